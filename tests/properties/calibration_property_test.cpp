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
    const auto auc = [&](const std::vector<double>& s, const std::vector<char>& l) { return cfp::roc_auc(s, l).auc; };
    double wins = 0, pairs = 0;
    for (std::size_t i = 0; i < grid.size(); ++i) {
      for (std::size_t j = 0; j < grid.size(); ++j) {
        if (y[i] == 0 || y[j] != 0) continue;
        pairs += 1;
        wins += grid[i] > grid[j] ? 1 : grid[i] == grid[j] ? 0.5 : 0;
      }
    }
    RC_ASSERT(std::abs(auc(scores, y) - (pairs > 0 ? wins / pairs : 0.5)) < 1e-12);
    RC_ASSERT(std::abs(auc(scores, y) - auc(grown, y)) < 1e-12);
    RC_ASSERT(std::abs(auc(scores, y) + auc(fallen, y) - 1) < 1e-12);
    RC_ASSERT(std::abs(auc(scores, y) + auc(scores, opposite) - 1) < 1e-12);
  });
}

TEST_CASE("Calibration of any doubles is finite and in range", "[properties]") {
  rc::prop("every figure stays in its documented range; every sample is used or skipped", [] {
    const auto number = rc::gen::oneOf(rc::gen::map(rc::gen::inRange(0, 1001), [](int i) { return i / 1000.0; }),
                                       rc::gen::element(0.0, 1.0, -0.0, 1.0 + 1e-15, std::nan(""), HUGE_VAL, 5e-324),
                                       rc::gen::arbitrary<double>());
    const auto p = *rc::gen::container<std::vector<double>>(number);
    const std::vector<char> y = labels(p.size());
    const auto r = cfp::evaluate_calibration<7>(p, y);
    for (const double x : {r.auc, r.brier, r.expected_calibration_error, r.static_fraction}) {
      RC_ASSERT(x >= 0 && x <= 1);
    }
    std::size_t used = 0, skipped = 0, in_bins = 0;
    long double brier = 0, moving = 0;
    for (std::size_t i = 0; i < p.size(); ++i) {
      const bool valid = p[i] >= 0 && p[i] <= 1;
      skipped += valid ? 0U : 1U;
      if (!valid) continue;
      ++used;
      const long double error = static_cast<long double>(p[i]) - (y[i] != 0 ? 1 : 0);
      brier += error * error, moving += y[i] != 0 ? 0 : 1;
    }
    for (const auto& bin : r.table) in_bins += bin.count;
    RC_ASSERT(r.used == used && r.skipped == skipped && in_bins == used);
    RC_ASSERT((r.status == cfp::Status::not_enough_data) == (used == 0));
    if (used == 0) return;
    const auto total = static_cast<long double>(used);
    RC_ASSERT(std::abs(r.brier - static_cast<double>(brier / total)) < 1e-9);
    RC_ASSERT(std::abs(1 - r.static_fraction - static_cast<double>(moving / total)) < 1e-9);
  });
}
