// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "support/svg.hpp"

/// Curves over time, one panel above the other on one time axis, with the phases of an experiment as bands.
///
///     Plot plot{.title = "Sphere, 642 vertices", .phases = {{"press", 0.1, 0.4}}};
///     plot.panels = {{"force [mN]", {{.name = "felt", .colour = "#12507b", .samples = {{0.1, 0.0}, {0.4, 3.2}}}}}};
///     std::ofstream("plot.svg") << drawn(plot);
namespace examples {

struct Sample {
    double time;  ///< [s]
    double value;
};

struct Curve {
    std::string name;  ///< In the legend.
    std::string colour;
    bool dashed = false;
    std::vector<Sample> samples = {};
    bool dots = false;  ///< In place of a line.
};

struct PlotPanel {
    std::string label;  ///< Quantity and unit.
    std::vector<Curve> curves;
};

struct Phase {
    std::string name;
    double begin, end;  ///< [s]
};

struct Plot {
    std::string title;
    std::vector<Phase> phases;  ///< At min_distance one; together they are the time axis.
    std::vector<PlotPanel> panels = {};
    std::string axis = "time [s]";  ///< Or another quantity, which then replaces time everywhere.
};

namespace detail {

/// 1, 2 or 5 times a power of ten: at most `count` such steps cover `range`.
inline double round_step(double range, int count) {
    const double min_distance = range / count, power = std::pow(10, std::floor(std::log10(min_distance)));
    for (const double factor : {1.0, 2.0, 5.0}) {
        if (factor * power >= 0.999 * min_distance) return factor * power;
    }
    return 10 * power;
}

/// A rectangle of the drawing, and the times and values at its borders.
struct Axes {
    double left, top, width, height;
    double begin, end, low, high;

    [[nodiscard]] Pixel at(const Sample& sample) const {
        return {left + width * (sample.time - begin) / (end - begin),
                top + height * (high - sample.value) / (high - low)};
    }
    [[nodiscard]] double right() const { return left + width; }
    [[nodiscard]] double bottom() const { return top + height; }
};

/// Pixels of the samples: of those that share a column of pixels, the first, the lowest, the highest and the last.
inline std::vector<Pixel> pixels(const Axes& axes, const std::vector<Sample>& samples) {
    const auto column = [&](const Sample& sample) { return std::floor(axes.at(sample).x); };
    std::vector<Pixel> result;
    for (auto next = samples.begin(); next != samples.end();) {
        const auto first = next;
        next = std::find_if(first, samples.end(), [&](const Sample& s) { return column(s) != column(*first); });
        const auto [low, high] = std::minmax_element(
            first, next, [](const Sample& one, const Sample& other) { return one.value < other.value; });
        for (auto sample = first; sample != next; ++sample) {
            if (sample == first || sample == low || sample == high || sample == next - 1) {
                result.push_back(axes.at(*sample));
            }
        }
    }
    return result;
}

/// The curve as a path, without invisible samples.
inline std::string path(const Axes& axes, const Curve& curve) {
    constexpr double min_distance = 0.6;  // [px]
    std::string d;
    Pixel last;
    for (const Pixel& p : pixels(axes, curve.samples)) {
        if (!d.empty() && std::hypot(p.x - last.x, p.y - last.y) < min_distance) continue;
        d += (d.empty() ? 'M' : 'L') + number(p.x) + ' ' + number(p.y);
        last = p;
    }
    return d;
}

inline std::string pen(const Curve& curve) {
    return "fill='none' stroke='" + curve.colour + "' stroke-width='1.6' stroke-linejoin='round'" +
           (curve.dashed ? " stroke-dasharray='5 3'" : "");
}

inline void draw_dot(Svg& svg, Pixel at, const Curve& curve) {
    svg.add("<circle cx='", at.x, "' cy='", at.y, "' r='3.5' fill='", curve.colour, "'/>\n");
}

inline void draw_curve(Svg& svg, const Axes& axes, const Curve& curve) {
    if (!curve.dots) return svg.add("<path d='", path(axes, curve), "' ", pen(curve), "/>\n");
    for (const Sample& sample : curve.samples) draw_dot(svg, axes.at(sample), curve);
}

/// From a round value below all samples to one above; zero always shows.
inline void fit_values(Axes& axes, const PlotPanel& panel) {
    double low = 0, high = 0;
    for (const Curve& curve : panel.curves) {
        for (const Sample& sample : curve.samples) {
            low = std::min(low, sample.value);
            high = std::max(high, sample.value);
        }
    }
    const double step = round_step(high > low ? high - low : 1, 5);
    axes.low = step * std::floor(low / step);
    axes.high = std::max(axes.low + step, step * std::ceil(high / step));
}

inline void draw_values(Svg& svg, const Axes& axes, const std::string& label) {
    const double step = round_step(axes.high - axes.low, 5);
    for (double value = axes.low; value < axes.high + step / 2; value += step) {
        const Pixel p = axes.at({axes.begin, value});
        svg.line(p, {axes.right(), p.y}, "stroke='#000' stroke-opacity='.09'");
        svg.text({p.x - 7, p.y + 4}, number(value, 3), {.size = 11, .colour = "#555", .anchor = "end"});
    }
    svg.line({axes.left, axes.bottom()}, {axes.right(), axes.bottom()}, "stroke='#333'");
    svg.text({axes.left - 46, axes.top + axes.height / 2}, label, {.size = 12, .anchor = "middle", .upright = true});
}

inline void draw_times(Svg& svg, const Axes& axes, const std::string& label) {
    const double step = round_step(axes.end - axes.begin, 10);
    for (double time = step * std::ceil(axes.begin / step - 1e-9); time < axes.end + 1e-3 * step; time += step) {
        const Pixel p = axes.at({time, axes.low});
        svg.line(p, {p.x, p.y + 5}, "stroke='#333'");
        svg.text({p.x, p.y + 18}, number(time, 3), {.size = 11, .colour = "#555", .anchor = "middle"});
    }
    svg.text({axes.left + axes.width / 2, axes.bottom() + 36}, label, {.size = 12, .anchor = "middle"});
}

/// Every second phase is shaded, over all panels.
inline void draw_phases(Svg& svg, const Axes& axes, const std::vector<Phase>& phases) {
    for (std::size_t i = 0; i < phases.size(); ++i) {
        const Pixel from = axes.at({phases[i].begin, axes.high}), to = axes.at({phases[i].end, axes.low});
        if (i % 2 == 1) svg.rectangle(from, to.x - from.x, to.y - from.y, "fill='#f2f4f6'");
        svg.text({(from.x + to.x) / 2, axes.top - 8}, phases[i].name,
                 {.size = 11, .colour = "#666", .anchor = "middle"});
    }
}

inline void draw_legend(Svg& svg, const Axes& axes, const PlotPanel& panel) {
    double y = axes.top + 12;
    for (const Curve& curve : panel.curves) {
        curve.dots ? draw_dot(svg, {axes.right() + 27, y}, curve)
                   : svg.line({axes.right() + 16, y}, {axes.right() + 38, y}, pen(curve));
        svg.text({axes.right() + 44, y + 4}, curve.name, {.size = 11});
        y += 18;
    }
}

inline constexpr double plot_head = 62, panel_height = 150, panel_gap = 18, plot_foot = 46;

inline double height_of(const Plot& plot) {
    return plot_head + static_cast<double>(plot.panels.size()) * (panel_height + panel_gap) - panel_gap + plot_foot;
}

inline void draw_plot(Svg& svg, const Plot& plot, double left, double top, double width) {
    svg.text({left, top + 22}, plot.title, {.size = 14, .bold = true});
    const double panels_height = height_of(plot) - plot_head - plot_foot;
    Axes axes{left, top + plot_head, width, panels_height, plot.phases.front().begin, plot.phases.back().end, 0, 1};
    draw_phases(svg, axes, plot.phases);
    axes.height = panel_height;
    for (const PlotPanel& panel : plot.panels) {
        fit_values(axes, panel);
        draw_values(svg, axes, panel.label);
        for (const Curve& curve : panel.curves) draw_curve(svg, axes, curve);
        draw_legend(svg, axes, panel);
        if (&panel == &plot.panels.back()) draw_times(svg, axes, plot.axis);
        axes.top += panel_height + panel_gap;
    }
}

}  // namespace detail

/// The plots as one SVG, one below the other.
[[nodiscard]] inline std::string drawn(const std::vector<Plot>& plots) {
    constexpr double left = 66, width = 620, legend = 240;
    double height = 0;
    for (const Plot& plot : plots) height += detail::height_of(plot);
    Svg svg(left + width + legend, height, plots.front().title);
    double top = 0;
    for (const Plot& plot : plots) {
        detail::draw_plot(svg, plot, left, top, width);
        top += detail::height_of(plot);
    }
    return svg.str();
}

[[nodiscard]] inline std::string drawn(const Plot& plot) { return drawn(std::vector<Plot>{plot}); }

}  // namespace examples
