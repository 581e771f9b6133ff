#include "cfp/clustering/dbscan.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "cfp/clustering/depth_foreground.hpp"
#include "cfp/core/random.hpp"
#include "cfp_testing/dbscan_verifier.hpp"
#include "support/catch.hpp"

#include <rapidcheck/catch.h>

namespace {

// Multiples of 1/64 in [0, 8): exact in float and double, with many ties.
std::vector<double> grid_values() {
  std::vector<double> values;
  for (const int steps : *rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 512)))
    values.push_back(steps / 64.0);
  return values;
}
cfp::DbscanOptions any_options() {
  return {*rc::gen::inRange(0, 40) / 64.0, static_cast<std::size_t>(*rc::gen::inRange(1, 10))};
}

template <typename Scalar>
std::vector<int> labels_of(const std::vector<Scalar>& values, const cfp::DbscanOptions& options) {
  cfp::DbscanWorkspace<Scalar> workspace;
  std::vector<int> labels(values.size());
  cfp::dbscan(values, options, workspace, labels);
  return labels;
}

// A box of depths: a few layers, spread and holes.
std::vector<double> any_box() {
  cfp::Random random(*rc::gen::arbitrary<std::uint64_t>(), "box");
  std::vector<double> depths(static_cast<std::size_t>(*rc::gen::inRange(0, 200)));
  for (double& depth : depths) {
    const std::uint32_t kind = random.index(8);
    depth = kind == 0  ? 0.0
            : kind < 4 ? 2.0 + 0.1 * random.normal()
            : kind < 6 ? 3.5 + 0.03 * random.normal()
                       : random.uniform(1, 6);
  }
  return depths;
}

std::vector<char> foreground_of(const std::vector<double>& depths, const cfp::ForegroundOptions& options = {}) {
  cfp::ForegroundWorkspace<double> workspace;
  std::vector<char> mask(depths.size());
  cfp::depth_foreground({depths, {}, {}, 0}, options, workspace, mask);
  return mask;
}

template <typename T>
std::vector<T> permuted(const std::vector<T>& values, const std::vector<std::size_t>& order) {
  std::vector<T> out;
  for (const std::size_t i : order) out.push_back(values[i]);
  return out;
}
std::vector<std::size_t> any_order(std::size_t n) {
  cfp::Random random(*rc::gen::arbitrary<std::uint64_t>(), "order");
  std::vector<std::size_t> order(n);
  for (std::size_t i = 0; i < n; ++i) order[i] = i;
  for (std::size_t i = n; i > 1; --i) std::swap(order[i - 1], order[random.index(static_cast<std::uint32_t>(i))]);
  return order;
}

}  // namespace

TEST_CASE("DBSCAN properties", "[properties]") {
  rc::prop("the verifier accepts every labelling", [] {
    const std::vector<double> values = grid_values();
    const cfp::DbscanOptions options = any_options();
    RC_ASSERT(cfp_testing::verify_dbscan(values, options, labels_of(values, options)).fault ==
              cfp_testing::DbscanFault::none);
  });
  rc::prop("permuting the values permutes the labels", [] {
    const std::vector<double> values = grid_values();
    const cfp::DbscanOptions options = any_options();
    const std::vector<std::size_t> order = any_order(values.size());
    RC_ASSERT(labels_of(permuted(values, order), options) == permuted(labels_of(values, options), order));
  });
  rc::prop("scaling and shifting values and eps changes no label", [] {
    const std::vector<double> values = grid_values();
    const cfp::DbscanOptions options = any_options();
    const double scale = std::ldexp(1.0, *rc::gen::inRange(-20, 20)), shift = *rc::gen::inRange(-512, 512) / 64.0;
    std::vector<double> moved;
    for (const double value : values) moved.push_back((value + shift) * scale);
    RC_ASSERT(labels_of(moved, {options.eps * scale, options.min_pts}) == labels_of(values, options));
  });
  rc::prop("float and double agree on values that both hold exactly", [] {
    const std::vector<double> values = grid_values();
    const cfp::DbscanOptions options = any_options();
    RC_ASSERT(labels_of(std::vector<float>(values.begin(), values.end()), options) == labels_of(values, options));
  });
  rc::prop("noise does not grow with eps, nor shrink with min_pts", [] {
    const std::vector<double> values = grid_values();
    const cfp::DbscanOptions options = any_options();
    const std::vector<int> labels = labels_of(values, options),
                           wider = labels_of(values, {options.eps + 1 / 64.0, options.min_pts}),
                           denser = labels_of(values, {options.eps, options.min_pts + 1});
    for (std::size_t i = 0; i < values.size(); ++i) {
      RC_ASSERT(labels[i] < 0 || wider[i] >= 0);
      RC_ASSERT(labels[i] >= 0 || denser[i] < 0);
    }
  });
}

TEST_CASE("Depth foreground properties", "[properties]") {
  rc::prop("the foreground is a cut in depth", [] {
    const std::vector<double> depths = any_box();
    const std::vector<char> mask = foreground_of(depths);
    double far = 0, near = 1e9;
    for (std::size_t i = 0; i < depths.size(); ++i) {
      if (!cfp::is_valid_depth(depths[i])) continue;
      if (mask[i] != 0)
        far = std::max(far, depths[i]);
      else
        near = std::min(near, depths[i]);
    }
    RC_ASSERT(far < near);
  });
  rc::prop("whatever is known, the foreground lies between two depths, and the background outside", [] {
    const std::vector<double> depths = any_box();
    cfp::Random random(*rc::gen::arbitrary<std::uint64_t>(), "pixels");
    std::vector<std::array<double, 2>> pixels;
    while (pixels.size() < depths.size()) pixels.push_back({random.uniform(0, 100), random.uniform(0, 200)});
    cfp::ForegroundWorkspace<double> workspace;
    std::vector<char> mask(depths.size());
    const double previous = *rc::gen::element(0.0, 2.0, 3.5, 9.0);
    const auto result = cfp::depth_foreground({depths, pixels, {0, 0, 100, 200}, previous}, {}, workspace, mask);
    RC_ASSERT(result.foreground + result.background + result.invalid == depths.size());
    for (std::size_t i = 0; i < depths.size(); ++i) {
      if (!cfp::is_valid_depth(depths[i])) continue;
      RC_ASSERT((mask[i] != 0) == (depths[i] >= result.near_m && depths[i] <= result.far_m));
    }
  });
  rc::prop("permuting the points permutes the mask", [] {
    const std::vector<double> depths = any_box();
    const std::vector<std::size_t> order = any_order(depths.size());
    RC_ASSERT(foreground_of(permuted(depths, order)) == permuted(foreground_of(depths), order));
  });
  rc::prop("points without depth change no other point", [] {
    std::vector<double> depths = any_box();
    const std::vector<char> before = foreground_of(depths);
    depths.insert(depths.end(), static_cast<std::size_t>(*rc::gen::inRange(1, 50)), 0.0);
    const std::vector<char> after = foreground_of(depths);
    RC_ASSERT(std::equal(before.begin(), before.end(), after.begin()));
  });
  rc::prop("every rule labels every point and repeats itself", [] {
    const std::vector<double> depths = any_box();
    cfp::ForegroundOptions options;
    options.rule = static_cast<cfp::ForegroundRule>(*rc::gen::inRange(0, 2));
    options.adaptive.rule = static_cast<cfp::AdaptiveRule>(*rc::gen::inRange(0, 2));
    const std::vector<char> mask = foreground_of(depths, options);
    RC_ASSERT(std::all_of(mask.begin(), mask.end(), [](char m) { return m == 0 || m == 1; }));
    RC_ASSERT(mask == foreground_of(depths, options));
  });
}
