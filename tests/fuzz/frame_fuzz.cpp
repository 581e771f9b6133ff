// The driver over frames with changing counts, hostile numbers and wrong indices: probabilities stay probabilities, and
// the same frames give the same bits.
#include <array>
#include <optional>

#include "cfp/frame/detector_lag.hpp"
#include "cfp/frame/static_probability.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"
#include "fuzz_input.hpp"

namespace {

using cfp_fuzz::FuzzInput;

struct Arrays {
  std::vector<float> keypoints, depths, flow_from, flow_to, flow_depths, flow_sigmas, m;
  std::vector<cfp::Detection<float>> detections;
  std::vector<std::int32_t> object, match;
  std::vector<std::uint8_t> descriptors, labels;
};

cfp::PointSpan<float, 2> points(const std::vector<float>& xy) {
  return xy.empty() ? cfp::PointSpan<float, 2>()
                    : cfp::PointSpan<float, 2>(xy.data(), xy.size() / 2, 2 * sizeof(float));
}

// Of n things or of none; now and then of what does not exist.
std::int32_t index(FuzzInput& in, std::size_t n) {
  const bool any = in.byte() < 8;
  return any ? static_cast<std::int32_t>(in.count(65535) << 15U) - 1000 : static_cast<std::int32_t>(in.count(n)) - 1;
}

cfp::SE3<double> motion(FuzzInput& in) {
  cfp::Vector6<double> xi;
  for (int k = 0; k < 6; ++k) xi[k] = in.number(-0.1, 0.1);
  return cfp::se3_exp(xi);
}

template <typename Camera>
std::vector<float> run(FuzzInput in, const Camera& camera) {
  cfp::FrameOptions options;
  options.coarse.flow.use_depth = in.flag();
  options.coarse.flow.use_motion_up_to_scale = in.flag();
  options.tracker.image_width = in.flag() ? 640 : 0;
  options.tracker.image_height = 480;
  if (in.flag()) {
    auto& flow = options.coarse.flow;
    auto& object = options.coarse.object;
    auto& fine = options.fine;
    auto& point = options.map_point;
    flow.min_outside_pairs = flow.motion.min_pairs = object.min_pairs = 8;
    point.weight = in.flag() ? cfp::WeightRule::product : cfp::WeightRule::posterior;
    cfp_fuzz::disturb(in, options,
                      {&options.object_threshold,
                       &options.min_creation_probability,
                       &options.health.min_inlier_weight,
                       &options.coarse.flow_radius_px,
                       &options.coarse.flow_depth_radius_px,
                       &options.coarse.unreported.radius_px,
                       &options.coarse.unreported.depth_share,
                       &options.coarse.unreported.max_share,
                       &options.coarse.unreported.min_known_depths,
                       &options.coarse.unreported.max_parallax,
                       &flow.camera_acceleration_m_s2,
                       &flow.motion.search_above_px,
                       &flow.motion.shared_depth_ratio,
                       &flow.motion.nearest_share,
                       &options.coarse.memory.time_constant_s,
                       &options.coarse.memory.evidence_limit,
                       &flow.nearer_than_room.inverse_mean,
                       &flow.nearer_than_room.inverse_sigma,
                       &flow.motion.min_inlier_share,
                       &flow.motion.min_sigma_px,
                       &flow.motion.max_sigma_px,
                       &flow.motion.distance.depth_noise.constant_m,
                       &flow.motion.distance.depth_noise.quadratic,
                       &flow.ransac.threshold_px,
                       &object.sigma_px,
                       &object.noise_factor,
                       &object.max_stray_share,
                       &object.shared_error_px,
                       &object.unknown_object_probability,
                       &fine.min_pose_inliers,
                       &fine.min_translation_m,
                       &fine.least_speed_m_s,
                       &fine.constraint.quantile,
                       &fine.constraint.steepness,
                       &fine.matching.radius_px,
                       &fine.matching.max_ratio,
                       &point.rate,
                       &point.evidence_limit,
                       &point.deletion_threshold,
                       &point.mismatch_threshold,
                       &point.constraint_power,
                       &point.foreground_prior,
                       &point.background_prior,
                       &options.health.min_effective_points});
  }
  cfp::StaticProbability probability(camera, options);
  cfp::DetectorLagOptions lag_options;
  lag_options.min_boxes = lag_options.min_rate = 0.1;
  cfp::DetectorLag<float> lag(lag_options);
  std::vector<float> all;
  std::size_t previous = 0;
  while (!in.empty()) {
    Arrays a;
    const std::size_t n = in.count(40), pairs = in.count(40);
    a.keypoints = in.numbers<float>(2 * n, 0, 640);
    if (in.flag()) a.depths = in.numbers<float>(n, 0, 6);
    a.flow_from = in.numbers<float>(2 * pairs, 0, 640);
    a.flow_to = a.flow_from;
    for (float& x : a.flow_to) x += FuzzInput::to<float>(in.number(-3, 3));
    if (in.flag()) a.flow_depths = in.numbers<float>(pairs, 0, 6);
    if (in.byte() < 64) a.flow_sigmas = in.numbers<float>(pairs, 0.5, 4);
    a.detections.resize(in.count(3));
    for (auto& d : a.detections) {
      d.box = {FuzzInput::to<float>(in.number(0, 300)), FuzzInput::to<float>(in.number(0, 300)),
               FuzzInput::to<float>(in.number(200, 640)), FuzzInput::to<float>(in.number(200, 480))};
      d.score = FuzzInput::to<float>(in.number(0, 1));
    }
    cfp::Frame<float> frame;
    frame.timestamp_s = in.number(0, 2);
    frame.keypoints = points(a.keypoints);
    frame.depths = a.depths;
    if (in.flag()) frame.detections = a.detections;
    frame.flow = {points(a.flow_from), points(a.flow_to), a.flow_depths, a.flow_sigmas};
    if (in.byte() < 64) {
      for (std::size_t i = 0; i < n; ++i) a.object.push_back(index(in, a.detections.size()));
      frame.object_of_keypoint = a.object;
    } else if (in.byte() < 64) {
      a.labels.resize(16 * 12);
      for (auto& l : a.labels) l = in.byte();
      frame.labels = {a.labels.data(), 16, 12, 16};
    }
    if (in.byte() < 64) {
      a.descriptors.resize(32 * n);
      for (auto& d : a.descriptors) d = in.byte();
      frame.descriptors = {a.descriptors.data(), n, 32, 32};
    }
    if (in.byte() < 32) frame.T_cur_prev = {motion(in), in.number(0, 0.02), in.number(0, 0.01)};
    if (in.byte() < 32) {
      cfp::Matrix3<float> H = cfp::Matrix3<float>::Identity();
      for (int k = 0; k < 9; ++k) H.data()[k] += FuzzInput::to<float>(in.number(-0.01, 0.01));
      (in.flag() ? frame.image_motion : frame.fundamental) = H;
    }
    a.m = in.numbers<float>(n, -0.2, 1);
    if (in.flag()) frame.map_point_probability = a.m;
    const auto check = [&](const cfp::StageResult<float>& result) {
      CFP_PROMISE(result.weight.size() == n && result.static_probability.size() == n);
      for (std::size_t i = 0; i < n; ++i) {
        CFP_PROMISE(cfp_fuzz::is_probability(result.weight[i]));
        CFP_PROMISE(cfp_fuzz::is_probability(result.static_probability[i]));
        CFP_PROMISE(cfp_fuzz::is_probability(probability.weight(i, a.m[i])));
        all.push_back(result.weight[i]);
        all.push_back(result.static_probability[i]);
      }
      for (const auto& object : probability.state().objects)
        CFP_PROMISE(cfp_fuzz::is_probability(object.static_probability));
    };
    check(probability.coarse(frame));
    const double late_s = lag.update(frame, probability.state());
    CFP_PROMISE(late_s >= 0 && late_s <= lag_options.max_lag_s);
    all.push_back(static_cast<float>(late_s));
    if (in.flag()) {
      for (std::size_t i = 0; i < n && in.flag(); ++i)
        a.match.push_back(static_cast<std::int32_t>(in.count(previous)) - 1);
      if (a.match.size() != n) a.match.clear();
      const bool learns = in.flag();
      check(probability.fine({motion(in), in.count(300)}, a.match,
                             learns ? cfp::span<const float>(a.m) : cfp::span<const float>()));
      if (learns) probability.update_map_points(a.m);
    }
    previous = n;
    if (in.byte() == 0) probability.reset();
  }
  return all;
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  FuzzInput in(data, size);
  const auto twice = [&](const auto& camera) { CFP_PROMISE(cfp_fuzz::same_bits(run(in, camera), run(in, camera))); };
  const cfp::PinholeCamera<float> pinhole{525, 525, 320, 240};
  if (in.flag()) {
    twice(pinhole);
  } else {
    cfp::RadialTangentialCamera<float> distorted;
    distorted.fx = distorted.fy = 525;
    distorted.cx = 320;
    distorted.cy = 240;
    distorted.k1 = FuzzInput::to<float>(in.number(-0.5, 0.5));
    distorted.k2 = FuzzInput::to<float>(in.number(-0.5, 0.5));
    twice(distorted);
  }
  return 0;
}
