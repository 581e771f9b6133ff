#include "cfp/core/random.hpp"

#include <array>
#include <vector>

#include "support/allocation_counter.hpp"
#include "support/catch.hpp"

TEST_CASE("Random gives SplitMix64's published sequence", "[core]") {
  // First outputs of the reference implementation for seed 1234567.
  cfp::Random random(1234567);
  CHECK(random() == 6457827717110365317ULL);
  CHECK(random() == 3203168211198807973ULL);
  CHECK(random() == 9817491932198370423ULL);
}

TEST_CASE("Random says that every number of 64 bits may come", "[core]") {
  CHECK((cfp::Random::min)() == 0);
  CHECK((cfp::Random::max)() == 0xffffffffffffffffULL);
}

TEST_CASE("Random stays in range and has the stated moments", "[core]") {
  cfp::Random random(1, "moments");
  constexpr int n = 100000;
  double mean = 0, normal_mean = 0, normal_square = 0;
  std::array<int, 7> counts{};
  for (int i = 0; i < n; ++i) {
    const double u = random.uniform();
    REQUIRE((u >= 0 && u < 1));
    mean += u / n;
    const double z = random.normal();
    normal_mean += z / n;
    normal_square += z * z / n;
    ++counts[random.index(7)];
  }
  CHECK_THAT(mean, WithinAbs(0.5, 0.005));
  CHECK_THAT(normal_mean, WithinAbs(0.0, 0.015));
  CHECK_THAT(normal_square, WithinAbs(1.0, 0.03));
  for (const int count : counts) CHECK_THAT(count / (n / 7.0), WithinAbs(1.0, 0.05));
}

TEST_CASE("Streams of one seed differ by name and repeat by name", "[core]") {
  cfp::Random a(5, "left"), b(5, "right"), again(5, "left");
  CHECK(a() != b());
  cfp::Random left(5, "left");
  CHECK(left() == again());
}

TEST_CASE("The allocation counter sees vectors and Eigen storage", "[core]") {
  CHECK(cfp_test::allocations_in([] {
          std::vector<int> v(100, 1);
          volatile int keep = v[5];
          (void)keep;
        }) >= 1);
  CHECK(cfp_test::allocations_in([] {
          cfp::Random random(3);
          volatile double keep = random.normal();
          (void)keep;
        }) == 0);
}
