// Trains a vocabulary for ORB-SLAM2, whose own is not always to be had, on images of recordings:
//   train_vocabulary OUT.txt RECORDING...
#include <cstdio>
#include <exception>
#include <vector>

#include "Converter.h"
#include "ORBVocabulary.h"
#include "ORBextractor.h"
#include "support/sequence.hpp"

int main(int argc, char* argv[]) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: %s OUT.txt RECORDING...\n", argv[0]);
    return 2;
  }
  try {
    ORB_SLAM2::ORBextractor extract(1000, 1.2F, 8, 20, 7);
    std::vector<std::vector<cv::Mat>> images;
    for (int k = 2; k < argc; ++k) {
      const cfp_examples::Sequence recording(argv[k]);
      for (std::size_t i = 0; i < recording.size(); i += 5) {
        cv::Mat gray, descriptors;
        const cfp_examples::SequenceFrame frame = recording.load(i);
        if (!frame.usable) continue;
        cv::cvtColor(frame.bgr, gray, cv::COLOR_BGR2GRAY);
        std::vector<cv::KeyPoint> keypoints;
        extract(gray, cv::Mat(), keypoints, descriptors);
        images.push_back(ORB_SLAM2::Converter::toDescriptorVector(descriptors));
      }
    }
    ORB_SLAM2::ORBVocabulary vocabulary(10, 4, DBoW2::TF_IDF, DBoW2::L1_NORM);
    vocabulary.create(images);
    vocabulary.saveToTextFile(argv[1]);
    std::printf("%u words of %zu images\n", vocabulary.size(), images.size());
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
