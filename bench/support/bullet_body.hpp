// SPDX-License-Identifier: MIT
#pragma once

#include <memory>
#include <vector>

#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>
#include <BulletSoftBody/btSoftBody.h>
#include <BulletSoftBody/btSoftBodyHelpers.h>

#include "scene.hpp"

/// The scene's sphere as a soft body of Bullet: a node for each vertex, a link for each spring, a face for each
/// triangle; in millimetres, which suit Bullet's constants.
namespace bench {

inline constexpr double bullet_unit = 1e-3;  // [m]

template <class Point>
[[nodiscard]] btVector3 bullet_point(const Point& point) {
    const auto number = [&](int k) { return static_cast<btScalar>(point[k] / bullet_unit); };
    return {number(0), number(1), number(2)};
}

class BulletBody {
  public:
    explicit BulletBody(std::int64_t vertices) : mesh_(sphere(vertices)) {
        world_.m_gravity.setZero();
        world_.m_sparsesdf.Initialize();
        std::vector<btVector3> nodes;
        for (Index v = 0; v < mesh_.vertex_count(); ++v)
            nodes.push_back(bullet_point(membrane::point(mesh_.positions(), v)));
        body_ = std::make_unique<btSoftBody>(&world_, mesh_.vertex_count(), nodes.data(), nullptr);
        const membrane::MassSpringNetwork network(mesh_, membrane::LinearSpring{}, {.stiffness = stiffness});
        for (const auto& spring : network.springs()) body_->appendLink(spring.first, spring.second);
        for (const auto& corners : mesh_.triangles().colwise()) body_->appendFace(corners[0], corners[1], corners[2]);
        btSoftBodyHelpers::ReoptimizeLinkOrder(body_.get());
        body_->m_materials[0]->m_kLST = btScalar(0.5);
        body_->getCollisionShape()->setMargin(btScalar(0.02));
        body_->updateConstants();
    }

    [[nodiscard]] btSoftBody& operator*() noexcept { return *body_; }
    [[nodiscard]] btSoftBody* operator->() noexcept { return body_.get(); }

    /// Whether the position of every node is finite.
    [[nodiscard]] bool finite() const {
        for (int i = 0; i < body_->m_nodes.size(); ++i) {
            if (!std::isfinite(body_->m_nodes[i].m_x.length2())) return false;
        }
        return true;
    }

  private:
    membrane::TriangleMesh<double> mesh_;
    btSoftBodyWorldInfo world_;
    std::unique_ptr<btSoftBody> body_;
};

}  // namespace bench
