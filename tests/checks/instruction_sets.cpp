// SPDX-License-Identifier: MIT
// A user's program of units for several instruction sets, in parts: -D MAKE, -D STEP (both with -D UNIT=NAME),
// -D ALL_MAIN, -D CROSSING_MAIN (with -D UNIT), -D GIVE, -D TAKE_MAIN. The linker takes `Scene`'s own functions from
// any unit that has them.
#include <cmath>
#include <cstdio>
#include <memory>

#if defined(MAKE) || defined(STEP)
#include <membrane/membrane.hpp>

struct Scene {
    membrane::TriangleMesh<double> mesh;
    membrane::MassSpringNetwork<double, membrane::LinearSpring> network;
    membrane::VirtualVolumeSprings<double> foundation;
    membrane::QuasiStaticSolver<double> solver;
    membrane::AabbTree<double> tree;
    membrane::ContactTracker<double> tracker;
    membrane::VertexNormals<double> normals;
    membrane::Points<double> x;
};
#elif defined(GIVE) || defined(TAKE_MAIN)
#include <membrane/contact/aabb_tree.hpp>

membrane::AabbTree<double>* given();
void take(const membrane::AabbTree<double>* tree);
membrane::TriangleMesh<double> mesh_from(const membrane::Points<double>& x);
#endif

struct Scene;
namespace sse2 {
Scene* make();
double step(Scene* scene);
}  // namespace sse2
namespace avx2 {
Scene* make();
double step(Scene* scene);
}  // namespace avx2
namespace portable {
Scene* make();
double step(Scene* scene);
}  // namespace portable

#if defined(MAKE)
Scene* UNIT::make() {
    const auto mesh = membrane::icosphere<double>({.radius = 0.01, .subdivisions = 3});
    const membrane::MassSpringNetwork network(mesh, membrane::LinearSpring{}, {.stiffness = 40.0});
    return new Scene{mesh,
                     network,
                     membrane::VirtualVolumeSprings(mesh, {.stiffness = 8.0, .damping = 0.02}),
                     membrane::QuasiStaticSolver(network, {.layers = 6}),
                     membrane::AabbTree(mesh),
                     membrane::ContactTracker(mesh),
                     membrane::VertexNormals(mesh),
                     mesh.positions()};
}
#elif defined(STEP)
// The force on a tool that presses. Frees the scene.
double UNIT::step(Scene* scene) {
    const std::unique_ptr<Scene> owner(scene);
    auto& [mesh, network, foundation, solver, tree, tracker, normals, x] = *scene;
    double force = 0;
    for (int tick = 0; tick < 50; ++tick) {
        const membrane::Tool<double> tool{.position = {0, 0, 0.0115 - 4e-5 * tick}, .radius = 1e-3};
        const auto contact = tracker.update(tree, x, tool);
        const auto report = solver.step(x, 1e-3, network, foundation, press(tool, contact));
        tree.refit(x, report.moved);
        normals.update(x, report.moved);
        force = report.reactions[0].norm();
    }
    return force;
}
#elif defined(ALL_MAIN)
int main() {
    const double force = sse2::step(sse2::make());
    for (const double other : {avx2::step(avx2::make()), portable::step(portable::make()), avx2::step(sse2::make()),
                               sse2::step(avx2::make()), portable::step(avx2::make()), sse2::step(portable::make())}) {
        if (!(force > 0.01 && other == force)) return std::printf("%.17g N, %.17g N\n", force, other);
    }
}
#elif defined(CROSSING_MAIN)
int main() { return UNIT::step(sse2::make()) > 0 ? 0 : 1; }
#elif defined(GIVE)
membrane::AabbTree<double>* given() { return nullptr; }
void take(const membrane::AabbTree<double>*) {}
membrane::TriangleMesh<double> mesh_from(const membrane::Points<double>& x) {
    return {x, membrane::Triangles{{0, 0, 0, 1}, {2, 1, 3, 2}, {1, 3, 2, 3}}};
}
#else
int main() {
#if defined(TAKE_TREE)
    take(given());
#else
    const auto mesh = mesh_from(membrane::Points<double>{{0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}});
    return mesh.positions()(2, 3) == 1 ? 0 : 1;
#endif
}
#endif
