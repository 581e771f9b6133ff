// What a ray can hit: boxes (furniture), the inside of one (the room) and capsules under an affine map (limbs, torsos,
// heads). Each is intersected in its own frame, where it is axis-aligned.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

namespace synthetic {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double infinity = std::numeric_limits<double>::infinity();

enum class Shape { box, room, capsule };

/// local = A (world − centre).
struct Surface {
  Shape shape = Shape::box;
  Matrix3d A = Matrix3d::Identity();
  Vector3d centre = Vector3d::Zero();
  Vector3d half =
      Vector3d::Ones();  ///< box, room: half extents; capsule along z: (radius, radius, half length of its axis)
  int texture = 0;
  double tile_m = 1;                  ///< edge of one texture tile; capsules with tile_m = 0 are wrapped once (heads)
  Vector3d shift = Vector3d::Zero();  ///< of the texture, m, so that equal textures do not look equal
  int person = -1;                    ///< index, −1 for the room
  bool absorbs_infrared = false;      ///< black glossy things have no depth
  Vector3d moved =
      Vector3d::Zero();  ///< people: A and centre a frame earlier, as world_before = inverse_before local + moved
  Matrix3d inverse_before = Matrix3d::Zero();
};

struct Hit {
  double depth =
      infinity;  ///< multiple of the ray direction; the directions have z = 1 in the camera, so it is the depth
  int face = 0;  ///< box, room: 2 axis + (positive side)
};

inline Hit hit_box(const Vector3d& origin, const Vector3d& direction, const Vector3d& half, bool from_inside) {
  double enter = -infinity, leave = infinity;
  int enter_face = 0, leave_face = 0;
  for (int a = 0; a < 3; ++a) {
    const double inverse = 1 / direction[a];
    const double side = inverse > 0 ? half[a] : -half[a];
    const double near = (-side - origin[a]) * inverse, far = (side - origin[a]) * inverse;
    if (near > enter) {
      enter = near;
      enter_face = 2 * a + (inverse > 0 ? 0 : 1);
    }
    if (far < leave) {
      leave = far;
      leave_face = 2 * a + (inverse > 0 ? 1 : 0);
    }
  }
  if (!(enter <= leave)) return {};
  if (from_inside) return leave > 0 ? Hit{leave, leave_face} : Hit{};
  return enter > 0 ? Hit{enter, enter_face} : Hit{};
}

inline Hit hit_capsule(const Vector3d& o, const Vector3d& d, const Vector3d& half) {
  const double r = half.x(), h = half.z();
  const double a = d.x() * d.x() + d.y() * d.y(), b = o.x() * d.x() + o.y() * d.y(),
               c = o.x() * o.x() + o.y() * o.y() - r * r;
  const double discriminant = b * b - a * c;
  if (!(discriminant > 0) || !(a > 0)) return {};
  const double t = (-b - std::sqrt(discriminant)) / a;
  const double z = o.z() + t * d.z();
  if (std::abs(z) <= h) return t > 0 ? Hit{t, 0} : Hit{};
  // Entering the endless cylinder beyond an end, the ray can only meet that end's sphere.
  const double oz = o.z() - (z > 0 ? h : -h);
  const double sa = a + d.z() * d.z(), sb = b + oz * d.z(), sc = c + oz * oz;
  const double sphere = sb * sb - sa * sc;
  if (!(sphere > 0)) return {};
  const double ts = (-sb - std::sqrt(sphere)) / sa;
  return ts > 0 ? Hit{ts, 0} : Hit{};
}

inline Hit hit(const Surface& surface, const Vector3d& local_origin, const Vector3d& local_direction) {
  switch (surface.shape) {
    case Shape::box:
      return hit_box(local_origin, local_direction, surface.half, false);
    case Shape::room:
      return hit_box(local_origin, local_direction, surface.half, true);
    case Shape::capsule:
      return hit_capsule(local_origin, local_direction, surface.half);
  }
  return {};
}

/// Outward unit normal in the world at a point given locally; the room's points inwards.
inline Vector3d normal_at(const Surface& surface, const Vector3d& local, int face) {
  if (surface.shape == Shape::capsule) {
    const double z = std::clamp(local.z(), -surface.half.z(), surface.half.z());
    return (surface.A.transpose() * Vector3d(local.x(), local.y(), local.z() - z)).normalized();
  }
  const double sign = (face % 2 == 1 ? 1 : -1) * (surface.shape == Shape::room ? -1 : 1);
  return sign * surface.A.row(face / 2).transpose();
}

/// Texture coordinates in tiles.
inline Eigen::Vector2d texture_coordinates(const Surface& surface, const Vector3d& local, int face) {
  constexpr double two_pi = 6.283185307179586;
  if (surface.shape == Shape::capsule) {
    const double turn = std::atan2(local.y(), local.x()) / two_pi;
    const double r = surface.half.x(), h = surface.half.z();
    if (surface.tile_m == 0) return {turn, (local.z() + h + r) / (2 * (h + r))};
    const double around = std::max(1.0, std::round(two_pi * r / surface.tile_m));
    return {turn * around + surface.shift.x(), (local.z() + surface.shift.z()) / surface.tile_m};
  }
  const Vector3d p = (local + surface.shift) / surface.tile_m;
  // Vertical faces stand upright: v falls with height.
  switch (face / 2) {
    case 0:
      return {p.y() + 0.37 * face, -p.z()};
    case 1:
      return {p.x() + 0.37 * face, -p.z()};
    default:
      return {p.x() + 0.37 * face, p.y()};
  }
}

/// Edge of a texture tile in metres, for choosing the mip level.
inline double tile_size(const Surface& surface) {
  return surface.tile_m > 0 ? surface.tile_m : 6.283185307179586 * surface.half.x();
}

}  // namespace synthetic
