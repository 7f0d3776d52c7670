// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <vector>

#include "sheet.hpp"

/// The wall of an eye, by the library: triangular springs that bend, under pressure and under a flat punch; and the bag
/// of a lens, pulled at its rim.
///
///     const bench::tissue::Eye pig{.radius = 8.44e-3, .rim = 6.58e-3, .thickness = 0.89e-3, .young_modulus = 0.188e6};
///     bench::tissue::Inflation inflation(pig, 20);
///     inflation.at(27.25 * bench::tissue::mmhg).rise;                                              // [m]
namespace bench::tissue {

inline constexpr double mmhg = 133.322;  ///< [Pa]

/// A cap of a sphere.
struct Eye {
    double radius;                ///< of the sphere [m]
    double rim;                   ///< radius of the border, which stays where it is [m]
    double thickness;             ///< [m]
    double young_modulus;         ///< [Pa]
    double poisson_ratio = 0.49;  ///< assumed in all published models of the cornea
    bool clamped = true;          ///< the border keeps its slope; otherwise it is hinged

    [[nodiscard]] double rim_angle() const { return std::asin(rim / radius); }
    [[nodiscard]] membrane::Material material() const {
        return {.young_modulus = young_modulus, .poisson_ratio = poisson_ratio, .thickness = thickness};
    }
    [[nodiscard]] Eye with(double Eye::*field, double value) const {
        Eye changed = *this;
        changed.*field = value;
        return changed;
    }
    [[nodiscard]] Eye hinged() const {
        Eye changed = *this;
        changed.clamped = false;
        return changed;
    }
};

/// The middle of an inflated cap.
struct Middle {
    double rise;     ///< [m]
    double stretch;  ///< equal in all directions of the surface
};

/// Change of thickness from one stretch to another, relative: no stress across, a material of constant Poisson ratio
/// nu.
[[nodiscard]] inline double thickness_strain(double before, double after, double poisson_ratio) {
    return std::pow(after / before, -2 * poisson_ratio / (1 - poisson_ratio)) - 1;
}

/// The mesh of an eye with this many rings up to its border. A clamped one has a ring beyond it.
[[nodiscard]] inline Mesh mesh_of(const Eye& eye, int rings) {
    const int all = rings + (eye.clamped ? 1 : 0);
    const double outer = std::sin(eye.rim_angle() * all / rings);
    return membrane::spherical_cap<double>(
        {.radius = eye.radius, .diameter = 2 * eye.radius * outer, .rings = static_cast<Index>(all)});
}

/// The vertices on and beyond the border.
[[nodiscard]] inline std::vector<Index> border_of(const Eye& eye, const Mesh& mesh) {
    std::vector<Index> found;
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        const auto x = mesh.positions().col(v);
        if (std::hypot(x.x(), x.y()) > eye.rim * (1 - 1e-9)) found.push_back(v);
    }
    return found;
}

/// A cap under growing pressure.
class Inflation {
  public:
    Inflation(const Eye& eye, int rings)
        : sheet_{.mesh = mesh_of(eye, rings), .material = eye.material()}, x_(sheet_.mesh.positions()) {
        sheet_.rigidity = membrane::flexural_rigidity(sheet_.material);
        sheet_.pinned = border_of(eye, sheet_.mesh);
    }

    /// The equilibrium for a pressure [Pa]. @throws std::runtime_error if none is found
    [[nodiscard]] Middle at(double pressure) {
        sheet_.pressure = pressure;
        x_ = sheet_.equilibrium(x_).x;
        return {x_(2, 0) - sheet_.mesh.positions()(2, 0), std::sqrt(area(x_) / area(sheet_.mesh.positions()))};
    }

  private:
    // Of the triangles around the middle.
    [[nodiscard]] double area(const Points& x) const {
        double sum = 0;
        for (const auto& corners : sheet_.mesh.triangles().colwise()) {
            if (corners.minCoeff() != 0) continue;
            const Vector3 a = x.col(corners[0]), b = x.col(corners[1]), c = x.col(corners[2]);
            sum += membrane::norm<double>(membrane::cross<double>(b - a, c - a)) / 2;
        }
        return sum;
    }

    Sheet sheet_;
    Points x_;
};

/// A cap under pressure that a flat plate presses. The shape without the plate is that under the pressure, which the
/// wall's tension, pressure times radius / 2, balances.
class Applanation {
  public:
    Applanation(const Eye& eye, double pressure, int rings)
        : top_(eye.radius),
          sheet_{.mesh = mesh_of(eye, rings), .material = eye.material()},
          x_(sheet_.mesh.positions()) {
        // Triangular springs stretched by s have a tension of E t / (1 - nu) times (s^2 - 1) / 2.
        sheet_.stretch = std::sqrt(1 + pressure * eye.radius / sheet_.material.biaxial_stiffness());
        sheet_.rigidity = membrane::flexural_rigidity(sheet_.material);
        sheet_.pressure = pressure;
        sheet_.pinned = border_of(eye, sheet_.mesh);
    }

    /// Force on the plate at a depth from first contact [N], near the last equilibrium; NaN if none is found.
    [[nodiscard]] double force(double depth) {
        plate_ = top_ - depth;
        try {
            const auto found = sheet_.equilibrium(x_, {Tool{.position = {0, 0, plate_ + flat}, .radius = flat}});
            x_ = found.x;
            return found.reactions[0].z();
        } catch (const std::runtime_error&) {
            return std::numeric_limits<double>::quiet_NaN();
        }
    }

    /// Mean distance of a ring of vertices from the plate and from the axis [m].
    [[nodiscard]] Eigen::Vector2d ring(Index number) const {
        Eigen::Vector2d sum(0, 0);
        const Index first = 1 + 3 * number * (number - 1);
        for (Index v = first; v < first + 6 * number; ++v) {
            const double away = std::hypot(x_(0, v), x_(1, v));
            sum += Eigen::Vector2d(plate_ + away * away / (2 * flat) - x_(2, v), away);
        }
        return sum / static_cast<double>(6 * number);
    }

  private:
    static constexpr double flat = 1;  // radius of a ball so large that it is a plate [m]

    double top_, plate_ = 0;
    Sheet sheet_;
    Points x_;
};

/// Forces of a flat punch on an eye under pressure at ascending depths [N]; NaN where no equilibrium is found.
[[nodiscard]] inline std::vector<double> punch_forces(const Eye& eye, double pressure,
                                                      const std::vector<double>& depths, int rings) {
    Applanation applanation(eye, pressure, rings);
    std::vector<double> forces;
    for (const double depth : depths) forces.push_back(applanation.force(depth));
    return forces;
}

/// Mean pressure on a plate that flattens a circle of a ring's radius [Pa].
[[nodiscard]] inline double applanation_pressure(const Eye& eye, double pressure, int rings, Index ring) {
    constexpr double step = 0.02e-3;
    Applanation applanation(eye, pressure, rings);
    double last = std::numeric_limits<double>::infinity();
    for (double depth = step; depth < 1e-3; depth += step) {
        static_cast<void>(applanation.force(depth));
        const double gap = applanation.ring(ring).x(), approach = last - gap;
        last = gap;
        if (gap > approach || !std::isfinite(approach)) continue;
        const double force = applanation.force(depth + step * gap / approach);  // the ring touches
        const double radius = applanation.ring(ring).y();
        return force / (std::numbers::pi * radius * radius);
    }
    throw std::runtime_error("the plate does not flatten the circle");
}

/// Force on the rim of a bag of two flat discs, per displacement of the rim [N/m].
[[nodiscard]] inline double bag_stiffness(const membrane::Material& front, double back_thickness) {
    constexpr double radius = 4e-3, strain = 1e-6;  // the stiffness does not depend on the radius
    Sheet sheet{.mesh = membrane::disc<double>({.radius = radius, .rings = 6}), .material = front};
    sheet.material.thickness += back_thickness;
    sheet.pinned = membrane::border(sheet.mesh);
    Points x = sheet.mesh.positions() * (1 + strain);
    x = sheet.equilibrium(x).x;
    double force = 0;
    for (const Index v : sheet.pinned) {
        const Vector3 inward = -x.col(v).normalized();
        force += sheet.force_on({v}, x).dot(inward);
    }
    return force / (radius * strain);
}

}  // namespace bench::tissue
