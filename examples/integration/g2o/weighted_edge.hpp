// cfp's weight in a graph of g2o, any version: w rho(s) with the outlier test on s alone. g2o's kernels see w s where
// the weight is in the information matrix; scaled by sqrt(w) they give w rho(s), as rho of scale delta sqrt(w) at w s
// is w times rho of scale delta at s (Huber, Cauchy, Geman-McClure; tests/integration/weighted_edge_test.cpp).
#pragma once

#include <cmath>

namespace cfp_integration {

// [glue]
// Weight w > 0 of an edge whose kernel has been set. information: without the weight, identity / sigma^2. chi2: the
// threshold of the outlier test, 5.991 for two rows, 7.815 for three. An edge of weight 0 is not added to the graph.
template <typename Edge, typename Information>
void SetWeight(Edge& edge, const Information& information, double chi2, double w) {
  edge.setInformation(information * w);
  if (edge.robustKernel()) edge.robustKernel()->setDelta(std::sqrt(chi2 * w));
}

// After computeError(): what the outlier test compares with chi2.
template <typename Edge>
double Chi2WithoutWeight(const Edge& edge, double w) {
  return edge.chi2() / w;
}
// [glue]

}  // namespace cfp_integration
