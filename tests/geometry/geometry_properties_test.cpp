// Properties of geometry/, for whatever the generators make.
#include <array>
#include <cmath>
#include <vector>

#include "cfp/geometry/box.hpp"
#include "cfp/geometry/camera.hpp"
#include "cfp/geometry/depth_noise.hpp"
#include "cfp/geometry/epipolar.hpp"
#include "cfp/geometry/fundamental.hpp"
#include "cfp/geometry/motion_distance.hpp"
#include "cfp/geometry/p3p.hpp"
#include "cfp_testing/generators.hpp"
#include "support/properties.hpp"

using cfp::Matrix3;
using cfp::Random;
using cfp::SE3;
using cfp::Vector2;
using cfp::Vector3;

namespace {

Vector3<double> point_before_camera(Random& random) {
  const double z = random.uniform(0.5, 6), x = random.uniform(-0.5, 0.5), y = random.uniform(-0.4, 0.4);
  return {x * z, y * z, z};
}

/// A small motion with a baseline.
SE3<double> motion(Random& random) {
  SE3<double> T = cfp_testing::pose(random, 0.3, 0.2);
  T.translation.x() += 0.4;
  return T;
}

template <typename Distance>
bool zero_for_truth(Random& random, const Distance& distance) {
  const auto camera = cfp_testing::pinhole_camera<double>(random);
  const SE3<double> T = motion(random);
  const Vector3<double> x = point_before_camera(random);
  Vector2<double> prev, cur;
  if (!camera.project(x, prev) || !camera.project(T * x, cur)) return true;
  return distance(camera, T, prev, cur, x.z()) < 1e-6;
}

}  // namespace

CFP_PROPERTIES("Properties of cameras", "[geometry]",
               {"a pixel's ray projects to the pixel, through any lens and at any depth", 300,
                [](Random& random) {
                  const auto camera = cfp_testing::distorted_camera<double>(random);
                  const Vector2<double> pixel = cfp_testing::pixel(random);
                  Vector3<double> ray;
                  Vector2<double> back;
                  return camera.unproject(pixel, ray) && camera.project(ray * random.uniform(0.01, 100), back) &&
                         (back - pixel).norm() < 1e-8;
                }},
               {"without distortion the two cameras are one", 200,
                [](Random& random) {
                  const auto pinhole = cfp_testing::pinhole_camera<double>(random);
                  cfp::RadialTangentialCamera<double> other;
                  other.fx = pinhole.fx, other.fy = pinhole.fy, other.cx = pinhole.cx, other.cy = pinhole.cy;
                  const Vector3<double> x = point_before_camera(random);
                  Vector2<double> a, b;
                  return pinhole.project(x, a) && other.project(x, b) && (a - b).norm() < 1e-10;
                }},
               {"the Jacobian of any camera is the derivative of its projection", 200,
                [](Random& random) {
                  const auto camera = cfp_testing::distorted_camera<double>(random);
                  const Vector3<double> x = point_before_camera(random), d = cfp_testing::vector_in_cube(random, 1e-6);
                  Vector2<double> a, b;
                  cfp::Matrix23<double> J;
                  if (!camera.project(x - d, a) || !camera.project(x + d, b)) return false;
                  Vector2<double> u;
                  return camera.project(x, u, &J) && ((b - a) - 2 * J * d).norm() < 1e-7;
                }},
               {"undistorting what has no distortion changes nothing", 200,
                [](Random& random) {
                  const auto camera = cfp_testing::distorted_camera<double>(random);
                  const cfp::RadialTangentialCamera<double> plain{camera.fx, camera.fy, camera.cx, camera.cy};
                  const std::vector<Vector2<double>> pixel{cfp_testing::pixel(random)};
                  std::vector<std::array<double, 2>> storage, again;
                  const auto once = cfp::undistorted(camera, pixel, storage);
                  return once[0].allFinite() && (cfp::undistorted(plain, once, again)[0] - once[0]).norm() < 1e-10;
                }},
               {"whatever the number, a projection that is given is finite", 1000, [](Random& random) {
                  const auto camera = cfp_testing::distorted_camera<float>(random);
                  const Vector3<float> x(cfp_testing::any_number<float>(random), cfp_testing::any_number<float>(random),
                                         cfp_testing::any_number<float>(random));
                  Vector2<float> u;
                  Vector3<float> ray;
                  const Vector2<float> pixel(x[0], x[1]);
                  return (!camera.project(x, u) || u.allFinite()) && (!camera.unproject(pixel, ray) || ray.allFinite());
                }})

CFP_PROPERTIES("Properties of boxes", "[geometry]",
               {"a box overlaps itself wholly, and nested boxes by the share of their areas", 200,
                [](Random& random) {
                  const auto b = cfp_testing::box<double>(random);
                  const double s = random.uniform(0.1, 1);
                  const cfp::Box<double> inner{b.x1, b.y1, b.x1 + s * b.width(), b.y1 + s * b.height()};
                  return cfp::iou(b, b) == 1 && std::abs(cfp::iou(b, inner) - s * s) < 1e-12;
                }},
               {"boxes apart do not overlap; nor do boxes of any numbers leave [0, 1]", 1000, [](Random& random) {
                  const auto b = cfp_testing::box<double>(random);
                  const double gap = b.width() + random.uniform(1e-9, 100);
                  const auto any = [&] { return cfp_testing::any_number<double>(random); };
                  const cfp::Box<double> wild{any(), any(), any(), any()}, other{any(), any(), any(), any()};
                  const double overlap = cfp::iou(wild, other);
                  return cfp::iou(b, {b.x1 + gap, b.y1, b.x2 + gap, b.y2}) == 0 && overlap >= 0 && overlap <= 1;
                }})

CFP_PROPERTIES("Properties of distances between views", "[geometry]",
               {"epipolar distances of a point's own pixels are zero", 300,
                [](Random& random) {
                  return zero_for_truth(
                      random, [](const auto& camera, const auto& T, const auto& prev, const auto& cur, double) {
                        const Matrix3<double> F = cfp::fundamental_from_pose(camera, T);
                        return cfp::epipolar_distance(F, prev, cur);
                      });
                }},
               {"the motion distance of a point's own pixels is zero", 300,
                [](Random& random) {
                  return zero_for_truth(
                      random, [](const auto& camera, const auto& T, const auto& prev, const auto& cur, double depth) {
                        return cfp::motion_distance(prev, depth, cur, cfp::UncertainMotion(T), camera, 1.0, {});
                      });
                }},
               {"an unsure depth never raises the motion distance, and it never exceeds the reprojection's", 300,
                [](Random& random) {
                  const auto camera = cfp_testing::pinhole_camera<double>(random);
                  const SE3<double> T = motion(random);
                  const Vector2<double> prev = cfp_testing::pixel(random), cur = cfp_testing::pixel(random);
                  cfp::MotionDistanceOptions sure, unsure;
                  sure.depth_noise.quadratic = random.uniform(0, 0.01);
                  unsure.depth_noise.quadratic = sure.depth_noise.quadratic + random.uniform(0, 0.05);
                  const double depth = random.uniform(0.5, 5),
                               a = cfp::motion_distance(prev, depth, cur, cfp::UncertainMotion(T), camera, 1.0, sure),
                               b = cfp::motion_distance(prev, depth, cur, cfp::UncertainMotion(T), camera, 1.0, unsure);
                  Vector3<double> ray;
                  Vector2<double> u;
                  if (!camera.unproject(prev, ray) || !camera.project(T * Vector3<double>(depth * ray), u))
                    return a == b;
                  return b <= a + 1e-9 && a <= (u - cur).norm() + 1e-9;
                }},
               {"the scale of F changes no distance", 300,
                [](Random& random) {
                  const Matrix3<double> F = cfp::fundamental_from_pose(cfp_testing::pinhole_camera<double>(random),
                                                                       motion(random)),
                                        other = -std::exp2(static_cast<double>(random.index(41)) - 20) * F;
                  const Vector2<double> prev = cfp_testing::pixel(random), cur = cfp_testing::pixel(random);
                  return std::abs(cfp::epipolar_distance(F, prev, cur) - cfp::epipolar_distance(other, prev, cur)) <
                         1e-9;
                }},
               {"a rotation of the camera is a homography", 300,
                [](Random& random) {
                  const auto camera = cfp_testing::pinhole_camera<double>(random);
                  SE3<double> T = cfp_testing::pose(random, 1, 0.3);
                  T.translation.setZero();
                  const Matrix3<double> H = cfp::rotation_homography(camera, T.rotation);
                  const Vector3<double> x = point_before_camera(random);
                  Vector2<double> prev, cur;
                  if (!camera.project(x, prev) || !camera.project(T * x, cur)) return true;
                  const Vector3<double> mapped = H * Vector3<double>(prev.x(), prev.y(), 1);
                  return (mapped.head<2>() / mapped.z() - cur).norm() < 1e-7;
                }},
               {"the nearest fundamental matrix has rank 2 and is its own nearest", 300,
                [](Random& random) {
                  Matrix3<double> M;
                  for (int k = 0; k < 9; ++k) M.data()[k] = random.normal();
                  const Matrix3<double> F = cfp::nearest_fundamental(M), again = cfp::nearest_fundamental(F);
                  return std::abs(cfp::determinant(F)) < 1e-12 && (F - again).norm() < 1e-12;
                }},
               {"a farther depth is never surer beyond the sensor's best", 300, [](Random& random) {
                  const cfp::DepthNoise noise;
                  const double z = random.uniform(noise.nearest_m, 8), more = z + random.uniform(0, 4);
                  return noise.sigma_m(more) >= noise.sigma_m(z) && noise.sigma_m(z) >= noise.constant_m;
                }})

CFP_PROPERTIES("Properties of P3P", "[geometry]",
               {"the true pose is among the solutions, wherever the world's frame is", 500, [](Random& random) {
                  cfp::P3PProblem<double> problem;
                  const SE3<double> T = cfp_testing::pose(random, 5, 3);
                  std::vector<Vector3<double>> in_camera;
                  for (std::size_t k = 0; k < 3; ++k) {
                    in_camera.push_back(point_before_camera(random));
                    problem.world[k] = T.inverse() * in_camera[k];
                    problem.rays[k] = in_camera[k] / in_camera[k].z();
                  }
                  const double area = cfp::cross(Vector3<double>(in_camera[1] - in_camera[0]),
                                                 Vector3<double>(in_camera[2] - in_camera[0]))
                                          .norm();
                  const auto solved = cfp::p3p(problem);
                  double best = area < 0.3 ? 0 : 1;
                  for (int k = 0; k < solved.count; ++k) {
                    const SE3<double>& S = solved.T_cam_world[static_cast<std::size_t>(k)];
                    best = std::fmin(best, (S.translation - T.translation).norm() + (S.rotation - T.rotation).norm());
                  }
                  return best < 1e-4;
                }})
