#include "../../examples/slam/loop/map.hpp"

#include "../../examples/slam/loop/local_bundle.hpp"
#include "../../examples/slam/loop/mapping.hpp"
#include "../../examples/slam/loop/matching.hpp"
#include "../../examples/slam/loop/pose.hpp"
#include "cfp/core/random.hpp"
#include "support/catch.hpp"
#include "support/engines.hpp"

using namespace cfp_slam;

namespace {

/// A keyframe that sees the given points, keypoint by keypoint.
int add_keyframe(Map& map, const std::vector<int>& points, const cfp::SE3<double>& T_cam_world = {}) {
  Frame frame;
  frame.keypoints.assign(points.size(), cv::KeyPoint(0, 0, 31, 0, 0, 0));
  frame.map_point = points;
  frame.T_cam_world = T_cam_world;
  const int index = map.add_keyframe(frame, map.newest_world());
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (map.is_alive(points[i])) map.point(points[i]).observations.push_back({index, static_cast<int>(i)});
  }
  return index;
}

cfp::SE3<double> at(double x) { return {cfp::Matrix3<double>::Identity(), {x, 0, 0}}; }

constexpr cfp::PinholeCamera<double> camera{525, 525, 320, 240};
const View view{camera.cast<float>(), camera, 640, 480, {1}, 1, 40};

/// A keypoint of the frame at X, which is no point of the map yet.
void see(Frame& frame, const cfp::SE3<double>& T_cam_world, const cfp::Vector3<double>& X) {
  const cfp::Vector3<double> in_camera = T_cam_world * X;
  cfp::Vector2<double> pixel;
  REQUIRE(camera.project(in_camera, pixel));
  frame.keypoints.emplace_back(float(pixel.x()), float(pixel.y()), 31.0F, 0.0F, 0.0F, 0);
  frame.pixels.push_back({float(pixel.x()), float(pixel.y())});
  frame.depths_m.push_back(float(in_camera.z()));
  frame.static_probability.push_back(1);
  frame.map_point.push_back(no_point);
}

}  // namespace

TEST_CASE("A keyframe that has gone is where it was, relative to one that moves", "[slam]") {
  Map map;
  const int a = map.add({}), b = map.add({});
  add_keyframe(map, {a}, at(0));
  add_keyframe(map, {a, b}, at(1));
  add_keyframe(map, {a, b}, at(3));
  map.erase_keyframe(2);
  map.erase_keyframe(1);  // its parent is the first now, and it is the parent of the third
  CHECK(map.alive_keyframes.size() == 1);
  CHECK(map.point(a).observations.size() == 1);
  CHECK_FALSE(map.is_alive(b));
  map.keyframe(0).frame.T_cam_world = at(10);
  CHECK_THAT(map.pose(1).translation.x(), WithinAbs(11, 1e-12));
  CHECK_THAT(map.pose(2).translation.x(), WithinAbs(13, 1e-12));
  map.erase_keyframe(0);  // nobody is left who could tell where it was: it stays
  CHECK(map.alive_keyframes.empty());
  CHECK(map.alive_points() == 0);
  CHECK_THAT(map.pose(0).translation.x(), WithinAbs(10, 1e-12));
  CHECK_THAT(map.pose(2).translation.x(), WithinAbs(13, 1e-12));
}

TEST_CASE("A map that is full forgets the smallest of the other worlds, then its own oldest keyframes", "[slam]") {
  Map map;
  const int a = map.add({}), b = map.add({}), c = map.add({});
  for (int k = 0; k < 4; ++k) add_keyframe(map, {a}, at(k));
  map.begin_world();
  for (int k = 0; k < 2; ++k) add_keyframe(map, {b}, at(10 + k));
  const int here = map.begin_world();
  for (int k = 0; k < 3; ++k) add_keyframe(map, {c}, at(20 + k));
  map.forget(9, here);
  CHECK(map.alive_keyframes.size() == 9);
  map.forget(8, here);
  CHECK(map.alive_keyframes == std::vector<int>{0, 1, 2, 3, 6, 7, 8});
  CHECK_FALSE(map.is_alive(b));
  map.forget(3, here);
  CHECK(map.alive_keyframes == std::vector<int>{6, 7, 8});
  map.forget(2, here);
  CHECK(map.alive_keyframes == std::vector<int>{7, 8});
  CHECK(map.point(c).observations.size() == 2);
  for (int k = 0; k < 3; ++k) {  // what was tracked from them is where it was
    CHECK_THAT(map.pose(k).translation.x(), WithinAbs(k, 1e-12));
    CHECK_THAT(map.pose(6 + k).translation.x(), WithinAbs(20 + k, 1e-12));
  }
  CHECK(map.keyframe(4).world != map.keyframe(6).world);
}

TEST_CASE("A map that is full does not give up a large world for a small one that has begun", "[slam]") {
  Map map;
  const int a = map.add({}), b = map.add({});
  for (int k = 0; k < 8; ++k) add_keyframe(map, {a}, at(k));
  const int here = map.begin_world();
  for (int k = 0; k < 2; ++k) add_keyframe(map, {b}, at(10 + k));
  map.forget(9, here);
  CHECK(map.alive_keyframes == std::vector<int>{1, 2, 3, 4, 5, 6, 7, 8, 9});
  map.forget(5, here);
  CHECK(map.alive_keyframes == std::vector<int>{5, 6, 7, 8, 9});
}

TEST_CASE("A world that is joined to another moves with all that it holds and held; the others stay", "[slam]") {
  Map map;
  const int a = map.add({}), b = map.add({});
  add_keyframe(map, {a}, at(1));
  const int first = map.newest_world(), second = map.begin_world();
  add_keyframe(map, {b}, at(2));
  add_keyframe(map, {b}, at(3));
  map.point(b).created_by = 1;
  map.point(b).position.setZero();
  map.erase_keyframe(1);
  map.begin_world();
  add_keyframe(map, {map.add({})}, at(4));
  map.join(second, first, at(5).inverse());
  CHECK_THAT(map.pose(0).translation.x(), WithinAbs(1, 1e-12));
  CHECK_THAT(map.pose(1).translation.x(), WithinAbs(7, 1e-12));
  CHECK_THAT(map.pose(2).translation.x(), WithinAbs(8, 1e-12));
  CHECK_THAT(map.pose(3).translation.x(), WithinAbs(4, 1e-12));
  CHECK((map.keyframe(1).world == first && map.keyframe(2).world == first && map.keyframe(3).world != first));
  CHECK_THAT(map.point(b).position.x(), WithinAbs(-5, 1e-12));
}

TEST_CASE("What a frame sees through has gone; what is hidden, or where people are, proves nothing", "[slam]") {
  Map map;
  std::vector<int> board;
  Frame frame;  // at the origin: forty places of a board at 1 m, of which the frame sees ten now
  for (int i = 0; i < 40; ++i) {
    MapPoint point;
    point.position = {0.02 * i - 0.4, 0, 1};
    board.push_back(map.add(std::move(point)));
    if (i % 4 == 0) see(frame, {}, map.point(board.back()).position);
  }
  const int keyframe = add_keyframe(map, board);
  KeypointGrid grid;
  grid.build(frame.pixels, view.width, view.height);
  const auto gone = [&](std::size_t behind, float static_probability, float depth_m = 1) {
    for (std::size_t i = 0; i < frame.size(); ++i) frame.depths_m[i] = i < behind ? 3 : depth_m;
    frame.static_probability.assign(frame.size(), static_probability);
    return has_gone(map, keyframe, frame, grid, view);
  };
  CHECK_FALSE(gone(0, 1));
  CHECK_FALSE(gone(2, 1));
  CHECK(gone(3, 1));
  CHECK(gone(10, 1));
  CHECK(gone(10, 0));  // whoever stands behind
  CHECK(gone(2, 0));   // who stands where it was is not it
  CHECK_FALSE(gone(0, 0));
  CHECK_FALSE(gone(0, 1, 0.5F));  // hidden
  CHECK(gone(2, 1, 0.5F));
  CHECK_FALSE(gone(0, 1, -1));
  frame.T_cam_world = at(20);  // out of view
  CHECK_FALSE(gone(10, 1));
}

TEST_CASE("The place of a point that has gone is another's only when nobody knows it any more", "[slam]") {
  Map map;
  const int a = map.add({});
  map.erase_point(a);
  CHECK(map.add({}) != a);
  map.recycle();
  CHECK(map.add({}) == a);
  CHECK(map.is_alive(a));
  CHECK(map.points.size() == 2);
}

TEST_CASE("A world that is given up leaves the others as they were", "[slam]") {
  Map map;
  const int a = map.add({}), once = map.add({});
  add_keyframe(map, {a, once});
  for (int k = 0; k < 3; ++k) add_keyframe(map, {a});
  REQUIRE_FALSE(map.is_proven(map.point(once)));
  CHECK(map.begin_world() == 1);
  CHECK(map.is_proven(map.point(once)));  // nothing is known of the new world, and all that is seen counts
  const int b = map.add({});
  add_keyframe(map, {b, a});
  map.drop_world();
  CHECK(map.newest_world() == 0);
  CHECK(map.keyframes.size() == 4);
  CHECK_FALSE(map.is_alive(b));
  CHECK(map.point(a).observations.size() == 4);
  CHECK(map.is_proven(map.point(a)));
  CHECK_FALSE(map.is_proven(map.point(once)));
}

TEST_CASE("Keyframes whose points three others see go, and with them nothing that is needed", "[slam]") {
  Map map;
  std::vector<int> points;
  for (int p = 0; p < 50; ++p) points.push_back(map.add({}));
  for (int k = 0; k < 8; ++k) {
    add_keyframe(map, points);
    for (int n = 0; n < k; ++n) map.keyframes.back().neighbours.push_back(n);
  }
  Options options;
  Mapping(options).cull(map);
  CHECK(map.alive_keyframes.size() == 4);
  CHECK(map.keyframe(0).parent < 0);  // the world's origin
  CHECK(map.keyframe(7).parent < 0);
  CHECK(map.alive_points() == 50);
  for (const int p : points) CHECK(map.point(p).observations.size() == 4);
}

TEST_CASE("A bundle adjustment corrects the newest keyframe, but does not contradict the pose that was believed",
          "[slam]") {
  for (const double error_m : {0.05, 0.2}) {
    cfp::Random random(1, "bundle");
    Map map;
    Frame frames[2];
    for (int i = 0; i < 60; ++i) {
      MapPoint point;
      point.position = {random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(2, 4)};
      for (int k = 0; k < 2; ++k) {
        see(frames[k], at(0.1 * k), point.position);
        frames[k].map_point.back() = i;
        point.observations.push_back({k, i});
      }
      map.add(std::move(point));
    }
    frames[1].T_cam_world = at(0.1 + error_m);
    for (const Frame& frame : frames) map.add_keyframe(frame, 0);
    LocalBundle bundle(map, 1, view);
    bundle.solve();
    bundle.apply(map);
    CHECK_THAT(map.pose(1).translation.x(), WithinAbs(error_m < 0.1 ? 0.1 : 0.1 + error_m, 1e-3));
    CHECK(map.pose(0).translation.norm() == 0);
  }
}

TEST_CASE("What only the last frame knows holds the pose, but puts no keyframe off", "[slam]") {
  const Options options;
  cfp::Random random(1);
  Map map;
  Frame frame;
  LastFrameMatches last;
  constexpr int known = 60, others = 60;  // the latter of the last frame alone
  std::vector<int> of_keyframe;
  for (int i = 0; i < known + others; ++i) {
    const cfp::Vector3<double> X{random.uniform(-1, 1), random.uniform(-0.8, 0.8), random.uniform(2, 3)};
    see(frame, at(0.02), X);
    last.match.push_back(i);
    last.positions.push_back(X);
    if (i >= known) continue;
    MapPoint point;
    point.position = X;
    of_keyframe.push_back(frame.map_point.back() = map.add(std::move(point)));
  }
  for (int i = 0; i < 40; ++i) of_keyframe.push_back(map.add({}));  // not seen any more
  add_keyframe(map, of_keyframe);
  add_keyframe(map, of_keyframe);
  const std::vector<float> weight(frame.size(), 1);
  const RefinedPose pose = PoseSolver(options)(frame, last, map, weight, view, 0, true, options.health, std::nullopt);
  REQUIRE(pose.health.ok());
  CHECK(pose.inliers == known + others);
  CHECK(pose.in_map == known);
  const Mapping mapping(options);
  CHECK(mapping.wants_keyframe(map, frame, 0, pose.in_map, 10));
  CHECK_FALSE(mapping.wants_keyframe(map, frame, 0, pose.inliers, 10));
}

TEST_CASE("Of what the map knows of a view a frame must find some, but not more than it has keypoints", "[slam]") {
  Options options;
  options.unproven_share = 1e9;  // all weigh alike
  const auto health_with = [&](int proven, std::size_t expected) {
    cfp::Random random(2);
    Map map;
    Frame frame;
    LastFrameMatches last;
    std::vector<int> of_two, of_one;
    for (int i = 0; i < 120; ++i) {
      const cfp::Vector3<double> X{random.uniform(-1, 1), random.uniform(-0.8, 0.8), random.uniform(2, 3)};
      see(frame, at(0.02), X);
      MapPoint point;
      point.position = X;
      (i < proven ? of_two : of_one).push_back(frame.map_point.back() = map.add(std::move(point)));
    }
    add_keyframe(map, of_two);
    add_keyframe(map, of_two);
    add_keyframe(map, of_one);
    last.match.assign(frame.size(), cfp::no_match);
    const std::vector<float> weight(frame.size(), 1);
    return PoseSolver(options)(frame, last, map, weight, view, expected, true, options.health, std::nullopt)
        .health.status;
  };
  CHECK(health_with(30, 60) == cfp::PoseHealth::ok);
  CHECK(health_with(3, 60) == cfp::PoseHealth::ok);  // 5 %
  CHECK(health_with(5, 120) == cfp::PoseHealth::few_agree);
  CHECK(health_with(30, 3000) == cfp::PoseHealth::ok);  // most of it is hidden, and a frame has 120 keypoints
  CHECK(health_with(5, 3000) == cfp::PoseHealth::few_agree);
}

TEST_CASE("Depths tell the matches that one motion explains from the nine in ten that none does", "[slam]") {
  cfp::Random random(1, "rigid");
  const cfp::SE3<double> T_cam_world{cfp::so3_exp<double>({0.2, -0.4, 0.1}), {0.5, -0.2, 0.3}};
  Map map;
  Frame frame;
  std::vector<Match> matches;
  constexpr std::size_t all = 200, right = 20;
  for (std::size_t i = 0; i < all; ++i) {
    frame.keypoints.emplace_back();
    frame.pixels.push_back({float(random.uniform(0, 640)), float(random.uniform(0, 480))});
    frame.depths_m.push_back(float(random.uniform(1, 4)));
    MapPoint point;
    point.position = T_cam_world.inverse() * frame.back_project(i, view.camera);
    if (i >= right) point.position += cfp::Vector3<double>(random.uniform(-2, 2), random.uniform(-2, 2), 1);
    matches.push_back({i, map.add(std::move(point)), 0, 0});
  }
  std::vector<Match> kept = matches;
  keep_rigid(frame, map, view.camera, kept);
  CHECK(std::count_if(kept.begin(), kept.end(), [](const Match& m) { return m.keypoint < right; }) == right);
  CHECK(kept.size() < 3 * right);

  frame.depths_m.assign(all, -1);
  kept = matches;
  keep_rigid(frame, map, view.camera, kept);
  CHECK(kept.size() == all);
}
