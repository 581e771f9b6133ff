// Keypoints of people in a room without images: the room, the people and the cameras of examples/synthetic, seen by a
// sensor that is simulated point by point. For studies of what follows from keypoints, depths, flow and boxes.
//
// 640 x 480 at 30 Hz. Points of the room and of the people's surfaces, hidden where a surface is before them, are found
// in 80 % of the frames with 0.8 px at the finest of eight levels and 1.2 times more at each coarser one; 2 % are up to
// 15 px off. Depth as of structured light; 6 % of the people's points have the depth of what is behind. Flow: 0.15 px,
// 3 % up to 5 px off. The detector's boxes shake by 1.8 % of their size and miss bursts of 1 to 6 frames.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "../../examples/synthetic/camera_motion.hpp"
#include "../../examples/synthetic/people.hpp"
#include "cfp/core/random.hpp"
#include "cfp/detection/box_tracker_types.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/depth_noise.hpp"

namespace cfp_study {

using Eigen::Vector3d;

/// What the two people do.
enum class Acting {
  walking,  ///< as in examples/synthetic
  sitting,  ///< seated; arms, heads and bodies move now and then
  rising,   ///< seated at rest; one of them gets up in the middle and walks
  resting   ///< seated, nothing moves
};
inline constexpr std::array<const char*, 4> acting_names{"walking", "sitting", "rising", "resting"};

enum class PointLabel : unsigned char { room, moving, still_part };

struct SeenPoint {
  std::size_t id;  ///< of the point in the world
  PointLabel label;
  double sigma_px;
};

/// One frame as a host has it, and the truth.
struct SeenFrame {
  double time_s = 0;
  cfp::SE3<double> T_world_cam;
  std::vector<SeenPoint> points;
  std::vector<std::array<double, 2>> pixels;
  std::vector<double> depths;
  std::vector<std::int32_t> match;  ///< in the frame before
  std::vector<std::array<double, 2>> flow_from, flow_to;
  std::vector<double> flow_depths;
  std::vector<cfp::Detection<double>> detections;
};

class PeopleScene {
 public:
  static constexpr double rate_hz = 30;
  const cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};

  PeopleScene(Acting acting, synthetic::Motion motion, double seconds, std::uint64_t seed)
      : motion_(motion, seed), room_(synthetic::SceneBuilder(seed).build({})), random_(seed, "people scene") {
    for (int person = 0; person < 2; ++person) {
      cfp::Random random(seed, person == 0 ? "first person" : "second person");
      scripts_[static_cast<std::size_t>(person)] = script(acting, random, person, seconds);
    }
    for (int i = 0; i < 1800; ++i) add_room_point(seconds);
    for (std::size_t person = 0; person < 2; ++person) {
      for (int i = 0; i < 300; ++i) add_person_point(person);
    }
  }

  /// The frames in order, each from the one before.
  std::vector<SeenFrame> record(int frames) {
    std::vector<SeenFrame> all;
    for (int k = 0; k < frames; ++k) all.push_back(see(k / rate_hz, all.empty() ? nullptr : &all.back()));
    return all;
  }

 private:
  struct Point {
    int person;         ///< -1: of the room
    std::size_t part;   ///< of the person
    Vector3d position;  ///< in the world, or in its part's frame
    int level;
  };

  static synthetic::Script script(Acting acting, cfp::Random& random, int person, double seconds) {
    const synthetic::Stage stage;
    if (acting == Acting::walking) return synthetic::walking_script(random, person, seconds, stage);
    if (acting == Acting::sitting) return synthetic::sitting_script(random, person, seconds, stage);
    synthetic::Director d = synthetic::seated(person, stage, 1);
    if (acting == Acting::resting || person == 1) return d.finish();
    d.wait(seconds / 2);
    d.sit(0);
    d.turn(-2.2, 1.0);
    for (bool left = false; d.now() < seconds; left = !left) d.walk((left ? -1 : 1) * 0.9, -1.8, 0.9);
    return d.finish();
  }

  [[nodiscard]] std::vector<synthetic::Surface> surfaces(double time) const {
    std::vector<synthetic::Surface> all = room_.surfaces;
    for (int person = 0; person < 2; ++person)
      synthetic::append_person(room_, scripts_[static_cast<std::size_t>(person)], person, time, 1 / rate_hz, all);
    return all;
  }
  /// The nearest hit on the way from `origin`, as a multiple of `ray`.
  static double first_hit(cfp::span<const synthetic::Surface> surfaces, const Vector3d& origin, const Vector3d& ray) {
    double nearest = synthetic::infinity;
    for (const synthetic::Surface& s : surfaces)
      nearest = std::min(nearest, synthetic::hit(s, s.A * (origin - s.centre), s.A * ray).depth);
    return nearest;
  }
  [[nodiscard]] Vector3d ray_at(const cfp::Vector2<double>& pixel, const cfp::SE3<double>& T_world_cam) const {
    Vector3d ray = Vector3d::UnitZ();
    static_cast<void>(camera.unproject(pixel, ray));
    return T_world_cam.rotation * ray;
  }

  void add_room_point(double seconds) {
    const cfp::SE3<double> T = motion_(random_.uniform(0, seconds));
    const Vector3d ray = ray_at({random_.uniform(0, 640), random_.uniform(0, 480)}, T);
    const double depth = first_hit(room_.surfaces, T.translation, ray);
    if (depth < 8) points_.push_back({-1, 0, T.translation + depth * ray, level()});
  }
  void add_person_point(std::size_t person) {
    const std::vector<synthetic::Surface> all = surfaces(0);
    const std::size_t part = random_.index(static_cast<std::uint32_t>(synthetic::parts.size()));
    const synthetic::Surface& s = all[room_.surfaces.size() + person * synthetic::parts.size() + part];
    const double angle = random_.uniform(0, 2 * cfp::pi<double>), z = random_.uniform(-1, 1), r = s.half.x();
    const double ring = std::sqrt(1 - z * z) * r;  // of the round ends, drawn apart over the length
    const Vector3d local =
        random_.uniform() * s.half.z() > 0.3 * r
            ? Vector3d(r * std::cos(angle), r * std::sin(angle), z * s.half.z())
            : Vector3d(ring * std::cos(angle), ring * std::sin(angle), z * r + (z > 0 ? 1 : -1) * s.half.z());
    points_.push_back({static_cast<int>(person), part, local, level()});
  }
  int level() { return static_cast<int>(8 * random_.uniform() * random_.uniform()); }

  SeenFrame see(double time, const SeenFrame* before) {
    SeenFrame frame;
    frame.time_s = time;
    frame.T_world_cam = motion_(time);
    const cfp::SE3<double> T_cam_world = frame.T_world_cam.inverse();
    const Vector3d eye = frame.T_world_cam.translation;
    const std::vector<synthetic::Surface> all = surfaces(time);
    const cfp::span<const synthetic::Surface> room(all.data(), room_.surfaces.size());
    std::vector<cfp::Vector2<double>> exact(points_.size(), {-1, -1});
    std::array<cfp::Box<double>, 2> outline;
    std::array<int, 2> seen{};
    outline.fill({1e9, 1e9, -1e9, -1e9});
    for (std::size_t id = 0; id < points_.size(); ++id) {
      const Point& point = points_[id];
      Vector3d X = point.position;
      PointLabel label = PointLabel::room;
      if (point.person >= 0) {
        const auto& s =
            all[room_.surfaces.size() + static_cast<std::size_t>(point.person) * synthetic::parts.size() + point.part];
        X = s.A.inverse() * point.position + s.centre;
        const double step = (X - s.inverse_before * point.position - s.moved).norm();
        label = step > 0.05 / rate_hz ? PointLabel::moving : PointLabel::still_part;
      }
      cfp::Vector2<double> p;
      const Vector3d in_camera = T_cam_world * X;
      if (!camera.project(in_camera, p)) continue;
      exact[id] = p;
      if (!(p.x() > 10 && p.y() > 10 && p.x() < 629 && p.y() < 469)) continue;
      if (first_hit(all, eye, X - eye) < 0.99) continue;
      if (point.person >= 0) {
        const auto who = static_cast<std::size_t>(point.person);
        ++seen[who];
        outline[who] = {std::min(outline[who].x1, p.x()), std::min(outline[who].y1, p.y()),
                        std::max(outline[who].x2, p.x()), std::max(outline[who].y2, p.y())};
      }
      if (random_.uniform() > 0.8) continue;
      const double sigma = 0.8 * std::pow(1.2, point.level), off = random_.uniform() < 0.02 ? 15 : 0;
      const double behind = first_hit(room, eye, X - eye) * in_camera.z();
      const bool wrong = point.person >= 0 && behind < 8 && random_.uniform() < 0.06;
      const double z = wrong ? behind : in_camera.z();
      frame.points.push_back({id, label, std::pow(1.2, point.level)});
      frame.pixels.push_back({p.x() + sigma * random_.normal() + off * random_.uniform(-1, 1),
                              p.y() + sigma * random_.normal() + off * random_.uniform(-1, 1)});
      frame.depths.push_back(z < 7 ? z + noise_.sigma_m(z) * random_.normal() : -1);
    }
    if (before != nullptr) follow(*before, exact, frame);
    detect(seen, outline, frame);
    return frame;
  }

  /// Matches and flow from the frame before.
  void follow(const SeenFrame& before, const std::vector<cfp::Vector2<double>>& exact, SeenFrame& frame) {
    std::vector<std::int32_t> index(points_.size(), -1);
    const cfp::SE3<double> T = before.T_world_cam.inverse();
    for (std::size_t j = 0; j < before.points.size(); ++j) {
      const std::size_t id = before.points[j].id;
      index[id] = static_cast<std::int32_t>(j);
      if (exact[id].x() < 5 || exact[id].y() < 5 || exact[id].x() > 634 || exact[id].y() > 474) continue;
      cfp::Vector2<double> there;
      const bool off = random_.uniform() < 0.03;
      if (!camera.project(T * where(id, before.time_s), there)) continue;
      const cfp::Vector2<double> step = exact[id] - there;
      const auto noise = [&] { return 0.15 * random_.normal() + (off ? random_.uniform(-5, 5) : 0); };
      frame.flow_from.push_back(before.pixels[j]);
      frame.flow_to.push_back({before.pixels[j][0] + step.x() + noise(), before.pixels[j][1] + step.y() + noise()});
      frame.flow_depths.push_back(before.depths[j]);
    }
    for (const SeenPoint& point : frame.points) frame.match.push_back(index[point.id]);
  }
  [[nodiscard]] Vector3d where(std::size_t id, double time) {
    const Point& point = points_[id];
    if (point.person < 0) return point.position;
    if (time != surfaces_time_) {
      surfaces_then_ = surfaces(time);
      surfaces_time_ = time;
    }
    const auto& s = surfaces_then_[room_.surfaces.size() +
                                   static_cast<std::size_t>(point.person) * synthetic::parts.size() + point.part];
    return s.A.inverse() * point.position + s.centre;
  }

  void detect(const std::array<int, 2>& seen, const std::array<cfp::Box<double>, 2>& outline, SeenFrame& frame) {
    for (std::size_t who = 0; who < 2; ++who) {
      if (missing_[who] == 0 && random_.uniform() < 0.02) missing_[who] = 1 + static_cast<int>(random_.index(6));
      if (missing_[who] > 0) --missing_[who];
      if (missing_[who] > 0 || seen[who] < 20) continue;
      cfp::Box<double> box = outline[who];
      const double w = 0.018 * box.width(), h = 0.018 * box.height();
      box = {box.x1 - 4 + w * random_.normal(), box.y1 - 4 + h * random_.normal(), box.x2 + 4 + w * random_.normal(),
             box.y2 + 4 + h * random_.normal()};
      frame.detections.push_back({box, 0, 0.8});
    }
  }

  synthetic::CameraMotion motion_;
  synthetic::Scene room_;
  std::array<synthetic::Script, 2> scripts_;
  std::vector<Point> points_;
  std::array<int, 2> missing_{};
  std::vector<synthetic::Surface> surfaces_then_;
  double surfaces_time_ = -1;
  cfp::DepthNoise noise_;
  cfp::Random random_;
};

}  // namespace cfp_study
