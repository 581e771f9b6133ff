#include "cfp/evaluation/calibration.hpp"

#include <cmath>
#include <vector>

#include "support/catch.hpp"

#include <rapidcheck/catch.h>

namespace {

std::vector<char> labels(std::size_t n) {
  return *rc::gen::container<std::vector<char>>(n, rc::gen::element<char>(0, 1));
}

}  // namespace

TEST_CASE("AUC follows the order of the scores only", "[properties]") {
  rc::prop("a growing map leaves AUC alone, a falling one mirrors it, as does swapping the labels", [] {
    const auto grid = *rc::gen::container<std::vector<int>>(rc::gen::inRange(-20, 20));
    const std::vector<char> y = labels(grid.size());
    std::vector<double> scores, grown, fallen;
    std::vector<char> opposite;
    for (std::size_t i = 0; i < grid.size(); ++i) {
      scores.push_back(grid[i]);
      grown.push_back(std::exp(0.3 * grid[i]));
      fallen.push_back(-grid[i]);
      opposite.push_back(y[i] == 0 ? 1 : 0);
    }
    cfp::CalibrationWorkspace workspace;
    const auto auc = [&](const std::vector<double>& s, const std::vector<char>& l) {
      return cfp::area_under_curve<double>(s, l, {}, workspace).auc;
    };
    RC_ASSERT(std::abs(auc(scores, y) - auc(grown, y)) < 1e-12);
    RC_ASSERT(std::abs(auc(scores, y) + auc(fallen, y) - 1) < 1e-12);
    RC_ASSERT(std::abs(auc(scores, y) + auc(scores, opposite) - 1) < 1e-12);
  });
}

TEST_CASE("Calibration of any doubles is finite and in range", "[properties]") {
  rc::prop("every figure stays in its documented range; used + skipped + weightless = n", [] {
    const auto p = *rc::gen::arbitrary<std::vector<double>>();
    const auto w = *rc::gen::container<std::vector<double>>(p.size(), rc::gen::arbitrary<double>());
    cfp::CalibrationWorkspace workspace;
    const std::vector<char> y = labels(p.size());
    const auto r = cfp::evaluate_calibration<7, double>(p, y, w, workspace);
    for (const double x :
         {r.auc, r.brier, r.expected_calibration_error, r.largest_calibration_error, r.static_fraction}) {
      RC_ASSERT(x >= 0 && x <= 1);
    }
    RC_ASSERT(r.log_loss >= 0 && r.log_loss < 35);
    RC_ASSERT(r.used + r.skipped <= p.size());
  });
}
