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

/// The extrapolation from which a step starts: a factor of the last displacements.
///
///     const double factor = predictor.extrapolation_factor(inputs);   // 1: the tools move steadily; 0: they stopped
///     for (const auto v : moved) x.col(v) += factor * last_displacements.col(v);
namespace membrane {

/// The current value of the input that drives a constraint, from a hand or a script.
template <Real Scalar>
struct InputSample {
    Vector3<Scalar> at;                                        ///< a position [m], or a force [N]
    Scalar longest = std::numeric_limits<Scalar>::infinity();  ///< largest change in a tick that is extrapolated
    bool is_force = false;                                     ///< whether `at` is a force
    Scalar rounding = 0;                                       ///< an input that changes by less is still
};

/// Empty if the constraint does not act.
template <Real Scalar>
using DrivingInput = std::optional<InputSample<Scalar>>;

/// Under a tool in steady motion a membrane repeats its last displacements. A step that starts from an extrapolation
/// corrects only the changes of the tool's velocity.
///
/// The factor is the minimum over all inputs of the new displacement projected on the last, less twice the part across
/// it, relative to the length of the last, clamped to [0, 1]; 0 if an input appears, vanishes, jumps, stops or turns by
/// more than 27 degrees. The part across is subtracted because a displacement of the tool into the surface moves the
/// membrane farther than one along it: if a tool turns from pressing to sliding, the membrane would run ahead of the
/// tool, which pushes but never pulls. If the sweeps of a step reduce an error by the factor q, 0 <= q < 1,
/// extrapolated steps reduce it by at least sqrt(q) from tick to tick, since z^2 = q ((1 + p) z - p) has no larger root
/// for 0 <= p <= 1: steps that converge without extrapolation converge with it.
template <Real Scalar, std::size_t max_inputs>
class Predictor {
  public:
    /// The factor of the last step's displacements for this step, 0 to 1. @pre finite, `max_inputs` at most
    [[nodiscard]] Scalar extrapolation_factor(std::span<const DrivingInput<Scalar>> inputs) noexcept;

    /// The factor is 0 in the next two steps.
    void reset() noexcept { inputs_ = {}; }

    /// Visits what is kept from tick to tick, see `replay/snapshot.hpp`.
    template <class Self, class Visit>
    static void visit_state(Self& self, const Visit& visit) noexcept {
        visit(self.inputs_);
    }

  private:
    struct Input {
        std::optional<Vector3<Scalar>> at, displacement;  // in the last step
    };
    [[nodiscard]] static Scalar factor_of(const Vector3<Scalar>& now, const Vector3<Scalar>& before) noexcept;

    std::array<Input, max_inputs> inputs_{};
};

template <Real Scalar, std::size_t max_inputs>
Scalar Predictor<Scalar, max_inputs>::extrapolation_factor(std::span<const DrivingInput<Scalar>> inputs) noexcept {
    Scalar factor = 1;
    bool moves = false;
    for (std::size_t i = 0; i < max_inputs; ++i) {
        const Input before = inputs_[i];
        const InputSample<Scalar>* const sample = i < inputs.size() && inputs[i] ? &*inputs[i] : nullptr;
        Input& input = inputs_[i] = {};
        if (sample != nullptr) input.at = sample->at;
        if (sample != nullptr && before.at) input.displacement = sample->at - *before.at;
        const bool appears_or_vanishes =
            (sample != nullptr) != before.at.has_value() || before.at.has_value() != before.displacement.has_value();
        const auto jumps = [&] {
            return norm(*input.displacement) > sample->longest || norm(*before.displacement) > sample->longest;
        };
        if (appears_or_vanishes || (sample != nullptr && jumps())) {
            factor = 0;
        } else if (sample != nullptr && norm(*before.displacement) > sample->rounding) {
            moves = true;
            factor = (std::min)(factor, factor_of(*input.displacement, *before.displacement));
        }
    }
    return moves ? factor : Scalar(0);
}

template <Real Scalar, std::size_t max_inputs>
Scalar Predictor<Scalar, max_inputs>::factor_of(const Vector3<Scalar>& now, const Vector3<Scalar>& before) noexcept {
    const Scalar along = dot(now, before), all = squared_norm(before);
    const Vector3<Scalar> across = now - along / all * before;
    const Scalar again = along - 2 * norm(across) * std::sqrt(all);
    if (!(again > 0)) return 0;
    return again < all ? again / all : Scalar(1);
}

}  // namespace membrane
