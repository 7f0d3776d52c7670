// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include <membrane/core/instruction_set.hpp>
#include <membrane/core/types.hpp>

/// A pack of numbers in SIMD registers, with the same operation on each.
///
///     const membrane::Lanes<float> length = sqrt(x * x + y * y);
///     const auto part = x / select(length > 0, length, membrane::Lanes<float>(1));      // each lane by itself
///     membrane::InLanes<membrane::VolumeSpring<double>> springs;                        // VolumeSpring<Lanes<double>>
///     membrane::set_lane(springs, 2, spring);
namespace membrane {

inline namespace MEMBRANE_INSTRUCTION_SET {

/// 8 floats or 4 doubles, on every processor. Each lane gives the same bits as scalar arithmetic.
template <Real Scalar>
class Lanes {
    // Operations are written out for the first and the last register, without a loop, which is slow without
    // optimisation. Where one register holds all lanes, it is both, and the compiler computes it once.
    using Registers = Register<Scalar>;
    static constexpr std::size_t width = Registers::size;

  public:
    using Each = Scalar;                                       ///< type of one lane
    static constexpr std::size_t count = 32 / sizeof(Scalar);  ///< number of lanes

    /// One register; `parts` of them hold all lanes, one or two.
    using Part = typename Registers::Type;
    static constexpr std::size_t parts = count / width;  ///< number of registers

    Lanes() = default;  ///< Not initialised.

    /// The same number in each lane.
    MEMBRANE_INLINE Lanes(Scalar all) noexcept {  // NOLINT(google-explicit-constructor): one number for all lanes
        const Part part = Registers::all(all);
        parts_[0] = part;
        parts_[last] = part;
    }

    /// `count` numbers, one after the other.
    [[nodiscard]] MEMBRANE_INLINE static Lanes load(const Scalar* from) noexcept {
        Lanes lanes;
        std::memcpy(lanes.parts_, from, sizeof lanes.parts_);
        return lanes;
    }

    /// `at(i)` in lane i.
    template <class At>
    [[nodiscard]] static Lanes of(const At& at) noexcept {
        const auto number = [&](std::size_t i) MEMBRANE_INLINE_LAMBDA { return detail::for_lane<Scalar>(at(i)); };
        Lanes lanes;
        for (std::size_t i = 0; i < parts; ++i) {
            const std::size_t k = i * width;
            if constexpr (width == 2) lanes.parts_[i] = Part{number(k), number(k + 1)};
            if constexpr (width == 4) lanes.parts_[i] = Part{number(k), number(k + 1), number(k + 2), number(k + 3)};
            if constexpr (width == 8) {
                lanes.parts_[i] = Part{number(k),     number(k + 1), number(k + 2), number(k + 3),
                                       number(k + 4), number(k + 5), number(k + 6), number(k + 7)};
            }
        }
        return lanes;
    }

    /// Writes `count` numbers, one after the other.
    MEMBRANE_INLINE void store(Scalar* to) const noexcept { std::memcpy(to, parts_, sizeof parts_); }

    /// The number in lane i, by value.
    [[nodiscard]] MEMBRANE_INLINE Scalar operator[](std::size_t i) const noexcept {
        return parts_[i / width][i % width];
    }

    /// Sets the number in lane i.
    MEMBRANE_INLINE void set(std::size_t i, Scalar value) noexcept { parts_[i / width][i % width] = value; }

    ///@{
    /// Register i, the lanes from i times `count` / `parts` on.
    [[nodiscard]] MEMBRANE_INLINE Part& part(std::size_t i) noexcept { return parts_[i]; }
    [[nodiscard]] MEMBRANE_INLINE const Part& part(std::size_t i) const noexcept { return parts_[i]; }
    ///@}

    ///@{
    /// Lane by lane.
    [[nodiscard]] MEMBRANE_INLINE friend Lanes operator+(const Lanes& a, const Lanes& b) noexcept {
        return {a.parts_[0] + b.parts_[0], a.parts_[last] + b.parts_[last]};
    }
    [[nodiscard]] MEMBRANE_INLINE friend Lanes operator-(const Lanes& a, const Lanes& b) noexcept {
        return {a.parts_[0] - b.parts_[0], a.parts_[last] - b.parts_[last]};
    }
    [[nodiscard]] MEMBRANE_INLINE friend Lanes operator*(const Lanes& a, const Lanes& b) noexcept {
        return {a.parts_[0] * b.parts_[0], a.parts_[last] * b.parts_[last]};
    }
    [[nodiscard]] MEMBRANE_INLINE friend Lanes operator/(const Lanes& a, const Lanes& b) noexcept {
        return {a.parts_[0] / b.parts_[0], a.parts_[last] / b.parts_[last]};
    }
    [[nodiscard]] MEMBRANE_INLINE Lanes operator-() const noexcept { return {-parts_[0], -parts_[last]}; }
    MEMBRANE_INLINE Lanes& operator+=(const Lanes& b) noexcept { return *this = *this + b; }
    MEMBRANE_INLINE Lanes& operator-=(const Lanes& b) noexcept { return *this = *this - b; }
    MEMBRANE_INLINE Lanes& operator*=(const Lanes& b) noexcept { return *this = *this * b; }
    MEMBRANE_INLINE Lanes& operator/=(const Lanes& b) noexcept { return *this = *this / b; }
    ///@}

    /// A boolean for each lane.
    class Mask {
      public:
        using PartMask = typename Registers::Mask;  ///< booleans of one register

        Mask() = default;  ///< Not initialised.

        /// From the masks of the first and the last register, the same mask twice if there is one register.
        MEMBRANE_INLINE Mask(const PartMask& first_part, const PartMask& last_part) noexcept {
            parts_[0] = first_part;
            parts_[last] = last_part;
        }

        ///@{
        /// Lane by lane.
        [[nodiscard]] MEMBRANE_INLINE friend Mask operator&(const Mask& a, const Mask& b) noexcept {
            return {a.parts_[0] & b.parts_[0], a.parts_[last] & b.parts_[last]};
        }
        [[nodiscard]] MEMBRANE_INLINE friend Mask operator|(const Mask& a, const Mask& b) noexcept {
            return {a.parts_[0] | b.parts_[0], a.parts_[last] | b.parts_[last]};
        }
        [[nodiscard]] MEMBRANE_INLINE Mask operator!() const noexcept { return {~parts_[0], ~parts_[last]}; }
        ///@}

        /// Whether the mask is set in every lane.
        [[nodiscard]] MEMBRANE_INLINE friend bool all(const Mask& mask) noexcept {
            return Registers::bits(mask.parts_[0] & mask.parts_[last]) == (1U << width) - 1;
        }

        /// Whether the mask is set in at least one lane.
        [[nodiscard]] MEMBRANE_INLINE friend bool any(const Mask& mask) noexcept {
            return Registers::bits(mask.parts_[0] | mask.parts_[last]) != 0;
        }

        /// Lane i in bit i.
        [[nodiscard]] MEMBRANE_INLINE friend std::uint32_t bits(const Mask& mask) noexcept {
            return Registers::bits(mask.parts_[0]) | Registers::bits(mask.parts_[last]) << last * width;
        }

      private:
        friend Lanes;
        PartMask parts_[parts];
    };

    ///@{
    /// Lane by lane.
    [[nodiscard]] MEMBRANE_INLINE friend Mask operator<(const Lanes& a, const Lanes& b) noexcept {
        return {a.parts_[0] < b.parts_[0], a.parts_[last] < b.parts_[last]};
    }
    [[nodiscard]] MEMBRANE_INLINE friend Mask operator<=(const Lanes& a, const Lanes& b) noexcept {
        return {a.parts_[0] <= b.parts_[0], a.parts_[last] <= b.parts_[last]};
    }
    [[nodiscard]] MEMBRANE_INLINE friend Mask operator>(const Lanes& a, const Lanes& b) noexcept { return b < a; }
    [[nodiscard]] MEMBRANE_INLINE friend Mask operator>=(const Lanes& a, const Lanes& b) noexcept { return b <= a; }
    [[nodiscard]] MEMBRANE_INLINE friend Mask operator!=(const Lanes& a, const Lanes& b) noexcept {
        return {a.parts_[0] != b.parts_[0], a.parts_[last] != b.parts_[last]};
    }
    ///@}

    /// The magnitude of each lane.
    [[nodiscard]] MEMBRANE_INLINE friend Lanes abs(const Lanes& a) noexcept {
        return {Registers::absolute(a.parts_[0]), Registers::absolute(a.parts_[last])};
    }

    /// `yes` in the lanes of `mask`, `no` in the others.
    [[nodiscard]] MEMBRANE_INLINE static Lanes choose(const Mask& mask, const Lanes& yes, const Lanes& no) noexcept {
        return {Registers::choose(mask.parts_[0], yes.parts_[0], no.parts_[0]),
                Registers::choose(mask.parts_[last], yes.parts_[last], no.parts_[last])};
    }

    /// Correctly rounded.
    [[nodiscard]] MEMBRANE_INLINE friend Lanes sqrt(const Lanes& a) noexcept {
        return {Registers::root(a.parts_[0]), Registers::root(a.parts_[last])};
    }

  private:
    static constexpr std::size_t last = parts - 1;

    MEMBRANE_INLINE Lanes(const Part& first_part, const Part& last_part) noexcept {
        parts_[0] = first_part;
        parts_[last] = last_part;
    }

    Part parts_[parts];
};

}  // namespace MEMBRANE_INSTRUCTION_SET

/// choice ? yes : no, in every lane.
template <Number N, class Choice>
[[nodiscard]] MEMBRANE_INLINE N select(const Choice& choice, const N& yes, const N& no) noexcept {
    if constexpr (Real<N>)
        return choice ? yes : no;
    else
        return N::choose(choice, yes, no);
}

///@{
/// `any` and `all` of a mask, for one lane.
[[nodiscard]] MEMBRANE_INLINE constexpr bool any(bool choice) noexcept { return choice; }
[[nodiscard]] MEMBRANE_INLINE constexpr bool all(bool choice) noexcept { return choice; }
///@}

/// The square root of a number, or of every lane.
template <Number N>
[[nodiscard]] MEMBRANE_INLINE N root_of(const N& a) noexcept {
    using std::sqrt;
    return sqrt(a);
}

/// `f` of the numbers, or of those in each lane.
template <Number N, class F, class... Rest>
[[nodiscard]] MEMBRANE_INLINE N lane_by_lane(const F& f, const N& a, const Rest&... rest) noexcept {
    if constexpr (Real<N>)
        return f(a, rest...);
    else
        return N::of([&](std::size_t i) { return f(a[i], rest[i]...); });
}

///@{
/// `std::max` and `std::min` of every lane.
template <Number N>
[[nodiscard]] MEMBRANE_INLINE N larger(const N& a, const N& b) noexcept {
    return select(a < b, b, a);
}
template <Number N>
[[nodiscard]] MEMBRANE_INLINE N smaller(const N& a, const N& b) noexcept {
    return select(b < a, b, a);
}
///@}

/// The unit vector along `a`; zero if `a` is zero.
template <Number N>
[[nodiscard]] MEMBRANE_INLINE Vector3<N> direction_or_zero(const Vector3<N>& a) noexcept {
    const N size = norm(a);
    return (1 / select<N>(size > 0, size, 1)) * a;
}

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
