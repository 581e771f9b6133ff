#include "../../examples/detection/detector.hpp"

#include <future>

#include <opencv2/imgcodecs.hpp>

#include "../../examples/support/tum.hpp"
#include "support/catch.hpp"
#include "support/data.hpp"
#include "support/temporary_folder.hpp"

using namespace cfp_examples;
using cfp_test::error_of;

namespace {

bool same(const Detections& a, const Detections& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const auto& x, const auto& y) {
    return x.class_id == y.class_id && x.score == y.score && x.box.x1 == y.box.x1 && x.box.y1 == y.box.y1 &&
           x.box.x2 == y.box.x2 && x.box.y2 == y.box.y2;
  });
}

}  // namespace

TEST_CASE("An image fitted into a network's input maps back to where it was", "[detector]") {
  cv::Mat image(480, 640, CV_8UC3, cv::Scalar::all(0));
  const cv::Rect mark(200, 100, 160, 240);
  image(mark).setTo(cv::Scalar(255, 255, 255));
  for (const bool keep_aspect : {false, true}) {
    for (const cv::Size input : {cv::Size(320, 320), cv::Size(640, 640), cv::Size(416, 320), cv::Size(96, 320)}) {
      cv::Mat fitted, bright;
      const InputMapping mapping = fit_image(image, input, keep_aspect, fitted);
      REQUIRE(fitted.size() == input);
      cv::extractChannel(fitted, bright, 0);
      const cv::Rect found = cv::boundingRect(bright > 127);
      const auto box = mapping.to_image({float(found.x), float(found.y), float(found.br().x), float(found.br().y)});
      const double pixel = 1.01 / double((std::min)(mapping.scale_x, mapping.scale_y));
      CHECK_THAT(box.x1, WithinAbs(mark.x, pixel));
      CHECK_THAT(box.y1, WithinAbs(mark.y, pixel));
      CHECK_THAT(box.x2, WithinAbs(mark.br().x, pixel));
      CHECK_THAT(box.y2, WithinAbs(mark.br().y, pixel));
      const cv::Scalar border = cv::mean(fitted(cv::Rect(0, 0, keep_aspect ? input.width : 1, 1)));
      CHECK(border[0] == (keep_aspect && (input.height > input.width * 3 / 4) ? 114 : 0));
    }
  }
}

TEST_CASE("Boxes of a text file come by time stamp, clipped to the image", "[detector]") {
  const cfp_test::TemporaryFolder folder;
  const auto detector = make_detector(folder.write("d.txt",
                                                   "# boxes\n1.0 person 0.9 -10 5 50 700\n1.0 cup 0.3 1 1 9 9\n2.0 "
                                                   "person 0.8 900 5 950 70\n3.0 person 0.5 1 2 3 4\n"));
  const cv::Mat image(480, 640, CV_8UC3);
  CHECK(detector->class_of("person") == 0);
  CHECK(detector->class_of("cup") == 1);
  CHECK(detector->class_of("dog") == -1);
  for (const double offset : {0.0, 0.0049, -0.0049}) {
    const Detections found = detector->detect(image, 1.0 + offset);
    REQUIRE(found.size() == 2);
    CHECK((found[0].box.x1 == 0 && found[0].box.y2 == 480 && found[1].class_id == 1));
  }
  for (const double time : {0.0, 1.0051, 1.5, 9.0, 1e300, std::nan("")}) CHECK(detector->detect(image, time).empty());
  CHECK(detector->detect(image, 2).empty());  // wholly outside
  CHECK(detector->detect(image, 3.004).size() == 1);
  CHECK(detector->detect(cv::Mat(), 3).empty());
}

TEST_CASE("A file of boxes of which none is of use says why", "[detector]") {
  const cfp_test::TemporaryFolder folder;
  const cv::Mat image(480, 640, CV_8UC3);
  const auto complaint = [&](const std::string& text, double time) {
    const auto detector = make_detector(folder.write("d.txt", text));
    (void)detector->detect(image, time);
    return detector->complaint();
  };
  CHECK(complaint("1.0 person 0.9 1 5 50 70\n", 1).empty());
  CHECK(complaint("# the detector saw nothing\n", 1).empty());
  CHECK(complaint("1.0 person 0.9 1 5 50 70\n2.0 person 0.9 1 5 50 70\n", 1.012)
            .find("d.txt: no image is within 5 ms of any of its 2 time stamps") != std::string::npos);
  CHECK(complaint("1.0 Person 0.9 1 5 50 70\n", 1).find("d.txt: no class 'person'") != std::string::npos);
  CHECK(make_detector("none")->complaint().empty());
  CHECK(make_detector("hog")->complaint().empty());
}

TEST_CASE("What cannot be used as a detector is refused by name", "[detector]") {
  const cfp_test::TemporaryFolder folder;
  const auto refused = [](const std::string& spec, const std::string& word) {
    const std::string error = error_of([&] { (void)make_detector(spec); });
    INFO(spec << " -> " << error);
    CHECK(error.find(word) != std::string::npos);
  };
  refused("", "no detector ''");
  refused("yolo", "no detector 'yolo'");
  refused((folder.path / "absent.txt").string(), "absent.txt");
  refused((folder.path / "absent.onnx").string(), "absent.onnx: no such file");
  refused((folder.path / "absent.onnx@640").string(), "absent.onnx: no such file");
  for (const char* size : {"", "x", "640x", "0", "-3", "640x480x3", "1e9", "640 "})
    refused((folder.path / "absent.onnx@").string() + size, "is no size");
  refused(folder.write("boxes.txt", "1 person 0.5 9 9 1 1\n"), "boxes.txt:1:");
  refused(folder.write("net.cfg", "[net]\nwidth=320\nheight=320\n"), "no detector");
  refused(folder.write("empty.onnx", ""), "empty.onnx");
  refused(folder.write("noise.onnx", std::string(4096, '\x3a')), "noise.onnx");
}

TEST_CASE("The networks find the two men of a real recording, in a thread of its own as well", "[detector]") {
  CFP_REQUIRE_DATA(folder, "tum_fr3_walking_halfsphere_30");
  CFP_REQUIRE_DATA(models, "detectors");
  const auto list = make_detector((folder / "detections.txt").string());
  const auto images = cfp_examples::read_tum_list(folder / "rgb.txt");
  for (const char* file : {"FastestDet.onnx@352"}) {
    const auto detector = make_detector((models / file).string());
    const int person = detector->class_of("person");
    REQUIRE(person == 0);
    int listed = 0, common = 0;
    for (std::size_t i = 0; i < images.size(); i += 6) {
      const cv::Mat image = cv::imread((folder / images[i].file).string());
      const Detections found = detector->detect(image, images[i].time_s);
      if (i == 0) CHECK(same(found, std::async(std::launch::async, [&] { return detector->detect(image, 0); }).get()));
      for (const auto& d : found)
        CHECK((cfp::is_proper(d.box) && d.box.x1 >= 0 && d.box.y1 >= 0 && d.box.x2 <= 640 && d.box.y2 <= 480));
      for (const auto& d : list->detect(image, images[i].time_s)) {
        ++listed;
        common += std::any_of(found.begin(), found.end(),
                              [&](const auto& f) { return f.class_id == person && cfp::iou(f.box, d.box) >= 0.5F; })
                      ? 1
                      : 0;
      }
    }
    INFO(file << ": " << common << " of " << listed);
    CHECK(common >= listed - 1);
    CHECK(detector->detect(cv::Mat(), 0).empty());
    CHECK_NOTHROW(detector->detect(cv::Mat(1, 1, CV_8UC3, cv::Scalar::all(9)), 0));
  }
}

TEST_CASE("The built-in people detector yields proper boxes or none", "[detector]") {
  const auto detector = make_detector("hog");
  CHECK(detector->class_of("person") == 0);
  for (const cv::Size size :
       {cv::Size(0, 0), cv::Size(1, 1), cv::Size(64, 128), cv::Size(63, 500), cv::Size(320, 240)}) {
    cv::Mat image(size, CV_8UC3);
    if (!image.empty()) cv::RNG(5).fill(image, cv::RNG::UNIFORM, 0, 256);
    for (const auto& d : detector->detect(image, 0))
      CHECK((cfp::is_proper(d.box) && d.box.x2 <= static_cast<float>(size.width)));
  }
  CHECK(make_detector("none")->detect(cv::Mat(480, 640, CV_8UC3), 0).empty());
}
