// How complete, exact and fast is P3P? Per kind of problem: the share whose true pose is among the solutions (to 1e-4
// and to 1e-6, |R - R'| + |t - t'|, m), the number of solutions, the share without any, the share of solutions that do
// not fit (a ray misses its point by more than 1e-6 rad, the point lies behind the camera, or the rotation is none by
// more than 1e-6), and the median time of a call, all methods in turns. Beside it PoseLib's and OpenGV's solvers where
// found.
//   random              three points 0.5 to 5 m away in a field of view of 62 x 48 degrees
//   triangle 10 .. 1 cm a small triangle 1 to 6 m away
//   thin 1e-2, 1e-3     a triangle whose height is that share of one edge
//   edge-on             the camera stands in the triangle's plane
//   danger cylinder     the camera above the circle through the points: two solutions meet, rounding may part them
//   cfp_p3p_study [problems per kind, default 1000000 | --smoke]
// Fails unless the true pose is found in 99.9 % (danger cylinder: 95 %) of the problems to 1e-6 and every solution
// fits.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "../../tests/support/two_view_scene.hpp"
#include "../support/interleaved.hpp"
#include "cfp/geometry/p3p.hpp"

#ifdef CFP_HAVE_OPENGV
#include <opengv/absolute_pose/modules/main.hpp>
#endif
#ifdef CFP_HAVE_POSELIB
#include <PoseLib/solvers/p3p.h>
#include <PoseLib/solvers/p3p_lambdatwist.h>
#endif

namespace {

using Vector = cfp::Vector3<double>;
using Points = std::array<Vector, 3>;

struct Problem : cfp::P3PProblem<double> {
  cfp::SE3<double> truth;
  std::vector<Vector> points, unit_rays;  // the same, as PoseLib wants them
};

using Poses = std::vector<cfp::SE3<double>>;

struct Method {
  std::string name;
  std::function<void(const Problem&, Poses&)> solve;
  std::vector<double> times_us = {};
  std::size_t close = 0, exact = 0, solutions = 0, none = 0, wrong = 0;
};

Vector random_ray(cfp::Random& random) { return {random.uniform(-0.6, 0.6), random.uniform(-0.45, 0.45), 1}; }

Points random_points(cfp::Random& random) {
  Points points;
  for (Vector& x : points) x = random.uniform(0.5, 5) * random_ray(random);
  return points;
}

Points small_triangle(cfp::Random& random, double edge_m) {
  const Vector centre = random.uniform(1, 6) * random_ray(random);
  Points points;
  for (Vector& x : points) x = centre + edge_m / std::sqrt(3.0) * cfp_test::random_direction(random);
  return points;
}

Points thin_triangle(cfp::Random& random, double height) {
  Points points = random_points(random);
  const Vector edge = points[1] - points[0];
  Vector side = cfp_test::random_direction(random);
  side -= side.dot(edge) / edge.squaredNorm() * edge;
  points[2] = points[0] + random.uniform(0.1, 0.9) * edge + height * edge.norm() * side.normalized();
  return points;
}

Points edge_on(cfp::Random& random) {
  const Vector a = random_ray(random), b = random_ray(random);
  return {random.uniform(0.5, 5) * a, random.uniform(0.5, 5) * b,
          random.uniform(0.5, 5) * (a + random.uniform(-0.5, 1.5) * (b - a))};
}

Points danger_cylinder(cfp::Random& random) {
  const double radius = random.uniform(0.2, 2), phi = random.uniform(0, 2 * cfp::pi<double>);
  const Vector camera(radius * std::cos(phi), radius * std::sin(phi), random.uniform(0.5, 5));
  Points points;
  double shortest = 0;
  while (shortest < 0.1 * radius) {
    for (Vector& x : points) {
      const double angle = random.uniform(0, 2 * cfp::pi<double>);
      x = Vector(radius * std::cos(angle), radius * std::sin(angle), 0);
    }
    shortest =
        (std::min)({(points[0] - points[1]).norm(), (points[0] - points[2]).norm(), (points[1] - points[2]).norm()});
  }
  // The camera looks at the centre of the points.
  cfp::Matrix3<double> R;
  const Vector z = ((points[0] + points[1] + points[2]) / 3 - camera).normalized();
  const Vector side = cfp::cross(cfp_test::random_direction(random), z);
  R.row(0) = side.normalized();
  R.row(2) = z;
  R.row(1) = cfp::cross(z, Vector(R.row(0)));
  for (Vector& x : points) x = R * (x - camera);
  return points;
}

Problem make_problem(cfp::Random& random, const std::function<Points(cfp::Random&)>& draw) {
  Points points = draw(random);
  while ((std::min)({points[0].z(), points[1].z(), points[2].z()}) < 0.05) points = draw(random);
  Problem problem;
  problem.truth.rotation = cfp::so3_exp<double>(random.uniform(0, 3.1) * cfp_test::random_direction(random));
  problem.truth.translation = random.uniform(0, 3) * cfp_test::random_direction(random);
  for (std::size_t i = 0; i < 3; ++i) {
    problem.rays[i] = points[i] / points[i].z();
    problem.world[i] = problem.truth.inverse() * points[i];
    problem.points.push_back(problem.world[i]);
    problem.unit_rays.push_back(problem.rays[i].normalized());
  }
  return problem;
}

double misfit(const Problem& problem, const cfp::SE3<double>& T) {
  double worst = (T.rotation * T.rotation.transpose() - cfp::Matrix3<double>::Identity()).norm();
  for (std::size_t i = 0; i < 3; ++i)
    worst = (std::max)(worst, ((T * problem.world[i]).normalized() - problem.rays[i].normalized()).norm());
  return std::isfinite(worst) ? worst : 1;
}

void judge(Method& method, const Problem& problem, const Poses& poses) {
  double best = 1;
  for (const cfp::SE3<double>& T : poses) {
    method.wrong += misfit(problem, T) <= 1e-6 ? 0 : 1;
    best = (std::min)(
        best, (T.rotation - problem.truth.rotation).norm() + (T.translation - problem.truth.translation).norm());
  }
  method.solutions += poses.size();
  method.none += poses.empty() ? 1 : 0;
  method.close += best < 1e-4 ? 1 : 0;
  method.exact += best < 1e-6 ? 1 : 0;
}

std::vector<Method> make_methods() {
  std::vector<Method> methods;
  methods.push_back({"cfp", [](const Problem& problem, Poses& poses) {
                       const cfp::P3PSolutions<double> solutions = cfp::p3p(problem);
                       for (int k = 0; k < solutions.count; ++k)
                         poses.push_back(solutions.T_cam_world[static_cast<std::size_t>(k)]);
                     }});
#ifdef CFP_HAVE_POSELIB
  const auto poselib = [&methods](const char* name, auto solver) {
    methods.push_back(
        {name, [solver, found = std::vector<poselib::CameraPose>()](const Problem& problem, Poses& poses) mutable {
           solver(problem.unit_rays, problem.points, &found);
           for (const auto& pose : found) poses.push_back({pose.R(), pose.t});
         }});
  };
  poselib("PoseLib", poselib::p3p);
  poselib("Lambda Twist", poselib::p3p_lambdatwist);
#endif
#ifdef CFP_HAVE_OPENGV
  const auto opengv = [&methods](const char* name, auto solver) {
    methods.push_back({name, [solver](const Problem& problem, Poses& poses) {
                         opengv::bearingVectors_t rays;
                         opengv::points_t world;
                         opengv::transformations_t found;
                         for (std::size_t i = 0; i < 3; ++i) {
                           rays.push_back(problem.rays[i].normalized());
                           world.push_back(problem.world[i]);
                         }
                         solver(rays, world, found);
                         for (const auto& M : found)
                           poses.push_back(cfp::SE3<double>{M.leftCols<3>(), M.col(3)}.inverse());
                       }});
  };
  opengv("OpenGV Kneip", opengv::absolute_pose::modules::p3p_kneip_main);
  opengv("OpenGV Gao", opengv::absolute_pose::modules::p3p_gao_main);
#endif
  return methods;
}

}  // namespace

int main(int argc, char** argv) {
  const bool smoke = argc > 1 && std::strcmp(argv[1], "--smoke") == 0;
  const int problems = smoke ? 4000 : argc > 1 ? std::atoi(argv[1]) : 1000000;
  if (problems < 1) {
    std::fprintf(stderr, "usage: cfp_p3p_study [problems per kind >= 1 | --smoke]\n");
    return 2;
  }
  struct Kind {
    const char* name;
    std::function<Points(cfp::Random&)> draw;
    double required_share;
  };
  std::vector<Kind> kinds = {{"random", random_points, 0.999}};
  static constexpr std::array<double, 4> edges_m = {0.1, 0.05, 0.03, 0.01};
  static constexpr std::array<const char*, 4> edge_names = {"triangle 10 cm", "triangle 5 cm", "triangle 3 cm",
                                                            "triangle 1 cm"};
  for (std::size_t i = 0; i < edges_m.size(); ++i)
    kinds.push_back({edge_names[i], [i](cfp::Random& r) { return small_triangle(r, edges_m[i]); }, 0.999});
  kinds.push_back({"thin 1e-2", [](cfp::Random& r) { return thin_triangle(r, 1e-2); }, 0.999});
  kinds.push_back({"thin 1e-3", [](cfp::Random& r) { return thin_triangle(r, 1e-3); }, 0.999});
  kinds.push_back({"edge-on", edge_on, 0.999});
  kinds.push_back({"danger cylinder", danger_cylinder, 0.95});

  bool good = true;
  constexpr int per_batch = 100;  // calls per reading of the clock
  std::printf("%-16s %-13s %8s %8s %9s %7s %9s %9s\n", "problem", "method", "1e-4 %", "1e-6 %", "solutions", "none %",
              "misfit %", "median us");
  for (const Kind& kind : kinds) {
    cfp::Random random(12, "p3p_study");
    std::vector<Method> methods = make_methods();
    std::vector<Poses> answers(per_batch);
    for (int done = 0; done < problems; done += per_batch) {
      std::vector<Problem> batch;
      while (batch.size() < per_batch) batch.push_back(make_problem(random, kind.draw));
      for (Method& method : methods) {
        for (Poses& poses : answers) poses.clear(), poses.reserve(20);
        const auto start = std::chrono::steady_clock::now();
        for (std::size_t k = 0; k < per_batch; ++k) method.solve(batch[k], answers[k]);
        method.times_us.push_back(
            std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count() / per_batch);
        for (std::size_t k = 0; k < per_batch; ++k) judge(method, batch[k], answers[k]);
      }
    }
    const double tried = static_cast<double>(methods[0].times_us.size() * per_batch);
    for (Method& m : methods) {
      std::printf("%-16s %-13s %8.3f %8.3f %9.3f %7.3f %9.4f %9.3f\n", kind.name, m.name.c_str(),
                  100 * static_cast<double>(m.close) / tried, 100 * static_cast<double>(m.exact) / tried,
                  static_cast<double>(m.solutions) / tried, 100 * static_cast<double>(m.none) / tried,
                  100 * static_cast<double>(m.wrong) / static_cast<double>((std::max)(m.solutions, std::size_t(1))),
                  cfp_benchmark::median(m.times_us));
    }
    good = good && static_cast<double>(methods[0].exact) >= kind.required_share * tried && methods[0].wrong == 0;
    std::fflush(stdout);
  }
  return good ? 0 : 1;
}
