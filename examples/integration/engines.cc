// The engines of cfp for the camera of the small hosts beside this file, compiled once for all of them.
#include "cfp/frame/static_probability.hpp"

template class cfp::StaticProbability<cfp::PinholeCamera<float>>;
