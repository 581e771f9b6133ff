// cfp in the shape of ORB-SLAM's tracking: the same host without and with cfp on the same simulated images of people
// who walk through a room. The glue is cfp_glue.hpp and ../orb_slam/static_weights.hpp; host.hpp and tracking.hpp are
// the host, whose lines for cfp are marked.
#include <cmath>
#include <cstdio>

#include "simulation.hpp"
#include "tracking.hpp"

namespace {

struct Outcome {
  double rmse_m = 0, worst_m = 0;
  int lost = 0;
};

Outcome Run(bool withCfp) {
  const Calibration K{535.4F, 539.2F, 320.1F, 247.6F, 640, 480};
  StaticWeights weights = MakeStaticWeights(K, 0);
  Tracking tracking(K, withCfp ? &weights : nullptr);
  Simulation simulation(K, 1);
  const Eigen::Matrix4f first = Simulation::TruePose(0);
  Outcome outcome;
  int poses = 0;
  double foreground = 0, byDescriptor = 0, unmatched = 0;
  for (long n = 0; n < 180; ++n) {
    if (!tracking.Track(simulation.Shoot(n))) {
      ++outcome.lost;
      continue;
    }
    // The first camera is the world.
    const Eigen::Matrix4f error = tracking.CurrentFrame().mTcw * first * Inverse(Simulation::TruePose(n));
    const double distance = static_cast<double>(error.topRightCorner<3, 1>().norm());
    outcome.rmse_m += distance * distance;
    outcome.worst_m = std::max(outcome.worst_m, distance);
    ++poses;
    foreground += static_cast<double>(weights.Report().foreground);
    byDescriptor += static_cast<double>(weights.Report().matched_in_boxes);
    unmatched += static_cast<double>(weights.Report().unmatched_foreground);
  }
  outcome.rmse_m = std::sqrt(outcome.rmse_m / poses);
  std::printf("%-12s error %.4f m RMSE, %.4f m at worst; %d of 180 frames without a pose (the lens was covered in 6)\n",
              withCfp ? "with cfp" : "as it was", outcome.rmse_m, outcome.worst_m, outcome.lost);
  if (withCfp) {
    std::printf(
        "             per frame: %.0f keypoints on people; %.0f keypoints in boxes matched by descriptor, %.0f "
        "on people not at all\n",
        foreground / poses, byDescriptor / poses, unmatched / poses);
  }
  return outcome;
}

}  // namespace

int main() {
  const Outcome plain = Run(false), cfp = Run(true);
  std::printf("gain         %.1f times less error\n", plain.rmse_m / cfp.rmse_m);
  return cfp.rmse_m < plain.rmse_m && cfp.lost <= plain.lost ? 0 : 1;
}
