// Ray casting with per-tile culling: colour, depth, surface and label of every pixel, and what of each person can be
// seen.
#pragma once

#include <algorithm>
#include <array>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <vector>

#include <opencv2/core.hpp>

#include "cfp/geometry/box.hpp"
#include "cfp/geometry/kannala_brandt_camera.hpp"
#include "cfp/math/se3.hpp"

#include "scene.hpp"
#include "surfaces.hpp"

namespace synthetic {

enum Label : unsigned char { label_static = 0, label_moving = 1, label_person_still = 2 };

/// A pinhole camera, or the fisheye where there is one.
struct ImageCamera : cfp::PinholeCamera<double> {
  int width = 640, height = 480;
  double lens = 0;  ///< the ray of a pixel is (1 + lens r^2) times as far from the axis as the pinhole's, r at depth 1
  std::optional<cfp::KannalaBrandtCamera<double>> fisheye;

  [[nodiscard]] Vector3d ray(double x, double y) const {
    Vector3d found(0, 0, 1);
    if (fisheye && fisheye->unproject({x, y}, found)) return found;
    if (fisheye) throw std::logic_error("a pixel of the fisheye has no ray");
    const Eigen::Vector2d plain((x - cx) / fx, (y - cy) / fy);
    const Eigen::Vector2d bent = (1 + lens * plain.squaredNorm()) * plain;
    return {bent.x(), bent.y(), 1};
  }
  /// No pixel's ray is farther from the pinhole's, px.
  [[nodiscard]] double most_bent_px() const {
    const double r = std::hypot(std::max(cx, width - cx) / fx, std::max(cy, height - cy) / fy);
    return std::abs(lens) * r * r * r * std::max(fx, fy);
  }
  /// A rectangle that holds the fisheye's image of a sphere.
  [[nodiscard]] cfp::Box<double> image_of(const Vector3d& centre, double radius) const {
    const double distance = centre.norm(), across = std::hypot(centre.x(), centre.y());
    if (!(distance > 1.01 * radius)) return {0, 0, width * 1.0, height * 1.0};
    // The angle from the axis is the radius in the image but for a tenth; around the axis up to 1.5 times as much.
    const double angle = std::atan2(across, centre.z()), scale = across > 0 ? angle / across : 0;
    const double x = fx * scale * centre.x() + cx, y = fy * scale * centre.y() + cy;
    const double reach = std::max(fx, fy) * (0.1 * angle + 1.7 * std::asin(radius / distance));
    return {x - reach, y - reach, x + reach, y + reach};
  }
};

/// What can be seen of a person. Box in pixels, right and lower edges exclusive; improper when nothing can be seen.
struct Sighting {
  cfp::Box<double> box{1e9, 1e9, -1e9, -1e9};
  int pixels = 0;      ///< visible
  double visible = 0;  ///< visible / inside the image if nothing stood before it
  bool at_border = false;
};

struct Frame {
  cv::Mat color;    ///< CV_32FC3, BGR in [0, 255], before exposure and noise
  cv::Mat depth;    ///< CV_32F, m along the optical axis, infinity where nothing is hit; no noise
  cv::Mat surface;  ///< CV_16S, surface * 8 + face; −1: nothing, or the recording behind
  cv::Mat label;    ///< CV_8U, Label
  cv::Mat slant;    ///< CV_32F, cosine between the ray and the normal
  std::array<Sighting, 2> people;
};

/// A real recording behind the people; empty images without.
struct Backdrop {
  cv::Mat color;  ///< CV_8UC3
  cv::Mat depth;  ///< CV_32F, m, 0 = unknown (the person is drawn before it)
};

struct RenderOptions {
  double frame_s = 1.0 / 30;     ///< time over which label_moving judges
  double moving_m_per_s = 0.05;  ///< a surface point faster than this is moving
};

class Renderer {
 public:
  /// Renders surfaces (people among them) as seen by the camera: all rows, or some of them.
  void render(const Scene& scene, const std::vector<Surface>& surfaces, const ImageCamera& camera,
              const cfp::SE3<double>& T_world_cam, const Backdrop& backdrop, const RenderOptions& options, Frame& frame,
              cv::Range rows = cv::Range::all()) {
    if (rows == cv::Range::all()) rows = {0, camera.height};
    scene_ = &scene;
    surfaces_ = &surfaces;
    camera_ = camera;
    backdrop_ = &backdrop;
    prepare(T_world_cam);
    const cv::Size size(camera.width, camera.height);
    frame.color.create(size, CV_32FC3);
    frame.depth.create(size, CV_32F);
    frame.surface.create(size, CV_16S);
    frame.label.create(size, CV_8U);
    frame.slant.create(size, CV_32F);
    for (int tile_y = rows.start; tile_y < rows.end; tile_y += tile) {
      for (int tile_x = 0; tile_x < camera.width; tile_x += tile) {
        collect(tile_x, tile_y);
        for (int y = tile_y; y < std::min(tile_y + tile, rows.end); ++y) {
          for (int x = tile_x; x < std::min(tile_x + tile, camera.width); ++x) shade_pixel(x, y, options, frame);
        }
      }
    }
    smooth_edges(frame, rows);
    if (rows == cv::Range(0, camera.height)) describe_people(frame);
  }

 private:
  static constexpr int tile = 16;

  struct Prepared {
    Matrix3d A_cam;         ///< local direction = A_cam * ray
    Vector3d origin;        ///< the camera, locally
    double nearest;         ///< no hit has a smaller depth
    double x1, y1, x2, y2;  ///< image rectangle that holds it
  };
  struct Sample {
    Hit hit;
    int surface = -1;
  };

  void prepare(const cfp::SE3<double>& T_world_cam) {
    const cfp::SE3<double> T_cam_world = T_world_cam.inverse();
    rotation_ = T_world_cam.rotation;
    translation_ = T_world_cam.translation;
    prepared_.clear();
    for (const Surface& s : *surfaces_) {
      Prepared p{s.A * T_world_cam.rotation,         s.A * (T_world_cam.translation - s.centre), 0, 0, 0,
                 static_cast<double>(camera_.width), static_cast<double>(camera_.height)};
      if (s.shape != Shape::room) bound(s, T_cam_world, p);
      prepared_.push_back(p);
    }
    by_depth_.resize(prepared_.size());
    std::iota(by_depth_.begin(), by_depth_.end(), 0);
    std::stable_sort(by_depth_.begin(), by_depth_.end(), [&](int a, int b) { return at(a).nearest < at(b).nearest; });
  }

  /// From the corners of the box around the surface, when all lie before the camera.
  void bound(const Surface& s, const cfp::SE3<double>& T_cam_world, Prepared& p) const {
    const Matrix3d world_from_local = s.shape == Shape::box ? Matrix3d(s.A.transpose()) : Matrix3d(s.A.inverse());
    const Vector3d half = s.shape == Shape::box ? s.half : Vector3d(s.half.x(), s.half.x(), s.half.z() + s.half.x());
    const Vector3d middle = T_cam_world * s.centre;
    double radius = 0, nearest = infinity, x1 = infinity, y1 = infinity, x2 = -infinity, y2 = -infinity;
    for (int corner = 0; corner < 8; ++corner) {
      const Vector3d sign(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
      const Vector3d q = T_cam_world * Vector3d(s.centre + world_from_local * sign.cwiseProduct(half));
      radius = std::max(radius, (q - middle).norm());
      nearest = std::min(nearest, q.z());
      const double z = std::max(q.z(), 1e-3);
      x1 = std::min(x1, camera_.fx * q.x() / z + camera_.cx);
      x2 = std::max(x2, camera_.fx * q.x() / z + camera_.cx);
      y1 = std::min(y1, camera_.fy * q.y() / z + camera_.cy);
      y2 = std::max(y2, camera_.fy * q.y() / z + camera_.cy);
    }
    p.nearest = nearest;
    if (camera_.fisheye) {
      const cfp::Box<double> image = camera_.image_of(middle, radius);
      p = {p.A_cam, p.origin, nearest, image.x1, image.y1, image.x2, image.y2};
      return;
    }
    const double margin = 1 + camera_.most_bent_px();
    if (nearest > 0.01) p = {p.A_cam, p.origin, nearest, x1 - margin, y1 - margin, x2 + margin, y2 + margin};
  }

  /// Candidates of a tile; nearest first, so that a pixel can stop early.
  void collect(int tile_x, int tile_y) {
    candidates_.clear();
    for (const int i : by_depth_) {
      const Prepared& p = at(i);
      if (p.x2 >= tile_x && p.x1 <= tile_x + tile && p.y2 >= tile_y && p.y1 <= tile_y + tile) candidates_.push_back(i);
    }
  }
  [[nodiscard]] const Prepared& at(int i) const { return prepared_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] const Surface& surface(int i) const { return (*surfaces_)[static_cast<std::size_t>(i)]; }

  [[nodiscard]] Sample trace(const Vector3d& direction, double farthest) const {
    Sample best;
    best.hit.depth = farthest;
    for (const int i : candidates_) {
      if (at(i).nearest > best.hit.depth) break;
      const Hit h = hit(surface(i), at(i).origin, at(i).A_cam * direction);
      if (h.depth < best.hit.depth) best = {h, i};
    }
    return best;
  }

  [[nodiscard]] double behind(int x, int y) const {
    if (backdrop_->depth.empty()) return infinity;
    const float real = backdrop_->depth.at<float>(y, x);
    return real > 0 ? static_cast<double>(real) : infinity;
  }

  [[nodiscard]] Color backdrop_color(int x, int y) const {
    if (backdrop_->color.empty()) return Color::Zero();
    const cv::Vec3b& p = backdrop_->color.at<cv::Vec3b>(y, x);
    return {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
  }

  [[nodiscard]] Color shade(const Sample& sample, const Vector3d& direction, double* slant = nullptr) const {
    const Surface& s = surface(sample.surface);
    const Vector3d local = at(sample.surface).origin + sample.hit.depth * (at(sample.surface).A_cam * direction);
    const Vector3d n = normal_at(s, local, sample.hit.face);
    const double cosine = std::abs(n.dot(rotation_ * direction)) / direction.norm();
    if (slant != nullptr) *slant = cosine;
    // The pixel's footprint: depth / f across, longer along a slanted surface. The square root is between blur and
    // aliasing.
    const double footprint_m = sample.hit.depth / camera_.fx / std::sqrt(std::max(cosine, 0.1));
    const Eigen::Vector2d uv = texture_coordinates(s, local, sample.hit.face);
    const Color color =
        scene_->textures[static_cast<std::size_t>(s.texture)].sample(uv.x(), uv.y(), footprint_m / tile_size(s));
    // Two lamps and the light that comes from everywhere.
    static const Vector3d lamp_a = Vector3d(-0.4, -0.5, 0.75).normalized(),
                          lamp_b = Vector3d(0.7, 0.3, 0.5).normalized();
    const double light = 0.62 + 0.5 * std::max(0.0, n.dot(lamp_a)) + 0.25 * std::max(0.0, n.dot(lamp_b));
    return static_cast<float>(light) * color;
  }

  void shade_pixel(int x, int y, const RenderOptions& options, Frame& frame) const {
    const Vector3d direction = camera_.ray(x, y);
    const double limit = behind(x, y);
    const Sample sample = trace(direction, limit);
    Color color;
    double slant = 1;
    Label label = label_static;
    if (sample.surface >= 0) {
      color = shade(sample, direction, &slant);
      const Surface& s = surface(sample.surface);
      if (s.person >= 0) {
        const Vector3d local = at(sample.surface).origin + sample.hit.depth * (at(sample.surface).A_cam * direction);
        const Vector3d now = rotation_ * (sample.hit.depth * direction) + translation_;
        const Vector3d before = s.inverse_before * local + s.moved;
        label = (now - before).norm() > options.moving_m_per_s * options.frame_s ? label_moving : label_person_still;
      }
    } else {
      color = backdrop_color(x, y);
    }
    frame.color.at<cv::Vec3f>(y, x) = {color[0], color[1], color[2]};
    frame.depth.at<float>(y, x) = static_cast<float>(sample.hit.depth);
    frame.surface.at<short>(y, x) = static_cast<short>(sample.surface < 0 ? -1 : sample.surface * 8 + sample.hit.face);
    frame.label.at<unsigned char>(y, x) = label;
    frame.slant.at<float>(y, x) = static_cast<float>(slant);
  }

  /// Four more rays through every pixel that borders on another surface.
  void smooth_edges(Frame& frame, cv::Range rows) {
    for (int tile_y = rows.start; tile_y < rows.end; tile_y += tile) {
      for (int tile_x = 0; tile_x < camera_.width; tile_x += tile) {
        bool collected = false;
        for (int y = std::max(tile_y, rows.start + 1); y < std::min(tile_y + tile, rows.end - 1); ++y) {
          for (int x = std::max(tile_x, 1); x < std::min(tile_x + tile, camera_.width - 1); ++x) {
            const short here = frame.surface.at<short>(y, x);
            if (here == frame.surface.at<short>(y, x + 1) && here == frame.surface.at<short>(y + 1, x) &&
                here == frame.surface.at<short>(y, x - 1) && here == frame.surface.at<short>(y - 1, x)) {
              continue;
            }
            if (!collected) collect(tile_x, tile_y);
            collected = true;
            Color sum = Color::Zero();
            for (int sub = 0; sub < 4; ++sub) {
              const Vector3d direction = camera_.ray(x + (sub % 2 == 0 ? -0.25 : 0.25), y + (sub < 2 ? -0.25 : 0.25));
              const Sample sample = trace(direction, behind(x, y));
              sum += sample.surface >= 0 ? shade(sample, direction) : backdrop_color(x, y);
            }
            frame.color.at<cv::Vec3f>(y, x) = {sum[0] / 4, sum[1] / 4, sum[2] / 4};
          }
        }
      }
    }
  }

  /// Boxes from every pixel; the hidden part on a grid of every fourth one.
  void describe_people(Frame& frame) {
    std::array<int, 2> seen{}, there{};
    frame.people = {};
    for (int y = 0; y < camera_.height; ++y) {
      for (int x = 0; x < camera_.width; ++x) {
        const short id = frame.surface.at<short>(y, x);
        const int person = id < 0 ? -1 : surface(id / 8).person;
        const bool on_grid = x % 4 == 0 && y % 4 == 0;
        if (person >= 0) {
          Sighting& s = frame.people[static_cast<std::size_t>(person)];
          s.box = {std::min(s.box.x1, x * 1.0), std::min(s.box.y1, y * 1.0), std::max(s.box.x2, x + 1.0),
                   std::max(s.box.y2, y + 1.0)};
          ++s.pixels;
          if (on_grid) ++seen[static_cast<std::size_t>(person)];
        }
        if (on_grid) {
          const Vector3d direction = camera_.ray(x, y);
          std::array<bool, 2> hits{};
          for (std::size_t i = 0; i < prepared_.size(); ++i) {
            const int who = (*surfaces_)[i].person;
            const Prepared& p = prepared_[i];
            if (who < 0 || hits[static_cast<std::size_t>(who)] || x < p.x1 || x > p.x2 || y < p.y1 || y > p.y2)
              continue;
            hits[static_cast<std::size_t>(who)] = hit((*surfaces_)[i], p.origin, p.A_cam * direction).depth < infinity;
          }
          for (std::size_t who = 0; who < 2; ++who) there[who] += hits[who] ? 1 : 0;
        }
      }
    }
    for (std::size_t who = 0; who < 2; ++who) {
      Sighting& s = frame.people[who];
      s.visible = there[who] > 0 ? std::min(1.0, static_cast<double>(seen[who]) / there[who]) : 0;
      s.at_border =
          s.pixels > 0 && (s.box.x1 <= 0 || s.box.y1 <= 0 || s.box.x2 >= camera_.width || s.box.y2 >= camera_.height);
    }
  }

  const Scene* scene_ = nullptr;
  const std::vector<Surface>* surfaces_ = nullptr;
  const Backdrop* backdrop_ = nullptr;
  ImageCamera camera_;
  Matrix3d rotation_;
  Vector3d translation_;
  std::vector<Prepared> prepared_;
  std::vector<int> by_depth_;    ///< nearest first
  std::vector<int> candidates_;  ///< of the tile, nearest first
};

}  // namespace synthetic
