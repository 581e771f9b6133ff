// Which rule should carry a map point's static probability M from frame to frame? Simulated in-box map points with the
// fine stage's own K = K^T K^F: static ones under unit reprojection noise, moving ones displaced by a few pixels.
// Prints how many static points each rule deletes within 1 s and 3 s (30 Hz), how many frames a moving point survives,
// and how near M is to the truth. Supports MapPointOptions::policy and ::rate. Usage: cfp_map_point_study [points |
// --smoke]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <initializer_list>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/probability/distance_sigmoid.hpp"
#include "cfp/probability/map_point.hpp"
#include "cfp/probability/second_stage_probability.hpp"

namespace {

/// One frame's pair of sigmoids, fitted to 400 static points outside the boxes.
struct Frame {
  cfp::ConstraintModel<double> projection, epipolar;

  explicit Frame(cfp::Random& random) {
    std::vector<double> d(400), line(400), scratch(400);
    for (std::size_t i = 0; i < d.size(); ++i) {
      line[i] = std::abs(random.normal());
      d[i] = std::hypot(line[i], random.normal());
    }
    projection = cfp::fit_constraint(d, {}, scratch);
    epipolar = cfp::fit_constraint(line, {}, scratch);
  }

  /// K of a point displaced by (along, across) its epipolar line.
  double k(double along, double across) const {
    const cfp::Evidence<double> t{cfp::static_probability(projection, std::hypot(along, across)), 1, true};
    const cfp::Evidence<double> f{cfp::static_probability(epipolar, std::abs(across)), 1, true};
    return cfp::fuse_high_dynamic(t, f);
  }
};

struct Outcome {
  int frames = 0;      ///< until deletion, limit + 1 without
  double m_after = 0;  ///< M after `settled` frames, deletion ignored
};

/// A point that is off its projection by `displacement_px` in a direction of its own, in every frame.
Outcome follow(double displacement_px, int limit, int settled, const std::vector<Frame>& sigmoids,
               const cfp::MapPointOptions& options, cfp::Random& random) {
  const double angle = random.uniform(0, 2 * cfp::pi<double>);
  Outcome outcome;
  outcome.frames = limit + 1;
  double m = 1;
  for (int frame = 0; frame < limit; ++frame) {
    const Frame& sigmoid = sigmoids[random.index(static_cast<std::uint32_t>(sigmoids.size()))];
    const double along = displacement_px * std::cos(angle) + random.normal(),
                 across = displacement_px * std::sin(angle) + random.normal();
    m = cfp::updated_map_point(sigmoid.k(along, across), m, options);
    if (frame + 1 == settled) outcome.m_after = m;
    if (cfp::is_deletable(m, options)) outcome.frames = (std::min)(outcome.frames, frame + 1);
  }
  return outcome;
}

void row(const char* name, const cfp::MapPointOptions& options, int points, const std::vector<Frame>& sigmoids) {
  cfp::Random random(1, "map point study");
  int within_1s = 0, within_3s = 0;
  double brier = 0;
  for (int i = 0; i < points; ++i) {
    const Outcome point = follow(0, 90, 10, sigmoids, options, random);
    within_1s += point.frames <= 30 ? 1 : 0;
    within_3s += point.frames <= 90 ? 1 : 0;
    brier += (1 - point.m_after) * (1 - point.m_after) / points;
  }
  std::printf("| %-22s | %5.1f %% | %5.1f %% | %.3f |", name, 100.0 * within_1s / points, 100.0 * within_3s / points,
              brier);
  for (const double displacement : {3.0, 6.0, 12.0}) {
    std::vector<int> lifetimes;
    brier = 0;
    for (int i = 0; i < points; ++i) {
      const Outcome point = follow(displacement, 90, 10, sigmoids, options, random);
      lifetimes.push_back(point.frames);
      brier += point.m_after * point.m_after / points;
    }
    std::sort(lifetimes.begin(), lifetimes.end());
    std::printf(" %d / %d, %.3f |", lifetimes[lifetimes.size() / 2], lifetimes[lifetimes.size() * 9 / 10], brier);
  }
  std::printf("\n");
}

}  // namespace

int main(int argc, char** argv) {
  const bool smoke = argc > 1 && std::strcmp(argv[1], "--smoke") == 0;
  const int points = smoke ? 50 : argc > 1 ? std::atoi(argv[1]) : 4000;
  if (points < 1) {
    std::fprintf(stderr, "usage: cfp_map_point_study [points >= 1 | --smoke]\n");
    return 2;
  }
  cfp::Random random(1, "map point study frames");
  std::vector<Frame> sigmoids;
  for (int i = 0; i < 500; ++i) sigmoids.emplace_back(random);
  std::printf("%d points a row, seed 1; M starts at 1, deletion below 0.3, Brier score of M after 10 frames\n\n",
              points);
  std::printf(
      "| rule | static deleted in 1 s | in 3 s | Brier | moving 3 px: frames it survives (median / 90 %%), Brier | 6 "
      "px | 12 px |\n|---|--:|--:|--:|--:|--:|--:|\n");
  cfp::MapPointOptions options;
  options.policy = cfp::MapPointPolicy::copy;
  row("copy", options, points, sigmoids);
  const auto rows = [&](cfp::MapPointPolicy policy, const char* label, std::initializer_list<double> rates) {
    options.policy = policy;
    for (const double rate : rates) {
      char name[32];
      std::snprintf(name, sizeof name, "%s %.2f", label, rate);
      options.rate = rate;
      row(name, options, points, sigmoids);
    }
  };
  rows(cfp::MapPointPolicy::exponential_mean, "exponential mean", {0.5, 0.3, 0.2, 0.15, 0.1, 0.05});
  rows(cfp::MapPointPolicy::log_odds, "log odds", {1.0, 0.5, 0.3, 0.25, 0.2, 0.15, 0.1});
  return 0;
}
