// A run of the loop in a folder of its own: where that is, whether it is done, and doing it.
#pragma once

#include <algorithm>
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
#include <vector>

#include "../slam/loop/run.hpp"
#include "../support/tum.hpp"
#include "../support/variant.hpp"
#include "../support/write_text.hpp"
#include "options_file.hpp"
#include "run_writer.hpp"

namespace cfp_slam {

// What decides a run's figures. Two runs with the same settings are the same run.
struct RunSettings {
  std::string recording, detector, variant = "cfp";  // the recording's whole path; the detector as make_detector has it
  std::uint64_t seed = 1;
  std::size_t frames = 0;  // 0: all
  int features = 1000;
  double min_score = 0;
  OptionValues options;    // other than the defaults
  bool decisions = false;  // everything about every keypoint is written; no figure depends on it

  [[nodiscard]] std::string text() const {
    std::ostringstream out;
    out.imbue(std::locale::classic());
    out.precision(17);
    out << "recording " << recording << "\ndetector " << detector << "\nvariant " << variant << "\nseed " << seed
        << "\nframes " << frames << "\nfeatures " << features << "\nmin_score " << min_score << "\noptions "
        << options_text(options) << '\n';
    return out.str();
  }
};

inline std::string file_text(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

// Folders that are recordings, or hold some: the recordings, whole paths.
inline std::vector<std::filesystem::path> recordings(const std::vector<std::string>& folders) {
  std::vector<std::filesystem::path> found;
  for (const std::filesystem::path folder : folders) {
    std::vector<std::filesystem::path> inside;
    if (std::filesystem::exists(folder / "rgb.txt")) inside.push_back(folder);
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      if (std::filesystem::exists(entry.path() / "rgb.txt")) inside.push_back(entry.path());
    }
    if (inside.empty()) throw std::runtime_error(folder.string() + ": neither a recording (rgb.txt) nor some in it");
    std::sort(inside.begin(), inside.end());
    for (const std::filesystem::path& recording : inside) found.push_back(std::filesystem::canonical(recording));
  }
  return found;
}

// OUT/<recording's name>/<variant>_<seed>. A second recording whose folder has the same name gets <name>_2, and so on:
// recording.txt says whose a folder is.
inline std::filesystem::path run_folder(const std::filesystem::path& out, const RunSettings& settings) {
  for (int n = 1;; ++n) {
    const std::string name = cfp_examples::folder_name(settings.recording) + (n > 1 ? "_" + std::to_string(n) : "");
    const std::filesystem::path folder = out / name;
    if (!std::filesystem::exists(folder / "recording.txt")) {
      cfp_examples::write_text(folder / "recording.txt", settings.recording);
    }
    if (file_text(folder / "recording.txt") == settings.recording)
      return folder / (settings.variant + "_" + std::to_string(settings.seed));
  }
}

// Whether the folder holds a whole run with these settings.
inline bool is_done(const std::filesystem::path& folder, const RunSettings& settings) {
  return file_text(folder / "run.txt").rfind(settings.text(), 0) == 0 &&
         (!settings.decisions || std::filesystem::exists(folder / "decisions.txt"));
}

// The loop's options of a run.
inline Options options_of(const RunSettings& settings, bool threads) {
  Options options;
  for (const auto& [name, value] : settings.options) set_option(options, name, value);
  options.variant = cfp_examples::variant_of(settings.variant);
  options.seed = settings.seed;
  options.threads = threads;
  options.max_frames = settings.frames;
  options.features.count = settings.features;
  return options;
}

// Runs the loop and writes its files. An interrupted run has no run.txt. Returns what went wrong on the way, in words.
inline std::string run_into(const std::filesystem::path& folder, const cfp_examples::Sequence& sequence,
                            cfp_examples::Detector& detector, const RunSettings& settings, bool threads,
                            const std::function<void(std::size_t)>& progress) {
  std::filesystem::create_directories(folder);
  for (const char* old : {"run.txt", "decisions.txt"}) std::filesystem::remove(folder / old);
  RunWriter writer(folder, progress, settings.decisions);
  const Options options = options_of(settings, threads);
  const RunResult result = run_slam(sequence, detector, options, writer);
  writer.close();
  {
    std::ofstream out = open_text(folder / "trajectory.txt", "timestamp tx ty tz qx qy qz qw");
    for (std::size_t p = 0; p < result.trajectory.size(); ++p) {
      if (p > 0 && result.world[p] != result.world[p - 1])
        out << "# cut: the poses from here to the next cut are in world " << result.world[p] << '\n';
      out << cfp_examples::tum_line(result.trajectory[p]) << '\n';
    }
    if (!out.flush()) throw std::runtime_error("cannot write " + (folder / "trajectory.txt").string());
  }
  cfp_examples::write_text(folder / "run.txt", settings.text() + "keyframes " + std::to_string(result.keyframes) +
                                                   "\nmap_points " + std::to_string(result.map_points) + '\n');
  std::string text = text_of(writer.said());
  const auto add = [&](const std::string& what) { text += (text.empty() || what.empty() ? "" : "; ") + what; };
  if (result.trajectory.empty()) add("no frame has a pose");
  if (cfp::variant_options(options.variant, options.probability).use_boxes) add(detector.complaint());
  return text;
}

}  // namespace cfp_slam
