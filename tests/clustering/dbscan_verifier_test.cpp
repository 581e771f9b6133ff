#include "cfp_testing/dbscan_verifier.hpp"

#include <limits>
#include <vector>

#include "support/catch.hpp"

namespace {

using cfp_testing::DbscanFault;

// Core points at 0, 0.25, 0.5 and 2, 2.25, 2.5; border points 0.75 and 1.75; noise 1.25 and 9; eps 0.25, min_pts 3
// counts the point itself.
const std::vector<double> shared_values{
    0, 0.25, 0.5, 0.75, 1.25, 1.75, 2, 2.25, 2.5, 9, 0, 2.5, std::numeric_limits<double>::quiet_NaN()};
const std::vector<int> right{0, 0, 0, 0, -1, 1, 1, 1, 1, -1, 0, 1, -1};
const cfp::DbscanOptions shared_options{0.25, 3};

DbscanFault fault(std::vector<int> labels, const cfp_testing::DbscanVerifierOptions& strictness = {}) {
  return cfp_testing::verify_dbscan(shared_values, shared_options, labels, strictness).fault;
}
DbscanFault fault_with(std::size_t at, int label) {
  std::vector<int> labels = right;
  labels[at] = label;
  return fault(labels);
}

}  // namespace

TEST_CASE("The verifier accepts a right labelling and names each fault of a wrong one", "[clustering]") {
  CHECK(fault(right) == DbscanFault::none);
  CHECK(fault(std::vector<int>(3, 0)) == DbscanFault::label_count);
  CHECK(fault_with(12, 0) == DbscanFault::invalid_labelled);
  CHECK(fault_with(1, -1) == DbscanFault::core_is_noise);
  CHECK(fault_with(7, 2) == DbscanFault::cluster_torn);
  CHECK(fault_with(4, 0) == DbscanFault::noise_labelled);
  CHECK(fault_with(3, -1) == DbscanFault::border_is_noise);
  CHECK(fault_with(3, 1) == DbscanFault::border_foreign);
  std::vector<int> joined = right;
  for (int& label : joined) label = label > 0 ? 0 : label;
  CHECK(fault(joined) == DbscanFault::clusters_joined);
  std::vector<int> swapped = right;
  for (int& label : swapped) label = label < 0 ? label : 1 - label;
  CHECK(fault(swapped) == DbscanFault::numbering);
  CHECK(fault(swapped, {true, false}) == DbscanFault::none);
  std::vector<int> gap = right;
  for (int& label : gap) label = label == 1 ? 2 : label;
  CHECK(fault(gap) == DbscanFault::numbering);
  std::vector<int> huge = right;
  for (int& label : huge) label = label == 1 ? std::numeric_limits<int>::max() : label;
  CHECK(fault(huge) == DbscanFault::numbering);
}

TEST_CASE("The verifier knows the nearest core point and the lower one of two", "[clustering]") {
  // Core points 0 and 1 alone (five neighbours each), the fifth value is within reach of both.
  std::vector<double> between{-0.375, -0.375, -0.125, 0, 0.5, 1, 1.125, 1.375, 1.375};
  const std::vector<int> lower{0, 0, 0, 0, 0, 1, 1, 1, 1}, upper{0, 0, 0, 0, 1, 1, 1, 1, 1};
  const cfp::DbscanOptions wide{0.5, 5};
  CHECK(cfp_testing::verify_dbscan(between, wide, lower).fault == DbscanFault::none);
  CHECK(cfp_testing::verify_dbscan(between, wide, upper).fault == DbscanFault::border_not_nearest);
  CHECK(cfp_testing::verify_dbscan(between, wide, upper, {false, true}).fault == DbscanFault::none);
}
