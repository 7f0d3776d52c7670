// SPDX-License-Identifier: MIT
#include <membrane/calibration/fit.hpp>

#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/LU>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;
using test::refusal;

namespace {

using Numbers = std::span<const double>;

/// A model from the force at one depth.
template <class Force>
auto each_depth(Force force) {
    return [force](Numbers constants, Numbers depths) {
        std::vector<double> forces;
        for (const double d : depths) forces.push_back(force(constants, d));
        return forces;
    };
}

// Depths are in mm here, which is as good as any length.
const auto proportional = each_depth([](Numbers c, double d) { return c[0] * d; });
const auto hertz = each_depth([](Numbers c, double d) { return c[0] * d + c[1] * d * std::sqrt(d); });
const auto stiffening = each_depth([](Numbers c, double d) { return c[0] * std::expm1(c[1] * d) / c[1]; });
const auto three = each_depth([](Numbers c, double d) { return c[0] * d + c[1] * d * d * d / (c[2] + d); });
const auto product = each_depth([](Numbers c, double d) { return c[0] * c[1] * d + c[2] * d * d; });

std::vector<double> depths(Index count, double deepest = 3) {
    std::vector<double> result;
    for (Index i = 1; i <= count; ++i) result.push_back(deepest * i / count);
    return result;
}

template <class Model>
ForceTable table_of(const Model& model, const std::vector<double>& truth, const std::vector<double>& at) {
    return {.depth = at, .force = model(Numbers(truth), Numbers(at))};
}

double gaussian(Random& random) {
    const double size = std::sqrt(-2 * std::log(1 - random.number()));
    return size * std::cos(2 * std::numbers::pi * random.number());
}

ForceTable noisy(ForceTable table, double part, Random& random) {
    for (double& force : table.force) force *= 1 + part * gaussian(random);
    return table;
}

double off(const Fit& found, const std::vector<double>& truth) {
    double most = 0;
    for (std::size_t k = 0; k < truth.size(); ++k) {
        most = std::fmax(most, std::abs(found.constants[k] / truth[k] - 1));
    }
    return most;
}

std::vector<double> guess(const std::vector<double>& truth, double factor, Random& random) {
    std::vector<double> start = truth;
    for (double& constant : start) constant *= std::pow(factor, random.number(-1.0, 1.0));
    return start;
}

/// In how many of `seeds` tables with 2 % noise the interval of each constant holds the truth.
template <class Model>
std::vector<int> held(const Model& model, const std::vector<double>& truth, Index rows, int seeds) {
    std::vector<int> result(truth.size());
    const ForceTable exact = table_of(model, truth, depths(rows));
    for (int seed = 1; seed <= seeds; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto found = fit(noisy(exact, 0.02, random), guess(truth, 3, random), model);
        CHECK(found.converged);
        for (std::size_t k = 0; k < truth.size(); ++k) {
            const auto& [lower, upper] = found.intervals[k];
            CHECK((lower <= found.constants[k] && found.constants[k] <= upper));
            result[k] += lower <= truth[k] && truth[k] <= upper ? 1 : 0;
        }
    }
    return result;
}

/// 90 to 99 % of 500; of fewer seeds, as far from that as chance may take them.
void check_coverage(const std::vector<int>& held, int seeds) {
    for (const int count : held) {
        const double part = static_cast<double>(count) / seeds;
        CAPTURE(seeds, part);
        if (seeds >= 500) {
            CHECK((part >= 0.9 && part <= 0.99));
        } else {
            CHECK(std::abs(part - 0.95) < 4 * std::sqrt(0.95 * 0.05 / seeds));
        }
    }
}

}  // namespace

TEST_CASE("A fit finds the constants of tables without noise") {
    Random random(1);
    for (int i = 0; i < cases(100); ++i) {
        CAPTURE(i);
        const double a = random.number(1.0, 100.0), b = random.number(0.3, 3.0);
        const auto check = [&](const auto& model, const std::vector<double>& truth) {
            const auto found = fit(table_of(model, truth, depths(12)), guess(truth, 5, random), model);
            CHECK(found.converged);
            CHECK(off(found, truth) < 1e-3);
            CHECK(found.misfit < 1e-4);
            for (std::size_t k = 0; k < truth.size(); ++k) CHECK(found.identifiable[k]);
        };
        check(proportional, {a});
        check(hertz, {a, a * b});
        check(stiffening, {a, b});
        check(three, {a, 2 * a * b, 1.0});
    }
}

TEST_CASE("The 95 % intervals of a fit hold the truth in 90 to 99 % of tables with 2 % noise") {
    const int seeds = cases(500);
    check_coverage(held(hertz, {20, 10}, 20, seeds), seeds);
    check_coverage(held(stiffening, {20, 0.5}, 20, seeds), seeds);
    check_coverage(held(three, {20, 30, 1}, 30, seeds), seeds);
    check_coverage(held(proportional, {20}, 3, seeds), seeds);
    check_coverage(held(hertz, {20, 10}, 4, seeds), seeds);
}

TEST_CASE("The interval of one factor is Student's, over the logarithms of the rows") {
    Random random(2);
    constexpr double t[] = {12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228};  // printed tables
    for (int i = 0; i < cases(100); ++i) {
        const Index rows = 2 + random.index(10);
        CAPTURE(i, rows);
        const auto table = noisy(table_of(proportional, {7}, depths(rows)), 0.05, random);
        const auto found = fit(table, {1}, proportional);
        double sum = 0, squares = 0;
        for (std::size_t r = 0; r < table.depth.size(); ++r) sum += std::log(table.force[r] / table.depth[r]);
        const double mean = sum / rows;
        for (std::size_t r = 0; r < table.depth.size(); ++r) {
            squares += std::pow(std::log(table.force[r] / table.depth[r]) - mean, 2);
        }
        const double half = t[rows - 2] * std::sqrt(squares / (rows - 1) / rows);
        CHECK(std::log(found.constants[0]) == Approx(mean).epsilon(1e-6));
        CHECK(std::log(found.intervals[0].upper / found.constants[0]) == Approx(half).epsilon(1e-3));
        CHECK(std::log(found.constants[0] / found.intervals[0].lower) == Approx(half).epsilon(1e-3));
        CHECK(found.misfit == Approx(std::sqrt(squares / rows)).epsilon(1e-3));
    }
}

TEST_CASE("Rows with deviations of their own count by these: weighted least squares") {
    Random random(3);
    for (int i = 0; i < cases(100); ++i) {
        CAPTURE(i);
        const double truth_a = 20, truth_b = random.number(5.0, 50.0), scale = random.number(0.1, 10.0);
        auto table = table_of(hertz, {truth_a, truth_b}, depths(15));
        table.depth.push_back(0);  // where nothing is felt but noise
        table.force.push_back(0);
        const auto rows = static_cast<Eigen::Index>(table.depth.size());
        Eigen::MatrixXd matrix(rows, 2);
        Eigen::VectorXd right(rows);
        for (Eigen::Index r = 0; r < rows; ++r) {
            const auto row = static_cast<std::size_t>(r);
            const double deviation = random.number(0.05, 0.5), d = table.depth[row];
            table.force[row] += deviation * gaussian(random);
            table.deviation.push_back(scale * deviation);
            matrix.row(r) << d / deviation, std::pow(d, 1.5) / deviation;
            right[r] = table.force[row] / deviation;
        }
        const Eigen::Matrix2d normal = matrix.transpose() * matrix, inverse = normal.inverse();
        const Eigen::Vector2d best = inverse * (matrix.transpose() * right);
        const double scatter = (matrix * best - right).norm() / std::sqrt(static_cast<double>(rows - 2));
        const auto found = fit(table, {10, 10}, hertz);
        REQUIRE(found.converged);
        for (Eigen::Index k = 0; k < 2; ++k) {
            const auto& [lower, upper] = found.intervals[static_cast<std::size_t>(k)];
            const double constant = found.constants[static_cast<std::size_t>(k)];
            const double deviation = std::sqrt(inverse(k, k)) * scatter;
            CHECK(std::abs(constant - best[k]) < 2e-3 * deviation);
            CHECK(std::log(upper / lower) == Approx(2 * 2.145 * deviation / constant).epsilon(3e-3));
        }
        const double expected = inverse(0, 1) / std::sqrt(inverse(0, 0) * inverse(1, 1));
        CHECK(found.correlation(0, 1) == Approx(expected).epsilon(1e-3));
        CHECK(found.misfit * scale ==
              Approx(scatter * std::sqrt(static_cast<double>(rows - 2) / static_cast<double>(rows))).epsilon(1e-3));
    }
}

TEST_CASE("Constants of which only the product shows are not identifiable, the one beside them is") {
    Random random(4);
    for (int i = 0; i < cases(100); ++i) {
        CAPTURE(i);
        const std::vector<double> truth{random.number(1.0, 10.0), random.number(1.0, 10.0), random.number(1.0, 20.0)};
        auto table = table_of(product, truth, depths(15));
        const bool exact = random.chance(0.3);
        if (!exact) table = noisy(table, 0.02, random);
        const auto found = fit(table, guess(truth, 4, random), product);
        REQUIRE(found.converged);
        CHECK_FALSE(found.identifiable[0]);
        CHECK_FALSE(found.identifiable[1]);
        CHECK(found.identifiable[2]);
        CHECK(found.intervals[0].lower == 0);
        CHECK(found.intervals[1].upper == std::numeric_limits<double>::infinity());
        CHECK(found.correlation(0, 1) == Approx(-1).epsilon(1e-6));
        CHECK(found.constants[0] * found.constants[1] / (truth[0] * truth[1]) == Approx(1).epsilon(exact ? 1e-3 : 0.1));
        CHECK(found.constants[2] == Approx(truth[2]).epsilon(exact ? 1e-3 : 0.5));
    }
}

TEST_CASE("Stiffening is identifiable from deep presses and not from shallow ones, whatever the start") {
    Random random(5);
    const int tables = cases(500);
    int identified = 0;
    for (int i = 0; i < tables; ++i) {
        CAPTURE(i);
        const std::vector<double> truth{random.number(5.0, 50.0), random.number(0.5, 1.5)};
        const auto start = guess(truth, 3, random);
        const auto deep = fit(noisy(table_of(stiffening, truth, depths(15, 3)), 0.02, random), start, stiffening);
        CHECK((deep.converged && deep.identifiable[0] && deep.identifiable[1]));
        const auto shallow = fit(noisy(table_of(stiffening, truth, depths(15, 0.01)), 0.02, random), start, stiffening);
        CHECK((shallow.converged && shallow.identifiable[0]));
        CHECK(shallow.constants[0] == Approx(truth[0]).epsilon(0.05));
        identified += shallow.identifiable[1] ? 1 : 0;
        const auto exact = fit(table_of(stiffening, truth, depths(15, 1e-4)), start, stiffening);
        CHECK((exact.identifiable[0] && !exact.identifiable[1]));
    }
    CHECK(identified <= tables / 20);  // noise that resembles stiffening: the intervals may miss as often
}

TEST_CASE("A constant without effect keeps its start value and is not identifiable") {
    const auto idle = each_depth([](Numbers c, double d) { return c[1] * d; });
    Random random(6);
    const auto found = fit(noisy(table_of(idle, {3, 4}, depths(9)), 0.02, random), {5, 1}, idle);
    CHECK(found.converged);
    CHECK(found.constants[0] == Approx(5));
    CHECK_FALSE(found.identifiable[0]);
    CHECK(found.identifiable[1]);
    CHECK(found.correlation(0, 1) == 0);
    CHECK(found.correlation(0, 0) == 1);
    const auto dead = each_depth([](Numbers, double) { return 1.0; });
    const auto none = fit(table_of(proportional, {1}, depths(5)), {2}, dead);
    CHECK_FALSE(none.identifiable[0]);
    CHECK(none.constants[0] == Approx(2));
}

TEST_CASE("A constant that leaves its search range ends at its edge, not identifiable, and the others are right") {
    Random random(7);
    // There is no stiffening: the best is none at all.
    const auto table = noisy(table_of(proportional, {20}, depths(15)), 0.02, random);
    const auto found = fit(table, {10, 1}, stiffening, {.search_factor = 50});
    CHECK(found.converged);
    CHECK_FALSE(found.identifiable[1]);
    CHECK(found.constants[1] >= 0.9999 / 50);
    CHECK(found.identifiable[0]);
    CHECK(found.constants[0] == Approx(20).epsilon(0.05));
    const auto bounded = fit(table, {2}, proportional, {.search_factor = 5});
    CHECK(bounded.constants[0] == Approx(10));
    CHECK_FALSE(bounded.identifiable[0]);
}

TEST_CASE("Units of force and depth change nothing but units") {
    Random random(8);
    for (int i = 0; i < cases(20); ++i) {
        const double force = std::pow(10, random.number(-9.0, 9.0)), depth = std::pow(10, random.number(-6.0, 6.0));
        CAPTURE(force, depth);
        const auto table = noisy(table_of(hertz, {20, 10}, depths(12)), 0.02, random);
        const auto found = fit(table, {10, 20}, hertz);
        auto scaled = table;
        for (double& f : scaled.force) f *= force;
        for (double& d : scaled.depth) d *= depth;
        const double a = force / depth, b = a / std::sqrt(depth);
        const auto other = fit(scaled, {10 * a, 20 * b}, hertz);
        CHECK(other.constants[0] == Approx(a * found.constants[0]).epsilon(1e-6));
        CHECK(other.constants[1] == Approx(b * found.constants[1]).epsilon(1e-6));
        CHECK(other.intervals[1].upper == Approx(b * found.intervals[1].upper).epsilon(1e-6));
        CHECK(other.misfit == Approx(found.misfit).epsilon(1e-6));
        CHECK(other.identifiable == found.identifiable);
    }
}

TEST_CASE("A fit gets by with a model that has no forces in places, and says so where it does not") {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const auto picky = each_depth([nan](Numbers c, double d) { return c[0] > 300 ? nan : c[0] * d + c[1] * d * d; });
    const auto found = fit(table_of(picky, {200, 10}, depths(10)), {100, 200}, picky);
    CHECK(found.converged);
    CHECK(off(found, {200, 10}) < 1e-3);
    const auto one_sided = each_depth([nan](Numbers c, double d) { return c[0] > 20.001 ? nan : c[0] * d; });
    CHECK(fit(table_of(one_sided, {20}, depths(10)), {9}, one_sided).identifiable[0]);
    Index calls = 0;
    const auto only_here = [&](Numbers, Numbers at) {
        return std::vector<double>(at.size(), calls++ == 0 ? 1.0 : nan);
    };
    const auto nowhere = fit(table_of(proportional, {20}, depths(10)), {9}, only_here);
    CHECK_FALSE(nowhere.identifiable[0]);
    CHECK(nowhere.evaluations == calls);
}

TEST_CASE("A fit that was stopped early determines no constant") {
    const auto found = fit(table_of(stiffening, {20, 0.5}, depths(12)), {2, 5}, stiffening, {.max_iterations = 1});
    CHECK_FALSE(found.converged);
    CHECK(found.identifiable == std::vector<bool>{false, false});
}

TEST_CASE("A step of a fit changes no constant by more than a factor of e^2") {
    double furthest = 0;
    const auto recorded = [&](Numbers constants, Numbers at) {
        furthest = std::max(furthest, std::abs(std::log(constants[0] / 0.02)));
        return proportional(constants, at);
    };
    static_cast<void>(fit(table_of(proportional, {20}, depths(10)), {0.02}, recorded, {.max_iterations = 1}));
    CHECK(furthest == Approx(2).epsilon(1e-3));  // and the steps of differences
}

TEST_CASE("A fit refuses what it cannot work with") {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const ForceTable valid{.depth = {1, 2, 3}, .force = {1, 2, 3}};
    const auto with = [&](auto change) {
        return refusal([&] {
            ForceTable table = valid;
            change(table);
            static_cast<void>(fit(table, {1}, proportional));
        });
    };
    CHECK(with([](auto&) {}) == "");
    CHECK(with([](auto& t) { t = {}; }) == "ForceTable: the table must have a row, got none");
    CHECK(with([](auto& t) { t.force.pop_back(); }) == "ForceTable: force must have as many rows as depth, 3, got 2");
    CHECK(with([](auto& t) { t.deviation = {1}; }) ==
          "ForceTable: deviation must have as many rows as depth, 3, got 1");
    CHECK(with([&](auto& t) { t.depth[1] = nan; }) == "ForceTable: depth of row 1 must be finite [m], got nan");
    CHECK(with([&](auto& t) { t.force[2] = 1 / 0.0; }) == "ForceTable: force of row 2 must be finite [N], got inf");
    CHECK(with([](auto& t) { t.force[0] = 0; }) ==
          "ForceTable: force of row 0 must be positive where rows have no deviation [N], got 0");
    CHECK(with([](auto& t) {
              t.deviation = {1, 0, 1};
          }) == "ForceTable: deviation of row 1 must be finite and positive [N], got 0");
    CHECK(with([](auto& t) { t = {.depth = {1}, .force = {1}}; }) ==
          "fit: the table must have more rows than there are constants, 1, got 1");

    const auto from = [&](const std::vector<double>& start) {
        return refusal([&] { static_cast<void>(fit(valid, start, proportional)); });
    };
    CHECK(from({}) == "fit: start must have a constant, got none");
    CHECK(from({1, -2}) == "fit: start of constant 1 must be finite and positive, got -2");
    CHECK(from({nan}) == "fit: start of constant 0 must be finite and positive, got nan");

    const auto by = [&](std::vector<double> forces) {
        const auto model = [&](Numbers, Numbers) { return forces; };
        return refusal([&] { static_cast<void>(fit(valid, {1}, model)); });
    };
    CHECK(by({1, 2}) == "fit: the model must give one force for each depth, 3, got 2");
    CHECK(by({1, 2, nan}) == "fit: the model must give valid forces at the start, got one that is not");
    CHECK(by({1, 2, 0}) == "fit: the model must give valid forces at the start, got one that is not");
    const ForceTable overflowing{.depth = {1, 2, 3}, .force = {1, 2, 3}, .deviation = {1e-160, 1e-160, 1e-160}};
    CHECK(refusal([&] { static_cast<void>(fit(overflowing, {2}, proportional)); }) ==
          "fit: the model must give valid forces at the start, got one that is not");

    const auto asking = [&](const FitOptions& options) {
        return refusal([&] { static_cast<void>(fit(valid, {1}, proportional, options)); });
    };
    CHECK(asking({.tolerance = 0}) == "FitOptions: tolerance must be above 0 and below 1, got 0");
    CHECK(asking({.step = 1}) == "FitOptions: step must be above 0 and below 1, got 1");
    CHECK(asking({.search_factor = nan}) == "FitOptions: search_factor must be above 1 and below 1e+30, got nan");
    CHECK(asking({.confidence = 1}) == "FitOptions: confidence must be above 0 and below 1, got 1");
    CHECK(asking({.max_interval_ratio = 1}) == "FitOptions: max_interval_ratio must be above 1 and below 1e+30, got 1");
    CHECK(asking({.min_sensitivity = -1}) == "FitOptions: min_sensitivity must be above 0 and below 1, got -1");
    CHECK(asking({.max_iterations = 0}) == "FitOptions: max_iterations must be at least 1, got 0");
}
