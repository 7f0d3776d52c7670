// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "support/text.hpp"

namespace examples {

/// Rows of text, numbers to the right; the first row names the columns.
using Table = std::vector<std::vector<std::string>>;

/// One self-contained HTML page: drawings are inline.
///
///     Page page("Press and pull");
///     page.paragraph("Sphere, 642 vertices");
///     page.figure(svg.str(), "Figure 4. At rest, pressed, pulled.");
///     std::ofstream("index.html") << page.str();
class Page {
  public:
    explicit Page(std::string_view title) : title_(escaped(title)) {}

    void paragraph(std::string_view text) { body_ += "<p>" + escaped(text) + "</p>\n"; }

    void figure(std::string_view svg, std::string_view caption) {
        body_ += "<figure>\n" + std::string(svg) + "<figcaption>" + escaped(caption) + "</figcaption>\n</figure>\n";
    }

    void table(const Table& rows, std::string_view caption) {
        body_ += "<div class=\"table\"><table>\n<caption>" + escaped(caption) + "</caption>\n";
        for (std::size_t i = 0; i < rows.size(); ++i) {
            const std::string cell = i == 0 ? "th" : "td";
            body_ += "<tr>";
            for (const auto& text : rows[i]) body_ += '<' + cell + '>' + escaped(text) + "</" + cell + '>';
            body_ += "</tr>\n";
        }
        body_ += "</table></div>\n";
    }

    [[nodiscard]] std::string str() const {
        return "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
               "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>" +
               title_ + "</title>\n<style>\n" + std::string(style) + "</style>\n</head>\n<body>\n<h1>" + title_ +
               "</h1>\n" + body_ + "</body>\n</html>\n";
    }

  private:
    static constexpr std::string_view style = R"(body { max-width: 60rem; margin: 2.5rem auto; padding: 0 1.2rem;
  font: 1rem/1.55 Helvetica, Arial, "Liberation Sans", sans-serif; color: #222; background: #fff; }
p, caption, figcaption { max-width: 46rem; }
figure { margin: 1.4rem 0 2rem; }
figure svg { max-width: 100%; height: auto; display: block; }
figcaption, caption { color: #555; font-size: .9rem; text-align: left; margin-bottom: .5rem; }
.table { overflow-x: auto; margin: 1.2rem 0; }
table { border-collapse: collapse; font-size: .88rem; font-variant-numeric: tabular-nums; }
th, td { text-align: right; padding: .3rem .7rem; border-bottom: 1px solid #ddd; white-space: nowrap; }
th { vertical-align: bottom; white-space: normal; }
th:first-child, td:first-child { text-align: left; padding-left: 0; white-space: nowrap; }
)";

    std::string title_, body_;
};

}  // namespace examples
