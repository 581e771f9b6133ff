#include "../../examples/support/sequence.hpp"

#include <sys/stat.h>

#include <opencv2/imgcodecs.hpp>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"
#include "support/data.hpp"
#include "support/temporary_folder.hpp"

using namespace cfp_examples;
using cfp_test::error_of;
using cfp_test::TemporaryFolder;

namespace {

constexpr const char* camera_line = "50 50 16 12 32 24 5000\n";

std::string png(const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  cv::imencode(".png", image, bytes);
  return {bytes.begin(), bytes.end()};
}
std::string color_png(int value, cv::Size size = {32, 24}) {
  return png(cv::Mat(size, CV_8UC3, cv::Scalar::all(value)));
}
std::string depth_png(int value, cv::Size size = {32, 24}) {
  return png(cv::Mat(size, CV_16UC1, cv::Scalar::all(value)));
}

// Images 0 ... n - 1 at i / 10 s, depth 3 ms later; image i has value 10 i + 10, its depth 1000 i + 1000.
void write_recording(const TemporaryFolder& folder, int n) {
  std::string rgb = "# color\n", depth = "# depth\n";
  for (int i = 0; i < n; ++i) {
    const std::string name = std::to_string(i) + ".png";
    rgb += std::to_string(i / 10.0) + " rgb/" + name + "\n";
    depth += std::to_string(i / 10.0 + 0.003) + " depth/" + name + "\n";
    folder.write("rgb/" + name, color_png(10 * i + 10));
    folder.write("depth/" + name, depth_png(1000 * i + 1000));
  }
  folder.write("rgb.txt", rgb);
  folder.write("depth.txt", depth);
  folder.write("camera.txt", camera_line);
}

int value_of(const cv::Mat& image) {
  return image.empty() ? -1 : image.depth() == CV_16U ? image.at<std::uint16_t>(0) : image.at<unsigned char>(0);
}

bool same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && (a.empty() || cv::norm(a, b, cv::NORM_INF) == 0);
}

}  // namespace

TEST_CASE("A sound recording reads frame by frame, the same ahead or not", "[sequence]") {
  const TemporaryFolder folder;
  write_recording(folder, 6);
  const Sequence sequence(folder.path);
  CHECK(
      (sequence.size() == 6 && sequence.notes().empty() && sequence.truth().empty() && sequence.true_boxes(0).empty()));
  CHECK((sequence.calibration().fx == 50 && sequence.calibration().k1 == 0));
  PrefetchingReader reader(sequence);
  for (const std::size_t i : {0U, 1U, 2U, 4U, 3U, 4U, 5U, 5U, 0U}) {
    const SequenceFrame frame = reader.load(i), again = sequence.load(i);
    CHECK((frame.usable && frame.note.empty()));
    CHECK(value_of(frame.bgr) == 10 * static_cast<int>(i) + 10);
    CHECK(value_of(frame.depth) == 1000 * static_cast<int>(i) + 1000);
    CHECK_THAT(frame.time_s, WithinAbs(static_cast<double>(i) / 10, 1e-9));
    CHECK((same(frame.bgr, again.bgr) && same(frame.depth, again.depth) && frame.image == again.image));
  }
}

TEST_CASE("A frame that cannot be read is noted with file and line and costs no other frame", "[sequence]") {
  const TemporaryFolder folder;
  write_recording(folder, 14);
  const std::string good = color_png(1), good_depth = depth_png(1);
  std::filesystem::remove(folder.path / "rgb/1.png");
  folder.write("rgb/2.png", "no picture");
  folder.write("rgb/3.png", good.substr(0, good.size() / 2));
  folder.write("rgb/4.png", color_png(9, {31, 24}));
  folder.write("rgb/5.png", "");
  std::filesystem::remove(folder.path / "rgb/6.png");
  std::filesystem::create_directories(folder.path / "rgb/6.png");
  std::filesystem::remove(folder.path / "depth/7.png");
  folder.write("depth/8.png", depth_png(9, {32, 25}));
  folder.write("depth/9.png", png(cv::Mat(24, 32, CV_8UC1, cv::Scalar(9))));
  folder.write("depth/10.png", good_depth.substr(0, 40));
  std::string monstrous = good;
  for (const std::size_t at : {16U, 20U}) monstrous[at] = '\x7f';  // width and height of the header
  folder.write("rgb/11.png", monstrous);
  std::filesystem::remove(folder.path / "rgb/12.png");
  REQUIRE(::mkfifo((folder.path / "rgb/12.png").c_str(), 0600) == 0);
  const Sequence sequence(folder.path);
  REQUIRE(sequence.size() == 14);
  PrefetchingReader reader(sequence);
  for (std::size_t i = 0; i < 14; ++i) {
    const SequenceFrame frame = reader.load(i);
    INFO(frame.note);
    CHECK(frame.usable == (i == 0 || i == 13));
    CHECK(frame.note.empty() == frame.usable);
    const bool colour = i < 7 || i > 10;
    if (!frame.usable)
      CHECK(frame.note.find((colour ? "rgb.txt:" : "depth.txt:") + std::to_string(i + 2) + ": ") != std::string::npos);
    CHECK(frame.bgr.empty() == (colour && !frame.usable));
  }
}

TEST_CASE("Lists out of order, repeated stamps and images without a partner leave the others as they were",
          "[sequence]") {
  const TemporaryFolder folder;
  write_recording(folder, 6);
  folder.write(
      "rgb.txt",
      "0.3 rgb/3.png\n0.0 rgb/0.png\n\n0.1 rgb/1.png\n0.1 rgb/5.png\n0.2 rgb/2.png\n9e9 rgb/4.png\n-5 rgb/5.png\n");
  folder.write("depth.txt",
               "0.2199 depth/2.png\n0.003 depth/0.png\n0.004 depth/4.png\n0.1201 depth/1.png\n0.29 depth/3.png\n0.301 "
               "depth/5.png\n");
  const Sequence sequence(folder.path);
  REQUIRE(sequence.size() == 6);
  CHECK(sequence.notes().size() == 3);
  std::string notes;
  for (const std::string& note : sequence.notes()) notes += note + "\n";
  INFO(notes);
  CHECK(notes.find("rgb.txt:2: earlier") != std::string::npos);
  CHECK(notes.find("rgb.txt:5: a second line") != std::string::npos);
  CHECK(notes.find("depth.txt:2: earlier") != std::string::npos);
  const int colors[] = {60, 10, 20, 30, 40, 50}, depths[] = {-1, 1000, -1, 3000, 6000, -1};
  for (std::size_t i = 0; i < 6; ++i) {
    const SequenceFrame frame = sequence.load(i);
    CHECK(value_of(frame.bgr) == colors[i]);
    CHECK(value_of(frame.depth) == depths[i]);
    CHECK(frame.usable == (depths[i] > 0));
    if (!frame.usable) CHECK(frame.note.find("no depth image near its time") != std::string::npos);
  }
}

TEST_CASE("Colour and depth are matched as TUM's associate.py does", "[sequence]") {
  const TemporaryFolder folder;
  write_recording(folder, 1);
  cfp::Random random(20261121, "association");
  std::vector<double> colors, depths;
  std::string rgb, depth;
  for (int i = 0; i < 40; ++i) {
    for (const bool is_color : {true, false}) {
      const double t = std::round((i / 30.0 + random.uniform(-0.015, 0.015)) * 1e6) / 1e6;
      (is_color ? colors : depths).push_back(t);
      (is_color ? rgb : depth) += cv::format("%.6f %s/0.png\n", t, is_color ? "rgb" : "depth");
    }
  }
  folder.write("rgb.txt", rgb);
  folder.write("depth.txt", depth);
  std::vector<std::tuple<double, double, double>> pairs;  // difference, colour, depth: the script's own greedy loop
  for (const double c : colors) {
    for (const double d : depths) {
      if (std::abs(c - d) < 0.02) pairs.emplace_back(std::abs(c - d), c, d);
    }
  }
  std::sort(pairs.begin(), pairs.end());
  std::vector<double> matched;
  for (const auto& [difference, c, d] : pairs) {
    const auto colour = std::find(colors.begin(), colors.end(), c);
    const auto partner = std::find(depths.begin(), depths.end(), d);
    if (colour == colors.end() || partner == depths.end()) continue;
    matched.push_back(c);
    colors.erase(colour);
    depths.erase(partner);
  }
  std::sort(matched.begin(), matched.end());
  const Sequence sequence(folder.path);
  std::vector<double> found;
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    if (sequence.load(i).usable) found.push_back(sequence.time_s(i));
  }
  CHECK(found == matched);
  CHECK(found.size() > 20);
}

TEST_CASE("What cannot be parsed refuses the recording with file and line", "[sequence]") {
  const auto refused = [](const char* file, const std::string& content, const std::string& word) {
    const TemporaryFolder folder;
    write_recording(folder, 3);
    folder.write(file, content);
    const std::string error = error_of([&] { (void)Sequence(folder.path); });
    INFO(file << ": " << error);
    CHECK(error.find(word) != std::string::npos);
    CHECK(error.find(file) != std::string::npos);
  };
  refused("rgb.txt", "# c\n0.0 rgb/0.png\n0.1\n", "rgb.txt:3: ");
  refused("rgb.txt", "0.0 rgb/0.png\nx rgb/1.png\n", "rgb.txt:2: ");
  refused("rgb.txt", "0.0 rgb/0.png\nnan rgb/1.png\n", "rgb.txt:2: ");
  refused("rgb.txt", "0.0 rgb/0.png\ninf rgb/1.png\n", "rgb.txt:2: ");
  refused("rgb.txt", "", "no image");
  refused("rgb.txt", "0.0 absent.png\n", "no image");
  refused("depth.txt", "0.0 a b c\n", "depth.txt:1: ");
  refused("camera.txt", "50 50 16 12 32 24\n", "camera.txt:1: ");
  refused("camera.txt", "50 50 16 12 32.5 24 5000\n", "camera.txt:1: ");
  refused("camera.txt", "50 nan 16 12 32 24 5000\n", "camera.txt:1: ");
  refused("camera.txt", "50 50 16 12 32 24 5000 0 0 0 0\n", "camera.txt:1: ");
  refused("camera.txt", "50 50 16 12 32 24 5000 fisheye 0 0 0\n", "camera.txt:1: ");
  refused("camera.txt", "50 50 16 12 32 24 5000 fisheye 0 0 0 x\n", "camera.txt:1: ");
  refused("camera.txt", "50 50 16 12 32 24 5000 fish 0 0 0 0\n", "camera.txt:1: ");
  refused("camera.txt", "# k1 k2 p1 p2 k3 = 1 2 3\n50 50 16 12 32 24 5000\n", "camera.txt:1: ");
  refused("groundtruth.txt", "0 0 0 0 0 0 0\n", "groundtruth.txt:1: ");
  refused("boxes.txt", "0 1 2 3 4 5 1\n", "boxes.txt:1: ");
  refused("boxes.txt", "0 1e20 2 3 4 5 1 9\n", "boxes.txt:1: ");
  refused("labels.txt", "0\n", "labels.txt:1: ");
  CHECK(error_of([] { (void)Sequence("/nowhere/rgbd_dataset_freiburg3_walking_xyz"); }).find("rgb.txt") !=
        std::string::npos);
  CHECK(error_of([] { (void)Sequence("/nowhere/mine"); }).find("no camera.txt") != std::string::npos);
}

TEST_CASE("A camera is told from camera.txt with its distortion, or from the folder's name", "[sequence]") {
  const TemporaryFolder folder;
  const auto distortion = [](const cfp_examples::TumCamera& c) {
    return std::vector<double>{c.k1, c.k2, c.p1, c.p2, c.k3};
  };
  const std::vector<double> fr1{0.2624, -0.9531, -0.0054, 0.0026, 1.1633};
  const std::string line = "517.3 516.5 318.6 255.3 640 480 5000";
  const auto read = [&](const std::string& text) {
    return distortion(cfp_examples::read_tum_camera(folder.write("camera.txt", text)));
  };
  CHECK(read(line + " 0.2624 -0.9531 -0.0054 0.0026 1.1633\n") == fr1);
  CHECK(read("# (distorted images, k1 k2 p1 p2 k3 = 0.2624 -0.9531 -0.0054 0.0026 1.1633)\n" + line + "\n") == fr1);
  CHECK(read("# undistorted\n" + line + "\n") == std::vector<double>(5, 0));
  CHECK(distortion(cfp_examples::published_tum_camera("/data/rgbd_dataset_freiburg1_desk/")) == fr1);
  CHECK(cfp_examples::published_tum_camera("tum_fr2_desk").fx == 520.9);
  CHECK(cfp_examples::published_tum_camera("/data/rgbd_dataset_freiburg3_walking_xyz").fx == 535.4);
  CHECK(!cfp_examples::published_tum_camera("fr3").distorted());

  const auto model = [&](const std::string& text) {
    return cfp_examples::read_tum_camera(folder.write("camera.txt", text)).camera().model;
  };
  CHECK(std::holds_alternative<cfp::PinholeCamera<double>>(model(line)));
  CHECK(std::get<cfp::RadialTangentialCamera<double>>(model(line + " 0 0 0 0 0.5")).k3 == 0.5);
  const auto fisheye = std::get<cfp::KannalaBrandtCamera<double>>(model(line + " fisheye 0.1 0.2 0.3 0.4"));
  CHECK((fisheye.fx == 517.3 && fisheye.cy == 255.3 && fisheye.k1 == 0.1 && fisheye.k2 == 0.2 && fisheye.k3 == 0.3 &&
         fisheye.k4 == 0.4));
}

TEST_CASE("Labels, true boxes and truth come with the frames they belong to", "[sequence]") {
  const TemporaryFolder folder;
  write_recording(folder, 3);
  folder.write("labels/1.png", png(cv::Mat(24, 32, CV_8UC1, cv::Scalar(2))));
  folder.write("labels.txt", "0.0 labels/0.png\n0.1 labels/1.png\n0.25 labels/1.png\n");
  folder.write("boxes.txt", "0.2 7 1 2 3 4 0.5 6\n0.1 1 1 2 3 4 1 4\n0.1 2 5 6 7 8 1 4\n");
  folder.write("pseudo_groundtruth.txt", "0.1 1 2 3 0 0 0 1\n");
  const Sequence sequence(folder.path);
  CHECK((sequence.truth().size() == 1 && sequence.truth_file() == "pseudo_groundtruth.txt"));
  std::string note;
  CHECK((sequence.load_labels(0, note).empty() && sequence.load(0).usable));
  CHECK(note.find("labels.txt:1: ") != std::string::npos);
  note.clear();
  CHECK(value_of(sequence.load_labels(1, note)) == 2);
  CHECK((sequence.load_labels(2, note).empty() && note.empty()));
  CHECK((sequence.true_boxes(0).empty() && sequence.true_boxes(1).size() == 2 && sequence.true_boxes(2).size() == 1));
  CHECK((sequence.true_boxes(2)[0].identity == 7 && sequence.true_boxes(2)[0].box.y2 == 4));
}

TEST_CASE("Real recordings open whole", "[sequence]") {
  CFP_REQUIRE_DATA(walking, "tum_fr3_walking_halfsphere_30");
  CFP_REQUIRE_DATA(desk, "tum_fr1_desk_9");
  const Sequence a(walking), b(desk);
  CHECK((a.size() == 30 && a.notes().empty() && a.truth().size() == 29 && !a.calibration().distorted()));
  CHECK(
      (b.size() == 9 && b.notes().size() == 1 && b.calibration().k3 == 1.1633 && b.truth_file() == "groundtruth.txt"));
  for (const Sequence* sequence : {&a, &b}) {
    for (std::size_t i = 0; i < sequence->size(); i += 4) CHECK(sequence->load(i).usable);
  }
}
