// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "support/camera.hpp"
#include "support/picture.hpp"
#include "support/section.hpp"
#include "support/svg.hpp"

namespace examples {

/// One picture of a figure, with a title above and a smaller note under that.
struct Panel {
    std::string title, note;
    Picture picture;
};

/// Pictures side by side with one camera, scale and range of colours.
struct Figure {
    std::string name;   ///< Short, unique on a page.
    std::string title;  ///< For screen readers.
    std::vector<Panel> panels = {};
    Camera::Options camera;  ///< Its `middle` is set for each panel.
    std::size_t columns = 3;
    double cell_width = 300, cell_height = 240;  ///< Of one picture [px].
    double headroom = 0;                         ///< Above each picture, for the tool [px].
    double section_height = 0;                   ///< Of the cut through the tool under each picture [px]; 0: none.
};

/// The figure as SVG.
[[nodiscard]] inline std::string drawn(const Figure& figure) {
    constexpr double foot = 46, magnified = 2;
    const double head = 46 + figure.headroom;
    const double section = figure.section_height > 0 ? figure.section_height + 24 : 0;
    const auto cells = [](std::size_t count, double size) { return static_cast<double>(count) * size; };
    const std::size_t rows = (figure.panels.size() + figure.columns - 1) / figure.columns;
    const double width = cells(figure.columns, figure.cell_width);
    const double height = cells(rows, head + figure.cell_height + section) + foot;
    Svg svg(width, height, figure.title);
    Camera::Options camera = figure.camera;
    for (std::size_t i = 0; i < figure.panels.size(); ++i) {
        const Panel& panel = figure.panels[i];
        const double left = cells(i % figure.columns, figure.cell_width);
        const double top = cells(i / figure.columns, head + figure.cell_height + section);
        const std::string letter(1, static_cast<char>('a' + i));
        camera.middle = {left + figure.cell_width / 2, top + head + figure.cell_height / 2};
        draw(svg, Camera(camera), panel.picture, figure.name + letter);
        if (section > 0) {
            const Pixel corner{left + 20, top + head + figure.cell_height + 14};
            draw_section(svg, Camera(camera), panel.picture, corner, figure.cell_width - 40, figure.section_height,
                         magnified * camera.metre, figure.name + letter);
            svg.text({corner.x + 8, corner.y + 16}, "section, x 2", {.size = 10, .colour = "#666"});
        }
        svg.text({left + 14, top + 24}, letter, {.size = 15, .colour = "#111", .bold = true});
        svg.text({left + 32, top + 24}, panel.title, {.size = 14, .colour = "#111"});
        svg.text({left + 32, top + 40}, panel.note, {.size = 11, .colour = "#666"});
    }
    draw_scale_bar(svg, Camera(camera), {16, height - 14}, 0.3 * figure.cell_width);
    draw_colour_bar(svg, {width - 196, height - 22}, 130, figure.panels.front().picture.colours, figure.name);
    return svg.str();
}

}  // namespace examples
