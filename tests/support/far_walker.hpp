// Somebody far away before a stereo camera: what cfp makes of him over four seconds. The room is 140 points 3 to 30 m
// away; a detector boxes the person with a jitter of 3 %. Pose exact, M learned as a host would.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/frame/static_probability.hpp"
#include "support/moving_flow.hpp"

namespace cfp_test {

struct FarWalkerOptions {
  double rate_hz = 20, noise_px = 0.3, baseline_m = 0.11;
  double distance_m = 10;  // at the start
  double across_m_s = 0, away_m_s = 0;
  double camera_m_s = 0;    // ahead
  std::size_t points = 20;  // on the person
};

struct FarWalkerOutcome {
  double background = 0;    // share of the person's keypoints that depth took for the wall
  double above_half = 0;    // share of them with a weight above 1/2 after the first second
  double object_known = 0;  // share of the frames
  double room_below = 0;    // share of the room's keypoints with a weight below 0.1
};

class FarWalker {
 public:
  FarWalker(const FarWalkerOptions& options, std::uint64_t seed)
      : options_(options),
        stereo_{camera.fx, options.baseline_m, 1.414 * options.noise_px},
        random_(seed, "far walker") {
    for (std::size_t i = 0; i < options.points; ++i)
      points_.push_back({{random_.uniform(-0.2, 0.2), random_.uniform(-0.8, 0.8), 0}, true, {}, -1, -1});
  }

  FarWalkerOutcome run(cfp::FrameOptions options) {
    options.tracker.image_width = width, options.tracker.image_height = height;
    options.coarse.flow.motion.distance.depth_noise = stereo_.depth_noise();
    cfp::StaticProbability<cfp::PinholeCamera<float>> probability(camera.cast<float>(), options);
    FarWalkerOutcome sums;
    double person = 0, later = 0, room = 0, frames = 0;
    cfp::Vector3<double> place(0.5, 0, options_.distance_m);
    const double dt = 1 / options_.rate_hz;
    for (double time_s = 0; time_s < 4; time_s += dt, ++frames) {
      observe(place);
      cfp::Frame<float> frame;
      frame.timestamp_s = time_s;
      frame.keypoints = pixels_, frame.depths = depths_, frame.flow = {from_, to_}, frame.map_point_probability = m_;
      const std::array<cfp::Detection<float>, 1> detections{detect(place)};
      frame.detections = detections;
      const auto coarse = probability.coarse(frame);
      const auto& state = probability.state();
      for (std::size_t i = 0; i < pixels_.size(); ++i) {
        const bool on_person = points_[seen_[i]].on_person;
        room += on_person ? 0 : 1, person += on_person ? 1 : 0;
        sums.room_below += !on_person && coarse.weight[i] < 0.1F ? 1 : 0;
        sums.background += on_person && state.label[i] == cfp::KeypointLabel::background ? 1 : 0;
        later += on_person && time_s > 1 ? 1 : 0;
        sums.above_half += on_person && time_s > 1 && coarse.weight[i] > 0.5F ? 1 : 0;
      }
      sums.object_known += state.report.unknown_objects == 0 ? 1 : 0;
      const cfp::SE3<double> moved{cfp::Matrix3<double>::Identity(), {0, 0, -options_.camera_m_s * dt}};
      if (time_s > 0) (void)probability.fine({moved, 100}, match_, m_);
      for (std::size_t i = 0; i < pixels_.size(); ++i)
        points_[seen_[i]].m =
            m_[i] < 0 ? probability.static_probability(i, -1.0F) : probability.updated_map_point(i, m_[i]);
      place += dt * cfp::Vector3<double>(options_.across_m_s, 0, options_.away_m_s - options_.camera_m_s);
      for (Point& point : points_) point.place.z() -= point.on_person ? 0 : options_.camera_m_s * dt;
    }
    return {sums.background / person, sums.above_half / later, sums.object_known / frames, sums.room_below / room};
  }

 private:
  static constexpr double width = 752, height = 480;
  static constexpr cfp::PinholeCamera<double> camera{460, 460, width / 2, height / 2};

  struct Point {
    cfp::Vector3<double> place;  // of the person: from his middle
    bool on_person;
    std::array<float, 2> last;
    std::int32_t index;  // among the keypoints of the frame before, -1: not seen there
    float m;
  };

  // Fills the arrays of a frame; points that leave the image are lost, and new ones of the room come in.
  void observe(const cfp::Vector3<double>& place) {
    pixels_.clear(), depths_.clear(), from_.clear(), to_.clear(), m_.clear(), match_.clear(), seen_.clear();
    while (points_.size() < 140 + options_.points) {
      const double z = random_.uniform(3, 30), x = random_.uniform(-0.8, 0.8), y = random_.uniform(-0.5, 0.5);
      points_.push_back({{x * z, y * z, z}, false, {}, -1, -1});
    }
    std::vector<Point> kept;
    for (Point point : points_) {
      const cfp::Vector3<double> x = point.on_person ? cfp::Vector3<double>(place + point.place) : point.place;
      cfp::Vector2<double> u(0, 0);
      const bool seen =
          x.z() > 1 && camera.project(x, u) && u.x() >= 0 && u.y() >= 0 && u.x() < width && u.y() < height;
      if (!seen && !point.on_person) continue;
      if (seen) {
        u += options_.noise_px * cfp::Vector2<double>{random_.normal(), random_.normal()};
        const std::array<float, 2> pixel{float(u.x()), float(u.y())};
        const double disparity_m = stereo_.focal_px * stereo_.baseline_m;
        const double disparity = disparity_m / x.z() + stereo_.disparity_noise_px * random_.normal();
        if (point.index >= 0) from_.push_back(point.last), to_.push_back(pixel);
        match_.push_back(point.index), m_.push_back(point.m), seen_.push_back(kept.size());
        point.index = static_cast<std::int32_t>(pixels_.size()), point.last = pixel;
        pixels_.push_back(pixel);
        depths_.push_back(disparity > 0 ? float(disparity_m / disparity) : 0.0F);
      } else {
        point.index = -1, point.m = -1;
      }
      kept.push_back(point);
    }
    points_.swap(kept);
  }

  cfp::Detection<float> detect(const cfp::Vector3<double>& place) {
    const double u = camera.cx + camera.fx * place.x() / place.z();
    const double w = camera.fx * 0.5 / place.z(), h = camera.fy * 1.7 / place.z();
    const auto side = [&](double middle, double half, double size) {
      return float(middle + half * size + 0.03 * size * random_.normal());
    };
    return {{side(u, -0.5, w), side(camera.cy, -0.5, h), side(u, 0.5, w), side(camera.cy, 0.5, h)}, 0, 1};
  }

  FarWalkerOptions options_;
  Stereo stereo_;
  cfp::Random random_;
  std::vector<Point> points_;
  std::vector<std::array<float, 2>> pixels_, from_, to_;
  std::vector<float> depths_, m_;
  std::vector<std::int32_t> match_;
  std::vector<std::size_t> seen_;
};

/// The means over scenes of several seeds.
inline FarWalkerOutcome mean_of_far_walkers(const FarWalkerOptions& walker, const cfp::FrameOptions& options,
                                            int scenes) {
  FarWalkerOutcome mean;
  for (int seed = 1; seed <= scenes; ++seed) {
    const FarWalkerOutcome one = FarWalker(walker, static_cast<std::uint64_t>(seed)).run(options);
    mean.background += one.background / scenes, mean.above_half += one.above_half / scenes;
    mean.object_known += one.object_known / scenes, mean.room_below += one.room_below / scenes;
  }
  return mean;
}

}  // namespace cfp_test
