// What a robot's day does to the driver: StaticProbability over a million frames of a camera among people who come and
// go, with changing counts, gaps, time that stands still or goes back, silent detectors, missing arrays and values that
// are not finite. After each tenth part: time of a frame, memory of the process, boxes alive, the largest id. The
// curves must be level, every probability in [0, 1], every id given once, and the last frames those of an object that
// starts there: what happened an hour ago has no say.
//   cfp_long_run_study [FRAMES [SEED]]
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <fstream>
#include <limits>
#include <set>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/frame/static_probability.hpp"

namespace {

using Point = std::array<float, 2>;
using Probability = cfp::StaticProbability<cfp::PinholeCamera<float>>;
const cfp::PinholeCamera<float> camera{525, 525, 320, 240};

struct Person {
  double x, y, depth, speed;
};

// The world of one camera, and the arrays of its present frame.
class World {
 public:
  explicit World(std::uint64_t seed) : random_(seed) {}

  // The frame's number decides what is wrong with it.
  cfp::Frame<float> next() {
    walk();
    const bool bad = random_.uniform() < 0.02;
    time_s_ += bad ? random_.uniform(-1, 30) : 1.0 / 30;
    look();
    cfp::Frame<float> frame;
    frame.timestamp_s = random_.uniform() < 0.001 ? std::numeric_limits<double>::quiet_NaN() : time_s_;
    frame.keypoints = keypoints;
    if (random_.uniform() > 0.05) frame.depths = depths;
    if (random_.uniform() > 0.1) frame.detections = detections;
    if (random_.uniform() > 0.1) frame.flow = {flow_from, keypoints, depths};
    if (bad && !keypoints.empty()) spoil();
    return frame;
  }
  cfp::PoseEstimate pose() { return {cfp::SE3<double>(), random_.index(200)}; }

  std::vector<Point> keypoints, flow_from;
  std::vector<float> depths, m;
  std::vector<std::int32_t> match;
  std::vector<cfp::Detection<float>> detections;

 private:
  void walk() {
    if (people_.size() < 6 && random_.uniform() < 0.03)
      people_.push_back({random_.uniform(-100, 740), 120, random_.uniform(1, 5), random_.normal() * 5});
    for (Person& p : people_) p.x += p.speed;
    people_.erase(std::remove_if(people_.begin(), people_.end(), [](auto& p) { return p.x < -150 || p.x > 790; }),
                  people_.end());
  }
  // Matches are those of a host that keeps the order of its keypoints while their number stays.
  void look() {
    const std::size_t before = keypoints.size(), n = random_.uniform() < 0.05 ? random_.index(400) : 200;
    keypoints.resize(n), flow_from.resize(n), depths.resize(n), m.resize(n, -1), match.assign(n, cfp::no_match);
    for (std::size_t i = 0; i < n; ++i) {
      const double on_person = people_.empty() ? -1 : random_.uniform();
      const bool person = on_person >= 0 && on_person < 0.5;
      const Person p = person ? people_[std::size_t(on_person * 2 * double(people_.size()))] : Person{};
      const double x = person ? p.x + random_.uniform(-40, 40) : random_.uniform(0, 640);
      const double y = person ? p.y + random_.uniform(0, 300) : random_.uniform(0, 480);
      const double motion = person ? p.speed : 0;
      keypoints[i] = {float(x + random_.normal() * 0.2), float(y + random_.normal() * 0.2)};
      flow_from[i] = {float(x - motion), float(y)};
      depths[i] = float(person ? p.depth : 6) + float(random_.normal()) * 0.02F;
      if (i < before && random_.uniform() < 0.8) match[i] = static_cast<std::int32_t>(i);
    }
    detections.clear();
    for (const Person& p : people_) {
      if (random_.uniform() < 0.15) continue;
      const float x = float(p.x + random_.normal() * 3), y = float(p.y + random_.normal() * 3);
      detections.push_back({{x - 45, y, x + 45, y + 300}, 0, float(random_.uniform(0.3, 1))});
    }
  }
  void spoil() {
    const float hostile[] = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -1e30F,
                             1e38F, 0};
    for (int k = 0; k < 20; ++k) {
      const std::size_t i = random_.index(static_cast<std::uint32_t>(keypoints.size()));
      const float value = hostile[random_.index(5)];
      switch (random_.index(5)) {
        case 0:
          keypoints[i][0] = value;
          break;
        case 1:
          depths[i] = value;
          break;
        case 2:
          m[i] = value;
          break;
        case 3:
          match[i] = static_cast<std::int32_t>(random_()) % 1000;
          break;
        default:
          if (!detections.empty()) detections[0].box.x1 = value;
      }
    }
  }

  cfp::Random random_;
  double time_s_ = 0;
  std::vector<Person> people_;
};

double resident_mib() {
  std::ifstream statm("/proc/self/statm");
  double size = 0, resident = 0;
  return statm >> size >> resident ? resident * 4096 / (1 << 20) : 0;
}

bool are_probabilities(cfp::span<const float> values) {
  return std::all_of(values.begin(), values.end(), [](float k) { return k >= 0 && k <= 1; });
}

struct Step {
  bool ok;  // all is a probability
  double us;
  cfp::span<const float> weight;
};

// Everything that the host of one camera does in a frame.
Step step(World& world, Probability& probability) {
  const cfp::Frame<float> frame = world.next();
  const std::clock_t start = std::clock();  // of the processor: other programs do not count
  Step done{are_probabilities(probability.coarse(frame).weight), 0, {}};
  const auto fine = probability.fine(world.pose(), world.match, world.m);
  probability.update_map_points(world.m);
  done.us = 1e6 * double(std::clock() - start) / CLOCKS_PER_SEC;
  done.weight = fine.weight;
  done.ok = done.ok && are_probabilities(fine.weight) && are_probabilities(fine.static_probability);
  for (float& m : world.m)
    if (!(m >= 0 && m <= 1)) m = -1;
  return done;
}

}  // namespace

int main(int argc, char** argv) {
  const bool smoke = argc > 1 && std::strcmp(argv[1], "--smoke") == 0;
  const long frames = smoke ? 2000 : argc > 1 ? std::atol(argv[1]) : 1000000;
  const std::uint64_t seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  World world(seed);
  Probability probability(camera);
  std::int64_t largest_id = -1;
  bool ok = true;
  std::printf("%10s %10s %10s %10s %12s %7s %8s\n", "frames", "median us", "99.9 % us", "largest us", "memory MiB",
              "boxes", "ids");
  for (long part = 1; part <= 10; ++part) {
    std::vector<double> times;
    double boxes = 0;
    for (long i = 0; i < frames / 10; ++i) {
      const Step done = step(world, probability);
      ok = done.ok && ok;
      times.push_back(done.us);
      std::set<std::int64_t> ids;
      for (const auto& box : probability.state().boxes) {
        ok = ids.insert(box.id).second && ok;
        largest_id = (std::max)(largest_id, box.id);
      }
      boxes += double(ids.size());
    }
    std::sort(times.begin(), times.end());
    std::printf("%10ld %10.1f %10.1f %10.1f %12.1f %7.2f %8lld\n", part * frames / 10, times[times.size() / 2],
                times[times.size() * 999 / 1000], times.back(), resident_mib(), boxes / double(times.size()),
                static_cast<long long>(largest_id + 1));
  }
  // A copy that is reset and a new object see the same frames from here on.
  Probability fresh(camera);
  World twin = world;
  probability.reset();
  bool same = true;
  for (int i = 0; i < 100; ++i) {
    const Step after_reset = step(world, probability), from_new = step(twin, fresh);
    ok = after_reset.ok && from_new.ok && ok;
    same = same && std::equal(after_reset.weight.begin(), after_reset.weight.end(), from_new.weight.begin(),
                              from_new.weight.end());
  }
  std::printf("probabilities in [0, 1], ids unique: %s; after a reset like new: %s\n", ok ? "yes" : "NO",
              same ? "yes" : "NO");
  return ok && same ? 0 : 1;
}
