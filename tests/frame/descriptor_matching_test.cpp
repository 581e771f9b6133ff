#include "cfp/frame/descriptor_matching.hpp"

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"

namespace {

using Descriptor = std::array<std::uint8_t, 32>;

cfp::DescriptorSpan view(const std::vector<Descriptor>& descriptors) {
  return {descriptors.empty() ? nullptr : descriptors[0].data(), descriptors.size(), 32, 32};
}

/// Points at random places with random descriptors, and the same moved a little with some bits changed.
struct Pairs {
  explicit Pairs(std::uint64_t seed, std::size_t n = 200) : random(seed, "descriptors") {
    for (std::size_t i = 0; i < n; ++i) {
      const double x = random.uniform(0, 640), y = random.uniform(0, 480);
      previous.push_back({x, y});
      current.push_back({x + random.uniform(-20, 20), y + random.uniform(-20, 20)});
      Descriptor d;
      for (auto& byte : d) byte = static_cast<std::uint8_t>(random.index(256));
      from.push_back(d);
      for (int bit = 0; bit < 15; ++bit) d[random.index(32)] ^= static_cast<std::uint8_t>(1U << random.index(8));
      to.push_back(d);
      queries.push_back(static_cast<std::int32_t>(i));
    }
    match.assign(n, -1);
  }
  std::size_t run(const cfp::DescriptorMatchOptions& options = {}) {
    return cfp::match_descriptors(cfp::PointSpan<double, 2>(previous), view(from), cfp::PointSpan<double, 2>(current),
                                  view(to), queries, options, workspace, match);
  }

  cfp::Random random;
  std::vector<std::array<double, 2>> previous, current;
  std::vector<Descriptor> from, to;
  std::vector<std::int32_t> queries, match;
  cfp::DescriptorMatchWorkspace<double> workspace;
};

/// The rule, by brute force over all pairs.
std::vector<std::int32_t> by_brute_force(const Pairs& p, const cfp::DescriptorMatchOptions& options) {
  const std::size_t n = p.previous.size();
  std::vector<std::int32_t> nearest(n, -1), result(n, -1);
  std::vector<int> distance(n, 1000);
  for (std::size_t i = 0; i < n; ++i) {
    int best = 1000, second = 256;
    for (std::size_t j = 0; j < n; ++j) {
      const double dx = p.previous[j][0] - p.current[i][0], dy = p.previous[j][1] - p.current[i][1];
      if (dx * dx + dy * dy > options.radius_px * options.radius_px) continue;
      int d = 0;
      for (std::size_t b = 0; b < 256; ++b) d += ((p.from[j][b / 8] ^ p.to[i][b / 8]) >> (b % 8)) & 1;
      if (d < best) {
        second = best < 1000 ? std::min(second, best) : second;
        best = d;
        nearest[i] = static_cast<std::int32_t>(j);
      } else {
        second = std::min(second, d);
      }
    }
    distance[i] = best;
    if (best > options.max_distance || !(best < options.max_ratio * second)) nearest[i] = -1;
  }
  for (std::size_t j = 0; j < n; ++j) {
    std::size_t holder = n;
    for (std::size_t i = 0; i < n; ++i) {
      if (nearest[i] == static_cast<std::int32_t>(j) && (holder == n || distance[i] < distance[holder])) holder = i;
    }
    if (holder < n) result[holder] = static_cast<std::int32_t>(j);
  }
  return result;
}

}  // namespace

TEST_CASE("Descriptors are matched by the rule, and mostly rightly", "[frame]") {
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    Pairs pairs(seed);
    const cfp::DescriptorMatchOptions options;
    const std::size_t matched = pairs.run(options);
    CHECK(pairs.match == by_brute_force(pairs, options));
    std::size_t count = 0, right = 0;
    for (std::size_t i = 0; i < pairs.match.size(); ++i) {
      count += pairs.match[i] >= 0 ? 1U : 0U;
      right += pairs.match[i] == static_cast<std::int32_t>(i) ? 1U : 0U;
    }
    CHECK(count == matched);
    CHECK(right >= 195);
  }
}

TEST_CASE("Matches that stand are kept and their keypoints taken; only queries are matched", "[frame]") {
  Pairs pairs(11);
  pairs.queries.resize(100);
  pairs.match[0] = 50;  // the host's, wrong as it may be
  pairs.queries.erase(pairs.queries.begin());
  pairs.run();
  CHECK(pairs.match[0] == 50);
  CHECK(pairs.match[50] != 50);
  for (std::size_t i = 100; i < 200; ++i) CHECK(pairs.match[i] == -1);
}

TEST_CASE("No match beyond the radius or the distance, nor for what is not finite or of another size", "[frame]") {
  Pairs pairs(12);
  cfp::DescriptorMatchOptions options;
  options.radius_px = 1e-3;
  CHECK(pairs.run(options) == 0);
  options = {};
  options.max_distance = 0;
  CHECK(pairs.run(options) == 0);
  Pairs hostile(13);
  for (auto& p : hostile.previous) p[1] = std::numeric_limits<double>::quiet_NaN();
  CHECK(hostile.run() == 0);
  Pairs other(14);
  for (auto& p : other.current) p[0] = std::numeric_limits<double>::infinity();
  CHECK(other.run() == 0);
  other.to.clear();
  CHECK(other.run() == 0);
}

TEST_CASE("The largest distance that matches is the option's, and a pixel without y is no candidate", "[frame]") {
  Pairs pair(16, 1);
  for (const int bits : {49, 50, 51, 52}) {
    pair.to[0] = pair.from[0];
    for (int b = 0; b < bits; ++b) pair.to[0][std::size_t(b / 8)] ^= static_cast<std::uint8_t>(1 << (b % 8));
    pair.match[0] = -1;
    CHECK(pair.run() == (bits <= 50 ? 1U : 0U));
  }
  cfp::DescriptorMatchOptions any;
  any.max_distance = (std::numeric_limits<int>::max)();
  CHECK(pair.run(any) == 1);
  Pairs whole(17);
  whole.run();
  Pairs holes(17);
  for (std::size_t j = 0; j < 200; j += 3) holes.previous[j][1] = std::numeric_limits<double>::quiet_NaN();
  holes.run();
  std::size_t same = 0;
  for (std::size_t i = 0; i < 200; ++i) {
    if (whole.match[i] >= 0 && whole.match[i] % 3 != 0) same += holes.match[i] == whole.match[i] ? 1U : 0U;
    if (holes.match[i] >= 0) CHECK(holes.match[i] % 3 != 0);
  }
  CHECK(same >= 130);
}

TEST_CASE("A match lies within the radius, its rim included", "[frame]") {
  Pairs pair(18, 1);
  pair.to = pair.from;
  pair.previous[0] = {100, 200};
  for (const double distance : {40.0, 40.01}) {
    for (const auto& [x, y] : {std::array<double, 2>{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
      pair.current[0] = {100 + x * distance, 200 + y * distance};
      pair.match[0] = -1;
      CHECK(pair.run() == (distance == 40 ? 1U : 0U));
    }
  }
}

TEST_CASE("Repeated matching allocates nothing and gives the same bits", "[frame]") {
  Pairs pairs(15);
  pairs.run();
  const std::vector<std::int32_t> first = pairs.match;
  pairs.match.assign(pairs.match.size(), -1);
  CHECK(cfp_test::allocations_in([&] { pairs.run(); }) == 0);
  CHECK(pairs.match == first);
}

TEST_CASE("The Hamming distance counts bits of any number of bytes", "[frame]") {
  const std::array<std::uint8_t, 11> a = {0xFF, 0, 0, 0, 0, 0, 0, 0, 0x0F, 1, 0}, b{};
  CHECK(cfp::hamming_distance(a.data(), b.data(), 11) == 13);
  CHECK(cfp::hamming_distance(a.data(), b.data(), 8) == 8);
  CHECK(cfp::hamming_distance(a.data(), a.data(), 11) == 0);
}
