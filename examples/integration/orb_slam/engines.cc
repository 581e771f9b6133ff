// The engines of cfp, compiled once for the whole system.
#include "cfp/frame/static_probability.hpp"
#include "cfp/geometry/radial_tangential_camera.hpp"

template class cfp::StaticProbability<cfp::RadialTangentialCamera<float>>;
