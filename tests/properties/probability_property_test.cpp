// Invariants of the probability formulas, for any input that RapidCheck finds.
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "cfp/core/random.hpp"
#include "cfp/probability/distance_sigmoid.hpp"
#include "cfp/probability/first_stage_probability.hpp"
#include "cfp/probability/map_point.hpp"
#include "cfp/probability/object.hpp"
#include "cfp/probability/second_stage_probability.hpp"
#include "support/catch.hpp"
#include "support/generators.hpp"

using cfp_test::any_double;
using cfp_test::distances;
using cfp_test::probability;

namespace {

double object(const std::vector<double>& d, const cfp::ObjectProbabilityOptions& options) {
  std::vector<double> scratch(d.size());
  return cfp::object_probability(d, options, scratch).static_probability;
}

cfp::ConstraintModel<double> fit(const std::vector<double>& d) {
  std::vector<double> scratch(d.size());
  return cfp::fit_constraint(d, {}, scratch);
}

cfp::ObjectProbabilityOptions from_one_pair() {
  cfp::ObjectProbabilityOptions options;
  options.min_pairs = 1;
  return options;
}

}  // namespace

TEST_CASE("Properties of the object probability", "[properties]") {
  rc::prop("O is in [0, 1] for any distances", [] {
    const auto d = *rc::gen::container<std::vector<double>>(any_double());
    const double o = object(d, from_one_pair());
    RC_ASSERT(o >= 0 && o <= 1);
  });
  rc::prop("O does not depend on the order of the pairs", [] {
    auto d = *distances(1);
    const double before = object(d, from_one_pair());
    cfp::Random random(*rc::gen::arbitrary<std::uint64_t>());
    std::shuffle(d.begin(), d.end(), random);
    RC_ASSERT(object(d, from_one_pair()) == before);
  });
  rc::prop("O never rises when a pair moves further off its line", [] {
    auto d = *distances(1);
    const double before = object(d, from_one_pair());
    const auto i = *rc::gen::inRange<std::size_t>(0, d.size());
    d[i] += *rc::gen::map(probability(), [](double p) { return 5 * p; });
    RC_ASSERT(object(d, from_one_pair()) <= before);
  });
  rc::prop("Scaling the distances and sigma together changes nothing", [] {
    const auto d = *distances(1);
    const double scale = std::exp2(*rc::gen::inRange(-8, 9));
    auto scaled = d;
    for (double& x : scaled) x *= scale;
    auto options = from_one_pair();
    const double before = object(d, options);
    options.sigma_px *= scale;
    RC_ASSERT(object(scaled, options) == before);
  });
  rc::prop("Float agrees with double", [] {
    const auto d = *distances(1);
    const std::vector<float> f(d.begin(), d.end());
    std::vector<float> scratch(f.size());
    const double single = cfp::object_probability(f, from_one_pair(), scratch).static_probability;
    RC_ASSERT(std::abs(single - object(d, from_one_pair())) < 1e-5);
  });
}

TEST_CASE("Properties of the first stage", "[properties]") {
  rc::prop("K is in [O, 1] for background and in {0, O} for foreground", [] {
    const double o = *probability(), t = 0.01 + 0.98 * *probability();
    const double background = cfp::first_stage_probability(o, false, t);
    const double foreground = cfp::first_stage_probability(o, true, t);
    RC_ASSERT(background >= o && background <= 1);
    RC_ASSERT(foreground == 0 || foreground == o);
    RC_ASSERT(foreground <= background);
  });
  rc::prop("K never falls when O rises", [] {
    const double a = *probability(), b = *probability(), t = 0.01 + 0.98 * *probability();
    for (const bool foreground : {false, true}) {
      RC_ASSERT(cfp::first_stage_probability((std::min)(a, b), foreground, t) <=
                cfp::first_stage_probability((std::max)(a, b), foreground, t) + 1e-12);
    }
  });
  rc::prop("Background is continuous at O_Th", [] {
    const double t = 0.01 + 0.98 * *probability();
    const double h = 1e-9;
    RC_ASSERT(std::abs(cfp::first_stage_probability(t - h, false, t) - cfp::first_stage_probability(t + h, false, t)) <
              1e-6);
  });
}

TEST_CASE("Properties of the constraint sigmoid", "[properties]") {
  rc::prop("The model is finite and its probabilities in range for any distances", [] {
    const auto d = *rc::gen::container<std::vector<double>>(any_double());
    const auto model = fit(d);
    RC_ASSERT(std::isfinite(model.threshold_px) && std::isfinite(model.minimum_px) &&
              std::isfinite(model.slope_per_px));
    RC_ASSERT(model.calculation_confidence >= 0 && model.calculation_confidence <= 1);
    const double k = cfp::static_probability(model, *any_double());
    RC_ASSERT(k >= 0 && k <= 1);
  });
  rc::prop("K never rises with the distance", [] {
    const auto model = fit(*distances(10));
    const double a = 10 * *probability(), b = 10 * *probability();
    RC_ASSERT(cfp::static_probability(model, (std::max)(a, b)) <= cfp::static_probability(model, (std::min)(a, b)));
  });
  rc::prop("The model does not depend on the order of the samples", [] {
    auto d = *distances(10);
    const auto before = fit(d);
    cfp::Random random(*rc::gen::arbitrary<std::uint64_t>());
    std::shuffle(d.begin(), d.end(), random);
    const auto after = fit(d);
    RC_ASSERT(after.threshold_px == before.threshold_px && after.minimum_px == before.minimum_px);
    RC_ASSERT(std::abs(after.calculation_confidence - before.calculation_confidence) < 1e-12);
  });
  rc::prop("Scaling all distances leaves every probability and the confidence unchanged", [] {
    const auto d = *distances(10);
    const double scale = std::exp2(*rc::gen::inRange(-20, 21));
    auto scaled = d;
    for (double& x : scaled) x *= scale;
    const auto a = fit(d), b = fit(scaled);
    RC_ASSERT(a.status == b.status);
    const double x = 10 * *probability();
    RC_ASSERT(std::abs(cfp::static_probability(a, x) - cfp::static_probability(b, x * scale)) < 1e-9);
    RC_ASSERT(std::abs(a.calculation_confidence - b.calculation_confidence) < 1e-9);
  });
}

TEST_CASE("Properties of the fusion", "[properties]") {
  const auto evidence = [] {
    return cfp::Evidence<double>{*probability(), *probability(), *rc::gen::arbitrary<bool>()};
  };
  rc::prop("The low-dynamic mean lies between its two probabilities, the high-dynamic product below both", [&] {
    auto t = evidence(), f = evidence();
    t.available = f.available = true;
    const double low = (std::min)(t.static_probability, f.static_probability),
                 high = (std::max)(t.static_probability, f.static_probability);
    const double mean = cfp::fuse_low_dynamic(t, f);
    RC_ASSERT(mean >= low - 1e-12 && mean <= high + 1e-12);
    RC_ASSERT(cfp::fuse_high_dynamic(t, f) <= low);
  });
  rc::prop("A constraint's probability never lowers the result by rising", [&] {
    cfp::SecondStageKeypoint<double> p{evidence(),
                                       evidence(),
                                       *probability(),
                                       *probability(),
                                       *rc::gen::arbitrary<bool>(),
                                       *rc::gen::arbitrary<bool>(),
                                       *rc::gen::arbitrary<bool>()};
    const double before = cfp::second_stage_probability(p, 0.9);
    p.projection.static_probability += (1 - p.projection.static_probability) * *probability();
    RC_ASSERT(cfp::second_stage_probability(p, 0.9) >= before - 1e-12);
  });
  rc::prop("K is in [0, 1] for any evidence", [] {
    const cfp::SecondStageKeypoint<double> p{{*any_double(), *any_double(), *rc::gen::arbitrary<bool>()},
                                             {*any_double(), *any_double(), *rc::gen::arbitrary<bool>()},
                                             *any_double(),
                                             *any_double(),
                                             *rc::gen::arbitrary<bool>(),
                                             *rc::gen::arbitrary<bool>(),
                                             *rc::gen::arbitrary<bool>()};
    const double k = cfp::second_stage_probability(p, 0.9);
    RC_ASSERT(k >= 0 && k <= 1);
  });
}

TEST_CASE("Properties of the map-point update", "[properties]") {
  for (const auto policy :
       {cfp::MapPointPolicy::copy, cfp::MapPointPolicy::exponential_mean, cfp::MapPointPolicy::log_odds}) {
    cfp::MapPointOptions options;
    options.policy = policy;
    rc::prop("M is in [0, 1] for any M and K, policy " + std::to_string(static_cast<int>(policy)), [options] {
      const double m = cfp::updated_map_point(*any_double(), *any_double(), options);
      RC_ASSERT(m >= 0 && m <= 1);
    });
    rc::prop("M never falls when K or M rises, policy " + std::to_string(static_cast<int>(policy)), [options] {
      const double m = *probability(), k = *probability();
      const double m2 = m + (1 - m) * *probability(), k2 = k + (1 - k) * *probability();
      RC_ASSERT(cfp::updated_map_point(k2, m2, options) >= cfp::updated_map_point(k, m, options) - 1e-12);
    });
  }
  rc::prop("The posterior lies between 0 and 1 and grows with K, E and M", [] {
    const cfp::MapPointOptions options;
    const double p = cfp::posterior_probability(*any_double(), *any_double(), *any_double(), options);
    RC_ASSERT(p > 0 && p < 1);
    const double m = *probability(), k = *probability(), e = *probability();
    const double m2 = m + (1 - m) * *probability(), k2 = k + (1 - k) * *probability(),
                 e2 = e + (1 - e) * *probability();
    RC_ASSERT(cfp::posterior_probability(k2, e2, m2, options) >= cfp::posterior_probability(k, e, m, options) - 1e-12);
  });
  rc::prop("The printed weight lies between 0 and 1 and grows with both", [] {
    const double m = *probability(), k = *probability();
    const double m2 = m + (1 - m) * *probability(), k2 = k + (1 - k) * *probability();
    RC_ASSERT(cfp::observation_weight(k, m) >= 0 && cfp::observation_weight(k, m) <= 1);
    RC_ASSERT(cfp::observation_weight(k2, m2) >= cfp::observation_weight(k, m) - 1e-15);
  });
}
