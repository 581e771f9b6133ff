// The engines of cfp for the cameras of the hosts beside this file, compiled once for all of them: what both share, which
// is nearly all, is compiled once, too.
#include "cfp/frame/static_probability.hpp"
#include "cfp/geometry/any_camera.hpp"

template class cfp::StaticProbability<cfp::PinholeCamera<float>>;
template class cfp::StaticProbability<cfp::AnyCamera<float>>;
