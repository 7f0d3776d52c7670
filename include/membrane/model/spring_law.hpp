// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <limits>

#include <membrane/core/check.hpp>
#include <membrane/core/lanes.hpp>
#include <membrane/core/types.hpp>

/// Tension of a spring at a given length: with constant stiffness, or stiffness as a function of the elongation.
///
///     struct Cubic {                                              // a law of one's own
///         template <membrane::Real Scalar>
///         membrane::SpringResponse<Scalar> operator()(const membrane::SpringState<Scalar>& s) const noexcept;
///     };
///     const auto network = membrane::MassSpringNetwork(mesh, Cubic{}, {.stiffness = 40.0});
namespace membrane {

/// A spring, the input of a law.
template <Number Scalar>
struct SpringState {
    Scalar stiffness;    ///< of the spring at rest, k_ij [N/m], > 0
    Scalar rest_length;  ///< r_ij [m], >= 0
    Scalar length;       ///< l_ij [m], > 0
};

/// The result of a law.
template <Number Scalar>
struct SpringResponse {
    Scalar tension;    ///< [N], positive if the spring pulls its two ends together
    Scalar stiffness;  ///< derivative of the tension by the length [N/m]
    Scalar energy;     ///< 0 at rest length [J]
};

/// A law of springs. Beyond the signature: tension and energy are 0 at rest length, `tension` is the derivative of
/// `energy` and `stiffness` that of `tension`, all finite for every finite length. If a law also takes `Lanes`, a
/// solver asks it for several springs at once. Members of the result that a caller does not use are not computed once
/// the call is inlined.
template <class Law, class Scalar>
concept SpringLaw = Real<Scalar> && std::copyable<Law> && requires(const Law& law, const SpringState<Scalar>& state) {
    { law(state) }
    noexcept->std::same_as<SpringResponse<Scalar>>;
};

namespace detail {

template <class Law, class Scalar>
consteval bool check_spring_law() noexcept {
    static_assert(std::copyable<Law>, "SpringLaw: must be copyable");
    static_assert(SpringLaw<Law, Scalar>,
                  "SpringLaw: law(const SpringState<Scalar>&) const noexcept must return SpringResponse<Scalar>");
    return SpringLaw<Law, Scalar>;
}

}  // namespace detail

/// A `SpringLaw`: if a type does not satisfy it, the error names the missing requirement.
template <class Law, class Scalar>
concept CheckedSpringLaw = detail::check_spring_law<Law, Scalar>();

/// The response of one spring, or of several: a law that does not take `Lanes` is asked for one spring after the other,
/// but for springs without stiffness, which fill unused lanes.
template <Number N, class Law>
[[nodiscard]] MEMBRANE_INLINE SpringResponse<N> response_of(const Law& law, const SpringState<N>& springs) noexcept {
    if constexpr (requires { law(springs); }) {
        return law(springs);
    } else {
        using Scalar = Each<N>;
        SpringResponse<N> responses{0, 0, 0};
        for (std::size_t i = 0; i < N::count; ++i) {
            const auto spring = lane_of<SpringState<Scalar>>(springs, i);
            if (spring.stiffness != 0) set_lane(responses, i, SpringResponse<Scalar>(law(spring)));
        }
        return responses;
    }
}

/// A law that sets `never_stiffens` states that at no other length a spring is stiffer than at this one, or than its
/// tension over its length if that is larger. Then updates guarantee descent; with other laws a solver needs a line
/// search.
template <class Law>
[[nodiscard]] consteval bool never_stiffens() noexcept {
    if constexpr (requires { Law::never_stiffens; }) return Law::never_stiffens;
    return false;
}

/// Tension proportional to the elongation, [Liu07] 2.2: k (l - r).
struct LinearSpring {
    static constexpr bool never_stiffens = true;  ///< see `never_stiffens`

    /// Tension [N], stiffness [N/m] and energy [J].
    template <Number Scalar>
    SpringResponse<Scalar> operator()(const SpringState<Scalar>& spring) const noexcept {
        const Scalar elongation = spring.length - spring.rest_length;
        const Scalar tension = spring.stiffness * elongation;
        return {tension, spring.stiffness, tension * elongation / 2};
    }
};

/// Linear in stretch, slack if shorter than at rest, like fibres and thin tissue that wrinkles: k max(l - r, 0). A
/// membrane of such springs has no force against compression; its foundation has.
struct TensionSpring {
    /// Tension [N], stiffness [N/m] and energy [J].
    template <Number Scalar>
    SpringResponse<Scalar> operator()(const SpringState<Scalar>& spring) const noexcept {
        const auto elongation = larger<Scalar>(spring.length - spring.rest_length, Scalar(0));
        const Scalar tension = spring.stiffness * elongation;
        const auto is_slack = spring.length < spring.rest_length;
        return {tension, select(is_slack, Scalar(0), spring.stiffness), tension * elongation / 2};
    }
};

/// Soft tissue stiffens as it is stretched: the tension grows exponentially with the strain e = (l - r) / r, as
/// [Fung67] found for mesentery: k r (exp(a e) - 1) / a, of stiffness k at rest. Beyond `strain_limit` it continues
/// along its tangent, so that extreme positions do not overflow. A spring of rest length zero has no strain and stays
/// linear. Calls exp: results may differ in the last bits from one mathematics library to another.
struct ExponentialSpring {
    double stiffening = 10;     ///< a; the stiffness grows e-fold for a strain of 1/a
    double strain_limit = 0.5;  ///< from here on the stiffness is constant

    /// Tension [N], stiffness [N/m] and energy [J]. Calls exp unless the rest length is zero.
    template <Real Scalar>
    SpringResponse<Scalar> operator()(const SpringState<Scalar>& spring) const noexcept;

    /// @throws InvalidInput unless both options are finite and positive, and their product at most 50
    void validate() const;
};

template <Real Scalar>
SpringResponse<Scalar> ExponentialSpring::operator()(const SpringState<Scalar>& spring) const noexcept {
    const Scalar rest = spring.rest_length;
    if (rest == 0) return LinearSpring{}(spring);
    const auto a = static_cast<Scalar>(stiffening);
    const Scalar strain = (spring.length - rest) / rest;
    const Scalar limited = (std::min)(strain, static_cast<Scalar>(strain_limit));
    const Scalar growth = std::expm1(a * limited);
    const Scalar stiffness = spring.stiffness * (growth + 1);
    const Scalar tension = spring.stiffness * rest * growth / a;
    // growth - a e loses all digits near rest; there its series is used.
    const Scalar z = a * limited;
    const Scalar series = Scalar(1) / 2 + z * (Scalar(1) / 6 + z * (Scalar(1) / 24 + z * (Scalar(1) / 120 + z / 720)));
    const Scalar bend = std::abs(z) < Scalar(1e-2) ? z * z * series : growth - z;
    const Scalar energy = spring.stiffness * rest * rest * bend / (a * a);
    const Scalar beyond = (strain - limited) * rest;
    return {tension + stiffness * beyond, stiffness, energy + (tension + stiffness * beyond / 2) * beyond};
}

inline void ExponentialSpring::validate() const {
    constexpr std::string_view component = "ExponentialSpring";
    if (!is_finite(stiffening) || !(stiffening > 0)) {
        refuse(component, "stiffening must be finite and positive, got ", stiffening);
    }
    if (!is_finite(strain_limit) || !(strain_limit > 0)) {
        refuse(component, "strain_limit must be finite and positive, got ", strain_limit);
    }
    if (stiffening * strain_limit > 50) {
        refuse(component, "stiffening times strain_limit must be at most 50, got ", stiffening * strain_limit);
    }
}

}  // namespace membrane
