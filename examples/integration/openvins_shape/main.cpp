// cfp in the shape of OpenVINS: the same filter without and with cfp on the same simulated tracks of one camera that
// moves through a room in which people walk. The glue is cfp_glue.hpp; the host's lines for cfp are marked.
#include <cmath>
#include <cstdio>
#include <iterator>
#include <map>
#include <vector>

#include "../room.hpp"
#include "cfp_glue.hpp"
#include "host.hpp"

namespace {

constexpr double rate_hz = 30;
constexpr std::size_t most_tracks = 200, most_clones = 11;

// Corners that are tracked from image to image while they are seen, by a fifth of a pixel, and new ones for those lost.
class Tracks {
 public:
  Tracks(const cfp::PinholeCamera<float>& camera, std::uint64_t seed)
      : random_(seed, "openvins_shape"), room_(camera, random_), id_(room_.size(), 0) {}

  // Returns what a detector sees.
  std::vector<cfp::Detection<float>> feed_new_camera(long n, ov_msckf::TrackKLT& tracker) {
    const std::vector<Eigen::Vector3f> pixels = room_.project(n);
    const Room::Boxes boxes = room_.boxes(pixels);
    std::size_t tracked = 0;
    for (std::size_t i = 0; i < id_.size(); ++i) {
      if (!room_.is_visible(i, pixels, boxes)) id_[i] = 0;
      tracked += id_[i] != 0 ? 1 : 0;
    }
    for (std::size_t k = 0; k < 20 * most_tracks && tracked < most_tracks; ++k) {
      const std::size_t i = random_.index(static_cast<std::uint32_t>(id_.size()));
      if (id_[i] != 0 || !room_.is_visible(i, pixels, boxes)) continue;
      id_[i] = ++last_id_;
      ++tracked;
    }
    tracker = {};
    for (std::size_t i = 0; i < id_.size(); ++i) {
      if (id_[i] == 0) continue;
      ov_msckf::KeyPoint keypoint;
      keypoint.pt = {pixels[i].x() + room_.noise(0.2F), pixels[i].y() + room_.noise(0.2F)};
      tracker.obs.push_back(keypoint);
      tracker.ids.push_back(id_[i]);
    }
    return room_.detect(boxes);
  }

  // The camera's motion since the image before, as something cheaper than a good IMU tells it.
  ov_msckf::Odometry odometry(long n) {
    const Eigen::Matrix4d T = (Room::pose(n) * Room::pose(n - 1).inverse()).cast<double>();
    ov_msckf::Odometry result;
    result.sigma_m = 0.002;
    result.sigma_rad = 0.001;
    const auto error = [&](double sigma) {
      return Eigen::Vector3d{sigma * random_.normal(), sigma * random_.normal(), sigma * random_.normal()};
    };
    result.R = cfp::so3_exp(error(result.sigma_rad)) * T.topLeftCorner<3, 3>();
    result.t = T.topRightCorner<3, 1>() + error(result.sigma_m);
    return result;
  }

 private:
  cfp::Random random_;
  Room room_;
  std::vector<std::size_t> id_;  // of the track of each point, 0: none
  std::size_t last_id_ = 0;
};

// The features to update with: those whose track ended, and those that reach back to the oldest clone.
std::vector<ov_msckf::Feature> take_ended(const ov_msckf::State& state, std::map<std::size_t, ov_msckf::Feature>& all) {
  std::vector<ov_msckf::Feature> ended;
  const bool full = state._clones.size() >= most_clones;
  for (auto it = all.begin(); it != all.end();) {
    const ov_msckf::Feature& feature = it->second;
    const bool lost = feature.timestamps.back() < state._timestamp;
    const bool old = full && feature.timestamps.front() <= state._clones.begin()->first;
    if (lost || old) ended.push_back(feature);
    it = lost || old ? all.erase(it) : std::next(it);
  }
  return ended;
}

struct Outcome {
  double position_m = 0, orientation_mrad = 0;  // RMSE
};

Outcome run(bool with_cfp, std::uint64_t seed) {
  const cfp::PinholeCamera<float> camera{458, 458, 320, 240};
  cfp::FrameOptions options;
  options.tracker.image_width = Room::width;
  options.tracker.image_height = Room::height;
  StaticTracks tracks_of_cfp(camera, options);  // cfp
  Tracks tracks(camera, seed);
  ov_msckf::State state;
  ov_msckf::TrackKLT tracker;
  const ov_msckf::UpdaterMSCKF updater(camera.cast<double>(), 0.3);
  std::map<std::size_t, ov_msckf::Feature> features;
  Outcome sum_sq;
  constexpr long images = 300;
  for (long n = 0; n < images; ++n) {
    const auto detections = tracks.feed_new_camera(n, tracker);
    propagate_and_clone(state, tracks.odometry(n), 1000 + static_cast<double>(n) / rate_hz);
    if (n == 0) {
      state._clones.begin()->second = {Room::pose(0).topLeftCorner<3, 3>().cast<double>(), Eigen::Vector3d::Zero()};
    }
    if (with_cfp) tracks_of_cfp.new_image(tracker, state, &detections);  // cfp
    for (std::size_t i = 0; i < tracker.ids.size(); ++i) {
      ov_msckf::Feature& feature = features[tracker.ids[i]];
      feature.featid = tracker.ids[i];
      feature.timestamps.push_back(state._timestamp);
      feature.uvs.push_back({double(tracker.obs[i].pt.x), double(tracker.obs[i].pt.y)});
    }
    const std::size_t used = updater.update(state, take_ended(state, features), [&](std::size_t featid) {
      return with_cfp ? tracks_of_cfp.weight(featid) : 1.0;  // cfp
    });
    if (with_cfp) tracks_of_cfp.updated(state, used);  // cfp
    if (state._clones.size() >= most_clones) marginalize_oldest_clone(state);
    const Eigen::Matrix4d truth = Room::pose(n).cast<double>();
    const ov_msckf::Clone& clone = state._clones.rbegin()->second;
    sum_sq.position_m += (clone.R_GtoC * clone.p_CinG + truth.topRightCorner<3, 1>()).squaredNorm();
    const Eigen::Matrix3d turned = clone.R_GtoC * truth.topLeftCorner<3, 3>().transpose();
    sum_sq.orientation_mrad += 1e6 * cfp::so3_log(turned).squaredNorm();
  }
  return {std::sqrt(sum_sq.position_m / images), std::sqrt(sum_sq.orientation_mrad / images)};
}

}  // namespace

int main() {
  int better = 0, runs = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed, ++runs) {
    const Outcome plain = run(false, seed), cfp = run(true, seed);
    std::printf("room %d: as it was %.3f m and %.1f mrad RMSE, with cfp %.3f and %.1f\n", static_cast<int>(seed),
                plain.position_m, plain.orientation_mrad, cfp.position_m, cfp.orientation_mrad);
    better += cfp.position_m < plain.position_m ? 1 : 0;
  }
  return better == runs ? 0 : 1;
}
