#include "cfp/interop/opencv_flow.hpp"

#include <limits>

#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "support/catch.hpp"

namespace {

// A smooth random texture.
cv::Mat texture() {
  cv::Mat image(300, 400, CV_8UC1);
  cv::RNG(11).fill(image, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(image, image, {0, 0}, 2);
  cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
  return image;
}

cv::Mat moved(const cv::Mat& image, double dx, double dy) {
  cv::Mat out;
  cv::warpAffine(image, out, cv::Matx23d(1, 0, dx, 0, 1, dy), image.size(), cv::INTER_CUBIC, cv::BORDER_REFLECT);
  return out;
}

std::vector<cv::KeyPoint> keypoints_of(const cv::Mat& image) {
  std::vector<cv::KeyPoint> keypoints;
  cv::ORB::create(2000)->detect(image, keypoints);
  return keypoints;
}

bool near(const cv::Point2f& a, const cv::Point2f& b, float distance) {
  return std::hypot(a.x - b.x, a.y - b.y) <= distance;
}

}  // namespace

TEST_CASE("Options of the flow outside their ranges are named", "[flow]") {
  using Options = cfp::OpticalFlowOptions;
  CHECK(!invalid_field(Options()));
  const auto refused = [](void (*set)(Options&)) {
    Options options;
    set(options);
    return invalid_field(options).string();
  };
  CHECK(refused([](Options& o) { o.corners = -1; }) == "corners");
  CHECK(refused([](Options& o) { o.corner_distance = -1; }) == "corner_distance");
  CHECK(refused([](Options& o) { o.corner_quality = 0; }) == "corner_quality");
  CHECK(refused([](Options& o) { o.corner_quality = 1; }) == "corner_quality");
  CHECK(refused([](Options& o) { o.room_share = 1.01; }) == "room_share");
  CHECK(refused([](Options& o) { o.room_share = std::numeric_limits<double>::quiet_NaN(); }) == "room_share");
  CHECK(refused([](Options& o) { o.keypoints_per_box = -1; }) == "keypoints_per_box");
  CHECK(refused([](Options& o) { o.keypoints_outside = -1; }) == "keypoints_outside");
  CHECK(refused([](Options& o) { o.window = 2; }) == "window");
  CHECK(refused([](Options& o) { o.levels = 0; }) == "levels");
  CHECK(refused([](Options& o) { o.iterations = 0; }) == "iterations");
  CHECK(refused([](Options& o) { o.precision = -1; }) == "precision");
  // The ends are used as they are.
  Options least;
  least.corners = least.keypoints_per_box = 0;
  least.corner_distance = least.precision = least.room_share = 0;
  least.window = 3;
  least.levels = least.iterations = 1;
  CHECK(!invalid_field(least));
  cfp::OpticalFlowTracker tracker(least);
  tracker.track(texture(), {}, {});
  tracker.track(moved(texture(), 1, 0), {}, {});
  CHECK(tracker.previous().empty());
}

TEST_CASE("Pairs follow the image, over several frames", "[flow]") {
  const cv::Mat image = texture();
  cfp::OpticalFlowTracker tracker;
  const cfp::Box<float> box{100, 80, 220, 240};
  tracker.track(image, {}, cfp::span<const cfp::Box<float>>());
  CHECK(tracker.previous().empty());
  cv::Mat before = image;
  for (int k = 1; k < 4; ++k) {
    const cv::Mat now = moved(image, 3.25 * k, -1.5 * k);
    tracker.track(now, keypoints_of(before), cfp::span<const cfp::Box<float>>(&box, 1));
    REQUIRE(tracker.previous().size() == tracker.current().size());
    std::size_t inside = 0, right = 0;
    for (std::size_t i = 0; i < tracker.previous().size(); ++i) {
      inside += cfp::contains(box, tracker.previous()[i].x, tracker.previous()[i].y) ? 1U : 0U;
      right += near(tracker.current()[i] - tracker.previous()[i], {3.25F, -1.5F}, 0.2F) ? 1U : 0U;
    }
    CHECK(inside >= 20);
    CHECK(tracker.previous().size() - inside >= 50);
    CHECK(right >= tracker.previous().size() * 9 / 10);
    before = now;
  }
}

TEST_CASE("The defaults of the flow", "[flow]") {
  const cfp::OpticalFlowOptions o;
  CHECK((o.corners == 500 && o.corner_distance == 6 && o.corner_quality == 0.01 && o.keypoints_per_box == 100));
  CHECK(o.room_share == 0.6);
  CHECK((o.keypoints_outside == 0 && o.window == 11 && o.levels == 4 && o.iterations == 20 && o.precision == 0.02));
}

TEST_CASE("No region gets more points than it may have", "[flow]") {
  const cv::Mat image = texture();
  const std::vector<cv::KeyPoint> keypoints = keypoints_of(image);
  const std::vector<cfp::Box<float>> boxes = {{10, 10, 150, 290}, {140, 100, 390, 200}, {-50, -50, 20, 20}};
  for (const int points : {0, 1, 7, 40}) {
    cfp::OpticalFlowOptions options;
    options.corners = 0;
    options.keypoints_per_box = points;
    options.keypoints_outside = 3 * points;
    cfp::OpticalFlowTracker tracker(options);
    tracker.track(image, {}, {});
    tracker.track(image, keypoints, cfp::span<const cfp::Box<float>>(boxes.data(), boxes.size()));
    std::vector<int> count(boxes.size() + 1, 0);
    for (const cv::Point2f& p : tracker.previous()) {
      std::size_t region = 0;
      while (region < boxes.size() && !cfp::contains(boxes[region], p.x, p.y)) ++region;
      ++count[region];
    }
    for (std::size_t region = 0; region < boxes.size(); ++region) CHECK(count[region] <= points);
    CHECK(count.back() <= 3 * points);
    options.keypoints_per_box = options.keypoints_outside = 0;
    options.corners = points;
    cfp::OpticalFlowTracker corners(options);
    corners.track(image, {}, {});
    corners.track(image, keypoints, {});
    CHECK(corners.previous().size() == static_cast<std::size_t>(points));
  }
}

TEST_CASE("The strongest keypoint of every cell of a box is followed, and nothing of frames before", "[flow]") {
  const cv::Mat image = texture();
  const cfp::Box<float> box{100, 30, 200, 270};
  cfp::OpticalFlowOptions options;
  options.corners = 0;
  options.keypoints_per_box = 15;  // cells of 40 px: 2 across, 6 down
  std::vector<cv::KeyPoint> keypoints, best(12);
  cv::RNG random(5);
  for (int k = 0; k < 400; ++k) {
    const float x = random.uniform(101.0F, 199.0F), y = random.uniform(31.0F, 269.0F);
    keypoints.emplace_back(x, y, 31.0F, -1.0F, random.uniform(0.0F, 1.0F));
    cv::KeyPoint& of_cell = best[static_cast<std::size_t>(2 * int((y - 30) / 40) + int((x - 100) / 50))];
    if (of_cell.response < keypoints.back().response) of_cell = keypoints.back();
  }
  cfp::OpticalFlowTracker tracker(options);
  tracker.track(image, {}, {});
  for (int repeat = 0; repeat < 3; ++repeat) {
    tracker.track(image, keypoints, cfp::span<const cfp::Box<float>>(&box, 1));
    std::vector<cv::Point2f> expected;
    for (const cv::KeyPoint& k : best) expected.push_back(k.pt);
    CHECK(tracker.previous() == expected);
  }
}

TEST_CASE("Corners keep their distance; without a pyramid they are found at full resolution", "[flow]") {
  const cv::Mat image = texture();
  for (const int levels : {1, 4}) {
    cfp::OpticalFlowOptions options;
    options.levels = levels;
    cfp::OpticalFlowTracker tracker(options);
    tracker.track(image, {}, {});
    tracker.track(image, {}, {});
    const auto& corners = tracker.previous();
    REQUIRE(corners.size() > 100);
    double smallest = 1e9;
    bool odd = false;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      odd = odd || static_cast<int>(corners[i].x) % 2 == 1;
      for (std::size_t j = 0; j < i; ++j) smallest = std::min(smallest, cv::norm(corners[i] - corners[j]));
    }
    CHECK((smallest >= 5.99 && smallest < 9));
    CHECK(odd == (levels == 1));
  }
}

TEST_CASE("Where the room is known it gets its share of the corners, however weak they are", "[flow]") {
  cv::Mat image = texture(), middle = cv::Mat(image.size(), CV_8U, cv::Scalar(255));
  const cv::Rect person(60, 0, 280, 300);
  middle(person) = 0;
  cv::Mat(0.4 * image).copyTo(image, middle);
  const auto corners = [&](const cv::Mat& room, int most) {
    cfp::OpticalFlowOptions options;
    options.corners = most;
    cfp::OpticalFlowTracker tracker(options);
    tracker.track(image, {}, {});
    tracker.track(image, {}, {}, room);
    return tracker.previous();
  };
  const auto outside = [&](const std::vector<cv::Point2f>& points) {
    return std::count_if(points.begin(), points.end(), [&](const auto& p) { return !person.contains(cv::Point(p)); });
  };
  const auto strongest = corners({}, 100), shared = corners(middle, 100);
  CHECK(outside(strongest) < 30);
  CHECK((shared.size() == 100 && outside(shared) == 60));
  // Where the room has too few, the others get what is left; a mask of another size is none.
  const auto all = corners({}, 5000);
  const int most = static_cast<int>(all.size()) - 20;
  CHECK((corners(middle, most).size() == all.size() - 20 && outside(corners(middle, most)) == outside(all)));
  CHECK(corners(middle(cv::Rect(0, 0, 200, 300)), 100) == strongest);
  CHECK(corners(cv::Mat(image.size(), CV_8U, cv::Scalar(0)), 100) == strongest);
}

TEST_CASE("Nothing to track, broken boxes and changed sizes make no pairs and no fuss", "[flow]") {
  const float inf = std::numeric_limits<float>::infinity(), nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<cfp::Box<float>> boxes = {{nan, 0, 1, 1},   {0, 0, inf, inf},   {5, 5, 4, 4},
                                              {-9, -9, -1, -1}, {1, 1, 1.5F, 1.5F}, {-1e30F, -1e30F, 1e30F, 1e30F}};
  const cfp::span<const cfp::Box<float>> view(boxes.data(), boxes.size());
  std::vector<cv::KeyPoint> odd = {{nan, 3, 1}, {inf, 3, 1}, {-5, 3, 1}, {3, 1e30F, 1}, {50, 50, 1}};
  const cv::Mat image = texture();
  cfp::OpticalFlowTracker tracker;
  tracker.track(cv::Mat(), odd, view);
  tracker.track(image, odd, view);
  CHECK(tracker.previous().empty());
  tracker.track(image, odd, view);
  for (const cv::Point2f& p : tracker.current()) CHECK((p.x >= 0 && p.x < 400 && p.y >= 0 && p.y < 300));
  tracker.track(image(cv::Rect(0, 0, 200, 100)).clone(), odd, view);
  CHECK(tracker.previous().empty());
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(20, 10), cv::Size(40, 30)}) {
    const cv::Mat flat(size, CV_8UC1, cv::Scalar(7));
    tracker.track(flat, odd, view);
    CHECK(tracker.previous().empty());
    tracker.track(flat, odd, view);
    CHECK(tracker.previous().size() == tracker.current().size());
  }
  tracker.track(image, odd, view);
  tracker.reset();
  tracker.track(image, keypoints_of(image), {});
  CHECK(tracker.previous().empty());
}

TEST_CASE("The caller's image may be overwritten between the calls", "[flow]") {
  const cv::Mat image = texture(), next = moved(image, 2, 1);
  // A part with room around it is what OpenCV would keep without a copy.
  const auto part = [](cv::Mat& buffer, const cv::Mat& content) {
    cv::Mat inner = buffer(cv::Rect(50, 50, 400, 300));
    content.copyTo(inner);
    return inner;
  };
  cv::Mat first = cv::Mat::zeros(400, 500, CV_8UC1), second = first.clone(), reused = first.clone();
  cfp::OpticalFlowTracker own, shared;
  own.track(part(first, image), {}, {});
  own.track(part(second, next), {}, {});
  shared.track(part(reused, image), {}, {});
  shared.track(part(reused, next), {}, {});
  REQUIRE(own.current().size() > 100);
  CHECK((own.previous() == shared.previous() && own.current() == shared.current()));
}

TEST_CASE("A part of a larger image gives the pairs of its copy", "[flow]") {
  const cv::Mat image = texture();
  const cv::Rect part(40, 30, 200, 150);
  cfp::OpticalFlowTracker of_part, of_copy;
  for (const double shift : {0.0, 2.5}) {
    cv::Mat whole(image.size(), CV_8UC1, cv::Scalar(shift > 0 ? 255 : 0));  // what lies around changes
    moved(image, shift, 0)(part).copyTo(whole(part));
    of_part.track(whole(part), {}, {});
    of_copy.track(whole(part).clone(), {}, {});
  }
  CHECK(of_part.previous().size() > 100);
  CHECK(of_part.previous() == of_copy.previous());
  CHECK(of_part.current() == of_copy.current());
}

TEST_CASE("An image of colours or of other depth is refused by name, and the next grey one is followed", "[flow]") {
  const cv::Mat image = texture();
  cfp::OpticalFlowTracker tracker;
  tracker.track(image, {}, {});
  for (const int type : {CV_8UC3, CV_16UC1, CV_32FC1}) {
    const cv::Mat other = cv::Mat::zeros(image.size(), type);
    CHECK_THROWS_AS(tracker.track(other, {}, {}), cv::Exception);
  }
  tracker.track(moved(image, 2, 1), {}, {});
  REQUIRE(tracker.current().size() > 100);
  const cv::Point2f shift = tracker.current()[0] - tracker.previous()[0];
  CHECK(near(shift, {2, 1}, 0.2F));
}
