// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>

#include <membrane/contact/contact.hpp>
#include <membrane/surface/normals.hpp>
#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_adjacency.hpp>
#include <membrane/surface/triangle_mesh.hpp>
#include <membrane/surface/vertex_split.hpp>

/// A contact normal that is continuous as the tool slides over edges and vertices.
///
///     const auto smooth = membrane::SmoothContact(mesh);
///     device.write(feel({tool, smooth(contact), report}));    // for the force; the solver takes `contact`
namespace membrane {

template <Real Scalar>
class MovingBody;  // of moving_body.hpp

/// The contact with the normal of a smooth surface: the surface without the tool, as for the depth, with normals
/// interpolated between its vertices. The proxy is the point of it whose normal passes through the tool. The proxy
/// moves as continuously as the tool, also over concave edges, and has no memory: it adds no delay. The depth is
/// already continuous and stays unchanged. Its gradient is another normal, that of a `RestContact`: a force along the
/// smooth normal has no potential, and gives a hand some energy on each slow turn (see `SampledLoop`).
///
/// If the tool's radius is larger than that of a fold around it, there are several proxies, and a change between them
/// is a jump. A change from one end of a shaft to the other, which the contact makes, is a jump too. Beyond a border
/// the proxy stays on the border. One instance serves any number of tools and threads.
template <Real Scalar>
class SmoothContact {
  public:
    /// Cost: O(V + F log F).
    explicit SmoothContact(const TriangleMesh<Scalar>& mesh)
        : triangles_(mesh.triangles()),
          adjacency_(mesh),
          at_rest_(mesh.positions()),
          normals_(VertexNormals<Scalar>(mesh).values()) {}

    /// A contact on a triangle that the mesh does not have stays as it is. Online. Cost: a few triangles, from the
    /// contact's to the proxy's.
    [[nodiscard]] Contact<Scalar> operator()(const Contact<Scalar>& contact) const noexcept {
        return over(contact, at_rest_, normals_);
    }

    /// The contact on a moving body; as it is if the body has another number of vertices.
    [[nodiscard]] Contact<Scalar> operator()(const Contact<Scalar>& contact,
                                             const MovingBody<Scalar>& body) const noexcept {
        return over(contact, body.anchors(), body.normals());
    }

    ///@{
    /// A vertex becomes two; a vertex moves at rest. The surface without the tool does not part: the normal is
    /// continuous over a tear. Online.
    void split(const VertexSplit& /*split*/) noexcept {}
    void reshape(const MovedVertex<Scalar>& moved) noexcept { at_rest_.col(moved.vertex) = moved.rest; }
    ///@}

    /// Visits what a tear changes, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.at_rest_);
    }

  private:
    [[nodiscard]] Contact<Scalar> over(const Contact<Scalar>& contact, const ConstPointsRef<Scalar>& anchors,
                                       const ConstPointsRef<Scalar>& normals) const noexcept;
    [[nodiscard]] Vector3<Scalar> normal_at(Index f, const Vector3<Scalar>& q, const ConstPointsRef<Scalar>& anchors,
                                            const ConstPointsRef<Scalar>& normals) const noexcept;
    [[nodiscard]] Index across(Index f, const Vector3<Scalar>& weights) const noexcept;

    static constexpr int max_triangles = 64;  // visited from the contact to the proxy

    Triangles triangles_;
    TriangleAdjacency adjacency_;
    Points<Scalar> at_rest_, normals_;
};

namespace detail {

/// The weights of the point whose interpolated normal passes through `q`. These are the weights of `q` in the triangle
/// that contains `q` after all corners have moved along their normals by one common height.
template <Real Scalar>
[[nodiscard]] Vector3<Scalar> weights_below(const Triangle<Scalar>& triangle, const Triangle<Scalar>& normals,
                                            const Vector3<Scalar>& q) noexcept {
    const Vector3<Scalar> ab = triangle.b - triangle.a, ac = triangle.c - triangle.a, aq = q - triangle.a;
    const Vector3<Scalar> turn_b = normals.b - normals.a, turn_c = normals.c - normals.a;
    Scalar height = dot(aq, direction<Scalar>(cross(ab, ac), normals.a));
    for (int i = 0; i < 8; ++i) {  // Newton's method for the height at which triangle and `q` span no volume
        const Vector3<Scalar> b = ab + height * turn_b, c = ac + height * turn_c, to_q = aq - height * normals.a;
        const Vector3<Scalar> area = cross(b, c);
        const Scalar volume = dot(to_q, area);
        const Scalar slope = dot<Scalar>(to_q, cross(turn_b, c) + cross(b, turn_c)) - dot(normals.a, area);
        const Scalar newton_step = volume / slope;
        if (!is_finite(newton_step)) break;
        height -= newton_step;
        if (std::abs(newton_step) <= std::numeric_limits<Scalar>::epsilon() * norm(aq)) break;
    }
    const Vector3<Scalar> b = ab + height * turn_b, c = ac + height * turn_c, to_q = aq - height * normals.a;
    const Vector3<Scalar> area = cross(b, c);
    const Scalar square = squared_norm(area);
    const Scalar second = dot<Scalar>(cross(to_q, c), area) / square,
                 third = dot<Scalar>(cross(b, to_q), area) / square;
    return {1 - second - third, second, third};
}

}  // namespace detail

template <Real Scalar>
Contact<Scalar> SmoothContact<Scalar>::over(const Contact<Scalar>& contact, const ConstPointsRef<Scalar>& anchors,
                                            const ConstPointsRef<Scalar>& normals) const noexcept {
    if (!contact.touching() || !is_valid(contact) || contact.triangle >= triangles_.cols()) return contact;
    if (anchors.cols() != at_rest_.cols() || normals.cols() != at_rest_.cols()) return contact;
    Contact<Scalar> smooth = contact;
    const Vector3<Scalar> normal = normal_at(contact.triangle, contact.patch.axis_point, anchors, normals);
    if (is_finite(normal)) smooth.normal = direction<Scalar>(contact.patch.side * normal, contact.normal);
    return smooth;
}

// Walks from triangle `f` on, across the side that the proxy is farthest beyond.
template <Real Scalar>
Vector3<Scalar> SmoothContact<Scalar>::normal_at(Index f, const Vector3<Scalar>& q,
                                                 const ConstPointsRef<Scalar>& anchors,
                                                 const ConstPointsRef<Scalar>& normals) const noexcept {
    for (int left = max_triangles;; --left) {
        const auto turned = triangle_at(normals, triangles_.col(f));
        const Vector3<Scalar> weights = detail::weights_below(triangle_at(anchors, triangles_.col(f)), turned, q);
        const Index next = left > 0 ? across(f, weights) : no_index;
        if (next == no_index) {
            const Vector3<Scalar> within = weights.cwiseMax(Vector3<Scalar>::Zero());
            return point_at<Scalar>(turned, within / within.sum());
        }
        f = next;
    }
}

// The next triangle towards a point with these weights; `no_index` if the point is in `f` or beyond a border.
template <Real Scalar>
Index SmoothContact<Scalar>::across(Index f, const Vector3<Scalar>& weights) const noexcept {
    Index next = no_index;
    Scalar least = -std::numeric_limits<Scalar>::epsilon();  // a point on the side belongs to both triangles
    for (std::size_t k = 0; k < 3; ++k) {
        const Index other = adjacency_.triangle_neighbours(f)[(k + 1) % 3];  // across from corner k
        const Scalar weight = weights[static_cast<Eigen::Index>(k)];
        if (other == no_index || !(weight < least)) continue;
        least = weight;
        next = other;
    }
    return next;
}

}  // namespace membrane
