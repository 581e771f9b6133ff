#include "cfp/frame/flow_model.hpp"

#include <array>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"
#include "support/engines.hpp"

namespace {

/// Pairs without depth of a static room, all outside boxes, with noise in the current image alone.
struct Room {
  cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};
  std::vector<std::array<double, 2>> previous, current;
  std::vector<char> outside;

  Room(const cfp::SE3<double>& T, double noise_px, std::uint64_t seed) {
    cfp::Random random(seed, "flow model");
    while (previous.size() < 400) {
      const cfp::Vector2<double> p(random.uniform(20, 620), random.uniform(20, 460));
      cfp::Vector3<double> ray;
      cfp::Vector2<double> q;
      REQUIRE(camera.unproject(p, ray));
      if (!camera.project(T * cfp::Vector3<double>(random.uniform(1, 5) * ray), q)) continue;
      previous.push_back({p.x(), p.y()});
      current.push_back({q.x() + noise_px * random.normal(), q.y() + noise_px * random.normal()});
    }
    outside.assign(previous.size(), 1);
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

TEST_CASE("The noise of one coordinate is measured, across lines and around mapped points", "[frame]") {
  for (const double noise : {0.1, 0.2, 0.4}) {
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      const cfp::FlowModel<double> moving = Room(motion(0.1, 0.02), noise, seed).model();
      REQUIRE(moving.kind == cfp::FlowModelKind::fundamental);
      CHECK_THAT(moving.sigma_px, WithinAbs(noise, 0.2 * noise));
      const cfp::FlowModel<double> turning = Room(motion(0, 0.02), noise, seed).model();
      REQUIRE(turning.kind == cfp::FlowModelKind::homography);
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
  options.use_rotation_homography = false;
  const cfp::FlowModel<double> turning = Room(motion(0, 0.02), 0.2, 1).model(options);
  CHECK(turning.kind == cfp::FlowModelKind::none);
  CHECK(turning.sigma_px == 0);
}

TEST_CASE("Too few pairs outside the boxes, and no depths: no model, for what is judged is no judge", "[frame]") {
  Room room(motion(0.1, 0.02), 0.2, 6);
  for (const std::size_t outside : {30U, 29U}) {
    for (std::size_t i = 0; i < room.outside.size(); ++i) room.outside[i] = i < outside ? 1 : 0;
    const cfp::FlowModel<double> model = room.model();
    const bool enough = outside == 30;
    CHECK(model.kind == (enough ? cfp::FlowModelKind::fundamental : cfp::FlowModelKind::none));
    CHECK(model.support == (enough ? cfp::FlowSupport::outside_pairs : cfp::FlowSupport::none));
    CHECK(model.status == (enough ? cfp::RansacStatus::ok : cfp::RansacStatus::not_enough_data));
    CHECK((model.sigma_px > 0) == enough);
  }
}
