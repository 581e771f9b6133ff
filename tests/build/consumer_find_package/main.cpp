#include "cfp/cfp.hpp"
#include "cfp_testing/people.hpp"
#include "cfp_testing/property.hpp"

int main() {
  const cfp::Box<float> detected{0, 0, 10, 10}, predicted{0, 0, 10, 10};
  const auto holds = [](cfp::Random& random) { return random.uniform() < 1; };
  return cfp::iou(detected, predicted) == 1.0F && cfp_testing::first_failure(3, holds) == cfp_testing::no_failure ? 0
                                                                                                                  : 1;
}
