// Every template of the public headers, instantiated for float and double, so that nothing rots uncompiled. One section
// per folder: class templates by explicit instantiation, function templates by taking their address in the section of their folder.
#include "cfp/cfp.hpp"

namespace {

std::size_t used = 0;

template <typename Function>
void use(Function function) noexcept {
  used += function != nullptr ? 1 : 0;
}

}  // namespace

// ---- core ----
template class cfp::span<float>;
template class cfp::span<const double>;
template class cfp::PointSpan<float, 2>;
template class cfp::PointSpan<float, 3>;
template class cfp::PointSpan<double, 2>;
template class cfp::PointSpan<double, 3>;
template <typename Scalar>
static void instantiate_core() noexcept {
  use(&cfp::is_finite<Scalar>);
  use(&cfp::clamp_probability<Scalar>);
  use(&cfp::is_valid_depth<Scalar>);
}

// ---- math ----
template struct cfp::SE3<float>;
template struct cfp::SE3<double>;
template <typename Scalar>
static void instantiate_math() noexcept {
  use(&cfp::hat<Scalar>);
  use(&cfp::so3_exp<Scalar>);
  use(&cfp::so3_log<Scalar>);
  use(&cfp::so3_left_jacobian<Scalar>);
  use(&cfp::normalized_rotation<Scalar>);
  use(&cfp::se3_exp<Scalar>);
  use(&cfp::se3_log<Scalar>);
  use(&cfp::adjoint<Scalar>);
  use(&cfp::SE3<Scalar>::template cast<float>);
  use(&cfp::SE3<Scalar>::template cast<double>);
}

// ---- geometry ----
template struct cfp::Box<float>;
template struct cfp::Box<double>;
template struct cfp::PinholeCamera<float>;
template struct cfp::PinholeCamera<double>;
template <typename Scalar>
static void instantiate_geometry() noexcept {
  use(&cfp::is_proper<Scalar>);
  use(&cfp::area<Scalar>);
  use(&cfp::contains<Scalar>);
  use(&cfp::intersection<Scalar>);
  use(&cfp::iou<Scalar>);
  use(&cfp::clip<Scalar>);
}

// ---- detection ----
// ---- clustering ----
// ---- probability ----
// ---- optimization ----
// ---- evaluation ----
// ---- pipeline ----

template <typename Scalar>
static void instantiate() noexcept {
  instantiate_core<Scalar>();
  instantiate_math<Scalar>();
  instantiate_geometry<Scalar>();
}

std::size_t instantiated_templates() noexcept;
std::size_t instantiated_templates() noexcept {
  used = 0;
  instantiate<float>();
  instantiate<double>();
  return used;
}
