#include "cfp/robust/fundamental_refine_impl.hpp"

#include <vector>

#include "cfp/robust/homography_impl.hpp"
#include "support/catch.hpp"
#include "support/two_view_scene.hpp"

using cfp::Matrix3;
using cfp::detail::FactoredF;
using cfp::detail::PairArrays;
using cfp::detail::SampsonSystem;

namespace {

struct Pairs {
  cfp_test::TwoViewScene<double> scene;
  PairArrays arrays;
  Matrix3<double> truth;  // F of scaled pixels

  Pairs(cfp::Random& random, cfp_test::SceneShape shape) {
    cfp_test::TwoViewOptions options;
    options.pairs = 101;  // no multiple of any packet
    options.noise_px = 0.5;
    options.outlier_share = 0.2;
    options.shape = shape;
    scene = cfp_test::make_two_view_scene<double>(random, options);
    std::vector<double> weights(options.pairs);
    for (double& w : weights) w = random.uniform(0.1, 1);
    arrays.load<double>(scene.prev, scene.cur, weights);
    truth =
        (arrays.scale_cur.matrix().inverse().transpose() * scene.F * arrays.scale_prev.matrix().inverse()).normalized();
  }
};

/// A step of size `size` away from F in a random direction of its seven parameters.
FactoredF perturbed(const Matrix3<double>& F, double size, cfp::Random& random) {
  FactoredF out(F);
  Eigen::Matrix<double, 7, 1> step;
  for (int k = 0; k < 7; ++k) step[k] = size * random.normal();
  out.update(step);
  return out;
}

}  // namespace

TEST_CASE("The gradient of the robust Sampson cost is that of central differences through the update", "[geometry]") {
  cfp::Random random(41, "sampson gradient");
  for (int trial = 0; trial < 20; ++trial) {
    const Pairs pairs(random, cfp_test::SceneShape::volume);
    const auto columns = pairs.arrays.exact_columns();
    const FactoredF F = perturbed(pairs.truth, 0.01, random);
    const double scale = 4 * pairs.arrays.factor * pairs.arrays.factor, h = 1e-6;
    SampsonSystem system;
    cfp::detail::sampson_system(columns, F.matrix(), scale, system);
    const Eigen::Matrix<double, 7, 1> gradient = 2 * F.tangents().transpose() * system.g;
    for (int k = 0; k < 7; ++k) {
      double cost[2];
      for (int side = 0; side < 2; ++side) {
        FactoredF moved = F;
        moved.update((side == 0 ? -h : h) * Eigen::Matrix<double, 7, 1>::Unit(k));
        SampsonSystem at;
        cfp::detail::sampson_system(columns, moved.matrix(), scale, at);
        cost[side] = at.cost;
      }
      CHECK_THAT((cost[1] - cost[0]) / (2 * h), WithinAbs(gradient[k], 1e-5 * gradient.norm()));
    }
  }
}

TEST_CASE("The Hessian's moments are those of the residuals' derivatives up to a hundredth", "[geometry]") {
  cfp::Random random(42, "sampson Hessian");
  const Pairs pairs(random, cfp_test::SceneShape::volume);
  const double scale = 4 * pairs.arrays.factor * pairs.arrays.factor, h = 1e-6;
  const FactoredF F(pairs.truth);
  SampsonSystem system;
  cfp::detail::sampson_system(pairs.arrays.exact_columns(), F.matrix(), scale, system);
  Eigen::Matrix<double, 7, 7> expected = Eigen::Matrix<double, 7, 7>::Zero();
  const auto distance = [&](const Matrix3<double>& f, std::size_t i) {
    const Eigen::Vector3d p(pairs.arrays.array(0)[i], pairs.arrays.array(1)[i], 1),
        q(pairs.arrays.array(2)[i], pairs.arrays.array(3)[i], 1);
    return q.dot(f * p) / std::sqrt((f * p).head<2>().squaredNorm() + (f.transpose() * q).head<2>().squaredNorm());
  };
  for (std::size_t i = 0; i < pairs.arrays.size; ++i) {
    Eigen::Matrix<double, 7, 1> J;
    for (int k = 0; k < 7; ++k) {
      FactoredF minus = F, plus = F;
      minus.update(-h * Eigen::Matrix<double, 7, 1>::Unit(k));
      plus.update(h * Eigen::Matrix<double, 7, 1>::Unit(k));
      J[k] = (distance(plus.matrix(), i) - distance(minus.matrix(), i)) / (2 * h);
    }
    const double d = distance(F.matrix(), i), share = 1 / (1 + d * d / scale);
    expected += pairs.arrays.weights()[i] * share * share / scale * J * J.transpose();
  }
  const Eigen::Matrix<double, 7, 7> H = F.tangents().transpose() * system.H * F.tangents();
  CHECK((H - expected).norm() < 0.01 * expected.norm());
}

TEST_CASE("Refinement never raises the cost and agrees between float and double", "[geometry]") {
  cfp::Random random(43, "refine");
  for (int trial = 0; trial < 20; ++trial) {
    const Pairs pairs(random, cfp_test::SceneShape::volume);
    const double scale = 4 * pairs.arrays.factor * pairs.arrays.factor;
    const FactoredF start = perturbed(pairs.truth, 0.003, random);
    SampsonSystem before;
    cfp::detail::sampson_system(pairs.arrays.exact_columns(), start.matrix(), scale, before);
    FactoredF exact = start, fast = start;
    const double cost = cfp::detail::refine_fundamental(pairs.arrays.exact_columns(), scale, 50, 1e-10, exact);
    CHECK(cost <= before.cost);
    CHECK_THAT(cfp::detail::refine_fundamental(pairs.arrays.fast_columns(), scale, 50, 1e-6, fast),
               WithinAbs(cost, 1e-3 * cost));
    CHECK_THAT(exact.matrix().norm(), WithinAbs(1, 1e-12));
    CHECK(std::abs(exact.matrix().determinant()) < 1e-12);
    FactoredF hopeless = start;
    CHECK(cfp::detail::refine_fundamental(pairs.arrays.exact_columns(), scale, 50, 1e-10, hopeless, -1e9) ==
          before.cost);
  }
}

TEST_CASE("The homography's normal equations are those of central differences", "[geometry]") {
  cfp::Random random(44, "homography gradient");
  const Pairs pairs(random, cfp_test::SceneShape::plane);
  Matrix3<double> H = Matrix3<double>::Identity();
  cfp::detail::refine_homography(pairs.arrays, 1, 20, H);
  H /= H(2, 2);
  const double limit = 1, h = 1e-6;  // far above every distance: no pair is cut off
  const auto cost = [&](const Matrix3<double>& M) {
    double sum = 0;
    for (std::size_t i = 0; i < pairs.arrays.size; ++i) {
      const double x = cfp::detail::transfer_sq(pairs.arrays, M, i) / limit;
      sum += pairs.arrays.weights()[i] * x / (1 + x);
    }
    return sum * limit / 2;
  };
  for (int k = 0; k < 8; ++k) H(k / 3, k % 3) += 0.01 * random.normal();
  Eigen::Matrix<double, 8, 8> A;
  Eigen::Matrix<double, 8, 1> g;
  cfp::detail::homography_system(pairs.arrays.exact_columns(), H, limit, A, g);
  for (int k = 0; k < 8; ++k) {
    Matrix3<double> minus = H, plus = H;
    minus(k / 3, k % 3) -= h;
    plus(k / 3, k % 3) += h;
    CHECK_THAT((cost(plus) - cost(minus)) / (2 * h), WithinAbs(g[k], 1e-6 * g.norm()));
  }
  CHECK(A.isApprox(A.transpose()));
}
