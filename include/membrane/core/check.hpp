// SPDX-License-Identifier: MIT
#pragma once

#include <atomic>
#include <concepts>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>

#include <membrane/core/types.hpp>

/// Error handling.
///
/// Offline code checks the caller's input in every build and throws `InvalidInput`. Online code returns errors as
/// values. The preconditions of accessors are `MEMBRANE_ASSERT`s, which only debug builds check.
///
///     try { membrane::MassSpringNetwork network(mesh, law, options); }
///     catch (const membrane::InvalidInput& e) { std::puts(e.what()); }
///     // MassSpringNetwork: stiffness of spring 17 must be finite and not negative [N/m], got -3
namespace membrane {

/// Invalid input. The message names component, field, index, the value expected and the value found.
class InvalidInput : public std::invalid_argument {
  public:
    using std::invalid_argument::invalid_argument;
};

/// Called with the message if a check fails in a translation unit compiled without exceptions. It must not return: if
/// it does, the program is aborted.
using InvalidInputHandler = void (*)(const char* message);

/// Called with the condition, file and line if a `MEMBRANE_ASSERT` fails. If it returns, the program is aborted.
using AssertHandler = void (*)(const char* condition, const char* file, int line) noexcept;

///@{
/// Replaces the handler for the whole program and returns the previous one; null restores the default, which prints to
/// stderr. Thread-safe.
inline InvalidInputHandler set_invalid_input_handler(InvalidInputHandler handler) noexcept;
inline AssertHandler set_assert_handler(AssertHandler handler) noexcept;
///@}

/// Whether `value` is neither infinite nor NaN.
template <Real Scalar>
[[nodiscard]] bool is_finite(Scalar value) noexcept;

///@{
/// Whether all entries of a vector or matrix are finite.
template <Real Scalar>
[[nodiscard]] bool is_finite(const Vector3<Scalar>& vector) noexcept;
template <class Derived>
[[nodiscard]] bool is_finite(const Eigen::DenseBase<Derived>& values) noexcept;
///@}

/// Throws `InvalidInput` with the message "component: part part ...", the parts concatenated. Offline only.
template <class... Parts>
[[noreturn]] void refuse(std::string_view component, const Parts&... parts);

/// A precondition of online code: checked unless `NDEBUG` is defined; then it costs nothing.
#ifdef NDEBUG
#define MEMBRANE_ASSERT(condition) static_cast<void>(0)
#else
#define MEMBRANE_ASSERT(condition) \
    ((condition) ? static_cast<void>(0) : ::membrane::detail::assertion_failed(#condition, __FILE__, __LINE__))
#endif

namespace detail {

/// Squares of larger numbers overflow: half of the exponent range, less a few bits.
template <Real Scalar>
inline constexpr Scalar too_large = Scalar(sizeof(Scalar) == 4 ? 1e18 : 1e153);

inline std::atomic<InvalidInputHandler> invalid_input_handler{nullptr};
inline std::atomic<AssertHandler> assert_handler{nullptr};

[[noreturn]] inline void assertion_failed(const char* condition, const char* file, int line) noexcept {
    if (const auto handler = assert_handler.load()) {
        handler(condition, file, line);
    } else {
        std::fprintf(stderr, "%s:%d: membrane: broken precondition: %s\n", file, line, condition);
    }
    std::abort();
}

[[noreturn]] inline void invalid_input(const std::string& message) {
#if defined(__cpp_exceptions) || defined(_CPPUNWIND)
    throw InvalidInput(message);
#else
    if (const auto handler = invalid_input_handler.load()) {
        handler(message.c_str());
    } else {
        std::fprintf(stderr, "membrane: invalid input: %s\n", message.c_str());
    }
    std::abort();
#endif
}

inline void append(std::string& text, std::string_view part) { text += part; }

template <class Number>
    requires std::is_arithmetic_v<Number>
void append(std::string& text, Number number) {
    if constexpr (std::integral<Number>) {
        text += std::to_string(number);
    } else {
        char digits[40];
        std::snprintf(digits, sizeof digits, "%.9g", static_cast<double>(number));
        for (const char c : std::string_view(digits)) {  // the decimal separator is the locale's, of one byte or more
            const bool is_separator = std::string_view("+-0123456789aefin").find(c) == std::string_view::npos;
            if (!is_separator || text.back() != '.') text += is_separator ? '.' : c;
        }
    }
}

}  // namespace detail

inline InvalidInputHandler set_invalid_input_handler(InvalidInputHandler handler) noexcept {
    return detail::invalid_input_handler.exchange(handler);
}

inline AssertHandler set_assert_handler(AssertHandler handler) noexcept {
    return detail::assert_handler.exchange(handler);
}

template <Real Scalar>
bool is_finite(Scalar value) noexcept {
    using Bits = std::conditional_t<sizeof(Scalar) == 4, std::uint32_t, std::uint64_t>;
    constexpr Bits exponent = sizeof(Scalar) == 4 ? Bits{0x7f800000U} : static_cast<Bits>(0x7ff0000000000000ULL);
    Bits bits;
    std::memcpy(&bits, &value, sizeof bits);
    return (bits & exponent) != exponent;
}

template <Real Scalar>
bool is_finite(const Vector3<Scalar>& vector) noexcept {
    return is_finite(vector.x()) && is_finite(vector.y()) && is_finite(vector.z());
}

template <class Derived>
bool is_finite(const Eigen::DenseBase<Derived>& values) noexcept {
    for (Eigen::Index column = 0; column < values.cols(); ++column) {
        for (Eigen::Index row = 0; row < values.rows(); ++row) {
            if (!is_finite(values.coeff(row, column))) return false;
        }
    }
    return true;
}

template <class... Parts>
void refuse(std::string_view component, const Parts&... parts) {
    std::string message(component);
    message += ": ";
    (detail::append(message, parts), ...);
    detail::invalid_input(message);
}

namespace detail {

/// Throws `InvalidInput` if the option is not finite, negative, or zero unless `allow_zero`.
inline void check_option(std::string_view component, double value, std::string_view field, std::string_view unit,
                         bool allow_zero = true) {
    if (is_finite(value) && (value > 0 || (allow_zero && value == 0))) return;
    refuse(component, field, " must be finite and ", allow_zero ? "not negative" : "positive", " [", unit, "], got ",
           value);
}

}  // namespace detail

}  // namespace membrane
