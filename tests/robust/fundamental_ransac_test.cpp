#include "cfp/robust/fundamental_ransac.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <numeric>
#include <sstream>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "cfp/geometry/epipolar.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/data.hpp"
#include "support/dynamic_scene.hpp"
#include "support/engines.hpp"
#include "support/two_view_scene.hpp"

using cfp::fundamental_ransac;
using cfp::FundamentalRansacOptions;
using cfp::FundamentalRansacWorkspace;
using cfp::FundamentalResult;
using cfp::Matrix3;
using cfp::PointPairs;
using cfp::RansacStatus;
using cfp_test::make_two_view_scene;
using cfp_test::SceneShape;
using cfp_test::TwoViewOptions;

namespace {

TwoViewOptions noisy(std::size_t pairs, double outlier_share) {
  TwoViewOptions options;
  options.pairs = pairs;
  options.outlier_share = outlier_share;
  options.noise_px = 0.5;
  return options;
}

/// Pairs before a camera that rests, or turns by `rotation_rad`.
TwoViewOptions without_parallax(std::size_t pairs, double outlier_share, double noise_px, double rotation_rad) {
  TwoViewOptions options = noisy(pairs, outlier_share);
  options.noise_px = noise_px;
  options.translation_m = 0;
  options.rotation_rad = rotation_rad;
  return options;
}

/// Makes the first `count` pairs those of somebody this deep in front of the camera, whose image moves by `step` beside
/// the camera's motion.
void put_walker(std::size_t count, double depth_m, const cfp::Vector2<double>& step, cfp::Random& random,
                cfp_test::TwoViewScene<double>& scene) {
  const double left = random.uniform(0, 500);
  for (std::size_t i = 0; i < count; ++i) {
    scene.prev[i] = {left + random.uniform(0, 130), random.uniform(60, 440)};
    cfp::Vector3<double> ray;
    REQUIRE(scene.camera.unproject({scene.prev[i][0], scene.prev[i][1]}, ray));
    cfp::Vector2<double> now(0, 0);
    REQUIRE(scene.camera.project(scene.T_cur_prev * cfp::Vector3<double>(depth_m * ray), now));
    scene.cur[i] = {now.x() + step.x(), now.y() + step.y()};
    scene.is_inlier[i] = 0;
  }
}

struct Labelled {
  std::vector<std::array<double, 2>> prev, cur;
  std::vector<char> label;
};

Labelled read_labelled(const std::filesystem::path& path) {
  Labelled pairs;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    std::istringstream in(line);
    std::array<double, 2> p{}, q{};
    double one = 0, label = 0;
    if (!(in >> p[0] >> p[1] >> one >> q[0] >> q[1] >> one >> label)) continue;
    pairs.prev.push_back(p), pairs.cur.push_back(q), pairs.label.push_back(label != 0 ? 1 : 0);
  }
  return pairs;
}

}  // namespace

TEMPLATE_TEST_CASE("F survives mismatches", "[robust]", float, double) {
  cfp::Random random(31, "mismatches");
  FundamentalRansacWorkspace workspace;
  for (const double outliers : {0.0, 0.2, 0.4, 0.55}) {
    for (int trial = 0; trial < 20; ++trial) {
      const auto scene = make_two_view_scene<TestType>(random, noisy(300, outliers));
      std::vector<char> mask(300);
      const auto result =
          fundamental_ransac(PointPairs{scene.prev, scene.cur}, FundamentalRansacOptions{}, workspace, mask);
      REQUIRE(result.found());
      CHECK(cfp_test::median_sampson_of_truth<TestType>(scene, result.F) < 0.35);  // noise is 0.5 px per coordinate
      CHECK(std::size_t(std::count(mask.begin(), mask.end(), 1)) == result.inliers);
      CHECK_THAT(result.inlier_share, WithinAbs(double(result.inliers) / 300, 1e-9));
      int kept = 0, caught = 0, mismatches = 0;
      for (std::size_t i = 0; i < 300; ++i) {
        mismatches += scene.is_inlier[i] == 0 ? 1 : 0;
        (scene.is_inlier[i] != 0 ? kept : caught) += mask[i];
      }
      CHECK(kept > 0.8 * (300 - mismatches));  // 95 % under the true F
      CHECK(caught <= 0.2 * mismatches + 3);   // a shift along the line cannot be seen
      CHECK_THAT(double(result.F.norm()), WithinAbs(1, 1e-6));
      CHECK(std::abs(double(result.F.determinant())) < 1e-7);
    }
  }
}

TEST_CASE("F is nearly as good as from the true inliers alone", "[robust]") {
  // A short baseline has several minima; one that chance led into would show in the mean.
  FundamentalRansacWorkspace workspace;
  for (const double outliers : {0.2, 0.4}) {
    cfp::Random random(45, "efficiency");
    double found = 0, ideal = 0;
    for (int trial = 0; trial < 60; ++trial) {
      const auto scene = make_two_view_scene<double>(random, noisy(500, outliers));
      found += cfp_test::median_sampson_of_truth<double>(
          scene, fundamental_ransac(PointPairs{scene.prev, scene.cur}, FundamentalRansacOptions{}, workspace).F);
      const std::vector<double> labels(scene.is_inlier.begin(), scene.is_inlier.end());
      cfp::detail::PairArrays inliers;
      cfp::detail::load_pairs(PointPairs{scene.prev, scene.cur, labels}, 1e-6, inliers);
      cfp::detail::FactoredF<double> F(cfp_test::scaled_fundamental(scene.F, inliers.scaling));
      cfp::detail::refine<7>(cfp::detail::SampsonModel<double>{cfp::detail::exact_columns(inliers), 1e6}, 30, 1e-10, F);
      ideal += cfp_test::median_sampson_of_truth<double>(
          scene, cfp::detail::unscaled_fundamental(F.matrix(), inliers.scaling));
    }
    CHECK(found < (outliers < 0.3 ? 1.2 : 1.3) * ideal);
  }
}

TEMPLATE_TEST_CASE("F is as uncertain as it says, at its own pairs and where it has none", "[robust]", float, double) {
  const auto of_most = static_cast<TestType>(GENERATE(1.0, 0.25));  // the weight of all but one: it is no information
  double inside = 0, beside = 0;
  std::size_t n_inside = 0, n_beside = 0;
  FundamentalRansacWorkspace workspace;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    cfp::Random random(seed, "covariance of F");
    const auto scene = make_two_view_scene<TestType>(random, noisy(300, 0.1));
    std::vector<TestType> weights;  // the right part of the image has no pairs
    for (const auto& pixel : scene.prev) weights.push_back(pixel[0] < TestType(440) ? of_most : TestType(0));
    *std::find(weights.begin(), weights.end(), of_most) = TestType(1);
    const FundamentalResult<TestType> result =
        fundamental_ransac(PointPairs<TestType>{scene.prev, scene.cur, weights}, FundamentalRansacOptions{}, workspace);
    REQUIRE(result.found());
    const cfp::FundamentalCovariance covariance = fundamental_covariance(result, workspace);
    for (std::size_t i = 0; i < scene.prev.size(); ++i) {
      const cfp::Vector3<double> p(static_cast<double>(scene.exact_prev[i][0]),
                                   static_cast<double>(scene.exact_prev[i][1]), 1),
          q(static_cast<double>(scene.exact_cur[i][0]), static_cast<double>(scene.exact_cur[i][1]), 1);
      Eigen::Matrix<double, 9, 1> a;
      a << q[0] * p, q[1] * p, p;
      const double error = q.dot(result.F.template cast<double>() * p), ratio = error * error / a.dot(covariance * a);
      (weights[i] > 0 ? inside : beside) += ratio;
      ++(weights[i] > 0 ? n_inside : n_beside);
    }
  }
  CHECK_THAT(inside / static_cast<double>(n_inside), WithinAbs(1.0, 0.35));
  CHECK_THAT(beside / static_cast<double>(n_beside), WithinAbs(1.0, 0.35));
}

TEST_CASE("Without F there is no covariance of it", "[robust]") {
  cfp::Random random(1, "no F");
  const auto scene = make_two_view_scene<double>(random, without_parallax(200, 0, 0.2, 0.05));
  FundamentalRansacWorkspace workspace;
  const auto result = fundamental_ransac(PointPairs{scene.prev, scene.cur}, FundamentalRansacOptions{}, workspace);
  REQUIRE_FALSE(result.found());
  CHECK(fundamental_covariance(result, workspace).isZero(0));
}

TEST_CASE("Few pairs and many mismatches: F is found as far as samples go", "[robust]") {
  FundamentalRansacWorkspace workspace;
  cfp::Random random(46, "hard");
  int lost = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const auto scene = make_two_view_scene<double>(random, noisy(120, 0.55));
    const auto result = fundamental_ransac(PointPairs{scene.prev, scene.cur}, FundamentalRansacOptions{}, workspace);
    lost += result.found() && cfp_test::median_sampson_of_truth<double>(scene, result.F) < 0.4 ? 0 : 1;
  }
  CHECK(lost <= 30);  // of 500: a thousand samples miss with a chance of 2.5 %, and 1.5 % are refused or led astray
}

TEST_CASE("Without noise mismatches move F by a fiftieth of the threshold at most", "[robust]") {
  cfp::Random random(32, "exact");
  FundamentalRansacWorkspace workspace;
  for (int trial = 0; trial < 20; ++trial) {
    TwoViewOptions options = noisy(200, 0.3);
    options.noise_px = 0;
    const auto scene = make_two_view_scene<double>(random, options);
    FundamentalRansacOptions tight;
    tight.threshold_px = 0.1;
    const auto result = fundamental_ransac(PointPairs{scene.prev, scene.cur}, tight, workspace);
    REQUIRE(result.found());
    CHECK(cfp_test::median_sampson_of_truth<double>(scene, result.F) < 0.02 * tight.threshold_px);
  }
}

TEST_CASE("Pairs that a homography explains give a reason and no F", "[robust]") {
  cfp::Random random(33, "degenerate");
  FundamentalRansacWorkspace workspace;
  struct Case {
    SceneShape shape;
    double translation_m, rotation_rad;
    RansacStatus with_camera, without;
  };
  const Case cases[] = {{SceneShape::volume, 0, 0.035, RansacStatus::pure_rotation, RansacStatus::homography},
                        {SceneShape::plane, 0.1, 0.035, RansacStatus::planar, RansacStatus::homography},
                        {SceneShape::volume, 0, 0, RansacStatus::no_motion, RansacStatus::no_motion}};
  for (const Case& c : cases) {
    for (const double outliers : {0.0, 0.2, 0.4}) {
      for (int trial = 0; trial < 30; ++trial) {
        TwoViewOptions options = noisy(trial % 2 == 0 ? 150 : 500, outliers);
        options.shape = c.shape;
        options.translation_m = c.translation_m;
        options.rotation_rad = c.rotation_rad;
        const auto scene = make_two_view_scene<double>(random, options);
        const auto result =
            fundamental_ransac(PointPairs{scene.prev, scene.cur}, scene.camera, FundamentalRansacOptions{}, workspace);
        CHECK(result.status == c.with_camera);
        CHECK(result.F.isZero());
        CHECK(result.homography.determinant() > 0);
        const auto true_inliers = std::count(scene.is_inlier.begin(), scene.is_inlier.end(), 1);
        CHECK(double(result.inliers) > 0.85 * double(true_inliers));
        CHECK(fundamental_ransac(PointPairs{scene.prev, scene.cur}, FundamentalRansacOptions{}, workspace).status ==
              c.without);
        double squares = 0;
        for (std::size_t i = 0; i < scene.world.size(); ++i) {
          const Eigen::Vector3d mapped =
              result.homography * Eigen::Vector3d(scene.exact_prev[i][0], scene.exact_prev[i][1], 1);
          squares +=
              (mapped.hnormalized() - Eigen::Vector2d(scene.exact_cur[i][0], scene.exact_cur[i][1])).squaredNorm() /
              double(scene.world.size());
        }
        CHECK(std::sqrt(squares) < 0.5);
      }
    }
  }
}

TEST_CASE("A floor or a wall that the camera comes near to gives no F", "[robust]") {
  // Its homography stretches the noise of the previous image, mostly away from the epipole: no parallax.
  constexpr cfp::PinholeCamera<double> camera{500, 500, 320, 240};
  const auto seen = [](const cfp::Vector2<double>& u) { return u.x() > 0 && u.x() < 640 && u.y() > 0 && u.y() < 480; };
  cfp::Random random(99, "ahead");
  FundamentalRansacWorkspace workspace;
  for (const bool floor : {true, false}) {
    for (const double step_m : {0.3, 1.0, -1.0}) {
      int wrong = 0, named = 0;
      for (int trial = 0; trial < 50; ++trial) {
        std::vector<std::array<double, 2>> previous, current;
        while (previous.size() < 200) {
          const double a = random.uniform(-1, 1), b = random.uniform(-1, 1);
          const cfp::Vector3<double> point =
              floor ? cfp::Vector3<double>(3 * a, 1.2, 5 + 2.5 * b) : cfp::Vector3<double>(3 * a, 2 * b, 5 + a);
          cfp::Vector2<double> u(0, 0), v(0, 0);
          if (!camera.project(point, u) || !seen(u)) continue;
          if (!camera.project(point + step_m * cfp::Vector3<double>(0.05, 0.03, -1), v) || !seen(v)) continue;
          previous.push_back({u.x() + 0.5 * random.normal(), u.y() + 0.5 * random.normal()});
          current.push_back({v.x() + 0.5 * random.normal(), v.y() + 0.5 * random.normal()});
        }
        const auto result = fundamental_ransac(PointPairs{previous, current}, camera, {}, workspace);
        wrong += result.found() ? 1 : 0;
        named += result.status == RansacStatus::planar ? 1 : 0;
      }
      INFO((floor ? "floor" : "wall") << ", " << step_m << " m ahead: F in " << wrong << ", planar in " << named);
      CHECK(wrong <= 1);
      CHECK(named >= 49);
    }
  }
}

TEST_CASE("A dominant plane with parallax beside it gives F", "[robust]") {
  cfp::Random random(34, "dominant plane");
  FundamentalRansacWorkspace workspace;
  for (int trial = 0; trial < 30; ++trial) {
    TwoViewOptions options = noisy(500, 0.2);
    options.shape = SceneShape::volume_and_plane;
    options.plane_share = 0.75;
    const auto scene = make_two_view_scene<double>(random, options);
    const auto result = fundamental_ransac(PointPairs{scene.prev, scene.cur}, FundamentalRansacOptions{}, workspace);
    REQUIRE(result.found());
    CHECK(cfp_test::median_sampson_of_truth<double>(scene, result.F) < 0.3);
  }
}

TEST_CASE("Little parallax beside a plane is found below mismatches, at the noise of the plane's pairs", "[robust]") {
  // Three mismatches in ten, parallax in seven of a hundred: under the threshold chance lines pass near as many pairs.
  cfp::Random random(50, "few off the plane"), elsewhere(51, "points off it");
  FundamentalRansacWorkspace workspace;
  int found = 0, wrong = 0;
  for (const double noise_px : {0.0, 0.05}) {
    for (const double outliers : {0.2, 0.3}) {
      for (int trial = 0; trial < 60; ++trial) {
        TwoViewOptions options = noisy(300, outliers);
        options.noise_px = noise_px;
        options.shape = SceneShape::volume_and_plane;
        options.plane_share = 0.9;
        const auto scene = make_two_view_scene<double>(random, options);
        const auto result =
            fundamental_ransac(PointPairs{scene.prev, scene.cur}, FundamentalRansacOptions{}, workspace);
        if (!result.found()) continue;
        ++found;
        std::vector<double> distances;  // of points everywhere, as those of the plane know no wrong epipole
        for (int k = 0; k < 201; ++k) {
          const cfp::Vector3<double> ray(0.3 * elsewhere.normal(), 0.3 * elsewhere.normal(), 1);
          const cfp::Vector3<double> point = elsewhere.uniform(0.6, 5) * ray;
          cfp::Vector2<double> u, v;
          REQUIRE((scene.camera.project(point, u) && scene.camera.project(scene.T_cur_prev * point, v)));
          distances.push_back(cfp_test::sampson_distance<double>(result.F, u, v));
        }
        std::nth_element(distances.begin(), distances.begin() + 100, distances.end());
        wrong += distances[100] < 0.05 + noise_px ? 0 : 1;
      }
    }
  }
  CHECK(found >= 222);
  CHECK(wrong <= 2);  // of 240: two in a thousand are, and which depends on the rounding of the compiler
}

TEST_CASE("Same input and seed give the same bits, in a fresh or a used workspace and mask", "[robust]") {
  cfp::Random random(35, "bits");
  FundamentalRansacWorkspace used;
  for (const cfp::Sampling sampling : {cfp::Sampling::uniform, cfp::Sampling::weighted}) {
    const auto scene = make_two_view_scene<double>(random, noisy(400, 0.4));
    std::vector<double> weights(400);
    for (double& w : weights) w = random.uniform(0.1, 1);
    FundamentalRansacOptions options;
    options.sampling = sampling;
    options.seed = 77;
    FundamentalRansacWorkspace fresh;
    std::vector<char> mask_a(400), mask_b(400, 1);
    const auto a = fundamental_ransac(PointPairs{scene.prev, scene.cur, weights}, options, used, mask_a);
    const auto b = fundamental_ransac(PointPairs{scene.prev, scene.cur, weights}, options, fresh, mask_b);
    CHECK(a.F == b.F);
    CHECK(a.iterations == b.iterations);
    CHECK(mask_a == mask_b);
  }
}

TEST_CASE("Absent pairs change nothing, weights guide the search", "[robust]") {
  cfp::Random random(36, "weights");
  FundamentalRansacWorkspace workspace;
  auto scene = make_two_view_scene<double>(random, noisy(300, 0.3));
  std::vector<double> weights(300, 1.0);
  const auto expected =
      fundamental_ransac(PointPairs{scene.prev, scene.cur, weights}, FundamentalRansacOptions{}, workspace);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::array<double, 2> hostile[] = {
      {nan, 0}, {1, std::numeric_limits<double>::infinity()}, {1e300, 5}, {5, 5}, {7, 7}, {9, 9}};
  for (std::size_t k = 0; k < 6; ++k) {
    scene.prev.push_back(hostile[k]);
    scene.cur.push_back({100, 100});
    weights.push_back(k < 3 ? 1.0 : k == 3 ? 0.0 : k == 4 ? -2.0 : nan);
  }
  const auto result =
      fundamental_ransac(PointPairs{scene.prev, scene.cur, weights}, FundamentalRansacOptions{}, workspace);
  CHECK(result.F == expected.F);
  CHECK(result.used == 300);

  // 70 % mismatches: out of reach for 1000 uniform samples, within it when the weights know.
  double iterations = 0;
  for (int trial = 0; trial < 10; ++trial) {
    const auto hard = make_two_view_scene<double>(random, noisy(400, 0.7));
    std::vector<double> known(400);
    for (std::size_t i = 0; i < 400; ++i)
      known[i] = hard.is_inlier[i] != 0 ? random.uniform(0.5, 1) : random.uniform(0, 0.3);
    const auto guided =
        fundamental_ransac(PointPairs{hard.prev, hard.cur, known}, FundamentalRansacOptions{}, workspace);
    REQUIRE(guided.found());
    CHECK(cfp_test::median_sampson_of_truth<double>(hard, guided.F) < 0.4);
    iterations += double(guided.iterations) / 10;
  }
  CHECK(iterations < 400);
}

TEST_CASE("A few heavy pairs beside many light ones are few pairs", "[robust]") {
  FundamentalRansacWorkspace workspace;
  cfp::Random random(53, "heavy");
  int wrong = 0, right = 0;
  for (int trial = 0; trial < 30; ++trial) {
    const auto scene = make_two_view_scene<double>(random, noisy(300, 0.3));
    std::vector<double> weights(300);
    const auto run = [&] {
      const auto result =
          fundamental_ransac(PointPairs{scene.prev, scene.cur, weights}, FundamentalRansacOptions{}, workspace);
      const bool good = result.found() && cfp_test::median_sampson_of_truth<double>(scene, result.F) < 0.6;
      right += good ? 1 : 0;
      wrong += result.found() && !good ? 1 : 0;
    };
    for (const std::size_t heavy : {3U, 5U, 8U}) {
      for (std::size_t i = 0; i < 300; ++i) weights[i] = i < heavy ? 1.0 : 1e-3;
      run();
    }
    CHECK(right == trial);
    for (double& w : weights) w = std::pow(10.0, random.uniform(-3, 0));
    run();
  }
  CHECK(wrong == 0);
  CHECK(right == 30);
}

TEST_CASE("Too little, coincident or unstructured input is reported and never crashes", "[robust]") {
  FundamentalRansacWorkspace workspace;
  const auto run = [&](const std::vector<std::array<double, 2>>& prev, const std::vector<std::array<double, 2>>& cur) {
    std::vector<char> mask(prev.size(), 9);
    const FundamentalResult<double> result =
        fundamental_ransac(PointPairs{prev, cur}, FundamentalRansacOptions{}, workspace, mask);
    CHECK(result.F.allFinite());
    CHECK(result.homography.allFinite());
    const auto count = [&](char label) { return std::size_t(std::count(mask.begin(), mask.end(), label)); };
    CHECK((count(1) == result.inliers && count(0) == prev.size() - result.inliers));
    CHECK((result.inlier_share >= 0 && result.inlier_share <= 1));
    return result.status;
  };
  cfp::Random random(37, "hostile");
  const auto scene = make_two_view_scene<double>(random, noisy(6, 0));
  CHECK(run({}, {}) == RansacStatus::not_enough_data);
  CHECK(run(scene.prev, scene.cur) == RansacStatus::not_enough_data);
  const std::vector<std::array<double, 2>> equal(50, {10.0, 20.0});
  CHECK(run(equal, equal) == RansacStatus::degenerate);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::array<double, 2>> bad(50, {nan, nan});
  CHECK(run(bad, bad) == RansacStatus::not_enough_data);
  std::vector<std::array<double, 2>> line, shifted, a, b;
  for (int i = 0; i < 60; ++i) {
    line.push_back({10.0 * i, 5.0 * i + 3});
    shifted.push_back({10.0 * i + 4, 5.0 * i + 9});
    a.push_back({random.uniform(0, 640), random.uniform(0, 480)});
    b.push_back({random.uniform(0, 640), random.uniform(0, 480)});
  }
  CHECK_FALSE(run(line, shifted) == RansacStatus::ok);
  CHECK_FALSE(run(line, line) == RansacStatus::ok);
  const RansacStatus chance = run(a, b);
  CHECK((chance == RansacStatus::no_consensus || chance == RansacStatus::iteration_limit));
  std::vector<std::array<double, 2>> two_places(60, {10.0, 20.0});
  for (std::size_t i = 0; i < 30; ++i) two_places[i] = {400.0, 300.0};
  CHECK_FALSE(run(two_places, two_places) == RansacStatus::ok);
}

TEST_CASE("Options outside their range are named", "[robust]") {
  FundamentalRansacOptions options;
  CHECK(!invalid_field(options));
  options.threshold_px = std::numeric_limits<double>::quiet_NaN();
  CHECK(invalid_field(options).string() == "threshold_px");
  options = {};
  options.confidence = 1;
  CHECK(invalid_field(options).string() == "confidence");
  options = {};
  options.min_inliers = 7;
  CHECK(invalid_field(options).string() == "min_inliers");
}

TEST_CASE("The smallest threshold that validation accepts is only a threshold", "[robust]") {
  // Its square is 0: copies of one pair over cells without a size are not a number (found by tests/fuzz), and a cut
  // that is widened from 0 stays there.
  const std::vector<std::array<double, 2>> copies(40, {100, 100});
  cfp::Random random(40, "threshold");
  const auto scene = make_two_view_scene<double>(random, noisy(100, 0.2));
  FundamentalRansacWorkspace workspace;
  FundamentalRansacOptions options;
  options.threshold_px = std::numeric_limits<double>::denorm_min();
  REQUIRE(!invalid_field(options));
  CHECK_FALSE(fundamental_ransac(PointPairs{copies, copies}, options, workspace).found());
  CHECK_FALSE(fundamental_ransac(PointPairs{scene.prev, scene.cur}, options, workspace).found());
}

TEST_CASE("A second call allocates nothing", "[robust]") {
  cfp::Random random(38, "allocation");
  const auto scene = make_two_view_scene<double>(random, noisy(500, 0.4));
  TwoViewOptions rotation_options = noisy(500, 0.2);
  rotation_options.translation_m = 0;
  const auto rotation = make_two_view_scene<double>(random, rotation_options);
  std::vector<double> weights(500, 0.5);
  std::vector<char> mask(500);
  FundamentalRansacWorkspace workspace;
  for (const cfp::Sampling sampling : {cfp::Sampling::weighted, cfp::Sampling::uniform}) {
    FundamentalRansacOptions options;
    options.sampling = sampling;
    (void)fundamental_ransac(PointPairs{scene.prev, scene.cur, weights}, options, workspace, mask);
    CHECK(cfp_test::allocations_in([&] {
            (void)fundamental_ransac(PointPairs{scene.prev, scene.cur, weights}, options, workspace, mask);
            (void)fundamental_ransac(PointPairs{rotation.prev, rotation.cur, weights}, rotation.camera, options,
                                     workspace, mask);
          }) == 0);
  }
  // Nor after a call that did not get as far.
  std::vector<double> half(500, 1.0);
  for (std::size_t i = 0; i < 500; i += 2) half[i] = 0;
  for (double& w : weights) w = random.uniform(0.1, 1);
  const std::vector<double> none(500, 0.0);
  for (const std::vector<double>& first : {std::vector<double>(), half, none}) {
    FundamentalRansacWorkspace other;
    (void)fundamental_ransac(PointPairs{scene.prev, scene.cur, first}, {}, other, mask);
    CHECK(cfp_test::allocations_in([&] {
            (void)fundamental_ransac(PointPairs{scene.prev, scene.cur, weights}, {}, other, mask);
          }) == 0);
  }
}

TEST_CASE("Labelled real pairs: the labelled inliers fit F", "[robust]") {
  CFP_REQUIRE_DATA(folder, "two_view");
  FundamentalRansacWorkspace workspace;
  for (const char* name : {"johnssonb", "unihouse", "physics"}) {
    const Labelled pairs = read_labelled(folder / (std::string(name) + "_pts.txt"));
    REQUIRE(pairs.prev.size() > 100);
    FundamentalRansacOptions options;
    options.threshold_px = 2;
    std::vector<char> mask(pairs.prev.size());
    const auto result = fundamental_ransac(PointPairs{pairs.prev, pairs.cur}, options, workspace, mask);
    INFO(name << ": " << to_string(result.status) << ", " << result.inliers << " inliers, " << result.iterations
              << " iterations");
    REQUIRE(result.found());
    double labelled = 0, found = 0;
    for (std::size_t i = 0; i < mask.size(); ++i)
      labelled += pairs.label[i], found += pairs.label[i] != 0 && mask[i] != 0 ? 1 : 0;
    CHECK(found > 0.85 * labelled);
  }
}

TEST_CASE("A slow camera before a far wall has an F where its noise allows, and a rotation is never one", "[robust]") {
  // A video's parallax over a far wall is often below threshold_px; the choice must rest on the noise, not on the
  // threshold.
  FundamentalRansacWorkspace workspace;
  constexpr int scenes = 60;
  for (const double noise_px : {0.02, 0.1, 0.3, 0.5}) {
    for (const double translation_m : {0.0, 0.03, 0.1}) {
      INFO("noise " << noise_px << " px, translation " << translation_m << " m");
      int found = 0, rotations = 0;
      for (std::uint64_t seed = 1; seed <= scenes; ++seed) {
        cfp_test::DynamicSceneOptions options;
        options.people = 0;
        options.pixel_noise_px = noise_px;
        options.translation_m = translation_m;
        const auto scene = cfp_test::make_dynamic_scene<double>(options, seed);
        const auto result = fundamental_ransac(PointPairs{scene.previous_keypoints, scene.keypoints}, scene.camera,
                                               FundamentalRansacOptions{}, workspace);
        found += result.found() ? 1 : 0;
        rotations += result.status == RansacStatus::pure_rotation ? 1 : 0;
      }
      if (translation_m == 0) CHECK(rotations >= scenes - 1);
      if (translation_m == 0) CHECK(found == 0);
      if (translation_m == 0.1) CHECK(found >= (noise_px > 0.4 ? scenes - 3 : scenes));
      if (translation_m == 0.03 && noise_px <= 0.1) CHECK(found == scenes);
    }
  }
}

TEST_CASE("A walker with more pairs than the room is no parallax", "[robust]") {
  // Nine in ten of the room's pairs are mismatches, so that the walker's are the larger plane before a turning camera.
  FundamentalRansacWorkspace workspace;
  cfp::Random random(48, "walker and mismatches");
  int found = 0;
  for (int trial = 0; trial < 30; ++trial) {
    auto scene = make_two_view_scene<double>(random, without_parallax(300, 0.9, 0, 0.035));
    put_walker(90, 1, {5, 3}, random, scene);
    const auto result = fundamental_ransac(PointPairs{scene.prev, scene.cur}, FundamentalRansacOptions{}, workspace);
    found += result.found() ? 1 : 0;
  }
  CHECK(found <= 5);
}

namespace {

/// Of 60 scenes of 300 exact pairs, 60 of them on a walker: those that have an F, and those whose F he bends.
struct Bent {
  int found = 0, bent = 0;
};

Bent bent_by_walker(double outlier_share, double translation_m, cfp::Random random) {
  FundamentalRansacWorkspace workspace;
  Bent counts;
  for (int trial = 0; trial < 60; ++trial) {
    TwoViewOptions options = noisy(300, outlier_share);
    options.noise_px = 0, options.translation_m = translation_m;
    auto scene = make_two_view_scene<double>(random, options);
    put_walker(60, 2, {4, 4}, random, scene);
    const auto result = fundamental_ransac(PointPairs{scene.prev, scene.cur}, FundamentalRansacOptions{}, workspace);
    if (!result.found()) continue;
    ++counts.found;
    counts.bent += cfp_test::median_sampson_of_truth<double>(scene, result.F) > 0.05 ? 1 : 0;
  }
  return counts;
}

}  // namespace

TEST_CASE("Pairs of a walker and mismatches within the threshold do not bend an F that others fit exactly",
          "[robust]") {
  // Two in three obey F. With a truncated square of 1 px for the score 16 of the 60 were a compromise with the others,
  // with the compromise's own noise to choose by 8.
  CHECK(bent_by_walker(0.2, 0.02, cfp::Random(52, "walker and room")).bent <= 6);
}

TEST_CASE("Beside a walker and two fifths of mismatches an F that others fit exactly is found", "[robust]") {
  // 8 of the 60 were an F between both motions: no sample of its inliers left the walker out, or he was taken for
  // noise.
  const Bent counts = bent_by_walker(0.4, 0.3, cfp::Random(53, "walker and mismatches"));
  CHECK(counts.found >= 57);
  CHECK(counts.bent <= 2);
}

TEST_CASE("Two walls seen along them have their F in a wide image and in a high one", "[robust]") {
  // The window of what is broad once took a whole wall of the wide one, and that of a person all of the high one.
  FundamentalRansacWorkspace workspace;
  cfp::Random random(63, "corridor");
  const cfp::PinholeCamera<double> camera{718, 718, 620, 620};
  for (const bool wide : {true, false}) {
    int found = 0;
    for (int trial = 0; trial < 20; ++trial) {
      const cfp::SE3<double> T_cur_prev{cfp::so3_exp<double>(0.005 * cfp_test::random_direction(random)), {0, 0, -1}};
      std::vector<std::array<double, 2>> previous, current;
      while (previous.size() < 300) {
        const double along = random.uniform(0, 1240), across = random.uniform(430, 810);
        cfp::Vector3<double> ray;
        cfp::Vector2<double> now(0, 0),
            before = wide ? cfp::Vector2<double>(along, across) : cfp::Vector2<double>(across, along);
        REQUIRE(camera.unproject(before, ray));
        const double depth_m = std::min(8 / std::abs(wide ? ray.x() : ray.y()), 80.0);
        if (!camera.project(T_cur_prev * cfp::Vector3<double>(depth_m * ray), now)) continue;
        previous.push_back({before.x() + 0.2 * random.normal(), before.y() + 0.2 * random.normal()});
        current.push_back({now.x() + 0.2 * random.normal(), now.y() + 0.2 * random.normal()});
      }
      found += fundamental_ransac(PointPairs{previous, current}, FundamentalRansacOptions{}, workspace).found();
    }
    CAPTURE(wide);
    CHECK(found >= 19);
  }
}

TEST_CASE("A person who moves before a camera at rest or turning gives no F", "[robust]") {
  FundamentalRansacWorkspace workspace;
  cfp::Random random(47, "walker");
  int found = 0, named = 0, all = 0;
  for (const double noise_px : {0.0, 0.1, 0.5}) {
    for (const double rotation_rad : {0.0, 0.035}) {
      for (const double share : {0.1, 0.2, 0.3}) {
        for (int trial = 0; trial < 5; ++trial) {
          auto scene = make_two_view_scene<double>(random, without_parallax(300, 0, noise_px, rotation_rad));
          const double left = random.uniform(0, 500);
          std::size_t walkers = 0;
          for (std::size_t i = 0; i < 300; ++i) {
            if (scene.prev[i][0] < left || scene.prev[i][0] > left + 130 || static_cast<double>(walkers) >= share * 300)
              continue;
            ++walkers;
            scene.cur[i][0] += 5, scene.cur[i][1] += 3;
          }
          const auto result = fundamental_ransac(PointPairs{scene.prev, scene.cur}, scene.camera,
                                                 FundamentalRansacOptions{}, workspace);
          ++all;
          found += result.found() ? 1 : 0;
          const RansacStatus right = rotation_rad > 0 ? RansacStatus::pure_rotation : RansacStatus::no_motion;
          named += result.status == right ? 1 : 0;
        }
      }
    }
  }
  CHECK(found <= 1);
  CHECK(named >= all - 5);
}

TEST_CASE("Two people who walk past each other before a camera at rest or turning give no F", "[robust]") {
  // Both move along the lines of one F, on either side of what rests: without that there were 33 of 60 and more.
  FundamentalRansacWorkspace workspace;
  cfp::Random random(60, "crossing");
  int found = 0;
  for (const double noise_px : {0.1, 0.5}) {
    for (const double rotation_rad : {0.0, 0.035}) {
      for (int trial = 0; trial < 20; ++trial) {
        auto scene = make_two_view_scene<double>(random, without_parallax(300, 0, noise_px, rotation_rad));
        const cfp::Vector2<double> step =
            random.uniform(4, 10) * cfp::Vector2<double>(random.normal(), 0.3 * random.normal()).normalized();
        put_walker(30, 2, -step, random, scene);
        put_walker(15, 2, step, random, scene);  // in the place of half of them
        found +=
            fundamental_ransac(PointPairs{scene.prev, scene.cur}, scene.camera, FundamentalRansacOptions{}, workspace)
                .found();
      }
    }
  }
  CHECK(found <= 4);
}

TEST_CASE("A rotation seen in whole pixels gives no F", "[robust]") {
  // Neighbours are rounded alike, which was taken for parallax in 43 of 100 at a tenth of a degree.
  FundamentalRansacWorkspace workspace;
  cfp::Random random(61, "whole pixels");
  for (const double rotation_rad : {0.0017, 0.005, 0.02}) {
    int found = 0;
    for (int trial = 0; trial < 30; ++trial) {
      auto scene = make_two_view_scene<double>(random, without_parallax(300, 0, 0, rotation_rad));
      for (auto* const points : {&scene.prev, &scene.cur}) {
        for (auto& x : *points) x = {std::round(x[0]), std::round(x[1])};
      }
      found +=
          fundamental_ransac(PointPairs{scene.prev, scene.cur}, scene.camera, FundamentalRansacOptions{}, workspace)
              .found();
    }
    CAPTURE(rotation_rad);
    CHECK(found == 0);
  }
}

TEST_CASE("Pairs in a part of the image beside mismatches that end anywhere have their F", "[robust]") {
  // The mismatches stretch the scale of both images: the window of a person must not grow with it.
  FundamentalRansacWorkspace workspace;
  cfp::Random random(62, "corner");
  TwoViewOptions options = noisy(4000, 0);
  options.translation_m = 0.3;
  int found = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const auto all = make_two_view_scene<double>(random, options);
    cfp_test::TwoViewScene<double> scene;
    const double left = random.uniform(100, 450), top = random.uniform(100, 300);
    for (std::size_t i = 0; i < all.prev.size() && scene.prev.size() < 200; ++i) {
      const double u = all.prev[i][0] - left, v = all.prev[i][1] - top;
      if (u < 0 || u > 128 || v < 0 || v > 128) continue;
      scene.prev.push_back(all.prev[i]), scene.cur.push_back(all.cur[i]);
    }
    for (std::size_t i = 0; i < scene.cur.size(); i += 3) {
      const double u = random.uniform(0, 640), v = random.uniform(0, 480);
      scene.cur[i] = {u, v};
    }
    found += fundamental_ransac(PointPairs{scene.prev, scene.cur}, FundamentalRansacOptions{}, workspace).found();
  }
  CHECK(found >= 18);
}

TEST_CASE("What is broad and moves before a camera at rest or turning gives no F", "[robust]") {
  // 400 x 240 px with another motion each, a depth of its own that makes the flow differ by a seventh, mismatches
  // elsewhere. A window as wide as one person holds half of it: all 160 were called an F.
  FundamentalRansacWorkspace workspace;
  cfp::Random random(53, "broad mover");
  int found = 0;
  for (const double noise_px : {0.1, 0.5}) {
    for (const double rotation_rad : {0.0, 0.035}) {
      for (int trial = 0; trial < 40; ++trial) {
        auto scene = make_two_view_scene<double>(random, without_parallax(300, 0.1, noise_px, rotation_rad));
        const double left = random.uniform(0, 240), top = random.uniform(0, 240);
        const cfp::Vector2<double> flow =
            random.uniform(6, 20) * cfp::Vector2<double>(random.normal(), random.normal()).normalized();
        for (std::size_t i = 0; i < 300; ++i) {
          const double nearer = random.uniform(0.86, 1.14), u = scene.prev[i][0] - left, v = scene.prev[i][1] - top;
          if (u < 0 || u > 400 || v < 0 || v > 240) continue;
          scene.cur[i][0] += nearer * flow.x(), scene.cur[i][1] += nearer * flow.y();
        }
        found += fundamental_ransac(PointPairs{scene.prev, scene.cur}, FundamentalRansacOptions{}, workspace).found();
      }
    }
  }
  CHECK(found <= 8);
}

TEST_CASE("Where nine in ten pairs are mismatches no F of chance is called one", "[robust]") {
  FundamentalRansacWorkspace workspace;
  cfp::Random random(52, "mismatches");
  int wrong = 0;
  for (const SceneShape shape : {SceneShape::volume, SceneShape::plane}) {
    for (const double noise_px : {0.0, 0.5}) {
      for (int trial = 0; trial < 50; ++trial) {
        TwoViewOptions options = noisy(300, 0.9);
        options.noise_px = noise_px;
        options.translation_m = 0.3;
        options.shape = shape;
        const auto scene = make_two_view_scene<double>(random, options);
        const auto result =
            fundamental_ransac(PointPairs{scene.prev, scene.cur}, FundamentalRansacOptions{}, workspace);
        wrong += result.found() && (shape == SceneShape::plane ||
                                    cfp_test::median_sampson_of_truth<double>(scene, result.F) > 0.05 + noise_px)
                     ? 1
                     : 0;
      }
    }
  }
  CHECK(wrong <= 4);
}

TEST_CASE("A few mismatches beside a plane or a turn are no parallax", "[robust]") {
  cfp::Random random(41, "few mismatches");
  cfp::FundamentalRansacWorkspace workspace;
  for (const bool turns : {false, true}) {
    for (const std::size_t n : {std::size_t(40), std::size_t(300)}) {
      int found = 0;
      for (int run = 0; run < 200; ++run) {
        const double noise = 0.1 * (run % 4);
        const std::size_t mismatches = std::size_t(1 + run % 5);
        std::vector<std::array<double, 2>> previous, current;
        for (std::size_t i = 0; i < n; ++i) {
          const double u = random.uniform(0, 640), v = random.uniform(0, 480);
          double x = turns ? u + 12 : u + 5 + 0.01 * (v - 240), y = turns ? v : v + 0.003 * (u - 320);
          if (i < mismatches) {
            x = random.uniform(0, 640);
            y = random.uniform(0, 480);
          }
          previous.push_back({u, v});
          x += noise * random.normal();
          y += noise * random.normal();
          current.push_back({x, y});
        }
        found += cfp::fundamental_ransac(cfp::PointPairs{previous, current}, {}, workspace).found() ? 1 : 0;
      }
      INFO((turns ? "a turn, " : "a plane, ") << n << " pairs: F in " << found << " of 200");
      CHECK(found <= 2);
    }
  }
}

TEST_CASE("A person at the edge of the image, away from all other pairs, gives no F", "[robust]") {
  FundamentalRansacWorkspace workspace;
  cfp::Random random(49, "edge");
  int found = 0, all = 0;
  for (const double mirrored : {0.0, 640.0}) {
    for (const double rotation_rad : {0.0, 0.035}) {
      for (int trial = 0; trial < 15; ++trial) {
        auto scene = make_two_view_scene<double>(random, without_parallax(300, 0, 0.1, rotation_rad));
        std::vector<std::array<double, 2>> prev, cur;
        for (std::size_t i = 0; i < 300; ++i) {
          const double x = std::abs(scene.prev[i][0] - mirrored);
          if (x > 300 && x < 560) continue;
          prev.push_back(scene.prev[i]), cur.push_back(scene.cur[i]);
          if (x >= 560) cur.back()[0] += 20, cur.back()[1] += 8;
        }
        const auto result =
            fundamental_ransac(PointPairs{prev, cur}, scene.camera, FundamentalRansacOptions{}, workspace);
        ++all;
        found += result.found() ? 1 : 0;
      }
    }
  }
  CAPTURE(all);
  CHECK(found == 0);
}

TEST_CASE("Pairs that tell no F give none", "[robust]") {
  FundamentalRansacWorkspace workspace;
  cfp::Random random(48, "undetermined");
  using Points = std::vector<std::array<double, 2>>;
  const auto status = [&](const Points& prev, const Points& cur) {
    return fundamental_ransac(PointPairs{prev, cur}, FundamentalRansacOptions{}, workspace).status;
  };
  const auto refuses = [&](const Points& prev, const Points& cur) {
    const RansacStatus s = status(prev, cur);
    return s != RansacStatus::ok && s != RansacStatus::iteration_limit;
  };
  int chance = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const auto scene = make_two_view_scene<double>(random, noisy(300, 0));
    Points shifted, copied_prev, copied_cur, anywhere, line_prev, line_cur;
    const cfp::Vector3<double> at[2] = {{-0.3, 0.2, 2.5}, {0.4, -0.3, 3}},
                               along[2] = {{0.9, 0.3, 0.4}, {-0.4, 0.7, -0.5}};
    for (std::size_t i = 0; i < 300; ++i) {
      shifted.push_back({scene.prev[i][0] + 5, scene.prev[i][1] - 3});
      copied_prev.push_back(scene.prev[i % 10]), copied_cur.push_back({random.uniform(0, 640), random.uniform(0, 480)});
      if (i >= 10) copied_cur[i] = copied_cur[i % 10];
      anywhere.push_back({random.uniform(0, 640), random.uniform(0, 480)});
      cfp::Vector2<double> u(0, 0), v(0, 0);
      const cfp::Vector3<double> point = at[i % 2] + random.uniform(-0.8, 0.8) * along[i % 2];
      REQUIRE((scene.camera.project(point, u) && scene.camera.project(scene.T_cur_prev * point, v)));
      line_prev.push_back({u.x() + 0.3 * random.normal(), u.y() + 0.3 * random.normal()});
      line_cur.push_back({v.x() + 0.3 * random.normal(), v.y() + 0.3 * random.normal()});
    }
    CHECK(status(scene.prev, scene.prev) == RansacStatus::no_motion);
    CHECK(status(scene.prev, shifted) == RansacStatus::homography);
    CHECK(refuses(copied_prev, copied_cur));
    CHECK(refuses(line_prev, line_cur));
    chance += refuses(scene.prev, anywhere) ? 0 : 1;
  }
  CHECK(chance <= 1);
}

TEST_CASE("Two long lines of points give no F, however far the camera has moved", "[robust]") {
  FundamentalRansacWorkspace workspace;
  cfp::Random random(50, "lines");
  const cfp::Vector3<double> at[2] = {{-0.3, 0.2, 2.5}, {0.4, -0.3, 3}},
                             along[2] = {{0.9, 0.3, 0.4}, {-0.4, 0.7, -0.5}};
  int found = 0;
  for (const std::size_t n : {60U, 300U}) {
    for (int trial = 0; trial < 20; ++trial) {
      TwoViewOptions options = noisy(8, 0);
      options.translation_m = 0.3;
      const auto scene = make_two_view_scene<double>(random, options);
      std::vector<std::array<double, 2>> prev, cur;
      while (prev.size() < n) {
        const std::size_t line = prev.size() % 2;
        const cfp::Vector3<double> point = at[line] + random.uniform(-2, 2) * along[line];
        cfp::Vector2<double> u(0, 0), v(0, 0);
        REQUIRE((scene.camera.project(point, u) && scene.camera.project(scene.T_cur_prev * point, v)));
        const auto measured = [&](const cfp::Vector2<double>& pixel) {
          return std::array<double, 2>{pixel.x() + 0.1 * random.normal(), pixel.y() + 0.1 * random.normal()};
        };
        prev.push_back(measured(u)), cur.push_back(measured(v));
      }
      const auto result =
          fundamental_ransac(PointPairs{prev, cur}, scene.camera, FundamentalRansacOptions{}, workspace);
      found += result.found() ? 1 : 0;
    }
  }
  CHECK(found == 0);
}

TEST_CASE("Points on one line are named degenerate, mismatches beside them or not", "[robust]") {
  FundamentalRansacWorkspace workspace;
  cfp::Random random(53, "line");
  int named = 0;
  for (const double noise_px : {0.0, 1e-6, 0.1}) {
    for (const double outliers : {0.0, 0.3}) {
      for (int trial = 0; trial < 10; ++trial) {
        const auto scene = make_two_view_scene<double>(random, noisy(8, 0));
        std::vector<std::array<double, 2>> prev, cur;
        while (prev.size() < 200) {
          const double x = random.uniform(-0.9, 0.9);
          const cfp::Vector3<double> point(x, 0.2 + 0.3 * x, 2.5 + 0.4 * x);
          cfp::Vector2<double> u(0, 0), v(0, 0);
          REQUIRE((scene.camera.project(point, u) && scene.camera.project(scene.T_cur_prev * point, v)));
          if (random.uniform() < outliers) v += cfp::Vector2<double>(random.uniform(-40, 40), random.uniform(-40, 40));
          prev.push_back({u.x() + noise_px * random.normal(), u.y() + noise_px * random.normal()});
          cur.push_back({v.x() + noise_px * random.normal(), v.y() + noise_px * random.normal()});
        }
        const auto result = fundamental_ransac(PointPairs{prev, cur}, FundamentalRansacOptions{}, workspace);
        CHECK_FALSE(result.found());
        named += result.status == RansacStatus::degenerate ? 1 : 0;
      }
    }
  }
  CHECK(named >= 57);
}

TEST_CASE("Mismatches that all end in one place are no support", "[robust]") {
  FundamentalRansacWorkspace workspace;
  cfp::Random random(49, "one place");
  for (int trial = 0; trial < 20; ++trial) {
    auto scene = make_two_view_scene<double>(random, noisy(300, 0));
    for (std::size_t i = 0; i < 300; i += 2) scene.cur[i] = {300 + random.uniform(0, 1), 200 + random.uniform(0, 1)};
    const auto result = fundamental_ransac(PointPairs{scene.prev, scene.cur}, FundamentalRansacOptions{}, workspace);
    REQUIRE(result.found());
    CHECK(cfp_test::median_sampson_of_truth<double>(scene, result.F) < 0.35);
  }
}

TEST_CASE("Mismatches that all end in one place, or nearly, make no F where nothing has parallax", "[robust]") {
  FundamentalRansacWorkspace workspace;
  for (const double noise_px : {0.0, 0.5}) {
    for (const double jitter_px : {0.0, 1.0, 2.0}) {
      for (const std::size_t hub : {6U, 12U, 40U}) {
        cfp::Random random(50, "hub");
        int found = 0;
        for (int trial = 0; trial < 60; ++trial) {
          TwoViewOptions options = without_parallax(200, 0, noise_px, trial % 3 == 0 ? 0 : 0.035);
          if (trial % 3 == 2) options.shape = cfp_test::SceneShape::plane, options.translation_m = 0.1;
          auto scene = make_two_view_scene<double>(random, options);
          const double x = random.uniform(100, 540), y = random.uniform(80, 400);
          for (std::size_t i = 0; i < hub; ++i) {
            const double dx = random.uniform(-jitter_px, jitter_px), dy = random.uniform(-jitter_px, jitter_px);
            scene.cur[i] = {x + dx, y + dy};
          }
          const auto result =
              fundamental_ransac(PointPairs{scene.prev, scene.cur}, FundamentalRansacOptions{}, workspace);
          found += result.found() ? 1 : 0;
        }
        CAPTURE(noise_px, jitter_px, hub);
        CHECK(found <= 1);
      }
    }
  }
}

TEST_CASE("Points on one line leave a plane open, among mismatches, too", "[robust]") {
  FundamentalRansacWorkspace workspace;
  cfp::Random random(51, "line");
  for (const double outlier_share : {0.0, 0.1, 0.3}) {
    int degenerate = 0;
    for (int trial = 0; trial < 40; ++trial) {
      auto scene = make_two_view_scene<double>(random, noisy(200, outlier_share));
      const double x = random.uniform(-0.5, 0.5), y = random.uniform(-0.5, 0.5), slope = random.uniform(-1, 1);
      for (std::size_t i = 0; i < 200; ++i) {
        if (scene.is_inlier[i] == 0) continue;
        const double at = random.uniform(-0.6, 0.6);
        const cfp::Vector3<double> point(x + at, y + slope * at, 3 + 0.3 * at);
        for (const bool current : {false, true}) {
          cfp::Vector2<double> pixel(0, 0);
          REQUIRE(scene.camera.project(current ? scene.T_cur_prev * point : point, pixel));
          for (double& coordinate : pixel) coordinate += 0.3 * random.normal();
          (current ? scene.cur : scene.prev)[i] = {pixel.x(), pixel.y()};
        }
      }
      const auto result = fundamental_ransac(PointPairs{scene.prev, scene.cur}, FundamentalRansacOptions{}, workspace);
      CHECK(result.status != cfp::RansacStatus::homography);
      CHECK(result.homography.isZero(0));
      degenerate += result.status == cfp::RansacStatus::degenerate ? 1 : 0;
    }
    CAPTURE(outlier_share);
    CHECK(degenerate >= (outlier_share < 0.2 ? 38 : 25));  // among many mismatches F is sometimes found
  }
}

TEST_CASE("Few pairs of a camera at rest or turning are seldom taken for a plane", "[robust]") {
  FundamentalRansacWorkspace workspace;
  cfp::Random random(52, "few pairs");
  const auto named = [&](std::size_t pairs, double noise_px, double rotation_rad) {
    FundamentalRansacOptions options;
    options.min_inliers = 8;
    int right = 0;
    for (int trial = 0; trial < 200; ++trial) {
      const auto scene = make_two_view_scene<double>(random, without_parallax(pairs, 0, noise_px, rotation_rad));
      const auto result = fundamental_ransac(PointPairs{scene.prev, scene.cur}, scene.camera, options, workspace);
      right += result.status == (rotation_rad > 0 ? cfp::RansacStatus::pure_rotation : cfp::RansacStatus::no_motion);
    }
    return right;
  };
  // Of 2,000 frames 82, 94 and 83 % are; where a homography that follows the noise counts, 49, 81 and 66 %. The bounds
  // are four standard deviations below.
  CHECK(named(12, 0.1, 0) >= 142);
  CHECK(named(20, 0.5, 0) >= 175);
  CHECK(named(12, 0.1, 0.035) >= 145);
}
