// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include <membrane/surface/normals.hpp>
#include <membrane/surface/triangle.hpp>

#include "support/picture.hpp"
#include "support/record.hpp"
#include "support/scenes.hpp"

/// A run as a drawing that moves, for browsers: the membrane under a transparent tool, its section along the motion of
/// the tool, and the force over time.
namespace examples {

namespace detail {

/// Rounded; a path of such numbers is short.
inline std::string whole(double pixels) { return number(pixels, 0); }

/// The cut of a star-shaped surface around the origin by the plane of two unit vectors: distances from the origin in
/// these directions [rad], from `up` toward `right`.
inline std::vector<double> radii(const membrane::Points<double>& x, const membrane::Triangles& triangles,
                                 const Vector3d& right, const Vector3d& up, const std::vector<double>& directions) {
    std::vector<double> result(directions.size());
    const Vector3d normal = right.cross(up);
    for (const auto& corners : triangles.colwise()) {
        std::vector<Eigen::Vector2d> ends;
        for (Eigen::Index k = 0; k < 3; ++k) {
            const Vector3d a = x.col(corners[k]), b = x.col(corners[(k + 1) % 3]);
            const double before = a.dot(normal), after = b.dot(normal);
            if ((before < 0) == (after < 0)) continue;
            const Vector3d crossing = a + before / (before - after) * (b - a);
            ends.emplace_back(crossing.dot(right), crossing.dot(up));
        }
        for (std::size_t i = 0; i < directions.size() && ends.size() == 2; ++i) {
            const Eigen::Vector2d ray{std::sin(directions[i]), std::cos(directions[i])}, across{-ray.y(), ray.x()};
            const double first = ends[0].dot(across), second = ends[1].dot(across);
            if ((first < 0) == (second < 0)) continue;
            result[i] = std::max(result[i], (ends[0] + first / (first - second) * (ends[1] - ends[0])).dot(ray));
        }
    }
    return result;
}

/// The states of a run at equal distances in time, drawn as SVG animations that repeat.
class Film {
  public:
    static constexpr double slower = 4;  ///< than the run

    Film(const Scene& scene, const Record& record) : scene_(scene), record_(record) {
        auto normals = membrane::VertexNormals(scene.mesh);
        for (const Snapshot& state : record.film) {
            pictures_.push_back({.mesh = scene.mesh,
                                 .points = state.points,
                                 .colours = {.high = scene.depth},
                                 .tool = state.frame.tool,
                                 .force = state.frame.reaction});
            normals.update(state.points);
            normals_.push_back(normals.values());
        }
    }

    void draw_membrane(Svg& svg, Pixel middle, double metre) const;
    void draw_section(Svg& svg, Pixel corner, double width, double height, double metre) const;
    void draw_force(Svg& svg, Pixel corner, double width, double height) const;

  private:
    struct Attribute {
        std::string_view name;
        std::vector<std::string> values;  // at each state
    };
    template <class Value>
    [[nodiscard]] Attribute attribute(std::string_view name, Value value) const {
        Attribute result{name, {}};
        for (const Picture& picture : pictures_) result.values.push_back(value(picture));
        return result;
    }
    void add(Svg& svg, std::string_view shape, std::string_view style,
             std::initializer_list<Attribute> attributes) const;
    [[nodiscard]] double end() const { return pictures_.back().tool->time; }

    const Scene& scene_;
    const Record& record_;
    std::vector<Picture> pictures_ = {};
    std::vector<membrane::Points<double>> normals_ = {};
};

/// A shape. A value that is that of the states before and after is left out, and an attribute that never changes is not
/// animated.
inline void Film::add(Svg& svg, std::string_view shape, std::string_view style,
                      std::initializer_list<Attribute> attributes) const {
    svg.add("<", shape, " ", style);
    for (const auto& [name, values] : attributes) svg.add(" ", name, "='", values.front(), "'");
    svg.add(">");
    for (const auto& [name, values] : attributes) {
        const std::size_t last = values.size() - 1;
        std::string times, kept;
        for (std::size_t i = 0; i <= last; ++i) {
            const bool needed = i == 0 || i == last || values[i] != values[i - 1] || values[i] != values[i + 1];
            if (!needed) continue;
            const char* const separator = i == 0 ? "" : ";";
            (times += separator) += number(static_cast<double>(i) / static_cast<double>(last), 3);
            (kept += separator) += values[i];
        }
        if (std::count(values.begin(), values.end(), values.front()) == std::ssize(values)) continue;
        svg.add("<animate attributeName='", name, "' dur='", slower * end(), "s' repeatCount='indefinite' keyTimes='",
                times, "' values='", kept, "'/>");
    }
    svg.add("</", shape, ">\n");
}

// In quarters of a pixel. Triangles that face away all the time are left out; those farthest on average come first.
inline void Film::draw_membrane(Svg& svg, Pixel middle, double metre) const {
    constexpr double per_pixel = 4;
    auto options = scene_.film_camera;
    options.middle = {per_pixel * middle.x, per_pixel * middle.y};
    options.metre = per_pixel * metre;
    const Camera camera(options);
    struct Seen {
        membrane::Index triangle;
        double distance = 0;
        bool outside = false, moves = false;
    };
    std::vector<Seen> facets;
    const auto& triangles = scene_.mesh.triangles();
    for (membrane::Index f = 0; f < scene_.mesh.triangle_count(); ++f) {
        Seen facet{f};
        for (const Picture& picture : pictures_) {
            const auto at = membrane::triangle_at(picture.points, triangles.col(f));
            facet.outside = facet.outside || membrane::area_vector(at).dot(camera.eye() - at.a) > 0;
            facet.distance += (camera.eye() - (at.a + at.b + at.c) / 3).norm();
            for (const auto v : triangles.col(f)) {
                const double displacement = (picture.points.col(v) - scene_.mesh.positions().col(v)).norm();
                facet.moves = facet.moves || displacement * metre > 1;  // [px]
            }
        }
        if (facet.outside) facets.push_back(facet);
    }
    std::sort(facets.begin(), facets.end(), [](const Seen& a, const Seen& b) { return a.distance > b.distance; });
    svg.add(
        "<g transform='scale(.25)' stroke='#7a3e36' stroke-opacity='.38' stroke-width='2' "
        "stroke-linejoin='round'>\n");
    for (const Seen& facet : facets) {
        const auto path = [&](const Picture& picture) {
            std::array<Pixel, 3> corners;
            for (std::size_t k = 0; k < 3; ++k) {
                const auto v = triangles(static_cast<Eigen::Index>(k), facet.triangle);
                const Pixel at = camera.pixel(picture.points.col(v));
                corners[k] = {std::round(at.x), std::round(at.y)};
            }
            return std::string("M").append(outline(corners));
        };
        const auto colour = [&](const Picture& picture) {
            const auto& normals = normals_[static_cast<std::size_t>(&picture - pictures_.data())];
            return hex(facet_colour(camera, picture, {facet.triangle, false, true, 0}, normals));
        };
        if (facet.moves) {
            add(svg, "path", "", {attribute("d", path), attribute("fill", colour)});
        } else {
            svg.add("<path d='", path(pictures_.front()), "' fill='", colour(pictures_.front()), "'/>\n");
        }
    }
    add(svg, "circle", "fill='#8b99a6' fill-opacity='.3' stroke='#46525e' stroke-width='5' stroke-opacity='.9'",
        {attribute("cx", [&](const Picture& at) { return whole(camera.pixel(at.tool->position).x); }),
         attribute("cy", [&](const Picture& at) { return whole(camera.pixel(at.tool->position).y); }),
         attribute("r", [&](const Picture& at) { return whole(at.tool->radius * camera.scale(at.tool->position)); })});
    svg.add("</g>\n");
}

inline void Film::draw_section(Svg& svg, Pixel corner, double width, double height, double metre) const {
    const Vector3d up = (scene_.pressed + scene_.slid).normalized();
    const Vector3d along = scene_.slid - scene_.pressed, right = (along - up * up.dot(along)).normalized();
    const auto pixel = [&](double x, double y) {
        return Pixel{corner.x + width / 2 + metre * x, corner.y + 0.42 * height + metre * (scene_.radius - y)};
    };
    std::vector<double> directions;
    for (int i = -36; i <= 36; ++i) directions.push_back(i * 1.2 / 36);
    const auto profile = [&](const membrane::Points<double>& x) {
        std::string path;
        const auto distances = radii(x, scene_.mesh.triangles(), right, up, directions);
        for (std::size_t i = 0; i < directions.size(); ++i) {
            const Pixel p = pixel(distances[i] * std::sin(directions[i]), distances[i] * std::cos(directions[i]));
            path.append(i == 0 ? "M" : i == 1 ? "L" : " ").append(number(p.x)).append(" ").append(number(p.y));
        }
        return path;
    };
    const auto tool = [&](const Picture& at) { return pixel(at.tool->position.dot(right), at.tool->position.dot(up)); };
    svg.add("<clipPath id='", scene_.key, "-cut'>");
    svg.rectangle(corner, width, height, "rx='4'");
    svg.add("</clipPath>\n<g clip-path='url(#", scene_.key, "-cut)' fill='none' stroke-linecap='round'>\n");
    svg.rectangle(corner, width, height, "fill='#f7f8f9'");
    add(svg, "circle", "fill='#d5dce3' stroke='#46525e'",
        {attribute("cx", [&](const Picture& at) { return number(tool(at).x); }),
         attribute("cy", [&](const Picture& at) { return number(tool(at).y); }),
         attribute("r", [&](const Picture& at) { return number(metre * at.tool->radius); })});
    svg.add("<path d='", profile(scene_.mesh.positions()), "' stroke='#888' stroke-dasharray='3 3'/>\n");
    add(svg, "path", "stroke='#b03442' stroke-width='2'",
        {attribute("d", [&](const Picture& at) { return profile(at.points); })});
    svg.add("</g>\n");
}

inline void Film::draw_force(Svg& svg, Pixel corner, double width, double height) const {
    double largest = 0;
    for (const Frame& frame : record_.frames) largest = std::max(largest, frame.reaction.norm());
    const auto pixel = [&](double time, double force) {
        return Pixel{corner.x + width * time / end(), corner.y + height * (1 - force / (1.15 * largest))};
    };
    const auto at = [&](const Picture& picture) { return pixel(picture.tool->time, picture.force.norm()); };
    std::string curve;
    for (const Frame& frame : record_.frames) {
        if (frame.tool.time > end()) break;
        const Pixel p = pixel(frame.tool.time, frame.reaction.norm());
        curve.append(curve.empty() ? "M" : " ").append(number(p.x)).append(" ").append(number(p.y));
    }
    svg.line({corner.x, corner.y + height}, {corner.x + width, corner.y + height}, "stroke='#777'");
    svg.add("<path d='", curve, "' fill='none' stroke='#12507b' stroke-width='1.5'/>\n");
    for (const Phase& phase : record_.phases) {
        const Pixel p = pixel((phase.begin + phase.end) / 2, 0);
        if (phase.begin < end())
            svg.text({p.x, p.y + 14}, phase.name, {.size = 10, .colour = "#666", .anchor = "middle"});
    }
    svg.text({corner.x, corner.y + 8}, std::string("force of the membrane, at most ").append(force_text(largest)),
             {.size = 11, .colour = "#12507b"});
    add(svg, "circle", "r='4' fill='#12507b'",
        {attribute("cx", [&](const Picture& picture) { return number(at(picture).x); }),
         attribute("cy", [&](const Picture& picture) { return number(at(picture).y); })});
}

}  // namespace detail

/// The film of a record, as SVG.
[[nodiscard]] inline std::string film(const Scene& scene, const Record& record) {
    const detail::Film film(scene, record);
    Svg svg(760, 346, scene.name + ": pressed, let go, grasped and pulled");
    film.draw_membrane(svg, {165, 178}, 1.3e4);
    film.draw_section(svg, {350, 14}, 396, 170, 2e4);
    film.draw_force(svg, {350, 200}, 396, 108);
    draw_colour_bar(svg, {190, 332}, 90, {.high = scene.depth}, scene.key + "-film");
    svg.text({14, 24}, scene.name, {.size = 13, .colour = "#111"});
    svg.text({360, 32}, "section", {.size = 11, .colour = "#666"});
    svg.text({14, 340}, number(detail::Film::slower) + " times slower than the run", {.size = 10, .colour = "#666"});
    return svg.str();
}

}  // namespace examples
