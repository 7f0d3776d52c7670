// SPDX-License-Identifier: MIT
#include <membrane/tissue/bending_triangles.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <vector>

#include <Eigen/LU>
#include <Eigen/SparseCholesky>

#include <membrane/core/lanes.hpp>
#include <membrane/surface/adjacency.hpp>
#include <membrane/surface/shapes.hpp>
#include <membrane/tissue/spring_stiffness.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/element_check.hpp"
#include "support/meshes.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;
using test::refusal;

namespace {

using Bending = Elements<double, BendingTriangle<double>>;

/// Any constants, for an energy of the order of `k` [J] in lengths of `size`.
BendingTriangle<double> random_element(double size, double k, Random& random) {
    BendingTriangle<double> element;
    for (auto& weight : element.by_height) weight = std::sqrt(k) / size * random.vector();
    element.rest = std::sqrt(k) * random.vector();
    element.by_tilt = (random.chance(0.5) ? std::sqrt(k) : 0) * random.vector();
    element.tangent = random.unit_vector();
    return element;
}

Corners<double, 12> random_corners(double size, Random& random) {
    for (;;) {
        Corners<double, 12> x;
        for (auto& corner : x) corner = size * random.vector();
        if (norm<double>(cross<double>(x[1] - x[0], x[2] - x[0])) > 0.3 * size * size) return x;
    }
}

Corners<double, 12> ordered(const Corners<double, 12>& x, std::size_t i) {
    Corners<double, 12> result;
    for (std::size_t k = 0; k < 12; ++k) result[k] = x[BendingTriangle<double>::orders[i][k]];
    return result;
}

/// A sheet in the plane z = 0 of about `squares` triangles along each side, with edges of about 1 / `squares`.
TriangleMesh<double> flat_sheet(Index squares, Random& random) {
    const auto sheet = test::irregular_sheet(squares, random);
    const double size =
        1 / (sheet.positions().rowwise().maxCoeff() - sheet.positions().rowwise().minCoeff()).maxCoeff();
    return {Points<double>(size * sheet.positions()), sheet.triangles()};
}

/// How many edges each vertex is away from the border.
std::vector<int> depths(const TriangleMesh<double>& mesh) {
    std::vector<int> depth(static_cast<std::size_t>(mesh.vertex_count()), 1000);
    for (const Index v : border(mesh)) depth[static_cast<std::size_t>(v)] = 0;
    for (int round = 0; round < 10; ++round) {
        for (const auto& corners : mesh.triangles().colwise()) {
            for (const Index a : corners) {
                for (const Index b : corners) {
                    int& here = depth[static_cast<std::size_t>(a)];
                    here = std::min(here, depth[static_cast<std::size_t>(b)] + 1);
                }
            }
        }
    }
    return depth;
}

/// Whether all corners of the triangle are at least `least` edges away from the border.
template <class Instance>
bool is_inside(const Instance& instance, const std::vector<int>& depth, int least) {
    return std::all_of(instance.corners.begin(), instance.corners.begin() + 3,
                       [&](Index v) { return depth[static_cast<std::size_t>(v)] >= least; });
}

double area_of(const Corners<double, 12>& x) { return norm<double>(cross<double>(x[1] - x[0], x[2] - x[0])) / 2; }

Points<double> forces(const Bending& bending, const Points<double>& x) {
    Points<double> sum = Points<double>::Zero(3, x.cols());
    for (const auto& instance : bending.all()) {
        const auto corners = instance.where(x);
        for (std::size_t i = 0; i < 12; ++i) {
            sum.col(instance.corners[i]) += instance.element.force_on(corners, i).force.eigen();
        }
    }
    return sum;
}

double energy_of(const Bending& bending, const Points<double>& x) {
    double sum = 0;
    for (const auto& instance : bending.all()) sum += instance.element.energy(instance.where(x));
    return sum;
}

/// Small deflections of a flat sheet along z, by sparse factors of the elements' Hessian at rest.
class Plate {
  public:
    Plate(const TriangleMesh<double>& mesh, const Bending& bending)
        : mesh_(mesh), stiffness_(mesh.vertex_count(), mesh.vertex_count()) {
        std::vector<Eigen::Triplet<double>> entries;
        for (const auto& instance : bending.all()) {
            const auto x = instance.where(mesh.positions());
            for (std::size_t i = 0; i < 12; ++i) {
                for (std::size_t j = 0; j < 12; ++j) {
                    entries.emplace_back(static_cast<int>(instance.corners[i]), static_cast<int>(instance.corners[j]),
                                         instance.element.hessian_block(x, i, j)(2, 2));
                }
            }
        }
        stiffness_.setFromTriplets(entries.begin(), entries.end());
    }

    /// Under `pressure`, with vertices held at their heights where these are no NaN.
    [[nodiscard]] Eigen::VectorXd heights(const Eigen::VectorXd& held, double pressure) const {
        std::vector<int> row(static_cast<std::size_t>(held.size()), -1);
        int rows = 0;
        for (Eigen::Index v = 0; v < held.size(); ++v) {
            if (std::isnan(held[v])) row[static_cast<std::size_t>(v)] = rows++;
        }
        const Eigen::VectorXd known = held.array().isNaN().select(0, held);
        const auto areas = vertex_areas(mesh_);
        Eigen::VectorXd load = -(stiffness_ * known);
        Eigen::VectorXd right(rows);
        std::vector<Eigen::Triplet<double>> entries;
        for (int k = 0; k < stiffness_.outerSize(); ++k) {
            const int to = row[static_cast<std::size_t>(k)];
            if (to < 0) continue;
            right[to] = load[k] + pressure * areas[static_cast<std::size_t>(k)];
            for (Eigen::SparseMatrix<double>::InnerIterator it(stiffness_, k); it; ++it) {
                const int from = row[static_cast<std::size_t>(it.row())];
                if (from >= 0) entries.emplace_back(from, to, it.value());
            }
        }
        Eigen::SparseMatrix<double> free(rows, rows);
        free.setFromTriplets(entries.begin(), entries.end());
        const Eigen::VectorXd found = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(free).solve(right);
        Eigen::VectorXd all = known;
        for (Eigen::Index v = 0; v < held.size(); ++v) {
            if (row[static_cast<std::size_t>(v)] >= 0) all[v] = found[row[static_cast<std::size_t>(v)]];
        }
        return all;
    }

    /// The force that holds each vertex.
    [[nodiscard]] Eigen::VectorXd pull(const Eigen::VectorXd& heights) const { return stiffness_ * heights; }

  private:
    const TriangleMesh<double>& mesh_;
    Eigen::SparseMatrix<double> stiffness_;
};

/// A disc of radius 1; its vertices between the circle of `patch` and the rim are moved by up to `by` edges.
TriangleMesh<double> unit_disc(Index rings, double by, double patch, Random& random) {
    const auto regular = disc<double>({.radius = 1, .rings = rings});
    Points<double> x = regular.positions();
    for (Index v = 0; v < x.cols(); ++v) {
        const double r = x.col(v).norm();
        if (r > 1 - 1e-9 || std::abs(r - patch) < 1e-9) continue;
        for (Eigen::Index k = 0; k < 2; ++k) x(k, v) += by / static_cast<double>(rings) * random.number(-1.0, 1.0);
    }
    return {x, regular.triangles()};
}

constexpr double nu = 0.3, rigidity = 2e-6;

/// Plates with radial symmetry: w = A + B r^2 + C log r + E r^2 log r + p r^4 / (64 D) between radii.
struct Ring {
    Eigen::Vector4d constants;
    double load;  // p / (64 D)

    [[nodiscard]] double height(double r) const {
        return constants.dot(Eigen::Vector4d(1, r * r, std::log(r), r * r * std::log(r))) + load * std::pow(r, 4);
    }
};
/// Rows of conditions at r: height, slope, bending moment / -D, shear force / -D; the last entry is that of r^4.
std::array<Eigen::Matrix<double, 5, 1>, 4> conditions(double r) {
    const double l = std::log(r);
    const Eigen::Matrix<double, 5, 1> height{1, r * r, l, r * r * l, std::pow(r, 4)};
    const Eigen::Matrix<double, 5, 1> slope{0, 2 * r, 1 / r, r * (2 * l + 1), 4 * std::pow(r, 3)};
    const Eigen::Matrix<double, 5, 1> second{0, 2, -1 / (r * r), 2 * l + 3, 12 * r * r};
    return {height, slope, Eigen::Matrix<double, 5, 1>(second + nu / r * slope),
            Eigen::Matrix<double, 5, 1>{0, 0, 0, 4 / r, 32 * r}};
}
Ring ring(const std::array<Eigen::Matrix<double, 5, 1>, 4>& rows, const Eigen::Vector4d& values, double load) {
    Eigen::Matrix4d left;
    Eigen::Vector4d right;
    for (Eigen::Index i = 0; i < 4; ++i) {
        const auto& row = rows[static_cast<std::size_t>(i)];
        left.row(i) = row.head<4>().transpose();
        right[i] = values[i] - load * row[4];
    }
    return {left.fullPivLu().solve(right), load};
}

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

/// Error of the deflections, relative, by the root of mean squares.
double error_of(const TriangleMesh<double>& mesh, const Eigen::VectorXd& found,
                const std::function<double(double)>& height) {
    double wrong = 0, all = 0;
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
        const double right = height(mesh.positions().col(v).norm());
        wrong += std::pow(found[v] - right, 2), all += right * right;
    }
    return std::sqrt(wrong / all);
}

/// Errors of `solve(rings, by)` on 8, 16 and 32 rings, regular and irregular: of second order.
void check_convergence(const std::function<double(Index, double)>& solve, double last) {
    for (const double by : {0.0, 0.15, 0.25}) {
        const double coarse = solve(8, by), middle = solve(16, by), fine = solve(32, by);
        CAPTURE(by, coarse, middle, fine);
        CHECK(std::log2(coarse / fine) / 2 > 1.8);
        CHECK(std::log2(middle / fine) > 1.8);
        CHECK(fine < last);
    }
}

}  // namespace

TEST_CASE("a bending triangle pulls with the derivative of its energy, whatever its constants", "[bending_triangles]") {
    int known = 0;
    const int elements = cases(300);
    for (int seed = 1; seed <= elements; ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const double size = std::pow(10, random.number(-4.0, 0.0)), k = std::pow(10, random.number(-8.0, 0.0));
        const auto element = random_element(size, k, random);
        const auto x = random_corners(size, random);
        const double energy = 100 * k;
        test::check_element(element, x, 0.3 * size, energy, random);
        auto at_rest = element;
        at_rest.rest += detail::bent_by<double>(element, x, detail::TrianglePlane<double>(x));
        test::check_hessian(at_rest, x, 0.3 * size, energy);
        known += test::check_remainder(element, x, size, energy, random);
        for (std::size_t i = 0; i < 12; ++i) {  // seen from each corner the same
            REQUIRE(element.in_order(i).energy(ordered(x, i)) == Approx(element.energy(x)).epsilon(1e-9));
            const std::size_t place = i < 3 ? 0 : i < 6 ? 3 : i % 2 == 0 ? 6 : 7;
            REQUIRE(BendingTriangle<double>::orders[i][place] == i);
        }
    }
    CHECK(known > 10 * elements);  // of twelve corners; those of the triangle know half of their displacements
    CHECK(known < 11.4 * elements);
}

TEST_CASE("a plate bent to any quadric stores what a plate does", "[bending_triangles]") {
    int triangles = 0;
    for (int seed = 1; seed <= cases(50); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = flat_sheet(7, random);
        const double poisson = random.number(0.0, 0.5);
        const auto bending = bending_triangles(mesh, {.rigidity = rigidity, .poisson_ratio = poisson});
        const auto depth = depths(mesh);
        const double a = random.number(-1.0, 1.0), b = random.number(-1.0, 1.0), c = random.number(-1.0, 1.0);
        const Eigen::Vector2d tilt(random.number(-1.0, 1.0), random.number(-1.0, 1.0));
        const double small = 1e-5;
        Points<double> x = mesh.positions();
        for (Index v = 0; v < x.cols(); ++v) {
            const Eigen::Vector2d p = x.col(v).head<2>();
            x(2, v) = small * (tilt.dot(p) + a / 2 * p.x() * p.x() + b / 2 * p.y() * p.y() + c * p.x() * p.y());
        }
        const double density = rigidity / 2 * small * small * ((a + b) * (a + b) - 2 * (1 - poisson) * (a * b - c * c));
        for (const auto& instance : bending.all()) {
            if (!is_inside(instance, depth, 2)) continue;
            const auto corners = instance.where(x);
            REQUIRE(instance.element.energy(corners) == Approx(density * area_of(corners)).epsilon(1e-5));
            ++triangles;
        }
        // Constant moments are in equilibrium.
        const auto pull = forces(bending, x);
        const double moment = rigidity * small * (std::abs(a) + std::abs(b) + std::abs(c));
        for (Index v = 0; v < x.cols(); ++v) {
            if (depth[static_cast<std::size_t>(v)] >= 4) REQUIRE(pull.col(v).norm() < 1e-4 * moment * 7);
        }
    }
    CHECK(triangles > cases(50));
}

TEST_CASE("a sheet rolled up and a roll laid flat store what a plate does", "[bending_triangles]") {
    Random random(3);
    const auto flat = flat_sheet(8, random);
    const double radius = 8, angle = 0.4;
    Points<double> x = flat.positions();
    for (Index v = 0; v < x.cols(); ++v) {
        const double along = std::cos(angle) * x(0, v) + std::sin(angle) * x(1, v),
                     across = std::cos(angle) * x(1, v) - std::sin(angle) * x(0, v);
        x.col(v) = Eigen::Vector3d(radius * std::sin(along / radius), across, radius * (1 - std::cos(along / radius)));
    }
    const TriangleMesh<double> rolled(x, flat.triangles());
    const auto depth = depths(flat);
    const auto check = [&](const TriangleMesh<double>& rest, const Points<double>& now) {
        const auto bending = bending_triangles(rest, {.rigidity = rigidity, .poisson_ratio = nu});
        double energy = 0, area = 0;
        for (const auto& instance : bending.all()) {
            if (!is_inside(instance, depth, 2)) continue;
            energy += instance.element.energy(instance.where(now));
            area += area_of(instance.where(rest.positions()));
        }
        REQUIRE(area > 0.1);
        CHECK(2 * energy * radius * radius / (rigidity * area) == Approx(1).epsilon(2e-3));
    };
    check(flat, x);
    check(rolled, flat.positions());
}

TEST_CASE("a rigid motion does not bend, a held patch takes the sheet along", "[bending_triangles]") {
    for (int seed = 1; seed <= cases(20); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto sphere = icosphere<double>({.radius = 1, .subdivisions = 2});
        const TriangleMesh<double> mesh(test::jittered(sphere.positions(), 0.05, random), sphere.triangles());
        std::vector<Index> patch;
        for (Index v = 0; v < mesh.vertex_count(); ++v) {
            if (mesh.positions()(2, v) > 0.6) patch.push_back(v);
        }
        const auto bending = bending_triangles(mesh, {.rigidity = rigidity, .poisson_ratio = nu, .clamped = patch});
        REQUIRE(bending.all().size() < static_cast<std::size_t>(mesh.triangle_count()));
        const Eigen::Matrix3d turn = random.rotation();
        const Eigen::Vector3d shift = random.vector();
        const Points<double> moved = (turn * mesh.positions()).colwise() + shift;
        REQUIRE(energy_of(bending, moved) < 1e-20 * rigidity);
        REQUIRE(forces(bending, moved).norm() < 1e-9 * rigidity);
        const Points<double> bent = test::jittered(mesh.positions(), 0.02, random);
        const Points<double> both = (turn * bent).colwise() + shift;
        REQUIRE(energy_of(bending, both) == Approx(energy_of(bending, bent)).epsilon(1e-9));
        REQUIRE((forces(bending, both) - turn * forces(bending, bent)).norm() < 1e-9 * forces(bending, bent).norm());
        REQUIRE(forces(bending, bent).rowwise().sum().norm() < 1e-9 * forces(bending, bent).norm());
    }
}

TEST_CASE("a clamped plate converges in second order", "[bending_triangles]") {
    Random random(5);
    check_convergence(
        [&](Index rings, double by) {
            const auto mesh = unit_disc(rings, by, 0, random);
            const auto bending =
                bending_triangles(mesh, {.rigidity = rigidity, .poisson_ratio = nu, .clamped = border(mesh)});
            Eigen::VectorXd held = Eigen::VectorXd::Constant(mesh.vertex_count(), unknown);
            for (const Index v : border(mesh)) held[v] = 0;
            const double pressure = 64 * rigidity;
            return error_of(mesh, Plate(mesh, bending).heights(held, pressure),
                            [](double r) { return std::pow(1 - r * r, 2); });
        },
        0.006);
}

TEST_CASE("a plate whose rim may turn converges in second order", "[bending_triangles]") {
    Random random(6);
    check_convergence(
        [&](Index rings, double by) {
            const auto mesh = unit_disc(rings, by, 0, random);
            const auto bending = bending_triangles(mesh, {.rigidity = rigidity, .poisson_ratio = nu});
            Eigen::VectorXd held = Eigen::VectorXd::Constant(mesh.vertex_count(), unknown);
            for (const Index v : border(mesh)) held[v] = 0;
            return error_of(mesh, Plate(mesh, bending).heights(held, 64 * rigidity),
                            [](double r) { return (1 - r * r) * ((5 + nu) / (1 + nu) - r * r); });
        },
        0.001);
}

TEST_CASE("a pinned triangle does not clamp the rim beside it", "[bending_triangles]") {
    Random random(10);
    check_convergence(
        [&](Index rings, double by) {
            const auto round = unit_disc(rings, by, 0, random);
            test::Surface<double> surface = test::surface_of(round);
            for_each_edge(half_edges(round.triangles()), [&](std::span<const HalfEdge> edge) {
                if (edge.size() != 1 || !random.chance(0.3)) return;
                const HalfEdge& side = edge[0];
                const Eigen::Vector3d middle = round.positions().col(side.first) + round.positions().col(side.second);
                surface.add(Eigen::Vector3d(middle.normalized()));
                const Index last = surface.vertex_count() - 1;
                surface.add(side.forward ? side.second : side.first, side.forward ? side.first : side.second, last);
            });
            const auto mesh = surface.mesh();
            const auto bending =
                bending_triangles(mesh, {.rigidity = rigidity, .poisson_ratio = nu, .supported = border(mesh)});
            REQUIRE(bending.all().size() == static_cast<std::size_t>(round.triangle_count()));
            Eigen::VectorXd held = Eigen::VectorXd::Constant(mesh.vertex_count(), unknown);
            for (const Index v : border(round)) held[v] = 0;
            for (Index v = round.vertex_count(); v < mesh.vertex_count(); ++v) held[v] = 0;
            return error_of(mesh, Plate(mesh, bending).heights(held, 64 * rigidity),
                            [](double r) { return (1 - r * r) * ((5 + nu) / (1 + nu) - r * r); });
        },
        0.001);
}

TEST_CASE("a plate with a free rim around a rigid patch converges in second order", "[bending_triangles]") {
    Random random(7);
    const double patch = 0.25;
    const auto inner = conditions(patch), outer = conditions(1);
    const auto exact = ring({inner[0], inner[1], outer[2], outer[3]}, Eigen::Vector4d::Zero(), 1);
    check_convergence(
        [&](Index rings, double by) {
            const auto mesh = unit_disc(rings, by, patch, random);
            BendingOptions options{.rigidity = rigidity, .poisson_ratio = nu};
            Eigen::VectorXd held = Eigen::VectorXd::Constant(mesh.vertex_count(), unknown);
            const auto regular = disc<double>({.radius = 1, .rings = rings});
            for (Index v = 0; v < mesh.vertex_count(); ++v) {
                if (regular.positions().col(v).norm() < patch + 1e-9) options.clamped.push_back(v), held[v] = 0;
            }
            const auto bending = bending_triangles(mesh, options);
            return error_of(mesh, Plate(mesh, bending).heights(held, 64 * rigidity),
                            [&](double r) { return r < patch ? 0 : exact.height(r); });
        },
        0.01);
}

TEST_CASE("the force on a rigid patch converges in second order", "[bending_triangles]") {
    Random random(8);
    const double patch = 0.25;
    const auto inner = conditions(patch), outer = conditions(1);
    const auto exact = ring({inner[0], inner[1], outer[0], outer[1]}, {1, 0, 0, 0}, 0);
    const double force = 8 * std::numbers::pi * rigidity * exact.constants[3];
    check_convergence(
        [&](Index rings, double by) {
            const auto mesh = unit_disc(rings, by, patch, random);
            BendingOptions options{.rigidity = rigidity, .poisson_ratio = nu, .clamped = border(mesh)};
            Eigen::VectorXd held = Eigen::VectorXd::Constant(mesh.vertex_count(), unknown);
            for (const Index v : options.clamped) held[v] = 0;
            std::vector<Index> pulled;
            const auto regular = disc<double>({.radius = 1, .rings = rings});
            for (Index v = 0; v < mesh.vertex_count(); ++v) {
                if (regular.positions().col(v).norm() < patch + 1e-9) pulled.push_back(v), held[v] = 1;
            }
            options.clamped.insert(options.clamped.end(), pulled.begin(), pulled.end());
            const Plate plate(mesh, bending_triangles(mesh, options));
            const Eigen::VectorXd pull = plate.pull(plate.heights(held, 0));
            double sum = 0;
            for (const Index v : pulled) sum += pull[v];
            return std::abs(std::abs(sum / force) - 1);
        },
        0.02);
}

TEST_CASE("a clamped rim resists a cone, a supported one turns", "[bending_triangles]") {
    const auto mesh = disc<double>({.radius = 1, .rings = 6});
    // [clamped]
    const auto rim = border(mesh);
    const auto clamped = bending_triangles(mesh, {.rigidity = rigidity, .poisson_ratio = nu, .clamped = rim});
    const auto hinged = bending_triangles(mesh, {.rigidity = rigidity, .poisson_ratio = nu, .supported = rim});
    // [/clamped]
    Points<double> x = mesh.positions();
    for (Index v = 0; v < x.cols(); ++v) x(2, v) = 1e-3 * (1 - x.col(v).norm());
    CHECK(energy_of(clamped, x) > 1.2 * energy_of(hinged, x));
    CHECK(energy_of(hinged, x) > 0);
}

TEST_CASE("a mesh with holes is at rest, in float as well", "[bending_triangles]") {
    for (int seed = 1; seed <= cases(30); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto check = [&](auto scalar) {
            using S = decltype(scalar);
            const auto mesh = test::with_holes(test::random_surface<S>(random), random).mesh();
            const auto bending = bending_triangles(mesh, {.rigidity = 1e-6, .poisson_ratio = nu});
            REQUIRE(bending.all().size() == static_cast<std::size_t>(mesh.triangle_count()));
            for (const auto& instance : bending.all()) {
                const auto x = instance.where(mesh.positions());
                const auto& corners = instance.corners;
                for (auto corner = corners.begin() + 3; corner != corners.end(); ++corner) {  // none counts twice
                    if (std::find(corners.begin(), corner, *corner) == corner) continue;
                    REQUIRE(norm(instance.element.by_height[static_cast<std::size_t>(corner - corners.begin()) - 3]) ==
                            0);
                }
                for (std::size_t i = 0; i < 12; ++i) {
                    const auto pull = instance.element.force_on(x, i);
                    REQUIRE(norm(pull.force) <=
                            S(1e3) * std::numeric_limits<S>::epsilon() * (1 + norm(pull.hessian * x[i])));
                }
            }
        };
        check(0.0);
        check(0.0F);
    }
}

TEST_CASE("small closed surfaces and single triangles have finite weights", "[bending_triangles]") {
    Random random(9);
    Points<double> x(3, 4);
    x << 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1;
    Triangles all(3, 4);
    all << 0, 0, 0, 1, 2, 1, 3, 2, 1, 3, 2, 3;
    const BendingOptions options{.rigidity = 1, .poisson_ratio = nu};
    const auto closed = bending_triangles(TriangleMesh<double>(x, all), options);
    CHECK(closed.all().size() == 4);
    const Triangles one = all.leftCols(1), two = all.leftCols(2);
    const auto single = bending_triangles(TriangleMesh<double>(x, one), options);
    CHECK(energy_of(single, test::jittered(x, 0.1, random)) == 0);
    const auto pair = bending_triangles(TriangleMesh<double>(x, two), options);
    Points<double> folded = x;
    folded(1, 3) = 0.3;
    CHECK(energy_of(pair, folded) > 0);
}

TEST_CASE("what is no plate is refused, none costs nothing", "[bending_triangles][bad]") {
    const auto mesh = disc();
    CHECK(bending_triangles(mesh, {}).all().empty());
    CHECK(refusal([&] { (void)bending_triangles(mesh, {.rigidity = -1}); }) ==
          "bending_triangles: rigidity must be finite and not negative [N m], got -1");
    CHECK(refusal([&] { (void)bending_triangles(mesh, {.rigidity = 1, .poisson_ratio = 0.6}); }) ==
          "bending_triangles: poisson_ratio must be 0 to 0.5, got 0.6");
    CHECK(refusal([&] { (void)bending_triangles(mesh, {.rigidity = 1, .poisson_ratio = unknown}); }) ==
          "bending_triangles: poisson_ratio must be 0 to 0.5, got nan");
    CHECK(refusal([&] {
              (void)bending_triangles(mesh, {.rigidity = 1, .clamped = {-1}});
          }).find("bending_triangles: held vertex -1 is none, expected 0 to ") == 0);
}

TEST_CASE("bending triangles side by side do what each does alone, to the bit", "[bending_triangles]") {
    using Wide = Lanes<double>;
    for (int seed = 1; seed <= cases(100); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        std::array<BendingTriangle<double>, Wide::count> elements;
        std::array<Corners<double, 12>, Wide::count> x;
        for (auto& element : elements) element = random_element(1, 1, random);
        for (auto& corners : x) corners = random_corners(1, random);
        if (random.chance(0.3)) x[1][2] = x[1][0];  // without an area
        test::check_lanes(elements, x, 0.1 * random.vector(), [](const auto& all) {
            InLanes<BendingTriangle<double>> together;
            for (std::size_t l = 0; l < Wide::count; ++l) set_lane(together, l, all[l]);
            return together;
        });
    }
}
