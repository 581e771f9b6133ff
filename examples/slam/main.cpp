// A thin RGB-D SLAM system around cfp: see README.md beside this file.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <opencv2/core.hpp>

#include "../detection/detector.hpp"
#include "../slam_runs/run_folder.hpp"
#include "../slam_runs/stress_result.hpp"
#include "../support/progress.hpp"
#include "../support/variant.hpp"

namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::vector<std::string> folders, variants = {"plain", "cfp"};
  fs::path out = "slam_out";
  cfp_slam::RunSettings settings;  // of every run; recording and variant are its own
  std::uint64_t seeds = 1;
  std::vector<std::string> stresses;
  fs::path options;  // a file of them
  int threads = 2;
  bool resume = false;
};

// Of every command.
void add_common_options(CLI::App& run, Arguments& a) {
  run.add_option("folders", a.folders, "recordings in TUM format (rgb.txt, depth.txt, camera.txt, ...), or of such")
      ->required()
      ->check(CLI::ExistingDirectory);
  run.add_option("--detector", a.settings.detector, "auto, none, hog, FILE.txt or FILE.onnx[@SIZE]");
  run.add_option("--min-score", a.settings.min_score, "detections below are left out; 0: the detector's own default");
  run.add_option("--frames", a.settings.frames, "only so many frames; 0: all");
  run.add_option("--features", a.settings.features, "ORB keypoints per frame")->check(CLI::Range(100, 10000));
  run.add_option("--threads", a.threads, "1: one after the other, with the same result")->check(CLI::Range(1, 64));
  run.add_option("--options", a.options, "a file of lines 'name value', as cfp_slam_report calibrate writes them")
      ->check(CLI::ExistingFile);
  run.add_option("--seed", a.settings.seed, "of the random samplers");
}

void add_run_options(CLI::App& run, Arguments& a) {
  run.add_option("--out", a.out, "folder for everything that is written");
  run.add_option("--variant", a.variants, cfp_examples::all_variants + ", or all; several with commas")->delimiter(',');
  run.add_option("--seeds", a.seeds, "runs of each variant, with so many seeds from --seed on")
      ->check(CLI::Range(1, 1000000));
  run.add_flag("--decisions", a.settings.decisions,
               "writes why each keypoint of each frame has its weight (100 kB each)");
  run.add_flag("--resume", a.resume, "leaves out runs that are there, whole and with the same settings");
}

// What the arguments mean for a recording.
cfp_slam::RunSettings settings_of(const fs::path& recording, const Arguments& a) {
  cfp_slam::RunSettings settings = a.settings;
  settings.recording = recording.string();
  if (settings.detector == "auto") {
    const fs::path own = recording / "detections.txt";
    settings.detector = fs::exists(own) ? own.string() : "hog";
  }
  return settings;
}

std::unique_ptr<cfp_examples::Detector> detector_of(const cfp_slam::RunSettings& settings) {
  cfp_examples::DetectorOptions options;
  options.min_score = settings.min_score;
  return cfp_examples::make_detector(settings.detector, options);
}

void run_recording(const fs::path& recording, const Arguments& a) {
  const cfp_examples::Sequence sequence(recording);
  for (const std::string& note : sequence.notes()) std::fprintf(stderr, "%s\n", note.c_str());
  cfp_slam::RunSettings settings = settings_of(recording, a);
  const auto detector = detector_of(settings);
  for (settings.seed = a.settings.seed; settings.seed < a.settings.seed + a.seeds; ++settings.seed) {
    for (const std::string& variant : a.variants) {
      settings.variant = variant;
      const fs::path out = cfp_slam::run_folder(a.out, settings);
      if (a.resume && cfp_slam::is_done(out, settings)) continue;
      cfp_examples::Progress progress(
          sequence.name() + ' ' + variant,
          std::min(sequence.size(), settings.frames > 0 ? settings.frames : sequence.size()));
      const std::string said = cfp_slam::run_into(out, sequence, *detector, settings, a.threads > 1, progress);
      if (!said.empty()) std::fprintf(stderr, "%s %s: %s\n", sequence.name().c_str(), variant.c_str(), said.c_str());
      std::printf("%s\n", (out / "trajectory.txt").c_str());
    }
  }
}

void stress_recording(const fs::path& recording, const Arguments& a) {
  const cfp_examples::Sequence sequence(recording);
  const cfp_slam::RunSettings settings = settings_of(recording, a);
  cfp_slam::print_stresses(sequence, options_of(settings, a.threads > 1), a.stresses,
                           [&] { return detector_of(settings); });
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"RGB-D SLAM with cfp's static probabilities"};
  app.option_defaults()->always_capture_default();
  app.require_subcommand(1);
  Arguments a;
  a.settings.detector = "auto";
  CLI::App& run = *app.add_subcommand("run", "runs variants side by side and writes trajectories and figures");
  CLI::App& stress =
      *app.add_subcommand("stress", "disturbs recordings in many ways and prints what becomes of the poses");
  add_common_options(run, a);
  add_run_options(run, a);
  add_common_options(stress, a);
  stress.add_option("--only", a.stresses, "only those with one of these in their names")->delimiter(',');
  CLI11_PARSE(app, argc, argv);
  try {
    if (a.variants == std::vector<std::string>{"all"}) a.variants = CLI::detail::split(cfp_examples::all_variants, ',');
    for (const std::string& variant : a.variants) cfp_examples::variant_of(variant);
    if (!a.options.empty()) a.settings.options = cfp_slam::read_options(a.options);
    cv::setNumThreads(a.threads);
    for (const fs::path& recording : cfp_slam::recordings(a.folders))
      stress.parsed() ? stress_recording(recording, a) : run_recording(recording, a);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
