// SPDX-License-Identifier: MIT
// What comes in by spans and by Eigen's own types, and what a loop on a moving body makes of it: numbers made of every
// bit.
#include <bit>
#include <cstdint>
#include <cstdio>
#include <span>
#include <vector>

#include <membrane/membrane.hpp>
#include <membrane/model/moving_foundation.hpp>

namespace {

template <class Matrix>
void print(const char* what, const Matrix& x) {
    std::uint64_t bits = 0;
    for (Eigen::Index c = 0; c < x.cols(); ++c) {
        for (Eigen::Index r = 0; r < x.rows(); ++r) bits = 31 * bits + std::bit_cast<std::uint64_t>(double(x(r, c)));
    }
    std::printf("%s %llx\n", what, static_cast<unsigned long long>(bits));
}

}  // namespace

int main() {
    const auto ball = membrane::icosphere<double>({.radius = 0.01, .subdivisions = 1});
    std::vector<double> xyz;
    std::vector<unsigned> corners;
    for (const auto& p : ball.positions().colwise()) xyz.insert(xyz.end(), {p[0], p[1], p[2]});
    for (const auto& t : ball.triangles().colwise()) {
        for (const auto v : t) corners.push_back(static_cast<unsigned>(v));
    }
    const membrane::TriangleMesh<double> by_spans{std::span<const double>(xyz), std::span<const unsigned>(corners)};
    print("spans", by_spans.positions());
    print("their triangles", by_spans.triangles());
    const Eigen::Matrix3Xd own = ball.positions();
    const Eigen::Matrix3Xi own_triangles = ball.triangles();
    print("matrices", membrane::TriangleMesh(own, own_triangles).positions());

    const auto mesh = membrane::reordered(by_spans).mesh;
    const auto network = membrane::MassSpringNetwork(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});
    const auto foundation = membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02});
    auto solver = membrane::QuasiStaticSolver(network);
    auto tree = membrane::AabbTree(mesh);
    auto tracker = membrane::ContactTracker(mesh);
    auto normals = membrane::VertexNormals(mesh);
    auto body = membrane::MovingBody(mesh);
    auto x = mesh.positions();
    membrane::Tool<double> tool{.position = {1e-3, 5e-4, 0.013}, .radius = 2e-3};
    membrane::Contact<double> contact;
    Eigen::Vector3d force(0, 0, 0);
    for (int i = 0; i < 60; ++i) {
        tool.position.z() -= 4e-5;
        tool.time = i * 1e-3;
        membrane::RigidFrame<double> pose;
        pose.origin = {1e-6 * i, 0, 0};
        if (!body.move_to(pose, x)) return 1;
        tree.refit(x);
        contact = tracker.update(tree, x, tool, body);
        const auto report = solver.step(x, 1e-3, network, on(body, foundation), press(tool, contact));
        normals.update(x);
        force = report.reactions[0];
    }
    print("loop", x);
    print("normals", normals.values());
    print("force", force);
    return force.norm() > 0.01 ? 0 : 1;
}
