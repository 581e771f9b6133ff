#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "cfp/clustering/dbscan.hpp"
#include "cfp_testing/dbscan_verifier.hpp"
#include "support/catch.hpp"

TEMPLATE_TEST_CASE("DBSCAN gives scikit-learn's clusters", "[clustering]", float, double) {
  std::ifstream table(std::string(CFP_SOURCE_DIR) + "/tests/data/dbscan_table.txt");
  int cases = 0;
  for (std::string line; std::getline(table, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    cfp::DbscanOptions options;
    std::size_t n = 0;
    words >> options.eps >> options.min_pts >> n;
    std::vector<TestType> values(n);
    std::vector<int> theirs(n), ours(n);
    for (TestType& value : values) words >> value;
    for (int& label : theirs) words >> label;
    REQUIRE_FALSE(words.fail());
    ++cases;

    cfp::DbscanWorkspace<TestType> workspace;
    const cfp::DbscanResult result = cfp::dbscan(values, options, workspace, ours);
    INFO("case " << cases << " n " << n << " eps " << options.eps << " min_pts " << options.min_pts);
    // Theirs is a DBSCAN labelling but for the freedoms of the definition: numbering, and which cluster gets a border
    // point.
    CHECK(cfp_testing::verify_dbscan(values, options, theirs, {false, false}).fault == cfp_testing::DbscanFault::none);
    CHECK(cfp_testing::verify_dbscan(values, options, ours).fault == cfp_testing::DbscanFault::none);
    std::map<int, int> partner;
    std::size_t their_core = 0;
    for (std::size_t i = 0; i < n; ++i) {
      CHECK((theirs[i] < 0) == (ours[i] < 0));
      std::size_t neighbours = 0;
      for (const TestType other : values)
        neighbours +=
            (other < values[i] ? values[i] - other : other - values[i]) <= static_cast<TestType>(options.eps) ? 1U : 0U;
      if (neighbours < options.min_pts) continue;
      ++their_core;
      CHECK(partner.emplace(theirs[i], ours[i]).first->second == ours[i]);
    }
    CHECK(partner.size() == result.clusters);
    CHECK(their_core == result.core_points);
  }
  CHECK(cases == 40);
}
