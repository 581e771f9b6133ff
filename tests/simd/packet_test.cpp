#include "cfp/simd/packet.hpp"

#include <cmath>
#include <limits>
#include <vector>

#include "cfp/core/random.hpp"
#include "support/catch.hpp"

namespace {

using cfp::simd::Packet;

/// Applies a generic lambda to whole packets and to single lanes, and checks that they agree to `ulps` roundings.
template <typename T, typename Operation>
void check_lanes(Operation operation, T low, T high, T ulps) {
  constexpr int lanes = cfp::simd::lanes_of<Packet<T>>;
  cfp::Random random(11, "packet");
  for (int round = 0; round < 200; ++round) {
    T a[lanes], b[lanes], c[lanes], result[lanes];
    for (int i = 0; i < lanes; ++i) {
      a[i] = static_cast<T>(random.uniform(low, high));
      b[i] = static_cast<T>(random.uniform(low, high));
      c[i] = static_cast<T>(random.uniform(low, high));
    }
    cfp::simd::store(
        result, operation(cfp::simd::load<Packet<T>>(a), cfp::simd::load<Packet<T>>(b), cfp::simd::load<Packet<T>>(c)));
    for (int i = 0; i < lanes; ++i) {
      const T expected = operation(a[i], b[i], c[i]);
      const T scale = std::abs(expected) + (ulps > 0 ? std::abs(a[i] * b[i]) : T(0));
      REQUIRE(std::abs(result[i] - expected) <= ulps * std::numeric_limits<T>::epsilon() * scale);
    }
  }
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
  check_lanes<T>([](auto a, auto, auto) { return cfp::simd::reciprocal(a); }, T(1), T(9), T(0));
  check_lanes<T>([](auto a, auto, auto) { return cfp::simd::reciprocal_sqrt(a); }, T(0.1), T(9), T(3));
  check_lanes<T>([](auto a, auto b, auto c) { return cfp::simd::multiply_add(a, b, c); }, T(-9), T(9), T(1));
  check_lanes<T>([](auto a, auto b, auto c) { return cfp::simd::select(a < b, b, c); }, T(-9), T(9), T(0));
  check_lanes<T>([](auto a, auto b, auto c) { return cfp::simd::select(cfp::simd::both(a <= b, b > c), a, c); }, T(-9),
                 T(9), T(0));
}

TEMPLATE_TEST_CASE("Packet: a comparison with NaN is false, and select drops the branch not taken", "[core]", float,
                   double) {
  using T = TestType;
  using P = Packet<T>;
  constexpr int lanes = cfp::simd::lanes_of<P>;
  const P nan(std::numeric_limits<T>::quiet_NaN());
  for (const P& chosen :
       {cfp::simd::select(nan < P(T(1)), nan, P(T(5))), cfp::simd::select(nan > P(T(1)), nan, P(T(5))),
        cfp::simd::select(P(T(0)) <= P(T(0)), P(T(5)), nan)}) {
    T out[lanes];
    cfp::simd::store(out, chosen);
    for (const T x : out) CHECK(x == T(5));
  }
}

TEMPLATE_TEST_CASE("Packet: the sum adds all lanes", "[core]", float, double) {
  using T = TestType;
  using P = Packet<T>;
  T numbers[cfp::simd::lanes_of<P>], expected = 0;
  for (T& x : numbers) x = expected + T(1), expected += x;
  CHECK(cfp::simd::reduce_add(cfp::simd::load<P>(numbers)) == expected);
  CHECK(cfp::simd::reduce_add(P(T(2))) == T(2) * cfp::simd::lanes_of<P>);
}
