// What the defaults of the box tracker rest on. Two kinds of data, so that neither alone decides:
//   TUD-Stadtmitte (MOT format: det.txt, gt.txt; 25 Hz, static camera, people who occlude each other), and
//   simulated walkers at 30 Hz (turns, stops, arms that change the width, bursts of misses, false alarms) before a
//   static camera and before a hand-held one, without and with the image motion handed to the tracker.
// Of the truth boxes that the detector missed (IoU < 0.5) for 1-6 frames in a row it prints the share that a
// compensated box covers at IoU >= 0.5, the compensated boxes on nothing and on a person who was detected, per frame,
// and identity switches. What no tracker can compensate is counted, too: `unseen` (never detected before) and `loose`
// (a detection overlaps the person by 0.3 to 0.5: there is a box, it only fits badly, so it counts as a detection).
// `recovered` is the share of the rest. Usage: cfp_tracker_study [folder of TUD-Stadtmitte]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <initializer_list>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/LU>

#include "cfp/core/random.hpp"
#include "cfp/detection/box_tracker.hpp"
#include "cfp/math/so3.hpp"
#include "support/data.hpp"

namespace {

using Box = cfp::Box<double>;
using cfp::Matrix3;

struct Truth {
  Box box;
  int person;
};
struct Frame {
  std::vector<Truth> truth;
  std::vector<cfp::Detection<double>> detections;
  Matrix3<double> image_motion = Matrix3<double>::Identity();
};
struct Sequence {
  std::vector<Frame> frames;
  double dt_s = 0;
  bool use_motion = false;
  double width = 640, height = 480;
};

// ---- data ----

std::vector<std::vector<double>> read_rows(const std::string& path) {
  std::ifstream file(path);
  std::vector<std::vector<double>> rows;
  for (std::string line; std::getline(file, line);) {
    std::stringstream fields(line);
    std::vector<double> row;
    for (std::string field; std::getline(fields, field, ',');) row.push_back(std::atof(field.c_str()));
    if (row.size() >= 7) rows.push_back(row);
  }
  return rows;
}

Sequence read_mot(const std::string& folder) {
  Sequence sequence;
  sequence.dt_s = 1.0 / 25;
  const auto frame = [&](double number) -> Frame& {
    const std::size_t k = static_cast<std::size_t>(number);
    if (sequence.frames.size() < k) sequence.frames.resize(k);
    return sequence.frames[k - 1];
  };
  for (const auto& r : read_rows(folder + "/gt.txt"))
    frame(r[0]).truth.push_back({{r[2], r[3], r[2] + r[4], r[3] + r[5]}, static_cast<int>(r[1])});
  for (const auto& r : read_rows(folder + "/det.txt"))
    frame(r[0]).detections.push_back({{r[2], r[3], r[2] + r[4], r[3] + r[5]}, 0, r[6]});
  return sequence;
}

/// People of 0.5 x 1.7 m walk and turn in a room; their boxes follow from a pinhole camera with f = 525 px.
Sequence simulate(std::uint64_t seed, bool hand_held, bool use_motion) {
  cfp::Random random(seed, "walkers");
  Sequence sequence;
  sequence.dt_s = 1.0 / 30;
  sequence.use_motion = use_motion;
  struct Person {
    double x, z, vx, vz, phase;
    int burst = 0;
  };
  std::vector<Person> people(4);
  for (Person& p : people)
    p = {random.uniform(-1.5, 1.5), random.uniform(1.8, 4.5), random.normal() * 0.6,
         random.normal() * 0.4,     random.uniform(0, 6),     0};
  double pan = 0, tilt = 0, roll = 0, pan_rate = 0, tilt_rate = 0, roll_rate = 0;
  Matrix3<double> before = Matrix3<double>::Identity();
  const double f = 525, cx = 320, cy = 240;
  for (int k = 0; k < 300; ++k) {
    Frame frame;
    if (hand_held) {  // angles driven by noisy rates, pulled back to the middle
      const double dt = sequence.dt_s;
      pan_rate += dt * (-6 * pan - 1.0 * pan_rate) + 0.10 * random.normal();
      tilt_rate += dt * (-6 * tilt - 1.0 * tilt_rate) + 0.06 * random.normal();
      roll_rate += dt * (-6 * roll - 1.0 * roll_rate) + 0.06 * random.normal();
      pan += dt * pan_rate;
      tilt += dt * tilt_rate;
      roll += dt * roll_rate;
    }
    Matrix3<double> K;
    K << f, 0, cx, 0, f, cy, 0, 0, 1;
    const Matrix3<double> R =
        cfp::so3_exp<double>({0, 0, roll}) * cfp::so3_exp<double>({tilt, 0, 0}) * cfp::so3_exp<double>({0, pan, 0});
    frame.image_motion = K * R * before.transpose() * K.inverse();
    before = R;
    std::vector<double> depth;
    for (std::size_t i = 0; i < people.size(); ++i) {
      Person& p = people[i];
      const double dt = sequence.dt_s;
      if (random.uniform() < 0.7 * dt) p.vx = 0.9 * random.normal();
      if (random.uniform() < 0.7 * dt) p.vz = 0.6 * random.normal();
      if (random.uniform() < 0.3 * dt) p.vx = p.vz = 0;
      if ((p.x < -1.8 && p.vx < 0) || (p.x > 1.8 && p.vx > 0)) p.vx = -p.vx;
      if ((p.z < 1.5 && p.vz < 0) || (p.z > 5 && p.vz > 0)) p.vz = -p.vz;
      p.x += dt * p.vx;
      p.z += dt * p.vz;
      const double speed = std::hypot(p.vx, p.vz);
      const double width = 0.5 + 0.12 * (speed > 0.1 ? std::sin(6 * speed * k * dt + p.phase) : 0.0);
      Box box{1e9, 1e9, -1e9, -1e9};
      for (const double sx : {-0.5, 0.5}) {
        for (const double y : {-0.8, 0.9}) {
          const Eigen::Vector3d q = K * R * Eigen::Vector3d(p.x + sx * width, y, p.z);
          const double u = q.x() / q.z(), v = q.y() / q.z();
          box = {std::min(box.x1, u), std::min(box.y1, v), std::max(box.x2, u), std::max(box.y2, v)};
        }
      }
      const Box visible = cfp::clip(box, 640.0, 480.0);
      if (cfp::area(visible) < 0.3 * cfp::area(box)) {
        depth.push_back(-1);
        continue;
      }
      frame.truth.push_back({visible, static_cast<int>(i)});
      depth.push_back(p.z);
    }
    for (const Truth& t : frame.truth) {
      Person& p = people[static_cast<std::size_t>(t.person)];
      double covered = 0;
      for (const Truth& o : frame.truth) {
        if (depth[static_cast<std::size_t>(o.person)] >= p.z || o.person == t.person) continue;
        covered = std::max(covered, cfp::area(cfp::intersection(o.box, t.box)) / cfp::area(t.box));
      }
      if (p.burst == 0 && random.uniform() < 0.04) p.burst = 1 + static_cast<int>(random.index(6));
      const bool missed = p.burst > 0 || covered > 0.6;
      p.burst = std::max(0, p.burst - 1);
      const double w = 0.04 * t.box.width(), h = 0.03 * t.box.height();
      const Box noisy{t.box.x1 + w * random.normal(), t.box.y1 + h * random.normal(), t.box.x2 + w * random.normal(),
                      t.box.y2 + h * random.normal()};
      if (!missed) frame.detections.push_back({noisy, 0, random.uniform(0.5, 1)});
    }
    if (random.uniform() < 0.03) {
      const double x = random.uniform(0, 500), y = random.uniform(0, 300), w = random.uniform(40, 140);
      frame.detections.push_back({{x, y, x + w, y + 2 * w}, 0, random.uniform(0.4, 0.8)});
    }
    sequence.frames.push_back(frame);
  }
  return sequence;
}

Sequence every_other(Sequence sequence) {
  std::vector<Frame> half;
  for (std::size_t k = 0; k < sequence.frames.size(); k += 2) half.push_back(sequence.frames[k]);
  sequence.frames = half;
  sequence.dt_s *= 2;
  return sequence;
}

enum class Withhold { nothing, frames, detections };

Sequence withhold(Sequence sequence, Withhold what) {
  int count = 0;
  for (std::size_t k = 0; k < sequence.frames.size(); ++k) {
    auto& d = sequence.frames[k].detections;
    if (what == Withhold::frames && k % 3 == 2) d.clear();
    if (what == Withhold::detections)
      d.erase(std::remove_if(d.begin(), d.end(), [&](const auto&) { return count++ % 3 == 2; }), d.end());
  }
  return sequence;
}

// ---- figures ----

struct Figures {
  double missed = 0, covered = 0;  // truth boxes in bursts of 1-6 missed frames
  double unseen = 0, loose = 0;    // of those not covered: no detection before the burst; a detection at IoU 0.3 to 0.5
  double on_nothing = 0, on_detected = 0, frames = 0, switches = 0, overlap = 0, overlaps = 0;
  void add(const Figures& o) {
    missed += o.missed, covered += o.covered, unseen += o.unseen, loose += o.loose, on_nothing += o.on_nothing;
    on_detected += o.on_detected, frames += o.frames, switches += o.switches, overlap += o.overlap,
        overlaps += o.overlaps;
  }
};

/// Indices of the boxes that belong to each truth box at IoU >= 0.5.
template <typename Boxes>
std::vector<int> match(const std::vector<Truth>& truth, const Boxes& boxes) {
  std::vector<cfp::Detection<double>> left, right;
  for (const Truth& t : truth) left.push_back({t.box, 0, 1});
  for (const auto& b : boxes) right.push_back({b.box, 0, 1});
  std::vector<int> partner(left.size());
  cfp::BoxAssociationWorkspace workspace;
  cfp::associate_boxes(left, right, 0.4999999, workspace, partner);
  return partner;
}

Figures run(const Sequence& sequence, cfp::BoxTrackerOptions options) {
  options.image_width = sequence.width;
  options.image_height = sequence.height;
  cfp::BoxTracker<double> tracker(options);
  Figures figures;
  struct Miss {
    bool covered, loose;
    std::size_t frame;
  };
  std::map<int, std::vector<Miss>> burst;  // the current run of misses of each person
  std::map<int, bool> seen;
  std::map<int, std::int64_t> identity;
  const auto close_burst = [&](int person) {
    std::vector<Miss>& b = burst[person];
    if (b.size() >= 1 && b.size() <= 6) {
      for (const Miss& m : b) {
        figures.missed += 1;
        figures.covered += m.covered;
        figures.unseen += !m.covered && !seen[person];
        figures.loose += !m.covered && seen[person] && m.loose;
      }
    }
    b.clear();
  };
  for (std::size_t k = 0; k < sequence.frames.size(); ++k) {
    const Frame& frame = sequence.frames[k];
    const auto result = tracker.track(frame.detections, k == 0 ? 0.0 : sequence.dt_s,
                                      sequence.use_motion ? &frame.image_motion : nullptr);
    const std::vector<int> detected = match(frame.truth, frame.detections);
    const std::vector<int> tracked = match(frame.truth, result.boxes);
    figures.frames += 1;
    for (std::size_t i = 0; i < frame.truth.size(); ++i) {
      const Truth& t = frame.truth[i];
      if (detected[i] == cfp::unassigned) {
        bool covered = false, loose = false;
        for (const auto& d : frame.detections) loose = loose || cfp::iou(d.box, t.box) >= 0.3;
        for (const auto& b : result.boxes) covered = covered || (b.compensated() && cfp::iou(b.box, t.box) >= 0.5);
        std::vector<Miss>& b = burst[t.person];
        if (!b.empty() && b.back().frame + 1 != k) close_burst(t.person);  // it left the picture in between
        burst[t.person].push_back({covered, loose, k});
      } else {
        close_burst(t.person);
        seen[t.person] = true;
      }
      if (tracked[i] == cfp::unassigned) continue;
      const std::int64_t id = result.boxes[static_cast<std::size_t>(tracked[i])].id;
      if (identity.count(t.person) != 0 && identity[t.person] != id) figures.switches += 1;
      identity[t.person] = id;
    }
    for (const auto& b : result.boxes) {
      if (!b.compensated()) continue;
      bool on_missed = false, on_detected = false;
      for (std::size_t i = 0; i < frame.truth.size(); ++i) {
        const double overlap = cfp::iou(b.box, frame.truth[i].box);
        if (overlap < 0.5) continue;
        (detected[i] == cfp::unassigned ? on_missed : on_detected) = true;
        if (detected[i] == cfp::unassigned) figures.overlap += overlap, figures.overlaps += 1;
      }
      figures.on_nothing += !on_missed && !on_detected;
      figures.on_detected += !on_missed && on_detected;
    }
  }
  for (const auto& [person, b] : std::map<int, std::vector<Miss>>(burst)) close_burst(person);
  return figures;
}

struct DataSet {
  std::string name;
  std::vector<Sequence> sequences;
};

Figures run(const DataSet& set, const cfp::BoxTrackerOptions& options) {
  Figures sum;
  for (const Sequence& s : set.sequences) sum.add(run(s, options));
  return sum;
}

struct Variant {
  std::string name;
  cfp::BoxTrackerOptions options;
};

std::vector<Variant> variants() {
  std::vector<Variant> all{{"defaults", {}}};
  const auto vary = [&](const std::string& name, auto member, std::initializer_list<double> values) {
    for (const double value : values) {
      Variant v{name + " " + std::to_string(value).substr(0, 5), {}};
      member(v.options, value);
      all.push_back(v);
    }
  };
  using O = cfp::BoxTrackerOptions;
  vary("max_coast", [](O& o, double v) { o.max_coast = static_cast<int>(v); }, {0, 3, 6, 9, 12});
  vary("confirm_hits", [](O& o, double v) { o.confirm_hits = static_cast<int>(v); }, {1, 2, 3, 5});
  vary("min_iou", [](O& o, double v) { o.min_iou = v; }, {0, 0.1, 0.2, 0.3, 0.4, 0.5});
  vary("birth_threshold", [](O& o, double v) { o.birth_threshold = v; }, {0.6, 0.7, 0.9});
  vary("min_score", [](O& o, double v) { o.min_score = v; }, {0.6, 0.7, 0.9});
  vary("edge_noise", [](O& o, double v) { o.motion.edge_noise = v; }, {0.01, 0.02, 0.04, 0.08, 0.15});
  vary("centre_acceleration", [](O& o, double v) { o.motion.centre_acceleration = v; }, {0.25, 0.5, 1, 1.5, 2, 4});
  vary("size_acceleration", [](O& o, double v) { o.motion.size_acceleration = v; }, {0.01, 0.05, 0.1, 0.2, 0.5, 1});
  vary("initial_centre_rate", [](O& o, double v) { o.motion.initial_centre_rate = v; }, {0.1, 0.3, 1, 3});
  vary("initial_size_rate", [](O& o, double v) { o.motion.initial_size_rate = v; }, {0.01, 0.05, 0.2, 0.5});
  vary("coast_per_hit", [](O& o, double v) { o.coast_per_hit = v; }, {0.5, 1, 2, 100});
  vary("min_visible", [](O& o, double v) { o.min_visible = v; }, {0, 0.25, 0.5});
  return all;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string folder = argc > 1 ? argv[1] : cfp_test::data_folder("mot/TUD-Stadtmitte").string();
  std::vector<DataSet> sets;
  const Sequence tud = read_mot(folder);
  if (tud.frames.empty()) {
    std::printf("no TUD-Stadtmitte in %s; simulated walkers only\n", folder.c_str());
  } else {
    sets.push_back({"TUD", {tud}});
    sets.push_back({"TUD, every 3rd frame withheld", {withhold(tud, Withhold::frames)}});
    sets.push_back({"TUD, every 3rd detection withheld", {withhold(tud, Withhold::detections)}});
  }
  sets.push_back({"simulated, static camera", {}});
  sets.push_back({"simulated, hand-held", {}});
  sets.push_back({"simulated, hand-held, image motion given", {}});
  sets.push_back({"simulated, hand-held, at 15 Hz", {}});
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    sets[sets.size() - 4].sequences.push_back(simulate(seed, false, false));
    sets[sets.size() - 3].sequences.push_back(simulate(seed, true, false));
    sets[sets.size() - 2].sequences.push_back(simulate(seed, true, true));
    sets[sets.size() - 1].sequences.push_back(every_other(simulate(seed, true, false)));
  }
  std::printf("%-42s %9s %8s %8s %8s %9s %10s %11s %9s %8s\n", "data, defaults", "missed1-6", "covered", "unseen",
              "loose", "recovered", "on nothing", "on detected", "switches", "mean IoU");
  for (const DataSet& set : sets) {
    const Figures f = run(set, {});
    std::printf("%-42s %9.0f %7.1f%% %7.1f%% %7.1f%% %8.1f%% %10.4f %11.4f %9.0f %8.3f\n", set.name.c_str(), f.missed,
                100 * f.covered / f.missed, 100 * f.unseen / f.missed, 100 * f.loose / f.missed,
                100 * f.covered / (f.missed - f.unseen - f.loose), f.on_nothing / f.frames, f.on_detected / f.frames,
                f.switches, f.overlap / f.overlaps);
  }
  std::printf("\nper data set: covered %% / on nothing per frame / switches\n%-26s", "variant");
  for (const DataSet& set : sets) std::printf("| %-21.21s", set.name.c_str());
  std::printf("\n");
  for (const Variant& v : variants()) {
    std::printf("%-26s", v.name.c_str());
    for (const DataSet& set : sets) {
      const Figures f = run(set, v.options);
      std::printf("| %5.1f %6.3f %6.0f  ", 100 * f.covered / f.missed, f.on_nothing / f.frames, f.switches);
    }
    std::printf("\n");
  }
}
