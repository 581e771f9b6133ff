// Which keypoints in a person's box are on the person? Red: foreground, green: background, grey: no depth, as in the
// paper's figure.
//
//   02_depth_foreground image RGB.png DEPTH.png UNITS_PER_METRE OUT.png X1 Y1 X2 Y2 [X1 Y1 X2 Y2 ...]
//   02_depth_foreground sequence TUM_FOLDER OUT_FOLDER [UNITS_PER_METRE = 5000]
//
// For instance, with the frame of five people (1000 units per metre) and its boxes:
//   ... image rgb.png depth_mm.png 1000 out.png 15 62 155 480 143 95 245 480 276 103 384 442 362 103 470 462 460 50 606
//   480
//
// A TUM folder has rgb.txt, depth.txt (timestamp filename) and detections.txt (timestamp class score x1 y1 x2 y2). One
// picture is written per frame, and a contact sheet of nine.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "cfp/clustering/depth_foreground.hpp"
#include "cfp/geometry/box.hpp"
#include "support/detections_file.hpp"
#include "support/tum.hpp"
#include "support/write_picture.hpp"

namespace {

using Box = cfp::Box<float>;

cv::Mat annotate(const cv::Mat& rgb, const cv::Mat& depth, double units_per_metre, const std::vector<Box>& boxes) {
  std::vector<cv::KeyPoint> keypoints;
  cv::ORB::create(1500)->detect(rgb, keypoints);
  cv::Mat picture = rgb.clone();
  cfp::ForegroundWorkspace<float> workspace;
  for (const Box& box : boxes) {
    std::vector<cv::Point2f> points;
    std::vector<std::array<float, 2>> pixels;
    std::vector<float> depths;
    for (const cv::KeyPoint& keypoint : keypoints) {
      if (!cfp::contains(box, keypoint.pt.x, keypoint.pt.y)) continue;
      points.push_back(keypoint.pt);
      pixels.push_back({keypoint.pt.x, keypoint.pt.y});
      depths.push_back(static_cast<float>(depth.at<std::uint16_t>(cvRound(keypoint.pt.y), cvRound(keypoint.pt.x)) /
                                          units_per_metre));
    }
    std::vector<char> foreground(depths.size());
    const cfp::ForegroundResult result = cfp::depth_foreground({depths, pixels, box, 0.0F}, {}, workspace, foreground);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const cv::Scalar colour = depths[i] <= 0       ? cv::Scalar(160, 160, 160)
                                : foreground[i] != 0 ? cv::Scalar(0, 0, 255)
                                                     : cv::Scalar(0, 220, 0);
      cv::circle(picture, points[i], 2, colour, cv::FILLED, cv::LINE_AA);
    }
    char text[160];
    std::snprintf(text, sizeof text, "%.2f-%.2f m", result.near_m, result.far_m);
    cv::rectangle(picture, cv::Point2f(box.x1, box.y1), cv::Point2f(box.x2, box.y2), cv::Scalar(255, 160, 0), 1);
    cv::putText(picture, text, cv::Point2f(box.x1 + 2, box.y1 + 12), cv::FONT_HERSHEY_SIMPLEX, 0.4,
                cv::Scalar(255, 255, 255), 1, cv::LINE_AA);
    std::printf("box %.0f %.0f %.0f %.0f: %s, foreground %zu (%.2f to %.2f m), background %zu, without depth %zu\n",
                static_cast<double>(box.x1), static_cast<double>(box.y1), static_cast<double>(box.x2),
                static_cast<double>(box.y2), to_string(result.status), result.foreground, result.near_m, result.far_m,
                result.background, result.invalid);
  }
  return picture;
}

int run_sequence(const std::filesystem::path& folder, const std::filesystem::path& out, double units_per_metre) {
  const auto images = cfp_examples::read_tum_list(folder / "rgb.txt"),
             depths = cfp_examples::read_tum_list(folder / "depth.txt");
  std::ifstream stream(folder / "detections.txt");
  const auto detected = cfp_examples::read_detections(stream, (folder / "detections.txt").string());
  if (!detected.error.empty()) throw std::runtime_error(detected.error);
  if (images.empty() || depths.empty())
    throw std::runtime_error(folder.string() + ": rgb.txt and depth.txt need at least one line each");
  std::filesystem::create_directories(out);
  std::vector<cv::Mat> sheet;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const cfp_examples::TumImage& image = images[i];
    const auto nearest = std::min_element(depths.begin(), depths.end(), [&](const auto& a, const auto& b) {
      return std::abs(a.time_s - image.time_s) < std::abs(b.time_s - image.time_s);
    });
    const cv::Mat rgb = cv::imread((folder / image.file).string()),
                  depth = cv::imread((folder / nearest->file).string(), cv::IMREAD_UNCHANGED);
    if (rgb.empty() || depth.type() != CV_16U || depth.size() != rgb.size()) {
      std::fprintf(stderr, "frame %s: no colour image, or no 16-bit depth image of its size\n", image.file.c_str());
      continue;
    }
    std::vector<Box> boxes;
    for (const auto& frame : detected.frames) {
      if (std::abs(frame.timestamp - image.time_s) >= 0.005) continue;
      for (const auto& d : frame.detections) {
        if (detected.classes[static_cast<std::size_t>(d.class_id)] != "person") continue;
        boxes.push_back({static_cast<float>(d.box.x1), static_cast<float>(d.box.y1), static_cast<float>(d.box.x2),
                         static_cast<float>(d.box.y2)});
      }
    }
    std::printf("%s\n", image.file.c_str());
    const cv::Mat picture = annotate(rgb, depth, units_per_metre, boxes);
    cfp_examples::write_picture(out / std::filesystem::path(image.file).filename(), picture);
    if (sheet.size() < 9 && i >= sheet.size() * images.size() / 9) sheet.push_back(picture);
  }
  std::vector<cv::Mat> rows;
  for (std::size_t i = 0; i + 3 <= sheet.size(); i += 3) {
    rows.emplace_back();
    cv::hconcat(sheet.data() + i, 3, rows.back());
  }
  if (!rows.empty()) {
    cv::Mat all;
    cv::vconcat(rows, all);
    cfp_examples::write_picture(out / "contact_sheet.png", all);
  }
  return 0;
}

}  // namespace

int main(int argc, char* argv[]) {
  const std::string mode = argc > 1 ? argv[1] : "";
  if (mode == "sequence" && argc >= 4) {
    try {
      return run_sequence(argv[2], argv[3], argc > 4 ? std::atof(argv[4]) : 5000.0);
    } catch (const std::exception& error) {
      std::fprintf(stderr, "%s\n", error.what());
      return 1;
    }
  }
  if (mode == "image" && argc >= 10 && (argc - 6) % 4 == 0) {
    const cv::Mat rgb = cv::imread(argv[2]), depth = cv::imread(argv[3], cv::IMREAD_UNCHANGED);
    if (rgb.empty() || depth.type() != CV_16U || depth.size() != rgb.size()) {
      std::fprintf(stderr, "needs a colour image and a 16-bit depth image of its size\n");
      return 1;
    }
    std::vector<Box> boxes;
    for (int i = 6; i + 3 < argc; i += 4) {
      boxes.push_back({std::strtof(argv[i], nullptr), std::strtof(argv[i + 1], nullptr),
                       std::strtof(argv[i + 2], nullptr), std::strtof(argv[i + 3], nullptr)});
    }
    return cv::imwrite(argv[5], annotate(rgb, depth, std::atof(argv[4]), boxes)) ? 0 : 1;
  }
  std::fprintf(stderr,
               "usage: %s image RGB.png DEPTH.png UNITS_PER_METRE OUT.png X1 Y1 X2 Y2 [...]\n"
               "       %s sequence TUM_FOLDER OUT_FOLDER [UNITS_PER_METRE]\n",
               argv[0], argv[0]);
  return 2;
}
