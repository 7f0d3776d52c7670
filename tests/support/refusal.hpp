// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include <membrane/core/check.hpp>

namespace test {

/// What `InvalidInput` says when `call` is refused; empty when it is not.
///
///     CHECK(test::refusal([&] { membrane::TriangleMesh mesh(x, triangles); }) == "TriangleMesh: ...");
template <class Call>
std::string refusal(Call call) {
    try {
        call();
    } catch (const membrane::InvalidInput& refused) {
        return refused.what();
    }
    return "";
}

}  // namespace test
