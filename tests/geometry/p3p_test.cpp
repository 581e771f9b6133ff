#include "cfp/geometry/p3p.hpp"

#include <limits>

#include "cfp/core/random.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/two_view_scene.hpp"

using cfp::p3p;
using cfp::SE3;
using cfp::Status;
using cfp::Vector3;

namespace {

template <typename Scalar>
struct Problem {
  SE3<double> truth;
  std::array<Vector3<Scalar>, 3> rays, world;
};

template <typename Scalar>
Problem<Scalar> make_problem(cfp::Random& random) {
  Problem<Scalar> problem;
  problem.truth.rotation = cfp::so3_exp<double>(random.uniform(0, 3.1) * cfp_test::random_direction(random));
  problem.truth.translation = random.uniform(0, 3) * cfp_test::random_direction(random);
  for (std::size_t i = 0; i < 3; ++i) {
    const Vector3<double> ray(random.uniform(-0.6, 0.6), random.uniform(-0.45, 0.45), 1);
    problem.rays[i] = ray.cast<Scalar>();
    problem.world[i] = (problem.truth.inverse() * (random.uniform(0.5, 5) * ray)).template cast<Scalar>();
  }
  return problem;
}

template <typename Scalar>
double pose_error(const SE3<Scalar>& T, const SE3<double>& truth) {
  return (T.rotation.template cast<double>() - truth.rotation).norm() +
         (T.translation.template cast<double>() - truth.translation).norm();
}

}  // namespace

TEMPLATE_TEST_CASE("The true pose is among the solutions and each solution fits", "[geometry]", float, double) {
  cfp::Random random(41, "p3p");
  constexpr int problems = 20000;
  int exact = 0, close = 0;
  for (int k = 0; k < problems; ++k) {
    const Problem<TestType> problem = make_problem<TestType>(random);
    const auto solutions = p3p<TestType>(problem.rays, problem.world);
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
  std::array<Vector3<double>, 3> world, rays;
  for (std::size_t i = 0; i < 3; ++i) {
    const double angle = 2 * cfp::pi<double> / 3 * double(i) + 0.1;
    world[i] = Vector3<double>(std::cos(angle), std::sin(angle), 0);
    rays[i] = world[i] + Vector3<double>(0, 0, 2.5);
  }
  const auto solutions = p3p<double>(rays, world);
  REQUIRE(solutions.count == 4);
  for (int a = 0; a < 4; ++a) {
    for (int b = 0; b < a; ++b)
      CHECK(pose_error(solutions.T_cam_world[std::size_t(a)], solutions.T_cam_world[std::size_t(b)]) > 1e-3);
  }
}

TEST_CASE("The scene's unit, the world frame, the order of points and the rays' lengths do not matter", "[geometry]") {
  cfp::Random random(42, "p3p");
  for (int k = 0; k < 200; ++k) {
    const Problem<double> problem = make_problem<double>(random);
    const auto expected = p3p<double>(problem.rays, problem.world);
    auto moved = problem;
    const double unit = k % 2 == 0 ? 1e6 : 1e-6;
    for (Vector3<double>& x : moved.world) x *= unit;
    for (Vector3<double>& y : moved.rays) y *= random.uniform(0.01, 100);
    std::swap(moved.rays[0], moved.rays[2]);
    std::swap(moved.world[0], moved.world[2]);
    const auto solutions = p3p<double>(moved.rays, moved.world);
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
  CHECK(p3p<double>(bad.rays, bad.world).status == Status::degenerate);
  bad = good;
  bad.world[1] = good.world[0];
  CHECK(p3p<double>(bad.rays, bad.world).status == Status::degenerate);
  bad.world[2] = good.world[0];
  CHECK(p3p<double>(bad.rays, bad.world).status == Status::degenerate);
  bad = good;
  bad.rays[1] = good.rays[0];
  CHECK(p3p<double>(bad.rays, bad.world).status == Status::degenerate);
  bad.rays[1].setZero();
  CHECK(p3p<double>(bad.rays, bad.world).status == Status::degenerate);
  for (const double value : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    bad = good;
    bad.world[1].y() = value;
    CHECK(p3p<double>(bad.rays, bad.world).status == Status::invalid_input);
    bad = good;
    bad.rays[2].x() = value;
    CHECK(p3p<double>(bad.rays, bad.world).status == Status::invalid_input);
  }
  for (const double value : {1e300, -1e300, 1e-300, 5e-324}) {
    bad = good;
    bad.world[1].y() = value;
    bad.rays[0].x() = value;
    const auto solutions = p3p<double>(bad.rays, bad.world);
    for (int s = 0; s < solutions.count; ++s) {
      CHECK(solutions.T_cam_world[std::size_t(s)].rotation.allFinite());
      CHECK(solutions.T_cam_world[std::size_t(s)].translation.allFinite());
    }
  }
}

TEST_CASE("P3P allocates nothing", "[geometry]") {
  cfp::Random random(44, "p3p");
  const Problem<double> problem = make_problem<double>(random);
  CHECK(cfp_test::allocations_in([&] { (void)p3p<double>(problem.rays, problem.world); }) == 0);
}
