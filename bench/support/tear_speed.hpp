// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <vector>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/model/tearable_springs.hpp>
#include <membrane/model/tissue.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tear/tearing.hpp>

#include "support/tear_shear.hpp"

/// What a tear costs in a tick.
namespace bench::tears {

/// A stretched disc of springs with a clamped rim. A hand draws the lip of a cut, just behind its tip, up and aside,
/// for three edges; then takes hold anew. Without a cut it draws a vertex at the same place.
class DrawnDisc {
  public:
    static constexpr int rings = 58;                                ///< 10,267 vertices
    static constexpr double radius = 10e-3, edge = radius / rings;  ///< [m]

    struct Tick {
        double seconds, vertex_updates;
        double torn;  ///< since the last one [m]
    };

    /// Not cut at all, or cut, with a toughness of `energy` [J/m^2].
    DrawnDisc(bool is_cut, double energy, const membrane::SolverOptions<double>& options = {.layers = 12})
        : mesh_(membrane::with_reserve(membrane::disc<double>({.radius = radius, .rings = rings}), 400)),
          springs_(membrane::TearableSprings(
              mesh_, membrane::MassSpringNetwork(mesh_, membrane::LinearSpring{},
                                                 {.stiffness = 20.0, .pinned = membrane::border(mesh_)}))),
          foundation_(mesh_, {.stiffness = 1e-3}),
          solver_(springs_, options),
          tear_(mesh_, membrane::EnergyRelease{energy, 1e-5}),
          tree_(mesh_),
          x_(1.02 * mesh_.positions()) {
        std::vector<Index> path{0};
        while (path.size() < 15) path.push_back(tear_.surface().nearest_in_direction(path.back(), {1, 0, 0}));
        held_ = path[13];
        if (is_cut) follow(tear_.cut_along(path, x_));
    }

    [[nodiscard]] Tick tick() {
        constexpr int ticks_an_edge = 60;
        if (ticks_++ % (3 * ticks_an_edge) == 0) hold();
        target_ += edge / ticks_an_edge * Vector(0, std::sqrt(0.5), std::sqrt(0.5));
        const double torn = tear_.torn_length();
        const auto start = std::chrono::steady_clock::now();
        const auto report = solver_.step(x_, 1e-3, springs_, foundation_, pull(held_, target_), tear_.ligaments());
        follow(tear_.update(x_, 1e-3, springs_, foundation_));
        tree_.refit(x_, report.moved);
        const std::chrono::duration<double> time = std::chrono::steady_clock::now() - start;
        return {time.count(), static_cast<double>(report.vertex_updates), tear_.torn_length() - torn};
    }

  private:
    // The left side behind the tip at the right.
    void hold() {
        const auto& rest = tear_.surface().rest_positions();
        double ahead = -radius;
        for (const auto& tip : tear_.tips()) {
            if (rest(0, tip.vertex) > ahead) ahead = rest(0, tip.vertex), held_ = tip.behind[1];
        }
        target_ = membrane::point(x_, held_);
    }
    void follow(std::span<const membrane::TearEvent<double>> events) {
        for (const auto& event : events) membrane::follow(event, springs_, foundation_, solver_, tree_);
    }

    membrane::TriangleMesh<double> mesh_;
    membrane::Tissue<membrane::TearableSprings<double, membrane::LinearSpring>> springs_;
    membrane::VirtualVolumeSprings<double> foundation_;
    membrane::QuasiStaticSolver<double> solver_;
    membrane::Tearing<double> tear_;
    membrane::AabbTree<double> tree_;
    membrane::Points<double> x_;
    Index held_ = 0;
    int ticks_ = 0;
    Vector target_ = Vector::Zero();
};

struct TickCost {
    double seconds, vertex_updates;  ///< of a tick, medians
    double slow;                     ///< time that one of 20 ticks exceeds [s]
    double torn;                     ///< in all [m]
};

/// The bound on vertex updates of a disc that tears: some fewer than the whole one takes.
inline constexpr Index update_bound = 1300;

/// Of a whole disc, one that is cut, one that tears, the same with bounded updates, and with steps near convergence.
/// They tick in turns: load of the machine affects all of them.
[[nodiscard]] inline std::vector<TickCost> cost_of_ticks(int ticks) {
    std::vector<DrawnDisc> discs{{false, 1.0},
                                 {true, 1e9},
                                 {true, 30.0},
                                 {true, 30.0, {.layers = 12, .max_vertex_updates = update_bound}},
                                 {true, 30.0, {.layers = membrane::unlimited, .sweeps = 8}}};
    std::vector<std::vector<DrawnDisc::Tick>> measured(discs.size());
    constexpr int in_turn = 20;
    for (int done = 0; done < ticks; done += in_turn) {
        for (std::size_t i = 0; i < discs.size(); ++i) {
            for (int n = 0; n < in_turn; ++n) measured[i].push_back(discs[i].tick());
        }
    }
    std::vector<TickCost> result;
    for (const auto& all : measured) {
        const auto quantile = [&](double DrawnDisc::Tick::*value, double part) {
            std::vector<double> values;
            for (const auto& tick : all) values.push_back(tick.*value);
            const auto at = static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size()));
            std::nth_element(values.begin(), values.begin() + at, values.end());
            return values[static_cast<std::size_t>(at)];
        };
        using Tick = DrawnDisc::Tick;
        TickCost cost{quantile(&Tick::seconds, 0.5), quantile(&Tick::vertex_updates, 0.5),
                      quantile(&Tick::seconds, 0.95), 0};
        for (const auto& tick : all) cost.torn += tick.torn;
        result.push_back(cost);
    }
    return result;
}

}  // namespace bench::tears
