// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <limits>
#include <string_view>
#include <type_traits>
#include <utility>

#include <membrane/core/check.hpp>
#include <membrane/core/lanes.hpp>
#include <membrane/model/elastic_network.hpp>

/// Step rules, and the vertex update: the displacement of a vertex for the force on it. One code serves one vertex and
/// several.
///
///     auto solver = membrane::QuasiStaticSolver(network, {.layers = 6}, membrane::MassStep{});  // (4) as published
///     auto solver = membrane::QuasiStaticSolver(network, {.layers = 6}, membrane::SafeStep{.omega = 1.5});
///     auto solver = membrane::QuasiStaticSolver(network, {.layers = 6}, membrane::BlockStep{});
///
///     const auto move = membrane::move_of(rule, vertex, rows.force_tolerance);
///     if (move.moves) position += move.displacement;
namespace membrane {

/// Compliance: multiplied with a force, it gives a displacement [m/N].
template <class C, class Scalar>
concept Compliance = std::same_as<C, Scalar> || std::same_as<C, Symmetric3<Scalar>>;

/// Input of a rule for one vertex: force and stiffness, each a sum over springs, foundation, damping and constraints,
/// and the members below.
template <Number Scalar>
struct VertexState : EnergyMajoriser<Scalar> {
    Scalar contact_stiffness = 0;  ///< the part of `stiffness` that acts along `contact_normal` alone [N/m]
    Vector3<Scalar> contact_normal = Vector3<Scalar>::Zero();  ///< along the forces of constraints; zero without
    Scalar mass = 0;                                           ///< [kg], zero where the network has none
    Each<Scalar> dt = 0;                                       ///< [s]
    Each<Scalar> over_relaxation = 1;  ///< by which the solver multiplies the displacement: at most 1.4 [1]
    bool constrained = false;          ///< of layer 0: constraints set their forces by its response
};

/// A step rule: the compliance of a vertex [m/N], a number, or a `Symmetric3` for a rule whose displacements are not
/// along the force. Beyond the signature: not negative, finite. If a rule sets `needs_mass`, the solver refuses a
/// network without masses. Only a rule that sets `needs_majoriser` gets `stiffness_reduction` and `size`. If a rule
/// sets `guarantees_descent`, no vertex update may raise the energy: for springs that stiffen the solver adds a line
/// search.
template <class Rule, class Scalar>
concept StepRule = Real<Scalar> && std::copyable<Rule> &&
    requires(const Rule& rule, const VertexState<Scalar>& vertex) {
    { rule.compliance(vertex) }
    noexcept->Compliance<Scalar>;
};

namespace detail {

template <class Rule, class Scalar>
consteval bool check_step_rule() noexcept {
    static_assert(std::copyable<Rule>, "StepRule: must be copyable");
    static_assert(
        StepRule<Rule, Scalar>,
        "StepRule: compliance(const VertexState<Scalar>&) const noexcept must return Scalar or Symmetric3<Scalar>");
    return StepRule<Rule, Scalar>;
}

}  // namespace detail

/// A `StepRule`: if a type does not satisfy it, the error names the missing requirement.
template <class Rule, class Scalar>
concept CheckedStepRule = detail::check_step_rule<Rule, Scalar>();

/// Whether the compliances of `Rule` are numbers, so that it moves a vertex along the force on it.
template <class Rule, class Scalar>
inline constexpr bool moves_along_force =
    std::same_as<Scalar, decltype(std::declval<const Rule&>().compliance(std::declval<const VertexState<Scalar>&>()))>;

/// The compliance of one vertex, or of several: a rule that does not take `Lanes` is asked for one vertex after the
/// other.
template <Number N, class Rule>
[[nodiscard]] MEMBRANE_INLINE auto compliance_of(const Rule& rule, const VertexState<N>& vertex) noexcept {
    if constexpr (requires { rule.compliance(vertex); }) {
        return rule.compliance(vertex);
    } else {
        using Scalar = Each<N>;
        using One = std::remove_cvref_t<decltype(rule.compliance(VertexState<Scalar>()))>;
        std::conditional_t<std::same_as<One, Scalar>, N, Symmetric3<N>> all{};
        for (std::size_t i = 0; i < N::count; ++i) {
            VertexState<Scalar> one;
            static_cast<EnergyMajoriser<Scalar>&>(one) = lane_of<EnergyMajoriser<Scalar>>(vertex, i);
            one.contact_stiffness = vertex.contact_stiffness[i];
            one.contact_normal = lane_of<Vector3<Scalar>>(vertex.contact_normal, i);
            one.mass = vertex.mass[i];
            one.dt = vertex.dt;
            one.over_relaxation = vertex.over_relaxation;
            one.constrained = vertex.constrained;
            if constexpr (std::same_as<One, Scalar>) {
                all.set(i, rule.compliance(one));
            } else {
                set_lane(all, i, rule.compliance(one));
            }
        }
        return all;
    }
}

/// Whether `Rule` sets `guarantees_descent`: its updates need no check for divergence.
template <class Rule>
inline constexpr bool is_descent_rule = requires {
    requires Rule::guarantees_descent;
};

/// The rule as published, [Liu07] (4): dx = F dt^2 / m. It converges while dt^2 / m stays below 2 over the largest
/// eigenvalue of the 3 x 3 block of every vertex; the solver refuses a step beyond that.
struct MassStep {
    static constexpr bool needs_mass = true;  ///< a network without masses is refused

    /// dt^2 / m [m/N].
    template <Number Scalar>
    [[nodiscard]] Scalar compliance(const VertexState<Scalar>& vertex) const noexcept {
        return vertex.dt * vertex.dt / vertex.mass;
    }
};

namespace detail {

/// No over-relaxation where constraints act: they set their forces by the response of the vertices.
template <Number Scalar>
[[nodiscard]] Each<Scalar> relaxation(double omega, const VertexState<Scalar>& vertex) noexcept {
    return static_cast<Each<Scalar>>(vertex.constrained ? (std::min)(omega, 1.0) : omega);
}

}  // namespace detail

/// Rule (4) with a mass that is always stable: dx = omega F / stiffness. No update raises the energy (of springs,
/// foundation and damping, less the work of the constraints' forces) for 0 < omega < 2: at the displacement s F it is
/// at most E - s F^2 + s^2 F^2 stiffness / 2, which is below E for 0 < s < 2 / stiffness.
struct SafeStep {
    static constexpr bool guarantees_descent = true;  ///< no update raises the energy

    double omega = 1;  ///< 0 to 2, both excluded; larger spreads a change faster, and beyond 1 may oscillate

    /// omega / stiffness [m/N]; zero without stiffness.
    template <Number Scalar>
    [[nodiscard]] Scalar compliance(const VertexState<Scalar>& vertex) const noexcept {
        const auto resists = vertex.stiffness > 0;
        const Scalar divisor = select(resists, vertex.stiffness, Scalar(1));
        return select<Scalar>(resists, detail::relaxation(omega, vertex) / divisor, Scalar(0));
    }

    /// @throws InvalidInput for an `omega` out of its range
    void validate() const;
};

/// Newton's step of a vertex on its own 3 x 3 block, as in vertex block descent [Chen24], with descent guaranteed
/// without a line search: dx = omega H^-1 F, H = stiffness I - stiffness_reduction / (1 + rho / size).
///
/// By `EnergyMajoriser` the energy is at most E - F.d + d.H d / 2 for every displacement d up to the length rho. As for
/// `SafeStep`, d = omega H^-1 F does not raise it for 0 < omega < 2, if rho is at least the length of d. No eigenvalue
/// of `stiffness_reduction` exceeds half its trace b, so |H^-1 F| <= |F| / (stiffness - b / (1 + rho / size)): rho is
/// chosen so that max(omega, 1) times the right side equals rho, a quadratic equation. Near equilibrium rho vanishes,
/// and H is the Hessian of the energy, without the compression of short springs across their edges. If a contact adds a
/// stiffness s along a normal n, s n n^T is added to H.
struct BlockStep {
    ///@{
    /// No update raises the energy; the state has the members of `EnergyMajoriser`.
    static constexpr bool guarantees_descent = true, needs_majoriser = true;
    ///@}

    double omega = 1;  ///< 0 to 2, both excluded; larger spreads a change faster, and may oscillate

    /// omega H^-1 [m/N].
    template <Number Scalar>
    [[nodiscard]] Symmetric3<Scalar> compliance(const VertexState<Scalar>& vertex) const noexcept;

    /// @throws InvalidInput for an `omega` out of its range
    void validate() const;
};

namespace detail {

/// Updates the inverse of H to that of H + stiffness normal normal^T [Sherman50].
template <Number Scalar>
MEMBRANE_INLINE void add_stiffness(Symmetric3<Scalar>& compliance, const Scalar& stiffness,
                                   const Vector3<Scalar>& normal) noexcept {
    const Vector3<Scalar> along = compliance * normal;
    compliance += outer<Scalar>(-stiffness / (1 + stiffness * dot(normal, along)), along);
}

inline void check_omega(std::string_view rule, double omega) {
    if (!is_finite(omega) || !(omega > 0 && omega < 2)) {
        refuse(rule, "omega must lie between 0 and 2, got ", omega);
    }
}

}  // namespace detail

inline void SafeStep::validate() const { detail::check_omega("SafeStep", omega); }

inline void BlockStep::validate() const { detail::check_omega("BlockStep", omega); }

template <Number Scalar>
MEMBRANE_INLINE Symmetric3<Scalar> BlockStep::compliance(const VertexState<Scalar>& vertex) const noexcept {
    using Limits = std::numeric_limits<Each<Scalar>>;
    const Scalar all_round = vertex.stiffness - vertex.contact_stiffness;
    const auto resists = all_round > 0;
    const Scalar per_stiffness = 1 / select(resists, all_round, Scalar(1));
    const Each<Scalar> relaxation = detail::relaxation(omega, vertex);
    const Each<Scalar> longest = vertex.over_relaxation * (std::max)(relaxation, Each<Scalar>(1));
    const Scalar unreduced = per_stiffness * (longest * norm(vertex.force));
    // A size above 1 / epsilon times the displacement may be reduced to it without loss.
    const Scalar size = smaller<Scalar>(vertex.size, unreduced / Limits::epsilon() + (Limits::min)());
    // With b as above: rho^2 + (size (1 - b / stiffness) - unreduced) rho = unreduced size.
    const Scalar slack = size * (1 - per_stiffness * vertex.stiffness_reduction.trace() / 2) - unreduced;
    const Scalar rho = (root_of<Scalar>(slack * slack + 4 * unreduced * size) - slack) / 2;
    // Nearly flat springs leave H nearly singular: cbrt(epsilon) keeps the determinant above its rounding error.
    const auto flattest = static_cast<Each<Scalar>>(sizeof(Each<Scalar>) == 4 ? 4e-3 : 6e-6);
    const Scalar part = size / (size + larger<Scalar>(rho, flattest * size));
    Symmetric3<Scalar> block = (-per_stiffness * part) * vertex.stiffness_reduction;
    block += diagonal3(Scalar(1));
    Symmetric3<Scalar> compliance = inverse(block, select<Scalar>(resists, relaxation * per_stiffness, Scalar(0)));
    if (vertex.constrained) detail::add_stiffness(compliance, vertex.contact_stiffness, vertex.contact_normal);
    return compliance;
}

inline namespace MEMBRANE_INSTRUCTION_SET {

/// The displacement of a vertex, or of several, by a rule.
template <Number N, class Compliance>
struct VertexMove {
    using YesNo = decltype(N() < N());  ///< a truth value for each vertex

    Compliance compliance;    ///< [m/N]
    N least;                  ///< the compliance if it is a number, else 1 / stiffness [m/N]
    Vector3<N> displacement;  ///< [m]
    YesNo moves;              ///< whether the force is above the tolerance
    YesNo may_overshoot;      ///< whether the displacement may be unstable, by the stiffness bound
};

///@{
/// A compliance as a 3 x 3 block.
template <Number N>
[[nodiscard]] const Symmetric3<N>& as_block(const Symmetric3<N>& block) noexcept {
    return block;
}
template <Number N>
[[nodiscard]] Symmetric3<N> as_block(const N& number) noexcept {
    return diagonal3(number);
}
///@}

/// The displacement of `vertex` by `rule`: compliance times force; zero if the force is at most `force_tolerance` [N].
template <class Rule, Number N>
[[nodiscard]] MEMBRANE_INLINE auto move_of(const Rule& rule, const VertexState<N>& vertex,
                                           Each<N> force_tolerance) noexcept {
    const auto compliance = compliance_of(rule, vertex);
    VertexMove<N, std::remove_cvref_t<decltype(compliance)>> move;
    move.compliance = compliance;
    if constexpr (moves_along_force<Rule, Each<N>>) {
        move.least = compliance;
        move.may_overshoot = is_descent_rule<Rule> ? N(0) > N(0) : compliance * vertex.stiffness >= 2;
    } else {
        const auto resists = vertex.stiffness > 0;
        move.least = select<N>(resists, 1 / select<N>(resists, vertex.stiffness, 1), 0);
        move.may_overshoot = N(0) > N(0);
    }
    move.displacement = compliance * vertex.force;
    move.moves = norm(vertex.force) > force_tolerance;
    return move;
}

}  // namespace MEMBRANE_INSTRUCTION_SET

/// Whether an update needs a line search: springs or elements may stiffen, and `Rule` guarantees descent.
template <class Rule, class Network>
inline constexpr bool needs_line_search = !Network::never_stiffens && is_descent_rule<Rule>;

/// Whether the majoriser bounds the energy of `Network`, and `Rule` evaluates it.
template <class Rule, class Network>
inline constexpr bool has_energy_bound = requires {
    requires Rule::needs_majoriser;
    requires Network::bounds_energy;
};

/// Whether the majoriser of `vertex` shows that a displacement does not raise the energy.
template <Number N>
[[nodiscard]] MEMBRANE_INLINE auto surely_descends(const VertexState<N>& vertex,
                                                   const Vector3<N>& displacement) noexcept {
    const N square = squared_norm(displacement), part = 1 / (1 + root_of<N>(square) / vertex.size);
    const N reduction = part * dot<N>(displacement, vertex.stiffness_reduction * displacement);
    const N quadratic = larger<N>((vertex.stiffness * square - reduction) / 2, 0);
    return vertex.remainder.at(square, quadratic) <= dot<N>(vertex.force, displacement) - quadratic;
}

}  // namespace membrane
