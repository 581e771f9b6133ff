#include "../../examples/slam_report/explained.hpp"

#include <opencv2/imgproc.hpp>

#include "../../examples/slam_runs/run_writer.hpp"
#include "support/catch.hpp"
#include "support/temporary_folder.hpp"

using namespace cfp_slam;

namespace {

/// Keypoint i of frame 1 with what the fine stage said of it.
Decision decision(std::size_t i, cfp::KeypointLabel label, double k, double weight) {
  Decision d;
  d.frame = 1;
  d.x = 10 * float(i);
  d.why.keypoint = i;
  d.why.label = label;
  d.why.box = label == cfp::KeypointLabel::outside ? cfp::no_box : 0;
  d.why.stage = cfp::Stage::fine;
  d.why.associated = d.why.high_dynamic = true;
  d.why.coarse_probability = label == cfp::KeypointLabel::foreground ? 0 : 0.3;
  d.why.projection = {true, 1, 1, k, 1};
  d.why.epipolar = d.why.projection;
  d.why.weight = weight;
  return d;
}

}  // namespace

TEST_CASE("The report tells of every keypoint why it has its weight, and picks out three", "[slam]") {
  using cfp::KeypointLabel;
  const cfp_test::TemporaryFolder folder;
  std::string text;
  for (const Decision& d :
       {decision(0, KeypointLabel::outside, 1, 1), decision(1, KeypointLabel::foreground, 0.4, 0.1),
        decision(2, KeypointLabel::foreground, 0.01, 0), decision(3, KeypointLabel::background, 0.9, 0.8),
        decision(4, KeypointLabel::background, 0.95, 0.9), decision(5, KeypointLabel::foreground, 0.95, 0.93)})
    text += decision_line(d) + "\n";
  folder.write("run/decisions.txt", text);
  cv::imwrite((folder.path / "1.png").string(), cv::Mat(24, 32, CV_8UC3, cv::Scalar(9, 9, 9)));
  RunRecord run;
  run.recording = folder.path.string();
  run.variant = "<cfp>";
  run.frames.resize(3);
  run.frames[1].image = run.frames[2].image = "1.png";
  run.frames[1].box_keypoints.resize(5);  // the most
  add_explained(run, folder.path / "run", {});
  REQUIRE(run.explained.size() == 1);
  CHECK(run.explained[0].decisions.size() == 6);
  const std::vector<Interesting> three = interesting(run.explained[0].decisions);
  REQUIRE(three.size() == 3);
  CHECK((three[0].index == 2 && three[1].index == 4 && three[2].index == 5));
  const std::string html = explained_section(series_of({&run}));
  for (int i = 0; i < 6; ++i) CHECK(html.find("<title>keypoint " + std::to_string(i) + ": ") != std::string::npos);
  CHECK(html.find("data-keypoint=\"5\"") != std::string::npos);
  CHECK(html.find("<cfp>") == std::string::npos);

  run.explained.clear();
  add_explained(run, folder.path / "run", {2, 0, 77});  // without keypoints, without an image, not there
  REQUIRE(run.explained.size() == 1);
  CHECK(run.explained[0].decisions.empty());
  CHECK(interesting({}).empty());
  run.explained.clear();
  add_explained(run, folder.path, {});  // no such file
  CHECK(explained_section(series_of({&run})).empty());
}
