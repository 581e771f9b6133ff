// A person detector as it fails in reality: boxes that shake, bursts of misses where detection is hard, now and then a
// false box.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "cfp/core/random.hpp"

#include "renderer.hpp"

namespace synthetic {

struct DetectorOptions {
  double miss_rate = 0.012;         ///< chance per frame and person that a burst of misses begins, in the easiest case
  double miss_at_border = 0.03;     ///< added when the person leaves the image
  double miss_when_hidden = 0.12;   ///< times the hidden part
  double miss_per_rad_s = 0.05;     ///< times the camera's rotation rate
  double miss_when_blurred = 0.03;  ///< added with motion blur
  int longest_burst = 6;            ///< frames, uniform from 1
  double false_rate = 0.02;         ///< chance per frame that a false box appears; it stays 1 to 5 frames
  double jitter = 0.018;            ///< standard deviation of each edge / box size
  int fewest_pixels = 500;          ///< smaller sightings are never detected
};

struct Detection {
  cfp::Box<double> box;
  double score = 0;
};

/// Stateful: feed the frames in order.
class Detector {
 public:
  Detector(const DetectorOptions& options, std::uint64_t seed) : options_(options), random_(seed, "detector") {}

  std::vector<Detection> detect(const std::array<Sighting, 2>& people, double rotation_rad_s, bool blurred, int width,
                                int height) {
    std::vector<Detection> found;
    const auto add = [&](cfp::Box<double> box, double score) {
      box = cfp::clip(box, width, height);
      if (cfp::area(box) > 100) found.push_back({box, std::clamp(score, 0.26, 0.97)});
    };
    for (std::size_t who = 0; who < people.size(); ++who) {
      const Sighting& s = people[who];
      const double difficulty = options_.miss_rate + (s.at_border ? options_.miss_at_border : 0) +
                                options_.miss_when_hidden * (1 - s.visible) + options_.miss_per_rad_s * rotation_rad_s +
                                (blurred ? options_.miss_when_blurred : 0);
      // Draw always, so that one person's sighting does not change the other's luck.
      const bool begins = random_.uniform() < difficulty;
      const int burst = 1 + static_cast<int>(random_.index(static_cast<std::uint32_t>(options_.longest_burst)));
      double shake[5];
      for (double& d : shake) d = random_.normal();
      if (missing_[who] == 0 && begins) missing_[who] = burst;
      if (missing_[who] > 0) {
        --missing_[who];
        continue;
      }
      if (s.pixels < options_.fewest_pixels || s.visible < 0.15) continue;
      const double w = options_.jitter * s.box.width(), h = options_.jitter * s.box.height();
      add({s.box.x1 + w * shake[0], s.box.y1 + h * shake[1], s.box.x2 + w * shake[2], s.box.y2 + h * shake[3]},
          0.9 - 0.35 * (1 - s.visible) - (s.at_border ? 0.05 : 0) - 0.5 * difficulty + 0.04 * shake[4]);
    }
    if (false_left_ == 0 && random_.uniform() < options_.false_rate) {
      false_left_ = 1 + static_cast<int>(random_.index(5));
      const double h = random_.uniform(0.15, 0.5) * height, w = h * random_.uniform(0.3, 0.7);
      const double x = random_.uniform(0, width - w), y = random_.uniform(0, height - h);
      false_box_ = {x, y, x + w, y + h};
    }
    if (false_left_ > 0) {
      --false_left_;
      const double dx = 2 * random_.normal(), dy = 2 * random_.normal();
      add({false_box_.x1 + dx, false_box_.y1 + dy, false_box_.x2 + dx, false_box_.y2 + dy},
          0.42 + 0.08 * random_.normal());
    }
    return found;
  }

 private:
  DetectorOptions options_;
  cfp::Random random_;
  std::array<int, 2> missing_{};
  int false_left_ = 0;
  cfp::Box<double> false_box_;
};

}  // namespace synthetic
