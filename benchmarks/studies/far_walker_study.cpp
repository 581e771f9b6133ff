// What a stereo camera makes of somebody far away (tests/support/far_walker.hpp; 460 px, 0.11 m, 0.3 px): chooses
// FineOptions::least_speed_m_s, and supports ForegroundInput::depth_noise. First the share of keypoints with a weight
// above 1/2, in percent, of people who walk past, 0.6 m/s, and of people at rest, for a least speed of 0 (K as printed)
// to 2 m/s. Those who walk should have none, and those at rest all who are near enough to be seen to rest; 0.5 is the
// speed at which neither loses much. Where nothing shows (0.6 m/s 20 m away at 60 Hz) 12 to 22 % are taken for static
// and 17 % of those at rest, 100 % of both by K as printed.
// Then, for somebody who walks away, the share of his keypoints that depth takes for the wall, and of the frames in
// which O is known: 34, 61 and 71 % and 97, 96 and 64 % at 7, 10 and 14 m before the window knew of the depth noise
// (6d383ac).
// Usage: cfp_far_walker_study [scenes, default 8 | --smoke]
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "../../tests/support/far_walker.hpp"

namespace {

void print_speeds(const char* who, cfp_test::FarWalkerOptions walker, int scenes) {
  for (const double rate_hz : {10.0, 30.0, 60.0}) {
    for (const double distance_m : {3.0, 6.0, 10.0, 20.0}) {
      walker.rate_hz = rate_hz, walker.distance_m = distance_m;
      std::printf("| %s, %2.0f m, %2.0f Hz |", who, distance_m, rate_hz);
      for (const double speed_m_s : {0.0, 0.25, 0.5, 1.0, 2.0}) {
        cfp::FrameOptions options;
        options.fine.least_speed_m_s = speed_m_s;
        std::printf(" %5.1f |", 100 * cfp_test::mean_of_far_walkers(walker, options, scenes).above_half);
      }
      std::printf("\n");
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  const bool smoke = argc > 1 && std::strcmp(argv[1], "--smoke") == 0;
  const int scenes = smoke ? 1 : argc > 1 ? std::atoi(argv[1]) : 8;
  std::printf("| weight above 1/2, %% | 0 m/s | 0.25 | 0.5 | 1 | 2 |\n|---|---|---|---|---|---|\n");
  cfp_test::FarWalkerOptions walker;
  walker.points = 6;  // too few for O
  walker.across_m_s = 0.6;
  print_speeds("walks, 6 points", walker, scenes);
  walker.points = 20;
  print_speeds("walks", walker, scenes);
  walker.across_m_s = 0;
  print_speeds("rests", walker, scenes);
  walker.away_m_s = 0.9, walker.rate_hz = 15;
  std::printf("\n| walks away | taken for the wall, %% | O known, %% |\n|---|---|---|\n");
  for (const double distance_m : {3.0, 5.0, 7.0, 10.0, 14.0}) {
    walker.distance_m = distance_m;
    const auto mean = cfp_test::mean_of_far_walkers(walker, {}, scenes);
    std::printf("| %2.0f m | %4.1f | %5.1f |\n", distance_m, 100 * mean.background, 100 * mean.object_known);
  }
}
