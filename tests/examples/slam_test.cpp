#include "../../examples/slam/loop/run.hpp"

#include <cstdlib>
#include <opencv2/imgcodecs.hpp>
#include <unordered_map>

#include "../../examples/detection/simple_detectors.hpp"
#include "../../examples/slam_report/annotate.hpp"
#include "../../examples/slam_report/calibrate.hpp"
#include "../../examples/slam_runs/read_run.hpp"
#include "../../examples/slam_runs/run_folder.hpp"
#include "../../examples/slam_runs/stress_result.hpp"
#include "../../examples/synthetic/writer.hpp"
#include "support/catch.hpp"
#include "support/data.hpp"
#include "support/temporary_folder.hpp"

using namespace cfp_slam;

namespace {

constexpr std::size_t frames = 48;

/// A recording that many tests read. Each test is a process of ctest's, which has the recordings made before all of
/// them; a program that is run by hand makes its own.
std::filesystem::path recording(const char* name, const synthetic::SequenceOptions& options) {
  static const cfp_test::TemporaryFolder own;
  const char* shared = std::getenv("CFP_TEST_RECORDINGS");
  const std::filesystem::path folder = (shared ? std::filesystem::path(shared) : own.path) / name;
  if (!std::filesystem::exists(folder)) {
    std::filesystem::create_directories(folder);
    synthetic::write_sequence(synthetic::Sequence(options), folder, 2, [](int) {});
  }
  return folder;
}

/// A small walking sequence.
std::filesystem::path rendered() {
  synthetic::SequenceOptions options;
  options.scenario = synthetic::Scenario::walking;
  options.motion = synthetic::Motion::xyz;
  options.frames = static_cast<int>(frames);
  options.camera = synthetic::SequenceOptions::default_camera(320);
  return recording("walking", options);
}

/// A room without people.
std::filesystem::path empty_room() {
  synthetic::SequenceOptions options;
  options.motion = synthetic::Motion::halfsphere;
  options.frames = 120;
  options.people = 0;
  options.camera = synthetic::SequenceOptions::default_camera(320);
  return recording("empty_room", options);
}

using cfp_examples::FileDetector;
using cfp_examples::NoDetector;
using cfp_examples::Sequence;

/// What the report reads of what the loop wrote.
RunRecord run(const std::filesystem::path& folder, const std::string& variant = "cfp") {
  const cfp_test::TemporaryFolder out;
  FileDetector detector((folder / "detections.txt").string(), {});
  RunSettings settings;
  settings.recording = folder.string();
  settings.variant = variant;
  run_into(out.path, Sequence(folder), detector, settings, false, [](std::size_t) {});
  return read_run(out.path);
}

std::size_t count(const RunRecord& run, Outcome outcome) {
  return static_cast<std::size_t>(
      std::count_if(run.frames.begin(), run.frames.end(), [=](const RunFrame& f) { return f.outcome == outcome; }));
}

/// The rendered sequence with other images in some places.
template <typename Change>
cfp_test::TemporaryFolder& changed(cfp_test::TemporaryFolder& folder, const Change& change) {
  std::filesystem::copy(rendered(), folder.path, std::filesystem::copy_options::recursive);
  const Sequence sequence(folder.path);
  for (std::size_t k = 0; k < sequence.size(); ++k) change(k, folder.path / sequence.load(k).image);
  return folder;
}

}  // namespace

TEST_CASE("The recordings that the other tests read", "[.recordings]") {
  const char* shared = std::getenv("CFP_TEST_RECORDINGS");
  REQUIRE(shared);
  std::filesystem::remove_all(shared);
  CHECK(Sequence(rendered()).size() == frames);
  CHECK(Sequence(empty_room()).size() == 120);
}

TEST_CASE("A sequence with walking people: every frame is tracked, to a centimetre", "[slam]") {
  RunRecord r = run(rendered());
  add_pictures(r, r.recording, 4);
  CHECK(count(r, Outcome::tracked) == frames);
  REQUIRE(r.absolute.coverage.matched == frames);
  CHECK(r.absolute.translation_m.rmse < 0.01);
  CHECK(r.relative.rotation_deg.rmse < 0.5);
  CHECK(r.keyframes >= 1);
  CHECK(r.pictures.size() == 4);
  CHECK_FALSE(r.pictures[0].jpeg.empty());
  CHECK_FALSE(r.second_stage.probability.empty());
  CHECK(r.second_stage.probability.size() == r.first_stage.probability.size());
}

TEST_CASE("Why every keypoint of every frame has its weight is on file when asked for", "[slam]") {
  const cfp_test::TemporaryFolder out;
  FileDetector detector((rendered() / "detections.txt").string(), {});
  RunSettings settings;
  settings.recording = rendered().string();
  settings.frames = 20;
  settings.decisions = true;
  CHECK_FALSE(is_done(out.path, settings));
  run_into(out.path, Sequence(rendered()), detector, settings, false, [](std::size_t) {});
  CHECK(is_done(out.path, settings));
  const RunRecord r = read_run(out.path);
  std::vector<std::size_t> keypoints(r.frames.size()), in_boxes(r.frames.size());
  std::size_t near = 0, seen = 0, heavy = 0;
  for_each_decision(out.path / "decisions.txt", [&](const Decision& d) {
    REQUIRE(d.frame < r.frames.size());
    CHECK(d.why.keypoint == keypoints[d.frame]++);
    CHECK((d.why.weight >= 0 && d.why.weight <= 1));
    if (d.why.box != cfp::no_box) {
      const BoxKeypoint& same = r.frames[d.frame].box_keypoints.at(in_boxes[d.frame]++);
      CHECK((same.x == d.x && same.y == d.y && same.coarse == float(d.why.coarse_probability)));
      if (same.fine >= 0) CHECK(same.fine == float(d.why.static_probability));
      CHECK(r.frames[d.frame].boxes.at(std::size_t(d.why.box)).id == d.why.track);
    }
    if (d.map_point == no_point) return;
    CHECK(d.why.map_point_probability >= 0);
    ++seen;
    near += d.residual_px >= 0 && d.residual_px < 3 * d.size / 31 ? 1 : 0;
    heavy += d.why.weight > 0.5 ? 1 : 0;
  });
  for (std::size_t k = 0; k < r.frames.size(); ++k) {
    CHECK(keypoints[k] == r.frames[k].keypoints);
    CHECK(in_boxes[k] == r.frames[k].box_keypoints.size());
  }
  CHECK(seen > 20 * 100);
  CHECK(double(near) > 0.95 * double(seen));
  CHECK(double(heavy) > 0.7 * double(seen));

  // A calibration that changes nothing gives every sample the weight that it had.
  CalibrationData data;
  add_run(out.path, r, data);
  CHECK(data.samples.size() > 500);
  CHECK(data.residuals_px.size() > 1000);
  for (const CalibrationSample& s : data.samples)
    CHECK_THAT(weight_with(s, chosen(data.options), data.options), WithinAbs(double(s.weight), 1e-3));
  CalibratedOptions none = chosen(data.options);
  none.min_translation_m = 1e9;
  for (const CalibrationSample& s : data.samples) {
    CalibrationSample without = s;
    without.known.epipolar = {};
    CHECK(weight_with(s, none, data.options) == weight_with(without, chosen(data.options), data.options));
  }

  settings.decisions = false;
  run_into(out.path, Sequence(rendered()), detector, settings, false, [](std::size_t) {});
  CHECK_FALSE(std::filesystem::exists(out.path / "decisions.txt"));
}

TEST_CASE("Threads change the time, not a bit of the trajectory", "[slam]") {
  std::vector<cfp::StampedPose<double>> trajectories[2];
  for (const bool threads : {false, true}) {
    FileDetector detector((rendered() / "detections.txt").string(), {});
    Options options;
    options.threads = threads;
    Observer nobody;
    trajectories[threads] = run_slam(Sequence(rendered()), detector, options, nobody).trajectory;
  }
  const auto &one = trajectories[0], &many = trajectories[1];
  REQUIRE(one.size() == frames);
  REQUIRE(one.size() == many.size());
  for (std::size_t k = 0; k < one.size(); ++k) {
    CHECK(one[k].T_world_cam.rotation == many[k].T_world_cam.rotation);
    CHECK(one[k].T_world_cam.translation == many[k].T_world_cam.translation);
  }
}

TEST_CASE("Every variant runs the sequence to its end", "[slam]") {
  for (int v = 0; v <= static_cast<int>(cfp::Variant::plain); ++v) {
    const RunRecord r = run(rendered(), cfp::to_string(static_cast<cfp::Variant>(v)));
    CAPTURE(r.variant);
    CHECK(r.frames.size() == frames);
    for (const RunFrame& f : r.frames) CHECK(cfp::is_usable(cfp::StampedPose<double>{f.time_s, f.T_world_cam}));
  }
}

TEST_CASE("Frames that show nothing are lost, none is invented, and the map finds the camera again", "[slam]") {
  cfp_test::TemporaryFolder folder;
  changed(folder, [](std::size_t k, const std::filesystem::path& image) {
    if (k >= 20 && k < 26) cv::imwrite(image.string(), cv::Mat(240, 320, CV_8UC3, cv::Scalar(90, 90, 90)));
  });
  const RunRecord r = run(folder.path);
  for (std::size_t k = 20; k < 26; ++k) {
    CHECK(r.frames[k].outcome == Outcome::lost);
    CHECK_FALSE(r.frames[k].note.empty());
  }
  for (std::size_t k = 26; k < 31; ++k) CHECK(r.frames[k].outcome == Outcome::relocalised);  // on probation
  CHECK(count(r, Outcome::tracked) == frames - 6 - 5);
  CHECK(r.trajectory().size() == frames - 6);
  CHECK(r.absolute.translation_m.rmse < 0.01);
}

TEST_CASE("The fine stage after a relocalisation rests on the inliers of the pose that it found", "[slam]") {
  // From frame 24 on the camera stands on its head: nothing is where the motion model expects it, all is in the map.
  cfp_test::TemporaryFolder folder;
  changed(folder, [](std::size_t k, const std::filesystem::path& image) {
    if (k < 24) return;
    for (const std::filesystem::path& file : {image, image.parent_path().parent_path() / "depth" / image.filename()}) {
      cv::Mat turned;
      cv::flip(cv::imread(file.string(), cv::IMREAD_UNCHANGED), turned, -1);
      cv::imwrite(file.string(), turned);
    }
  });
  struct Confidence final : Observer {
    void weighted(const cfp::StageResult<float>& result, const cfp::FrameState<float>&, const Frame&) override {
      if (result.report.stage == cfp::Stage::fine) last = result.report.projection.confidence;
    }
    void finished(const FrameRecord& record) override {
      outcomes.push_back(record.outcome);
      confidence.push_back(last);
      last = -1;
    }
    double last = -1;
    std::vector<double> confidence;
    std::vector<Outcome> outcomes;
  } observer;
  NoDetector detector;
  Options options;
  options.threads = false;
  options.probability.fine.min_pose_inliers = 100;  // C_s is then a step at 50 inliers
  run_slam(Sequence(folder.path), detector, options, observer);
  REQUIRE(observer.outcomes.size() == frames);
  CAPTURE(observer.confidence[23], observer.confidence[24]);
  REQUIRE(observer.outcomes[24] == Outcome::relocalised);
  CHECK(observer.confidence[24] > 0.5 * observer.confidence[23]);
}

namespace {

/// The empty room under a stress.
StressResult under(const Stress& stress, std::vector<FrameRecord>& records, Options options = {}) {
  const Sequence sequence(empty_room());
  NoDetector none;
  StressedDetector detector(none, sequence, stress);
  StressObserver observer;
  options.threads = false;
  const RunResult result = run_slam(stressed(sequence, stress, 120), detector, options, observer);
  records = observer.records;
  return judge(sequence, stress, records, result);
}
StressResult under(const char* name, std::vector<FrameRecord>& records, const Options& options = {}) {
  for (const Stress& stress : stresses(120, 30, Sequence(empty_room()).calibration())) {
    if (stress.name == name) return under(stress, records, options);
  }
  FAIL("no stress " << name);
  return {};
}

}  // namespace

TEST_CASE("After a gap the pose comes from the map, and is on probation", "[slam]") {
  std::vector<FrameRecord> records;
  const StressResult result = under("gap of 1 s", records);
  REQUIRE(records.size() == 90);
  CHECK(records[39].outcome == Outcome::tracked);
  CHECK(records[40].note.find("gap") != std::string::npos);
  for (std::size_t k = 40; k < 45; ++k) {
    CHECK(records[k].outcome == Outcome::relocalised);
    CHECK_FALSE(records[k].keyframe);
  }
  CHECK(records[45].outcome == Outcome::tracked);
  CHECK(result.right == 90);
  CHECK(result.recovery == 0);
}

TEST_CASE("What crosses the view and no detector knows does not take the camera with it", "[slam]") {
  std::vector<FrameRecord> records;
  const StressResult result = under("board over 40 %", records);
  CHECK(result.wrong == 0);
  CHECK(result.right >= 105);
}

namespace {

/// A board over all of the view from frame `first` to `last`.
Stress board_over_all(std::size_t first, std::size_t last) {
  const double units = Sequence(empty_room()).calibration().depth_units_per_metre;
  Stress stress;
  stress.name = "board over all";
  stress.first = first;
  stress.last = last;
  stress.image = [=](std::size_t k, cfp_examples::SequenceFrame& f) {
    cfp_slam::detail::carry_board(0.3 + 0.4 * static_cast<double>(k - first) / static_cast<double>(last - first), 3.0,
                                  1.1, units, f);
  };
  return stress;
}

}  // namespace

TEST_CASE("A new map that has stood its trial stays apart: its poses are not called tracked", "[slam]") {
  std::vector<FrameRecord> records;
  const StressResult result = under(board_over_all(20, 119), records);
  CAPTURE(result.reported);
  CHECK(result.reported.find("1x new map") != std::string::npos);
  CHECK(result.reported.find("given up") == std::string::npos);
  for (std::size_t k = 20; k < 119; ++k) CHECK(records[k].outcome != Outcome::tracked);
  CHECK(records[90].outcome == Outcome::relocalised);  // 30 frames lost, 30 on trial
}

TEST_CASE("A new map of what covers the view is given up when that goes, and no pose in it was called tracked",
          "[slam]") {
  std::vector<FrameRecord> records;
  const StressResult result = under(board_over_all(45, 95), records);
  CAPTURE(result.reported);
  CHECK(result.reported.find("1x new map") != std::string::npos);
  CHECK(result.reported.find("1x the new map is given up") != std::string::npos);
  for (std::size_t k = 45; k < 95; ++k) CHECK(records[k].outcome != Outcome::tracked);
  CHECK(records.back().outcome == Outcome::tracked);
  CHECK(result.wrong == 0);
  CHECK(result.right == result.poses);
  CHECK(result.poses <= 70);  // none of those before the board is left
}

TEST_CASE("A camera that goes there and back needs no larger map the longer it does", "[slam]") {
  struct MapSizes final : Observer {
    std::vector<double> keyframes, points;  // after each frame
    void decided(const cfp::StaticProbability<Camera>&, const Frame&, const Map& map) override {
      keyframes.push_back(static_cast<double>(map.alive_keyframes.size()));
      points.push_back(static_cast<double>(map.alive_points()));
    }
  } sizes;
  const Sequence sequence(empty_room());
  FrameSource source(sequence);
  source.size = 720;
  source.load = [&](std::size_t k) {
    cfp_examples::SequenceFrame frame = sequence.load(k / 120 % 2 == 0 ? k % 120 : 119 - k % 120);
    frame.time_s = static_cast<double>(k) / 30;
    return frame;
  };
  NoDetector none;
  Options options;
  options.threads = false;
  const RunResult result = run_slam(source, none, options, sizes);
  REQUIRE(sizes.points.size() == 720);
  CAPTURE(sizes.keyframes[239], sizes.keyframes[719], sizes.points[239], sizes.points[719]);
  CHECK(sizes.keyframes[719] < 1.5 * sizes.keyframes[239]);
  CHECK(sizes.points[719] < 1.3 * sizes.points[239]);
  REQUIRE(result.trajectory.size() == 720);
  for (std::size_t k = 0; k < 720; ++k) {  // where it is does not change with the pass
    const auto center = [&](std::size_t frame) { return result.trajectory[frame].T_world_cam.translation; };
    CHECK((center(k) - center(k % 240)).norm() < 0.02);
  }
}

TEST_CASE("After a second of being lost a new map begins", "[slam]") {
  std::vector<FrameRecord> records;
  const StressResult result = under("halves", records);
  REQUIRE(records.size() == 120);
  for (std::size_t k = 40; k < 69; ++k) CHECK(records[k].outcome == Outcome::lost);
  CHECK(result.reported.find("1x new map") != std::string::npos);
  CHECK(result.wrong == 0);
  CHECK(result.right == result.poses);
}

TEST_CASE("A new map that has stood its trial is joined to the old one when both are in view", "[slam]") {
  std::vector<FrameRecord> records;
  Options options;
  options.new_map_after_s = 0.7;  // and for as long on trial, which ends before they are
  const StressResult result = under("halves", records, options);
  REQUIRE(records.size() == 120);
  CHECK(result.reported.find("1x new map") != std::string::npos);
  CHECK(result.reported.find("1x joined") != std::string::npos);
  CHECK(result.wrong == 0);
  CHECK(result.right == result.poses);
}

TEST_CASE("Poses of a new map by what moved away before it was joined are taken back", "[slam]") {
  // A board fills the view and moves with a camera that believes to stand still before it, then it goes.
  Stress stress;
  stress.name = "board";
  stress.first = 20;
  stress.last = 90;
  const double units = Sequence(empty_room()).calibration().depth_units_per_metre;
  stress.image = [&](std::size_t k, SequenceFrame& frame) {
    const double shown = k < 70 ? 0.5 : 0.5 + 0.5 * double(k - 70) / 20;  // its left edge leaves to the right
    detail::carry_board(shown, 1, 1.1, units, frame);
  };
  std::vector<FrameRecord> records;
  Options options;
  options.new_map_after_s = 0.3;
  const StressResult result = under(stress, records, options);
  CAPTURE(result.reported, result.poses, result.right, result.rmse_m);
  CHECK(result.reported.find("1x joined") != std::string::npos);
  CHECK(result.reported.find("1x poses by what has gone since are taken back") != std::string::npos);
  CHECK(result.wrong == 0);
  CHECK(result.poses - result.right < 3);  // a keyframe that saw board and room may stay
}

namespace {

/// Of the rendered recording, every frame.
std::vector<FrameRecord> records_with(cfp_examples::Detector& detector) {
  StressObserver observer;
  Options options;
  options.threads = false;
  run_slam(Sequence(rendered()), detector, options, observer);
  REQUIRE(observer.records.size() == frames);
  return observer.records;
}

}  // namespace

TEST_CASE("A detector that falls silent is noticed, and what it knew is carried on", "[slam]") {
  struct Silent final : cfp_examples::Detector {
    Silent() : Detector("silent", {"person"}) {}
    cfp_examples::Detections detect(const cv::Mat& bgr, double) override {
      const float shift = 0.01F * static_cast<float>(++frame_);
      if (frame_ > 20) return {};
      return {{{0.3F * float(bgr.cols) + shift, 10, 0.6F * float(bgr.cols), float(bgr.rows) - 10}, 0, 0.9F}};
    }
    int frame_ = 0;
  } detector;
  struct BoxCounter final : StressObserver {
    void weighted(const cfp::StageResult<float>& result, const cfp::FrameState<float>& state, const Frame&) override {
      if (result.report.stage == cfp::Stage::coarse) boxes.push_back(state.boxes.size());
    }
    std::vector<std::size_t> boxes;
  } observer;
  Options options;
  options.threads = false;
  run_slam(Sequence(rendered()), detector, options, observer);
  REQUIRE(observer.records.size() == frames);
  REQUIRE(observer.boxes.size() == frames);
  for (std::size_t k = 0; k < frames; ++k) {
    CAPTURE(k);
    CHECK((observer.records[k].note.find("detector silent") != std::string::npos) == (k >= 22));
    CHECK(observer.boxes[k] == 1);  // six frames without its being noticed
  }
}

TEST_CASE("A detector that is late is noticed, and what was known to move stays so meanwhile", "[slam]") {
  const Sequence sequence(rendered());
  FileDetector in_time((rendered() / "detections.txt").string(), {});
  Stress late;
  late.last = frames;
  late.detections = [](std::size_t, const std::vector<cfp_examples::Detections>& seen) {
    return seen[seen.size() - std::min<std::size_t>(seen.size(), 8)];
  };
  StressedDetector detector(in_time, sequence, late);
  struct Learning final : Observer {
    struct Known {
      int created_by;
      float probability;
    };
    void decided(const cfp::StaticProbability<Camera>&, const Frame&, const Map& map) override {
      for (const auto& [index, known] : moving) {
        if (!late || !map.is_alive(index) || map.point(index).created_by != known.created_by) continue;
        ++compared;
        CHECK(map.point(index).static_probability <= known.probability);
      }
      moving.clear();
      for (int p = 0; p < static_cast<int>(map.points.size()); ++p) {
        if (map.is_alive(p) && map.point(p).static_probability < 0.5F)
          moving[p] = {map.point(p).created_by, map.point(p).static_probability};
      }
    }
    void finished(const FrameRecord& record) override {
      late = record.note.find("detector late by 0.") != std::string::npos;
      late_frames += late ? 1 : 0;
    }
    std::unordered_map<int, Known> moving;
    bool late = false;
    int late_frames = 0, compared = 0;
  } observer;
  Options options;
  options.threads = false;
  options.detector_lag.min_boxes = 4;
  run_slam(sequence, detector, options, observer);
  CHECK(observer.late_frames >= 5);
  CHECK(observer.compared >= 20);
}

TEST_CASE("A detector that has nothing left to see is not called silent", "[slam]") {
  struct Leaving final : cfp_examples::Detector {
    Leaving() : Detector("leaving", {"person"}) {}
    cfp_examples::Detections detect(const cv::Mat& bgr, double) override {
      const float right = float(bgr.cols), x = 0.3F * right + 0.03F * right * static_cast<float>(frame_++);
      if (frame_ > 16) return {};  // too wide for a box that leaves, and gone six frames later
      return {{{x, 10, std::min(x + 0.25F * right, right), float(bgr.rows) - 10}, 0, 0.9F}};
    }
    int frame_ = 0;
  } detector;
  const std::vector<FrameRecord> records = records_with(detector);
  for (std::size_t k = 30; k < frames; ++k) {
    CAPTURE(k);
    CHECK(records[k].note.empty());
  }
}

TEST_CASE("Damaged frames are skipped with their line; the others are tracked", "[slam]") {
  cfp_test::TemporaryFolder folder;
  changed(folder, [&](std::size_t k, const std::filesystem::path& image) {
    if (k == 10) std::filesystem::remove(image);
    if (k == 11) std::filesystem::resize_file(image, 200);
    if (k == 12) cv::imwrite(image.string(), cv::Mat(100, 100, CV_8UC3, cv::Scalar(0, 0, 0)));
  });
  const RunRecord r = run(folder.path);
  for (std::size_t k = 10; k < 13; ++k) {
    CHECK(r.frames[k].outcome == Outcome::skipped);
    CHECK(r.frames[k].note.find("rgb.txt:") != std::string::npos);
  }
  CHECK(count(r, Outcome::skipped) == 3);
  CHECK(r.trajectory().size() == frames - 3);
  CHECK(r.absolute.translation_m.rmse < 0.01);
}

TEST_CASE("A recording that disappears while it is read costs its own frames, and nothing that was done", "[slam]") {
  for (const bool threads : {false, true}) {
    cfp_test::TemporaryFolder folder;
    const cfp_test::TemporaryFolder out;
    std::filesystem::copy(rendered(), folder.path, std::filesystem::copy_options::recursive);
    FileDetector detector((folder.path / "detections.txt").string(), {});
    RunSettings settings;
    settings.recording = folder.path.string();
    const auto unmounted = [&](std::size_t done) {
      if (done == 20) std::filesystem::remove_all(folder.path);
    };
    const std::string said = run_into(out.path, Sequence(folder.path), detector, settings, threads, unmounted);
    CHECK(said.find("rgb.txt") != std::string::npos);
    CHECK(cfp_test::error_of([&] { read_run(out.path); }).find(folder.path.string()) != std::string::npos);
    std::filesystem::copy(rendered(), folder.path, std::filesystem::copy_options::recursive);
    const RunRecord r = read_run(out.path);
    CHECK(r.frames.size() == frames);
    CHECK(count(r, Outcome::tracked) + count(r, Outcome::skipped) == frames);
    CHECK(count(r, Outcome::tracked) >= 20);
    CHECK(count(r, Outcome::tracked) <= 22);
  }
}

TEST_CASE("A detector that throws ends the run with its words; the folder is no run, and can be one", "[slam]") {
  struct Broken final : cfp_examples::Detector {
    Broken() : Detector("broken", {}) {}
    cfp_examples::Detections detect(const cv::Mat&, double) override {
      if (++frame == 7) throw std::runtime_error("the detector's cable is out");
      return {};
    }
    int frame = 0;
  };
  const Sequence sequence(rendered());
  for (const bool threads : {false, true}) {
    const cfp_test::TemporaryFolder out;
    RunSettings settings;
    settings.recording = rendered().string();
    settings.frames = 12;
    Broken broken;
    const auto run_it = [&] { run_into(out.path, sequence, broken, settings, threads, [](std::size_t) {}); };
    CHECK(cfp_test::error_of(run_it) == "the detector's cable is out");
    CHECK_FALSE(is_done(out.path, settings));
    CHECK(cfp_test::error_of(run_it).empty());
    CHECK(is_done(out.path, settings));
  }
}

TEST_CASE("Two men stand up in a real clip: every frame has a pose, within centimetres of a published estimate",
          "[slam]") {
  CFP_REQUIRE_DATA(folder, "tum_fr3_walking_halfsphere_30");
  const RunRecord r = run(folder);
  CHECK(count(r, Outcome::tracked) == 30);
  CHECK(r.absolute.translation_m.rmse < 0.02);
}
