// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <new>
#include <vector>

#include <BulletCollision/CollisionShapes/btBvhTriangleMeshShape.h>
#include <BulletCollision/CollisionShapes/btTriangleIndexVertexArray.h>
#include <BulletCollision/NarrowPhaseCollision/btRaycastCallback.h>
#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Simple_cartesian.h>
#include <embree3/rtcore.h>
#include <fcl/fcl.h>

#include "scene.hpp"

/// The triangles of a mesh in our tree and in those of others, with the same queries, as far as each supports them:
///
///     Tree tree(mesh);
///     tree.closest(q);            // distance to the surface [m]
///     tree.touching(q, range);    // number of triangles within this distance [m]
///     tree.first_hit(p, q);       // fraction of the segment at the hit, 0 to 1; if none, 2
///     tree.refit(x);              // to other positions
///     tree.build();               // all anew
namespace bench {

using Mesh = membrane::TriangleMesh<double>;

template <membrane::Real Scalar>
class Ours {
  public:
    explicit Ours(const Mesh& mesh)
        : mesh_(mesh.positions().cast<Scalar>(), mesh.triangles()), x_(mesh_.positions()), tree_(mesh_) {}

    void build() { tree_ = membrane::AabbTree(mesh_); }
    [[nodiscard]] double closest(const Vector3& q) const {
        return std::sqrt(tree_.closest_point(x_, q.cast<Scalar>()).squared_distance);
    }
    [[nodiscard]] int touching(const Vector3& q, double range) const {
        int count = 0;
        tree_.overlap_sphere(x_, q.cast<Scalar>(), static_cast<Scalar>(range), [&](Index) { ++count; });
        return count;
    }
    [[nodiscard]] double first_hit(const Vector3& p, const Vector3& q) const {
        const auto hit = tree_.first_hit(x_, p.cast<Scalar>(), q.cast<Scalar>());
        return hit.triangle == membrane::no_index ? 2 : hit.fraction;
    }
    void refit(const Points& x) {
        x_ = x.cast<Scalar>();
        tree_.refit(x_);
    }

  private:
    membrane::TriangleMesh<Scalar> mesh_;
    membrane::Points<Scalar> x_;
    membrane::AabbTree<Scalar> tree_;
};

/// Embree calls back for each triangle; the callback uses our own closest point.
class Embree {
  public:
    explicit Embree(const Mesh& mesh) : corners_(mesh.triangles()) {
        rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_DYNAMIC);
        rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_LOW);
        const auto count = static_cast<std::size_t>(mesh.vertex_count());
        const auto triangles = static_cast<std::size_t>(mesh.triangle_count());
        auto* points = static_cast<float*>(
            rtcSetNewGeometryBuffer(geometry_, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), count));
        new (&x_) Eigen::Map<membrane::Points<float>>(points, 3, mesh.vertex_count());
        auto* indices = static_cast<Index*>(rtcSetNewGeometryBuffer(geometry_, RTC_BUFFER_TYPE_INDEX, 0,
                                                                    RTC_FORMAT_UINT3, 3 * sizeof(Index), triangles));
        std::copy_n(corners_.data(), corners_.size(), indices);
        copy(mesh.positions());
        rtcSetGeometryBuildQuality(geometry_, RTC_BUILD_QUALITY_REFIT);
        rtcAttachGeometry(scene_, geometry_);
        commit();
    }
    ~Embree() {
        rtcReleaseGeometry(geometry_);
        rtcReleaseScene(scene_);
    }
    Embree(const Embree&) = delete;
    Embree& operator=(const Embree&) = delete;

    /// Fast build, less good for queries than the first; later updates rebuild in place of a refit.
    void build() {
        rtcSetGeometryBuildQuality(geometry_, RTC_BUILD_QUALITY_LOW);
        commit();
    }
    [[nodiscard]] double closest(const Vector3& q) {
        return ask(q, std::numeric_limits<float>::infinity(), [](RTCPointQueryFunctionArguments* asked) {
            const float distance = static_cast<Embree*>(asked->userPtr)->distance(*asked);
            if (!(distance < asked->query->radius)) return false;
            asked->query->radius = distance;
            return true;
        });
    }
    [[nodiscard]] int touching(const Vector3& q, double range) {
        touched_ = 0;
        ask(q, static_cast<float>(range), [](RTCPointQueryFunctionArguments* asked) {
            auto* self = static_cast<Embree*>(asked->userPtr);
            if (self->distance(*asked) <= asked->query->radius) ++self->touched_;
            return false;
        });
        return touched_;
    }
    [[nodiscard]] double first_hit(const Vector3& p, const Vector3& q) const {
        RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        const Eigen::Vector3f from = p.cast<float>(), direction = (q - p).cast<float>();
        RTCRayHit asked{};
        asked.ray = {from.x(), from.y(), from.z(), 0, direction.x(), direction.y(), direction.z(), 0, 1, ~0U, 0, 0};
        asked.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(scene_, &context, &asked);
        return asked.hit.geomID == RTC_INVALID_GEOMETRY_ID ? 2 : asked.ray.tfar;
    }
    void refit(const Points& x) {
        copy(x);
        commit();
    }

  private:
    void copy(const Points& x) { x_ = x.cast<float>(); }
    void commit() {
        rtcUpdateGeometryBuffer(geometry_, RTC_BUFFER_TYPE_VERTEX, 0);
        rtcCommitGeometry(geometry_);
        rtcCommitScene(scene_);
    }
    [[nodiscard]] float distance(const RTCPointQueryFunctionArguments& asked) const {
        const Eigen::Vector3f q(asked.query->x, asked.query->y, asked.query->z);
        const auto triangle = membrane::triangle_at(x_, corners_.col(static_cast<Index>(asked.primID)));
        return std::sqrt(membrane::closest_point<float>(triangle, q).squared_distance);
    }
    float ask(const Vector3& q, float radius_of_query, RTCPointQueryFunction callback) {
        RTCPointQueryContext context;
        rtcInitPointQueryContext(&context);
        const Eigen::Vector3f at = q.cast<float>();
        RTCPointQuery query{at.x(), at.y(), at.z(), 0, radius_of_query};
        rtcPointQuery(scene_, &query, &context, callback, this);
        return query.radius;
    }

    static RTCDevice one_thread() {
        static const RTCDevice device = rtcNewDevice("threads=1");
        return device;
    }

    membrane::Triangles corners_;
    RTCScene scene_ = rtcNewScene(one_thread());
    RTCGeometry geometry_ = rtcNewGeometry(one_thread(), RTC_GEOMETRY_TYPE_TRIANGLE);
    Eigen::Map<membrane::Points<float>> x_{nullptr, 3, 0};  // Embree's
    int touched_ = 0;
};

/// CGAL has no refit. A short segment meets a sphere once, so that any hit is the first.
class Cgal {
  public:
    explicit Cgal(const Mesh& mesh) {
        for (const auto& corners : mesh.triangles().colwise()) {
            const auto at = [&](int k) { return point(membrane::point(mesh.positions(), corners[k])); };
            triangles_.emplace_back(at(0), at(1), at(2));
        }
        build();
    }

    /// Builds all but the search tree of start points for distances, which the first distance query builds.
    void build() { tree_.rebuild(triangles_.begin(), triangles_.end()); }
    [[nodiscard]] double closest(const Vector3& q) const { return std::sqrt(tree_.squared_distance(point(q))); }
    [[nodiscard]] int touching(const Vector3& q, double range) const {
        Near near{point(q), range * range};
        tree_.traversal(near.centre, near);
        return near.count;
    }
    [[nodiscard]] double first_hit(const Vector3& p, const Vector3& q) const {
        const auto hit = tree_.any_intersection(Kernel::Segment_3(point(p), point(q)));
        if (!hit) return 2;
        const auto* met = boost::get<Kernel::Point_3>(&hit->first);
        return met == nullptr ? 2 : std::sqrt(CGAL::squared_distance(point(p), *met)) / membrane::norm<double>(q - p);
    }

  private:
    using Kernel = CGAL::Simple_cartesian<double>;
    using Triangles = std::vector<Kernel::Triangle_3>;
    using Primitive = CGAL::AABB_triangle_primitive<Kernel, Triangles::const_iterator>;

    static Kernel::Point_3 point(const Vector3& p) { return {p.x(), p.y(), p.z()}; }

    /// Counts the triangles that a ball touches: CGAL's own spheres are hollow.
    struct Near {
        Kernel::Point_3 centre;
        double squared_range;
        int count = 0;

        [[nodiscard]] static bool go_further() { return true; }
        void intersection(const Kernel::Point_3&, const Primitive& primitive) {
            if (CGAL::squared_distance(centre, primitive.datum()) <= squared_range) ++count;
        }
        [[nodiscard]] bool do_intersect(const Kernel::Point_3&, const auto& node) const {
            double squared = 0;
            for (int k = 0; k < 3; ++k) {
                const double outside = std::max({node.bbox().min(k) - centre[k], centre[k] - node.bbox().max(k), 0.0});
                squared += outside * outside;
            }
            return squared <= squared_range;
        }
    };

    Triangles triangles_;
    CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Primitive>> tree_;
};

/// FCL computes the distance of two bodies, and the triangles in which they meet; a point is a ball of radius `tiny`.
/// It has no rays.
class Fcl {
  public:
    explicit Fcl(const Mesh& mesh) : points_(static_cast<std::size_t>(mesh.vertex_count())) {
        for (const auto& corners : mesh.triangles().colwise()) {
            const auto at = [&](int k) { return static_cast<std::size_t>(corners[k]); };
            triangles_.emplace_back(at(0), at(1), at(2));
        }
        copy(mesh.positions());
        build();
    }

    void build() {
        model_ = std::make_unique<Model>();
        model_->beginModel(static_cast<int>(triangles_.size()), static_cast<int>(points_.size()));
        model_->addSubModel(points_, triangles_);
        model_->endModel();
    }
    [[nodiscard]] double closest(const Vector3& q) const {
        const fcl::Sphered ball(tiny);
        fcl::DistanceResultd result;
        return fcl::distance(&ball, at(q), model_.get(), fcl::Transform3d::Identity(), fcl::DistanceRequestd(true),
                             result) +
               tiny;
    }
    [[nodiscard]] int touching(const Vector3& q, double range) const {
        const fcl::Sphered ball(range);
        fcl::CollisionResultd result;
        fcl::collide(&ball, at(q), model_.get(), fcl::Transform3d::Identity(), fcl::CollisionRequestd(max_contacts),
                     result);
        return static_cast<int>(result.numContacts());
    }
    void refit(const Points& x) {
        copy(x);
        constexpr bool bottom_up = false;  // would give boxes that do not contain their triangles
        model_->beginReplaceModel();
        model_->replaceSubModel(points_);
        model_->endReplaceModel(true, bottom_up);
    }

  private:
    using Model = fcl::BVHModel<fcl::OBBRSSd>;

    static constexpr double tiny = 1e-9;  // [m]
    static constexpr std::size_t max_contacts = 1'000'000;

    static fcl::Transform3d at(const Vector3& q) { return fcl::Transform3d(fcl::Translation3d(q)); }
    void copy(const Points& x) {
        for (Index v = 0; v < x.cols(); ++v) points_[static_cast<std::size_t>(v)] = x.col(v);
    }

    std::vector<fcl::Vector3d> points_;
    std::vector<fcl::Triangle> triangles_;
    std::unique_ptr<Model> model_;
};

/// Bullet's shape of a mesh that does not deform, for rays only; in millimetres, because its boxes of 16 bits have a
/// margin of one unit.
class Bullet {
  public:
    explicit Bullet(const Mesh& mesh)
        : corners_(mesh.triangles()),
          x_((mesh.positions() * per_metre).cast<btScalar>()),
          mesh_(static_cast<int>(corners_.cols()), corners_.data(), 3 * sizeof(Index), static_cast<int>(x_.cols()),
                x_.data(), 3 * sizeof(btScalar)),
          shape_(&mesh_, true) {}

    [[nodiscard]] double first_hit(const Vector3& p, const Vector3& q) const {
        const btVector3 from = point(p), to = point(q);
        FirstHit first(from, to);
        shape_.performRaycast(&first, from, to);
        return first.met ? first.m_hitFraction : 2;
    }

  private:
    struct FirstHit : btTriangleRaycastCallback {
        using btTriangleRaycastCallback::btTriangleRaycastCallback;
        btScalar reportHit(const btVector3&, btScalar fraction, int, int) override {
            met = true;
            return fraction;
        }
        bool met = false;
    };

    static constexpr double per_metre = 1000;
    static btVector3 point(const Vector3& p) {
        const auto number = [&](int k) { return static_cast<btScalar>(p[k] * per_metre); };
        return {number(0), number(1), number(2)};
    }

    membrane::Triangles corners_;
    membrane::Points<btScalar> x_;
    btTriangleIndexVertexArray mesh_;
    mutable btBvhTriangleMeshShape shape_;
};

}  // namespace bench
