// An RGB-D recording in the format of the TUM data set: opened with every list checked, read frame by frame. What
// cannot be read is a frame with a note that says why, never an exception; what cannot be parsed refuses the recording
// with file and line.
#pragma once

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <future>
#include <string>
#include <utility>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "cfp/geometry/box.hpp"
#include "tum.hpp"

namespace cfp_examples {

struct SequenceFrame {
  double time_s = 0;
  std::string image;    // file of the colour image, relative to the folder
  cv::Mat bgr;          // 8-bit
  cv::Mat depth;        // 16-bit, units of camera.txt, 0 = none
  bool usable = false;  // colour and depth are there, of the camera's size
  std::string note;     // what is wrong, with file and line
};

// A person in truth (boxes.txt of cfp_synthetic).
struct TrueBox {
  double time_s = 0;
  int identity = 0;
  cfp::Box<float> box;
  double visible_fraction = 0;
  int pixels = 0;
};

class Sequence {
 public:
  // Reads camera.txt (or takes the published TUM camera that the folder's name tells), rgb.txt, depth.txt and, when
  // they are there, groundtruth.txt or pseudo_groundtruth.txt, labels.txt and boxes.txt. Lists are put in order; of
  // equal stamps the first line stays. Colour and depth are matched one to one, nearest first, when nearer than
  // max_difference_s, as by TUM's associate.py.
  explicit Sequence(std::filesystem::path folder, double max_difference_s = 0.02) : folder_(std::move(folder)) {
    camera_ = std::filesystem::exists(folder_ / "camera.txt") ? read_tum_camera(folder_ / "camera.txt")
                                                              : published_tum_camera(folder_);
    List colors = read_list("rgb.txt");
    const List depths = read_list("depth.txt");
    drop_absent_ends(colors);
    if (colors.empty()) throw std::runtime_error((folder_ / "rgb.txt").string() + ": no image of it is there");
    for (auto& color : colors) frames_.push_back({std::move(color), {}, {}});
    match(depths, max_difference_s, &Frame::depth);
    if (std::filesystem::exists(folder_ / "labels.txt")) match(read_list("labels.txt"), 0.001, &Frame::labels);
    for (const char* name : {"groundtruth.txt", "pseudo_groundtruth.txt"}) {
      if (!truth_file_.empty() || !std::filesystem::exists(folder_ / name)) continue;
      truth_ = read_tum_trajectory(folder_ / name);
      truth_file_ = name;
    }
    if (std::filesystem::exists(folder_ / "boxes.txt")) read_true_boxes();
  }

  [[nodiscard]] std::size_t size() const { return frames_.size(); }
  [[nodiscard]] double time_s(std::size_t i) const { return frames_.at(i).color.time_s; }
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  [[nodiscard]] std::string name() const { return folder_name(folder_); }
  [[nodiscard]] const TumCamera& calibration() const { return camera_; }
  // Camera to world, for cfp's evaluation; empty: none known.
  [[nodiscard]] const std::vector<cfp::StampedPose<double>>& truth() const { return truth_; }
  [[nodiscard]] const std::string& truth_file() const { return truth_file_; }
  // What was found odd about the lists, each with file and line.
  [[nodiscard]] const std::vector<std::string>& notes() const { return notes_; }

  [[nodiscard]] std::vector<TrueBox> true_boxes(std::size_t i) const {
    const auto from = std::lower_bound(true_boxes_.begin(), true_boxes_.end(), time_s(i) - 0.001,
                                       [](const TrueBox& b, double t) { return b.time_s < t; });
    const auto to =
        std::find_if(from, true_boxes_.end(), [&](const TrueBox& b) { return b.time_s > time_s(i) + 0.001; });
    return {from, to};
  }

  // Frame i < size(). The same from any thread, at any time, as long as the files are.
  [[nodiscard]] SequenceFrame load(std::size_t i) const {
    const Frame& frame = frames_.at(i);
    SequenceFrame out;
    out.time_s = frame.color.time_s;
    out.image = frame.color.file;
    out.bgr = read("rgb.txt", frame.color, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION, CV_8UC3, "8-bit colour",
                   out.note);
    if (frame.depth.line > 0) {
      out.depth = read("depth.txt", frame.depth, cv::IMREAD_UNCHANGED, CV_16UC1, "16-bit grey", out.note);
    } else {
      add_note("rgb.txt", frame.color, "no depth image near its time", out.note);
    }
    out.usable = !out.bgr.empty() && !out.depth.empty();
    return out;
  }

  // 8-bit: 0 static, 1 moving, 2 part of a person but still. Empty: there are none for this frame, or `note` says why.
  [[nodiscard]] cv::Mat load_labels(std::size_t i, std::string& note) const {
    const TumImage& image = frames_.at(i).labels;
    return image.line > 0 ? read("labels.txt", image, cv::IMREAD_UNCHANGED, CV_8UC1, "8-bit grey", note) : cv::Mat();
  }

 private:
  using List = std::vector<TumImage>;
  struct Frame {
    TumImage color, depth, labels;  // line 0: none
  };

  void add_note(const char* list, const TumImage& image, const std::string& what, std::string& note) const {
    note += (note.empty() ? "" : "; ") + (folder_ / list).string() + ":" + std::to_string(image.line) + ": " + what;
  }

  // The image of a list's line; empty, with a note, when it is none of this type and of the camera's size.
  cv::Mat read(const char* list, const TumImage& image, int flags, int type, const char* type_name,
               std::string& note) const {
    cv::Mat picture = read_image(folder_ / image.file, flags);
    const auto size_text = [](int width, int height) { return std::to_string(width) + "x" + std::to_string(height); };
    std::string wrong;
    if (picture.empty()) {
      wrong = " cannot be read";
    } else if (picture.cols != camera_.width || picture.rows != camera_.height) {
      wrong = " is " + size_text(picture.cols, picture.rows) + ", the camera's images are " +
              size_text(camera_.width, camera_.height);
    } else if (picture.type() != type) {
      wrong = std::string(" is not ") + type_name;
    }
    if (wrong.empty()) return picture;
    add_note(list, image, image.file + wrong, note);
    return {};
  }

  // In order of time, one line per stamp.
  List read_list(const char* name) {
    List list = read_tum_list(folder_ / name);
    const auto remark = [&](const TumImage& image, const char* what) {
      notes_.push_back((folder_ / name).string() + ":" + std::to_string(image.line) + ": " + what);
    };
    for (const auto& image : list) {
      if (!cfp::is_finite(image.time_s)) bad_line(folder_ / name, image.line, "the timestamp is not finite");
    }
    const auto earlier = [](const auto& a, const auto& b) { return a.time_s < b.time_s; };
    const auto unordered = std::is_sorted_until(list.begin(), list.end(), earlier);
    if (unordered != list.end()) {
      remark(*unordered, "earlier than the line before; the list is put in order");
      std::stable_sort(list.begin(), list.end(), earlier);
    }
    const auto repeated = [&](const auto& a, const auto& b) {
      if (a.time_s == b.time_s) remark(b, "a second line with this timestamp is left out");
      return a.time_s == b.time_s;
    };
    list.erase(std::unique(list.begin(), list.end(), repeated), list.end());
    return list;
  }

  // An excerpt of a recording comes with the whole list: images that are not there before the first and after the last
  // that is belong to no frame. Between those they are frames that cannot be read.
  void drop_absent_ends(List& list) {
    const auto there = [&](const auto& image) { return is_image_file(folder_ / image.file); };
    const auto first = std::find_if(list.begin(), list.end(), there);
    const auto last = std::find_if(list.rbegin(), std::make_reverse_iterator(first), there).base();
    const auto absent = (first - list.begin()) + (list.end() - last);
    if (absent > 0)
      notes_.push_back((folder_ / "rgb.txt").string() + ": " + std::to_string(absent) + " of " +
                       std::to_string(list.size()) + " images, before the first and after the last, are not there");
    list = List(first, last);
  }

  void match(const List& list, double max_difference_s, TumImage Frame::*member) {
    std::vector<cfp::StampedPose<double>> colors, others;  // the association of the evaluation does for images, too
    for (const Frame& frame : frames_) colors.push_back({frame.color.time_s, {}});
    for (const auto& image : list) others.push_back({image.time_s, {}});
    cfp::AssociationOptions options;
    options.max_difference_s = max_difference_s;
    for (const cfp::TimeMatch& m : cfp::associate(colors, others, options)) frames_[m.first].*member = list[m.second];
  }

  void read_true_boxes() {
    const auto file = folder_ / "boxes.txt";
    for_each_line(file, [&](int line, const std::vector<std::string>& words) {
      if (words.size() != 8) bad_line(file, line, "expected 'timestamp identity x1 y1 x2 y2 visible_fraction pixels'");
      double v[8];
      for (std::size_t i = 0; i < 8; ++i) {
        v[i] = parse_number(file, line, words[i], "box");
        if (!(std::abs(v[i]) < (i == 0 ? 1e18 : 1e9))) bad_line(file, line, "'" + words[i] + "' out of range");
      }
      true_boxes_.push_back({v[0], int(v[1]), {float(v[2]), float(v[3]), float(v[4]), float(v[5])}, v[6], int(v[7])});
    });
    std::stable_sort(true_boxes_.begin(), true_boxes_.end(),
                     [](const TrueBox& a, const TrueBox& b) { return a.time_s < b.time_s; });
  }

  // A pipe under an image's name would be waited for.
  static bool is_image_file(const std::filesystem::path& file) {
    std::error_code ignored;
    return std::filesystem::is_regular_file(file, ignored);
  }
  static cv::Mat read_image(const std::filesystem::path& file, int flags) {
    if (!is_image_file(file)) return {};
    try {
      return cv::imread(file.string(), flags);
    } catch (const cv::Exception&) {  // a header that states a monstrous size
      return {};
    }
  }

  std::filesystem::path folder_;
  TumCamera camera_;
  std::vector<Frame> frames_;
  std::vector<cfp::StampedPose<double>> truth_;
  std::string truth_file_;
  std::vector<TrueBox> true_boxes_;
  std::vector<std::string> notes_;
};

// Frames in the order of time: a recording's, or what somebody made of them.
struct FrameSource {
  FrameSource() = default;
  // The recording must stay.
  FrameSource(const Sequence& sequence)  // NOLINT: a recording is a source
      : calibration(sequence.calibration()),
        size(sequence.size()),
        load([&sequence](std::size_t k) { return sequence.load(k); }) {}

  TumCamera calibration;
  std::size_t size = 0;
  std::function<SequenceFrame(std::size_t)> load;
};

// Loads frame i + 1 in the background while frame i is worked on. The frames are those of `load`.
class PrefetchingReader {
 public:
  PrefetchingReader(std::size_t frames, std::function<SequenceFrame(std::size_t)> load)
      : frames_(frames), load_(std::move(load)) {}
  // The sequence must stay.
  explicit PrefetchingReader(const Sequence& sequence)
      : PrefetchingReader(sequence.size(), [&sequence](std::size_t i) { return sequence.load(i); }) {}

  SequenceFrame load(std::size_t i) {
    SequenceFrame frame = ahead_.valid() && ahead_index_ == i ? ahead_.get() : load_(i);
    if (i + 1 < frames_) {
      ahead_index_ = i + 1;
      ahead_ = std::async(std::launch::async, load_, i + 1);
    }
    return frame;
  }

 private:
  std::size_t frames_;
  std::function<SequenceFrame(std::size_t)> load_;
  std::size_t ahead_index_ = 0;
  std::future<SequenceFrame> ahead_;
};

}  // namespace cfp_examples
