#include "../../examples/slam_runs/decisions.hpp"

#include <limits>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"
#include "support/temporary_folder.hpp"

using namespace cfp_slam;
using cfp_test::error_of;
using cfp_test::TemporaryFolder;

namespace {

/// Any decision: every column has some number of its type.
Decision any_decision(cfp::Random& random) {
  Decision decision;
  detail::for_each_column(decision, [&](const char*, auto& column) {
    using T = std::decay_t<decltype(column)>;
    if constexpr (std::is_floating_point_v<T>) {
      column = static_cast<T>(static_cast<float>(random.normal() * std::exp(10 * random.normal())));
    } else if constexpr (std::is_enum_v<T>) {
      column = static_cast<T>(random() % static_cast<std::uint64_t>(detail::last_of(T()) + 1));
    } else {
      column = static_cast<T>(random() % (std::is_same_v<T, bool> ? 2 : 1000));
    }
  });
  return decision;
}

std::vector<Decision> read(const std::string& file) {
  std::vector<Decision> decisions;
  for_each_decision(file, [&](const Decision& d) { decisions.push_back(d); });
  return decisions;
}

/// A line whose numbers are all `value`, but for one column.
std::string line_with(const std::string& column, const std::string& value) {
  std::string text;
  Decision none;
  detail::for_each_column(none, [&](const char* name, auto&) { text += (name == column ? value : "0") + " "; });
  return text + "\n";
}

}  // namespace

TEST_CASE("What was decided is read back to the last bit", "[slam]") {
  const TemporaryFolder folder;
  cfp::Random random(5, "decisions");
  std::vector<Decision> written;
  std::string text = "# " + decision_columns() + "\n";
  for (int n = 0; n < 500; ++n) {
    written.push_back(any_decision(random));
    text += decision_line(written.back()) + "\n";
  }
  const std::vector<Decision> found = read(folder.write("decisions.txt", text));
  REQUIRE(found.size() == written.size());
  for (std::size_t n = 0; n < found.size(); ++n) {
    std::vector<double> a, b;
    const auto to = [](std::vector<double>& numbers) {
      return [&numbers](const char*, const auto& column) { numbers.push_back(static_cast<double>(column)); };
    };
    detail::for_each_column(written[n], to(a));
    detail::for_each_column(found[n], to(b));
    CHECK(a == b);
    CHECK(cfp::to_text(found[n].why) == cfp::to_text(written[n].why));
  }
}

TEST_CASE("A decision holds numbers only, whatever it is made of", "[slam]") {
  Decision decision;
  decision.x = std::numeric_limits<float>::quiet_NaN();
  decision.why.weight = std::numeric_limits<double>::infinity();
  decision.why.flow_sigma_px = 1e300;
  const TemporaryFolder folder;
  const std::vector<Decision> found = read(folder.write("decisions.txt", decision_line(decision)));
  REQUIRE(found.size() == 1);
  CHECK(found[0].x == -1);
  CHECK(found[0].why.weight == -1);
  CHECK(found[0].why.flow_sigma_px == -1);
}

TEST_CASE("A line that holds no decision is refused with file, line and column", "[slam]") {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& line) {
    const std::string file = folder.write("decisions.txt", "# a comment\n" + line_with("", "") + line);
    return error_of([&] { read(file); });
  };
  CHECK(error("").empty());
  CHECK(error("1 2 3\n").find("decisions.txt:3: ends before column y") != std::string::npos);
  CHECK(error(line_with("F_confidence", "0 0")).find("decisions.txt:3: surplus '0'") != std::string::npos);
  for (const auto& [column, value] : std::vector<std::pair<std::string, std::string>>{{"frame", "-1"},
                                                                                      {"frame", "1e30"},
                                                                                      {"keypoint", "0.5"},
                                                                                      {"x", "nan"},
                                                                                      {"y", "1e200"},
                                                                                      {"label", "4"},
                                                                                      {"rule", "-1"},
                                                                                      {"rule", "5"},
                                                                                      {"compensated", "2"},
                                                                                      {"box", "3e9"},
                                                                                      {"weight", "high"}}) {
    INFO(column << " " << value);
    const std::string said = error(line_with(column, value));
    CHECK(said.find("decisions.txt:3: ") != std::string::npos);
    CHECK(said.find(column) != std::string::npos);
    CHECK(said.find(value) != std::string::npos);
  }
}
