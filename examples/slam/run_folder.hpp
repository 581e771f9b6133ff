// What a run leaves behind, as text files in a folder of its own (README.md tells every column): trajectory.txt,
// frames.txt, boxes.txt, keypoints.txt and, when all is done, run.txt with the settings and the figures of the whole.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <locale>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "../support/tum.hpp"
#include "loop/run.hpp"

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

class RunWriter final : public Observer {
 public:
  // progress is called with the number of frames done.
  RunWriter(const std::filesystem::path& folder, std::function<void(std::size_t)> progress)
      : progress_(std::move(progress)),
        frames_(open_text(folder / "frames.txt", frame_columns().c_str())),
        boxes_(open_text(folder / "boxes.txt", "frame id x1 y1 x2 y2 compensated object_known O flow_pairs")),
        keypoints_(open_text(folder / "keypoints.txt", "frame x y size foreground K_coarse K_fine M")) {}

  void begin(Module module) override { clock_.begin(module); }
  void end(Module module) override { clock_.end(module); }

  void weighted(const cfp::StageResult<float>& result, const cfp::FrameState<float>& state,
                const Frame& frame) override {
    if (result.report.stage == cfp::Stage::coarse) {
      for (std::size_t i = 0; i < frame.size(); ++i) {
        const bool foreground = state.label[i] == cfp::KeypointLabel::foreground;
        if (foreground || state.label[i] == cfp::KeypointLabel::background)
          inside_.push_back({i, frame.keypoints[i], foreground, result.static_probability[i], -1, -1});
      }
      return;
    }
    for (Inside& k : inside_) {
      k.fine = result.static_probability[k.index];
      k.map_point = frame.map_point_probability[k.index];
    }
  }

  void finished(const FrameRecord& record) override {
    write_frame(record);
    for (const BoxRecord& b : record.boxes) {
      boxes_ << frame_ << ' ' << b.id << ' ' << b.box.x1 << ' ' << b.box.y1 << ' ' << b.box.x2 << ' ' << b.box.y2 << ' '
             << b.compensated << ' ' << b.object_known << ' ' << b.object_probability << ' ' << b.flow_pairs << '\n';
    }
    for (const Inside& k : inside_) {
      keypoints_ << frame_ << ' ' << k.keypoint.pt.x << ' ' << k.keypoint.pt.y << ' ' << k.keypoint.size << ' '
                 << k.foreground << ' ' << k.coarse << ' ' << k.fine << ' ' << k.map_point << '\n';
    }
    inside_.clear();
    progress_(++frame_);
  }

  // Throws when something could not be written.
  void close() {
    for (std::ofstream* file : {&frames_, &boxes_, &keypoints_}) {
      file->close();
      if (!*file) throw std::runtime_error("cannot write all figures of the run");
    }
  }

 private:
  struct Inside {
    std::size_t index;
    cv::KeyPoint keypoint;
    bool foreground;
    float coarse, fine, map_point;  // K, K, M; negative: none
  };

  static std::string frame_columns() {
    std::string columns =
        "timestamp image outcome keyframe keypoints matches inliers effective_points box_share fallback";
    for (std::size_t m = 0; m < module_count; ++m) {
      columns += ' ';
      for (const char* c = to_string(static_cast<Module>(m)); *c != '\0'; ++c) columns += *c == ' ' ? '_' : *c;
      columns += "_ms";
    }
    return columns + " # note";
  }

  void write_frame(const FrameRecord& f) {
    frames_ << cfp_examples::fixed_text(f.time_s, 6) << ' ' << f.image << ' ' << to_string(f.outcome) << ' '
            << f.keyframe << ' ' << f.keypoints << ' ' << f.matches << ' ' << f.inliers << ' '
            << f.health.effective_points << ' ' << f.health.box_share << ' '
            << (f.health.fallback != cfp::WeightFallback::none);
    for (std::size_t m = 0; m < module_count; ++m) frames_ << ' ' << clock_.take_ms(static_cast<Module>(m));
    frames_ << (f.note.empty() ? "" : " # ") << f.note << '\n';
  }

  std::function<void(std::size_t)> progress_;
  Clock clock_;
  std::ofstream frames_, boxes_, keypoints_;
  std::vector<Inside> inside_;  // the keypoints in boxes of the frame under way
  std::size_t frame_ = 0;
};

// What decides a run's figures. Two runs with the same settings are the same run.
struct RunSettings {
  std::string recording, detector, variant = "cfp";  // the recording's whole path; the detector as make_detector has it
  std::uint64_t seed = 1;
  std::size_t frames = 0;  // 0: all
  int features = 1000;
  double min_score = 0;

  [[nodiscard]] std::string text() const {
    std::ostringstream out;
    out.imbue(std::locale::classic());
    out.precision(17);
    out << "recording " << recording << "\ndetector " << detector << "\nvariant " << variant << "\nseed " << seed
        << "\nframes " << frames << "\nfeatures " << features << "\nmin_score " << min_score << '\n';
    return out.str();
  }
};

inline cfp::Variant variant_of(const std::string& name) {
  for (int v = 0; v <= static_cast<int>(cfp::Variant::plain); ++v) {
    if (name == cfp::to_string(static_cast<cfp::Variant>(v))) return static_cast<cfp::Variant>(v);
  }
  throw std::runtime_error("no variant '" + name + "': cfp, cfp-minus, no-mdc, no-dbscan, no-ksp, only-boxes, plain");
}

inline std::string file_text(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

// OUT/<recording's name>/<variant>_<seed>. A second recording whose folder has the same name gets <name>_2, and so on:
// recording.txt says whose a folder is.
inline std::filesystem::path run_folder(const std::filesystem::path& out, const RunSettings& settings) {
  for (int n = 1;; ++n) {
    const std::string name = cfp_examples::folder_name(settings.recording) + (n > 1 ? "_" + std::to_string(n) : "");
    const std::filesystem::path folder = out / name;
    if (!std::filesystem::exists(folder / "recording.txt")) {
      std::filesystem::create_directories(folder);
      std::ofstream(folder / "recording.txt", std::ios::binary) << settings.recording;
    }
    if (file_text(folder / "recording.txt") == settings.recording)
      return folder / (settings.variant + "_" + std::to_string(settings.seed));
  }
}

// Whether the folder holds a whole run with these settings.
inline bool is_done(const std::filesystem::path& folder, const RunSettings& settings) {
  return file_text(folder / "run.txt").rfind(settings.text(), 0) == 0;
}

// Runs the loop and writes its files. An interrupted run has no run.txt.
inline void run_into(const std::filesystem::path& folder, const cfp_examples::Sequence& sequence,
                     cfp_examples::Detector& detector, const RunSettings& settings, bool threads,
                     const std::function<void(std::size_t)>& progress) {
  RunOptions options;
  options.variant = variant_of(settings.variant);
  options.seed = settings.seed;
  options.threads = threads;
  options.max_frames = settings.frames;
  options.front_end.features.count = settings.features;
  options.front_end.features.candidates = 3 * settings.features;
  std::filesystem::create_directories(folder);
  std::filesystem::remove(folder / "run.txt");
  RunWriter writer(folder, progress);
  const RunResult result = run_slam(sequence, detector, options, writer);
  writer.close();
  {
    std::ofstream out = open_text(folder / "trajectory.txt", "timestamp tx ty tz qx qy qz qw");
    for (const auto& pose : result.trajectory) out << cfp_examples::tum_line(pose) << '\n';
    if (!out.flush()) throw std::runtime_error("cannot write " + (folder / "trajectory.txt").string());
  }
  std::ofstream out(folder / "run.txt", std::ios::binary);
  out << settings.text() << "keyframes " << result.keyframes << "\nmap_points " << result.map_points << '\n';
  if (!out.flush()) throw std::runtime_error("cannot write " + (folder / "run.txt").string());
}

}  // namespace cfp_slam
