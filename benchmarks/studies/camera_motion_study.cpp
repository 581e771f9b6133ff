// When does what moves, and no box holds, lead the camera's motion astray, and what does searching the motion help?
// 100, 300 or 500 flow pairs of a room 1 to 5 m away with the depth noise of structured light; the camera moves by some
// 15 mm and 8 mrad a frame. A share of the pairs moves by 1.5 to 16 px: spread over the image by one vector, or in a
// region 1.2 to 3 m away, by one vector or as a rigid body. Misled: the motion moves what is at rest at 2 m by over 1
// px, or its noise is over thrice the pairs' own. Supports CameraMotionOptions::search_above_px. Usage:
// cfp_camera_motion_study [frames | --smoke]
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/frame/camera_motion.hpp"

namespace {

const cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};
constexpr std::array<const char*, 3> movers = {"spread", "region", "rigid region"};

struct Cell {
  std::size_t mover;
  double share, noise_px, wrong_depths;
};

struct Flow {
  cfp::SE3<double> T_cur_prev;
  std::vector<std::array<double, 2>> previous, current;
  std::vector<double> depths;
};

cfp::SE3<double> motion(double translation_m, double rotation_rad, cfp::Random& random) {
  cfp::Vector6<double> xi;
  for (int i = 0; i < 6; ++i) xi[i] = (i < 3 ? translation_m : rotation_rad) * random.normal();
  return cfp::se3_exp(xi);
}

Flow make_flow(const Cell& cell, std::size_t pairs, double moves_px, cfp::Random& random) {
  Flow flow;
  flow.T_cur_prev = motion(0.015, 0.008, random);
  const bool rigid = cell.mover == 2, spread = cell.mover == 0;
  const double width = 640 * std::sqrt(cell.share), height = 480 * std::sqrt(cell.share);
  const double left = random.uniform(0, 640 - width), top = random.uniform(0, 480 - height);
  const double angle = random.uniform(0, 2 * cfp::pi<double>), near_m = random.uniform(1.2, 3);
  const cfp::SE3<double> walk = motion(moves_px / camera.fx * near_m, 0.3 * moves_px / camera.fx, random);
  const cfp::DepthNoise depth_noise;
  while (flow.depths.size() < pairs) {
    const cfp::Vector2<double> p(random.uniform(10, 630), random.uniform(10, 470));
    const bool inside = p.x() > left && p.x() < left + width && p.y() > top && p.y() < top + height;
    const bool moves = spread ? random.uniform() < cell.share : inside;
    const double z = moves && !spread ? near_m + 0.1 * random.normal() : random.uniform(1, 5);
    cfp::Vector3<double> ray;
    cfp::Vector2<double> q;
    if (!camera.unproject(p, ray)) continue;
    cfp::Vector3<double> point = z * ray;
    if (moves && rigid) point = walk * point;
    if (!camera.project(flow.T_cur_prev * point, q)) continue;
    if (moves && !rigid) q += moves_px * cfp::Vector2<double>(std::cos(angle), std::sin(angle));
    q += cell.noise_px * cfp::Vector2<double>(random.normal(), random.normal());
    const bool wrong = random.uniform() < cell.wrong_depths;
    flow.previous.push_back({p.x(), p.y()});
    flow.current.push_back({q.x(), q.y()});
    flow.depths.push_back(wrong ? random.uniform(0.8, 6) : z + depth_noise.sigma_m(z) * random.normal());
  }
  return flow;
}

void print(const Cell& cell, double search_above_px, int frames) {
  cfp::CameraMotionOptions options;
  options.search_above_px = search_above_px;
  cfp::CameraMotionWorkspace<double> workspace;
  cfp::Random random(1, "camera motion study");
  int misled = 0, unknown = 0;
  std::vector<double> times_us;
  for (int i = 0; i < frames; ++i) {
    constexpr std::array<std::size_t, 3> pairs = {100, 300, 500};
    constexpr std::array<double, 5> moves_px = {1.5, 2.5, 4, 8, 16};
    const auto k = static_cast<std::size_t>(i);
    const Flow flow = make_flow(cell, pairs[k % pairs.size()], moves_px[k % moves_px.size()], random);
    const std::vector<char> outside(flow.depths.size(), 1);
    const auto start = std::chrono::steady_clock::now();
    const cfp::CameraMotion<double> found = cfp::estimate_camera_motion<double>(
        {flow.previous, flow.current, flow.depths}, outside, {}, camera, options, workspace);
    times_us.push_back(std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count());
    if (!found.known) {
      ++unknown;
      continue;
    }
    const cfp::SE3<double> error = flow.T_cur_prev.inverse() * found.T_cur_prev;
    const double moved_px = camera.fx * (error.translation.norm() / 2 + cfp::so3_log(error.rotation).norm());
    misled += moved_px > 1 || found.sigma_px > 3 * cell.noise_px ? 1 : 0;
  }
  std::nth_element(times_us.begin(), times_us.begin() + frames / 2, times_us.end());
  std::printf(" %.1f / %.1f, %.0f |", 100.0 * misled / frames, 100.0 * unknown / frames,
              times_us[static_cast<std::size_t>(frames) / 2]);
}

}  // namespace

int main(int argc, char** argv) {
  const bool smoke = argc > 1 && std::strcmp(argv[1], "--smoke") == 0;
  const int frames = smoke ? 15 : argc > 1 ? std::atoi(argv[1]) : 600;
  if (frames < 1) {
    std::fprintf(stderr, "usage: cfp_camera_motion_study [frames >= 1 | --smoke]\n");
    return 2;
  }
  std::printf("%d frames a cell, seed 1: %% misled / without a motion, median us\n\n", frames);
  std::printf("| moving | share | noise px | wrong depths | never searched | above 0.25 px | always |\n");
  std::printf("|---|--:|--:|--:|--:|--:|--:|\n");
  for (std::size_t mover = 0; mover < movers.size(); ++mover) {
    for (const double share : {0.0, 0.2, 0.33, 0.42}) {
      if (share <= 0 && mover > 0) continue;  // nothing moves: once
      for (const double noise : {0.1, 0.2, 0.4}) {
        for (const double wrong : {0.0, 0.15}) {
          std::printf("| %s | %.2f | %.1f | %.2f |", share > 0 ? movers[mover] : "nothing", share, noise, wrong);
          for (const double above : {1e9, cfp::CameraMotionOptions().search_above_px, 0.01})
            print({mover, share, noise, wrong}, above, frames);
          std::printf("\n");
        }
      }
    }
  }
  return 0;
}
