#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "cfp/optimization/bundle/bundle_adjustment.hpp"
#include "cfp/optimization/bundle/two_threads.hpp"
#include "support/adjust.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"

using cfp_test::adjust;

namespace {

struct BackwardExecutor {
  template <typename Task>
  void operator()(int count, const Task& task) const {
    for (int i = count - 1; i >= 0; --i) task(i);
  }
};

/// Whose thread pool ends at some call.
struct EndingExecutor {
  template <typename Task>
  void operator()(int count, const Task& task) {
    for (int i = 0; i < count; ++i) {
      if (i == 1 && calls_left-- == 0) throw std::runtime_error("no thread");
      task(i);
    }
  }
  int calls_left;
};

bool same_bits(const cfp_test::BaScene& a, const cfp_test::BaScene& b) {
  return std::memcmp(a.poses.data(), b.poses.data(), a.poses.size() * sizeof(a.poses[0])) == 0 &&
         std::memcmp(a.points.data(), b.points.data(), a.points.size() * sizeof(a.points[0])) == 0;
}

bool all_finite(const cfp_test::BaScene& scene) {
  double sum = 0;
  for (const auto& pose : scene.poses) sum += pose.rotation.sum() + pose.translation.sum();
  for (const auto& point : scene.points) sum += point.sum();
  return cfp::is_finite(sum);
}

}  // namespace

TEST_CASE("One thread, two threads and any order of the tasks give the same bits",
          "[optimization][bundle_adjustment]") {
  cfp::TwoThreads two_threads;
  cfp::BundleWorkspace workspace;
  for (const int poses : {2, 10, 80}) {
    cfp_test::BaSceneOptions options;
    options.poses = poses;
    options.points = 30 * poses;
    options.stereo_share = 0.3;
    const cfp_test::BaScene start = cfp_test::make_ba_scene(options, 1);
    cfp_test::BaScene one = start, two = start, backward = start, again = start;
    (void)adjust_bundle(one.problem(), cfp::BundleOptions{}, workspace);
    (void)adjust_bundle(two.problem(), cfp::BundleOptions{}, workspace, {}, two_threads);
    (void)adjust_bundle(backward.problem(), cfp::BundleOptions{}, workspace, {}, BackwardExecutor{});
    (void)adjust_bundle(again.problem(), cfp::BundleOptions{}, workspace);
    CHECK(same_bits(one, two));
    CHECK(same_bits(one, backward));
    CHECK(same_bits(one, again));
  }
}

TEST_CASE("An executor that throws leaves poses and points as they were, and the workspace as good as new",
          "[optimization][bundle_adjustment]") {
  cfp_test::BaSceneOptions options;
  options.poses = 30;
  options.points = 900;
  const cfp_test::BaScene start = cfp_test::make_ba_scene(options, 3);
  cfp_test::BaScene expected = start;
  REQUIRE(adjust(expected).accepted > 1);
  REQUIRE(expected.problem().observations.pose.size() >= 4000);
  cfp::BundleWorkspace workspace;
  bool done = false;
  for (int calls = 0; !done; ++calls) {
    cfp_test::BaScene scene = start;
    try {
      (void)adjust_bundle(scene.problem(), cfp::BundleOptions{}, workspace, {}, EndingExecutor{calls});
      done = true;
      CHECK(calls > 4);
      CHECK(same_bits(scene, expected));
    } catch (const std::runtime_error&) {
      CHECK(same_bits(scene, start));
    }
    if (calls % 3 != 0) continue;
    scene = start;
    (void)adjust_bundle(scene.problem(), cfp::BundleOptions{}, workspace);
    CHECK(same_bits(scene, expected));
  }
}

TEST_CASE("A second call of the same size allocates nothing; a large one nothing per iteration",
          "[optimization][bundle_adjustment]") {
  for (const int poses : {10, 100}) {
    cfp_test::BaSceneOptions options;
    options.poses = poses;
    options.points = 20 * poses;
    options.stereo_share = 0.3;
    const cfp_test::BaScene start = cfp_test::make_ba_scene(options, 2);
    cfp::BundleWorkspace workspace;
    const auto allocations = [&](int iterations) {
      cfp_test::BaScene scene = start;
      cfp::BundleOptions ba;
      ba.levenberg_marquardt.max_iterations = iterations;
      cfp::BundleResult result;
      const std::size_t count =
          cfp_test::allocations_in([&] { result = adjust_bundle(scene.problem(), ba, workspace); });
      CHECK(result.iterations == iterations);
      return count;
    };
    allocations(1);
    const std::size_t one = allocations(1), six = allocations(6);
    CHECK(one == six);
    if (poses == 10) CHECK(six == 0);
  }
}

TEST_CASE("Poses in any order, and one that sees everything: the reduced system stays sparse",
          "[optimization][bundle_adjustment]") {
  cfp_test::BaSceneOptions options;
  options.poses = 150;
  options.points = 3000;
  const cfp_test::BaScene film = cfp_test::make_ba_scene(options, 4);
  std::vector<int> number(film.poses.size());
  for (std::size_t k = 0; k < number.size(); ++k) number[k] = static_cast<int>(k);
  cfp::Random random(4, "order of poses");
  for (std::size_t k = number.size(); k > 1; --k)
    std::swap(number[k - 1], number[random.index(static_cast<std::uint32_t>(k))]);
  cfp_test::BaScene in_order = film, shuffled = film;
  for (std::size_t k = 0; k < number.size(); ++k) {
    const auto to = static_cast<std::size_t>(number[k]);
    shuffled.poses[to] = film.poses[k], shuffled.fixed[to] = film.fixed[k];
    shuffled.true_poses[to] = film.true_poses[k];
  }
  for (int& pose : shuffled.pose) pose = number[static_cast<std::size_t>(pose)];
  const cfp::BundleResult a = adjust(in_order), b = adjust(shuffled);
  CHECK(a.free_poses == 148);
  CHECK(a.factor_blocks < 16 * a.free_poses);
  CHECK(b.factor_blocks < 16 * b.free_poses);
  CHECK(a.iterations == b.iterations);
  CHECK(std::abs(a.final_cost - b.final_cost) < 1e-9 * a.final_cost);
  CHECK(std::abs(in_order.position_error() - shuffled.position_error()) < 1e-9);

  cfp_test::BaScene arrow;  // pose 0 sees all points, every other pose two of its own
  constexpr int leaves = 100;
  for (int k = 0; k <= leaves; ++k) arrow.poses.emplace_back();
  for (int j = 0; j < 2 * leaves; ++j) {
    arrow.points.emplace_back(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(2, 4));
    for (const int k : {0, 1 + j / 2}) {
      arrow.pose.push_back(k), arrow.point.push_back(j), arrow.pixels.emplace_back(320, 240);
      arrow.u_right.push_back(-1), arrow.sigma.push_back(1), arrow.weights.push_back(1);
    }
  }
  arrow.fixed.assign(arrow.poses.size(), 0);
  const cfp::BundleResult c = adjust(arrow);
  CHECK(c.free_poses == leaves + 1);
  CHECK(c.factor_blocks <= 2 * c.free_poses);
  CHECK(c.final_cost < c.initial_cost);
}

TEST_CASE("Up to 64 free poses the caller's order is kept, beyond they are ordered by their common points",
          "[optimization][bundle_adjustment]") {
  for (const std::size_t free_poses : {64U, 65U}) {
    cfp_test::BaScene chain;  // pose k shares points with pose k + half alone
    const std::size_t half = free_poses / 2;
    cfp::Random random(5, "chain");
    chain.poses.resize(free_poses);
    chain.fixed.assign(free_poses, 0);
    for (std::size_t k = 0; k < free_poses; ++k) {
      for (int j = 0; j < 3; ++j) {
        for (const std::size_t pose : {k, (k + half) % free_poses}) {
          chain.pose.push_back(static_cast<int>(pose)), chain.point.push_back(static_cast<int>(chain.points.size()));
          chain.pixels.emplace_back(320, 240), chain.u_right.push_back(-1);
          chain.sigma.push_back(1), chain.weights.push_back(1);
        }
        chain.points.emplace_back(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(2, 4));
      }
    }
    const cfp::BundleResult result = adjust(chain);
    CAPTURE(free_poses, result.factor_blocks);
    CHECK(result.free_poses == free_poses);
    CHECK((result.factor_blocks > 10 * free_poses) == (free_poses == 64));
  }
}

TEST_CASE("Without damping a point that one camera sees makes the system degenerate, and nothing moves",
          "[optimization][bundle_adjustment]") {
  cfp::BundleOptions undamped;
  undamped.levenberg_marquardt.initial_damping = undamped.levenberg_marquardt.min_damping = 0;
  for (const bool first : {true, false}) {
    for (const bool all_fixed : {true, false}) {
      cfp_test::BaSceneOptions options;
      options.points = 20;
      cfp_test::BaScene scene = cfp_test::make_ba_scene(options, 6);
      if (all_fixed) std::fill(scene.fixed.begin(), scene.fixed.end(), 1);
      if (first) {
        for (int& point : scene.point) ++point;
      }
      scene.pose.push_back(static_cast<int>(scene.poses.size()));
      scene.poses.emplace_back(), scene.fixed.push_back(1);
      scene.point.push_back(first ? 0 : 20);
      scene.points.insert(first ? scene.points.begin() : scene.points.end(), {0, 0, 2});  // on its axis: no parallax
      scene.pixels.emplace_back(scene.camera.cx, scene.camera.cy), scene.u_right.push_back(-1);
      scene.sigma.push_back(1), scene.weights.push_back(1);
      const cfp_test::BaScene start = scene;
      const cfp::BundleResult result = adjust(scene, undamped);
      CAPTURE(first, all_fixed);
      CHECK(result.status == cfp::SolverStatus::degenerate);
      CHECK(result.accepted == 0);
      CHECK(same_bits(scene, start));
      CHECK(adjust(scene).accepted > 0);  // with damping it stays, and the rest is adjusted
    }
  }
}

TEST_CASE("Degenerate after some steps: poses and points are as they were", "[optimization][bundle_adjustment]") {
  // Gauss-Newton on points that two cameras see under hardly any angle: some run off until rounding ends it.
  cfp::BundleOptions undamped;
  undamped.levenberg_marquardt.initial_damping = undamped.levenberg_marquardt.min_damping = 0;
  undamped.levenberg_marquardt.max_iterations = 100;
  int late = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    cfp::Random random(seed, "late");
    cfp_test::BaScene scene;
    scene.camera = {500, 500, 320, 240};
    for (int k = 0; k < 2; ++k) {
      scene.poses.emplace_back(), scene.fixed.push_back(1);
      scene.poses.back().translation.x() = -1e-3 * k;
    }
    for (int j = 0; j < 10; ++j) {
      const cfp::Vector3<double> point(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(2, 4));
      scene.points.push_back(point);
      for (int k = 0; k < 2; ++k) {
        const cfp::Vector3<double> seen = scene.poses[std::size_t(k)] * point;
        scene.pose.push_back(k), scene.point.push_back(j);
        scene.pixels.emplace_back(500 * seen.x() / seen.z() + 320 + random.normal(),
                                  500 * seen.y() / seen.z() + 240 + random.normal());
        scene.u_right.push_back(-1), scene.sigma.push_back(1), scene.weights.push_back(1);
      }
    }
    const cfp_test::BaScene start = scene;
    const cfp::BundleResult result = adjust(scene, undamped);
    if (cfp::is_solved(result.status)) continue;
    late += result.iterations > 1 ? 1 : 0;
    CHECK(same_bits(scene, start));
    CHECK(result.accepted == 0);
    CHECK(result.final_cost == result.initial_cost);
  }
  CHECK(late > 0);
}

TEST_CASE("Nothing to do is reported and changes nothing", "[optimization][bundle_adjustment]") {
  cfp::BundleWorkspace workspace;
  CHECK(adjust_bundle(cfp::BundleProblem<>{}, cfp::BundleOptions{}, workspace).status ==
        cfp::SolverStatus::not_enough_data);
  cfp_test::BaSceneOptions options;
  options.points = 20;
  const cfp_test::BaScene start = cfp_test::make_ba_scene(options, 3);
  cfp_test::BaScene scene = start;
  std::fill(scene.weights.begin(), scene.weights.end(), 0.0);
  cfp::BundleResult result = adjust(scene);
  CHECK(result.status == cfp::SolverStatus::no_weight);
  CHECK(result.zero_weight == scene.pose.size());
  CHECK(same_bits(scene, start));
  scene.weights.front() = -1;
  CHECK(adjust(scene).status == cfp::SolverStatus::not_enough_data);
  scene = start;
  for (cfp::Vector3<double>& point : scene.points) point.z() -= 1000;
  result = adjust(scene);
  CHECK(result.status == cfp::SolverStatus::degenerate);
  CHECK(result.behind == scene.pose.size());
  scene = start;
  cfp::BundleOptions none;
  none.levenberg_marquardt.max_iterations = 0;
  result = adjust(scene, none);
  CHECK(result.status == cfp::SolverStatus::iteration_limit);
  CHECK(result.final_cost == result.initial_cost);
  CHECK(same_bits(scene, start));
}

TEST_CASE("With all poses fixed the points alone are adjusted; fixed and untouched things keep their bits",
          "[optimization][bundle_adjustment]") {
  cfp_test::BaSceneOptions options;
  options.points = 50;
  cfp_test::BaScene scene = cfp_test::make_ba_scene(options, 4);
  std::fill(scene.fixed.begin(), scene.fixed.end(), 1);
  scene.points.emplace_back(1, 2, 3);
  const cfp_test::BaScene start = scene;
  const cfp::BundleResult result = adjust(scene);
  CHECK(result.free_poses == 0);
  CHECK(result.adjusted_points == 50);
  CHECK(result.final_cost < 0.7 * result.initial_cost);
  CHECK(std::memcmp(scene.poses.data(), start.poses.data(), scene.poses.size() * sizeof(scene.poses[0])) == 0);
  CHECK(scene.points.back() == start.points.back());
  CHECK(scene.points.front() != start.points.front());
}

TEST_CASE("Points behind a camera are left out and counted, and no step puts a used one there",
          "[optimization][bundle_adjustment]") {
  cfp_test::BaSceneOptions options;
  options.points = 200;
  options.start_point_m = 0.4;  // with depths from 0.8 m a Gauss-Newton step overshoots the cameras
  options.start_angle_deg = 3;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    cfp_test::BaScene scene = cfp_test::make_ba_scene(options, seed);
    for (std::size_t j = 0; j < 10; ++j) scene.points[j].z() = -2;
    const cfp_test::BaScene start = scene;
    cfp::BundleOptions ba;
    ba.levenberg_marquardt.max_iterations = 100;
    const cfp::BundleResult result = adjust(scene, ba);
    CHECK(result.behind >= 20);
    CHECK(result.used + result.behind == scene.pose.size());
    CHECK(result.final_cost < 0.1 * result.initial_cost);
    CHECK(all_finite(scene));
    for (std::size_t i = 0; i < scene.pose.size(); ++i) {
      const auto k = static_cast<std::size_t>(scene.pose[i]), j = static_cast<std::size_t>(scene.point[i]);
      if ((start.poses[k] * start.points[j]).z() > 1e-6) CHECK((scene.poses[k] * scene.points[j]).z() > 0);
    }
    for (std::size_t j = 0; j < 10; ++j) CHECK(scene.points[j] == start.points[j]);
  }
}

TEST_CASE("Hostile input is counted as invalid and does not change the rest", "[optimization][bundle_adjustment]") {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  cfp_test::BaSceneOptions options;
  options.points = 60;
  const cfp_test::BaScene clean = cfp_test::make_ba_scene(options, 5);
  cfp_test::BaScene expected = clean;
  const cfp::BundleResult reference = adjust(expected);
  cfp_test::BaScene scene = clean;
  const auto add = [&](int pose, int point, double u, double v, double sigma, double weight) {
    scene.pose.push_back(pose), scene.point.push_back(point), scene.pixels.emplace_back(u, v);
    scene.u_right.push_back(-1), scene.sigma.push_back(sigma), scene.weights.push_back(weight);
  };
  std::size_t invalid = 0;
  for (const int index : {-1, 1000, (std::numeric_limits<int>::max)(), (std::numeric_limits<int>::min)()}) {
    add(index, 0, 1, 1, 1, 1), add(0, index, 1, 1, 1, 1), invalid += 2;
  }
  for (const double bad : {nan, inf, -inf}) {
    add(3, 3, bad, 1, 1, 1), add(3, 3, 1, bad, 1, 1), add(3, 3, 1, 1, bad, 1), add(3, 3, 1, 1, 1, bad), invalid += 4;
  }
  add(3, 3, 1, 1, 0, 1), add(3, 3, 1, 1, -1, 1), add(3, 3, 1, 1, 1, -1), add(3, 3, 1, 1, 1e-200, 1),
      add(3, 3, 1e300, 1, 1, 1), add(3, 3, 1e5, 1, 1, 1e300), invalid += 6;
  scene.points.emplace_back(nan, 0, 1), add(3, static_cast<int>(scene.points.size()) - 1, 1, 1, 1, 1), ++invalid;
  scene.points.emplace_back(0, 0, inf), add(3, static_cast<int>(scene.points.size()) - 1, 1, 1, 1, 1), ++invalid;
  for (const bool scaled : {false, true}) {  // not finite, and no rotation
    scene.poses.emplace_back(), scene.fixed.push_back(0);
    if (scaled)
      scene.poses.back().rotation *= 1.1;
    else
      scene.poses.back().translation.x() = nan;
    add(static_cast<int>(scene.poses.size()) - 1, 0, 1, 1, 1, 1), ++invalid;
  }
  std::vector<double> errors(scene.pose.size());
  cfp::BundleWorkspace workspace;
  const cfp::BundleResult result = adjust_bundle(scene.problem(), cfp::BundleOptions{}, workspace, errors);
  CHECK(result.invalid == invalid);
  CHECK(result.used == clean.pose.size());
  CHECK(result.final_cost == reference.final_cost);
  CHECK(std::memcmp(scene.poses.data(), expected.poses.data(), expected.poses.size() * sizeof(expected.poses[0])) == 0);
  for (std::size_t i = 0; i < errors.size(); ++i) {
    CHECK(cfp::is_finite(errors[i]));
    CHECK((errors[i] >= 0) == (i < clean.pose.size()));
  }
}

TEST_CASE("Any finite numbers give a finite result and an end", "[optimization][bundle_adjustment]") {
  cfp_test::BaSceneOptions options;
  options.poses = 4;
  options.points = 10;
  options.stereo_share = 0.5;
  cfp::Random random(9, "hostile numbers");
  const double extremes[] = {0, 1, -1, 1e-300, 1e-30, 1e-8, 1e8, 1e30, 1e150, 1e300, 5e-324};
  for (int round = 0; round < 300; ++round) {
    CAPTURE(round);
    cfp_test::BaScene scene = cfp_test::make_ba_scene(options, 1);
    const auto extreme = [&] { return extremes[random.index(11)]; };
    for (int change = 0; change < 4; ++change) {
      const std::size_t i = random.index(static_cast<std::uint32_t>(scene.pose.size()));
      switch (random.index(7)) {
        case 0:
          scene.pixels[i].x() = extreme();
          break;
        case 1:
          scene.u_right[i] = extreme();
          break;
        case 2:
          scene.sigma[i] = extreme();
          break;
        case 3:
          scene.weights[i] = extreme();
          break;
        case 4:
          scene.points[i % 10][static_cast<int>(random.index(3))] = extreme();
          break;
        case 5:
          scene.poses[i % 4].translation[static_cast<int>(random.index(3))] = extreme();
          break;
        default:
          scene.poses[i % 4].rotation(static_cast<int>(random.index(3)), 1) = extreme();
          break;
      }
    }
    cfp::BundleOptions ba;
    ba.loss = static_cast<cfp::LossType>(random.index(5));
    ba.levenberg_marquardt.max_iterations = 30;
    const cfp::BundleResult result = adjust(scene, ba);
    CHECK(cfp::is_finite(result.final_cost));
    CHECK(result.final_cost <= result.initial_cost);
    CHECK(result.used + result.behind + result.invalid + result.zero_weight == scene.pose.size());
    CHECK(all_finite(scene));
  }
}

TEST_CASE("Badly determined problems end without harm", "[optimization][bundle_adjustment]") {
  for (const int views : {1, 2}) {
    cfp_test::BaSceneOptions options;
    options.views_per_point = views;  // one view: depth is free
    options.points = 30;
    cfp_test::BaScene scene = cfp_test::make_ba_scene(options, 6);
    const cfp::BundleResult result = adjust(scene);
    CHECK(result.final_cost <= result.initial_cost);
    CHECK(all_finite(scene));
  }
  cfp_test::BaSceneOptions all_equal;
  all_equal.points = 20;
  cfp_test::BaScene scene = cfp_test::make_ba_scene(all_equal, 7);
  for (auto& point : scene.points) point = cfp::Vector3<double>(0, 0, 4);
  CHECK(adjust(scene).final_cost >= 0);
  CHECK(all_finite(scene));
}

TEST_CASE("Options of the bundle adjustment outside their range are named, nested ones with a dot",
          "[optimization][bundle_adjustment]") {
  cfp::BundleOptions options;
  CHECK(!invalid_field(options));
  options.chi2_mono = std::numeric_limits<double>::quiet_NaN();
  CHECK(invalid_field(options).string() == "chi2_mono");
  options = {};
  options.chi2_stereo = 0;
  CHECK(invalid_field(options).string() == "chi2_stereo");
  options = {};
  options.loss = static_cast<cfp::LossType>(17);
  CHECK(invalid_field(options).string() == "loss");
  options = {};
  options.levenberg_marquardt.max_iterations = -1;
  CHECK(invalid_field(options).string() == "levenberg_marquardt.max_iterations");
}

TEST_CASE("Rotations that are off in their last digits do not move cameras that are far from the origin",
          "[optimization][bundle_adjustment]") {
  const auto far_off = [](double error) {
    cfp_test::BaScene scene = cfp_test::make_ba_scene({}, 8);
    cfp::Random random(8, "digits");
    const cfp::Vector3<double> origin(1e4, -2e4, 5e3);
    for (cfp::Vector3<double>& point : scene.points) point += origin;
    for (cfp::SE3<double>& pose : scene.poses) {
      const cfp::Vector3<double> centre = pose.inverse().translation + origin;
      for (int i = 0; i < 9; ++i) pose.rotation(i / 3, i % 3) += error * random.normal();
      pose.translation = -(pose.rotation * centre);
    }
    return adjust(scene);
  };
  const cfp::BundleResult exact = far_off(0);
  REQUIRE(cfp::is_solved(exact.status));
  for (const double error : {1e-7, 1e-5}) {
    const cfp::BundleResult off = far_off(error);
    CAPTURE(error, to_string(off.status));
    CHECK(cfp::is_solved(off.status));
    CHECK((off.used == exact.used && off.behind == exact.behind));
    CHECK(off.initial_cost == Approx(exact.initial_cost).epsilon(1e-3));
    CHECK(off.final_cost == Approx(exact.final_cost).epsilon(1e-3));
  }
}

TEST_CASE("A point at the least depth, where a step may leave it, does not undo the solution",
          "[optimization][bundle_adjustment]") {
  cfp::Random random(9, "border");
  for (int i = 0; i < 200; ++i) {
    cfp_test::BaScene scene = cfp_test::make_ba_scene({}, 9);
    const std::size_t k = random.index(10), o = random.index(1000);
    scene.poses[k] = {cfp::so3_exp(cfp_test::random_vector(random, 1)), cfp_test::random_vector(random, 1)};
    scene.pose[o] = static_cast<int>(k);
    const double z = cfp::Tolerance<double>::min_depth * (1 + 1e-12 * random.normal());
    scene.points[static_cast<std::size_t>(scene.point[o])] =
        scene.poses[k].inverse() * cfp::Vector3<double>(0.1 * z, 0.1 * z, z);
    const cfp::BundleResult result = adjust(scene);
    CHECK(cfp::is_solved(result.status));
    CHECK(result.behind >= 1);
  }
}
