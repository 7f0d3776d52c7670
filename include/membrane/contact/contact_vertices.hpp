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

/// On a fine mesh the vertices stay outside the tool, and the faces between them cut into it. A smooth surface through
/// the vertices of a face cuts in less than the face: it touches a tool of radius R, for faces of circumradius c, where
/// the vertices stay sqrt(R^2 + w c^2) from the axis. If the vertices touched the tool, w = 0, a membrane on a
/// foundation would push too little; with w = 1 the faces would touch it, and hold the membrane too far out.
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
    /// How far outside a tool of this radius `v` stays, and at most any that carries the contact [m].
    [[nodiscard]] double lift(Index v, double radius) const noexcept { return above(radius, squares_[at(v)].mean); }
    [[nodiscard]] double largest_lift(double radius) const noexcept {
        return any() ? above(radius, fine_ * fine_ * radius * radius) : 0;
    }
    ///@}

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

}  // namespace membrane
