// A thin RGB-D SLAM system around cfp: see README.md beside this file.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <opencv2/core.hpp>

#include "../support/tum.hpp"
#include "detection/detector.hpp"
#include "loop/run.hpp"
#include "progress.hpp"
#include "report/picture.hpp"
#include "report/profile.hpp"
#include "report/report.hpp"
#include "report/summary_file.hpp"
#include "report/tables.hpp"

namespace {

using cfp_slam::RunRecord;
namespace fs = std::filesystem;

struct Arguments {
  std::vector<std::string> folders, variants = {"plain", "cfp"};
  std::string detector = "auto";
  fs::path out = "slam_out", picture;
  std::uint64_t seed = 1;
  std::size_t seeds = 3, frames = 0, pictures = 8;
  int features = 1000, threads = 2;
  double min_score = 0, target_fps = 30;
  bool profile = false, write_pictures = false, no_report = false;
};

cfp::Variant variant_of(const std::string& name) {
  for (int v = 0; v <= static_cast<int>(cfp::Variant::plain); ++v) {
    if (name == cfp::to_string(static_cast<cfp::Variant>(v))) return static_cast<cfp::Variant>(v);
  }
  throw std::runtime_error("no variant '" + name + "': cfp, cfp-minus, no-mdc, no-dbscan, no-ksp, only-boxes, plain");
}

std::size_t frames_of(const cfp_slam::Sequence& sequence, const Arguments& arguments) {
  return arguments.frames > 0 ? std::min(arguments.frames, sequence.size()) : sequence.size();
}

// `auto` takes the recording's own detections.txt, or OpenCV's people detector where there is none.
std::unique_ptr<cfp_slam::Detector> detector_for(const fs::path& folder, const Arguments& arguments) {
  std::string spec = arguments.detector;
  if (spec == "auto") spec = fs::exists(folder / "detections.txt") ? (folder / "detections.txt").string() : "hog";
  cfp_slam::DetectorOptions options;
  options.min_score = arguments.min_score;
  return cfp_slam::make_detector(spec, options);
}

cfp_slam::RunOptions run_options(const Arguments& arguments, const std::string& variant, std::uint64_t seed) {
  cfp_slam::RunOptions options;
  options.variant = variant_of(variant);
  options.seed = seed;
  options.threads = arguments.threads > 1;
  options.max_frames = arguments.frames;
  options.front_end.features.count = arguments.features;
  options.front_end.features.candidates = 3 * arguments.features;
  return options;
}

void write_frames(const fs::path& file, const RunRecord& run) {
  std::ofstream out(file);
  out << "# timestamp image outcome keyframe keypoints matches inliers effective_points box_share boxes";
  for (std::size_t m = 0; m < cfp_slam::module_count; ++m) {
    std::string name = cfp_slam::to_string(static_cast<cfp_slam::Module>(m));
    std::replace(name.begin(), name.end(), ' ', '_');
    out << ' ' << name << "_ms";
  }
  out << " note\n";
  for (const cfp_slam::FrameRecord& f : run.frames) {
    char text[256];
    std::snprintf(text, sizeof text, "%.6f %s %s %d %zu %zu %zu %.1f %.3f %zu", f.time_s, f.image.c_str(),
                  to_string(f.outcome), f.keyframe ? 1 : 0, f.keypoints, f.matches, f.inliers,
                  f.health.effective_points, f.health.box_share, f.boxes.size());
    out << text;
    for (const double ms : f.milliseconds) {
      std::snprintf(text, sizeof text, " %.3f", ms);
      out << text;
    }
    out << (f.note.empty() ? "" : " # " + f.note) << '\n';
  }
  if (!out) throw std::runtime_error("cannot write " + file.string());
}

void write_trajectory(const fs::path& file, const RunRecord& run) {
  std::ofstream out(file);
  out << "# timestamp tx ty tz qx qy qz qw\n";
  for (const auto& pose : run.trajectory()) out << cfp_examples::tum_line(pose) << '\n';
  if (!out) throw std::runtime_error("cannot write " + file.string());
}

void print_summary(const RunRecord& run) {
  const cfp_slam::RunSummary s = cfp_slam::summarize(run);
  const auto ms = [&](cfp_slam::Module m) {
    return std::pair{s.median_ms[static_cast<std::size_t>(m)], s.p95_ms[static_cast<std::size_t>(m)]};
  };
  std::printf("%-11s", s.variant.c_str());
  if (s.expected > 0 && s.matched > 0) {
    std::printf(" ATE %.4f m RMSE (median %.4f, max %.4f)", s.ate_rmse_m, s.ate_median_m, s.ate_max_m);
    if (std::isfinite(s.rpe_rmse_m))
      std::printf(", RPE %.4f m/s %.3f deg/s", s.rpe_rmse_m, s.rpe_rmse_deg);  // not for clips below a second
    std::printf(", %zu of %zu poses", s.matched, s.expected);
  } else {
    std::printf(" no true trajectory, %zu of %zu frames with a pose", s.tracked + s.relocalised, s.frames);
  }
  const auto [median, p95] = ms(cfp_slam::Module::tracking);
  std::printf("; lost %zu, relocalised %zu, skipped %zu; tracking %.1f ms (95 %%: %.1f)\n", s.lost, s.relocalised,
              s.skipped, median, p95);
}

RunRecord run_one(const cfp_slam::Sequence& sequence, cfp_slam::Detector& detector, const Arguments& arguments,
                  const std::string& variant, std::uint64_t seed, std::size_t pictures,
                  const fs::path& picture_folder) {
  cfp_slam::RunOptions options = run_options(arguments, variant, seed);
  options.pictures = pictures;
  options.picture_folder = picture_folder;
  cfp_slam::Progress progress(sequence.name() + " " + variant, frames_of(sequence, arguments));
  return cfp_slam::run_slam(sequence, detector, options, [&](std::size_t done) { progress(done); });
}

// Every variant on every folder; trajectory, frames and pictures of each, and one report.
void run_command(const Arguments& arguments) {
  fs::create_directories(arguments.out);
  std::vector<RunRecord> runs;
  for (const std::string& folder : arguments.folders) {
    const cfp_slam::Sequence sequence(folder);
    for (const std::string& note : sequence.notes()) std::fprintf(stderr, "%s\n", note.c_str());
    std::printf("%s: %zu frames%s\n", sequence.name().c_str(), sequence.size(),
                sequence.truth().empty() ? "" : (", truth: " + sequence.truth_file()).c_str());
    const auto detector = detector_for(folder, arguments);
    for (const std::string& variant : arguments.variants) {
      const std::string base = sequence.name() + "_" + variant;
      runs.push_back(run_one(sequence, *detector, arguments, variant, arguments.seed, arguments.pictures,
                             arguments.write_pictures ? arguments.out / base : fs::path()));
      const RunRecord& run = runs.back();
      for (const auto& frame : run.frames) {
        if (frame.outcome == cfp_slam::Outcome::skipped) std::fprintf(stderr, "skipped: %s\n", frame.note.c_str());
        if (frame.outcome == cfp_slam::Outcome::lost)
          std::fprintf(stderr, "%s: lost: %s\n", frame.image.c_str(), frame.note.c_str());
      }
      write_trajectory(arguments.out / (base + "_trajectory.txt"), run);
      write_frames(arguments.out / (base + "_frames.txt"), run);
      print_summary(run);
      if (arguments.profile)
        std::printf("%s", cfp_slam::profile_text(run, arguments.target_fps, arguments.features).c_str());
    }
  }
  if (!arguments.picture.empty()) {
    const auto of_first = [&](const RunRecord& run) { return run.sequence == runs.front().sequence; };
    cfp_slam::write_summary_picture(arguments.picture,
                                    {runs.begin(), std::find_if_not(runs.begin(), runs.end(), of_first)});
    std::printf("picture: %s\n", arguments.picture.c_str());
  }
  if (arguments.no_report) return;
  cfp_slam::write_report(arguments.out / "report.html", runs);
  std::printf("report: %s\n", (arguments.out / "report.html").c_str());
}

// Folders that are recordings, or hold some.
std::vector<fs::path> recordings(const std::vector<std::string>& folders) {
  std::vector<fs::path> found;
  for (const std::string& folder : folders) {
    if (fs::exists(fs::path(folder) / "rgb.txt")) {
      found.emplace_back(folder);
      continue;
    }
    std::vector<fs::path> inside;
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (fs::exists(entry.path() / "rgb.txt")) inside.push_back(entry.path());
    }
    if (inside.empty()) throw std::runtime_error(folder + ": neither a recording (rgb.txt) nor a folder of some");
    std::sort(inside.begin(), inside.end());
    found.insert(found.end(), inside.begin(), inside.end());
  }
  return found;
}

// All variants on all recordings, `seeds` times each; resumes where an earlier run stopped.
void tables_command(const Arguments& arguments) {
  fs::create_directories(arguments.out);
  const fs::path journal = arguments.out / "runs.jsonl";
  std::vector<cfp_slam::RunSummary> runs =
      fs::exists(journal) ? cfp_slam::read_summaries(journal) : std::vector<cfp_slam::RunSummary>{};
  for (const fs::path& folder : recordings(arguments.folders)) {
    const cfp_slam::Sequence sequence(folder);
    const std::size_t frames = frames_of(sequence, arguments);
    const auto detector = detector_for(folder, arguments);
    for (std::uint64_t seed = 1; seed <= arguments.seeds; ++seed) {
      for (const std::string& variant : arguments.variants) {
        const auto same = [&](const cfp_slam::RunSummary& r) {
          return r.sequence == sequence.name() && r.variant == variant && r.seed == seed && r.frames == frames &&
                 r.detector == detector->name();
        };
        if (std::any_of(runs.begin(), runs.end(), same)) continue;
        const RunRecord run = run_one(sequence, *detector, arguments, variant, seed, 0, {});
        std::printf("%s seed %llu ", sequence.name().c_str(), static_cast<unsigned long long>(seed));
        print_summary(run);
        std::fflush(stdout);
        runs.push_back(cfp_slam::summarize(run));
        cfp_slam::append_summary(journal, runs.back());
      }
    }
  }
  cfp_slam::write_tables(arguments.out / "tables", runs, cfp_slam::machine_text());
  std::printf("tables: %s, %s\n", (arguments.out / "tables.md").c_str(), (arguments.out / "tables.html").c_str());
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"RGB-D SLAM with cfp's static probabilities"};
  app.require_subcommand(1);
  Arguments a;
  const auto common = [&](CLI::App* command) {
    command->add_option("folders", a.folders, "recordings in TUM format (rgb.txt, depth.txt, camera.txt, ...)")
        ->required()
        ->check(CLI::ExistingDirectory);
    command->add_option("--out", a.out, "folder for everything that is written")->capture_default_str();
    command
        ->add_option("--detector", a.detector, "auto, none, hog, FILE.txt, FILE.onnx[@SIZE], FILE.cfg or FILE.weights")
        ->capture_default_str();
    command->add_option("--min-score", a.min_score, "detections below are left out; 0: the detector's own default")
        ->capture_default_str();
    command->add_option("--frames", a.frames, "only so many frames; 0: all")->capture_default_str();
    command->add_option("--features", a.features, "ORB keypoints per frame")
        ->check(CLI::Range(100, 10000))
        ->capture_default_str();
    command->add_option("--threads", a.threads, "1: everything one after the other, with the same result")
        ->check(CLI::Range(1, 64))
        ->capture_default_str();
    command
        ->add_option("--variant", a.variants,
                     "cfp, cfp-minus, no-mdc, no-dbscan, no-ksp, only-boxes, plain; several with commas")
        ->delimiter(',')
        ->capture_default_str();
  };
  CLI::App* run = app.add_subcommand("run", "runs variants side by side and writes trajectories and a report");
  common(run);
  run->add_option("--seed", a.seed, "of the random samplers")->capture_default_str();
  run->add_option("--report-pictures", a.pictures, "annotated frames in the report")->capture_default_str();
  run->add_flag("--pictures", a.write_pictures, "writes every annotated frame as PNG");
  run->add_option("--picture", a.picture, "writes trajectories and a frame of the first recording as SVG");
  run->add_flag("--no-report", a.no_report, "writes no HTML");
  run->add_flag("--profile", a.profile, "prints where a frame's time goes and what to turn down");
  run->add_option("--target-fps", a.target_fps, "frame rate that --profile aims at")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  CLI::App* tables =
      app.add_subcommand("tables", "all variants, all recordings, several seeds: the paper's Tables I to V");
  common(tables);
  tables->add_option("--seeds", a.seeds, "runs of each")->check(CLI::PositiveNumber)->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    for (const std::string& variant : a.variants) variant_of(variant);
    cv::setNumThreads(a.threads);
    if (tables->parsed() && tables->get_option("--variant")->count() == 0)
      a.variants = {"plain", "only-boxes", "no-ksp", "no-dbscan", "no-mdc", "cfp-minus", "cfp"};
    run->parsed() ? run_command(a) : tables_command(a);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
