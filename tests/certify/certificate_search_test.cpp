// SPDX-License-Identifier: MIT
#include <membrane/certify/error_bound.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include <membrane/certify/factored_convexity.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/pressed.hpp"
#include "support/random.hpp"
#include "support/sparse_newton.hpp"

// Searches that try to break a certificate: states change at random, and those are kept that are certified and nearer
// to where a proof would fail, by a bound that is used up, a membrane about to buckle, or a tool about to lose its
// contact.

using namespace membrane;
using test::Random;

namespace {

double farthest(const Points<double>& a, const Points<double>& b) { return (a - b).colwise().norm().maxCoeff(); }

/// What is sought: the larger the nearer. None: not certified.
using Score = std::optional<double>;

/// Maximises a score over numbers in [-1, 1] without its gradient: one is changed into one, and the better is kept; the
/// changes grow with each success and shrink with each failure (evolution strategy). Returns the number of scores.
template <class Evaluate>
int search(Index unknowns, int evaluations, Random& random, Evaluate score_of) {
    const auto any = [&] {
        Eigen::VectorXd numbers(unknowns);
        for (double& number : numbers) number = random.number(-1.0, 1.0);
        return numbers;
    };
    Eigen::VectorXd best = any();
    Score best_score = score_of(best);
    double size = 0.3;
    int scores = best_score ? 1 : 0;
    for (int i = 1; i < evaluations; ++i) {
        const Eigen::VectorXd next = best_score ? (best + size * any()).cwiseMax(-1).cwiseMin(1).eval() : any();
        const Score score = score_of(next);
        scores += score ? 1 : 0;
        const bool is_better = score && (!best_score || *score >= *best_score);
        if (best_score) size = std::clamp(size * (is_better ? 1.5 : 0.9), 1e-4, 0.5);
        if (!is_better) continue;
        best = next;
        best_score = score;
    }
    return scores;
}

/// A sphere with springs that are too long, on a foundation that may be too weak to hold it round.
class Swollen {
  public:
    static constexpr Index unknowns = 3 + 2 * 3 * 42;

    explicit Swollen(bool towards_buckling) : towards_buckling_(towards_buckling) {}

    [[nodiscard]] Score operator()(const Eigen::VectorXd& numbers) {
        std::vector<double> lengths;
        for (const auto& s : as_built_.springs()) lengths.push_back((1.075 + 0.075 * numbers[0]) * s.rest_length);
        const MassSpringNetwork network(mesh_, LinearSpring{}, {.stiffness = 1.0, .rest_length = lengths});
        const double stiffness = std::pow(10, -0.75 + 1.25 * numbers[1]);
        const VirtualVolumeSprings foundation(mesh_, {.stiffness = stiffness});
        test::StillMembrane still(network, mesh_.positions(), stiffness);
        const Points<double> crumpled = mesh_.positions() + 0.1 * numbers.segment<126>(3).reshaped(3, 42);
        const Points<double> x = still.equilibrium(crumpled).x +
                                 std::pow(10, -3 + 2 * numbers[2]) * numbers.segment<126>(129).reshaped(3, 42);
        ErrorBound<FactoredConvexity> bound(network);
        const auto error = bound.compute(x, network, foundation);
        if (!error.certified()) return std::nullopt;

        const auto rest = still.equilibrium(x);
        const double off = farthest(rest.x, x);
        CHECK(rest.stable);
        CHECK(off <= error.position);
        for (const double far : {-0.9, -0.5, 0.5, 0.9}) {  // along the softest direction, to where another may be
            const Points<double> start = x + far * error.position * softest(still.stiffness(rest.x));
            const auto other = still.equilibrium(start).x;
            if (still.forces(other).norm() > 1e-10 || farthest(other, x) > error.position) continue;
            CHECK(farthest(other, rest.x) < 1e-9);
        }
        return towards_buckling_ ? -error.convexity : off / error.position;
    }

  private:
    /// The direction of least stiffness, the longest of its vectors 1.
    [[nodiscard]] static Points<double> softest(const Eigen::SparseMatrix<double>& stiffness) {
        Random random(1);
        Points<double> u(3, 42);
        for (double& number : u.reshaped()) number = random.number(-1.0, 1.0);
        constexpr double above_all = 20;  // N/m: six springs, twice, and the foundation
        for (int i = 0; i < 200; ++i) {
            const Eigen::VectorXd pulled = stiffness * u.reshaped();
            u -= pulled.reshaped(3, 42) / above_all;
            u /= u.colwise().norm().maxCoeff();
        }
        return u;
    }

    TriangleMesh<double> mesh_ = icosphere<double>({.radius = 1, .subdivisions = 1});
    MassSpringNetwork<double, LinearSpring> as_built_{mesh_, {}, {.stiffness = 1.0}};
    bool towards_buckling_;
};

/// A sphere and a tool, deep in it or about to leave it.
class Touched {
  public:
    static constexpr Index unknowns = 10;

    explicit Touched(bool towards_tangency) : towards_tangency_(towards_tangency) {}

    [[nodiscard]] Score operator()(const Eigen::VectorXd& numbers) const {
        test::Pressed membrane(1, 1, std::pow(10, -0.5 + numbers[0]));
        const Vector3<double> outward =
            direction<double>(Vector3<double>(numbers[1], numbers[2], numbers[3]), Vector3<double>::UnitZ());
        membrane.tool.radius = membrane.edge * std::pow(2, 1 + numbers[4]);
        if (numbers[5] > 0) membrane.tool.axis = 0.5 * outward + 0.5 * Vector3<double>(numbers[6], numbers[7], 0);
        membrane.press_at(outward, std::pow(10, -2.5 + 1.8 * numbers[8]), {.layers = unlimited, .sweeps = 3},
                          15 + static_cast<Index>(10 * numbers[9]));
        const auto rest = membrane.rest_from(membrane.x);
        if (!rest.converged || rest.contacts.empty()) return std::nullopt;
        ErrorBound<FactoredConvexity> bound(membrane.network);
        const auto error = bound.compute(rest, membrane.x, membrane.mesh, membrane.network, membrane.foundation,
                                         press(membrane.tool, membrane.contact));
        if (!error.certified()) return std::nullopt;

        const double off = farthest(rest.x, membrane.x);
        const auto& reaction = error.reactions[0];
        CHECK(off <= error.position);
        for (int start = 0; start < 3; ++start) {
            const auto from = test::jittered(rest.x, error.position / 4, membrane.random);
            const auto other = membrane.rest_from(from);
            CHECK((other.converged && farthest(other.x, rest.x) < 1e-8));
            CHECK(norm<double>(other.reactions[0] - reaction.centre) <= reaction.radius);
            CHECK(norm<double>(other.reactions[0] - membrane.force) <= reaction.max_distance_to(membrane.force));
        }
        double least = std::numeric_limits<double>::infinity();  // of the pressures
        for (const auto& touch : rest.contacts) least = std::min(least, touch.multiplier);
        return towards_tangency_ ? -least : off / error.position;
    }

  private:
    bool towards_tangency_;
};

}  // namespace

TEST_CASE("a search for a certificate that is wrong finds none, up to where the membrane buckles",
          "[error_bound][break]") {
    int certified = 0;
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        certified += search(Swollen::unknowns, 100, random, Swollen(seed % 2 == 0));
    }
    CHECK(certified > 20 * cases(20));
}

TEST_CASE("nor up to where a tool is about to leave it", "[error_bound][break]") {
    int certified = 0;
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        certified += search(Touched::unknowns, 30, random, Touched(seed % 2 == 0));
    }
    CHECK(certified > 5 * cases(20));
}
