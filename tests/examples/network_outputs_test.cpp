// The decoders against tensors made backwards from known boxes.
#include "../../examples/detection/network_outputs.hpp"

#include <cstring>
#include <limits>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"

using namespace cfp_examples;

namespace {

const cv::Size input{320, 256};
constexpr int classes = 7;

cv::Mat tensor(std::initializer_list<int> shape, float value = 0) {
  return cv::Mat(static_cast<int>(shape.size()), std::vector<int>(shape).data(), CV_32F,
                 cv::Scalar(static_cast<double>(value)));
}

// The outputs of every family, all zero.
std::vector<cv::Mat> blank(NetworkFamily family) {
  const int cells = grid_cells(input, {8, 16, 32});
  switch (family) {
    case NetworkFamily::yolov5:
      return {tensor({1, 3 * cells, 5 + classes})};
    case NetworkFamily::yolov8:
      return {tensor({1, 4 + classes, cells})};
    case NetworkFamily::fastestdet:
      return {tensor({1, 5 + classes, 16, 20})};
  }
  return {};
}

Detections decode(NetworkFamily family, const std::vector<cv::Mat>& outputs, float min_score) {
  Detections found;
  switch (family) {
    case NetworkFamily::yolov5:
      decode_yolov5(outputs[0], min_score, found);
      break;
    case NetworkFamily::yolov8:
      decode_yolov8(outputs[0], min_score, found);
      break;
    case NetworkFamily::fastestdet:
      decode_fastestdet(outputs[0], input, min_score, found);
      break;
  }
  return found;
}

// Writes one box, centre and size, class and score where the family would have it.
void put(NetworkFamily family, std::vector<cv::Mat>& outputs, int at, const float (&box)[4], int id, float score) {
  const auto [cx, cy, w, h] = box;
  float* const data = outputs[0].ptr<float>();
  const int cols = outputs[0].size[outputs[0].dims - 1];
  const float W = 320, H = 256;
  switch (family) {
    case NetworkFamily::yolov5: {
      float* row = data + at * cols;
      std::copy(box, box + 4, row);
      row[4] = 0.9F;
      row[5 + id] = score / 0.9F;
      break;
    }
    case NetworkFamily::yolov8:
      for (int c = 0; c < 4; ++c) data[c * cols + at] = box[c];
      data[(4 + id) * cols + at] = score;
      break;
    case NetworkFamily::fastestdet: {
      const int x = static_cast<int>(cx / 16), y = static_cast<int>(cy / 16), cell = y * 20 + x;
      const auto logit = [](float p) { return std::log(p / (1 - p)); };
      const float values[] = {score, std::atanh(cx / 16 - static_cast<float>(x)),
                              std::atanh(cy / 16 - static_cast<float>(y)), logit(w / W), logit(h / H)};
      for (int c = 0; c < 5; ++c) data[c * 320 + cell] = values[c];
      data[(5 + id) * 320 + cell] = score;
      break;
    }
  }
}

const NetworkFamily families[] = {NetworkFamily::yolov5, NetworkFamily::yolov8, NetworkFamily::fastestdet};

}  // namespace

TEST_CASE("Every decoder gives back the boxes its tensor was made from", "[detector]") {
  for (const NetworkFamily family : families) {
    INFO(to_string(family));
    std::vector<cv::Mat> outputs = blank(family);
    const float first[4] = {100.5F, 90.25F, 61, 43}, second[4] = {250.75F, 200.5F, 30.5F, 77};
    put(family, outputs, 11, first, 0, 0.75F);
    put(family, outputs, 57, second, classes - 1, 0.5F);
    const Detections found = decode(family, outputs, 0.4F);
    REQUIRE(found.size() == 2);
    for (int i = 0; i < 2; ++i) {
      const auto& expected = i == 0 ? first : second;
      const auto& d = found[static_cast<std::size_t>(i)];
      CHECK(d.class_id == (i == 0 ? 0 : classes - 1));
      CHECK_THAT(d.score, WithinAbs(i == 0 ? 0.75 : 0.5, 1e-5));
      CHECK_THAT((d.box.x1 + d.box.x2) / 2, WithinAbs(expected[0], 1e-2));
      CHECK_THAT((d.box.y1 + d.box.y2) / 2, WithinAbs(expected[1], 1e-2));
      CHECK_THAT(d.box.width(), WithinAbs(expected[2], 1e-2));
      CHECK_THAT(d.box.height(), WithinAbs(expected[3], 1e-2));
    }
    CHECK(decode(family, outputs, 0.6F).size() == 1);
  }
}

TEST_CASE("A family is told from the shapes alone", "[detector]") {
  for (const NetworkFamily family : families) {
    INFO(to_string(family));
    const NetworkLayout layout = recognise(blank(family), input);
    CHECK(layout.family == family);
    CHECK(layout.classes == classes);
  }
  CHECK(recognise({tensor({1, 25200, 85})}, {640, 640}).family == NetworkFamily::yolov5);
  CHECK(recognise({tensor({1, 25200, 6})}, {640, 640}).classes == 1);
  CHECK(recognise({tensor({1, 84, 8400})}, {640, 640}).family == NetworkFamily::yolov8);
  CHECK(recognise({tensor({1, 84, 33600})}, {1280, 1280}).family == NetworkFamily::yolov8);
}

TEST_CASE("Outputs of another kind are refused with their shapes", "[detector]") {
  const std::vector<std::vector<cv::Mat>> others = {{},
                                                    {tensor({1, 300, 6})},
                                                    {tensor({1, 8400, 5})},
                                                    {tensor({1, 4, 8400})},
                                                    {tensor({1, 116, 8400}), tensor({1, 32, 160, 160})},
                                                    {tensor({2, 85, 20, 20})},
                                                    {tensor({1, 3, 80, 80, 85})},
                                                    {cv::Mat(8400, 84, CV_8U)}};
  for (const auto& outputs : others) {
    INFO(shapes_of(outputs));
    CHECK_THROWS_WITH(recognise(outputs, {640, 640}), Catch::Contains(shapes_of(outputs)));
  }
  CHECK_THROWS(recognise({tensor({300, 6}), tensor({300, 7})}, {320, 320}));
}

TEST_CASE("Garbage in a tensor yields nothing but proper boxes", "[detector]") {
  const float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  const float oddities[] = {nan, inf, -inf, 3e38F, -3e38F, 1e-42F, 0, 1, -1, 0.5F, 100};
  cfp::Random random(20261121);
  for (const NetworkFamily family : families) {
    for (int round = 0; round < 40; ++round) {
      std::vector<cv::Mat> outputs = blank(family);
      for (cv::Mat& output : outputs) {
        for (std::size_t i = 0; i < output.total(); ++i) {
          const std::uint64_t bits = random();
          const auto low = static_cast<std::uint32_t>(bits);
          float any = 0;
          std::memcpy(&any, &low, sizeof any);
          output.ptr<float>()[i] = round < 11               ? oddities[round]
                                   : (bits >> 32U) % 3 == 0 ? any
                                                            : oddities[(bits >> 34U) % 11];
        }
      }
      Detections found = decode(family, outputs, 0.3F);
      suppress(found, 0.5F);
      bool good = found.size() <= 1000;
      for (const auto& d : found)
        good = good && cfp::is_proper(d.box) && d.score >= 0.3F && cfp::is_finite(d.score) && d.class_id >= 0 &&
               d.class_id < classes;
      CHECK(good);
    }
  }
}

TEST_CASE("Suppression keeps the surest of what overlaps, within each class", "[detector]") {
  cfp::Random random(7);
  const auto uniform = [&](double low, double high) { return static_cast<float>(random.uniform(low, high)); };
  for (int round = 0; round < 50; ++round) {
    Detections all;
    for (int i = 0; i < 60; ++i) {
      const float x = uniform(0, 100), y = uniform(0, 100);
      all.push_back({{x, y, x + uniform(20, 60), y + uniform(20, 60)}, i % 2, uniform(0, 1)});
    }
    Detections kept = all;
    suppress(kept, 0.4F);
    for (const auto& d : all) {
      const auto same = [&](const auto& k) { return k.score == d.score && k.box.x1 == d.box.x1; };
      const bool is_kept = std::any_of(kept.begin(), kept.end(), same);
      const bool covered = std::any_of(kept.begin(), kept.end(), [&](const auto& k) {
        return !same(k) && k.class_id == d.class_id && k.score >= d.score && cfp::iou(k.box, d.box) > 0.4F;
      });
      CHECK(is_kept != covered);
    }
  }
}
