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

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  cfp_fuzz::FuzzInput in(data, size);
  const int reader = in.byte() % 8;
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
      default:
        cfp_slam::detail::read_settings(file_of(in));
    }
  } catch (const std::runtime_error&) {
  }
  return 0;
}
