#include "../../examples/slam_report/calibrate.hpp"

#include "cfp/core/random.hpp"
#include "support/catch.hpp"
#include "support/temporary_folder.hpp"

using namespace cfp_slam;
using cfp_test::error_of;

namespace {

/// Keypoints on an object that rests, of which `wrong` of the walls' epipolar evidence is noise below `noisy_m`.
CalibrationData made(double noisy_m) {
  CalibrationData data;
  data.options_text = "none";
  cfp::Random random(3, "calibrate");
  for (int n = 0; n < 4000; ++n) {
    CalibrationSample s;
    s.is_static = n % 2 == 0;
    s.step_m = 0.04 * random.uniform();
    const bool noise = s.step_m < noisy_m;
    s.known.foreground = false;
    s.known.matched = s.known.box_associated = true;
    s.known.object_probability = 0.1F;
    s.known.projection = {0.6F, 1, true};
    s.known.epipolar = {noise ? float(random.uniform()) : s.is_static ? 0.95F : 0.05F, 1, true};
    s.map_point = 0.5F;
    s.weight = weight_with(s, chosen(data.options), data.options);
    data.samples.push_back(s);
  }
  for (int n = 0; n < 4000; ++n) data.residuals_px.push_back(std::hypot(0.4 * random.normal(), 0.4 * random.normal()));
  return data;
}

}  // namespace

TEST_CASE("The noise of keypoints is found although the pose has left out the far ones", "[slam]") {
  cfp::Random random(9, "residuals");
  for (const double sigma : {0.3, 1.0, 1.4}) {
    std::vector<double> residuals;
    while (residuals.size() < 20000) {
      const double r = std::hypot(sigma * random.normal(), sigma * random.normal());
      if (r * r < 5.991) residuals.push_back(r);
    }
    CAPTURE(sigma);
    CHECK_THAT(keypoint_sigma(residuals, 1), WithinAbs(sigma, 0.06 * sigma));
  }
  CHECK(keypoint_sigma({2.4, 2.4, 2.4}, 1) == 2);  // as much noise as can be told
}

TEST_CASE("t_Th is where the epipolar constraint begins to know something", "[slam]") {
  const CalibrationData data = made(0.01);
  const CalibratedOptions best = calibrated(data);
  CHECK_THAT(best.min_translation_m, WithinAbs(0.01, 0.0026));
  CHECK(judged(data, &best).brier < 0.95 * judged(data, nullptr).brier);
  CHECK(calibrated(made(0)).min_translation_m == data.options.probability.fine.min_translation_m);
}

TEST_CASE("Measured options are written for a run to read; without enough labels nothing is", "[slam]") {
  const cfp_test::TemporaryFolder folder;
  CalibrationData data = made(0.01);
  calibrate(data, folder.path / "options.txt");
  const OptionValues values = read_options(folder.path / "options.txt");
  REQUIRE(values.size() == 4);
  CHECK_THAT(values.at("keypoint_sigma_px"), WithinAbs(0.4, 0.03));
  CHECK(values.at("probability.fine.min_translation_m") > 0.005);
  for (const auto& [name, value] : values) {
    Options options;
    CHECK(set_option(options, name, value));
    CHECK_FALSE(cfp::invalid_field(options.probability));
  }
  data.samples.resize(150);
  CHECK_FALSE(error_of([&] { calibrate(data, folder.path / "none.txt"); }).empty());
  CHECK_FALSE(std::filesystem::exists(folder.path / "none.txt"));
}

TEST_CASE("Options come from a file, go through a run's settings, and are refused with file and line", "[slam]") {
  const cfp_test::TemporaryFolder folder;
  const auto file = [&](const std::string& text) { return folder.write("o.txt", text); };
  const OptionValues values =
      read_options(file("# mine\nprobability.object_threshold 0.8\n\nbaseline_fx 38.25 # px m\n"));
  REQUIRE(values.size() == 2);
  const Options options = options_from_text(options_text(values));
  CHECK(options.probability.object_threshold == 0.8);
  CHECK(options.baseline_fx == 38.25);
  CHECK(options.keypoint_sigma_px == 1);
  CHECK(options_text({}) == "none");
  CHECK(options_from_text("none").baseline_fx == Options().baseline_fx);
  for (const char* bad :
       {"baseline_fx", "baseline_fx 1 2", "baseline_fx much", "base 1", "baseline_fx 1\nbaseline_fx 2", "baseline_fx 0",
        "keypoint_sigma_px nan", "keypoint_sigma_px -1", "give_depths 5", "flow_edge_px inf", "features.room_share 5",
        "unproven_share -3", "min_known_share nan"}) {
    INFO(bad);
    CHECK(error_of([&] { read_options(file(bad)); }).find("o.txt:") != std::string::npos);
  }
  const auto complaint = [&](const char* text) { return error_of([&] { read_options(file(text)); }); };
  CHECK(complaint("# mine\nprobability.map_point.rate 7").find("o.txt:2: probability.map_point.rate") !=
        std::string::npos);
  // Each alone would be out of range.
  CHECK(complaint("probability.coarse.flow.motion.min_sigma_px 50\nprobability.coarse.flow.motion.max_sigma_px 60") ==
        "");
  for (const char* bad : {"baseline_fx=", "baseline_fx", "base=1"})
    CHECK_FALSE(error_of([&] { options_from_text(bad); }).empty());
}
