// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <concepts>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <string_view>

/// Text of an SVG drawing, as short as it can be: one decimal, no style sheet, so that drawings can stand in one HTML
/// page without touching each other.
///
///     Svg svg(200, 100, "Force over time");
///     svg.add("<circle cx='", 3.5, "' cy='", 20, "' r='", radius, "'/>\n");
///     svg.text({100, 60}, "0.12 N", {.size = 12, .anchor = "middle"});
///     save("force.svg", svg.str());
namespace examples {

/// A position on the drawing, y downwards [px].
struct Pixel {
    double x = 0, y = 0;
};

/// `value` with at most `decimals` digits behind the point and no zeros at the end.
[[nodiscard]] inline std::string number(double value, int decimals = 1) {
    char digits[64];
    std::snprintf(digits, sizeof digits, "%.*f", decimals, value);
    std::string text = digits;
    if (text.find('.') != std::string::npos) {
        text.erase(text.find_last_not_of('0') + 1);
        if (text.back() == '.') text.pop_back();
    }
    return text == "-0" ? "0" : text;
}

/// `value` with so many significant `digits` and no exponent: 0.0123, 4.57, 1230.
[[nodiscard]] inline std::string significant(double value, int digits = 3) {
    const int magnitude = value == 0 ? 0 : static_cast<int>(std::floor(std::log10(std::abs(value))));
    char text[64];
    std::snprintf(text, sizeof text, "%.*f", magnitude >= digits - 1 ? 0 : digits - 1 - magnitude, value);
    return text;
}

/// `value` in words of powers of ten where it is small: 0.25, 1.1 x 10^-9 with raised digits.
[[nodiscard]] inline std::string power_of_ten(double value) {
    if (std::abs(value) >= 1e-3 || value == 0) return significant(value, 2);
    char text[32];
    std::snprintf(text, sizeof text, "%.1e", value);  // d.de-dd
    static constexpr std::string_view raised[] = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
    std::string exponent = std::string(std::string_view(text).substr(5));
    exponent.erase(0, exponent.find_first_not_of('0'));
    std::string result = std::string(text, 3) + " × 10⁻";
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

struct TextStyle {
    double size = 12;  ///< [px]
    std::string_view colour = "#333";
    std::string_view anchor = "start";  ///< Or "middle", "end".
    bool bold = false;
    bool halo = false;  ///< A white border, to be read over a picture.
};

class Svg {
  public:
    Svg(double width, double height, std::string_view title) : width_(width), height_(height), title_(title) {}

    /// Adds markup, strings as they are and numbers and pixels with one decimal.
    template <class... Parts>
    void add(const Parts&... parts) {
        (append(parts), ...);
    }

    void line(Pixel from, Pixel to, std::string_view attributes) {
        add("<path d='M", from, "L", to, "' ", attributes, "/>\n");
    }

    void rectangle(Pixel corner, double width, double height, std::string_view attributes) {
        add("<rect x='", corner.x, "' y='", corner.y, "' width='", width, "' height='", height, "' ", attributes,
            "/>\n");
    }

    void text(Pixel where, std::string_view words, const TextStyle& style = {}) {
        add("<text x='", where.x, "' y='", where.y, "' font-size='", style.size, "' fill='", style.colour, "'");
        if (style.anchor != "start") add(" text-anchor='", style.anchor, "'");
        if (style.bold) add(" font-weight='bold'");
        if (style.halo) add(" stroke='#fff' stroke-width='3.5' stroke-linejoin='round' paint-order='stroke'");
        add(">", escaped(words), "</text>\n");
    }

    /// The whole drawing, on white.
    [[nodiscard]] std::string str() const {
        Svg whole(width_, height_, title_);
        whole.add("<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 ", width_, " ", height_, "' width='", width_,
                  "' height='", height_, "' font-family='Helvetica,Arial,Liberation Sans,sans-serif' role='img'>\n",
                  "<title>", escaped(title_), "</title>\n<rect width='100%' height='100%' fill='#fff'/>\n", body_,
                  "</svg>\n");
        return whole.body_;
    }

  private:
    void append(std::string_view text) { body_ += text; }
    void append(Pixel p) { add(p.x, " ", p.y); }
    template <class Number>
        requires std::floating_point<Number> || std::integral<Number>
    void append(Number value) { body_ += number(static_cast<double>(value)); }

    double width_, height_;
    std::string title_, body_;
};

/// Writes a file. @throws std::runtime_error if it cannot
inline void save(const std::filesystem::path& file, const std::string& text) {
    std::ofstream stream(file);
    if (!(stream << text << std::flush)) throw std::runtime_error("cannot write " + file.string());
}

}  // namespace examples
