// The derivative of a least-squares model's cost by central differences.
#pragma once

#include <Eigen/Core>

#include "cfp/math/normal_equations.hpp"

namespace cfp_test {

/// Along each of the N directions of the model's own update, with steps of h. The model is as minimize_least_squares
/// asks for: cost = linearize(at, equations), moved(at, step).
template <int N, typename Model, typename Parameters>
Eigen::Matrix<double, N, 1> numeric_gradient(const Model& model, const Parameters& at, double h) {
  using Step = Eigen::Matrix<double, N, 1>;
  Step gradient;
  cfp::detail::NormalEquations<N> ignored;
  for (int k = 0; k < N; ++k) {
    const Step step = h * Step::Unit(k);
    const double plus = model.linearize(model.moved(at, step), ignored);
    gradient[k] = (plus - model.linearize(model.moved(at, -step), ignored)) / (2 * h);
  }
  return gradient;
}

}  // namespace cfp_test
