// SPDX-License-Identifier: MIT
#include <membrane/contact/facet_correction.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>
#include <utility>
#include <vector>

#include <membrane/accuracy/equilibrium.hpp>
#include <membrane/contact/contact_tracker.hpp>
#include <membrane/meshing/distmesh.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/foundation_layer.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/facet_lattice.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using membrane::FacetCorrection;
using membrane::Index;
using membrane::Points;
using Point = membrane::Vector3<double>;
using Mesh = membrane::TriangleMesh<double>;

namespace {

constexpr double disc_radius = 5e-3, stretch = 1.02;  // [m], 1
const membrane::Material sheet{.young_modulus = 1e6, .poisson_ratio = 0.45, .thickness = 50e-6};

/// St Venant-Kirchhoff under equal stretch: the force per present length [N/m].
double tension() { return sheet.biaxial_stiffness() * (stretch * stretch - 1) / 2; }

auto tissue_of(const Mesh& mesh) {
    return membrane::Tissue(membrane::MassSpringNetwork(mesh, membrane::LinearSpring{},
                                                        {.stiffness = 0.0, .pinned = membrane::border(mesh)}),
                            membrane::triangular_springs(mesh, sheet, stretch));
}

/// A flat disc under tension with a fixed rim, under a ball.
struct Disc {
    Mesh mesh;
    decltype(tissue_of(mesh)) tissue = tissue_of(mesh);
    membrane::FoundationSprings<double> nothing{mesh, {.normal = 0.0, .tangential = 0.0}};
    FacetCorrection<double> correction{mesh, {.tension = tension()}};

    /// The forces at equilibrium [N], without the correction and with it.
    [[nodiscard]] std::pair<double, double> forces(const membrane::Tool<double>& ball) const {
        const membrane::AabbTree<double> tree(mesh);
        Points<double> x = mesh.positions();
        Point offset = Point::Zero();
        Point last = Point::Zero();
        double uncorrected = 0, relaxation = 0.6;
        for (int i = 0; i < 30; ++i) {
            auto pressed = ball;
            pressed.position += offset;
            membrane::ContactTracker<double> tracker(mesh, {.fine_triangles = 0});
            const auto contact = tracker.update(tree, mesh.positions(), pressed);
            const auto rest = membrane::equilibrium(x, mesh, tissue, nothing, {}, press(pressed, contact));
            REQUIRE(rest.converged);
            x = rest.x;
            const double force = membrane::norm(rest.reactions[0]);
            if (i == 0) uncorrected = force;
            const Point change = correction(x, contact, rest.reactions[0]) - offset;
            if (membrane::norm(change) < 1e-4 * (ball.radius - ball.position.z())) return {uncorrected, force};
            if (i > 0) relaxation *= last.dot(last - change) / (last - change).squaredNorm();  // Aitken's
            offset += relaxation * change;
            last = change;
        }
        FAIL("the correction does not converge");
        return {};
    }
};

/// A ball that touches a linear membrane within `contact_radius`, off the middle of the disc, and its force [N].
/// Green's function of the disc is ln(conformal radius / distance) near a point.
struct ClosedForm {
    membrane::Tool<double> ball;
    double force;

    ClosedForm(double x, double y, double contact_radius) {
        const double radius = 100 * contact_radius;  // small slopes
        const double conformal = disc_radius - (x * x + y * y) / disc_radius;
        const double bend = contact_radius * contact_radius / radius;
        const double depth = bend * (std::log(conformal / contact_radius) + 0.5);
        ball = {.position = {x, y, radius - depth}, .radius = radius};
        force = 2 * std::numbers::pi * tension() * bend;
    }
};

Mesh irregular_disc(double edge) {
    const double r = 1.1 * disc_radius;
    return membrane::distmesh(membrane::trimmed(membrane::HalfSpace{}, membrane::Ball{.radius = disc_radius}),
                              {.edge_length = edge, .bounds = membrane::Bounds{{-r, -r, -r / 8}, {r, r, r / 8}}});
}

/// Largest and mean error of the forces on balls anywhere near the middle, of contacts of 0.1 to 2.5 edges.
struct Errors {
    double largest = 0, mean = 0;
};

/// Without the correction and with it.
std::pair<Errors, Errors> errors(const Mesh& mesh, double edge) {
    const int count = cases(5, 16);
    std::pair<Errors, Errors> found;
    test::Random random(7);
    const Disc disc{mesh};
    for (int i = 0; i < count; ++i) {
        const double x = random.number(-1.0, 1.0) * 0.2 * disc_radius, y = random.number(-1.0, 1.0) * 0.2 * disc_radius;
        const ClosedForm exact(x, y, edge * 0.1 * std::pow(25, (i + 0.5) / count));
        const auto add = [&](double force, Errors& sum) {
            const double error = std::abs(force / exact.force - 1);
            sum.largest = std::max(sum.largest, error);
            sum.mean += error / count;
        };
        const auto [uncorrected, corrected] = disc.forces(exact.ball);
        add(uncorrected, found.first);
        add(corrected, found.second);
    }
    return found;
}

}  // namespace

TEST_CASE("small contacts lack the logarithm from the triangle's size down, and what lies within the triangle") {
    // The resistance from a vertex of the triangular lattice to far away is that of a disc of this radius, in edges.
    const double disc = std::exp(-std::numbers::egamma) / std::sqrt(12.0);
    test::Random random(1);
    for (int i = 0; i < 100; ++i) {
        const Point w = random.barycentric();
        const double pairs = w[0] * w[1] + w[1] * w[2] + w[2] * w[0];
        const double ratio = 0.05 * std::pow(1e-6, random.number());
        const double exact = std::log(disc / ratio) + 0.5 + 2 * std::numbers::pi / std::sqrt(3.0) * pairs;
        CHECK(membrane::facet_depth(ratio, w) == Approx(exact).margin(0.03));
    }
}

TEST_CASE("what facets lack is that of a linear membrane on a regular triangulation, anywhere, for any contact") {
    const test::FacetLattice lattice;
    const int count = cases(40, 400);
    for (int seed = 1; seed <= count; ++seed) {
        test::Random random(static_cast<unsigned>(seed));
        const Point w = random.barycentric();
        const auto exact = lattice.press(0.03 * std::pow(100, (seed - random.number()) / count), w);
        const double depth = membrane::facet_depth(exact.ratio, w);
        CAPTURE(seed, exact.ratio, exact.missing, depth);
        CHECK(std::abs(depth - exact.missing) < 0.03);
    }
}

TEST_CASE("what facets lack is continuous in the contact's size and the same for each corner") {
    test::Random random(2);
    for (int i = 0; i < 1000; ++i) {
        const Point w = random.barycentric();
        const double ratio = 0.01 * std::pow(1000, random.number());
        const double depth = membrane::facet_depth(ratio, w);
        CHECK(depth == Approx(membrane::facet_depth(ratio, {w[2], w[0], w[1]})).epsilon(1e-9));
        CHECK(depth == Approx(membrane::facet_depth(ratio, {w[1], w[0], w[2]})).epsilon(1e-9));
        CHECK(std::abs(depth - membrane::facet_depth(1.001 * ratio, w)) < 0.01);
        CHECK(depth > 0);
    }
}

TEST_CASE("the contact's radius by force, tension and stiffness") {
    const auto mesh = membrane::disc<double>({.radius = disc_radius, .rings = 2});
    const FacetCorrection<double> taut(mesh, {.tension = 2}), both(mesh, {.tension = 2, .stiffness = 50}),
        slack(mesh, {.stiffness = 50});
    const double radius = 1e-3;
    for (const double force : {1e-6, 1e-5, 1e-4}) {
        const auto tension = [&](double a, double before) {
            return before + 3.0 / 16 * 50 * a * a / (radius * radius);
        };
        const auto balance = [&](double a, double t) { return 2 * std::numbers::pi * t * a * a / radius; };
        const double a = taut.contact_radius(radius, force), b = both.contact_radius(radius, force),
                     c = slack.contact_radius(radius, force);
        CHECK(balance(a, 2) == Approx(force).epsilon(1e-12));
        CHECK(balance(b, tension(b, 2)) == Approx(force).epsilon(1e-12));
        CHECK(balance(c, tension(c, 0)) == Approx(force).epsilon(1e-12));
    }
    CHECK(taut.contact_radius(radius, 1e6) == radius);
}

TEST_CASE("a corrected ball on triangles of any size has the force of a linear membrane") {
    const auto rings = membrane::disc<double>({.radius = disc_radius, .rings = 16});
    const double edge = disc_radius / 16;
    const auto [before, after] = errors(rings, edge);
    CAPTURE(before.largest, before.mean, after.largest, after.mean);
    CHECK(before.largest > 0.4);
    CHECK(after.largest < 0.03);
    CHECK(after.mean < 0.01);
}

TEST_CASE("a corrected ball on irregular triangles") {
    if (!in_full()) return;
    const double edge = disc_radius / 16;
    const auto mesh = irregular_disc(edge);
    const auto [before, after] = errors(mesh, edge);
    CAPTURE(before.largest, before.mean, after.largest, after.mean);
    CHECK(before.largest > 0.4);
    CHECK(after.largest < 0.04);
    CHECK(after.mean < 0.015);
}

TEST_CASE("no offset without a ball's force, and what is refused") {
    const auto mesh = membrane::disc<double>({.radius = disc_radius, .rings = 2});
    const FacetCorrection<double> correction(mesh, {.tension = 2});
    membrane::Contact<double> contact;
    const auto& x = mesh.positions();
    CHECK(correction(x, contact, {0, 0, 1}).isZero(0));
    contact.phase = membrane::ContactPhase::began;
    contact.triangle = 0;
    contact.corners = {mesh.triangles()(0, 0), mesh.triangles()(1, 0), mesh.triangles()(2, 0)};
    contact.barycentric = {1, 0, 0};
    contact.normal = {0, 0, 1};
    contact.patch.axis_point = {0, 0, 1e-3};
    contact.patch.radius = 1e-3;
    CHECK(correction(x, contact, {0, 0, 0}).isZero(0));
    CHECK(correction(x, contact, {0, 0, std::numeric_limits<double>::quiet_NaN()}).isZero(0));
    const Point offset = correction(x, contact, {0, 0, 1e-4});
    CHECK(offset.z() > 0);
    CHECK(std::hypot(offset.x(), offset.y()) == 0);
    const membrane::ContactPoint<double> of_vertex{.feature = membrane::vertex_feature};
    contact.patch.points = {&of_vertex, 1};
    CHECK(correction(x, contact, {0, 0, 1e-4}).isZero(0));
    contact.patch.points = {};

    Points<double> wild = x;
    for (const Index v : contact.corners) wild.col(v).setConstant(std::numeric_limits<double>::quiet_NaN());
    const membrane::ContactTriangle listed{0, contact.corners};
    contact.patch.triangles = {&listed, 1};
    CHECK(correction(x, contact, {0, 0, 1e-4}).z() > 0);
    CHECK(membrane::is_finite(correction(wild, contact, {0, 0, 1e-4})));

    const Eigen::MatrixXd rows = x.transpose();
    CHECK(correction(rows, contact, {0, 0, 1e-4}).isZero(0));
    CHECK(correction(x.leftCols(3), contact, {0, 0, 1e-4}).isZero(0));
    const membrane::ContactTriangle elsewhere{0, {0, 1, mesh.vertex_count()}};
    contact.patch.triangles = {&elsewhere, 1};
    CHECK(correction(x, contact, {0, 0, 1e-4}).isZero(0));
    contact.patch.triangles = {&listed, 1};

    Points<double> flat = x;
    for (const Index v : contact.corners) flat.col(v) = x.col(contact.corners[0]);
    const FacetCorrection<double> degenerate(Mesh(flat, mesh.triangles()), {.tension = 2});
    CHECK(membrane::is_finite(degenerate(x, contact, {0, 0, 1e-4})));

    const auto refused = [&](const membrane::FacetCorrectionOptions& options) {
        return test::refusal([&] { FacetCorrection<double>(mesh, options); });
    };
    CHECK(refused({}) == "FacetCorrection: tension or stiffness must be positive [N/m], got 0 for both");
    CHECK(refused({.tension = -1}) == "FacetCorrection: tension must be finite and not negative [N/m], got -1");
    CHECK(refused({.tension = 1, .stiffness = std::numeric_limits<double>::infinity()}) ==
          "FacetCorrection: stiffness must be finite and not negative [N/m], got inf");
}

TEMPLATE_TEST_CASE("a ball that slides in the loop has a force that does not depend on the triangles", "",
                   TEST_SCALARS) {
    using S = TestType;
    const auto mesh = membrane::disc<S>({.radius = S(disc_radius), .rings = 8});
    const double edge = disc_radius / 8, radius = 2 * edge;
    const auto tissue =
        membrane::Tissue(membrane::MassSpringNetwork(mesh, membrane::LinearSpring{},
                                                     {.stiffness = S(0), .pinned = membrane::border(mesh)}),
                         membrane::triangular_springs(mesh, sheet, stretch));
    const membrane::FoundationSprings<S> nothing(mesh, {.normal = S(0), .tangential = S(0)});
    const FacetCorrection<S> correction(mesh,
                                        {.tension = tension(), .stiffness = sheet.young_modulus * sheet.thickness});
    const auto spread = [&](bool corrected) {
        membrane::QuasiStaticSolver solver(tissue, {.layers = membrane::unlimited, .sweeps = 8});
        membrane::AabbTree<S> tree(mesh);
        membrane::ContactTracker<S> tracker(mesh, {.fine_triangles = 0});
        Points<S> x = mesh.positions();
        membrane::Vector3<S> offset = membrane::Vector3<S>::Zero();
        double least = 1, most = 0;
        constexpr int start = 300, ticks = 700;
        for (int tick = 0; tick < ticks; ++tick) {
            const double along = std::max(0, tick - start) * edge / (ticks - start);  // over a face, a vertex, a face
            const double depth = 0.05 * radius * std::min(1.0, tick / 50.0);
            membrane::Tool<S> ball{.position = {S(along), S(0.3 * (edge - along)), S(radius - depth)},
                                   .radius = S(radius)};
            ball.position += offset;
            const auto contact = tracker.update(tree, x, ball);
            const auto report = solver.step(x, S(1e-3), tissue, nothing, press(ball, contact));
            tree.refit(x, report.moved);
            if (corrected) offset += (correction(x, contact, report.reactions[0]) - offset) / 2;
            if (tick < start) continue;
            least = std::min<double>(least, membrane::norm(report.reactions[0]));
            most = std::max<double>(most, membrane::norm(report.reactions[0]));
        }
        return most / least - 1;
    };
    const double before = spread(false), after = spread(true);
    CAPTURE(before, after);
    CHECK(after < before / 3);
}
