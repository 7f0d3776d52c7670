// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <numbers>
#include <utility>

#include <membrane/tissue/triangular_springs.hpp>

#include "hand.hpp"
#include "session.hpp"
#include "support/capsulorhexis.hpp"
#include "support/opening.hpp"
#include "support/peeling.hpp"
#include "support/surface_state.hpp"

/// The operations of the page: those of the examples, by the hand there or by the user's.
namespace web {

using Points = membrane::Points<double>;

static_assert(dt == examples::capsule_loop.tick && dt == examples::LoopOptions().tick);

/// How far it is.
struct Progress {
    double length = 0, area = 0;  ///< torn [m]; peeled [m^2]
    double circularity = 0;       ///< of the opening; 0: it is not closed
    bool finished = false;        ///< the tear has met its beginning, or the border
};

/// Forceps at a position, and the force on them.
struct ForcepsState {
    Vector3 position = Vector3::Zero(), force = Vector3::Zero();  ///< [m], [N]
    bool closed = false;
};

class Operation {
  public:
    /// `edge`: mean length of the membrane's edges [m]. The user's forceps slip off at `max_force` [N].
    Operation(double edge, double max_speed, double max_force)
        : edge_(edge), max_force_(max_force), hand_(edge / 2, max_speed) {}
    virtual ~Operation() = default;

    /// From now on the forceps follow the hand of the example.
    void demonstrate() { demonstrated_ = true; }

    /// Puts the user's hand at another position, without a path from the last one.
    void place(const Vector3& position) {
        hand_.place(position);
        triangle_ = membrane::no_index;
    }

    /// The user's hand moves toward `target`, and closes its forceps at the membrane: this ends the demonstration.
    /// Forceps that have slipped off take hold again after they were open.
    void aim(const Vector3& target, bool close) {
        target_ = target;
        close_ = close;
        if (close) demonstrated_ = false;
    }

    void step() {
        if (demonstrated_) {
            forceps_ = follow_example();
            return;
        }
        hand_.follow(target_, close_, dt);
        slipped_ = close_ && (slipped_ || membrane::norm(forceps_.force) > max_force_);
        if (!close_ || slipped_ || finished())
            triangle_ = membrane::no_index;
        else if (triangle_ == membrane::no_index)
            grasp();
        const Vector3& at = hand_.tool().position;
        forceps_ = {at, advance(attachment(triangle_, at)), triangle_ != membrane::no_index};
    }

    [[nodiscard]] const ForcepsState& forceps() const { return forceps_; }
    [[nodiscard]] double radius() const { return hand_.tool().radius; }

    /// At rest, as it is drawn, and its triangles by now.
    [[nodiscard]] virtual const Points& rest() const = 0;
    [[nodiscard]] virtual Points positions() const = 0;
    [[nodiscard]] virtual const membrane::Triangles& triangles() const = 0;
    [[nodiscard]] virtual Eigen::VectorXd tension() const = 0;  ///< at each vertex [N/m]
    [[nodiscard]] virtual Progress progress() const = 0;
    [[nodiscard]] virtual bool finished() const { return false; }  ///< the forceps take no hold any more
    [[nodiscard]] virtual Mesh body() const = 0;                   ///< under it

  protected:
    /// A tick with the example's hand.
    [[nodiscard]] virtual ForcepsState follow_example() = 0;
    /// A tick with what the user holds; returns the force on the hand [N].
    [[nodiscard]] virtual Vector3 advance(const membrane::PointAttachment<double>& held) = 0;

  private:
    static Vector3 middle_of(const membrane::Triangles& triangles, const Points& x, Index f) {
        return (x.col(triangles(0, f)) + x.col(triangles(1, f)) + x.col(triangles(2, f))) / 3;
    }

    /// Closes the forceps if a triangle is within an edge's length.
    void grasp() {
        const Vector3 at = hand_.tool().position;
        const auto& now = triangles();
        const Points x = positions();
        double nearest = edge_;
        for (Index f = 0; f < static_cast<Index>(now.cols()); ++f) {
            const double distance = membrane::norm<double>(middle_of(now, x, f) - at);
            if (distance < nearest) nearest = distance, triangle_ = f;
        }
        if (triangle_ != membrane::no_index) hand_.place(middle_of(now, x, triangle_));
    }

    [[nodiscard]] membrane::PointAttachment<double> attachment(Index f, const Vector3& at) const {
        if (f == membrane::no_index) return {};
        const auto& now = triangles();
        return {f, {now(0, f), now(1, f), now(2, f)}, {1.0 / 3, 1.0 / 3, 1.0 / 3}, at};
    }

    double edge_, max_force_;
    Hand hand_;
    Vector3 target_ = Vector3::Zero();
    bool close_ = false, slipped_ = false, demonstrated_ = false;
    Index triangle_ = membrane::no_index;  // that the user holds
    ForcepsState forceps_;
};

/// As examples/capsulorhexis.cpp.
class RhexisOperation : public Operation {
  public:
    explicit RhexisOperation(const examples::RhexisScene& scene = shared_scene())
        : Operation(scene.edge, 10e-3, 60e-3),
          scene_(scene),
          loop_(scene),
          example_hand_(scene, examples::capsule_lift * std::numbers::pi / 180),
          triangles_(loop_.tear().surface().triangles()) {}

    [[nodiscard]] const Points& rest() const override { return loop_.tear().surface().rest_positions(); }

    /// The flap passes through the membrane and lies on it: it is drawn a little above, to hide that.
    [[nodiscard]] Points positions() const override {
        Points x = loop_.x();
        const double far = scene_.radius / 6;
        for (Eigen::Index v = 0; v < x.cols(); ++v) {
            const double part = std::min(1.0, (x.col(v) - rest().col(v)).norm() / far);
            x.col(v) += part * far / 2 * scene_.axis.eigen();
        }
        return x;
    }
    [[nodiscard]] const membrane::Triangles& triangles() const override { return triangles_; }
    [[nodiscard]] Eigen::VectorXd tension() const override {
        return examples::vertex_tensions(loop_.sheet(), loop_.x());
    }
    [[nodiscard]] Progress progress() const override {
        return {.length = loop_.tear().torn_length(), .circularity = circularity_, .finished = finished_};
    }
    [[nodiscard]] bool finished() const override { return finished_; }
    [[nodiscard]] Mesh body() const override { return scene_.ball_under_opening(); }

  protected:
    [[nodiscard]] ForcepsState follow_example() override {
        if (finished_) return {example_hand_.position(), advance(membrane::PointAttachment<double>())};
        example_hand_.guide(loop_.tear(), loop_.x(), dt, norm(forceps().force));
        const Vector3 force = advance(example_hand_.hold(loop_.tear()));
        example_hand_.slip(loop_.tear(), loop_.x());
        return {example_hand_.position(), force, example_hand_.closed() && !finished_};
    }

    [[nodiscard]] Vector3 advance(const membrane::PointAttachment<double>& held) override {
        if (finished_) {
            loop_.run_to_equilibrium(1);
            return Vector3::Zero();
        }
        const Vector3 force = loop_.step(held).reactions[0];
        triangles_ = loop_.tear().surface().triangles();
        if (examples::is_round(loop_.tear())) take_out_flap();
        return force;
    }

  private:
    static const examples::RhexisScene& shared_scene() {
        static const examples::RhexisScene scene = examples::lens_front();
        return scene;
    }

    void take_out_flap() {
        const auto opening = examples::opening_of(scene_, loop_.tear().surface());
        finished_ = true;
        circularity_ = opening.circularity;
        if (circularity_ == 0) return;
        Eigen::Index left = 0;
        for (Eigen::Index f = 0; f < triangles_.cols(); ++f)
            if (!opening.inside[static_cast<std::size_t>(f)]) triangles_.col(left++) = triangles_.col(f).eval();
        triangles_.conservativeResize(3, left);
    }

    const examples::RhexisScene& scene_;
    examples::Capsulorhexis loop_;
    examples::Forceps example_hand_;
    membrane::Triangles triangles_;  // of what is drawn
    double circularity_ = 0;
    bool finished_ = false;
};

/// As the circle of examples/peel.cpp.
class PeelOperation : public Operation {
  public:
    explicit PeelOperation(const examples::PeelScene& scene = examples::circle_scene())
        : Operation(examples::mean_edge(scene.mesh), 3e-3, 1e-3),
          scene_(scene),
          loop_(scene),
          device_(scene.script(), {.tick = dt, .radius = examples::mean_edge(scene.mesh)}),
          sheet_(membrane::triangular_springs(scene.mesh, examples::ilm, 1.0)) {}

    [[nodiscard]] const Points& rest() const override { return scene_.mesh.positions(); }
    [[nodiscard]] Points positions() const override { return loop_.x(); }
    [[nodiscard]] const membrane::Triangles& triangles() const override { return scene_.mesh.triangles(); }
    [[nodiscard]] Eigen::VectorXd tension() const override { return examples::vertex_tensions(sheet_, loop_.x()); }
    [[nodiscard]] Progress progress() const override { return {.area = loop_.area()}; }

    /// The surface at rest, an edge's quarter deeper.
    [[nodiscard]] Mesh body() const override {
        Points points = rest();
        points.colwise() -= examples::mean_edge(scene_.mesh) / 4 * scene_.up;
        return {points, scene_.mesh.triangles()};
    }

  protected:
    [[nodiscard]] ForcepsState follow_example() override {
        const auto tool = device_.read();
        const auto held = membrane::pull(tool, loop_.grasp(tool));
        const Vector3 force = loop_.step(held).total_reaction();
        return {tool.position, force, tool.grasping};
    }

    [[nodiscard]] Vector3 advance(const membrane::PointAttachment<double>& held) override {
        return loop_.step(held).total_reaction();
    }

  private:
    examples::PeelScene scene_;
    examples::Peeling loop_;
    membrane::ScriptedDevice<double> device_;
    decltype(membrane::triangular_springs(std::declval<const Mesh&>(), examples::ilm, 1.0)) sheet_;
};

}  // namespace web
