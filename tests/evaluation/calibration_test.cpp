#include "cfp/evaluation/calibration.hpp"

#include <limits>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"

namespace {

template <typename Scalar>
struct Samples {
  std::vector<Scalar> probability;
  std::vector<char> is_static;
};

/// Probabilities on a grid of 1 / levels, so that ties abound; labels that agree with them.
template <typename Scalar>
Samples<Scalar> random_samples(cfp::Random& random, std::size_t n, std::uint32_t levels) {
  Samples<Scalar> s;
  for (std::size_t i = 0; i < n; ++i) {
    s.probability.push_back(static_cast<Scalar>(random.index(levels + 1)) / static_cast<Scalar>(levels));
    s.is_static.push_back(random.uniform() < static_cast<double>(s.probability.back()) ? 1 : 0);
  }
  return s;
}

template <typename Scalar>
double auc_by_pairs(const Samples<Scalar>& s) {
  double wins = 0, pairs = 0;
  for (std::size_t i = 0; i < s.probability.size(); ++i) {
    for (std::size_t j = 0; j < s.probability.size(); ++j) {
      if (s.is_static[i] == 0 || s.is_static[j] != 0) continue;
      pairs += 1;
      wins += s.probability[i] > s.probability[j] ? 1 : s.probability[i] == s.probability[j] ? 0.5 : 0;
    }
  }
  return wins / pairs;
}

}  // namespace

TEMPLATE_TEST_CASE("AUC equals the count over all pairs, ties included", "[evaluation]", float, double) {
  cfp::Random random(51, "auc");
  for (int round = 0; round < 100; ++round) {
    const auto s = random_samples<TestType>(random, 20 + random.index(60), 1 + random.index(30));
    const auto result = cfp::roc_auc(s.probability, s.is_static);
    REQUIRE(result.status == cfp::Status::ok);
    CHECK_THAT(result.auc, WithinAbs(auc_by_pairs(s), 1e-12));
    CHECK((result.used == s.probability.size() && result.skipped == 0));
  }
}

TEST_CASE("Perfect, reversed and constant scores have AUC 1, 0 and one half", "[evaluation]") {
  const std::vector<double> rising{0.1, 0.2, 0.8, 0.9}, falling{9, 8, -2, -3}, same(4, 0.3);
  const std::vector<char> labels{0, 0, 1, 1};
  const auto auc = [&](const std::vector<double>& scores) { return cfp::roc_auc(scores, labels).auc; };
  CHECK(auc(rising) == 1);
  CHECK(auc(falling) == 0);
  CHECK(auc(same) == 0.5);
}

TEMPLATE_TEST_CASE("Brier, ECE and the table equal those by hand", "[evaluation]", float, double) {
  constexpr TestType low(0.25), high(0.75);
  const Samples<TestType> s{{low, low, low, low, high, high, 1, 1}, {0, 1, 1, 1, 1, 1, 1, 1}};
  const auto r = cfp::evaluate_calibration<4>(s.probability, s.is_static);
  CHECK(r.status == cfp::Status::ok);
  CHECK(r.used == 8);
  CHECK_THAT(r.brier, WithinAbs((1 * 0.0625 + 3 * 0.5625 + 2 * 0.0625) / 8, 1e-15));
  CHECK_THAT(r.static_fraction, WithinAbs(7.0 / 8, 1e-15));
  CHECK(r.table[0].count == 0);
  CHECK(r.table[1].count == 4);
  CHECK_THAT(r.table[1].static_fraction, WithinAbs(0.75, 1e-12));
  CHECK(r.table[3].count == 4);  // 0.75 opens the last bin and 1 belongs to it
  CHECK_THAT(r.table[3].mean_probability, WithinAbs(0.875, 1e-12));
  CHECK_THAT(r.expected_calibration_error, WithinAbs(0.5 * 0.5 + 0.5 * 0.125, 1e-12));
  CHECK_THAT(r.auc, WithinAbs(auc_by_pairs(s), 1e-12));
}

TEST_CASE("Labels drawn from the probabilities are found calibrated, squashed ones are not", "[evaluation]") {
  cfp::Random random(52, "calibrated");
  auto s = random_samples<double>(random, 200000, 1000);
  const auto good = cfp::evaluate_calibration(s.probability, s.is_static);
  CHECK(good.expected_calibration_error < 0.005);
  CHECK_THAT(good.brier, WithinAbs(1.0 / 6, 0.003));  // E p (1 - p) for uniform p
  for (double& p : s.probability) p = 0.5 + 0.25 * (p - 0.5);
  const auto squashed = cfp::evaluate_calibration(s.probability, s.is_static);
  CHECK(squashed.expected_calibration_error > 0.15);
  CHECK_THAT(squashed.auc, WithinAbs(good.auc, 1e-12));
}

TEMPLATE_TEST_CASE("Hostile probabilities are skipped, and everything stays finite", "[evaluation]", float, double) {
  constexpr TestType nan = std::numeric_limits<TestType>::quiet_NaN(), inf = std::numeric_limits<TestType>::infinity();
  constexpr TestType huge = (std::numeric_limits<TestType>::max)(), tiny = std::numeric_limits<TestType>::denorm_min();
  const Samples<TestType> s{{nan, inf, -inf, -1, 2, huge, -tiny, 0, 1, 0, tiny}, {0, 1, 0, 1, 0, 1, 0, 1, 0, 0, 1}};
  const auto r = cfp::evaluate_calibration(s.probability, s.is_static);
  CHECK(r.skipped == 7);
  CHECK(r.used == 4);
  for (const double x : {r.auc, r.brier, r.expected_calibration_error, r.static_fraction}) CHECK((x >= 0 && x <= 1));
  for (const auto& bin : r.table) {
    CHECK((bin.mean_probability >= 0 && bin.mean_probability <= 1));
    CHECK((bin.static_fraction >= 0 && bin.static_fraction <= 1));
  }

  const auto none = cfp::evaluate_calibration(std::vector<TestType>(), {});
  CHECK(none.status == cfp::Status::not_enough_data);
  CHECK(none.auc == 0.5);
  const Samples<TestType> one{{TestType(0.25)}, {1}};
  const auto single = cfp::evaluate_calibration(one.probability, one.is_static);
  CHECK(single.status == cfp::Status::degenerate);
  CHECK(single.auc == 0.5);
  CHECK(single.brier == 0.5625);
}
