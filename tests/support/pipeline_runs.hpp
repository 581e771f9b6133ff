// The two stages on a synthetic scene, with the buffers a host would hold.
#pragma once

#include <utility>
#include <vector>

#include "cfp/frame/first_stage.hpp"
#include "cfp/frame/second_stage.hpp"
#include "support/dynamic_scene.hpp"

namespace cfp_test {

template <typename Scalar>
struct FirstStageRun {
  explicit FirstStageRun(DynamicScene<Scalar> s) : scene(std::move(s)) {
    const std::size_t n = scene.keypoints.size();
    k.resize(n);
    label.resize(n);
    ruling_box.resize(n);
    objects.resize(scene.boxes.size());
    for (const auto& box : scene.boxes) boxes.push_back({box, true, true});
  }

  cfp::FirstStageResult first(const cfp::FirstStageOptions& options, const cfp::Matrix3<Scalar>* F = nullptr) {
    return first(options, F, scene.camera);
  }
  template <typename Camera>
  cfp::FirstStageResult first(const cfp::FirstStageOptions& options, const cfp::Matrix3<Scalar>* F,
                              const Camera& camera) {
    const cfp::FirstStageInput<Scalar> in{scene.keypoints,          scene.depths,    boxes,
                                          scene.previous_keypoints, scene.keypoints, F};
    return cfp::first_stage(in, camera, {k, label, ruling_box, objects}, options, work);
  }

  DynamicScene<Scalar> scene;
  std::vector<Scalar> k;
  std::vector<cfp::KeypointLabel> label;
  std::vector<std::int32_t> ruling_box;
  std::vector<cfp::ObjectProbability> objects;
  std::vector<cfp::ObjectBox<Scalar>> boxes;
  cfp::FirstStageWorkspace<Scalar> work;
};

template <typename Scalar>
struct SecondStageRun : FirstStageRun<Scalar> {
  explicit SecondStageRun(DynamicScene<Scalar> s)
      : FirstStageRun<Scalar>(std::move(s)),
        m(this->scene.keypoints.size(), Scalar(1)),
        weight(this->scene.keypoints.size()),
        T_cur_prev(this->scene.T_cur_prev) {
    this->first({});
  }

  cfp::SecondStageResult second(const cfp::SecondStageOptions& options) { return second(options, this->scene.camera); }
  template <typename Camera>
  cfp::SecondStageResult second(const cfp::SecondStageOptions& options, const Camera& camera) {
    const cfp::SecondStageInput<Scalar> in{this->scene.keypoints,
                                           this->label,
                                           this->ruling_box,
                                           this->boxes,
                                           this->objects,
                                           this->scene.previous_keypoints,
                                           this->scene.previous_depths,
                                           this->scene.match,
                                           T_cur_prev,
                                           inliers};
    return cfp::second_stage(in, camera, {this->k, m, weight}, options, second_work);
  }

  std::vector<Scalar> m, weight;
  cfp::SE3<double> T_cur_prev;
  std::size_t inliers = 300;
  cfp::SecondStageWorkspace<Scalar> second_work;
};

}  // namespace cfp_test
