// Renders a sequence on several threads and writes it as a TUM folder with labels; see README.md for the files.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <initializer_list>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "../support/write_picture.hpp"
#include "sequence.hpp"

namespace synthetic {

/// The values behind blanks, all with the same number of decimals.
inline std::string columns(std::initializer_list<double> values, int decimals) {
  std::string text;
  for (const double value : values) text += ' ' + cfp_examples::fixed(value, decimals);
  return text;
}

/// Writes the sequence into a folder, which is made when missing. progress(frames done) is called from the rendering
/// threads, one at a time. The files do not depend on the number of threads.
inline void write_sequence(const Sequence& sequence, const std::filesystem::path& folder, int threads,
                           const std::function<void(int)>& progress) {
  const SequenceOptions& options = sequence.options();
  for (const char* sub : {"rgb", "depth", "labels"}) std::filesystem::create_directories(folder / sub);
  std::vector<std::array<Sighting, 2>> people(static_cast<std::size_t>(options.frames));
  std::atomic<int> next{0};
  std::mutex mutex;
  std::exception_ptr failure;
  int done = 0;
  const auto work = [&] {
    Renderer renderer;
    RenderedFrame frame;
    for (int k; (k = next++) < options.frames;) {
      try {
        sequence.render(k, renderer, frame);
        people[static_cast<std::size_t>(k)] = frame.truth.people;
        const std::string name = cfp_examples::fixed(sequence.stamp_of(k), 6) + ".png";
        // Noise does not compress: the fastest level costs a few per cent of space and half the time.
        const std::vector<int> fast{cv::IMWRITE_PNG_COMPRESSION, 1};
        cfp_examples::write_picture(folder / "rgb" / name, frame.color, fast);
        cfp_examples::write_picture(folder / "depth" / name, frame.depth, fast);
        cfp_examples::write_picture(folder / "labels" / name, frame.label, fast);
        const std::lock_guard<std::mutex> lock(mutex);
        progress(++done);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(mutex);
        if (!failure) failure = std::current_exception();
        next = options.frames;
      }
    }
  };
  std::vector<std::thread> pool;
  for (int i = 1; i < threads; ++i) pool.emplace_back(work);
  work();
  for (std::thread& thread : pool) thread.join();
  if (failure) std::rethrow_exception(failure);

  std::ofstream rgb(folder / "rgb.txt"), depth(folder / "depth.txt"), labels(folder / "labels.txt"),
      truth(folder / "groundtruth.txt"), boxes(folder / "boxes.txt"), detections(folder / "detections.txt"),
      camera(folder / "camera.txt");
  const ImageCamera& c = options.camera;
  camera << "# fx fy cx cy width height depth_units_per_metre"
         << (c.fisheye ? " fisheye k1 k2 k3 k4" : "; images are undistorted") << '\n';
  const double told = 1 + options.focal_error;
  for (const double value : {told * c.fx, told * c.fy, c.cx, c.cy, double(c.width), double(c.height)})
    camera << cfp_examples::general(value, 6) << ' ';
  camera << cfp_examples::general(options.sensor.depth_units_per_metre, 6);
  if (c.fisheye) camera << " fisheye" << columns({c.fisheye->k1, c.fisheye->k2, c.fisheye->k3, c.fisheye->k4}, 8);
  camera << '\n';
  rgb << "# color images: timestamp filename\n";
  depth << "# depth maps, 16-bit, 0 = none: timestamp filename\n";
  labels << "# labels, 8-bit, 0 = static, 1 = moving, 2 = part of a person but still: timestamp filename\n";
  truth << "# ground truth, camera to world: timestamp tx ty tz qx qy qz qw\n";
  boxes << "# true boxes of what is visible: timestamp identity x1 y1 x2 y2 visible_fraction pixels\n";
  detections << "# simulated detector: timestamp class score x1 y1 x2 y2\n";
  Detector detector(options.detector, options.seed);
  for (int k = 0; k < options.frames; ++k) {
    const std::string stamp = cfp_examples::fixed(sequence.stamp_of(k), 6);
    rgb << stamp << " rgb/" << stamp << ".png\n";
    depth << stamp << " depth/" << stamp << ".png\n";
    labels << stamp << " labels/" << stamp << ".png\n";
    truth << cfp_examples::tum_line({sequence.stamp_of(k), sequence.T_world_cam(k)}) << '\n';
    const auto& seen = people[static_cast<std::size_t>(k)];
    for (std::size_t who = 0; who < seen.size(); ++who) {
      const Sighting& s = seen[who];
      if (s.pixels > 0) {
        boxes << stamp << ' ' << std::to_string(who + 1) << columns({s.box.x1, s.box.y1, s.box.x2, s.box.y2}, 0)
              << columns({s.visible}, 3) << ' ' << std::to_string(s.pixels) << '\n';
      }
    }
    for (const Detection& d :
         detector.detect(seen, sequence.rotation_rate(k), options.blur_samples > 1, c.width, c.height)) {
      detections << stamp << " person" << columns({d.score}, 4) << columns({d.box.x1, d.box.y1, d.box.x2, d.box.y2}, 2)
                 << '\n';
    }
  }
  for (std::ofstream* file : {&rgb, &depth, &labels, &truth, &boxes, &detections, &camera}) {
    if (!file->flush()) throw std::runtime_error("cannot write text files into " + folder.string());
  }
}

}  // namespace synthetic
