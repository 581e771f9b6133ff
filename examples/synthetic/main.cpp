// cfp_synthetic: renders the eight sequences of the TUM fr3 protocol, with truth for everything.
#include <algorithm>
#include <array>
#include <cstdio>
#include <iostream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>
#include <opencv2/core.hpp>

#include "../support/progress.hpp"
#include "writer.hpp"

namespace {

template <std::size_t N>
std::size_t index_of(const std::array<const char*, N>& names, const std::string& name) {
  return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
}

template <std::size_t N>
std::vector<std::string> strings(const std::array<const char*, N>& names) {
  return {names.begin(), names.end()};
}

void write_with_progress(const synthetic::Sequence& sequence, const std::filesystem::path& folder, int threads) {
  cfp_examples::Progress progress(folder.string(), static_cast<std::size_t>(sequence.options().frames));
  synthetic::write_sequence(sequence, folder, threads, [&](int done) { progress(static_cast<std::size_t>(done)); });
}

}  // namespace

int main(int argc, char* argv[]) {
  using namespace synthetic;
  CLI::App app{
      "Renders people who sit or walk before a moving RGB-D camera: TUM format, with truth for poses, boxes and every "
      "pixel."};
  std::string scenario = "walking", motion = "xyz";
  std::filesystem::path out, background;
  SequenceOptions options;
  bool all = false;
  int threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency())), width = 640;
  double camera_height = 1.35;
  app.add_option("out", out, "folder to write; with --all, one folder per sequence in it")->required();
  app.add_option("--scenario", scenario, "what the people do")
      ->check(CLI::IsMember(strings(scenario_names)))
      ->capture_default_str();
  app.add_option("--motion", motion, "what the camera does")
      ->check(CLI::IsMember(strings(motion_names)))
      ->capture_default_str();
  app.add_flag("--all", all, "all eight sequences, as out/<scenario>_<motion>");
  app.add_option("--frames", options.frames, "length at 30 Hz")->check(CLI::Range(1, 1000000))->capture_default_str();
  app.add_option("--seed", options.seed, "of everything random")->capture_default_str();
  app.add_option("--people", options.people, "of the two; 0: an empty room")
      ->check(CLI::Range(0, 2))
      ->capture_default_str();
  auto* close_up = app.add_flag("--close-up", options.close_up, "people fill the view: 40 % of it, up to 78 %");
  auto* furniture = app.add_flag("--furniture", options.furniture, "a table and a plant stand before the people");
  app.add_option("--width", width, "of the images, 4:3")->check(CLI::Range(64, 4096))->capture_default_str();
  app.add_option("--blur", options.blur_samples, "sub-exposures of the motion blur; 1 = none")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  app.add_option("--image-noise", options.sensor.image_noise, "standard deviation, grey levels")
      ->check(CLI::Range(0, 100))
      ->capture_default_str();
  double readout_ms = 0, depth_late_ms = 0, lens = 0, focal_error_percent = 0;
  auto* readout = app.add_option("--readout", readout_ms, "rolling shutter: from the first row to the last, ms")
                      ->check(CLI::Range(0, 100))
                      ->capture_default_str();
  auto* late = app.add_option("--depth-late", depth_late_ms, "depth is taken so much after its stamp, ms")
                   ->check(CLI::Range(-100, 100))
                   ->capture_default_str();
  auto* bent = app.add_option("--lens", lens, "an image that nobody undistorted: radial coefficient")
                   ->check(CLI::Range(-0.2, 0.2))
                   ->capture_default_str();
  auto* fisheye = app.add_flag("--fisheye", "a lens of 122 degrees, told in camera.txt")->excludes(bent);
  app.add_option("--focal-error", focal_error_percent, "of camera.txt, per cent")
      ->check(CLI::Range(-20, 20))
      ->capture_default_str();
  app.add_option("--threads", threads, "rendering threads")->check(CLI::Range(1, 256))->capture_default_str();
  app.add_option("--background", background, "a recording in TUM format with poses; the people are put into it")
      ->check(CLI::ExistingDirectory)
      ->excludes(close_up, furniture, readout, late, bent, fisheye);
  app.add_option("--camera-height", camera_height, "of the first background camera above the floor, m")
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  cv::setNumThreads(1);  // the frames are what runs in parallel
  options.camera = *fisheye ? SequenceOptions::fisheye_camera(width) : SequenceOptions::default_camera(width);
  options.camera.lens = lens;
  options.readout_s = readout_ms / 1000;
  options.depth_late_s = depth_late_ms / 1000;
  options.focal_error = focal_error_percent / 100;
  try {
    std::shared_ptr<Recording> recording;
    if (!background.empty()) recording = std::make_shared<Recording>(read_recording(background, camera_height));
    for (std::size_t s = 0; s < scenario_names.size(); ++s) {
      for (std::size_t m = 0; m < motion_names.size(); ++m) {
        if (!all && (s != index_of(scenario_names, scenario) || m != index_of(motion_names, motion))) continue;
        if (all && recording != nullptr && m > 0) continue;  // the recording moves the camera
        if (all && static_cast<Scenario>(s) == Scenario::rising) continue;
        options.scenario = static_cast<Scenario>(s);
        options.motion = static_cast<Motion>(m);
        const std::string name =
            std::string(scenario_names[s]) + (recording != nullptr ? "" : std::string("_") + motion_names[m]);
        write_with_progress(Sequence(options, recording), all ? out / name : out, threads);
      }
    }
  } catch (const std::exception& error) {
    std::cerr << "cfp_synthetic: " << error.what() << '\n';
    return 1;
  }
  return 0;
}
