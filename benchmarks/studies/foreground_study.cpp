// Which way of reading depths tells the person of a box from what is behind and before? The default of
// clustering/depth_foreground.hpp rests on the tables printed here.
//
//   cfp_foreground_study [scenes per kind, default 60] [seed stream, default "held out"] [folder of the recordings]
//
// Scenes of twelve kinds (support/person_scene.hpp), 10 to 2000 keypoints per box, with the sensor's noise and
// quantisation, flying pixels and missing depth. The defaults were chosen on the stream "tune". Judged per box and
// averaged: the share of the person's points labelled foreground (recall), and of all others labelled background.
// Points without depth or with a depth mixed from two surfaces are not judged. `previous` is the method's own answer on
// other keypoints of the same scene, moved by 5 cm. The DBSCAN rows take the first cluster, as printed. KANN-DBSCAN is
// cubic in effect and left out above 300 points. Pictures of real frames: examples/02_depth_foreground.
//
// The aim is to be in no cell more than a point behind the best rival of that cell. With 60 scenes a cell is uncertain
// by about a point; with 300, on the stream "held out 2" ("held out" was seen while choosing) and with what was
// remembered, the mean is 97.6 / 89.5 %, and 12 of 84 cells miss it: boxes without a person (14 to 22 points, at every
// n), and five kinds with 10 points (desk and table 1.9, the others 1.0 to 1.1). Where nothing is remembered of a
// person at a desk or table, so do cells with more points (up to 4.4 points, 10.1 with 10). Boxes without a person can
// be told by where their points lie: calling everything background where the mean log likelihood ratio of the labels
// given the places, against labels that know no places, is below -0.2 - 0.5 / sqrt(n) keeps 80 % there, level with
// Otsu, and costs 0.5 to 2 % of the people drawn here; but people whom the image's edge cuts, as in the real walking
// clip, lie otherwise in their boxes: 15 to 17 % of their points were lost. So it is left out: what stands in a false
// box keeps its O. The price of the places: of people at desks 4 % of the points are lost that the remembered or the
// upper window kept when it was taken always; of sitting people 3 % are won where nothing is remembered.
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "cfp/clustering/depth_foreground.hpp"
#include "support/data.hpp"
#include "support/depth_cuts.hpp"
#include "support/k_distance.hpp"
#include "support/person_scene.hpp"
#ifdef CFP_HAVE_OPENCV
#include "support/real_boxes.hpp"
#endif

namespace {

using cfp_study::Keypoints;

struct Box {
  Keypoints points, before;
  double moved_m;
};

using Mask = std::vector<char>;

cfp::ForegroundResult label(const Keypoints& points, bool with_pixels, double previous_m,
                            const cfp::ForegroundOptions& options, Mask& mask) {
  static cfp::ForegroundWorkspace<double> workspace;
  std::vector<std::array<double, 2>> pixels;
  for (std::size_t i = 0; i < points.x.size(); ++i) pixels.push_back({points.x[i], points.y[i]});
  cfp::ForegroundInput<double> in{points.depths, {}, {}, previous_m};
  if (with_pixels) {
    in.pixels = pixels;
    in.box = {0, 0, 1, 1};
  }
  mask.resize(points.depths.size());
  return cfp::depth_foreground(in, options, workspace, mask);
}

/// A rival that cuts: how many of the ascending depths are foreground.
template <typename Cut>
Mask label_by(const Keypoints& points, const Cut& cut) {
  std::vector<double> sorted;
  for (const double z : points.depths) {
    if (cfp::is_valid_depth(z)) sorted.push_back(z);
  }
  std::sort(sorted.begin(), sorted.end());
  const std::size_t count = cut(sorted);
  Mask mask(points.depths.size(), 1);
  for (std::size_t i = 0; i < mask.size(); ++i)
    mask[i] = count == sorted.size() || points.depths[i] < sorted[count] ? char(1) : char(0);
  return mask;
}

struct Method {
  std::string name;
  bool rival;
  std::size_t largest;
  std::function<Mask(const Box&)> label;
};

cfp::ForegroundOptions as_printed(cfp::AdaptiveRule rule, const cfp::DbscanOptions& dbscan) {
  cfp::ForegroundOptions options;
  options.rule = cfp::ForegroundRule::dbscan;
  options.adaptive.rule = rule;
  options.adaptive.fixed = dbscan;
  return options;
}

std::vector<Method> methods() {
  std::vector<Method> all;
  const std::size_t any = 1000000;
  const auto cut = [&](const char* name, auto rule) {
    all.push_back({name, true, any, [rule](const Box& box) { return label_by(box.points, rule); }});
  };
  using Depths = std::vector<double>;
  cut("quantile + 0.3 m", [](const Depths& d) { return cfp_study::quantile_cut(d, 0.3); });
  cut("quantile + 0.4 m", [](const Depths& d) { return cfp_study::quantile_cut(d, 0.4); });
  cut("quantile + 0.5 m", [](const Depths& d) { return cfp_study::quantile_cut(d, 0.5); });
  cut("Otsu", [](const Depths& d) { return cfp_study::otsu_cut(d); });
  cut("mixture of two", [](const Depths& d) { return cfp_study::mixture_cut(d); });
  const auto cluster = [&](const char* name, bool rival, std::size_t largest, auto options_of) {
    all.push_back({name, rival, largest, [options_of](const Box& box) {
                     Mask mask;
                     label(box.points, false, 0, options_of(box.points.depths), mask);
                     return mask;
                   }});
  };
  const auto by = [](cfp_study::Rule rule) {
    return [rule](const Depths& d) { return as_printed(cfp::AdaptiveRule::fixed, cfp_study::options_by(rule, d)); };
  };
  cluster("k-distance knee", true, any, by(cfp_study::Rule::k_distance_knee));
  cluster("KANN-DBSCAN", true, 300, by(cfp_study::Rule::kann));
  cluster("fixed 0.1 m / 5", true, any, [](const Depths&) { return as_printed(cfp::AdaptiveRule::fixed, {0.1, 5}); });
  cluster("adaptive DBSCAN", false, any,
          [](const Depths&) { return as_printed(cfp::AdaptiveRule::foreground_density, {}); });
  const auto ours = [&](const char* name, bool with_pixels, bool with_previous) {
    all.push_back({name, false, any, [=](const Box& box) {
                     Mask mask;
                     double previous_m = 0;
                     if (with_previous) {
                       previous_m = label(box.before, true, 0, {}, mask).depth_m;
                       if (previous_m > 0) previous_m += box.moved_m;
                     }
                     label(box.points, with_pixels, previous_m, {}, mask);
                     return mask;
                   }});
  };
  ours("window, depths", false, false);
  ours("window, + pixels", true, false);
  ours("window, + previous", true, true);
  return all;
}

struct Figures {
  double recall = 0, background = 0;
  int recall_boxes = 0, background_boxes = 0;

  void add(const Keypoints& points, const Mask& mask) {
    std::size_t f = 0, f_kept = 0, b = 0, b_kept = 0;
    for (std::size_t i = 0; i < mask.size(); ++i) {
      if (points.truth[i] == 1) ++f, f_kept += mask[i] != 0 ? 1U : 0U;
      if (points.truth[i] == 0) ++b, b_kept += mask[i] == 0 ? 1U : 0U;
    }
    if (f > 0) recall += 100 * static_cast<double>(f_kept) / static_cast<double>(f), ++recall_boxes;
    if (b > 0) background += 100 * static_cast<double>(b_kept) / static_cast<double>(b), ++background_boxes;
  }
  [[nodiscard]] bool has_person() const { return recall_boxes > 0; }
  [[nodiscard]] double r() const { return recall / (std::max)(1, recall_boxes); }
  [[nodiscard]] double b() const { return background / (std::max)(1, background_boxes); }
  /// Mean of both; without a person, the background alone.
  [[nodiscard]] double balanced() const { return has_person() ? (r() + b()) / 2 : b(); }
};

const std::vector<std::size_t> sizes{10, 20, 40, 100, 300, 1000, 2000};

/// Figures by method, kind and size.
struct Results {
  std::vector<Method> methods;
  std::vector<std::vector<std::vector<Figures>>> of;

  [[nodiscard]] double best_rival(std::size_t kind, std::size_t size) const {
    double best = 0;
    for (std::size_t m = 0; m < methods.size(); ++m) {
      if (methods[m].rival && sizes[size] <= methods[m].largest) best = (std::max)(best, of[m][kind][size].balanced());
    }
    return best;
  }
  /// "recall / background kept" over the cells for which `in(kind, size)` holds.
  template <typename In>
  void print_mean(std::size_t method, const In& in) const {
    double r = 0, b = 0;
    int rs = 0, bs = 0;
    for (std::size_t k = 0; k < cfp_study::scenarios.size(); ++k) {
      for (std::size_t s = 0; s < sizes.size(); ++s) {
        if (!in(k, s) || sizes[s] > methods[method].largest) continue;
        const Figures& f = of[method][k][s];
        if (f.has_person()) r += f.r(), ++rs;
        b += f.b(), ++bs;
      }
    }
    if (bs == 0)
      std::printf(" – |");
    else if (rs == 0)
      std::printf(" – / %.1f |", b / bs);
    else
      std::printf(" %.1f / %.1f |", r / rs, b / bs);
  }
};

Results evaluate(int scenes, const char* stream) {
  Results results{methods(), {}};
  results.of.assign(results.methods.size(), {});
  for (auto& kinds : results.of) kinds.assign(cfp_study::scenarios.size(), std::vector<Figures>(sizes.size()));
  cfp::Random random(1, stream);
  for (std::size_t k = 0; k < cfp_study::scenarios.size(); ++k) {
    for (int i = 0; i < scenes; ++i) {
      const cfp_study::PersonScene scene = cfp_study::draw_scene(random, cfp_study::scenarios[k]);
      for (std::size_t s = 0; s < sizes.size(); ++s) {
        Box box{cfp_study::draw_keypoints(random, scene, sizes[s]), {}, 0};
        box.before = cfp_study::draw_keypoints(random, scene, sizes[s]);
        box.moved_m = 0.05 * random.normal();
        for (std::size_t m = 0; m < results.methods.size(); ++m) {
          if (sizes[s] <= results.methods[m].largest)
            results.of[m][k][s].add(box.points, results.methods[m].label(box));
        }
      }
    }
  }
  return results;
}

void print_head(const char* first, const std::vector<std::string>& columns) {
  std::printf("| %s |", first);
  for (const std::string& column : columns) std::printf(" %s |", column.c_str());
  std::printf("\n|---|");
  for (std::size_t i = 0; i < columns.size(); ++i) std::printf("---|");
  std::printf("\n");
}

void print_tables(const Results& results) {
  std::vector<std::string> kinds{"all"}, counts;
  for (const auto kind : cfp_study::scenarios) kinds.emplace_back(cfp_study::name_of(kind));
  for (const std::size_t n : sizes) counts.push_back("n = " + std::to_string(n));
  std::printf("Table 1: recall / background kept, %%, by kind, mean over n\n");
  print_head("method", kinds);
  for (std::size_t m = 0; m < results.methods.size(); ++m) {
    std::printf("| %-18s |", results.methods[m].name.c_str());
    results.print_mean(m, [](std::size_t, std::size_t) { return true; });
    for (std::size_t k = 0; k < cfp_study::scenarios.size(); ++k)
      results.print_mean(m, [k](std::size_t kind, std::size_t) { return kind == k; });
    std::printf("\n");
  }
  std::printf("\nTable 2: the same by n, mean over the kinds\n");
  print_head("method", counts);
  for (std::size_t m = 0; m < results.methods.size(); ++m) {
    std::printf("| %-18s |", results.methods[m].name.c_str());
    for (std::size_t s = 0; s < sizes.size(); ++s)
      results.print_mean(m, [s](std::size_t, std::size_t size) { return size == s; });
    std::printf("\n");
  }
  for (std::size_t m = results.methods.size() - 2; m < results.methods.size(); ++m) {
    std::printf("\nTable %zu: lead of '%s' over the best rival of the cell, points of the mean of both figures\n",
                m + 5 - results.methods.size(), results.methods[m].name.c_str());
    print_head("kind", counts);
    for (std::size_t k = 0; k < cfp_study::scenarios.size(); ++k) {
      std::printf("| %-15s |", cfp_study::name_of(cfp_study::scenarios[k]));
      for (std::size_t s = 0; s < sizes.size(); ++s)
        std::printf(" %+.1f |", results.of[m][k][s].balanced() - results.best_rival(k, s));
      std::printf("\n");
    }
  }
}

}  // namespace

int main(int argc, char* argv[]) {
  const bool smoke = argc > 1 && std::string(argv[1]) == "--smoke";
  const int scenes = smoke ? 2 : argc > 1 ? std::atoi(argv[1]) : 60;
  const char* stream = argc > 2 ? argv[2] : "held out";
  std::printf("%zu kinds, %d scenes each, stream \"%s\"\n\n", cfp_study::scenarios.size(), scenes, stream);
  print_tables(evaluate(scenes, stream));
#ifdef CFP_HAVE_OPENCV
  std::printf(
      "\nTable 5: real depth frames, limits between person and background read by hand (support/real_boxes.hpp)\n");
  cfp_study::print_real_boxes(argc > 3 ? argv[3] : cfp_test::data_folder("").string());
#endif
}
