// A fuzzer's bytes as values, the hostile ones among them, and what is asked of every answer.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <vector>

/// Ends the process with the broken promise, which is what a fuzzer calls a finding.
#define CFP_PROMISE(condition)                                                             \
  do {                                                                                     \
    if (!(condition)) {                                                                    \
      std::fprintf(stderr, "%s:%d: broken promise: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                        \
    }                                                                                      \
  } while (false)

namespace cfp_fuzz {

/// Reads the bytes from first to last; zeros after that.
class FuzzInput {
 public:
  FuzzInput(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

  [[nodiscard]] bool empty() const { return size_ == 0; }
  std::uint8_t byte() {
    if (size_ == 0) return 0;
    --size_;
    return *data_++;
  }
  bool flag() { return (byte() & 1U) != 0; }
  /// In [0, most].
  std::size_t count(std::size_t most) { return (byte() + 256U * byte()) % (most + 1); }
  /// In [low, high], seven times of eight; else whatever breaks formulas.
  double number(double low, double high) {
    const std::uint8_t kind = byte();
    if ((kind & 7U) != 7) return low + (high - low) * static_cast<double>(byte() + 256U * byte()) / 65535.0;
    using Limits = std::numeric_limits<double>;
    static constexpr double special[] = {0.0,
                                         -0.0,
                                         1.0,
                                         -1.0,
                                         1e-30,
                                         1e30,
                                         1e300,
                                         -1e300,
                                         Limits::denorm_min(),
                                         (Limits::min)(),
                                         (Limits::max)(),
                                         Limits::infinity(),
                                         -Limits::infinity(),
                                         Limits::quiet_NaN(),
                                         1e-300,
                                         -1e-9};
    if ((kind & 128U) == 0) return special[(kind >> 3U) & 15U];
    double any;
    std::uint8_t bytes[sizeof(any)];
    for (std::uint8_t& b : bytes) b = byte();
    std::memcpy(&any, bytes, sizeof(any));
    return any;
  }
  template <typename Scalar>
  std::vector<Scalar> numbers(std::size_t n, double low, double high) {
    std::vector<Scalar> all(n);
    for (Scalar& x : all) x = to<Scalar>(number(low, high));
    return all;
  }
  /// The type's own infinity where a double does not fit: the conversion is undefined there.
  template <typename Scalar>
  static Scalar to(double x) {
    const auto most = static_cast<double>((std::numeric_limits<Scalar>::max)());
    if (x > most) return std::numeric_limits<Scalar>::infinity();
    if (x < -most) return -std::numeric_limits<Scalar>::infinity();
    return static_cast<Scalar>(x);
  }
  [[nodiscard]] const std::uint8_t* rest() const { return data_; }
  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
};

/// Other values for some of the options' fields, hostile ones among them, as far as validation lets them pass.
template <typename Options>
void disturb(FuzzInput& in, Options& options, std::initializer_list<double*> fields) {
  for (double* field : fields) {
    if (in.byte() >= 40) continue;
    const double before = *field;
    *field = in.number(0, 2);
    if (invalid_field(options)) *field = before;
  }
}

template <typename Scalar>
[[nodiscard]] bool is_probability(Scalar p) {
  return p >= Scalar(0) && p <= Scalar(1);
}

/// Bit for bit, NaN included.
template <typename T>
[[nodiscard]] bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

}  // namespace cfp_fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
