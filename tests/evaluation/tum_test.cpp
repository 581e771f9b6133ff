#include "../../examples/support/tum.hpp"

#include <unistd.h>

#include "support/catch.hpp"
#include "support/trajectories.hpp"

namespace {

struct TemporaryFile {
  explicit TemporaryFile(const std::string& text)
      : path(std::filesystem::temp_directory_path() / ("cfp_tum_test_" + std::to_string(::getpid()) + ".txt")) {
    std::ofstream(path) << text;
  }
  ~TemporaryFile() { std::filesystem::remove(path); }
  std::filesystem::path path;
};

template <typename Read>
std::string error_of(const Read& read) {
  try {
    read();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("A written trajectory reads back", "[evaluation]") {
  cfp::Random random(61, "tum");
  const auto poses = cfp_test::random_walk(random, 20, 1305031453, 0.03);
  std::string text = "# comment\n\n";
  for (const auto& pose : poses) text += cfp_examples::tum_line(pose) + "  # trailing\r\n";
  const TemporaryFile file(text);
  const auto read = cfp_examples::read_tum_trajectory(file.path);
  REQUIRE(read.size() == poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    CHECK_THAT(read[i].time_s, WithinAbs(poses[i].time_s, 1e-6));
    CHECK((read[i].T_world_cam.rotation - poses[i].T_world_cam.rotation).norm() < 1e-8);
    CHECK((read[i].T_world_cam.translation - poses[i].T_world_cam.translation).norm() < 1e-8);
  }
}

TEST_CASE("A bad line is refused with file and line", "[evaluation]") {
  for (const char* bad : {"1 2 3", "1 2 3 4 0 0 0 x", "1 2 3 4 0 0 0 1 9", "1 2 3 4 0 0 0 1e", "1 2 3 4 0 0 0 0x1"}) {
    const TemporaryFile file("# header\n0 0 0 0 0 0 0 1\n" + std::string(bad) + "\n");
    CHECK(error_of([&] { (void)cfp_examples::read_tum_trajectory(file.path); }).find(file.path.string() + ":3: ") == 0);
  }
  CHECK(error_of([] { (void)cfp_examples::read_tum_trajectory("/nowhere/at/all.txt"); }).find("/nowhere/at/all.txt") !=
        std::string::npos);
  const std::string folder = std::filesystem::temp_directory_path().string();
  CHECK(error_of([&] { (void)cfp_examples::read_tum_trajectory(folder); }).find(folder) != std::string::npos);
  const TemporaryFile list("0.1 a.png b\n");
  CHECK(error_of([&] { (void)cfp_examples::read_tum_list(list.path); }).find(":1: ") != std::string::npos);
  const TemporaryFile camera("525 525 320 240 640 0 5000\n");
  CHECK(error_of([&] { (void)cfp_examples::read_tum_camera(camera.path); }).find(":1: '0' out of range") !=
        std::string::npos);
  const TemporaryFile empty("# nothing\n");
  CHECK(!error_of([&] { (void)cfp_examples::read_tum_camera(empty.path); }).empty());
}

TEST_CASE("Quaternions of any length, and a mark of the byte order, are read", "[evaluation]") {
  const TemporaryFile file(
      "\xEF\xBB\xBF"
      "1 0 0 0 1e200 0 0 1e200\n2 0 0 0 1e-200 0 0 1e-200\n3 0 0 0 1 0 0 1\n");
  const auto poses = cfp_examples::read_tum_trajectory(file.path);
  REQUIRE(poses.size() == 3);
  for (const auto& pose : poses) CHECK((pose.T_world_cam.rotation - poses[2].T_world_cam.rotation).norm() < 1e-12);
}

TEST_CASE("Lost frames as SLAM systems print them are read and found unusable", "[evaluation]") {
  const TemporaryFile file("1 nan nan nan 0 0 0 1\n2 0 0 0 0 0 0 0\n3 0 0 0 0 0 0 2\n");
  const auto poses = cfp_examples::read_tum_trajectory(file.path);
  REQUIRE(poses.size() == 3);
  CHECK_FALSE(is_usable(poses[0]));
  CHECK_FALSE(is_usable(poses[1]));
  CHECK(is_usable(poses[2]));
}
