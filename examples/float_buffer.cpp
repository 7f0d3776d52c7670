// SPDX-License-Identifier: MIT
//
// An engine's vertices, interleaved and in floats, are deformed in place: the loop copies no position, and writes only
// the normals that have changed.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <vector>

#include <membrane/membrane.hpp>

/// One vertex as the engine sends it to the graphics card.
struct EngineVertex {
    float position[3], normal[3], texture[2];
};

/// The engine's mesh: vertices, and 32-bit indices.
struct EngineMesh {
    std::vector<EngineVertex> vertices;
    std::vector<std::uint32_t> indices;
};

/// A sphere of radius 10 mm, in metres.
EngineMesh load() {
    const auto sphere = membrane::icosphere<float>({.radius = 10e-3, .subdivisions = 3});
    EngineMesh mesh{std::vector<EngineVertex>(static_cast<std::size_t>(sphere.vertex_count())), {}};
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
        Eigen::Map<Eigen::Vector3f>(mesh.vertices[v].position) = sphere.positions().col(static_cast<Eigen::Index>(v));
    }
    for (const auto corner : sphere.triangles().reshaped()) mesh.indices.push_back(static_cast<std::uint32_t>(corner));
    return mesh;
}

/// Three floats of every vertex, as the columns of a 3 x V matrix.
auto columns(std::vector<EngineVertex>& vertices, float (EngineVertex::*member)[3]) {
    constexpr Eigen::Index stride = sizeof(EngineVertex) / sizeof(float);
    return Eigen::Map<Eigen::Matrix3Xf, 0, Eigen::OuterStride<>>(
        vertices.front().*member, 3, static_cast<Eigen::Index>(vertices.size()), Eigen::OuterStride<>(stride));
}

int main() {
    EngineMesh engine = load();
    auto x = columns(engine.vertices, &EngineVertex::position);
    auto shown_normals = columns(engine.vertices, &EngineVertex::normal);
    const Eigen::Map<const Eigen::Matrix<std::uint32_t, 3, Eigen::Dynamic>> triangles(
        engine.indices.data(), 3, static_cast<Eigen::Index>(engine.indices.size() / 3));

    const float dt = 1e-3F;  // [s]
    const membrane::TriangleMesh mesh(x, triangles);
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0F});  // [N/m]
    const auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0F});                       // [N/m]
    auto solver = membrane::QuasiStaticSolver(network);
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto normals = membrane::VertexNormals(mesh);
    shown_normals = normals.values();
    membrane::ScriptedDevice<float> device({{0, {0, 0, 13e-3F}}, {0.2F, {0, 0, 10e-3F}}}, {.radius = 2e-3});

    std::size_t written = 0;  // most in a tick
    while (device.running()) {
        const auto tool = device.read();
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, dt, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        for (const auto v : normals.update(x, report.moved)) shown_normals.col(v) = normals.values().col(v);
        device.write(membrane::ReactionForce{}({tool, contact, report}));
        written = std::max(written, report.moved.size());
    }
    Eigen::Index deepest = 0;
    (x - mesh.positions()).colwise().squaredNorm().maxCoeff(&deepest);
    std::printf("%zu vertices of %zu bytes, at most %zu of them written in a frame\n", engine.vertices.size(),
                sizeof(EngineVertex), written);
    std::printf("vertex %td is now at (%.2f, %.2f, %.2f) mm, pressed with %.1f mN\n", deepest, 1e3F * x(0, deepest),
                1e3F * x(1, deepest), 1e3F * x(2, deepest), 1e3F * device.force().norm());
}
