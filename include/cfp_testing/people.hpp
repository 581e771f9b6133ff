/// @file people.hpp
/// Two frames of a room with people in it, as arrays: what a SLAM front end would hand to cfp, with the truth beside
/// it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/geometry/box.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/math/se3.hpp"

namespace cfp_testing {

struct DynamicSceneOptions {
  std::size_t wall_points = 700;  ///< static keypoints, 3.5 to 5 m away, over the whole image
  std::size_t people = 2;         ///< standing at 1.8 to 2.6 m
  std::size_t points_per_person = 120;
  double person_motion_m = 0.06;  ///< sideways between the two frames; 0: they stand still
  double pixel_noise_px = 0.5;
  double depth_noise_m = 0.01;
  double translation_m = 0.03;  ///< of the camera
  double rotation_rad = 0.01;
  double match_share = 0.9;  ///< keypoints with a match in the previous frame
};

template <typename Scalar>
struct DynamicScene {
  cfp::PinholeCamera<Scalar> camera{Scalar(535.4), Scalar(539.2), Scalar(320.1), Scalar(247.6)};
  cfp::SE3<double> T_cur_prev;
  std::vector<std::array<Scalar, 2>> keypoints, previous_keypoints;  ///< element i of both is the same point
  std::vector<Scalar> depths, previous_depths;
  std::vector<std::int32_t> match;
  std::vector<char> is_static, is_person;  ///< truth per keypoint
  std::vector<cfp::Box<Scalar>> boxes;     ///< of the people, current frame
};

template <typename Scalar>
DynamicScene<Scalar> make_dynamic_scene(const DynamicSceneOptions& options, std::uint64_t seed) {
  cfp::Random random(seed, "dynamic scene");
  DynamicScene<Scalar> scene;
  const cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};
  cfp::Vector6<double> motion;
  const double heading = random.uniform(0, 2 * cfp::pi<double>);
  motion << options.translation_m * std::cos(heading), options.translation_m * std::sin(heading) * 0.5,
      options.translation_m * 0.3, options.rotation_rad * random.normal(), options.rotation_rad * random.normal(),
      0.3 * options.rotation_rad * random.normal();
  scene.T_cur_prev = cfp::se3_exp(motion);
  const cfp::SE3<double> T_prev_cur = scene.T_cur_prev.inverse();

  const auto add = [&](const cfp::Vector3<double>& current, const cfp::Vector3<double>& shift, bool person) {
    const cfp::Vector3<double> previous = T_prev_cur * (current - shift);
    cfp::Vector2<double> u, v;
    if (!camera.project(current, u) || !camera.project(previous, v)) return false;
    const auto noisy = [&](const cfp::Vector2<double>& p) {
      return std::array<Scalar, 2>{static_cast<Scalar>(p.x() + options.pixel_noise_px * random.normal()),
                                   static_cast<Scalar>(p.y() + options.pixel_noise_px * random.normal())};
    };
    scene.keypoints.push_back(noisy(u));
    scene.previous_keypoints.push_back(noisy(v));
    scene.depths.push_back(static_cast<Scalar>(current.z() + options.depth_noise_m * random.normal()));
    scene.previous_depths.push_back(static_cast<Scalar>(previous.z() + options.depth_noise_m * random.normal()));
    scene.match.push_back(random.uniform() < options.match_share ? static_cast<std::int32_t>(scene.match.size()) : -1);
    scene.is_static.push_back(!person || options.person_motion_m == 0 ? 1 : 0);
    scene.is_person.push_back(person ? 1 : 0);
    return true;
  };

  for (std::size_t person = 0; person < options.people; ++person) {
    const double depth = random.uniform(1.8, 2.6);
    const double centre = (static_cast<double>(person) + 0.5) / static_cast<double>(options.people) * 1.6 - 0.8;
    const cfp::Vector3<double> shift(random.uniform() < 0.5 ? options.person_motion_m : -options.person_motion_m,
                                     0.3 * options.person_motion_m, 0);
    double x1 = 1e9, y1 = 1e9, x2 = -1e9, y2 = -1e9;
    for (std::size_t i = 0; i < options.points_per_person; ++i) {
      // An ellipse that fills about half of its box; the depth varies as a body's does.
      const double angle = random.uniform(0, 2 * cfp::pi<double>), radius = std::sqrt(random.uniform());
      const cfp::Vector3<double> p(depth * 0.35 * centre + 0.22 * radius * std::cos(angle),
                                   0.55 * radius * std::sin(angle), depth + random.uniform(-0.12, 0.12));
      if (!add(p, shift, true)) continue;
      const auto& pixel = scene.keypoints.back();
      x1 = (std::min)(x1, static_cast<double>(pixel[0]));
      y1 = (std::min)(y1, static_cast<double>(pixel[1]));
      x2 = (std::max)(x2, static_cast<double>(pixel[0]));
      y2 = (std::max)(y2, static_cast<double>(pixel[1]));
    }
    scene.boxes.push_back({static_cast<Scalar>(x1 - 2), static_cast<Scalar>(y1 - 2), static_cast<Scalar>(x2 + 2),
                           static_cast<Scalar>(y2 + 2)});
  }
  for (std::size_t i = 0; i < options.wall_points; ++i) {
    cfp::Vector3<double> ray;
    (void)camera.unproject(cfp::Vector2<double>(random.uniform(5, 635), random.uniform(5, 475)), ray);
    add(ray * random.uniform(3.5, 5.0), cfp::Vector3<double>::Zero(), false);
  }
  return scene;
}

}  // namespace cfp_testing
