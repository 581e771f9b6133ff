#include "cfp/simd/packet.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"

namespace {

using cfp::simd::Packet;

/// Checks that an operation of packets does in every lane what `expected` does with numbers, to `ulps` roundings.
template <typename T, typename Operation, typename Expected>
void check_lanes(Operation operation, Expected expected_of, T low, T high, T ulps) {
  constexpr int lanes = static_cast<int>(Packet<T>::lanes);
  cfp::Random random(11, "packet");
  for (int round = 0; round < 200; ++round) {
    T a[lanes], b[lanes], c[lanes], result[lanes];
    for (int i = 0; i < lanes; ++i) {
      a[i] = static_cast<T>(random.uniform(low, high));
      b[i] = static_cast<T>(random.uniform(low, high));
      c[i] = static_cast<T>(random.uniform(low, high));
    }
    operation(Packet<T>::load(a), Packet<T>::load(b), Packet<T>::load(c)).store(result);
    for (int i = 0; i < lanes; ++i) {
      const T expected = expected_of(a[i], b[i], c[i]);
      const T scale = std::abs(expected) + (ulps > 0 ? std::abs(a[i] * b[i]) : T(0));
      REQUIRE(std::abs(result[i] - expected) <= ulps * std::numeric_limits<T>::epsilon() * scale);
    }
  }
}

/// The same for a generic lambda that takes packets and numbers.
template <typename T, typename Operation>
void check_lanes(Operation operation, T low, T high, T ulps) {
  check_lanes<T>(operation, operation, low, high, ulps);
}

}  // namespace

TEMPLATE_TEST_CASE("Packet: every operation equals the scalar one in every lane", "[core]", float, double) {
  using T = TestType;
  using std::abs;
  using std::log1p;
  check_lanes<T>([](auto a, auto b, auto) { return a + b; }, T(-9), T(9), T(0));
  check_lanes<T>([](auto a, auto b, auto) { return a - b; }, T(-9), T(9), T(0));
  check_lanes<T>([](auto a, auto b, auto) { return a * b; }, T(-9), T(9), T(0));
  check_lanes<T>([](auto a, auto b, auto) { return a / b; }, T(1), T(9), T(0));
  check_lanes<T>([](auto a, auto, auto) { return abs(a); }, T(-9), T(9), T(0));
  check_lanes<T>([](auto a, auto, auto) { return log1p(a); }, T(0), T(9), T(1));
  check_lanes<T>([](auto a, auto, auto) { return cfp::simd::reciprocal_sqrt(a); }, T(0.1), T(9), T(3));
  check_lanes<T>([](auto a, auto b, auto c) { return multiply_add(a, b, c); }, [](T a, T b, T c) { return a * b + c; },
                 T(-9), T(9), T(1));
  check_lanes<T>([](auto a, auto b, auto c) { return cfp::simd::select(a < b, b, c); }, T(-9), T(9), T(0));
  check_lanes<T>([](auto a, auto b, auto c) { return cfp::simd::select(both(a <= b, b > c), a, c); },
                 [](T a, T b, T c) { return a <= b && b > c ? a : c; }, T(-9), T(9), T(0));
}

TEMPLATE_TEST_CASE("Packet: a comparison with NaN is false, and select drops the branch not taken", "[core]", float,
                   double) {
  using T = TestType;
  using P = Packet<T>;
  constexpr std::size_t lanes = P::lanes;
  const P nan(std::numeric_limits<T>::quiet_NaN());
  for (const P& chosen :
       {cfp::simd::select(nan < P(T(1)), nan, P(T(5))), cfp::simd::select(nan > P(T(1)), nan, P(T(5))),
        cfp::simd::select(P(T(0)) <= P(T(0)), P(T(5)), nan)}) {
    T out[lanes];
    chosen.store(out);
    for (const T x : out) CHECK(x == T(5));
  }
}

TEMPLATE_TEST_CASE("Packet: the sum adds all lanes", "[core]", float, double) {
  using T = TestType;
  using P = Packet<T>;
  T numbers[P::lanes], expected = 0;
  for (T& x : numbers) x = expected + T(1), expected += x;
  CHECK(reduce_add(P::load(numbers)) == expected);
  CHECK(reduce_add(P(T(2))) == T(2) * T(P::lanes));
}
