// Associations and motion models in the manner of SORT (Bewley et al., ICIP 2016), OC-SORT (Cao et al., CVPR 2023) and
// ByteTrack (Zhang et al., ECCV 2022), written for tracker_study after the papers, with the parameters that the authors
// publish. Their filters count frames, not seconds. How long a box is predicted is the same for all: the rule of
// cfp::BoxTracker, so that the study compares motion models and associations alone.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "cfp/detection/assignment.hpp"
#include "cfp/detection/box_tracker_types.hpp"

namespace cfp_study {

enum class Rival { sort, oc_sort, byte_track };

/// A value and its change per frame, with independent noise on both.
struct FrameFilter {
  double x = 0, v = 0, pxx = 1, pxv = 0, pvv = 1;

  void predict(double qx, double qv) {
    x += v;
    pxx += 2 * pxv + pvv + qx;
    pxv += pvv;
    pvv += qv;
  }
  void correct(double z, double r) {
    const double s = pxx + r, k = pxx / s, kv = pxv / s, innovation = z - x;
    x += k * innovation;
    v += kv * innovation;
    pvv -= kv * pxv;
    pxv *= 1 - k;
    pxx *= 1 - k;
  }
};

class RivalTracker {
 public:
  struct Output {
    cfp::Box<double> box;
    bool predicted;
    int id;
    [[nodiscard]] bool compensated() const { return predicted; }
  };

  RivalTracker(Rival kind, const cfp::BoxTrackerOptions& options) : kind_(kind), options_(options) {}

  const std::vector<Output>& track(const std::vector<cfp::Detection<double>>& detections) {
    for (Track& t : tracks_) {
      predict(t);
      ++t.missed;
    }
    std::vector<char> taken(detections.size(), 0), matched(tracks_.size(), 0);
    const auto anything = [](const cfp::Detection<double>&) { return true; };
    const auto predicted = [this](const Track& t) { return box_of(t); };
    if (kind_ == Rival::byte_track) {
      const auto high = [](const cfp::Detection<double>& d) { return d.score >= 0.6; };
      const auto low = [](const cfp::Detection<double>& d) { return d.score < 0.6 && d.score > 0.1; };
      associate(detections, high, predicted, 0.2, false, taken, matched);
      associate(detections, low, predicted, 0.5, true, taken, matched);
    } else {
      associate(detections, anything, predicted, 0.3, false, taken, matched);
      const auto last = [](const Track& t) { return t.seen.back(); };
      if (kind_ == Rival::oc_sort) associate(detections, anything, last, 0.3, false, taken, matched);
    }
    for (std::size_t j = 0; j < detections.size(); ++j) {
      const double birth = kind_ == Rival::byte_track ? 0.7 : 0.0;
      if (taken[j] == 0 && detections[j].score >= birth) start(detections[j].box);
    }
    return output();
  }

 private:
  struct Track {
    std::array<FrameFilter, 4> filter, at_last;  // at_last: after the last detection
    std::vector<cfp::Box<double>> seen;
    int id, hits = 1, missed = 0;
  };

  // SORT: centre, area, aspect w / h. ByteTrack: centre, aspect, height.
  [[nodiscard]] std::array<double, 4> measured(const cfp::Box<double>& b) const {
    const double w = b.width(), h = b.height(), u = 0.5 * (b.x1 + b.x2), v = 0.5 * (b.y1 + b.y2);
    if (kind_ == Rival::byte_track) return {u, v, w / h, h};
    return {u, v, w * h, w / h};
  }
  [[nodiscard]] cfp::Box<double> box_of(const Track& t) const {
    const auto& f = t.filter;
    double h = f[3].x, w = f[2].x * h;
    if (kind_ != Rival::byte_track) {
      w = std::sqrt((std::max)(f[2].x * f[3].x, 1.0));
      h = f[2].x / w;
    }
    return {f[0].x - w / 2, f[1].x - h / 2, f[0].x + w / 2, f[1].x + h / 2};
  }
  void predict(Track& t) const {
    auto& f = t.filter;
    if (kind_ == Rival::byte_track) {
      const double h = f[3].x, qx = h * h / 400, qv = h * h / 25600;
      if (t.missed > 0) f[3].v = 0;  // as the authors do for lost tracks
      f[0].predict(qx, qv);
      f[1].predict(qx, qv);
      f[2].predict(1e-4, 1e-10);
      f[3].predict(qx, qv);
      return;
    }
    if (f[2].x + f[2].v <= 0) f[2].v = 0;
    f[0].predict(1, 0.01);
    f[1].predict(1, 0.01);
    f[2].predict(1, 0.0001);
    f[3].pxx += 1;
  }
  void correct(Track& t, const cfp::Box<double>& box) const {
    const std::array<double, 4> z = measured(box);
    std::array<double, 4> r{1, 1, 10, 10};
    if (kind_ == Rival::byte_track) {
      const double h = t.filter[3].x, noise = h * h / 400;
      r = {noise, noise, 0.01, noise};
    }
    for (std::size_t i = 0; i < 4; ++i) t.filter[i].correct(z[i], r[i]);
  }
  void start(const cfp::Box<double>& box) {
    Track t;
    const std::array<double, 4> z = measured(box);
    const double h = box.height();
    for (std::size_t i = 0; i < 4; ++i) {
      t.filter[i] = {z[i], 0, 10, 0, 1e4};
      if (kind_ == Rival::byte_track) t.filter[i] = {z[i], 0, h * h / 100, 0, h * h / 256};
    }
    if (kind_ == Rival::byte_track) {
      t.filter[2] = {z[2], 0, 1e-4, 0, 1e-10};
    } else {
      t.filter[3].v = t.filter[3].pvv = 0;
    }
    t.at_last = t.filter;
    t.seen = {box};
    t.id = ++ids_;
    tracks_.push_back(t);
  }
  // OC-SORT re-updates a track that was lost along a straight line of virtual detections.
  void extend(Track& t, const cfp::Box<double>& box) const {
    if (kind_ == Rival::oc_sort && t.missed > 1) {
      const cfp::Box<double> from = t.seen.back();
      const int steps = t.missed;
      t.filter = t.at_last;
      for (int k = 1; k <= steps; ++k) {
        const double s = static_cast<double>(k) / steps;
        predict(t);
        correct(t, {from.x1 + s * (box.x1 - from.x1), from.y1 + s * (box.y1 - from.y1),
                    from.x2 + s * (box.x2 - from.x2), from.y2 + s * (box.y2 - from.y2)});
      }
    } else {
      correct(t, box);
    }
    t.at_last = t.filter;
    t.seen.push_back(box);
    if (t.seen.size() > 4) t.seen.erase(t.seen.begin());
    t.missed = 0;
    ++t.hits;
  }
  // How well the way to a detection agrees with the track's direction, in [-0.5, 0.5].
  [[nodiscard]] static double consistency(const Track& t, const cfp::Box<double>& box) {
    if (t.seen.size() < 2) return 0;
    const cfp::Box<double>&last = t.seen.back(),
          &before = t.seen[t.seen.size() - (std::min)(t.seen.size(), std::size_t(4))];
    const auto direction = [](const cfp::Box<double>& a, const cfp::Box<double>& b) {
      return std::atan2(b.y1 + b.y2 - a.y1 - a.y2, b.x1 + b.x2 - a.x1 - a.x2);
    };
    double angle = std::abs(direction(before, last) - direction(before, box));
    angle = (std::min)(angle, 2 * cfp::pi<double> - angle);
    return (cfp::pi<double> / 2 - angle) / cfp::pi<double>;
  }

  template <typename Use, typename BoxOf>
  void associate(const std::vector<cfp::Detection<double>>& detections, const Use& use, const BoxOf& box_for,
                 double min_iou, bool tracked_only, std::vector<char>& taken, std::vector<char>& matched) {
    std::vector<double> costs(tracks_.size() * detections.size(), std::numeric_limits<double>::infinity());
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      if (matched[i] != 0 || (tracked_only && tracks_[i].missed > 1)) continue;
      const cfp::Box<double> box = box_for(tracks_[i]);
      for (std::size_t j = 0; j < detections.size(); ++j) {
        if (taken[j] != 0 || !use(detections[j])) continue;
        double& cost = costs[i * detections.size() + j];
        cost = 1 - cfp::iou(box, detections[j].box);
        if (kind_ == Rival::oc_sort) cost -= 0.2 * detections[j].score * consistency(tracks_[i], detections[j].box);
      }
    }
    std::vector<int> partner(tracks_.size());
    cfp::solve_assignment(cfp::CostMatrix(costs, tracks_.size(), detections.size()),
                          std::numeric_limits<double>::infinity(), workspace_, partner);
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      if (partner[i] == cfp::unassigned) continue;
      const auto j = static_cast<std::size_t>(partner[i]);
      if (cfp::iou(box_for(tracks_[i]), detections[j].box) < min_iou) continue;
      matched[i] = 1;
      taken[j] = 1;
      extend(tracks_[i], detections[j].box);
    }
  }

  const std::vector<Output>& output() {
    output_.clear();
    std::vector<Track> kept;
    for (Track& t : tracks_) {
      if (t.missed > 0) {
        const bool trusted = t.hits >= options_.confirm_hits && t.missed <= options_.coast_per_hit * t.hits;
        const cfp::Box<double> box = box_of(t), visible = cfp::clip(box, options_.image_width, options_.image_height);
        if (!trusted || t.missed > options_.max_coast || !(cfp::area(visible) > 0) ||
            cfp::area(visible) < options_.min_visible * cfp::area(box))
          continue;
        output_.push_back({visible, true, t.id});
      } else {
        output_.push_back({t.seen.back(), false, t.id});
      }
      kept.push_back(t);
    }
    tracks_ = kept;
    return output_;
  }

  Rival kind_;
  cfp::BoxTrackerOptions options_;
  int ids_ = 0;
  std::vector<Track> tracks_;
  std::vector<Output> output_;
  cfp::AssignmentWorkspace workspace_;
};

}  // namespace cfp_study
