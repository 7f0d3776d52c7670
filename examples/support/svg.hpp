// SPDX-License-Identifier: MIT
#pragma once

#include <concepts>
#include <string>
#include <string_view>

#include "support/text.hpp"

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

}  // namespace examples
