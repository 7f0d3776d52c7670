// SPDX-License-Identifier: MIT
#pragma once

#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "support/figure.hpp"
#include "support/film.hpp"
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

/// The run with volume springs, moving.
[[nodiscard]] inline Drawing moving(const Outcome& outcome) {
    return {outcome.scene.key + "_moving",
            "The " + outcome.scene.name + ", pressed, let go, grasped and pulled. The tool is transparent.",
            film(outcome.scene, outcome.with)};
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

/// Force [mN] and depth [mm] over time: felt, reaction, reaction without volume springs, depth, pulled.
[[nodiscard]] inline std::vector<Curve> curves(const Outcome& outcome) {
    std::vector<Curve> result(5);
    for (const Frame& frame : outcome.with.frames) {
        const double now = frame.tool.time;
        result[0].push_back({now, 1e3 * frame.felt.norm()});
        result[1].push_back({now, 1e3 * frame.reaction.norm()});
        result[3].push_back({now, 1e3 * frame.depth});
        result[4].push_back({now, 1e3 * frame.pulled});
    }
    for (const Frame& frame : outcome.without.frames) {
        result[2].push_back({frame.tool.time, 1e3 * frame.reaction.norm()});
    }
    return result;
}

inline constexpr const char* force_caption =
    "Force and depth over time. Felt is the paper's formula, a function of depth and velocity alone; the reaction is "
    "the "
    "force of the membrane on the tool.";

/// For gnuplot: the name of the scene, and the phases as labels, every second one shaded.
[[nodiscard]] inline std::string settings(const Outcome& outcome) {
    std::ostringstream text;
    text << "name = '" << outcome.scene.name << "'\n";
    bool shaded = false;
    for (const Phase& phase : outcome.with.phases) {
        text << "set label '" << phase.name << "' at " << (phase.begin + phase.end) / 2
             << ", graph 1.06 center font ',11' tc '#666666'\n";
        if (shaded) {
            text << "set object rectangle from " << phase.begin << ", graph 0 to " << phase.end
                 << ", graph 1 behind fc '#f2f4f6' fs solid noborder\n";
        }
        shaded = !shaded;
    }
    text << "set xrange [" << outcome.with.phases.front().begin << ':' << outcome.with.phases.back().end << "]\n";
    return text.str();
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
