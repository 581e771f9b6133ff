// One program of units compiled with different vector flags, run on the same inputs: results differ by rounding only,
// and those of the baseline unit are the bits it gives in a program without the others. CFP_OTHERS: the other units,
// each as X(flags); not defined in the program without.
//   cfp_build_baseline_alone FILE   writes the baseline's results;   cfp_build_mixed FILE   compares.
#include <cmath>
#include <cstdio>
#include <string>

#include "instruction_sets.hpp"

using cfp_isa_test::AllInputs;
using cfp_isa_test::Inputs;
using cfp_isa_test::Result;

std::vector<Result> baseline(const AllInputs&);
#ifdef CFP_OTHERS
#define X(flags) std::vector<Result> flags(const AllInputs&);
CFP_OTHERS
#undef X
#endif

namespace {

template <typename Scalar>
Inputs<Scalar> make_inputs() {
  Inputs<Scalar> in;
  cfp::Random random(5, "instruction sets");
  for (std::size_t i = 0; i < 1003; ++i) {  // a partial chunk at the end
    const double u = random.uniform(0, 640), v = random.uniform(0, 480);
    in.previous.push_back({Scalar(u), Scalar(v)});
    in.current.push_back({Scalar(u + 20 * random.normal()), Scalar(v + 20 * random.normal())});
    in.depth.push_back(random.uniform() < 0.1 ? Scalar(0) : Scalar(random.uniform(0.6, 6)));
    in.drawn.push_back(Scalar(std::abs(random.normal())));
    in.two_depths.push_back(Scalar(random.uniform() < 0.5 ? 2 + 0.12 * random.normal() : 3.5 + 0.05 * random.normal()));
  }
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    cfp_test::PoseSceneOptions options;
    options.points = 40 + 7 * static_cast<int>(seed);
    options.outlier_share = 0.1 * static_cast<double>(seed % 4);
    options.stereo_share = 0.5 * static_cast<double>(seed % 3);
    options.octaves = seed % 2 == 0;
    in.poses.push_back(cfp_test::make_pose_scene<Scalar>(seed, options));
  }
  cfp_test::TwoViewOptions views;
  views.noise_px = 0.5;
  views.outlier_share = 0.3;
  in.views = cfp_test::make_two_view_scene<Scalar>(random, views);
  for (std::uint64_t seed = 1; seed <= 3; ++seed)
    in.frames.push_back(cfp_test::make_dynamic_scene<Scalar>(cfp_test::DynamicSceneOptions{}, seed));
  return in;
}

AllInputs make_all_inputs() {
  cfp::Random random(6, "instruction sets");
  cfp_test::AbsolutePoseOptions map;
  map.outlier_share = 0.3;
  const cfp::PinholeCamera<double> camera{535.4, 539.2, 320.1, 247.6};
  AllInputs in{
      make_inputs<float>(), make_inputs<double>(), cfp_test::make_absolute_pose_scene<double>(random, camera, map), {}};
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    cfp_test::BaSceneOptions options;
    options.points = 200;
    options.stereo_share = 0.3;
    in.bundles.push_back(cfp_test::make_ba_scene(options, seed));
  }
  return in;
}

[[maybe_unused]] int write(const std::vector<Result>& results, const char* path) {
  std::FILE* file = std::fopen(path, "w");
  if (file == nullptr) return 1;
  for (const Result& r : results) std::fprintf(file, "%a\n", r.value);
  return std::fclose(file);
}

[[maybe_unused]] std::vector<double> read(const char* path) {
  std::vector<double> values;
  std::FILE* file = std::fopen(path, "r");
  if (file == nullptr) return values;
  for (double value = 0; std::fscanf(file, "%la", &value) == 1;) values.push_back(value);
  std::fclose(file);
  return values;
}

/// True if all results are within their tolerances, or within `at_most` where that is less; names the first
/// differences.
[[maybe_unused]] bool agree(const char* unit, const std::vector<Result>& results, const std::vector<double>& expected,
                            double at_most) {
  std::size_t different = results.size() == expected.size() ? 0 : 1;
  for (std::size_t i = 0; i < results.size() && i < expected.size(); ++i) {
    if (std::abs(results[i].value - expected[i]) <= (std::min)(results[i].tolerance, at_most)) continue;
    if (++different <= 10) std::printf("  %s: %.17g, expected %.17g\n", results[i].what, results[i].value, expected[i]);
  }
  std::printf("%s: %zu results of %zu, %zu differences\n", unit, results.size(), expected.size(), different);
  return different == 0 && !results.empty();
}

[[maybe_unused]] bool machine_has(const std::string& flags) {
  if (flags == "avx2") return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (flags == "avx512")
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
           __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl");
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const AllInputs in = make_all_inputs();
  const std::vector<Result> base = baseline(in);
#ifdef CFP_OTHERS
  std::vector<double> values;
  for (const Result& r : base) values.push_back(r.value);
  bool good = agree("baseline beside the others", base, read(argv[1]), 0);
#define X(flags) \
  if (machine_has(#flags)) good = agree(#flags, flags(in), values, 1) && good;
  CFP_OTHERS
#undef X
  // Last, so that a unit's leavings would be seen.
  good = agree("baseline after the others", baseline(in), values, 0) && good;
  return good ? 0 : 1;
#else
  return write(base, argv[1]);
#endif
}
