#include "cfp/robust/fundamental_degeneracy_impl.hpp"

#include <algorithm>
#include <vector>

#include <Eigen/LU>

#include "support/catch.hpp"
#include "support/two_view_scene.hpp"

using cfp::Matrix3;

namespace {

/// The check of a search at a threshold of 1 px whose F has all pairs for inliers.
struct Checked {
  cfp_test::TwoViewScene<double> scene;
  cfp::detail::PairArrays pairs;
  std::vector<std::uint32_t> list;
  std::vector<double> distances_sq, scratch;
  cfp::detail::FundamentalSearch<double> search;
  cfp::detail::DegeneracyCheck<double> check;

  Checked(cfp::Random& random, const cfp_test::TwoViewOptions& options)
      : scene(cfp_test::make_two_view_scene<double>(random, options)),
        search{loaded(), pairs.factor * pairs.factor, list, distances_sq, cfp::Random(1)},
        check{search, scratch} {
    distances_sq.assign(pairs.capacity, 0.0);
    scratch.assign(4 * pairs.capacity, 0.0);
    search.collect_inliers();
  }
  Checked(const Checked&) = delete;
  Checked& operator=(const Checked&) = delete;

  [[nodiscard]] const cfp::detail::PairArrays& loaded() {
    cfp::detail::load_pairs(cfp::PointPairs{scene.prev, scene.cur}, 1e-6, pairs);
    return pairs;
  }
  /// How far it is, px, that the homography puts the pairs that are no mismatches from where they are.
  [[nodiscard]] double farthest(const Matrix3<double>& H) const {
    double largest = 0;
    for (std::size_t i = 0; i < pairs.size; ++i) {
      if (scene.is_inlier[i] == 0) continue;
      const cfp::Vector3<double> p = H * cfp::detail::previous_point<double>(pairs, i);
      const cfp::Vector3<double> q = cfp::detail::current_point<double>(pairs, i);
      largest = (std::max)(largest, (p / p.z() - q).norm() / pairs.factor);
    }
    return largest;
  }
};

cfp_test::TwoViewOptions options_of(cfp_test::SceneShape shape, double translation_m, double outlier_share = 0) {
  cfp_test::TwoViewOptions options;
  options.shape = shape, options.translation_m = translation_m, options.outlier_share = outlier_share;
  return options;
}

}  // namespace

TEST_CASE("The homography of a plane is found, and holds most pairs; a room has none that does", "[robust]") {
  cfp::Random random(81, "degeneracy");
  for (int trial = 0; trial < 10; ++trial) {
    Checked plane(random, options_of(cfp_test::SceneShape::plane, 0.2, 0.2));
    plane.check.find_homography(200);
    CHECK(plane.check.dominant);
    CHECK(plane.farthest(plane.check.H) < 0.1);
    Checked room(random, options_of(cfp_test::SceneShape::volume, 0.5));
    room.check.find_homography(200);
    CHECK_FALSE(room.check.dominant);
  }
}

TEST_CASE("An F that fits a plane alone becomes the one of the points off it", "[robust]") {
  cfp::Random random(86, "degeneracy");
  cfp_test::TwoViewOptions options = options_of(cfp_test::SceneShape::volume_and_plane, 0.2, 0.1);
  options.plane_share = 0.85, options.noise_px = 0.1;
  for (int trial = 0; trial < 10; ++trial) {
    Checked checked(random, options);
    checked.check.find_homography(200);
    REQUIRE(checked.check.dominant);
    // hat(e) H is an F of every pair on the plane, whatever the epipole e.
    const cfp::Vector3<double> wrong_epipole = cfp_test::random_direction(random);
    cfp::RansacCandidate<Matrix3<double>> candidate;
    candidate.model = (cfp::hat(wrong_epipole) * checked.check.H).normalized();
    const Matrix3<double> truth = cfp_test::scaled_fundamental(checked.scene.F, checked.pairs.scaling);
    const auto off = [&](const Matrix3<double>& F) { return 1 - std::abs(F.cwiseProduct(truth).sum()); };
    REQUIRE(off(candidate.model) > 1e-2);
    checked.search.measure_noise(candidate.model);
    checked.check.complete_from_plane(candidate);
    CHECK(off(candidate.model) < 1e-3);
  }
}

TEST_CASE("Fewer than four pairs have no homography", "[robust]") {
  cfp::Random random(82, "degeneracy");
  for (const std::size_t few : {0U, 1U, 2U, 3U}) {
    Checked turned(random, options_of(cfp_test::SceneShape::volume, 0));
    turned.list.resize(few);
    const Matrix3<double> before = turned.check.H;
    turned.check.find_homography(200);
    CHECK(turned.check.H == before);
    CHECK_FALSE(turned.check.dominant);
    CHECK(turned.check.find_homography_beside({0, 0, 0, 5, 16}));
    CHECK(turned.check.H == before);
  }
}

TEST_CASE("A rotation is found from its homography, and each motion has its name", "[robust]") {
  cfp::Random random(83, "degeneracy");
  const auto named = [&](const cfp_test::TwoViewOptions& options, bool with_camera) {
    Checked checked(random, options);
    checked.check.find_homography(200);
    const Matrix3<double> K = checked.scene.camera.matrix();
    const cfp::RansacStatus status = checked.check.classify(with_camera ? &K : nullptr);
    CHECK(checked.farthest(checked.check.H) < 0.1);
    CHECK(checked.check.explained_by(checked.check.H) == 1);
    if (options.translation_m == 0) {
      const auto all = [](std::size_t) { return true; };
      const Matrix3<double> turn = cfp::detail::fitted_rotation(checked.pairs, K, all);
      CHECK(checked.farthest(checked.check.scaled_homography(turn)) < 1e-6);
      const Matrix3<double> truth = K * checked.scene.T_cur_prev.rotation * K.inverse();
      CHECK(checked.farthest(checked.check.scaled_homography(truth)) < 1e-6);
    }
    return status;
  };
  for (int trial = 0; trial < 10; ++trial) {
    cfp_test::TwoViewOptions options = options_of(cfp_test::SceneShape::plane, 0.2);
    CHECK(named(options, true) == cfp::RansacStatus::planar);
    CHECK(named(options, false) == cfp::RansacStatus::homography);
    options = options_of(cfp_test::SceneShape::volume, 0);
    CHECK(named(options, true) == cfp::RansacStatus::pure_rotation);
    CHECK(named(options, false) == cfp::RansacStatus::homography);
    options.rotation_rad = 0;
    CHECK(named(options, true) == cfp::RansacStatus::no_motion);
    CHECK(named(options, false) == cfp::RansacStatus::no_motion);
  }
}

TEST_CASE("A homography explains the share of another's pairs, by their weights", "[robust]") {
  cfp::Random random(84, "degeneracy");
  cfp_test::TwoViewOptions options = options_of(cfp_test::SceneShape::volume, 0, 0.3);
  int partly = 0;
  for (int trial = 0; trial < 20; ++trial) {
    options.rotation_rad = 0.0005 * trial;  // by up to 5 px: rest explains the pairs near the axis
    Checked checked(random, options);
    checked.check.find_homography(200);
    const Matrix3<double> at_rest = checked.check.scaled_homography(Matrix3<double>::Identity());
    const double limit = checked.check.transfer_noise_limit();
    double both = 0, all = 0;
    for (std::size_t i = 0; i < checked.pairs.size; ++i) {
      const double w = checked.pairs.row(4)[i] = random.uniform(0.1, 1);
      if (cfp::detail::transfer_sq(checked.pairs, checked.check.H, i) > limit) continue;
      all += w;
      both += cfp::detail::transfer_sq(checked.pairs, at_rest, i) <= 1.5 * limit ? w : 0;
    }
    CHECK(checked.check.explained_by(at_rest) == Approx(both / all));
    partly += both > 0 && both < all ? 1 : 0;
    checked.check.H(0, 2) += 1e3;  // holds no pair
    CHECK(checked.check.explained_by(at_rest) == 0);
  }
  CHECK(partly > 5);
}
