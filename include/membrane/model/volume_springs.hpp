// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/core/field.hpp>
#include <membrane/core/lanes.hpp>
#include <membrane/core/symmetric3.hpp>
#include <membrane/model/elastic_network.hpp>
#include <membrane/surface/triangle_mesh.hpp>
#include <membrane/surface/vertex_split.hpp>

/// The foundation: it supports the membrane on the body under it.
///
///     const auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});
///     solver.step(x, dt, network, foundation, press(tool, contact));            // the body stands still
///     solver.step(x, dt, network, on(body, foundation), press(tool, contact));  // see `moving_foundation.hpp`
namespace membrane {

/// Constants of the volume springs: one value for all vertices, or one for each vertex.
template <Real Scalar>
struct VolumeSpringOptions {
    Field<Scalar> stiffness = {};  ///< k'_s [N/m], required; a larger one holds closer to the body
    Field<Scalar> damping = {};    ///< k'_d [N s/m], zero if not given; recovery takes the time k'_d / k'_s [s]
};
// For g++ 12, which otherwise fails on this type's initialiser inside another's.
static_assert(std::is_default_constructible_v<VolumeSpringOptions<float>>);
static_assert(std::is_default_constructible_v<VolumeSpringOptions<double>>);

/// A model of the foundation: its force on vertex `v` at `position`, which was at `start` when the tick of length `dt`
/// [s] began. Beyond the signature: the force does no work on the membrane over a closed path. Optional members:
/// `spring(v, start, dt)`, with which a solver updates several vertices at once; `hessian(v)`, the stiffness without
/// damping as a `Symmetric3`, which an equilibrium needs of an anisotropic model; for a linear model
/// `hessian<Number>(v)` in either number type and `anchors()`, the positions without force: an equilibrium then
/// evaluates the model in double even if it is of floats; `force_tolerance(dt)`, the force on a vertex that is
/// negligible by the rounding of its position [N]. On a moving body a model is transformed by `on(body, volume)`.
template <class Volume, class Scalar>
concept FoundationModel = Real<Scalar> &&
    requires(const Volume& volume, Index v, const Vector3<Scalar>& position, Scalar dt) {
    { volume.force_on(v, position, position, dt) }
    noexcept->std::same_as<VertexForce<Scalar>>;
};

namespace detail {

template <class Volume, class Scalar>
consteval bool check_foundation_model() noexcept {
    static_assert(
        FoundationModel<Volume, Scalar>,
        "FoundationModel: force_on(Index, const Vector3<Scalar>& position, const Vector3<Scalar>& start, Scalar dt) "
        "const noexcept must return VertexForce<Scalar>");
    return FoundationModel<Volume, Scalar>;
}

}  // namespace detail

/// A `FoundationModel`: if a type does not satisfy it, the error names the missing requirement.
template <class Volume, class Scalar>
concept CheckedFoundationModel = detail::check_foundation_model<Volume, Scalar>();

namespace detail {

/// The force that is negligible on every vertex of a foundation. Damping slows a vertex until rounding stops it.
template <Real Scalar>
struct NegligibleFoundationForce {
    /// Adds the spring of a vertex [N/m], [N s/m].
    void add(Scalar stiffness, Scalar damping) noexcept {
        elastic = (std::max)(elastic, rounding * stiffness);
        viscous = (std::max)(viscous, rounding * damping);
    }
    /// In a tick of `dt` [s].
    [[nodiscard]] Scalar force(Scalar dt) const noexcept { return elastic + viscous / dt; }

    Scalar rounding;                  ///< of positions [m]
    Scalar elastic = 0, viscous = 0;  ///< [N], [N s]
};

}  // namespace detail

/// No body under the membrane: no force, at no cost.
struct NoFoundation {
    /// Zero.
    template <Real Scalar>
    [[nodiscard]] VertexForce<Scalar> force_on(Index, const std::type_identity_t<Vector3<Scalar>>&,
                                               const std::type_identity_t<Vector3<Scalar>>&, Scalar) const noexcept {
        return {Vector3<Scalar>::Zero(), 0};
    }
};

/// One virtual volume spring, [Liu07] (5), for the length of a tick: of rest length zero, from an anchor to its vertex.
template <Number Scalar>
struct VolumeSpring {
    Vector3<Scalar> anchor = Vector3<Scalar>::Zero();  ///< [m]
    Scalar stiffness = 0;                              ///< k'_s [N/m]
    Scalar rate = 0;                                   ///< damping over the length of the tick, k'_d / dt [N/m]
    Scalar before = 0;                                 ///< its length when the tick began [m]

    /// Its force on the vertex at `position`, without damping.
    [[nodiscard]] VertexForce<Scalar> elastic_force(const Vector3<Scalar>& position) const noexcept {
        return {-stiffness * (position - anchor), stiffness + rate};
    }

    /// Energy stored [J].
    [[nodiscard]] Scalar energy(const Vector3<Scalar>& position) const noexcept {
        return stiffness * squared_norm<Scalar>(position - anchor) / 2;
    }

    /// The damping force. The velocity along the spring in (5) is its change of length over the tick: the number of
    /// vertex updates within the tick does not change the damping, and the force has an energy, like that of a spring:
    /// k'_d (change of length)^2 / (2 dt).
    [[nodiscard]] Vector3<Scalar> damping_force(const Vector3<Scalar>& position) const noexcept {
        const Vector3<Scalar> length = position - anchor;
        const Scalar square = squared_norm(length);
        const auto damps = (rate != 0) & (square != 0);  // the spring acts only while it has a length
        const Scalar now = select(damps, root_of(square), Scalar(1));
        return -select<Scalar>(damps, rate * (now - before) / now, Scalar(0)) * length;
    }

    /// Elastic force and damping force.
    [[nodiscard]] VertexForce<Scalar> force_on(const Vector3<Scalar>& position) const noexcept {
        auto sum = elastic_force(position);
        if (any(rate != 0)) sum.force += damping_force(position);
        return sum;
    }

    /// Whether it has damping.
    [[nodiscard]] bool damps() const noexcept { return any(rate != 0); }

    /// The spring in another frame: `to_world(point)` of its anchor.
    template <class PointToWorld, class VectorToWorld>
    [[nodiscard]] VolumeSpring moved(const PointToWorld& to_world, const VectorToWorld&) const noexcept {
        VolumeSpring there = *this;
        there.anchor = to_world(anchor);
        return there;
    }
};

/// Whether the foundation is of `count` vertices, as far as it has anchors.
template <class Volume>
[[nodiscard]] bool has_vertices([[maybe_unused]] const Volume& volume, [[maybe_unused]] Eigen::Index count) noexcept {
    if constexpr (requires { volume.anchors().cols(); }) return volume.anchors().cols() == count;
    return true;
}

/// A model whose force on a vertex is that of a spring with constants for the length of a tick: such as `VolumeSpring`,
/// with its member functions.
template <class Volume, class Scalar>
concept HasSprings = requires(const Volume& volume, const Vector3<Scalar>& start, Scalar dt) {
    { volume.spring(Index(0), start, dt).force_on(start) } -> std::same_as<VertexForce<Scalar>>;
    { volume.spring(Index(0), start, dt).damping_force(start) } -> std::same_as<Vector3<Scalar>>;
    { volume.spring(Index(0), start, dt).damps() } -> std::same_as<bool>;
};

/// The spring of one vertex.
template <class Volume, class Scalar>
    requires HasSprings<Volume, Scalar>
using SpringOf =
    std::remove_cvref_t<decltype(std::declval<const Volume&>().spring(Index(0), Vector3<Scalar>(), Scalar(1)))>;

/// Most numbers in a spring for updates of several vertices at once.
inline constexpr std::size_t max_numbers_in_spring = 12;

/// Whether a solver may update several vertices at once: the spring is a struct of few numbers, and takes `Lanes`.
template <class Volume, class Scalar>
concept SpringsInLanes = HasSprings<Volume, Scalar> && StructOfNumbers<SpringOf<Volume, Scalar>> &&
                             sizeof(SpringOf<Volume, Scalar>) <= max_numbers_in_spring * sizeof(Scalar) &&
                         requires(const InLanes<SpringOf<Volume, Scalar>>& springs,
                                  const Vector3<Lanes<Scalar>>& position) {
    { springs.force_on(position) } -> std::same_as<VertexForce<Lanes<Scalar>>>;
    { springs.elastic_force(position) } -> std::same_as<VertexForce<Lanes<Scalar>>>;
};

template <class Volume, Real Scalar>
class MovingFoundation;  // of moving_foundation.hpp

/// Virtual volume springs, [Liu07] (5): one for each vertex, of rest length zero, from the anchor to the vertex.
template <Real Scalar>
class VirtualVolumeSprings : public SplitCount {
  public:
    /// Anchors are the positions of `mesh`.
    /// @throws InvalidInput for a constant that is negative, not finite, missing, or of the wrong count
    VirtualVolumeSprings(const TriangleMesh<Scalar>& mesh, const VolumeSpringOptions<Scalar>& options);

    /// Anchors, 3 x V [m].
    [[nodiscard]] const Points<Scalar>& anchors() const& noexcept { return anchors_; }
    [[nodiscard]] Points<Scalar> anchors() && noexcept { return std::move(anchors_); }

    ///@{
    /// Constants of vertex `v`: k'_s [N/m] and k'_d [N s/m].
    [[nodiscard]] Scalar stiffness(Index v) const noexcept { return stiffness_[static_cast<std::size_t>(v)]; }
    [[nodiscard]] Scalar damping(Index v) const noexcept {
        return damping_.empty() ? Scalar(0) : damping_[static_cast<std::size_t>(v)];
    }
    ///@}

    /// The spring of vertex `v`, which was at `start` when the tick of length `dt` [s] began.
    [[nodiscard]] VolumeSpring<Scalar> spring(Index v, const Vector3<Scalar>& start, Scalar dt) const noexcept {
        const Vector3<Scalar> anchor = point(anchors_, v);
        const Scalar d = damping(v);
        if (d == 0) return {anchor, stiffness(v), 0, 0};
        return {anchor, stiffness(v), d / dt, norm<Scalar>(start - anchor)};
    }

    /// As `FoundationModel` requires.
    [[nodiscard]] VertexForce<Scalar> force_on(Index v, const Vector3<Scalar>& position, const Vector3<Scalar>& start,
                                               Scalar dt) const noexcept {
        if (damping(v) == 0) return VolumeSpring<Scalar>{point(anchors_, v), stiffness(v)}.elastic_force(position);
        return spring(v, start, dt).force_on(position);
    }

    /// The Hessian of the energy, computed in `Number` from the constants [N/m].
    template <Real Number = Scalar>
    [[nodiscard]] Symmetric3<Number> hessian(Index v) const noexcept {
        return diagonal3(static_cast<Number>(stiffness(v)));
    }

    /// Energy stored in the spring of vertex `v` at `position` [J].
    [[nodiscard]] Scalar energy(Index v, const Vector3<Scalar>& position) const noexcept {
        return VolumeSpring<Scalar>{point(anchors_, v), stiffness(v)}.energy(position);
    }

    /// A negligible force in a tick of `dt` [s], by the rounding of positions [N].
    [[nodiscard]] Scalar force_tolerance(Scalar dt) const noexcept { return negligible_.force(dt); }

    ///@{
    /// A vertex becomes two, each with its share of the stiffness; a vertex moves at rest, and its anchor with it.
    /// Online.
    void split(const VertexSplit& split) noexcept;
    void reshape(const MovedVertex<Scalar>& moved) noexcept { anchors_.col(moved.vertex) = moved.rest; }
    ///@}

    /// Visits what a tear changes, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.anchors_, self.stiffness_, self.damping_, self.splits_);
    }

  private:
    Points<Scalar> anchors_;
    std::vector<Scalar> stiffness_, damping_;
    detail::NegligibleFoundationForce<Scalar> negligible_;
};

template <Real Scalar>
VirtualVolumeSprings<Scalar>::VirtualVolumeSprings(const TriangleMesh<Scalar>& mesh,
                                                   const VolumeSpringOptions<Scalar>& options)
    : anchors_(mesh.positions()), negligible_{detail::position_rounding(anchors_)} {
    constexpr std::string_view component = "VirtualVolumeSprings";
    if (!options.stiffness.given()) refuse(component, "stiffness [N/m] is required");
    stiffness_ = options.stiffness.expand(mesh.vertex_count(), component, "stiffness", "vertex", "N/m");
    if (options.damping.given()) {
        damping_ = options.damping.expand(mesh.vertex_count(), component, "damping", "vertex", "N s/m");
    }
    for (Index v = 0; v < mesh.vertex_count(); ++v) negligible_.add(stiffness(v), damping(v));
}

template <Real Scalar>
void VirtualVolumeSprings<Scalar>::split(const VertexSplit& split) noexcept {
    ++splits_;
    anchors_.col(split.copy) = anchors_.col(split.vertex);
    for (auto* constants : {&stiffness_, &damping_}) {
        if (!constants->empty())
            divide((*constants)[static_cast<std::size_t>(split.vertex)],
                   (*constants)[static_cast<std::size_t>(split.copy)], split.area_share);
    }
}

}  // namespace membrane
