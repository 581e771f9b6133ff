// Where the time of a run went, and what to turn down to reach a wanted frame rate.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "../slam_runs/run_record.hpp"
#include "summary.hpp"

namespace cfp_slam {

// Processor, logical cores and compiler in a few words.
inline std::string machine_text() {
  std::string model = "unknown processor";
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (line.rfind("model name", 0) != 0) continue;
    model = line.substr(std::min(line.size(), line.find(':') + 2));
    break;
  }
#if defined(__clang__)
  const std::string compiler = std::string("clang ") + __clang_version__;
#else
  const std::string compiler = std::string("g++ ") + __VERSION__;
#endif
  return model + ", " + std::to_string(std::thread::hardware_concurrency()) + " logical cores, " + compiler;
}

// One switch and the time of the tracking thread that it gives back.
struct Saving {
  std::string what;
  double milliseconds = 0;
};

inline std::vector<Saving> savings_of(const RunSummary& s, int features) {
  const auto median = [&](Module m) {
    const double ms = s.median_ms[static_cast<std::size_t>(m)];
    return ms > 0 ? ms : 0.0;
  };
  // Features, flow and detector run side by side: the tracking thread waits for the slowest.
  const double side = std::max({median(Module::features), median(Module::flow), median(Module::detection)});
  const auto without = [&](Module m, double left) {
    double rest = 0;
    for (const Module other : {Module::features, Module::flow, Module::detection})
      rest = std::max(rest, other == m ? left : median(other));
    return side - rest;
  };
  // Half of the extractor's time is the pyramid and the corner test, which do not depend on how many keypoints are
  // kept. Nearly all of the coarse stage is F and O.
  std::vector<Saving> savings{
      {"--features " + std::to_string(features / 2) + ": keypoints, their matching and their poses",
       without(Module::features, 0.75 * median(Module::features)) +
           (median(Module::matching) + median(Module::pose) + median(Module::fine)) / 2},
      {"a smaller network, or --detector FILE.txt from an earlier pass", without(Module::detection, 0)},
      {"half the flow points (OpticalFlowOptions)", without(Module::flow, median(Module::flow) / 2)},
      {"--variant no-ksp: no second stage", median(Module::fine)}};
  if (median(Module::flow) > 0) {
    savings.push_back({"--variant cfp-minus: no optical flow, no object probability",
                       without(Module::flow, 0) + 0.8 * median(Module::coarse)});
    savings.push_back({"FundamentalRansacOptions::confidence 0.95: fewer samples for F", median(Module::coarse) / 2});
  }
  std::stable_sort(savings.begin(), savings.end(),
                   [](const Saving& a, const Saving& b) { return a.milliseconds > b.milliseconds; });
  return savings;
}

inline std::string profile_text(const RunRecord& run, double target_fps) {
  const RunSummary s = summarize(run);
  char line[256];
  std::string out = "  where the time of a frame goes (ms; modules beside the tracking thread are marked *)\n";
  for (std::size_t m = 0; m < module_count; ++m) {
    const auto module = static_cast<Module>(m);
    const bool beside = module == Module::reading || module == Module::detection || module == Module::flow ||
                        module == Module::bundle_adjustment;
    if (!(s.median_ms[m] > 0)) continue;
    std::snprintf(line, sizeof line, "  %c %-22s median %7.3f   95 %% %7.3f\n", beside ? '*' : ' ', to_string(module),
                  s.median_ms[m], s.p95_ms[m]);
    out += line;
  }
  const double now = s.median_ms[static_cast<std::size_t>(Module::tracking)], budget = 1000 / target_fps;
  if (!(now > 0)) return out;
  if (now <= budget) {
    std::snprintf(line, sizeof line, "  %.1f ms per frame is within the %.1f ms of %g frames/s; %.1f ms to spare\n",
                  now, budget, target_fps, budget - now);
    return out + line;
  }
  std::snprintf(line, sizeof line,
                "  %.1f ms per frame is %.1f ms too much for %g frames/s. What gives time back, about:\n", now,
                now - budget, target_fps);
  out += line;
  for (const Saving& saving : savings_of(s, run.features)) {
    if (saving.milliseconds < 0.01) continue;
    std::snprintf(line, sizeof line, "    %6.2f ms  %s%s\n", saving.milliseconds, saving.what.c_str(),
                  now - saving.milliseconds <= budget ? "  <- enough" : "");
    out += line;
  }
  return out;
}

}  // namespace cfp_slam
