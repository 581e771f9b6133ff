/* A host in C: two frames of its own arrays, weights before and after its pose. */
#include <stdio.h>

#include "cfp_weights.h"
#include "scene.h"

static struct scene_frame previous, current;
static int match[scene_points];
static float map_point[scene_points], weight[scene_points];

static float mean(int from, int to) {
  float sum = 0.0F;
  int i;
  for (i = from; i < to; ++i) sum += weight[i];
  return sum / (float)(to - from);
}

static struct cfp_weights_frame frame_of(const struct scene_frame* arrays, double time_s) {
  struct cfp_weights_frame frame = {0};
  frame.time_s = time_s;
  frame.keypoints = scene_points;
  frame.xy = arrays->xy;
  frame.depth = arrays->depth;
  frame.boxes = 1;
  frame.box = arrays->box;
  return frame;
}

int main(void) {
  /* The camera moved 3 cm to the right, as the host's optimiser will find. */
  static const double T_cur_prev[12] = {1, 0, 0, -0.03, 0, 1, 0, 0, 0, 0, 1, 0};
  struct cfp_weights* const weights = cfp_weights_create(scene_fx, scene_fy, scene_cx, scene_cy, 640, 480);
  struct cfp_weights_frame frame;
  float person, wall;
  int i;
  scene_make(&previous, &current);
  frame = frame_of(&previous, 0.0);
  cfp_weights_coarse(weights, &frame, weight);
  for (i = 0; i < scene_points; ++i) {
    match[i] = i;
    map_point[i] = weight[i]; /* M of a new map point: what is known of its keypoint */
  }
  frame = frame_of(&current, 1.0 / 30.0);
  frame.flow_pairs = scene_points;
  frame.flow_previous = previous.xy;
  frame.flow_current = current.xy;
  cfp_weights_coarse(weights, &frame, weight);
  printf("coarse: mean weight of the person %.3f, of the wall %.3f\n", (double)mean(scene_wall, scene_points),
         (double)mean(0, scene_wall));
  cfp_weights_fine(weights, T_cur_prev, scene_wall, match, map_point, weight);
  person = mean(scene_wall, scene_points);
  wall = mean(0, scene_wall);
  printf("fine:   mean weight of the person %.3f, of the wall %.3f\n", (double)person, (double)wall);
  cfp_weights_learn(weights, map_point);
  cfp_weights_destroy(weights);
  return person < 0.1F && wall > 0.8F && map_point[0] > 0.5F && map_point[scene_points - 1] < 1.0F ? 0 : 1;
}
