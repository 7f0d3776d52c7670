// SPDX-License-Identifier: MIT
#pragma once

#include <concepts>

/// What lengths, forces and times are made of.
namespace membrane {

/// `float` or `double`: the type of every length, force and time of one scene.
template <class T>
concept Real = std::same_as<T, float> || std::same_as<T, double>;

/// A `Real`, or several of them side by side: `Lanes`.
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

/// The `Real` that a number is made of.
template <Number N>
using Each = typename detail::EachOf<N>::Type;

}  // namespace membrane
