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

enum class Scenario {
  alone,
  wall_far,
  wall_close,
  wall_touched,
  slanted,
  two_people,
  behind_desk,
  at_table,
  outstretched_arm,
  sitting,
  nobody,
  cut_by_edge
};
inline constexpr std::array<Scenario, 12> scenarios{
    Scenario::alone,      Scenario::wall_far,    Scenario::wall_close, Scenario::wall_touched,     Scenario::slanted,
    Scenario::two_people, Scenario::behind_desk, Scenario::at_table,   Scenario::outstretched_arm, Scenario::sitting,
    Scenario::nobody,     Scenario::cut_by_edge};
inline const char* name_of(Scenario scenario) {
  constexpr std::array<const char*, 12> names{"alone",        "wall far",      "wall close",    "touching a wall",
                                              "slanted wall", "person behind", "behind a desk", "table in front",
                                              "arm forward",  "sitting",       "no person",     "cut by the edge"};
  return names[static_cast<std::size_t>(scenario)];
}

/// Kinect-like depth noise, one standard deviation in metres (Nguyen, Izadi, Lovell 2012).
inline double structured_light_sigma(double depth_m) { return 0.0012 + 0.0019 * (depth_m - 0.4) * (depth_m - 0.4); }
/// Steps of its disparity in depth (Smisek, Jancosek, Pajdla 2011).
inline double quantised(double depth_m) {
  const double step = (std::max)(0.001, 0.00273 * depth_m * depth_m);
  return std::round(depth_m / step) * step;
}

struct Capsule {
  Vector3d a, b;
  double radius;
};
struct Plane {
  Vector3d point, normal;
};
/// Edges along the axes.
struct Cuboid {
  Vector3d low, high;
};

// Distance along the unit ray from the origin to the cuboid; infinite when missed.
inline double hit(const Cuboid& c, const Vector3d& ray) {
  double enter = 0, leave = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i) {
    const double a = c.low[i] / ray[i], b = c.high[i] / ray[i];
    enter = (std::max)(enter, (std::min)(a, b));
    leave = (std::min)(leave, (std::max)(a, b));
  }
  return enter < leave && enter > 0 ? enter : std::numeric_limits<double>::infinity();
}

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
    double x, y;          ///< place in the box, 0 to 1
    bool foreground;
  };
  std::vector<Cell> cells;
  std::vector<double> cumulative;
  double mixed_share = 0, missing_share = 0;
};

struct Keypoints {
  std::vector<double> depths;      ///< as measured; 0 = missing
  std::vector<signed char> truth;  ///< 1 foreground, 0 background, -1 not judged (missing depth, or a mixed pixel: its
                                   ///< depth is on neither surface)
  std::vector<double> x, y;        ///< place in the box, 0 to 1
  double person_m = 0;             ///< median depth of the person's points, 0 without one: what a track would remember
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

namespace detail {

struct World {
  std::vector<Plane> planes;
  std::vector<Capsule> person, others;
  std::vector<Cuboid> furniture;
};
struct Seen {
  double depth;
  int what;  // 0 person, 1 floor, 2 wall, 3 other
};
struct Window {
  double x1, y1, x2, y2;  // in the plane z = 1
};
inline constexpr int columns = 56, rows = 84;

inline Seen look(const World& world, const Vector3d& ray) {
  double best = 12.0;
  int what = 2;
  for (std::size_t i = 0; i < world.planes.size(); ++i) {
    const double facing = world.planes[i].normal.dot(ray),
                 t = world.planes[i].normal.dot(world.planes[i].point) / facing;
    if (facing < -1e-6 && t > 0 && t < best) best = t, what = static_cast<int>(i) + 1;
  }
  const auto against = [&](const auto& shapes, int kind) {
    for (const auto& shape : shapes) {
      const double t = hit(shape, ray);
      if (t < best) best = t, what = kind;
    }
  };
  against(world.others, 3);
  against(world.furniture, 3);
  against(world.person, 0);
  return {best * ray.z(), what};
}

inline std::vector<Seen> look(const World& world, const Window& box) {
  std::vector<Seen> grid(columns * rows);
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      const Vector3d direction(box.x1 + (box.x2 - box.x1) * (c + 0.5) / columns,
                               box.y1 + (box.y2 - box.y1) * (r + 0.5) / rows, 1.0);
      grid[static_cast<std::size_t>(r * columns + c)] = look(world, direction.normalized());
    }
  }
  return grid;
}

// The part of the box in which the person is seen.
inline Window visible(const std::vector<Seen>& grid, const Window& box) {
  int c1 = columns, c2 = 0, r1 = rows, r2 = 0;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      if (grid[static_cast<std::size_t>(r * columns + c)].what != 0) continue;
      c1 = (std::min)(c1, c), c2 = (std::max)(c2, c + 1), r1 = (std::min)(r1, r), r2 = (std::max)(r2, r + 1);
    }
  }
  if (c1 >= c2) return box;
  const double w = (box.x2 - box.x1) / columns, h = (box.y2 - box.y1) / rows;
  return {box.x1 + c1 * w, box.y1 + r1 * h, box.x1 + c2 * w, box.y1 + r2 * h};
}

inline Window bounds(const std::vector<Capsule>& parts) {
  Window out{1e9, 1e9, -1e9, -1e9};
  for (const Capsule& part : parts) {
    for (const Vector3d& p : {part.a, part.b}) {
      const double depth = (std::max)(p.z(), 0.3), r = part.radius / depth;
      out.x1 = (std::min)(out.x1, p.x() / depth - r), out.x2 = (std::max)(out.x2, p.x() / depth + r);
      out.y1 = (std::min)(out.y1, p.y() / depth - r), out.y2 = (std::max)(out.y2, p.y() / depth + r);
    }
  }
  return out;
}

}  // namespace detail

/// Draws one scene. Camera: 525 px focal length, 640 x 480, 1.0-1.5 m above the floor, level; person 1.2-4.5 m away,
/// turned by up to 90 degrees. The box is the seen part of the person, widened or cut by a few per cent on each side.
inline PersonScene draw_scene(cfp::Random& random, Scenario scenario) {
  const auto u = [&](double a, double b) { return random.uniform(a, b); };
  const bool furnished = scenario == Scenario::behind_desk || scenario == Scenario::at_table;
  const double height = u(1.0, 1.5), distance = furnished ? u(1.9, 4.5) : u(1.2, 4.5);
  const auto place = [&](std::vector<Capsule> parts, double x, double z, double turn) {
    const Eigen::Matrix3d R = Eigen::AngleAxisd(turn, Vector3d::UnitY()).toRotationMatrix();
    for (Capsule& part : parts) {
      part.a = R * part.a + Vector3d(x, height, z);
      part.b = R * part.b + Vector3d(x, height, z);
    }
    return parts;
  };
  const bool faces = furnished || scenario == Scenario::outstretched_arm;
  double x = u(-0.3, 0.3) * distance;
  if (scenario == Scenario::cut_by_edge)
    x += (x > 0 ? 0.3 : -0.3) * distance;  // about half of them outside of the image
  const double turn = faces ? u(-0.5, 0.5) : u(-1.57, 1.57);
  const Scenario posture = scenario == Scenario::at_table ? Scenario::sitting : scenario;
  detail::World world;
  world.person = place(detail::body(random, posture), x, distance, turn);

  double gap = u(0.8, 4.0), slant = u(-0.3, 0.3);
  if (scenario == Scenario::alone) gap = u(4.0, 7.0);
  if (scenario == Scenario::wall_close) gap = u(0.35, 0.8);
  if (scenario == Scenario::wall_touched) {
    double back = distance;
    for (const Capsule& part : world.person) back = (std::max)({back, part.a.z(), part.b.z()});
    gap = back - distance + u(0.1, 0.2);
    slant = 0;
  }
  if (scenario == Scenario::slanted) {
    gap = u(0.6, 2.5);
    slant = (random.index(2) == 0 ? 1.0 : -1.0) * u(0.5, 1.2);
  }
  if (scenario == Scenario::two_people) gap += 1.2;
  world.planes = {{{0, height, 0}, {0, -1, 0}}, {{x, 0, distance + gap}, {std::sin(slant), 0, -std::cos(slant)}}};
  if (scenario == Scenario::behind_desk || scenario == Scenario::sitting || scenario == Scenario::nobody) {
    const auto clutter = 3 + random.index(6);
    for (std::uint32_t i = 0; i < clutter; ++i) {
      const double z = distance + u(0.55, (std::max)(0.6, gap)), radius = u(0.06, 0.15), y = height - u(0.3, 1.6),
                   cx = x + u(-0.5, 0.5);
      world.others.push_back({{cx, y, z}, {cx + u(-0.3, 0.3), y + u(-0.2, 0.2), z}, radius});
    }
  }
  if (scenario == Scenario::two_people) {
    world.others =
        place(detail::body(random, Scenario::wall_far), x + u(-0.45, 0.45), distance + u(0.6, 1.6), u(-1.57, 1.57));
  }
  if (furnished) {  // a top, perhaps with a front below, and things on it; the desk's top stands higher before them
    const bool desk = scenario == Scenario::behind_desk;
    const double near = distance - u(0.3, 0.4) - u(0.5, 0.9), far = distance - u(0.25, 0.35),
                 top = height - u(0.7, 0.78);
    const double left = x - u(0.5, 1.0), right = x + u(0.5, 1.0);
    world.furniture.push_back({{left, top, near}, {right, top + 0.04, far}});
    if (desk && random.index(3) > 0) world.furniture.push_back({{left, top, near}, {right, height, near + 0.02}});
    const auto things = desk ? 1 + random.index(3) : random.index(3);
    for (std::uint32_t i = 0; i < things; ++i) {
      const double cx = x + u(-0.5, 0.5), w = u(0.05, desk ? 0.3 : 0.12), h = u(0.05, desk ? 0.4 : 0.15);
      const double z = u(near, far - 0.1);
      world.furniture.push_back({{cx - w, top - h, z}, {cx + w, top, z + u(0.03, 0.1)}});
    }
  }
  detail::Window box = detail::bounds(world.person);
  box = {(std::max)(box.x1, -0.61), (std::max)(box.y1, -0.457), (std::min)(box.x2, 0.61), (std::min)(box.y2, 0.457)};
  box = detail::visible(detail::look(world, box), box);
  const double w = box.x2 - box.x1, h = box.y2 - box.y1;
  box.x1 = (std::max)(box.x1 - u(-0.03, 0.08) * w, -0.61), box.x2 = (std::min)(box.x2 + u(-0.03, 0.08) * w, 0.61);
  box.y1 = (std::max)(box.y1 - u(-0.02, 0.06) * h, -0.457), box.y2 = (std::min)(box.y2 + u(-0.02, 0.06) * h, 0.457);
  if (scenario == Scenario::nobody) world.person.clear();
  const std::vector<detail::Seen> grid = detail::look(world, box);
  constexpr int columns = detail::columns, rows = detail::rows;
  using detail::Seen;

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
      scene.cells.push_back({seen.depth, other, weight, (c + 0.5) / columns, (r + 0.5) / rows, seen.what == 0});
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
                 surface = mixed ? cell.depth_m + share * (cell.mixed_with_m - cell.depth_m) : cell.depth_m,
                 measured = surface + structured_light_sigma(surface) * random.normal();
    out.depths.push_back(missing ? 0.0 : quantised(measured));
    out.x.push_back(cell.x);
    out.y.push_back(cell.y);
    out.truth.push_back(static_cast<signed char>(missing || mixed ? -1 : cell.foreground ? 1 : 0));
  }
  std::vector<double> person;
  for (const PersonScene::Cell& cell : scene.cells) {
    if (cell.foreground) person.push_back(cell.depth_m);
  }
  std::sort(person.begin(), person.end());
  out.person_m = person.empty() ? 0 : person[person.size() / 2];
  return out;
}

}  // namespace cfp_study
