// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/tear/tearable_springs.hpp>
#include <membrane/tear/tearing.hpp>
#include <membrane/tissue/material.hpp>
#include <membrane/tissue/spring_stiffness.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/fluid.hpp"
#include "support/hand_work.hpp"
#include "support/turned_grid.hpp"

/// A flat sheet that two hands tear, and the energy that they give.
///
///     test::TornSheet sheet(mesh, {.hands = {bottom, top}, .tolerance = 1e-6}, membrane::EnergyRelease{1e3, 1e-5});
///     sheet.cut({0, 10e-3, 0}, {1, 0, 0}, 12);
///     while (sheet.tear.torn_length() < 5e-3) sheet.tick({Vector3<double>(0, 0, 0), Vector3<double>(0, 1e-5, 0)});
namespace test {

inline constexpr membrane::Material torn_material{.young_modulus = 1e6, .poisson_ratio = 0.3, .thickness = 1e-5};

struct TornSheetOptions {
    std::array<std::vector<membrane::Index>, 2> hands;  ///< the vertices that each holds
    std::vector<membrane::Index> fixed = {};            ///< vertices that never move
    double tolerance;                                   ///< residual force that counts as none [N]
    bool springs = false;                               ///< a network of springs in place of a continuous sheet
    double drag = 0;                                    ///< of a fluid, on each vertex [N s/m]
    membrane::Index sweeps = 6;                         ///< of a step
    membrane::Index steps = 20;                         ///< of a tick, at most
    membrane::TearOptions tear = {};                    ///< how it tears
    membrane::Material material = torn_material;        ///< of the sheet
};

inline constexpr double torn_tick = 1e-3;  ///< [s]

/// The drag on a vertex that over the time of a tick is `relative` times the stiffness of a membrane of `torn_material`
/// there, young_modulus x thickness whatever the mesh [N s/m].
[[nodiscard]] constexpr double drag_of_stiffness(double relative) {
    return relative * torn_material.young_modulus * torn_material.thickness * torn_tick;
}

/// The vertices of a mesh without a reserve at which `is_in(position at rest)`.
template <membrane::Real Scalar, class IsIn>
[[nodiscard]] std::vector<membrane::Index> vertices_where(const membrane::TriangleMesh<Scalar>& mesh,
                                                          const IsIn& is_in) {
    std::vector<membrane::Index> result;
    for (membrane::Index v = 0; v < mesh.vertex_count(); ++v) {
        if (is_in(membrane::point(mesh.positions(), v))) result.push_back(v);
    }
    return result;
}

/// The energy that all elements of a tissue store [J].
template <class Tissue, class Positions>
[[nodiscard]] double stored_in(const Tissue& tissue, const Positions& x) {
    double sum = 0;
    tissue.for_each_element(
        [&](const auto& instance) { sum += static_cast<double>(instance.element.energy(instance.where(x))); });
    return sum;
}

/// Triangular springs and `Others`, elements that follow a tear.
template <membrane::Real Scalar, class Criterion = membrane::EnergyRelease, class... Others>
class TornSheet {
    using Springs = membrane::TearableSprings<Scalar, membrane::LinearSpring>;
    using Triangles = membrane::Elements<Scalar, membrane::TriangularSpring<Scalar>>;

  public:
    using Index = membrane::Index;
    using Vector = membrane::Vector3<Scalar>;
    using Tissue = membrane::Tissue<Springs, Triangles, Others...>;
    static constexpr auto dt = static_cast<Scalar>(torn_tick);  ///< [s]

    /// `reserved` is a mesh with a reserve, of which `others` are too.
    TornSheet(const membrane::TriangleMesh<Scalar>& reserved, const TornSheetOptions& options,
              const Criterion& criterion, Others... others)
        : options_(options),
          fluid_(static_cast<Scalar>(options.drag), reserved.vertex_count()),
          hands(options.hands),
          mesh(reserved),
          tissue(springs_of(mesh, options), triangles_of(mesh, options), others...),
          tear(mesh, criterion, options.tear),
          solver(tissue, {.layers = membrane::unlimited, .sweeps = options.sweeps, .predict = false}),
          x(mesh.positions()) {}

    /// Cuts from the vertex nearest to `from` as nearly as possible along a line; `parts` follow.
    template <class... Parts>
    void cut(const Vector& from, const Vector& direction, int edges, Parts&... parts) {
        const auto& rest = tear.surface().rest_positions();
        const auto off = [&](Index v) { return norm<Scalar>(membrane::point(rest, v) - from); };
        auto& path = cut_path;
        path = {0};
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            if (off(v) < off(path[0])) path[0] = v;
        }
        const Vector start = membrane::point(rest, path[0]);
        const Scalar edge = tear.surface().mean_edge(path[0]);
        for (int i = 0; i < edges; ++i) {
            const Vector at = membrane::point(rest, path.back()) - start;
            const Vector aside = dot(at, direction) * direction - at;
            path.push_back(tear.surface().nearest_in_direction(path.back(), direction + (1 / edge) * aside));
        }
        const auto events = tear.cut_along(path, x);
        if (events.empty()) throw std::runtime_error("the sheet cannot be cut there");
        follow(events, parts...);
    }

    /// Takes the present positions as where the hands are, once they are at equilibrium.
    void start() {
        fluid_ = {Scalar(0), x.cols()};
        relax(5000);
        work = stored();
        relaxed = 0;
        fluid_ = {static_cast<Scalar>(options_.drag), x.cols()};
    }

    /// The hands move; the membrane follows, up to the tolerance or the number of steps; and what tears then.
    void tick(const std::array<Vector, 2>& displacements) {
        const auto before = forces;
        const auto halfway = forces_alone(displacements, Scalar(0.5)), alone = forces_alone(displacements, Scalar(1));
        move(x, displacements, Scalar(1));
        relax(options_.steps);
        for (std::size_t i = 0; i < 2; ++i) {
            const auto hand = hand_work<Scalar>(displacements[i], before[i], halfway[i], alone[i], forces[i]);
            work += hand.smooth;
            relaxed -= hand.excess();
        }
        update();
    }

    /// Edges open, tips advance. Vertices that a tear moves onto its path give the membrane energy, which the next step
    /// takes.
    void update() {
        const double before = stored_in(tissue, x);
        follow(tear.update(x, dt, tissue, none));
        relaxed += before - stored_in(tissue, x);
    }

    /// Whether the forces balance.
    [[nodiscard]] bool at_rest() const { return static_cast<double>(report.residual) < options_.tolerance; }

    /// In the membrane and in opening edges [J].
    [[nodiscard]] double stored() const { return stored_in(tissue, x) + tear.stored(x); }

    /// What the hands gave and nothing has taken [J]. `relaxed` closes the balance, whatever the solver does, if the
    /// forces on the hands belong to the energies and the tear loses none.
    [[nodiscard]] double lost() const { return work - stored() - tear.dissipated() - damped() - relaxed; }

    /// Taken by the drag [J].
    [[nodiscard]] double damped() const { return fluid_.taken(); }

  private:
    static Springs springs_of(const membrane::TriangleMesh<Scalar>& mesh, const TornSheetOptions& options) {
        membrane::NetworkOptions<Scalar> network{.stiffness = Scalar(0), .pinned = options.fixed};
        if (options.springs) network.stiffness = membrane::spring_stiffnesses(mesh, options.material);
        return Springs(mesh, membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, network));
    }
    static Triangles triangles_of(const membrane::TriangleMesh<Scalar>& mesh, const TornSheetOptions& options) {
        auto material = options.material;
        if (options.springs) material.young_modulus *= 1e-9;  // as good as none
        return membrane::triangular_springs(mesh, material);
    }
    void move(membrane::Points<Scalar>& points, const std::array<Vector, 2>& displacements, Scalar part) const {
        for (std::size_t i = 0; i < 2; ++i) {
            for (const Index v : hands[i]) points.col(v) += Eigen::Matrix<Scalar, 3, 1>(part * displacements[i]);
        }
    }
    // Of the hands, if they moved by this part and the membrane did not follow [N].
    [[nodiscard]] std::array<Vector, 2> forces_alone(const std::array<Vector, 2>& displacements, Scalar part) const {
        membrane::Points<Scalar> moved = x;
        move(moved, displacements, part);
        std::array<Vector, 2> sums{Vector::Zero(), Vector::Zero()};
        for (std::size_t i = 0; i < 2; ++i) {
            for (const Index v : hands[i]) sums[i] -= tissue.force_on(v, moved).force;
        }
        return sums;
    }
    // What the membrane stores, and what its opening edges store and have taken [J].
    [[nodiscard]] double taken_up() const {
        double sum = stored_in(tissue, x);
        for (auto ligament : tear.ligaments().ligaments) {
            const auto apart = membrane::point(x, ligament.vertex) - membrane::point(x, ligament.copy);
            ligament.open(norm<Scalar>(apart));
            sum += static_cast<double>(ligament.dissipated + ligament.stored(ligament.opening));
        }
        return sum;
    }
    // Without a fluid only the equilibrium matters: steps extrapolate the last ones, as long as the residual force
    // decreases [Nesterov83].
    void relax(int steps) {
        relaxed += taken_up() + damped();
        membrane::Points<Scalar> last = x;
        Scalar residual = std::numeric_limits<Scalar>::infinity();
        for (int i = 0, in_turn = 0; i < steps; ++i) {
            solver.wake_all();
            report = fluid_.step(solver, x, dt, tissue, none, membrane::pin(hands[0]), membrane::pin(hands[1]),
                                 tear.ligaments());
            if (report.status != membrane::StepStatus::advanced) throw std::runtime_error("a step was refused");
            if (at_rest() || i + 1 == steps) break;
            if (fluid_.drag() > 0) continue;
            in_turn = report.residual < std::exchange(residual, report.residual) ? in_turn + 1 : 0;
            const membrane::Points<Scalar> now = x;
            x += static_cast<Scalar>(in_turn / (in_turn + 3.0)) * (now - last);
            last = now;
        }
        relaxed -= taken_up() + damped();
        for (std::size_t i = 0; i < 2; ++i) forces[i] = -report.reactions[i];
    }
    template <class... Parts>
    void follow(std::span<const membrane::TearEvent<Scalar>> events, Parts&... parts) {
        for (const auto& event : events) membrane::follow(event, tissue, solver, parts...);
    }

    static constexpr membrane::NoFoundation none{};
    TornSheetOptions options_;
    examples::Fluid<Scalar> fluid_;

  public:
    std::array<std::vector<Index>, 2> hands;  ///< the vertices that each holds
    membrane::TriangleMesh<Scalar> mesh;
    Tissue tissue;
    membrane::Tearing<Scalar, Criterion> tear;
    membrane::QuasiStaticSolver<Scalar> solver;
    membrane::Points<Scalar> x;
    membrane::StepReport<Scalar> report;
    std::vector<Index> cut_path;
    std::array<Vector, 2> forces{};  ///< of the hands [N]
    double work = 0;                 ///< of the hands [J]
    double relaxed = 0;              ///< taken by the steps: in jumps, or by what they leave unbalanced [J]
};

}  // namespace test
