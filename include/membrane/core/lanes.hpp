// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>

#include <membrane/core/instruction_set.hpp>
#include <membrane/core/types.hpp>

#if defined(__AVX__)
#include <immintrin.h>
#elif defined(__SSE2__)
#include <emmintrin.h>
#endif

/// A pack of numbers in SIMD registers, with the same operation on each.
///
///     const membrane::Lanes<float> length = sqrt(x * x + y * y);
///     const auto part = x / select(length > 0, length, membrane::Lanes<float>(1));      // each lane by itself
namespace membrane {

inline namespace MEMBRANE_INSTRUCTION_SET {

#if defined(__AVX__)
inline constexpr std::size_t register_bytes = 32;
#else
inline constexpr std::size_t register_bytes = 16;
#endif

template <class Scalar, std::size_t bytes = register_bytes>
struct Register {
    using Type __attribute__((vector_size(bytes))) = Scalar;
};

/// 8 floats or 4 doubles, on every processor. Each lane gives the same bits as scalar arithmetic.
template <Real Scalar>
class Lanes {
  public:
    using Each = Scalar;
    static constexpr std::size_t count = 32 / sizeof(Scalar);

    /// One register; `parts` of them hold all lanes.
    using Part = typename Register<Scalar>::Type;
    static constexpr std::size_t parts = 32 / register_bytes;

    Lanes() = default;
    Lanes(Scalar all) noexcept {  // NOLINT(google-explicit-constructor): one number stands for all lanes
        for (auto& part : parts_) part = all - Part{};  // keeps the sign of a zero
    }

    /// `count` numbers, one after the other.
    [[nodiscard]] static Lanes load(const Scalar* from) noexcept {
        Lanes lanes;
        std::memcpy(lanes.parts_.data(), from, sizeof lanes.parts_);
        return lanes;
    }

    /// `at(i)` in lane i.
    template <class At>
    [[nodiscard]] static Lanes of(const At& at) noexcept {
        Lanes lanes;
        for (std::size_t i = 0; i < parts; ++i) {
            const std::size_t k = i * width;
            if constexpr (width == 2) lanes.parts_[i] = Part{at(k), at(k + 1)};
            if constexpr (width == 4) lanes.parts_[i] = Part{at(k), at(k + 1), at(k + 2), at(k + 3)};
            if constexpr (width == 8) {
                lanes.parts_[i] =
                    Part{at(k), at(k + 1), at(k + 2), at(k + 3), at(k + 4), at(k + 5), at(k + 6), at(k + 7)};
            }
        }
        return lanes;
    }
    void store(Scalar* to) const noexcept { std::memcpy(to, parts_.data(), sizeof parts_); }
    [[nodiscard]] Scalar operator[](std::size_t i) const noexcept { return parts_[i / width][i % width]; }
    void set(std::size_t i, Scalar value) noexcept { parts_[i / width][i % width] = value; }
    [[nodiscard]] Part& part(std::size_t i) noexcept { return parts_[i]; }
    [[nodiscard]] const Part& part(std::size_t i) const noexcept { return parts_[i]; }

    [[nodiscard]] friend Lanes operator+(const Lanes& a, const Lanes& b) noexcept {
        return each([](auto x, auto y) { return x + y; }, a, b);
    }
    [[nodiscard]] friend Lanes operator-(const Lanes& a, const Lanes& b) noexcept {
        return each([](auto x, auto y) { return x - y; }, a, b);
    }
    [[nodiscard]] friend Lanes operator*(const Lanes& a, const Lanes& b) noexcept {
        return each([](auto x, auto y) { return x * y; }, a, b);
    }
    [[nodiscard]] friend Lanes operator/(const Lanes& a, const Lanes& b) noexcept {
        return each([](auto x, auto y) { return x / y; }, a, b);
    }
    [[nodiscard]] Lanes operator-() const noexcept {
        return each([](auto x, auto) { return -x; }, *this, *this);
    }
    Lanes& operator+=(const Lanes& b) noexcept { return *this = *this + b; }
    Lanes& operator-=(const Lanes& b) noexcept { return *this = *this - b; }
    Lanes& operator*=(const Lanes& b) noexcept { return *this = *this * b; }
    Lanes& operator/=(const Lanes& b) noexcept { return *this = *this / b; }

    /// A boolean for each lane.
    class Mask {
      public:
        using PartMask = decltype(Part{} < Part{});

        [[nodiscard]] friend Mask operator&(const Mask& a, const Mask& b) noexcept {
            Mask both;
            for (std::size_t i = 0; i < parts; ++i) both.parts_[i] = a.parts_[i] & b.parts_[i];
            return both;
        }
        [[nodiscard]] friend Mask operator|(const Mask& a, const Mask& b) noexcept {
            Mask either;
            for (std::size_t i = 0; i < parts; ++i) either.parts_[i] = a.parts_[i] | b.parts_[i];
            return either;
        }
        [[nodiscard]] Mask operator!() const noexcept {
            Mask none;
            for (std::size_t i = 0; i < parts; ++i) none.parts_[i] = ~parts_[i];
            return none;
        }
        [[nodiscard]] friend bool all(const Mask& mask) noexcept { return !any(!mask); }
        [[nodiscard]] friend bool any(const Mask& mask) noexcept { return bits(mask) != 0; }

        /// Lane i in bit i.
        [[nodiscard]] friend std::uint32_t bits(const Mask& mask) noexcept {
            std::uint32_t all = 0;
            for (std::size_t i = 0; i < parts; ++i) all |= bits_of(mask.parts_[i]) << (i * count / parts);
            return all;
        }

      private:
        friend Lanes;
        static std::uint32_t bits_of(const PartMask& mask) noexcept {
#if defined(__AVX__)
            if constexpr (sizeof(Scalar) == 4)
                return static_cast<std::uint32_t>(_mm256_movemask_ps(reinterpret_cast<Part>(mask)));
            else
                return static_cast<std::uint32_t>(_mm256_movemask_pd(reinterpret_cast<Part>(mask)));
#elif defined(__SSE2__)
            if constexpr (sizeof(Scalar) == 4)
                return static_cast<std::uint32_t>(_mm_movemask_ps(reinterpret_cast<Part>(mask)));
            else
                return static_cast<std::uint32_t>(_mm_movemask_pd(reinterpret_cast<Part>(mask)));
#else
            std::uint32_t all = 0;
            for (std::size_t i = 0; i < count / parts; ++i) all |= static_cast<std::uint32_t>(mask[i] != 0) << i;
            return all;
#endif
        }

        std::array<PartMask, parts> parts_;
    };

    [[nodiscard]] friend Mask operator<(const Lanes& a, const Lanes& b) noexcept {
        return compare([](auto x, auto y) { return x < y; }, a, b);
    }
    [[nodiscard]] friend Mask operator<=(const Lanes& a, const Lanes& b) noexcept {
        return compare([](auto x, auto y) { return x <= y; }, a, b);
    }
    [[nodiscard]] friend Mask operator>(const Lanes& a, const Lanes& b) noexcept { return b < a; }
    [[nodiscard]] friend Mask operator>=(const Lanes& a, const Lanes& b) noexcept {
        return compare([](auto x, auto y) { return x >= y; }, a, b);
    }
    [[nodiscard]] friend Mask operator!=(const Lanes& a, const Lanes& b) noexcept {
        return compare([](auto x, auto y) { return x != y; }, a, b);
    }

    [[nodiscard]] friend Lanes abs(const Lanes& a) noexcept {
        using Bits = typename Mask::PartMask;
        using One = std::remove_cvref_t<decltype(Bits{}[0])>;
        const Bits all_but_sign = (std::numeric_limits<One>::max)() - Bits{};
        return each([&](auto x, auto) { return reinterpret_cast<Part>(reinterpret_cast<Bits>(x) & all_but_sign); }, a,
                    a);
    }

    /// `yes` in the lanes of `mask`, `no` in the others.
    [[nodiscard]] static Lanes choose(const Mask& mask, const Lanes& yes, const Lanes& no) noexcept {
        Lanes chosen;
        for (std::size_t i = 0; i < parts; ++i) chosen.parts_[i] = mask.parts_[i] ? yes.parts_[i] : no.parts_[i];
        return chosen;
    }

    /// Correctly rounded.
    [[nodiscard]] friend Lanes sqrt(const Lanes& a) noexcept {
        return each([](auto x, auto) { return root(x); }, a, a);
    }

  private:
    template <class Operation>
    static Lanes each(Operation operation, const Lanes& a, const Lanes& b) noexcept {
        Lanes result;
        for (std::size_t i = 0; i < parts; ++i) result.parts_[i] = operation(a.parts_[i], b.parts_[i]);
        return result;
    }
    template <class Relation>
    static Mask compare(Relation relation, const Lanes& a, const Lanes& b) noexcept {
        Mask mask;
        for (std::size_t i = 0; i < parts; ++i) mask.parts_[i] = relation(a.parts_[i], b.parts_[i]);
        return mask;
    }
    // Compilers vectorise a square root only under `-fno-math-errno`.
    static Part root(const Part& a) noexcept {
#if defined(__AVX__)
        if constexpr (sizeof(Scalar) == 4)
            return _mm256_sqrt_ps(a);
        else
            return _mm256_sqrt_pd(a);
#elif defined(__SSE2__)
        if constexpr (sizeof(Scalar) == 4)
            return _mm_sqrt_ps(a);
        else
            return _mm_sqrt_pd(a);
#else
        Part roots;
        for (std::size_t i = 0; i < sizeof(Part) / sizeof(Scalar); ++i) roots[i] = std::sqrt(a[i]);
        return roots;
#endif
    }

    static constexpr std::size_t width = count / parts;
    std::array<Part, parts> parts_;
};

}  // namespace MEMBRANE_INSTRUCTION_SET

/// choice ? yes : no, in every lane.
template <Number N, class Choice>
[[nodiscard]] N select(const Choice& choice, const N& yes, const N& no) noexcept {
    if constexpr (Real<N>)
        return choice ? yes : no;
    else
        return N::choose(choice, yes, no);
}
[[nodiscard]] constexpr bool any(bool choice) noexcept { return choice; }
[[nodiscard]] constexpr bool all(bool choice) noexcept { return choice; }

/// The square root of a number, or of every lane.
template <Number N>
[[nodiscard]] N root_of(const N& a) noexcept {
    using std::sqrt;
    return sqrt(a);
}

/// `f` of the numbers, or of those in each lane.
template <Number N, class F, class... Rest>
[[nodiscard]] N lane_by_lane(const F& f, const N& a, const Rest&... rest) noexcept {
    if constexpr (Real<N>)
        return f(a, rest...);
    else
        return N::of([&](std::size_t i) { return f(a[i], rest[i]...); });
}

/// `std::max` and `std::min` of every lane.
template <Number N>
[[nodiscard]] N larger(const N& a, const N& b) noexcept {
    return select(a < b, b, a);
}
template <Number N>
[[nodiscard]] N smaller(const N& a, const N& b) noexcept {
    return select(b < a, b, a);
}

/// The unit vector along `a`; zero if `a` is zero.
template <Number N>
[[gnu::always_inline, nodiscard]] inline Vector3<N> direction_or_zero(const Vector3<N>& a) noexcept {
    const N size = norm(a);
    return (1 / select<N>(size > 0, size, 1)) * a;
}

}  // namespace membrane
