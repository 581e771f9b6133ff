#include "../../examples/slam_report/report.hpp"

#include "../../examples/slam_report/picture.hpp"

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <limits>
#include <regex>

#include "support/catch.hpp"
#include "support/fake_runs.hpp"

using namespace cfp_slam;

namespace {

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t n = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + part.size())) ++n;
  return n;
}

/// Elements are closed in the order in which they were opened, as XML demands; void elements of HTML excepted.
std::string first_unbalanced(const std::string& html) {
  std::vector<std::string> open;
  for (std::size_t at = html.find('<'); at != std::string::npos; at = html.find('<', at + 1)) {
    const std::size_t end = html.find('>', at);
    if (html[at + 1] == '!' || end == std::string::npos) continue;
    const bool closes = html[at + 1] == '/';
    const std::size_t from = at + (closes ? 2 : 1);
    const std::string name = html.substr(from, html.find_first_of(" />", from) - from);
    if (name == "meta" || name == "input" || name == "img" || html[end - 1] == '/') continue;
    if (!closes) {
      open.push_back(name);
    } else if (open.empty() || open.back() != name) {
      return name;
    } else {
      open.pop_back();
    }
  }
  return open.empty() ? std::string() : open.back();
}

void check_page(const std::string& page) {
  CHECK(first_unbalanced(page) == "");
  for (const char* broken : {"nan", "NaN", "inf\"", "inf ", "-inf"}) CHECK(count(page, broken) == 0);
  for (const char* remote : {"http:", "https:", "<script", "<link", "@import", "url("}) CHECK(count(page, remote) == 0);
}

}  // namespace

TEST_CASE("Text is escaped for elements and attributes", "[slam]") {
  CHECK(escape("a<b & \"c\" > 'd'") == "a&lt;b &amp; &quot;c&quot; &gt; &#39;d&#39;");
  CHECK(escape(std::string("\x01\x1b") + "x") == "  x");
  CHECK(escape("Größe") == "Größe");
}

TEST_CASE("Numbers that are not finite are dashes, and there is no minus zero", "[slam]") {
  CHECK(number(std::nan(""), 2) == "–");
  CHECK(number(-std::numeric_limits<double>::infinity(), 2) == "–");
  CHECK(number(-0.0001, 2) == "0.00");
  CHECK(number(-0.01, 2) == "-0.01");
  CHECK(number(1e300, 2) == "1e+300");
  CHECK(number(-1.25e12, 2) == "-1.2e+12");
}

TEST_CASE("Base64 gives the vectors of RFC 4648", "[slam]") {
  const auto encoded = [](const std::string& text) { return base64({text.begin(), text.end()}); };
  CHECK(encoded("") == "");
  CHECK(encoded("f") == "Zg==");
  CHECK(encoded("fo") == "Zm8=");
  CHECK(encoded("foo") == "Zm9v");
  CHECK(encoded("foob") == "Zm9vYg==");
  CHECK(encoded("fooba") == "Zm9vYmE=");
  CHECK(encoded("foobar") == "Zm9vYmFy");
  CHECK(base64({0xff, 0xfe, 0xfd}) == "//79");
}

TEST_CASE("Ticks are round, inside the range and few", "[slam]") {
  for (const double size : {1e-6, 0.03, 0.7, 1.0, 7.0, 33.0, 1e6}) {
    for (const double low : {-3.3 * size, 0.0, 0.123 * size}) {
      const auto marks = ticks(low, low + size, 6);
      CHECK(marks.size() >= 3);
      CHECK(marks.size() <= 12);
      for (const Tick& tick : marks) {
        CHECK(tick.value >= low - 1e-6 * size);
        CHECK(tick.value <= low + size * (1 + 1e-6));
        CHECK(std::abs(std::stod(tick.label) - tick.value) <= 1e-6 * size);
      }
    }
  }
  CHECK(ticks(0, 0, 6).empty());
  CHECK(ticks(0, std::nan(""), 6).empty());
}

TEST_CASE("A metre is as long upwards as sideways in plots of equal scale", "[slam]") {
  for (const auto& [dx, dy] : {std::make_pair(2.0, 0.5), std::make_pair(0.3, 4.0), std::make_pair(0.0, 0.0)}) {
    Range x, y;
    x.add(1);
    x.add(1 + dx);
    y.add(-2);
    y.add(-2 + dy);
    const Plot plot = Plot::equal_scale("t", x, y, "x", "y");
    const double across = plot.px(1 + 0.5 * dx + 1e-3) - plot.px(1 + 0.5 * dx),
                 up = plot.py(-2 + 0.5 * dy) - plot.py(-2 + 0.5 * dy + 1e-3);
    CHECK(across > 0);
    CHECK(std::abs(across - up) < 1e-9 * across);
  }
}

TEST_CASE("The report of seven variants is one closed page that fetches nothing", "[slam]") {
  auto runs = cfp_test::fake_variants("walking_halfsphere");
  runs[1].pictures.push_back({runs[1].frames[30].time_s, "two <men>", {0xff, 0xd8, 0xff, 0xd9}});
  const std::string page = report_page(runs);
  check_page(page);
  CHECK(count(page, "data:image/jpeg;base64,/9j/2Q==") == 1);
  CHECK(count(page, "two &lt;men&gt;") >= 1);
  CHECK(count(page, "<section>") == 1);
  for (const RunRecord& run : runs) CHECK(count(page, "<th scope=\"row\"><span>" + run.variant + "</span></th>") >= 1);
}

TEST_CASE("The report survives runs without truth, frames, boxes or finite numbers", "[slam]") {
  check_page(report_page({}));
  check_page(report_page({RunRecord{}}));
  cfp_test::FakeRun bare;
  bare.with_truth = bare.with_boxes = false;
  bare.frames = 3;
  check_page(report_page({cfp_test::fake_run(bare)}));
  bare.frames = 1;
  bare.with_truth = true;
  check_page(report_page({cfp_test::fake_run(bare), RunRecord{}}));

  for (const double broken :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e300, -1e300}) {
    auto run = cfp_test::fake_run({});
    run.variant = "</title><script>alert(1)</script>";
    for (std::size_t k = 0; k < run.frames.size(); k += 3) {
      run.frames[k].T_world_cam.translation.x() = broken;
      run.frames[k].milliseconds.fill(broken);
      if (!run.frames[k].boxes.empty()) run.frames[k].boxes[0].object_probability = broken;
      run.first_stage.probability[k] = static_cast<float>(std::isfinite(broken) ? 2.0 : broken);
    }
    run.frames[7].time_s = broken;
    run.frames[8].time_s = -broken;
    run.truth[5].T_world_cam.translation.y() = broken;
    run.truth[6].time_s = broken;
    run.pictures.push_back({broken, "", {0xff, 0xd8}});
    run.absolute.translation_m.rmse = broken;
    check_page(report_page({run, cfp_test::fake_run({})}));
    CHECK(count(report_page({run}), "d=\"M–") == 0);
    CHECK(first_unbalanced(summary_picture({run})) == "");
    cfp_test::evaluate(run);
    check_page(report_page({run}));
  }
}

TEST_CASE("A variant that flew away does not shrink the others", "[slam]") {
  cfp_test::FakeRun fake;
  auto good = cfp_test::fake_run(fake), bad = good;
  bad.variant = "plain";
  for (std::size_t k = 200; k < bad.frames.size(); ++k) bad.frames[k].T_world_cam.translation.x() += 1000;
  bad.absolute = good.absolute;  // its alignment
  const std::vector<const RunRecord*> runs{&good, &bad}, alone{&good};
  const auto with = trajectory_views(series_of(runs)), without = trajectory_views(series_of(alone));
  CHECK(with[0].cut_off);
  CHECK_FALSE(without[0].cut_off);
  CHECK(with[0].plot.px(1) - with[0].plot.px(0) > 0.15 * (without[0].plot.px(1) - without[0].plot.px(0)));
  check_page(report_page({good, bad}));
}

TEST_CASE("Runs are grouped by sequence, and seeds of one variant get their own names and colours", "[slam]") {
  cfp_test::FakeRun fake;
  fake.frames = 60;
  std::vector<RunRecord> runs;
  for (const char* sequence : {"a", "b", "a"}) {
    fake.sequence = sequence;
    ++fake.seed;
    runs.push_back(cfp_test::fake_run(fake));
  }
  const std::string page = report_page(runs);
  check_page(page);
  CHECK(count(page, "<section>") == 2);
  CHECK(count(page, "<th scope=\"row\"><span>cfp, seed 2</span></th>") >= 1);
  CHECK(count(page, "<th scope=\"row\"><span>cfp, seed 4</span></th>") >= 1);
  std::vector<const RunRecord*> all;
  for (int k = 0; k < 14; ++k) all.push_back(&runs[0]);
  const auto series = series_of(all);
  REQUIRE(series.size() == 14);
  for (const Series& s : series) CHECK(s.style < series_styles.size());
  for (std::size_t a = 0; a < series_styles.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) CHECK(series[a].style != series[b].style);
  }
}

TEST_CASE("The summary picture names a colour for viewers that know no CSS variables", "[slam]") {
  const auto picture = summary_picture(cfp_test::fake_variants("walking_xyz"));
  const std::regex variable("(fill|stroke):var"), named("(fill|stroke):#[0-9a-f]+;\\1:var");
  const auto matches = [&](const std::regex& what) {
    return std::distance(std::sregex_iterator(picture.begin(), picture.end(), what), std::sregex_iterator());
  };
  CHECK(matches(variable) > 5);
  CHECK(matches(named) == matches(variable));
}

TEST_CASE("The report is written whole or not at all", "[slam]") {
  const auto folder = std::filesystem::temp_directory_path() / "cfp_slam_report_test";
  std::filesystem::remove_all(folder);
  write_report(folder / "deep" / "report.html", {cfp_test::fake_run({})});
  CHECK(std::filesystem::file_size(folder / "deep" / "report.html") > 10000);
  CHECK(std::distance(std::filesystem::directory_iterator(folder / "deep"), {}) == 1);
  CHECK_THROWS(write_report(folder / "deep" / "report.html" / "below_a_file.html", {}));
  std::filesystem::remove_all(folder);
}

TEST_CASE("The summary picture is one small SVG with the frame that tells most and fits", "[slam]") {
  auto runs = cfp_test::fake_variants("walking_xyz");
  runs.resize(2);
  const auto without = summary_picture(runs);
  CHECK(first_unbalanced(without) == "");
  CHECK(without.find("<image") == std::string::npos);
  CHECK(without.size() < 150000);
  runs[0].pictures.push_back({runs[0].frames[55].time_s, "plain", std::vector<unsigned char>(60000, 1)});
  runs[1].pictures.push_back({runs[1].frames[10].time_s, "detected", std::vector<unsigned char>(30000, 2)});
  runs[1].pictures.push_back({runs[1].frames[55].time_s, "compensated", std::vector<unsigned char>(30000, 3)});
  runs[1].pictures.push_back({runs[1].frames[56].time_s, "too large", std::vector<unsigned char>(130000, 4)});
  const auto with = summary_picture(runs);
  CHECK(with.size() < 150000);
  CHECK(with.find(base64(runs[1].pictures[1].jpeg)) != std::string::npos);
  CHECK(count(with, "<image") == 1);
  CHECK(count(with, "nan") == 0);
  CHECK(first_unbalanced(summary_picture({})) == "");
  CHECK(first_unbalanced(summary_picture({RunRecord{}})) == "");
}
