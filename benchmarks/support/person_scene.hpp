// Seeded depth scenes of people for studies of depth clustering: a jointed body of capsules before planes, boxes or
// another person, ray-cast through a detection box, with structured-light noise. What is hard in real frames is in here
// on purpose: limbs nearer than the body by more than the sensor's noise, walls a hand's breadth behind the back,
// floors and slanted walls that cross the body's depth range, mixed ("flying") pixels along silhouettes, missing depth,
// and keypoints in clumps that crowd at silhouettes and leave plain parts empty. Points of a crossing plane at the
// body's own depth cannot be told apart by depth at all; no rule reaches 100 %.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cfp/core/random.hpp"

namespace cfp_study {

using Eigen::Vector3d;

enum class Scenario { wall_far, wall_close, slanted_wall, desk_and_clutter, two_people, outstretched_arm, sitting };
inline constexpr std::array<Scenario, 7> scenarios{
    Scenario::wall_far,   Scenario::wall_close,       Scenario::slanted_wall, Scenario::desk_and_clutter,
    Scenario::two_people, Scenario::outstretched_arm, Scenario::sitting};
inline const char* name_of(Scenario scenario) {
  constexpr std::array<const char*, 7> names{"wall far",   "wall close",  "slanted wall", "desk, clutter",
                                             "two people", "arm forward", "sitting"};
  return names[static_cast<std::size_t>(scenario)];
}

/// Kinect-like depth noise, one standard deviation in metres (Nguyen, Izadi, Lovell 2012).
inline double structured_light_sigma(double depth_m) { return 0.0012 + 0.0019 * (depth_m - 0.4) * (depth_m - 0.4); }

struct Capsule {
  Vector3d a, b;
  double radius;
};
struct Plane {
  Vector3d point, normal;
};

// Distance along the unit ray from the origin to the capsule; infinite when missed.
inline double hit(const Capsule& c, const Vector3d& ray) {
  constexpr double miss = std::numeric_limits<double>::infinity();
  const auto sphere = [&](const Vector3d& centre) {
    const double along = centre.dot(ray), gap = centre.squaredNorm() - along * along, r_sq = c.radius * c.radius;
    return gap < r_sq ? along - std::sqrt(r_sq - gap) : miss;
  };
  double best = (std::min)(sphere(c.a), sphere(c.b));
  const Vector3d axis = (c.b - c.a).normalized();
  const double length = (c.b - c.a).norm();
  const Vector3d across = ray - axis * axis.dot(ray), offset = -c.a - axis * axis.dot(-c.a);
  const double qa = across.squaredNorm(), qb = across.dot(offset), qc = offset.squaredNorm() - c.radius * c.radius,
               root = qb * qb - qa * qc;
  if (qa > 1e-12 && root > 0) {
    const double t = (-qb - std::sqrt(root)) / qa, at = axis.dot(ray * t - c.a);
    if (t > 0 && at > 0 && at < length) best = (std::min)(best, t);
  }
  return best > 0 ? best : miss;
}

/// One box of a detector: for each cell of a grid over it what the sensor could see there.
struct PersonScene {
  struct Cell {
    double depth_m;       ///< true depth of the surface
    double mixed_with_m;  ///< depth of the other surface at a silhouette, else 0
    double weight;        ///< relative density of keypoints
    bool foreground;
  };
  std::vector<Cell> cells;
  std::vector<double> cumulative;
  double mixed_share = 0, missing_share = 0;
  double far_m = 0;  ///< depth of the person's farthest visible surface
};

struct Keypoints {
  std::vector<double> depths;      ///< as measured; 0 = missing
  std::vector<signed char> truth;  ///< 1 foreground, 0 background, -1 not judged (missing depth, or a mixed pixel: its
                                   ///< depth is on neither surface)
  std::vector<signed char>
      beyond;  ///< 1 for background behind the person's farthest surface: what depth alone can tell apart
};

namespace detail {

// y is down and 0 at the floor, z is away from the camera, x to the right; the body stands at the origin facing the
// camera.
inline std::vector<Capsule> body(cfp::Random& random, Scenario scenario) {
  const auto u = [&](double a, double b) { return random.uniform(a, b); };
  std::vector<Capsule> parts;
  const bool sits = scenario == Scenario::sitting;
  const double hip = sits ? 0.50 : 0.92, lean = sits ? u(-0.25, 0.15) : u(-0.08, 0.08);
  const auto limb = [&](const Vector3d& from, const Vector3d& middle, const Vector3d& to, double r1, double r2) {
    parts.push_back({from, middle, r1});
    parts.push_back({middle, to, r2});
  };
  const Vector3d chest(0, -(hip + 0.45), lean);
  for (const double side : {-1.0, 1.0}) {
    parts.push_back({{side * 0.09, -hip, 0}, chest + Vector3d(side * 0.09, 0, 0), u(0.11, 0.14)});
    const Vector3d shoulder = chest + Vector3d(side * 0.2, -0.02, 0);
    const double swing = u(-0.25, 0.25);
    if (scenario == Scenario::outstretched_arm && side > 0) {
      const double reach = u(0.35, 0.6), up = u(-0.25, 0.2), out = u(-0.2, 0.2);
      limb(shoulder, shoulder + 0.5 * Vector3d(out, up + 0.1, -reach), shoulder + Vector3d(out, up, -reach), 0.05,
           0.045);
    } else if (sits) {
      limb(shoulder, shoulder + Vector3d(side * 0.05, 0.28, u(-0.15, 0.05)),
           shoulder + Vector3d(side * u(-0.1, 0.05), u(0.25, 0.4), u(-0.4, -0.15)), 0.055, 0.045);
    } else {
      limb(shoulder, shoulder + Vector3d(side * u(0.02, 0.1), 0.28, 0.5 * swing),
           shoulder + Vector3d(side * u(0, 0.1), 0.52, swing - 0.05), 0.055, 0.045);
    }
    const Vector3d joint(side * 0.1, -hip, 0);
    if (sits) {
      const Vector3d knee(side * u(0.1, 0.25), -0.5, -u(0.35, 0.48));
      limb(joint, knee, {knee.x(), -0.08, knee.z() + u(-0.1, 0.15)}, 0.085, 0.06);
    } else {
      const double step = u(-0.3, 0.3);
      limb(joint, {side * 0.1, -0.48, 0.5 * step - 0.04}, {side * 0.1, -0.08, step}, 0.08, 0.06);
      parts.push_back({{side * 0.1, -0.05, step}, {side * 0.13, -0.04, step - 0.14}, 0.04});
    }
  }
  parts.push_back({chest + Vector3d(0, -0.22, -0.02), chest + Vector3d(0, -0.27, -0.02), 0.1});
  return parts;
}

}  // namespace detail

/// Draws one scene. Camera: 525 px focal length, 640 x 480, 1.0-1.5 m above the floor, level; person 1.2-4.5 m away,
/// turned by up to 90 degrees.
inline PersonScene draw_scene(cfp::Random& random, Scenario scenario) {
  const auto u = [&](double a, double b) { return random.uniform(a, b); };
  const double height = u(1.0, 1.5), distance = u(1.2, 4.5);
  const auto place = [&](std::vector<Capsule> parts, double x, double z, double turn) {
    const Eigen::Matrix3d R = Eigen::AngleAxisd(turn, Vector3d::UnitY()).toRotationMatrix();
    for (Capsule& part : parts) {
      part.a = R * part.a + Vector3d(x, height, z);
      part.b = R * part.b + Vector3d(x, height, z);
    }
    return parts;
  };
  const double x = u(-0.3, 0.3) * distance, turn_range = scenario == Scenario::outstretched_arm ? 0.5 : 1.57;
  const std::vector<Capsule> person = place(detail::body(random, scenario), x, distance, u(-turn_range, turn_range));

  std::vector<Plane> planes{{{0, height, 0}, {0, -1, 0}}};
  std::vector<Capsule> others;
  double gap = u(0.8, 4.0), slant = u(-0.3, 0.3);
  if (scenario == Scenario::wall_close) gap = u(0.35, 0.8);
  if (scenario == Scenario::slanted_wall) {
    gap = u(0.6, 2.5);
    slant = (random.index(2) == 0 ? 1.0 : -1.0) * u(0.5, 1.2);
  }
  planes.push_back({{x, 0, distance + gap}, {std::sin(slant), 0, -std::cos(slant)}});
  if (scenario == Scenario::desk_and_clutter || scenario == Scenario::sitting) {
    const auto clutter = 3 + random.index(6);
    for (std::uint32_t i = 0; i < clutter; ++i) {
      const double z = distance + u(0.55, (std::max)(0.6, gap)), radius = u(0.06, 0.15), y = height - u(0.3, 1.6),
                   cx = x + u(-0.5, 0.5);
      others.push_back({{cx, y, z}, {cx + u(-0.3, 0.3), y + u(-0.2, 0.2), z}, radius});
    }
  }
  if (scenario == Scenario::two_people) {
    const std::vector<Capsule> other =
        place(detail::body(random, Scenario::wall_far), x + u(-0.45, 0.45), distance + u(0.6, 1.6), u(-1.57, 1.57));
    others.insert(others.end(), other.begin(), other.end());
    planes[1].point.z() += 1.2;
  }

  // The detection box: the projected person within the image, widened or cut by a few per cent on each side.
  double x1 = 1e9, y1 = 1e9, x2 = -1e9, y2 = -1e9;
  for (const Capsule& part : person) {
    for (const Vector3d& p : {part.a, part.b}) {
      const double depth = (std::max)(p.z(), 0.3), r = part.radius / depth;
      x1 = (std::min)(x1, p.x() / depth - r), x2 = (std::max)(x2, p.x() / depth + r);
      y1 = (std::min)(y1, p.y() / depth - r), y2 = (std::max)(y2, p.y() / depth + r);
    }
  }
  const double w = x2 - x1, h = y2 - y1;
  x1 -= u(-0.03, 0.08) * w, x2 += u(-0.03, 0.08) * w, y1 -= u(-0.02, 0.06) * h, y2 += u(-0.02, 0.06) * h;
  x1 = (std::max)(x1, -0.61), x2 = (std::min)(x2, 0.61), y1 = (std::max)(y1, -0.457), y2 = (std::min)(y2, 0.457);

  constexpr int columns = 56, rows = 84;
  struct Seen {
    double depth;
    int what;  // 0 person, 1 floor, 2 wall, 3 other
  };
  std::vector<Seen> grid(columns * rows);
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      const Vector3d direction(x1 + (x2 - x1) * (c + 0.5) / columns, y1 + (y2 - y1) * (r + 0.5) / rows, 1.0),
          ray = direction.normalized();
      double best = 12.0;
      int what = 2;
      for (std::size_t i = 0; i < planes.size(); ++i) {
        const double facing = planes[i].normal.dot(ray), t = planes[i].normal.dot(planes[i].point) / facing;
        if (facing < -1e-6 && t > 0 && t < best) best = t, what = static_cast<int>(i) + 1;
      }
      for (const Capsule& part : others) {
        const double t = hit(part, ray);
        if (t < best) best = t, what = 3;
      }
      for (const Capsule& part : person) {
        const double t = hit(part, ray);
        if (t < best) best = t, what = 0;
      }
      grid[static_cast<std::size_t>(r * columns + c)] = {best * ray.z(), what};
    }
  }

  PersonScene scene;
  scene.mixed_share = u(0.05, 0.25);
  scene.missing_share = u(0.0, 0.2);
  const double person_texture = std::exp(u(-0.9, 0.9)), floor_texture = u(0.1, 0.6);
  // Keypoints come in clumps: every patch of 5 x 5 cells has its own texture, log-normal, so bodies show gaps in depth
  // where they are plain.
  constexpr int patch = 5, patches_per_row = columns / patch + 1;
  std::vector<double> patch_texture(static_cast<std::size_t>(patches_per_row * (rows / patch + 1)));
  for (double& texture : patch_texture) texture = std::exp(1.2 * random.normal());
  double sum = 0;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      const Seen& seen = grid[static_cast<std::size_t>(r * columns + c)];
      double other = 0;
      for (const auto& [dr, dc] : {std::pair<int, int>{0, 1}, {0, -1}, {1, 0}, {-1, 0}}) {
        if (r + dr < 0 || r + dr >= rows || c + dc < 0 || c + dc >= columns) continue;
        const Seen& next = grid[static_cast<std::size_t>((r + dr) * columns + c + dc)];
        if (std::abs(next.depth - seen.depth) > 0.1 + 0.03 * seen.depth) other = next.depth;
      }
      const double texture = seen.what == 0 ? person_texture : seen.what == 1 ? floor_texture : 1.0;
      const double clump = patch_texture[static_cast<std::size_t>(r / patch * patches_per_row + c / patch)];
      const double weight = texture * clump * (other > 0 ? 3.0 : 1.0);
      if (seen.what == 0) scene.far_m = (std::max)(scene.far_m, seen.depth);
      scene.cells.push_back({seen.depth, other, weight, seen.what == 0});
      scene.cumulative.push_back(sum += weight);
    }
  }
  return scene;
}

/// Draws n measured keypoints of a scene.
inline Keypoints draw_keypoints(cfp::Random& random, const PersonScene& scene, std::size_t n) {
  Keypoints out;
  for (std::size_t i = 0; i < n; ++i) {
    const auto at =
        std::upper_bound(scene.cumulative.begin(), scene.cumulative.end(), random.uniform() * scene.cumulative.back()) -
        scene.cumulative.begin();
    const PersonScene::Cell& cell = scene.cells[(std::min)(static_cast<std::size_t>(at), scene.cells.size() - 1)];
    const bool mixed = cell.mixed_with_m > 0 && random.uniform() < scene.mixed_share,
               missing = random.uniform() < scene.missing_share;
    const double share = random.uniform(),
                 surface = mixed ? cell.depth_m + share * (cell.mixed_with_m - cell.depth_m) : cell.depth_m;
    out.depths.push_back(missing ? 0.0 : surface + structured_light_sigma(surface) * random.normal());
    out.beyond.push_back(cell.depth_m > scene.far_m ? 1 : 0);
    out.truth.push_back(static_cast<signed char>(missing || mixed ? -1 : cell.foreground ? 1 : 0));
  }
  return out;
}

}  // namespace cfp_study
