// Articulated people: a skeleton driven by a script, dressed in capsules. A person is a pure function of time, so
// frames can be rendered in any order and by any thread.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Geometry>

#include "surfaces.hpp"
#include "tracks.hpp"

namespace synthetic {

// clang-format off
enum Joint {
  pelvis, chest, neck, crown,
  hip_left, hip_right, knee_left, knee_right, ankle_left, ankle_right, toe_left, toe_right,
  shoulder_left, shoulder_right, elbow_left, elbow_right, wrist_left, wrist_right, finger_left, finger_right,
  joints
};
// clang-format on

/// Joints in the world and the directions that fix the parts' twist.
struct Skeleton {
  std::array<Vector3d, joints> at;
  Vector3d right, head_right;
};

inline Skeleton skeleton_at(const Script& script, double time) {
  const double size = script.height / 1.78;
  const double heading = script.heading(time), sit = script.sit(time), lean = script.lean(time);
  const Vector3d up = Vector3d::UnitZ(), forward(std::cos(heading), std::sin(heading), 0);
  const Vector3d right = forward.cross(up);
  const auto in_plane = [&](double angle) -> Vector3d {
    return std::sin(angle) * forward - std::cos(angle) * up;
  };  // 0 = down

  // Gait: one cycle per 1.35 m; its strength follows the speed, so that starting and stopping look natural.
  const double speed = (script.distance(time + 0.05) - script.distance(time - 0.05)) / 0.1;
  const double gait = std::min(1.0, std::max(0.0, speed) / 0.9);
  const double phase = 2 * cfp::pi<double> * script.distance(time) / (1.35 * size) + script.gait_offset;

  Skeleton s;
  s.right = right;
  const double thigh = 0.43 * size, shin = 0.42 * size, sole = 0.075 * size;
  double reach = 0;
  for (int side = 0; side < 2; ++side) {
    const double p = phase + side * cfp::pi<double>;
    const double hip = 0.42 * gait * std::sin(p) + sit * (1.45 - 0.42 * gait * std::sin(p));
    const double bend = gait * (0.12 + 0.85 * std::max(0.0, std::cos(p)));
    const double knee = 0.04 + bend + sit * (1.42 - bend);
    const Vector3d hip_at = (side == 0 ? -0.095 : 0.095) * size * right;
    const auto offset = [](Joint left, int is_right) {
      return static_cast<std::size_t>(left) + static_cast<std::size_t>(is_right);
    };
    s.at[offset(hip_left, side)] = hip_at;
    s.at[offset(knee_left, side)] = hip_at + thigh * in_plane(hip) + (side == 0 ? -0.05 : 0.05) * sit * right;
    s.at[offset(ankle_left, side)] = s.at[offset(knee_left, side)] + shin * in_plane(hip - knee);
    s.at[offset(toe_left, side)] = s.at[offset(ankle_left, side)] + 0.17 * size * in_plane(hip - knee + 1.5);
    reach = std::max(reach, -s.at[offset(ankle_left, side)].z());
  }
  const double twist = 0.12 * gait * std::sin(phase);
  const Vector3d torso = std::cos(lean + 0.05 * gait) * up + std::sin(lean + 0.05 * gait) * forward;
  const Vector3d across = std::cos(twist) * right + std::sin(twist) * forward;
  s.at[pelvis] = Vector3d::Zero();
  s.at[chest] = 0.47 * size * torso;
  s.at[neck] = 0.55 * size * torso;
  s.at[crown] = s.at[neck] + 0.23 * size * (torso + 0.25 * up).normalized();
  const double yaw = script.head_yaw(time);
  s.head_right = std::cos(yaw) * right + std::sin(yaw) * forward;
  for (int side = 0; side < 2; ++side) {
    const double outward = side == 0 ? -1 : 1;
    const double raised = script.arm[side](time);
    const double swing = -0.45 * gait * std::sin(phase + side * cfp::pi<double>);
    const double shoulder = swing + sit * (0.5 - swing);
    const double bend = 0.2 + 0.25 * gait;
    const double elbow = bend + sit * (1.0 - bend);
    const double wave = 2 * cfp::pi<double> * 0.8 * time + side;
    const double upper = shoulder + raised * (0.95 + 0.3 * std::sin(wave) - shoulder);
    const double lower = upper + elbow + raised * (0.9 + 0.5 * std::sin(1.3 * wave) - elbow);
    const auto tilt = [&](double angle, double open) -> Vector3d {
      return (in_plane(angle) + open * outward * across).normalized();
    };
    const auto i = [side](Joint left) { return static_cast<std::size_t>(left) + static_cast<std::size_t>(side); };
    s.at[i(shoulder_left)] = s.at[chest] + 0.175 * size * outward * across;
    s.at[i(elbow_left)] = s.at[i(shoulder_left)] + 0.29 * size * tilt(upper, 0.16 + 0.2 * raised);
    s.at[i(wrist_left)] = s.at[i(elbow_left)] + 0.25 * size * tilt(lower, -0.1 - 0.3 * sit * (1 - raised));
    s.at[i(finger_left)] = s.at[i(wrist_left)] + 0.09 * size * tilt(lower + 0.15, -0.1);
  }
  // The script moves the feet; sitting down, the pelvis goes back by the thigh's length. The lower foot stands on the
  // floor.
  const Vector3d root(script.x(time), script.y(time), reach + sole);
  const Vector3d back = -sit * thigh * forward;
  for (Vector3d& joint : s.at) joint += root + back;
  return s;
}

/// Which joints a part spans, its radius, the width of its cross-section along and across `right`, and what it wears.
struct Part {
  Joint from, to;
  double radius, wide, deep;
  enum Wear { shirt, trousers, skin, face, shoe } wear;
  double trim = 0;  ///< shortens the axis at both ends, in radii, so that the round ends do not stick out
};

// clang-format off
inline constexpr std::array<Part, 19> parts{{
    {pelvis, chest, 0.14, 1.12, 0.74, Part::shirt, 0.55},
    {shoulder_left, shoulder_right, 0.075, 1, 1, Part::shirt, 0},
    {hip_left, hip_right, 0.098, 1, 1, Part::trousers, 0},
    {chest, neck, 0.06, 1, 1, Part::skin, 0},
    {neck, crown, 0.088, 0.92, 1.1, Part::face, 0.45},
    {hip_left, knee_left, 0.082, 1, 1, Part::trousers, 0},
    {hip_right, knee_right, 0.082, 1, 1, Part::trousers, 0},
    {knee_left, ankle_left, 0.06, 1, 1, Part::trousers, 0},
    {knee_right, ankle_right, 0.06, 1, 1, Part::trousers, 0},
    {ankle_left, toe_left, 0.045, 1, 1, Part::shoe, 0},
    {ankle_right, toe_right, 0.045, 1, 1, Part::shoe, 0},
    {shoulder_left, elbow_left, 0.054, 1, 1, Part::shirt, 0},
    {shoulder_right, elbow_right, 0.054, 1, 1, Part::shirt, 0},
    {elbow_left, wrist_left, 0.04, 1, 1, Part::skin, 0},
    {elbow_right, wrist_right, 0.04, 1, 1, Part::skin, 0},
    {wrist_left, finger_left, 0.036, 1, 0.7, Part::skin, 0},
    {wrist_right, finger_right, 0.036, 1, 0.7, Part::skin, 0},
    {pelvis, pelvis, 0.125, 1.2, 0.88, Part::trousers, 0},
    {chest, chest, 0.11, 1.25, 0.82, Part::shirt, 0},
}};
// clang-format on

/// The capsule's frame: z along the bone, x along `right` as far as that allows.
inline void place(const Part& part, const Skeleton& skeleton, double size, Surface& surface) {
  const Vector3d a = skeleton.at[part.from], b = skeleton.at[part.to];
  const double length = (b - a).norm();
  const Vector3d right = part.wear == Part::face ? skeleton.head_right : skeleton.right;
  Vector3d z = length > 1e-9 ? Vector3d((b - a) / length) : Vector3d::UnitZ();
  Vector3d y = z.cross(right);
  y = y.norm() > 0.3 ? Vector3d(y.normalized()) : Vector3d(z.cross(Vector3d::UnitZ()).normalized());
  const Vector3d x = y.cross(z);
  const double r = part.radius * size;
  surface.shape = Shape::capsule;
  surface.half = Vector3d(r, r, std::max(0.0, length / 2 - part.trim * r));
  surface.centre = (a + b) / 2;
  surface.A.row(0) = x.transpose() / part.wide;
  surface.A.row(1) = y.transpose() / part.deep;
  surface.A.row(2) = z.transpose();
}

/// The surfaces of a person at a time, with where each part was `before_s` earlier.
inline void append_person(const Scene& scene, const Script& script, int person, double time, double before_s,
                          std::vector<Surface>& surfaces) {
  const Skeleton now = skeleton_at(script, time), before = skeleton_at(script, time - before_s);
  const double size = script.height / 1.78;
  const struct {
    int texture;
    double tile_m;
  } wardrobe[] = {{scene.shirts[person], 0.5},
                  {scene.trousers[person], 0.5},
                  {scene.skins[person], 0.25},
                  {scene.heads[person], 0},
                  {scene.shoes, 0.2}};
  for (const Part& part : parts) {
    Surface s, earlier;
    place(part, now, size, s);
    place(part, before, size, earlier);
    s.inverse_before = earlier.A.inverse();
    s.moved = earlier.centre;
    s.person = person;
    s.shift = Vector3d(0.13 * static_cast<int>(part.from), 0, 0.31 * static_cast<int>(part.to));
    s.texture = wardrobe[part.wear].texture;
    s.tile_m = wardrobe[part.wear].tile_m;
    surfaces.push_back(s);
  }
}

}  // namespace synthetic
