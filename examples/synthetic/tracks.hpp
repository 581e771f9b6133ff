// Values over time from key frames, and the scripts of what the two people do.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "cfp/core/random.hpp"

#include "camera_motion.hpp"
#include "scene.hpp"

namespace synthetic {

/// Smooth between keys (velocity zero at each), constant outside.
class Track {
 public:
  explicit Track(double start = 0) { keys_.push_back({0, start}); }
  /// Reaches value at time `to`, having kept the last one until `from`.
  void move(double from, double to, double value) {
    if (from > keys_.back().time) keys_.push_back({from, keys_.back().value});
    keys_.push_back({std::max(to, from + 1e-3), value});
  }
  [[nodiscard]] double last() const { return keys_.back().value; }
  [[nodiscard]] double operator()(double time) const {
    const auto next =
        std::upper_bound(keys_.begin(), keys_.end(), time, [](double t, const Key& key) { return t < key.time; });
    if (next == keys_.begin()) return keys_.front().value;
    const Key& before = *(next - 1);
    if (next == keys_.end()) return before.value;
    const double s = (time - before.time) / (next->time - before.time);
    return before.value + (next->value - before.value) * s * s * (3 - 2 * s);
  }

 private:
  struct Key {
    double time, value;
  };
  std::vector<Key> keys_;
};

/// Everything a person does over time. Angles in radians; heading 0 looks along +x.
struct Script {
  Track x, y, heading, distance, sit, head_yaw, lean;
  Track arm[2];  ///< 0 hanging (or in the lap), 1 raised and gesturing; [0] left
  double gait_offset = 0, height = 1.78;
};

/// Writes a script, action by action.
class Director {
 public:
  Director(double x, double y, double heading, double sit, double height) {
    script_.x = Track(x);
    script_.y = Track(y);
    script_.heading = Track(heading);
    script_.sit = Track(sit);
    script_.height = height;
  }

  [[nodiscard]] double now() const { return now_; }
  Script finish() { return std::move(script_); }

  void wait(double seconds) { now_ += seconds; }
  void turn(double heading, double seconds = 0.7) {
    const double from = script_.heading.last();
    const double by = std::remainder(heading - from, 2 * cfp::pi<double>);
    if (std::abs(by) < 0.05) return;
    script_.heading.move(now_, now_ + seconds, from + by);
    now_ += 0.6 * seconds;
  }
  void walk(double x, double y, double speed) {
    const double dx = x - script_.x.last(), dy = y - script_.y.last();
    const double length = std::hypot(dx, dy);
    if (length < 0.05) return;
    turn(std::atan2(dy, dx));
    const double seconds = length / speed + 0.3;
    script_.x.move(now_, now_ + seconds, x);
    script_.y.move(now_, now_ + seconds, y);
    script_.distance.move(now_, now_ + seconds, script_.distance.last() + length);
    now_ += seconds;
  }
  void sit(double to, double seconds = 1.4) {
    script_.sit.move(now_, now_ + seconds, to);
    script_.lean.move(now_, now_ + 0.5 * seconds, 0.5);
    script_.lean.move(now_ + 0.5 * seconds, now_ + seconds, 0);
    now_ += seconds;
  }
  /// Raises an arm, gestures, lowers it; the rest of the body stays still.
  void gesture(int arm, double seconds) {
    script_.arm[arm].move(now_, now_ + 0.6, 1);
    script_.arm[arm].move(now_ + 0.6 + seconds, now_ + 1.2 + seconds, 0);
    now_ += 1.2 + seconds;
  }
  void look(double yaw, double seconds = 0.6) {
    script_.head_yaw.move(now_, now_ + seconds, yaw);
    now_ += seconds;
  }
  void lean(double angle, double seconds = 1) {
    script_.lean.move(now_, now_ + seconds, angle);
    now_ += seconds;
  }

 private:
  Script script_;
  double now_ = 0;
};

inline void gesture_with_either(Director& d, cfp::Random& random, double shortest_s, double longest_s) {
  const double seconds = random.uniform(shortest_s, longest_s);  // before the arm, whatever order a compiler prefers
  d.gesture(static_cast<int>(random.index(2)), seconds);
}

/// On their chairs; sit 1: seated, less: perched.
inline Director seated(int person, const Stage& stage, double sit) {
  const Stage::Chair& chair = stage.chairs[person];
  const double feet = 0.42;  // in front of the chair's middle
  return {chair.x + feet * std::cos(chair.heading), chair.y + feet * std::sin(chair.heading), chair.heading, sit,
          person == 0 ? 1.80 : 1.74};
}

/// Two people on their chairs at the desk: gestures, looks, leaning, and much stillness.
inline Script sitting_script(cfp::Random& random, int person, double seconds, const Stage& stage) {
  Director d = seated(person, stage, 1);
  d.wait(person == 0 ? 0.3 : 1.2);
  while (d.now() < seconds) {
    const double choice = random.uniform();
    if (choice < 0.6) {
      gesture_with_either(d, random, 0.8, 3);
    } else if (choice < 0.75) {
      d.look(random.uniform(-0.9, 0.9));
    } else if (choice < 0.9) {
      d.lean(random.uniform(0, 0.45));
    } else {
      d.wait(random.uniform(0.4, 1.2));
    }
  }
  return d.finish();
}

/// Two people perched before the camera, at rest. When half of the time is over, the first gets up and leaves.
inline Script rising_script(int person, double seconds, const Stage& stage) {
  const Stage::Chair& chair = stage.chairs[person];
  Director d = seated(person, stage, 0.3);
  if (person == 0) {
    d.wait(seconds / 2);
    d.sit(0);
    d.walk(chair.x - 1.6, chair.y + 0.3, 0.9);
  }
  return d.finish();
}

/// They stand up, walk past each other before and behind the desk, stop to talk with a hand, and sit down again.
inline Script walking_script(cfp::Random& random, int person, double seconds, const Stage& stage) {
  const double side = person == 0 ? -1 : 1;
  const double lane = stage.lanes[person];
  const Stage::Chair& chair = stage.chairs[person];
  const double inward = chair.heading;
  const double seat_x = chair.x + 0.42 * std::cos(inward), seat_y = chair.y + 0.42 * std::sin(inward);
  const double speed = random.uniform(0.75, 1.05);
  const bool starts_seated = stage.room && person == 0;
  Director d(starts_seated ? seat_x : side * (stage.room ? 1.0 : 0.5), starts_seated ? seat_y : lane,
             starts_seated ? inward : cfp::pi<double>, starts_seated ? 1 : 0, person == 0 ? 1.80 : 1.74);
  if (starts_seated) {
    d.wait(0.6);
    d.sit(0);
    d.turn(-2.2, 1.0);
    d.walk(side * 0.4, lane, speed);
  }
  bool left = person != 0;
  while (d.now() < seconds) {
    const double choice = random.uniform();
    const double x = (left ? -1 : 1) * random.uniform(0.25, 1.1);
    if (choice < 0.62) {
      const double hurry = random.uniform(0.8, 1.2), aside = random.uniform(-0.1, 0.1);
      d.walk(x, lane + aside, speed * hurry);
      left = !left;
    } else if (choice < 0.8) {
      d.turn(random.uniform(1.1, 2.0));
      gesture_with_either(d, random, 0.4, 1.2);
    } else if (choice < 0.88 || !stage.room) {
      // Around the desk, behind the partition, and back on the other side.
      const double s = left ? -1 : 1;
      d.walk(s * 1.95, lane + 0.1, speed);
      d.walk(s * 1.95, 1.15 + 0.2 * person, speed);
      d.walk(-s * 1.95, 1.15 + 0.2 * person, speed);
      d.walk(-s * 1.95, lane, speed);
      left = s > 0;
    } else {
      d.walk(side * 1.5, lane, speed);
      d.walk(seat_x + 0.1 * side, seat_y, speed);
      d.turn(inward);
      d.walk(seat_x, seat_y, speed);
      d.turn(inward);
      d.sit(1);
      d.gesture(person, random.uniform(0.3, 1));
      d.sit(0);
    }
  }
  return d.finish();
}

/// They come in from the sides and stay where the camera looks. Every three seconds both take new places: side by side,
/// one before the other, the rear one stepping back; in between they gesture or look around. Each keeps his own
/// distance, so that they do not walk through each other.
inline Script close_up_script(cfp::Random& random, int person, double seconds, const Stage& stage,
                              const CameraMotion& camera) {
  const struct {
    double bearing, distance;
  } places[2][4] = {{{-0.26, 0.9}, {0.18, 0.92}, {-0.24, 0.96}, {-0.12, 0.88}},
                    {{0, 1.2}, {0.3, 1.2}, {0.24, 1.24}, {0.26, 1.45}}};
  const double home = person == 0 ? -1 : 1;
  const double speed = random.uniform(0.8, 1.05), front = stage.front + 0.27 * person;
  Director d(home * (0.75 + 0.15 * person), -1.95 + 0.3 * person, home > 0 ? cfp::pi<double> : 0, 0,
             person == 0 ? 1.80 : 1.74);
  for (int beat = 0; d.now() < seconds; ++beat) {
    const auto& place = places[person][beat % 4];
    // From where the camera will stand and look in the middle of the stop; y from the middle of its motion.
    const cfp::SE3<double> T = camera(d.now() + 2);
    const double angle = std::atan2(T.rotation(1, 2), T.rotation(0, 2)) - place.bearing - random.uniform(-0.04, 0.04);
    d.walk(T.translation.x() + place.distance * std::cos(angle),
           std::max(front, -2.95 + place.distance * std::sin(angle)), speed);
    d.turn(random.uniform(1.1, 2.0));
    if (random.uniform() < 0.6) {
      gesture_with_either(d, random, 0, 0.4);
    } else {
      d.look(random.uniform(-0.9, 0.9));
    }
    d.wait(std::max(0.0, 3 * (beat + 1) - d.now()));
  }
  return d.finish();
}

}  // namespace synthetic
