#include "cfp/geometry/p3p.hpp"

#include <cmath>
#include <limits>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "cfp/core/random.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/two_view_scene.hpp"

using cfp::p3p;
using cfp::P3PProblem;
using cfp::SE3;
using cfp::Status;
using cfp::Vector3;

namespace {

template <typename Scalar>
struct Problem : P3PProblem<Scalar> {
  SE3<double> truth;
};

Vector3<double> random_ray(cfp::Random& random) { return {random.uniform(-0.6, 0.6), random.uniform(-0.45, 0.45), 1}; }

std::array<Vector3<double>, 3> random_points(cfp::Random& random) {
  std::array<Vector3<double>, 3> points;
  for (Vector3<double>& x : points) x = random.uniform(0.5, 5) * random_ray(random);
  return points;
}

/// Three points of the camera frame, seen from a random pose.
template <typename Scalar = double>
Problem<Scalar> view(cfp::Random& random, const std::array<Vector3<double>, 3>& points) {
  Problem<Scalar> problem;
  problem.truth.rotation = cfp::so3_exp<double>(random.uniform(0, 3.1) * cfp_test::random_direction(random));
  problem.truth.translation = random.uniform(0, 3) * cfp_test::random_direction(random);
  for (std::size_t i = 0; i < 3; ++i) {
    problem.rays[i] = (points[i] / points[i].z()).template cast<Scalar>();
    problem.world[i] = (problem.truth.inverse() * points[i]).template cast<Scalar>();
  }
  return problem;
}

template <typename Scalar>
Problem<Scalar> make_problem(cfp::Random& random) {
  return view<Scalar>(random, random_points(random));
}

template <typename Scalar>
double pose_error(const SE3<Scalar>& T, const SE3<double>& truth) {
  return (T.rotation.template cast<double>() - truth.rotation).norm() +
         (T.translation.template cast<double>() - truth.translation).norm();
}

/// The error of the solution nearest to the truth.
template <typename Scalar>
double best_error(const cfp::P3PSolutions<Scalar>& solutions, const SE3<double>& truth) {
  double best = std::numeric_limits<double>::infinity();
  for (int s = 0; s < solutions.count; ++s)
    best = (std::min)(best, pose_error(solutions.T_cam_world[std::size_t(s)], truth));
  return best;
}

/// The largest distance of a point from its ray, in units of its depth; two for one behind the camera.
template <typename Scalar>
double worst_misfit(const cfp::P3PSolutions<Scalar>& solutions, const P3PProblem<Scalar>& problem) {
  double worst = 0;
  for (int s = 0; s < solutions.count; ++s) {
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3<Scalar> p = solutions.T_cam_world[std::size_t(s)] * problem.world[i];
      worst = (std::max)(worst, double((p.normalized() - problem.rays[i].normalized()).norm()));
    }
  }
  return worst;
}

}  // namespace

TEST_CASE("P3P: whole numbers and symmetry hide no pose", "[geometry]") {
  // Camera above the corners of right and isosceles triangles: conics that are exactly pairs of lines, one at infinity.
  int problems = 0, missed = 0, in_the_centre = 0;
  for (const int left : {0, 1}) {
    for (int w = 1; w <= 4; ++w) {
      for (int h = 1; h <= 5; ++h) {
        for (int k = 0; k < 11 * 11 * 3; ++k) {
          Problem<double> problem;
          problem.world = {Vector3<double>(-left * w, 0, 0), Vector3<double>(w, 0, 0), Vector3<double>(0, h, 0)};
          problem.truth.translation = Vector3<double>(k % 11 - 5, k / 11 % 11 - 5, k / 121 + 1);
          for (std::size_t i = 0; i < 3; ++i) {
            const Vector3<double> point = problem.truth * problem.world[i];
            problem.rays[i] = point / point.z();
          }
          const cfp::P3PSolutions<double> solutions = p3p(problem);
          ++problems;
          missed += best_error(solutions, problem.truth) < 1e-4 ? 0 : 1;  // 3e-5 on the danger cylinder
          for (int s = 0; s < solutions.count; ++s) {
            for (const Vector3<double>& x : problem.world)
              in_the_centre += (solutions.T_cam_world[std::size_t(s)] * x).norm() < 1e-9 ? 1 : 0;
          }
        }
      }
    }
  }
  INFO(problems << " problems");
  CHECK(missed == 0);
  CHECK(in_the_centre == 0);
}

TEMPLATE_TEST_CASE("The true pose is among the solutions and each solution fits", "[geometry]", float, double) {
  cfp::Random random(41, "p3p");
  constexpr int problems = 20000;
  int exact = 0, close = 0;
  for (int k = 0; k < problems; ++k) {
    const Problem<TestType> problem = make_problem<TestType>(random);
    const auto solutions = p3p(problem);
    REQUIRE(solutions.status == Status::ok);
    REQUIRE(solutions.count <= 4);
    double best = 1;
    for (int s = 0; s < solutions.count; ++s) {
      const SE3<TestType>& T = solutions.T_cam_world[std::size_t(s)];
      best = (std::min)(best, pose_error(T, problem.truth));
      double misfit = 0;  // m
      for (std::size_t i = 0; i < 3; ++i) {
        const Vector3<TestType> p = T * problem.world[i];
        CHECK(p.dot(problem.rays[i]) > 0);
        misfit = (std::max)(misfit, double(p.cross(problem.rays[i].normalized()).norm()));
      }
      CHECK(misfit < (std::is_same_v<TestType, float> ? 2e-5 : 1e-9));
      CHECK_THAT(double(T.rotation.determinant()), WithinAbs(1, 1e-5));
    }
    exact += best < (std::is_same_v<TestType, float> ? 1e-3 : 1e-9) ? 1 : 0;
    close += best < (std::is_same_v<TestType, float> ? 0.1 : 1e-5) ? 1 : 0;
  }
  // Near a double root the input's rounding alone moves the pose by its square root.
  CHECK(exact > (std::is_same_v<TestType, float> ? 0.97 : 0.998) * problems);
  CHECK(close > (std::is_same_v<TestType, float> ? 0.998 : 0.9999) * problems);
}

TEST_CASE("All four solutions of a regular case are found", "[geometry]") {
  // Equilateral triangle seen from above its centre: the symmetric pose, and three poses tilted about one vertex each.
  P3PProblem<double> problem;
  for (std::size_t i = 0; i < 3; ++i) {
    const double angle = 2 * cfp::pi<double> / 3 * double(i) + 0.1;
    problem.world[i] = Vector3<double>(std::cos(angle), std::sin(angle), 0);
    problem.rays[i] = problem.world[i] + Vector3<double>(0, 0, 2.5);
  }
  const auto solutions = p3p(problem);
  REQUIRE(solutions.count == 4);
  for (int a = 0; a < 4; ++a) {
    for (int b = 0; b < a; ++b)
      CHECK(pose_error(solutions.T_cam_world[std::size_t(a)], solutions.T_cam_world[std::size_t(b)]) > 1e-3);
  }
}

TEST_CASE("A small triangle far away, a thin one and one seen edge-on are as good as any", "[geometry]") {
  cfp::Random random(45, "p3p");
  for (const double size : {0.1, 0.01, 1e-4}) {
    for (int k = 0; k < 3000; ++k) {
      std::array<Vector3<double>, 3> points;
      const Vector3<double> centre = random.uniform(1, 6) * random_ray(random);
      for (Vector3<double>& x : points) x = centre + size * cfp_test::random_direction(random);
      const Problem<double> problem = view(random, points);
      CHECK(best_error(p3p(problem), problem.truth) < 1e-8 / size);
    }
  }
  for (const double height : {0.1, 0.01, 1e-3}) {
    for (int k = 0; k < 3000; ++k) {
      std::array<Vector3<double>, 3> points = random_points(random);
      const Vector3<double> edge = points[1] - points[0];
      Vector3<double> side = cfp_test::random_direction(random);
      side -= side.dot(edge) / edge.squaredNorm() * edge;
      points[2] = points[0] + random.uniform(0.1, 0.9) * edge + height * edge.norm() * side.normalized();
      const Problem<double> problem = view(random, points);
      CHECK(best_error(p3p(problem), problem.truth) < 1e-7 / (height * height));
    }
  }
  for (int k = 0; k < 3000; ++k) {  // the camera stands in the triangle's plane
    const Vector3<double> a = random_ray(random), b = random_ray(random);
    const std::array<Vector3<double>, 3> points = {random.uniform(0.5, 5) * a, random.uniform(0.5, 5) * b,
                                                   random.uniform(0.5, 5) * (a + random.uniform(-0.5, 1.5) * (b - a))};
    const Problem<double> problem = view(random, points);
    CHECK(best_error(p3p(problem), problem.truth) < 1e-5);
  }
}

TEST_CASE("Points a thousand times as far as others lose few digits", "[geometry]") {
  cfp::Random random(48, "p3p");
  constexpr int problems = 40000;
  int poor = 0;
  for (int k = 0; k < problems; ++k) {
    std::array<Vector3<double>, 3> points;
    for (Vector3<double>& x : points) x = std::pow(10, random.uniform(-3, 3)) * random_ray(random);
    const Problem<double> problem = view(random, points);
    poor += best_error(p3p(problem), problem.truth) > 1e-7 ? 1 : 0;
  }
  CHECK(poor < 0.0015 * problems);
}

TEST_CASE("Two solutions that meet on the danger cylinder are not lost", "[geometry]") {
  cfp::Random random(46, "p3p");
  constexpr int problems = 5000;
  int found = 0;
  for (int k = 0; k < problems; ++k) {
    // Three points of a circle of radius one, the camera above it: rounding alone decides whether a pose is left.
    const double phi = random.uniform(0, 2 * cfp::pi<double>), height = random.uniform(0.5, 5);
    const Vector3<double> camera(std::cos(phi), std::sin(phi), height);
    std::array<Vector3<double>, 3> points;
    for (std::size_t i = 0; i < 3; ++i) {
      const double angle = phi + 0.4 + 2 * double(i) + random.uniform(-0.3, 0.3);
      points[i] = Vector3<double>(std::cos(angle), std::sin(angle), 0) - camera;
      points[i].z() = -points[i].z();
    }
    const Problem<double> problem = view(random, points);
    found += best_error(p3p(problem), problem.truth) < 1e-5 ? 1 : 0;
  }
  CHECK(found >= 0.99 * problems);
}

TEST_CASE("Rays that no such triangle fits have no pose and say so", "[geometry]") {
  // An equilateral triangle, two rays that coincide and a third at a right angle: the third edge cannot be as long.
  P3PProblem<double> problem;
  problem.world = {Vector3<double>(0, 0, 0), Vector3<double>(2, 0, 0), Vector3<double>(0.1, 0.1, 0)};
  problem.rays = {Vector3<double>(0, 0, 1), Vector3<double>(0, 0.01, 1), Vector3<double>(1, 0, 0.01)};
  const auto solutions = p3p(problem);
  CHECK(solutions.count == 0);
  CHECK(solutions.status == Status::degenerate);
  // Nothing is found where nothing is, and something is called ok only where something is.
  cfp::Random random(47, "p3p");
  for (int k = 0; k < 3000; ++k) {
    problem.world = random_points(random);
    problem.rays = random_points(random);
    const auto any = p3p(problem);
    CHECK((any.status == Status::ok) == (any.count > 0));
    CHECK(worst_misfit(any, problem) < 1e-7);
  }
}

TEST_CASE("A thin triangle on rays that it does not fit has poses that are rotations, or none", "[geometry]") {
  cfp::Random random(48, "p3p");
  int solved = 0;
  for (int k = 0; k < 20000; ++k) {
    P3PProblem<double> problem;
    problem.world = random_points(random);
    const Vector3<double> along = problem.world[1] - problem.world[0];
    const double height = std::pow(10, random.uniform(-8, -1));
    problem.world[2] = problem.world[0] + random.uniform(-1, 1) * along + height * cfp_test::random_direction(random);
    for (std::size_t i = 0; i < 3; ++i) {
      const double off = std::pow(10, random.uniform(-8, 0));
      problem.rays[i] = problem.world[i] / problem.world[i].z() + off * cfp_test::random_direction(random);
    }
    const auto solutions = p3p(problem);
    for (int s = 0; s < solutions.count; ++s) {
      const auto& R = solutions.T_cam_world[std::size_t(s)].rotation;
      REQUIRE((R * R.transpose() - cfp::Matrix3<double>::Identity()).norm() < 1e-5);
      ++solved;
    }
    REQUIRE(worst_misfit(solutions, problem) < 1e-5);
  }
  CHECK(solved > 5000);
}

TEST_CASE("The scene's unit, the world frame, the order of points and the rays' lengths do not matter", "[geometry]") {
  cfp::Random random(42, "p3p");
  for (int k = 0; k < 200; ++k) {
    const Problem<double> problem = make_problem<double>(random);
    const auto expected = p3p(problem);
    auto moved = problem;
    const double unit = k % 2 == 0 ? 1e6 : 1e-6;
    for (Vector3<double>& x : moved.world) x *= unit;
    for (Vector3<double>& y : moved.rays) y *= random.uniform(0.01, 100);
    std::swap(moved.rays[0], moved.rays[2]);
    std::swap(moved.world[0], moved.world[2]);
    const auto solutions = p3p(moved);
    double best = 1;
    for (int s = 0; s < solutions.count; ++s) {
      SE3<double> T = solutions.T_cam_world[std::size_t(s)];
      T.translation /= unit;
      best = (std::min)(best, pose_error(T, problem.truth));
    }
    CHECK(best < 1e-6);
    CHECK(solutions.count == expected.count);
  }
}

TEST_CASE("Degenerate triangles, rays and hostile numbers are reported", "[geometry]") {
  cfp::Random random(43, "p3p");
  const Problem<double> good = make_problem<double>(random);
  auto bad = good;
  bad.world[2] = 2 * good.world[1] - good.world[0];
  CHECK(p3p(bad).status == Status::degenerate);
  bad = good;
  bad.world[1] = good.world[0];
  CHECK(p3p(bad).status == Status::degenerate);
  bad.world[2] = good.world[0];
  CHECK(p3p(bad).status == Status::degenerate);
  bad = good;
  bad.rays[1].setZero();
  CHECK(p3p(bad).status == Status::degenerate);
  for (const double value : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    bad = good;
    bad.world[1].y() = value;
    CHECK(p3p(bad).status == Status::invalid_input);
    bad = good;
    bad.rays[2].x() = value;
    CHECK(p3p(bad).status == Status::invalid_input);
  }
  for (const double value : {1e300, -1e300, 1e-300, 5e-324}) {
    bad = good;
    bad.world[1].y() = value;
    bad.rays[0].x() = value;
    const auto solutions = p3p(bad);
    for (int s = 0; s < solutions.count; ++s) {
      CHECK(solutions.T_cam_world[std::size_t(s)].rotation.allFinite());
      CHECK(solutions.T_cam_world[std::size_t(s)].translation.allFinite());
    }
  }
}

TEST_CASE("P3P allocates nothing", "[geometry]") {
  cfp::Random random(44, "p3p");
  const Problem<double> problem = make_problem<double>(random);
  CHECK(cfp_test::allocations_in([&] { (void)p3p(problem); }) == 0);
}
