// Published figures on the eight dynamic fr3 sequences of the TUM RGB-D benchmark, to stand beside ours.
//
// Evidence: P printed by the authors of the system themselves, 2 printed in somebody else's table, – not recorded
// which. Single runs nearly all of them, on different machines, coverage seldom given: differences below about 1 mm or
// 10 % are noise.
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <string_view>

#include "../slam_runs/run_record.hpp"

namespace cfp_slam {

inline constexpr std::size_t paper_sequence_count = 8;
// In the paper's order. TUM's folder is rgbd_dataset_freiburg3_<key>.
inline constexpr std::array<const char*, paper_sequence_count> paper_keys{
    "sitting_xyz", "sitting_halfsphere", "sitting_static", "sitting_rpy",
    "walking_xyz", "walking_halfsphere", "walking_static", "walking_rpy"};
inline constexpr std::array<const char*, paper_sequence_count> paper_names{
    "fr3/s/xyz", "fr3/s/half", "fr3/s/static", "fr3/s/rpy", "fr3/w/xyz", "fr3/w/half", "fr3/w/static", "fr3/w/rpy"};

// Index of a sequence in the paper's tables; paper_sequence_count for any other. Only TUM's own names count: neither a
// rendered "walking_xyz" nor an excerpt may stand beside published figures.
inline std::size_t paper_sequence(std::string_view name) {
  constexpr std::string_view prefix = "rgbd_dataset_freiburg3_";
  while (!name.empty() && name.back() == '/') name.remove_suffix(1);
  const std::size_t slash = name.rfind('/');
  if (slash != std::string_view::npos) name.remove_prefix(slash + 1);
  if (name.substr(0, prefix.size()) != prefix) return paper_sequence_count;
  name.remove_prefix(prefix.size());
  std::size_t k = 0;
  while (k < paper_sequence_count && name != paper_keys[k]) ++k;
  return k;
}

inline constexpr double no = std::numeric_limits<double>::quiet_NaN();  // not published

struct PublishedError {
  double rmse = no, sd = no;
};
struct PublishedRow {
  const char* system;
  const char* evidence;
  std::array<PublishedError, paper_sequence_count> error;
  int decimals = 4;  // as published
};

// clang-format off
// Table I of the paper: ATE in metres, RMSE and S.D.
inline constexpr std::array<PublishedRow, 7> paper_ate_m{{
    {"ORB-SLAM2", "2", {{{0.0092, 0.0047}, {0.0192, 0.0110}, {0.0087, 0.0042}, {0.0195, 0.0124},
      {0.7214, 0.2560}, {0.4667, 0.2601}, {0.3872, 0.1636}, {0.7842, 0.4005}}}},
    {"DynaSLAM", "2", {{{0.0127, 0.0060}, {0.0186, 0.0086}, {no, no}, {no, no},
      {0.0164, 0.0086}, {0.0296, 0.0157}, {0.0068, 0.0032}, {0.0354, 0.0190}}}},
    {"DS-SLAM", "2", {{{no, no}, {no, no}, {0.0065, 0.0033}, {no, no},
      {0.0247, 0.0161}, {0.0303, 0.0159}, {0.0081, 0.0036}, {0.4442, 0.2350}}}},
    {"Blitz-SLAM", "2", {{{0.0148, 0.0069}, {0.0160, 0.0076}, {no, no}, {no, no},
      {0.0153, 0.0078}, {0.0256, 0.0126}, {0.0102, 0.0052}, {0.0356, 0.0220}}}},
    {"TRS", "2", {{{0.0117, no}, {0.0172, no}, {no, no}, {no, no},
      {0.0194, no}, {0.0290, no}, {0.0111, no}, {0.0371, no}}}},
    {"CFP-SLAM-", "P", {{{0.0129, 0.0068}, {0.0159, 0.0072}, {0.0061, 0.0029}, {0.0244, 0.0175},
      {0.0149, 0.0077}, {0.0235, 0.0114}, {0.0069, 0.0032}, {0.0411, 0.0257}}}},
    {"CFP-SLAM", "P", {{{0.0090, 0.0042}, {0.0147, 0.0069}, {0.0053, 0.0027}, {0.0253, 0.0154},
      {0.0141, 0.0072}, {0.0237, 0.0114}, {0.0066, 0.0030}, {0.0368, 0.0230}}}}}};

// Table II: translational drift in metres per second.
inline constexpr std::array<PublishedRow, 7> paper_rpe_m{{
    {"ORB-SLAM2", "2", {{{0.0117, 0.0060}, {0.0231, 0.0163}, {0.0090, 0.0043}, {0.0245, 0.0144},
      {0.3944, 0.2964}, {0.3480, 0.2859}, {0.2349, 0.2151}, {0.4582, 0.3447}}}},
    {"DynaSLAM", "2", {{{0.0142, 0.0073}, {0.0239, 0.0120}, {no, no}, {no, no},
      {0.0217, 0.0119}, {0.0284, 0.0149}, {0.0089, 0.0044}, {0.0448, 0.0262}}}},
    {"DS-SLAM", "2", {{{no, no}, {no, no}, {0.0078, 0.0038}, {no, no},
      {0.0333, 0.0229}, {0.0297, 0.0152}, {0.0102, 0.0048}, {0.1503, 0.1168}}}},
    {"Blitz-SLAM", "2", {{{0.0144, 0.0071}, {0.0165, 0.0073}, {no, no}, {no, no},
      {0.0197, 0.0096}, {0.0253, 0.0123}, {0.0129, 0.0069}, {0.0473, 0.0283}}}},
    {"TRS", "2", {{{0.0166, no}, {0.0259, no}, {no, no}, {no, no},
      {0.0234, no}, {0.0423, no}, {0.0117, no}, {0.0471, no}}}},
    {"CFP-SLAM-", "P", {{{0.0149, 0.0081}, {0.0214, 0.0099}, {0.0078, 0.0034}, {0.0322, 0.0217},
      {0.0196, 0.0099}, {0.0274, 0.0130}, {0.0092, 0.0043}, {0.0540, 0.0350}}}},
    {"CFP-SLAM", "P", {{{0.0114, 0.0055}, {0.0162, 0.0079}, {0.0072, 0.0035}, {0.0316, 0.0186},
      {0.0190, 0.0097}, {0.0259, 0.0128}, {0.0089, 0.0040}, {0.0500, 0.0306}}}}}};

// Table III: rotational drift in degrees per second.
inline constexpr std::array<PublishedRow, 7> paper_rpe_deg{{
    {"ORB-SLAM2", "2", {{{0.4890, 0.2713}, {0.6015, 0.2924}, {0.2850, 0.1241}, {0.7772, 0.3999},
      {7.7846, 5.8335}, {7.2138, 5.8299}, {4.1856, 3.8077}, {8.8923, 6.6658}}}},
    {"DynaSLAM", "2", {{{0.5042, 0.2651}, {0.7045, 0.3488}, {no, no}, {no, no},
      {0.6284, 0.3848}, {0.7842, 0.4012}, {0.2612, 0.1259}, {0.9894, 0.5701}}}},
    {"DS-SLAM", "2", {{{no, no}, {no, no}, {0.2735, 0.1215}, {no, no},
      {0.8266, 0.5826}, {0.8142, 0.4101}, {0.2690, 0.1182}, {3.0042, 2.3065}}}},
    {"Blitz-SLAM", "2", {{{0.5024, 0.2634}, {0.5981, 0.2739}, {no, no}, {no, no},
      {0.6132, 0.3348}, {0.7879, 0.3751}, {0.3038, 0.1437}, {1.0841, 0.6668}}}},
    {"TRS", "2", {{{0.5968, no}, {0.7891, no}, {no, no}, {no, no},
      {0.6368, no}, {0.9650, no}, {0.2872, no}, {1.0587, no}}}},
    {"CFP-SLAM-", "P", {{{0.5126, 0.2793}, {0.7697, 0.3718}, {0.2749, 0.1192}, {0.8303, 0.4653},
      {0.6204, 0.3850}, {0.7853, 0.3821}, {0.2535, 0.1130}, {1.0521, 0.5577}}}},
    {"CFP-SLAM", "P", {{{0.4875, 0.2640}, {0.5917, 0.2834}, {0.2654, 0.1183}, {0.7410, 0.3665},
      {0.6023, 0.3719}, {0.7575, 0.3743}, {0.2527, 0.1051}, {1.1084, 0.6722}}}}}};

// Table IV: ATE in metres of the ablations.
inline constexpr std::array<PublishedRow, 6> paper_ablation_m{{
    {"CFP-SLAM", "P", {{{0.0090, 0.0042}, {0.0147, 0.0069}, {0.0053, 0.0027}, {0.0253, 0.0154},
      {0.0141, 0.0072}, {0.0237, 0.0114}, {0.0066, 0.0030}, {0.0368, 0.0230}}}},
    {"CFP-SLAM-", "P", {{{0.0129, 0.0068}, {0.0159, 0.0072}, {0.0061, 0.0029}, {0.0244, 0.0175},
      {0.0149, 0.0077}, {0.0235, 0.0114}, {0.0069, 0.0032}, {0.0411, 0.0257}}}},
    {"W/O-MDC", "P", {{{0.0123, 0.0066}, {0.0150, 0.0074}, {0.0055, 0.0025}, {0.0237, 0.0149},
      {0.0158, 0.0079}, {0.0258, 0.0134}, {0.0070, 0.0031}, {0.1910, 0.1594}}}},
    {"W/O-DBS", "P", {{{0.0130, 0.0060}, {0.0305, 0.0179}, {0.0064, 0.0030}, {0.0297, 0.0205},
      {0.0159, 0.0081}, {0.0274, 0.0137}, {0.0078, 0.0033}, {0.0749, 0.0536}}}},
    {"W/O-KSP", "P", {{{0.0142, 0.0063}, {0.0201, 0.0089}, {0.0062, 0.0030}, {0.0287, 0.0195},
      {0.0154, 0.0076}, {0.0307, 0.0151}, {0.0076, 0.0033}, {0.0405, 0.0211}}}},
    {"Only-YOLO", "P", {{{0.0174, 0.0079}, {0.0281, 0.0158}, {0.0064, 0.0027}, {0.0460, 0.0332},
      {0.0165, 0.0082}, {0.0310, 0.0165}, {0.0073, 0.0032}, {0.0456, 0.0312}}}}}};

// Other RGB-D systems with a rigid alignment, among them the best published on each sequence. ATE RMSE in metres.
inline constexpr std::array<PublishedRow, 10> later_ate_m{{
    {"DynaSLAM (own paper)", "P", {{{0.015, no}, {0.017, no}, {no, no}, {no, no},
      {0.015, no}, {0.025, no}, {0.006, no}, {0.035, no}}}, 3},
    {"Wang et al. 2019", "2", {{{0.0098, no}, {0.0217, no}, {no, no}, {no, no},
      {0.0190, no}, {0.0285, no}, {0.0059, no}, {no, no}}}},
    {"Fang et al. 2021", "2", {{{0.0088, no}, {0.0145, no}, {no, no}, {no, no},
      {0.0164, no}, {0.0923, no}, {0.0104, no}, {no, no}}}},
    {"WF-SLAM", "P", {{{0.0087, no}, {0.0171, no}, {no, no}, {no, no},
      {0.0127, no}, {0.0244, no}, {0.0068, no}, {0.0252, no}}}},
    {"DFS-SLAM", "2", {{{no, no}, {no, no}, {no, no}, {no, no},
      {0.013, no}, {0.018, no}, {0.006, no}, {0.027, no}}}, 3},
    {"NGD-SLAM", "P", {{{no, no}, {no, no}, {no, no}, {no, no},
      {0.015, no}, {0.024, no}, {0.007, no}, {0.034, no}}}, 3},
    {"V3D-SLAM", "P", {{{0.0087, no}, {0.0147, no}, {0.0058, no}, {0.0169, no},
      {0.0153, no}, {0.0229, no}, {0.0065, no}, {0.0781, no}}}},
    {"DG-SLAM", "P", {{{0.010, no}, {no, no}, {no, no}, {no, no},
      {0.016, no}, {no, no}, {0.006, no}, {0.043, no}}}, 3},
    {"UP-SLAM", "P", {{{0.009, no}, {no, no}, {no, no}, {no, no},
      {0.016, no}, {0.026, no}, {0.007, no}, {no, no}}}, 3},
    {"ADD-SLAM", "P", {{{no, no}, {0.013, no}, {no, no}, {no, no},
      {0.014, no}, {0.016, no}, {0.005, no}, {no, no}}}, 3}}};

// Monocular and learned systems, aligned with scale (Sim(3)), which hides scale error: not comparable one to one.
inline constexpr std::array<PublishedRow, 5> scaled_ate_m{{
    {"DROID-SLAM", "–", {{{0.009, no}, {0.014, no}, {0.005, no}, {0.022, no},
      {0.016, no}, {0.022, no}, {0.012, no}, {0.040, no}}}, 3},
    {"MegaSaM", "–", {{{no, no}, {no, no}, {no, no}, {no, no},
      {0.015, no}, {0.018, no}, {0.006, no}, {0.026, no}}}, 3},
    {"WildGS-SLAM", "–", {{{0.008, no}, {0.020, no}, {0.005, no}, {0.024, no},
      {0.013, no}, {0.016, no}, {0.004, no}, {0.033, no}}}, 3},
    {"DROID-W", "–", {{{0.008, no}, {0.014, no}, {0.005, no}, {0.021, no},
      {0.012, no}, {0.016, no}, {0.005, no}, {0.031, no}}}, 3},
    {"Dream-SLAM", "–", {{{0.006, no}, {0.019, no}, {0.003, no}, {0.023, no},
      {0.017, no}, {0.016, no}, {0.003, no}, {no, no}}}, 3}}};
// clang-format on

// Table V: mean milliseconds on an Intel i7 with an RTX 3060; `no` where the paper gives none. The coarse stage is its
// box filter, static probability of objects (which holds the optical flow) and DBSCAN together. "cfp-minus" has no
// object stage and a shorter frame; the paper's times for the other variants are not published.
inline double paper_milliseconds(Module module, std::string_view variant) {
  const bool minus = variant == "cfp-minus";
  if (!minus && variant != "cfp") return no;
  switch (module) {
    case Module::detection:
      return 12.44;
    case Module::coarse:
      return minus ? 0.07 + 1.76 : 0.07 + 17.93 + 1.76;
    case Module::fine:
      return 3.66;
    case Module::tracking:
      return minus ? 24.77 : 42.7;
    default:
      return no;
  }
}

}  // namespace cfp_slam
