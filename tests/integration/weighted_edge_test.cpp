#include "../../examples/integration/g2o/weighted_edge.hpp"

#include <array>
#include <cmath>
#include <memory>

#include "cfp/core/random.hpp"
#include "cfp/core/types.hpp"
#include "cfp/optimization/robust_loss.hpp"
#include "support/catch.hpp"

namespace {

// g2o's base classes as far as weights are concerned: the kernel sees e^T information e, and its first derivative
// scales the information in the normal equations.
struct HuberKernel {
  double delta = 1;
  void setDelta(double d) { delta = d; }
  void robustify(double e2, std::array<double, 2>& rho) const {
    const double root = std::sqrt(e2);
    if (e2 <= delta * delta)
      rho = {e2, 1};
    else
      rho = {2 * root * delta - delta * delta, delta / root};
  }
};

struct Edge {
  cfp::Vector2<double> error = cfp::Vector2<double>::Zero();
  Eigen::Matrix2d information = Eigen::Matrix2d::Identity();
  std::unique_ptr<HuberKernel> kernel = std::make_unique<HuberKernel>();
  void setInformation(const Eigen::Matrix2d& i) { information = i; }
  HuberKernel* robustKernel() const { return kernel.get(); }
  double chi2() const { return error.dot(information * error); }
};

}  // namespace

TEST_CASE("An edge's cost is w rho(s), its pull w rho'(s), and its outlier test sees s", "[integration]") {
  cfp::Random random(3, "weighted edge");
  const cfp::Huber<double> loss{std::sqrt(5.991)};
  for (int i = 0; i < 2000; ++i) {
    const double w = random.uniform(1e-3, 1), sigma = random.uniform(0.5, 4);
    Edge edge;
    edge.error = {random.uniform(-30, 30), random.uniform(-30, 30)};
    cfp_integration::SetWeight(edge, Eigen::Matrix2d(Eigen::Matrix2d::Identity() / (sigma * sigma)), 5.991, w);
    const double s = edge.error.squaredNorm() / (sigma * sigma);
    std::array<double, 2> rho{};
    edge.robustKernel()->robustify(edge.chi2(), rho);
    CHECK(rho[0] == Approx(w * loss.value(s)).epsilon(1e-12));
    CHECK(rho[1] * edge.information(0, 0) == Approx(w * loss.first(s) / (sigma * sigma)).epsilon(1e-12));
    CHECK(cfp_integration::Chi2WithoutWeight(edge, w) == Approx(s).epsilon(1e-12));
  }
  Edge without;
  without.kernel.reset();
  cfp_integration::SetWeight(without, Eigen::Matrix2d(Eigen::Matrix2d::Identity()), 5.991, 0.25);
  CHECK(without.information(1, 1) == 0.25);
}
