// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstring>
#include <type_traits>

#include <membrane/core/lanes.hpp>

/// Structs of numbers, several side by side in the lanes of one.
///
///     membrane::InLanes<membrane::VolumeSpring<double>> springs;                 // VolumeSpring<Lanes<double>>
///     membrane::set_lane(springs, 2, spring);
///     const auto second = membrane::lane_of<membrane::VolumeSpring<double>>(springs, 2);
namespace membrane {

namespace detail {

template <class T>
struct LanesOf {
    static constexpr bool exist = false;
};
template <template <class> class T, Real Scalar>
struct LanesOf<T<Scalar>> {
    using Type = T<Lanes<Scalar>>;
    using Number = Scalar;
    static constexpr std::size_t numbers = sizeof(T<Scalar>) / sizeof(Scalar);
    static constexpr bool exist = std::is_trivially_copyable_v<T<Scalar>> && std::is_trivially_copyable_v<Type> &&
                                  numbers * sizeof(Scalar) == sizeof(T<Scalar>) &&
                                  numbers * sizeof(Lanes<Scalar>) == sizeof(Type);
};

}  // namespace detail

/// A struct template of which all members are its scalars.
template <class T>
concept StructOfNumbers = detail::LanesOf<T>::exist;

/// `T<Lanes<Scalar>>` for `T<Scalar>`.
template <StructOfNumbers T>
using InLanes = typename detail::LanesOf<T>::Type;

/// Copies the numbers of `from` to one lane. @pre `lane` < the number of lanes
template <StructOfNumbers T>
void set_lane(InLanes<T>& to, std::size_t lane, const T& from) noexcept {
    using Number = typename detail::LanesOf<T>::Number;
    const auto* const read = reinterpret_cast<const std::byte*>(&from);
    auto* const write = reinterpret_cast<std::byte*>(&to) + lane * sizeof(Number);
    for (std::size_t k = 0; k < detail::LanesOf<T>::numbers; ++k) {
        std::memcpy(write + k * sizeof(Lanes<Number>), read + k * sizeof(Number), sizeof(Number));
    }
}

/// The numbers of one lane. @pre `lane` < the number of lanes
template <StructOfNumbers T>
[[nodiscard]] T lane_of(const InLanes<T>& from, std::size_t lane) noexcept {
    using Number = typename detail::LanesOf<T>::Number;
    T to;
    const auto* const read = reinterpret_cast<const std::byte*>(&from) + lane * sizeof(Number);
    auto* const write = reinterpret_cast<std::byte*>(&to);
    for (std::size_t k = 0; k < detail::LanesOf<T>::numbers; ++k) {
        std::memcpy(write + k * sizeof(Number), read + k * sizeof(Lanes<Number>), sizeof(Number));
    }
    return to;
}

}  // namespace membrane
