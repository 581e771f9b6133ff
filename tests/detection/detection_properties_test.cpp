// Properties of the box tracker and its filters, for whatever the generators make.
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <vector>

#include "cfp/detection/box_motion.hpp"
#include "cfp/detection/box_tracker.hpp"
#include "cfp_testing/generators.hpp"
#include "support/properties.hpp"

using cfp::Random;

namespace {

using Detections = std::vector<cfp::Detection<double>>;
using Boxes = std::vector<cfp::TrackedBox<double>>;

/// Two or three people who walk, now and then unseen.
std::vector<Detections> walk(Random& random, int frames) {
  std::vector<Detections> all;
  const std::size_t people = cfp_testing::count(random, 2, 3);
  for (int k = 0; k < frames; ++k) {
    Detections seen;
    for (std::size_t p = 0; p < people; ++p) {
      const double x = 40 + 200 * static_cast<double>(p) + 3 * k + random.normal(), y = 100 + random.normal();
      if (random.uniform() > 0.15) seen.push_back({{x, y, x + 70, y + 220}, 0, random.uniform(0.5, 1)});
    }
    all.push_back(seen);
  }
  return all;
}

Boxes track(const std::vector<Detections>& frames, std::vector<std::size_t>* sizes = nullptr) {
  cfp::BoxTracker<double> tracker;
  Boxes all;
  for (const Detections& detections : frames) {
    const auto result = tracker.track(detections, 1.0 / 30);
    all.insert(all.end(), result.boxes.begin(), result.boxes.end());
    if (sizes != nullptr) sizes->push_back(all.size());
  }
  return all;
}

bool same(const cfp::Box<double>& a, const cfp::Box<double>& b, double tolerance = 0) {
  return std::abs(a.x1 - b.x1) <= tolerance && std::abs(a.y1 - b.y1) <= tolerance &&
         std::abs(a.x2 - b.x2) <= tolerance && std::abs(a.y2 - b.y2) <= tolerance;
}

cfp::BoxFilter<double> filter_after(Random& random, const cfp::Box<double>& start, double scale) {
  const cfp::BoxMotionOptions options;
  const auto grown = [&](cfp::Box<double> b) {
    return cfp::Box<double>{scale * b.x1, scale * b.y1, scale * b.x2, scale * b.y2};
  };
  cfp::BoxFilter<double> filter = cfp::make_box_filter(grown(start), options);
  for (int k = 0; k < 8; ++k) {
    cfp::predict_box(filter, 0.05, options);
    const double dx = random.uniform(-3, 3), dy = random.uniform(-3, 3);
    cfp::correct_box(filter, grown({start.x1 + dx, start.y1 + dy, start.x2 + dx, start.y2 + dy}), options);
  }
  return filter;
}

}  // namespace

CFP_PROPERTIES("Properties of the box filter", "[detection]",
               {"scaling the picture scales the boxes", 100,
                [](Random& random) {
                  const cfp::Box<double> start = cfp_testing::box<double>(random);
                  Random other = random;
                  const auto a = filter_after(random, start, 1).box(), b = filter_after(other, start, 4).box();
                  return same({4 * a.x1, 4 * a.y1, 4 * a.x2, 4 * a.y2}, b, 1e-8);
                }},
               {"a measurement never makes a value less sure, and covariances stay valid", 200,
                [](Random& random) {
                  cfp::RateFilter<double> f;
                  f.var_value = random.uniform(0, 10), f.var_rate = random.uniform(0, 10);
                  for (int k = 0; k < 20; ++k) {
                    const double dt = random.uniform(0, 0.5), q = random.uniform(0, 3);
                    f.predict(dt, q);
                    const double before = f.var_value;
                    f.correct(random.normal(), random.uniform(1e-6, 5));
                    const bool valid = f.var_value >= 0 && f.var_rate >= 0 &&
                                       f.covariance * f.covariance <= f.var_value * f.var_rate * (1 + 1e-9) + 1e-12;
                    if (f.var_value > before || !valid) return false;
                  }
                  return true;
                }},
               {"what cannot be measured changes nothing", 100,
                [](Random& random) {
                  cfp::RateFilter<double> f;
                  f.value = random.normal(), f.var_rate = random.uniform(0, 1);
                  const cfp::RateFilter<double> before = f;
                  f.correct(random.normal(), 0);  // sure already, of a value that is measured without noise
                  f.var_value = 1;
                  f.correct(cfp_testing::hostile_numbers<double>()[random.index(3)], 1);
                  f.correct(1, std::numeric_limits<double>::infinity());
                  return f.value == before.value && f.rate == before.rate && f.var_rate == before.var_rate;
                }},
               {"two short predictions are one long one", 200,
                [](Random& random) {
                  cfp::RateFilter<double> one;
                  one.value = random.normal(), one.rate = random.normal();
                  one.var_value = 1, one.covariance = random.uniform(-0.5, 0.5), one.var_rate = 1;
                  cfp::RateFilter<double> two = one;
                  const double a = random.uniform(0, 1), b = random.uniform(0, 1), q = random.uniform(0, 2);
                  one.predict(a + b, q);
                  two.predict(a, q);
                  two.predict(b, q);
                  return std::abs(one.value - two.value) < 1e-12 && std::abs(one.var_value - two.var_value) < 1e-12 &&
                         std::abs(one.covariance - two.covariance) < 1e-12 &&
                         std::abs(one.var_rate - two.var_rate) < 1e-12;
                }},
               {"no time and no measurement change nothing", 100,
                [](Random& random) {
                  cfp::BoxFilter<double> filter = filter_after(random, cfp_testing::box<double>(random), 1);
                  const cfp::Box<double> before = filter.box();
                  cfp::predict_box(filter, 0, {});
                  return same(filter.box(), before);
                }},
               {"a filter of any numbers stays finite", 300, [](Random& random) {
                  const auto any = [&] { return cfp_testing::any_number<float>(random); };
                  cfp::BoxFilter<float> filter = cfp::make_box_filter(cfp_testing::box<float>(random), {});
                  for (int k = 0; k < 10; ++k) {
                    cfp::predict_box(filter, static_cast<float>(random.uniform(0, 1)), {});
                    cfp::correct_box(filter, {any(), any(), any(), any()}, {});
                  }
                  const cfp::Box<float> b = filter.box();
                  return cfp::is_finite(b.x1) && cfp::is_finite(b.y1) && cfp::is_finite(b.x2) && cfp::is_finite(b.y2);
                }})

CFP_PROPERTIES("Properties of the box tracker", "[detection]",
               {"what is known of a frame does not depend on later frames", 40,
                [](Random& random) {
                  const std::vector<Detections> all = walk(random, 30);
                  const std::vector<Detections> begin(all.begin(), all.begin() + 17);
                  std::vector<std::size_t> sizes;
                  const Boxes a = track(all, &sizes), b = track(begin);
                  if (b.size() != sizes[16]) return false;
                  return std::equal(b.begin(), b.end(), a.begin(),
                                    [](const auto& p, const auto& q) { return p.id == q.id && same(p.box, q.box); });
                }},
               {"the order of the detections in a frame moves no box", 40,
                [](Random& random) {
                  const std::vector<Detections> frames = walk(random, 25);
                  std::vector<Detections> shuffled = frames;
                  for (Detections& d : shuffled) std::reverse(d.begin(), d.end());
                  Boxes a = track(frames), b = track(shuffled);
                  const auto by_place = [](const auto& p, const auto& q) { return p.box.x1 < q.box.x1; };
                  std::sort(a.begin(), a.end(), by_place);
                  std::sort(b.begin(), b.end(), by_place);
                  return a.size() == b.size() &&
                         std::equal(a.begin(), a.end(), b.begin(), [](const auto& p, const auto& q) {
                           return same(p.box, q.box, 1e-9) && p.age == q.age;
                         });
                }},
               {"no two boxes of a frame have the same id or the same detection", 40,
                [](Random& random) {
                  cfp::BoxTracker<double> tracker;
                  for (const Detections& detections : walk(random, 30)) {
                    std::set<std::int64_t> ids, used;
                    std::size_t detected = 0;
                    const auto result = tracker.track(detections, random.uniform(0, 0.2));
                    for (const auto& box : result.boxes) {
                      ids.insert(box.id);
                      if (box.compensated()) continue;
                      ++detected;
                      used.insert(box.detection);
                    }
                    if (ids.size() != result.boxes.size() || used.size() != detected) return false;
                  }
                  return true;
                }},
               {"moving the whole picture moves every box with it", 40, [](Random& random) {
                  const std::vector<Detections> frames = walk(random, 25);
                  std::vector<Detections> moved = frames;
                  for (Detections& all : moved) {
                    for (auto& d : all) d.box.x1 += 64, d.box.x2 += 64, d.box.y1 -= 32, d.box.y2 -= 32;
                  }
                  const Boxes a = track(frames), b = track(moved);
                  return a.size() == b.size() &&
                         std::equal(a.begin(), a.end(), b.begin(), [](const auto& p, const auto& q) {
                           const cfp::Box<double> there{p.box.x1 + 64, p.box.y1 - 32, p.box.x2 + 64, p.box.y2 - 32};
                           return p.id == q.id && same(there, q.box, 1e-9);
                         });
                }})
