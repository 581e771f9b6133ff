// What is left when an allocation fails: nothing ends the program, workspaces are as good as new ones, and the driver
// goes on with the next frame.
#include <array>
#include <cstring>
#include <memory>
#include <new>
#include <set>
#include <tuple>
#include <vector>

#include "cfp/cfp.hpp"
#include "support/absolute_pose_scene.hpp"
#include "support/allocation_counter.hpp"
#include "support/ba_scene.hpp"
#include "support/catch.hpp"
#include "support/dynamic_scene.hpp"
#include "support/engines.hpp"
#include "support/pose_scene.hpp"
#include "support/two_view_scene.hpp"

namespace {

using cfp_test::DynamicScene;
using cfp_test::without_memory;

/// Where the allocator cannot be made to fail, there is nothing to see.
bool can_fail() {
  return without_memory([] { return 0; }, [](int) { ::operator delete(::operator new(8)); }, [](int) {}) > 0;
}

/// work(workspace) returns something comparable; fails everywhere, and then gives what a new workspace gives.
template <typename Workspace, typename Work>
void check_workspace(const Work& work) {
  Workspace fresh;
  const auto expected = work(fresh);
  const std::size_t failures =
      without_memory([] { return std::make_unique<Workspace>(); }, [&](auto& workspace) { (void)work(*workspace); },
                     [&](auto& workspace) { CHECK(work(*workspace) == expected); });
  CHECK(failures > 1);
}

struct Host {
  explicit Host(const DynamicScene<double>& small, const DynamicScene<double>& large)
      : scenes{&small, &large}, probability(small.camera) {}

  /// A pair of frames, by both stages.
  std::vector<double> both(const DynamicScene<double>& scene) {
    std::vector<cfp::Detection<double>> detections;
    for (const auto& box : scene.boxes) detections.push_back({box, 0, 0.8});
    cfp::Frame<double> frame;
    frame.timestamp_s = time += 1.0 / 32;
    frame.keypoints = scene.previous_keypoints;
    frame.depths = scene.previous_depths;
    frame.detections = detections;
    probability.coarse(frame);
    frame.timestamp_s = time += 1.0 / 32;
    frame.keypoints = scene.keypoints;
    frame.depths = scene.depths;
    frame.flow = {scene.previous_keypoints, scene.keypoints};
    probability.coarse(frame);
    const auto weight = probability.fine({scene.T_cur_prev, 300}, scene.match).weight;
    return {weight.begin(), weight.end()};
  }

  std::array<const DynamicScene<double>*, 2> scenes;
  cfp::StaticProbability<cfp::PinholeCamera<double>> probability;
  double time = 0;
};

/// The scene with every n-th keypoint only.
DynamicScene<double> thinned(DynamicScene<double> scene, std::size_t n) {
  const auto keep = [n](auto& values) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < values.size(); i += n) values[kept++] = values[i];
    values.resize(kept);
  };
  keep(scene.keypoints);
  keep(scene.previous_keypoints);
  keep(scene.depths);
  keep(scene.previous_depths);
  scene.match.resize(scene.keypoints.size());
  for (std::size_t i = 0; i < scene.match.size(); ++i) scene.match[i] = static_cast<std::int32_t>(i);
  return scene;
}

}  // namespace

TEST_CASE("A frame for which there was no memory is lost, the next is not", "[integration]") {
  if (!can_fail()) return;
  const auto large = cfp_test::make_dynamic_scene<double>({}, 31);
  const auto small = thinned(large, 3);
  Host untroubled(small, large);
  const auto expected = untroubled.both(small);
  const std::size_t failures = without_memory(
      [&] {
        auto host = std::make_unique<Host>(small, large);
        host->both(small);
        return host;
      },
      [&](auto& host) { host->both(large); },
      [&](auto& host) {
        const auto& state = host->probability.state();
        for (const auto* memory : {&state.previous, &state.current}) {
          CHECK((!memory->known || memory->depths.size() == memory->keypoints.size()));
        }
        for (const double w : host->both(small)) CHECK((w >= 0 && w <= 1));
        host->probability.reset();
        CHECK(host->both(small) == expected);
      });
  CHECK(failures > 20);
}

TEST_CASE("No two tracks of a tracker that ran out of memory have one id", "[integration]") {
  if (!can_fail()) return;
  const auto frame = [](int k) {
    std::vector<cfp::Detection<double>> boxes;
    for (int b = 0; b < 3 + 4 * k; ++b)
      if (b != k) boxes.push_back({{60.0 * b + k, 10, 60.0 * b + 50 + k, 200}, 0, 1});
    return boxes;
  };
  const std::vector<std::vector<cfp::Detection<double>>> frames{frame(0), frame(1), frame(2), frame(3)};
  const std::size_t failures = without_memory([&] { return std::make_unique<cfp::BoxTracker<double>>(); },
                                              [&](auto& tracker) {
                                                for (const auto& boxes : frames) (void)tracker->track(boxes, 0.03);
                                              },
                                              [&](auto& tracker) {
                                                const auto result = tracker->track(frames.back(), 0.03);
                                                std::set<std::int64_t> ids;
                                                for (const auto& box : result.boxes) ids.insert(box.id);
                                                CHECK(ids.size() == result.boxes.size());
                                                CHECK(result.boxes.size() >= frames.back().size());
                                              });
  CHECK(failures > 10);
}

TEST_CASE("A workspace that ran out of memory gives the bits of a new one", "[integration]") {
  if (!can_fail()) return;
  cfp::Random random(3, "out of memory");
  const auto views = cfp_test::make_two_view_scene<double>(random, {});
  const auto mask_of = [](const auto& result, const std::vector<char>& mask) {
    return std::make_tuple(result.status, result.inliers, result.iterations, mask);
  };
  check_workspace<cfp::FundamentalRansacWorkspace>([&](auto& workspace) {
    std::vector<char> mask(views.prev.size());
    const auto result = cfp::fundamental_ransac(cfp::PointPairs{views.prev, views.cur}, views.camera,
                                                cfp::FundamentalRansacOptions{}, workspace, mask);
    return mask_of(result, mask);
  });
  const cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};
  const auto absolute = cfp_test::make_absolute_pose_scene<double>(random, camera, {});
  check_workspace<cfp::PnpRansacWorkspace>([&](auto& workspace) {
    std::vector<char> mask(absolute.world.size());
    const auto result = cfp::pnp_ransac(absolute.world, absolute.pixels, absolute.weights, camera,
                                        cfp::PnpRansacOptions{}, workspace, mask);
    return mask_of(result, mask);
  });
  const auto pose = cfp_test::make_pose_scene<float>(5);
  check_workspace<cfp::PoseWorkspace<float>>([&](auto& workspace) {
    const auto result = cfp::refine_pose(pose.observations(), pose.camera, pose.start, cfp::PoseOptions{}, workspace);
    return std::make_tuple(result.status, result.inliers, result.cost);
  });
}

TEST_CASE("Bundle adjustment without memory leaves poses and points as they were", "[integration]") {
  if (!can_fail()) return;
  cfp_test::BaSceneOptions options;
  options.poses = 4;
  options.points = 40;
  const cfp_test::BaScene start = cfp_test::make_ba_scene(options, 7);
  struct Run {
    cfp_test::BaScene scene;
    cfp::BundleWorkspace workspace;
  };
  const auto adjust = [](auto& run) {
    return cfp::adjust_bundle(run->scene.problem(), cfp::BundleOptions{}, run->workspace).final_cost;
  };
  const auto same = [](const auto& a, const auto& b) {
    return std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])) == 0;
  };
  auto fresh = std::make_unique<Run>(Run{start, {}});
  const double expected = adjust(fresh);
  const std::size_t failures = without_memory(
      [&] {
        return std::make_unique<Run>(Run{start, {}});
      },
      [&](auto& run) { (void)adjust(run); },
      [&](auto& run) {
        CHECK(same(run->scene.poses, start.poses));
        CHECK(same(run->scene.points, start.points));
        CHECK(adjust(run) == expected);
      });
  CHECK(failures > 10);
}
