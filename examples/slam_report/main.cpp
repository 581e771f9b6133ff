// What cfp_slam's runs show, from the files that it wrote: see README.md beside this file.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "../slam_runs/read_run.hpp"
#include "../support/write_picture.hpp"
#include "annotate.hpp"
#include "calibrate.hpp"
#include "explained.hpp"
#include "picture.hpp"
#include "profile.hpp"
#include "report.hpp"
#include "tables.hpp"

namespace {

using cfp_slam::RunRecord;
namespace fs = std::filesystem;

// visit(folder, run) for every finished run.
template <typename Visit>
void for_each_run(const fs::path& out, const Visit& visit) {
  const std::vector<fs::path> folders = cfp_slam::run_folders(out);
  if (folders.empty()) throw std::runtime_error(out.string() + ": no finished run of cfp_slam in it");
  for (const fs::path& folder : folders) {
    RunRecord run = cfp_slam::read_run(folder);
    for (const std::string& note : run.notes) std::fprintf(stderr, "%s\n", note.c_str());
    visit(folder, std::move(run));
  }
}

void print_summary(const RunRecord& run) {
  const cfp_slam::RunSummary s = cfp_slam::summarize(run);
  std::printf("%-11s", s.variant.c_str());
  if (s.expected > 0 && s.matched > 0) {
    std::printf(" ATE %.4f m RMSE (median %.4f, max %.4f)", s.ate_rmse_m, s.ate_median_m, s.ate_max_m);
    if (std::isfinite(s.rpe_rmse_m))
      std::printf(", RPE %.4f m/s %.3f deg/s", s.rpe_rmse_m, s.rpe_rmse_deg);  // not for clips below a second
    std::printf(", %zu of %zu poses", s.matched, s.expected);
  } else {
    std::printf(" no true trajectory, %zu of %zu frames with a pose", s.tracked + s.relocalised, s.frames);
  }
  const auto tracking = static_cast<std::size_t>(cfp_slam::Module::tracking);
  std::printf("; lost %zu, relocalised %zu, skipped %zu; tracking %.1f ms (95 %%: %.1f)\n", s.lost, s.relocalised,
              s.skipped, s.median_ms[tracking], s.p95_ms[tracking]);
  const auto percent = [](double share) { return cfp_slam::number(100 * share, 1) + " %"; };
  if (s.weight.samples > 0)
    std::printf(
        "%11s AUC of K %.3f, M %.3f, the weight %.3f; in boxes %s of the static at 0, %s of the moving above 0.5\n", "",
        s.second_stage.auc, s.map_point.auc, s.weight.auc, percent(s.weight.static_lost).c_str(),
        percent(s.weight.moving_kept).c_str());
  if (s.object.samples > 0)
    std::printf("%11s AUC of O %s; of the boxes of people at rest %s at or below O_Th, of those who move %s above\n",
                "", cfp_slam::number(s.object.auc, 3).c_str(), percent(s.object.static_lost).c_str(),
                percent(s.object.moving_kept).c_str());
}

struct Arguments {
  fs::path out, picture, pictures_folder, options = "options.txt";
  std::size_t pictures = 8;
  std::vector<std::size_t> explained;
  double target_fps = 30;
  bool profile = false;
};

// Every annotated frame of a run.
void write_pictures(const fs::path& folder, const RunRecord& run) {
  fs::create_directories(folder);
  for (std::size_t k = 0; k < run.frames.size(); ++k) {
    const cv::Mat image = cv::imread((fs::path(run.recording) / run.frames[k].image).string());
    if (!image.empty())
      cfp_examples::write_picture(folder / (std::to_string(1000000 + k).substr(1) + ".png"),
                                  cfp_slam::annotate(image, run.frames[k]));
  }
}

void report(const Arguments& a) {
  std::vector<RunRecord> runs;
  for_each_run(a.out, [&](const fs::path& folder, RunRecord&& run) {
    cfp_slam::add_pictures(run, run.recording, a.pictures);
    cfp_slam::add_explained(run, folder, a.explained);
    if (!a.pictures_folder.empty()) write_pictures(a.pictures_folder / run.sequence / folder.filename(), run);
    runs.push_back(std::move(run));
  });
  cfp_slam::sort_runs(runs);
  for (const RunRecord& run : runs) {
    if (&run == &runs.front() || run.sequence != (&run)[-1].sequence) std::printf("%s\n", run.sequence.c_str());
    print_summary(run);
    if (a.profile) std::printf("%s", cfp_slam::profile_text(run, a.target_fps).c_str());
  }
  if (!a.picture.empty()) {
    cfp_slam::write_summary_picture(a.picture, runs);
    std::printf("picture: %s\n", a.picture.c_str());
  }
  cfp_slam::write_report(a.out / "report.html", runs);
  std::printf("report: %s\n", (a.out / "report.html").c_str());
}

// Options from the runs that have decisions, and labels.
void calibrate(const Arguments& a) {
  cfp_slam::CalibrationData data;
  for_each_run(a.out, [&](const fs::path& folder, const RunRecord& run) {
    if (fs::exists(folder / "decisions.txt")) cfp_slam::add_run(folder, run, data);
  });
  cfp_slam::calibrate(data, a.options);
}

void tables(const Arguments& a) {
  std::vector<cfp_slam::RunSummary> runs;
  for_each_run(a.out, [&](const fs::path&, const RunRecord& run) { runs.push_back(cfp_slam::summarize(run)); });
  cfp_slam::write_tables(a.out / "tables", runs, cfp_slam::machine_text());
  std::printf("tables: %s, %s\n", (a.out / "tables.md").c_str(), (a.out / "tables.html").c_str());
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Report and tables of cfp_slam's runs"};
  app.option_defaults()->always_capture_default();
  app.require_subcommand(1);
  Arguments a;
  const auto out = [&](CLI::App& command) {
    command.add_option("out", a.out, "the folder that cfp_slam wrote")->required()->check(CLI::ExistingDirectory);
  };
  CLI::App& report_command = *app.add_subcommand("report", "errors, and trajectories, probabilities and times as HTML");
  out(report_command);
  report_command.add_option("--pictures", a.pictures, "annotated frames of each run in the report");
  report_command
      .add_option("--explain", a.explained, "frames whose keypoints tell why, of runs with --decisions; default: one")
      ->delimiter(',');
  report_command.add_option("--pictures-to", a.pictures_folder, "writes every annotated frame below this folder");
  report_command.add_option("--picture", a.picture, "writes trajectories and a frame of the first recording as SVG");
  report_command.add_flag("--profile", a.profile, "prints where a frame's time goes and what to turn down");
  report_command.add_option("--target-fps", a.target_fps, "frame rate that --profile aims at")
      ->check(CLI::PositiveNumber);
  CLI::App& tables_command = *app.add_subcommand("tables", "the paper's Tables I to V, and what they show");
  out(tables_command);
  CLI::App& calibrate_command =
      *app.add_subcommand("calibrate", "options from runs with --decisions over labelled recordings");
  out(calibrate_command);
  calibrate_command.add_option("--options", a.options, "the file to write, for cfp_slam run --options");
  CLI11_PARSE(app, argc, argv);
  try {
    report_command.parsed() ? report(a) : calibrate_command.parsed() ? calibrate(a) : tables(a);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
