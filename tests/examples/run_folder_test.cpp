#include "../../examples/slam_runs/run_folder.hpp"

#include "../../examples/slam_runs/read_run.hpp"
#include "support/catch.hpp"
#include "support/full_disk.hpp"
#include "support/temporary_folder.hpp"

using namespace cfp_slam;
using cfp_test::error_of;
using cfp_test::TemporaryFolder;

namespace {

RunSettings settings_of(const std::filesystem::path& recording) {
  RunSettings settings;
  settings.recording = recording.string();
  settings.detector = "hog";
  settings.seed = 18446744073709551615ULL;
  settings.min_score = 0.1;
  return settings;
}

/// Three frames as the loop tells them, one of them with a box and two keypoints, and a recording to go with them.
void write_run(const TemporaryFolder& folder, const std::string& image) {
  folder.write("recording/camera.txt", "50 50 16 12 32 24 5000\n");
  folder.write("recording/rgb.txt", "1 rgb/1.png\n");
  folder.write("recording/depth.txt", "1 depth/1.png\n");
  folder.write("recording/rgb/1.png", "no picture");
  folder.write("recording/groundtruth.txt", "1 0 0 0 0 0 0 1\n");
  std::filesystem::create_directories(folder.path / "run");
  RunWriter writer(folder.path / "run", [](std::size_t) {});
  Frame frame;
  frame.keypoints = {{1.25F, 2, 31}, {3, 4, 31}, {5, 6, 62}};
  frame.map_point_probability = {-1, 0.7F, 0.1F};
  cfp::FrameState<float> state;
  state.label = {cfp::KeypointLabel::outside, cfp::KeypointLabel::background, cfp::KeypointLabel::foreground};
  state.boxes.resize(1);
  state.boxes[0].id = -7;
  state.boxes[0].box = {1, 2, 3.5F, 4};
  state.boxes[0].detection = -1;  // compensated
  state.objects.resize(1);
  state.objects[0].static_probability = 0.1 + 0.2;
  state.objects[0].status = cfp::Status::ok;
  state.objects[0].pairs = 12;
  const std::vector<float> k{1, 0.3F, 0.4F}, fine{1, 0.6F, 1.0F / 3}, weight{1, 0.5F, 0.25F};
  cfp::StageResult<float> result;
  state.static_probability = k;
  writer.weighted(result, state, frame);
  state.static_probability = fine;
  result.weight = weight;
  result.report.stage = cfp::Stage::fine;
  writer.weighted(result, state, frame);
  FrameRecord record;
  record.time_s = 1305031102.175304;
  record.image = image;
  record.outcome = Outcome::tracked;
  record.keypoints = 3;
  record.pose.inlier_share = 0.75;
  record.pose.position_sigma_m = 0.002;
  writer.begin(Module::pose);
  writer.end(Module::pose);
  writer.finished(record);
  record.outcome = Outcome::lost;
  record.note = "too few: 3 # of 4";
  writer.finished(record);
  record.outcome = Outcome::skipped;
  writer.finished(record);
  writer.close();
  folder.write("run/trajectory.txt", "# timestamp\n1305031102.175304 1 2 3 0 0 0 1\n");
  folder.write("run/run.txt", settings_of(folder.path / "recording").text() + "keyframes 4\nmap_points 5\n");
}

}  // namespace

TEST_CASE("The report reads what the loop wrote, however long the names", "[slam]") {
  const TemporaryFolder folder;
  const std::string image = "rgb/" + std::string(600, 'x') + ".png";
  write_run(folder, image);
  const RunRecord run = read_run(folder.path / "run");
  CHECK(run.seed == 18446744073709551615ULL);
  CHECK((run.detector == "hog" && run.variant == "cfp" && run.keyframes == 4 && run.map_points == 5));
  REQUIRE(run.frames.size() == 3);
  const RunFrame& first = run.frames[0];
  CHECK(first.image == image);
  CHECK(first.time_s == 1305031102.175304);
  CHECK((first.pose.inlier_share == 0.75 && first.pose.position_sigma_m == 0.002));
  CHECK(first.T_world_cam.translation == cfp::Vector3<double>(1, 2, 3));
  CHECK(first.milliseconds[static_cast<std::size_t>(Module::pose)] > 0);
  CHECK(first.milliseconds[static_cast<std::size_t>(Module::flow)] == 0);
  REQUIRE(first.boxes.size() == 1);
  CHECK((first.boxes[0].id == -7 && first.boxes[0].compensated && first.boxes[0].object_known));
  CHECK((first.boxes[0].box.x2 == 3.5F && first.boxes[0].flow_pairs == 12));
  CHECK_THAT(first.boxes[0].object_probability, WithinAbs(0.3, 1e-9));
  REQUIRE(first.box_keypoints.size() == 2);  // none outside
  CHECK((first.box_keypoints[0].coarse == 0.3F && !first.box_keypoints[0].foreground));
  CHECK((first.box_keypoints[1].fine == 1.0F / 3 && first.box_keypoints[1].map_point == 0.1F));
  CHECK((first.box_keypoints[0].weight == 0.5F && first.box_keypoints[1].weight == 0.25F));
  CHECK((first.box_keypoints[1].size == 62 && first.box_keypoints[1].foreground));
  CHECK(run.frames[1].note == "too few: 3 # of 4");
  CHECK(run.frames[1].outcome == Outcome::lost);
  CHECK(run.frames[1].box_keypoints.empty());
  CHECK(run.frames[2].outcome == Outcome::skipped);
  CHECK(run.truth.size() == 1);
}

TEST_CASE("A file that is cut off or damaged is refused with its name", "[slam]") {
  const TemporaryFolder folder;
  const auto refused = [&](const std::string& file, const std::string& content) {
    write_run(folder, "rgb/1.png");
    folder.write("run/" + file, content);
    INFO(file << ": " << content);
    const std::string error = error_of([&] { read_run(folder.path / "run"); });
    CHECK(error.find(file) != std::string::npos);
  };
  refused("run.txt", "recording x\n");
  refused("run.txt", settings_of(folder.path / "recording").text());
  refused("frames.txt", "1 rgb/1.png tracked 0 0\n");
  refused("trajectory.txt", "");
  refused("trajectory.txt", "1 2 3\n");
  refused("trajectory.txt", "1305031109.175304 1 2 3 0 0 0 1\n");
  for (const char* line :
       {"0 1 2 3", "3 1 2 3 4 5 6 7 8", "-1 1 2 3 4 5 6 7 8", "nan 1 2 3 4 5 6 7 8", "0 1 2 3 4 5 6 7 x"})
    refused("keypoints.txt", line);
  for (const char* line : {"9 1 1 2 3 4 0 1 0.5 0", "0 1e300 1 2 3 4 0 1 0.5 0", "0 1 1 2 3 4 0 1 0.5 -1"})
    refused("boxes.txt", line);
  const std::string numbers = "keyframes 4\nmap_points 5\n", settings = settings_of(folder.path / "recording").text();
  const auto without_seed = [&](const std::string& seed) {
    const std::size_t at = settings.find("\nseed ") + 6;
    return settings.substr(0, at) + seed + settings.substr(settings.find('\n', at)) + numbers;
  };
  for (const char* seed : {"x", "", "-1", "99999999999999999999999"}) refused("run.txt", without_seed(seed));
  for (const char* count : {"-1", "1.5", "1e300", "nan"})
    refused("run.txt", settings + "keyframes 4\nmap_points " + count + "\n");
}

TEST_CASE("Only a whole run with the same settings is not run again", "[slam]") {
  const TemporaryFolder folder;
  write_run(folder, "rgb/1.png");
  const RunSettings same = settings_of(folder.path / "recording");
  CHECK(is_done(folder.path / "run", same));
  CHECK_FALSE(is_done(folder.path / "absent", same));
  for (const auto change : {+[](RunSettings& s) { s.recording += "2"; }, +[](RunSettings& s) { s.detector = "none"; },
                            +[](RunSettings& s) { s.variant = "plain"; }, +[](RunSettings& s) { s.seed = 1; },
                            +[](RunSettings& s) { s.frames = 3; }, +[](RunSettings& s) { s.features = 500; },
                            +[](RunSettings& s) { s.min_score = 0.1000001; },
                            +[](RunSettings& s) { s.options["keypoint_sigma_px"] = 0.5; }}) {
    RunSettings other = same;
    change(other);
    CHECK_FALSE(is_done(folder.path / "run", other));
  }
  std::filesystem::remove(folder.path / "run/run.txt");
  CHECK_FALSE(is_done(folder.path / "run", same));
}

TEST_CASE("Two recordings of one name have folders of their own", "[slam]") {
  const TemporaryFolder folder;
  const std::filesystem::path out = folder.path / "out";
  const RunSettings a = settings_of("/data/today/walk"), b = settings_of("/data/yesterday/walk");
  const auto of_a = run_folder(out, a), of_b = run_folder(out, b);
  CHECK(of_a.parent_path().filename() == "walk");
  CHECK(of_b.parent_path().filename() == "walk_2");
  for (int again = 0; again < 2; ++again) {
    CHECK(run_folder(out, b) == of_b);
    CHECK(run_folder(out, a) == of_a);
  }
  RunSettings plain = a;
  plain.variant = "plain";
  CHECK(run_folder(out, plain).parent_path() == of_a.parent_path());
  CHECK(run_folder(out, plain) != of_a);
}

TEST_CASE("The finished runs of a folder are found, unfinished ones are not", "[slam]") {
  const TemporaryFolder folder;
  folder.write("walk/cfp_1/run.txt", "x");
  folder.write("walk/plain_1/frames.txt", "x");
  folder.write("desk/cfp_1/run.txt", "x");
  const auto found = run_folders(folder.path);
  REQUIRE(found.size() == 2);
  CHECK(found[0] == folder.path / "desk/cfp_1");
  CHECK(found[1] == folder.path / "walk/cfp_1");
}

#if defined(__unix__)
TEST_CASE("A full disk is an error that names the file, and no file is half of what it says", "[slam]") {
  const TemporaryFolder folder;
  const std::string image = "rgb/" + std::string(6000, 'x') + ".png";
  std::string error;
  {
    const cfp_test::FullDisk full(4096);
    error = error_of([&] { write_run(folder, image); });
  }
  CHECK(error == "cannot write " + (folder.path / "run/frames.txt").string());
  CHECK_FALSE(std::filesystem::exists(folder.path / "run/run.txt"));
  {
    const cfp_test::FullDisk full(4);
    error = error_of([&] { run_folder(folder.path / "out", settings_of(folder.path / "recording")); });
  }
  CHECK(error.find("recording.txt") != std::string::npos);
  CHECK_FALSE(std::filesystem::exists(run_folder(folder.path / "out", settings_of(folder.path / "recording"))));
}
#endif

TEST_CASE("What frames said is summed up without its numbers, of a file's lines the first in full", "[slam]") {
  Said said;
  FrameRecord record;
  for (const char* note : {"gap before this frame: 0.5 s", "a/rgb.txt:7: no depth image near its time; lost, jump: 3",
                           "gap before this frame: 0.7 s; a/rgb.txt:9: 8.png: not there", "7: seven"}) {
    record.note = note;
    listen(record, said);
  }
  CHECK(text_of(said) ==
        "1x 7; 2x a/rgb.txt (a/rgb.txt:7: no depth image near its time); 2x gap before this frame; 1x lost, jump");
}
