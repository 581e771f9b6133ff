#include "cfp/evaluation/alignment.hpp"

#include <array>
#include <limits>
#include <vector>

#include <Eigen/LU>

#include "cfp/core/span.hpp"
#include "support/allocation_counter.hpp"
#include "support/catch.hpp"
#include "support/trajectories.hpp"

namespace {

template <typename Scalar>
using Points = std::vector<cfp::Vector3<Scalar>>;

template <typename Scalar>
cfp::AlignmentResult align(const Points<Scalar>& from, const Points<Scalar>& to, bool with_scale) {
  return cfp::align_points(from, to, with_scale);
}

double cost(const cfp::Similarity& S, const Points<double>& from, const Points<double>& to) {
  double sum = 0;
  for (std::size_t i = 0; i < from.size(); ++i) sum += (to[i] - S * from[i]).squaredNorm();
  return sum;
}

bool is_proper_rotation(const cfp::Matrix3<double>& R) {
  return (R * R.transpose() - cfp::Matrix3<double>::Identity()).norm() < 1e-12 && R.determinant() > 0;
}

}  // namespace

TEMPLATE_TEST_CASE("Alignment recovers the motion and scale that made the points", "[evaluation]", float, double) {
  cfp::Random random(21, "recover");
  const double tolerance = std::is_same_v<TestType, float> ? 2e-5 : 1e-12;
  for (const bool with_scale : {false, true}) {
    const double s = with_scale ? 2.5 : 1;
    const cfp::Matrix3<double> R = cfp::so3_exp<double>(cfp_test::random_vector(random, 2));
    const cfp::Vector3<double> t = cfp_test::random_vector(random, 3);
    Points<TestType> from, to;
    for (int i = 0; i < 50; ++i) {
      const cfp::Vector3<double> p = cfp_test::random_vector(random, 1);
      from.push_back(p.cast<TestType>());
      to.push_back((s * (R * p) + t).cast<TestType>());
    }
    const auto result = align(from, to, with_scale);
    CHECK(result.status == cfp::Status::ok);
    CHECK(result.used == 50);
    CHECK_THAT((result.S_to_from.rotation - R).norm(), WithinAbs(0, tolerance));
    CHECK_THAT((result.S_to_from.translation - t).norm(), WithinAbs(0, tolerance));
    CHECK_THAT(result.S_to_from.scale, WithinAbs(s, tolerance));
  }
}

TEST_CASE("No small change of the aligned motion lowers the cost, noise and reflections included", "[evaluation]") {
  cfp::Random random(22, "optimal");
  for (int round = 0; round < 60; ++round) {
    const bool with_scale = round % 2 == 0;
    Points<double> from, to;
    for (int i = 0; i < 12; ++i) {
      const cfp::Vector3<double> p = cfp_test::random_vector(random, 1);
      from.push_back(p);
      // Every third round mirrors the points: the best orthogonal matrix would be improper, the best rotation is not.
      const cfp::Vector3<double> q = round % 3 == 0 ? cfp::Vector3<double>(-p.x(), p.y(), p.z()) : p;
      to.push_back(1.5 * q + cfp_test::random_vector(random, 0.3));
    }
    const auto S = align(from, to, with_scale).S_to_from;
    REQUIRE(is_proper_rotation(S.rotation));
    const double best = cost(S, from, to);
    for (int step = 0; step < 30; ++step) {
      cfp::Similarity other = S;
      other.rotation = cfp::so3_exp<double>(cfp_test::random_vector(random, 1e-2)) * S.rotation;
      other.translation += cfp_test::random_vector(random, 1e-2);
      if (with_scale) other.scale *= 1 + random.uniform(-1e-2, 1e-2);
      REQUIRE(cost(other, from, to) >= best - 1e-12);
    }
  }
}

TEST_CASE("Points far from the origin are aligned as well as their coordinates tell", "[evaluation]") {
  cfp::Random random(23, "far");
  const cfp::Matrix3<double> R = cfp::so3_exp<double>(cfp_test::random_vector(random, 2));
  for (const double far : {1e3, 1e6, 1e8}) {
    const cfp::Vector3<double> from_offset = far * cfp::Vector3<double>(1, 2, -1), to_offset(2 * far, far, -far);
    Points<double> from, to;
    for (int i = 0; i < 500; ++i) {
      const cfp::Vector3<double> p = cfp_test::random_vector(random, 1);
      from.push_back(p + from_offset), to.push_back(R * p + to_offset);
    }
    for (const bool with_scale : {false, true}) {
      const auto result = align(from, to, with_scale);
      CAPTURE(far, with_scale);
      CHECK(result.status == cfp::Status::ok);
      CHECK((result.S_to_from.rotation - R).norm() < 1e-15 * far + 1e-13);
      CHECK_THAT(result.S_to_from.scale, WithinAbs(1, 1e-15 * far + 1e-13));
      CHECK((result.S_to_from * from_offset - to_offset).norm() < 1e-13 * far + 1);
    }
  }
}

TEST_CASE("Points that do not fix the rotation give a proper minimiser and the status degenerate", "[evaluation]") {
  const Points<double> one{{1, 2, 3}}, two{{0, 0, 0}, {1, 0, 0}}, line{{0, 0, 0}, {1, 1, 1}, {3, 3, 3}},
      same{{1, 1, 1}, {1, 1, 1}, {1, 1, 1}};
  for (const auto& points : {one, two, line, same}) {
    Points<double> to;
    for (const auto& p : points) to.emplace_back(-p.y() + 5, p.x(), p.z());
    for (const bool with_scale : {false, true}) {
      const auto result = align(points, to, with_scale);
      CHECK(result.status == cfp::Status::degenerate);
      CHECK(is_proper_rotation(result.S_to_from.rotation));
      CHECK_THAT(cost(result.S_to_from, points, to), WithinAbs(0, 1e-20));
      CHECK(result.S_to_from.scale > 0);
    }
  }
  CHECK(align<double>({}, {}, true).status == cfp::Status::not_enough_data);
}

TEMPLATE_TEST_CASE("Hostile points are skipped or scaled away, and the result is finite", "[evaluation]", float,
                   double) {
  constexpr TestType nan = std::numeric_limits<TestType>::quiet_NaN(), inf = std::numeric_limits<TestType>::infinity();
  constexpr TestType huge = (std::numeric_limits<TestType>::max)(), tiny = std::numeric_limits<TestType>::denorm_min();
  for (const TestType size : {huge, tiny, TestType(1)}) {
    const Points<TestType> from{{size, 0, 0}, {0, size, 0}, {0, 0, size}, {-size, 0, 0}, {nan, 0, 0}, {1, 1, 1}};
    const Points<TestType> to{{0, size, 0}, {-size, 0, 0}, {0, 0, size}, {0, -size, 0}, {0, 0, 0}, {inf, 0, 0}};
    for (const bool with_scale : {false, true}) {
      const auto result = align(from, to, with_scale);
      CHECK(result.used == 4);
      CHECK(is_proper_rotation(result.S_to_from.rotation));
      CHECK(result.S_to_from.translation.allFinite());
      CHECK((result.S_to_from.scale > 0 && cfp::is_finite(result.S_to_from.scale)));
    }
  }
  const Points<TestType> zero(3, cfp::Vector3<TestType>::Zero());
  CHECK(align(zero, zero, true).S_to_from.scale == 1);
}

TEST_CASE("Alignment reads strided points and allocates nothing", "[evaluation]") {
  struct Record {
    double x, y, z;
    int label;
  };
  const std::array<Record, 3> from{{{0, 0, 0, 1}, {1, 0, 0, 2}, {0, 1, 0, 3}}};
  const Points<double> to{{1, 0, 0}, {1, 1, 0}, {0, 0, 0}};
  cfp::AlignmentResult result;
  const auto work = [&] {
    result = cfp::align_points(cfp::PointSpan<double, 3>(&from[0].x, from.size(), sizeof(Record)), to);
  };
  CHECK(cfp_test::allocations_in(work) == 0);
  CHECK_THAT((result.S_to_from * cfp::Vector3<double>(1, 0, 0) - to[1]).norm(), WithinAbs(0, 1e-12));
}

TEST_CASE("Points that all coincide, anywhere, tell neither rotation nor scale", "[evaluation]") {
  cfp::Random random(31, "coincide");
  const auto any = [&] {
    return cfp::Vector3<double>(random.uniform(-9, 9), random.uniform(-9, 9), random.uniform(-9, 9));
  };
  for (int round = 0; round < 300; ++round) {
    const Points<double> still(2 + random.index(30), any());
    Points<double> moving;
    for (std::size_t i = 0; i < still.size(); ++i) moving.push_back(any());
    for (const bool frozen_estimate : {true, false}) {
      const auto result = frozen_estimate ? align(still, moving, true) : align(moving, still, true);
      CHECK(result.status == cfp::Status::degenerate);
      CHECK(result.S_to_from.scale == 1);
    }
  }
}

TEST_CASE("An octahedron and its mirror image fix no rotation", "[evaluation]") {
  Points<double> from, to;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) from.push_back(side * cfp::Vector3<double>::Unit(axis));
  }
  for (const auto& p : from) to.push_back(-p);
  CHECK(align(from, to, false).status == cfp::Status::degenerate);
}

TEST_CASE("Mirror-symmetric points that are turned about one axis are aligned exactly", "[evaluation]") {
  cfp::Random random(32, "symmetric");
  for (int round = 0; round < 500; ++round) {
    Points<double> from, to;
    for (int i = 0; i < 4; ++i) {
      const double x = random.uniform(-3, 3), y = random.uniform(0.2, 3), z = random.uniform(-3, 3);
      for (const double side : {-1.0, 1.0}) from.emplace_back(x, side * y, z);
    }
    const auto R = cfp::so3_exp(cfp::Vector3<double>(0, random.uniform(-3, 3), 0));
    for (const auto& p : from) to.push_back(R * p);
    const auto result = align(from, to, false);
    CHECK(result.status == cfp::Status::ok);
    CHECK((result.S_to_from.rotation - R).norm() < 1e-12);
  }
}
