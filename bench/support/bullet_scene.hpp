// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstdint>

#include "bullet_body.hpp"

namespace bench {

/// Bullet's body, and the tool as a kinematic rigid body: 4 position iterations a tick, contact, normals, Bullet's own
/// shape matching as the foundation.
///
///     BulletScene scene(642, 2e-3);
///     scene.frame(tool.position);                                                                       // each tick
class BulletScene {
  public:
    /// With a sphere tool of this radius [m].
    BulletScene(std::int64_t vertices, double tool_radius)
        : body_(vertices), ball_(static_cast<btScalar>(tool_radius / bullet_unit)) {
        body_->m_cfg.piterations = 4;
        body_->m_cfg.kMT = btScalar(0.1);
        body_->m_cfg.kDP = btScalar(0.05);
        body_->m_cfg.kKHR = 1;
        body_->setTotalMass(1);
        body_->setPose(false, true);
        tool_.setCollisionFlags(tool_.getCollisionFlags() | btCollisionObject::CF_KINEMATIC_OBJECT);
        for (int i = 0; i < body_->m_nodes.size(); ++i) rest_.push_back(body_->m_nodes[i].m_x);
    }

    /// One tick with the tool's centre at `tool_position` [m].
    void frame(const Vector3& tool_position) {
        const btTransform transform(btQuaternion::getIdentity(), bullet_point(tool_position));
        tool_.setWorldTransform(transform);
        tool_.setInterpolationWorldTransform(transform);
        body_->predictMotion(btScalar(tick));
        const btCollisionObjectWrapper tool(nullptr, &ball_, &tool_, transform, -1, -1);
        body_->defaultCollisionHandler(&tool);
        touched_ = body_->m_rcontacts.size();
        body_->solveConstraints();
        body_->integrateMotion();
    }

    /// Moves all nodes to their initial positions, with zero velocity.
    void reset() {
        for (int i = 0; i < body_->m_nodes.size(); ++i) {
            auto& node = body_->m_nodes[i];
            node.m_x = node.m_q = rest_[static_cast<std::size_t>(i)];
            node.m_v.setZero();
            node.m_f.setZero();
        }
    }

    /// Number of nodes in contact with the tool in the last tick.
    [[nodiscard]] int touched() const noexcept { return touched_; }

    /// Largest penetration of a node into the tool [m].
    [[nodiscard]] double penetration() {
        double deepest = 0;
        for (int i = 0; i < body_->m_nodes.size(); ++i) {
            const double gap =
                (body_->m_nodes[i].m_x - tool_.getWorldTransform().getOrigin()).length() - ball_.getRadius();
            deepest = std::max(deepest, -gap * bullet_unit);
        }
        return deepest;
    }

    [[nodiscard]] bool finite() const { return body_.finite(); }

  private:
    BulletBody body_;
    btSphereShape ball_;
    btRigidBody tool_{0, nullptr, &ball_};
    std::vector<btVector3> rest_;
    int touched_ = 0;
};

}  // namespace bench
