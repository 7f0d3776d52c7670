// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

#include <membrane/core/number.hpp>

/// The instruction set that a translation unit is compiled for, and all that is not ISO C++.
///
/// One program may contain units compiled for different sets, as SSE2 and AVX2. Types packed in registers (solver,
/// tree, lanes) are in an inline namespace named after the set, `membrane::avx2::QuasiStaticSolver`. Each unit uses its
/// own types; passing one to a unit compiled for another set does not link. All other types (mesh, network, positions,
/// tool, contact, report) are the same for all sets and may be passed between units.
///
/// `MEMBRANE_PORTABLE_LANES`, set for compilers other than g++ and clang, replaces registers by arrays: ISO C++ alone,
/// slower, the same bits.
#if !defined(__GNUC__) && !defined(__clang__) && !defined(MEMBRANE_PORTABLE_LANES)
#define MEMBRANE_PORTABLE_LANES
#endif

#if defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__
#error "membrane: add -fno-finite-math-only after -ffast-math or -Ofast: no check for NaN and infinity works without it"
#endif

/// Name of the instruction set, and of the inline namespace of the types packed in its registers.
#if defined(MEMBRANE_PORTABLE_LANES)
#define MEMBRANE_INSTRUCTION_SET portable
#elif defined(__AVX512F__)
#define MEMBRANE_INSTRUCTION_SET avx512
#elif defined(__AVX2__)
#define MEMBRANE_INSTRUCTION_SET avx2
#elif defined(__AVX__)
#define MEMBRANE_INSTRUCTION_SET avx
#elif defined(__SSE2__)
#define MEMBRANE_INSTRUCTION_SET sse2
#else
#define MEMBRANE_INSTRUCTION_SET generic
#endif

#if !defined(MEMBRANE_PORTABLE_LANES) && defined(__AVX__)
#include <immintrin.h>
#elif !defined(MEMBRANE_PORTABLE_LANES) && defined(__SSE2__)
#include <emmintrin.h>
#endif

///@{
/// Attributes of g++ and clang; empty, or `inline`, for other compilers. Small functions of the innermost loops are
/// inlined even without optimisation, where a call costs more than they do.
#if defined(__GNUC__) || defined(__clang__)
#define MEMBRANE_INLINE __attribute__((always_inline)) inline
#define MEMBRANE_INLINE_LAMBDA __attribute__((always_inline))
#define MEMBRANE_NOINLINE __attribute__((noinline))
#define MEMBRANE_FLATTEN __attribute__((flatten))
#define MEMBRANE_ABI_TAG __attribute__((abi_tag))
#else
#define MEMBRANE_INLINE inline
#define MEMBRANE_INLINE_LAMBDA
#define MEMBRANE_NOINLINE
#define MEMBRANE_FLATTEN
#define MEMBRANE_ABI_TAG
#endif
///@}

namespace membrane {

// With the tag, the name is also in the symbol of a function that only returns a type of the namespace.
inline namespace MEMBRANE_INSTRUCTION_SET MEMBRANE_ABI_TAG {}

namespace detail {

/// `number`, before it is put into a lane. For WebAssembly, clang before 16 reads a number from memory into all lanes
/// by one instruction, and moves this behind stores and calls that change the number there. After an `asm` the number
/// is in a register.
template <Real Scalar>
[[nodiscard]] MEMBRANE_INLINE Scalar for_lane(Scalar number) noexcept {
#if defined(__wasm_simd128__) && defined(__clang__) && __clang_major__ < 16
    if (!__builtin_constant_p(number)) asm("" : "+r"(number));
#endif
    return number;
}

// An object of such a type may also come from another unit as a member of a type that names no instruction set. So a
// unit that constructs it defines a symbol, and a unit that uses it refers to that symbol. If only units for other sets
// construct it, the symbol is undefined. If units for each set construct it, a mix is not detected, but harmless: the
// memory layout is the same for all sets.
#if defined(__ELF__) && (defined(__GNUC__) || defined(__clang__))
template <class Part>
struct MadeHere {
    friend void made_for_this_instruction_set(const Part*) noexcept __attribute__((used, visibility("default"))) {}
};

template <class Part>
void define_made() noexcept {
    static_cast<void>(sizeof(MadeHere<Part>));
    void made_for_this_instruction_set(const Part*) noexcept;
    made_for_this_instruction_set(nullptr);
}

template <class Part>
void require_made() noexcept {
    void made_for_this_instruction_set(const Part*) noexcept;
    made_for_this_instruction_set(nullptr);
}
#else
template <class Part>
void define_made() noexcept {}
template <class Part>
void require_made() noexcept {}
#endif

}  // namespace detail

inline namespace MEMBRANE_INSTRUCTION_SET {

#if !defined(MEMBRANE_PORTABLE_LANES)

/// Size of a `Register`.
#if defined(__AVX__)
inline constexpr std::size_t register_bytes = 32;
#else
inline constexpr std::size_t register_bytes = 16;
#endif

/// A SIMD register of numbers, with the compiler's operators.
template <Real Scalar, std::size_t bytes = register_bytes>
struct Register {
    static constexpr std::size_t size = bytes / sizeof(Scalar);  ///< numbers in a register
    /// The register.
    using Type __attribute__((vector_size(bytes))) = Scalar;
    using Mask = decltype(Type{} < Type{});  ///< all bits of a number, or none

    /// The same number `size` times; a zero keeps its sign.
    [[nodiscard]] MEMBRANE_INLINE static Type all(Scalar number) noexcept { return detail::for_lane(number) - Type{}; }

    /// `yes` where `mask` is set, `no` elsewhere.
    [[nodiscard]] MEMBRANE_INLINE static Type choose(Mask mask, Type yes, Type no) noexcept { return mask ? yes : no; }

    /// The magnitude of each number: clears its sign bit.
    [[nodiscard]] MEMBRANE_INLINE static Type absolute(Type a) noexcept {
        using One = std::conditional_t<sizeof(Scalar) == 4, std::int32_t, std::int64_t>;
        const Mask all_but_sign = (std::numeric_limits<One>::max)() - Mask{};
        return reinterpret_cast<Type>(reinterpret_cast<Mask>(a) & all_but_sign);
    }

    /// The square root, correctly rounded. Compilers vectorise it only under `-fno-math-errno`.
    [[nodiscard]] MEMBRANE_INLINE static Type root(Type a) noexcept {
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
        Type roots;
        for (std::size_t i = 0; i < size; ++i) roots[i] = std::sqrt(a[i]);
        return roots;
#endif
    }

    /// Number i in bit i.
    [[nodiscard]] MEMBRANE_INLINE static std::uint32_t bits(Mask mask) noexcept {
#if defined(__AVX__)
        if constexpr (sizeof(Scalar) == 4)
            return static_cast<std::uint32_t>(_mm256_movemask_ps(reinterpret_cast<Type>(mask)));
        else
            return static_cast<std::uint32_t>(_mm256_movemask_pd(reinterpret_cast<Type>(mask)));
#elif defined(__SSE2__)
        if constexpr (sizeof(Scalar) == 4)
            return static_cast<std::uint32_t>(_mm_movemask_ps(reinterpret_cast<Type>(mask)));
        else
            return static_cast<std::uint32_t>(_mm_movemask_pd(reinterpret_cast<Type>(mask)));
#else
        std::uint32_t set = 0;
        for (std::size_t i = 0; i < size; ++i) set |= static_cast<std::uint32_t>(mask[i] != 0) << i;
        return set;
#endif
    }

    /// Three numbers from `from` on and a zero.
    [[nodiscard]] MEMBRANE_INLINE static Type load_three(const Scalar* from) noexcept {
        static_assert(size == 4);
#if defined(__AVX__)
        if constexpr (sizeof(Scalar) == 8)
            return _mm256_maskload_pd(from, _mm256_setr_epi64x(-1, -1, -1, 0));
        else
            return _mm_maskload_ps(from, _mm_setr_epi32(-1, -1, -1, 0));
#else
        return Type{detail::for_lane(from[0]), detail::for_lane(from[1]), detail::for_lane(from[2]), 0};
#endif
    }
};

/// The numbers `index` of `a` and then `b`.
template <int... index, class Part>
[[nodiscard]] MEMBRANE_INLINE auto shuffle(Part a, Part b) noexcept {
    return __builtin_shufflevector(a, b, index...);
}

#else

/// Size of a `Register`.
inline constexpr std::size_t register_bytes = 16;

/// Numbers in an array, with the operators of a SIMD register.
template <class Number, std::size_t count>
struct alignas(count * sizeof(Number)) PlainRegister {
    using Truth = std::conditional_t<sizeof(Number) == 4, std::int32_t, std::int64_t>;

    Number number[count];

    [[nodiscard]] Number& operator[](std::size_t i) noexcept { return number[i]; }
    [[nodiscard]] const Number& operator[](std::size_t i) const noexcept { return number[i]; }

    /// `operation` of each number of `a` and of `b`.
    template <class Operation>
    [[nodiscard]] static auto each(const PlainRegister& a, const PlainRegister& b, Operation operation) noexcept {
        PlainRegister<decltype(operation(a[0], b[0])), count> result;
        for (std::size_t i = 0; i < count; ++i) result[i] = operation(a[i], b[i]);
        return result;
    }

    friend auto operator+(const PlainRegister& a, const PlainRegister& b) noexcept {
        return each(a, b, [](Number x, Number y) { return x + y; });
    }
    friend auto operator-(const PlainRegister& a, const PlainRegister& b) noexcept {
        return each(a, b, [](Number x, Number y) { return x - y; });
    }
    friend auto operator*(const PlainRegister& a, const PlainRegister& b) noexcept {
        return each(a, b, [](Number x, Number y) { return x * y; });
    }
    friend auto operator/(const PlainRegister& a, const PlainRegister& b) noexcept {
        return each(a, b, [](Number x, Number y) { return x / y; });
    }
    friend auto operator-(const PlainRegister& a) noexcept {
        return each(a, a, [](Number x, Number) { return -x; });
    }
    friend auto operator<(const PlainRegister& a, const PlainRegister& b) noexcept {
        return each(a, b, [](Number x, Number y) { return x < y ? Truth(-1) : Truth(0); });
    }
    friend auto operator<=(const PlainRegister& a, const PlainRegister& b) noexcept {
        return each(a, b, [](Number x, Number y) { return x <= y ? Truth(-1) : Truth(0); });
    }
    friend auto operator!=(const PlainRegister& a, const PlainRegister& b) noexcept {
        return each(a, b, [](Number x, Number y) { return x != y ? Truth(-1) : Truth(0); });
    }
    friend auto operator&(const PlainRegister& a, const PlainRegister& b) noexcept {
        return each(a, b, [](Number x, Number y) { return x & y; });
    }
    friend auto operator|(const PlainRegister& a, const PlainRegister& b) noexcept {
        return each(a, b, [](Number x, Number y) { return x | y; });
    }
    friend auto operator~(const PlainRegister& a) noexcept {
        return each(a, a, [](Number x, Number) { return ~x; });
    }
};

template <Real Scalar, std::size_t bytes = register_bytes>
struct Register {
    static constexpr std::size_t size = bytes / sizeof(Scalar);
    using Type = PlainRegister<Scalar, size>;
    using Mask = decltype(Type{} < Type{});

    [[nodiscard]] static Type all(Scalar number) noexcept {
        return Type::each({}, {}, [number](Scalar, Scalar) { return number; });
    }
    [[nodiscard]] static Type choose(const Mask& mask, const Type& yes, const Type& no) noexcept {
        Type chosen;
        for (std::size_t i = 0; i < size; ++i) chosen[i] = mask[i] != 0 ? yes[i] : no[i];
        return chosen;
    }
    [[nodiscard]] static Type absolute(const Type& a) noexcept {
        return Type::each(a, a, [](Scalar x, Scalar) { return std::abs(x); });
    }
    [[nodiscard]] static Type root(const Type& a) noexcept {
        return Type::each(a, a, [](Scalar x, Scalar) { return std::sqrt(x); });
    }
    [[nodiscard]] static std::uint32_t bits(const Mask& mask) noexcept {
        std::uint32_t set = 0;
        for (std::size_t i = 0; i < size; ++i) set |= static_cast<std::uint32_t>(mask[i] != 0) << i;
        return set;
    }
    [[nodiscard]] static Type load_three(const Scalar* from) noexcept { return {from[0], from[1], from[2], 0}; }
};

template <int... index, class Number, std::size_t count>
[[nodiscard]] auto shuffle(const PlainRegister<Number, count>& a, const PlainRegister<Number, count>& b) noexcept {
    return PlainRegister<Number, sizeof...(index)>{
        (index < int(count) ? a[std::size_t(index)] : b[std::size_t(index) - count])...};
}

#endif

}  // namespace MEMBRANE_INSTRUCTION_SET

}  // namespace membrane
