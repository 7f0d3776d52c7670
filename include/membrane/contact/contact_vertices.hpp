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
///     auto tracker = membrane::ContactTracker(mesh);
///     const auto contact = tracker.update(tree, x, tool);
///     for (const auto& point : contact.patch.points) {
///         if (point.feature == membrane::vertex_feature) std::printf("%g m outside\n", point.lift);
///     }
namespace membrane {

/// On a fine mesh the vertices stay outside the tool, and the faces between them cut into it. A smooth surface through
/// the vertices of a face cuts in less than the face: it touches a tool of radius R, for faces of circumradius c (half
/// of the longest edge if an angle is obtuse), where the vertices stay sqrt(R^2 + w c^2) from the axis. If the vertices
/// touched the tool, w = 0, a membrane on a foundation would push too little; with w = 1 the faces would touch it, and
/// hold the membrane too far out.
///
/// Larger triangles carry the contact with their faces. Up to twice the size of `fine` triangles both do: the larger
/// they are, the less is a vertex lifted, and the less may a face cut in. So on a graded mesh the force does not jump
/// where faces take over.
///
/// Lengths are those of the mesh at rest: what is fine does not change as the membrane stretches. However far it does,
/// no face comes nearer to the axis than half the radius: the tool does not pass between the vertices.
class ContactVertices {
  public:
    ContactVertices() = default;  ///< none

    /// Of `surface` at rest at `x` (3 x V [m]). Triangles are fine if their circumradius is at most `fine` tool radii;
    /// 0: none are. Cost: O(V + F).
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

    ///@{
    /// The largest circumradius of fine triangles [tool radii]; whether any vertex may carry a contact.
    [[nodiscard]] double fine() const noexcept { return fine_; }
    [[nodiscard]] bool any() const noexcept { return fine_ > 0; }
    ///@}

    /// 1 for a vertex between triangles that are fine for a tool of this radius [m], 0 beside one twice as large.
    [[nodiscard]] double roundness(Index v, double radius) const noexcept {
        return any() ? std::clamp(2 - std::sqrt(squares_[at(v)].largest) / (fine_ * radius), 0.0, 1.0) : 0;
    }

    ///@{
    /// Whether `v` carries the contact with a tool of this radius [m]; whether these corners do so without their face.
    [[nodiscard]] bool carries(Index v, double radius) const noexcept { return roundness(v, radius) > 0; }
    [[nodiscard]] bool carry_alone(const std::array<Index, 3>& corners, double radius) const noexcept {
        return std::all_of(corners.begin(), corners.end(), [&](Index v) { return roundness(v, radius) == 1; });
    }
    ///@}

    ///@{
    /// How far outside a tool of this radius `v` stays; at most any of these corners; at most any vertex [m].
    [[nodiscard]] double lift(Index v, double radius) const noexcept {
        return any() ? roundness(v, radius) * above(radius, squares_[at(v)].mean) : 0;
    }
    [[nodiscard]] double largest_lift(const std::array<Index, 3>& corners, double radius) const noexcept {
        return (std::max)({lift(corners[0], radius), lift(corners[1], radius), lift(corners[2], radius)});
    }
    [[nodiscard]] double largest_lift(double radius) const noexcept {
        // Roundness times squared size is largest where triangles are 4/3 as large as fine ones.
        return any() ? 32.0 / 27 * above(radius, fine_ * fine_ * radius * radius) : 0;
    }
    ///@}

    /// How far outside a tool of this radius the face of these corners stays, not above 0: minus half the radius where
    /// they carry alone, elsewhere at most as deep as the face of a fine triangle cuts into a sphere [m].
    [[nodiscard]] double face_lift(const std::array<Index, 3>& corners, double radius) const noexcept {
        const auto of = [&](std::size_t k) { return roundness(corners[k], radius); };
        const double round = (std::min)({of(0), of(1), of(2)});
        return -radius / 2 * (round == 1 ? 1 : round * fine_ * fine_);
    }

  private:
    static constexpr double part = 0.2;  // w

    struct Squares {
        double largest = 0, mean = 0;  // squared circumradius of the triangles around a vertex [m^2]
    };

    [[nodiscard]] static std::size_t at(Index v) noexcept { return static_cast<std::size_t>(v); }
    [[nodiscard]] static double above(double radius, double square) noexcept {
        return std::sqrt(radius * radius + part * square) - radius;
    }

    double fine_ = 0;
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
