// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "support/figure.hpp"
#include "support/page.hpp"
#include "support/plot.hpp"
#include "support/record.hpp"
#include "support/report.hpp"
#include "support/scenes.hpp"

/// The pictures of `press_and_pull`: the paper's figures 3 to 5, force and depth over time, and a page with all of
/// them.
namespace examples {

/// A drawing with its caption and its file's name without ".svg".
struct Drawing {
    std::string name, caption, svg;
};

namespace detail {

inline Picture picture(const Scene& scene, const Snapshot& snapshot) {
    return {.mesh = scene.mesh,
            .points = snapshot.points,
            .colours = {.high = scene.depth},
            .tool = snapshot.frame.tool,
            .force = snapshot.frame.reaction};
}

inline std::string millimetres(double metres) { return significant(1e3 * metres) + " mm"; }

inline std::string after_figure(const std::string& number) {
    return number.empty() ? "" : "As in figure " + number + " of [Liu07]. ";
}

}  // namespace detail

/// At rest, pressed, pulled: figures 3 and 4 of the paper.
[[nodiscard]] inline Drawing pressed_and_pulled(const Outcome& outcome) {
    const auto& [scene, with, without] = outcome;
    const Snapshot rest{scene.mesh.positions(), with.frames.front()};
    const Snapshot &pressed = with.snapshots[press_in], &pulled = with.snapshots[pull_out];
    const std::string size = std::to_string(scene.mesh.vertex_count()) + " vertices, " +
                             std::to_string(scene.mesh.triangle_count()) + " triangles";
    Figure figure{
        .name = scene.key,
        .title = scene.name + ": at rest, pressed, pulled",
        .panels = {{"At rest", size, detail::picture(scene, rest)},
                   {"Pressed", detail::millimetres(pressed.frame.depth) + " deep", detail::picture(scene, pressed)},
                   {"Grasped and pulled", "by " + detail::millimetres(pulled.frame.pulled),
                    detail::picture(scene, pulled)}},
        .camera = scene.camera,
        .cell_height = scene.picture_height,
        .headroom = 56,
        .section_height = 120};
    const double arrow = 0.6 * scene.radius / peak(with, &Frame::reaction);
    for (Panel& panel : figure.panels) panel.picture.arrow = arrow;
    const std::string name = (scene.paper_figure.empty() ? "" : "figure_" + scene.paper_figure + "_") + scene.key;
    return {name,
            detail::after_figure(scene.paper_figure) + "The " + scene.name +
                ": at rest (a), pressed by the tool (b), grasped and pulled by it (c), with virtual volume springs. "
                "Arrows: force of the membrane on the tool. Sections through the tool: dashed the membrane at rest.",
            drawn(figure)};
}

/// After press and after pull, without and with volume springs: figure 5 of the paper.
[[nodiscard]] inline Drawing recovered(const Outcome& outcome) {
    const auto& [scene, with, without] = outcome;
    Figure figure{.name = scene.key + "_recovered",
                  .title = scene.name + ": recovered from press and pull",
                  .camera = scene.camera_after,
                  .columns = 2,
                  .cell_height = scene.picture_height};
    for (const Record* record : {&without, &with}) {
        for (const Step step : {recover, recover_again}) {
            Panel panel{step == recover ? "After the press, " : "After the pull, ",
                        power_of_ten(shape_error(scene, *record, step)) + " of the radius: shape error",
                        detail::picture(scene, record->snapshots[step])};
            panel.title += record == &with ? "with volume springs" : "without volume springs";
            panel.picture.tool.reset();
            figure.panels.push_back(std::move(panel));
        }
    }
    return {(scene.paper_figure.empty() ? "" : "figure_5_") + scene.key + "_recovered",
            detail::after_figure(scene.paper_figure.empty() ? "" : "5") + "The " + scene.name +
                ", let go: after the press (a, c) and after the pull (b, d), without virtual volume springs (a, b) as "
                "in the paper, and with them (c, d). Shape error: the largest distance, rigid drift removed.",
            drawn(figure)};
}

/// Force and depth over time.
[[nodiscard]] inline Drawing over_time(const Outcome& outcome) {
    const auto& [scene, with, without] = outcome;
    Curve felt{.name = "felt, -k x - \u03bc v", .colour = "#8a8f94"};
    Curve reaction{.name = "reaction", .colour = "#12507b"};
    Curve loose{.name = "reaction without volume springs", .colour = "#d0532f", .dashed = true};
    Curve depth{.name = "depth of the tool", .colour = "#333"};
    Curve pulled{.name = "displacement of the held point", .colour = "#7a4ea3"};
    for (const Frame& frame : with.frames) {
        felt.samples.push_back({frame.tool.time, 1e3 * frame.felt.norm()});
        reaction.samples.push_back({frame.tool.time, 1e3 * frame.reaction.norm()});
        depth.samples.push_back({frame.tool.time, 1e3 * frame.depth});
        pulled.samples.push_back({frame.tool.time, 1e3 * frame.pulled});
    }
    for (const Frame& frame : without.frames) {
        loose.samples.push_back({frame.tool.time, 1e3 * frame.reaction.norm()});
    }
    const Plot plot{.title = "Force and depth, " + scene.name,
                    .phases = with.phases,
                    .panels = {{"force [mN]", {felt, reaction, loose}}, {"depth [mm]", {depth, pulled}}}};
    return {scene.key + "_force",
            "Force and depth over time. Felt is the paper's formula, a function of depth and velocity alone; the "
            "reaction is the force of the membrane on the tool.",
            drawn(plot)};
}

/// Tables and drawings on one page.
[[nodiscard]] inline std::string page(const std::vector<Outcome>& outcomes, const std::vector<Drawing>& drawings,
                                      membrane::Index layers) {
    Page page("Press and pull a membrane");
    const Scene& scene = outcomes.front().scene;
    page.paragraph(
        "A sphere presses a membrane, slides, lets go, grasps it, pulls and lets go; with virtual volume springs under "
        "the membrane, and without, where the pull starts from the rest shape. Springs of " +
        number(scene.stiffness) + " N/m along the edges, volume springs of " + number(scene.foundation_stiffness) +
        " N/m with " + number(scene.foundation_damping, 3) + " N s/m, one tick a millisecond.");
    page.table(speed_table(outcomes, layers), speed_note());
    page.table(force_table(outcomes), force_note());
    for (const Drawing& drawing : drawings) page.figure(drawing.svg, drawing.caption);
    page.paragraph(
        "[Liu07] B. Liu, B.-L. Wang, J.-Z. Xie: Research on the Technology of Virtual Surgery Simulation for "
        "Biomembrane Tissue. China Digital Medicine 2 (11), 37-40, 2007.");
    return page.str();
}

}  // namespace examples
