// Every reader of the examples that is text alone: a bad file ends in std::runtime_error, never in anything else.
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "../../examples/ba_files.hpp"
#include "../../examples/slam_runs/decisions.hpp"
#include "../../examples/slam_runs/read_run.hpp"
#include "../../examples/support/detections_file.hpp"
#include "../../examples/support/tum.hpp"
#include "fuzz_input.hpp"
#include "support/temporary_folder.hpp"

namespace {

const std::filesystem::path& file_of(const cfp_fuzz::FuzzInput& in) {
  static const cfp_test::TemporaryFolder folder;
  static const std::filesystem::path file = folder.path / "input.txt";
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(in.rest()), static_cast<std::streamsize>(in.size()));
  return file;
}

/// A finished run, one of whose files is what the fuzzer says.
void read_run(cfp_fuzz::FuzzInput& in) {
  static const char* const names[] = {"run.txt", "frames.txt", "boxes.txt", "keypoints.txt", "trajectory.txt"};
  static const cfp_test::TemporaryFolder folder;
  static const std::string good[] = {
      "recording " + (folder.path / "recording").string() +
          "\ndetector hog\nvariant cfp\nseed 1\nframes 0\nfeatures 9\noptions none\nkeyframes 4\nmap_points 5\n",
      "1 rgb/1.png tracked 0 3 2 1 9 0.5 0 0.7 0.2 0.1" +
          [] {
            std::string times;
            for (std::size_t m = 0; m < cfp_slam::module_count; ++m) times += " 1";
            return times + "\n";
          }(),
      "0 1 1 2 3 4 0 1 0.5 0\n", "0 1 2 31 1 0.5 0.4 0.3 0.2\n", "1 1 2 3 0 0 0 1\n"};
  static const bool written = [] {
    folder.write("recording/camera.txt", "50 50 16 12 32 24 5000\n");
    for (const char* list : {"rgb", "depth"}) {
      folder.write("recording/" + std::string(list) + ".txt", "1 " + std::string(list) + "/1.png\n");
      folder.write("recording/" + std::string(list) + "/1.png", "no picture");
    }
    folder.write("recording/groundtruth.txt", "1 0 0 0 0 0 0 1\n");
    return true;
  }();
  CFP_PROMISE(written);
  const std::size_t changed = in.byte() % 5;
  std::string text(reinterpret_cast<const char*>(in.rest()), in.size());
  if (changed < 2 && in.flag()) text = good[changed] + text;
  for (std::size_t k = 0; k < 5; ++k) folder.write("run/" + std::string(names[k]), k == changed ? text : good[k]);
  if (changed == 0) {  // any other recording is another test
    const auto settings = cfp_slam::detail::read_settings(folder.path / "run/run.txt");
    const auto recording = settings.find("recording");
    if (recording == settings.end() || recording->second != (folder.path / "recording").string()) return;
  }
  const cfp_slam::RunRecord run = cfp_slam::read_run(folder.path / "run");
  CFP_PROMISE(run.frames.size() <= text.size() + 1);
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  cfp_fuzz::FuzzInput in(data, size);
  const int reader = in.byte() % 9;
  try {
    switch (reader) {
      case 0:
        for (const auto& pose : cfp_examples::read_tum_trajectory(file_of(in))) CFP_PROMISE(std::isfinite(pose.time_s));
        break;
      case 1:
        cfp_examples::read_tum_list(file_of(in));
        break;
      case 2:
        cfp_examples::read_tum_camera(file_of(in));
        break;
      case 3: {
        std::istringstream text(std::string(reinterpret_cast<const char*>(in.rest()), in.size()));
        cfp_examples::read_detections(text, "input.txt");
        break;
      }
      case 4:
        ba_files::read_bal(file_of(in).string());
        break;
      case 5:
        ba_files::read_libmv(file_of(in).string());
        break;
      case 6:
        cfp_slam::for_each_decision(file_of(in), [](const cfp_slam::Decision& d) {
          CFP_PROMISE(cfp_slam::decision_line(d).size() > 2 && !cfp::to_text(d.why).empty());
        });
        break;
      case 7:
        read_run(in);
        break;
      default:
        cfp_slam::detail::read_settings(file_of(in));
    }
  } catch (const std::runtime_error&) {
  }
  return 0;
}
