// Optical flow for the box sequences of box_sequences.hpp: pairs on people move as their boxes, those on the room as
// the camera turns and, if it goes, by their depths.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/box_sequences.hpp"

namespace cfp_study {

struct BoxFlowOptions {
  int pairs = 300;
  double noise_px = 0.3;
  double mismatches = 0.03;      ///< share of the pairs that end anywhere
  double body = 0.7;             ///< share of a box's pairs that are on the person
  double along_m_s = 0;          ///< the camera goes sideways beside the people, so that their boxes show nothing of it
  double focal_length_px = 525;  ///< of the simulated camera
};

struct BoxFlow {
  std::vector<std::array<double, 2>> previous, current;
};

/// From one frame of a sequence to the next, dt_s later. The room is 2 to 8 m away.
inline BoxFlow flow_between(const BoxFrame& before, const BoxFrame& after, double dt_s, cfp::Random& random,
                            const BoxFlowOptions& o) {
  BoxFlow flow;
  const auto keep = [&](double x, double y, double u, double v) {
    if (random.uniform() < o.mismatches) u = random.uniform(0, 640), v = random.uniform(0, 480);
    if (!cfp::contains(Box{0, 0, 640, 480}, u, v)) return;
    flow.previous.push_back({x, y});
    flow.current.push_back({u + o.noise_px * random.normal(), v + o.noise_px * random.normal()});
  };
  for (int i = 0; i < o.pairs; ++i) {
    const double x = random.uniform(0, 640), y = random.uniform(0, 480), depth = random.uniform(2, 8);
    const auto holds = [&](const Truth& t) { return cfp::contains(t.box, x, y); };
    const auto from = std::find_if(before.truth.begin(), before.truth.end(), holds);
    if (from != before.truth.end() && random.uniform() < o.body) {
      const auto is_same = [&](const Truth& t) { return t.person == from->person; };
      const auto to = std::find_if(after.truth.begin(), after.truth.end(), is_same);
      if (to == after.truth.end()) continue;
      keep(x, y, to->box.x1 + (x - from->box.x1) / from->box.width() * to->box.width(),
           to->box.y1 + (y - from->box.y1) / from->box.height() * to->box.height());
    } else {
      const cfp::Vector3<double> q = after.image_motion * cfp::Vector3<double>(x, y, 1);
      keep(x, y, q.x() / q.z() - o.focal_length_px * o.along_m_s * dt_s / depth, q.y() / q.z());
    }
  }
  return flow;
}

}  // namespace cfp_study
