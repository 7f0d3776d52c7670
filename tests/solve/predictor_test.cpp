// SPDX-License-Identifier: MIT
#include <membrane/solve/predictor.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include <membrane/accuracy/trial.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>

#include "support/bits.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;
using test::same_bits;

namespace {

using Leads = std::array<DrivingInput<double>, 2>;

DrivingInput<double> at(double x, double y = 0) { return InputSample<double>{{x, y, 0}}; }

constexpr double radius = 0.01, stiffness = 40, dt = 1e-3;  // [m], [N/m], [s]

struct Membrane {
    TriangleMesh<double> mesh = icosphere({.radius = radius, .subdivisions = 2});
    MassSpringNetwork<double, LinearSpring> network{mesh, {}, {.stiffness = stiffness}};
    VirtualVolumeSprings<double> foundation{mesh, {.stiffness = stiffness / 4}};
};

/// A tool of 3 mm, 1.5 mm deep after 30 ticks, slides along at 50 mm/s.
std::vector<Tool<double>> slide(Index ticks) {
    std::vector<Tool<double>> tools;
    for (Index t = 1; t <= ticks; ++t) {
        const double angle = 0.05 * dt * std::max(t - 30, 0) / radius;
        const double from_centre = radius + 3e-3 - 1.5e-3 * std::min(t, 30) / 30;
        tools.push_back({.position = from_centre * Vector3<double>(std::sin(angle), 0.1, std::cos(angle)).normalized(),
                         .radius = 3e-3});
    }
    return tools;
}

/// Sees where the vertices are when a step begins, before anything is held.
struct Witness {
    Points<double>* seen;

    bool valid() const noexcept { return true; }
    void prescribe(ConstraintContext<double>& context) const noexcept {
        for (Index v = 0; v < seen->cols(); ++v) seen->col(v) = context.position(v);
    }
    void begin(ConstraintContext<double>&) const noexcept {}
    bool enforce(ConstraintContext<double>&) const noexcept { return false; }
    Vector3<double> reaction(const ConstraintContext<double>&) const noexcept { return Vector3<double>::Zero(); }
};

/// A vertex is pulled outward, 0.2 mm in a tick.
struct DrivenSphere {
    explicit DrivenSphere(const SolverOptions<double>& options = {}) : solver(membrane.network, options) {}

    template <class... Others>
    StepReport<double> go_on(const Others&... others) {
        ++ticks;
        return stay(others...);
    }
    template <class... Others>
    StepReport<double> stay(const Others&... others) {
        const Vector3<double> from = point(membrane.mesh.positions(), 0);
        return solver.step(x, dt, membrane.network, membrane.foundation, Witness{&begin},
                           pull(0, Vector3<double>((1 + 0.02 * ticks) * from)), others...);
    }
    Index neighbour() const { return membrane.network.springs_of(0)[0].other; }

    Membrane membrane;
    QuasiStaticSolver<double> solver;
    Points<double> x = membrane.mesh.positions(), begin = x;
    int ticks = 0;
};

}  // namespace

TEST_CASE("nothing is expected before something has gone on for two steps") {
    Predictor<double, 2> predictor;
    CHECK(predictor.extrapolation_factor(Leads{at(1)}) == 0);
    CHECK(predictor.extrapolation_factor(Leads{at(2)}) == 0);
    CHECK(predictor.extrapolation_factor(Leads{at(3)}) == 1);
    predictor.reset();
    CHECK(predictor.extrapolation_factor(Leads{at(4)}) == 0);
    CHECK(predictor.extrapolation_factor(Leads{at(5)}) == 0);
    CHECK(predictor.extrapolation_factor(Leads{at(6)}) == 1);
}

TEST_CASE("the factor is how far the input repeats its last displacement, less its turn") {
    const auto expected = [](const DrivingInput<double>& next) {
        Predictor<double, 2> predictor;
        static_cast<void>(predictor.extrapolation_factor(Leads{at(1)}));
        static_cast<void>(predictor.extrapolation_factor(Leads{at(3)}));
        return predictor.extrapolation_factor(Leads{next});
    };
    CHECK(expected(at(5)) == 1);
    CHECK(expected(at(100)) == 1);
    CHECK(expected(at(4)) == 0.5);
    CHECK(expected(at(5, 0.5)) == 0.5);
    CHECK(expected(at(5, 1)) == 0);
    CHECK(expected(at(7, 1)) == 1);
    CHECK(expected(at(4, 7)) == 0);
    CHECK(expected(at(3)) == 0);
    CHECK(expected(at(3, 2)) == 0);
    CHECK(expected(at(2)) == 0);
    CHECK(expected(std::nullopt) == 0);
}

TEST_CASE("of several inputs the one that goes on least counts, those that stay do not") {
    Predictor<double, 2> predictor;
    static_cast<void>(predictor.extrapolation_factor(Leads{at(1), at(1)}));
    static_cast<void>(predictor.extrapolation_factor(Leads{at(2), at(1)}));
    CHECK(predictor.extrapolation_factor(Leads{at(3), at(1)}) == 1);
    CHECK(predictor.extrapolation_factor(Leads{at(4), at(2)}) == 1);
    CHECK(predictor.extrapolation_factor(Leads{at(5), at(2.5)}) == 0.5);
    CHECK(predictor.extrapolation_factor(Leads{at(6), at(2.5)}) == 0);
    CHECK(predictor.extrapolation_factor(Leads{at(7), at(2.5)}) == 1);
    CHECK(predictor.extrapolation_factor(Leads{at(8), std::nullopt}) == 0);
    CHECK(predictor.extrapolation_factor(Leads{at(9), std::nullopt}) == 1);
    CHECK(predictor.extrapolation_factor(std::span<const DrivingInput<double>>()) == 0);
    CHECK(predictor.extrapolation_factor(std::span<const DrivingInput<double>>()) == 0);
}

TEST_CASE("an input that changes by rounding stays") {
    const auto rounded = [](double x) { return DrivingInput<double>(InputSample<double>{{x, 0, 0}, 10, false, 0.1}); };
    Predictor<double, 2> predictor;
    static_cast<void>(predictor.extrapolation_factor(Leads{at(1), rounded(1)}));
    static_cast<void>(predictor.extrapolation_factor(Leads{at(2), rounded(1.09)}));
    CHECK(predictor.extrapolation_factor(Leads{at(3), rounded(1)}) == 1);
    CHECK(predictor.extrapolation_factor(Leads{at(3), rounded(1.09)}) == 0);
    CHECK(predictor.extrapolation_factor(Leads{at(4), rounded(1)}) == 0);  // nothing has moved
    CHECK(predictor.extrapolation_factor(Leads{at(5), rounded(1.2)}) == 1);
    CHECK(predictor.extrapolation_factor(Leads{at(6), rounded(1.3)}) == Approx(0.5));
}

TEST_CASE("after a displacement longer than the input's limit the factor is zero, and once more") {
    const auto expected = [](double first, double second) {
        Predictor<double, 1> predictor;
        const auto no_farther = [](double x) {
            return std::array{DrivingInput<double>(InputSample<double>{{x, 0, 0}, 2})};
        };
        static_cast<void>(predictor.extrapolation_factor(no_farther(0)));
        static_cast<void>(predictor.extrapolation_factor(no_farther(first)));
        return predictor.extrapolation_factor(no_farther(first + second));
    };
    CHECK(expected(2, 2) == 1);
    CHECK(expected(2, 2.1) == 0);
    CHECK(expected(2.1, 2) == 0);
}

TEST_CASE("displacements too small or too large for their square give a factor from 0 to 1") {
    const double tiny = std::numeric_limits<double>::denorm_min(), small = 1e-160, huge = 1e150;
    for (const double first : {tiny, small, 1.0, huge}) {
        for (const double second : {-huge, -1.0, -tiny, 0.0, tiny, small, 1.0, huge}) {
            Predictor<double, 1> predictor;
            static_cast<void>(predictor.extrapolation_factor(std::array{at(0)}));
            static_cast<void>(predictor.extrapolation_factor(std::array{at(first)}));
            const double part = predictor.extrapolation_factor(std::array{at(first + second)});
            CAPTURE(first, second);
            CHECK(part >= 0);
            CHECK(part <= 1);
        }
    }
}

TEST_CASE("what converges by itself converges with the prediction") {
    for (int seed = 1; seed <= cases(1000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const double q = random.number(0.0, 1.0), p = random.number(0.0, 1.0);
        const std::complex<double> root = std::sqrt(std::complex<double>(q * q * (1 + p) * (1 + p) - 4 * q * p));
        CHECK(std::abs(q * (1 + p) + root) / 2 <= std::sqrt(q) * (1 + 1e-14));
        CHECK(std::abs(q * (1 + p) - root) / 2 <= std::sqrt(q) * (1 + 1e-14));
    }
}

TEST_CASE("a tool that slides on is felt with a third of the error, or less") {
    const Membrane membrane;
    const ToolTrajectory<double> stroke(membrane.mesh, slide(90), dt, {.fine_triangles = 0});
    const auto references = equilibria(membrane.mesh, membrane.network, membrane.foundation, stroke, 6);
    REQUIRE(references.size() == 15);
    const auto error = [&](Index sweeps, bool predict) {
        const SolverOptions<double> options{
            .layers = unlimited, .sweeps = sweeps, .contact_iterations = 4, .predict = predict};
        return run_trial(membrane.mesh, membrane.network, membrane.foundation, stroke, references, options).force_error;
    };
    for (const Index sweeps : {1, 2, 4}) {
        CAPTURE(sweeps);
        CHECK(error(sweeps, true) < error(sweeps, false) / 3);
    }
}

TEST_CASE("a step begins at extrapolated positions if the input goes on") {
    DrivenSphere driven;
    for (int tick = 0; tick < 3; ++tick) driven.go_on();
    const Points<double> before = driven.x;
    driven.go_on();
    const Points<double> displacement = driven.x - before, there = driven.x + displacement;
    driven.go_on();
    CHECK(displacement.col(driven.neighbour()).norm() > 1e-3 * radius);
    CHECK((driven.begin.rightCols(161) - there.rightCols(161)).norm() <= 1e-12 * radius);

    const Points<double> last = driven.x;
    driven.stay();
    CHECK(same_bits(driven.begin, last));
}

TEST_CASE("a vertex that is pinned in motion stays where it is") {
    DrivenSphere driven;
    for (int tick = 0; tick < 4; ++tick) driven.go_on();
    const Points<double> before = driven.x;
    const Index v = driven.neighbour();
    driven.go_on(pin({&v, 1}));
    CHECK(same_bits(point(driven.x, v), point(before, v)));
    CHECK_FALSE(same_bits(driven.x, before));
}

TEST_CASE("a step that is refused is not predicted, nor the next one") {
    DrivenSphere driven;
    for (int tick = 0; tick < 4; ++tick) driven.go_on();
    const Points<double> before = driven.x;
    const Vector3<double> somewhere = Vector3<double>::Zero();
    CHECK(driven.go_on(pull(no_index, somewhere)).status == StepStatus::invalid_input);
    CHECK(same_bits(driven.x, before));
    driven.go_on();
    CHECK(same_bits(driven.begin, before));
}

TEST_CASE("without the option nothing is predicted") {
    DrivenSphere driven({.predict = false});
    for (int tick = 0; tick < 4; ++tick) driven.go_on();
    const Points<double> before = driven.x;
    driven.go_on();
    CHECK(same_bits(driven.begin, before));
}
