// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "support/torn_sheet.hpp"

/// Trouser test: a strip is cut along its middle, one leg is drawn up, the other down, and the cut tears on.
///
///     const auto found = test::tear_trousers<double>({.width = 4}, 12);
///     CHECK(found.mean == Approx(1).epsilon(0.1));
namespace test {

struct Trousers {
    int width = 6;             ///< of a leg [edges]
    double turn = 0;           ///< of the grid [rad]
    double strain = 0.02;      ///< of a leg while it tears, nearly
    double relative_drag = 0;  ///< of a fluid, as `drag_of_stiffness` takes it
    int steps = 10;            ///< of a tick, at most; with more the forces balance better

    static constexpr double leg_width = 6e-3;  ///< [m]

    [[nodiscard]] double edge() const { return leg_width / width; }
    /// Such that the legs stretch so: for a force of half that times the thickness, see `expected_force`.
    [[nodiscard]] double toughness() const { return 2 * strain * torn_material.young_modulus * leg_width; }
    [[nodiscard]] double resistance() const { return toughness() * torn_material.thickness; }

    /// Hands draw the legs apart by the force F each, at right angles to the strip. An advance by a makes both legs
    /// longer by a, which stretch by the factor s: each hand moves on by s a, and a of each leg stores the energy
    /// a W(s), while the strip ahead is not stretched. So 2 (F s - W(s)) = toughness x thickness. A leg that does not
    /// stretch has s = 1 and W = 0: F = toughness x thickness / 2. In general F = dW/ds, with E t w (s^2 - 1)^2 / 8 for
    /// W.
    [[nodiscard]] double expected_force() const {
        const double stiffness = torn_material.young_modulus * torn_material.thickness * leg_width;
        const auto force = [&](double s) { return stiffness * s * (s * s - 1) / 2; };
        const auto released = [&](double s) { return 2 * (force(s) * s - stiffness * std::pow(s * s - 1, 2) / 8); };
        double low = 1, high = 2;
        while (high - low > 1e-12) {
            const double middle = (low + high) / 2;
            (released(middle) < resistance() ? low : high) = middle;
        }
        return force(low);
    }
};

struct TrouserRun {
    double mean = 0;                           ///< force of a hand while the tear is steady, over the expected one
    double low = 0, high = 0;                  ///< least and largest force then, over the same
    double energy = 0;                         ///< work of the hands then, over that of the closed form
    double torn = 0, damped = 0, relaxed = 0;  ///< taken by tear, drag and steps, over what was given and is not stored
    double lost = 0;                           ///< taken by nothing, over the same
    double off_line = 0;                       ///< [edges]
    std::vector<std::array<double, 2>> curve;  ///< displacement of a hand [edges], force over the expected one
};

namespace detail {

// 1 for the vertices of the leg at y > middle, -1 for those of the other one, 0 beyond `end`.
template <class Sheet>
[[nodiscard]] std::vector<int> legs_of(const Sheet& sheet, double middle, double end) {
    using membrane::Index;
    const auto& rest = sheet.tear.surface().rest_positions();
    const auto& triangles = sheet.tear.surface().triangles();
    std::vector<int> side(static_cast<std::size_t>(rest.cols()), 0);
    const auto of = [&](Index v) -> int& { return side[static_cast<std::size_t>(v)]; };
    const auto edge = static_cast<double>(sheet.tear.surface().mean_edge(0));
    for (Index v = 0; v < rest.cols(); ++v) {
        const auto aside = static_cast<double>(rest(1, v)) - middle;
        if (rest(0, v) == 0 && std::abs(aside) > edge / 2) of(v) = aside > 0 ? 1 : -1;
    }
    for (bool changes = true; changes;) {
        changes = false;
        for (Index f = 0; f < triangles.cols(); ++f) {
            int found = 0;
            for (const Index v : triangles.col(f)) {
                if (rest(0, v) < end && of(v) != 0) found = of(v);
            }
            for (const Index v : triangles.col(f)) {
                if (found == 0 || of(v) != 0 || rest(0, v) >= end) continue;
                of(v) = found;
                changes = true;
            }
        }
    }
    return side;
}

}  // namespace detail

/// The legs stand upright, unstretched at first. A hand holds all of a leg but the part next to the tip, which is one
/// and a half times as long as wide, and takes hold anew as the tear runs on.
template <membrane::Real Scalar>
class TrouserTest {
    using Index = membrane::Index;
    using Vector = membrane::Vector3<double>;
    using Sheet = TornSheet<Scalar>;

  public:
    explicit TrouserTest(const Trousers& scene) : scene_(scene), sheet(whole(scene)) {
        const double edge = scene.edge();
        sheet.cut({0, static_cast<Scalar>(Trousers::leg_width), 0}, {1, 0, 0}, 2 * scene.width);
        const auto& rest = sheet.tear.surface().rest_positions();
        const double end = tip()[0];
        const auto legs = detail::legs_of(sheet, Trousers::leg_width, end);
        for (Index v = 0; v < rest.cols(); ++v) {
            const int leg = legs[static_cast<std::size_t>(v)];
            if (leg == 0) continue;
            const auto up = static_cast<Scalar>(leg) * (static_cast<Scalar>(end) - rest(0, v));
            sheet.x.col(v) << static_cast<Scalar>(end), rest(1, v), up;
        }
        at_ = end;
        hold();
        sheet.start();
        line_ = tip()[1] / edge;
    }

    /// The hands move on by a part of an edge, and keep above and below the tip.
    void tick(double part) {
        const double step = part * scene_.edge(), torn = sheet.tear.torn_length();
        const double along = std::clamp(tip()[0] - at_, 0.0, 1.2 * step);
        at_ += along;
        const Vector up(along, 0, step), down(along, 0, -step);
        sheet.tick({up.cast<Scalar>(), down.cast<Scalar>()});
        if (sheet.tear.torn_length() != torn) hold();
    }

    /// Of a hand, upward [N].
    [[nodiscard]] double force() const { return static_cast<double>(sheet.forces[0][2] - sheet.forces[1][2]) / 2; }
    [[nodiscard]] Vector tip() const {
        return membrane::point(sheet.tear.surface().rest_positions(), sheet.tear.tips()[0].vertex)
            .template cast<double>();
    }
    /// Distance of the tip from the line of the cut [edges].
    [[nodiscard]] double off_line() const { return std::abs(tip()[1] / scene_.edge() - line_); }

  private:
    static Sheet whole(const Trousers& scene) {
        const double edge = scene.edge();
        const int columns = 3 * scene.width + 26;
        const auto mesh = turned_grid<Scalar>(columns, 2 * scene.width, edge, scene.turn).mesh();
        TornSheetOptions options{
            .hands = {},
            .fixed = vertices_where(
                mesh, [&](const auto& at) { return at[0] > static_cast<Scalar>((columns - 0.5) * edge); }),
            .tolerance = 1e-4 * scene.resistance(),
            .drag = drag_of_stiffness(scene.relative_drag),
            .sweeps = 10,
            .steps = scene.steps};
        return {membrane::with_reserve(mesh, 2 * columns), options,
                membrane::EnergyRelease{scene.toughness(), torn_material.thickness}};
    }
    void hold() {
        const double end = tip()[0];
        const auto& rest = sheet.tear.surface().rest_positions();
        const auto legs = detail::legs_of(sheet, Trousers::leg_width, end);
        for (auto& hand : sheet.hands) hand.clear();
        for (Index v = 0; v < rest.cols(); ++v) {
            const int leg = legs[static_cast<std::size_t>(v)];
            if (leg == 0 || !(static_cast<double>(rest(0, v)) < end - 1.5 * Trousers::leg_width)) continue;
            sheet.hands[leg > 0 ? 0 : 1].push_back(v);
        }
    }

    Trousers scene_;
    double at_ = 0, line_ = 0;

  public:
    Sheet sheet;
};

/// Tears on, a `part` of an edge in a tick; steady is what comes after the first quarter.
template <membrane::Real Scalar>
[[nodiscard]] TrouserRun tear_trousers(const Trousers& scene, double edges, double part = 1.0 / 60) {
    TrouserTest<Scalar> test(scene);
    const auto& tear = test.sheet.tear;
    const double expected = scene.expected_force(), step = part * scene.edge();
    double drawn = 0, torn = 0, sum = 0, first_work = 0;
    int count = 0;
    TrouserRun result;
    result.low = 10;
    while (torn < edges * scene.edge() && !tear.tips().empty()) {
        test.tick(part);
        drawn += step;
        const double ratio = test.force() / expected;
        result.curve.push_back({drawn / scene.edge(), ratio});
        if (tear.tips().empty()) break;
        result.off_line = std::max(result.off_line, test.off_line());
        torn = tear.torn_length();
        if (torn < edges / 4 * scene.edge()) continue;
        if (count++ == 0) {
            first_work = test.sheet.work;
            continue;
        }
        sum += ratio;
        result.low = std::min(result.low, ratio);
        result.high = std::max(result.high, ratio);
    }
    result.mean = sum / (count - 1);
    result.energy = (test.sheet.work - first_work) / (2 * expected * (count - 1) * step);
    const double given = test.sheet.work - test.sheet.stored();
    result.torn = tear.dissipated() / given;
    result.damped = test.sheet.damped() / given;
    result.relaxed = test.sheet.relaxed / given;
    result.lost = test.sheet.lost() / given;
    return result;
}

}  // namespace test
