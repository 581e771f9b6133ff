#include "cfp/geometry/common_shift.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/math/chi_squared.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"

namespace {

using V3 = cfp::Vector3<double>;

const cfp::PinholeCamera<double> pinhole{535.4, 539.2, 320.1, 247.6};
constexpr double sigma_px = 0.3;

/// Points of somebody about 2 m away, seen before and after.
struct Object {
  std::vector<std::array<double, 2>> previous, current;
  std::vector<double> depths, relative_sigmas;
  std::vector<std::int32_t> members;

  [[nodiscard]] double shift(const cfp::UncertainMotion<double>& motion, double shared_error_px = 0) const {
    return cfp::common_shift({previous, current, depths, relative_sigmas}, cfp::span<const std::int32_t>(members),
                             motion, pinhole, sigma_px, cfp::MotionDistanceOptions(), shared_error_px);
  }
};

Object make_object(const cfp::SE3<double>& T_cur_prev, const V3& step, int points, cfp::Random& random) {
  Object object;
  for (int i = 0; i < points; ++i) {
    const cfp::Vector2<double> p(random.uniform(250, 400), random.uniform(80, 420));
    const double z = random.uniform(1.9, 2.1);
    V3 ray;
    cfp::Vector2<double> q(0, 0);
    (void)pinhole.unproject(p, ray);
    (void)pinhole.project(T_cur_prev * V3(ray * z) + step, q);
    object.previous.push_back({p.x(), p.y()});
    object.current.push_back({q.x() + sigma_px * random.normal(), q.y() + sigma_px * random.normal()});
    object.depths.push_back(z + cfp::DepthNoise().sigma_m(z) * random.normal());
    object.members.push_back(i);
  }
  return object;
}

cfp::SE3<double> drawn_motion(cfp::Random& random, double metres = 0.02, double radians = 0.01) {
  cfp::Vector6<double> xi;
  for (int i = 0; i < 6; ++i) xi[i] = (i < 3 ? metres : radians) * random.normal();
  return cfp::se3_exp(xi);
}

}  // namespace

TEST_CASE("The common shift of what is at rest has three degrees of freedom", "[geometry][common_shift]") {
  const double error_m = GENERATE(0.0, 0.004), error_rad = error_m / 4;
  cfp::Random random(1, "at rest");
  double sum = 0;
  int above = 0;
  constexpr int runs = 2000;
  for (int i = 0; i < runs; ++i) {
    const cfp::SE3<double> T = drawn_motion(random);
    const Object object = make_object(T, V3::Zero(), 40, random);
    // The motion errs as its covariance says: by much more than the mean of forty pairs.
    const double shift = object.shift({drawn_motion(random, error_m, error_rad) * T, error_m, error_rad});
    sum += shift;
    above += cfp::chi_squared_survival(shift, 3) < 0.05 ? 1 : 0;
  }
  CHECK(sum / runs > 2.4);
  CHECK(sum / runs < 3.3);
  CHECK(above < 0.065 * runs);
}

TEST_CASE("A motion that errs by more than it says is taken for a shift", "[geometry][common_shift]") {
  cfp::Random random(2, "exact");
  for (int i = 0; i < 100; ++i) {
    const cfp::SE3<double> T = drawn_motion(random);
    const Object object = make_object(T, V3::Zero(), 40, random);
    const cfp::SE3<double> wrong{T.rotation, T.translation + V3(0.004, 0, 0)};
    CHECK(object.shift(cfp::UncertainMotion<double>(wrong)) > 3 * object.shift({wrong, 0.004, 0.0}));
  }
}

TEST_CASE("What moves together by less than its noise is found, along the axis, too", "[geometry][common_shift]") {
  cfp::Random random(3, "together");
  const V3 step = GENERATE(V3(0.0011, 0, 0), V3(0, -0.0011, 0), V3(0, 0, 0.012));  // 0.3 px, on average
  int found = 0;
  for (int i = 0; i < 200; ++i) {
    const cfp::SE3<double> T = drawn_motion(random);
    const Object object = make_object(T, step, 60, random);
    found += object.shift(cfp::UncertainMotion<double>(T)) > 11.3 ? 1 : 0;  // 1 % at rest
  }
  CHECK(found >= 190);
}

TEST_CASE("A quarter of mismatches neither makes nor hides a common shift", "[geometry][common_shift]") {
  cfp::Random random(4, "mismatches");
  int at_rest = 0, moving = 0;
  for (int i = 0; i < 200; ++i) {
    const cfp::SE3<double> T = drawn_motion(random);
    for (const bool moves : {false, true}) {
      Object object = make_object(T, moves ? V3(0.003, 0, 0) : V3::Zero(), 60, random);
      for (std::size_t k = 0; k < 15; ++k) object.current[k] = {random.uniform(200, 450), random.uniform(30, 470)};
      (moves ? moving : at_rest) += object.shift(cfp::UncertainMotion<double>(T)) > 16.3 ? 1 : 0;  // 0.1 % at rest
    }
  }
  CHECK(at_rest <= 4);
  CHECK(moving >= 196);
}

TEST_CASE("What neighbours err by together no number of pairs makes smaller", "[geometry][common_shift]") {
  cfp::Random random(5, "most");
  const cfp::UncertainMotion<double> motion(drawn_motion(random));
  const Object object = make_object(motion.T_cur_prev, V3(0.002, 0, 0), 60, random);
  const double all = object.shift(motion), a_quarter = object.shift(motion, 0.25 * sigma_px),
               half = object.shift(motion, 0.5 * sigma_px);
  CHECK(all > 3 * a_quarter);
  CHECK_THAT(a_quarter, WithinAbs(16.0 / 4.75 * half, 0.03 * a_quarter));  // 60 pairs as 60/4.75 and 60/16, some less
}

TEST_CASE("A common shift of nothing is none, and never NaN", "[geometry][common_shift]") {
  cfp::Random random(6, "nothing");
  const cfp::UncertainMotion<double> motion(drawn_motion(random));
  CHECK(Object().shift(motion) == 0);
  const double bad = GENERATE(std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e300);
  const Object good = make_object(motion.T_cur_prev, V3(0.002, 0, 0), 30, random);
  Object object = good;
  object.previous[3][0] = object.current[7][1] = object.depths[11] = bad;
  const double shift = object.shift(motion);
  CHECK(std::isfinite(shift));
  CHECK(shift > 0.5 * good.shift(motion));
  for (auto& pixel : object.current) pixel[0] = bad;
  CHECK(std::isfinite(object.shift(motion)));
  cfp::UncertainMotion<double> no_motion(motion);
  no_motion.covariance.setConstant(bad);
  CHECK(good.shift(no_motion) == 0);
  Object alone = good;
  alone.members = {4};
  CHECK(std::isfinite(alone.shift(motion)));
}

TEST_CASE("Pairs without a depth take no part in a common shift", "[geometry][common_shift]") {
  cfp::Random random(7, "unknown");
  const cfp::UncertainMotion<double> motion(drawn_motion(random));
  Object object = make_object(motion.T_cur_prev, V3(0.004, 0, 0), 60, random), half = object;
  for (std::size_t i = 30; i < 60; ++i) object.depths[i] = i % 2 == 0 ? -1 : std::numeric_limits<double>::quiet_NaN();
  half.members.resize(30);
  CHECK(object.shift(motion) == half.shift(motion));
  CHECK(object.shift(motion) > 30);
  object.depths.clear();
  CHECK(object.shift(motion) == 0);
}

TEST_CASE("The common shift allocates nothing, and float sees what double sees", "[geometry][common_shift]") {
  cfp::Random random(8, "float");
  const cfp::UncertainMotion<double> motion(drawn_motion(random), 0.001, 0.0002);
  const Object object = make_object(motion.T_cur_prev, V3(0.002, 0, 0), 60, random);
  std::vector<std::array<float, 2>> previous, current;
  for (std::size_t i = 0; i < object.previous.size(); ++i) {
    const auto as_float = [](const std::array<double, 2>& p) {
      return std::array<float, 2>{static_cast<float>(p[0]), static_cast<float>(p[1])};
    };
    previous.push_back(as_float(object.previous[i])), current.push_back(as_float(object.current[i]));
  }
  const std::vector<float> depths(object.depths.begin(), object.depths.end());
  const std::size_t before = cfp_test::allocation_count();
  const double shift =
      cfp::common_shift({previous, current, depths}, cfp::span<const std::int32_t>(object.members),
                        motion.cast<float>(), pinhole.cast<float>(), 0.3F, cfp::MotionDistanceOptions(), 0.05);
  CHECK(cfp_test::allocation_count() == before);
  CHECK_THAT(shift, WithinAbs(object.shift(motion, 0.05), 0.02 * shift));
}

TEST_CASE("A pair of thrice the noise says as much as one whose pixels all err by thrice as much",
          "[geometry][common_shift]") {
  cfp::Random random(11, "relative");
  const cfp::SE3<double> T{cfp::so3_exp<double>({0.01, -0.005, 0.002}), V3(0.01, 0, 0.02)};
  Object object = make_object(T, V3(0.004, 0, 0), 60, random);
  const cfp::UncertainMotion<double> motion(T, 0.0005, 0.0002);
  const double alike = object.shift(motion);
  object.relative_sigmas.assign(object.depths.size(), 1.0);
  CHECK(object.shift(motion) == alike);
  object.relative_sigmas.assign(object.depths.size(), 3.0);
  CHECK_THAT(object.shift(motion), WithinAbs(cfp::common_shift({object.previous, object.current, object.depths},
                                                               cfp::span<const std::int32_t>(object.members), motion,
                                                               pinhole, 3 * sigma_px, cfp::MotionDistanceOptions(), 0),
                                             1e-9 * alike));
  CHECK(object.shift(motion) < 0.8 * alike);
  // Pairs of no sensible noise take no part.
  object.relative_sigmas.assign(object.depths.size(), std::numeric_limits<double>::quiet_NaN());
  CHECK(object.shift(motion) == 0);
  object.relative_sigmas.assign(object.depths.size(), 0);
  CHECK(object.shift(motion) == 0);
}
