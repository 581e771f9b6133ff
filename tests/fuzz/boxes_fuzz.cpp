// Assignment, clustering, foreground and box tracker under hostile numbers.
#include "cfp/clustering/depth_foreground.hpp"
#include "cfp/detection/box_tracker.hpp"
#include "cfp_testing/dbscan_verifier.hpp"
#include "fuzz_input.hpp"

namespace {

using cfp_fuzz::FuzzInput;

void assignment(FuzzInput& in) {
  const std::size_t rows = in.count(12), cols = in.count(12);
  const std::vector<double> costs = in.numbers<double>(rows * cols, -2, 2);
  const double gate = in.number(0, 3);
  cfp::AssignmentWorkspace workspace;
  std::vector<int> columns(rows);
  const cfp::AssignmentResult result =
      cfp::solve_assignment(cfp::CostMatrix(costs, rows, cols), gate, workspace, columns);
  CFP_PROMISE((result.status == cfp::Status::invalid_input) == (gate != gate));
  std::vector<char> taken(cols, 0);
  std::size_t pairs = 0;
  for (std::size_t i = 0; i < rows; ++i) {
    if (columns[i] == cfp::unassigned) continue;
    const auto j = static_cast<std::size_t>(columns[i]);
    CFP_PROMISE(j < cols && taken[j] == 0 && costs[i * cols + j] < gate);
    taken[j] = 1;
    ++pairs;
  }
  CFP_PROMISE(pairs == result.pairs && std::isfinite(result.cost));
}

void clustering(FuzzInput& in) {
  const std::vector<float> depths = in.numbers<float>(in.count(60), 0, 5);
  const cfp::DbscanOptions options{std::abs(in.number(0, 1)), in.count(8)};
  cfp::DbscanWorkspace<float> workspace;
  std::vector<int> labels(depths.size());
  const cfp::DbscanResult result = cfp::dbscan(depths, options, workspace, labels);
  if (result.status == cfp::Status::ok)
    CFP_PROMISE(cfp_testing::verify_dbscan(depths, options, labels).fault == cfp_testing::DbscanFault::none);

  cfp::ForegroundOptions foreground;
  foreground.rule = in.flag() ? cfp::ForegroundRule::dbscan : cfp::ForegroundRule::depth_window;
  cfp::AdaptiveOptions& a = foreground.adaptive;
  cfp_fuzz::disturb(in, foreground,
                    {&foreground.near_share, &foreground.upper_share, &foreground.obstacle_m, &foreground.before_m,
                     &foreground.behind_m, &foreground.first_gap_m, &foreground.last_gap_m, &foreground.min_gap_m,
                     &foreground.half_body_m, &a.noise_factor, &a.min_eps_m, &a.max_eps_m, &a.spacing_factor,
                     &a.min_share, &a.density, &a.noise.constant_m, &a.noise.quadratic, &a.fixed.eps});
  const std::vector<float> pixels = in.numbers<float>(in.flag() ? 2 * depths.size() : 0, 0, 640);
  cfp::ForegroundInput<float> input;
  input.depths_m = depths;
  if (!pixels.empty()) input.pixels = cfp::PointSpan<float, 2>(pixels.data(), depths.size(), 2 * sizeof(float));
  input.box = {FuzzInput::to<float>(in.number(0, 300)), FuzzInput::to<float>(in.number(0, 200)),
               FuzzInput::to<float>(in.number(300, 640)), FuzzInput::to<float>(in.number(200, 480))};
  input.previous_depth_m = FuzzInput::to<float>(in.number(-1, 5));
  cfp::ForegroundWorkspace<float> scratch;
  std::vector<char> mask(depths.size());
  const cfp::ForegroundResult found = cfp::depth_foreground(input, foreground, scratch, mask);
  CFP_PROMISE(found.foreground + found.background + found.invalid == depths.size());
  CFP_PROMISE(std::isfinite(found.depth_m) && std::isfinite(found.near_m) && std::isfinite(found.far_m));
}

template <typename Scalar>
void tracker(FuzzInput& in) {
  cfp::BoxTrackerOptions options;
  options.image_width = in.flag() ? 640 : 0;
  options.image_height = 480;
  options.max_coast = static_cast<int>(in.count(9));
  cfp::BoxMotionOptions& m = options.motion;
  cfp_fuzz::disturb(in, options,
                    {&m.edge_noise, &m.centre_acceleration, &m.size_acceleration, &m.initial_centre_rate,
                     &m.initial_size_rate, &options.min_iou, &options.restart_gate, &options.min_score,
                     &options.birth_threshold, &options.coast_per_hit, &options.min_visible, &options.max_gap_s});
  const double largest = in.byte() < 32 ? 1e5 : 640;
  cfp::BoxTracker<Scalar> tracker(options);
  std::int64_t newest = 0;
  while (!in.empty()) {
    std::vector<cfp::Detection<Scalar>> detections(in.count(6));
    for (auto& d : detections) {
      const double x = in.number(-50, largest), y = in.number(-50, 480), w = in.number(-5, largest / 3),
                   h = in.number(-5, largest / 2);
      d.box = {FuzzInput::to<Scalar>(x), FuzzInput::to<Scalar>(y), FuzzInput::to<Scalar>(x + w),
               FuzzInput::to<Scalar>(y + h)};
      d.class_id = in.byte() & 1;
      d.score = FuzzInput::to<Scalar>(in.number(0, 1));
    }
    cfp::Matrix3<Scalar> motion = cfp::Matrix3<Scalar>::Identity();
    const bool moved = in.flag();
    for (int k = 0; moved && k < 9; ++k) motion.data()[k] += FuzzInput::to<Scalar>(in.number(-0.01, 0.01));
    const auto dt = FuzzInput::to<Scalar>(in.number(0, 0.5));
    const auto result = in.flag() ? tracker.track(detections, dt, moved ? &motion : nullptr)
                                  : tracker.coast(dt, moved ? &motion : nullptr);
    for (const auto& box : result.boxes) {
      CFP_PROMISE(cfp::is_proper(box.box) && std::isfinite(box.box.width()) && std::isfinite(box.box.height()));
      CFP_PROMISE(box.id >= 1 && box.missed >= 0 && box.missed <= (std::max)(options.max_coast, options.max_idle));
      CFP_PROMISE(box.detection < static_cast<int>(detections.size()));
      newest = (std::max)(newest, box.id);
    }
  }
  CFP_PROMISE(newest >= 0);
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  FuzzInput in(data, size);
  switch (in.byte() & 3) {
    case 0:
      assignment(in);
      break;
    case 1:
      clustering(in);
      break;
    case 2:
      tracker<float>(in);
      break;
    default:
      tracker<double>(in);
  }
  return 0;
}
