/* Two frames of a camera that moves past a wall while a person walks: the arrays that a host has. C and C++. */
#ifndef CFP_EXAMPLE_SCENE_H
#define CFP_EXAMPLE_SCENE_H

#include <math.h>

enum { scene_wall = 600, scene_person = 150, scene_points = scene_wall + scene_person };

struct scene_frame {
  float xy[2 * scene_points]; /* px, x y x y ... */
  float depth[scene_points];  /* m */
  float box[4];               /* of the person: x1 y1 x2 y2 */
};

static const float scene_fx = 535.4F, scene_fy = 539.2F, scene_cx = 320.1F, scene_cy = 247.6F;

static unsigned scene_state = 1U;
static float scene_uniform(float from, float to) {
  scene_state = scene_state * 1664525U + 1013904223U;
  return from + (to - from) * (float)(scene_state >> 8) / 16777216.0F;
}

/* Frames k-1 and k: element i of both is the same point, the person's last. The camera moves 3 cm to the right. */
static void scene_make(struct scene_frame* previous, struct scene_frame* current) {
  int i;
  struct scene_frame* const frames[2] = {previous, current};
  for (i = 0; i < scene_points; ++i) {
    const int person = i >= scene_wall;
    const float z = person ? scene_uniform(1.9F, 2.1F) : scene_uniform(3.5F, 5.0F);
    const float x = person ? scene_uniform(-0.2F, 0.2F) : scene_uniform(-0.55F, 0.55F) * z;
    const float y = person ? scene_uniform(-0.5F, 0.5F) : scene_uniform(-0.42F, 0.42F) * z;
    int k;
    for (k = 0; k < 2; ++k) {
      const float now = x - (k == 1 ? 0.03F : 0.0F) + (k == 1 && person ? 0.05F : 0.0F);
      const float walk = k == 1 && person ? 0.02F : 0.0F;
      frames[k]->xy[2 * i] = scene_fx * now / z + scene_cx + scene_uniform(-0.4F, 0.4F);
      frames[k]->xy[2 * i + 1] = scene_fy * (y + walk) / z + scene_cy + scene_uniform(-0.4F, 0.4F);
      frames[k]->depth[i] = z;
    }
  }
  for (i = 0; i < 2; ++i) {
    int j;
    float* const box = frames[i]->box;
    box[0] = box[1] = 1e9F;
    box[2] = box[3] = -1e9F;
    for (j = scene_wall; j < scene_points; ++j) {
      const float u = frames[i]->xy[2 * j], v = frames[i]->xy[2 * j + 1];
      if (u < box[0]) box[0] = u;
      if (v < box[1]) box[1] = v;
      if (u > box[2]) box[2] = u;
      if (v > box[3]) box[3] = v;
    }
  }
}

#endif
