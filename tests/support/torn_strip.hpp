// SPDX-License-Identifier: MIT
#pragma once

#include <cmath>
#include <type_traits>
#include <vector>

#include "support/pure_shear.hpp"
#include "support/torn_sheet.hpp"

/// A strip between two clamps, with a notch, that is torn.
///
///     test::TornStrip<double> strip({.turn = 0.3});
///     strip.cut();
///     strip.stretch(1.2);
///     while (strip.torn_edges() < 12) strip.tick(1e-4);
///     CHECK(strip.balance() == Approx(1).epsilon(0.01));
namespace test {

struct TornStripOptions {
    int columns = 40, rows = 20;      ///< edges
    double edge = 1e-3;               ///< [m]
    int notch = 12;                   ///< edges
    double turn = 0;                  ///< of the grid [rad]
    double toughness = 1000;          ///< [J/m^2]
    bool springs = false;             ///< a network of springs in place of a continuous sheet
    double drag = 0;                  ///< of a fluid, on each vertex [N s/m]
    double tolerance = 3e-4;          ///< of residual forces, over the resistance; in single precision ten times that
    membrane::TearOptions tear = {};  ///< how it tears

    [[nodiscard]] double height() const { return rows * edge; }
    [[nodiscard]] double resistance() const { return toughness * torn_material.thickness; }
    /// Its closed forms.
    [[nodiscard]] PureShear pure_shear() const { return {torn_material, toughness, height()}; }
};

/// Pure shear: the clamps at y = 0 and y = height move apart, the strip is as long as wide, and its tear releases the
/// energy density times the height, whatever its length.
template <membrane::Real Scalar, class Criterion = membrane::EnergyRelease>
class TornStrip : public TornSheet<Scalar, Criterion> {
    using Sheet = TornSheet<Scalar, Criterion>;

  public:
    using typename Sheet::Index, typename Sheet::Vector;

    explicit TornStrip(const TornStripOptions& options)
        : TornStrip(options, membrane::EnergyRelease{options.toughness, torn_material.thickness}) {}
    TornStrip(const TornStripOptions& options, const Criterion& criterion)
        : TornStrip(options, criterion,
                    turned_grid<Scalar>(options.columns, options.rows, options.edge, options.turn).mesh()) {}

    [[nodiscard]] double edge() const { return options_.edge; }
    [[nodiscard]] double height() const { return options_.height(); }
    [[nodiscard]] PureShear pure_shear() const { return options_.pure_shear(); }
    /// The vertices of the upper clamp.
    [[nodiscard]] const std::vector<Index>& top() const { return this->hands[1]; }

    /// Cuts the notch from the middle of the left side; `parts` follow.
    template <class... Parts>
    void cut(Parts&... parts) {
        Sheet::cut({0, static_cast<Scalar>(height() / 2), 0}, {1, 0, 0}, options_.notch, parts...);
        notch_end = tip();
    }

    /// Stretches the strip evenly, and finds its equilibrium.
    void stretch(double to) {
        stretched = to;
        this->x.row(1) = static_cast<Scalar>(to) * this->tear.surface().rest_positions().row(1);
        this->start();
    }

    /// Holds this vertex where it is, moved by `displacement`, and finds the equilibrium.
    void hold(Index v, const Vector& displacement) {
        this->hands[0].push_back(v);
        this->x.col(v) += displacement;
        this->start();
    }

    /// The clamps move apart by `by` of the height; up to 20 steps, and what tears then.
    void tick(double by) {
        stretched += by;
        Sheet::tick({Vector::Zero(), Vector(0, static_cast<Scalar>(by * height()), 0)});
    }

    /// The clamps' force [N].
    [[nodiscard]] double force() const { return static_cast<double>(this->forces[1][1]); }
    /// Energy stored and taken, over the work of the clamps.
    [[nodiscard]] double balance() const { return 1 - this->lost() / this->work; }
    [[nodiscard]] double torn_edges() const { return this->tear.torn_length() / edge(); }
    /// Where the tip is at rest, from the end of the notch [edges].
    [[nodiscard]] membrane::Vector3<double> advance() const { return (1 / edge()) * (tip() - notch_end); }
    [[nodiscard]] double off_line() const { return std::abs(advance()[1]); }

  private:
    TornStrip(const TornStripOptions& options, const Criterion& criterion, const membrane::TriangleMesh<Scalar>& whole)
        : Sheet(membrane::with_reserve(whole, 2 * options.columns), sheet_options(options, whole), criterion),
          options_(options),
          vertices(whole.vertex_count()) {}
    static TornSheetOptions sheet_options(const TornStripOptions& options,
                                          const membrane::TriangleMesh<Scalar>& whole) {
        const double middle = options.height() / 2, half = middle - options.edge / 2;
        const auto bottom = vertices_where(whole, [&](const auto& at) { return at[1] - middle < -half; });
        const auto top = vertices_where(whole, [&](const auto& at) { return at[1] - middle > half; });
        auto both = bottom;
        both.insert(both.end(), top.begin(), top.end());
        const double tolerance = std::is_same_v<Scalar, double> ? options.tolerance : 10 * options.tolerance;
        return {.hands = {bottom, top},
                .fixed = both,
                .tolerance = tolerance * options.resistance(),
                .springs = options.springs,
                .drag = options.drag,
                .tear = options.tear};
    }
    [[nodiscard]] membrane::Vector3<double> tip() const {
        const auto at = membrane::point(this->tear.surface().rest_positions(), this->tear.tips()[0].vertex);
        return at.template cast<double>();
    }

    TornStripOptions options_;

  public:
    Index vertices;        ///< before it is cut
    double stretched = 1;  ///< in height
    membrane::Vector3<double> notch_end = membrane::Vector3<double>::Zero();
};

}  // namespace test
