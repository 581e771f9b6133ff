// Beyond the range of a depth camera, which share of the flow's pairs must have a depth for their motion to be the
// camera's? No boxes; somebody 1.5 to 2.5 m away who walks with 0.8 m/s, across or along the axis, or stands, holds
// `walker` of 400 flow pairs and as many keypoints, what is at rest within 2.2 to 4.4 m `near` of them. The others are
// 6 to 25 m away and without depth (hall), or 2.5 to 6 m, and three of five depths are missing at random (holes). The
// camera rests, moves across or along its axis or turns; who walks across before a camera that moves so, too, is left
// out, as nothing but depth tells. Depth noise as of structured light. Per share (UnreportedOptions::min_known_depths),
// means over cameras and walks: keypoints with a weight above 0.5 on who walks / on who stands / below it on the rest.
//
// One camera before a wall 4 m away, straight or slanted, has no F: what stands there, 0.8 m away in a tenth of the
// view, and what moves are one. What is said of either (nearer_than_room, max_parallax), the camera at rest, turning,
// or moving with 0.05, 0.15 and 0.5 m/s: keypoints above 0.5 on who walks / below 0.5 on what stands / below 0.5 on the
// wall.
//
// One camera and a host's motion, whose errors have the sigmas that it says, or five times these: in the room of
// `holes` without its depths, who walks across or along holding `walker` of the pairs: frames in which the motion is
// refused / keypoints above 0.5 on who walks / below 0.5 on the rest.
//
//   cfp_unreported_study [frames, default 50] [seed, default 7] | --smoke
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <utility>
#include <vector>

#include "../../tests/support/moving_flow.hpp"
#include "cfp/core/random.hpp"
#include "cfp/frame/static_probability.hpp"

namespace {

using V2 = cfp::Vector2<double>;
using V3 = cfp::Vector3<double>;

enum class Path { rests, across, along, turns };

enum class Place { hall, holes, wall, slanted_wall };

struct Scene {
  Place place = Place::hall;
  double near = 0, walker = 0.1, noise_px = 0.2, camera_m = 0.5 / 30;
  Path camera = Path::rests, person = Path::across;
};

struct Counts {
  double right = 0, all = 0;
};

enum class Part : std::uint8_t { room, thing, person };

// Keypoints that have the weight asked for: on the person above 0.5, elsewhere below. Frames of a refused motion.
struct Judged {
  Counts person, thing, room, refused;
};

// Sigmas of a motion that a host hands over, and by how many of them it errs.
struct Host {
  double sigma_m = 0, sigma_rad = 0, errors = 1;
};

class Frames {
 public:
  Frames(const Scene& scene, cfp::Random& random) : scene_(scene), random_(random) {}

  void make() {
    previous.clear(), current.clear(), keypoints.clear(), flow_depths.clear(), depths.clear(), part.clear();
    T_cur_prev = motion();
    const double step = (random_.uniform() < 0.5 ? 0.8 : -0.8) / 30;
    const V3 shift(scene_.person == Path::across ? step : 0, 0, scene_.person == Path::along ? step : 0);
    person_ = V3(random_.uniform(-0.6, 0.6), 0, random_.uniform(1.5, 2.5));
    thing_ = random_.uniform(-0.3, 0.3);
    for (int i = 0; i < 800; ++i) {
      Part of = Part::room;
      const V3 point = sample(of);
      const bool person = of == Part::person;
      const V3 moved = T_cur_prev * V3(point + (person ? shift : V3(0, 0, 0)));
      V2 from = V2::Zero(), to = from;
      if (!camera.project(point, from) || !camera.project(moved, to) || !in_image(to)) continue;
      const bool behind = !person && scene_.walker > 0 && point.z() > person_.z();
      if (behind && (is_covered(from) || is_covered(to))) continue;
      if (i % 2 == 0) {
        keypoints.push_back({to.x(), to.y()});
        depths.push_back(measured(moved.z()));
        part.push_back(of);
      } else {
        const double s = scene_.noise_px;
        previous.push_back({from.x() + s * random_.normal(), from.y() + s * random_.normal()});
        current.push_back({to.x() + s * random_.normal(), to.y() + s * random_.normal()});
        flow_depths.push_back(measured(point.z()));
      }
    }
  }

  cfp::PinholeCamera<double> camera{525, 525, 320, 240};
  cfp::SE3<double> T_cur_prev;
  std::vector<std::array<double, 2>> previous, current, keypoints;
  std::vector<double> flow_depths, depths;
  std::vector<Part> part;

 private:
  cfp::SE3<double> motion() {
    cfp::Vector6<double> xi = cfp::Vector6<double>::Zero();
    if (scene_.camera == Path::across) xi[0] = scene_.camera_m;
    if (scene_.camera == Path::along) xi[2] = -scene_.camera_m;
    if (scene_.camera == Path::turns) xi[4] = 0.02;
    for (int k = 0; k < 6; ++k) xi[k] += (k < 3 ? 0.001 : 0.002) * random_.normal();
    return cfp::se3_exp(xi);
  }
  V3 sample(Part& of) {
    const double share = random_.uniform();
    if (share < scene_.walker) {
      of = Part::person;
      return person_ + V3(random_.uniform(-0.25, 0.25), random_.uniform(-0.8, 0.8), random_.uniform(-0.1, 0.1));
    }
    const double u = random_.uniform(-0.6, 0.6), v = random_.uniform(-0.45, 0.45);
    if (scene_.place == Place::wall || scene_.place == Place::slanted_wall) {
      const double z = scene_.place == Place::wall ? 4 : 4 / (1 + u);
      const bool thing = scene_.near > 0 && std::abs(u - thing_) < 0.2 && std::abs(v - 0.1) < 0.2;
      of = thing ? Part::thing : Part::room;
      return (thing ? 0.2 : 1) * V3(u * z, v * z, z);
    }
    if (share < scene_.walker + scene_.near) {
      const double z = random_.uniform(2.2, 4.4);
      return {u * z, random_.uniform(0.1, 0.45) * z, z};
    }
    const double z = scene_.place == Place::hall ? random_.uniform(6, 25) : random_.uniform(2.5, 6);
    return {u * z, v * z, z};
  }
  bool is_covered(const V2& pixel) const {
    return std::abs((pixel.x() - 320) / 525 * person_.z() - person_.x()) < 0.3 &&
           std::abs((pixel.y() - 240) / 525 * person_.z()) < 0.85;
  }
  static bool in_image(const V2& p) { return p.x() >= 0 && p.x() < 640 && p.y() >= 0 && p.y() < 480; }
  double measured(double z) {
    const bool missing =
        scene_.place == Place::hall ? z > 4.5 : scene_.place != Place::holes || random_.uniform() < 0.6;
    return missing ? 0 : z + 0.0016 * z * z * random_.normal();
  }

  Scene scene_;
  cfp::Random& random_;
  V3 person_;
  double thing_ = 0;
};

cfp::UncertainMotion<double> seen_by(const Host& host, const cfp::SE3<double>& T_cur_prev, cfp::Random& random) {
  const auto error = cfp_test::random_motion(host.errors * host.sigma_m, host.errors * host.sigma_rad, random);
  return {error * T_cur_prev, host.sigma_m, host.sigma_rad};
}

// With a host: one camera, no depths.
Judged judge(const Scene& scene, const cfp::UnreportedOptions& unreported, int frames, std::uint64_t seed,
             const Host* host = nullptr) {
  cfp::Random random(seed, "unreported study");
  Frames made(scene, random);
  cfp::FrameOptions options;
  options.coarse.unreported = unreported;
  cfp::StaticProbability probability(made.camera, options);
  const std::vector<cfp::Detection<double>> nobody;
  Judged judged;
  for (int k = 0; k < frames + 3; ++k) {
    made.make();
    cfp::Frame<double> frame;
    frame.timestamp_s = 1000 + k / 30.0;
    frame.keypoints = made.keypoints;
    frame.depths = made.depths;
    frame.detections = nobody;
    frame.flow = {made.previous, made.current, made.flow_depths};
    if (host != nullptr) {
      frame.depths = frame.flow.previous_depths = {};
      frame.T_cur_prev = seen_by(*host, made.T_cur_prev, random);
    }
    const auto [weight, known, report] = probability.coarse(frame);
    if (k >= 3) judged.refused.right += report.motion_refused ? 1 : 0, ++judged.refused.all;
    for (std::size_t i = 0; k >= 3 && i < weight.size(); ++i) {
      const bool person = made.part[i] == Part::person;
      Counts& counts = person ? judged.person : made.part[i] == Part::thing ? judged.thing : judged.room;
      counts.right += (weight[i] > 0.5) == person ? 1 : 0;
      ++counts.all;
    }
  }
  return judged;
}

double percent(const Counts& counts) { return counts.all > 0 ? 100 * counts.right / counts.all : 0; }

// To a mean of shares.
void add(const Counts& counts, Counts& mean) {
  if (counts.all > 0) mean.right += counts.right / counts.all, ++mean.all;
}

void print_depths(Scene scene, const cfp::UnreportedOptions& options, int frames, std::uint64_t seed) {
  Counts walking, standing, room;
  for (const Path camera : {Path::rests, Path::across, Path::along, Path::turns}) {
    for (const Path person : {Path::rests, Path::across, Path::along}) {
      scene.camera = camera, scene.person = person;
      if (camera == Path::across && person == Path::across) continue;
      const Judged judged = judge(scene, options, frames, seed);
      add(judged.person, person == Path::rests ? standing : walking);
      add(judged.room, room);
    }
  }
  std::printf(" %.0f / %.0f / %.1f |", percent(walking), percent(standing), percent(room));
}

void print_one_camera(Scene scene, const cfp::UnreportedOptions& options, int frames, std::uint64_t seed) {
  Counts walking, thing, room;
  const bool moves = scene.camera == Path::across || scene.camera == Path::along;
  for (const double speed : {0.05, 0.15, 0.5}) {
    scene.camera_m = speed / 30;
    if (!moves && speed > 0.05) continue;
    scene.near = 0, scene.walker = 0.1;
    for (const Path person : {Path::across, Path::along}) {
      scene.person = person;
      if (person != scene.camera) add(judge(scene, options, frames, seed).person, walking);
    }
    scene.near = 0.1, scene.walker = 0;
    const Judged judged = judge(scene, options, frames, seed);
    add(judged.thing, thing);
    add(judged.room, room);
  }
  std::printf(" %.0f / %.1f / %.1f |", percent(walking), percent(thing), percent(room));
}

void print_host(Scene scene, const Host& host, int frames, std::uint64_t seed) {
  Counts refused, walking, room;
  for (const Path camera : {Path::rests, Path::across, Path::along, Path::turns}) {
    for (const Path person : {Path::across, Path::along}) {
      scene.camera = camera, scene.person = person;
      if (camera == person) continue;  // as something near that stands
      const Judged judged = judge(scene, {}, frames, seed, &host);
      add(judged.refused, refused), add(judged.person, walking), add(judged.room, room);
    }
  }
  std::printf(" %.0f / %.0f / %.1f |", percent(refused), percent(walking), percent(room));
}

}  // namespace

int main(int argc, char** argv) {
  const bool smoke = argc > 1 && std::strcmp(argv[1], "--smoke") == 0;
  const int frames = smoke ? 2 : argc > 1 ? std::atoi(argv[1]) : 50;
  const int seed = argc > 2 ? std::atoi(argv[2]) : 7;
  if (frames < 1 || seed < 0) {
    std::fprintf(stderr, "usage: cfp_unreported_study [frames >= 1] [seed >= 0] | --smoke\n");
    return 2;
  }
  const auto stream = static_cast<std::uint64_t>(seed);
  std::printf("%d frames a cell, seed %d: %% above 0.5 of who walks / who stands / below 0.5 of the room\n\n", frames,
              seed);
  std::printf("| room | near | walker | noise px | camera m/s | depths always | a quarter | half | three quarters |\n");
  std::printf("|---|--:|--:|--:|--:|--:|--:|--:|--:|\n");
  for (const Place place : {Place::hall, Place::holes}) {
    for (const double near : {0.0, 0.1, 0.2, 0.3}) {
      for (const double walker : {0.05, 0.1, 0.2}) {
        for (const double noise_px : {0.2, 0.4}) {
          for (const double speed : {0.1, 0.5}) {
            if (smoke && (near > 0 || walker > 0.1 || noise_px > 0.2)) continue;
            const bool hall = place == Place::hall;
            if (!hall && near != 0.1) continue;  // the room is as near
            std::printf("| %s | %.1f | %.2f | %.1f | %.1f |", hall ? "hall" : "holes", near, walker, noise_px, speed);
            for (const double share : {0.0, 0.25, 0.5, 0.75}) {
              cfp::UnreportedOptions options;
              options.min_known_depths = share;
              print_depths({place, near, walker, noise_px, speed / 30}, options, frames, stream);
            }
            std::printf("\n");
          }
        }
      }
    }
  }

  std::printf("\none camera: %% above 0.5 of who walks / below 0.5 of what stands / of the wall\n\n");
  std::printf(
      "| wall | noise px | camera | as in boxes, no limit | inverse 1 +- 2.5, no limit | 1 +- 10 | 5 | 3 | 1.5 |\n");
  std::printf("|---|--:|---|--:|--:|--:|--:|--:|--:|\n");
  constexpr std::array<const char*, 4> cameras = {"rests", "across", "along", "turns"};
  for (const Place place : {Place::wall, Place::slanted_wall}) {
    for (const double noise_px : {0.2, 0.4}) {
      for (const Path camera : {Path::rests, Path::across, Path::along, Path::turns}) {
        if (smoke && (noise_px > 0.2 || camera == Path::turns)) continue;
        std::printf("| %s | %.1f | %s |", place == Place::wall ? "straight" : "slanted", noise_px,
                    cameras[static_cast<std::size_t>(camera)]);
        for (const auto& [nearer, limit] : std::array<std::pair<cfp::UnknownDepth, double>, 6>{
                 {{{2.5, 1}, 1e6}, {{1, 2.5}, 1e6}, {{1, 10}, 1e6}, {{1, 2.5}, 5}, {{1, 2.5}, 3}, {{1, 2.5}, 1.5}}}) {
          cfp::UnreportedOptions options;
          options.nearer_than_room = nearer, options.max_parallax = limit;
          print_one_camera({place, 0, 0, noise_px, 0, camera}, options, frames, stream);
        }
        std::printf("\n");
      }
    }
  }

  std::printf("\none camera, a host's motion: %% refused / above 0.5 of who walks / below 0.5 of the room\n\n");
  std::printf("| walker | noise px | errors | 0.1 mm, 0.05 mrad | 0.2, 0.1 | 0.5, 0.2 | 1, 0.5 | 3, 1 |\n");
  std::printf("|--:|--:|--:|--:|--:|--:|--:|--:|\n");
  for (const double walker : {0.0, 0.1, 0.2}) {
    for (const double noise_px : {0.2, 0.4}) {
      for (const double errors : {1.0, 5.0}) {
        if (smoke && (noise_px > 0.2 || errors > 1)) continue;
        std::printf("| %.1f | %.1f | %.0f |", walker, noise_px, errors);
        for (const auto& [m, rad] : std::array<std::pair<double, double>, 5>{
                 {{1e-4, 5e-5}, {2e-4, 1e-4}, {5e-4, 2e-4}, {1e-3, 5e-4}, {3e-3, 1e-3}}})
          print_host({Place::holes, 0, walker, noise_px, 0.3 / 30}, {m, rad, errors}, frames, stream);
        std::printf("\n");
      }
    }
  }
}
