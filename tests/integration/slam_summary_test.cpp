#include "../../examples/slam_report/summary.hpp"

#include <limits>

#include "../../examples/slam_report/experiment.hpp"
#include "support/catch.hpp"
#include "support/fake_runs.hpp"

using namespace cfp_slam;

TEST_CASE("Quantiles are those of the ranked finite values", "[slam]") {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  CHECK(quantile({3, 1, 2}, 0.5) == 2);
  CHECK(quantile({4, 1, 2, 3}, 0.5) == 2.5);
  CHECK(quantile({nan, 7, inf, -inf}, 0.5) == 7);
  CHECK(std::isnan(quantile({}, 0.5)));
  CHECK(std::isnan(quantile({nan}, 0.5)));
  CHECK(quantile({1, 2, 3, 4, 5}, 0) == 1);
  CHECK(quantile({1, 2, 3, 4, 5}, 1) == 5);
  CHECK(std::abs(quantile({0, 10}, 0.95) - 9.5) < 1e-12);
}

TEST_CASE("The spread of seeds counts runs without a result but does not average them", "[slam]") {
  const Spread s = spread_of({0.3, not_known, 0.1, 0.2});
  CHECK(s.median == 0.2);
  CHECK(s.minimum == 0.1);
  CHECK(s.maximum == 0.3);
  CHECK(s.known == 3);
  CHECK(s.total == 4);
  CHECK(range_text(s, 2) == "0.10–0.30, 3 of 4 runs");
  CHECK(range_text(spread_of({0.1}), 2) == "");
  CHECK(range_text(spread_of({not_known}), 2) == "0 of 1 runs");
  CHECK(std::isnan(spread_of(std::vector<double>{}).median));
}

TEST_CASE("Improvement is the paper field's percentage", "[slam]") {
  // DS-SLAM and its followers: (ORB-SLAM2 - ours) / ORB-SLAM2, here the paper's w/xyz.
  CHECK(std::abs(improvement_percent(0.7214, 0.0141) - 98.05) < 0.005);
  CHECK(improvement_percent(0.0195, 0.0253) < 0);
  CHECK(std::isnan(improvement_percent(0, 1)));
  CHECK(std::isnan(improvement_percent(not_known, 1)));
  CHECK(std::isnan(improvement_percent(1, not_known)));
}

TEST_CASE("A summary holds the record's figures", "[slam]") {
  cfp_test::FakeRun fake;
  fake.lost_from = 100;
  fake.lost_count = 5;
  const RunRecord run = cfp_test::fake_run(fake);
  const RunSummary s = summarize(run);
  CHECK(s.frames == 300);
  CHECK(s.lost == 5);
  CHECK(s.skipped == 1);
  CHECK(s.relocalised == 1);
  CHECK(s.tracked == 293);
  CHECK(s.expected == 300);
  CHECK(s.matched == 294);
  CHECK(s.ate_rmse_m == run.absolute.translation_m.rmse);
  CHECK(s.rpe_sd_deg == run.relative.rotation_deg.standard_deviation);
  CHECK(s.rpe_delta_s == 1);
  CHECK(s.largest_gap_s > 0.19);
  CHECK(s.second_stage.samples == run.second_stage.probability.size());
  CHECK(s.second_stage.auc > s.first_stage.auc);
  // Mapping ran in the keyframes alone: its time is that of those frames.
  CHECK(s.median_ms[static_cast<std::size_t>(Module::mapping)] > 3);
  CHECK(s.p95_ms[static_cast<std::size_t>(Module::tracking)] >=
        s.median_ms[static_cast<std::size_t>(Module::tracking)]);
}

TEST_CASE("Weights count as moving near zero, objects at or below O_Th", "[slam]") {
  RunRecord run;
  run.weight = run.object = {{0.005F, 0.4F, 0.6F, 0.95F, 0.6F, 0.95F}, {1, 1, 1, 1, 0, 0}};
  const RunSummary s = summarize(run);
  CHECK(s.weight.static_lost == 0.25);
  CHECK(s.weight.moving_kept == 1);
  CHECK(s.object.static_lost == 0.75);
  CHECK(s.object.moving_kept == 0.5);
}

TEST_CASE("A run without truth, frames or labels has no errors, not errors of zero", "[slam]") {
  for (const RunSummary& s : {RunSummary{}, summarize(RunRecord{})}) {
    CHECK(std::isnan(s.ate_rmse_m));
    CHECK(std::isnan(s.rpe_rmse_deg));
    CHECK(std::isnan(s.first_stage.auc));
    CHECK(std::isnan(coverage_percent(s)));
  }
  CHECK(std::isnan(summarize(RunRecord{}).median_ms[0]));
  auto blind = cfp_test::fake_run({});
  for (RunFrame& frame : blind.frames) frame.outcome = Outcome::lost;
  cfp_test::evaluate(blind);
  CHECK(std::isnan(summarize(blind).ate_rmse_m));
  CHECK(coverage_percent(summarize(blind)) == 0);
}
