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

/// How much of the last step is to be expected again.
///
///     const double part = predictor.expect(leads);        // 1: what leads goes on as it did; 0: it has stopped
///     for (v : moved) x.col(v) += part * last_way(v);
namespace membrane {

/// What a constraint is led by, a hand or a script: where that is on its way.
template <Real Scalar>
struct LeadPoint {
    Vector3<Scalar> at;                                        ///< a position [m], or a force [N]
    Scalar longest = std::numeric_limits<Scalar>::infinity();  ///< of the ways in a tick that let one expect the next
    bool is_force = false;
};

/// Nothing where the constraint does not act.
template <Real Scalar>
using Lead = std::optional<LeadPoint<Scalar>>;

/// Under a tool that slides on, a membrane goes on as it did in the tick before, but for how the tool speeds up or turns: a
/// step that begins there has no more than that to mend.
///
/// The part that is expected again is the least, over all that leads, of the new way along the last one, less twice the
/// way across it, at most all of it; nothing where something comes, goes, jumps, stops or turns by more than 27 degrees.
/// Less, since a way into the surface moves the membrane farther than one along it: where a tool turns from pressing to
/// sliding, the membrane would run ahead of the tool, which pushes back what is behind but pulls nothing. Sweeps that leave
/// the part q of an error, 0 <= q < 1, then leave sqrt(q) of it at most from tick to tick, since z^2 = q ((1 + p) z - p)
/// has no larger root for 0 <= p <= 1: what converges without a prediction converges with it.
template <Real Scalar, std::size_t most_leads>
class Predictor {
  public:
    /// The part of the last step's ways to begin this one with, 0 to 1. @pre finite, `most_leads` at most
    [[nodiscard]] Scalar expect(std::span<const Lead<Scalar>> leads) noexcept;

    /// Expects nothing in the next two steps.
    void forget() noexcept { paths_ = {}; }

  private:
    struct Path {
        std::optional<Vector3<Scalar>> at, way;  // in the last step
    };
    [[nodiscard]] static Scalar part_of(const Vector3<Scalar>& now, const Vector3<Scalar>& before) noexcept;

    std::array<Path, most_leads> paths_{};
};

template <Real Scalar, std::size_t most_leads>
Scalar Predictor<Scalar, most_leads>::expect(std::span<const Lead<Scalar>> leads) noexcept {
    Scalar part = 1;
    bool led = false;
    for (std::size_t i = 0; i < most_leads; ++i) {
        const Path before = paths_[i];
        const LeadPoint<Scalar>* const lead = i < leads.size() && leads[i] ? &*leads[i] : nullptr;
        Path& path = paths_[i] = {};
        if (lead != nullptr) path.at = lead->at;
        if (lead != nullptr && before.at) path.way = lead->at - *before.at;
        const bool comes_or_goes =
            (lead != nullptr) != before.at.has_value() || before.at.has_value() != before.way.has_value();
        const auto jumps = [&] { return norm(*path.way) > lead->longest || norm(*before.way) > lead->longest; };
        if (comes_or_goes || (lead != nullptr && jumps())) {
            part = 0;
        } else if (lead != nullptr && squared_norm(*before.way) > 0) {
            led = true;
            part = (std::min)(part, part_of(*path.way, *before.way));
        }
    }
    return led ? part : Scalar(0);
}

template <Real Scalar, std::size_t most_leads>
Scalar Predictor<Scalar, most_leads>::part_of(const Vector3<Scalar>& now, const Vector3<Scalar>& before) noexcept {
    const Scalar along = dot(now, before), all = squared_norm(before);
    const Vector3<Scalar> across = now - along / all * before;
    const Scalar again = along - 2 * norm(across) * std::sqrt(all);
    if (!(again > 0)) return 0;
    return again < all ? again / all : Scalar(1);
}

}  // namespace membrane
