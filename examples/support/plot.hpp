// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/text.hpp"

/// Curves, drawn by gnuplot.
///
///     const Curve force{{0.1, 0.0}, {0.4, 3.2}};                               // [s], [mN]
///     std::puts(plot("pictures/slide", {force}, "slide").c_str());             // by support/slide.gnuplot
namespace examples {

struct Sample {
    double x, y;
};

using Curve = std::vector<Sample>;

/// A part of an experiment.
struct Phase {
    std::string name;
    double begin, end;  ///< [s]
};

/// Of the samples in each of 600 columns, the first, the lowest, the highest and the last; x must not decrease.
[[nodiscard]] inline Curve thinned(const Curve& curve) {
    if (curve.empty()) return curve;
    const double width = (curve.back().x - curve.front().x) / 600;
    const auto column = [&](const Sample& sample) { return std::floor((sample.x - curve.front().x) / width); };
    Curve result;
    for (auto next = curve.begin(); next != curve.end();) {
        const auto first = next;
        next = std::find_if(first + 1, curve.end(), [&](const Sample& s) { return column(s) != column(*first); });
        const auto [low, high] =
            std::minmax_element(first, next, [](const Sample& a, const Sample& b) { return a.y < b.y; });
        for (auto sample = first; sample != next; ++sample) {
            if (sample == first || sample == low || sample == high || sample == next - 1) result.push_back(*sample);
        }
    }
    return result;
}

/// Writes the curves to `file`.dat, a block each, and lets support/`script`.gnuplot draw them in `file`.svg, with
/// `settings` before. Returns where the picture is, or that gnuplot is missing and where the data are.
/// @throws std::runtime_error if a file cannot be written, or gnuplot fails
[[nodiscard]] inline std::string plot(const std::filesystem::path& file, const std::vector<Curve>& curves,
                                      const std::string& script, const std::string& settings = "") {
    std::ostringstream rows;
    rows.precision(9);
    for (const Curve& curve : curves) {
        rows << "# x y\n";
        for (const Sample& sample : thinned(curve)) rows << sample.x << ' ' << sample.y << '\n';
        rows << (curve.empty() ? "0 0\n\n\n" : "\n\n");  // gnuplot refuses a block without rows
    }
    const std::string data = file.string() + ".dat", picture = file.string() + ".svg";
    save(data, rows.str());
    if (std::system("command -v gnuplot > /dev/null") != 0) return "no picture, gnuplot is missing; data: " + data;

    const auto quoted = [](std::string text) {
        for (std::size_t at = 0; (at = text.find('\'', at)) != text.npos; at += 2) text.insert(at, 1, '\'');
        return "'" + text + "'\n";
    };
    FILE* gnuplot = popen("LC_ALL=C.UTF-8 gnuplot", "w");  // others may have no degree sign
    if (gnuplot == nullptr) throw std::runtime_error("cannot run gnuplot");
    const auto load = [&](const std::string& name) {
        return "load " + quoted(MEMBRANE_EXAMPLE_DATA "/../support/" + name + ".gnuplot");
    };
    const std::string commands =
        "data = " + quoted(data) + "picture = " + quoted(picture) + load("style") + settings + load(script);
    std::fputs(commands.c_str(), gnuplot);
    if (pclose(gnuplot) != 0) throw std::runtime_error("gnuplot cannot draw " + data);

    std::ifstream drawn(picture);
    std::string svg{std::istreambuf_iterator<char>(drawn), std::istreambuf_iterator<char>()};
    svg.erase(0, svg.find("<svg"));  // so that it can stand in a page
    svg.erase(svg.rfind("</svg>") + 6);
    save(picture, svg + '\n');
    return "picture: " + picture;
}

}  // namespace examples
