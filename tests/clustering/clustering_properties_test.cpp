// Properties of the depth foreground, for whatever the generators make; those of DBSCAN are in tests/properties.
#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/clustering/adaptive.hpp"
#include "cfp/clustering/depth_foreground.hpp"
#include "cfp_testing/generators.hpp"
#include "support/properties.hpp"

using cfp::Random;

namespace {

/// A person, a wall and points without a depth.
template <typename Scalar>
std::vector<Scalar> depths(Random& random) {
  const double person = random.uniform(1, 3), wall = person + random.uniform(0.3, 3);
  return cfp_testing::many(cfp_testing::count(random, 0, 120), [&] {
    const double u = random.uniform();
    return static_cast<Scalar>(u < 0.1 ? 0 : u < 0.6 ? person + 0.08 * random.normal() : wall + random.uniform(0, 0.3));
  });
}

template <typename Scalar>
cfp::ForegroundResult run(const std::vector<Scalar>& in, std::vector<char>& mask) {
  mask.assign(in.size(), 9);
  cfp::ForegroundWorkspace<Scalar> workspace;
  return cfp::depth_foreground({in, {}, {}, 0}, {}, workspace, mask);
}

}  // namespace

CFP_PROPERTIES("Properties of the depth foreground", "[clustering]",
               {"every point is counted once and labelled 0 or 1, whatever the depths", 300,
                [](Random& random) {
                  std::vector<float> in = depths<float>(random);
                  for (float& d : in) d = random.index(10) == 0 ? cfp_testing::any_number<float>(random) : d;
                  std::vector<char> mask;
                  const auto r = run(in, mask);
                  return r.foreground + r.background + r.invalid == in.size() && std::isfinite(r.depth_m) &&
                         r.near_m <= r.far_m &&
                         std::all_of(mask.begin(), mask.end(), [](char m) { return m == 0 || m == 1; });
                }},
               {"the order of the points moves no label", 200,
                [](Random& random) {
                  std::vector<double> in = depths<double>(random), back(in.rbegin(), in.rend());
                  std::vector<char> a, b;
                  const auto first = run(in, a), second = run(back, b);
                  std::reverse(b.begin(), b.end());
                  return a == b && first.depth_m == second.depth_m && first.status == second.status;
                }},
               {"the foreground is an interval of depths, nearer than all background behind it", 200,
                [](Random& random) {
                  const std::vector<double> in = depths<double>(random);
                  std::vector<char> mask;
                  const auto r = run(in, mask);
                  if (r.status != cfp::ForegroundStatus::ok) return true;
                  for (std::size_t i = 0; i < in.size(); ++i) {
                    if (in[i] > 0 && (mask[i] == 1) != (in[i] >= r.near_m && in[i] <= r.far_m)) return false;
                  }
                  return r.near_m <= r.depth_m && r.depth_m <= r.far_m;
                }},
               {"the same frame twice through one workspace gives the same labels", 100, [](Random& random) {
                  const std::vector<float> in = depths<float>(random), other = depths<float>(random);
                  cfp::ForegroundWorkspace<float> workspace;
                  std::vector<char> a(in.size()), b(in.size()), c(other.size());
                  const auto first = cfp::depth_foreground({in, {}, {}, 0}, {}, workspace, a);
                  (void)cfp::depth_foreground({other, {}, {}, 0}, {}, workspace, c);
                  const auto again = cfp::depth_foreground({in, {}, {}, 0}, {}, workspace, b);
                  return a == b && first.depth_m == again.depth_m;
                }})
