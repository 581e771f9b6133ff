#include "../../examples/synthetic/writer.hpp"

#include <iterator>
#include <map>
#include <set>

#include "support/catch.hpp"
#include "support/temporary_folder.hpp"

using namespace synthetic;

namespace {

SequenceOptions small(Scenario scenario, Motion motion) {
  SequenceOptions options;
  options.scenario = scenario;
  options.motion = motion;
  options.frames = 240;
  options.camera = SequenceOptions::default_camera(160);
  return options;
}

/// People who sit (even) or walk (odd); from 2 on they fill the view and furniture stands before them.
SequenceOptions of_kind(int kind, Motion motion) {
  SequenceOptions options = small(kind % 2 == 0 ? Scenario::sitting : Scenario::walking, motion);
  options.close_up = options.furniture = kind > 1;
  return options;
}

RenderedFrame rendered(const Sequence& sequence, int frame) {
  Renderer renderer;
  RenderedFrame out;
  sequence.render(frame, renderer, out);
  return out;
}

bool same(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && std::equal(a.datastart, a.dataend, b.datastart);
}

/// Negative inside the solid, positive outside, zero on its surface: written without any ray.
double signed_distance(const Surface& s, const Vector3d& world) {
  const Vector3d p = s.A * (world - s.centre);
  if (s.shape == Shape::capsule) {
    const Vector3d axis(0, 0, std::clamp(p.z(), -s.half.z(), s.half.z()));
    return (p - axis).norm() - s.half.x();
  }
  const double box = (p.cwiseAbs() - s.half).maxCoeff();
  return s.shape == Shape::room ? -box : box;
}

Vector3d world_point(const Sequence& sequence, int frame, double x, double y, double depth) {
  return sequence.T_stage_cam(frame) * (depth * sequence.options().camera.ray(x, y));
}

std::map<std::string, std::string> files_of(const std::filesystem::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    std::ifstream stream(entry.path(), std::ios::binary);
    files[std::filesystem::relative(entry.path(), folder).string()] = {std::istreambuf_iterator<char>(stream), {}};
  }
  return files;
}

}  // namespace

TEST_CASE("A frame depends on the seed and its number alone", "[synthetic]") {
  const auto options = small(Scenario::walking, Motion::xyz);
  const Sequence one(options), two(options);
  const auto later_first = rendered(two, 90), a = rendered(one, 30), b = rendered(two, 30);
  CHECK(same(a.color, b.color));
  CHECK(same(a.depth, b.depth));
  CHECK(same(a.label, b.label));
  CHECK_FALSE(same(a.color, later_first.color));
  auto other = options;
  other.seed = 2;
  CHECK_FALSE(same(a.color, rendered(Sequence(other), 30).color));
}

TEST_CASE("True depth lies on the nearest surface of the scene", "[synthetic]") {
  for (const int kind : {0, 1, 2, 3, 4, 5, 6, 7}) {
    auto options = of_kind(kind % 4, Motion::halfsphere);
    options.camera.lens = kind == 4 ? 0.08 : kind == 5 ? -0.08 : 0;
    if (kind > 5) options.camera = SequenceOptions::fisheye_camera(160);
    const Sequence sequence(options);
    const int frame = 75;
    const auto out = rendered(sequence, frame);
    const auto surfaces = sequence.surfaces_at(sequence.time_of(frame));
    for (int y = 1; y < out.truth.depth.rows; y += 7) {
      for (int x = 1; x < out.truth.depth.cols; x += 5) {
        const double depth = static_cast<double>(out.truth.depth.at<float>(y, x));
        const int id = out.truth.surface.at<short>(y, x) / 8;
        REQUIRE(std::abs(signed_distance(surfaces[static_cast<std::size_t>(id)],
                                         world_point(sequence, frame, x, y, depth))) < 1e-5);
        for (double part = 0.02; part < 1; part += 0.02) {
          const Vector3d before = world_point(sequence, frame, x, y, part * depth);
          for (const Surface& s : surfaces) REQUIRE(signed_distance(s, before) > -1e-5);
        }
      }
    }
  }
}

TEST_CASE("Labels, boxes and visible parts agree with the surfaces", "[synthetic]") {
  std::set<int> seen;
  for (const int kind : {0, 1, 2, 3}) {
    const Sequence sequence(of_kind(kind, Motion::fixed));
    for (int frame = 0; frame < 240; frame += 40) {
      const auto out = rendered(sequence, frame);
      const double time = sequence.time_of(frame), dt = sequence.options().render.frame_s;
      const auto surfaces = sequence.surfaces_at(time), before = sequence.surfaces_at(time - dt);
      std::array<cv::Rect, 2> boxes;
      std::array<int, 2> pixels{};
      for (int y = 0; y < out.label.rows; ++y) {
        for (int x = 0; x < out.label.cols; ++x) {
          const auto id = static_cast<std::size_t>(out.truth.surface.at<short>(y, x) / 8);
          const int label = out.label.at<unsigned char>(y, x);
          seen.insert(label);
          const int person = surfaces[id].person;
          REQUIRE((label == label_static) == (person < 0));
          if (person < 0) continue;
          boxes[static_cast<std::size_t>(person)] |= cv::Rect(x, y, 1, 1);
          ++pixels[static_cast<std::size_t>(person)];
          // The same material point a frame earlier, through the earlier surface itself.
          const Vector3d now = world_point(sequence, frame, x, y, static_cast<double>(out.truth.depth.at<float>(y, x)));
          const Vector3d local = surfaces[id].A * (now - surfaces[id].centre);
          const double speed = (before[id].A.inverse() * local + before[id].centre - now).norm() / dt;
          if (std::abs(speed - 0.05) > 1e-3) REQUIRE((label == label_moving) == (speed > 0.05));
        }
      }
      for (std::size_t who = 0; who < 2; ++who) {
        const Sighting& s = out.truth.people[who];
        CHECK(s.pixels == pixels[who]);
        CHECK((s.visible >= 0 && s.visible <= 1));
        if (s.pixels == 0) continue;
        CHECK(cv::Rect2d(s.box.x1, s.box.y1, s.box.width(), s.box.height()) == cv::Rect2d(boxes[who]));
      }
    }
  }
  CHECK(seen == std::set<int>{0, 1, 2});
}

TEST_CASE("Without close-up and furniture, room and people are what they were before these options", "[synthetic]") {
  // Middle of the hips of both people at 7 s: figures of the generator without the options.
  const double hips_of[2][2][3] = {{{-0.9592194, -0.9616179, 0.5529390}, {0.9502095, -0.9502640, 0.5345077}},
                                   {{0.6497995, -1.8132880, 0.9350535}, {0.4274265, -1.5252786, 0.8699311}}};
  for (const auto scenario : {Scenario::sitting, Scenario::walking}) {
    const auto surfaces = Sequence(small(scenario, Motion::xyz)).surfaces_at(7);
    REQUIRE(surfaces.size() == 91);
    for (std::size_t who = 0; who < 2; ++who) {
      const Vector3d hips = surfaces[surfaces.size() - 2 * parts.size() + who * parts.size() + 2].centre;
      const auto& before = hips_of[static_cast<std::size_t>(scenario)][who];
      CHECK((hips - Vector3d(before[0], before[1], before[2])).norm() < 1e-6);
    }
  }
}

TEST_CASE("In a close-up, people fill the view of every camera and keep clear of it", "[synthetic]") {
  for (std::size_t m = 0; m < motion_names.size(); ++m) {
    for (const std::uint64_t seed : {1U, 2U}) {
      CAPTURE(motion_names[m], seed);
      auto options = small(Scenario::walking, static_cast<Motion>(m));
      options.frames = 300;
      options.camera = SequenceOptions::default_camera(80);
      options.seed = seed;
      options.close_up = true;
      const Sequence sequence(options);
      std::vector<double> shares;
      for (int frame = 0; frame < 300; frame += 5) {
        const auto out = rendered(sequence, frame);
        shares.push_back(1 - cv::countNonZero(out.label == label_static) / static_cast<double>(out.label.total()));
        const auto surfaces = sequence.surfaces_at(sequence.time_of(frame));
        const std::size_t first = surfaces.size() - 2 * parts.size(), second = first + parts.size();
        for (std::size_t i = first; i < surfaces.size(); ++i)
          REQUIRE(signed_distance(surfaces[i], sequence.T_stage_cam(frame).translation) > 0.2);
        REQUIRE((surfaces[first + 2].centre - surfaces[second + 2].centre).norm() > 0.2);
      }
      std::sort(shares.begin(), shares.end());
      CHECK(shares[shares.size() / 2] > 0.35);
      CHECK(shares[shares.size() / 2] < 0.52);
      CHECK(shares.back() > 0.5);
      CHECK(shares.back() < 0.8);
    }
  }
}

TEST_CASE("Two people at rest fill the view until one of them gets up and leaves", "[synthetic]") {
  for (std::size_t m = 0; m < motion_names.size(); ++m) {
    CAPTURE(motion_names[m]);
    auto options = small(Scenario::rising, static_cast<Motion>(m));
    options.frames = 300;
    options.camera = SequenceOptions::default_camera(80);
    const Sequence sequence(options);
    std::vector<double> shares;
    for (int frame = 0; frame < 150; frame += 5) {
      const auto out = rendered(sequence, frame);
      shares.push_back(1 - cv::countNonZero(out.label == label_static) / static_cast<double>(out.label.total()));
      REQUIRE(cv::countNonZero(out.label == label_moving) == 0);
    }
    std::sort(shares.begin(), shares.end());
    CHECK(shares[shares.size() / 2] > 0.45);
    CHECK(shares[shares.size() / 2] < 0.7);
    CHECK(cv::countNonZero(rendered(sequence, 190).label == label_moving) > 0);
    const auto surfaces = sequence.surfaces_at(sequence.time_of(299));
    const std::size_t first = surfaces.size() - 2 * parts.size(), second = first + parts.size();
    CHECK((surfaces[first].centre - surfaces[second].centre).norm() > 1.5);
  }
}

TEST_CASE("Furniture stands before people, within their boxes, static, with depth, and none walks through it",
          "[synthetic]") {
  for (const bool close_up : {false, true}) {
    for (const auto scenario : {Scenario::sitting, Scenario::walking}) {
      auto options = small(scenario, Motion::xyz);
      options.close_up = close_up;
      const std::size_t people = 2 * parts.size(), room = Sequence(options).surfaces_at(0).size() - people;
      options.furniture = true;
      const Sequence sequence(options);
      CAPTURE(close_up, scenario_names[static_cast<std::size_t>(scenario)]);
      int frames = 0, hidden = 0, covered = 0, with_depth = 0;
      for (int frame = 0; frame < options.frames; frame += 8, ++frames) {
        const auto surfaces = sequence.surfaces_at(sequence.time_of(frame));
        const std::size_t first = surfaces.size() - people;
        REQUIRE(first > room);
        for (std::size_t i = room; i < first; ++i) {
          for (std::size_t p = first; p < surfaces.size(); ++p)
            REQUIRE(signed_distance(surfaces[i], surfaces[p].centre) > 0.02);
        }
        const auto out = rendered(sequence, frame);
        bool before_somebody = false;
        for (const Sighting& s : out.truth.people) {
          if (s.pixels == 0) continue;
          double inside = 0;
          for (int y = static_cast<int>(s.box.y1); y < static_cast<int>(s.box.y2); ++y) {
            for (int x = static_cast<int>(s.box.x1); x < static_cast<int>(s.box.x2); ++x) {
              const auto id = static_cast<std::size_t>(out.truth.surface.at<short>(y, x) / 8);
              if (id < room || id >= first) continue;
              REQUIRE(out.label.at<unsigned char>(y, x) == label_static);
              ++inside;
              ++covered;
              with_depth += out.depth.at<std::uint16_t>(y, x) > 0 ? 1 : 0;
            }
          }
          if (inside > 0.1 * cfp::area(s.box)) {
            before_somebody = true;
            CHECK(s.visible < 0.99);
          }
        }
        hidden += before_somebody ? 1 : 0;
      }
      CHECK(hidden > 0.3 * frames);
      CHECK(with_depth > 0.6 * covered);  // the camera comes nearer than 0.5 m
    }
  }
}

TEST_CASE("Cameras move at the mean speeds of TUM's fr3_walking recordings", "[synthetic]") {
  // The benchmark's own figures: m/s, deg/s.
  const double tum[4][2] = {{0.012, 1.388}, {0.208, 5.490}, {0.221, 18.267}, {0.091, 20.903}};
  for (std::size_t m = 0; m < 4; ++m) {
    CAPTURE(motion_names[m]);
    const CameraMotion motion(static_cast<Motion>(m), 1);
    double length = 0, angle = 0;
    cfp::SE3<double> last = motion(0);
    for (int k = 1; k <= 900; ++k) {
      const cfp::SE3<double> T = motion(k / 30.0);
      length += (T.translation - last.translation).norm();
      angle += cfp::so3_log<double>(last.rotation.transpose() * T.rotation).norm() * 180 / cfp::pi<double>;
      last = T;
    }
    CHECK_THAT(length / 30 / tum[m][0], WithinAbs(1, 0.25));
    CHECK_THAT(angle / 30 / tum[m][1], WithinAbs(1, 0.25));
  }
}

TEST_CASE("Static pixels reprojected with the true poses meet the same depth", "[synthetic]") {
  for (const auto motion : {Motion::xyz, Motion::halfsphere, Motion::rpy}) {
    const Sequence sequence(small(Scenario::walking, motion));
    const ImageCamera& c = sequence.options().camera;
    const int from = 60, to = 66;
    const auto a = rendered(sequence, from), b = rendered(sequence, to);
    const cfp::SE3<double> T_to_world = sequence.T_world_cam(to).inverse();
    int compared = 0, equal = 0, seen_through = 0;
    for (int y = 0; y < c.height; ++y) {
      for (int x = 0; x < c.width; ++x) {
        if (a.label.at<unsigned char>(y, x) != label_static) continue;
        const Vector3d p =
            T_to_world * world_point(sequence, from, x, y, static_cast<double>(a.truth.depth.at<float>(y, x)));
        cfp::Vector2<double> pixel;
        if (!c.project(p, pixel)) continue;
        const int u = static_cast<int>(std::lround(pixel.x())), v = static_cast<int>(std::lround(pixel.y()));
        if (u < 0 || v < 0 || u >= c.width || v >= c.height || b.label.at<unsigned char>(v, u) != label_static)
          continue;
        const double depth = static_cast<double>(b.truth.depth.at<float>(v, u));
        ++compared;
        if (std::abs(depth - p.z()) < 0.03 * p.z()) ++equal;
        if (depth > 1.03 * p.z()) ++seen_through;
      }
    }
    CAPTURE(motion_names[static_cast<std::size_t>(motion)]);
    CHECK(compared > 4000);
    CHECK(equal > 0.93 * compared);  // the rest are half-pixel errors at edges and what newly hides
    CHECK(seen_through < 0.03 * compared);
  }
}

TEST_CASE("Sensed depth has the stated noise, steps and holes", "[synthetic]") {
  auto near = small(Scenario::walking, Motion::fixed);
  near.sensor.fading_m = 4;
  near.sensor.range_m = 5;
  const Sequence sequence(near);
  const auto& options = sequence.options().sensor;
  const auto out = rendered(sequence, 120);
  double square = 0;
  int n = 0, holes_beyond = 0, beyond = 0, holes_at_edges = 0, edges = 0;
  for (int y = 0; y < out.depth.rows; ++y) {
    for (int x = 1; x + 2 < out.depth.cols; ++x) {
      const double z = static_cast<double>(out.truth.depth.at<float>(y, x));
      const double measured = out.depth.at<std::uint16_t>(y, x) / options.depth_units_per_metre;
      double jump = 0, near_jump = 0;  // within the reach of ragged edges, and to the direct neighbours
      for (int d = -1; d <= 2; ++d) {
        const double step = std::abs(z - static_cast<double>(out.truth.depth.at<float>(y, x + d)));
        jump = std::max(jump, step);
        if (d < 2) near_jump = std::max(near_jump, step);
      }
      if (z > options.range_m) {
        ++beyond;
        holes_beyond += measured == 0 ? 1 : 0;
      } else if (near_jump > 0.3) {
        ++edges;
        holes_at_edges += measured == 0 ? 1 : 0;
      } else if (measured > 0 && jump < 0.1) {
        const double step = options.disparity_step_px / options.focal_baseline * z * z;
        // The quantisation of a uniform error adds step² / 12.
        square += (measured - z) * (measured - z) / (depth_sigma(z) * depth_sigma(z) + step * step / 12);
        ++n;
        const double steps = options.focal_baseline / measured / options.disparity_step_px;
        REQUIRE(std::abs(steps - std::round(steps)) < 0.05);
      }
    }
  }
  CHECK(n > 5000);
  CHECK_THAT(square / n, WithinAbs(1, 0.06));
  CHECK(beyond > 1000);
  CHECK(holes_beyond > 0.97 * beyond);
  CHECK(holes_at_edges > 0.3 * edges);
}

TEST_CASE("A rolling shutter shows each row at its own time", "[synthetic]") {
  auto options = small(Scenario::walking, Motion::rpy);
  options.blur_samples = 2;
  auto in_milliseconds = options;
  in_milliseconds.rate_hz = 1000;
  in_milliseconds.frames = 8000;  // as long: the people do the same
  options.readout_s = 0.06;
  const Sequence rolling(options), still(in_milliseconds);
  const auto out = rendered(rolling, 45);
  for (const int row : {0, 41, 59, 117}) {
    const int band = row / 4, at_ms = 1500 - 30 + 2 * band + 1;
    const auto then = rendered(still, at_ms);
    int equal = 0, equal_color = 0, equal_label = 0, equal_of_frame = 0;
    const auto middle = rendered(still, 1500);
    for (int x = 0; x < 160; ++x) {
      const float depth = out.truth.depth.at<float>(row, x);
      equal += std::abs(depth - then.truth.depth.at<float>(row, x)) < 1e-4F * depth ? 1 : 0;
      equal_of_frame += std::abs(depth - middle.truth.depth.at<float>(row, x)) < 1e-4F * depth ? 1 : 0;
      equal_color +=
          cv::norm(out.truth.color.at<cv::Vec3f>(row, x) - then.truth.color.at<cv::Vec3f>(row, x)) < 0.1 ? 1 : 0;
      equal_label += out.label.at<unsigned char>(row, x) == then.label.at<unsigned char>(row, x) ? 1 : 0;
    }
    CAPTURE(row);
    CHECK(equal == 160);
    CHECK(equal_color == 160);
    CHECK(equal_label == 160);
    CHECK((row == 59 || equal_of_frame < 80));
  }
}

TEST_CASE("Late depth is that of another time, through the same lens", "[synthetic]") {
  auto options = small(Scenario::walking, Motion::rpy);
  const auto later = rendered(Sequence(options), 63);
  options.depth_late_s = 3 / options.rate_hz;
  const auto out = rendered(Sequence(options), 60);
  int known = 0, late = 0, in_time = 0;
  for (int y = 0; y < out.depth.rows; ++y) {
    for (int x = 0; x < out.depth.cols; ++x) {
      const double z = out.depth.at<std::uint16_t>(y, x) / options.sensor.depth_units_per_metre;
      if (z == 0) continue;
      ++known;
      late += std::abs(static_cast<double>(later.truth.depth.at<float>(y, x)) - z) < 0.05 * z ? 1 : 0;
      in_time += std::abs(static_cast<double>(out.truth.depth.at<float>(y, x)) - z) < 0.05 * z ? 1 : 0;
    }
  }
  CHECK(known > 5000);
  CHECK(late > 0.97 * known);
  CHECK(in_time < 0.9 * known);
}

TEST_CASE("The detector misses in bursts, more often where detection is hard", "[synthetic]") {
  const DetectorOptions options;
  const auto missed = [&](bool at_border, double visible, double rotation, bool blurred) {
    Detector detector(options, 5);
    Sighting s;
    s.box = at_border ? cfp::Box<double>{0, 100, 120, 480} : cfp::Box<double>{200, 100, 320, 400};
    s.pixels = 20000;
    s.visible = visible;
    s.at_border = at_border;
    int misses = 0, longest = 0, run = 0;
    for (int k = 0; k < 20000; ++k) {
      const auto found = detector.detect({s, Sighting{}}, rotation, blurred, 640, 480);
      const bool hit =
          std::any_of(found.begin(), found.end(), [&](const Detection& d) { return cfp::iou(d.box, s.box) > 0.5; });
      run = hit ? 0 : run + 1;
      misses += hit ? 0 : 1;
      longest = std::max(longest, run);
      for (const Detection& d : found)
        REQUIRE((d.score > 0.25 && d.score < 1 && is_proper(d.box) && d.box.x1 >= 0 && d.box.y2 <= 480));
    }
    CHECK(longest >= options.longest_burst);
    return misses / 20000.0;
  };
  const double easy = missed(false, 1, 0, false);
  CHECK_THAT(easy, WithinAbs(options.miss_rate * 3.5 / (1 + options.miss_rate * 2.5), 0.012));
  CHECK(missed(true, 1, 0, false) > 1.5 * easy);
  CHECK(missed(false, 0.5, 0, false) > 1.5 * easy);
  CHECK(missed(false, 1, 1, false) > 1.5 * easy);
  CHECK(missed(false, 1, 0, true) > 1.5 * easy);
}

TEST_CASE("A written folder is the same from one thread and from three, and reads back", "[synthetic]") {
  auto options = small(Scenario::walking, Motion::rpy);
  options.frames = 7;
  options.blur_samples = 2;
  options.focal_error = 0.02;
  const cfp_test::TemporaryFolder folder;
  const Sequence sequence(options);
  write_sequence(sequence, folder.path / "one", 1, [](int) {});
  int calls = 0;
  write_sequence(sequence, folder.path / "three", 3, [&](int done) { calls = std::max(calls, done); });
  CHECK(calls == 7);
  CHECK(files_of(folder.path / "one") == files_of(folder.path / "three"));

  const auto camera = cfp_examples::read_tum_camera(folder.path / "one/camera.txt");
  CHECK(camera.width == 160);
  CHECK_THAT(camera.fx / options.camera.fx, WithinAbs(1.02, 1e-5));
  CHECK_THAT(camera.fy / options.camera.fy, WithinAbs(1.02, 1e-5));
  const auto images = cfp_examples::read_tum_list(folder.path / "one/rgb.txt");
  const auto truth = cfp_examples::read_tum_trajectory(folder.path / "one/groundtruth.txt");
  REQUIRE(images.size() == 7);
  REQUIRE(truth.size() == 7);
  for (int k = 0; k < 7; ++k) {
    const auto i = static_cast<std::size_t>(k);
    CHECK_THAT(truth[i].time_s, WithinAbs(images[i].time_s, 1e-9));
    CHECK((truth[i].T_world_cam.translation - sequence.T_world_cam(k).translation).norm() < 1e-8);
    CHECK(same(cv::imread((folder.path / "one" / images[i].file).string(), cv::IMREAD_UNCHANGED),
               rendered(sequence, k).color));
  }
}

TEST_CASE("A fisheye is told in camera.txt: its pixels are those of the rays that were rendered", "[synthetic]") {
  auto options = small(Scenario::walking, Motion::xyz);
  options.frames = 1;
  options.camera = SequenceOptions::fisheye_camera(160);
  const cfp_test::TemporaryFolder folder;
  write_sequence(Sequence(options), folder.path, 1, [](int) {});
  const cfp::AnyCamera<double> camera = cfp_examples::read_tum_camera(folder.path / "camera.txt").camera();
  for (const double x : {0.0, 40.0, 159.0}) {
    for (const double y : {0.0, 70.0, 119.0}) {
      cfp::Vector2<double> pixel(-7, -7);
      REQUIRE(camera.project(options.camera.ray(x, y), pixel));
      CHECK((pixel - cfp::Vector2<double>(x, y)).norm() < 0.01);
    }
  }
}

TEST_CASE("People put into a recording leave the rest of it alone and are hidden by what is nearer", "[synthetic]") {
  // The recording is a rendered room in which nobody walks yet.
  auto options = small(Scenario::sitting, Motion::xyz);
  options.frames = 4;
  const cfp_test::TemporaryFolder folder;
  write_sequence(Sequence(options), folder.path, 1, [](int) {});
  const auto recording = std::make_shared<Recording>(read_recording(folder.path, 1.35));
  REQUIRE(recording->views.size() == 4);
  options.scenario = Scenario::walking;
  const Sequence composed(options, recording);
  for (int k = 0; k < 4; ++k) {
    const auto out = rendered(composed, k);
    const cv::Mat color = cv::imread(recording->views[static_cast<std::size_t>(k)].color.string());
    const cv::Mat depth =
        cv::imread(recording->views[static_cast<std::size_t>(k)].depth.string(), cv::IMREAD_UNCHANGED);
    int people = 0, kept = 0;
    for (int y = 1; y + 1 < color.rows; ++y) {
      for (int x = 1; x + 1 < color.cols; ++x) {
        const bool person = out.label.at<unsigned char>(y, x) != label_static;
        people += person ? 1 : 0;
        const double real = depth.at<std::uint16_t>(y, x) / recording->depth_units_per_metre;
        if (person && real > 0) REQUIRE(static_cast<double>(out.truth.depth.at<float>(y, x)) <= real + 1e-4);
        const bool inside = !person && out.truth.surface.at<short>(y, x - 1) < 0 &&
                            out.truth.surface.at<short>(y, x + 1) < 0 && out.truth.surface.at<short>(y - 1, x) < 0 &&
                            out.truth.surface.at<short>(y + 1, x) < 0;
        if (!inside) continue;  // the smoothed rim
        REQUIRE(out.color.at<cv::Vec3b>(y, x) == color.at<cv::Vec3b>(y, x));
        REQUIRE((out.depth.at<std::uint16_t>(y, x) == depth.at<std::uint16_t>(y, x) ||
                 out.depth.at<std::uint16_t>(y, x) == 0));
        ++kept;
      }
    }
    CHECK(people > 300);
    CHECK(kept > 5000);
  }
  write_sequence(composed, folder.path / "composed", 1, [](int) {});
  const auto before = cfp_examples::read_tum_trajectory(folder.path / "groundtruth.txt");
  const auto after = cfp_examples::read_tum_trajectory(folder.path / "composed/groundtruth.txt");
  REQUIRE(after.size() == before.size());
  for (std::size_t k = 0; k < after.size(); ++k) {
    CHECK_THAT(after[k].time_s, WithinAbs(before[k].time_s, 1e-6));
    CHECK((after[k].T_world_cam.translation - before[k].T_world_cam.translation).norm() < 1e-8);
    CHECK((after[k].T_world_cam.rotation - before[k].T_world_cam.rotation).norm() < 1e-8);
  }
}

TEST_CASE("A recording with a missing or wrong file is refused with its name", "[synthetic]") {
  auto options = small(Scenario::walking, Motion::fixed);
  options.frames = 2;
  const cfp_test::TemporaryFolder folder;
  write_sequence(Sequence(options), folder.path, 1, [](int) {});
  const auto recording = std::make_shared<Recording>(read_recording(folder.path, 1.35));
  cv::imwrite(recording->views[1].depth.string(), cv::Mat(10, 10, CV_16U, cv::Scalar(0)));
  CHECK_THROWS_WITH(rendered(Sequence(options, recording), 1), Catch::Matchers::Contains("size differs"));
  std::filesystem::remove(recording->views[1].color);
  CHECK_THROWS_WITH(rendered(Sequence(options, recording), 1),
                    Catch::Matchers::Contains(recording->views[1].color.filename().string()));
  CHECK_THROWS_WITH(write_sequence(Sequence(options, recording), folder.path / "out", 2, [](int) {}),
                    Catch::Matchers::Contains("cannot read"));
  std::filesystem::remove(folder.path / "camera.txt");
  CHECK_THROWS_WITH(read_recording(folder.path, 1.35), Catch::Matchers::Contains("camera.txt"));
}
