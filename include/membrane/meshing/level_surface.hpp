// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <concepts>
#include <optional>
#include <utility>

#include <membrane/meshing/signed_distance.hpp>

/// The zero level of a signed distance, whole or within another body, and the projection onto it.
///
///     const auto eye    = membrane::Ball{.radius = 12e-3};                                           // [m]
///     const auto front  = membrane::HalfSpace{.point = {0, 0, 8e-3}, .normal = {0, 0, -1}};
///     const auto mesh   = membrane::distmesh(membrane::trimmed(eye, front), {.edge_length = 1e-3});  // has a border
///     const auto foot   = membrane::LevelSurface(eye, eye.bounds()).project(p);                      // one point only
namespace membrane {

/// The part of a body's surface that lies within another body; its border is where the two surfaces meet.
template <SignedDistance Body, SignedDistance Within>
struct Trimmed {
    Body body;      ///< whose surface it is
    Within within;  ///< outside of which there is no surface

    /// The box that the bounds of both have in common [m].
    [[nodiscard]] Bounds bounds() const { return bounds_of(body).within(bounds_of(within)); }
};

namespace detail {

template <class T>
inline constexpr bool is_trimmed = false;
template <class Body, class Within>
inline constexpr bool is_trimmed<Trimmed<Body, Within>> = true;

}  // namespace detail

/// The part of the surface of `body` within `within`. The two surfaces should not meet at a small angle.
template <SignedDistance Body, SignedDistance Within>
[[nodiscard]] Trimmed<Body, Within> trimmed(Body body, Within within) {
    return {std::move(body), std::move(within)};
}

/// All of space: `Within` of a surface without a border.
struct Everywhere {
    /// Negative: every point is inside.
    [[nodiscard]] double operator()(const Vector3<double>&) const noexcept { return -1; }
};

/// A point of a surface, and the normal there.
struct OnSurface {
    Vector3<double> point;   ///< [m]
    Vector3<double> normal;  ///< Out of the body, unit length.
};

/// The part of the surface of `Body` within `Within`.
template <SignedDistance Body, SignedDistance Within = Everywhere>
class LevelSurface {
  public:
    static constexpr bool has_border = !std::same_as<Within, Everywhere>;  ///< whether another body trims the surface

    ///@{
    /// `bounds` [m] only set the difference step of gradients and the tolerance.
    LevelSurface(const Body& body, const Bounds& bounds) : LevelSurface(trimmed(body, Within{}), bounds) {}
    LevelSurface(const Trimmed<Body, Within>& surface, const Bounds& bounds)
        : surface_(surface), size_(norm<double>(bounds.high - bounds.low)) {}
    ///@}

    ///@{
    /// Signed distance to the body [m]; to the body that trims it [m].
    [[nodiscard]] double distance(const Vector3<double>& p) const { return surface_.body(p); }
    [[nodiscard]] double beyond_border(const Vector3<double>& p) const { return surface_.within(p); }
    ///@}

    /// Largest distance of a projected point from the surface [m]: 1e-10 of the size of the bounds. Most points are
    /// much closer.
    [[nodiscard]] double tolerance() const noexcept { return 1e-10 * size_; }

    /// The result of Newton's method along the gradient from `p`: near the closest point of the surface if `p` is near
    /// the surface, empty if the method does not converge. The border is ignored.
    [[nodiscard]] std::optional<OnSurface> project(const Vector3<double>& p) const;

    /// The projection onto the border: both distances are zero.
    [[nodiscard]] std::optional<OnSurface> project_to_border(const Vector3<double>& p) const;

  private:
    static constexpr int max_steps = 30;

    [[nodiscard]] Vector3<double> gradient(const auto& body, const Vector3<double>& p) const {
        return gradient_at(body, p, 1e-6 * size_);
    }

    Trimmed<Body, Within> surface_;
    double size_;  // [m]
};

template <class Body>
LevelSurface(const Body&, const Bounds&) -> LevelSurface<Body>;
template <class Body, class Within>
LevelSurface(const Trimmed<Body, Within>&, const Bounds&) -> LevelSurface<Body, Within>;

template <SignedDistance Body, SignedDistance Within>
std::optional<OnSurface> LevelSurface<Body, Within>::project(const Vector3<double>& p) const {
    Vector3<double> x = p;
    for (int i = 0; i < max_steps; ++i) {
        const double off = distance(x);
        const Vector3<double> slope = gradient(surface_.body, x);
        const double squared = squared_norm(slope);
        if (!is_finite(off) || !is_finite(squared) || !(squared > 0)) return std::nullopt;
        const double steepness = std::sqrt(squared);
        if (std::abs(off) <= tolerance() * steepness) return OnSurface{x, slope / steepness};
        x -= off / squared * slope;
    }
    return std::nullopt;
}

template <SignedDistance Body, SignedDistance Within>
std::optional<OnSurface> LevelSurface<Body, Within>::project_to_border(const Vector3<double>& p) const {
    Vector3<double> x = p;
    for (int i = 0; i < max_steps; ++i) {
        const double off = distance(x), beyond = beyond_border(x);
        const Vector3<double> a = gradient(surface_.body, x), b = gradient(surface_.within, x);
        const double aa = squared_norm(a), ab = dot(a, b), bb = squared_norm(b), whole = aa * bb - ab * ab;
        if (!is_finite(off) || !is_finite(beyond) || !is_finite(whole)) return std::nullopt;
        if (!(whole > 1e-6 * aa * bb)) return std::nullopt;  // the surfaces are tangent: no border
        const double steepness = std::sqrt(aa);
        if (std::abs(off) <= tolerance() * steepness && std::abs(beyond) <= tolerance() * std::sqrt(bb)) {
            return OnSurface{x, a / steepness};
        }
        x -= (bb * off - ab * beyond) / whole * a + (aa * beyond - ab * off) / whole * b;
    }
    return std::nullopt;
}

}  // namespace membrane
