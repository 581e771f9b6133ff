// Reads the folder of a run, and of its recording the truth. Whatever is wrong with a file is thrown as
// std::runtime_error that says file and line.
#pragma once

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "../support/sequence.hpp"
#include "labels.hpp"
#include "run_record.hpp"

namespace cfp_slam {

namespace detail {

// visit(line, numbers of the words) for every line of a file of numbers.
template <typename Visit>
void for_each_row(const std::filesystem::path& file, std::size_t columns, const Visit& visit) {
  std::vector<double> v(columns);
  cfp_examples::for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    if (words.size() != columns) cfp_examples::bad_line(file, line, "expected " + std::to_string(columns) + " numbers");
    for (std::size_t i = 0; i < columns; ++i) v[i] = cfp_examples::parse_number(file, line, words[i], "figure");
    visit(line, v);
  });
}

// `key value` lines.
inline std::map<std::string, std::string> read_settings(const std::filesystem::path& file) {
  std::map<std::string, std::string> settings;
  std::ifstream stream(file);
  for (std::string line; std::getline(stream, line);) {
    const std::size_t blank = line.find(' ');
    if (blank != std::string::npos) settings[line.substr(0, blank)] = line.substr(blank + 1);
  }
  return settings;
}

inline void read_frames(const std::filesystem::path& file, RunRecord& run) {
  std::vector<std::string> notes;  // what stands behind # is a comment to for_each_line
  std::ifstream stream(file);
  for (std::string text; std::getline(stream, text);) {
    const std::size_t note = text.find(" # ");
    notes.push_back(note == std::string::npos || text[0] == '#' ? "" : text.substr(note + 3));
  }
  cfp_examples::for_each_line(file, [&](int line, const std::vector<std::string>& words) {
    constexpr std::size_t fixed = 13;
    if (words.size() != fixed + module_count) cfp_examples::bad_line(file, line, "not the columns of this version");
    const auto number = [&](std::size_t i) { return cfp_examples::parse_number(file, line, words[i], "figure"); };
    const auto count = [&](std::size_t i) { return cfp_examples::parse_count(file, line, words[i], "figure"); };
    RunFrame f;
    f.time_s = number(0);
    f.image = words[1];
    int outcome = 0;
    while (outcome < 4 && words[2] != to_string(static_cast<Outcome>(outcome))) ++outcome;
    if (outcome == 4) cfp_examples::bad_line(file, line, "'" + words[2] + "' is no outcome");
    f.outcome = static_cast<Outcome>(outcome);
    f.keyframe = number(3) != 0;
    f.keypoints = count(4);
    f.matches = count(5);
    f.inliers = count(6);
    f.health.effective_points = number(7);
    f.health.box_share = number(8);
    f.fallback = number(9) != 0;
    f.pose.inlier_share = number(10);
    f.pose.spread = number(11);
    f.pose.position_sigma_m = number(12);
    for (std::size_t m = 0; m < module_count; ++m) f.milliseconds[m] = number(fixed + m);
    f.note = notes[static_cast<std::size_t>(line) - 1];
    run.frames.push_back(f);
  });
}

inline RunFrame& frame_at(RunRecord& run, const std::filesystem::path& file, int line, double index) {
  if (!(index >= 0 && index < static_cast<double>(run.frames.size())))
    cfp_examples::bad_line(file, line, "no such frame");
  return run.frames[static_cast<std::size_t>(index)];
}

}  // namespace detail

// A finished run. The recording must still be where it was, for its truth.
inline RunRecord read_run(const std::filesystem::path& folder) {
  const auto settings = detail::read_settings(folder / "run.txt");
  const auto value = [&](const char* key) {
    const auto at = settings.find(key);
    if (at == settings.end()) throw std::runtime_error((folder / "run.txt").string() + ": no " + key);
    return at->second;
  };
  const auto number = [&](const char* key) {
    return cfp_examples::parse_count(folder / "run.txt", 0, value(key), key);
  };
  RunRecord run;
  run.recording = value("recording");
  run.sequence = folder.parent_path().filename().string();
  run.variant = value("variant");
  run.detector = value("detector");
  run.options = settings.count("options") > 0 ? value("options") : "none";
  const std::string seed = value("seed");
  const char* const end = seed.data() + seed.size();
  if (const auto read = std::from_chars(seed.data(), end, run.seed); read.ec != std::errc() || read.ptr != end)
    throw std::runtime_error((folder / "run.txt").string() + ": '" + seed + "' is no seed");
  run.features = static_cast<int>(number("features"));
  run.keyframes = number("keyframes");
  run.map_points = number("map_points");
  detail::read_frames(folder / "frames.txt", run);

  const auto poses = cfp_examples::read_tum_trajectory(folder / "trajectory.txt");
  std::size_t pose = 0;
  for (RunFrame& frame : run.frames) {
    if (frame.outcome > Outcome::relocalised) continue;
    if (pose < poses.size() && std::abs(poses[pose].time_s - frame.time_s) < 1e-5) {
      frame.T_world_cam = poses[pose++].T_world_cam;
    } else if (frame.outcome == Outcome::relocalised) {
      frame.outcome = Outcome::lost;  // taken back later
    } else {
      throw std::runtime_error((folder / "trajectory.txt").string() + ": poses are missing");
    }
  }
  const auto boxes = folder / "boxes.txt", keypoints = folder / "keypoints.txt";
  detail::for_each_row(boxes, 10, [&](int line, const std::vector<double>& v) {
    if (!(std::abs(v[1]) <= 0x1p53 && v[9] >= 0 && v[9] <= 0x1p53))
      cfp_examples::bad_line(boxes, line, "no such id or count");
    detail::frame_at(run, boxes, line, v[0])
        .boxes.push_back({static_cast<std::int64_t>(v[1]),
                          {float(v[2]), float(v[3]), float(v[4]), float(v[5])},
                          v[6] != 0,
                          v[8],
                          v[7] != 0,
                          static_cast<std::size_t>(v[9])});
  });
  detail::for_each_row(keypoints, 9, [&](int line, const std::vector<double>& v) {
    detail::frame_at(run, keypoints, line, v[0])
        .box_keypoints.push_back(
            {float(v[1]), float(v[2]), float(v[3]), v[4] != 0, float(v[5]), float(v[6]), float(v[7]), float(v[8])});
  });

  const cfp_examples::Sequence sequence(run.recording);
  run.truth = sequence.truth();
  evaluate(run);
  for (std::size_t k = 0; k < std::min(run.frames.size(), sequence.size()); ++k) {
    std::string note;
    if (const cv::Mat labels = sequence.load_labels(k, note); !labels.empty()) add_samples(run.frames[k], labels, run);
    if (!note.empty()) run.notes.push_back(note);
  }
  return run;
}

// The finished runs below a folder that cfp_slam wrote, sequence by sequence, in the order of names.
inline std::vector<std::filesystem::path> run_folders(const std::filesystem::path& out) {
  std::vector<std::filesystem::path> found;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(out)) {
    if (entry.path().filename() == "run.txt") found.push_back(entry.path().parent_path());
  }
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace cfp_slam
