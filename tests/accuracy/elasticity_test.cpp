// SPDX-License-Identifier: MIT
#include <membrane/accuracy/elasticity.hpp>

#include <array>
#include <cmath>
#include <vector>

#include <membrane/model/moving_foundation.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/foundation_layer.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/spring_law_check.hpp"

using namespace membrane;

namespace {

constexpr double h = 1e-6;

/// The matrix of a system of all vertices, column by column: fixed ones take unit steps.
template <class Model>
Eigen::MatrixXd stiffness_of(const Model& elasticity, const ElasticState& state) {
    const auto vertices = static_cast<Index>(state.x.cols());
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3 * vertices, 3 * vertices);
    for (Index v = 0; v < vertices; ++v) {
        // Vertex v alone is free, and held by a spring of its own so stiff that its step is the force on it.
        std::vector<unsigned char> fixed(static_cast<std::size_t>(vertices), 1);
        fixed[static_cast<std::size_t>(v)] = 0;
        for (Index i = 0; i < 3 * vertices; ++i) {
            if (i / 3 == v) continue;
            NewtonSystem system(fixed);
            Points<double> unit = Points<double>::Zero(3, vertices);
            unit.reshaped()[i] = 1;
            system.open(unit);
            elasticity.add_stiffness(state, system);
            system.add(v, v, 1e9 * Eigen::Matrix3d::Identity());
            H.block<3, 1>(3 * v, i) = -1e9 * system.solve(1e9).step.col(v);
        }
    }
    return H;
}

template <class Law>
void check_derivatives(const Law& law, int seed) {
    test::Random random(static_cast<std::uint64_t>(seed));
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    const MassSpringNetwork network(mesh, law, {.stiffness = 2.0});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 0.7, .damping = 5.0});
    Elasticity elasticity(network, foundation);
    const Points<double> x = test::jittered<double>(mesh.positions(), 0.1, random);
    const auto here = elasticity.at(x);
    const auto H = stiffness_of(elasticity, here);
    double stiffest = 0;
    for (const auto& spring : network.springs()) {
        const double length = (x.col(spring.second) - x.col(spring.first)).norm();
        const auto response = law(SpringState<double>{spring.stiffness, spring.rest_length, length});
        stiffest = std::max(stiffest, response.stiffness);
    }
    CHECK(elasticity.largest_stiffness(here) == Approx(stiffest));
    CHECK(here.energy == Approx(network.energy(x)));
    for (Index i = 0; i < x.size(); ++i) {
        CAPTURE(i);
        Points<double> more = x, less = x;
        more.reshaped()[i] += h;
        less.reshaped()[i] -= h;
        const auto after = elasticity.at(more), before = elasticity.at(less);
        const double force = here.springs.reshaped()[i] + here.foundation.reshaped()[i];
        CHECK(elasticity.energy_change(before, after) / (2 * h) == Approx(-force).margin(1e-8));
        const Points<double> slope = (after.springs + after.foundation - before.springs - before.foundation) / (2 * h);
        for (Index j = 0; j < x.size(); ++j) {
            if (i / 3 != j / 3) CHECK(-slope.reshaped()[j] == Approx(H(j, i)).epsilon(1e-5).margin(1e-5));
        }
    }
}

/// A foundation that pulls less and less.
struct Saturating {
    template <Real Scalar>
    [[nodiscard]] VertexForce<Scalar> force_on(Index, const Vector3<Scalar>& position, const Vector3<Scalar>&,
                                               Scalar) const noexcept {
        return {-position / (1 + squared_norm(position)), 1};
    }
};

}  // namespace

TEST_CASE("forces are the slopes of energies, stiffnesses those of forces", "[elasticity]") {
    for (int seed = 1; seed <= 3; ++seed) {
        CAPTURE(seed);
        check_derivatives(LinearSpring{}, seed);
        check_derivatives(ExponentialSpring{.stiffening = 4}, seed);
        check_derivatives(test::CubicSpring{}, seed);
    }
}

TEST_CASE("forces are those of network and foundation without damping", "[elasticity]") {
    test::Random random(1);
    const auto mesh = icosphere({.radius = 0.01, .subdivisions = 2});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0});
    const VirtualVolumeSprings damped(mesh, {.stiffness = 8.0, .damping = 0.5});
    const VirtualVolumeSprings undamped(mesh, {.stiffness = 8.0});
    const Points<double> x = test::jittered<double>(mesh.positions(), 1e-3, random);
    const Points<double> anchors = test::jittered<double>(mesh.positions(), 1e-3, random);
    MovingBody body(mesh);
    Points<double> along = mesh.positions();
    REQUIRE(body.move_to(anchors, 1, along));
    const auto moved = on(body, damped);
    const auto state = Elasticity(network, damped).at(x), state_moved = Elasticity(network, moved).at(x);
    double largest = 0;
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        const auto here = point(x, v);
        CHECK((state.springs.col(v) - network.force_on(v, x).force).norm() < 1e-15);
        CHECK((state.foundation.col(v) - undamped.force_on(v, here, here, 1.0).force).norm() == 0);
        CHECK((state_moved.foundation.col(v) - 8 * (anchors.col(v) - here)).norm() < 1e-15);
        largest = std::max(largest, state.foundation.col(v).norm());
    }
    for (Index s = 0; s < static_cast<Index>(network.springs().size()); ++s) {
        largest = std::max(largest, std::abs(network.tension(s, x)));
    }
    CHECK(state.largest_force == Approx(largest).epsilon(1e-14));
}

TEST_CASE("network and foundation of floats are evaluated in double", "[elasticity]") {
    for (int seed = 1; seed <= 20; ++seed) {
        CAPTURE(seed);
        test::Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = icosphere<float>({.radius = 0.01F, .subdivisions = 1});
        const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 40.0F});
        const VirtualVolumeSprings volume(mesh, {.stiffness = 7.3F, .damping = 0.02F});
        const FoundationSprings foundation(mesh, {.normal = 7.3F, .tangential = 2.1F, .recovery_time = 0.1F});
        MovingBody body(mesh);
        Points<float> along = mesh.positions();
        REQUIRE(body.move_to(test::jittered<float>(along, 1e-4F, random), 1e-3F, along));
        const Points<double> x = test::jittered<double>(mesh.positions().cast<double>(), 1e-3, random);
        const auto check = [&](const auto& model, const Points<float>& anchors, auto stiffness) {
            const auto state = Elasticity(network, model).at(x);
            for (Index v = 0; v < mesh.vertex_count(); ++v) {
                const Eigen::Vector3d displacement = anchors.col(v).cast<double>() - x.col(v);
                const Eigen::Vector3d exact = stiffness(v) * displacement;
                CHECK((state.foundation.col(v) - exact).norm() <= 2e-15 * exact.norm());
            }
        };
        const auto springs = [](Index) -> Eigen::Matrix3d { return double(7.3F) * Eigen::Matrix3d::Identity(); };
        check(volume, mesh.positions(), springs);
        check(foundation, mesh.positions(), [&](Index v) -> Eigen::Matrix3d {
            const Eigen::Vector3d n = foundation.normals().col(v).cast<double>();
            const double normal = double(7.3F), tangential = double(2.1F);
            return tangential * Eigen::Matrix3d::Identity() + (normal - tangential) * n * n.transpose();
        });
        const auto moved = on(body, volume);
        const auto state = Elasticity(network, moved).at(x);
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            const Eigen::Vector3d exact = double(7.3F) * (body.anchors().col(v).cast<double>() - x.col(v));
            CHECK((state.foundation.col(v) - exact).norm() <= 2e-15 * exact.norm());
        }
    }
}

TEST_CASE("a network of floats has smooth forces in double", "[elasticity]") {
    test::Random random(1);
    const auto mesh = icosphere<float>({.radius = 1, .subdivisions = 1});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0F});
    const VirtualVolumeSprings foundation(mesh, {.stiffness = 0.5F});
    Elasticity elasticity(network, foundation);
    const Points<double> x = test::jittered<double>(mesh.positions().cast<double>(), 0.1, random);
    const auto here = elasticity.at(x);
    const Points<double> displacement = test::jittered<double>(Points<double>::Zero(3, x.cols()), 1e-9, random);
    const auto there = elasticity.at(x + displacement);
    CHECK(((there.foundation - here.foundation) + 0.5 * displacement).norm() < 1e-15);
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        const Vector3<double> exact = -0.5 * (x.col(v) - mesh.positions().col(v).cast<double>());
        CHECK((here.foundation.col(v) - exact).norm() < 1e-6 * exact.norm());
    }
}

TEST_CASE("a spring without length has no force and no energy that is not finite", "[elasticity]") {
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    const MassSpringNetwork network(mesh, test::CubicSpring{}, {.stiffness = 1.0});
    Elasticity elasticity(network, NoFoundation{});
    const Points<double> at_one_place = Points<double>::Zero(3, mesh.vertex_count());
    const auto state = elasticity.at(at_one_place);
    CHECK(state.springs.isZero(0));
    CHECK(state.foundation.isZero(0));
    CHECK(is_finite(state.energy));
    CHECK(is_finite(elasticity.largest_stiffness(state)));
}

TEST_CASE("a foundation of one's own is asked wherever it is", "[elasticity]") {
    test::Random random(1);
    const auto mesh = icosphere({.radius = 1, .subdivisions = 0});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 1.0});
    const Saturating foundation;
    Elasticity elasticity(network, foundation);
    for (int i = 0; i < 10; ++i) {
        const Points<double> x = test::jittered<double>(mesh.positions(), 0.5, random);
        const auto state = elasticity.at(x);
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            const Vector3<double> expected = -x.col(v) / (1 + x.col(v).squaredNorm());
            CHECK((state.foundation.col(v) - expected).norm() < 1e-14);
        }
    }
}

TEST_CASE("a foundation that is not alike in all directions yields as its stiffness says", "[elasticity]") {
    test::Random random(1);
    const auto mesh = icosphere({.radius = 1, .subdivisions = 1});
    const MassSpringNetwork network(mesh, LinearSpring{}, {.stiffness = 0.0});
    const FoundationSprings foundation(mesh, {.normal = 7.0, .tangential = 0.3, .recovery_time = 5.0});
    Elasticity elasticity(network, foundation);
    const auto rest = elasticity.at(mesh.positions());
    CHECK(elasticity.largest_stiffness(rest) == Approx(7));
    NewtonSystem system(std::vector<unsigned char>(static_cast<std::size_t>(mesh.vertex_count()), 0));
    system.open(Points<double>::Zero(3, mesh.vertex_count()));
    elasticity.add_stiffness(rest, system);
    Points<double> force = Points<double>::Zero(3, mesh.vertex_count());
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        force.col(v) = random.vector();
        system.add_force(v, force.col(v));
    }
    const Points<double> step = system.solve(7).step;
    const auto there = elasticity.at(mesh.positions() + step);
    CHECK((there.foundation + force).cwiseAbs().maxCoeff() < 1e-13);
    double energy = 0;
    for (Index v = 0; v < mesh.vertex_count(); ++v)
        energy += foundation.energy(v, mesh.positions().col(v) + step.col(v));
    CHECK(elasticity.energy_change(rest, there) == Approx(energy));
}
