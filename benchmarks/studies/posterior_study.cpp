// Which rule should make the weight of an observation from what is known of it: O of its object, K of the keypoint, M
// of its map point, and how much does each count? Two people walk, sit and move their arms, get up, or rest before four
// camera motions (support/people_scene.hpp). Every rule tracks the camera by itself: both stages, a pose after each, a
// map whose points are made, learn and go by the rule's own probabilities. The defaults of MapPointOptions rest on it.
//
//   cfp_posterior_study [seeds, default 3] [first seed, default 101] [frames, default 240] | --smoke
//
// Judged in every frame, as by cfp_slam_report: keypoints in boxes with a match and a map point, on the room (static)
// or on a part of a person that moves faster than 0.05 m/s. Per kind of scene, medians over seeds and camera motions:
// AUC of the weight, static keypoints at weight 0 (below 0.01) and moving ones above 0.5 in %, Brier score of the
// weight as P(static) with the still parts of people as static, RMSE of the camera's position in mm, AUC of O (a box
// moves when a third of the person in it does, and rests when less than a twentieth does). Last, the worst run of the
// first three and of the position. The defaults were chosen on seeds 1 and 2.
//
// keypoint_evidence was chosen on seeds 1 and 2 and on two camera motions of the rendered sequences. Against K beside E
// as if they were independent, seeds 101 to 103, walking / sitting / rising: AUC 0.989 / 0.986 / 0.991 for 0.986 /
// 0.982 / 0.986, moving above 0.5 2.8 / 4.2 / 2.7 % for 3.5 / 5.8 / 4.3 %, Brier score 0.062 / 0.122 / 0.097 for 0.063
// / 0.117 / 0.095, position within 0.2 mm. A K that on the object may not exceed the larger of E and 1/2 lets fewer
// through (sitting, seeds 1 and 2: 2.9 for 3.9 %), but people at rest lose weight by it (Brier score 0.170 for 0.131);
// one that may not exceed the score of the flow is between.
//
// That O counts beside the flow at the place of what depth puts on its object came from a rendered recording, in which
// somebody who walked off took the camera with him. Here, seeds 201 and 202, with it and without, walking / sitting /
// rising: moving above 0.5 1.3 / 3.1 / 1.7 % and 2.3 / 5.5 / 3.6 %, position 3.81 / 3.40 / 3.00 and 3.93 / 3.39 / 2.96
// mm, AUC 0.992 / 0.982 / 0.991 and 0.991 / 0.986 / 0.989; its price: static at weight 0 2.4 / 3.4 / 1.7 % and 0.6 /
// 1.2 / 0.8 %, Brier score 0.088 / 0.182 / 0.101 and 0.069 / 0.130 / 0.094: the still parts of who moves lose weight.
//
// What pairs only show together (ObjectProbability::together) came from such a recording, too: at commit 5fc790e, seeds
// 201 and 202, 150 frames, with it and without, walking / sitting / rising: AUC 0.990 / 0.984 / 0.986 and 0.990 / 0.985
// / 0.983, static at weight 0 3.5 / 2.7 / 2.1 % and 3.4 / 2.4 / 1.9 %, moving above 0.5 1.2 / 2.7 / 3.7 % and 1.4 / 2.8
// / 3.7 %, Brier score 0.103 / 0.185 / 0.114 and 0.103 / 0.176 / 0.112. Where all pairs of who moves are asked, and not
// only those that look at rest one by one, walking has 3.8 % static at 0 and a Brier score of 0.107.
//
// A detector on every n-th frame: `idle` is max_idle. Seeds 301 to 303, moving above 0.5 in walking / sitting / rising
// for every 10th and 30th frame: max_idle 30 4.4 / 4.2 / 4.4 and 6.9 / 7.4 / 7.1 %, max_idle 0 4.9 / 3.3 / 4.5 and 9.2
// / 7.9 / 7.0 %: what is sought outside of boxes finds most of what no box reports; without it (`unrep. 0 px`) a
// max_idle of 30 has 31.3 / 26.0 / 36.3 % on every 30th frame. With tracks of one detection a false box in a fifth of
// the detector's runs costs the weight of the room 0.002 to 0.03 on average, the position nothing.
//
// UnreportedOptions, as seen there: within 30, 60 and 90 px 14.0 / 7.6 / 11.9, 6.9 / 7.4 / 7.1 and 5.3 / 7.4 / 6.5 %;
// pairs at any depth 10.0 / 7.2 / 10.5 %. Most of six pairs within 30 px at any depth, the rule before 6978f87: 21.1 /
// 10.9 / 19.2 %.
//
// Masks: judged is what has a box, so all on a mask and, beside it, in its box. Depth could tell what a mask spills, as
// in boxes, but of what it holds of people 6 % have the depth of what is behind here: seed 301, 60 frames, moving above
// 0.5 in walking / sitting / rising with exact masks would be 7.6 / 20.3 / 4.3 % in the place of 1.1 / 18.9 / 1.7 %.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "cfp/evaluation/calibration.hpp"
#include "cfp/frame/static_probability.hpp"
#include "cfp/optimization/pose/pose_refinement.hpp"
#include "support/people_scene.hpp"

namespace {

using cfp_study::PeopleScene;
using cfp_study::PointLabel;
using cfp_study::SeenFrame;
using Camera = cfp::PinholeCamera<double>;
using V3 = cfp::Vector3<double>;

/// Where the flow pairs come from.
enum class FlowSource {
  all,            ///< tracked, at every keypoint of the frame before
  few_outside,    ///< tracked in boxes, and 60 outside
  matches,        ///< the keypoints' matches with the frame before, which a host has anyway
  matched_inside  ///< these in boxes, tracked outside
};

/// What tells which keypoints are on the people: their boxes, or an index of them, as of a mask.
enum class Masks {
  none,
  exact,
  legless,   ///< leaves out what is in the lowest quarter of a box
  of_first,  ///< of the first detection only
};

struct Rule {
  std::string name;
  cfp::FrameOptions options;
  FlowSource flow = FlowSource::all;
  Masks masks = Masks::none;
  bool mean = false;         ///< the mean of K and M as weight, whatever the options say
  bool independent = false;  ///< K beside E as if they were independent: without keypoint_evidence
  int detector_every = 1;    ///< so manieth frame alone has detections; judged is what lies in those of any frame
};

struct Score {
  double auc = 0, static_lost = 0, moving_kept = 0, brier = 0, position_mm = 0, object_auc = 0;
};

/// The camera tracked by the weights of one rule.
class Tracker {
 public:
  Tracker(const Camera& camera, const Rule& rule) : camera_(camera), rule_(rule), probability_(camera, rule.options) {}

  void track(const SeenFrame& frame) {
    const std::size_t n = frame.points.size();
    for (const cfp_study::SeenPoint& point : frame.points) map_.resize(std::max(map_.size(), point.id + 1));
    m_.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
      MapPoint& point = map_[frame.points[i].id];
      if (!point.mapped && point.frame != frames_) point = {};
      m_[i] = point.m;
    }
    cfp::Frame<double> input;
    input.timestamp_s = frame.time_s;
    input.keypoints = frame.pixels;
    input.depths = frame.depths;
    if (frames_ % rule_.detector_every == 0)
      input.detections = cfp::span<const cfp::Detection<double>>(frame.detections);
    if (input.detections && rule_.masks != Masks::none) input.object_of_keypoint = masked(frame);
    input.flow = flow(frame);
    input.map_point_probability = m_;
    cfp::StageResult<double> stage = probability_.coarse(input);
    if (frames_++ == 0) {
      T_cam_world_ = frame.T_world_cam.inverse();
    } else {
      const cfp::SE3<double> T_last = T_cam_world_;
      const std::size_t inliers = refine(frame, weights(stage));
      stage = probability_.fine({T_cam_world_ * T_last.inverse(), inliers}, frame.match, m_);
      const cfp::span<const double> weight = weights(stage);
      judge(frame, weight);
      judge_objects(frame);
      refine(frame, weight);
    }
    const double error = (T_cam_world_.inverse().translation - frame.T_world_cam.translation).norm();
    error_sq_ += error * error;
    learn(frame);
  }

  Score score() {
    Score s;
    s.auc = cfp::roc_auc(scores_, cfp::span<const char>(is_static_)).auc;
    double still = 0, lost = 0, moving = 0, kept = 0;
    for (std::size_t i = 0; i < scores_.size(); ++i) {
      (is_static_[i] != 0 ? still : moving) += 1;
      if (is_static_[i] != 0) lost += scores_[i] < 0.01 ? 1 : 0;
      if (is_static_[i] == 0) kept += scores_[i] > 0.5 ? 1 : 0;
    }
    s.static_lost = 100 * lost / std::max(still, 1.0);
    s.moving_kept = 100 * kept / std::max(moving, 1.0);
    s.object_auc = cfp::roc_auc(objects_, cfp::span<const char>(object_is_static_)).auc;
    s.brier = brier_sum_ / std::max(brier_count_, 1.0);
    s.position_mm = 1000 * std::sqrt(error_sq_ / std::max(frames_, 1));
    return s;
  }

 private:
  struct MapPoint {
    double m = -1;  ///< negative: nothing is known
    V3 position = V3::Zero();
    double seen = 0;      ///< observations that the position rests on; 0: there is none
    bool mapped = false;  ///< else it is remembered for one frame only
    int frame = 0;        ///< when it was seen last
  };

  static bool is_detected(const SeenFrame& frame, const std::array<double, 2>& p) {
    return std::any_of(frame.detections.begin(), frame.detections.end(),
                       [&](const auto& d) { return cfp::contains(d.box, p[0], p[1]); });
  }

  const std::vector<std::int32_t>& masked(const SeenFrame& frame) {
    object_.assign(frame.points.size(), cfp::no_object);
    for (std::size_t i = 0; i < frame.points.size(); ++i) {
      const auto& [x, y] = frame.pixels[i];
      if (frame.points[i].label == PointLabel::room) continue;
      for (std::size_t d = 0; d < frame.detections.size() && (d == 0 || rule_.masks != Masks::of_first); ++d) {
        const cfp::Box<double>& box = frame.detections[d].box;
        const double bottom = rule_.masks == Masks::legless ? box.y2 - box.height() / 4 : box.y2;
        if (cfp::contains(box, x, y) && y <= bottom) object_[i] = static_cast<std::int32_t>(d);
      }
    }
    return object_;
  }

  cfp::FlowPairs<double> flow(const SeenFrame& frame) {
    from_.clear();
    to_.clear();
    depths_.clear();
    std::size_t outside = 0;
    for (std::size_t p = 0; p < frame.flow_to.size(); ++p) {
      const bool inside = is_detected(frame, frame.flow_to[p]);
      outside += inside ? 0U : 1U;
      if (rule_.flow == FlowSource::matches || (rule_.flow == FlowSource::matched_inside && inside)) continue;
      if (rule_.flow == FlowSource::few_outside && !inside && outside % (frame.flow_to.size() / 60 + 1) != 0) continue;
      add_pair(frame.flow_from[p], frame.flow_to[p], frame.flow_depths[p]);
    }
    for (std::size_t i = 0; i < frame.match.size(); ++i) {
      if (frame.match[i] == cfp::no_match || rule_.flow < FlowSource::matches) continue;
      if (rule_.flow == FlowSource::matched_inside && !is_detected(frame, frame.pixels[i])) continue;
      const auto j = static_cast<std::size_t>(frame.match[i]);
      add_pair(last_pixels_[j], frame.pixels[i], last_depths_[j]);
    }
    last_pixels_ = frame.pixels;
    last_depths_ = frame.depths;
    return {from_, to_, depths_};
  }
  void add_pair(const std::array<double, 2>& from, const std::array<double, 2>& to, double depth) {
    from_.push_back(from);
    to_.push_back(to);
    depths_.push_back(depth);
  }

  cfp::span<const double> weights(const cfp::StageResult<double>& stage) {
    weight_.assign(stage.weight.begin(), stage.weight.end());
    for (std::size_t i = 0; rule_.mean && i < weight_.size(); ++i) {
      if (m_[i] >= 0) weight_[i] = 0.5 * (stage.static_probability[i] + m_[i]);
    }
    for (std::size_t i = 0; rule_.independent && i < weight_.size(); ++i) {
      if (is_limited(i)) weight_[i] = independent(stage.static_probability[i], m_[i], i);
    }
    return weight_;
  }

  /// Where keypoint_evidence may keep K from its say.
  [[nodiscard]] bool is_limited(std::size_t i) const {
    const cfp::FrameState<double>& state = probability_.state();
    return state.report.constrained > 0 && state.label[i] == cfp::KeypointLabel::foreground && m_[i] >= 0;
  }
  [[nodiscard]] double independent(double k, double m, std::size_t i) const {
    const double e = std::min(cfp::first_stage_evidence(i, rule_.options, probability_.state()), 0.5);
    return cfp::posterior_probability(k, e, m, rule_.options.map_point);
  }
  [[nodiscard]] double learnt(double m, std::size_t i) const {
    if (!rule_.independent || !is_limited(i) || probability_.state().flow_probability[i] < 0)
      return probability_.updated_map_point(i, m);
    const double k = independent(0.5, probability_.state().static_probability[i], i);
    return cfp::updated_map_point(k, m, rule_.options.map_point);
  }

  std::size_t refine(const SeenFrame& frame, cfp::span<const double> weight) {
    points_.clear();
    pixels_.clear();
    weights_.clear();
    sigmas_.clear();
    keypoint_.clear();
    for (std::size_t i = 0; i < weight.size(); ++i) {
      const MapPoint& point = map_[frame.points[i].id];
      if (m_[i] < 0 || !(point.seen > 0)) continue;
      const V3& X = point.position;
      points_.push_back({X.x(), X.y(), X.z()});
      pixels_.push_back(frame.pixels[i]);
      weights_.push_back(weight[i]);
      sigmas_.push_back(frame.points[i].sigma_px);
      keypoint_.push_back(i);
    }
    inlier_.assign(points_.size(), 0);
    cfp::PoseObservations<double> observations;
    observations.points = points_;
    observations.pixels = pixels_;
    observations.weights = weights_;
    observations.sigmas = sigmas_;
    const cfp::PoseResult pose =
        cfp::refine_pose(observations, camera_, T_cam_world_, cfp::PoseOptions(), workspace_, inlier_);
    if (cfp::is_solved(pose.status)) T_cam_world_ = pose.T_cam_world;
    std::size_t inliers = 0;
    for (std::size_t o = 0; o < keypoint_.size(); ++o)
      inliers += inlier_[o] != 0 && cfp::counts_as_inlier(weight[keypoint_[o]], rule_.options) ? 1U : 0U;
    return inliers;
  }

  void judge(const SeenFrame& frame, cfp::span<const double> weight) {
    for (std::size_t i = 0; i < weight.size(); ++i) {
      const bool in_a_box =
          rule_.detector_every == 1 ? probability_.state().box[i] != cfp::no_box : is_detected(frame, frame.pixels[i]);
      if (!in_a_box || frame.match[i] == cfp::no_match || m_[i] < 0) continue;
      const double truth = frame.points[i].label == PointLabel::moving ? 0 : 1;
      brier_sum_ += (weight[i] - truth) * (weight[i] - truth);
      ++brier_count_;
      if (frame.points[i].label == PointLabel::still_part) continue;
      scores_.push_back(weight[i]);
      is_static_.push_back(frame.points[i].label == PointLabel::room ? char(1) : char(0));
    }
  }

  /// A box counts as moving when a third of the person's points in it moves, as static when less than a twentieth does.
  void judge_objects(const SeenFrame& frame) {
    const auto& state = probability_.state();
    for (std::size_t b = 0; b < state.boxes.size(); ++b) {
      double moving = 0, still = 0;
      for (std::size_t i = 0; i < frame.points.size(); ++i) {
        if (!cfp::contains(state.boxes[b].box, frame.pixels[i][0], frame.pixels[i][1])) continue;
        moving += frame.points[i].label == PointLabel::moving ? 1 : 0;
        still += frame.points[i].label == PointLabel::still_part ? 1 : 0;
      }
      const double share = moving / std::max(moving + still, 1.0);
      if (moving + still < 10 || (share >= 0.05 && share <= 1.0 / 3)) continue;
      objects_.push_back(state.objects[b].static_probability);
      object_is_static_.push_back(share < 0.05 ? char(1) : char(0));
    }
  }

  /// What the frame saw learns. What does not agree with the pose, or has become dynamic, is no landmark any more;
  /// every fifth frame makes new ones. All else is where this frame saw it.
  void learn(const SeenFrame& frame) {
    for (std::size_t o = 0; frames_ > 1 && o < keypoint_.size(); ++o) {
      MapPoint& point = map_[frame.points[keypoint_[o]].id];
      point.mapped = point.mapped && inlier_[o] != 0;
    }
    const cfp::SE3<double> T_world_cam = T_cam_world_.inverse();
    for (std::size_t i = 0; i < frame.points.size(); ++i) {
      MapPoint& point = map_[frame.points[i].id];
      point.frame = frames_;
      point.m = point.m < 0 ? probability_.static_probability(i, -1) : learnt(point.m, i);
      if (cfp::is_deletable(point.m, rule_.options.map_point)) point.mapped = false;
      if (!point.mapped) point.seen = 0;
      V3 ray;
      const cfp::Vector2<double> pixel(frame.pixels[i][0], frame.pixels[i][1]);
      if (!(frame.depths[i] > 0) || !camera_.unproject(pixel, ray)) continue;
      if (frames_ % 5 != 1 && point.mapped) continue;
      if (frames_ % 5 == 1 && probability_.may_create_map_point(i)) point.mapped = true;
      point.seen = std::min(point.seen + 1, 20.0);
      point.position += (T_world_cam * V3(frame.depths[i] * ray) - point.position) / point.seen;
    }
  }

  const Camera& camera_;
  const Rule& rule_;
  cfp::StaticProbability<Camera> probability_;
  cfp::PoseWorkspace<double> workspace_;
  cfp::SE3<double> T_cam_world_;
  std::vector<MapPoint> map_;
  std::vector<double> m_, weight_, weights_, sigmas_, scores_, objects_, last_depths_, depths_;
  std::vector<std::array<double, 3>> points_;
  std::vector<std::array<double, 2>> pixels_, last_pixels_, from_, to_;
  std::vector<std::size_t> keypoint_;
  std::vector<std::int32_t> object_;
  std::vector<char> inlier_, is_static_, object_is_static_;
  double error_sq_ = 0, brier_sum_ = 0, brier_count_ = 0;
  int frames_ = 0;
};

std::vector<Rule> rules() {
  std::vector<Rule> all;
  const auto add = [&](const std::string& name, const std::function<void(cfp::FrameOptions&)>& change) -> Rule& {
    all.push_back({name, {}, FlowSource::all});
    all.back().options.tracker.image_width = 640;
    all.back().options.tracker.image_height = 480;
    change(all.back().options);
    return all.back();
  };
  const auto nothing = [](cfp::FrameOptions&) {};
  add("posterior", nothing);
  add("product", [](auto& o) { o.map_point.weight = cfp::WeightRule::product; });
  add("mean of K and M", [](auto& o) { o.map_point.weight = cfp::WeightRule::product; }).mean = true;
  add("posterior, K beside E", nothing).independent = true;
  add("boxes left out", [](auto& o) { o = cfp::variant_options(cfp::Variant::only_boxes, o); });
  add("flow in boxes, 60 out", nothing).flow = FlowSource::few_outside;
  add("matches for flow", nothing).flow = FlowSource::matches;
  add("matches in boxes", nothing).flow = FlowSource::matched_inside;
  add("object's O alone", [](auto& o) { o.coarse.flow_radius_px = 0; });
  add("masks", nothing).masks = Masks::exact;
  add("masks without legs", nothing).masks = Masks::legless;
  add("masks of the first", nothing).masks = Masks::of_first;
  for (const int every : {5, 10, 30}) {
    for (const int max_idle : {0, 30}) {
      add("every " + std::to_string(every) + "th, idle " + std::to_string(max_idle), [&](auto& o) {
        o.tracker.max_idle = max_idle;
      }).detector_every = every;
    }
  }
  const auto unreported = [&](const std::string& name, double radius_px, double depth_share) {
    add("30th, " + name, [&](auto& o) {
      o.coarse.unreported.radius_px = radius_px, o.coarse.unreported.depth_share = depth_share;
    }).detector_every = 30;
  };
  const cfp::UnreportedOptions chosen;
  for (const int radius_px : {0, 30, 90})
    unreported("unrep. " + std::to_string(radius_px) + " px", radius_px, chosen.depth_share);
  unreported("any depth", chosen.radius_px, 100);
  const auto vary = [&](const char* name, std::initializer_list<double> values, double cfp::MapPointOptions::*field) {
    for (const double value : values) {
      char text[32];
      std::snprintf(text, sizeof text, "%s %g", name, value);
      add(text, [&](auto& o) { o.map_point.*field = value; });
    }
  };
  for (const double radius : {5.0, 20.0})
    add(radius < 10 ? "radius 5" : "radius 20", [&](auto& o) { o.coarse.flow_radius_px = radius; });
  vary("prior", {0.05, 0.2}, &cfp::MapPointOptions::foreground_prior);
  vary("power of K", {0.25, 1}, &cfp::MapPointOptions::constraint_power);
  vary("rate", {0.1, 0.4}, &cfp::MapPointOptions::rate);
  vary("evidence limit", {0.01, 0.05}, &cfp::MapPointOptions::evidence_limit);
  return all;
}

double median(std::vector<double> x) {
  std::nth_element(x.begin(), x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2), x.end());
  return x[x.size() / 2];
}

}  // namespace

int main(int argc, char** argv) {
  const bool smoke = argc > 1 && std::strcmp(argv[1], "--smoke") == 0;
  const int seeds = smoke ? 1 : argc > 1 ? std::atoi(argv[1]) : 3, first = argc > 2 ? std::atoi(argv[2]) : 101;
  const int frames = smoke ? 10 : argc > 3 ? std::atoi(argv[3]) : 240;
  if (seeds < 1 || frames < 2) {
    std::fprintf(stderr, "usage: cfp_posterior_study [seeds >= 1] [first seed] [frames >= 2] | --smoke\n");
    return 2;
  }
  const std::vector<Rule> all = rules();
  using Scores = std::array<std::vector<Score>, cfp_study::acting_names.size()>;
  std::vector<Scores> scores(all.size());
  for (int seed = first; seed < first + seeds; ++seed) {
    for (std::size_t act = 0; act < cfp_study::acting_names.size(); ++act) {
      for (std::size_t motion = 0; motion < (smoke ? 1 : synthetic::motion_names.size()); ++motion) {
        PeopleScene scene(static_cast<cfp_study::Acting>(act), static_cast<synthetic::Motion>(motion),
                          frames / PeopleScene::rate_hz, static_cast<std::uint64_t>(seed));
        const std::vector<SeenFrame> recording = scene.record(frames);
        for (std::size_t r = 0; r < all.size(); ++r) {
          Tracker tracker(scene.camera, all[r]);
          for (const SeenFrame& frame : recording) tracker.track(frame);
          scores[r][act].push_back(tracker.score());
        }
      }
    }
  }
  std::printf(
      "%d seeds from %d, %d frames; per kind: AUC, static at 0, moving above 0.5 (%%), Brier score, position (mm), AUC "
      "of O\n\n",
      seeds, first, frames);
  std::printf("| rule |");
  for (const char* name : cfp_study::acting_names) std::printf(" %s |", name);
  std::printf(" worst |\n|---|--:|--:|--:|--:|--:|\n");
  for (std::size_t r = 0; r < all.size(); ++r) {
    std::printf("| %-21s |", all[r].name.c_str());
    double auc = 1, lost = 0, kept = 0, position = 0;
    for (const std::vector<Score>& of_act : scores[r]) {
      const auto median_of = [&](double Score::*figure) {
        std::vector<double> x;
        for (const Score& s : of_act) x.push_back(s.*figure);
        return median(x);
      };
      std::printf(" %.3f %4.1f %4.1f %.3f %5.2f %.3f |", median_of(&Score::auc), median_of(&Score::static_lost),
                  median_of(&Score::moving_kept), median_of(&Score::brier), median_of(&Score::position_mm),
                  median_of(&Score::object_auc));
      for (const Score& s : of_act) {
        if (&of_act != &scores[r].back()) auc = std::min(auc, s.auc);
        lost = std::max(lost, s.static_lost);
        kept = std::max(kept, s.moving_kept);
        position = std::max(position, s.position_mm);
      }
    }
    std::printf(" %.3f %4.1f %4.1f %5.2f |\n", auc, lost, kept, position);
  }
  return 0;
}
