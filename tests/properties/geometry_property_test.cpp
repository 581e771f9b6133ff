#include "support/generators.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/geometry/box.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"
#include "cfp/geometry/reprojection.hpp"

using cfp::SE3;
using cfp::Vector2;
using cfp::Vector3;
using cfp_test::real;

namespace {
cfp::Vector6<double> tangent(double translation, double rotation) {
  cfp::Vector6<double> xi;
  for (int c = 0; c < 6; ++c) xi[c] = c < 3 ? real(-translation, translation) : real(-rotation, rotation);
  return xi;
}
const cfp::PinholeCamera<double> camera{500, 510, 320, 240};
}  // namespace

TEST_CASE("properties of motions", "[properties]") {
  rc::prop("log inverts exp below half a turn", [] {
    const cfp::Vector6<double> xi = tangent(5, 1.8);
    RC_PRE(xi.tail<3>().norm() < 3.1);
    RC_ASSERT((cfp::se3_log(cfp::se3_exp(xi)) - xi).norm() < 1e-10);
  });
  rc::prop("(A B)^-1 = B^-1 A^-1 and rotations stay rotations", [] {
    const SE3<double> A = cfp::se3_exp(tangent(5, 3)), B = cfp::se3_exp(tangent(5, 3));
    const SE3<double> left = (A * B).inverse(), right = B.inverse() * A.inverse();
    RC_ASSERT((left.translation - right.translation).norm() < 1e-12);
    RC_ASSERT((left.rotation.transpose() * left.rotation - cfp::Matrix3<double>::Identity()).norm() < 1e-13);
  });
}

TEST_CASE("properties of epipolar distances", "[properties]") {
  rc::prop("zero for the image of a point at any depth: the line is that of the ray", [] {
    const SE3<double> T = cfp::se3_exp(tangent(0.5, 0.3));
    RC_PRE(T.translation.norm() > 0.01);
    const Vector2<double> prev(real(0, 640), real(0, 480));
    Vector3<double> ray = Vector3<double>::Zero();
    Vector2<double> cur = Vector2<double>::Zero();
    RC_ASSERT(camera.unproject(prev, ray));
    RC_PRE(camera.project(T * Vector3<double>(ray * real(0.5, 50)), cur));
    RC_PRE(cur.norm() < 1e4);
    const cfp::Matrix3<double> F = cfp::fundamental_from_pose(camera, T);
    // A pixel away from the epipole, where the camera stands, has a line.
    Vector2<double> epipole = Vector2<double>::Zero();
    const Vector3<double> centre = T.inverse().translation;
    const bool in_front = camera.project(centre, epipole) || camera.project(Vector3<double>(-centre), epipole);
    RC_PRE(in_front && (epipole - prev).norm() > 1);
    const double d = cfp::epipolar_distance(F, prev, cur);
    RC_ASSERT(cfp::has_distance(d) && d < 1e-6);
    const double away = real(-30, 30);
    const Vector2<double> normal = cfp::epipolar_line(F, prev).head<2>().normalized();
    const double moved = cfp::epipolar_distance(F, prev, Vector2<double>(cur + away * normal));
    RC_ASSERT(std::abs(moved - std::abs(away)) < 1e-6);
  });
  rc::prop("moving the current pixel moves the distance by at most as much", [] {
    const cfp::Matrix3<double> F = cfp::fundamental_from_pose(camera, cfp::se3_exp(tangent(0.5, 0.3)));
    const Vector2<double> prev(real(0, 640), real(0, 480)), cur(real(0, 640), real(0, 480)),
        step(real(-20, 20), real(-20, 20));
    const double d = cfp::epipolar_distance(F, prev, cur),
                 moved = cfp::epipolar_distance(F, prev, Vector2<double>(cur + step));
    RC_PRE(cfp::has_distance(d));
    RC_ASSERT(std::abs(moved - d) <= step.norm() + 1e-9);
  });
}

TEST_CASE("properties of reprojection distances", "[properties]") {
  rc::prop("a rigid change of the world changes nothing", [] {
    // The relative pose of two cameras is the same whatever the world frame is.
    const SE3<double> T_prev_world = cfp::se3_exp(tangent(2, 0.5)), T_cur_prev = cfp::se3_exp(tangent(0.3, 0.2)),
                      S = cfp::se3_exp(tangent(9, 3));
    const SE3<double> T_cur_world = T_cur_prev * T_prev_world;
    const SE3<double> again = (T_cur_world * S) * (T_prev_world * S).inverse();
    const Vector2<double> prev(real(0, 640), real(0, 480)), cur(real(0, 640), real(0, 480));
    const double depth = real(0.8, 8);
    const double d = cfp::reprojection_distance(prev, depth, cur, T_cur_prev, camera);
    RC_PRE(cfp::has_distance(d) && d < 1e4);
    RC_ASSERT(std::abs(cfp::reprojection_distance(prev, depth, cur, again, camera) - d) < 1e-6);
  });
  rc::prop("the array function is permutation equivariant to the bit, and float follows double", [] {
    const std::size_t n = static_cast<std::size_t>(*rc::gen::inRange(1, 150));
    const SE3<double> T = cfp::se3_exp(tangent(0.2, 0.1));
    std::vector<Vector2<double>> prev(n), cur(n);
    std::vector<Vector2<float>> prev_f(n), cur_f(n);
    std::vector<double> depth(n), out(n), reversed(n);
    std::vector<float> depth_f(n), out_f(n);
    for (std::size_t i = 0; i < n; ++i) {
      prev[i] << real(0, 640), real(0, 480);
      cur[i] << real(0, 640), real(0, 480);
      depth[i] = real(-0.1, 6);
      prev_f[i] = prev[i].cast<float>();
      cur_f[i] = cur[i].cast<float>();
      depth_f[i] = static_cast<float>(depth[i]);
    }
    cfp::reprojection_distances(prev, depth, cur, T, camera, out);
    cfp::reprojection_distances(prev_f, depth_f, cur_f, T.cast<float>(), cfp::PinholeCamera<float>{500, 510, 320, 240},
                                out_f);
    for (std::size_t i = 0; i < n; ++i) {
      if (depth[i] > 1) RC_ASSERT(std::abs(out[i] - static_cast<double>(out_f[i])) < 5e-3 * (1 + out[i] * 1e-2));
      if (depth[i] <= 0) RC_ASSERT(out[i] == -1 && out_f[i] == -1);
    }
    for (std::vector<Vector2<double>>* points : {&prev, &cur}) std::reverse(points->begin(), points->end());
    std::reverse(depth.begin(), depth.end());
    cfp::reprojection_distances(prev, depth, cur, T, camera, reversed);
    std::reverse(reversed.begin(), reversed.end());
    RC_ASSERT(reversed == out);
  });
}

TEST_CASE("properties of boxes and of the distorted camera", "[properties]") {
  rc::prop("iou is symmetric, in [0, 1], and unchanged by shift and scale", [] {
    const auto box = [] { return cfp::Box<double>{real(-10, 10), real(-10, 10), real(-10, 10), real(-10, 10)}; };
    const cfp::Box<double> a = box(), b = box();
    const double overlap = cfp::iou(a, b), scale = real(0.01, 100), shift = real(-50, 50);
    const auto moved = [&](const cfp::Box<double>& c) {
      return cfp::Box<double>{c.x1 * scale + shift, c.y1 * scale - shift, c.x2 * scale + shift, c.y2 * scale - shift};
    };
    RC_ASSERT(overlap >= 0 && overlap <= 1);
    RC_ASSERT(overlap == cfp::iou(b, a));
    RC_ASSERT(std::abs(cfp::iou(moved(a), moved(b)) - overlap) < 1e-9 || cfp::area(a) < 1e-3 || cfp::area(b) < 1e-3);
  });
  rc::prop("a ray that unproject gives projects to its pixel, for any lens", [] {
    const cfp::RadialTangentialCamera<double> lens{
        500, 500, 320, 240, real(-0.5, 0.5), real(-1, 1), real(-0.02, 0.02), real(-0.02, 0.02), real(-1, 1)};
    const Vector2<double> pixel(real(-100, 740), real(-100, 580));
    Vector3<double> ray = Vector3<double>::Zero();
    Vector2<double> back = Vector2<double>::Zero();
    if (!lens.unproject(pixel, ray)) return;  // beyond the fold of a strong lens
    RC_ASSERT(lens.project(ray, back));
    RC_ASSERT((back - pixel).norm() < 1e-9);
  });
  rc::prop("the pixel that project gives unprojects to its ray, for any lens a photographer would buy", [] {
    const cfp::RadialTangentialCamera<double> lens{
        500, 500, 320, 240, real(-0.1, 0.3), real(-0.05, 0.05), real(-0.003, 0.003), real(-0.003, 0.003), 0};
    const Vector3<double> point(real(-0.6, 0.6), real(-0.45, 0.45), 1);
    Vector3<double> ray = Vector3<double>::Zero();
    Vector2<double> pixel = Vector2<double>::Zero();
    RC_ASSERT(lens.project(point, pixel));
    RC_ASSERT(lens.unproject(pixel, ray));
    RC_ASSERT((ray - point).norm() < 1e-9);
  });
}
