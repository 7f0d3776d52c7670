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

    /// x, y and z.
    [[nodiscard]] Vector3<Scalar> point() const noexcept { return {number[0], number[1], number[2]}; }

    /// The fourth number.
    [[nodiscard]] Scalar extra() const noexcept { return number[3]; }

    /// Sets all four numbers.
    void set(const Vector3<Scalar>& p, Scalar extra = 0) noexcept { number = {p.x(), p.y(), p.z(), extra}; }
};

inline namespace MEMBRANE_INSTRUCTION_SET {

/// A padded point in registers; operators act on its four numbers.
template <Real Scalar>
class PaddedVector {
    // As many of the numbers as fit a register. As in `Lanes`, the first one may be the last.
    using Registers = Register<Scalar, (std::min)(4 * sizeof(Scalar), register_bytes)>;
    using Part = typename Registers::Type;
    static constexpr std::size_t width = Registers::size, parts = 4 / width, last = parts - 1;

  public:
    PaddedVector() noexcept : PaddedVector(Scalar(0)) {}  ///< Zero.

    /// Four times the same number.
    MEMBRANE_INLINE explicit PaddedVector(Scalar all) noexcept {
        const Part part = Registers::all(all);
        parts_[0] = part;
        parts_[last] = part;
    }

    /// Reads four numbers from `from` on.
    [[nodiscard]] MEMBRANE_INLINE static PaddedVector load(const Scalar* from) noexcept {
        PaddedVector vector;
        std::memcpy(vector.parts_, from, sizeof parts_);
        return vector;
    }

    /// Writes four numbers from `to` on.
    MEMBRANE_INLINE void store(Scalar* to) const noexcept { std::memcpy(to, parts_, sizeof parts_); }

    /// Reads three numbers from `from` on, none beyond them; the fourth becomes zero.
    [[nodiscard]] MEMBRANE_INLINE static PaddedVector load_point(const Scalar* from) noexcept {
        if constexpr (parts == 1) {
            const Part all = Registers::load_three(from);
            return {all, all};
        } else {
            return {Part{detail::for_lane(from[0]), detail::for_lane(from[1])}, Part{detail::for_lane(from[2]), 0}};
        }
    }

    /// The first three numbers.
    [[nodiscard]] MEMBRANE_INLINE Vector3<Scalar> point() const noexcept {
        return {parts_[0][0], parts_[0][1], parts_[2 / width][2 % width]};
    }

    ///@{
    /// Number by number.
    [[nodiscard]] MEMBRANE_INLINE friend PaddedVector operator+(const PaddedVector& a, const PaddedVector& b) noexcept {
        return {a.parts_[0] + b.parts_[0], a.parts_[last] + b.parts_[last]};
    }
    [[nodiscard]] MEMBRANE_INLINE friend PaddedVector operator-(const PaddedVector& a, const PaddedVector& b) noexcept {
        return {a.parts_[0] - b.parts_[0], a.parts_[last] - b.parts_[last]};
    }
    [[nodiscard]] MEMBRANE_INLINE friend PaddedVector operator*(const PaddedVector& a, const PaddedVector& b) noexcept {
        return {a.parts_[0] * b.parts_[0], a.parts_[last] * b.parts_[last]};
    }
    ///@}

    ///@{
    /// `membrane::smaller` and `larger` of each number.
    [[nodiscard]] MEMBRANE_INLINE friend PaddedVector smaller(const PaddedVector& a, const PaddedVector& b) noexcept {
        return {Registers::choose(b.parts_[0] < a.parts_[0], b.parts_[0], a.parts_[0]),
                Registers::choose(b.parts_[last] < a.parts_[last], b.parts_[last], a.parts_[last])};
    }
    [[nodiscard]] MEMBRANE_INLINE friend PaddedVector larger(const PaddedVector& a, const PaddedVector& b) noexcept {
        return {Registers::choose(a.parts_[0] < b.parts_[0], b.parts_[0], a.parts_[0]),
                Registers::choose(a.parts_[last] < b.parts_[last], b.parts_[last], a.parts_[last])};
    }
    ///@}

    /// The sum of all four numbers.
    [[nodiscard]] MEMBRANE_INLINE Scalar sum() const noexcept {
        Scalar number[4];
        store(number);
        return (number[0] + number[1]) + (number[2] + number[3]);
    }

    /// The point (y, z, x).
    [[nodiscard]] MEMBRANE_INLINE PaddedVector turned() const noexcept {
        if constexpr (parts == 1) {
            const Part all = shuffle<1, 2, 0, 3>(parts_[0], parts_[0]);
            return {all, all};
        } else {
            return {shuffle<1, 2>(parts_[0], parts_[1]), parts_[0]};
        }
    }

  private:
    MEMBRANE_INLINE PaddedVector(const Part& first_part, const Part& last_part) noexcept {
        parts_[0] = first_part;
        parts_[last] = last_part;
    }

    Part parts_[parts];
};

}  // namespace MEMBRANE_INSTRUCTION_SET

/// Numbers in a padded point.
inline constexpr Index numbers_in_point = 4;

///@{
/// Number at which a row of padded points begins, and the row that begins there.
[[nodiscard]] constexpr Index begin_of_row(Index row) noexcept { return numbers_in_point * row; }
[[nodiscard]] constexpr Index row_at(Index begin) noexcept { return begin / numbers_in_point; }
///@}

/// In lane i the point of `rows` that begins at number `begins[i]`.
template <Real Scalar>
[[nodiscard]] Vector3<Lanes<Scalar>> gather(const PaddedPoint<Scalar>* rows, const Index* begins) noexcept;

/// Writes lane i to the point of `rows` that begins at number `begins[i]`; its extra number becomes zero.
template <Real Scalar>
void scatter(const Vector3<Lanes<Scalar>>& points, PaddedPoint<Scalar>* rows, const Index* begins) noexcept;

/// Padded points, one a lane.
template <Real Scalar>
struct PaddedLanes {
    Vector3<Lanes<Scalar>> point;  ///< x, y and z
    Lanes<Scalar> extra;           ///< the fourth numbers
};

///@{
/// `gather` and `scatter` with the extra number.
template <Real Scalar>
[[nodiscard]] PaddedLanes<Scalar> gather_padded(const PaddedPoint<Scalar>* rows, const Index* begins) noexcept;
template <Real Scalar>
void scatter_padded(const PaddedLanes<Scalar>& points, PaddedPoint<Scalar>* rows, const Index* begins) noexcept;
///@}

namespace detail {

template <class Part, Real Scalar>
[[nodiscard]] MEMBRANE_INLINE Part load_part(const Scalar* from) noexcept {
    Part part;
    std::memcpy(&part, from, sizeof part);
    return part;
}
template <class Part, Real Scalar>
MEMBRANE_INLINE void store_part(const Part& part, Scalar* to) noexcept {
    std::memcpy(to, &part, sizeof part);
}

/// The four columns of a matrix.
template <class Part>
struct Columns {
    Part x, y, z, extra;
};

/// Numbers k and k + 1 of row i, and then those of row i + 2.
template <class Half, Real Scalar>
[[nodiscard]] MEMBRANE_INLINE auto half_rows(const Scalar* rows, const Index* begins, std::size_t i,
                                             std::size_t k) noexcept {
    return shuffle<0, 1, 2, 3>(load_part<Half>(rows + begins[i] + k), load_part<Half>(rows + begins[i + 2] + k));
}

/// Row i, and then row i + 4.
template <class Part, Real Scalar>
[[nodiscard]] MEMBRANE_INLINE Part two_rows(const Scalar* rows, const Index* begins, std::size_t i) noexcept {
    using Row = typename Register<Scalar, 16>::Type;
    return shuffle<0, 1, 2, 3, 4, 5, 6, 7>(load_part<Row>(rows + begins[i]), load_part<Row>(rows + begins[i + 4]));
}

/// The four columns of a matrix whose row i begins at `rows + begins[i]`; it has as many rows as a register
/// holds numbers. Unused columns cost nothing.
template <class Part, Real Scalar>
[[nodiscard]] MEMBRANE_INLINE Columns<Part> columns(const Scalar* rows, const Index* begins) noexcept {
    constexpr std::size_t width = sizeof(Part) / sizeof(Scalar);
    static_assert(width == 2 || width == 4 || width == 8);
    if constexpr (width == 2) {
        const Scalar *first = rows + begins[0], *second = rows + begins[1];
        const auto column = [&](std::size_t k) MEMBRANE_INLINE_LAMBDA {
            return Part{for_lane(first[k]), for_lane(second[k])};
        };
        return {column(0), column(1), column(2), column(3)};
    } else if constexpr (sizeof(Part) == 16) {
        const Part a = load_part<Part>(rows + begins[0]), b = load_part<Part>(rows + begins[1]),
                   c = load_part<Part>(rows + begins[2]), d = load_part<Part>(rows + begins[3]);
        const Part ab = shuffle<0, 4, 1, 5>(a, b), cd = shuffle<0, 4, 1, 5>(c, d);
        const Part ab_z = shuffle<2, 6, 3, 7>(a, b), cd_z = shuffle<2, 6, 3, 7>(c, d);
        return {shuffle<0, 1, 4, 5>(ab, cd), shuffle<2, 3, 6, 7>(ab, cd), shuffle<0, 1, 4, 5>(ab_z, cd_z),
                shuffle<2, 3, 6, 7>(ab_z, cd_z)};
    } else if constexpr (width == 4) {
        // Reads half rows, so that no later shuffle crosses the halves of a register.
        using Half = typename Register<Scalar, 2 * sizeof(Scalar)>::Type;
        const Part xy_even = half_rows<Half>(rows, begins, 0, 0), xy_odd = half_rows<Half>(rows, begins, 1, 0);
        const Part zw_even = half_rows<Half>(rows, begins, 0, 2), zw_odd = half_rows<Half>(rows, begins, 1, 2);
        return {shuffle<0, 4, 2, 6>(xy_even, xy_odd), shuffle<1, 5, 3, 7>(xy_even, xy_odd),
                shuffle<0, 4, 2, 6>(zw_even, zw_odd), shuffle<1, 5, 3, 7>(zw_even, zw_odd)};
    } else {
        const Part a = two_rows<Part>(rows, begins, 0), b = two_rows<Part>(rows, begins, 1),
                   c = two_rows<Part>(rows, begins, 2), d = two_rows<Part>(rows, begins, 3);
        const Part ab = shuffle<0, 8, 1, 9, 4, 12, 5, 13>(a, b), cd = shuffle<0, 8, 1, 9, 4, 12, 5, 13>(c, d);
        const Part ab_z = shuffle<2, 10, 3, 11, 6, 14, 7, 15>(a, b), cd_z = shuffle<2, 10, 3, 11, 6, 14, 7, 15>(c, d);
        return {shuffle<0, 1, 8, 9, 4, 5, 12, 13>(ab, cd), shuffle<2, 3, 10, 11, 6, 7, 14, 15>(ab, cd),
                shuffle<0, 1, 8, 9, 4, 5, 12, 13>(ab_z, cd_z), shuffle<2, 3, 10, 11, 6, 7, 14, 15>(ab_z, cd_z)};
    }
}

/// Writes rows i, i + 1, i + 4 and i + 5.
template <class Part>
MEMBRANE_INLINE void put_four_rows(const Part& xy, const Part& z_extra, std::size_t i, float* rows,
                                   const Index* begins) noexcept {
    store_part(shuffle<0, 1, 8, 9>(xy, z_extra), rows + begins[i]);
    store_part(shuffle<2, 3, 10, 11>(xy, z_extra), rows + begins[i + 1]);
    store_part(shuffle<4, 5, 12, 13>(xy, z_extra), rows + begins[i + 4]);
    store_part(shuffle<6, 7, 14, 15>(xy, z_extra), rows + begins[i + 5]);
}

/// Writes the four columns to the rows: the inverse of `columns`.
template <class Part, Real Scalar>
MEMBRANE_INLINE void put_columns(const Columns<Part>& column, Scalar* rows, const Index* begins) noexcept {
    constexpr std::size_t width = sizeof(Part) / sizeof(Scalar);
    static_assert(width == 2 || width == 4 || width == 8);
    const Part &x = column.x, &y = column.y, &z = column.z, &extra = column.extra;
    if constexpr (width == 2) {
        Scalar *first = rows + begins[0], *second = rows + begins[1];
        store_part(shuffle<0, 2>(x, y), first);
        store_part(shuffle<0, 2>(z, extra), first + 2);
        store_part(shuffle<1, 3>(x, y), second);
        store_part(shuffle<1, 3>(z, extra), second + 2);
    } else if constexpr (width == 4) {
        const Part xy_even = shuffle<0, 4, 2, 6>(x, y), xy_odd = shuffle<1, 5, 3, 7>(x, y);
        const Part zw_even = shuffle<0, 4, 2, 6>(z, extra), zw_odd = shuffle<1, 5, 3, 7>(z, extra);
        store_part(shuffle<0, 1, 4, 5>(xy_even, zw_even), rows + begins[0]);
        store_part(shuffle<0, 1, 4, 5>(xy_odd, zw_odd), rows + begins[1]);
        store_part(shuffle<2, 3, 6, 7>(xy_even, zw_even), rows + begins[2]);
        store_part(shuffle<2, 3, 6, 7>(xy_odd, zw_odd), rows + begins[3]);
    } else {
        put_four_rows<Part>(shuffle<0, 8, 1, 9, 4, 12, 5, 13>(x, y), shuffle<0, 8, 1, 9, 4, 12, 5, 13>(z, extra), 0,
                            rows, begins);
        put_four_rows<Part>(shuffle<2, 10, 3, 11, 6, 14, 7, 15>(x, y), shuffle<2, 10, 3, 11, 6, 14, 7, 15>(z, extra), 2,
                            rows, begins);
    }
}

}  // namespace detail

template <Real Scalar>
MEMBRANE_INLINE PaddedLanes<Scalar> gather_padded(const PaddedPoint<Scalar>* rows, const Index* begins) noexcept {
    using Part = typename Lanes<Scalar>::Part;
    const Scalar* numbers = rows->number.data();
    PaddedLanes<Scalar> points;
    for (std::size_t i = 0; i < Lanes<Scalar>::parts; ++i) {
        const auto part = detail::columns<Part>(numbers, begins + i * Lanes<Scalar>::count / Lanes<Scalar>::parts);
        points.point.x().part(i) = part.x;
        points.point.y().part(i) = part.y;
        points.point.z().part(i) = part.z;
        points.extra.part(i) = part.extra;
    }
    return points;
}

template <Real Scalar>
MEMBRANE_INLINE void scatter_padded(const PaddedLanes<Scalar>& points, PaddedPoint<Scalar>* rows,
                                    const Index* begins) noexcept {
    using Part = typename Lanes<Scalar>::Part;
    Scalar* numbers = rows->number.data();
    const auto& point = points.point;
    for (std::size_t i = 0; i < Lanes<Scalar>::parts; ++i) {
        detail::put_columns<Part>({point.x().part(i), point.y().part(i), point.z().part(i), points.extra.part(i)},
                                  numbers, begins + i * Lanes<Scalar>::count / Lanes<Scalar>::parts);
    }
}

template <Real Scalar>
MEMBRANE_INLINE Vector3<Lanes<Scalar>> gather(const PaddedPoint<Scalar>* rows, const Index* begins) noexcept {
    return gather_padded(rows, begins).point;
}

template <Real Scalar>
MEMBRANE_INLINE void scatter(const Vector3<Lanes<Scalar>>& points, PaddedPoint<Scalar>* rows,
                             const Index* begins) noexcept {
    scatter_padded<Scalar>({points, Lanes<Scalar>(0)}, rows, begins);
}

}  // namespace membrane
