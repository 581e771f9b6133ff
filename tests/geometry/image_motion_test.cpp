#include "cfp/geometry/image_motion.hpp"

#include <array>
#include <cmath>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"

namespace {

template <typename Scalar>
struct Pairs {
  std::vector<std::array<Scalar, 2>> previous, current;

  void add(double x, double y, double u, double v) {
    previous.push_back({Scalar(x), Scalar(y)});
    current.push_back({Scalar(u), Scalar(v)});
  }
  [[nodiscard]] bool find(cfp::Matrix3<Scalar>& motion) const {
    std::vector<Scalar> work;
    return cfp::image_motion(cfp::PointSpan<Scalar, 2>(previous), cfp::PointSpan<Scalar, 2>(current), work, motion);
  }
};

/// Pixels all over the image, moved by H but for a share that goes anywhere.
template <typename Scalar>
Pairs<Scalar> moved(const cfp::Matrix3<double>& H, int n, double wrong, double noise_px, cfp::Random& random) {
  Pairs<Scalar> pairs;
  for (int i = 0; i < n; ++i) {
    const double x = random.uniform(0, 640), y = random.uniform(0, 480);
    const cfp::Vector3<double> q = H * cfp::Vector3<double>(x, y, 1);
    if (random.uniform() < wrong)
      pairs.add(x, y, random.uniform(0, 640), random.uniform(0, 480));
    else
      pairs.add(x, y, q.x() + noise_px * random.normal(), q.y() + noise_px * random.normal());
  }
  return pairs;
}

cfp::Matrix3<double> similarity(double scale, double angle, double x, double y) {
  cfp::Matrix3<double> H;
  H << scale * std::cos(angle), -scale * std::sin(angle), x, scale * std::sin(angle), scale * std::cos(angle), y, 0, 0,
      1;
  return H;
}

}  // namespace

TEMPLATE_TEST_CASE("The motion of an image that shifts, rolls and grows is found among mismatches", "[geometry]", float,
                   double) {
  const double wrong = GENERATE(0.0, 0.1, 0.3), angle = GENERATE(0.0, 0.05, -0.1);
  const double x = GENERATE(-80.0, 30.0);
  cfp::Random random(1, "image motion");
  const cfp::Matrix3<double> H = similarity(1.03, angle, x, 12);
  cfp::Matrix3<TestType> found;
  REQUIRE(moved<TestType>(H, 300, wrong, 0, random).find(found));
  for (const auto& [u, v] : {std::array{0.0, 0.0}, std::array{640.0, 0.0}, std::array{320.0, 480.0}}) {
    const cfp::Vector3<double> pixel(u, v, 1);
    INFO(u << ' ' << v << ", wrong " << wrong << ", angle " << angle << ", x " << x);
    CHECK((found.template cast<double>() * pixel - H * pixel).norm() < 0.5);
  }
}

TEST_CASE("Noise takes little of a large motion, and all of one that it hides", "[geometry]") {
  cfp::Random random(2, "image motion");
  cfp::Matrix3<double> found = cfp::Matrix3<double>::Constant(7);
  CHECK_FALSE(moved<double>(similarity(1, 0, 0, 0), 300, 0.03, 0.3, random).find(found));
  CHECK_FALSE(moved<double>(similarity(1, 0, 0.4, 0), 300, 0.03, 0.01, random).find(found));
  CHECK_FALSE(moved<double>(similarity(1, 0, 1, 0), 300, 0.03, 2, random).find(found));
  CHECK(found == cfp::Matrix3<double>::Constant(7));
  REQUIRE(moved<double>(similarity(1, 0, 40, 0), 300, 0.03, 0.5, random).find(found));
  CHECK_THAT(found(0, 2) + 320 * found(0, 0) + 240 * found(0, 1) - 320, WithinAbs(40, 0.5));
}

TEST_CASE("Of the motion past things at many depths little is taken, of a turn beside it much", "[geometry]") {
  cfp::Random random(3, "image motion");
  const auto shift_at_centre = [&](double turn_px, double nearest_m) {
    Pairs<double> pairs;
    for (int i = 0; i < 300; ++i) {
      const double x = random.uniform(0, 640), y = random.uniform(0, 480), z = random.uniform(nearest_m, 8);
      pairs.add(x, y, x + turn_px - 525 * 0.15 / z, y);
    }
    cfp::Matrix3<double> found = cfp::Matrix3<double>::Identity();
    (void)pairs.find(found);
    return found(0, 2) + 320 * found(0, 0) + 240 * found(0, 1) - 320;
  };
  CHECK_THAT(shift_at_centre(0, 1), WithinAbs(0, 8));  // 10 to 79 px, half of them 17 or more
  CHECK_THAT(shift_at_centre(0, 2), WithinAbs(0, 8));  // 10 to 39 px
  CHECK_THAT(shift_at_centre(90, 2), WithinAbs(90 - 16, 8));
}

TEMPLATE_TEST_CASE("Few pairs, pairs at one place and hostile ones give no motion that is not finite", "[geometry]",
                   float, double) {
  cfp::Matrix3<TestType> found;
  CHECK_FALSE(Pairs<TestType>{}.find(found));
  Pairs<TestType> few, one_place, far, thrown_together;
  for (int i = 0; i < 11; ++i) few.add(50 * i, 30 * i * i, 50 * i + 20, 30 * i * i);
  CHECK_FALSE(few.find(found));
  few.add(600, 10, 620, 10);
  CHECK(few.find(found));
  for (int i = 0; i < 50; ++i) one_place.add(100, 100, 120, 100);
  CHECK_FALSE(one_place.find(found));
  cfp::Random random(4, "image motion");
  const auto any = [&] { return random.uniform(-1e6, 1e6); };
  for (int i = 0; i < 50; ++i) far.add(any(), any(), any(), any());
  for (int i = 0; i < 50; ++i) thrown_together.add(any(), any(), 5, 5);
  for (const Pairs<TestType>* pairs : {&far, &thrown_together}) {
    found.setIdentity();
    (void)pairs->find(found);
    CHECK(found.allFinite());
  }
}

TEST_CASE("The image motion allocates nothing once its memory is as large, and repeats its bits", "[geometry]") {
  cfp::Random random(5, "image motion");
  const Pairs<float> pairs = moved<float>(similarity(1, 0.03, 25, -9), 256, 0.2, 0.3, random);
  std::vector<float> work(256);
  cfp::Matrix3<float> first, second;
  const auto find = [&](cfp::Matrix3<float>& motion) {
    (void)cfp::image_motion(cfp::PointSpan<float, 2>(pairs.previous), cfp::PointSpan<float, 2>(pairs.current), work,
                            motion);
  };
  find(first);
  CHECK(cfp_test::allocations_in([&] { find(second); }) == 0);
  CHECK(first == second);
}
