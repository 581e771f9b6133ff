#include "../../examples/slam_report/tables.hpp"

#include <fstream>
#include <iterator>
#include <regex>
#include <sstream>

#include "support/catch.hpp"
#include "support/data.hpp"

using namespace cfp_slam;

namespace {

RunSummary run_of(const std::string& sequence, const std::string& variant, std::uint64_t seed, double ate,
                  std::size_t matched = 100) {
  RunSummary s;
  s.sequence = sequence;
  s.variant = variant;
  s.seed = seed;
  s.detector = "text";
  s.alignment = "SE(3)";
  s.frames = s.expected = 100;
  s.matched = matched;
  s.ate_rmse_m = ate;
  s.ate_sd_m = ate / 2;
  s.rpe_delta_s = 1;
  s.rpe_rmse_m = 2 * ate;
  return s;
}

const std::string walking_xyz = "rgbd_dataset_freiburg3_walking_xyz";

/// The rows "fr3/..." of one table of the paper: numbers, or NaN for "/".
std::vector<std::vector<double>> rows_of_tex(const std::string& tex, const std::string& label) {
  const std::size_t begin = tex.find("\\label{" + label + "}"), end = tex.find("\\end{tabular}", begin);
  REQUIRE(begin != std::string::npos);
  std::istringstream lines(tex.substr(begin, end - begin));
  std::vector<std::vector<double>> rows;
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind("fr3/", 0) != 0) continue;
    line = std::regex_replace(line, std::regex("\\\\(textbf|underline|bottomrule)|[{}\\\\]"), " ");
    std::istringstream cells(line.substr(line.find('&') + 1));
    rows.emplace_back();
    for (std::string cell; std::getline(cells, cell, '&');)
      rows.back().push_back(cell.find('/') != std::string::npos ? not_known : std::stod(cell));
  }
  return rows;
}

template <std::size_t N>
void check_against_tex(const std::string& tex, const std::string& label, const std::array<PublishedRow, N>& published) {
  const auto rows = rows_of_tex(tex, label);
  REQUIRE(rows.size() == paper_sequence_count);
  for (std::size_t q = 0; q < rows.size(); ++q) {
    REQUIRE(rows[q].size() == 2 * N);
    for (std::size_t system = 0; system < N; ++system) {
      INFO(label << ' ' << paper_names[q] << ' ' << published[system].system);
      const PublishedError& e = published[system].error[q];
      const double rmse = rows[q][2 * system], sd = rows[q][2 * system + 1];
      CHECK((std::isnan(rmse) ? std::isnan(e.rmse) : e.rmse == rmse));
      CHECK((std::isnan(sd) ? std::isnan(e.sd) : e.sd == sd));
    }
  }
}

}  // namespace

TEST_CASE("The published rows are the paper's, figure by figure", "[slam]") {
  CFP_REQUIRE_DATA(file, "../paper/cfp-slam.tex");
  std::ifstream stream(file);
  const std::string tex{std::istreambuf_iterator<char>(stream), {}};
  check_against_tex(tex, "ATE-lable", paper_ate_m);
  check_against_tex(tex, "T-RPE-lable", paper_rpe_m);
  check_against_tex(tex, "R-RPE-lable", paper_rpe_deg);
  check_against_tex(tex, "Ab-ATE-lable", paper_ablation_m);
  const std::size_t times = tex.find("THE AVERAGE RUNNING TIME");
  for (const char* row :
       {"CFP-SLAM                      & 12.44   & 0.07 & 17.93 & 1.76                        & 3.66 & 42.7 ",
        "CFP-SLAM-                     & 12.44   & 0.07 & /     & 1.76                        & 3.66 & 24.77 "}) {
    CHECK(tex.find(row, times) != std::string::npos);
  }
}

TEST_CASE("The paper's two frame times differ by its object stage", "[slam]") {
  const auto difference = [](Module m) { return paper_milliseconds(m, "cfp") - paper_milliseconds(m, "cfp-minus"); };
  CHECK(std::abs(difference(Module::tracking) - 17.93) < 1e-9);
  CHECK(std::abs(difference(Module::coarse) - 17.93) < 1e-9);
  CHECK(difference(Module::fine) == 0);
  CHECK(std::isnan(paper_milliseconds(Module::coarse, "no-ksp")));
  CHECK(std::isnan(paper_milliseconds(Module::tracking, "plain")));
}

TEST_CASE("Only TUM's own sequences stand beside published figures", "[slam]") {
  CHECK(paper_sequence(walking_xyz) == 4);
  CHECK(paper_sequence("/data/tum/rgbd_dataset_freiburg3_sitting_rpy/") == 3);
  for (const char* other :
       {"walking_xyz", "tum_fr3_walking_halfsphere_30", "rgbd_dataset_freiburg3_walking_xyz_validation", "", "/",
        "rgbd_dataset_freiburg1_xyz", "rgbd_dataset_freiburg3_"}) {
    CHECK(paper_sequence(other) == paper_sequence_count);
  }
  const std::string ours = tables_markdown({run_of("walking_xyz", "cfp", 1, 0.01)}, "");
  CHECK(ours.find("ORB-SLAM2") == std::string::npos);
  CHECK(ours.find("V3D-SLAM") == std::string::npos);
}

TEST_CASE("Table I gives the median of the seeds, their spread and the improvement", "[slam]") {
  std::vector<RunSummary> runs;
  std::uint64_t seed = 0;
  for (const double ate : {0.4, 0.2, 0.3}) runs.push_back(run_of("walking_xyz", "plain", ++seed, ate));
  for (const double ate : {0.012, 0.010, 0.015}) runs.push_back(run_of("walking_xyz", "cfp", ++seed, ate));
  const Table table = error_table(runs, error_kinds[0], "protocol");
  REQUIRE(table.rows.size() == 1);
  const auto& row = table.rows[0];
  REQUIRE(row.size() == table.header.size());
  CHECK(row[1].text == "0.3000");
  CHECK(row[1].range == "0.2000–0.4000");
  CHECK(row[2].text == "0.1500");
  CHECK(row[3].text == "100.0 %");
  CHECK(row[4].text == "–");  // no cfp-minus
  CHECK(row[7].text == "0.0120");
  CHECK(row[7].rank == Rank::best);
  CHECK(row[1].rank == Rank::second);
  CHECK(row[10].text == "96.0 %");
  CHECK(row[11].text == "3");
}

TEST_CASE("A small error over few poses wins nothing", "[slam]") {
  const std::vector<RunSummary> runs{run_of("walking_rpy", "plain", 1, 0.4), run_of("walking_rpy", "cfp", 1, 0.02),
                                     run_of("walking_rpy", "no-mdc", 1, 0.001, 30)};
  const Table table = ablation_table(runs, "");
  REQUIRE(table.header == std::vector<std::string>{"sequence", "plain", "cfp", "no-mdc"});
  CHECK(table.rows[0][2].rank == Rank::best);
  CHECK(table.rows[0][3].rank == Rank::none);
  CHECK(table.rows[0][3].range == "30.0 %");
}

TEST_CASE("Equal figures as printed share a rank; one figure alone has none", "[slam]") {
  std::vector<Cell> cells(3);
  rank({&cells[0], &cells[1], &cells[2]}, {0.01001, 0.01002, 0.02}, 4);
  CHECK(cells[0].rank == Rank::best);
  CHECK(cells[1].rank == Rank::best);
  CHECK(cells[2].rank == Rank::second);
  std::vector<Cell> alone(2);
  rank({&alone[0], &alone[1]}, {0.01, not_known}, 4);
  CHECK(alone[0].rank == Rank::none);
}

TEST_CASE("TUM sequences bring the paper's and the best published rows, with evidence, ours among them", "[slam]") {
  const std::vector<RunSummary> runs{run_of(walking_xyz, "plain", 1, 0.5), run_of(walking_xyz, "cfp", 1, 0.0139),
                                     run_of("own_room", "cfp", 1, 0.02)};
  const Table table = published_error_table(runs, error_kinds[0], "");
  REQUIRE(table.header == std::vector<std::string>{"system", "evidence", "fr3/w/xyz"});
  const auto row = [&](const std::string& system) {
    for (const auto& r : table.rows) {
      if (r[0].text == system) return r;
    }
    return std::vector<Cell>(3);
  };
  CHECK(row("CFP-SLAM (paper)")[2].text == "0.0141");
  CHECK(row("CFP-SLAM (paper)")[1].text == "P");
  CHECK(row("ORB-SLAM2 (paper)")[1].text == "2");
  CHECK(row("DFS-SLAM")[2].text == "0.013");  // as many digits as published
  CHECK(row("WF-SLAM")[2].rank == Rank::best);
  CHECK(row("ours: cfp")[2].text == "0.0139");
  CHECK(row("DROID-W [Sim(3)]")[2].text == "0.012");
  CHECK(row("DROID-W [Sim(3)]")[2].rank == Rank::none);
  CHECK(row("ours: cfp-minus").front().text.empty());  // was not run
  for (const auto& r : table.rows) CHECK(r.size() == 3);
}

TEST_CASE("Every table states its protocol", "[slam]") {
  std::vector<RunSummary> runs{run_of(walking_xyz, "plain", 1, 0.5), run_of(walking_xyz, "cfp", 1, 0.02),
                               run_of(walking_xyz, "cfp", 2, 0.03)};
  runs[1].frames = 90;
  runs[1].detector = "/some/folder/text";
  const auto tables = tables_of(runs, "2 cores");
  CHECK(tables.size() == 11);
  for (const Table& table : tables) {
    for (const char* part :
         {"SE(3)", "1.00 s", "n = 1–2 seeds", "90–100 frames", "detector: text", "machine: 2 cores"}) {
      INFO(table.title << ": " << part);
      CHECK(table.protocol.find(part) != std::string::npos);
    }
  }
}

TEST_CASE("Tables of nothing and of runs without any figure are still tables", "[slam]") {
  for (const auto& runs : {std::vector<RunSummary>{}, std::vector<RunSummary>{RunSummary{}}}) {
    for (const std::string& text : {tables_markdown(runs, ""), tables_html(runs, "")}) {
      CHECK(text.find("nan") == std::string::npos);
      CHECK(text.find("inf") == std::string::npos);
      CHECK(text.find("Table V") != std::string::npos);
    }
  }
}

TEST_CASE("Names cannot break out of a cell", "[slam]") {
  const Table table{"t", "", {"a|b"}, {{{"x | <b> *y* _z_ [l](u) walking_xyz", "1|2", Rank::best}}}, "", false, {}};
  const std::string markdown = to_markdown(table);
  CHECK(markdown.find("**x \\| &lt;b> \\*y\\* \\_z\\_ \\[l\\](u) walking_xyz** (1\\|2) |") != std::string::npos);
  CHECK(to_html(table).find("<b>x | &lt;b&gt; *y*") != std::string::npos);
}
