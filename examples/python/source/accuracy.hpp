// SPDX-License-Identifier: MIT
#pragma once

#include <type_traits>

#include "types.hpp"

/// Long calls.
namespace membrane_python {

/// What `call(network, foundation)` returns, with the types of both, without Python's lock. An error that a law of
/// Python raised meanwhile is raised in place of the one that follows from it. Refuses what changes from tick to tick:
/// springs that tear, springs that fail.
template <class Call>
[[nodiscard]] auto unlocked(std::string_view component, const Network& network, const Foundation& foundation,
                            Call call) {
    using Result = std::invoke_result_t<Call, const SpringsOf<AnySpring>&, const membrane::NoFoundation&>;
    const auto call_or_refuse = [&]<class Springs, class Volume>(const Springs& springs,
                                                                 const Volume& volume) -> Result {
        if constexpr (membrane::FollowsSplit<Springs>) {
            refuse(component, "the network must be a MassSpringNetwork, got one that tears");
        } else if constexpr (std::same_as<Volume, membrane::CohesiveSprings<double>>) {
            refuse(component, "the foundation must be one that does not fail, got CohesiveSprings");
        } else {
            return call(springs, volume);
        }
    };
    try {
        auto result = [&] {
            const py::gil_scoped_release unlock;
            return std::visit(call_or_refuse, network.any, foundation.any);
        }();
        network.rethrow();
        return result;
    } catch (const membrane::InvalidInput&) {
        network.rethrow();
        throw;
    }
}

}  // namespace membrane_python
