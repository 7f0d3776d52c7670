// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

#include <membrane/core/types.hpp>

/// Exact orientation predicates: signs of volumes and areas, consistent with each other.
///
///     if (sign_of_volume(a, b, c, d) == 0) coplanar = true;  // exactly
///
/// Computed in floating point first; if the rounding error could change the sign, in exact arithmetic [Shewchuk97]. Not
/// exact under `-ffast-math`, or if products of three differences overflow or underflow.
namespace membrane {

/// Sign of the volume of a, b, c, d: -1, 0 or 1; positive if a, b, c run counter-clockwise seen from d.
[[nodiscard]] inline int sign_of_volume(const Vector3<double>& a, const Vector3<double>& b, const Vector3<double>& c,
                                        const Vector3<double>& d) noexcept;

/// Sign of the area of a, b, c seen from the end of axis `k`: -1, 0 or 1; positive if they run counter-clockwise.
[[nodiscard]] inline int sign_of_area(const Vector3<double>& a, const Vector3<double>& b, const Vector3<double>& c,
                                      int k) noexcept;

/// Whether the three points lie on one line, exactly.
[[nodiscard]] inline bool on_one_line(const Vector3<double>& a, const Vector3<double>& b,
                                      const Vector3<double>& c) noexcept {
    return sign_of_area(a, b, c, 0) == 0 && sign_of_area(a, b, c, 1) == 0 && sign_of_area(a, b, c, 2) == 0;
}

namespace detail {

[[nodiscard]] constexpr int sign_of(double value) noexcept { return value > 0 ? 1 : value < 0 ? -1 : 0; }

/// A rounded result and its rounding error: the exact result is `value` + `rest`.
struct Rounded {
    double value, rest;
};

[[nodiscard]] inline Rounded exact_sum(double a, double b) noexcept {
    const double sum = a + b, from_b = sum - a, from_a = sum - from_b;
    return {sum, (a - from_a) + (b - from_b)};
}

[[nodiscard]] inline Rounded exact_product(double a, double b) noexcept {
    const double product = a * b;
    return {product, std::fma(a, b, -product)};
}

/// An exact sum of up to 192 numbers, stored as nonoverlapping terms, smallest first.
class ExactSum {
  public:
    void add(double number) noexcept {
        std::size_t kept = 0;
        for (std::size_t i = 0; i < count_; ++i) {
            const Rounded sum = exact_sum(number, terms_[i]);
            if (sum.rest != 0) terms_[kept++] = sum.rest;
            number = sum.value;
        }
        if (number != 0) terms_[kept++] = number;
        count_ = kept;
    }

    void add_product(double a, double b) noexcept {
        if (a == 0 || b == 0) return;
        const Rounded product = exact_product(a, b);
        add(product.rest);
        add(product.value);
    }

    [[nodiscard]] int sign() const noexcept { return count_ == 0 ? 0 : sign_of(terms_[count_ - 1]); }

  private:
    std::array<double, 192> terms_;
    std::size_t count_ = 0;
};

/// Adds sign * (a - a0) * (b - b0) * (c - c0) to the sum.
inline void add_triple(ExactSum& sum, double sign, const Rounded& a, const Rounded& b, const Rounded& c) noexcept {
    for (const double i : {a.value, a.rest}) {
        for (const double j : {b.value, b.rest}) {
            const Rounded product = exact_product(sign * i, j);
            for (const double k : {c.value, c.rest}) {
                sum.add_product(product.value, k);
                sum.add_product(product.rest, k);
            }
        }
    }
}

}  // namespace detail

inline int sign_of_volume(const Vector3<double>& a, const Vector3<double>& b, const Vector3<double>& c,
                          const Vector3<double>& d) noexcept {
    const Vector3<double> u = a - d, v = b - d, w = c - d;
    double volume = 0, magnitude = 0;
    for (const int k : {0, 1, 2}) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        const double first = v[i] * w[j], second = v[j] * w[i];
        volume += u[k] * (first - second);
        magnitude += std::abs(u[k]) * (std::abs(first) + std::abs(second));
    }
    if (std::abs(volume) > 8e-16 * magnitude) return detail::sign_of(volume);
    if (magnitude == 0) return 0;
    detail::ExactSum sum;
    const auto from_d = [&](const Vector3<double>& p, int k) { return detail::exact_sum(p[k], -d[k]); };
    for (const int k : {0, 1, 2}) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        detail::add_triple(sum, 1, from_d(a, k), from_d(b, i), from_d(c, j));
        detail::add_triple(sum, -1, from_d(a, k), from_d(b, j), from_d(c, i));
    }
    return sum.sign();
}

inline int sign_of_area(const Vector3<double>& a, const Vector3<double>& b, const Vector3<double>& c, int k) noexcept {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    const double first = (a[i] - c[i]) * (b[j] - c[j]), second = (a[j] - c[j]) * (b[i] - c[i]);
    const double area = first - second;
    if (std::abs(area) > 4e-16 * (std::abs(first) + std::abs(second))) return detail::sign_of(area);
    if (first == 0 && second == 0) return 0;
    detail::ExactSum sum;  // of a x b + b x c + c x a
    for (const auto& [p, q] : {std::array{&a, &b}, std::array{&b, &c}, std::array{&c, &a}}) {
        sum.add_product((*p)[i], (*q)[j]);
        sum.add_product(-(*p)[j], (*q)[i]);
    }
    return sum.sign();
}

}  // namespace membrane
