// Missed-detection compensation: reads a detections file (format: support/detections_file.hpp) and prints, frame by
// frame, what the detector saw and what it missed but the tracker knows.
//   cfp_example_03_missed_detections [detections.txt [image width] [image height]]
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "cfp/core/options.hpp"
#include "cfp/detection/box_tracker.hpp"
#include "support/detections_file.hpp"

namespace {

// A person walks to the right, a chair stands; the detector misses the person in the fourth and fifth frame.
const char* const embedded = R"(
0.000 person 0.9 100 80 180 320
0.000 chair  0.6 400 200 480 330
0.033 person 0.9 104 80 184 320
0.033 chair  0.6 401 200 480 331
0.067 person 0.8 108 81 188 321
0.067 chair  0.7 400 199 480 330
0.100 chair  0.6 400 200 481 330
0.133 chair  0.6 399 200 480 330
0.167 person 0.8 120 80 200 320
0.167 chair  0.6 400 200 480 330
)";

}  // namespace

int main(int argc, char** argv) {
  std::ifstream from_file;
  std::istringstream from_memory(embedded);
  if (argc > 1) from_file.open(argv[1]);
  std::istream& input = argc > 1 ? static_cast<std::istream&>(from_file) : from_memory;
  const cfp_examples::DetectionsFile file = cfp_examples::read_detections(input, argc > 1 ? argv[1] : "embedded");
  if (!file.error.empty()) {
    std::fprintf(stderr, "%s\n", file.error.c_str());
    return EXIT_FAILURE;
  }

  cfp::BoxTrackerOptions options;
  options.image_width = argc > 2 ? std::atof(argv[2]) : 640;
  options.image_height = argc > 3 ? std::atof(argv[3]) : 480;
  cfp::validate(options);
  cfp::BoxTracker<double> tracker(options);

  double before = file.frames.empty() ? 0 : file.frames.front().timestamp;
  std::size_t compensated = 0;
  for (std::size_t k = 0; k < file.frames.size(); ++k) {
    const cfp_examples::DetectionFrame& frame = file.frames[k];
    const cfp::BoxTrackerResult<double> result = tracker.track(frame.detections, frame.timestamp - before);
    before = frame.timestamp;
    compensated += result.compensated;
    std::printf("frame %zu at %.3f s\n", k, frame.timestamp);
    for (const cfp::TrackedBox<double>& box : result.boxes) {
      std::printf(
          "  %-11s %s %d  [%.0f, %.0f] x [%.0f, %.0f]  age %d%s\n", box.compensated() ? "COMPENSATED" : "detected",
          file.classes[static_cast<std::size_t>(box.class_id)].c_str(), static_cast<int>(box.id), box.box.x1,
          box.box.x2, box.box.y1, box.box.y2, box.age, box.associated ? "" : "  (new: not in the frame before)");
    }
  }
  std::printf("%zu frames, %zu boxes compensated\n", file.frames.size(), compensated);
}
