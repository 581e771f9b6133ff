// What the cameras of the small hosts see: a textured room, two people who walk through it, and a box detector that
// misses some of them. Points only, so that the examples need no images.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cfp/core/random.hpp"
#include "cfp/detection/box_tracker_types.hpp"
#include "cfp/geometry/camera.hpp"

class Room {
 public:
  static constexpr int width = 640, height = 480, people = 2;
  using Boxes = std::array<cfp::Box<float>, people>;

  Room(const cfp::PinholeCamera<float>& camera, cfp::Random& random) : camera_(camera), random_(random) {
    for (int i = 0; i < 2500; ++i) points_.push_back({{uniform(-4, 4), uniform(-1.6F, 1.2F), uniform(3.2F, 5.5F)}, -1});
    for (int person = 0; person < people; ++person) {
      for (int i = 0; i < 260; ++i)
        points_.push_back({{0.25F * uniform(-1, 1), 0.8F * uniform(-1, 1), 0.12F * uniform(-1, 1)}, person});
    }
  }

  std::size_t size() const { return points_.size(); }

  // The camera's true pose T_cam_world at a frame, at 30 Hz: it sways, moves and turns.
  static Eigen::Matrix4f pose(long n) {
    const float t = static_cast<float>(n) / 30, yaw = 0.12F * std::sin(0.7F * t), c = std::cos(yaw), s = std::sin(yaw);
    const Eigen::Vector3f position(0.35F * std::sin(0.9F * t), 0.1F * std::sin(1.3F * t), 0.2F * std::sin(0.6F * t));
    Eigen::Matrix4f T = Eigen::Matrix4f::Identity();
    T.topLeftCorner<3, 3>() = Eigen::Matrix3f{{c, 0, -s}, {0, 1, 0}, {s, 0, c}};
    T.topRightCorner<3, 1>() = -T.topLeftCorner<3, 3>() * position;
    return T;
  }

  // Pixel and depth of every point at a frame; depth 0 behind the camera.
  std::vector<Eigen::Vector3f> project(long n) const {
    const Eigen::Matrix4f T = pose(n);
    const float t = static_cast<float>(n) / 30;
    std::vector<Eigen::Vector3f> pixels;
    for (const Point& point : points_) {
      Eigen::Vector3f world = point.position;
      if (point.person >= 0) {
        const float side = point.person == 0 ? -1.0F : 1.0F;
        world += Eigen::Vector3f(side * (0.5F + 0.55F * std::sin(1.1F * t + side)), 0.1F, 1.9F + 0.3F * side);
      }
      const Eigen::Vector3f x = (T * world.homogeneous()).head<3>();
      Eigen::Vector2f pixel;
      const bool before = x.z() > 0.1F && camera_.project(x, pixel);
      pixels.push_back(before ? Eigen::Vector3f(pixel.x(), pixel.y(), x.z()) : Eigen::Vector3f::Zero());
    }
    return pixels;
  }

  // The true box of each person; of nobody before the camera an improper one.
  Boxes boxes(const std::vector<Eigen::Vector3f>& pixels) const {
    Boxes boxes;
    boxes.fill({1e9F, 1e9F, -1e9F, -1e9F});
    for (std::size_t i = 0; i < points_.size(); ++i) {
      if (points_[i].person < 0 || pixels[i].z() <= 0) continue;
      cfp::Box<float>& box = boxes[static_cast<std::size_t>(points_[i].person)];
      box = {std::min(box.x1, pixels[i].x()), std::min(box.y1, pixels[i].y()), std::max(box.x2, pixels[i].x()),
             std::max(box.y2, pixels[i].y())};
    }
    return boxes;
  }

  // Whether point i is in the image and no person stands before it: an ellipse in the middle of his box.
  bool is_visible(std::size_t i, const std::vector<Eigen::Vector3f>& pixels, const Boxes& boxes) const {
    if (!is_inside(pixels[i])) return false;
    for (int person = 0; person < people; ++person) {
      const cfp::Box<float>& b = boxes[static_cast<std::size_t>(person)];
      if (points_[i].person == person || b.x2 <= b.x1 || (points_[i].person >= 0 && points_[i].person < person))
        continue;
      const float dx = (2 * pixels[i].x() - b.x1 - b.x2) / b.width(),
                  dy = (2 * pixels[i].y() - b.y1 - b.y2) / b.height();
      if (dx * dx + dy * dy < 0.9F) return false;
    }
    return true;
  }
  static bool is_inside(const Eigen::Vector3f& pixel) {
    return pixel.z() > 0 && pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < float(width) && pixel.y() < float(height);
  }

  // As a detector would have them: a few pixels off, and one in seven missed.
  std::vector<cfp::Detection<float>> detect(const Boxes& boxes) {
    std::vector<cfp::Detection<float>> detections;
    for (const cfp::Box<float>& b : boxes) {
      if (b.x2 < 5 || b.x1 > float(width) - 5 || uniform(0, 1) < 0.15F) continue;
      detections.push_back({{b.x1 + noise(3), b.y1 + noise(3), b.x2 + noise(3), b.y2 + noise(3)}, 0, 0.9F});
    }
    return detections;
  }

  float uniform(float a, float b) { return static_cast<float>(random_.uniform(double(a), double(b))); }
  float noise(float sigma) { return sigma * static_cast<float>(random_.normal()); }

 private:
  struct Point {
    Eigen::Vector3f position;  // of a person's point: from his middle
    int person;                // -1: of the room
  };

  cfp::PinholeCamera<float> camera_;
  cfp::Random& random_;
  std::vector<Point> points_;
};
