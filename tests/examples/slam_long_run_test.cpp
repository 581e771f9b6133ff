// What a robot's day does to the loop: a camera over a wall, small images so that there can be many, and all that goes
// wrong with them. CFP_LONG_RUN_FRAMES=1000000 makes a day of it and prints what grows.
#include <cmath>
#include <cstdlib>
#include <limits>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "../../examples/slam/loop/run.hpp"
#include "cfp/core/random.hpp"
#include "support/catch.hpp"

using namespace cfp_slam;

namespace {

constexpr int width = 160, height = 120;

/// The frames, each made from its number and what came before.
class Wall {
 public:
  explicit Wall(std::uint64_t seed) : random_(seed), texture_(480, 640, CV_8UC3) {
    cv::RNG(seed).fill(texture_, cv::RNG::UNIFORM, 0, 255);
    cv::resize(texture_, texture_, {}, 4, 4, cv::INTER_CUBIC);
    cv::resize(texture_, texture_, {800, 600}, 0, 0, cv::INTER_AREA);
    cv::GaussianBlur(texture_, texture_, {5, 5}, 1.2);
    cv::normalize(texture_, texture_, 0, 255, cv::NORM_MINMAX);
  }
  cfp_examples::SequenceFrame next() {
    const bool jumps = random_.uniform() < 0.002;
    phase_ += jumps ? random_.uniform(0, 100) : 0.003;
    time_s_ += jumps ? random_.uniform(-1, 5) : 1.0 / 30;
    if (hidden_ > 0) --hidden_;
    if (random_.uniform() < 0.002) hidden_ = random_.index(90);
    const int x = static_cast<int>(320 + 300 * std::sin(phase_)),
              y = static_cast<int>(240 + 230 * std::sin(0.7 * phase_));
    cfp_examples::SequenceFrame frame;
    frame.time_s = random_.uniform() < 1e-4 ? std::numeric_limits<double>::quiet_NaN() : time_s_;
    frame.usable = true;
    frame.bgr = texture_(cv::Rect(x, y, width, height)).clone();
    frame.depth = cv::Mat(height, width, CV_16UC1, cv::Scalar(5000 * 0.6));
    if (hidden_ > 0) cv::randu(frame.bgr, 0, 255);
    if (random_.uniform() < 0.01) frame.depth = cv::Scalar(0);
    return frame;
  }

 private:
  cfp::Random random_;
  cv::Mat texture_;
  double phase_ = 0, time_s_ = 0;
  std::size_t hidden_ = 0;
};

/// Boxes that come, go and now and then are nonsense.
class Passers final : public cfp_examples::Detector {
 public:
  Passers() : Detector("passers", {"person"}) {}
  cfp_examples::Detections detect(const cv::Mat&, double) override {
    cfp_examples::Detections found;
    if (++frame_ % 7 == 0) return found;
    const auto x = static_cast<float>(frame_ * 2 % width), w = static_cast<float>(random_.uniform(20, 50));
    if (frame_ / 300 % 2 == 0) found.push_back({{x, 10, x + w, 110}, 0, 0.9F});
    if (random_.uniform() < 0.01) found.push_back({{0, 0, width, height}, 0, 0.9F});
    return found;
  }

 private:
  cfp::Random random_{5};
  std::size_t frame_ = 0;
};

class Watcher final : public Observer {
 public:
  std::size_t poses = 0, frames = 0, points = 0, largest_keyframes = 0, worlds = 0;
  std::int64_t newest = 0;
  bool finite = true;

  void decided(const cfp::StaticProbability<Camera>&, const Frame& frame, const Map& map) override {
    finite = finite && (!frame.has_pose || frame.T_cam_world.translation.allFinite());
    points = map.alive_points();
    largest_keyframes = std::max(largest_keyframes, map.alive_keyframes.size());
    worlds = static_cast<std::size_t>(map.newest_world()) + 1;
  }
  void finished(const FrameRecord& record) override {
    ++frames;
    poses += record.outcome == Outcome::tracked || record.outcome == Outcome::relocalised ? 1 : 0;
    for (const BoxRecord& box : record.boxes) newest = std::max(newest, box.id);
    if (frames % 10000 == 0)
      WARN(frames << " frames: " << poses << " poses, " << worlds << " maps begun, " << points << " points, at most "
                  << largest_keyframes << " keyframes, newest box " << newest);
  }
};

}  // namespace

TEST_CASE("A long run over a wall with everything that goes wrong: each frame is answered, the way found again",
          "[slam]") {
  const char* const asked = std::getenv("CFP_LONG_RUN_FRAMES");
  const std::size_t frames = asked != nullptr ? std::strtoul(asked, nullptr, 10) : 1500;
  Wall wall(3);
  FrameSource source;
  source.calibration.fx = source.calibration.fy = 150;
  source.calibration.cx = (width - 1) / 2.0, source.calibration.cy = (height - 1) / 2.0;
  source.calibration.width = width, source.calibration.height = height;
  source.camera = {150, 150, source.calibration.cx, source.calibration.cy};
  source.size = frames;
  source.load = [&](std::size_t) { return wall.next(); };
  Options options;
  options.threads = false;
  options.features.count = 300;
  options.min_initial_points = 60;
  if (asked == nullptr) options.mapping.max_keyframes = 20;
  Passers passers;
  Watcher watcher;
  const RunResult result = run_slam(source, passers, options, watcher);
  CHECK(watcher.frames == frames);
  CHECK(watcher.finite);
  CHECK(watcher.poses > frames / 2);
  CHECK(watcher.largest_keyframes <= options.mapping.max_keyframes);  // a loss begins a map; the old ones stay or go
  CHECK(result.trajectory.size() > frames / 2);
  for (const auto& pose : result.trajectory) REQUIRE(pose.T_world_cam.translation.allFinite());
}
