// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <string_view>
#include <type_traits>
#include <vector>

#include <membrane/core/field.hpp>
#include <membrane/core/symmetric3.hpp>
#include <membrane/model/volume_springs.hpp>
#include <membrane/surface/normals.hpp>

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

/// For each vertex a spring to its rest position, with one stiffness along the normal n there and one across it:
/// K = k_t I + (k_n - k_t) n n^T. In a tick of dt its force is -K (u + T (u - u_0) / dt), u the displacement from rest,
/// u_0 that at the start of the tick, T the recovery time. The damping is T K (Kelvin and Voigt).
///
/// A tick reduces an indentation by the factor 1 / (1 + dt / T): in ticks of T / 10 the recovery takes 5 % longer than
/// T.
template <Real Scalar>
class FoundationSprings {
  public:
    /// Anchors and normals are those of `mesh`.
    /// @throws InvalidInput for a constant that is negative, not finite, missing, or of the wrong count
    FoundationSprings(const TriangleMesh<Scalar>& mesh, const FoundationOptions<Scalar>& options);

    ///@{
    /// Positions [m] and unit normals of the mesh, 3 x V.
    [[nodiscard]] const Points<Scalar>& anchors() const noexcept { return anchors_; }
    [[nodiscard]] const Points<Scalar>& normals() const noexcept { return normals_; }
    ///@}

    ///@{
    /// Constants of vertex `v`: [N/m], [N/m] and [s].
    [[nodiscard]] Scalar normal_stiffness(Index v) const noexcept { return constants(v).normal; }
    [[nodiscard]] Scalar tangential_stiffness(Index v) const noexcept { return constants(v).tangential; }
    [[nodiscard]] Scalar recovery_time(Index v) const noexcept { return constants(v).time; }
    ///@}

    /// As `FoundationModel` requires.
    [[nodiscard]] VertexForce<Scalar> force_on(Index v, const Vector3<Scalar>& position, const Vector3<Scalar>& start,
                                               Scalar dt) const noexcept {
        const auto& k = constants(v);
        const Scalar rate = k.time / dt;
        const Vector3<Scalar> displacement = (position - point(anchors_, v)) + rate * (position - start);
        return {-stiffness_times(v, displacement), (std::max)(k.normal, k.tangential) * (1 + rate)};
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
        return dot<Scalar>(displacement, stiffness_times(v, displacement)) / 2;
    }

  private:
    struct Constants {
        Scalar normal, tangential, time;
    };
    [[nodiscard]] const Constants& constants(Index v) const noexcept { return constants_[static_cast<std::size_t>(v)]; }

    /// K `displacement` [N].
    [[nodiscard]] Vector3<Scalar> stiffness_times(Index v, const Vector3<Scalar>& displacement) const noexcept {
        const auto& k = constants(v);
        const Vector3<Scalar> normal = point(normals_, v);
        return k.tangential * displacement + ((k.normal - k.tangential) * dot(normal, displacement)) * normal;
    }

    Points<Scalar> anchors_, normals_;
    std::vector<Constants> constants_;
};

static_assert(FoundationModel<FoundationSprings<float>, float> && FoundationModel<FoundationSprings<double>, double>);

template <Real Scalar>
FoundationSprings<Scalar>::FoundationSprings(const TriangleMesh<Scalar>& mesh, const FoundationOptions<Scalar>& options)
    : anchors_(mesh.positions()), normals_(VertexNormals(mesh).values()) {
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
    for (std::size_t v = 0; v < normal.size(); ++v) constants_.push_back({normal[v], tangential[v], time[v]});
}

}  // namespace membrane
