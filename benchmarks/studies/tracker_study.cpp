// What the defaults of the box tracker rest on: frame rates from 5 to 60 Hz, boxes that a detector misplaces by 1 to
// 8 % of their size, a still and a hand-held camera (simulated walkers), and TUD-Stadtmitte at its full, half and
// quarter rate (MOT format: det.txt, gt.txt; 25 Hz, still camera, people who cover each other), beside associations in
// the manner of SORT, OC-SORT and ByteTrack (support/rival_trackers.hpp).
//
//   cfp_tracker_study [folder of TUD-Stadtmitte] [sequences per cell, default 20]
//
// Of the truth boxes that the detector missed (IoU < 0.5) for 1 to 6 frames in a row `covered` is the share that a
// compensated box covers at IoU >= 0.5; `false` counts the compensated boxes per frame that lie on nothing or on a
// person who was detected. The defaults were chosen on the stream "tune" and its walkers (table 2); table 1 reports
// other seeds, other numbers of people, other speeds and other miss rates.
//
// The aim is to cover nowhere more than a point less than the best of the three, with at most 10 % more false boxes
// than the least of them, which are different trackers. All cells of TUD-Stadtmitte reach it (with bursts withheld
// +1.0, -0.4 and -0.9 points, +6, +2 and +2 % false boxes at full, half and quarter rate), and all simulated ones but
// two of a hand-held camera at 60 Hz whose motion is not handed over: -1.1 points at 1 %, +11 % at 2 % (with 80
// sequences -1.1 and +10). On "tune" with 80 sequences all reach it. What it took was seen in where the false boxes of
// TUD-Stadtmitte lay; no other default changed:
//   - The acceleration of the centre is as large up and down as across. In units of the height, 3.5 times as large for
//     people, compensated boxes at quarter rate were 0.40 heights off after six frames, where SORT's were 0.07. Price:
//     a camera's tilt that is not handed over is followed less, -0.2 points at 60 Hz, -2.3 at 15 Hz, where the lead
//     is 3.
//   - A detection that no track takes starts the nearest one without a detection anew. Identity switches fall by a
//     sixth, false boxes at 5 Hz by 14 to 23 %. The simulated cells take any restart_gate up to 5; 4, which is 99.7 %
//     of chi-squared with four degrees of freedom, is also what TUD-Stadtmitte asks for, on the bursts of "tune".
//
// What was tried beside the options of table 2, on the stream "tune", before these two: rates that fade in 1 to 2 s
// cover 0.5 % more, with up to +29 to +37 % false boxes; no coasting for tracks seen in less than 70 (80) % of their
// frames: +18 (+12) %, and 6 (12) cells behind; no compensated box on a detected one (IoU > 0.5): +14 %, 14 cells
// behind; a second round of association that goes on with the track, by enlarged boxes or the last ones seen: up to
// +31 %, 4 to 14 cells behind (the false boxes at low rates follow ghosts that a worse association never confirms).
// With the first of them: a size and an aspect instead of width and height, no difference; no compensation once the
// centre is unsure by half a width, a tenth fewer false boxes for 0.6 points. With both: process noise driven by the
// innovation (inflated where it exceeds 1.5 to 3 sigma), up to 0.6 points more of the simulated and 2 to 4 less of
// TUD-Stadtmitte, whose boxes are cut by who stands before them; a restart that keeps half of its detections, 0.8
// points more and up to +26 % false boxes.
//
// Table 3: the step of a frame (track_boxes) finds the image motion in the flow where the host hands over none. The aim
// is to lose nowhere more than half a point to nothing given. In the simulated cells the flow covers at most a point
// less than the motion itself does. "Camera goes along" is a camera that goes sideways at 0.8 m/s beside the people,
// before a room 2 to 8 m away: what the flow shows is no motion of theirs. The worst cell there has 0.4 points less and
// 5 % more false boxes. Tried beside it, here and in rooms with more parallax and larger people: the median shift of
// the pairs outside of the boxes covers as much but for a rolling camera (-3 to -5 points at 5 Hz), and 8 points less
// than nothing where the camera goes along; of all pairs, the same, and -3 points where somebody near holds half of
// them; a similarity taken whole, -4 points where the camera goes forward at 5 Hz; affine and homography no better than
// it; a quarter quantile or what is left beyond the mean of the last second, less gain; a part of 1 - 8 d^2 / D^2 loses
// a point where few pairs are known, of 1 - 16 d^2 / D^2 gains less.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <initializer_list>
#include <map>
#include <string>
#include <vector>

#include "cfp/detection/box_tracker.hpp"
#include "cfp/frame/begin_frame.hpp"
#include "cfp/frame/track_boxes.hpp"
#include "support/box_flow.hpp"
#include "support/box_sequences.hpp"
#include "support/data.hpp"
#include "support/rival_trackers.hpp"

namespace {

using cfp_study::BoxFrame;
using cfp_study::BoxSequence;
using cfp_study::Truth;

struct Figures {
  double missed = 0, covered = 0, wrong = 0, frames = 0, switches = 0;

  [[nodiscard]] double share() const { return missed > 0 ? 100 * covered / missed : 0; }
  [[nodiscard]] double wrong_per_frame() const { return wrong / frames; }
};

/// Indices of the boxes that belong to each truth box at IoU >= 0.5.
template <typename Boxes>
std::vector<int> match(const std::vector<Truth>& truth, const Boxes& boxes) {
  std::vector<double> costs;
  for (const Truth& t : truth) {
    for (const auto& b : boxes) costs.push_back(1 - cfp::iou(t.box, b.box));
  }
  std::vector<int> partner(truth.size());
  cfp::AssignmentWorkspace workspace;
  cfp::solve_assignment(cfp::CostMatrix(costs, truth.size(), boxes.size()), 1 - 0.4999999, workspace, partner);
  return partner;
}

/// Runs one tracker over one sequence; `next(frame, dt)` returns its boxes.
template <typename Next>
void run(const BoxSequence& sequence, Figures& figures, const Next& next) {
  struct Burst {
    std::vector<bool> covered;
    std::size_t last = 0;
  };
  std::map<int, Burst> bursts;  // the current run of misses of each person
  std::map<int, std::int64_t> identity;
  const auto close = [&](Burst& burst) {
    if (burst.covered.size() <= 6) {
      figures.missed += static_cast<double>(burst.covered.size());
      figures.covered += static_cast<double>(std::count(burst.covered.begin(), burst.covered.end(), true));
    }
    burst.covered.clear();
  };
  for (std::size_t k = 0; k < sequence.frames.size(); ++k) {
    const BoxFrame& frame = sequence.frames[k];
    const auto boxes = next(frame, k == 0 ? 0.0 : sequence.dt_s);
    const std::vector<int> detected = match(frame.truth, frame.detections), tracked = match(frame.truth, boxes);
    figures.frames += 1;
    for (std::size_t i = 0; i < frame.truth.size(); ++i) {
      const Truth& t = frame.truth[i];
      Burst& burst = bursts[t.person];
      if (!burst.covered.empty() && burst.last + 1 != k) close(burst);  // the person left the picture in between
      if (detected[i] == cfp::unassigned) {
        burst.covered.push_back(std::any_of(boxes.begin(), boxes.end(), [&](const auto& b) {
          return b.compensated() && cfp::iou(b.box, t.box) >= 0.5;
        }));
        burst.last = k;
      } else {
        close(burst);
      }
      if (tracked[i] == cfp::unassigned) continue;
      const std::int64_t id = boxes[static_cast<std::size_t>(tracked[i])].id;
      const auto known = identity.emplace(t.person, id).first;
      figures.switches += known->second != id ? 1 : 0;
      known->second = id;
    }
    for (const auto& b : boxes) {
      bool on_missed = false;
      for (std::size_t i = 0; i < frame.truth.size(); ++i)
        on_missed = on_missed || (detected[i] == cfp::unassigned && cfp::iou(b.box, frame.truth[i].box) >= 0.5);
      figures.wrong += b.compensated() && !on_missed ? 1 : 0;
    }
  }
  for (auto& [person, burst] : bursts) close(burst);
}

struct Cell {
  std::string name;
  std::vector<BoxSequence> sequences;
};

cfp::BoxTrackerOptions in_image(const BoxSequence& sequence, cfp::BoxTrackerOptions options) {
  options.image_width = sequence.width;
  options.image_height = sequence.height;
  return options;
}

Figures run_ours(const Cell& cell, const cfp::BoxTrackerOptions& options) {
  Figures figures;
  for (const BoxSequence& sequence : cell.sequences) {
    cfp::BoxTracker<double> tracker(in_image(sequence, options));
    run(sequence, figures, [&](const BoxFrame& frame, double dt) { return tracker.track(frame.detections, dt).boxes; });
  }
  return figures;
}

/// What the host hands over beside the detections.
enum class Given : std::uint8_t { motion, flow, flow_beside };

/// The step of a frame, which finds the image motion in the flow.
Figures run_step(const Cell& cell, Given given) {
  Figures figures;
  for (const BoxSequence& sequence : cell.sequences) {
    cfp::Random random(1, "flow");
    cfp_study::BoxFlowOptions o;
    o.along_m_s = given == Given::flow_beside ? 0.8 : 0;
    cfp::FrameOptions options;
    options.tracker = in_image(sequence, {});
    cfp::BoxTracker<double> tracker(options.tracker);
    cfp::FrameState<double> state;
    const BoxFrame* before = nullptr;
    double time_s = 0;
    run(sequence, figures, [&](const BoxFrame& seen, double dt) {
      cfp::Frame<double> frame;
      frame.timestamp_s = time_s += dt;
      frame.detections = seen.detections;
      cfp_study::BoxFlow flow;
      if (given == Given::motion)
        frame.image_motion = seen.image_motion;
      else if (before != nullptr)
        flow = flow_between(*before, seen, dt, random, o);
      frame.flow = {cfp::PointSpan<double, 2>(flow.previous), cfp::PointSpan<double, 2>(flow.current)};
      before = &seen;
      cfp::begin_frame(frame, state);
      cfp::track_boxes(frame, options, tracker, state);
      return state.boxes;
    });
  }
  return figures;
}

Figures run_rival(const Cell& cell, cfp_study::Rival rival) {
  Figures figures;
  for (const BoxSequence& sequence : cell.sequences) {
    cfp_study::RivalTracker tracker(rival, in_image(sequence, {}));
    run(sequence, figures, [&](const BoxFrame& frame, double) { return tracker.track(frame.detections); });
  }
  return figures;
}

constexpr std::size_t simulated_cells = 40;  // come first

std::vector<Cell> make_cells(const char* stream, int sequences, bool tune, const std::string& folder) {
  std::vector<Cell> cells;
  for (const bool hand_held : {false, true}) {
    for (const double rate : {5.0, 7.5, 15.0, 30.0, 60.0}) {
      for (const double jitter : {0.01, 0.02, 0.04, 0.08}) {
        char name[64];
        std::snprintf(name, sizeof name, "%s, %4.1f Hz, %.0f %%", hand_held ? "hand-held" : "still    ", rate,
                      100 * jitter);
        Cell cell{name, {}};
        for (int k = 0; k < sequences; ++k) {
          cfp::Random random(static_cast<std::uint64_t>(k + 1), stream);
          cfp_study::WalkerOptions walkers;
          walkers.rate_hz = rate;
          walkers.jitter = jitter;
          walkers.hand_held = hand_held;
          if (!tune) {
            walkers.people = 2 + random.index(4);
            walkers.speed = random.uniform(0.5, 1.3);
            walkers.miss_rate = random.uniform(0.02, 0.08);
          }
          cell.sequences.push_back(cfp_study::simulate_walkers(random, walkers));
        }
        cells.push_back(cell);
      }
    }
  }
  for (const std::size_t step : {std::size_t(1), std::size_t(2), std::size_t(4)}) {
    const std::vector<BoxSequence> tud = cfp_study::read_mot(folder, 25, step);
    if (tud.empty()) continue;
    cells.push_back({"TUD-Stadtmitte, 1/" + std::to_string(step), tud});
    Cell withheld{"  and bursts withheld", {}};
    for (int k = 0; k < sequences; ++k) {
      cfp::Random random(static_cast<std::uint64_t>(k + 1), stream);
      for (const BoxSequence& part : tud) withheld.sequences.push_back(cfp_study::withhold_bursts(part, random, 0.04));
    }
    cells.push_back(withheld);
  }
  return cells;
}

/// How one tracker stands beside the best rival of every cell.
struct Standing {
  double share = 0, lead = 1e9, excess = -1e9;  // mean; worst over the cells: points, and % of the least false boxes
  void add(const Figures& ours, const std::vector<Figures>& rivals, std::size_t cells) {
    double best = 0, least = 1e9;
    for (const Figures& r : rivals) {
      best = (std::max)(best, r.share());
      least = (std::min)(least, r.wrong_per_frame());
    }
    share += ours.share() / static_cast<double>(cells);
    lead = (std::min)(lead, ours.share() - best);
    excess = (std::max)(excess, 100 * (ours.wrong_per_frame() / least - 1));
  }
};

using Rivals = std::vector<std::vector<Figures>>;  // per cell

Rivals run_rivals(const std::vector<Cell>& cells) {
  Rivals rivals;
  for (const Cell& cell : cells) {
    rivals.emplace_back();
    for (const auto rival : {cfp_study::Rival::sort, cfp_study::Rival::oc_sort, cfp_study::Rival::byte_track})
      rivals.back().push_back(run_rival(cell, rival));
  }
  return rivals;
}

void print_report(const std::vector<Cell>& cells, const Rivals& rivals) {
  std::printf(
      "| cell | covered %%: SORT | OC-SORT | ByteTrack | cfp | false per frame: SORT | OC-SORT | ByteTrack | cfp | "
      "lead, points | false beyond the least |\n|---|---|---|---|---|---|---|---|---|---|---|\n");
  Standing all;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const Figures ours = run_ours(cells[c], {});
    Standing standing;
    standing.add(ours, rivals[c], 1);
    all.add(ours, rivals[c], cells.size());
    std::printf("| %-22s |", cells[c].name.c_str());
    for (const Figures& r : rivals[c]) std::printf(" %5.1f |", r.share());
    std::printf(" %5.1f |", ours.share());
    for (const Figures& r : rivals[c]) std::printf(" %.4f |", r.wrong_per_frame());
    std::printf(" %.4f | %+5.1f | %+5.1f %% |\n", ours.wrong_per_frame(), standing.lead, standing.excess);
  }
  std::printf("mean covered %.1f %%; the worst cell: %+.1f points, false boxes %+.1f %%\n\n", all.share, all.lead,
              all.excess);
}

void print_image_motion(const std::vector<Cell>& cells) {
  std::printf(
      "| cell | covered %%: nothing given | the motion | flow | flow, camera goes along | false per frame: nothing | "
      "the motion | flow | flow, camera goes along |\n|---|---|---|---|---|---|---|---|---|\n");
  double lead = 1e9, excess = -1e9;
  for (std::size_t c = 0; c < (std::min)(cells.size(), simulated_cells); ++c) {
    std::vector<Figures> all{run_ours(cells[c], {})};
    for (const Given given : {Given::motion, Given::flow, Given::flow_beside}) all.push_back(run_step(cells[c], given));
    std::printf("| %-22s |", cells[c].name.c_str());
    for (const Figures& f : all) std::printf(" %5.1f |", f.share());
    for (const Figures& f : all) std::printf(" %.4f |", f.wrong_per_frame());
    std::printf("\n");
    for (std::size_t k = 2; k < all.size(); ++k) {
      lead = (std::min)(lead, all[k].share() - all[0].share());
      excess = (std::max)(excess, 100 * (all[k].wrong_per_frame() / all[0].wrong_per_frame() - 1));
    }
  }
  std::printf("with flow, beside nothing given, the worst cell: %+.1f points, false boxes %+.1f %%\n\n", lead, excess);
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
  vary("edge_noise", [](O& o, double v) { o.motion.edge_noise = v; }, {0.02, 0.04, 0.06, 0.08, 0.12});
  vary("centre_acceleration", [](O& o, double v) { o.motion.centre_acceleration = v; }, {0.25, 0.5, 0.75, 1, 1.5, 2});
  vary("size_acceleration", [](O& o, double v) { o.motion.size_acceleration = v; }, {0.02, 0.05, 0.1, 0.2, 0.5});
  vary("initial_centre_rate", [](O& o, double v) { o.motion.initial_centre_rate = v; }, {0.1, 0.2, 0.3, 0.5, 1, 2});
  vary("initial_size_rate", [](O& o, double v) { o.motion.initial_size_rate = v; }, {0.02, 0.05, 0.1, 0.2});
  vary("min_iou", [](O& o, double v) { o.min_iou = v; }, {0.1, 0.2, 0.3, 0.4});
  vary("restart_gate", [](O& o, double v) { o.restart_gate = v; }, {0, 3, 4, 5, 6});
  vary("confirm_hits", [](O& o, double v) { o.confirm_hits = static_cast<int>(v); }, {1, 2, 3});
  vary("max_coast", [](O& o, double v) { o.max_coast = static_cast<int>(v); }, {3, 6, 9});
  vary("coast_per_hit", [](O& o, double v) { o.coast_per_hit = v; }, {0.5, 1, 2});
  return all;
}

}  // namespace

int main(int argc, char** argv) {
  const bool smoke = argc > 1 && std::string(argv[1]) == "--smoke";
  const std::string folder = argc > 1 && !smoke ? argv[1] : cfp_test::data_folder("mot/TUD-Stadtmitte").string();
  const int sequences = smoke ? 1 : argc > 2 ? std::atoi(argv[2]) : 20;
  std::printf("Table 1: other seeds and walkers than the defaults were chosen on\n");
  const std::vector<Cell> report = make_cells("report", sequences, false, folder);
  print_report(report, run_rivals(report));
  std::printf(
      "Table 2: one option varied, the seeds and walkers that the defaults were chosen on, and TUD-Stadtmitte\n"
      "| variant | mean covered %% | worst lead, points | false beyond the least in the worst cell "
      "|\n|---|---|---|---|\n");
  const std::vector<Cell> tune = make_cells("tune", sequences, true, folder);
  const Rivals rivals = run_rivals(tune);
  for (const Variant& v : variants()) {
    Standing standing;
    for (std::size_t c = 0; c < tune.size(); ++c) standing.add(run_ours(tune[c], v.options), rivals[c], tune.size());
    std::printf("| %-26s | %5.2f | %+5.1f | %+5.1f %% |\n", v.name.c_str(), standing.share, standing.lead,
                standing.excess);
    std::fflush(stdout);
  }
  std::printf("\nTable 3: the cells of table 1 with the image motion of the host, or of the flow\n");
  print_image_motion(report);
}
