// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <deque>
#include <string>
#include <vector>

#include <membrane/contact/aabb_tree.hpp>
#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tear/tearable_springs.hpp>
#include <membrane/tear/tearing.hpp>
#include <membrane/tissue/tissue.hpp>

#include "support/tear_shear.hpp"

/// What a tear costs in a tick.
namespace bench::tears {

enum class Cut { none, from_rim, inside };  ///< with no, one and two tips

class DrawnDisc;

struct DrawnDiscOptions {
    Cut cut = Cut::none;
    double toughness = 1e9;              ///< that of one that does not tear [J/m^2]
    const DrawnDisc* hand_of = nullptr;  ///< a disc whose hand draws this one, too
    membrane::SolverOptions<double> solver = {.layers = 12};
};

/// A stretched disc of springs with a clamped rim. A hand draws the lip of a cut, just behind its tip, up and aside,
/// for three edges; then takes hold anew. Without a cut it draws a vertex in the middle.
class DrawnDisc {
  public:
    static constexpr int rings = 58;                                ///< 10,267 vertices
    static constexpr double radius = 10e-3, edge = radius / rings;  ///< [m]

    struct Tick {
        double seconds, vertex_updates;
        double torn;  ///< since the last one [m]
    };

    explicit DrawnDisc(const DrawnDiscOptions& options)
        : hand_of_(options.hand_of),
          mesh_(membrane::with_reserve(membrane::disc<double>({.radius = radius, .rings = rings}), 400)),
          springs_(membrane::TearableSprings(
              mesh_, membrane::MassSpringNetwork(mesh_, membrane::LinearSpring{},
                                                 {.stiffness = 20.0, .pinned = membrane::border(mesh_)}))),
          foundation_(mesh_, {.stiffness = 1e-3}),
          solver_(springs_, options.solver),
          tear_(mesh_, membrane::EnergyRelease{options.toughness, 1e-5}),
          tree_(mesh_),
          x_(1.02 * mesh_.positions()) {
        const bool from_rim = options.cut == Cut::from_rim;
        std::vector<Index> path{nearest_to({from_rim ? -radius : 0, 0, 0})};
        while (path.size() < (from_rim ? 30 : 15)) {
            path.push_back(tear_.surface().nearest_in_direction(path.back(), {1, 0, 0}));
        }
        held_ = path[path.size() - 2];
        if (options.cut != Cut::none) follow(tear_.cut_along(path, x_));
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
    [[nodiscard]] Index nearest_to(const Vector& place) const {
        Eigen::Index v = 0;
        (mesh_.positions().colwise() - Eigen::Vector3d(place)).colwise().squaredNorm().minCoeff(&v);
        return static_cast<Index>(v);
    }
    // Of the held vertex, at rest.
    [[nodiscard]] Vector place() const { return membrane::point(tear_.surface().rest_positions(), held_); }
    // The left side behind the tip at the right.
    void hold() {
        const auto& rest = tear_.surface().rest_positions();
        double ahead = -radius;
        for (const auto& tip : tear_.tips()) {
            if (rest(0, tip.vertex) > ahead) ahead = rest(0, tip.vertex), held_ = tip.behind[1];
        }
        if (hand_of_ != nullptr) held_ = nearest_to(hand_of_->place());
        target_ = membrane::point(x_, held_);
    }
    void follow(std::span<const membrane::TearEvent<double>> events) {
        for (const auto& event : events) membrane::follow(event, springs_, foundation_, solver_, tree_);
    }

    const DrawnDisc* hand_of_;
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
    std::string name;                        ///< of the disc
    double seconds = 0, vertex_updates = 0;  ///< of a tick, medians
    double slow = 0;                         ///< time that one of 20 ticks exceeds [s]
    double torn = 0;                         ///< in all [m]
};

/// The bound on vertex updates of a disc that tears: some fewer than the whole one takes.
inline constexpr Index update_bound = 1300;
[[nodiscard]] inline std::string bounded_updates() { return std::to_string(update_bound) + " vertex updates at most"; }

/// The discs of `cost_of_ticks`, in order. Two whole ones have the hand of one that tears.
enum class Disc { hand_stays, one_tip, one_tip_runs, whole_as_one, two_tips, two_tips_run, whole_as_two, bounded, all };
inline constexpr std::size_t disc_count = 9;

/// Of whole discs; of one with one tip, and with two, that are too tough to tear, and that tear; of the one with two
/// tips and bounded updates, and with steps near convergence. They tick in turns: load of the machine affects all.
[[nodiscard]] inline std::array<TickCost, disc_count> cost_of_ticks(int ticks) {
    constexpr double weak = 30;  // [J/m^2]
    std::deque<DrawnDisc> discs;
    std::array<TickCost, disc_count> result;
    const auto add = [&](const std::string& name, const DrawnDiscOptions& options) {
        result[discs.size()].name = name;
        return &discs.emplace_back(options);
    };
    add("whole, the hand stays", {});
    add("one tip, not torn", {.cut = Cut::from_rim});
    const auto* const one_tip = add("one tip, runs", {.cut = Cut::from_rim, .toughness = weak});
    add("whole, under the same hand", {.hand_of = one_tip});
    add("two tips, not torn", {.cut = Cut::inside});
    const auto* const two_tips = add("two tips, run", {.cut = Cut::inside, .toughness = weak});
    add("whole, under the same hand", {.hand_of = two_tips});
    add("two tips, run, " + bounded_updates(),
        {.cut = Cut::inside, .toughness = weak, .solver = {.layers = 12, .max_vertex_updates = update_bound}});
    add("two tips, run, all layers, 8 sweeps",
        {.cut = Cut::inside, .toughness = weak, .solver = {.layers = membrane::unlimited, .sweeps = 8}});
    std::vector<std::vector<DrawnDisc::Tick>> measured(discs.size());
    constexpr int in_turn = 20;
    for (int done = 0; done < ticks; done += in_turn) {
        for (std::size_t i = 0; i < discs.size(); ++i) {
            for (int n = 0; n < in_turn; ++n) measured[i].push_back(discs[i].tick());
        }
    }
    for (std::size_t i = 0; i < result.size(); ++i) {
        const auto& all = measured[i];
        const auto quantile = [&](double DrawnDisc::Tick::*value, double part) {
            std::vector<double> values;
            for (const auto& tick : all) values.push_back(tick.*value);
            const auto at = static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size()));
            std::nth_element(values.begin(), values.begin() + at, values.end());
            return values[static_cast<std::size_t>(at)];
        };
        using Tick = DrawnDisc::Tick;
        auto& cost = result[i];
        cost.seconds = quantile(&Tick::seconds, 0.5);
        cost.vertex_updates = quantile(&Tick::vertex_updates, 0.5);
        cost.slow = quantile(&Tick::seconds, 0.95);
        for (const auto& tick : all) cost.torn += tick.torn;
    }
    return result;
}

}  // namespace bench::tears
