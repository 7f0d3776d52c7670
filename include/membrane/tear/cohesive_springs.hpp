// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/core/field.hpp>
#include <membrane/model/moving_foundation.hpp>
#include <membrane/model/volume_springs.hpp>
#include <membrane/surface/normals.hpp>
#include <membrane/surface/vertex_split.hpp>
#include <membrane/tissue/spring_stiffness.hpp>

/// Adhesion of the membrane to the body under it, which peeling overcomes.
///
///     auto adhesion = membrane::CohesiveSprings(mesh, {.stiffness = 1e8, .strength = 2e3, .energy = 0.05});
///     const auto report = solver.step(x, dt, network, adhesion, pull(tool, grasp));
///     adhesion.update(x, report.moved);                                   // what has been drawn too far lets go
namespace membrane {

/// Constants per area of the body: one value for all vertices, or one for each vertex. A vertex of strength zero does
/// not adhere.
template <Real Scalar>
struct CohesionOptions {
    Field<Scalar> stiffness = {};            ///< along the normal, undamaged [Pa/m], required, positive
    Field<Scalar> strength = {};             ///< largest stress along the normal [Pa], required
    Field<Scalar> energy = {};               ///< that peels off an area along the normal [J/m^2], required, positive
    Field<Scalar> tangential_strength = {};  ///< largest stress along the surface [Pa]; if not given, `strength`
    Field<Scalar> tangential_energy = {};    ///< that shears off an area [J/m^2]; if not given, `energy`
};
// For g++ 12, which otherwise fails on this type's initialiser inside another's.
static_assert(std::is_default_constructible_v<CohesionOptions<float>>);
static_assert(std::is_default_constructible_v<CohesionOptions<double>>);

/// The spring of one vertex of `CohesiveSprings`, for the length of a tick. Its separation is the displacement from the
/// anchor as a part of the one where it fails: the root of the sum of squares of opening / failure opening and sliding
/// / failure sliding.
template <Number Scalar>
struct CohesiveSpring {
    Vector3<Scalar> anchor = Vector3<Scalar>::Zero();  ///< [m]
    Vector3<Scalar> normal = Vector3<Scalar>::Zero();  ///< unit vector
    Scalar normal_stiffness = 0;                       ///< undamaged [N/m]
    Scalar tangential_stiffness = 0;                   ///< undamaged [N/m]
    Scalar per_opening = 0;                            ///< 1 / failure opening [1/m]
    Scalar per_sliding = 0;                            ///< 1 / failure sliding [1/m]
    Scalar softening = 0;  ///< s / (1 - s), s the separation at which damage begins: where the stress is the strength
    Scalar reached = 1;    ///< largest separation in earlier ticks, at least s

    ///@{
    /// Force and stiffness bound at `position`. The bound makes a quadratic that is nowhere below the energy if normal
    /// and tangential energy are equal: beyond s the stress decreases with the separation.
    [[nodiscard]] VertexForce<Scalar> force_on(const Vector3<Scalar>& position) const noexcept {
        const Displacement at(*this, position);
        const auto [along, across] = stiffnesses(at);
        return {-(across * at.sliding + (along * at.height) * normal), larger(along, across)};
    }
    [[nodiscard]] VertexForce<Scalar> elastic_force(const Vector3<Scalar>& position) const noexcept {
        return force_on(position);
    }
    ///@}

    ///@{
    /// It has no damping.
    [[nodiscard]] Vector3<Scalar> damping_force(const Vector3<Scalar>&) const noexcept {
        return Vector3<Scalar>::Zero();
    }
    [[nodiscard]] bool damps() const noexcept { return false; }
    ///@}

    /// Energy stored, which is given back if the displacement is taken back [J].
    [[nodiscard]] Scalar energy(const Vector3<Scalar>& position) const noexcept {
        const Displacement at(*this, position);
        const auto [along, across] = stiffnesses(at);
        return (along * (at.height * at.height) + across * squared_norm(at.sliding)) / 2;
    }

    /// The separation at `position`; it fails at 1.
    [[nodiscard]] Scalar separation(const Vector3<Scalar>& position) const noexcept {
        return separation(Displacement(*this, position));
    }

    /// Energy that the damage takes if the separation increases from `reached` to that at `position` [J].
    [[nodiscard]] Scalar dissipation(const Vector3<Scalar>& position) const noexcept {
        const Displacement at(*this, position);
        const Scalar now = separation(at), height = larger<Scalar>(at.height, 0);
        const auto grows = now > reached;
        const Scalar undamaged = normal_stiffness * (height * height) + tangential_stiffness * squared_norm(at.sliding);
        const Scalar per_square = undamaged / select<Scalar>(grows, now * now, 1);
        return select<Scalar>(grows, per_square * softening * (smaller<Scalar>(now, 1) - reached) / 2, 0);
    }

    /// The part of the stiffness that is left after a separation.
    [[nodiscard]] Scalar intact(const Scalar& separation) const noexcept {
        const Scalar largest = larger(separation, reached);
        return smaller<Scalar>(larger<Scalar>(softening * (1 / largest - 1), 0), 1);
    }

    /// The spring in another frame, by `to_world(point)` and `turned(vector)`.
    template <class PointToWorld, class VectorToWorld>
    [[nodiscard]] CohesiveSpring moved(const PointToWorld& to_world, const VectorToWorld& turned) const noexcept {
        CohesiveSpring there = *this;
        there.anchor = to_world(anchor);
        there.normal = turned(normal);
        return there;
    }

  private:
    struct Displacement {
        Displacement(const CohesiveSpring& spring, const Vector3<Scalar>& position) noexcept
            : height(dot<Scalar>(spring.normal, position - spring.anchor)),
              sliding((position - spring.anchor) - height * spring.normal) {}
        Scalar height;  // above the surface at the anchor
        Vector3<Scalar> sliding;
    };
    [[nodiscard]] Scalar separation(const Displacement& at) const noexcept {
        const Scalar opening = per_opening * larger<Scalar>(at.height, 0);
        return root_of<Scalar>(opening * opening + (per_sliding * per_sliding) * squared_norm(at.sliding));
    }
    // Along the normal, and along the surface. Pressed down, the spring keeps the former.
    [[nodiscard]] std::array<Scalar, 2> stiffnesses(const Displacement& at) const noexcept {
        const Scalar left = intact(separation(at));
        return {select<Scalar>(at.height < 0, normal_stiffness, left * normal_stiffness), left * tangential_stiffness};
    }
};

/// For each vertex a spring that holds it to its rest position until it fails: a cohesive zone with a bilinear law
/// [Geubelle98]. Drawn along the normal, the stress increases by the stiffness K up to the strength S, then decreases
/// linearly to zero at the opening 2 G / S; the area below is the energy G. What is drawn back before that keeps the
/// reduced stiffness. Along the surface the same holds with the tangential constants, whose stiffness is such that both
/// begin to be damaged at the same part of the failure displacement; in between, opening and sliding add up as a root
/// of squares, and the energies in proportion. Pressed down, a vertex is supported by K, also after its spring has
/// failed: by the plane through its anchor, which is the body only as far as that is flat.
///
/// The damage depends on the positions within the tick: a step that converges is an equilibrium with the law itself.
/// `update` makes it permanent. Without it the springs heal.
///
/// A 90 degree peel takes the force G per width, whatever the strength, if the edges resolve the zone where the stress
/// decreases: at most G / (3 S). On a coarser mesh the front moves in jumps; reduce the strength.
template <Real Scalar>
class CohesiveSprings : public SplitCount {
  public:
    /// Anchors and normals are those of `mesh`. @throws InvalidInput for a constant that is negative, not finite,
    /// missing, or of the wrong count, and if a strength is reached only beyond the failure: it must be S^2 < 2 G K.
    CohesiveSprings(const TriangleMesh<Scalar>& mesh, const CohesionOptions<Scalar>& options);

    ///@{
    /// Positions [m] and unit normals of the mesh, 3 x V.
    [[nodiscard]] const Points<Scalar>& anchors() const& noexcept { return anchors_; }
    [[nodiscard]] Points<Scalar> anchors() && noexcept { return std::move(anchors_); }
    [[nodiscard]] const Points<Scalar>& normals() const& noexcept { return normals_; }
    [[nodiscard]] Points<Scalar> normals() && noexcept { return std::move(normals_); }
    ///@}

    /// The spring of vertex `v`.
    [[nodiscard]] CohesiveSpring<Scalar> spring(Index v, const Vector3<Scalar>&, Scalar) const noexcept {
        return spring(v);
    }

    /// As `FoundationModel` requires.
    [[nodiscard]] VertexForce<Scalar> force_on(Index v, const Vector3<Scalar>& position, const Vector3<Scalar>&,
                                               Scalar) const noexcept {
        return spring(v).force_on(position);
    }

    /// Energy stored in the spring of vertex `v` at `position` [J].
    [[nodiscard]] Scalar energy(Index v, const Vector3<Scalar>& position) const noexcept {
        return spring(v).energy(position);
    }

    ///@{
    /// Damages the springs of the vertices `moved` by their separation at `x`, on a body that has moved by `body`.
    /// Returns false, and changes nothing, if `x` or the body is not of V vertices. Ignores an index that is no vertex.
    /// Online. Cost: O(moved).
    bool update(const ConstPointsRef<Scalar>& x, std::span<const Index> moved) noexcept;
    bool update(const MovingBody<Scalar>& body, const ConstPointsRef<Scalar>& x, std::span<const Index> moved) noexcept;
    ///@}

    /// Whether vertex `v` adheres: its spring has not failed.
    [[nodiscard]] bool adheres(Index v) const noexcept { return reached_[static_cast<std::size_t>(v)] < 1; }

    /// The part of the stiffness of vertex `v` that is lost, 0 to 1.
    [[nodiscard]] Scalar damage(Index v) const noexcept { return 1 - spring(v).intact(0); }

    /// Energy that the damage has taken since the construction or `reset` [J].
    [[nodiscard]] double dissipated() const noexcept { return dissipated_; }

    /// Undoes all damage. Cost: O(V).
    void reset() noexcept;

    /// A negligible force, by the rounding of positions [N].
    [[nodiscard]] Scalar force_tolerance(Scalar dt) const noexcept { return negligible_.force(dt); }

    ///@{
    /// A vertex becomes two, each with its share of the stiffness; a vertex moves at rest, and its anchor with it.
    /// Online.
    void split(const VertexSplit& split) noexcept;
    void reshape(const MovedVertex<Scalar>& moved) noexcept { anchors_.col(moved.vertex) = moved.rest; }
    ///@}

    /// Visits damage, and what a tear changes, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.anchors_, self.normals_, self.constants_, self.reached_, self.dissipated_, self.splits_);
    }

  private:
    struct Constants {
        Scalar normal_stiffness, tangential_stiffness, per_opening, per_sliding, softening;
    };
    [[nodiscard]] CohesiveSpring<Scalar> spring(Index v) const noexcept {
        const auto& k = constants_[static_cast<std::size_t>(v)];
        return {point(anchors_, v), point(normals_, v), k.normal_stiffness, k.tangential_stiffness,
                k.per_opening,      k.per_sliding,      k.softening,        reached_[static_cast<std::size_t>(v)]};
    }
    void set_constants(const TriangleMesh<Scalar>& mesh, const CohesionOptions<Scalar>& options);
    void damage_at(Index v, const Vector3<Scalar>& position) noexcept;

    Points<Scalar> anchors_, normals_;
    std::vector<Constants> constants_;
    std::vector<Scalar> reached_;  // largest separation of each vertex
    double dissipated_ = 0;
    detail::NegligibleFoundationForce<Scalar> negligible_;
};

static_assert(FoundationModel<CohesiveSprings<float>, float> && SpringsInLanes<CohesiveSprings<double>, double>);

template <Real Scalar>
CohesiveSprings<Scalar>::CohesiveSprings(const TriangleMesh<Scalar>& mesh, const CohesionOptions<Scalar>& options)
    : anchors_(mesh.positions()),
      normals_(VertexNormals(mesh).values()),
      negligible_{detail::position_rounding(anchors_)} {
    set_constants(mesh, options);
    for (const auto& k : constants_) negligible_.add((std::max)(k.normal_stiffness, k.tangential_stiffness), 0);
    reached_.resize(constants_.size());
    reset();
}

template <Real Scalar>
void CohesiveSprings<Scalar>::set_constants(const TriangleMesh<Scalar>& mesh, const CohesionOptions<Scalar>& options) {
    constexpr std::string_view component = "CohesiveSprings";
    const auto each = [&](const Field<Scalar>& field, std::string_view name, std::string_view unit, bool allow_zero) {
        if (!field.given()) refuse(component, name, " [", unit, "] is required");
        return field.expand(mesh.vertex_count(), component, name, "vertex", unit, allow_zero);
    };
    const auto or_else = [](const Field<Scalar>& field, const Field<Scalar>& other) {
        return field.given() ? field : other;
    };
    const auto areas = vertex_areas(mesh);
    const auto stiffness = each(options.stiffness, "stiffness", "Pa/m", false);
    const auto strength = each(options.strength, "strength", "Pa", true);
    const auto energy = each(options.energy, "energy", "J/m^2", false);
    const auto tangential_strength =
        each(or_else(options.tangential_strength, options.strength), "tangential_strength", "Pa", true);
    const auto tangential_energy =
        each(or_else(options.tangential_energy, options.energy), "tangential_energy", "J/m^2", false);
    constants_.reserve(areas.size());
    for (std::size_t v = 0; v < areas.size(); ++v) {
        const Scalar k = stiffness[v], s = strength[v], t = tangential_strength[v];
        const Scalar onset = s * s / (2 * energy[v] * k);
        if (!(onset < 1)) {
            refuse(component, "strength of vertex ", v,
                   " must be below sqrt(2 energy stiffness) = ", std::sqrt(2 * energy[v] * k), " [Pa], got ", s);
        }
        if (onset == 0) {
            constants_.push_back({areas[v] * k, 0, 0, 0, 0});
            continue;
        }
        constants_.push_back({areas[v] * k, areas[v] * (t * t / (2 * tangential_energy[v] * onset)),
                              s / (2 * energy[v]), t / (2 * tangential_energy[v]), onset / (1 - onset)});
    }
}

template <Real Scalar>
bool CohesiveSprings<Scalar>::update(const ConstPointsRef<Scalar>& x, std::span<const Index> moved) noexcept {
    if (x.cols() != anchors_.cols()) return false;
    for (const Index v : moved) {
        if (v >= 0 && v < x.cols()) damage_at(v, point(x, v));
    }
    return true;
}

template <Real Scalar>
bool CohesiveSprings<Scalar>::update(const MovingBody<Scalar>& body, const ConstPointsRef<Scalar>& x,
                                     std::span<const Index> moved) noexcept {
    if (x.cols() != anchors_.cols() || body.anchors().cols() != x.cols()) return false;
    for (const Index v : moved) {
        if (v >= 0 && v < x.cols()) damage_at(v, FrameOnBody(body, v).point_to_body(point(x, v)));
    }
    return true;
}

template <Real Scalar>
void CohesiveSprings<Scalar>::damage_at(Index v, const Vector3<Scalar>& position) noexcept {
    const auto before = spring(v);
    Scalar& reached = reached_[static_cast<std::size_t>(v)];
    dissipated_ += static_cast<double>(before.dissipation(position));
    reached = (std::max)(reached, (std::min)(before.separation(position), Scalar(1)));
}

template <Real Scalar>
void CohesiveSprings<Scalar>::reset() noexcept {
    for (std::size_t v = 0; v < reached_.size(); ++v) {
        const Scalar softening = constants_[v].softening;
        reached_[v] = softening > 0 ? softening / (1 + softening) : Scalar(1);
    }
    dissipated_ = 0;
}

template <Real Scalar>
void CohesiveSprings<Scalar>::split(const VertexSplit& split) noexcept {
    ++splits_;
    const auto from = static_cast<std::size_t>(split.vertex), to = static_cast<std::size_t>(split.copy);
    for (auto* points : {&anchors_, &normals_}) points->col(split.copy) = points->col(split.vertex);
    constants_[to] = constants_[from];
    divide(constants_[from].normal_stiffness, constants_[to].normal_stiffness, split.area_share);
    divide(constants_[from].tangential_stiffness, constants_[to].tangential_stiffness, split.area_share);
    reached_[to] = reached_[from];
}

}  // namespace membrane
