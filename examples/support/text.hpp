// SPDX-License-Identifier: MIT
#pragma once

#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <ios>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>

/// Numbers as people read them, text as XML takes it, and text to a file.
namespace examples {

/// `value` with so many `decimals`, whatever the locale.
[[nodiscard]] inline std::string printed(double value, int decimals, std::chars_format format) {
    char digits[400];
    return {digits, std::to_chars(digits, std::end(digits), value, format, decimals).ptr};
}

/// `value` with at most `decimals` digits behind the point and no zeros at the end.
[[nodiscard]] inline std::string number(double value, int decimals = 1) {
    std::string text = printed(value, decimals, std::chars_format::fixed);
    if (text.find('.') != std::string::npos) {
        text.erase(text.find_last_not_of('0') + 1);
        if (text.back() == '.') text.pop_back();
    }
    return text == "-0" ? "0" : text;
}

/// `value` with so many significant `digits` and no exponent: 0.0123, 4.57, 1230.
[[nodiscard]] inline std::string significant(double value, int digits = 3) {
    const int magnitude = value == 0 ? 0 : static_cast<int>(std::floor(std::log10(std::abs(value))));
    return printed(value, magnitude >= digits - 1 ? 0 : digits - 1 - magnitude, std::chars_format::fixed);
}

/// `value` as a program prints it: 1.3e-09.
[[nodiscard]] inline std::string exponential(double value) { return printed(value, 1, std::chars_format::scientific); }

/// `value` in words of powers of ten where it is small: 0.25, 1.1 x 10^-9 with raised digits.
[[nodiscard]] inline std::string power_of_ten(double value) {
    if (std::abs(value) >= 1e-3 || value == 0) return significant(value, 2);
    const std::string text = exponential(value);  // d.de-dd
    static constexpr std::string_view raised[] = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
    std::string exponent = text.substr(5);
    exponent.erase(0, exponent.find_first_not_of('0'));
    std::string result = text.substr(0, 3) + " × 10⁻";
    for (const char digit : exponent) result += raised[digit - '0'];
    return result;
}

/// `text`, escaped for XML and HTML.
[[nodiscard]] inline std::string escaped(std::string_view text) {
    std::string safe;
    for (const char c : text) {
        switch (c) {
            case '<': safe += "&lt;"; break;
            case '>': safe += "&gt;"; break;
            case '&': safe += "&amp;"; break;
            default: safe += c;
        }
    }
    return safe;
}

/// Writes a file. @throws std::runtime_error if it cannot
inline void save(const std::filesystem::path& file, const std::string& text,
                 std::ios::openmode mode = std::ios::trunc) {
    std::ofstream stream(file, mode);
    if (!(stream << text << std::flush)) throw std::runtime_error("cannot write " + file.string());
}

}  // namespace examples
