#include "../../examples/ba_files.hpp"

#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/catch.hpp"

namespace {

/// A file of the build folder that is gone with the object.
class File {
 public:
  File(const std::string& name, const std::string& content) : name_("cfp_ba_files_test_" + name) {
    std::ofstream(name_, std::ios::binary) << content;
  }
  ~File() { std::remove(name_.c_str()); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  [[nodiscard]] const std::string& name() const { return name_; }

 private:
  std::string name_;
};

/// What the reader says of a file with this content: the message without the file's name, "" when it reads it.
std::string complaint(const std::string& extension, const std::string& content) {
  const File file("damaged." + extension, content);
  try {
    (void)ba_files::read(file.name());
  } catch (const std::runtime_error& error) {
    const std::string message = error.what();
    REQUIRE(message.compare(0, file.name().size() + 2, file.name() + ": ") == 0);
    return message.substr(file.name().size() + 2);
  }
  return "";
}

/// Two cameras, one point, two observations.
const std::string bal =
    "2 1 2\n"
    "0 0 1.5 -2.5\n"
    "1 0 3 4\n"
    "0 0 0\n0 0 -5\n500 0.01 0.001\n"
    "0.1 0 0\n1 0 -5\n600 0 0\n"
    "0.5 0.25 1\n";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

/// libmv's binary of one camera at image 7, one point of track 3, and the given markers.
struct Libmv {
  bool big_endian = false;
  std::string bytes;

  void word(std::uint32_t value) {
    for (int b = 0; b < 4; ++b) bytes += static_cast<char>(value >> (8 * (big_endian ? 3 - b : b)) & 0xFFU);
  }
  void real(float value) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, &value, 4);
    word(bits);
  }
};

std::string libmv(bool big_endian, int marker_track = 3, float first_intrinsic = 500) {
  Libmv file;
  file.big_endian = big_endian;
  file.bytes = big_endian ? "VP" : "vP";
  file.real(first_intrinsic);
  for (const float k : {320.F, 240.F, 0.1F, 0.F, 0.F, 0.F, 0.F}) file.real(k);
  file.word(1), file.word(7);
  for (int e = 0; e < 9; ++e) file.real(e % 4 == 0 ? 1.F : 0.F);
  for (const float t : {1.F, 2.F, 3.F}) file.real(t);
  file.word(1), file.word(3);
  for (const float x : {4.F, 5.F, 6.F}) file.real(x);
  file.word(1), file.word(7), file.word(static_cast<std::uint32_t>(marker_track));
  for (const float u : {11.F, 12.F}) file.real(u);
  return file.bytes;
}

}  // namespace

TEST_CASE("BAL text: what is written is read, turned to look down +z", "[examples]") {
  const File file("whole.txt", bal);
  const ba_files::Problem problem = ba_files::read(file.name());
  REQUIRE(problem.poses.size() == 2);
  REQUIRE(problem.points.size() == 1);
  REQUIRE(problem.pixels.size() == 2);
  CHECK(problem.pose == std::vector<int>{0, 1});
  CHECK(problem.point == std::vector<int>{0, 0});
  CHECK(problem.pixels[0] == cfp::Vector2<double>(1.5, 2.5));
  CHECK(problem.points[0] == cfp::Vector3<double>(0.5, 0.25, 1));
  CHECK(problem.cameras[0].focal == 500);
  CHECK(problem.cameras[0].k2 == 0.001);
  // BAL: P = R X + t = (0.5, 0.25, -4), p = -P / P.z = (0.125, 0.0625), then f (1 + k1 r^2 + k2 r^4) p.
  cfp::Vector2<double> pixel;
  REQUIRE(problem.cameras[0].project(problem.poses[0] * problem.points[0], pixel));
  const double r2 = 0.125 * 0.125 + 0.0625 * 0.0625, scale = 500 * (1 + 0.01 * r2 + 0.001 * r2 * r2);
  CHECK(pixel.x() == Approx(scale * 0.125));
  CHECK(-pixel.y() == Approx(scale * 0.0625));
}

TEST_CASE("BAL text: damage is reported with its line", "[examples]") {
  CHECK(complaint("txt", bal).empty());
  CHECK(complaint("txt", "") == "line 1: the file ends before number of cameras");
  CHECK(complaint("txt", "2 x 2\n") == "line 1: number of points is not a number: 'x'");
  CHECK(complaint("txt", "2 -1 2\n") == "line 1: number of points is not a whole number from 0 to below 100000000");
  CHECK(complaint("txt", "2 1.5 2\n") == "line 1: number of points is not a whole number from 0 to below 100000000");
  CHECK(complaint("txt", replaced(bal, "1 0 3 4", "2 0 3 4")) ==
        "line 3: camera index is not a whole number from 0 to below 2");
  CHECK(complaint("txt", replaced(bal, "1 0 3 4", "1 1 3 4")) ==
        "line 3: point index is not a whole number from 0 to below 1");
  CHECK(complaint("txt", replaced(bal, "1 0 3 4", "1 0 nan 4")) == "line 3: x is not a number: 'nan'");
  CHECK(complaint("txt", replaced(bal, "1 0 3 4", "1 0 3 4px")) == "line 3: y is not a number: '4px'");
  CHECK(complaint("txt", replaced(bal, "500 0.01", "500 1e999")) == "line 6: camera 0, k1 is not a number: '1e999'");
  CHECK(complaint("txt", bal.substr(0, bal.find("0.5 0.25"))) == "line 10: the file ends before point 0, x");
  CHECK(complaint("txt", bal.substr(0, bal.find("600"))) == "line 9: the file ends before camera 1, f");
}

TEST_CASE("libmv binary: both byte orders are read", "[examples]") {
  for (const bool big_endian : {false, true}) {
    const File file("whole.bin", libmv(big_endian));
    const ba_files::Problem problem = ba_files::read(file.name());
    REQUIRE(problem.pixels.size() == 1);
    CHECK(problem.cameras[0].focal == 500);
    CHECK(problem.cameras[0].cy == 240);
    CHECK(problem.poses[0].translation == cfp::Vector3<double>(1, 2, 3));
    CHECK(problem.points[0] == cfp::Vector3<double>(4, 5, 6));
    CHECK(problem.pixels[0] == cfp::Vector2<double>(11, 12));
  }
  const File unknown("unknown.bin", libmv(false, 4));  // a marker of a track that was not reconstructed
  CHECK(ba_files::read(unknown.name()).pixels.empty());
}

TEST_CASE("libmv binary: damage is reported with its byte", "[examples]") {
  const std::string whole = libmv(false);
  CHECK(complaint("bin", "") == "byte 0: the file ends before the byte order");
  CHECK(complaint("bin", "x" + whole.substr(1)) == "byte 0: the byte order is neither 'V' nor 'v'");
  CHECK(complaint("bin", "vX" + whole.substr(2)) == "byte 1: the marker space is neither 'P' nor 'N'");
  CHECK(complaint("bin", libmv(false, 3, std::numeric_limits<float>::infinity())) ==
        "byte 2: intrinsic f is not finite");
  std::string negative = whole;
  negative[37] = static_cast<char>(0x80);  // the highest byte of the number of cameras
  CHECK(complaint("bin", negative) == "byte 34: number of cameras is negative");
  // Cut anywhere it names the byte where something is missing, and never reads on.
  for (std::size_t size = 2; size < whole.size(); ++size) {
    const std::string message = complaint("bin", whole.substr(0, size));
    CAPTURE(size, message);
    CHECK(message.compare(0, 5, "byte ") == 0);
    CHECK(message.find("the file ends before ") != std::string::npos);
    CHECK(std::stoul(message.substr(5)) <= size);
  }
}

TEST_CASE("A file that is not there is named", "[examples]") {
  for (const std::string name : {"no_such_file.txt", "no_such_file.bin"})
    CHECK_THROWS_WITH(ba_files::read(name), name + ": cannot be opened");
}
