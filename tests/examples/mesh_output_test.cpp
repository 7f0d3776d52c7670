// SPDX-License-Identifier: MIT
#include "support/mesh_output.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include <membrane/solve/boundary_conditions.hpp>
#include <membrane/solve/quasi_static.hpp>
#include <membrane/solve/tool_contact.hpp>
#include <membrane/surface/shapes.hpp>

#include "mesh_texts.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/mesh_file.hpp"
#include "support/random.hpp"

using namespace test;

namespace {

std::string content(const std::filesystem::path& file) {
    std::ifstream stream(file, std::ios::binary);
    REQUIRE(stream.good());
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

/// The numbers of the array `name` of a .vtp, which must have this type and so many components.
std::vector<double> array(const std::string& text, const std::string& type, const std::string& name, int components) {
    const std::string head = "<DataArray type='" + type + "' Name='" + name + "' NumberOfComponents='" +
                             std::to_string(components) + "' format='ascii'>\n";
    const std::size_t begin = text.find(head), end = text.find("</DataArray>", begin);
    REQUIRE(begin != text.npos);
    REQUIRE(end != text.npos);
    const std::string body = text.substr(begin + head.size(), end - begin - head.size());
    if (type == "Int32") REQUIRE(body.find_first_not_of("0123456789 \n") == body.npos);
    std::istringstream numbers(body);
    std::vector<double> result;
    for (std::string word; numbers >> word;) result.push_back(std::stod(word));
    return result;
}

template <class Matrix>
std::vector<double> numbers(const Matrix& matrix) {
    std::vector<double> result;
    for (const auto number : matrix.reshaped()) result.push_back(static_cast<double>(number));
    return result;
}

examples::SurfaceState random_state(const membrane::TriangleMesh<double>& mesh, Random& random) {
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});
    membrane::Points<double> x = mesh.positions();
    for (double& number : x.reshaped()) number += random.number(-1e-4, 1e-4);
    return examples::surface_state(mesh, x, network, membrane::NoFoundation{});
}

}  // namespace

TEST_CASE("tension and force are what the energy says") {
    for (int seed = 1; seed <= cases(50, 1000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = membrane::icosphere<double>({.radius = 0.01, .subdivisions = 2});
        const auto network = membrane::MassSpringNetwork(mesh, membrane::ExponentialSpring{}, {.stiffness = 40.0});
        membrane::Points<double> x = random.number(0.9, 1.2) * mesh.positions();
        for (double& number : x.reshaped()) number += random.number(-2e-4, 2e-4);
        const auto state = examples::surface_state(mesh, x, network, membrane::NoFoundation{});
        CHECK(state.points == x);
        CHECK(state.displacement == x - mesh.positions());

        // Energy of all that grows by a small part in all directions: twice the sum of area times tension, and the work
        // of the forces.
        const double part = 1e-5;
        const membrane::Points<double> larger = (1 + part) * x, smaller = (1 - part) * x;
        const double slope = (network.energy(larger) - network.energy(smaller)) / (2 * part);
        Eigen::VectorXd area = Eigen::VectorXd::Zero(x.cols());
        for (const auto& t : mesh.triangles().colwise()) {
            const Eigen::Vector3d ab = x.col(t[1]) - x.col(t[0]), ac = x.col(t[2]) - x.col(t[0]);
            for (const auto v : t) area[v] += ab.cross(ac).norm() / 2 / 3;
        }
        const double scale = 40 * 1e-4;  // [J]
        CHECK(2 * area.dot(state.tension) == Approx(slope).margin(1e-7 * scale));
        CHECK((state.force.array() * x.array()).sum() == Approx(slope).margin(1e-7 * scale));
    }
}

TEST_CASE("what holds a vertex that is pulled is the reaction, and nothing holds the others") {
    const auto mesh = membrane::icosphere<double>({.radius = 0.01, .subdivisions = 2});
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});
    const auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});
    auto solver = membrane::QuasiStaticSolver(network, {.layers = membrane::unlimited, .sweeps = 100});
    auto x = mesh.positions();
    const Eigen::Vector3d target = 1.3 * mesh.positions().col(17);
    Eigen::Vector3d reaction = Eigen::Vector3d::Zero();
    for (int tick = 0; tick < 200; ++tick) {
        reaction = solver.step(x, 1e-3, network, foundation, membrane::pull(17, target)).reactions[0];
    }
    auto state = examples::surface_state(mesh, x, network, foundation);
    REQUIRE(reaction.norm() > 0.01);
    CHECK((state.force.col(17) + reaction).norm() < 1e-5 * reaction.norm());
    state.force.col(17).setZero();
    CHECK(state.force.cwiseAbs().maxCoeff() < 1e-5 * reaction.norm());
}

TEST_CASE("a file for ParaView has every number to the last digit") {
    const Folder folder;
    Random random(1);
    for (const membrane::Index subdivisions : {0, 2, 4}) {
        const auto mesh = membrane::icosphere<double>({.radius = 0.01, .subdivisions = subdivisions});
        const auto state = random_state(mesh, random);
        examples::write_vtp(folder.path / "a.vtp", mesh.triangles(), state);
        const std::string text = content(folder.path / "a.vtp");
        CHECK(text.rfind("<?xml version='1.0'?>\n<VTKFile type='PolyData'", 0) == 0);
        CHECK_THAT(text, ContainsSubstring("NumberOfPoints='" + std::to_string(mesh.vertex_count()) + "'") &&
                             ContainsSubstring("NumberOfPolys='" + std::to_string(mesh.triangle_count()) + "'"));
        CHECK(array(text, "Float64", "points", 3) == numbers(state.points));
        CHECK(array(text, "Float64", "displacement", 3) == numbers(state.displacement));
        CHECK(array(text, "Float64", "force", 3) == numbers(state.force));
        CHECK(array(text, "Float64", "tension", 1) == numbers(state.tension));
        CHECK(array(text, "Int32", "connectivity", 1) == numbers(mesh.triangles()));
        const auto ends = array(text, "Int32", "offsets", 1);
        REQUIRE(ends.size() == static_cast<std::size_t>(mesh.triangle_count()));
        for (std::size_t f = 0; f < ends.size(); ++f) REQUIRE(ends[f] == 3.0 * static_cast<double>(f + 1));
    }
}

TEST_CASE("a file for ParaView has no exponent in its indices") {
    const Folder folder;
    const auto mesh = membrane::sheet<double>({.columns = 183, .rows = 183});
    const auto& x = mesh.positions();
    examples::write_vtp(folder.path / "a.vtp", mesh.triangles(), {x, x, x, Eigen::VectorXd::Zero(x.cols())});
    const auto ends = array(content(folder.path / "a.vtp"), "Int32", "offsets", 1);
    CHECK(ends.size() == static_cast<std::size_t>(mesh.triangle_count()));
    CHECK(ends.back() == 3.0 * static_cast<double>(mesh.triangle_count()));
    CHECK(std::find(ends.begin(), ends.end(), 99999) != ends.end());
    CHECK(std::find(ends.begin(), ends.end(), 150000) != ends.end());
}

TEST_CASE("a file for MeshLab is read back, and has every number to the last digit") {
    const Folder folder;
    Random random(2);
    const auto mesh = membrane::icosphere<double>({.radius = 0.01, .subdivisions = 2});
    const auto state = random_state(mesh, random);
    const auto file = folder.path / "a.ply";
    examples::write_ply(file, mesh.triangles(), state);
    const auto read = examples::read_mesh(file);
    CHECK(read.triangles == mesh.triangles());
    CHECK((read.points - state.points).cwiseAbs().maxCoeff() < 1e-9);

    const std::string text = content(file);
    std::istringstream rows(text.substr(text.find("end_header\n") + 11));
    for (membrane::Index v = 0; v < mesh.vertex_count(); ++v) {
        Eigen::Matrix<double, 11, 1> row, expected;
        for (double& number : row) rows >> number;
        expected << state.points.col(v), state.displacement.col(v), state.force.col(v), state.tension[v],
            state.displacement.col(v).norm();
        REQUIRE(row.head(10) == expected.head(10));
        REQUIRE(row[10] == Approx(expected[10]));
    }
}

TEST_CASE("a time series names its states with their times") {
    const Folder folder;
    Random random(3);
    const auto mesh = membrane::icosphere<double>({.radius = 0.01, .subdivisions = 1});
    const auto state = random_state(mesh, random);
    auto farther = state;
    farther.displacement *= 2;
    examples::Series series(folder.path / "new" / "folder", "ball", mesh.triangles(), 0.02);
    int written = 0;
    for (int tick = 0; tick <= 100; ++tick) {
        const double time = 1e-3 * tick;
        if (!series.due(time)) continue;
        series.add(time, written == 2 ? farther : state, {0, 0, 1});
        const std::string pvd = content(folder.path / "new" / "folder" / "ball.pvd");
        CHECK_THAT(pvd, ContainsSubstring("part='0' file='ball_" + std::to_string(written) + ".vtp'/>\n</Collection>"));
        ++written;
    }
    CHECK(written == 6);
    const auto pvd = content(folder.path / "new" / "folder" / "ball.pvd");
    CHECK_THAT(pvd, ContainsSubstring("timestep='0' ") && ContainsSubstring("timestep='0.02' ") &&
                        ContainsSubstring("timestep='0.1' "));
    const auto points = array(content(folder.path / "new" / "folder" / "ball_5.vtp"), "Float64", "points", 3);
    CHECK(points == numbers((state.points.colwise() + Eigen::Vector3d(0, 0, 1)).eval()));
    const auto most = content(folder.path / "new" / "folder" / "ball.ply");
    examples::write_ply(folder.path / "farther.ply", mesh.triangles(), [&] {
        auto moved = farther;
        moved.points.colwise() += Eigen::Vector3d(0, 0, 1);
        return moved;
    }());
    CHECK(most == content(folder.path / "farther.ply"));

    CHECK_FALSE(examples::Series("", "none", mesh.triangles(), 0.02).due(0));
    const std::string file = folder.file("file", "");
    CHECK_THROWS_AS(examples::Series(file + "/folder", "ball", mesh.triangles(), 0.02), std::runtime_error);
    CHECK_THROWS_AS(examples::write_vtp(file + "/a.vtp", mesh.triangles(), state), std::runtime_error);
}
