// Sequences of person boxes with truth, detections and misses: simulated walkers before a still or hand-held camera at
// any frame rate and detector jitter, and recordings in the MOT format.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "cfp/core/random.hpp"
#include "cfp/detection/box_tracker_types.hpp"
#include "cfp/math/so3.hpp"

namespace cfp_study {

using Box = cfp::Box<double>;

struct Truth {
  Box box;
  int person;
};
struct BoxFrame {
  std::vector<Truth> truth;
  std::vector<cfp::Detection<double>> detections;
  cfp::Matrix3<double> image_motion = cfp::Matrix3<double>::Identity();
};
struct BoxSequence {
  std::vector<BoxFrame> frames;
  double dt_s = 0, width = 640, height = 480;
};

/// gt.txt and det.txt of a folder, every `step`-th frame, once from each of the first `step` frames; empty without
/// them.
inline std::vector<BoxSequence> read_mot(const std::string& folder, double rate_hz, std::size_t step) {
  BoxSequence all;
  const auto for_each_row = [&](const std::string& name, const auto& take) {
    std::ifstream file(folder + name);
    for (std::string line; std::getline(file, line);) {
      std::stringstream fields(line);
      std::vector<double> row;
      for (std::string field; std::getline(fields, field, ',');) row.push_back(std::atof(field.c_str()));
      if (row.size() < 7 || row[0] < 1) continue;
      const auto k = static_cast<std::size_t>(row[0]);
      if (all.frames.size() < k) all.frames.resize(k);
      take(all.frames[k - 1], row, Box{row[2], row[3], row[2] + row[4], row[3] + row[5]});
    }
  };
  for_each_row("/gt.txt", [](BoxFrame& frame, const std::vector<double>& row, const Box& box) {
    frame.truth.push_back({box, static_cast<int>(row[1])});
  });
  for_each_row("/det.txt", [](BoxFrame& frame, const std::vector<double>& row, const Box& box) {
    frame.detections.push_back({box, 0, row[6]});
  });
  std::vector<BoxSequence> out;
  for (std::size_t first = 0; first < step && !all.frames.empty(); ++first) {
    BoxSequence part;
    part.dt_s = static_cast<double>(step) / rate_hz;
    for (std::size_t k = first; k < all.frames.size(); k += step) part.frames.push_back(all.frames[k]);
    out.push_back(part);
  }
  return out;
}

/// Withholds the detections of people, at IoU >= 0.5 with their truth, in bursts of 1 to 6 frames.
inline BoxSequence withhold_bursts(BoxSequence sequence, cfp::Random& random, double rate) {
  std::map<int, int> burst;  // frames left, by person
  for (BoxFrame& frame : sequence.frames) {
    for (const Truth& t : frame.truth) {
      int& left = burst[t.person];
      if (left == 0 && random.uniform() < rate) left = 1 + static_cast<int>(random.index(6));
      if (left == 0) continue;
      --left;
      auto& d = frame.detections;
      d.erase(std::remove_if(d.begin(), d.end(), [&](const auto& seen) { return cfp::iou(seen.box, t.box) >= 0.5; }),
              d.end());
    }
  }
  return sequence;
}

struct WalkerOptions {
  double rate_hz = 30;
  double jitter = 0.04;  ///< standard deviation of a detected edge / size of the box
  bool hand_held = false;
  std::size_t people = 4;
  double speed = 0.9;  ///< scale of the walking speeds, m/s
  double miss_rate = 0.04;
  int frames = 300;
};

namespace detail {

struct Walker {
  double x, z, vx, vz, phase;
  int burst;

  void step(double dt, double speed, cfp::Random& random) {
    if (random.uniform() < 0.7 * dt) vx = speed * random.normal();
    if (random.uniform() < 0.7 * dt) vz = 0.7 * speed * random.normal();
    if (random.uniform() < 0.3 * dt) vx = vz = 0;
    if ((x < -1.8 && vx < 0) || (x > 1.8 && vx > 0)) vx = -vx;
    if ((z < 1.5 && vz < 0) || (z > 5 && vz > 0)) vz = -vz;
    x += dt * vx;
    z += dt * vz;
  }
  /// Box of a body of 1.7 m whose width swings with its steps.
  [[nodiscard]] Box box(const cfp::Matrix3<double>& KR, double time_s) const {
    const double speed = std::hypot(vx, vz);
    const double width = 0.5 + 0.12 * (speed > 0.1 ? std::sin(6 * speed * time_s + phase) : 0.0);
    Box out{1e9, 1e9, -1e9, -1e9};
    for (const double side : {-0.5, 0.5}) {
      for (const double y : {-0.8, 0.9}) {
        const Eigen::Vector3d q = KR * Eigen::Vector3d(x + side * width, y, z);
        const double u = q.x() / q.z(), v = q.y() / q.z();
        out = {(std::min)(out.x1, u), (std::min)(out.y1, v), (std::max)(out.x2, u), (std::max)(out.y2, v)};
      }
    }
    return out;
  }
};

/// Angles of a hand-held camera: noisy rates, pulled back to the middle. The noise per second does not depend on the
/// frame rate.
struct HandHeld {
  std::array<double, 3> angle{}, rate{};  // pan, tilt, roll

  cfp::Matrix3<double> step(double dt, cfp::Random& random) {
    const std::array<double, 3> noise{0.55, 0.33, 0.33};
    for (std::size_t i = 0; i < 3; ++i) {
      for (int k = 0; k < 8; ++k) {  // small steps: stable at low frame rates
        rate[i] += dt / 8 * (-6 * angle[i] - rate[i]) + noise[i] * std::sqrt(dt / 8) * random.normal();
        angle[i] += dt / 8 * rate[i];
      }
    }
    const auto about = [](double x, double y, double z) { return cfp::so3_exp(Eigen::Vector3d(x, y, z)); };
    return about(0, 0, angle[2]) * about(angle[1], 0, 0) * about(0, angle[0], 0);
  }
};

}  // namespace detail

/// People of 0.5 x 1.7 m walk and turn in a room before a pinhole camera with f = 525 px; the detector misses them in
/// bursts of 1 to 6 frames and where they are covered, and sometimes sees one that is not there.
inline BoxSequence simulate_walkers(cfp::Random& random, const WalkerOptions& o) {
  BoxSequence sequence;
  sequence.dt_s = 1 / o.rate_hz;
  std::vector<detail::Walker> people(o.people);
  for (detail::Walker& p : people)
    p = {random.uniform(-1.5, 1.5),       random.uniform(1.8, 4.5), 0.7 * o.speed * random.normal(),
         0.5 * o.speed * random.normal(), random.uniform(0, 6),     0};
  cfp::Matrix3<double> K, K_inverse, before = cfp::Matrix3<double>::Identity();
  K << 525, 0, 320, 0, 525, 240, 0, 0, 1;
  K_inverse << 1 / 525.0, 0, -320 / 525.0, 0, 1 / 525.0, -240 / 525.0, 0, 0, 1;
  detail::HandHeld camera;
  for (int k = 0; k < o.frames; ++k) {
    BoxFrame frame;
    cfp::Matrix3<double> R = cfp::Matrix3<double>::Identity();
    if (o.hand_held) R = camera.step(sequence.dt_s, random);
    frame.image_motion = K * R * before.transpose() * K_inverse;
    before = R;
    for (std::size_t i = 0; i < people.size(); ++i) {
      people[i].step(sequence.dt_s, o.speed, random);
      const Box box = people[i].box(K * R, k * sequence.dt_s), visible = cfp::clip(box, 640.0, 480.0);
      if (cfp::area(visible) >= 0.3 * cfp::area(box)) frame.truth.push_back({visible, static_cast<int>(i)});
    }
    for (const Truth& t : frame.truth) {
      detail::Walker& p = people[static_cast<std::size_t>(t.person)];
      double covered = 0;
      for (const Truth& other : frame.truth) {
        if (other.person == t.person || people[static_cast<std::size_t>(other.person)].z >= p.z) continue;
        covered = (std::max)(covered, cfp::area(cfp::intersection(other.box, t.box)) / cfp::area(t.box));
      }
      if (p.burst == 0 && random.uniform() < o.miss_rate) p.burst = 1 + static_cast<int>(random.index(6));
      const bool missed = p.burst > 0 || covered > 0.6;
      p.burst = (std::max)(0, p.burst - 1);
      const double w = o.jitter * t.box.width(), h = o.jitter * t.box.height();
      const Box seen{t.box.x1 + w * random.normal(), t.box.y1 + h * random.normal(), t.box.x2 + w * random.normal(),
                     t.box.y2 + h * random.normal()};
      const double score = 0.95 - 0.7 * covered - 0.15 * random.uniform();
      if (!missed) frame.detections.push_back({seen, 0, score});
    }
    if (random.uniform() < 0.03) {
      const double x = random.uniform(0, 500), y = random.uniform(0, 300), w = random.uniform(40, 140);
      frame.detections.push_back({{x, y, x + w, y + 2 * w}, 0, random.uniform(0.4, 0.8)});
    }
    sequence.frames.push_back(frame);
  }
  return sequence;
}

}  // namespace cfp_study
