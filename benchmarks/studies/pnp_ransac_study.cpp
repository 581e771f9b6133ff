// How many mismatches does pnp_ransac stand without weights, and does it say so where it fails? Per number of
// observations and share of mismatches: the share of problems solved (centre within 5 cm + 5 % of the mean depth over
// the square root of the true inliers, rotation within 2 degrees), refused (no pose), and wrong (a pose, but another
// one); the samples drawn and the median time. 1 px noise, options as by default. Three kinds of scene: a volume 0.6 to
// 5 m in front of the camera; an object of 20 cm seen from 20 m through a long lens (f = 8000 px); nothing but
// mismatches, which must be refused. Then: of 200 observations in the volume some right, and mismatches some of which
// crowd in a square patch of the image.
//   cfp_pnp_ransac_study [problems per cell, default 1000 | --smoke]
// Fails unless of each cell up to 90 % of mismatches 97 %, and beside each crowd 90 %, are solved and at most 1 %
// wrong.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "../../tests/support/absolute_pose_scene.hpp"
#include "../support/interleaved.hpp"
#include "cfp/robust/pnp_ransac.hpp"

namespace {

using Scene = cfp_test::AbsolutePoseScene<double>;

struct Kind {
  const char* name;
  cfp::PinholeCamera<double> camera;
  bool small_object;
};

struct Cell {
  int solved = 0, refused = 0, wrong = 0;
  std::vector<double> iterations, times_us;
};

/// The scene's inliers moved into a small object far away.
Scene make_scene(cfp::Random& random, const Kind& kind, const cfp_test::AbsolutePoseOptions& options) {
  return kind.small_object ? cfp_test::make_long_lens_scene<double>(random, kind.camera, options)
                           : cfp_test::make_absolute_pose_scene<double>(random, kind.camera, options);
}

void run(const Kind& kind, std::size_t points, double outliers, int problems, Cell& cell) {
  cfp_test::AbsolutePoseOptions scene_options;
  scene_options.points = points;
  scene_options.outlier_share = outliers;
  cfp::Random random(12, "pnp_ransac_study");
  cfp::PnpRansacWorkspace workspace;
  for (int k = 0; k < problems; ++k) {
    const Scene scene = make_scene(random, kind, scene_options);
    cfp::PnpRansacOptions options;
    options.seed = static_cast<std::uint64_t>(k);
    const auto start = std::chrono::steady_clock::now();
    const auto result = cfp::pnp_ransac(scene.world, scene.pixels, {}, kind.camera, options, workspace);
    cell.times_us.push_back(
        std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count());
    cell.iterations.push_back(static_cast<double>(result.iterations));
    // A small object leaves the camera's place uncertain; where its points come to lie tells.
    std::vector<double> distances_px;
    for (std::size_t i = 0; i < points; ++i) {
      cfp::Vector2<double> a(0, 0), b(0, 0);
      const cfp::Vector3<double> x(scene.world[i][0], scene.world[i][1], scene.world[i][2]);
      const bool seen = kind.camera.project(scene.T_cam_world * x, a) && kind.camera.project(result.T_cam_world * x, b);
      distances_px.push_back(seen ? (a - b).norm() : 1e9);
    }
    const auto error = cfp_test::pose_distance(result.T_cam_world, scene.T_cam_world);
    const bool right = cfp_benchmark::median(distances_px) < 2 && error[1] < (kind.small_object ? 0.2 : 0.035);
    ++(!result.found() ? cell.refused : right ? cell.solved : cell.wrong);
  }
}

// A tenth or more of 200 observations right, or none, and a crowd of mismatches.
bool run_crowds(const cfp::PinholeCamera<double>& camera, int problems) {
  bool good = true;
  std::printf("\n%5s %6s %10s %9s %10s %8s\n", "right", "crowd", "patch px", "solved %", "refused %", "wrong %");
  for (const std::size_t right : {0U, 20U, 40U}) {
    for (const std::size_t crowd : {15U, 25U, 60U, 100U}) {
      for (const double half_px : {1.0, 3.0, 4.0, 6.0, 10.0}) {
        Cell cell;
        cfp::Random random(13, "pnp_ransac_study");
        cfp::PnpRansacWorkspace workspace;
        for (int k = 0; k < problems; ++k) {
          const Scene scene = cfp_test::make_crowded_scene(random, camera, 200, right, crowd, half_px);
          cfp::PnpRansacOptions options;
          options.seed = static_cast<std::uint64_t>(k);
          const auto result = cfp::pnp_ransac(scene.world, scene.pixels, {}, camera, options, workspace);
          const auto error = cfp_test::pose_distance(result.T_cam_world, scene.T_cam_world);
          const bool solved = right > 0 && error[0] < 0.2 && error[1] < 0.05;
          ++(!result.found() ? cell.refused : solved ? cell.solved : cell.wrong);
        }
        const double percent = 100.0 / problems;
        std::printf("%5zu %6zu %10.0f %9.1f %10.1f %8.1f\n", right, crowd, 2 * half_px, percent * cell.solved,
                    percent * cell.refused, percent * cell.wrong);
        std::fflush(stdout);
        good = good && cell.wrong <= 0.01 * problems + 1 && (right == 0 || cell.solved >= 0.9 * problems - 1);
      }
    }
  }
  return good;
}

}  // namespace

int main(int argc, char** argv) {
  const bool smoke = argc > 1 && std::strcmp(argv[1], "--smoke") == 0;
  const int problems = smoke ? 20 : argc > 1 ? std::atoi(argv[1]) : 1000;
  if (problems < 1) {
    std::fprintf(stderr, "usage: cfp_pnp_ransac_study [problems per cell >= 1 | --smoke]\n");
    return 2;
  }
  const Kind kinds[] = {{"volume", {535.4, 539.2, 320.1, 247.6}, false}, {"long lens", {8000, 8000, 320, 240}, true}};
  bool good = true;
  std::printf("%-10s %5s %10s %9s %10s %8s %9s %10s\n", "scene", "N", "mismatches", "solved %", "refused %", "wrong %",
              "samples", "median us");
  for (const Kind& kind : kinds) {
    for (const std::size_t points : {100U, 300U, 1000U}) {
      for (const double outliers : {0.0, 0.5, 0.7, 0.8, 0.85, 0.9, 1.0}) {
        Cell cell;
        run(kind, points, outliers, problems, cell);
        const double percent = 100.0 / problems;
        std::printf("%-10s %5zu %9.0f%% %9.1f %10.1f %8.1f %9.0f %10.1f\n", kind.name, points, 100 * outliers,
                    percent * cell.solved, percent * cell.refused, percent * cell.wrong,
                    cfp_benchmark::median(cell.iterations), cfp_benchmark::median(cell.times_us));
        std::fflush(stdout);
        // With a tenth of a hundred observations right there are hardly the eight inliers asked for.
        const bool enough = outliers < 1 && (1 - outliers) * static_cast<double>(points) >= 20;
        if (enough) good = good && cell.solved >= 0.97 * problems - 1 && cell.wrong <= 0.01 * problems + 1;
        if (outliers >= 1) good = good && cell.wrong <= 0.01 * problems + 1;
      }
    }
  }
  good = run_crowds(kinds[0].camera, (problems + 4) / 5) && good;
  return good ? 0 : 1;
}
