#include "../../examples/support/numbers.hpp"

#include <array>
#include <clocale>
#include <filesystem>
#include <fstream>
#include <locale>
#include <string>

#include "../../examples/ba_files.hpp"
#include "../../examples/support/detections_file.hpp"
#include "../../examples/support/tum.hpp"
#include "support/catch.hpp"

namespace {

/// German numbers in C++, and in C where the machine has such a locale, until the end of the scope.
class GermanNumbers {
 public:
  GermanNumbers() : before_(std::locale::global(std::locale(std::locale::classic(), new Punctuation))) {
    for (const char* name : {"de_DE.UTF-8", "de_DE.utf8", "de_DE", "fr_FR.UTF-8"}) {
      if (std::setlocale(LC_NUMERIC, name) != nullptr) break;
    }
  }
  ~GermanNumbers() {
    std::setlocale(LC_NUMERIC, "C");
    std::locale::global(before_);
  }
  GermanNumbers(const GermanNumbers&) = delete;
  GermanNumbers& operator=(const GermanNumbers&) = delete;

 private:
  struct Punctuation : std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
    char do_thousands_sep() const override { return '.'; }
    std::string do_grouping() const override { return "\3"; }
  };
  std::locale before_;
};

std::filesystem::path written(const char* name, const std::string& text) {
  const std::filesystem::path file = std::filesystem::temp_directory_path() / ("cfp_numbers_" + std::string(name));
  std::ofstream(file, std::ios::binary) << text;
  return file;
}

}  // namespace

TEST_CASE("A word is a number as a whole or not at all", "[examples]") {
  CHECK(cfp_examples::read_number("0.5") == 0.5);
  CHECK(cfp_examples::read_number("+2") == 2.0);
  CHECK(cfp_examples::read_number("-1e-3") == -1e-3);
  for (const char* word : {"", "+", "+-1", "0,5", "1.5px", "x", "1e999", "0x10"}) {
    CAPTURE(word);
    CHECK_FALSE(cfp_examples::read_number(word).has_value());
  }
  CHECK(cfp_examples::fixed(1341846434.25, 6) == "1341846434.250000");
  CHECK(cfp_examples::fixed(-0.00049, 3) == "-0.000");
  CHECK(cfp_examples::general(535.4, 6) == "535.4");
}

TEST_CASE("Files do not depend on the locale of the program", "[examples]") {
  const GermanNumbers german;
  cfp::StampedPose<double> pose;
  pose.time_s = 1341846434.123456;
  pose.T_world_cam.translation << 1234.5, -0.25, 1e-3;
  const std::string line = cfp_examples::tum_line(pose);
  CHECK(line ==
        "1341846434.123456 1234.500000000 -0.250000000 0.001000000 0.000000000 0.000000000 0.000000000 1.000000000");
  const auto poses = cfp_examples::read_tum_trajectory(written("trajectory.txt", line + "\n"));
  REQUIRE(poses.size() == 1);
  CHECK(poses[0].time_s == pose.time_s);
  CHECK(poses[0].T_world_cam.translation == pose.T_world_cam.translation);

  std::istringstream boxes("1.5 person 0.875 1000.5 20.25 1100 200\n");
  const auto detections = cfp_examples::read_detections(boxes, "boxes");
  CHECK(detections.error.empty());
  REQUIRE(detections.frames.size() == 1);
  CHECK(detections.frames[0].timestamp == 1.5);
  CHECK(detections.frames[0].detections[0].score == 0.875);
  CHECK(detections.frames[0].detections[0].box.x1 == 1000.5);

  const auto problem = ba_files::read(
      written("bal.txt", "1 1 1\n0 0 1.5 -2.5\n0 0 0 0.5 0 0 500.5 0.01 0.001\n0.25 0.5 -1.75\n").string());
  CHECK(problem.pixels[0] == cfp::Vector2<double>(1.5, 2.5));
  CHECK(problem.cameras[0].focal == 500.5);
  CHECK(problem.points[0] == cfp::Vector3<double>(0.25, 0.5, -1.75));
}

TEST_CASE("Detections: damage is reported with its line", "[examples]") {
  const auto complaint = [](const std::string& text) {
    std::istringstream stream(text);
    return cfp_examples::read_detections(stream, "f").error;
  };
  CHECK(complaint("# nothing\n\n1 person 0.5 1 2 3 4 # good\n").empty());
  CHECK(complaint("x person 0.5 1 2 3 4\n") == "f:1: no timestamp: 'x'");
  CHECK(complaint("1\n") == "f:1: no class after the timestamp");
  CHECK(complaint("1 person\n") == "f:1: no score after class 'person'");
  CHECK(complaint("1 person 0,5 1 2 3 4\n") == "f:1: no score after class 'person'");
  CHECK(complaint("1 person 0.5 1 2 3\n") == "f:1: four numbers x1 y1 x2 y2 must follow the score");
  CHECK(complaint("1 person 0.5 1 2 3 4 5\n") == "f:1: surplus '5' after the box");
  CHECK(complaint("1 person 0.5 3 2 1 4\n") == "f:1: the box needs x1 < x2 and y1 < y2");
  CHECK(complaint("1 person nan 1 2 3 4\n") == "f:1: no score after class 'person'");
  CHECK(complaint("\xEF\xBB\xBF"
                  "1 person 0.5 1 2 3 4\n")
            .empty());
  CHECK(complaint("2 person 0.5 1 2 3 4\n1 person 0.5 1 2 3 4\n") ==
        "f:2: the timestamp is before that of the line above");
  std::ifstream folder(std::filesystem::temp_directory_path());
  CHECK(cfp_examples::read_detections(folder, "tmp").error == "tmp:0: cannot be read");
}
