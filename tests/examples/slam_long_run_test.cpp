// What a robot's day does to the loop: images of a wall, few but all the way through, then a room of points straight
// into the tracking, where a frame costs so little that there can be many, and all that goes wrong with either.
// CFP_LONG_RUN_FRAMES=1000000 makes a day of the second and prints what grows.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <limits>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "../../examples/slam/loop/run.hpp"
#include "../../examples/slam/loop/tracking.hpp"
#include "cfp/core/random.hpp"
#include "support/catch.hpp"

using namespace cfp_slam;

namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

/// Frames of a wall, each made from its number and what came before.
class Wall {
 public:
  static constexpr int width = 160, height = 120;

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
    frame.time_s = random_.uniform() < 1e-4 ? not_a_number : time_s_;
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
    const auto x = static_cast<float>(frame_ * 2 % Wall::width), w = static_cast<float>(random_.uniform(20, 50));
    if (frame_ / 300 % 2 == 0) found.push_back({{x, 10, x + w, 110}, 0, 0.9F});
    if (random_.uniform() < 0.01) found.push_back({{0, 0, Wall::width, Wall::height}, 0, 0.9F});
    return found;
  }

 private:
  cfp::Random random_{5};
  std::size_t frame_ = 0;
};

/// Something that every camera knows again: a corner of the room, or of somebody who walks in it.
struct Corner {
  cfp::Vector3<double> position;  // in the room, or from the middle of its owner
  Descriptor descriptor{};
  double farthest_m = 0;  // from where it is seen at level 0 of the pyramid
  double angle = 0, swing = 0;
  std::size_t seen_in = 0;  // the last frame that could see it, where, and at what depth
  cfp::Vector2<double> pixel;
  double depth_m = -1;
};

struct Walker {
  std::vector<Corner> corners;
  cfp::Vector3<double> half;  // of its box
  std::array<double, 4> path{};
  double clock_s = 0;
  bool here = false, walks = false;
};

/// A room of 8 x 3 x 6 m full of corners, people in it whom a detector knows and a trolley that it does not, a camera
/// that wanders, is carried away, covered up and set to another time.
class Room {
 public:
  static constexpr int width = 640, height = 480;

  // The view must be of source().
  Room(std::uint64_t seed, const View& view) : random_(seed), view_(view) {
    for (int i = 0; i < 8000; ++i) {
      const cfp::Vector3<double> inside{random_.uniform(-1, 1), random_.uniform(-1, 1), random_.uniform(-1, 1)};
      const cfp::Vector3<double> wall = inside / inside.cwiseAbs().maxCoeff();
      corners_.push_back(corner(wall.cwiseProduct(cfp::Vector3<double>(4, 1.5, 3)) *
                                (random_.uniform() < 0.3 ? random_.uniform(0.8, 1) : 1)));
      if (random_.uniform() < 0.03)
        corners_.back().descriptor = corners_[random_.index(std::uint32_t(i) + 1)].descriptor;
    }
    for (Walker& w : walkers_) {
      const bool is_trolley = &w == &walkers_.back();
      w.half = is_trolley ? cfp::Vector3<double>{0.3, 0.4, 0.3} : cfp::Vector3<double>{0.25, 0.85, 0.15};
      for (int i = 0; i < (is_trolley ? 40 : 90); ++i) {
        const cfp::Vector3<double> inside{random_.uniform(-1, 1), random_.uniform(-1, 1), random_.uniform(-1, 1)};
        w.corners.push_back(corner(w.half.cwiseProduct(inside)));
        w.corners.back().swing = is_trolley ? 0 : random_.uniform(0, 0.06);
      }
    }
  }

  FrontEndResult next() {
    ++number_;
    const double dt = happen();
    move(dt);
    FrontEndResult result;
    Frame& frame = result.frame;
    frame.time_s = random_.uniform() < 2e-4 ? not_a_number : time_s_;
    boxes_.clear();
    nearest_.clear();
    for (Walker& w : walkers_) {
      if (w.here) look_at(w, result);
    }
    for (Corner& c : corners_) look_at(c, c.position, nearest_.size(), result);
    if (covered_ > 0) cover(result);
    if (no_depth_ > 0 || random_.uniform() < 0.01) std::fill(frame.depths_m.begin(), frame.depths_m.end(), -1.0F);
    if (random_.uniform() > 0.05) result.detections = detections();
    frame.static_probability.assign(frame.size(), 1.0F);
    frame.map_point_probability.assign(frame.size(), -1.0F);
    frame.map_point.assign(frame.size(), no_point);
    return result;
  }
  static FrameSource source() {
    FrameSource source;
    source.calibration = {525, 525, (width - 1) / 2.0, (height - 1) / 2.0, width, height};
    return source;
  }
  [[nodiscard]] const cfp::SE3<double>& T_cam_room() const { return T_cam_room_; }

 private:
  Corner corner(const cfp::Vector3<double>& position) {
    Corner c;
    c.position = position;
    for (auto& byte : c.descriptor) byte = static_cast<std::uint8_t>(random_());
    c.farthest_m = 1.5 / (1 - random_.uniform());  // the finer, the more there are
    c.angle = random_.uniform(0, 360);
    return c;
  }

  // What goes wrong from this frame on, after ten seconds without. Returns how much time goes by in the room.
  double happen() {
    double dt = 1.0 / 30;
    if (number_ < 300) {
      time_s_ += dt;
      return dt;
    }
    for (std::size_t* const left : {&covered_, &no_depth_, &silent_, &stuck_}) *left -= *left > 0 ? 1 : 0;
    if (random_.uniform() < 0.002) covered_ = random_.index(90), cover_ = random_.index(3);
    if (random_.uniform() < 0.0005) no_depth_ = random_.index(90);
    if (random_.uniform() < 0.001) silent_ = random_.index(90);
    if (random_.uniform() < 0.0005) stuck_ = random_.index(60);
    if (random_.uniform() < 0.002) dt = random_.uniform(0.1, 4);
    time_s_ += random_.uniform() < 0.001 ? 0 : dt;
    if (random_.uniform() < 0.001) time_s_ += random_.uniform(-1, 1);
    if (random_.uniform() < 1e-4) time_s_ += random_.uniform(-1e5, 1e5);
    if (random_.uniform() < 0.001) phase_s_ += random_.uniform(0, 100);
    return dt;
  }

  void move(double dt) {
    phase_s_ += dt;
    const double s = phase_s_;
    const cfp::Vector3<double> centre{2.2 * std::sin(0.21 * s), 0.3 * std::sin(0.33 * s), 1.4 * std::sin(0.17 * s + 1)};
    const cfp::Matrix3<double> R_room_cam = cfp::so3_exp<double>({0, 0.2 * s + 0.8 * std::sin(0.4 * s), 0}) *
                                            cfp::so3_exp<double>({0.25 * std::sin(0.5 * s), 0, 0}) *
                                            cfp::so3_exp<double>({0, 0, 0.15 * std::sin(0.37 * s)});
    T_cam_room_ = cfp::SE3<double>{R_room_cam, centre}.inverse();
    for (Walker& w : walkers_) {
      if (random_.uniform() < 0.002) {
        w.here = !w.here;
        for (double& p : w.path) p = random_.uniform(0.1, 0.4);
      }
      if (random_.uniform() < 0.01) w.walks = random_.uniform() < 0.7;
      if (w.walks) w.clock_s += dt;
    }
  }

  void look_at(Walker& w, FrontEndResult& result) {
    const cfp::Vector3<double> middle{3.3 * std::sin(w.path[0] * w.clock_s + 9 * w.path[1]), 1.5 - w.half.y(),
                                      2.3 * std::sin(w.path[2] * w.clock_s + 9 * w.path[3])};
    const double depth = (T_cam_room_ * middle).z();
    if (depth < 0.7) return;
    cfp::Box<float> box{1e9F, 1e9F, -1e9F, -1e9F};
    const std::size_t nearer = nearest_.size();
    for (Corner& c : w.corners) {
      const cfp::Vector3<double> at =
          middle + c.position + cfp::Vector3<double>::Constant(c.swing * std::sin(7 * w.clock_s + c.angle));
      cfp::Vector2<double> pixel;
      if (!view_.exact.project(T_cam_room_ * at, pixel)) continue;
      box = {std::min(box.x1, float(pixel.x())), std::min(box.y1, float(pixel.y())), std::max(box.x2, float(pixel.x())),
             std::max(box.y2, float(pixel.y()))};
      look_at(c, at, nearer, result);
    }
    box = {std::max(box.x1, 0.0F), std::max(box.y1, 0.0F), std::min(box.x2, float(width)),
           std::min(box.y2, float(height))};
    if (!(box.x1 < box.x2 && box.y1 < box.y2)) return;
    nearest_.push_back({box, depth});
    if (&w != &walkers_.back()) boxes_.push_back(box);
  }

  // Only the first so many of nearest_ can hide it.
  void look_at(Corner& c, const cfp::Vector3<double>& at, std::size_t nearer, FrontEndResult& result) {
    const cfp::Vector3<double> in_camera = T_cam_room_ * at;
    cfp::Vector2<double> pixel;
    if (in_camera.z() < 0.3 || !view_.sees(in_camera, pixel)) return;
    const double distance = in_camera.norm();
    const long level = std::lround(std::log(c.farthest_m / distance) / std::log(double(view_.scales[1])));
    if (level < 0 || level >= long(view_.scales.size())) return;
    for (std::size_t n = 0; n < nearer; ++n) {
      const auto& [box, depth] = nearest_[n];
      if (depth < in_camera.z() && cfp::contains(box, float(pixel.x()), float(pixel.y()))) return;
    }
    const bool followed = c.seen_in + 1 == number_ && random_.uniform() < 0.9;
    if (followed) {
      const bool wrong = random_.uniform() < 0.03;
      result.flow.from.push_back(noisy(c.pixel, 0.1));
      result.flow.to.push_back(noisy(pixel, wrong ? 5 : 0.1));
      result.flow.depths_m.push_back(float(c.depth_m));
    }
    c.depth_m = measured(in_camera.z());
    c.seen_in = number_;
    c.pixel = pixel;
    for (long l = level; l < long(view_.scales.size()) && l < level + 2; ++l) {
      if (random_.uniform() < (l == level ? 0.85 : 0.15)) add(c, pixel, int(l), float(c.depth_m), result.frame);
    }
  }
  cv::Point2f noisy(const cfp::Vector2<double>& pixel, double sigma) {
    return {float(pixel.x() + sigma * random_.normal()), float(pixel.y() + sigma * random_.normal())};
  }
  double measured(double z) {
    const double luck = random_.uniform();
    return luck < 0.05 || z > 8 ? -1 : luck < 0.07 ? random_.uniform(0.5, 8) : z + noise_.sigma_m(z) * random_.normal();
  }
  void add(const Corner& c, const cfp::Vector2<double>& pixel, int level, float depth_m, Frame& frame) {
    const float scale = view_.scales[std::size_t(level)];
    const cv::Point2f seen = noisy(pixel, 0.5 * double(scale));
    frame.keypoints.emplace_back(seen, 31 * scale, float(std::fmod(c.angle + 5 * random_.normal() + 720, 360)), 1.0F,
                                 level);
    frame.pixels.push_back({seen.x, seen.y});
    frame.depths_m.push_back(depth_m);
    frame.descriptors.push_back(c.descriptor);
    for (std::uint32_t flips = random_.index(20); flips > 0; --flips) {
      const std::uint32_t bit = random_.index(256);
      frame.descriptors.back()[bit / 8] ^= static_cast<std::uint8_t>(1U << bit % 8);
    }
  }

  // Noise, a few corners of it, or nothing at all.
  void cover(FrontEndResult& result) {
    result = {};
    result.frame.time_s = time_s_;
    for (std::uint32_t n = cover_ == 0 ? 200 : cover_ == 1 ? random_.index(30) : 0; n > 0; --n) {
      const Corner noise = corner({});
      const cfp::Vector2<double> pixel{random_.uniform(0, width), random_.uniform(0, height)};
      const int level = int(random_.index(8));
      add(noise, pixel, level, float(random_.uniform(0.5, 6)), result.frame);
    }
  }

  cfp_examples::Detections detections() {
    if (stuck_ > 0) return last_;
    last_.clear();
    if (silent_ > 0) return last_;
    for (const cfp::Box<float>& b : boxes_) {
      if (random_.uniform() < 0.9)
        last_.push_back({{b.x1 + float(3 * random_.normal()), b.y1, b.x2 + 1, b.y2 + 1}, 0, 0.9F});
    }
    const double luck = random_.uniform();
    if (luck < 0.01) last_.push_back({{0, 0, width, height}, 0, 0.9F});
    if (luck > 0.99) last_.push_back({{-1e5F, 50, 1e5F, 1e5F}, 0, 0.9F});
    if (luck > 0.995) last_.push_back({{float(not_a_number), 0, 100, 100}, 0, 0.9F});
    return last_;
  }

  cfp::Random random_;
  View view_;
  cfp::DepthNoise noise_;
  std::vector<Corner> corners_;
  std::array<Walker, 4> walkers_;  // the last one is the trolley
  std::vector<std::pair<cfp::Box<float>, double>> nearest_;
  std::vector<cfp::Box<float>> boxes_;
  cfp_examples::Detections last_;
  cfp::SE3<double> T_cam_room_;
  double phase_s_ = 0, time_s_ = 0;
  std::size_t number_ = 1, covered_ = 0, no_depth_ = 0, silent_ = 0, stuck_ = 0;
  std::uint32_t cover_ = 0;
};

class Watcher : public Observer {
 public:
  std::size_t frames = 0, poses = 0, maps = 0, points = 0, keyframes = 0, largest_keyframes = 0;
  std::int64_t newest = -1;
  bool finite = true, ids_grow = true;

  void weighted(const cfp::StageResult<float>& result, const cfp::FrameState<float>& state, const Frame&) override {
    if (result.report.stage != cfp::Stage::coarse) return;
    const std::int64_t newest_before = newest;
    for (const auto& box : state.boxes) {
      const auto [last, is_new] = seen_in_.try_emplace(box.id, frames);
      ids_grow = ids_grow && (is_new ? box.id > newest_before : frames - last->second <= longest_unseen);
      last->second = frames;
      newest = std::max(newest, box.id);
    }
  }
  void decided(const cfp::StaticProbability<Camera>&, const Frame& frame, const Map& map) override {
    finite = finite && (!frame.has_pose || frame.T_cam_world.translation.allFinite());
    points = map.alive_points();
    keyframes = map.alive_keyframes.size();
    largest_keyframes = std::max(largest_keyframes, keyframes);
  }
  void finished(const FrameRecord& record) override {
    ++frames;
    poses += record.outcome <= Outcome::relocalised ? 1 : 0;
    maps += record.keyframe && (maps == 0 || record.note.find("new map") != std::string::npos) ? 1 : 0;
  }

 private:
  static constexpr std::size_t longest_unseen = 40;        // frames after which a number is not given again
  std::unordered_map<std::int64_t, std::size_t> seen_in_;  // the last frame of each number
};

/// Compares what is called tracked with where the camera is. A pose from the map alone says where the room is by the
/// keyframe that it sees; a hundred tracked frames later the room may be elsewhere by a little, but not suddenly: the
/// loop closes no loops, and its maps drift. So does a pose from a part of the map that is older than that: where the
/// camera comes back to it, the two parts may lie apart by what has been drifted in between.
class Judge final : public Watcher {
 public:
  std::size_t tracked = 0, wrong = 0, wrong_in_a_row = 0, longest_wrong = 0;

  explicit Judge(const Room& room) : room_(room) {}
  void decided(const cfp::StaticProbability<Camera>& probability, const Frame& frame, const Map& map) override {
    Watcher::decided(probability, frame, map);
    map_ = &map;
    T_cam_map_ = frame.T_cam_world;
    reference_ = -1;
    for (const int p : frame.map_point) {
      if (map.is_alive(p)) reference_ = map.point(p).observations.back().keyframe;
    }
    if (reference_ < 0) return;
    const Keyframe& keyframe = map.keyframe(reference_);
    T_room_map_by_keyframe_ = made_.at(std::size_t(reference_)).T_room_keyframe * keyframe.frame.T_cam_world;
    if (keyframe.world != world_) T_room_map_ = T_room_map_by_keyframe_;
    world_ = keyframe.world;
  }
  void finished(const FrameRecord& record) override {
    Watcher::finished(record);
    if (record.keyframe) {
      made_.resize(map_->keyframes.size());
      made_.back() = {room_.T_cam_room().inverse(), frames};
    }
    if (record.outcome != Outcome::tracked) wrong_in_a_row = 0;
    if (record.outcome > Outcome::relocalised || reference_ < 0) return;
    const bool from_old_part =
        made_[std::size_t(reference_)].frame + drifts_in < frames && error_m(T_room_map_by_keyframe_) < 0.03;
    if (record.outcome == Outcome::relocalised || from_old_part) T_room_map_ = T_room_map_by_keyframe_;
    const bool is_wrong = error_m(T_room_map_) > 0.1;
    if (!is_wrong) {
      const cfp::SE3<double> T_room_map_now = room_.T_cam_room().inverse() * T_cam_map_;
      T_room_map_ = T_room_map_ * cfp::se3_exp<double>(0.01 * cfp::se3_log(T_room_map_.inverse() * T_room_map_now));
    }
    if (record.outcome != Outcome::tracked) return;
    ++tracked;
    wrong += is_wrong ? 1 : 0;
    wrong_in_a_row = is_wrong ? wrong_in_a_row + 1 : 0;
    longest_wrong = std::max(longest_wrong, wrong_in_a_row);
  }

 private:
  static constexpr std::size_t drifts_in = 300;  // frames

  struct Made {
    cfp::SE3<double> T_room_keyframe;
    std::size_t frame = 0;
  };

  [[nodiscard]] double error_m(const cfp::SE3<double>& T_room_map) const {
    return (room_.T_cam_room() * T_room_map * T_cam_map_.inverse()).translation.norm();
  }

  const Room& room_;
  const Map* map_ = nullptr;
  int reference_ = -1, world_ = -1;  // of this frame
  cfp::SE3<double> T_cam_map_, T_room_map_, T_room_map_by_keyframe_;
  std::vector<Made> made_;  // of each keyframe
};

double resident_mib() {
  std::ifstream statm("/proc/self/statm");
  double size = 0, resident = 0;
  return statm >> size >> resident ? resident * 4096 / (1 << 20) : 0;
}

}  // namespace

TEST_CASE("A long run over a wall with everything that goes wrong: each frame is answered, the way found again",
          "[slam]") {
  constexpr std::size_t frames = 1000;
  Wall wall(3);
  FrameSource source;
  source.calibration = {150, 150, (Wall::width - 1) / 2.0, (Wall::height - 1) / 2.0, Wall::width, Wall::height};
  source.size = frames;
  source.load = [&](std::size_t) { return wall.next(); };
  Options options;
  options.threads = false;
  options.features.count = 300;
  options.min_initial_points = 60;
  options.max_keyframes = 20;
  Passers passers;
  Watcher watcher;
  const RunResult result = run_slam(source, passers, options, watcher);
  CHECK(watcher.frames == frames);
  CHECK(watcher.finite);
  CHECK(watcher.poses > frames / 2);
  CHECK(watcher.largest_keyframes <= options.max_keyframes);  // a loss begins a map; the old ones stay or go
  CHECK(result.trajectory.size() > frames / 2);
  for (const auto& pose : result.trajectory) REQUIRE(pose.T_world_cam.translation.allFinite());
}

TEST_CASE("A day in a room where all goes wrong: each frame is answered, and what is called tracked is right",
          "[slam]") {
  const char* const asked = std::getenv("CFP_LONG_RUN_FRAMES");
  const std::size_t frames = asked != nullptr ? std::strtoul(asked, nullptr, 10) : 4000;
  Options chosen;
  chosen.threads = false;
  if (asked == nullptr) chosen.max_keyframes = 40;
  const FrameSource source = Room::source();
  const Options options = fitted(chosen, source, Passers());
  const View view = view_of(source, options);
  Room room(1, view);
  Judge judge(room);
  Tracking tracking(source.calibration.camera().cast<float>(), view, options, judge);
  std::vector<double> times_ms;
  for (std::size_t k = 1; k <= frames; ++k) {
    FrontEndResult seen = room.next();
    FrameRecord record;
    record.time_s = seen.frame.time_s;
    const std::clock_t start = std::clock();  // of the processor: other programs do not count
    tracking.track(std::move(seen), record);
    times_ms.push_back(1e3 * double(std::clock() - start) / CLOCKS_PER_SEC);
    judge.finished(record);
    if (asked == nullptr || k % (frames / 20) != 0) continue;
    std::sort(times_ms.begin(), times_ms.end());
    std::printf("| %zu | %zu | %zu | %zu | %zu | %zu | %zu | %zu | %lld | %.0f | %.2f | %.2f |\n", k, judge.poses,
                judge.tracked, judge.wrong, judge.longest_wrong, judge.maps, judge.keyframes, judge.points,
                static_cast<long long>(judge.newest), resident_mib(), times_ms[times_ms.size() / 2],
                times_ms[times_ms.size() * 95 / 100]);
    std::fflush(stdout);
    times_ms.clear();
  }
  const RunResult result = tracking.finish();
  CHECK(judge.finite);
  CHECK(judge.ids_grow);
  CHECK(judge.frames == frames);
  CHECK(judge.tracked > frames / 2);
  CHECK(judge.longest_wrong <= 5);
  CHECK(judge.largest_keyframes <= options.max_keyframes);
  CHECK(result.trajectory.size() > frames / 2);
  for (const auto& pose : result.trajectory) REQUIRE(pose.T_world_cam.translation.allFinite());
}

TEST_CASE("A clock that is set back while the camera is lost puts no new map off", "[slam]") {
  const FrameSource source = Room::source();
  const Options options = fitted({}, source, Passers());
  const View view = view_of(source, options);
  Watcher watcher;
  Tracking tracking(source.calibration.camera().cast<float>(), view, options, watcher);
  Room room(1, view), other_room(2, view);
  FrameRecord record;
  for (int k = 0; k < 160; ++k) {
    FrontEndResult seen = k < 100 ? room.next() : other_room.next();
    seen.frame.time_s = k / 30.0 - (k < 110 ? 0 : 3600);
    record = {};
    tracking.track(std::move(seen), record);
    watcher.finished(record);
    if (k >= 100 && k < 120) CHECK(record.outcome == Outcome::lost);
  }
  CHECK(watcher.maps == 2);
  CHECK(record.outcome == Outcome::relocalised);
}
