// The engines of cfp, compiled once for the whole system.
#include "cfp/frame/static_probability.hpp"
#include "cfp/geometry/any_camera.hpp"

template class cfp::StaticProbability<cfp::AnyCamera<float>>;
