#include "../../examples/slam/report/summary_file.hpp"

#include <limits>

#include "../../examples/slam/report/experiment.hpp"
#include "support/catch.hpp"
#include "support/fake_runs.hpp"

using namespace cfp_slam;

namespace {

/// Field by field, NaN equal to NaN.
bool same(const RunSummary& a, const RunSummary& b) { return to_json_line(a) == to_json_line(b); }

RunSummary full_summary() { return summarize(cfp_test::fake_run({})); }

}  // namespace

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

TEST_CASE("A run without truth, frames or labels has no errors, not errors of zero", "[slam]") {
  for (const RunSummary& s : {RunSummary{}, summarize(RunRecord{})}) {
    CHECK(std::isnan(s.ate_rmse_m));
    CHECK(std::isnan(s.rpe_rmse_deg));
    CHECK(std::isnan(s.first_stage.auc));
    CHECK(std::isnan(coverage_percent(s)));
  }
  CHECK(std::isnan(summarize(RunRecord{}).median_ms[0]));
  auto blind = cfp_test::fake_run({});
  for (FrameRecord& frame : blind.frames) frame.outcome = Outcome::lost;
  cfp_test::evaluate(blind);
  CHECK(std::isnan(summarize(blind).ate_rmse_m));
  CHECK(coverage_percent(summarize(blind)) == 0);
}

TEST_CASE("A summary survives a line of JSON bit for bit", "[slam]") {
  RunSummary s = full_summary();
  s.variant = "with \"quotes\", \\ and\nlines\t{}:,";
  s.detector = "Größe";
  s.seed = 18446744073709551615ULL;
  s.ate_rmse_m = 0.1 + 0.2;
  s.ate_max_m = 5e-324;
  s.rpe_sd_m = -1.7976931348623157e308;
  s.rpe_rmse_deg = not_known;
  const std::string line = to_json_line(s);
  CHECK(line.back() == '\n');
  CHECK(line.find('\n') == line.size() - 1);
  const auto back = from_json_line(line);
  REQUIRE(back.has_value());
  CHECK(same(*back, s));
  CHECK(back->variant == s.variant);
  CHECK(back->ate_rmse_m == s.ate_rmse_m);
  CHECK(back->ate_max_m == s.ate_max_m);
  CHECK(std::isnan(back->rpe_rmse_deg));
  CHECK(back->second_stage.auc == s.second_stage.auc);
  RunSummary infinite = s;
  infinite.ate_rmse_m = std::numeric_limits<double>::infinity();
  CHECK(std::isnan(from_json_line(to_json_line(infinite))->ate_rmse_m));
}

TEST_CASE("A line that is cut off, incomplete or no summary is refused", "[slam]") {
  const std::string line = to_json_line(full_summary());
  for (std::size_t n = 0; n + 2 < line.size(); ++n) REQUIRE_FALSE(from_json_line(line.substr(0, n)).has_value());
  for (const char* other :
       {"", "{}", "[]", "null", "{\"sequence\": \"a\"}", "{\"sequence\"}", "x", "{\"a\": \"\\u00"}) {
    CHECK_FALSE(from_json_line(other).has_value());
  }
  CHECK_FALSE(from_json_line(line + line).has_value());
  std::string wrong = line;
  wrong.replace(wrong.find("300"), 3, "-30");
  CHECK_FALSE(from_json_line(wrong).has_value());
  std::string more = line;
  more.insert(1, "\"of a later version\": 1, ");
  CHECK(from_json_line(more).has_value());
}

TEST_CASE("An experiment resumes from its file, a line cut off included", "[slam]") {
  const auto file = std::filesystem::temp_directory_path() / "cfp_slam_summary_test.jsonl";
  std::filesystem::remove(file);
  CHECK(read_summaries(file).empty());
  RunSummary s = full_summary();
  append_summary(file, s);
  s.seed = 2;
  append_summary(file, s);
  std::filesystem::resize_file(file, std::filesystem::file_size(file) - 100);
  REQUIRE(read_summaries(file).size() == 1);
  s.seed = 3;
  append_summary(file, s);
  const auto runs = read_summaries(file);
  REQUIRE(runs.size() == 2);
  CHECK(runs[0].seed == 1);
  CHECK(runs[1].seed == 3);
  CHECK(same(runs[1], s));
  std::filesystem::remove(file);
}
