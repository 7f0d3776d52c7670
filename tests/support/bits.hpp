// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstring>

#include <Eigen/Core>

#include <membrane/core/vector3.hpp>

namespace test {

/// Whether two matrices are of one size and hold the same bits: unlike ==, no two zeros and every NaN.
///
///     CHECK(test::same_bits(x, before));
template <class Derived>
bool same_bits(const Eigen::PlainObjectBase<Derived>& a, const Eigen::PlainObjectBase<Derived>& b) {
    const auto bytes = sizeof(typename Derived::Scalar) * static_cast<std::size_t>(a.size());
    return a.rows() == b.rows() && a.cols() == b.cols() && std::memcmp(a.data(), b.data(), bytes) == 0;
}

template <class Scalar>
bool same_bits(const membrane::Vector3<Scalar>& a, const membrane::Vector3<Scalar>& b) {
    return std::memcmp(a.data(), b.data(), 3 * sizeof(Scalar)) == 0;
}

}  // namespace test
