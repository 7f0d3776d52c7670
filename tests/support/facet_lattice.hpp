// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>
#include <vector>

#include <Eigen/SparseCholesky>

#include <membrane/surface/triangle.hpp>

/// What `facet_depth` tabulates, computed: a linear membrane of tension 1 on a hexagon of the triangular lattice with
/// edges of length 1, under the paraboloid |x - place|^2 / 2 (a ball of radius 1, as small slopes see it).
namespace test {

class FacetLattice {
  public:
    using Corners = Eigen::Vector3i;
    using Point = membrane::Vector3<double>;  // of the plane z = 0

    /// The contact radius over an edge length, and the depth that triangles lack, over its square.
    struct Press {
        double ratio, missing;
    };

    FacetLattice() {
        number_vertices();
        list_triangles();
        assemble();
    }

    /// Pressed until the contact has this radius, at the barycentric coordinates of the triangle in the middle.
    [[nodiscard]] Press press(double ratio, const Point& weights) const {
        const Place place = place_at(weights);
        Press found{ratio, 0};
        for (int i = 0; i < 4; ++i) {  // `missing` changes slowly with the depth
            const double depth = ratio * ratio * (smooth_depth(ratio) - found.missing);
            found = pressed(place, depth);
        }
        return found;
    }

  private:
    static constexpr int rings = 24, near_rings = 6;  // of the lattice, and of those that a contact may reach

    struct Place {
        Point at;
        Eigen::VectorXd far;  // displacement of the near vertices by the rim's, per force
    };

    /// A point that may be in contact: by a force of 1 there `moved` is the displacement of all near vertices.
    struct ContactPoint {
        Corners corners;
        Point weights, at;
        Eigen::VectorXd moved;
        double force = 0;

        [[nodiscard]] double displacement(const Eigen::VectorXd& of) const {
            return weights[0] * of[corners[0]] + weights[1] * of[corners[1]] + weights[2] * of[corners[2]];
        }
    };

    /// Of the continuous membrane, over the square of the contact radius.
    [[nodiscard]] static double smooth_depth(double ratio) { return 0.5 + std::log(rings / ratio); }

    template <class T>
    static const T& at(const std::vector<T>& list, int i) {
        return list[static_cast<std::size_t>(i)];
    }

    static int ring(int i, int j) { return std::max({std::abs(i), std::abs(j), std::abs(i + j)}); }

    void number_vertices() {
        for (int i = -rings; i <= rings; ++i) {
            for (int j = -rings; j <= rings; ++j) {
                if (ring(i, j) > rings) continue;
                number_[{i, j}] = static_cast<int>(vertices_.size());
                vertices_.emplace_back(i + 0.5 * j, j * std::sqrt(3.0) / 2, 0.0);
                rings_.push_back(ring(i, j));
            }
        }
    }

    void list_triangles() {
        for (const auto& found : number_) {
            const auto [i, j] = found.first;
            const int first = found.second;
            const auto add = [&](std::pair<int, int> b, std::pair<int, int> c) {
                const auto second = number_.find(b), third = number_.find(c);
                if (second == number_.end() || third == number_.end()) return;
                triangles_.emplace_back(first, second->second, third->second);
            };
            add({i + 1, j}, {i, j + 1});
            add({i + 1, j - 1}, {i + 1, j});
        }
    }

    /// Linear finite elements: half a cotangent for each side of a triangle. The inner vertices first.
    void assemble() {
        const int count = static_cast<int>(vertices_.size());
        Eigen::VectorXi row = Eigen::VectorXi::Constant(count, -1);
        int inner = 0;
        for (int v = 0; v < count; ++v) {
            if (at(rings_, v) < rings) row[v] = inner++;
        }
        std::vector<Eigen::Triplet<double>> among, from_rim;
        const double half_cotangent = 0.5 / std::sqrt(3.0);
        for (const auto& triangle : triangles_) {
            for (int k = 0; k < 6; ++k) {  // each side in both directions
                const int a = triangle[k % 3], b = triangle[(k + 1 + k / 3) % 3];
                if (row[a] < 0) continue;
                among.emplace_back(row[a], row[a], half_cotangent);
                if (row[b] >= 0)
                    among.emplace_back(row[a], row[b], -half_cotangent);
                else
                    from_rim.emplace_back(row[a], b, half_cotangent);
            }
        }
        Eigen::SparseMatrix<double> stiffness(inner, inner);
        stiffness.setFromTriplets(among.begin(), among.end());
        from_rim_.resize(inner, count);
        from_rim_.setFromTriplets(from_rim.begin(), from_rim.end());
        factors_.compute(stiffness);
        list_near(row);
    }

    /// The vertices that a contact may reach, by their rows among the inner ones, and how forces there move them.
    void list_near(const Eigen::VectorXi& row) {
        const int count = static_cast<int>(vertices_.size());
        Eigen::VectorXi near = Eigen::VectorXi::Constant(count, -1);
        for (int v = 0; v < count; ++v) {
            if (at(rings_, v) > near_rings) continue;
            near[v] = static_cast<int>(near_rows_.size());
            near_rows_.push_back(row[v]);
            near_vertices_.push_back(at(vertices_, v));
        }
        Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(factors_.rows(), static_cast<Eigen::Index>(near_rows_.size()));
        for (std::size_t k = 0; k < near_rows_.size(); ++k) unit(near_rows_[k], static_cast<Eigen::Index>(k)) = 1;
        compliance_ = factors_.solve(unit)(near_rows_, Eigen::all);
        for (const auto& t : triangles_) {
            if (near[t[0]] < 0 || near[t[1]] < 0 || near[t[2]] < 0) continue;
            near_triangles_.emplace_back(near[t[0]], near[t[1]], near[t[2]]);
        }
    }

    /// The rim has the displacement of the continuous membrane under a force of 1 at that place.
    [[nodiscard]] Place place_at(const Point& weights) const {
        const auto corner = [&](int i, int j) { return at(vertices_, number_.at({i, j})); };
        const Point at_place = weights[0] * corner(0, 0) + weights[1] * corner(1, 0) + weights[2] * corner(0, 1);
        const int count = static_cast<int>(vertices_.size());
        Eigen::VectorXd rim = Eigen::VectorXd::Zero(count);
        for (int v = 0; v < count; ++v) {
            if (at(rings_, v) < rings) continue;
            rim[v] = std::log(rings / membrane::norm<double>(at(vertices_, v) - at_place)) / (2 * std::numbers::pi);
        }
        return {at_place, factors_.solve(from_rim_ * rim)(near_rows_)};
    }

    /// How far a point of the displaced membrane is inside the paraboloid.
    [[nodiscard]] static double overlap(const ContactPoint& contact, const Place& place, double depth,
                                        const Eigen::VectorXd& w) {
        return depth - membrane::squared_norm<double>(contact.at - place.at) / 2 - contact.displacement(w);
    }

    /// The deepest point of a triangle: on it the overlap is a paraboloid around `place` less the slope of `w`.
    [[nodiscard]] ContactPoint deepest(const Corners& corners, const Place& place, const Eigen::VectorXd& w) const {
        const Point a = at(near_vertices_, corners[0]), b = at(near_vertices_, corners[1]),
                    c = at(near_vertices_, corners[2]);
        const Point along = w[corners[0]] * (c - b) + w[corners[1]] * (a - c) + w[corners[2]] * (b - a);
        const Point slope = cross<double>({0, 0, 1}, along) / (std::sqrt(3.0) / 2);
        const auto nearest = membrane::closest_point(membrane::Triangle<double>{a, b, c}, Point(place.at - slope));
        return {corners, nearest.barycentric, nearest.point, {}};
    }

    /// Equilibrium at a depth: points are added where the membrane is inside, until it is nowhere.
    [[nodiscard]] Press pressed(const Place& place, double depth) const {
        std::vector<ContactPoint> contacts;
        Eigen::VectorXd w = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(near_vertices_.size()));
        for (int round = 0; round < 50; ++round) {
            const std::size_t before = contacts.size();
            for (const auto& corners : near_triangles_) {
                ContactPoint contact = deepest(corners, place, w);
                if (overlap(contact, place, depth, w) < accuracy * depth) continue;
                const auto is_there = [&](const ContactPoint& t) {
                    return membrane::norm<double>(t.at - contact.at) < same_place;
                };
                if (std::any_of(contacts.begin(), contacts.end(), is_there)) continue;
                contact.moved = place.far;
                for (int k = 0; k < 3; ++k) contact.moved += contact.weights[k] * compliance_.col(corners[k]);
                contacts.push_back(std::move(contact));
            }
            if (contacts.size() == before) break;
            find_forces(contacts, place, depth, w);
        }
        double force = 0;
        for (const auto& contact : contacts) force += contact.force;
        const double square = force / (2 * std::numbers::pi);
        return {std::sqrt(square), smooth_depth(std::sqrt(square)) - depth / square};
    }

    /// Forces that push, only where the membrane is in contact: projected Gauss-Seidel.
    static void find_forces(std::vector<ContactPoint>& contacts, const Place& place, double depth, Eigen::VectorXd& w) {
        for (int sweep = 0; sweep < 5000; ++sweep) {
            double largest = 0;
            for (auto& contact : contacts) {
                const double inside = overlap(contact, place, depth, w);
                const double change = std::max(inside / contact.displacement(contact.moved), -contact.force);
                if (change == 0) continue;
                contact.force += change;
                w += change * contact.moved;
                largest = std::max(largest, contact.force > 0 ? std::abs(inside) : inside);
            }
            if (largest < accuracy / 4 * depth) return;
        }
    }

    static constexpr double accuracy = 1e-5;    // of the depth
    static constexpr double same_place = 5e-4;  // two points are one

    std::map<std::pair<int, int>, int> number_;
    std::vector<Point> vertices_, near_vertices_;
    std::vector<int> rings_, near_rows_;
    std::vector<Corners> triangles_, near_triangles_;  // the second by numbers of near vertices
    Eigen::SparseMatrix<double> from_rim_;
    Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factors_;
    Eigen::MatrixXd compliance_;
};

}  // namespace test
