// A thin RGB-D SLAM system around cfp: see README.md beside this file.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <opencv2/core.hpp>

#include "../detection/detector.hpp"
#include "../support/progress.hpp"
#include "run_folder.hpp"

namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::vector<std::string> folders, variants = {"plain", "cfp"};
  std::string detector = "auto";
  fs::path out = "slam_out";
  std::size_t frames = 0;
  std::uint64_t seed = 1, seeds = 1;
  int features = 1000, threads = 2;
  double min_score = 0;
  bool resume = false;
};

void add_options(CLI::App& run, Arguments& a) {
  run.add_option("folders", a.folders, "recordings in TUM format (rgb.txt, depth.txt, camera.txt, ...), or of such")
      ->required()
      ->check(CLI::ExistingDirectory);
  run.add_option("--out", a.out, "folder for everything that is written");
  run.add_option("--detector", a.detector, "auto, none, hog, FILE.txt or FILE.onnx[@SIZE]");
  run.add_option("--min-score", a.min_score, "detections below are left out; 0: the detector's own default");
  run.add_option("--frames", a.frames, "only so many frames; 0: all");
  run.add_option("--features", a.features, "ORB keypoints per frame")->check(CLI::Range(100, 10000));
  run.add_option("--threads", a.threads, "1: everything one after the other, with the same result")
      ->check(CLI::Range(1, 64));
  run.add_option("--variant", a.variants,
                 "cfp, cfp-minus, no-mdc, no-dbscan, no-ksp, only-boxes, plain, or all; several with commas")
      ->delimiter(',');
  run.add_option("--seed", a.seed, "of the random samplers");
  run.add_option("--seeds", a.seeds, "runs of each variant, with so many seeds from --seed on");
  run.add_flag("--resume", a.resume, "leaves out runs that are there, whole and with the same settings");
}

// Folders that are recordings, or hold some.
std::vector<fs::path> recordings(const std::vector<std::string>& folders) {
  std::vector<fs::path> found;
  for (const fs::path folder : folders) {
    const std::size_t before = found.size();
    if (fs::exists(folder / "rgb.txt")) {
      found.push_back(folder);
      continue;
    }
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (fs::exists(entry.path() / "rgb.txt")) found.push_back(entry.path());
    }
    if (found.size() == before)
      throw std::runtime_error(folder.string() + ": neither a recording (rgb.txt) nor a folder of some");
    std::sort(found.begin() + static_cast<std::ptrdiff_t>(before), found.end());
  }
  return found;
}

// `auto` takes the recording's own detections.txt, or OpenCV's people detector where there is none.
std::string detector_of(const fs::path& recording, const Arguments& a) {
  if (a.detector != "auto") return a.detector;
  return fs::exists(recording / "detections.txt") ? (recording / "detections.txt").string() : "hog";
}

void run_recording(const fs::path& folder, const Arguments& a) {
  const cfp_examples::Sequence sequence(folder);
  for (const std::string& note : sequence.notes()) std::fprintf(stderr, "%s\n", note.c_str());
  const fs::path recording = fs::canonical(folder);
  const std::string spec = detector_of(recording, a);
  const auto detector = cfp_examples::make_detector(spec, {a.min_score, cfp_examples::DetectorOptions().max_overlap});
  const std::size_t frames = a.frames > 0 ? std::min(a.frames, sequence.size()) : sequence.size();
  for (std::uint64_t seed = a.seed; seed < a.seed + a.seeds; ++seed) {
    for (const std::string& variant : a.variants) {
      const cfp_slam::RunSettings settings{recording.string(), spec, variant, seed, frames, a.features, a.min_score};
      const fs::path out = cfp_slam::run_folder(a.out, settings);
      if (a.resume && cfp_slam::is_done(out, settings)) continue;
      cfp_examples::Progress progress(sequence.name() + ' ' + variant, frames);
      cfp_slam::run_into(out, sequence, *detector, settings, a.threads > 1, [&](std::size_t done) { progress(done); });
      std::printf("%s\n", (out / "trajectory.txt").c_str());
      std::fflush(stdout);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"RGB-D SLAM with cfp's static probabilities"};
  app.option_defaults()->always_capture_default();
  app.require_subcommand(1);
  Arguments a;
  add_options(*app.add_subcommand("run", "runs variants side by side and writes trajectories and figures"), a);
  CLI11_PARSE(app, argc, argv);
  try {
    if (a.variants == std::vector<std::string>{"all"})
      a.variants = {"plain", "only-boxes", "no-ksp", "no-dbscan", "no-mdc", "cfp-minus", "cfp"};
    for (const std::string& variant : a.variants) cfp_slam::variant_of(variant);
    cv::setNumThreads(a.threads);
    for (const fs::path& folder : recordings(a.folders)) run_recording(folder, a);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
