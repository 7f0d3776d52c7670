// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <string>

#include <Eigen/Geometry>

#include <membrane/surface/triangle.hpp>

#include "support/camera.hpp"
#include "support/picture.hpp"
#include "support/svg.hpp"

/// A section of the membrane through the tool: the part that the tool hides in a picture.
namespace examples {

/// The plane of a cut through the tool and the origin, outward upwards.
struct Cut {
    Vector3d origin, right, up;
    Pixel middle;  ///< Where `origin` lies in the drawing.
    double metre;  ///< How long one metre is in the drawing [px].

    [[nodiscard]] double beyond(const Vector3d& p) const { return (p - origin).dot(right.cross(up)); }
    [[nodiscard]] Pixel pixel(const Vector3d& p) const {
        return {middle.x + metre * (p - origin).dot(right), middle.y - metre * (p - origin).dot(up)};
    }
};

namespace detail {

/// The cut through a surface, as one path.
inline std::string profile(const Cut& cut, const membrane::Points<double>& points,
                           const membrane::Triangles& triangles) {
    std::string path;
    for (const auto& corners : triangles.colwise()) {
        char pen = 'M';
        for (Eigen::Index k = 0; k < 3; ++k) {
            const Vector3d a = points.col(corners[k]), b = points.col(corners[(k + 1) % 3]);
            const double before = cut.beyond(a), after = cut.beyond(b);
            if ((before < 0) == (after < 0)) continue;
            const Vector3d crossing = a + before / (before - after) * (b - a);
            if ((crossing - cut.origin).norm() > crossing.norm()) continue;  // the far side of the body
            const Pixel p = cut.pixel(crossing);
            path += pen + number(p.x) + ' ' + number(p.y);
            pen = 'L';
        }
    }
    return path;
}

}  // namespace detail

/// Draws the cut through the deformed membrane, over that of the rest shape, in a window of `width` x `height` pixels
/// whose upper left corner is `corner`.
inline void draw_section(Svg& svg, const Camera& camera, const Picture& picture, Pixel corner, double width,
                         double height, double metre, const std::string& name) {
    const Vector3d up = picture.tool->position.normalized();
    const double surface = (up.transpose() * picture.mesh.positions()).maxCoeff();
    const Vector3d right = (camera.seen(1, 0, 0) - up * up.dot(camera.seen(1, 0, 0))).normalized();
    const Cut cut{surface * up, right, up, {corner.x + width / 2, corner.y + 0.5 * height}, metre};
    const Pixel tool = cut.pixel(picture.tool->position);
    const auto& triangles = picture.mesh.triangles();
    svg.add("<clipPath id='", name, "-cut'>");
    svg.rectangle(corner, width, height, "rx='4'");
    svg.add("</clipPath>\n");
    svg.rectangle(corner, width, height, "rx='4' fill='#f7f8f9'");
    svg.add("<g clip-path='url(#", name, "-cut)' fill='none' stroke-linecap='round'>\n");
    svg.add("<circle cx='", tool.x, "' cy='", tool.y, "' r='", picture.tool->radius * metre,
            "' fill='#d5dce3' stroke='#46525e' stroke-width='.8'/>\n");
    svg.add("<path d='", detail::profile(cut, picture.mesh.positions(), triangles),
            "' stroke='#888' stroke-dasharray='3 3'/>\n");
    svg.add("<path d='", detail::profile(cut, picture.points, triangles),
            "' stroke='#b03442' stroke-width='2'/>\n</g>\n");
}

}  // namespace examples
