// SPDX-License-Identifier: MIT
#pragma once

#include <concepts>

/// Number types.
namespace membrane {

/// `float` or `double`: the type of every length, force and time of one scene.
template <class T>
concept Real = std::same_as<T, float> || std::same_as<T, double>;

/// A `Real`, or several of them in `Lanes`.
template <class N>
concept Number = Real<N> || requires {
    requires Real<typename N::Each>;
};

namespace detail {

template <class N>
struct EachOf {
    using Type = typename N::Each;
};
template <Real N>
struct EachOf<N> {
    using Type = N;
};

}  // namespace detail

/// The `Real` type of a number, or of each of its lanes.
template <Number N>
using Each = typename detail::EachOf<N>::Type;

}  // namespace membrane
