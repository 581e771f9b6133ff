// An observer of the loop that writes what it sees as text files: frames.txt, boxes.txt, keypoints.txt and, when asked,
// decisions.txt (README.md tells every column).
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <locale>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "../slam/loop/observer.hpp"
#include "../support/tum.hpp"
#include "decisions.hpp"

namespace cfp_slam {

// Milliseconds per module of the frame under way.
class Clock {
 public:
  void begin(Module m) { start_[std::size_t(m)] = std::chrono::steady_clock::now(); }
  void end(Module m) {
    const auto spent = std::chrono::steady_clock::now() - start_[std::size_t(m)];
    spent_ns_[std::size_t(m)] += std::chrono::duration_cast<std::chrono::nanoseconds>(spent).count();
  }
  // What was measured since the last call.
  double take_ms(Module m) { return 1e-6 * static_cast<double>(spent_ns_[std::size_t(m)].exchange(0)); }

 private:
  std::array<std::chrono::steady_clock::time_point, module_count> start_{};
  std::array<std::atomic<std::int64_t>, module_count> spent_ns_{};
};

// An output file, the same in every locale; numbers with all the digits of a float.
inline std::ofstream open_text(const std::filesystem::path& file, const char* columns) {
  std::ofstream out(file);
  out.imbue(std::locale::classic());
  out.precision(9);
  out << "# " << columns << '\n';
  if (!out) throw std::runtime_error("cannot write " + file.string());
  return out;
}

// What the notes of frames said, without their numbers, and in how many frames; of a file's lines the first in full.
struct Times {
  int count = 0;
  std::string first;
};
using Said = std::map<std::string, Times>;
inline void listen(const FrameRecord& record, Said& said) {
  for (std::size_t from = 0; from < record.note.size();) {
    const std::size_t to = std::min(record.note.find("; ", from), record.note.size());
    const std::string note = record.note.substr(from, to - from);
    const std::string what = note.substr(0, note.find(": "));
    const std::string file = what.substr(0, what.find_last_not_of("0123456789") + 1);  // with its colon, of file:line
    const bool of_file = file.size() < what.size() && !file.empty() && file.back() == ':';
    Times& times = said[of_file ? file.substr(0, file.size() - 1) : what];
    if (++times.count == 1 && of_file) times.first = note;
    from = to + 2;
  }
}
inline std::string text_of(const Said& said) {
  std::string text;
  for (const auto& [what, times] : said) {
    text += (text.empty() ? "" : "; ") + std::to_string(times.count) + "x " + what;
    if (!times.first.empty()) text += " (" + times.first + ")";
  }
  return text;
}

class RunWriter final : public Observer {
 public:
  // progress is called with the number of frames done. decisions: everything about every keypoint is written, too.
  RunWriter(const std::filesystem::path& folder, std::function<void(std::size_t)> progress, bool decisions = false)
      : folder_(folder),
        progress_(std::move(progress)),
        frames_(open_text(folder / "frames.txt", frame_columns().c_str())),
        boxes_(open_text(folder / "boxes.txt", "frame id x1 y1 x2 y2 compensated object_known O flow_pairs")),
        keypoints_(open_text(folder / "keypoints.txt", "frame x y size foreground K_coarse K_fine M weight")) {
    if (decisions) decisions_ = open_text(folder / "decisions.txt", decision_columns().c_str());
  }

  void begin(Module module) override { clock_.begin(module); }
  void end(Module module) override { clock_.end(module); }

  void weighted(const cfp::StageResult<float>& result, const cfp::FrameState<float>& state,
                const Frame& frame) override {
    health_ = result.report.health;
    if (result.report.stage == cfp::Stage::coarse) {
      for (std::size_t b = 0; b < state.boxes.size(); ++b) {
        const auto& box = state.boxes[b];
        const auto& object = state.objects[b];
        boxes_ << frame_ << ' ' << box.id << ' ' << box.box.x1 << ' ' << box.box.y1 << ' ' << box.box.x2 << ' '
               << box.box.y2 << ' ' << box.compensated() << ' ' << (object.status == cfp::Status::ok) << ' '
               << object.static_probability << ' ' << object.pairs << '\n';
      }
      for (std::size_t i = 0; i < frame.size(); ++i) {
        const bool foreground = state.label[i] == cfp::KeypointLabel::foreground;
        if (foreground || state.label[i] == cfp::KeypointLabel::background)
          inside_.push_back({i, frame.keypoints[i], foreground, state.static_probability[i], -1, -1, -1});
      }
      return;
    }
    for (Inside& k : inside_) {
      k.fine = state.static_probability[k.index];
      k.map_point = frame.map_point_probability[k.index];
      k.weight = result.weight[k.index];
    }
  }

  void decided(const cfp::StaticProbability<Camera>& probability, const Frame& frame, const Map& map) override {
    if (!decisions_.is_open()) return;
    const auto camera = cfp::undistorted_camera(probability.camera()).template cast<double>();
    for (std::size_t i = 0; i < frame.size(); ++i) {
      const bool mapped = map.is_alive(frame.map_point[i]);
      const cv::KeyPoint& seen = frame.keypoints[i];
      const float m = mapped ? map.point(frame.map_point[i]).static_probability : frame.map_point_probability[i];
      Decision d{frame_, seen.pt.x, seen.pt.y, seen.size, no_point, -1, {}};
      d.why = cfp::explain(i, m, probability.options(), probability.state());
      if (mapped && frame.has_pose) {
        d.map_point = frame.map_point[i];
        cfp::Vector2<double> pixel;
        if (camera.project(frame.T_cam_world * map.point(d.map_point).position, pixel))
          d.residual_px = std::hypot(float(pixel.x()) - frame.pixels[i][0], float(pixel.y()) - frame.pixels[i][1]);
      }
      decided_ += decision_line(d) + '\n';
    }
  }

  void finished(const FrameRecord& record) override {
    write_frame(record);
    decisions_ << decided_;
    decided_.clear();
    for (const Inside& k : inside_) {
      keypoints_ << frame_ << ' ' << k.keypoint.pt.x << ' ' << k.keypoint.pt.y << ' ' << k.keypoint.size << ' '
                 << k.foreground << ' ' << k.coarse << ' ' << k.fine << ' ' << k.map_point << ' ' << k.weight << '\n';
    }
    inside_.clear();
    health_ = {};
    listen(record, said_);
    progress_(++frame_);
  }

  // How often something was said, numbers left out.
  [[nodiscard]] const Said& said() const { return said_; }

  // Throws when something could not be written.
  void close() {
    const std::pair<std::ofstream*, const char*> files[] = {{&frames_, "frames.txt"},
                                                            {&boxes_, "boxes.txt"},
                                                            {&keypoints_, "keypoints.txt"},
                                                            {&decisions_, "decisions.txt"}};
    for (const auto& [file, name] : files) {
      const bool written = file->is_open();
      file->close();
      if (written && !*file) throw std::runtime_error("cannot write " + (folder_ / name).string());
    }
  }

 private:
  struct Inside {
    std::size_t index;
    cv::KeyPoint keypoint;
    bool foreground;
    float coarse, fine, map_point, weight;  // K, K, M; negative: none
  };

  static std::string frame_columns() {
    std::string columns =
        "timestamp image outcome keyframe keypoints matches inliers effective_points box_share fallback "
        "inlier_share spread position_sigma_m";
    for (std::size_t m = 0; m < module_count; ++m) {
      columns += ' ';
      for (const char* c = to_string(static_cast<Module>(m)); *c != '\0'; ++c) columns += *c == ' ' ? '_' : *c;
      columns += "_ms";
    }
    return columns + " # note";
  }

  void write_frame(const FrameRecord& f) {
    frames_ << cfp_examples::fixed(f.time_s, 6) << ' ' << f.image << ' ' << to_string(f.outcome) << ' ' << f.keyframe
            << ' ' << f.keypoints << ' ' << f.matches << ' ' << f.inliers << ' ' << health_.effective_points << ' '
            << health_.box_share << ' ' << (health_.fallback != cfp::WeightFallback::none) << ' ' << f.pose.inlier_share
            << ' ' << f.pose.spread << ' ' << (cfp::is_finite(f.pose.position_sigma_m) ? f.pose.position_sigma_m : -1);
    for (std::size_t m = 0; m < module_count; ++m) frames_ << ' ' << clock_.take_ms(static_cast<Module>(m));
    frames_ << (f.note.empty() ? "" : " # ") << f.note << '\n';
  }

  std::filesystem::path folder_;
  std::function<void(std::size_t)> progress_;
  Clock clock_;
  std::ofstream frames_, boxes_, keypoints_, decisions_;
  std::string decided_;         // lines of the frame under way
  std::vector<Inside> inside_;  // the keypoints in boxes of the frame under way
  cfp::FrameHealth health_;     // of its last weights
  std::size_t frame_ = 0;
  Said said_;
};

}  // namespace cfp_slam
