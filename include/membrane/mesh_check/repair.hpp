// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <membrane/core/check.hpp>
#include <membrane/core/disjoint_sets.hpp>
#include <membrane/core/exact_sign.hpp>
#include <membrane/mesh_check/checked_mesh.hpp>
#include <membrane/mesh_check/coincident_vertices.hpp>
#include <membrane/mesh_check/surface_facts.hpp>
#include <membrane/surface/mesh_checks.hpp>

/// Deterministic repairs of a mesh, each only on request.
///
///     const auto repaired = membrane::repair(x, triangles, {.weld = 1e-6, .drop_repeated = true, .orient = true});
///     std::cout << to_string(repaired.report);                      // welded 12 vertices, reversed 3 triangles
///     const membrane::TriangleMesh mesh(repaired.positions, repaired.triangles);
namespace membrane {

/// The repairs, in the order of their application; all are off by default. Those after welding are repeated until none
/// changes anything, so that a second repair changes nothing. Welding and dropping may show that triangles are oriented
/// inconsistently, where an edge of three triangles did not count: ask for `orient` as well.
struct RepairOptions {
    /// Weld distance [m]. Vertices at most this far apart become one, that of lowest index, which keeps its position.
    /// The ends of a chain of welded vertices may be farther apart. 0: only identical positions. Unset: no welding.
    std::optional<double> weld{};

    bool drop_repeated = false;    ///< Drops triangles that reference a vertex twice.
    bool drop_zero_area = false;   ///< Drops triangles of three collinear vertices; may leave a T-junction.
    bool drop_duplicates = false;  ///< Of triangles with the same vertices, in any order, keeps only the first.
    /// Reverses triangles until each component is consistently oriented. A component here is what edges of exactly two
    /// triangles join. One that is consistently oriented, see `flip_inward`, or not orientable, is left unchanged. Any
    /// other that is closed, but for holes of at most a quarter of its area, then faces outward; in any other open one
    /// as few triangles as possible are reversed. Each component is treated separately: one inside another faces
    /// outward too, even if it is meant as the wall of a cavity.
    bool orient = false;
    /// Gives each fan of triangles at a vertex, except the first, its own vertex; not where a coordinate is not finite.
    bool split_vertices = false;
    bool flip_inward = false;    ///< Reverses closed components that face inward.
    bool drop_isolated = false;  ///< Drops vertices that no triangle references; those that a repair left, always.
};

/// Number of vertices or triangles that each option has changed.
struct RepairReport {
    ///@{
    /// Of the option `weld`, `drop_repeated`, `drop_zero_area`, `drop_duplicates`, `orient`, `split_vertices`,
    /// `flip_inward`, `drop_isolated`.
    Index welded = 0, repeated = 0, zero_area = 0, duplicates = 0, reversed = 0, split = 0, flipped = 0, isolated = 0;
    ///@}
    bool complete = true;  ///< False: the search for pairs within `weld` reached its limit, some may not be welded.
};

/// A repaired mesh, and where its vertices and triangles come from.
template <Real Scalar>
struct RepairedMesh {
    Points<Scalar> positions;  ///< 3 x V [m]
    Triangles triangles;       ///< 3 x F
    ///@{
    /// Index in the input of each vertex (welded: the lowest; split off: the one it was split from) and triangle.
    std::vector<Index> vertices, source_triangles;
    ///@}
    /// Index in the result of each vertex of the input: welded, that of the vertex it became one with; split, that of
    /// its first fan; dropped, `no_index`. So `positions.col(new_vertices[v])` moves vertex v of a seam.
    std::vector<Index> new_vertices;
    RepairReport report;  ///< What was changed.
};

/// The mesh after the repairs of `options`, without other changes. Kept vertices keep their order and their positions,
/// bit for bit; those split off follow. Kept triangles keep their order and their first corner; a reversed one swaps
/// the other two. The result may still have defects, which `validate` reports. O(F log F).
/// @throws InvalidInput for shapes as `validate` does, for triangles that name a vertex that does not exist, and if
/// `weld` is negative or not finite
template <class P, class T>
[[nodiscard]] RepairedMesh<typename P::Scalar> repair(const Eigen::MatrixBase<P>& positions,
                                                      const Eigen::MatrixBase<T>& triangles,
                                                      const RepairOptions& options);

/// Repairs a mesh given as x y z x y z ... [m] and three vertices for each triangle.
template <class S, std::size_t m, std::integral I, std::size_t n>
[[nodiscard]] auto repair(std::span<S, m> xyz, std::span<I, n> corners, const RepairOptions& options) {
    return repair(detail::by_threes("repair", xyz, "positions"), detail::by_threes("repair", corners, "triangles"),
                  options);
}

/// A phrase for each option that has changed something.
[[nodiscard]] inline std::string to_string(const RepairReport& report) {
    std::string text;
    const auto say = [&](const char* what, Index count, const char* of) {
        if (count > 0) (((((text += text.empty() ? "" : ", ") += what) += " ") += std::to_string(count)) += " ") += of;
    };
    say("welded", report.welded, "vertices");
    say("dropped", report.repeated, "triangles with a repeated vertex");
    say("dropped", report.zero_area, "triangles without area");
    say("dropped", report.duplicates, "duplicate triangles");
    say("reversed", report.reversed, "triangles");
    say("split off", report.split, "vertices");
    say("flipped", report.flipped, "inward triangles");
    say("dropped", report.isolated, "isolated vertices");
    if (!report.complete) text += text.empty() ? "welding incomplete" : ", welding incomplete";
    return text.empty() ? "no changes" : text;
}

namespace detail {

/// A mesh under repair.
class Repair {
  public:
    Repair(Points<double> x, Triangles triangles)
        : x_(std::move(x)),
          triangles_(std::move(triangles)),
          kept_vertices_(static_cast<std::size_t>(x_.cols()), true),
          kept_(static_cast<std::size_t>(triangles_.cols())),
          origin_(static_cast<std::size_t>(x_.cols())) {
        std::iota(kept_.begin(), kept_.end(), Index{0});
        std::iota(origin_.begin(), origin_.end(), Index{0});
        welded_to_ = origin_;
        referenced_ = references();
    }

    inline void weld(std::span<const Index> points, double distance);
    inline void apply(const RepairOptions& options, const std::vector<bool>& usable);
    inline void drop_repeated();
    inline void drop_zero_area(const std::vector<bool>& usable);
    inline void drop_duplicates();
    inline void orient(const std::vector<bool>& usable);
    inline void split_vertices(const std::vector<bool>& usable);
    inline void flip_inward(const std::vector<bool>& usable);
    inline void drop_isolated(bool all);

    template <Real Scalar>
    [[nodiscard]] RepairedMesh<Scalar> result(const Points<Scalar>& given) const;

  private:
    [[nodiscard]] std::array<Index, 3> corners(Index f) const {
        return {triangles_(0, f), triangles_(1, f), triangles_(2, f)};
    }
    void turn(Index f) { std::swap(triangles_(1, f), triangles_(2, f)); }

    /// The half-edges of the kept triangles with three different vertices.
    [[nodiscard]] std::vector<HalfEdge> sides() const {
        std::vector<Index> some;
        for (const Index f : kept_) {
            if (!repeats(f)) some.push_back(f);
        }
        return half_edges_of(triangles_, some);
    }
    /// Of each vertex, whether a kept triangle references it.
    [[nodiscard]] std::vector<bool> references() const {
        std::vector<bool> referenced(static_cast<std::size_t>(x_.cols()), false);
        for (const Index f : kept_) {
            for (const Index v : corners(f)) referenced[static_cast<std::size_t>(v)] = true;
        }
        return referenced;
    }
    /// `usable` says it of the vertices given; a vertex that was split off is as its origin.
    [[nodiscard]] bool is_usable(const std::vector<bool>& usable, Index v) const {
        return usable[static_cast<std::size_t>(origin_[static_cast<std::size_t>(v)])];
    }
    [[nodiscard]] bool repeats(Index f) const {
        const auto [a, b, c] = corners(f);
        return a == b || b == c || c == a;
    }
    /// The components with the present orientation of the triangles; one with an unusable point is not closed.
    [[nodiscard]] inline SurfaceParts parts(const std::vector<bool>& usable) const;

    Points<double> x_;
    Triangles triangles_;
    std::vector<bool> kept_vertices_, referenced_;  // `referenced_`: of the vertices given, before any repair
    std::vector<Index> kept_;                       // triangles
    std::vector<Index> welded_to_;                  // of each vertex given: itself, or the vertex it became one with
    std::vector<Index> origin_;                     // of each vertex: itself, or the vertex it was split from
    RepairReport report_;
};

inline void Repair::weld(std::span<const Index> points, double distance) {
    const CoincidentVertices coincident(x_, points);
    DisjointSets sets(kept_vertices_.size());
    std::size_t v = 0;
    for (const Index lowest : coincident.representative()) sets.unite(v++, static_cast<std::size_t>(lowest));
    std::int64_t effort = 1'000'000 + 1000 * x_.cols();
    report_.complete = distance == 0 || coincident.for_each_pair(distance, effort, [&](Index i, Index j) {
        sets.unite(static_cast<std::size_t>(i), static_cast<std::size_t>(j));
    });
    for (v = 0; v < kept_vertices_.size(); ++v) {
        welded_to_[v] = static_cast<Index>(sets.find(v));
        kept_vertices_[v] = sets.find(v) == v;
        report_.welded += kept_vertices_[v] ? 0 : 1;
    }
    const auto one = [&](Index corner) { return static_cast<Index>(sets.find(static_cast<std::size_t>(corner))); };
    for (Index& corner : triangles_.reshaped()) corner = one(corner);
}

// What a split or a dropped triangle leaves may need an earlier repair again.
inline void Repair::apply(const RepairOptions& options, const std::vector<bool>& usable) {
    constexpr int most = 100;
    for (int turn = 0; turn < most; ++turn) {
        const auto before = std::pair(triangles_, kept_);
        if (options.drop_repeated) drop_repeated();
        if (options.drop_zero_area) drop_zero_area(usable);
        if (options.drop_duplicates) drop_duplicates();
        if (options.orient) orient(usable);
        if (options.split_vertices) split_vertices(usable);
        if (options.flip_inward) flip_inward(usable);
        if (std::pair(triangles_, kept_) == before) break;
    }
    drop_isolated(options.drop_isolated);
}

inline void Repair::drop_repeated() {
    report_.repeated += static_cast<Index>(std::erase_if(kept_, [&](Index f) { return repeats(f); }));
}

inline void Repair::drop_zero_area(const std::vector<bool>& usable) {
    const auto flat = [&](Index f) {
        for (const Index v : corners(f)) {
            if (!is_usable(usable, v)) return false;
        }
        return !repeats(f) &&
               on_one_line(point(x_, triangles_(0, f)), point(x_, triangles_(1, f)), point(x_, triangles_(2, f)));
    };
    report_.zero_area += static_cast<Index>(std::erase_if(kept_, flat));
}

inline void Repair::drop_duplicates() {
    std::vector<bool> is_duplicate(static_cast<std::size_t>(triangles_.cols()), false);
    const std::vector<HalfEdge> all = sides();
    for_each_edge(all, [&](std::span<const HalfEdge> edge) {
        for (std::size_t i = 1; i < edge.size(); ++i) {  // those with one apex in ascending order of triangles
            if (edge[i].apex == edge[i - 1].apex) is_duplicate[static_cast<std::size_t>(edge[i].triangle)] = true;
        }
    });
    report_.duplicates +=
        static_cast<Index>(std::erase_if(kept_, [&](Index f) { return is_duplicate[static_cast<std::size_t>(f)]; }));
}

inline void Repair::orient(const std::vector<bool>& usable) {
    const auto count = static_cast<std::size_t>(triangles_.cols());
    const std::vector<HalfEdge> all = sides();
    DisjointSets sets = turns(all, count);
    // For each component, at its lowest triangle: how many triangles agree with that one, and how many are opposite.
    std::vector<std::array<Index, 2>> votes(count, {0, 0});
    const auto side_of = [&](Index f) {
        const std::size_t as_is = sets.find(static_cast<std::size_t>(f));
        const std::size_t turned = sets.find(static_cast<std::size_t>(f) + count);
        return std::pair((std::min)(as_is, turned), as_is <= turned ? std::size_t{0} : std::size_t{1});
    };
    for (const Index f : kept_) {
        const auto [lowest, side] = side_of(f);
        ++votes[lowest][side];
    }
    std::vector<bool> turned(count, false);
    const auto turn_over = [&](Index f) {
        turn(f);
        turned[static_cast<std::size_t>(f)].flip();
    };
    for (const Index f : kept_) {
        const auto [lowest, side] = side_of(f);
        const std::size_t fewer = votes[lowest][1] <= votes[lowest][0] ? 1 : 0;
        if (side == fewer) turn_over(f);  // never on a one-sided surface
    }
    const SurfaceParts now = parts(usable);
    std::vector<bool> agreed(now.parts.size(), true);  // whether the input triangles of a component agree
    for (const Index f : kept_) {
        const Index p = now.part_of[static_cast<std::size_t>(f)];
        if (p != no_index && turned[static_cast<std::size_t>(f)]) agreed[static_cast<std::size_t>(p)] = false;
    }
    for (const Index f : kept_) {
        const Index p = now.part_of[static_cast<std::size_t>(f)];
        if (p == no_index || agreed[static_cast<std::size_t>(p)]) continue;
        const SurfaceComponent& part = now.parts[static_cast<std::size_t>(p)];
        if (part.encloses && part.volume < 0) turn_over(f);
    }
    report_.reversed += static_cast<Index>(std::count(turned.begin(), turned.end(), true));
}

inline void Repair::split_vertices(const std::vector<bool>& usable) {
    const std::vector<HalfEdge> all = sides();
    DisjointSets sets = fans(triangles_, all);
    constexpr auto none = static_cast<std::size_t>(-1);
    std::vector<std::size_t> first_fan(kept_vertices_.size(), none);
    std::vector<Index> vertex_of_fan(static_cast<std::size_t>(triangles_.size()), no_index);
    std::vector<Index> origins;
    for (const Index f : kept_) {
        if (repeats(f)) continue;
        for (Index k = 0; k < 3; ++k) {
            Index& corner = triangles_(k, f);
            const auto v = static_cast<std::size_t>(corner);
            if (!is_usable(usable, corner)) continue;
            const std::size_t fan = sets.find(3 * static_cast<std::size_t>(f) + static_cast<std::size_t>(k));
            if (first_fan[v] == none) first_fan[v] = fan;
            if (first_fan[v] == fan) continue;
            Index& own = vertex_of_fan[fan];
            if (own == no_index) {
                own = static_cast<Index>(origin_.size());
                origin_.push_back(origin_[v]);
                ++report_.split;
            }
            corner = own;
        }
    }
    const Eigen::Index before = x_.cols();
    x_.conservativeResize(3, static_cast<Eigen::Index>(origin_.size()));
    for (Eigen::Index v = before; v < x_.cols(); ++v) x_.col(v) = x_.col(origin_[static_cast<std::size_t>(v)]);
    kept_vertices_.resize(origin_.size(), true);
}

inline SurfaceParts Repair::parts(const std::vector<bool>& usable) const {
    std::vector<bool> finite(static_cast<std::size_t>(triangles_.cols()), true);
    for (const Index f : kept_) {
        for (const Index v : corners(f)) {
            if (!is_usable(usable, v)) finite[static_cast<std::size_t>(f)] = false;
        }
    }
    return surface_parts(x_, triangles_, sides(), finite);
}

inline void Repair::flip_inward(const std::vector<bool>& usable) {
    const SurfaceParts now = parts(usable);
    for (const Index f : kept_) {
        const Index p = now.part_of[static_cast<std::size_t>(f)];
        if (p == no_index) continue;
        const SurfaceComponent& part = now.parts[static_cast<std::size_t>(p)];
        if (!part.closed || part.volume >= 0) continue;
        turn(f);
        ++report_.flipped;
    }
}

// All, or those that had a triangle.
inline void Repair::drop_isolated(bool all) {
    const std::vector<bool> referenced = references();
    for (std::size_t v = 0; v < referenced.size(); ++v) {
        if (!kept_vertices_[v] || referenced[v]) continue;
        if (!all && (v >= referenced_.size() || !referenced_[v])) continue;
        kept_vertices_[v] = false;
        ++report_.isolated;
    }
}

template <Real Scalar>
RepairedMesh<Scalar> Repair::result(const Points<Scalar>& given) const {
    RepairedMesh<Scalar> mesh;
    std::vector<Index> number(kept_vertices_.size(), no_index);
    for (std::size_t v = 0; v < number.size(); ++v) {
        if (!kept_vertices_[v]) continue;
        number[v] = static_cast<Index>(mesh.vertices.size());
        mesh.vertices.push_back(origin_[v]);
    }
    for (const Index v : welded_to_) mesh.new_vertices.push_back(number[static_cast<std::size_t>(v)]);
    mesh.positions.resize(3, static_cast<Eigen::Index>(mesh.vertices.size()));
    for (Eigen::Index v = 0; v < mesh.positions.cols(); ++v) {
        mesh.positions.col(v) = given.col(mesh.vertices[static_cast<std::size_t>(v)]);
    }
    mesh.triangles = selected(triangles_, kept_);
    for (Index& corner : mesh.triangles.reshaped()) corner = number[static_cast<std::size_t>(corner)];
    mesh.source_triangles = kept_;
    mesh.report = report_;
    return mesh;
}

}  // namespace detail

template <class P, class T>
RepairedMesh<typename P::Scalar> repair(const Eigen::MatrixBase<P>& positions, const Eigen::MatrixBase<T>& triangles,
                                        const RepairOptions& options) {
    using Scalar = typename P::Scalar;
    detail::check_types<P, T>();
    static_assert(Real<Scalar>, "positions must be float or double");
    if (options.weld) detail::check_option("repair", *options.weld, "weld", "m");
    const auto found = [](MeshDefect defect, const std::vector<Index>&, const std::vector<Index>&,
                          const auto&... parts) {
        if (defect == MeshDefect::index_out_of_range) refuse("repair", parts...);
    };
    detail::check_shapes("repair", positions, triangles, found);
    Triangles corners(3, triangles.cols());
    for (Eigen::Index f = 0; f < triangles.cols(); ++f) {
        detail::check_corners(triangles.derived(), f, positions.cols(), found);
        for (Eigen::Index k = 0; k < 3; ++k) corners(k, f) = static_cast<Index>(triangles(k, f));
    }
    const detail::StoredPoints<Scalar> stored(positions.derived(), found);
    detail::Repair work(stored.x.template cast<double>(), std::move(corners));
    if (options.weld) work.weld(stored.points, *options.weld);
    work.apply(options, stored.usable);
    return work.result(stored.x);
}

}  // namespace membrane
