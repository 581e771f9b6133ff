// Static probability O of a person from simulated RGB-D flow with known motion: what depth, the measured noise, the
// positions and the foreground bring over the paper's epipolar distance. Prints, for 0 and 15 % wrong depths, per way
// of scoring: AUC; moving people missed at 5 % false alarms, over all and in the worst cell from 0.5 m/s on; static
// people called moving (O <= O_Th) at each noise; share of the frames in which O is known.
// "pairs one by one" leaves out what they share, "shared, error 0.1 px" and "0.01 px" are other
// ObjectProbabilityOptions:: shared_error_px, "strays counted" has a max_stray_share of 0. Then the same in a bare
// room, whose motion says little of a person who is near; "motion taken as exact" leaves its covariance out; "a host's
// motion" is the true one with errors of 3 mm and 1 mrad, and these as its sigmas, a "wrong" one errs by five times as
// much as it says. Then with 5, 15 and 30 % of the depths wrong by anything before furniture and walls, with
// CameraMotionOptions::nearest_share and shared_depth_ratio and without. Then with 10 to 14 points on the person, by
// ObjectProbabilityOptions::min_pairs. Then how soon somebody who sways counts as moving, and how often somebody at
// rest does whom a rolling shutter, a lens or a focal length that nobody told displaces, by shared_error_px. Then what
// the motion of the frame before adds, by FlowModelOptions::camera_acceleration_m_s2, where the camera's velocity
// changes (a hand: 0.6 m/s^2 in the truth of TUM's fr3_walking_xyz at 30 Hz). Then with one camera, no depths at all,
// in five kinds of scene and at three frame rates: with the fundamental matrix alone, and with the motion up to scale
// where there is none, or with a host's motion, which the flow refines. Then through a fisheye of 147 x 110 degrees, as
// it is and with the noise of all pairs of its undistorted image taken as alike.
//   cfp_object_motion_study [N per cell, default 20] [seed, default 1] | --smoke
//
// The simulator: 640 x 480 at 30 Hz, f = 535 px. Camera: still; sideways or forward 0.3 m/s; rotating 20 deg/s; both;
// slow 0.05 m/s. A room 4.2 m deep with a floor and furniture at 2.2 to 2.8 m, 350 tracked points. A person at 1.5
// to 3.5 m, 30 to 120 points on an ellipse within a box a tenth larger; at rest, or walking across, along the camera's
// motion, along the axis or with the camera at 0.2 to 2 m/s, limbs at +-30 % of it. Noise 0.1 to 0.4 px per coordinate,
// 4 % of the points up to 6 px off, depth noise of structured light; wrong depths: a point of the person has the depth
// of what is behind it, a point beside it the person's. The bare room has 60 points, no furniture and a person at 0.8
// to 1.6 m; a cluttered one 0.8 to 4.5 m in cells of 40 x 50 px; a floor with a slanted wall; a street with houses on
// both sides, 40 m long, a person at 3 to 10 m.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <string>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/frame/begin_frame.hpp"
#include "cfp/frame/estimate_objects.hpp"
#include "cfp/geometry/kannala_brandt_camera.hpp"

namespace {

using V2 = cfp::Vector2<double>;
using V3 = cfp::Vector3<double>;

const cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};
const cfp::KannalaBrandtCamera<double> fisheye{250, 250, 320.1, 247.6, -0.01, 0.003, -0.002, 0.0003};
constexpr std::array<double, 5> noises = {0.1, 0.15, 0.2, 0.3, 0.4};
const std::array<const char*, 6> cameras = {"still", "sideways", "forward", "rotating", "both", "slow"};
const std::array<const char*, 5> people = {"at rest", "across", "along", "axis", "with"};

struct Cell {
  std::size_t camera, person, noise;
  double speed;

  [[nodiscard]] bool at_rest() const { return person == 0; }
  [[nodiscard]] std::string name() const {
    char text[96];
    std::snprintf(text, sizeof text, "%s, %s %.2f m/s, %.2f px", cameras[camera], people[person], speed, noises[noise]);
    return text;
  }
};

/// What the pairs of a frame share without having moved.
struct Fault {
  const char* name = "none";
  double rolling_s = 0;    // from the first row to the last
  double radial = 0;       // k1 of a lens that is taken for a pinhole
  double focal_ratio = 1;  // of the camera to the one that is told
};
constexpr std::array<Fault, 4> faults = {
    {{"none"}, {"rolling shutter 20 ms", 0.02}, {"k1 of 0.03", 0, 0.03}, {"focal length 1 % off", 0, 0, 1.01}}};

struct Scene {
  std::vector<std::array<double, 2>> previous, current;
  std::vector<double> depths;
  cfp::Box<double> box;
  cfp::SE3<double> T_cur_prev;
};

/// Camera velocity (m/s) and turn rate (rad/s).
struct Velocity {
  V3 velocity = V3::Zero(), turn = V3::Zero();
};

Velocity draw_camera(std::size_t kind, cfp::Random& random) {
  Velocity drawn;
  auto& [velocity, turn] = drawn;
  const V3 any(random.normal(), random.normal(), random.normal());
  if (kind == 1 || kind == 4) velocity = 0.3 * V3(any.x(), 0.3 * any.y(), 0).normalized();
  if (kind == 2) velocity = 0.3 * V3(0.1 * any.x(), 0.05 * any.y(), 1).normalized();
  if (kind == 3 || kind == 4) turn = 0.35 * V3(random.normal(), random.normal(), 0.5 * random.normal()).normalized();
  if (kind == 5) velocity = 0.05 * any.normalized();
  return drawn;
}

double bare_depth(const V2& p) {
  const double floor = p.y() > 300 ? 1.35 * camera.fy / (p.y() - camera.cy) : 1e9;
  return std::min(4.2 + 0.001 * (p.x() - 320), floor);
}
double furnished_depth(const V2& p) {
  const double column = std::floor(p.x() / 70), row = std::floor(p.y() / 90);
  return std::min(bare_depth(p), std::fmod(column * 7 + row * 3, 5) < 1 ? 2.2 + 0.2 * std::fmod(column, 4) : 1e9);
}
double cluttered_depth(const V2& p) {
  return 0.8 + 0.37 * std::fmod(std::floor(p.x() / 40) * 7 + std::floor(p.y() / 50) * 3, 11);
}
double slanted_depth(const V2& p) {
  return std::min(1.35 * camera.fy / std::max(p.y() - camera.cy + 100, 1.0), 2 + 4 * p.x() / 640);
}
double street_depth(const V2& p) {
  const double houses = 2000 / std::max(std::abs(p.x() - 320) - 100, 1.0);
  return std::min({1.5 * camera.fy / std::max(p.y() - camera.cy, 1.0), houses, 40.0});
}

double wall_depth(const V2& p) { return 2.5 + 3 * p.x() / 640; }
double far_wall_depth(const V2& p) { return 5 + 3 * p.x() / 640; }

struct Room {
  const char* name;
  int points;
  double (*depth)(const V2& pixel);
  double nearest_m, farthest_m;    // a person in it
  bool wrong_anywhere = false;     // a wrong depth is any from 0.5 to 8 m, not that of the other side of a silhouette
  double fewest = 30, most = 120;  // points on the person
  double margin_px = 150;          // whose centre is so far from the left and the right of the image
};
constexpr std::array<Room, 5> rooms = {{{"a furnished room", 350, furnished_depth, 1.5, 3.5},
                                        {"a bare room", 60, bare_depth, 0.8, 1.6},
                                        {"a cluttered room", 200, cluttered_depth, 1, 3},
                                        {"a floor and a slanted wall", 200, slanted_depth, 1.5, 3.5},
                                        {"a street", 250, street_depth, 3, 10}}};
constexpr std::size_t rooms_with_depth = 2;
constexpr std::array<Room, 3> rooms_of_fisheye = {
    {{"a furnished room", 350, furnished_depth, 1.5, 3.5, false, 30, 120, 60},
     {"a bare room", 60, bare_depth, 0.8, 1.6, false, 30, 120, 60},
     {"a cluttered room", 200, cluttered_depth, 1, 3, false, 30, 120, 60}}};
constexpr Room few_pairs = {"10 to 14 pairs", 350, furnished_depth, 1.5, 3.5, false, 10, 15};
constexpr std::array<Room, 3> rooms_of_wrong_depths = {{{"a furnished room", 350, furnished_depth, 1.5, 3.5, true},
                                                        {"a slanted wall", 200, wall_depth, 1.5, 2.4, true},
                                                        {"a far wall", 60, far_wall_depth, 1.5, 4, true}}};

/// One frame of a camera that moves as it is told. `who` draws the person, `random` the points and the noise.
template <typename Lens = cfp::PinholeCamera<double>>
Scene simulate(const Cell& cell, const Room& room, double frame_s, double wrong_depths, const Velocity& moving,
               cfp::Random& who, cfp::Random& random, const Fault& fault = faults[0], const Lens& lens = camera) {
  Scene scene;
  const auto& [velocity, turn] = moving;
  const double side = who.uniform() < 0.5 ? -1 : 1;
  V3 walk = V3::Zero();
  if (cell.person == 1) walk = cell.speed * side * V3::UnitX();
  if (cell.person == 2) walk = cell.speed * side * velocity.normalized();
  if (cell.person == 3) walk = cell.speed * side * V3::UnitZ();
  if (cell.person == 4) walk = velocity;
  cfp::Vector6<double> twist;
  twist << -velocity * frame_s, -turn * frame_s;
  scene.T_cur_prev = cfp::se3_exp(twist);
  const cfp::DepthNoise depth_noise;
  // Where the faulty camera sees a point that it would see at the pixel p with a global shutter.
  const auto seen = [&](V2 p, const V3& X) {
    const double late_s = (p.y() / 480 - 0.5) * fault.rolling_s;
    if (fault.rolling_s > 0) (void)camera.project(cfp::se3_exp(cfp::Vector6<double>(late_s / frame_s * twist)) * X, p);
    const V2 centre(camera.cx, camera.cy), from_centre = p - centre;
    const double radius_sq = from_centre.squaredNorm() / (camera.fx * camera.fy);
    return V2(centre + fault.focal_ratio * (1 + fault.radial * radius_sq) * from_centre);
  };
  const auto add = [&](const V2& p, double z, const V3& step, double other_side) {
    V3 ray;
    V2 q;
    if (!lens.unproject(p, ray) || !lens.project(scene.T_cur_prev * V3(z * ray + step), q)) return;
    if (q.x() < 5 || q.y() < 5 || q.x() > 634 || q.y() > 474) return;
    q = seen(q, scene.T_cur_prev * V3(z * ray + step));
    const V2 before = seen(p, z * ray);
    q += noises[cell.noise] * V2(random.normal(), random.normal());
    if (random.uniform() < 0.04) q += V2(random.uniform(-6, 6), random.uniform(-6, 6));
    const bool is_wrong = random.uniform() < wrong_depths;
    const double measured = !is_wrong ? z : room.wrong_anywhere ? random.uniform(0.5, 8) : other_side;
    scene.previous.push_back({before.x(), before.y()});
    scene.current.push_back({q.x(), q.y()});
    scene.depths.push_back(measured + depth_noise.sigma_m(measured) * random.normal());
  };

  const double z = who.uniform(room.nearest_m, room.farthest_m), half_width = lens.fx * 0.28 / z,
               half_height = lens.fy * 0.8 / z;
  const V2 centre(who.uniform(room.margin_px, 640 - room.margin_px), who.uniform(220, 280));
  scene.box = {centre.x() - 1.1 * half_width, centre.y() - 1.05 * half_height, centre.x() + 1.1 * half_width,
               centre.y() + 1.05 * half_height};
  for (int i = 0; i < room.points; ++i) {
    const V2 p(random.uniform(6, 633), random.uniform(6, 473));
    const double beside =
        std::pow((p.x() - centre.x()) / half_width, 2) + std::pow((p.y() - centre.y()) / half_height, 2);
    if (beside > 1) add(p, room.depth(p), V3::Zero(), beside < 1.5 ? z : room.depth(p));
  }
  const int on_person = static_cast<int>(who.uniform(room.fewest, room.most));
  for (int i = 0; i < on_person; ++i) {
    const double angle = random.uniform(0, 2 * cfp::pi<double>), radius = std::sqrt(random.uniform());
    const V2 p(centre.x() + half_width * radius * std::cos(angle), centre.y() + half_height * radius * std::sin(angle));
    const V3 limb(random.normal(), random.normal(), random.normal());
    add(p, z + 0.08 * random.normal(), frame_s * (random.uniform(0.7, 1.3) * walk + 0.2 * walk.norm() * limb),
        room.depth(p));
  }
  return scene;
}

/// What a host hands over as the camera's motion.
enum class Given { nothing, pairs_as_exact, prediction_as_exact, prediction, wrong_prediction };

struct Way {
  const char* name = "";
  cfp::FrameOptions options;
  std::size_t depth_of_every = 1;  // so many pairs; 0: none, as with one camera
  Given given = Given::nothing;
  bool noise_alike = false;  // of all pairs of the undistorted image
};

constexpr double host_error_m = 0.003, host_error_rad = 0.001;

std::vector<Way> ways() {
  std::vector<Way> all(17);
  all[0].name = "as printed";
  all[1].name = "without depths";
  all[2].name = "depth";
  all[3].name = "depth, at 0.1 0.2 0.3 M";
  all[4].name = "depth, noise not measured";
  all[5].name = "depth, all pairs in the box";
  all[6].name = "depth of every second pair";
  all[7].name = "depth, motion taken as exact";
  all[8].name = "depth, a host's motion as exact";
  all[9].name = "depth, a host's motion";
  all[10].name = "depth, pairs one by one";
  all[11].name = "depth, shared, error 0.1 px";
  all[12].name = "depth, shared, error 0.01 px";
  all[13].name = "depth, a host's wrong motion";
  all[14].name = "depth, strays counted";
  all[15].name = "depth of every fifth pair";
  all[16].name = "depth of every twentieth pair";
  all[0].options.coarse.flow.use_motion_up_to_scale = false;
  all[0].options.coarse.flow.use_depth = all[1].options.coarse.flow.use_depth = false;
  all[0].options.coarse.object.noise_factor = all[4].options.coarse.object.noise_factor = 0;
  all[0].options.coarse.object.positions = all[3].options.coarse.object.positions = {0.1, 0.2, 0.3};
  all[0].options.coarse.object.max_stray_share = all[14].options.coarse.object.max_stray_share = 0;
  all[5].options.coarse.use_depth_foreground = false;
  all[6].depth_of_every = 2;
  all[15].depth_of_every = 5;
  all[16].depth_of_every = 20;
  all[7].given = Given::pairs_as_exact;
  all[8].given = Given::prediction_as_exact;
  all[9].given = Given::prediction;
  all[10].options.coarse.object.shared_error_px = 0;
  all[11].options.coarse.object.shared_error_px = 0.1;
  all[12].options.coarse.object.shared_error_px = 0.01;
  all[13].given = Given::wrong_prediction;
  return all;
}

/// Hands over the motion that cfp finds in the pairs outside the box, or the true one with the errors of a prediction.
void give_motion(Given given, const Scene& scene, cfp::Random& random, cfp::Frame<double>& frame) {
  if (given == Given::nothing) return;
  if (given == Given::pairs_as_exact) {
    std::vector<char> outside;
    for (const auto& p : scene.current) outside.push_back(contains(cfp::widened(scene.box, 0.1), p[0], p[1]) ? 0 : 1);
    cfp::CameraMotionWorkspace<double> workspace;
    const auto motion = cfp::estimate_camera_motion(frame.flow, outside, camera, cfp::CameraMotionOptions(), workspace);
    if (motion.known) frame.T_cur_prev = {motion.T_cur_prev, 0, 0};
    return;
  }
  const double factor = given == Given::wrong_prediction ? 5 : 1;
  cfp::Vector6<double> error;
  for (int k = 0; k < 6; ++k) error[k] = factor * (k < 3 ? host_error_m : host_error_rad) * random.normal();
  const double known = given == Given::prediction_as_exact ? 0 : 1;
  frame.T_cur_prev = {cfp::se3_exp(error) * scene.T_cur_prev, known * host_error_m, known * host_error_rad};
}

struct Outcome {
  const Cell* cell;
  double score;
  bool known;
};

void report(const char* name, const std::vector<Outcome>& outcomes, double threshold) {
  std::vector<double> resting, moving;
  for (const Outcome& o : outcomes) (o.cell->at_rest() ? resting : moving).push_back(o.score);
  std::sort(resting.begin(), resting.end());
  double area = 0;
  for (const double score : moving) {
    const auto [low, high] = std::equal_range(resting.begin(), resting.end(), score);
    area += static_cast<double>(resting.end() - high) + 0.5 * static_cast<double>(high - low);
  }
  area /= static_cast<double>(resting.size()) * static_cast<double>(moving.size());
  const double alarm = resting[resting.size() / 20];
  const auto missed = std::count_if(moving.begin(), moving.end(), [&](double score) { return score >= alarm; });
  std::map<const Cell*, std::array<double, 2>> cells;
  std::array<std::array<double, 2>, noises.size()> called{};
  double known = 0;
  for (const Outcome& o : outcomes) {
    known += o.known ? 1 : 0;
    if (o.cell->at_rest()) {
      called[o.cell->noise][0] += o.score <= threshold ? 1 : 0;
      called[o.cell->noise][1] += 1;
    } else if (o.cell->speed >= 0.5) {
      cells[o.cell][0] += o.score >= alarm ? 1 : 0;
      cells[o.cell][1] += 1;
    }
  }
  const Cell* worst = nullptr;
  double most = -1;
  for (const auto& [cell, count] : cells) {
    if (count[0] / count[1] <= most) continue;
    most = count[0] / count[1];
    worst = cell;
  }
  std::printf("%-38s %6.4f %6.2f %% %6.1f %%  ", name, area,
              100.0 * static_cast<double>(missed) / static_cast<double>(moving.size()), 100 * most);
  for (const auto& count : called) std::printf("%6.1f", 100 * count[0] / count[1]);
  std::printf(" %% %6.1f %%   %s\n", 100 * known / static_cast<double>(outcomes.size()),
              most > 0 && worst != nullptr ? worst->name().c_str() : "");
}

/// What takes back that the noise of a pair grows with the place in the undistorted image.
template <typename Lens>
std::vector<double> against_lens(const Lens& lens, const std::vector<std::array<double, 2>>& pixels) {
  std::vector<std::array<double, 2>> ideal;
  std::vector<double> memory, inverse;
  const auto points = cfp::undistorted(lens, cfp::PointSpan<double, 2>(pixels), ideal);
  for (const double sigma : cfp::undistorted_sigmas(lens, points, {}, memory)) inverse.push_back(1 / sigma);
  return inverse;
}

/// O of every cell, `repetitions` scenes each (at rest four times as many), as a row of the table.
template <typename Lens = cfp::PinholeCamera<double>>
void judge(const char* name, const Way& way, const std::vector<Cell>& cells, const Room& room, double frame_s,
           double wrong_depths, int repetitions, std::uint64_t seed, const Lens& lens = camera) {
  cfp::Random random(seed, "object_motion_study"), host(seed, "host");
  cfp::FrameState<double> state;
  std::vector<Outcome> outcomes;
  for (const Cell& cell : cells) {
    for (int i = 0; i < repetitions * (cell.at_rest() ? 4 : 1); ++i) {
      Scene scene = simulate(cell, room, frame_s, wrong_depths, draw_camera(cell.camera, random), random, random,
                             faults[0], lens);
      for (std::size_t k = 0; k < scene.depths.size(); ++k) {
        if (way.depth_of_every > 0 && k % way.depth_of_every != 0) scene.depths[k] = -1;
      }
      cfp::Frame<double> frame;
      frame.flow = {scene.previous, scene.current};
      if (way.depth_of_every > 0) frame.flow.previous_depths = scene.depths;
      std::vector<double> inverse;
      if (way.noise_alike) frame.flow.relative_sigmas = inverse = against_lens(lens, scene.current);
      give_motion(way.given, scene, host, frame);
      state.boxes.resize(1);
      state.boxes[0].box = scene.box;
      estimate_objects(frame, lens, way.options, state);
      outcomes.push_back({&cell, state.objects[0].static_probability, state.objects[0].status == cfp::Status::ok});
    }
  }
  report(name, outcomes, way.options.object_threshold);
}

/// The same of the last of six frames, between which the camera's velocity changes by the accelerations given, standard
/// deviations of each coordinate in m/s^2 and rad/s^2.
void judge_accelerated(const char* name, const cfp::FrameOptions& options, const std::vector<Cell>& cells,
                       const Room& room, double wrong_depths, const Velocity& acceleration, int repetitions,
                       std::uint64_t seed) {
  constexpr double frame_s = 1 / 30.0;
  cfp::Random random(seed, "accelerated"), held(seed, "hand");
  std::vector<Outcome> outcomes;
  for (const Cell& cell : cells) {
    for (int i = 0; i < repetitions * (cell.at_rest() ? 4 : 1); ++i) {
      cfp::FrameState<double> state;
      Velocity moving = draw_camera(cell.camera, held);
      for (int k = 0; k < 6; ++k) {
        const Scene scene = simulate(cell, room, frame_s, wrong_depths, moving, random, random);
        cfp::Frame<double> frame;
        frame.timestamp_s = k * frame_s;
        frame.flow = {scene.previous, scene.current, scene.depths};
        begin_frame(frame, state);
        state.boxes.resize(1);
        state.boxes[0].box = scene.box;
        estimate_objects(frame, camera, options, state);
        for (int axis = 0; axis < 3; ++axis) {
          moving.velocity[axis] += frame_s * acceleration.velocity[axis] * held.normal();
          moving.turn[axis] += frame_s * acceleration.turn[axis] * held.normal();
        }
      }
      outcomes.push_back({&cell, state.objects[0].static_probability, state.objects[0].status == cfp::Status::ok});
    }
  }
  report(name, outcomes, options.object_threshold);
}

void print_head(const char* title) {
  std::printf("\n%s\n%-38s %6s %8s %8s  %32s %8s\n", title, "O from", "AUC", "missed", "worst",
              "static called moving at 0.1..0.4", "known");
}

/// O over time: a person walks for a second, rests for one and a half, walks again. Printed: boxes static within 1 s of
/// the rest, share of the resting frames after that second that are static, boxes moving within 3 frames of the start.
void follow(const char* name, const cfp::FrameOptions& options, const Room& room, double speed, int repetitions,
            std::uint64_t seed) {
  int boxes = 0, soon = 0, resting = 0, resting_static = 0, caught = 0;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    for (std::size_t n = 0; n < noises.size(); ++n) {
      for (int i = 0; i < repetitions; ++i) {
        const std::uint64_t sequence = seed + 1000 * static_cast<std::uint64_t>(i) + 10 * c + n;
        cfp::Random random(sequence, "over time");
        cfp::FrameState<double> state;
        bool is_soon = false, is_caught = false;
        for (int k = 0; k < 90; ++k) {
          const bool walks = k < 30 || k >= 75;
          cfp::Random who(sequence, "person");
          const Cell cell{c, walks ? 1U : 0U, n, walks ? speed : 0};
          const Scene scene = simulate(cell, room, 1 / 30.0, 0.1, draw_camera(c, who), who, random);
          cfp::Frame<double> frame;
          frame.timestamp_s = k / 30.0;
          frame.flow = {scene.previous, scene.current, scene.depths};
          begin_frame(frame, state);
          state.boxes.resize(1);
          state.boxes[0].box = scene.box;
          estimate_objects(frame, camera, options, state);
          remember_objects(options, state);
          const bool is_static = state.objects[0].static_probability > options.object_threshold;
          if (k >= 30 && k < 60) is_soon = is_soon || is_static;
          if (k >= 60 && k < 75) {
            ++resting;
            resting_static += is_static ? 1 : 0;
          }
          if (k >= 75 && k < 78) is_caught = is_caught || !is_static;
        }
        ++boxes;
        soon += is_soon ? 1 : 0;
        caught += is_caught ? 1 : 0;
      }
    }
  }
  const auto percent = [](int part, int whole) { return 100.0 * part / whole; };
  std::printf("%-28s %5.2f m/s  %6.1f %%  %6.1f %%  %6.1f %%\n", name, speed, percent(soon, boxes),
              percent(resting_static, resting), percent(caught, boxes));
}

/// Share of the people who sway across at this speed and count as moving, over all cameras and noises.
double called_moving(double speed, const Fault& fault, double shared_error_px, int repetitions, std::uint64_t seed) {
  cfp::Random random(seed, "sway");
  cfp::FrameOptions options;
  options.coarse.object.shared_error_px = shared_error_px;
  cfp::FrameState<double> state;
  int moving = 0, all = 0;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    for (std::size_t n = 0; n < noises.size(); ++n) {
      for (int i = 0; i < 4 * repetitions; ++i, ++all) {
        const Scene scene =
            simulate({c, 1, n, speed}, rooms[0], 1 / 30.0, 0.05, draw_camera(c, random), random, random, fault);
        cfp::Frame<double> frame;
        frame.flow = {scene.previous, scene.current, scene.depths};
        state.boxes.resize(1);
        state.boxes[0].box = scene.box;
        estimate_objects(frame, camera, options, state);
        moving += state.objects[0].static_probability <= options.object_threshold ? 1 : 0;
      }
    }
  }
  return 100.0 * moving / all;
}

void print_accelerated(const std::vector<Cell>& cells, int repetitions, std::uint64_t seed) {
  for (const double wrong_depths : {0.0, 0.15}) {
    for (const Room& room : {rooms[0], rooms[1], rooms_of_wrong_depths[2]}) {
      for (const double moves : {0.5, 2.0, 4.0}) {
        char title[128];
        std::snprintf(title, sizeof title, "%s, %.0f %% wrong depths, a camera of %.1f m/s^2, by camera_acceleration",
                      room.name, 100 * wrong_depths, moves);
        print_head(title);
        for (const double believed : {0.0, 1.0, 2.0, 3.0, 5.0}) {
          cfp::FrameOptions options;
          options.coarse.flow.camera_acceleration_m_s2 = believed;
          char name[32];
          std::snprintf(name, sizeof name, "%.0f m/s^2", believed);
          judge_accelerated(name, options, cells, room, wrong_depths, {V3::Constant(moves), V3::Constant(5)},
                            repetitions, seed);
        }
      }
    }
  }
}

void print_fisheye(const std::vector<Cell>& cells, int repetitions, std::uint64_t seed) {
  print_head("through a fisheye; and the noise of all pairs alike");
  for (const bool alike : {false, true}) {
    Way way;
    way.noise_alike = alike;
    const auto row = [&](const Room& room, const char* what, double hz, double wrong_depths) {
      char name[64];
      std::snprintf(name, sizeof name, "%s%s%s", alike ? "  " : "", room.name, what);
      judge(name, way, cells, room, 1 / hz, wrong_depths, repetitions, seed, fisheye);
    };
    for (const Room& room : {rooms_of_fisheye[0], rooms_of_fisheye[1]}) {
      row(room, "", 30, 0);
      row(room, ", 15 % wrong", 30, 0.15);
    }
    way.depth_of_every = 0;
    row(rooms_of_fisheye[0], ", no depths", 30, 0);
    row(rooms_of_fisheye[2], ", no depths, 10 Hz", 10, 0);
  }
}

void print_shared(int repetitions, std::uint64_t seed) {
  constexpr std::array<double, 6> errors_px = {0, 0.1, 0.06, 0.04, 0.03, 0.02};
  std::printf("\na furnished room, 5 %% wrong depths: called moving (%%), by shared_error_px\n%-34s", "");
  for (const double e : errors_px) std::printf("%8.2f", e);
  const auto row = [&](const char* name, double speed, const Fault& fault) {
    std::printf("\n%-34s", name);
    for (const double e : errors_px) std::printf("%8.1f", called_moving(speed, fault, e, repetitions, seed));
  };
  for (const Fault& fault : faults) row((std::string("at rest, fault: ") + fault.name).c_str(), 0, fault);
  for (const double speed : {0.02, 0.05, 0.1, 0.2, 0.5}) {
    char name[64];
    std::snprintf(name, sizeof name, "across at %.2f m/s", speed);
    row(name, speed, faults[0]);
  }
  std::printf("\n");
}

}  // namespace

int main(int argc, char** argv) {
  const bool smoke = argc > 1 && std::strcmp(argv[1], "--smoke") == 0;
  const int repetitions = smoke ? 1 : argc > 1 ? std::atoi(argv[1]) : 20;
  const auto seed = static_cast<std::uint64_t>(argc > 2 ? std::atoi(argv[2]) : 1);
  if (repetitions < 1) {
    std::fprintf(stderr, "usage: cfp_object_motion_study [N per cell] [seed] | --smoke\n");
    return 2;
  }
  std::vector<Cell> cells;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    for (std::size_t p = 0; p < people.size(); ++p) {
      const bool translates = c != 0 && c != 3, needs_translation = p == 2 || p == 4, one_speed = p == 0 || p == 4;
      if (needs_translation && !translates) continue;
      for (const double speed : one_speed ? std::vector<double>{p == 0   ? 0.0
                                                                : c == 5 ? 0.05
                                                                         : 0.3}
                                          : std::vector<double>{0.2, 0.5, 1, 2}) {
        for (std::size_t n = 0; n < noises.size(); ++n) cells.push_back({c, p, n, speed});
      }
    }
  }

  std::printf("%d scenes per cell, seed %llu\n", repetitions, static_cast<unsigned long long>(seed));
  for (std::size_t r = 0; r < rooms_with_depth; ++r) {
    for (const double wrong_depths : {0.0, 0.15}) {
      char title[96];
      std::snprintf(title, sizeof title, "%s, %.0f %% wrong depths at the silhouettes", rooms[r].name,
                    100 * wrong_depths);
      print_head(title);
      for (const Way& way : ways()) judge(way.name, way, cells, rooms[r], 1 / 30.0, wrong_depths, repetitions, seed);
    }
  }

  for (const double wrong_depths : {0.05, 0.15, 0.3}) {
    char title[96];
    std::snprintf(title, sizeof title, "%.0f %% wrong depths anywhere", 100 * wrong_depths);
    print_head(title);
    for (const Room& room : rooms_of_wrong_depths) {
      Way way;
      judge(room.name, way, cells, room, 1 / 30.0, wrong_depths, repetitions, seed);
      way.options.coarse.flow.motion.nearest_share = 0;
      judge("  near ones tell what they can", way, cells, room, 1 / 30.0, wrong_depths, repetitions, seed);
      way.options.coarse.flow.motion.shared_depth_ratio = 0;
      judge("  and all take part", way, cells, room, 1 / 30.0, wrong_depths, repetitions, seed);
    }
  }

  print_head("a furnished room, 10 to 14 points on the person, 15 % wrong depths, by min_pairs");
  for (const std::size_t min_pairs : {4U, 6U, 8U, 10U, 12U}) {
    Way way;
    way.options.coarse.object.min_pairs = min_pairs;
    judge(std::to_string(min_pairs).c_str(), way, cells, few_pairs, 1 / 30.0, 0.15, repetitions, seed);
  }
  print_shared(repetitions, seed);
  print_accelerated(cells, (repetitions + 4) / 5, seed);
  print_fisheye(cells, repetitions, seed);

  print_head("one camera, no depths; then F alone; a host's motion, and a wrong one");
  Way one_camera;
  one_camera.depth_of_every = 0;
  for (const Room& room : rooms) {
    for (const double hz : smoke ? std::vector<double>{30} : std::vector<double>{30, 10, 5}) {
      for (const bool up_to_scale : {true, false}) {
        char name[64];
        std::snprintf(name, sizeof name, "%s, %.0f Hz%s", room.name, hz, up_to_scale ? "" : ", F");
        one_camera.options.coarse.flow.use_motion_up_to_scale = up_to_scale;
        judge(name, one_camera, cells, room, 1 / hz, 0, repetitions, seed);
      }
      Way host = one_camera;
      host.options = {};
      host.given = Given::prediction;
      judge("  a host's motion", host, cells, room, 1 / hz, 0, repetitions, seed);
      host.given = Given::wrong_prediction;
      judge("  a host's wrong motion", host, cells, room, 1 / hz, 0, repetitions, seed);
    }
  }

  for (std::size_t r = 0; r < rooms_with_depth; ++r) {
    std::printf("\nover time, %s, 10 %% wrong depths\n%-28s %9s  %8s  %8s  %8s\n", rooms[r].name, "", "speed",
                "at rest", "resting", "start");
    for (const Way& way : ways()) {
      for (const bool memory : {false, true}) {
        cfp::FrameOptions options = way.options;
        if (!memory) options.coarse.memory.time_constant_s = 0;
        for (const double speed : smoke ? std::vector<double>{0.5} : std::vector<double>{0.2, 0.5, 1.0}) {
          follow((std::string(way.name) + (memory ? ", remembered" : "")).c_str(), options, rooms[r], speed,
                 (repetitions + 3) / 4, seed);
        }
      }
      if (std::strcmp(way.name, "depth") == 0) break;
    }
  }
  return 0;
}
