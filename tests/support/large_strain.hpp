// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/incompressible_triangle.hpp>
#include <membrane/tissue/pressure.hpp>
#include <membrane/tissue/tissue.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/eigenvalues.hpp"
#include "support/element_check.hpp"
#include "support/meshes.hpp"
#include "support/random.hpp"

/// Checks of the elements of an incompressible sheet against the continuum, at any strain.
namespace test {

/// Nominal stress, force per width at rest [N/m], of an incompressible isotropic sheet in plane stress; `slope` is the
/// derivative of its energy per area at rest by I1.
inline Eigen::Matrix2d isotropic_stress(const Eigen::Matrix2d& deformation, double slope) {
    const double thinner = 1 / deformation.determinant();
    const Eigen::Matrix2d left = deformation * deformation.transpose();
    return 2 * slope * (left - thinner * thinner * Eigen::Matrix2d::Identity()) * deformation.inverse().transpose();
}

/// I1 - 3 of an incompressible sheet.
inline double invariant(const Eigen::Matrix2d& deformation) {
    const double thinner = 1 / deformation.determinant();
    return (deformation.transpose() * deformation).trace() + thinner * thinner - 3;
}

inline Eigen::Matrix2d rotation_by(double angle) { return Eigen::Rotation2Dd(angle).toRotationMatrix(); }

/// A deformation with principal stretches in a range.
inline Eigen::Matrix2d random_deformation(Random& random, double from, double to) {
    const Eigen::Vector2d stretches(random.number(from, to), random.number(from, to));
    const double turn = 2 * std::numbers::pi;
    return rotation_by(random.number(0.0, turn)) * stretches.asDiagonal() * rotation_by(random.number(0.0, turn));
}

/// A triangle at rest in the plane z = 0, its edge from corner 0 to 1 along the first axis, and deformed in space.
struct DeformedTriangle {
    DeformedTriangle(Random& random, double size, const Eigen::Matrix2d& f) : deformation(f) {
        const double base = size * random.number(0.5, 2.0), height = size * random.number(0.5, 2.0);
        rest = {Vector(0, 0, 0), Vector(base, 0, 0), Vector(base * random.number(-0.5, 1.5), height, 0)};
        const Eigen::Matrix3d turn = random.rotation();
        const Eigen::Vector3d shift = size * random.vector();
        for (std::size_t i = 0; i < 3; ++i) {
            const Eigen::Vector2d flat = f * rest[i].eigen().head<2>();
            now[i] = Vector(Eigen::Vector3d(turn * Eigen::Vector3d(flat[0], flat[1], 0) + shift));
        }
        area = base * height / 2;
        smallest = std::numeric_limits<double>::infinity();
        for (std::size_t i = 0; i < 3; ++i) {
            const double edge = membrane::norm<double>(now[i] - now[(i + 1) % 3]);
            smallest = (std::min)(smallest, 2 * area * std::abs(f.determinant()) / edge);
        }
    }

    membrane::TriangleMesh<double> mesh() const {
        membrane::Points<double> x(3, 3);
        x << rest[0].eigen(), rest[1].eigen(), rest[2].eigen();
        return {x, membrane::Triangles(Eigen::Vector3i(0, 1, 2))};
    }

    using Vector = membrane::Vector3<double>;
    Eigen::Matrix2d deformation;
    membrane::Corners<double, 3> rest, now;
    double area, smallest;  // at rest; the smallest height now
};

/// In the plane of any sheet: where `deformation` takes the mesh, turned in space by `turn`.
inline membrane::Points<double> deformed(const membrane::TriangleMesh<double>& mesh, const Eigen::Matrix2d& deformation,
                                         const Eigen::Matrix3d& turn = Eigen::Matrix3d::Identity()) {
    membrane::Points<double> x = mesh.positions();
    x.topRows<2>() = deformation * mesh.positions().topRows<2>();
    return turn * x;
}

/// Height to which a pressure [Pa] blows up a flat sheet that is clamped at a circle of 1 m; `slope(strain)` is the
/// derivative of its energy per area at rest by the invariant. Equilibrium of a membrane of revolution by shooting: at
/// the distance S from the middle at rest the state is the radius, the height below the middle and the meridian
/// tension T, with T' = (circumferential tension - T) r' / r, and the vertical load gives the slope, 2 T sin = p r.
template <class Slope>
double inflated_height(const Slope& slope, double pressure) {
    struct State {
        double radius, depth, tension;
    };
    const auto tension = [&](double along, double across) {
        const double thinner = 1 / (along * across), square = thinner * thinner;
        return 2 * slope(along * along + across * across + square - 3) * (along * along - square) * thinner;
    };
    const auto meridian = [&](double across, double wanted) {  // stretch for a tension
        double low = 0.1, high = 10;
        for (int i = 0; i < 60; ++i) {
            const double middle = (low + high) / 2;
            (tension(middle, across) < wanted ? low : high) = middle;
        }
        return low;
    };
    const auto rate = [&](double s, const State& state) -> State {
        const double across = state.radius / s, along = meridian(across, state.tension);
        const double sine = (std::min)(pressure * state.radius / (2 * state.tension), 1.0);
        const double outward = along * std::sqrt(1 - sine * sine);
        return {outward, along * sine, (tension(across, along) - state.tension) * outward / state.radius};
    };
    constexpr int steps = 400;
    const auto shoot = [&](double stretch) {
        double s = 1e-4;
        const double h = (1 - s) / steps;
        State state{stretch * s, 0, tension(stretch, stretch)};
        const auto moved = [&](const State& by, double part) -> State {
            return {state.radius + part * by.radius, state.depth + part * by.depth, state.tension + part * by.tension};
        };
        for (int i = 0; i < steps; ++i, s += h) {  // Runge and Kutta's method
            const State a = rate(s, state), b = rate(s + h / 2, moved(a, h / 2)), c = rate(s + h / 2, moved(b, h / 2));
            const State d = rate(s + h, moved(c, h));
            state = moved({(a.radius + 2 * b.radius + 2 * c.radius + d.radius) / 6,
                           (a.depth + 2 * b.depth + 2 * c.depth + d.depth) / 6,
                           (a.tension + 2 * b.tension + 2 * c.tension + d.tension) / 6},
                          h);
        }
        return state;
    };
    double low = 1.0005, high = 1.5;
    for (int i = 0; i < 40; ++i) {
        const double middle = (low + high) / 2;
        (shoot(middle).radius < 1 ? low : high) = middle;
    }
    return shoot(low).depth;
}

/// The same by the elements that `make` puts on a disc.
template <class Make>
double inflated_height_of(const Make& make, double pressure, membrane::Index rings) {
    const auto mesh = membrane::disc({.radius = 1, .rings = rings});
    const membrane::MassSpringNetwork<double, membrane::LinearSpring> springs(
        mesh, membrane::LinearSpring{}, {.stiffness = 0.0, .pinned = membrane::border(mesh)});
    membrane::Points<double> x = mesh.positions();
    for (membrane::Index v = 0; v < mesh.vertex_count(); ++v) x(2, v) = 0.2 * (1 - x.col(v).squaredNorm());
    const auto tissue = membrane::Tissue(springs, make(mesh), membrane::pressure(mesh, pressure));
    const auto rest = membrane::equilibrium(x, mesh, tissue, membrane::NoFoundation{}, {});
    REQUIRE(rest.converged);
    return rest.x(2, 0);
}

/// The energy for a strain continues beyond `limit` with its first two derivatives, which are those of the energy on
/// both sides.
template <class E>
void check_response(const E& element, double limit) {
    const auto before = element.response(limit * (1 - 1e-9)), after = element.response(limit * (1 + 1e-9));
    REQUIRE(after.energy == Approx(before.energy).epsilon(1e-6));
    REQUIRE(after.slope == Approx(before.slope).epsilon(1e-6));
    REQUIRE(after.curvature == Approx(before.curvature).epsilon(1e-6));
    for (const double strain : {0.3 * limit, 2 * limit}) {
        const double h = 1e-5 * limit;
        const auto low = element.response(strain - h), here = element.response(strain),
                   high = element.response(strain + h);
        REQUIRE(here.slope == Approx((high.energy - low.energy) / (2 * h)).epsilon(1e-6));
        REQUIRE(here.curvature == Approx((high.slope - low.slope) / (2 * h)).epsilon(1e-6));
    }
}

inline membrane::MassSpringNetwork<double, membrane::LinearSpring> no_springs(
    const membrane::TriangleMesh<double>& mesh) {
    return {mesh, membrane::LinearSpring{}, {.stiffness = 0.0}};
}

/// The nominal stress of a deformed patch, from the forces on its vertices; those inside must be in balance.
template <class Kind>
void check_patch(const membrane::TriangleMesh<double>& mesh, const Kind& elements, const Eigen::Matrix2d& deformation,
                 const Eigen::Matrix2d& stress, double modulus, Random& random) {
    const auto tissue = membrane::Tissue(no_springs(mesh), elements);
    const Eigen::Matrix3d turn = random.rotation();
    const membrane::Points<double> x = deformed(mesh, deformation, turn);
    const auto rim = membrane::border(mesh);
    const double scale = 1e-9 * (modulus + stress.norm());
    Eigen::Matrix2d found = Eigen::Matrix2d::Zero();  // by the virial, of a sheet of area 1
    for (membrane::Index v = 0; v < mesh.vertex_count(); ++v) {
        const Eigen::Vector3d force = turn.transpose() * tissue.force_on(v, x).force.eigen();
        found -= force.head<2>() * mesh.positions().col(v).head<2>().transpose();
        const bool inside = std::find(rim.begin(), rim.end(), v) == rim.end();
        if (inside) REQUIRE(force.norm() < scale);
    }
    CAPTURE(found, stress);
    REQUIRE((found - stress).norm() < scale);
}

/// A moved and turned triangle has the same energy and turned forces, and an element has no net force or torque.
template <class E>
void check_rigid_motion(const E& element, const membrane::Corners<double, 3>& x, double size, double energy,
                        Random& random) {
    const Eigen::Matrix3d turn = random.rotation();
    const Eigen::Vector3d shift = size * random.vector();
    membrane::Corners<double, 3> moved;
    for (std::size_t i = 0; i < 3; ++i) moved[i] = Eigen::Vector3d(turn * x[i].eigen() + shift);
    REQUIRE(std::abs(element.energy(moved) - element.energy(x)) < 1e-11 * energy);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero(), torque = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < 3; ++i) {
        const Eigen::Vector3d force = element.force_on(x, i).force, there = element.force_on(moved, i).force;
        REQUIRE((turn * force - there).norm() < 1e-11 * energy / size);
        sum += force;
        torque += x[i].eigen().cross(force);
    }
    REQUIRE(sum.norm() < 1e-11 * energy / size);
    REQUIRE(torque.norm() < 1e-11 * energy);
}

/// Where corners of a triangle of about 1 m must not be, but may: in one point or on one line, next to each other, as
/// far away as `far`.
template <membrane::Real S>
membrane::Corners<S, 3> wild_corners(Random& random, S far) {
    using Limits = std::numeric_limits<S>;
    const std::array<S, 10> numbers{0,
                                    S(-0.0),
                                    1,
                                    S(-1),
                                    S(1) + Limits::epsilon(),
                                    Limits::denorm_min(),
                                    far,
                                    -far / 3,
                                    (Limits::min)(),
                                    std::sqrt((Limits::min)())};
    membrane::Corners<S, 3> x;
    for (auto& corner : x) {
        for (int k = 0; k < 3; ++k) {
            const bool any = random.chance(0.2);
            corner[k] = any ? random.number<S>(-2, 2) : numbers[static_cast<std::size_t>(random.index(10))];
        }
    }
    if (random.chance(0.2)) x[1] = x[0];
    if (random.chance(0.2)) x[2] = x[1];
    if (random.chance(0.2)) x[2] = (x[0] + x[1]) / S(2);
    return x;
}

/// All results are finite wherever the corners are, and the Hessian is positive semidefinite.
template <class E, membrane::Real S>
void check_finite(const E& element, const membrane::Corners<S, 3>& x, const membrane::Vector3<S>& displacement) {
    REQUIRE(membrane::is_finite(element.energy(x)));
    REQUIRE(membrane::is_finite(element.mean_tension(x)));
    for (std::size_t i = 0; i < 3; ++i) {
        const auto corner = element.force_on(x, i);
        REQUIRE(membrane::is_finite(corner.force));
        const Eigen::Matrix3d hessian = dense(corner.hessian).template cast<double>();
        REQUIRE(membrane::is_finite(hessian));
        const double epsilon = static_cast<double>(std::numeric_limits<S>::epsilon());
        REQUIRE(eigenvalues_of(hessian)[0] >= -16 * epsilon * hessian.norm());
        const auto change = element.energy_change(x, i, displacement);
        REQUIRE((membrane::is_finite(change.change) && membrane::is_finite(change.size)));
        if constexpr (sizeof(S) == sizeof(double)) {
            for (std::size_t j = 0; j < 3; ++j) REQUIRE(membrane::is_finite(element.hessian_block(x, i, j)));
        }
    }
}

/// An element whose constants are all zero, as in a lane without one: nothing, with all corners at one point.
template <class E>
void check_nothing(Random& random) {
    const membrane::Vector3<double> at = random.vector(), displacement = random.vector();
    const membrane::Corners<double, 3> x{at, at, at};
    const E nothing{};
    REQUIRE(nothing.energy(x) == 0);
    for (std::size_t i = 0; i < 3; ++i) {
        REQUIRE(nothing.force_on(x, i).force == membrane::Vector3<double>::Zero());
        REQUIRE(nothing.force_on(x, i).hessian.trace() == 0);
        const auto change = nothing.energy_change(x, i, displacement);
        REQUIRE((change.change == 0 && change.size == 0));
    }
}

template <class Get, class E>
auto side_by_side(const std::array<E, membrane::Lanes<double>::count>& all, const Get& number) {
    return membrane::Lanes<double>::of([&](std::size_t l) { return number(all[l]); });
}

template <class E>
membrane::IncompressibleTriangle<membrane::Lanes<double>> rest_shapes(
    const std::array<E, membrane::Lanes<double>::count>& all) {
    return {side_by_side(all, [](const E& e) { return e.rest.along; }),
            side_by_side(all, [](const E& e) { return e.rest.skew; }),
            side_by_side(all, [](const E& e) { return e.rest.across; })};
}

/// A square sheet, clamped at its left edge, under the loads of `stress` on all edges comes to equilibrium
/// in the shape of `deformation`, if `stress` belongs to it.
template <class... Kinds>
void check_equilibrium(const membrane::TriangleMesh<double>& mesh, const Eigen::Matrix2d& deformation,
                       const Eigen::Matrix2d& stress, Random& random, const Kinds&... elements) {
    std::vector<membrane::Index> clamped;
    for (membrane::Index v = 0; v < mesh.vertex_count(); ++v) {
        if (mesh.positions()(0, v) < -0.5 + 1e-9) clamped.push_back(v);
    }
    const membrane::MassSpringNetwork<double, membrane::LinearSpring> springs(mesh, membrane::LinearSpring{},
                                                                              {.stiffness = 0.0, .pinned = clamped});
    membrane::Points<double> loads = membrane::Points<double>::Zero(3, mesh.vertex_count());
    const auto rim = membrane::border(mesh);  // counter-clockwise, of a sheet with equal edges
    for (const membrane::Index v : rim) {
        for (const membrane::Index w : rim) {
            const Eigen::Vector2d edge = (mesh.positions().col(w) - mesh.positions().col(v)).head<2>();
            const Eigen::Vector2d middle = (mesh.positions().col(w) + mesh.positions().col(v)).head<2>() / 2;
            const bool on_edge = std::abs(middle.cwiseAbs().maxCoeff() - 0.5) < 1e-9;
            const double side = 1 / std::round(static_cast<double>(rim.size()) / 4);
            if (v >= w || !on_edge || std::abs(edge.norm() - side) > 1e-9) continue;
            const Eigen::Vector2d normal = std::abs(edge[0]) > std::abs(edge[1])
                                               ? Eigen::Vector2d(0, middle[1] > 0 ? 1 : -1)
                                               : Eigen::Vector2d(middle[0] > 0 ? 1 : -1, 0);
            loads.col(v).head<2>() += side / 2 * stress * normal;
            loads.col(w).head<2>() += side / 2 * stress * normal;
        }
    }
    using Loads = membrane::Elements<double, membrane::DeadLoad<double>>;
    std::vector<Loads::Instance> all;
    for (membrane::Index v = 0; v < mesh.vertex_count(); ++v) all.push_back({{v}, {loads.col(v)}});
    const auto tissue = membrane::Tissue(springs, elements..., Loads(mesh, all));
    const membrane::Points<double> expected = deformed(mesh, deformation);
    membrane::Points<double> x = jittered(expected, 0.02, random);
    for (const membrane::Index v : clamped) x.col(v) = expected.col(v);
    const auto rest = membrane::equilibrium(x, mesh, tissue, membrane::NoFoundation{}, {});
    REQUIRE(rest.converged);
    REQUIRE((rest.x - expected).colwise().norm().maxCoeff() < 1e-6);
}

/// No step of the solver raises the energy of a ball of the elements on a foundation, however wild the start.
template <class Make>
void check_descent(const Make& make, Random& random) {
    const auto mesh = membrane::icosphere({.radius = 0.01, .subdivisions = 1});
    const auto elements = make(mesh);
    const auto tissue = membrane::Tissue(no_springs(mesh), elements);
    const membrane::VirtualVolumeSprings<double> foundation(mesh, {.stiffness = random.number(0.5, 3.0)});
    const auto energy = [&](const membrane::Points<double>& x) {
        double sum = 0;
        for (const auto& instance : elements.all()) sum += instance.element.energy(instance.where(x));
        for (membrane::Index v = 0; v < x.cols(); ++v) sum += foundation.energy(v, x.col(v));
        return sum;
    };
    membrane::QuasiStaticSolver solver(tissue, {.layers = membrane::unlimited, .sweeps = 1, .predict = false});
    membrane::Points<double> x = jittered(mesh.positions(), random.number(0.0, 0.02), random);
    double before = energy(x);
    const double start = before;
    solver.wake_all();
    for (int step = 0; step < 20; ++step) {
        const auto report = solver.step(x, 1e-3, tissue, foundation);
        REQUIRE(report.status == membrane::StepStatus::advanced);
        const double after = energy(x);
        CAPTURE(step, before, after);
        REQUIRE(after <= before + 1e-10 * std::abs(before));
        before = after;
    }
    REQUIRE(before < 0.7 * start);
}

}  // namespace test
