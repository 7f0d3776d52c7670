// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include <emscripten/bind.h>

/// Numbers for JavaScript, without a copy: until the memory grows.
namespace web {

template <class Number>
[[nodiscard]] emscripten::val view(const std::vector<Number>& numbers) {
    return emscripten::val(emscripten::typed_memory_view(numbers.size(), numbers.data()));
}

template <class Matrix>
[[nodiscard]] emscripten::val view(const Matrix& numbers) {
    return emscripten::val(emscripten::typed_memory_view(static_cast<std::size_t>(numbers.size()), numbers.data()));
}

}  // namespace web
