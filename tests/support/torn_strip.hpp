// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/model/tearable_springs.hpp>
#include <membrane/model/tissue.hpp>
#include <membrane/model/triangular_springs.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/tear/tearing.hpp>

#include "support/pure_shear.hpp"
#include "support/torn_sheet.hpp"
#include "support/turned_grid.hpp"

/// A strip between two clamps, with a notch, that is torn.
///
///     test::TornStrip<double> strip({.turn = 0.3});
///     while (strip.torn_edges() < 12) strip.tick();
///     CHECK(strip.balance() == Approx(1).epsilon(0.01));
namespace test {

struct TornStripOptions {
    int columns = 40, rows = 20;      ///< edges of 1 mm
    int notch = 12;                   ///< edges
    double turn = 0;                  ///< of the grid [rad]
    double toughness = 1000;          ///< [J/m^2]
    bool springs = false;             ///< a network of springs in place of a continuous sheet
    double damping = 0;               ///< of a vertex, by a body that does not support it [N s/m]
    membrane::TearOptions tear = {};  ///< how it tears
};

/// Pure shear: the clamps at y = 0 and y = height move apart, the strip is as long as wide, and its tear releases the
/// energy density times the height, whatever its length.
template <membrane::Real Scalar>
class TornStrip {
  public:
    using Vector = membrane::Vector3<Scalar>;
    using Index = membrane::Index;
    using Springs = membrane::TearableSprings<Scalar, membrane::LinearSpring>;
    using Sheet = membrane::Tissue<Springs, membrane::Elements<Scalar, membrane::TriangularSpring<Scalar>>>;

    static constexpr double edge = 1e-3;
    static constexpr double thickness = 1e-5;
    static constexpr auto dt = Scalar(1e-3);  ///< [s]

    explicit TornStrip(const TornStripOptions& options)
        : options_(options),
          surface(turned_grid<Scalar>(options.columns, options.rows, edge, options.turn)),
          mesh(membrane::with_reserve(surface.mesh(), 100)),
          sheet(springs_of(), membrane::triangular_springs(mesh, material_of())),
          foundation(mesh, {.stiffness = Scalar(0), .damping = static_cast<Scalar>(options.damping)}),
          tear(mesh, membrane::EnergyRelease{options.toughness, thickness}, options.tear),
          solver(sheet, {.layers = membrane::unlimited, .sweeps = 6, .predict = false}),
          x(mesh.positions()) {
        for (Index v = 0; v < surface.vertex_count(); ++v) {
            if (surface.x(1, v) == static_cast<Scalar>(height())) top.push_back(v);
        }
    }

    double height() const { return options_.rows * edge; }
    /// [N/m^2] The material of the sheet; Poisson ratio 0.3.
    static membrane::Material material() {
        return {.young_modulus = 1e6, .poisson_ratio = 0.3, .thickness = thickness};
    }
    /// Its closed forms.
    PureShear pure_shear() const { return {material(), options_.toughness, height()}; }

    /// Cuts the notch from the middle of the left side.
    template <class... Parts>
    void cut(Parts&... parts) {
        Index first = 0;
        for (Index v = 0; v < surface.vertex_count(); ++v) {
            const auto off = [&](Index w) { return std::abs(surface.x(1, w) - height() / 2); };
            if (surface.x(0, v) == 0 && (surface.x(0, first) != 0 || off(v) < off(first))) first = v;
        }
        std::vector<Index> path{first};
        while (static_cast<int>(path.size()) <= options_.notch) {
            const double off = (height() / 2 - static_cast<double>(surface.x(1, path.back()))) / (2 * edge);
            path.push_back(tear.surface().nearest_in_direction(path.back(), Vector(1, static_cast<Scalar>(off), 0)));
        }
        follow(tear.cut_along(path, x), parts...);
        cut_path = path;
        start = membrane::point(tear.surface().rest_positions(), path.back());
    }

    /// Stretches the strip evenly, and finds its equilibrium.
    void stretch(double to) {
        stretched = to;
        x.row(1) = static_cast<Scalar>(to) * tear.surface().rest_positions().row(1);
        relax(3000);
        force_ = force();
        work = energy();
        damped = 0;
    }

    /// Holds this vertex where it is, moved by `displacement`, and finds the equilibrium.
    void hold(Index v, const Vector& displacement) {
        held.push_back(v);
        x.col(v) += displacement;
        relax(3000);
    }

    /// The clamps move apart by `by` of the height; up to 20 steps, and what tears then.
    void tick(double by) {
        const double apart = by * height();
        stretched += by;
        for (const Index v : top) x(1, v) += static_cast<Scalar>(apart);
        relax(20);
        work += (std::exchange(force_, force()) + force()) / 2 * apart;
        follow(tear.update(x, dt, sheet, foundation));
    }

    /// Whether the forces balance, but for a small part of what tears the strip.
    bool at_rest() const {
        constexpr double part = std::is_same_v<Scalar, double> ? 3e-4 : 3e-3;
        return report.residual < static_cast<Scalar>(part * options_.toughness * thickness);
    }

    /// The clamps' force [N].
    double force() const { return -static_cast<double>(report.reactions[1][1]); }
    double energy() const { return stored_in(sheet, x); }
    /// Energy stored and dissipated, over the work of the clamps.
    double balance() const { return (energy() + tear.stored(x) + tear.dissipated() + damped) / work; }
    double torn_edges() const { return tear.torn_length() / edge; }
    /// Distance of the tip from the line of the notch [edges].
    double off_line() const {
        return std::abs(static_cast<double>(tear.surface().rest_positions()(1, tear.tips()[0].vertex) - start[1])) /
               edge;
    }

  private:
    membrane::Material material_of() const {
        auto sheet_material = material();
        if (options_.springs) sheet_material.young_modulus *= 1e-9;  // as good as none
        return sheet_material;
    }
    Springs springs_of() const {
        std::vector<Index> clamped;
        for (Index v = 0; v < surface.vertex_count(); ++v) {
            if (surface.x(1, v) == 0 || surface.x(1, v) == static_cast<Scalar>(height())) clamped.push_back(v);
        }
        membrane::NetworkOptions<Scalar> options{.stiffness = Scalar(0), .pinned = clamped};
        if (options_.springs) options.stiffness = membrane::spring_stiffnesses(mesh, material());
        return Springs(mesh, membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, options));
    }
    void relax(int steps) {
        for (int i = 0; i < steps; ++i) {
            solver.wake_all();
            const membrane::Points<Scalar> before = x;
            report = solver.step(x, dt, sheet, foundation, tear.ligaments(), membrane::pin(top), membrane::pin(held));
            if (options_.damping > 0) damped += taken_by_damping(foundation, before, x, report.moved, dt);
            if (at_rest()) return;
        }
    }
    template <class... Parts>
    void follow(std::span<const membrane::TearEvent<Scalar>> events, Parts&... parts) {
        for (const auto& event : events) membrane::follow(event, sheet, foundation, solver, parts...);
    }

    TornStripOptions options_;
    double force_ = 0;

  public:
    Surface<Scalar> surface;
    membrane::TriangleMesh<Scalar> mesh;
    Sheet sheet;
    membrane::VirtualVolumeSprings<Scalar> foundation;
    membrane::Tearing<Scalar> tear;
    membrane::QuasiStaticSolver<Scalar> solver;
    membrane::Points<Scalar> x;
    std::vector<Index> top;   ///< vertices of the upper clamp
    std::vector<Index> held;  ///< others that are held
    std::vector<Index> cut_path;
    membrane::StepReport<Scalar> report;
    Vector start = Vector::Zero();  ///< of the tear
    double stretched = 1, work = 0, damped = 0;
};

}  // namespace test
