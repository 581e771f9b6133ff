#include "cfp/optimization/robust_loss.hpp"

#include <cmath>
#include <limits>

#include "support/catch.hpp"

namespace {

constexpr cfp::LossType all_types[] = {cfp::LossType::trivial, cfp::LossType::huber, cfp::LossType::cauchy,
                                       cfp::LossType::geman_mcclure, cfp::LossType::truncated};

}  // namespace

TEST_CASE("Losses: the derivative equals the central differences of the value", "[optimization]") {
  for (const cfp::LossType type : all_types) {
    for (const double delta : {0.3, 1.0, 2.4476519, 20.0}) {
      const cfp::NamedLoss<double> loss{type, delta};
      for (const double ratio :
           {1e-3, 0.1, 0.5, 0.97, 1.03, 2.0, 17.0, 1e3}) {  // of s to delta^2; the corner itself is left out
        const double s = ratio * delta * delta;
        const double h = 1e-5 * s;
        CAPTURE(static_cast<int>(type), delta, s);
        CHECK(loss.first(s) == Approx((loss.value(s + h) - loss.value(s - h)) / (2 * h)).epsilon(1e-6).margin(1e-12));
      }
    }
  }
}

TEMPLATE_TEST_CASE("Losses: least squares at 0, concave, derivative in [0, 1], finite limits", "[optimization]", float,
                   double) {
  using Scalar = TestType;
  for (const cfp::LossType type : all_types) {
    const cfp::NamedLoss<Scalar> loss{type, Scalar(1.5)};
    CAPTURE(static_cast<int>(type));
    CHECK(loss.value(Scalar(0)) == Scalar(0));
    CHECK(loss.first(Scalar(0)) == Scalar(1));
    Scalar last_value = 0, last_first = 1;
    for (Scalar s = Scalar(1e-6); s < Scalar(1e30); s *= Scalar(1.7)) {
      REQUIRE(loss.value(s) >= last_value);
      REQUIRE(loss.value(s) <= s * (1 + 4 * std::numeric_limits<Scalar>::epsilon()));
      REQUIRE(loss.first(s) <= last_first);
      REQUIRE(loss.first(s) >= 0);
      last_value = loss.value(s), last_first = loss.first(s);
    }
    for (const Scalar s : {std::numeric_limits<Scalar>::denorm_min(), (std::numeric_limits<Scalar>::max)(),
                           std::numeric_limits<Scalar>::infinity()}) {
      CHECK_FALSE(std::isnan(loss.value(s)));
      CHECK_FALSE(std::isnan(loss.first(s)));
    }
    if (type != cfp::LossType::trivial) CHECK(loss.first(std::numeric_limits<Scalar>::infinity()) == 0);
  }
}

TEST_CASE("Losses: closed forms at chosen points", "[optimization]") {
  // delta = 2, s = 16: Huber 2*2*4 - 4; Cauchy 4 ln 5; Geman-McClure 16/5; truncated 4.
  CHECK(cfp::Trivial<double>{}.value(16) == 16);
  CHECK(cfp::Huber<double>{2}.value(16) == 12);
  CHECK(cfp::Cauchy<double>{2}.value(16) == Approx(6.437751649736401));
  CHECK(cfp::GemanMcClure<double>{2}.value(16) == Approx(3.2));
  CHECK(cfp::Truncated<double>{2}.value(16) == 4);
  // At the corner s = delta^2 the quadratic side counts.
  CHECK(cfp::Huber<double>{2}.first(4) == 1);
  CHECK(cfp::Truncated<double>{2}.first(4) == 1);
}

TEST_CASE("Losses: a name that is none is known as such", "[optimization]") {
  for (const cfp::LossType type : all_types) CHECK(cfp::is_loss(type));
  CHECK_FALSE(cfp::is_loss(static_cast<cfp::LossType>(5)));
  CHECK_FALSE(cfp::is_loss(static_cast<cfp::LossType>(77)));
}

TEMPLATE_TEST_CASE("Losses: a packet of residuals gives the scalar results", "[optimization]", float, double) {
  using Scalar = TestType;
  using P = cfp::simd::Packet<Scalar>;
  constexpr int lanes = static_cast<int>(P::lanes);
  for (const cfp::LossType type : all_types) {
    for (Scalar base = 0; base < Scalar(100); base += Scalar(1.37)) {
      Scalar s[lanes], value[lanes], first[lanes];
      for (int i = 0; i < lanes; ++i) s[i] = base * static_cast<Scalar>(i + 1);
      cfp::with_loss<P>(type, P(Scalar(2.5)), [&](const auto& loss) {
        loss.value(P::load(s)).store(value);
        loss.first(P::load(s)).store(first);
      });
      const cfp::NamedLoss<Scalar> loss{type, Scalar(2.5)};
      for (int i = 0; i < lanes; ++i) {
        const Scalar epsilon = 8 * std::numeric_limits<Scalar>::epsilon();
        REQUIRE(value[i] == Approx(loss.value(s[i])).epsilon(epsilon));
        REQUIRE(first[i] == Approx(loss.first(s[i])).epsilon(epsilon));
      }
    }
  }
}

TEST_CASE("Losses: a weight outside equals one inside when the scale goes with its root", "[optimization]") {
  for (const cfp::LossType type : all_types) {
    for (const double w : {0.01, 0.3, 1.0}) {
      for (const double s : {0.0, 0.5, 3.0, 7.0, 400.0}) {
        const cfp::NamedLoss<double> outside{type, 1.7}, inside{type, 1.7 * std::sqrt(w)};
        CHECK(w * outside.value(s) == Approx(inside.value(w * s)).epsilon(1e-12));
      }
    }
  }
}
