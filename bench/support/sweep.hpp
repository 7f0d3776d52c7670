// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <span>
#include <vector>

#include <Eigen/LU>

#include <membrane/solve/packed_vertices.hpp>
#include <membrane/solve/propagation_queue.hpp>

#include "scene.hpp"

/// A sweep over all vertices of a mesh: in packs, and as a plain loop.
namespace bench {

using membrane::Lanes;
using membrane::Real;

/// A sphere with random displacements from its rest shape.
template <Real Scalar>
struct Field {
    explicit Field(std::int64_t vertices)
        : mesh(sphere_of<Scalar>(vertices)),
          network(mesh, {}, {.stiffness = Scalar(stiffness), .mass = Scalar(4e-4)}),
          volume(mesh, {.stiffness = Scalar(foundation)}),
          rows(mesh.vertex_count()) {
        std::mt19937_64 random(1);
        for (Index v = 0; v < x.cols(); ++v) {
            for (int k = 0; k < 3; ++k)
                x(k, v) += static_cast<Scalar>(0.05 * radius * (static_cast<double>(random() % 2001) / 1000 - 1));
        }
        const membrane::ConstPointsRef<Scalar> start = x;
        for (Index v = 0; v < x.cols(); ++v) rows.load(v, start, network);
    }

    membrane::TriangleMesh<Scalar> mesh;
    membrane::MassSpringNetwork<Scalar, membrane::LinearSpring> network;
    membrane::VirtualVolumeSprings<Scalar> volume;
    membrane::VertexRows<Scalar> rows;
    membrane::Points<Scalar> x = mesh.positions();
};

inline void count_updates(benchmark::State& state) {
    state.counters["vertex_updates"] = static_cast<double>(state.range(0));
}

/// (4), without SIMD.
struct PlainMass {
    template <Real Scalar, class Springs>
    static Eigen::Matrix<Scalar, 3, 1> move(const Springs& springs, const Eigen::Matrix<Scalar, 3, 1>& from_anchor) {
        Eigen::Matrix<Scalar, 3, 1> force = -Scalar(foundation) * from_anchor;
        springs([&](const auto& edge, Scalar k, Scalar rest_length) {
            const Scalar length = edge.norm();
            force += k * (length - rest_length) / length * edge;
        });
        return static_cast<Scalar>(tick * tick / 4e-4) * force;
    }
};

/// Newton's step on the 3 x 3 block, bounded as `BlockStep` is.
struct PlainNewton {
    template <Real Scalar, class Springs>
    static Eigen::Matrix<Scalar, 3, 1> move(const Springs& springs, const Eigen::Matrix<Scalar, 3, 1>& from_anchor) {
        using Matrix3 = Eigen::Matrix<Scalar, 3, 3>;
        Eigen::Matrix<Scalar, 3, 1> force = -Scalar(foundation) * from_anchor;
        Matrix3 dyads = Matrix3::Zero();
        Scalar sum = Scalar(foundation), trace = 0, size = std::numeric_limits<Scalar>::max();
        springs([&](const auto& edge, Scalar k, Scalar rest_length) {
            const Scalar length = edge.norm();
            const Eigen::Matrix<Scalar, 3, 1> direction = edge / length;
            force += k * (length - rest_length) * direction;
            const Scalar part = k * std::min(rest_length / length, Scalar(1));
            dyads.noalias() += (part * direction).lazyProduct(direction.transpose());
            trace += part;
            sum += k;
            size = std::min(size, length);
        });
        const Scalar ratio = force.norm() / (sum * size), slack = 1 - trace / sum - ratio;
        const Scalar rho = (std::sqrt(slack * slack + 4 * ratio) - slack) / 2;
        // The stiffness reduction is trace I - dyads.
        const Matrix3 block = (sum - trace / (1 + rho)) * Matrix3::Identity() + dyads / (1 + rho);
        return block.inverse() * force;
    }
};

/// A plain loop, vertex by vertex.
template <Real Scalar, class Rule>
void plain(benchmark::State& state) {
    struct End {
        Index other;
        Scalar stiffness, rest_length;
    };
    Field<Scalar> field(state.range(0));
    std::vector<std::size_t> row{0};
    std::vector<End> ends;
    for (Index v = 0; v < field.x.cols(); ++v) {
        for (const auto& end : field.network.springs_of(v)) ends.push_back({end.other, end.stiffness, end.rest_length});
        row.push_back(ends.size());
    }
    auto& x = field.x;
    const membrane::Points<Scalar> anchor = field.mesh.positions();
    for (auto _ : state) {
        for (Index v = 0; v < x.cols(); ++v) {
            const auto at = static_cast<std::size_t>(v);
            const auto springs = [&](const auto& add) {
                for (std::size_t e = row[at]; e < row[at + 1]; ++e) {
                    const Eigen::Matrix<Scalar, 3, 1> edge = x.col(ends[e].other) - x.col(v);
                    add(edge, ends[e].stiffness, ends[e].rest_length);
                }
            };
            x.col(v) += Rule::template move<Scalar>(springs, x.col(v) - anchor.col(v));
        }
        benchmark::DoNotOptimize(x.data());
    }
    require(membrane::is_finite(x), "the plain loop must not diverge");
    count_updates(state);
}

/// In packs, as in a step beyond layer 0.
template <Real Scalar, class Rule>
void packs(benchmark::State& state) {
    Field<Scalar> field(state.range(0));
    const membrane::ConstPointsRef<Scalar> start = field.x, now = field.rows.positions();
    const membrane::StepInput<Scalar, decltype(field.network), decltype(field.volume)> scene{
        start, now, Scalar(tick), field.network, field.volume, field.rows};
    const Index seed = 0;
    membrane::PropagationQueue queue(field.mesh.vertex_count());
    queue.build(field.network, std::span(&seed, 1), membrane::unlimited);
    queue.group(field.network);
    membrane::PackedVertices<Scalar> packed(field.network);
    packed.assign(queue.vertices(), queue.colour_ends(), field.network);
    require(packed.size() == static_cast<std::size_t>(state.range(0)), "the packs must have capacity for all vertices");
    packed.begin_step(scene);
    for (auto _ : state) {
        for (std::size_t p = 0, end = 0; p < packed.count(); p = end) {
            end = packed.end_of_group(p, packed.count());
            packed.update(p, end, scene, Rule{}, membrane::Constrained::no, membrane::OneThread{});
            benchmark::DoNotOptimize(end);
        }
    }
    require(membrane::is_finite(membrane::Points<Scalar>(now)), "the sweep must not diverge");
    count_updates(state);
    state.counters["filled"] =
        static_cast<double>(packed.size()) / static_cast<double>(packed.count() * Lanes<Scalar>::count);
}

}  // namespace bench
