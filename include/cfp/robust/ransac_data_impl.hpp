/// @file ransac_data_impl.hpp
/// What the estimators over ransac.hpp share beside the search: their data, its refinement, the report. Not an
/// interface.
#pragma once

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <vector>

#include "cfp/core/span.hpp"
#include "cfp/optimization/least_squares.hpp"
#include "cfp/robust/ransac.hpp"
#include "cfp/simd/packet.hpp"

namespace cfp::detail {

// The data present as one array per coordinate, the weight last and relative to the largest; padded with zeros to whole
// blocks, so that loops over packets need no rest. In double and, for scoring, rounded to float.
template <std::size_t Rows>
struct RansacColumns {
  static constexpr std::size_t block = 64;

  std::size_t size = 0, capacity = 0;
  double total_weight = 0;
  std::vector<std::uint32_t> index;  // position in the caller's arrays
  std::vector<double> exact;
  std::vector<float> fast;

  template <typename T>
  [[nodiscard]] const T* column(std::size_t r) const noexcept {
    if constexpr (std::is_same_v<T, double>)
      return exact.data() + r * capacity;
    else
      return fast.data() + r * capacity;
  }
  [[nodiscard]] const double* row(std::size_t r) const noexcept { return column<double>(r); }
  [[nodiscard]] double* row(std::size_t r) noexcept { return exact.data() + r * capacity; }
  [[nodiscard]] span<const double> weights() const noexcept { return {row(Rows - 1), size}; }

  void begin(std::size_t most) {
    size = 0;
    capacity = (most + block - 1) / block * block;
    index.resize(most);
    exact.assign(Rows * capacity, 0.0);
    fast.resize(Rows * capacity);
  }
  CFP_INLINE void push(std::size_t i, const double (&datum)[Rows]) noexcept {
    for (std::size_t r = 0; r < Rows; ++r) row(r)[size] = datum[r];
    index[size++] = static_cast<std::uint32_t>(i);
  }
};

// Counts what falls into the same cell: open addressing.
struct CellCounts {
  std::vector<std::uint64_t> keys;
  std::vector<std::uint32_t> counts, slots;  // per slot; the slot of every datum

  CFP_INLINE void begin(std::size_t data) {
    std::size_t size = 64;
    while (size < 2 * data) size *= 2;
    keys.assign(size, 0), counts.assign(size, 0), slots.resize(data);
  }
  // Datum i into cell (x, y), not both 0.
  CFP_INLINE void enter(std::size_t i, std::uint64_t x, std::uint64_t y) noexcept {
    const std::uint64_t key = x << 32 | y;
    std::size_t at = static_cast<std::size_t>(key * 0x9e3779b97f4a7c15U >> 32) & (keys.size() - 1);
    while (keys[at] != 0 && keys[at] != key) at = (at + 1) & (keys.size() - 1);
    keys[at] = key;
    ++counts[at];
    slots[i] = static_cast<std::uint32_t>(at);
  }
  // How many are in the cell of datum i.
  [[nodiscard]] CFP_INLINE std::uint32_t beside(std::size_t i) const noexcept { return counts[slots[i]]; }
};

inline namespace CFP_ISA {

template <std::size_t Rows>
void finish(RansacColumns<Rows>& columns) noexcept {
  double* const weight = columns.row(Rows - 1);
  const double largest = columns.size > 0 ? *std::max_element(weight, weight + columns.size) : 1.0;
  columns.total_weight = 0;
  for (std::size_t i = 0; i < columns.size; ++i) columns.total_weight += weight[i] /= largest;
  std::transform(columns.exact.begin(), columns.exact.end(), columns.fast.begin(),
                 [](double x) { return static_cast<float>(x); });
}

// The sum of term(i), i = 0, lanes, 2 lanes, … below `size`; some value above `bound` as soon as the sum exceeds it.
template <typename T, typename Term>
[[nodiscard]] double bounded_sum(std::size_t size, double bound, const Term& term) noexcept {
  using P = simd::Packet<T>;
  constexpr std::size_t block = RansacColumns<1>::block;
  double sum = 0;
  for (std::size_t first = 0; first < size && sum < bound; first += block) {
    P part(T(0));
    for (std::size_t i = first; i < first + block; i += P::lanes) part += term(i);
    sum += static_cast<double>(reduce_add(part));
  }
  return sum;
}

// Takes at most max_steps that each lower the model's cost by more than `tolerance` of it. Returns the cost, infinite
// when it is not finite at the start.
template <int N, typename Model, typename State>
double refine(Model model, int max_steps, double tolerance, State& state) {
  LevenbergMarquardtOptions options;
  options.max_iterations = max_steps;
  options.initial_damping = 1e-6;
  options.min_damping = 1e-9;
  options.rejected_damping = 1e-4;
  options.max_damping = 1e6;
  options.min_relative_decrease = tolerance;
  options.min_absolute_decrease = 0;
  DenseLeastSquares<N, State, Model> problem{model, state};
  const LeastSquaresResult result = minimize_least_squares(problem, options);
  state = problem.state;
  return result.status == SolverStatus::not_finite ? std::numeric_limits<double>::infinity() : result.final_cost;
}

// Nats by which it is unlikely that `near` of `all` data lie where chance puts the share `chance` of them: the exponent
// of the binomial tail, 0 unless they are more than chance expects.
template <typename T>
[[nodiscard]] T binomial_nats(T near, T all, T chance) noexcept {
  if (!(near > chance * all)) return 0;
  const auto nats = [&](T part, T share) { return part > 0 ? part * std::log(part / (share * all)) : T(0); };
  return nats(near, chance) + nats(all - near, 1 - chance);
}

inline void refuse(span<char> inlier_mask, RansacReport& report,
                   RansacStatus status = RansacStatus::no_consensus) noexcept {
  std::fill(inlier_mask.begin(), inlier_mask.end(), char(0));
  report.inliers = 0;
  report.inlier_share = 0;
  report.status = status;
}

// Fills the counts, the share and the mask (empty, or one per datum of the caller, all 0). Too few inliers are no
// consensus.
template <std::size_t Rows, typename IsInlier>
void report_inliers(const RansacColumns<Rows>& data, IsInlier&& is_inlier, std::size_t min_inliers,
                    span<char> inlier_mask, RansacReport& report) {
  double weight = 0;
  for (std::size_t i = 0; i < data.size; ++i) {
    if (!is_inlier(i)) continue;
    ++report.inliers;
    weight += data.weights()[i];
    if (!inlier_mask.empty()) inlier_mask[data.index[i]] = 1;
  }
  report.inlier_share = (std::min)(weight / data.total_weight, 1.0);
  if (report.inliers < min_inliers) refuse(inlier_mask, report);
}

}  // namespace CFP_ISA
}  // namespace cfp::detail
