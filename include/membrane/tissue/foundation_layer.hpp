// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/core/field.hpp>
#include <membrane/core/symmetric3.hpp>
#include <membrane/model/volume_springs.hpp>
#include <membrane/surface/normals.hpp>
#include <membrane/surface/vertex_split.hpp>

/// A foundation with one stiffness along the normal and another along the surface.
///
///     const auto foundation =
///         membrane::FoundationSprings(mesh, {.normal = membrane::normal_stiffnesses(mesh, layer),
///                                            .tangential = membrane::tangential_stiffnesses(mesh, layer),
///                                            .recovery_time = 0.2});
///     solver.step(x, dt, network, foundation, press(tool, contact));
namespace membrane {

/// Constants of the foundation: one value for all vertices, or one for each vertex.
template <Real Scalar>
struct FoundationOptions {
    Field<Scalar> normal = {};         ///< stiffness along the normal at rest [N/m], required
    Field<Scalar> tangential = {};     ///< stiffness along the surface at rest [N/m], required
    Field<Scalar> recovery_time = {};  ///< T [s], zero if not given: in T the foundation alone reduces an indentation
                                       ///< to 1 / e; the membrane accelerates the recovery
};
// For g++ 12, which otherwise fails on this type's initialiser inside another's.
static_assert(std::is_default_constructible_v<FoundationOptions<float>>);
static_assert(std::is_default_constructible_v<FoundationOptions<double>>);

/// The spring of one vertex of `FoundationSprings`, for the length of a tick.
template <Number Scalar>
struct FoundationSpring {
    Vector3<Scalar> anchor = Vector3<Scalar>::Zero();  ///< [m]
    Vector3<Scalar> start = Vector3<Scalar>::Zero();   ///< of the vertex when the tick began [m]
    Vector3<Scalar> normal = Vector3<Scalar>::Zero();  ///< unit vector
    Scalar tangential = 0;                             ///< stiffness along the surface [N/m]
    Scalar excess = 0;                                 ///< of the stiffness along the normal over that [N/m]
    Scalar rate = 0;                                   ///< recovery time over the length of the tick

    ///@{
    /// Force and stiffness bound at `position`: without damping, of damping alone, and together.
    [[nodiscard]] VertexForce<Scalar> elastic_force(const Vector3<Scalar>& position) const noexcept {
        return {-times(position - anchor), largest() * (1 + rate)};
    }
    [[nodiscard]] Vector3<Scalar> damping_force(const Vector3<Scalar>& position) const noexcept {
        return -times(rate * (position - start));
    }
    [[nodiscard]] VertexForce<Scalar> force_on(const Vector3<Scalar>& position) const noexcept {
        return {-times((position - anchor) + rate * (position - start)), largest() * (1 + rate)};
    }
    ///@}

    /// Whether it has damping.
    [[nodiscard]] bool damps() const noexcept { return any(rate != 0); }

    /// The spring in another frame, by `to_world(point)` and `turned(vector)`.
    template <class PointToWorld, class VectorToWorld>
    [[nodiscard]] FoundationSpring moved(const PointToWorld& to_world, const VectorToWorld& turned) const noexcept {
        return {to_world(anchor), to_world(start), turned(normal), tangential, excess, rate};
    }

    /// The stiffness K times a displacement [N].
    [[nodiscard]] Vector3<Scalar> times(const Vector3<Scalar>& displacement) const noexcept {
        return tangential * displacement + (excess * dot(normal, displacement)) * normal;
    }

  private:
    [[nodiscard]] Scalar largest() const noexcept { return larger<Scalar>(tangential + excess, tangential); }
};

/// For each vertex a spring to its rest position, with one stiffness along the normal n there and one across it:
/// K = k_t I + (k_n - k_t) n n^T. In a tick of dt its force is -K (u + T (u - u_0) / dt), u the displacement from rest,
/// u_0 that at the start of the tick, T the recovery time. The damping is T K (Kelvin and Voigt).
///
/// A tick reduces an indentation by the factor 1 / (1 + dt / T): in ticks of T / 10 the recovery takes 5 % longer than
/// T.
template <Real Scalar>
class FoundationSprings : public SplitCount {
  public:
    /// Anchors and normals are those of `mesh`.
    /// @throws InvalidInput for a constant that is negative, not finite, missing, or of the wrong count
    FoundationSprings(const TriangleMesh<Scalar>& mesh, const FoundationOptions<Scalar>& options);

    ///@{
    /// Positions [m] and unit normals of the mesh, 3 x V.
    [[nodiscard]] const Points<Scalar>& anchors() const& noexcept { return anchors_; }
    [[nodiscard]] Points<Scalar> anchors() && noexcept { return std::move(anchors_); }
    [[nodiscard]] const Points<Scalar>& normals() const& noexcept { return normals_; }
    [[nodiscard]] Points<Scalar> normals() && noexcept { return std::move(normals_); }
    ///@}

    ///@{
    /// Constants of vertex `v`: [N/m], [N/m] and [s].
    [[nodiscard]] Scalar normal_stiffness(Index v) const noexcept { return constants(v).normal; }
    [[nodiscard]] Scalar tangential_stiffness(Index v) const noexcept { return constants(v).tangential; }
    [[nodiscard]] Scalar recovery_time(Index v) const noexcept { return constants(v).time; }
    ///@}

    /// The spring of vertex `v`, which was at `start` when the tick of length `dt` [s] began.
    [[nodiscard]] FoundationSpring<Scalar> spring(Index v, const Vector3<Scalar>& start, Scalar dt) const noexcept {
        const auto& k = constants(v);
        return {point(anchors_, v), start, point(normals_, v), k.tangential, k.normal - k.tangential, k.time / dt};
    }

    /// As `FoundationModel` requires.
    [[nodiscard]] VertexForce<Scalar> force_on(Index v, const Vector3<Scalar>& position, const Vector3<Scalar>& start,
                                               Scalar dt) const noexcept {
        return spring(v, start, dt).force_on(position);
    }

    /// K, the Hessian of the energy, computed in `Number` from constants and normals [N/m].
    template <Real Number = Scalar>
    [[nodiscard]] Symmetric3<Number> hessian(Index v) const noexcept {
        const auto normal = static_cast<Number>(constants(v).normal),
                   tangential = static_cast<Number>(constants(v).tangential);
        auto sum = diagonal3(tangential);
        sum += outer<Number>(normal - tangential, point(normals_, v).template cast<Number>());
        return sum;
    }

    /// Energy stored in the spring of vertex `v` at `position` [J].
    [[nodiscard]] Scalar energy(Index v, const Vector3<Scalar>& position) const noexcept {
        const Vector3<Scalar> displacement = position - point(anchors_, v);
        return dot<Scalar>(displacement, spring(v, position, 1).times(displacement)) / 2;
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
        visit(self.anchors_, self.normals_, self.constants_, self.splits_);
    }

  private:
    struct Constants {
        Scalar normal, tangential, time;
    };
    [[nodiscard]] const Constants& constants(Index v) const noexcept { return constants_[static_cast<std::size_t>(v)]; }

    Points<Scalar> anchors_, normals_;
    std::vector<Constants> constants_;
    detail::NegligibleFoundationForce<Scalar> negligible_;
};

static_assert(FoundationModel<FoundationSprings<float>, float> && FoundationModel<FoundationSprings<double>, double>);

template <Real Scalar>
FoundationSprings<Scalar>::FoundationSprings(const TriangleMesh<Scalar>& mesh, const FoundationOptions<Scalar>& options)
    : anchors_(mesh.positions()),
      normals_(VertexNormals(mesh).values()),
      negligible_{detail::position_rounding(anchors_)} {
    constexpr std::string_view component = "FoundationSprings";
    const auto each = [&](const Field<Scalar>& field, std::string_view name, std::string_view unit) {
        return field.expand(mesh.vertex_count(), component, name, "vertex", unit);
    };
    if (!options.normal.given()) refuse(component, "normal [N/m] is required");
    if (!options.tangential.given()) refuse(component, "tangential [N/m] is required");
    const auto normal = each(options.normal, "normal", "N/m");
    const auto tangential = each(options.tangential, "tangential", "N/m");
    const auto time = each(options.recovery_time.given() ? options.recovery_time : Scalar(0), "recovery_time", "s");
    constants_.reserve(normal.size());
    for (std::size_t v = 0; v < normal.size(); ++v) {
        constants_.push_back({normal[v], tangential[v], time[v]});
        const Scalar stiffest = (std::max)(normal[v], tangential[v]);
        negligible_.add(stiffest, stiffest * time[v]);
    }
}

template <Real Scalar>
void FoundationSprings<Scalar>::split(const VertexSplit& split) noexcept {
    ++splits_;
    for (auto* points : {&anchors_, &normals_}) points->col(split.copy) = points->col(split.vertex);
    Constants& of_vertex = constants_[static_cast<std::size_t>(split.vertex)];
    Constants& of_copy = constants_[static_cast<std::size_t>(split.copy)];
    of_copy = of_vertex;
    divide(of_vertex.normal, of_copy.normal, split.area_share);
    divide(of_vertex.tangential, of_copy.tangential, split.area_share);
}

}  // namespace membrane
