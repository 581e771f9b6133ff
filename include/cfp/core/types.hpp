/// @file types.hpp
/// The small vectors and matrices of cfp. In public structs only those stand whose alignment no compiler flag changes.
#pragma once

#include <Eigen/Core>

#include "cfp/version.hpp"

namespace cfp {

template <typename Scalar>
using Vector2 = Eigen::Matrix<Scalar, 2, 1>;
template <typename Scalar>
using Vector3 = Eigen::Matrix<Scalar, 3, 1>;
template <typename Scalar>
using Vector4 = Eigen::Matrix<Scalar, 4, 1>;
template <typename Scalar>
using Vector6 = Eigen::Matrix<Scalar, 6, 1>;
template <typename Scalar>
using Matrix3 = Eigen::Matrix<Scalar, 3, 3>;
template <typename Scalar>
using Matrix4 = Eigen::Matrix<Scalar, 4, 4>;
template <typename Scalar>
using Matrix6 = Eigen::Matrix<Scalar, 6, 6>;
template <typename Scalar>
using Matrix23 = Eigen::Matrix<Scalar, 2, 3>;

}  // namespace cfp
