// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include <membrane/contact/local_surface.hpp>

/// Which vertices carry a contact, and how far outside the tool they stay.
///
///     auto tracker = membrane::ContactTracker(mesh, {.fine_triangles = 0.5});
///     const auto contact = tracker.update(tree, x, tool);
///     const auto* carriers = contact.patch.vertices;                         // null: faces carry the contact
///     if (carriers != nullptr && carriers->carries(v, tool.radius)) {
///         std::printf("%g m outside\n", carriers->lift(v, tool.radius));
///     }
namespace membrane {

/// How far outside a tool a point of a face stays [m], for one face or several; negative where the face may cut in. By
/// roundness and lifts of the corners, see `ContactVertices`, and the direction of a shaft. A surface through the
/// corners that is as round as the tool lies outside the face by p / (2 radius): p is the product of the distances of
/// the point from both ends of a chord of the circumcircle, the sum over the sides of weight times weight times squared
/// length. A shaft is round across its axis only.
template <Number N>
[[nodiscard]] MEMBRANE_INLINE N face_lift(const Triangle<N>& triangle, const Vector3<N>& weights,
                                          const Vector3<N>& roundness, const Vector3<N>& lifts,
                                          const Vector3<Each<N>>& along, Each<N> radius) noexcept {
    const Vector3<N> axis = along.template cast<N>();
    const auto square = [&](const Vector3<N>& side) {
        const N part = dot(side, axis);
        return squared_norm(side) - part * part;
    };
    const N product = weights[0] * weights[1] * square(triangle.b - triangle.a) +
                      weights[1] * weights[2] * square(triangle.c - triangle.b) +
                      weights[2] * weights[0] * square(triangle.a - triangle.c);
    const N inside = product / (2 * radius);
    N sum = 0;
    for (Eigen::Index k = 0; k < 3; ++k) sum += weights[k] * roundness[k] * (lifts[k] - inside);
    return sum;
}

/// On a fine mesh the vertices stay outside the tool, and the faces between them cut into it. A smooth surface through
/// the vertices of a face cuts in less than the face: it touches a tool of radius R, for faces of circumradius c, where
/// the vertices stay sqrt(R^2 + w c^2) from the axis. If the vertices touched the tool, w = 0, a membrane on a
/// foundation would push too little; with w = 1 the faces would touch it, and hold the membrane too far out.
///
/// A vertex beside larger triangles does not carry the contact; the faces there do, lifted as far as the vertices would
/// lift them (`face_lift`). The lift fades up to twice the size of `fine` triangles: on a graded mesh the force does
/// not jump where faces take over.
///
/// Lengths are those of the mesh at rest, in double: what is fine does not change as the membrane stretches.
class ContactVertices {
  public:
    /// Of `surface` at rest at `x` (3 x V [m]). A vertex carries the contact with a tool if the circumradius of each of
    /// its triangles is at most `fine` tool radii; 0: none does. Cost: O(V + F).
    template <Real Scalar>
    ContactVertices(const LocalSurface<Scalar>& surface, const ConstPointsRef<Scalar>& x, double fine)
        : fine_(fine), squares_(fine > 0 ? static_cast<std::size_t>(x.cols()) : 0) {
        for (Index v = 0; v < static_cast<Index>(squares_.size()); ++v) measure(surface, x, v);
    }

    /// Measures the triangles around `v` anew. Cost: linear in them.
    template <Real Scalar>
    void measure(const LocalSurface<Scalar>& surface, const ConstPointsRef<Scalar>& x, Index v) noexcept;

    /// Visits what a tear changes, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.squares_);
    }

    /// Whether any vertex may carry a contact.
    [[nodiscard]] bool any() const noexcept { return fine_ > 0; }

    ///@{
    /// Whether `v` carries the contact with a tool of this radius [m]; whether all corners do, and so the face does
    /// not.
    [[nodiscard]] bool carries(Index v, double radius) const noexcept {
        return any() && squares_[at(v)].largest <= fine_ * fine_ * radius * radius;
    }
    [[nodiscard]] bool carry(const std::array<Index, 3>& corners, double radius) const noexcept {
        return std::all_of(corners.begin(), corners.end(), [&](Index v) { return carries(v, radius); });
    }
    ///@}

    ///@{
    /// How far outside a tool of this radius `v` stays; at most any of these corners, by as much as the contact is
    /// theirs; at most any that carries the contact [m].
    [[nodiscard]] double lift(Index v, double radius) const noexcept { return above(radius, squares_[at(v)].mean); }
    [[nodiscard]] double largest_lift(const std::array<Index, 3>& corners, double radius) const noexcept {
        double largest = 0;
        for (std::size_t k = 0; any() && k < 3; ++k)
            largest = (std::max)(largest, roundness(corners[k], radius) * lift(corners[k], radius));
        return largest;
    }
    [[nodiscard]] double largest_lift(double radius) const noexcept {
        return any() ? above(radius, fine_ * fine_ * radius * radius) : 0;
    }
    ///@}

    /// 1 for a vertex that carries the contact, 0 where the triangles around it are larger by a factor of two.
    [[nodiscard]] double roundness(Index v, double radius) const noexcept {
        return std::clamp(2 - std::sqrt(squares_[at(v)].largest) / (fine_ * radius), 0.0, 1.0);
    }

    /// How far outside a tool of this radius a point of a face stays, `triangle` now; see `face_lift` [m].
    template <Real Scalar>
    [[nodiscard]] Scalar lift(const std::array<Index, 3>& corners, const Triangle<Scalar>& triangle,
                              const Vector3<Scalar>& weights, const Vector3<Scalar>& axis,
                              Scalar radius) const noexcept;

  private:
    static constexpr double part = 0.2;  // w

    struct Squares {
        double largest = 0, mean = 0;  // squared circumradius of the triangles around a vertex [m^2]
    };

    [[nodiscard]] static std::size_t at(Index v) noexcept { return static_cast<std::size_t>(v); }
    [[nodiscard]] static double above(double radius, double square) noexcept {
        return std::sqrt(radius * radius + part * square) - radius;
    }

    double fine_;
    std::vector<Squares> squares_;
};

namespace detail {

/// The squared radius of the smallest sphere around a triangle: the circumradius, or half of the longest edge if an
/// angle is obtuse. As deep as this a face between points of a sphere cuts into it, and no deeper.
[[nodiscard]] inline double squared_radius_around(const Triangle<double>& triangle) noexcept {
    std::array<double, 3> squares{squared_norm<double>(triangle.b - triangle.a),
                                  squared_norm<double>(triangle.c - triangle.b),
                                  squared_norm<double>(triangle.a - triangle.c)};
    std::sort(squares.begin(), squares.end());
    if (squares[0] + squares[1] <= squares[2]) return squares[2] / 4;
    return squares[0] * squares[1] / squared_norm(area_vector(triangle)) * squares[2] / 16;
}

}  // namespace detail

template <Real Scalar>
void ContactVertices::measure(const LocalSurface<Scalar>& surface, const ConstPointsRef<Scalar>& x, Index v) noexcept {
    if (!any()) return;
    Squares found;
    const auto around = surface.triangles_of(v);
    for (const Index f : around) {
        const auto [a, b, c] = surface.triangle(x, f);
        const double square = detail::squared_radius_around(
            {a.template cast<double>(), b.template cast<double>(), c.template cast<double>()});
        found.largest = (std::max)(found.largest, square);
        found.mean += square / static_cast<double>(around.size());
    }
    squares_[at(v)] = found;
}

template <Real Scalar>
Scalar ContactVertices::lift(const std::array<Index, 3>& corners, const Triangle<Scalar>& triangle,
                             const Vector3<Scalar>& weights, const Vector3<Scalar>& axis,
                             Scalar radius) const noexcept {
    Vector3<Scalar> round, lifts;
    for (std::size_t k = 0; any() && k < 3; ++k) {
        const auto row = static_cast<Eigen::Index>(k);
        round[row] = static_cast<Scalar>(roundness(corners[k], radius));
        lifts[row] = static_cast<Scalar>(lift(corners[k], radius));
    }
    return any() ? face_lift(triangle, weights, round, lifts, direction_or_zero(axis), radius) : Scalar(0);
}

}  // namespace membrane
