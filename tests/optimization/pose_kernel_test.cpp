#include "cfp/optimization/pose/pose_kernel_impl.hpp"

#include <cmath>
#include <type_traits>
#include <vector>

#include "cfp/optimization/pose/pose_refinement.hpp"
#include "support/catch.hpp"
#include "support/pose_scene.hpp"

namespace {

using cfp::Matrix6;
using cfp::Vector6;
using cfp::detail::PoseColumns;
using cfp::detail::PoseSystem;

enum class Third { none, depth, u_right };

/// What is measured of one observation in pixels, written down once more: u, v and the third row.
Eigen::Vector3d expected_pixels(const cfp::SE3<double>& T, const Eigen::Vector3d& X,
                                const cfp::PinholeCamera<double>& camera, double baseline_fx, Third third) {
  const Eigen::Vector3d p = T.rotation * X + T.translation;
  const double u = camera.fx * p.x() / p.z() + camera.cx, disparity = baseline_fx / p.z();
  return {u, camera.fy * p.y() / p.z() + camera.cy,
          third == Third::none ? 0.0 : (third == Third::u_right ? u : 0.0) - disparity};
}

/// Normal equations of one observation (residual r, information W) from central differences through the library's
/// update.
PoseSystem numeric_system(const cfp::SE3<double>& T, const Eigen::Vector3d& X, const Eigen::Vector3d& r, double W,
                          const cfp::PinholeCamera<double>& camera, double baseline_fx, Third third) {
  Eigen::Matrix<double, 3, 6> J;
  for (int k = 0; k < 6; ++k) {
    const double h = 1e-6;
    const Vector6<double> step = Vector6<double>::Unit(k) * h;
    J.col(k) = (expected_pixels(cfp::se3_exp<double>(step) * T, X, camera, baseline_fx, third) -
                expected_pixels(cfp::se3_exp<double>(Vector6<double>(-step)) * T, X, camera, baseline_fx, third)) /
               (2 * h);
  }
  PoseSystem system;
  system.equations.H = W * J.transpose() * J;
  system.equations.g = W * J.transpose() * r;
  return system;
}

}  // namespace

TEMPLATE_TEST_CASE("Pose kernel: H and g equal those of numeric Jacobians, pixel and depth, packets and any camera",
                   "[optimization]", float, double) {
  using Scalar = TestType;
  using P = cfp::simd::Packet<Scalar>;
  const double tolerance = std::is_same_v<Scalar, float> ? 2e-4 : 1e-6;
  const cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};
  const double baseline_fx = 40;
  cfp::Random random(4, "jacobian");
  for (int i = 0; i < 100; ++i) {
    const cfp::SE3<double> T{cfp::so3_exp<double>(cfp_test::random_direction(random) * random.uniform(0, 3)),
                             cfp_test::random_direction(random) * 0.3};
    const Eigen::Vector3d p(random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(0.6, 4));
    const Eigen::Vector3d X = T.rotation.transpose() * (p - T.translation);
    const double information = random.uniform(0.2, 2), weight = random.uniform(0.1, 1);
    const Third third = std::array{Third::none, Third::depth, Third::u_right}[static_cast<std::size_t>(i % 3)];
    const bool stereo = third != Third::none;
    const Eigen::Vector3d r(random.uniform(-4, 4), random.uniform(-4, 4), stereo ? random.uniform(-4, 4) : 0.0);
    const Eigen::Vector3d measured = expected_pixels(T, X, camera, baseline_fx, third) - r;

    const std::size_t lanes = P::lanes;
    std::vector<Scalar> storage[10];
    PoseColumns<Scalar> columns;
    columns.baseline_fx = baseline_fx;
    columns.third_has_u = third == Third::depth ? 0 : 1;
    Scalar** pointers[10] = {&columns.x,     &columns.y,         &columns.z,           &columns.u,
                             &columns.v,     &columns.disparity, &columns.information, &columns.active,
                             &columns.error, &columns.weight};
    const auto fill = [&](bool normalised) {
      const double fu = normalised ? 1 / camera.fx : 1, fv = normalised ? 1 / camera.fy : 1,
                   cu = normalised ? camera.cx : 0, cv = normalised ? camera.cy : 0;
      const double values[10] = {X.x(),
                                 X.y(),
                                 X.z(),
                                 (measured[0] - cu) * fu,
                                 (measured[1] - cv) * fv,
                                 (columns.third_has_u * measured[0] - measured[2]) * fu,
                                 information / (fu * fu),
                                 weight,
                                 0,
                                 weight};
      for (int c = 0; c < 10; ++c) {
        storage[c].assign(lanes, Scalar(c == 6 ? 1 : 0));  // the other lanes: padding
        storage[c][0] = static_cast<Scalar>(values[c]);
        *pointers[c] = storage[c].data();
      }
    };
    const PoseSystem expected = numeric_system(T, X, r, weight * information, camera, baseline_fx, third);
    const auto check = [&](const PoseSystem& system) {
      const Matrix6<double> H = system.equations.H.selfadjointView<Eigen::Upper>();
      CAPTURE(i, stereo, H, expected.equations.H, system.equations.g.transpose(), expected.equations.g.transpose());
      CHECK((H - expected.equations.H).norm() < tolerance * expected.equations.H.norm());
      CHECK((system.equations.g - expected.equations.g).norm() < 20 * tolerance * expected.equations.g.norm());
      CHECK(system.cost == Approx(weight * information * r.squaredNorm()).epsilon(20 * tolerance));
    };
    const auto add = [&](auto is_stereo) {
      constexpr bool s = decltype(is_stereo)::value;
      PoseSystem packet, general;
      fill(true);
      cfp::detail::add_observations<s>(columns, 0, lanes, camera, T, cfp::Trivial<P>{}, packet);
      CHECK(static_cast<double>(columns.error[0]) == Approx(information * r.squaredNorm()).epsilon(20 * tolerance));
      fill(false);
      cfp::detail::add_observations<s>(columns, 0, 1, cfp_test::PlainCamera{camera}, T, cfp::NamedLoss<double>{},
                                       general);
      check(packet);
      check(general);
    };
    stereo ? add(std::true_type()) : add(std::false_type());
  }
}

TEST_CASE("Pose kernel: a point behind the camera keeps the error it last had in front and adds nothing to H and g",
          "[optimization]") {
  using P = cfp::simd::Packet<double>;
  const cfp::PinholeCamera<double> camera{500, 500, 320, 240};
  std::vector<double> x(8), y(8), z(8, 2.0), u(8, 0.01), v(8), information(8, 500.0 * 500.0), active(8), error(8);
  active[0] = 1;
  PoseColumns<double> columns;
  columns.x = x.data(), columns.y = y.data(), columns.z = z.data(), columns.u = u.data(), columns.v = v.data();
  columns.information = information.data(), columns.active = active.data(), columns.error = error.data();
  const cfp::SE3<double> front, behind{cfp::Matrix3<double>::Identity(), {0, 0, -3}};
  const std::size_t lanes = P::lanes;
  PoseSystem first, second, third;
  cfp::detail::add_observations<false>(columns, 0, lanes, camera, front, cfp::Trivial<P>{}, first);
  CHECK(first.cost == Approx(25.0));
  cfp::detail::add_observations<false>(columns, 0, lanes, camera, behind, cfp::Trivial<P>{}, second);
  CHECK(second.cost == Approx(25.0));
  CHECK(second.equations.H.norm() == 0);
  CHECK(second.equations.g.norm() == 0);
  CHECK(error[0] < 0);
  cfp::detail::add_observations<false>(columns, 0, lanes, camera, front, cfp::Trivial<P>{}, third);
  CHECK(third.cost == Approx(25.0));
  CHECK(error[0] == Approx(25.0));
}

TEST_CASE("Pose kernel: a point is in view up to a hundred times as far aside as ahead", "[optimization]") {
  using P = cfp::simd::Packet<double>;
  const cfp::PinholeCamera<double> camera{500, 500, 320, 240};
  std::vector<double> x(8), y(8), z(8, 1.0), u(8), v(8), information(8, 1.0), active(8, 1.0), error(8);
  PoseColumns<double> columns;
  columns.x = x.data(), columns.y = y.data(), columns.z = z.data(), columns.u = u.data(), columns.v = v.data();
  columns.information = information.data(), columns.active = active.data(), columns.error = error.data();
  const double beyond = std::nextafter(100.0, 200.0);
  x = {0, 100, -100, beyond, -beyond, 0, 0, 0}, y = {0, 0, 0, 0, 0, 100, -100, beyond};
  PoseSystem system;
  cfp::detail::add_observations<false>(columns, 0, 8, camera, {}, cfp::Trivial<P>{}, system);
  for (std::size_t i = 0; i < 8; ++i) {
    const bool in_view = std::abs(x[i]) <= 100 && std::abs(y[i]) <= 100;
    CAPTURE(i, error[i]);
    CHECK(in_view == (error[i] >= 0 && (error[i] > 0 || i == 0)));
  }
}
