// The formulas take dual numbers: values as for double, derivatives as central differences say.
#include <ceres/jet.h>

#include "cfp/math/chi_squared.hpp"
#include "cfp/math/logistic.hpp"
#include "cfp/math/se3.hpp"
#include "support/catch.hpp"

using Jet = ceres::Jet<double, 1>;

namespace {
template <typename Function>
void check_derivative(Function&& function, double x) {
  CAPTURE(x);
  const Jet value = function(Jet(x, 0));
  const double h = 1e-6 * (1 + std::abs(x));
  CHECK_THAT(value.a, WithinAbs(function(x), 1e-14));
  CHECK_THAT(value.v[0], WithinAbs((function(x + h) - function(x - h)) / (2 * h), 1e-8));
}
}  // namespace

TEST_CASE("chi-squared and logistic differentiate", "[math]") {
  for (const int k : {1, 2, 3, 4, 7, 40}) {
    CAPTURE(k);
    for (const double x : {0.4, 0.9, 2.5, 5.991, 20.0, 60.0}) {
      check_derivative([&](const auto& t) { return cfp::chi_squared_survival(t, k); }, x);
      check_derivative([&](const auto& t) { return cfp::chi_squared_density(t, k); }, x);
    }
  }
  for (const double x : {-800.0, -3.0, -0.1, 0.2, 5.0, 800.0})
    check_derivative([](const auto& t) { return cfp::logistic(t); }, x);
}

TEST_CASE("motions differentiate at the identity and away from it", "[math]") {
  using Jet6 = ceres::Jet<double, 6>;
  const Eigen::Vector3d p(0.5, -1, 2);
  for (const double size : {0.0, 1e-9, 0.05, 1.3}) {
    cfp::Vector6<double> xi;
    xi << 0.3, -0.2, 0.1, 0.6, -0.64, 0.48;
    xi *= size;
    cfp::Vector6<Jet6> dual;
    for (int c = 0; c < 6; ++c) dual[c] = Jet6(xi[c], c);
    const cfp::Vector3<Jet6> moved = cfp::se3_exp(dual) * cfp::Vector3<Jet6>(p.cast<Jet6>());
    for (int c = 0; c < 6; ++c) {
      const cfp::Vector6<double> d = cfp::Vector6<double>::Unit(c) * 1e-6;
      const Eigen::Vector3d slope =
          (cfp::se3_exp(cfp::Vector6<double>(xi + d)) * p - cfp::se3_exp(cfp::Vector6<double>(xi - d)) * p) / 2e-6;
      for (int r = 0; r < 3; ++r) CHECK_THAT(moved[r].v[c], WithinAbs(slope[r], 1e-8));
    }
  }
}
