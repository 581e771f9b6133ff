#include "cfp/frame/flow_model.hpp"

#include <array>
#include <cmath>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"
#include "support/engines.hpp"
#include "support/moving_flow.hpp"

namespace {

/// Pairs without depth of a static room, all outside boxes, with noise in the current image alone.
struct Room {
  cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};
  std::vector<std::array<double, 2>> previous, current;
  std::vector<char> outside;

  Room(const cfp::SE3<double>& T, double noise_px, std::uint64_t seed, double near_m = 1, double far_m = 5) {
    cfp::Random random(seed, "flow model");
    while (previous.size() < 400) {
      const cfp::Vector2<double> p(random.uniform(20, 620), random.uniform(20, 460));
      cfp::Vector3<double> ray;
      cfp::Vector2<double> q;
      REQUIRE(camera.unproject(p, ray));
      if (!camera.project(T * cfp::Vector3<double>(random.uniform(near_m, far_m) * ray), q)) continue;
      previous.push_back({p.x(), p.y()});
      current.push_back({q.x() + noise_px * random.normal(), q.y() + noise_px * random.normal()});
    }
    outside.assign(previous.size(), 1);
  }
  /// Moves the current pixels to where points at other depths, which it returns, are seen; those in one of so many
  /// columns and rows of the image err by `shared` together, beside the noise.
  std::vector<double> err_by_parts(const cfp::SE3<double>& T, std::array<int, 2> columns_and_rows, double shared,
                                   double noise_px, cfp::Random& random) {
    const auto [columns, rows] = columns_and_rows;
    std::vector<cfp::Vector2<double>> of_part(static_cast<std::size_t>(columns * rows));
    for (cfp::Vector2<double>& error : of_part) {
      error.x() = shared * random.normal();
      error.y() = shared * random.normal();
    }
    std::vector<double> depths;
    for (std::size_t i = 0; i < previous.size(); ++i) {
      cfp::Vector3<double> ray;
      cfp::Vector2<double> q;
      REQUIRE(camera.unproject({previous[i][0], previous[i][1]}, ray));
      depths.push_back(random.uniform(1.5, 4));
      REQUIRE(camera.project(T * cfp::Vector3<double>(depths[i] * ray), q));
      const double part =
          std::floor(previous[i][0] / 640 * columns) + columns * std::floor(previous[i][1] / 480 * rows);
      q += of_part[static_cast<std::size_t>(part)];
      current[i] = {q.x() + noise_px * random.normal(), q.y() + noise_px * random.normal()};
    }
    return depths;
  }
  [[nodiscard]] cfp::FlowModel<double> model(const cfp::FlowModelOptions& options = {}) const {
    cfp::FlowModelWorkspace<double> workspace;
    return cfp::estimate_flow_model<double>({previous, current, {}}, outside, camera, options, workspace);
  }
};

cfp::SE3<double> motion(double translation_m, double rotation_rad) {
  cfp::SE3<double> T;
  T.translation = cfp::Vector3<double>(0.8, -0.2, 0.5).normalized() * translation_m;
  T.rotation = cfp::so3_exp<double>(rotation_rad * cfp::Vector3<double>(0.3, 0.9, -0.2).normalized());
  return T;
}

}  // namespace

TEST_CASE("The noise of one coordinate is measured, across lines and around predicted points", "[frame]") {
  for (const double noise : {0.1, 0.2, 0.4}) {
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      const cfp::FlowModel<double> moving = Room(motion(0.1, 0.02), noise, seed).model();
      REQUIRE(moving.kind == cfp::FlowModelKind::fundamental);
      CHECK_THAT(moving.sigma_px, WithinAbs(noise, 0.2 * noise));
      const cfp::FlowModel<double> turning = Room(motion(0, 0.02), noise, seed).model();
      REQUIRE(turning.kind == cfp::FlowModelKind::motion_up_to_scale);
      CHECK_THAT(turning.sigma_px, WithinAbs(noise, 0.2 * noise));
    }
  }
}

TEST_CASE("The measured noise is kept within its bounds", "[frame]") {
  const Room room(motion(0.1, 0.02), 0.4, 5);
  cfp::FlowModelOptions options;
  options.motion.max_sigma_px = 0.2;
  CHECK(room.model(options).sigma_px == 0.2);
  options.motion.min_sigma_px = options.motion.max_sigma_px = 0.6;
  CHECK(room.model(options).sigma_px == 0.6);
}

TEST_CASE("Without a model no noise is measured", "[frame]") {
  cfp::FlowModelOptions options;
  options.use_motion_up_to_scale = false;
  const cfp::FlowModel<double> turning = Room(motion(0, 0.02), 0.2, 1).model(options);
  CHECK(turning.kind == cfp::FlowModelKind::none);
  CHECK(turning.sigma_px == 0);
}

TEST_CASE("Before a wall the motion is known up to scale, and how well", "[frame]") {
  double nees = 0;
  constexpr int seeds = 50;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    CAPTURE(seed);
    const cfp::SE3<double> T = motion(0.02, 0.02);
    const cfp::FlowModel<double> model = Room(T, 0.2, seed, 4, 4).model();
    REQUIRE(model.kind == cfp::FlowModelKind::motion_up_to_scale);
    CHECK(model.support == cfp::FlowSupport::outside_pairs);
    CHECK(model.status != cfp::RansacStatus::ok);
    const cfp::SE3<double> in_walls{T.rotation, T.translation / 4};
    nees += cfp_test::normalized_error_sq(model.motion, in_walls) / seeds;
  }
  CHECK(nees > 4);
  CHECK(nees < 9);
}

TEST_CASE("What neighbours err by together is measured, and the motion is as uncertain as it makes it", "[frame]") {
  constexpr double noise = 0.2;
  constexpr int seeds = 60;
  for (const double shared : {0.0, 0.1, 0.3}) {
    CAPTURE(shared);
    double measured = 0, nees = 0, nees_if_alone = 0;
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
      cfp::Random random(seed, "shared error");
      const cfp::SE3<double> T = motion(0.02, 0.02);
      Room room(T, noise, seed);
      const std::vector<double> depths = room.err_by_parts(T, {5, 4}, shared, noise, random);
      cfp::FlowModelWorkspace<double> workspace;
      cfp::FlowModelOptions options;
      options.motion.shared_depth_ratio = 0;
      options.motion.distance.depth_noise = {0, 0, 0};
      const auto model = cfp::estimate_flow_model<double>({room.previous, room.current, depths}, room.outside,
                                                          room.camera, options, workspace);
      REQUIRE(model.kind == cfp::FlowModelKind::motion);
      measured += model.shared_error_px / seeds;
      const cfp::CameraMotion<double> alone = cfp::estimate_camera_motion<double>(
          {room.previous, room.current, depths}, room.outside, room.camera, options.motion, workspace.motion);
      nees += cfp_test::normalized_error_sq(model.motion, T) / seeds;
      nees_if_alone += cfp_test::normalized_error_sq(alone, T) / seeds;
    }
    CHECK(measured < shared + 0.05);
    CHECK(measured > 0.2 * shared);
    CHECK(nees < 16);  // 6, if all were known
    if (shared > 0.2) CHECK(nees_if_alone > 40);
  }
}

TEST_CASE("What neighbours err by together is measured under F, too, and a pair far beside the others hides it nowhere",
          "[frame]") {
  constexpr double noise = 0.2, shared = 0.4;
  constexpr int seeds = 40;
  for (const bool with_depths : {false, true}) {
    for (const bool one_far : {false, true}) {
      CAPTURE(with_depths, one_far);
      double mean_sq = 0;
      int measured = 0;
      for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
        cfp::Random random(seed, "shared error of F");
        const cfp::SE3<double> T = motion(0.15, 0.02);
        Room room(T, noise, seed);
        std::vector<double> depths = room.err_by_parts(T, {4, 3}, shared, noise, random);
        if (one_far) room.previous[7] = room.current[7] = {4000, 240};
        if (!with_depths) depths.clear();
        cfp::FlowModelWorkspace<double> workspace;
        cfp::FlowModelOptions options;
        options.motion.shared_depth_ratio = 0;
        options.motion.distance.depth_noise = {0, 0, 0};
        const auto model = cfp::estimate_flow_model<double>({room.previous, room.current, depths}, room.outside,
                                                            room.camera, options, workspace);
        if ((model.kind == cfp::FlowModelKind::motion) != with_depths) continue;
        if (!with_depths && model.kind != cfp::FlowModelKind::fundamental) continue;
        mean_sq += model.shared_error_px * model.shared_error_px;
        ++measured;
      }
      CHECK(measured >= seeds / 2);
      CHECK(std::sqrt(mean_sq / measured) > (one_far ? 0.55 : 0.85) * shared);
      CHECK(std::sqrt(mean_sq / measured) < 1.2 * shared);
    }
  }
}

TEST_CASE("Pairs in five parts of the image tell their motion, but not what neighbours err by together", "[frame]") {
  constexpr double noise = 0.2;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    CAPTURE(seed);
    cfp::Random random(seed, "few parts");
    const cfp::SE3<double> T = motion(0.02, 0.02);
    Room room(T, noise, seed);
    const std::vector<double> depths = room.err_by_parts(T, {4, 3}, 0, noise, random);
    for (std::size_t i = 0; i < room.outside.size(); ++i) {
      const auto part = static_cast<int>(room.previous[i][0] / 160) + 4 * static_cast<int>(room.previous[i][1] / 160);
      room.outside[i] = part == 0 || part == 3 || part == 5 || part == 8 || part == 11 ? 1 : 0;
    }
    cfp::FlowModelWorkspace<double> workspace;
    const auto model = cfp::estimate_flow_model<double>({room.previous, room.current, depths}, room.outside,
                                                        room.camera, cfp::FlowModelOptions{}, workspace);
    REQUIRE(model.kind == cfp::FlowModelKind::motion);
    CHECK(model.shared_error_px == 0);
  }
}

TEST_CASE("Depths that are too few for a motion do not enter one without scale", "[frame]") {
  const Room room(motion(0, 0.02), 0.2, 7);
  cfp::FlowModelWorkspace<double> workspace;
  std::vector<double> depths(room.previous.size(), 0), with(depths.size()), without(depths.size());
  depths[0] = depths[1] = 0.5;
  const cfp::FlowPairs<double> flow{room.previous, room.current, depths};
  const auto model = cfp::estimate_flow_model<double>(flow, room.outside, room.camera, {}, workspace);
  REQUIRE(model.kind == cfp::FlowModelKind::motion_up_to_scale);
  cfp::flow_distances(model, flow, room.camera, {}, cfp::span<double>(with));
  cfp::flow_distances(model, {room.previous, room.current, {}}, room.camera, {}, cfp::span<double>(without));
  CHECK(with == without);
}

TEST_CASE("Too few pairs outside the boxes, and no depths: no model, for what is judged is no judge", "[frame]") {
  using Kind = cfp::FlowModelKind;
  const auto kind_of = [](Room room, std::size_t outside) {
    for (std::size_t i = 0; i < room.outside.size(); ++i) room.outside[i] = i < outside ? 1 : 0;
    const cfp::FlowModel<double> model = room.model();
    CHECK(model.support == (model.kind == Kind::none ? cfp::FlowSupport::none : cfp::FlowSupport::outside_pairs));
    CHECK((model.status == cfp::RansacStatus::ok) == (model.kind == Kind::fundamental));
    CHECK((model.sigma_px > 0) == (model.kind != Kind::none));
    return model.kind;
  };
  const Room parallax(motion(0.1, 0.02), 0.2, 6);
  CHECK(kind_of(parallax, 30) == Kind::fundamental);
  CHECK(kind_of(parallax, 29) == Kind::none);  // not of one depth either
  const Room wall(motion(0.02, 0.02), 0.2, 6, 4, 4);
  CHECK(kind_of(wall, 12) == Kind::motion_up_to_scale);
  CHECK(kind_of(wall, 11) == Kind::none);
}
