// One sequence: who does what before which camera; renders any frame of it, and writes the folder.
#pragma once

#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include <Eigen/Geometry>

#include "../support/tum.hpp"
#include "camera_motion.hpp"
#include "detector.hpp"
#include "people.hpp"
#include "sensor.hpp"

namespace synthetic {

enum class Scenario { sitting, walking, rising };
inline constexpr std::array<const char*, 3> scenario_names{"sitting", "walking", "rising"};

struct SequenceOptions {
  Scenario scenario = Scenario::walking;
  Motion motion = Motion::xyz;
  int frames = 300;
  double rate_hz = 30;
  std::uint64_t seed = 1;
  int people = 2;             ///< of the two; 0: an empty room
  bool close_up = false;      ///< they fill the view
  bool furniture = false;     ///< stands before them
  int blur_samples = 1;       ///< sub-exposures; 1: no motion blur
  double exposure_s = 0.012;  ///< over which they are spread
  double readout_s = 0;       ///< rolling shutter: from the first row to the last; the stamp is that of the middle
  double depth_late_s = 0;    ///< the depth image is taken so much later than the colour image of its stamp
  double focal_error = 0;     ///< camera.txt says that the focal lengths are (1 + this) times what they are
  ImageCamera camera = default_camera(640);
  RenderOptions render;
  SensorOptions sensor;
  DetectorOptions detector;

  /// TUM fr3's intrinsics, scaled to a width (4:3).
  static ImageCamera default_camera(int width) {
    ImageCamera c;
    const double s = width / 640.0;
    c.fx = 535.4 * s;
    c.fy = 539.2 * s;
    c.cx = (320.1 + 0.5) * s - 0.5;
    c.cy = (247.6 + 0.5) * s - 0.5;
    c.width = width;
    c.height = width * 3 / 4;
    return c;
  }
  /// The lens of TUM-VI's cameras with 122 degrees from left to right.
  static ImageCamera fisheye_camera(int width) {
    ImageCamera c = default_camera(width);
    c.fx = c.fy = 300 * width / 640.0;
    c.fisheye = {c.fx, c.fy, c.cx, c.cy, 0.0034824, 0.00071503, -0.0020532, 0.00020294};
    return c;
  }
};

/// A real recording with poses that stands behind the people instead of the room.
struct Recording {
  struct View {
    double time_s;
    std::filesystem::path color, depth;
    cfp::SE3<double> T_world_cam;  ///< as recorded
    cfp::SE3<double> T_stage_cam;  ///< in the frame of scene.hpp, where the people are
  };
  std::vector<View> views;
  ImageCamera camera;
  double depth_units_per_metre = 5000;
};

struct RenderedFrame {
  Frame truth;
  cv::Mat color, depth, label;  ///< CV_8UC3, CV_16U, CV_8U as written
};

class Sequence {
 public:
  explicit Sequence(const SequenceOptions& options, std::shared_ptr<const Recording> recording = nullptr)
      : options_(options),
        recording_(std::move(recording)),
        normal_(options.seed),
        motion_(options.motion, options.seed) {
    const Stage stage = arranged();
    if (recording_ != nullptr) {
      options_.camera = recording_->camera;
      options_.sensor.depth_units_per_metre = recording_->depth_units_per_metre;
      options_.frames = std::min(options_.frames, static_cast<int>(recording_->views.size()));
    }
    scene_ = SceneBuilder(options_.seed).build(stage);
    const double seconds =
        recording_ != nullptr ? time_of(options_.frames) + 1 : options_.frames / options_.rate_hz + 1;
    for (int person = 0; person < 2; ++person) {
      cfp::Random random(options_.seed, person == 0 ? "first person" : "second person");
      const Scenario scenario = options_.scenario;
      scripts_[person] = scenario == Scenario::sitting  ? sitting_script(random, person, seconds, stage)
                         : scenario == Scenario::rising ? rising_script(person, seconds, stage)
                         : options_.close_up            ? close_up_script(random, person, seconds, stage, motion_)
                                                        : walking_script(random, person, seconds, stage);
    }
    if (!stage.room && options_.scenario == Scenario::walking) scene_.surfaces.clear();  // nobody sits: no chairs
  }

  [[nodiscard]] const SequenceOptions& options() const { return options_; }
  /// Seconds since the first frame.
  [[nodiscard]] double time_of(int frame) const {
    if (recording_ == nullptr) return frame / options_.rate_hz;
    const auto last = recording_->views.size() - 1;
    return recording_->views[std::min(static_cast<std::size_t>(frame), last)].time_s - recording_->views[0].time_s;
  }
  [[nodiscard]] double stamp_of(int frame) const {
    return (recording_ == nullptr ? 1000.0 : recording_->views[0].time_s) + time_of(frame);
  }
  /// The camera in the frame of scene.hpp.
  [[nodiscard]] cfp::SE3<double> T_stage_cam(int frame) const {
    return recording_ == nullptr ? motion_(time_of(frame))
                                 : recording_->views[static_cast<std::size_t>(frame)].T_stage_cam;
  }
  /// The camera as groundtruth.txt has it: a recording keeps its own world.
  [[nodiscard]] cfp::SE3<double> T_world_cam(int frame) const {
    return recording_ == nullptr ? motion_(time_of(frame))
                                 : recording_->views[static_cast<std::size_t>(frame)].T_world_cam;
  }
  [[nodiscard]] double rotation_rate(int frame) const {
    const int other = frame == 0 ? std::min(1, options_.frames - 1) : frame - 1;
    const double dt = std::max(1e-3, std::abs(time_of(frame) - time_of(other)));
    return cfp::so3_log((T_world_cam(other).inverse() * T_world_cam(frame)).rotation).norm() / dt;
  }
  /// Everything in the scene at a time, people last.
  [[nodiscard]] std::vector<Surface> surfaces_at(double time) const {
    std::vector<Surface> surfaces = scene_.surfaces;
    for (int person = 0; person < options_.people; ++person)
      append_person(scene_, scripts_[person], person, time, options_.render.frame_s, surfaces);
    return surfaces;
  }

  /// A pure function of the options and the frame's number.
  void render(int frame, Renderer& renderer, RenderedFrame& out) const {
    const double time = time_of(frame);
    Backdrop backdrop;
    if (recording_ != nullptr) backdrop = load(recording_->views[static_cast<std::size_t>(frame)]);
    const std::vector<Surface> surfaces = surfaces_at(time);
    renderer.render(scene_, surfaces, options_.camera, T_stage_cam(frame), backdrop, options_.render, out.truth);
    const bool is_rendered = recording_ == nullptr;  // not put into a recording, which has errors of its own
    if (options_.readout_s > 0 && is_rendered)
      roll(time, renderer, out.truth);
    else if (options_.blur_samples > 1 && is_rendered)
      blur(time, {0, options_.camera.height}, renderer, out.truth);
    double people = 0;
    for (const Sighting& s : out.truth.people) people += s.pixels;
    people /= static_cast<double>(out.truth.depth.total());
    const cfp::Random random(options_.seed * 1000003 + static_cast<std::uint64_t>(frame), "sensor");
    const double gain = exposure(options_.sensor, time, people);
    out.depth = options_.depth_late_s != 0 && is_rendered
                    ? late_depth(std::max(0.0, time + options_.depth_late_s), renderer, random)
                    : sense_depth(out.truth, surfaces, options_.sensor, normal_, random);
    out.color = sense_color(out.truth, options_.sensor, gain, normal_, cfp::Random(cfp::Random(random)()));
    out.label = out.truth.label;
  }

 private:
  [[nodiscard]] Stage arranged() const {
    Stage stage;
    stage.room = recording_ == nullptr;
    stage.furniture = options_.furniture;
    if (options_.furniture) {
      stage.lanes[0] = -1.72;
      stage.lanes[1] = -1.45;
      stage.front = -1.8;
    }
    const bool rising = options_.scenario == Scenario::rising;
    if (rising || (options_.close_up && options_.scenario == Scenario::sitting)) {
      const double x = rising ? 0.27 : 0.32, y = options_.furniture ? -1.75 : rising ? -2.3 : -2.07;
      stage.chairs[0] = {-x, y, 1.45};
      stage.chairs[1] = {x, y, 3.14159265358979 - 1.45};
    }
    return stage;
  }

  /// Some rows at a time, and beside them those that their edges are smoothed with.
  void render_rows(double time, cv::Range rows, Renderer& renderer, Frame& frame) const {
    const cv::Range seen(std::max(rows.start - 1, 0), std::min(rows.end + 1, options_.camera.height));
    renderer.render(scene_, surfaces_at(time), options_.camera, motion_(time), {}, options_.render, frame, seen);
  }

  void blur(double time, cv::Range rows, Renderer& renderer, Frame& truth) const {
    cv::Mat sum = cv::Mat::zeros(rows.size(), truth.color.cols, CV_32FC3);
    Frame part;
    for (int k = 0; k < options_.blur_samples; ++k) {
      const double at = std::max(0.0, time + options_.exposure_s * ((k + 0.5) / options_.blur_samples - 0.5));
      render_rows(at, rows, renderer, part);
      sum += part.color.rowRange(rows);
    }
    cv::Mat(sum / options_.blur_samples).copyTo(truth.color.rowRange(rows));
  }

  /// Every band of rows at its own time. What is seen of the people stays that of the middle.
  void roll(double time, Renderer& renderer, Frame& truth) const {
    constexpr int band = 4;
    const int height = options_.camera.height;
    Frame part;
    for (int y = 0; y < height; y += band) {
      const double at = std::max(0.0, time + options_.readout_s * ((y + 0.5 * band) / height - 0.5));
      const cv::Range rows(y, std::min(y + band, height));
      render_rows(at, rows, renderer, part);
      for (cv::Mat Frame::*image : {&Frame::color, &Frame::depth, &Frame::surface, &Frame::label, &Frame::slant})
        (part.*image).rowRange(rows).copyTo((truth.*image).rowRange(rows));
      if (options_.blur_samples > 1) blur(at, rows, renderer, truth);
    }
  }

  [[nodiscard]] cv::Mat late_depth(double time, Renderer& renderer, const cfp::Random& random) const {
    Frame later;
    const std::vector<Surface> surfaces = surfaces_at(time);
    renderer.render(scene_, surfaces, options_.camera, motion_(time), {}, options_.render, later);
    return sense_depth(later, surfaces, options_.sensor, normal_, random);
  }

  [[nodiscard]] Backdrop load(const Recording::View& view) const {
    Backdrop b;
    b.color = cv::imread(view.color.string(), cv::IMREAD_COLOR);
    const cv::Mat depth = cv::imread(view.depth.string(), cv::IMREAD_UNCHANGED);
    const cv::Size size(options_.camera.width, options_.camera.height);
    if (b.color.empty()) throw std::runtime_error("cannot read the image " + view.color.string());
    if (depth.empty() || depth.type() != CV_16U)
      throw std::runtime_error("cannot read a 16-bit depth image from " + view.depth.string());
    if (b.color.size() != size || depth.size() != size)
      throw std::runtime_error(view.color.string() + ": size differs from camera.txt");
    depth.convertTo(b.depth, CV_32F, 1 / recording_->depth_units_per_metre);
    return b;
  }

  SequenceOptions options_;
  std::shared_ptr<const Recording> recording_;
  NormalTable normal_;
  CameraMotion motion_;
  Scene scene_;
  Script scripts_[2];
};

/// Reads rgb.txt, depth.txt, groundtruth.txt (or pseudo_groundtruth.txt) and camera.txt. Frames without depth or pose
/// within 20 ms are left out. The stage is put before the first camera: `camera_height_m` above the floor, looking the
/// way it looks on average, upright along the mean −y axis of the cameras (nobody films upside down).
inline Recording read_recording(const std::filesystem::path& folder, double camera_height_m) {
  Recording recording;
  const cfp_examples::TumCamera camera = cfp_examples::read_tum_camera(folder / "camera.txt");
  recording.camera.fx = camera.fx;
  recording.camera.fy = camera.fy;
  recording.camera.cx = camera.cx;
  recording.camera.cy = camera.cy;
  if (camera.fisheye) recording.camera.fisheye = std::get<cfp::KannalaBrandtCamera<double>>(camera.camera().model);
  recording.camera.width = camera.width;
  recording.camera.height = camera.height;
  recording.depth_units_per_metre = camera.depth_units_per_metre;
  const bool pseudo = !std::filesystem::exists(folder / "groundtruth.txt");
  const auto poses =
      cfp_examples::read_tum_trajectory(folder / (pseudo ? "pseudo_groundtruth.txt" : "groundtruth.txt"));
  const auto colors = cfp_examples::read_tum_list(folder / "rgb.txt"),
             depths = cfp_examples::read_tum_list(folder / "depth.txt");
  // Lists and trajectory are all stamped; the association of the evaluation does for both.
  const auto stamped = [](const std::vector<cfp_examples::TumImage>& images) {
    std::vector<cfp::StampedPose<double>> stamps;
    for (const auto& image : images) stamps.push_back({image.time_s, {}});
    return stamps;
  };
  const auto with_depth = cfp::associate(stamped(colors), stamped(depths)),
             with_pose = cfp::associate(stamped(colors), poses);
  for (std::size_t i = 0, j = 0; i < with_depth.size(); ++i) {
    while (j < with_pose.size() && colors[with_pose[j].first].time_s < colors[with_depth[i].first].time_s) ++j;
    if (j == with_pose.size() || with_pose[j].first != with_depth[i].first) continue;
    recording.views.push_back({colors[with_depth[i].first].time_s,
                               folder / colors[with_depth[i].first].file,
                               folder / depths[with_depth[i].second].file,
                               poses[with_pose[j].second].T_world_cam,
                               {}});
  }
  if (recording.views.empty()) throw std::runtime_error(folder.string() + ": no frame with colour, depth and pose");
  Eigen::Vector3d up = Eigen::Vector3d::Zero(), forward = Eigen::Vector3d::Zero();
  for (const auto& view : recording.views) {
    up -= view.T_world_cam.rotation.col(1);
    forward += view.T_world_cam.rotation.col(2);
  }
  up.normalize();
  forward = (forward - forward.dot(up) * up).normalized();
  cfp::SE3<double> T_stage_world;
  T_stage_world.rotation.row(0) = forward.cross(up).transpose();
  T_stage_world.rotation.row(1) = forward.transpose();
  T_stage_world.rotation.row(2) = up.transpose();
  T_stage_world.translation =
      Eigen::Vector3d(0, -2.95, camera_height_m) - T_stage_world.rotation * recording.views[0].T_world_cam.translation;
  for (auto& view : recording.views) view.T_stage_cam = T_stage_world * view.T_world_cam;
  return recording;
}

}  // namespace synthetic
