// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>

#include <membrane/core/lanes.hpp>

/// Points of which several are gathered or scattered at once.
///
///     std::vector<membrane::PaddedPoint<float>> rows;
///     const auto there = membrane::gather(rows.data(), begins);             // one point a lane
namespace membrane {

/// A point and one extra number, aligned to be read at once.
template <Real Scalar>
struct alignas(4 * sizeof(Scalar)) PaddedPoint {
    std::array<Scalar, 4> number{};  ///< x, y, z and the extra number

    [[nodiscard]] Vector3<Scalar> point() const noexcept { return {number[0], number[1], number[2]}; }
    [[nodiscard]] Scalar extra() const noexcept { return number[3]; }
    void set(const Vector3<Scalar>& p, Scalar extra = 0) noexcept { number = {p.x(), p.y(), p.z(), extra}; }
};

inline namespace MEMBRANE_INSTRUCTION_SET {

/// A padded point in registers; operators act on its four numbers.
template <Real Scalar>
class PaddedVector {
  public:
    PaddedVector() = default;                     ///< Zero.
    explicit PaddedVector(Scalar all) noexcept {  ///< Four times the same number.
        for (auto& part : parts_) part = all - Part{};
    }

    /// Reads four numbers from `from` on.
    [[nodiscard]] static PaddedVector load(const Scalar* from) noexcept {
        PaddedVector vector;
        std::memcpy(vector.parts_.data(), from, sizeof parts_);
        return vector;
    }
    void store(Scalar* to) const noexcept { std::memcpy(to, parts_.data(), sizeof parts_); }

    /// Reads three numbers from `from` on, none beyond them; the fourth becomes zero.
    [[nodiscard]] static PaddedVector load_point(const Scalar* from) noexcept {
        PaddedVector vector;
#if defined(__AVX__)
        if constexpr (sizeof(Scalar) == 8) {
            vector.parts_[0] = _mm256_maskload_pd(from, _mm256_setr_epi64x(-1, -1, -1, 0));
        } else {
            vector.parts_[0] = _mm_maskload_ps(from, _mm_setr_epi32(-1, -1, -1, 0));
        }
#else
        if constexpr (parts == 1) {
            vector.parts_[0] = Part{from[0], from[1], from[2], 0};
        } else {
            vector.parts_ = {Part{from[0], from[1]}, Part{from[2], 0}};
        }
#endif
        return vector;
    }

    /// The first three numbers.
    [[nodiscard]] Vector3<Scalar> point() const noexcept {
        return {parts_[0][0], parts_[0][1], parts_[2 / width][2 % width]};
    }

    [[nodiscard]] friend PaddedVector operator+(const PaddedVector& a, const PaddedVector& b) noexcept {
        return each([](auto x, auto y) { return x + y; }, a, b);
    }
    [[nodiscard]] friend PaddedVector operator-(const PaddedVector& a, const PaddedVector& b) noexcept {
        return each([](auto x, auto y) { return x - y; }, a, b);
    }
    [[nodiscard]] friend PaddedVector operator*(const PaddedVector& a, const PaddedVector& b) noexcept {
        return each([](auto x, auto y) { return x * y; }, a, b);
    }

    /// `membrane::smaller` and `larger` of each number.
    [[nodiscard]] friend PaddedVector smaller(const PaddedVector& a, const PaddedVector& b) noexcept {
        return each([](auto x, auto y) { return y < x ? y : x; }, a, b);
    }
    [[nodiscard]] friend PaddedVector larger(const PaddedVector& a, const PaddedVector& b) noexcept {
        return each([](auto x, auto y) { return x < y ? y : x; }, a, b);
    }

    /// The sum of all four numbers.
    [[nodiscard]] Scalar sum() const noexcept {
        std::array<Scalar, 4> number;
        store(number.data());
        return (number[0] + number[1]) + (number[2] + number[3]);
    }

    /// The point (y, z, x).
    [[nodiscard]] PaddedVector turned() const noexcept {
        PaddedVector result;
        if constexpr (parts == 1) {
            result.parts_[0] = __builtin_shufflevector(parts_[0], parts_[0], 1, 2, 0, 3);
        } else {
            result.parts_ = {__builtin_shufflevector(parts_[0], parts_[1], 1, 2), parts_[0]};
        }
        return result;
    }

  private:
    template <class Operation>
    static PaddedVector each(Operation operation, const PaddedVector& a, const PaddedVector& b) noexcept {
        PaddedVector result;
        for (std::size_t i = 0; i < parts; ++i) result.parts_[i] = operation(a.parts_[i], b.parts_[i]);
        return result;
    }

    // As many of the numbers as fit a register.
    using Part = typename Register<Scalar, (std::min)(4 * sizeof(Scalar), register_bytes)>::Type;
    static constexpr std::size_t parts = 4 * sizeof(Scalar) / sizeof(Part), width = 4 / parts;
    std::array<Part, parts> parts_{};
};

}  // namespace MEMBRANE_INSTRUCTION_SET

/// Numbers in a padded point: row r begins at number 4 r.
inline constexpr Index numbers_in_point = 4;

/// In lane i the point of `rows` that begins at number `begins[i]`.
template <Real Scalar>
[[nodiscard]] Vector3<Lanes<Scalar>> gather(const PaddedPoint<Scalar>* rows, const Index* begins) noexcept;

/// Writes lane i to the point of `rows` that begins at number `begins[i]`; its extra number becomes zero.
template <Real Scalar>
void scatter(const Vector3<Lanes<Scalar>>& points, PaddedPoint<Scalar>* rows, const Index* begins) noexcept;

/// Padded points, one a lane.
template <Real Scalar>
struct PaddedLanes {
    Vector3<Lanes<Scalar>> point;
    Lanes<Scalar> extra;
};

/// `gather` and `scatter` with the extra number.
template <Real Scalar>
[[nodiscard]] PaddedLanes<Scalar> gather_padded(const PaddedPoint<Scalar>* rows, const Index* begins) noexcept;
template <Real Scalar>
void scatter_padded(const PaddedLanes<Scalar>& points, PaddedPoint<Scalar>* rows, const Index* begins) noexcept;

namespace detail {

template <class Part, Real Scalar>
[[nodiscard]] Part load_part(const Scalar* from) noexcept {
    Part part;
    std::memcpy(&part, from, sizeof part);
    return part;
}
template <class Part, Real Scalar>
void store_part(const Part& part, Scalar* to) noexcept {
    std::memcpy(to, &part, sizeof part);
}

#if defined(__GNUC__)
/// The four columns of a matrix of eight rows.
template <class Part>
[[gnu::always_inline, nodiscard]] inline std::array<Part, 4> eight_columns(const PaddedPoint<float>* rows,
                                                                           const Index* begins) noexcept {
    const auto row = [&](std::size_t i) { return rows->number.data() + begins[i]; };
    using Half __attribute__((vector_size(16))) = float;
    const auto pair = [&](std::size_t i) {
        return __builtin_shufflevector(load_part<Half>(row(i)), load_part<Half>(row(i + 4)), 0, 1, 2, 3, 4, 5, 6, 7);
    };
    const Part a = pair(0), b = pair(1), c = pair(2), d = pair(3);
    const Part ab = __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13);
    const Part cd = __builtin_shufflevector(c, d, 0, 8, 1, 9, 4, 12, 5, 13);
    const Part ab_z = __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15);
    const Part cd_z = __builtin_shufflevector(c, d, 2, 10, 3, 11, 6, 14, 7, 15);
    return {__builtin_shufflevector(ab, cd, 0, 1, 8, 9, 4, 5, 12, 13),
            __builtin_shufflevector(ab, cd, 2, 3, 10, 11, 6, 7, 14, 15),
            __builtin_shufflevector(ab_z, cd_z, 0, 1, 8, 9, 4, 5, 12, 13),
            __builtin_shufflevector(ab_z, cd_z, 2, 3, 10, 11, 6, 7, 14, 15)};
}
#endif

/// The four columns of a matrix whose row i begins at number `begins[i]` of `rows`; it has as many rows as a register
/// holds numbers. Unused columns cost nothing.
template <class Part, Real Scalar>
[[gnu::always_inline, nodiscard]] inline std::array<Part, 4> columns(const PaddedPoint<Scalar>* rows,
                                                                     const Index* begins) noexcept {
    constexpr std::size_t width = sizeof(Part) / sizeof(Scalar);
    const auto row = [&](std::size_t i) { return rows->number.data() + begins[i]; };
#if defined(__GNUC__)
    if constexpr (width == 2) {
        const auto half = [&](std::size_t i, std::size_t k) { return load_part<Part>(row(i) + 2 * k); };
        const Part a = half(0, 0), b = half(1, 0), c = half(0, 1), d = half(1, 1);
        return {__builtin_shufflevector(a, b, 0, 2), __builtin_shufflevector(a, b, 1, 3),
                __builtin_shufflevector(c, d, 0, 2), __builtin_shufflevector(c, d, 1, 3)};
    } else if constexpr (width == 4) {
        // Reads half rows, so that no later shuffle crosses the halves of a register.
        using Half = typename Register<Scalar, 2 * sizeof(Scalar)>::Type;
        const auto halves = [&](std::size_t i, std::size_t k) {
            return __builtin_shufflevector(load_part<Half>(row(i) + 2 * k), load_part<Half>(row(i + 2) + 2 * k), 0, 1,
                                           2, 3);
        };
        const Part xy_even = halves(0, 0), xy_odd = halves(1, 0), zw_even = halves(0, 1), zw_odd = halves(1, 1);
        return {
            __builtin_shufflevector(xy_even, xy_odd, 0, 4, 2, 6), __builtin_shufflevector(xy_even, xy_odd, 1, 5, 3, 7),
            __builtin_shufflevector(zw_even, zw_odd, 0, 4, 2, 6), __builtin_shufflevector(zw_even, zw_odd, 1, 5, 3, 7)};
    } else if constexpr (width == 8) {
        return eight_columns<Part>(rows, begins);
    }
#endif
    std::array<Part, 4> result{};
    for (std::size_t i = 0; i < width; ++i) {
        for (std::size_t k = 0; k < 4; ++k) result[k][i] = row(i)[k];
    }
    return result;
}

/// Writes the four columns to the rows: the inverse of `columns`.
template <class Part, Real Scalar>
[[gnu::always_inline]] inline void put_columns(const std::array<Part, 4>& column, PaddedPoint<Scalar>* rows,
                                               const Index* begins) noexcept {
    constexpr std::size_t width = sizeof(Part) / sizeof(Scalar);
    const auto row = [&](std::size_t i) { return rows->number.data() + begins[i]; };
#if defined(__GNUC__)
    const Part x = column[0], y = column[1], z = column[2], extra = column[3];
    if constexpr (width == 2) {
        store_part(__builtin_shufflevector(x, y, 0, 2), row(0));
        store_part(__builtin_shufflevector(z, extra, 0, 2), row(0) + 2);
        store_part(__builtin_shufflevector(x, y, 1, 3), row(1));
        store_part(__builtin_shufflevector(z, extra, 1, 3), row(1) + 2);
        return;
    } else if constexpr (width == 4) {
        const Part xy_even = __builtin_shufflevector(x, y, 0, 4, 2, 6),
                   xy_odd = __builtin_shufflevector(x, y, 1, 5, 3, 7),
                   zw_even = __builtin_shufflevector(z, extra, 0, 4, 2, 6),
                   zw_odd = __builtin_shufflevector(z, extra, 1, 5, 3, 7);
        store_part(__builtin_shufflevector(xy_even, zw_even, 0, 1, 4, 5), row(0));
        store_part(__builtin_shufflevector(xy_odd, zw_odd, 0, 1, 4, 5), row(1));
        store_part(__builtin_shufflevector(xy_even, zw_even, 2, 3, 6, 7), row(2));
        store_part(__builtin_shufflevector(xy_odd, zw_odd, 2, 3, 6, 7), row(3));
        return;
    } else if constexpr (width == 8) {
        const Part xy = __builtin_shufflevector(x, y, 0, 8, 1, 9, 4, 12, 5, 13);
        const Part xy_next = __builtin_shufflevector(x, y, 2, 10, 3, 11, 6, 14, 7, 15);
        const Part z_first = __builtin_shufflevector(z, extra, 0, 8, 1, 9, 4, 12, 5, 13);
        const Part z_next = __builtin_shufflevector(z, extra, 2, 10, 3, 11, 6, 14, 7, 15);
        const auto put = [&](const Part& a, const Part& b, std::size_t i) {
            store_part(__builtin_shufflevector(a, b, 0, 1, 8, 9), row(i));
            store_part(__builtin_shufflevector(a, b, 2, 3, 10, 11), row(i + 1));
            store_part(__builtin_shufflevector(a, b, 4, 5, 12, 13), row(i + 4));
            store_part(__builtin_shufflevector(a, b, 6, 7, 14, 15), row(i + 5));
        };
        put(xy, z_first, 0);
        put(xy_next, z_next, 2);
        return;
    }
#endif
    for (std::size_t i = 0; i < width; ++i) {
        for (std::size_t k = 0; k < 4; ++k) row(i)[k] = column[k][i];
    }
}

}  // namespace detail

template <Real Scalar>
[[gnu::always_inline]] inline PaddedLanes<Scalar> gather_padded(const PaddedPoint<Scalar>* rows,
                                                                const Index* begins) noexcept {
    using Part = typename Lanes<Scalar>::Part;
    constexpr std::size_t width = sizeof(Part) / sizeof(Scalar);
    PaddedLanes<Scalar> points;
    for (std::size_t i = 0; i < Lanes<Scalar>::parts; ++i) {
        const auto part = detail::columns<Part>(rows, begins + i * width);
        for (std::size_t k = 0; k < 3; ++k) points.point[static_cast<Eigen::Index>(k)].part(i) = part[k];
        points.extra.part(i) = part[3];
    }
    return points;
}

template <Real Scalar>
[[gnu::always_inline]] inline void scatter_padded(const PaddedLanes<Scalar>& points, PaddedPoint<Scalar>* rows,
                                                  const Index* begins) noexcept {
    using Part = typename Lanes<Scalar>::Part;
    constexpr std::size_t width = sizeof(Part) / sizeof(Scalar);
    const auto& point = points.point;
    for (std::size_t i = 0; i < Lanes<Scalar>::parts; ++i) {
        detail::put_columns<Part>({point[0].part(i), point[1].part(i), point[2].part(i), points.extra.part(i)}, rows,
                                  begins + i * width);
    }
}

template <Real Scalar>
[[gnu::always_inline]] inline Vector3<Lanes<Scalar>> gather(const PaddedPoint<Scalar>* rows,
                                                            const Index* begins) noexcept {
    return gather_padded(rows, begins).point;
}

template <Real Scalar>
[[gnu::always_inline]] inline void scatter(const Vector3<Lanes<Scalar>>& points, PaddedPoint<Scalar>* rows,
                                           const Index* begins) noexcept {
    scatter_padded<Scalar>({points, Lanes<Scalar>(0)}, rows, begins);
}

}  // namespace membrane
