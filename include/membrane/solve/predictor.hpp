// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>

#include <membrane/core/types.hpp>

/// How much of the last step's displacements a step starts with.
///
///     const double factor = predictor.extrapolation_factor(inputs);   // 1: the tools move on as they did; 0: they have stopped
///     for (v : moved) x.col(v) += factor * last_displacements.col(v);
namespace membrane {

/// What drives a constraint, a hand or a script: where that is now.
template <Real Scalar>
struct InputSample {
    Vector3<Scalar> at;                                        ///< a position [m], or a force [N]
    Scalar longest = std::numeric_limits<Scalar>::infinity();  ///< displacement in a tick that is extrapolated
    bool is_force = false;
};

/// Nothing where the constraint does not act.
template <Real Scalar>
using DrivingInput = std::optional<InputSample<Scalar>>;

/// Under a tool that slides on, a membrane moves as it did in the tick before, but for how the tool speeds up or turns. A
/// step that starts from an extrapolation has no more than that to correct.
///
/// The factor is the minimum over all inputs of the new displacement projected on the last, less twice the part across it,
/// relative to the length of the last, clamped to [0, 1]; 0 if an input appears, vanishes, jumps, stops or turns by more
/// than 27 degrees. Less, since a displacement into the surface moves the membrane farther than one along it: if a tool turns
/// from pressing to sliding, the membrane would run ahead of the tool, which pushes but never pulls. Sweeps that leave
/// the part q of an error, 0 <= q < 1, then leave sqrt(q) of it at most from tick to tick, since z^2 = q ((1 + p) z - p)
/// has no larger root for 0 <= p <= 1: what converges without extrapolation converges with it.
template <Real Scalar, std::size_t max_leads>
class Predictor {
  public:
    /// The part of the last step's displacements to start this step with, 0 to 1. @pre finite, `max_leads` at most
    [[nodiscard]] Scalar extrapolation_factor(std::span<const DrivingInput<Scalar>> inputs) noexcept;

    /// Extrapolates nothing in the next two steps.
    void forget() noexcept { inputs_ = {}; }

  private:
    struct Input {
        std::optional<Vector3<Scalar>> at, displacement;  // in the last step
    };
    [[nodiscard]] static Scalar factor_of(const Vector3<Scalar>& now, const Vector3<Scalar>& before) noexcept;

    std::array<Input, max_leads> inputs_{};
};

template <Real Scalar, std::size_t max_leads>
Scalar Predictor<Scalar, max_leads>::extrapolation_factor(std::span<const DrivingInput<Scalar>> inputs) noexcept {
    Scalar factor = 1;
    bool moves = false;
    for (std::size_t i = 0; i < max_leads; ++i) {
        const Input before = inputs_[i];
        const InputSample<Scalar>* const lead = i < inputs.size() && inputs[i] ? &*inputs[i] : nullptr;
        Input& input = inputs_[i] = {};
        if (lead != nullptr) input.at = lead->at;
        if (lead != nullptr && before.at) input.displacement = lead->at - *before.at;
        const bool appears_or_vanishes =
            (lead != nullptr) != before.at.has_value() || before.at.has_value() != before.displacement.has_value();
        const auto jumps = [&] {
            return norm(*input.displacement) > lead->longest || norm(*before.displacement) > lead->longest;
        };
        if (appears_or_vanishes || (lead != nullptr && jumps())) {
            factor = 0;
        } else if (lead != nullptr && squared_norm(*before.displacement) > 0) {
            moves = true;
            factor = (std::min)(factor, factor_of(*input.displacement, *before.displacement));
        }
    }
    return moves ? factor : Scalar(0);
}

template <Real Scalar, std::size_t max_leads>
Scalar Predictor<Scalar, max_leads>::factor_of(const Vector3<Scalar>& now, const Vector3<Scalar>& before) noexcept {
    const Scalar along = dot(now, before), all = squared_norm(before);
    const Vector3<Scalar> across = now - along / all * before;
    const Scalar again = along - 2 * norm(across) * std::sqrt(all);
    if (!(again > 0)) return 0;
    return again < all ? again / all : Scalar(1);
}

}  // namespace membrane
