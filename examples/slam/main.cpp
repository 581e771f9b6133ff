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
  run.add_option("--variant", a.variants, cfp_slam::all_variants + ", or all; several with commas")->delimiter(',');
  run.add_option("--seeds", a.seeds, "runs of each variant, with so many seeds from --seed on");
  run.add_flag("--decisions", a.settings.decisions,
               "writes why each keypoint of each frame has its weight (100 kB each)");
  run.add_flag("--resume", a.resume, "leaves out runs that are there, whole and with the same settings");
}

// Folders that are recordings, or hold some.
std::vector<fs::path> recordings(const std::vector<std::string>& folders) {
  std::vector<fs::path> found;
  for (const fs::path folder : folders) {
    std::vector<fs::path> inside;
    if (fs::exists(folder / "rgb.txt")) inside.push_back(folder);
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (fs::exists(entry.path() / "rgb.txt")) inside.push_back(entry.path());
    }
    if (inside.empty()) throw std::runtime_error(folder.string() + ": neither a recording (rgb.txt) nor some in it");
    std::sort(inside.begin(), inside.end());
    for (const fs::path& recording : inside) found.push_back(fs::canonical(recording));
  }
  return found;
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

std::size_t frames_of(const cfp_examples::Sequence& sequence, const cfp_slam::RunSettings& settings) {
  return settings.frames > 0 ? std::min(settings.frames, sequence.size()) : sequence.size();
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
  const std::size_t frames = frames_of(sequence, settings);
  for (settings.seed = a.settings.seed; settings.seed < a.settings.seed + a.seeds; ++settings.seed) {
    for (const std::string& variant : a.variants) {
      settings.variant = variant;
      const fs::path out = cfp_slam::run_folder(a.out, settings);
      if (a.resume && cfp_slam::is_done(out, settings)) continue;
      cfp_examples::Progress progress(sequence.name() + ' ' + variant, frames);
      const std::string said = cfp_slam::run_into(out, sequence, *detector, settings, a.threads > 1, progress);
      if (!said.empty()) std::fprintf(stderr, "%s %s: %s\n", sequence.name().c_str(), variant.c_str(), said.c_str());
      std::printf("%s\n", (out / "trajectory.txt").c_str());
    }
  }
}

// A table of what each stress does to the poses.
void stress_recording(const fs::path& recording, const Arguments& a) {
  const cfp_examples::Sequence sequence(recording);
  const cfp_slam::RunSettings settings = settings_of(recording, a);
  const std::size_t frames = frames_of(sequence, settings);
  if (sequence.truth().empty() || frames < 30)
    throw std::runtime_error(recording.string() + ": a stress test needs a truth and 30 frames");
  const double seconds = sequence.time_s(frames - 1) - sequence.time_s(0);
  std::printf("%s\n", sequence.name().c_str());
  cfp_slam::print_stress_header();
  for (const cfp_slam::Stress& stress :
       cfp_slam::stresses(frames, static_cast<double>(frames - 1) / seconds, sequence.calibration())) {
    if (!a.stresses.empty() && std::none_of(a.stresses.begin(), a.stresses.end(), [&](const std::string& part) {
          return stress.name.find(part) != std::string::npos;
        }))
      continue;
    const auto inner = detector_of(settings);
    cfp_slam::StressedDetector detector(*inner, sequence, stress);
    cfp_slam::FrameSource source = cfp_slam::stressed(sequence, stress, frames);
    cfp_slam::StressObserver observer;
    cfp_slam::Options options = cfp_slam::options_of(settings, a.threads > 1);
    const cfp_slam::RunResult run = cfp_slam::run_slam(source, detector, options, observer);
    cfp_slam::print(stress, cfp_slam::judge(sequence, stress, observer.records, run));
  }
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
    if (a.variants == std::vector<std::string>{"all"}) a.variants = CLI::detail::split(cfp_slam::all_variants, ',');
    for (const std::string& variant : a.variants) cfp_slam::variant_of(variant);
    if (!a.options.empty()) a.settings.options = cfp_slam::read_options(a.options);
    cv::setNumThreads(a.threads);
    for (const fs::path& recording : recordings(a.folders))
      stress.parsed() ? stress_recording(recording, a) : run_recording(recording, a);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
