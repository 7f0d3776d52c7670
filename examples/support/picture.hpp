// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include <membrane/contact/tool.hpp>
#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/normals.hpp>
#include <membrane/surface/triangle.hpp>
#include <membrane/surface/triangle_mesh.hpp>

#include "support/camera.hpp"
#include "support/colours.hpp"
#include "support/svg.hpp"

/// A shaded picture of a membrane, the tool and its force.
///
///     Picture picture{.mesh = mesh, .points = x, .tool = tool, .force = {0, 0, 0.12}};
///     draw(svg, camera, picture, "pressed");
namespace examples {

/// A quantity shown as colour.
struct ColourScale {
    std::string name = "displacement", unit = "mm";
    double per_unit = 1e3;  ///< Number of `unit` in one SI unit.
    double low = 0;         ///< Value of the palest colour, in SI.
    double high = 1e-3;     ///< Value of the strongest colour, in SI.

    [[nodiscard]] double share(double value) const { return (value - low) / (high - low); }
};

/// The contents of one picture.
struct Picture {
    membrane::TriangleMesh<double> mesh;              ///< Rest shape: triangles, and origin of displacements.
    membrane::Points<double> points;                  ///< Deformed, 3 x V [m].
    ColourScale colours = {};                         ///< Of the quantity shown as colour.
    std::optional<Eigen::VectorXd> values = {};       ///< Of each triangle, in SI; if none, displacements [m].
    std::optional<membrane::Tool<double>> tool = {};  ///< Drawn as a sphere.
    Vector3d force = Vector3d::Zero();                ///< On the tool [N], drawn as an arrow with its value.
    double arrow = 0.1;                               ///< Length of an arrow of one newton [m].
};

/// Draws `picture` as `camera` sees it; `name` must be unique among the drawings of a page.
void draw(Svg& svg, const Camera& camera, const Picture& picture, const std::string& name);

/// A bar of a round length, at longest `width` pixels, with that length in millimetres.
void draw_scale_bar(Svg& svg, const Camera& camera, Pixel left, double width);

/// The colours with their values.
void draw_colour_bar(Svg& svg, Pixel corner, double width, const ColourScale& colours, const std::string& name);

namespace detail {

/// A visible triangle.
struct Facet {
    membrane::Index triangle;
    bool over_tool;   // lies between the eye and the tool
    bool outside;     // shows its outside
    double distance;  // from the eye [m]
};

/// Whether the tool hides nothing of the triangle: a plane between the two has the eye on the triangle's side.
inline bool over(const membrane::Tool<double>& tool, const membrane::Triangle<double>& triangle, const Vector3d& eye) {
    const Vector3d near = membrane::closest_point<double>(triangle, tool.position).point;
    return (near - tool.position).dot(eye - near) > 0;
}

/// Far triangles first, those over the tool last. The inside of a closed surface is left out.
inline std::vector<Facet> painters_order(const Camera& camera, const Picture& picture, bool closed) {
    std::vector<Facet> facets;
    const Vector3d eye = camera.eye();
    for (membrane::Index f = 0; f < picture.mesh.triangle_count(); ++f) {
        const auto triangle = membrane::triangle_at(picture.points, picture.mesh.triangles().col(f));
        const Vector3d middle = (triangle.a + triangle.b + triangle.c) / 3;
        const bool outside = membrane::area_vector(triangle).dot(eye - triangle.a) > 0;
        if (closed && !outside) continue;
        facets.push_back({f, picture.tool && over(*picture.tool, triangle, eye), outside, (eye - middle).norm()});
    }
    std::sort(facets.begin(), facets.end(), [](const Facet& a, const Facet& b) {
        return a.over_tool != b.over_tool ? b.over_tool : a.distance > b.distance;
    });
    return facets;
}

/// Light from a lamp at the upper left: so little that each colour can be found on the colour bar, and no gloss.
inline Colour lit(const Colour& surface, const Vector3d& normal, const Camera& camera) {
    return surface * (0.72 + 0.28 * std::max(0.0, normal.dot(camera.seen(-0.5, 0.75, 0.7))));
}

/// A triangle as one path after "M": where it starts, then relative lines in tenths of a pixel.
inline std::string outline(const std::array<Pixel, 3>& p) {
    const auto tenths = [](double v) { return std::round(10 * v) / 10; };
    const auto line = [&](Pixel from, Pixel to) {
        const std::string dx = number(tenths(to.x) - tenths(from.x)), dy = number(tenths(to.y) - tenths(from.y));
        return dx + (dy.front() == '-' ? "" : " ") + dy;
    };
    return number(p[0].x) + " " + number(p[0].y) + "l" + line(p[0], p[1]) + " " + line(p[1], p[2]) + "z";
}

inline Colour facet_colour(const Camera& camera, const Picture& picture, const Facet& facet,
                           const membrane::Points<double>& normals) {
    const auto corners = picture.mesh.triangles().col(facet.triangle);
    const auto triangle = membrane::triangle_at(picture.points, corners);
    Vector3d normal = 2 * membrane::area_vector(triangle).normalized();
    double displacement = 0;
    for (const auto v : corners) {
        normal += normals.col(v);  // softens the facets
        displacement += (picture.points.col(v) - picture.mesh.positions().col(v)).norm() / 3;
    }
    const double value = picture.values ? (*picture.values)[facet.triangle] : displacement;
    Colour surface = tissue(picture.colours.share(value));
    if (!facet.outside) surface = surface.cwiseProduct(screen(214, 205, 212));
    normal *= (facet.outside ? 1 : -1) / normal.norm();
    return lit(surface, normal, camera);
}

inline void draw_facet(Svg& svg, const Camera& camera, const Picture& picture, const Facet& facet, const Colour& colour,
                       const membrane::Adjacency& adjacency) {
    const auto triangle = membrane::triangle_at(picture.points, picture.mesh.triangles().col(facet.triangle));
    const std::array<Pixel, 3> p{camera.pixel(triangle.a), camera.pixel(triangle.b), camera.pixel(triangle.c)};
    svg.add("<path d='M", outline(p), "' fill='", hex(colour), "'/>\n");
    const auto& across = adjacency.triangle_neighbours(facet.triangle);
    for (std::size_t k = 0; k < 3; ++k) {
        if (across[k] != membrane::no_index) continue;
        svg.line(p[k], p[(k + 1) % 3], "stroke='#5b2f30' stroke-opacity='1' stroke-width='2' stroke-linecap='round'");
    }
}

inline void draw_tool(Svg& svg, const Camera& camera, const membrane::Tool<double>& tool, const std::string& name) {
    const Pixel p = camera.pixel(tool.position);
    svg.add("<radialGradient id='", name, "-tool' cx='.36' cy='.3' r='.72'><stop offset='0' stop-color='#fdfeff'/>",
            "<stop offset='.35' stop-color='#c6d0d9'/><stop offset='1' stop-color='#667482'/></radialGradient>\n",
            "<circle cx='", p.x, "' cy='", p.y, "' r='", std::max(2.0, tool.radius * camera.scale(tool.position)),
            "' fill='url(#", name, "-tool)' stroke='#46525e' stroke-width='.7'/>\n");
}

inline std::string force_text(double newtons) {
    return newtons < 1 ? significant(1e3 * newtons) + " mN" : significant(newtons) + " N";
}

/// An arrow from the tool along the force, with its value.
inline void draw_force(Svg& svg, const Camera& camera, const Picture& picture) {
    const Pixel p = camera.pixel(picture.tool->position);
    const Pixel q = camera.pixel(picture.tool->position + picture.arrow * picture.force);
    const double length = std::hypot(q.x - p.x, q.y - p.y);
    if (length < 4) return;
    const Pixel along{(q.x - p.x) / length, (q.y - p.y) / length};
    const double head = std::min(11.0, 0.6 * length), half = 0.42 * head;
    const Pixel neck{q.x - head * along.x, q.y - head * along.y};
    const Pixel left{neck.x - half * along.y, neck.y + half * along.x};
    const Pixel right{neck.x + half * along.y, neck.y - half * along.x};
    for (const char* style :
         {"fill='#fff' stroke='#fff' stroke-width='6'", "fill='#12507b' stroke='#12507b' stroke-width='2'"}) {
        svg.add("<path d='M", p, "L", neck, "M", left, "L", q, "L", right, "z' ", style, "/>\n");
    }
    const bool leftwards = along.x < -0.3;
    svg.text({q.x + (leftwards ? -7 : 7), q.y + (along.y > 0.5 ? 14 : 4)}, force_text(picture.force.norm()),
             {.size = 13, .colour = "#12507b", .anchor = leftwards ? "end" : "start", .bold = true, .halo = true});
}

}  // namespace detail

inline void draw(Svg& svg, const Camera& camera, const Picture& picture, const std::string& name) {
    const membrane::Adjacency adjacency(picture.mesh);
    auto normals = membrane::VertexNormals(picture.mesh);
    normals.update(picture.points);
    const auto facets = detail::painters_order(camera, picture, adjacency.closed());
    const auto first_over =
        std::find_if(facets.begin(), facets.end(), [](const auto& facet) { return facet.over_tool; });
    const auto draw_facets = [&](auto begin, auto end) {
        svg.add("<g fill='none' stroke='#7a3e36' stroke-opacity='.38' stroke-width='.5' stroke-linejoin='round'>\n");
        for (auto facet = begin; facet != end; ++facet) {
            const Colour colour = detail::facet_colour(camera, picture, *facet, normals.values());
            detail::draw_facet(svg, camera, picture, *facet, colour, adjacency);
        }
        svg.add("</g>\n");
    };
    draw_facets(facets.begin(), first_over);
    if (picture.tool) detail::draw_tool(svg, camera, *picture.tool, name);
    draw_facets(first_over, facets.end());
    if (picture.tool) detail::draw_force(svg, camera, picture);
}

inline void draw_scale_bar(Svg& svg, const Camera& camera, Pixel left, double width) {
    const double longest = width / camera.options().metre;  // [m]
    double length = std::pow(10, std::floor(std::log10(longest)));
    length *= 5 * length <= longest ? 5 : 2 * length <= longest ? 2 : 1;
    const double right = left.x + length * camera.options().metre;
    svg.line(left, {right, left.y}, "stroke='#333' stroke-width='2'");
    svg.text({(left.x + right) / 2, left.y - 6}, number(1e3 * length, 3) + " mm", {.size = 11, .anchor = "middle"});
}

inline void draw_colour_bar(Svg& svg, Pixel corner, double width, const ColourScale& colours, const std::string& name) {
    svg.add("<linearGradient id='", name, "-bar'>");
    for (int i = 0; i <= 8; ++i) svg.add("<stop offset='", 12.5 * i, "%' stop-color='", hex(tissue(i / 8.0)), "'/>");
    svg.add("</linearGradient>\n");
    svg.rectangle(corner, width, 8, "fill='url(#" + name + "-bar)' stroke='#777' stroke-width='.5'");
    const auto value = [&](double si) { return number(colours.per_unit * si, 2); };
    svg.text({corner.x - 6, corner.y + 8}, value(colours.low), {.size = 11, .anchor = "end"});
    svg.text({corner.x + width + 6, corner.y + 8}, value(colours.high) + " " + colours.unit, {.size = 11});
    svg.text({corner.x + width / 2, corner.y - 5}, colours.name, {.size = 11, .anchor = "middle"});
}

}  // namespace examples
