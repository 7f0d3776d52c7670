// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_adjacency.hpp>
#include <membrane/tissue/tissue.hpp>

/// The energy that a membrane releases as a tear advances.
namespace membrane {

/// Gradients of the barycentric coordinates of a triangle at rest [1/m], and its area [m^2].
template <Real Scalar>
struct RestTriangle {
    std::array<Vector3<Scalar>, 3> gradient;  ///< of the coordinate of each corner
    Vector3<Scalar> normal;                   ///< unit vector
    Scalar area;                              ///< [m^2]

    /// From the corners [m].
    explicit RestTriangle(const std::array<Vector3<Scalar>, 3>& x) noexcept {
        const Vector3<Scalar> twice = cross<Scalar>(x[1] - x[0], x[2] - x[0]);
        const Scalar size = norm(twice);
        area = size / 2;
        normal = (1 / size) * twice;
        for (std::size_t k = 0; k < 3; ++k) {
            gradient[k] = (1 / size) * cross<Scalar>(normal, x[(k + 2) % 3] - x[(k + 1) % 3]);
        }
    }
};

/// The configurational forces of a triangle on its corners, times `weights`, in sum: that on a corner is minus the
/// derivative of the triangle's energy by the corner's position at rest, with all present positions kept [N]. For a
/// homogeneous material of energy density W, deformation gradient F and first Piola-Kirchhoff stress P the sum is
/// -(W I - F^T P) times the gradient of the weights at rest, integrated [Miehe07]: with the corners' forces f, and F^T
/// f, this needs energy and forces alone.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> configurational_force(const std::array<Vector3<Scalar>, 3>& rest,
                                                    const std::array<Vector3<Scalar>, 3>& x,
                                                    const TriangleResponse<Scalar>& response,
                                                    const std::array<Scalar, 3>& weights) noexcept {
    const Vector3<Scalar> force =
        weights[0] * response.force[0] + weights[1] * response.force[1] + weights[2] * response.force[2];
    const Vector3<Scalar> area = area_vector<Scalar>({rest[0], rest[1], rest[2]});
    // A barycentric coordinate has the gradient area x opposite edge / (2 area^2).
    Vector3<Scalar> sum = Vector3<Scalar>::Zero();
    for (std::size_t k = 0; k < 3; ++k) {
        const Vector3<Scalar> opposite = rest[(k + 2) % 3] - rest[(k + 1) % 3];
        sum += (response.energy * weights[k] + dot<Scalar>(x[k] - x[0], force)) * opposite;
    }
    return -1 / (2 * squared_norm(area)) * cross(area, sum);
}

/// T^T T of a triangle, with its first Piola-Kirchhoff stress T, a force per width at rest [N^2/m^2]: the root of its
/// largest principal value is the largest tension.
template <Real Scalar>
[[nodiscard]] Symmetric3<Scalar> squared_tension(const RestTriangle<Scalar>& rest,
                                                 const std::array<Vector3<Scalar>, 3>& at_rest,
                                                 const TriangleResponse<Scalar>& response) noexcept {
    // T = -sum of f_k (X_k - X_0)^T / area
    const Vector3<Scalar> a = (1 / rest.area) * response.force[1], b = (1 / rest.area) * response.force[2];
    const Vector3<Scalar> p = at_rest[1] - at_rest[0], q = at_rest[2] - at_rest[0];
    Symmetric3<Scalar> sum = outer<Scalar>(dot(a, a), p);
    sum += outer<Scalar>(dot(b, b), q);
    const Scalar both = dot(a, b);
    sum += outer<Scalar>(both / 2, p + q);
    sum += outer<Scalar>(-both / 2, p - q);
    return sum;
}

}  // namespace membrane
