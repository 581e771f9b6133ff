// Feeds a recording to ORB-SLAM2 or ORB-SLAM3 in real time and writes the trajectory, as its rgbd_tum does, with the
// detections of the recording's detections.txt:
//   rgbd VOCABULARY.txt RECORDING TRAJECTORY.txt VARIANT [mono]
// Built by their CMakeLists.txt, with cfp/include and cfp/examples among the include directories.
// VARIANT: plain (cfp is not called), cfp or another of cfp::Variant's names. mono: without the depths. SPEED=0.2 in
// the environment feeds a fifth of the images per second, for machines that do other work.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "System.h"
#include "detection/simple_detectors.hpp"
#include "support/sequence.hpp"
#include "support/variant.hpp"

#if __has_include("Atlas.h")
namespace host = ORB_SLAM3;
#else
namespace host = ORB_SLAM2;
#endif

namespace {

// Of the recording's time.
double speed() {
  const char* text = std::getenv("SPEED");
  const double value = text == nullptr ? 1 : std::strtod(text, nullptr);
  if (!(value > 0)) throw std::runtime_error("SPEED must be a number above 0");
  return value;
}

// What both read: the recording's camera, and the values of its own RGB-D examples.
std::string settings_of(const cfp_examples::TumCamera& c, const std::string& file) {
  std::ofstream out(file);
  out << std::showpoint  // ORB-SLAM3 takes 0 for no real number
      << "%YAML:1.0\n"
      << "Camera.type: " << (c.fisheye ? "KannalaBrandt8" : "PinHole") << "\nCamera.fx: " << c.fx
      << "\nCamera.fy: " << c.fy << "\nCamera.cx: " << c.cx << "\nCamera.cy: " << c.cy << "\nCamera.k1: " << c.k1
      << "\nCamera.k2: " << c.k2 << "\nCamera.p1: " << c.p1 << "\nCamera.p2: " << c.p2 << "\nCamera.k3: " << c.k3
      << "\nCamera.k4: " << c.k4 << "\nCamera.fps: 30.0\nCamera.bf: 40.0\nCamera.RGB: 0\nThDepth: 40.0\n"
      << "DepthMapFactor: " << c.depth_units_per_metre << "\nORBextractor.nFeatures: 1000\n"
      << "ORBextractor.scaleFactor: 1.2\nORBextractor.nLevels: 8\nORBextractor.iniThFAST: 20\n"
      << "ORBextractor.minThFAST: 7\n";
  if (!out.flush()) throw std::runtime_error(file + " cannot be written");
  return file;
}

void run(const char* vocabulary, const char* folder, const std::string& trajectory, cfp::Variant variant, bool mono) {
  using Clock = std::chrono::steady_clock;
  const cfp_examples::Sequence recording(folder);
  cfp_examples::FileDetector detector(std::string(folder) + "/detections.txt", {});
  const auto& camera = recording.calibration();
  if (camera.fisheye && !mono) throw std::runtime_error("they take no depths with a fisheye: run it with mono");
  host::System slam(vocabulary, settings_of(camera, trajectory + ".yaml"),
                    mono ? host::System::MONOCULAR : host::System::RGBD, false);
  const bool plain = variant == cfp::Variant::plain;
  cfp::FrameOptions options = cfp::variant_options(
      variant, cfp_integration::StaticWeightsOptions(detector.class_of("person"), camera.width, camera.height));
  if (!plain) slam.UseStaticWeights(options);

  std::vector<double> milliseconds;
  const double times = speed();
  const auto start = Clock::now();
  for (std::size_t i = 0; i < recording.size(); ++i) {
    const cfp_examples::SequenceFrame frame = recording.load(i);
    if (!frame.usable) continue;
    if (!plain) slam.SetDetections(detector.detect(frame.bgr, frame.time_s));
    std::this_thread::sleep_until(start + std::chrono::duration<double>((frame.time_s - recording.time_s(0)) / times));
    const auto begin = Clock::now();
    if (mono) {
      slam.TrackMonocular(frame.bgr, frame.time_s);
    } else {
      slam.TrackRGBD(frame.bgr, frame.depth, frame.time_s);
    }
    milliseconds.push_back(std::chrono::duration<double, std::milli>(Clock::now() - begin).count());
  }
  slam.Shutdown();
  if (mono) {
    slam.SaveKeyFrameTrajectoryTUM(trajectory);
  } else {
    slam.SaveTrajectoryTUM(trajectory);
  }
  std::sort(milliseconds.begin(), milliseconds.end());
  if (!milliseconds.empty()) std::printf("median %.1f ms per frame\n", milliseconds[milliseconds.size() / 2]);
}

}  // namespace

int main(int argc, char* argv[]) {
  const bool mono = argc == 6 && std::strcmp(argv[5], "mono") == 0;
  if (argc != 5 && !mono) {
    std::fprintf(stderr, "usage: %s VOCABULARY.txt RECORDING TRAJECTORY.txt VARIANT [mono]\n", argv[0]);
    return 2;
  }
  try {
    run(argv[1], argv[2], argv[3], cfp_examples::variant_of(argv[4]), mono);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
