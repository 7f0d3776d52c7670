// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <membrane/membrane.hpp>
#include <membrane/model/moving_foundation.hpp>

#include "../support/bits.hpp"
#include "bytes.hpp"

// Bytes that drive a whole scene: two tools that press and grasp, loads, pins and targets on a body that moves, under
// any options, budgets and deadlines, with wild numbers now and then. Each step is refused by name, with the positions
// as they were, or advances to finite positions and reactions; one whose input was always tame advances, and so does
// one without tools, whatever they did.

using namespace membrane;
using test::Bytes;
using test::require;

namespace {

template <Real S>
SolverOptions<S> any_options(Bytes& bytes) {
    const test::Switches switches(bytes.next<std::uint8_t>());
    SolverOptions<S> options{.layers = bytes.index(8), .adaptive_layers = switches.on(0)};
    if (options.layers == 7) options.layers = unlimited;
    options.sweeps = 1 + bytes.index(4);
    options.contact_iterations = 1 + bytes.index(4);
    options.order = static_cast<UpdateOrder>(bytes.index(3));
    options.predict = !switches.on(1);
    if (switches.on(2)) options.max_vertex_updates = 1 + bytes.index(100);
    if (switches.on(3)) options.force_tolerance = bytes.number<S>(0, 1e-3);
    if (switches.on(4)) options.rigid_stiffness = bytes.number<S>(0, 1e3);
    if (switches.on(5)) options.max_contact_points = bytes.index(64);
    if (switches.on(6)) options.max_packed_vertices = bytes.index(64);
    return options;
}

template <Real S>
class Scene {
  public:
    Scene(const TriangleMesh<S>& surface, Bytes& bytes)
        : mesh_(surface),
          network_(mesh_, {}, {.stiffness = S(40), .pinned = {bytes.index(7)}}),
          foundation_(mesh_, {.stiffness = S(8), .damping = bytes.number<S>(0, 0.02)}),
          options_(any_options<S>(bytes)),
          solver_(network_, options_) {}

    void tick(Bytes& bytes) {
        const test::Switches now(bytes.next<std::uint8_t>()), seldom(bytes.next<std::uint8_t>());
        const bool is_wild = seldom.on(0) && seldom.on(1) && seldom.on(2);
        auto& moved = tools_[now.on(0) ? 1 : 0];
        moved.position = moved.position + bytes.vector<S>(-0.2, 0.2);
        moved.radius = bytes.number<S>(0, 0.3);
        if (now.on(1)) moved.grasping = !moved.grasping;
        if (now.on(2)) moved.axis = bytes.vector<S>();
        if (now.on(3)) move_body(bytes, is_wild);
        if (seldom.on(3) && seldom.on(4)) reset();
        step(bytes, now, is_wild);
    }

    void release() {
        if (is_body_wild_) return;
        require(solver_.step(x_, S(1e-3), network_, on(body_, foundation_)).status == StepStatus::advanced);
        require(is_finite(x_));
    }

  private:
    void move_body(Bytes& bytes, bool is_wild) {
        const S angle = bytes.number<S>(-0.3, 0.3), s = std::sin(angle), c = std::cos(angle);
        RigidFrame<S> pose;
        pose.rotation << c, -s, 0, s, c, 0, 0, 0, 1;
        pose.origin = bytes.vector<S>(-0.1, 0.1);
        Points<S> anchors = mesh_.positions();
        anchors.row(bytes.index(3)) *= bytes.number<S>(0.9, 1.1);
        if (is_wild) (bytes.index(2) == 0 ? pose.origin[bytes.index(3)] : anchors(bytes.index(3), 0)) = bytes.wild<S>();
        is_body_wild_ = is_body_wild_ || is_wild;
        const Points<S> before = x_;
        const bool moves = bytes.index(2) == 0 ? body_.move_to(pose, x_) : body_.move_to(anchors, S(1e-3), x_);
        // From a wild place there may be no finite velocity back.
        if (!moves) require(test::same_bits(x_, before) && (is_wild || !is_tame_));
        require(is_finite(x_));
        is_tame_ = is_tame_ && !is_wild;
        tree_.refit(x_);
    }

    void reset() {
        x_ = body_.anchors();
        solver_.reset();
        for (auto& tracker : trackers_) tracker.reset();
        for (auto& grasper : graspers_) grasper.reset();
        tree_.refit(x_);
    }

    void step(Bytes& bytes, const test::Switches& now, bool is_wild) {
        std::array<Tool<S>, 2> tools = tools_;
        S dt = bytes.number<S>(1e-4, 2e-2);
        Vector3<S> target = S(1.1) * point(mesh_.positions(), 9), force = bytes.vector<S>(-0.1, 0.1);
        bool is_number = true;
        if (is_wild) {
            const std::array<S*, 8> inputs{&dt,
                                           &tools[0].position[0],
                                           &tools[0].radius,
                                           &tools[0].axis[1],
                                           &tools[1].velocity[2],
                                           &tools[1].time,
                                           &target[1],
                                           &force[0]};
            S& input = *inputs[static_cast<std::size_t>(bytes.index(8))];
            input = bytes.wild<S>();
            is_number = is_finite(input);
        }
        const std::array<Contact<S>, 2> contacts{trackers_[0].update(tree_, x_, tools[0], body_),
                                                 trackers_[1].update(tree_, x_, tools[1], body_)};
        const std::array<Grasp<S>, 2> grasps{graspers_[0].update(contacts[0], x_, tools[0], body_),
                                             graspers_[1].update(contacts[1], x_, tools[1], body_)};
        const std::array<Index, 3> corners{0, mesh_.triangles()(1, 0), mesh_.triangles()(2, 0)};
        const Vector3<S> middle(S(0.5), S(0.25), S(0.25));
        const std::array<Index, 2> pins{20, bytes.index(30)};
        const auto act = [&](auto take) {
            return take(press(tools[0], contacts[0], grasps[0]), pull(tools[0], grasps[0]),
                        press(tools[1], contacts[1], grasps[1]), pull(tools[1], grasps[1]), pull(9, target),
                        load(corners, middle, force), pin(std::span(pins).first(now.on(4) ? 2 : 0)));
        };
        const Points<S> before = x_;
        int reads = 0;
        const Deadline deadline([&reads] { return ++reads; }, bytes.index(20));
        const auto report = act([&](const auto&... constraints) {
            const auto support = on(body_, foundation_);
            return now.on(5) ? solver_.step_until(deadline, x_, dt, network_, support, constraints...)
                             : solver_.step(x_, dt, network_, support, constraints...);
        });
        tree_.refit(x_, report.moved);
        normals_.update(x_, report.moved);
        check(report, before, is_wild, is_number);
    }

    void check(const StepReport<S>& report, const Points<S>& before, bool is_wild, bool is_number) {
        require(is_finite(x_) && is_finite(normals_.values()) && is_finite(report.residual));
        require(report.reactions.size() == 7);
        for (const auto& reaction : report.reactions) require(is_finite(reaction));
        if (report.status != StepStatus::advanced) {
            require(test::same_bits(x_, before) && report.moved.empty());
        } else {
            is_tame_ = is_tame_ && !is_wild;
            for (Index v = 0; v < mesh_.vertex_count(); ++v) {  // what is not named has not moved
                const bool named = std::count(report.moved.begin(), report.moved.end(), v) > 0;
                require(named || test::same_bits(point(x_, v), point(before, v)));
            }
        }
        if (!is_number) require(report.status != StepStatus::advanced);
        const bool is_full = report.status == StepStatus::too_many_contact_points && options_.max_contact_points < 64;
        // From a wild place a tool sweeps whatever is between.
        if (is_tame_ && !is_wild && !was_wild_) require(report.status == StepStatus::advanced || is_full);
        was_wild_ = is_wild;
    }

    TriangleMesh<S> mesh_;
    MassSpringNetwork<S, LinearSpring> network_;
    VirtualVolumeSprings<S> foundation_;
    SolverOptions<S> options_;
    QuasiStaticSolver<S> solver_;
    AabbTree<S> tree_{mesh_};
    std::array<ContactTracker<S>, 2> trackers_{ContactTracker<S>(mesh_), ContactTracker<S>(mesh_)};
    std::array<Grasper<S>, 2> graspers_{Grasper<S>(mesh_), Grasper<S>(mesh_)};
    VertexNormals<S> normals_{mesh_};
    MovingBody<S> body_{mesh_};
    std::array<Tool<S>, 2> tools_{Tool<S>{.position = {0, 0, S(1.1)}}, Tool<S>{.position = {0, S(1.1), 0}}};
    Points<S> x_ = mesh_.positions();
    bool is_tame_ = true, was_wild_ = false, is_body_wild_ = false;
};

template <Real S>
void examine(Bytes bytes) {
    static const std::array meshes{icosphere<S>({.radius = 1, .subdivisions = 1}), disc<S>({.radius = 1, .rings = 4})};
    Scene<S> scene(meshes[static_cast<std::size_t>(bytes.index(2))], bytes);
    while (bytes.left() > 0) scene.tick(bytes);
    scene.release();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Bytes bytes(data, size);
    if (bytes.index(2) == 0) {
        examine<float>(bytes);
    } else {
        examine<double>(bytes);
    }
    return 0;
}
