// SPDX-License-Identifier: MIT
#pragma once

#include "types.hpp"

/// Long calls.
namespace membrane_python {

/// What `call(network, foundation)` returns, with the types of both, without Python's lock. An error that a law of
/// Python raised meanwhile is raised in place of the one that follows from it.
template <class Call>
[[nodiscard]] auto unlocked(const Network& network, const Foundation& foundation, Call call) {
    try {
        auto result = [&] {
            const py::gil_scoped_release unlock;
            return std::visit(call, network.any, foundation.any);
        }();
        network.rethrow();
        return result;
    } catch (const membrane::InvalidInput&) {
        network.rethrow();
        throw;
    }
}

}  // namespace membrane_python
