// What the detectors of the SLAM example find on a real recording, against two lists of boxes made elsewhere (NanoDet-m
// 320's own program; YOLOv5x on the first ten frames): recall and precision of persons at IoU >= 0.5 over the score
// threshold, time per frame. The default threshold of FastestDet in examples/detection/network_detector.hpp rests on
// it.
//   cfp_detector_study [--pictures FOLDER]
#include "../../examples/detection/detector.hpp"

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "../../examples/support/tum.hpp"
#include "support/data.hpp"

namespace {

namespace fs = std::filesystem;

struct Image {
  double time_s;
  std::string file;
  cv::Mat bgr;
};

struct Score {
  int reference = 0, found = 0, common = 0;
};

// One-to-one, surest box first.
void compare(const cfp_examples::Detections& reference, const cfp_examples::Detections& found, Score& score) {
  std::vector<char> taken(reference.size(), 0);
  score.reference += static_cast<int>(reference.size());
  score.found += static_cast<int>(found.size());
  for (const auto& d : found) {
    std::size_t best = reference.size();
    for (std::size_t i = 0; i < reference.size(); ++i) {
      if (taken[i] == 0 && cfp::iou(reference[i].box, d.box) >= 0.5F &&
          (best == reference.size() || cfp::iou(reference[i].box, d.box) > cfp::iou(reference[best].box, d.box)))
        best = i;
    }
    if (best == reference.size()) continue;
    taken[best] = 1;
    ++score.common;
  }
}

cfp_examples::Detections people(const cfp_examples::Detector& detector, cfp_examples::Detections all, float min_score) {
  const int person = detector.class_of("person");
  all.erase(std::remove_if(all.begin(), all.end(),
                           [&](const auto& d) { return d.class_id != person || !(d.score >= min_score); }),
            all.end());
  return all;
}

}  // namespace

int main(int argc, char** argv) {
  const fs::path folder = cfp_test::data_folder("tum_fr3_walking_halfsphere_30"), data = folder.parent_path();
  if (!fs::exists(folder) || !fs::exists(data / "detectors")) {
    std::printf("CFP_SKIPPED: no %s or no %s\n", folder.c_str(), (data / "detectors").c_str());
    return 0;
  }
  bool smoke = false;
  fs::path pictures;
  for (int i = 1; i < argc; ++i) {
    smoke = smoke || std::string(argv[i]) == "--smoke";
    if (std::string(argv[i]) == "--pictures" && i + 1 < argc) pictures = argv[++i];
  }
  std::vector<Image> images;
  for (const auto& image : cfp_examples::read_tum_list(folder / "rgb.txt")) {
    images.push_back(
        {image.time_s, fs::path(image.file).filename().string(), cv::imread((folder / image.file).string())});
    if (smoke && images.size() == 3) break;
  }
  const auto nanodet_list = cfp_examples::make_detector((folder / "detections.txt").string()),
             yolo_list = cfp_examples::make_detector((folder / "detections_yolov5x.txt").string());

  std::printf(
      "persons at IoU >= 0.5; recall/precision against NanoDet's list (all frames) and YOLOv5x's (frames 0-9); %d "
      "OpenCV threads\n",
      cv::getNumThreads());
  std::printf("%-36s %9s %7s   %s\n", "detector", "ms median", "score",
              "R/P of NanoDet's list   R/P of YOLOv5x's list");
  for (const std::string& spec : {(data / "detectors/FastestDet.onnx@352").string(), std::string("hog")}) {
    cfp_examples::DetectorOptions options;
    const bool hog = spec == "hog";
    options.min_score = hog ? 0 : 0.1;
    const auto detector = cfp_examples::make_detector(spec, options);
    std::vector<cfp_examples::Detections> all;
    std::vector<double> ms;
    for (const Image& image : images) {
      const auto start = std::chrono::steady_clock::now();
      all.push_back(detector->detect(image.bgr, image.time_s));
      ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
    }
    std::nth_element(ms.begin(), ms.begin() + static_cast<std::ptrdiff_t>(ms.size() / 2), ms.end());
    for (const float min_score : {0.2F, 0.3F, 0.4F, 0.5F, 0.6F, 0.7F}) {
      Score nanodet, yolo;
      for (std::size_t i = 0; i < images.size(); ++i) {
        const auto found = people(*detector, all[i], min_score);
        compare(people(*nanodet_list, nanodet_list->detect(images[i].bgr, images[i].time_s), 0), found, nanodet);
        if (i < 10) compare(people(*yolo_list, yolo_list->detect(images[i].bgr, images[i].time_s), 0), found, yolo);
      }
      std::printf("%-36s %9.1f %7.2f   %3d/%3d  %3d/%3d        %3d/%3d  %3d/%3d\n", detector->name().c_str(),
                  ms[ms.size() / 2], min_score, nanodet.common, nanodet.reference, nanodet.common, nanodet.found,
                  yolo.common, yolo.reference, yolo.common, yolo.found);
    }
    if (pictures.empty()) continue;
    const auto drawn = cfp_examples::make_detector(spec);
    for (const Image& image : images) {
      cv::Mat picture = image.bgr.clone();
      for (const auto& d : drawn->detect(image.bgr, image.time_s)) {
        const cv::Point corner(int(d.box.x1), int(d.box.y1));
        cv::rectangle(picture, corner, {int(d.box.x2), int(d.box.y2)}, {0, 255, 255}, 2);
        cv::putText(picture,
                    drawn->classes()[static_cast<std::size_t>(d.class_id)] + cv::format(" %.2f", double(d.score)),
                    corner + cv::Point(4, 16), cv::FONT_HERSHEY_SIMPLEX, 0.5, {0, 255, 255}, 1, cv::LINE_AA);
      }
      fs::create_directories(pictures / drawn->name());
      cv::imwrite((pictures / drawn->name() / image.file).string(), picture);
    }
  }
  return 0;
}
