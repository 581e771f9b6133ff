// Optical flow for the object stage: how few points, how small a window, which points, and is tracking back worth its
// time? The usual way (1000 corners over the whole image, 22x22, five levels, no check) against keypoints of the
// previous frame on pyramids that are kept. On rendered sequences with labels: time on one core for flow and for F and
// O, and how well O tells moving people from still ones (AUC; a box is moving when at least half, still when at most 2
// % of its person pixels move). Supports cfp::OpticalFlowOptions, and edge_px of cfp::sample_depth: rendered depth fits
// its image to the pixel, so --depth spoils it as sensors do: of the frame before, shifted by 6 and 3 px, or what is
// near widened by 6 px, as stereo matching does; or there is none, as with one camera. --masks gives the people's
// pixels in the place of boxes, cut (below 0) or grown by so many px, as networks do.
//   cfp_object_flow_study [--depth late|shifted|widened|none] [--masks PX]
//                         [--smoke | --frames N | [--still] TUM_FOLDER...]
// Instead of rendering it takes folders of cfp_synthetic; one without labels, with a detections.txt, gives times and
// mean O alone (as "partly"). With --still nothing moves in the folders, and three boxes on what is there are people at
// rest: what a real camera errs by (rolling shutter, lens, late depth) must not make them move.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "../../examples/detection/simple_detectors.hpp"
#include "../../examples/support/sequence.hpp"
#include "../../examples/synthetic/sequence.hpp"
#include "cfp/core/random.hpp"
#include "cfp/evaluation/calibration.hpp"
#include "cfp/frame/begin_frame.hpp"
#include "cfp/frame/estimate_objects.hpp"
#include "cfp/frame/label_image.hpp"
#include "cfp/interop/opencv.hpp"
#include "cfp/interop/opencv_flow.hpp"

namespace {

using Pairs = std::pair<std::vector<cv::Point2f>, std::vector<cv::Point2f>>;

struct Person {
  cfp::Box<float> box;
  double moving_share = 0;
};

struct Image {
  cv::Mat gray, depth, mask;  // mask: empty, or v for person v - 1
  double metres_per_unit = 0;
  std::vector<cv::KeyPoint> keypoints;
  std::vector<Person> people;
};

// A way to make the pairs, with what it measured.
struct Candidate {
  std::string name;
  std::function<void(const cv::Mat& previous, const Image& before, const Image& now, Pairs& pairs)> track;
  double edge_px = 0;
  std::optional<double> of_keypoints_px{};  // the pairs come without depths: CoarseOptions::flow_depth_radius_px
  std::vector<double> flow_ms{}, object_ms{}, total_ms{};
  std::vector<float> score{};
  std::vector<char> is_static{};
  double still_sum = 0, moving_sum = 0, partly_sum = 0, pairs = 0;
  std::size_t still = 0, moving = 0, partly = 0, unknown = 0, frames = 0, still_passed = 0, moving_passed = 0,
              no_model = 0, up_to_scale = 0;
};

double processor_ms() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// Tracks back as well, and drops pairs that return further than half a pixel from where they came. It doubles the time,
// and O of one who moves an arm rises, as the pairs on the arm are those it drops.
void drop_what_strays(const cv::Mat& previous, const cv::Mat& now, int window, int levels, Pairs& pairs) {
  std::vector<cv::Point2f> back;
  std::vector<unsigned char> found;
  std::vector<float> error;
  if (pairs.first.empty()) return;
  cv::calcOpticalFlowPyrLK(now, previous, pairs.second, back, found, error, {window, window}, levels - 1);
  Pairs kept;
  for (std::size_t i = 0; i < back.size(); ++i) {
    const cv::Point2f strayed = back[i] - pairs.first[i];
    if (found[i] == 0 || std::hypot(strayed.x, strayed.y) > 0.5F) continue;
    kept.first.push_back(pairs.first[i]);
    kept.second.push_back(pairs.second[i]);
  }
  pairs = kept;
}

// Corners of its own on the previous image, pyramids built anew.
Candidate corners(const std::string& name, int count, double quality, double distance, int window, int levels,
                  bool backward) {
  return {name, [=](const cv::Mat& previous, const Image&, const Image& now, Pairs& pairs) {
            std::vector<cv::Point2f> from, to;
            std::vector<unsigned char> found;
            std::vector<float> error;
            cv::goodFeaturesToTrack(previous, from, count, quality, distance);
            if (from.empty()) return;
            cv::calcOpticalFlowPyrLK(previous, now.gray, from, to, found, error, {window, window}, levels - 1);
            for (std::size_t i = 0; i < from.size(); ++i) {
              if (found[i] == 0) continue;
              pairs.first.push_back(from[i]);
              pairs.second.push_back(to[i]);
            }
            if (backward) drop_what_strays(previous, now.gray, window, levels, pairs);
          }};
}

Candidate tracker(const std::string& name, const cfp::OpticalFlowOptions& options, bool backward = false) {
  auto state = std::make_shared<std::pair<cfp::OpticalFlowTracker, std::vector<cfp::Box<float>>>>(
      cfp::OpticalFlowTracker(options), std::vector<cfp::Box<float>>());
  return {name, [=](const cv::Mat& previous, const Image& before, const Image& now, Pairs& pairs) {
            auto& [flow, boxes] = *state;
            boxes.clear();
            for (const Person& person : before.people) boxes.push_back(person.box);
            if (previous.empty()) flow.reset();
            flow.track(now.gray, before.keypoints, boxes);
            pairs = {flow.previous(), flow.current()};
            if (backward) drop_what_strays(previous, now.gray, options.window, options.levels, pairs);
          }};
}

std::vector<Candidate> candidates() {
  const auto with = [](auto change) {
    cfp::OpticalFlowOptions o;
    change(o);
    return o;
  };
  std::vector<Candidate> all;
  all.push_back(corners("1000 corners, 22 px, 5 levels", 1000, 0.01, 8, 22, 5, false));
  all.push_back(corners("500 corners, 22 px, 5 levels", 500, 0.01, 8, 22, 5, false));
  all.push_back(corners("500 corners, 21 px, 5 levels, back", 500, 0.01, 8, 21, 5, true));
  all.push_back(tracker("default", {}));
  all.push_back(
      tracker("  keypoints alone, 300 outside", with([](auto& o) { o.corners = 0, o.keypoints_outside = 300; })));
  all.push_back(tracker("  corners alone", with([](auto& o) { o.keypoints_per_box = 0; })));
  all.push_back(tracker("  250 corners", with([](auto& o) { o.corners = 250; })));
  all.push_back(tracker("  800 corners", with([](auto& o) { o.corners = 800; })));
  all.push_back(tracker("  50 keypoints in a box", with([](auto& o) { o.keypoints_per_box = 50; })));
  all.push_back(tracker("  300 keypoints in a box", with([](auto& o) { o.keypoints_per_box = 300; })));
  all.push_back(tracker("  corners 12 px apart", with([](auto& o) { o.corner_distance = 12; })));
  all.push_back(tracker("  window 9", with([](auto& o) { o.window = 9; })));
  all.push_back(tracker("  window 15", with([](auto& o) { o.window = 15; })));
  all.push_back(tracker("  window 21", with([](auto& o) { o.window = 21; })));
  all.push_back(tracker("  3 levels", with([](auto& o) { o.levels = 3; })));
  all.push_back(tracker("  10 iterations", with([](auto& o) { o.iterations = 10; })));
  all.push_back(tracker("  tracked back as well", {}, true));
  for (const double edge_px : {3.0, 5.0, 8.0}) {
    all.push_back(tracker("  no depth " + std::to_string(int(edge_px)) + " px from edges", {}));
    all.back().edge_px = edge_px;
  }
  for (const double radius_px : {0.0, 1.0, 3.0, 5.0, 8.0, 12.0}) {
    all.push_back(tracker("  depths of keypoints in " + std::to_string(int(radius_px)) + " px", {}));
    all.back().of_keypoints_px = radius_px;
  }
  return all;
}

double moving_share(const cv::Mat& labels, const cv::Mat& inside) {
  const int moving = cv::countNonZero((labels == 1) & inside), still = cv::countNonZero((labels == 2) & inside);
  return moving + still > 0 ? double(moving) / (moving + still) : 0;
}
double moving_share(const cv::Mat& labels, const cfp::Box<float>& box) {
  if (labels.empty()) return std::numeric_limits<double>::quiet_NaN();
  cv::Mat inside = cv::Mat::zeros(labels.size(), CV_8U);
  cv::rectangle(inside, cv::Rect(int(box.x1), int(box.y1), int(std::ceil(box.width())), int(std::ceil(box.height()))),
                255, cv::FILLED);
  return moving_share(labels, inside);
}

// People as a network segments them: connected pixels of theirs are one object, 2000 of them at least.
void add_masks(const cv::Mat& labels, int grow_px, Image& image) {
  const int size = 2 * std::abs(grow_px) + 1;
  const cv::Mat disc = cv::getStructuringElement(cv::MORPH_ELLIPSE, {size, size});
  cv::Mat people = labels != 0, pieces, sizes, centres;
  grow_px < 0 ? cv::erode(people, people, disc) : cv::dilate(people, people, disc);
  const int count = cv::connectedComponentsWithStats(people, pieces, sizes, centres);
  image.mask = cv::Mat::zeros(labels.size(), CV_8U);
  std::vector<double> share;
  for (int k = 1; k < count; ++k) {
    if (sizes.at<int>(k, cv::CC_STAT_AREA) < 2000) continue;
    share.push_back(moving_share(labels, pieces == k));
    image.mask.setTo(double(share.size()), pieces == k);
  }
  std::vector<cfp::Detection<float>> found;
  cfp::detections_of(cfp::label_view(image.mask), 0, found);
  for (std::size_t b = 0; b < found.size(); ++b) image.people.push_back({found[b].box, share[b]});
}

void judge(std::vector<Candidate>& all, const std::vector<Image>& images, const cfp::PinholeCamera<float>& camera) {
  cfp::FrameOptions options;
  cfp::FrameState<float> state;
  for (std::size_t k = 0; k < images.size(); ++k) {
    for (std::size_t turn = 0; turn < all.size(); ++turn) {
      Candidate& c = all[(turn + k) % all.size()];
      Pairs pairs;
      const double start = processor_ms();
      if (k == 0) {
        static const Image nothing;
        if (c.name.find("corners") == std::string::npos) c.track({}, nothing, images[0], pairs);
        continue;
      }
      c.track(images[k - 1].gray, images[k - 1], images[k], pairs);
      const double tracked = processor_ms();
      const Image& before = images[k - 1];
      const auto depths_at = [&](const cfp::PointSpan<float, 2>& pixels) {
        std::vector<float> depths_m(before.depth.empty() ? 0 : pixels.size());
        if (!depths_m.empty()) cfp::sample_depth(before.depth, pixels, before.metres_per_unit, depths_m, c.edge_px);
        return depths_m;
      };
      cfp::Frame<float> last, frame;
      frame.timestamp_s = 1.0 / 30;
      std::vector<float> depths_m = depths_at(c.of_keypoints_px ? cfp::view(before.keypoints) : cfp::view(pairs.first));
      frame.flow = {cfp::view(pairs.first), cfp::view(pairs.second)};
      if (c.of_keypoints_px) {
        last.keypoints = cfp::view(before.keypoints);
        last.depths = depths_m;
        options.coarse.flow_depth_radius_px = *c.of_keypoints_px;
      } else {
        frame.flow.previous_depths = depths_m;
      }
      if (!images[k].mask.empty()) frame.labels = cfp::label_view(images[k].mask);
      cfp::begin_frame(last, state);
      cfp::begin_frame(frame, state);
      for (const Person& person : images[k].people) {
        cfp::TrackedBox<float> box;
        box.box = person.box;
        box.detection = static_cast<int>(state.boxes.size());
        state.boxes.push_back(box);
      }
      cfp::estimate_objects(frame, camera, options, state);
      const std::vector<cfp::ObjectProbability>& objects = state.objects;
      const cfp::FrameReport& result = state.report;
      const double end = processor_ms();
      c.flow_ms.push_back(tracked - start);
      c.object_ms.push_back(end - tracked);
      c.total_ms.push_back(end - start);
      c.pairs += static_cast<double>(pairs.first.size());
      ++c.frames;
      c.no_model += result.flow_model == cfp::FlowModelKind::none ? 1U : 0U;
      c.up_to_scale += result.flow_model == cfp::FlowModelKind::motion_up_to_scale ? 1U : 0U;
      for (std::size_t b = 0; b < objects.size(); ++b) {
        const double share = images[k].people[b].moving_share, o = objects[b].static_probability;
        if (objects[b].status != cfp::Status::ok) ++c.unknown;
        if (!(share <= 0.02 || share >= 0.5)) {
          c.partly_sum += o;
          ++c.partly;
          continue;
        }
        const bool is_static = share <= 0.02;
        c.score.push_back(static_cast<float>(o));
        c.is_static.push_back(is_static ? 1 : 0);
        (is_static ? c.still_sum : c.moving_sum) += o;
        ++(is_static ? c.still : c.moving);
        if (o > options.object_threshold) ++(is_static ? c.still_passed : c.moving_passed);
      }
    }
  }
}

// The depth image as another sensor would have it.
cv::Mat spoiled(const cv::Mat& depth, const std::string& how, cv::Mat& last) {
  if (how == "none") return {};
  cv::Mat out = depth.clone();
  if (how == "late" && last.size() == depth.size()) out = last;
  if (how == "shifted")
    cv::warpAffine(depth, out, cv::Mat(cv::Matx23d(1, 0, 6, 0, 1, 3)), depth.size(), cv::INTER_NEAREST);
  if (how == "widened") {
    out.setTo(65535, depth == 0);
    cv::erode(out, out, cv::Mat::ones(13, 13, CV_8U));
    out.setTo(0, out == 65535);
  }
  last = depth.clone();
  return out;
}

// Boxes as of people on what is there, which shake as a detector's.
void add_still(const cv::Size& size, cfp::Random& random, Image& image) {
  for (const double left : {0.1, 0.36, 0.67}) {
    const double top = random.uniform(0.08, 0.22), width = 0.25;
    const auto edge = [&](double share, int pixels) { return float(share * pixels + random.uniform(-2, 2)); };
    image.people.push_back(
        {{edge(left, size.width), edge(top, size.height), edge(left + width, size.width), edge(top + 0.7, size.height)},
         0});
  }
}

void finish(Image& image, const cv::Mat& bgr, cv::ORB& orb) {
  cv::cvtColor(bgr, image.gray, cv::COLOR_BGR2GRAY);
  orb.detect(image.gray, image.keypoints);
}

void print(const std::vector<Candidate>& all) {
  std::printf("%-36s %6s | %6s %6s %6s %6s %6s | %7s %7s %7s | %7s %7s | %7s %5s %5s | %4s %4s %4s\n", "", "pairs",
              "flow", "F, O", "sum", "95 %", "ratio", "AUC", "still>", "moving>", "O still", "moving", "partly",
              "boxes", "unkn.", "T, F", "T~", "none");
  for (const Candidate& c : all) {
    const auto auc = cfp::roc_auc(c.score, c.is_static);
    const auto mean = [](double sum, std::size_t n) { return n > 0 ? sum / static_cast<double>(n) : 0.0; };
    std::printf(
        "%-36s %6.0f | %6.2f %6.2f %6.2f %6.2f %6.2f | %7.4f %7.3f %7.3f | %7.3f %7.3f | %7.3f %5zu %5zu | %4zu %4zu "
        "%4zu\n",
        c.name.c_str(), mean(c.pairs, c.frames), quantile(c.flow_ms, 0.5), quantile(c.object_ms, 0.5),
        quantile(c.total_ms, 0.5), quantile(c.total_ms, 0.95),
        quantile(c.total_ms, 0.5) / quantile(all[0].total_ms, 0.5), auc.auc, mean(double(c.still_passed), c.still),
        mean(double(c.moving_passed), c.moving), mean(c.still_sum, c.still), mean(c.moving_sum, c.moving),
        mean(c.partly_sum, c.partly), c.still + c.moving + c.partly, c.unknown, c.frames - c.no_model - c.up_to_scale,
        c.up_to_scale, c.no_model);
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::vector<std::string> folders;
  std::string depth_is;
  std::optional<int> mask_px;
  int frames = 60;
  bool smoke = false, still = false;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--smoke") {
      smoke = true;
    } else if (word == "--still") {
      still = true;
    } else if (word == "--depth" && i + 1 < argc) {
      depth_is = argv[++i];
      if (depth_is != "late" && depth_is != "shifted" && depth_is != "widened" && depth_is != "none") {
        std::fprintf(stderr, "--depth: late, shifted, widened or none, not '%s'\n", depth_is.c_str());
        return 2;
      }
    } else if (word == "--masks" && i + 1 < argc) {
      mask_px = std::atoi(argv[++i]);
    } else if (word == "--frames" && i + 1 < argc) {
      frames = std::max(2, std::atoi(argv[++i]));
    } else {
      folders.push_back(word);
    }
  }
  if (still && folders.empty()) {
    std::fprintf(stderr, "--still: names folders in which nothing moves\n");
    return 2;
  }
  cv::setNumThreads(1);
  const cv::Ptr<cv::ORB> orb = cv::ORB::create(1000, 1.2F, 8, 15, 0, 2, cv::ORB::HARRIS_SCORE, 31, 10);
  std::vector<Candidate> all = candidates();
  std::vector<Image> images;
  cv::Mat last_depth;
  cfp::Random random(1, "still");
  const auto add = [&](const cv::Mat& bgr, const cv::Mat& depth, double units_per_metre, const cv::Mat& labels,
                       const std::vector<cfp::Box<float>>& boxes) {
    Image image;
    finish(image, bgr, *orb);
    if (images.empty()) last_depth.release();
    image.depth = spoiled(depth, depth_is, last_depth);
    image.metres_per_unit = 1 / units_per_metre;
    if (still)
      add_still(bgr.size(), random, image);
    else if (mask_px && !labels.empty())
      add_masks(labels, *mask_px, image);
    else
      for (const auto& box : boxes) image.people.push_back({box, moving_share(labels, box)});
    images.push_back(std::move(image));
  };
  for (const std::string& folder : folders) {
    const cfp_examples::Sequence sequence(folder);
    std::unique_ptr<cfp_examples::FileDetector> detections;
    images.clear();
    for (std::size_t i = 0; i < sequence.size(); ++i) {
      const cfp_examples::SequenceFrame frame = sequence.load(i);
      std::vector<cfp::Box<float>> boxes;
      for (const auto& b : sequence.true_boxes(i)) {
        if (b.pixels >= 2000 && b.visible_fraction >= 0.3) boxes.push_back(b.box);
      }
      if (!frame.usable) continue;
      std::string note;
      const cv::Mat labels = sequence.load_labels(i, note);
      if (labels.empty() && !still) {
        if (!detections)
          detections = std::make_unique<cfp_examples::FileDetector>((sequence.folder() / "detections.txt").string(),
                                                                    cfp_examples::DetectorOptions{});
        for (const auto& d : detections->detect(frame.bgr, frame.time_s)) boxes.push_back(d.box);
      }
      add(frame.bgr, frame.depth, sequence.calibration().depth_units_per_metre, labels, boxes);
    }
    const auto& c = sequence.calibration();
    judge(all, images, {float(c.fx), float(c.fy), float(c.cx), float(c.cy)});
  }
  for (int s = 0; s < 8 && folders.empty(); ++s) {
    if (smoke && s % 4 != 1) continue;
    synthetic::SequenceOptions options;
    options.scenario = static_cast<synthetic::Scenario>(s / 4);
    options.motion = static_cast<synthetic::Motion>(s % 4);
    options.seed = 3;
    options.frames = smoke ? 3 : frames;
    const synthetic::Sequence sequence(options);
    synthetic::Renderer renderer;
    synthetic::RenderedFrame frame;
    images.clear();
    for (int k = 0; k < options.frames; ++k) {
      sequence.render(k, renderer, frame);
      std::vector<cfp::Box<float>> boxes;
      for (const auto& person : frame.truth.people) {
        if (person.pixels >= 2000 && person.visible >= 0.3)
          boxes.push_back({float(person.box.x1), float(person.box.y1), float(person.box.x2), float(person.box.y2)});
      }
      add(frame.color, frame.depth, options.sensor.depth_units_per_metre, frame.label, boxes);
    }
    const auto& c = sequence.options().camera;
    judge(all, images, {float(c.fx), float(c.fy), float(c.cx), float(c.cy)});
  }
  std::printf(
      "processor ms per frame on one core (medians; ratio of sums to the first line), AUC of O, share with O > 0.9, "
      "mean O; frames judged by a motion or F, by a motion up to scale (T~), by nothing\n");
  print(all);
  return 0;
}
