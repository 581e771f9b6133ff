#include "cfp/geometry/box.hpp"

int main() {
  const cfp::Box<float> detected{0, 0, 10, 10}, predicted{0, 0, 10, 10};
  return cfp::iou(detected, predicted) == 1.0F ? 0 : 1;
}
