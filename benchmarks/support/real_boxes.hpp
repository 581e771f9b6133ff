// Person boxes of real depth frames with the depth that parts person from background, for foreground_study. The limits
// were read by hand off the depth images and hold for whole boxes, so background at a person's own depth counts as
// person here. The recordings belong to others and are not in this repository; absent ones are reported and left out.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>

#include "cfp/clustering/depth_foreground.hpp"
#include "cfp/geometry/box.hpp"
#include "support/k_distance.hpp"

namespace cfp_study {

struct RealBox {
  std::string group;
  cfp::Box<double> box;
  std::vector<double> depths;
  std::vector<std::array<double, 2>> pixels;
  double limit_m;
};

inline void add_real_boxes(const std::string& group, const std::string& image, const std::string& depth_image,
                           double units_per_metre, const std::vector<std::pair<cfp::Box<float>, double>>& boxes,
                           std::vector<RealBox>& out) {
  const cv::Mat rgb = cv::imread(image), depth = cv::imread(depth_image, cv::IMREAD_UNCHANGED);
  if (rgb.empty() || depth.type() != CV_16U || rgb.size() != depth.size()) return;
  std::vector<cv::KeyPoint> keypoints;
  cv::ORB::create(1500)->detect(rgb, keypoints);
  for (const auto& [box, limit] : boxes) {
    RealBox real{group, {box.x1, box.y1, box.x2, box.y2}, {}, {}, limit};
    for (const cv::KeyPoint& keypoint : keypoints) {
      if (!cfp::contains(box, keypoint.pt.x, keypoint.pt.y)) continue;
      real.pixels.push_back({keypoint.pt.x, keypoint.pt.y});
      real.depths.push_back(depth.at<std::uint16_t>(cvRound(keypoint.pt.y), cvRound(keypoint.pt.x)) / units_per_metre);
    }
    out.push_back(real);
  }
}

inline std::vector<RealBox> read_real_boxes(const std::string& data) {
  std::vector<RealBox> out;
  const std::string walking = data + "/tum_fr3_walking_halfsphere_30/", five = data + "/rgbd_pairs/five_people/";
  std::ifstream images(walking + "rgb.txt"), depths(walking + "depth.txt");
  // The clip's colour and depth lists go in step, line by line.
  for (std::string image, depth; std::getline(images, image) && std::getline(depths, depth);) {
    std::istringstream image_words(image), depth_words(depth);
    double time = 0, depth_time = 0;
    std::string image_name, depth_name;
    if (!(image_words >> time >> image_name) || !(depth_words >> depth_time >> depth_name)) continue;
    std::ifstream detections(walking + "detections.txt");
    for (std::string line; std::getline(detections, line);) {
      std::istringstream words(line);
      double at = 0, score = 0;
      std::string name;
      cfp::Box<float> box;
      if (!(words >> at >> name >> score >> box.x1 >> box.y1 >> box.x2 >> box.y2) || std::abs(at - time) > 0.005)
        continue;
      const bool left = box.x1 + box.x2 < 600.0F;
      add_real_boxes(left ? "walking, left man" : "walking, right man", walking + image_name, walking + depth_name,
                     5000.0, {{box, left ? 2.28 : 2.0}}, out);
    }
  }
  add_real_boxes("five people", five + "rgb.png", five + "depth_mm.png", 1000.0,
                 {{{15, 62, 155, 480}, 2.4},
                  {{143, 95, 245, 480}, 2.5},
                  {{276, 103, 384, 442}, 3.3},
                  {{362, 103, 470, 462}, 3.1},
                  {{460, 50, 606, 480}, 2.3}},
                 out);
  return out;
}

inline void print_real_boxes(const std::string& data) {
  const std::vector<RealBox> boxes = read_real_boxes(data);
  if (boxes.empty()) {
    std::printf("left out: no recordings under %s\n", data.c_str());
    return;
  }
  using Options = cfp::ForegroundOptions;
  const auto fixed = [](const cfp::DbscanOptions& dbscan) {
    Options options;
    options.rule = cfp::ForegroundRule::dbscan;
    options.adaptive.rule = cfp::AdaptiveRule::fixed;
    options.adaptive.fixed = dbscan;
    return options;
  };
  const auto by = [&](Rule rule) { return [=](const RealBox& box) { return fixed(options_by(rule, box.depths)); }; };
  const auto always = [&](double eps, std::size_t min_pts) {
    return [=](const RealBox&) { return fixed({eps, min_pts}); };
  };
  struct Row {
    const char* name;
    std::function<Options(const RealBox&)> options;
  };
  Options adaptive;
  adaptive.rule = cfp::ForegroundRule::dbscan;
  const Row rows[] = {{"window", [](const RealBox&) { return Options{}; }},
                      {"adaptive DBSCAN", [=](const RealBox&) { return adaptive; }},
                      {"k-distance median", by(Rule::k_distance_median)},
                      {"k-distance knee", by(Rule::k_distance_knee)},
                      {"KANN-DBSCAN", by(Rule::kann)},
                      {"fixed 0.05 m / 5", always(0.05, 5)},
                      {"fixed 0.1 m / 5", always(0.1, 5)},
                      {"fixed 0.15 m / 10", always(0.15, 10)},
                      {"fixed 0.2 m / 10", always(0.2, 10)}};
  const char* groups[] = {"walking, left man", "walking, right man", "five people"};
  std::printf("| foreground / background kept, %% |");
  for (const char* group : groups) {
    std::size_t count = 0, points = 0;
    for (const RealBox& box : boxes) {
      if (box.group == group) ++count, points += box.depths.size();
    }
    std::printf(" %s: %zu boxes of %zu points |", group, count, count > 0 ? points / count : 0);
  }
  std::printf("\n|---|---|---|---|\n");
  cfp::ForegroundWorkspace<double> workspace;
  for (const Row& row : rows) {
    std::printf("| %-18s |", row.name);
    for (const char* group : groups) {
      double foreground = 0, background = 0;
      int boxes_f = 0, boxes_b = 0;
      for (const RealBox& box : boxes) {
        if (box.group != group) continue;
        std::vector<char> mask(box.depths.size());
        cfp::depth_foreground({box.depths, box.pixels, box.box, 0}, row.options(box), workspace, mask);
        int f = 0, f_kept = 0, b = 0, b_kept = 0;
        for (std::size_t i = 0; i < mask.size(); ++i) {
          if (!cfp::is_valid_depth(box.depths[i])) continue;
          if (box.depths[i] <= box.limit_m)
            ++f, f_kept += mask[i] != 0 ? 1 : 0;
          else
            ++b, b_kept += mask[i] == 0 ? 1 : 0;
        }
        if (f > 0) foreground += 100.0 * f_kept / f, ++boxes_f;
        if (b > 0) background += 100.0 * b_kept / b, ++boxes_b;
      }
      std::printf(" %5.1f / %5.1f |", foreground / (boxes_f > 0 ? boxes_f : 1),
                  background / (boxes_b > 0 ? boxes_b : 1));
    }
    std::printf("\n");
  }
}

}  // namespace cfp_study
