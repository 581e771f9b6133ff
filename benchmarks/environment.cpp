// Prints, as JSON, what a benchmark's figures depend on: compiler, flags, instruction set, versions of Eigen and of the
// peers.
#include <cstdio>

#include <benchmark/benchmark.h>
#include <Eigen/Core>

#include "cfp/simd/packet.hpp"
#include "cfp/version.hpp"

#ifdef CFP_HAVE_BOOST
#include <boost/version.hpp>
#endif
#ifdef CFP_HAVE_CERES
#include <ceres/version.h>
#endif
#ifdef CFP_HAVE_DLIB
#include <dlib/revision.h>
#endif
#ifdef CFP_HAVE_NANOFLANN
#include <nanoflann.hpp>
#endif
#ifdef CFP_HAVE_OPENCV
#include <opencv2/core/version.hpp>
#endif

int main() {
#if defined(__clang__)
  std::printf("{\"compiler\": \"Clang %s\", ", __clang_version__);
#elif defined(__GNUC__)
  std::printf("{\"compiler\": \"GCC %s\", ", __VERSION__);
#else
  std::printf("{\"compiler\": \"other\", ");
#endif
  std::printf(
      "\"flags\": \"%s\", \"instruction set\": \"%s, %d floats and %d doubles at once\", \"cfp\": \"%s\", \"Eigen\": "
      "\"%d.%d.%d\"",
      CFP_BENCHMARK_FLAGS, Eigen::SimdInstructionSetsInUse(), static_cast<int>(cfp::simd::Packet<float>::lanes),
      static_cast<int>(cfp::simd::Packet<double>::lanes), CFP_VERSION_STRING, EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION,
      EIGEN_MINOR_VERSION);
#ifdef CFP_HAVE_BOOST
  std::printf(", \"Boost\": \"%d.%d\"", BOOST_VERSION / 100000, BOOST_VERSION / 100 % 1000);
#endif
#ifdef CFP_HAVE_CERES
  std::printf(", \"Ceres\": \"%s\"", CERES_VERSION_STRING);
#endif
#ifdef CFP_HAVE_DLIB
  std::printf(", \"dlib\": \"%d.%d\"", DLIB_MAJOR_VERSION, DLIB_MINOR_VERSION);
#endif
#ifdef CFP_HAVE_NANOFLANN
  std::printf(", \"nanoflann\": \"%x\"", NANOFLANN_VERSION);
#endif
#ifdef CFP_HAVE_OPENCV
  std::printf(", \"OpenCV\": \"%s\"", CV_VERSION);
#endif
  std::printf("}\n");
  return 0;
}
