// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <vector>

#include <membrane/replay/snapshot.hpp>

namespace membrane {

/// The state of components before a loop, to which it is reset: a membrane that has torn is whole again.
///
///     const membrane::InitialState whole(tear, tissue, foundation, solver, tree, tracker, x);  // before the loop
///     ...
///     if (whole.reset(tear, tissue, foundation, solver, tree, tracker, x)) tree.refit(x);      // between two ticks
///
/// A snapshot in memory of its own, with the conditions and costs of `save_snapshot`.
class InitialState {
  public:
    /// Saves the state of the components. Allocates.
    template <class... Components>
    explicit InitialState(const Components&... components) : snapshot_(snapshot_capacity(components...)) {
        snapshot_.resize(save_snapshot(snapshot_, components...));
    }

    /// Brings these components, or others of the same kinds, in the same order, back to that state, to the bit. Returns
    /// false and changes nothing if they are of other types, numbers of vertices or capacities. Online.
    template <class... Components>
    [[nodiscard]] bool reset(Components&... components) const noexcept {
        return restore_snapshot(snapshot_, components...);
    }

  private:
    std::vector<std::byte> snapshot_;
};

}  // namespace membrane
