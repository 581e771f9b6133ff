/* cfp for a host with plain arrays: C, or any language that calls C. Arrays are the host's; sizes are in elements.
   Nothing throws across this border but the lack of memory, which ends the program. */
#ifndef CFP_EXAMPLE_WEIGHTS_H
#define CFP_EXAMPLE_WEIGHTS_H

#ifdef __cplusplus
extern "C" {
#endif

struct cfp_weights; /* one per camera */

struct cfp_weights_frame {
  double time_s;
  int keypoints;
  const float* xy;    /* px, x y x y ... */
  const float* depth; /* m, one per keypoint, <= 0: none; null: no depth at all */
  int boxes;          /* -1: the detector did not run on this frame */
  const float* box;   /* x1 y1 x2 y2 of each person */
  int flow_pairs;
  const float* flow_previous; /* px, x y x y ... */
  const float* flow_current;
};

struct cfp_weights* cfp_weights_create(float fx, float fy, float cx, float cy, int width, int height);
void cfp_weights_destroy(struct cfp_weights* w);

/* Stage 1. weight: one per keypoint. */
void cfp_weights_coarse(struct cfp_weights* w, const struct cfp_weights_frame* frame, float* weight);

/* Stage 2, with the pose that stage 1's weights led to. T_cur_prev: 3 x 4, row by row. match: per keypoint the index in
   the frame before, -1: none. map_point: M per keypoint, < 0: none. weight: one per keypoint. */
void cfp_weights_fine(struct cfp_weights* w, const double* T_cur_prev, int inliers, const int* match,
                      const float* map_point, float* weight);

/* After the frame's last pose: M learns, in place. */
void cfp_weights_learn(const struct cfp_weights* w, float* map_point);

#ifdef __cplusplus
}
#endif

#endif
