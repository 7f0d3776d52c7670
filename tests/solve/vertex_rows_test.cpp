// SPDX-License-Identifier: MIT
#include <membrane/solve/vertex_rows.hpp>

#include <array>

#include "support/catch.hpp"

using namespace membrane;

namespace {

struct OnePinned {
    Index pinned_vertex = 3;
    bool pinned(Index v) const { return v == pinned_vertex; }
};

}  // namespace

TEMPLATE_TEST_CASE("a vertex is loaded once in a step, with its pin", "[rows]", TEST_SCALARS) {
    using S = TestType;
    Points<S> x = Points<S>::Random(3, 8);
    const Points<S> before = x;
    VertexRows<S> rows(8);
    rows.begin_step();
    for (const Index v : {3, 5}) rows.load(v, x, OnePinned{});
    x.setZero();
    rows.load(5, x, OnePinned{});
    CHECK(rows.loaded.count() == 2);
    CHECK(point(rows.positions(), 5) == point(before, 5));
    CHECK(rows.is_fixed(3));
    CHECK_FALSE(rows.is_fixed(5));

    rows.begin_step();
    CHECK(rows.loaded.empty());
    rows.load(5, x, OnePinned{5});
    CHECK(point(rows.positions(), 5) == Vector3<S>::Zero());
    CHECK(rows.is_fixed(5));
}

TEST_CASE("positions are set without the number beside them, and restored but where they are prescribed", "[rows]") {
    const Points<double> x = Points<double>::Random(3, 8);
    VertexRows<double> rows(8);
    rows.begin_step();
    for (Index v = 0; v < 8; ++v) rows.load(v, x, OnePinned{});
    rows.set_response(2, {{1, 2, 3, 4, 5, 6}, 7, 8}, 0.5);
    rows.set_position(2, {1, 1, 1});
    rows.set_position(4, {2, 2, 2});
    rows.prescribed.insert(4);
    CHECK(rows.compliance(2) == 0.5);
    const auto response = rows.response_of(2);
    const auto& block = response.compliance;
    CHECK(block.xx == 1);
    CHECK(block.yy == 2);
    CHECK(block.zz == 3);
    CHECK(block.xy == 4);
    CHECK(block.xz == 5);
    CHECK(block.yz == 6);
    CHECK(response.internal_force == 7);
    CHECK(response.internal_stiffness == 8);
    rows.restore(x);
    CHECK(point(rows.positions(), 2) == point(x, 2));
    CHECK(point(rows.positions(), 4) == Vector3<double>(2, 2, 2));
    rows.clear_response(2);
    CHECK(rows.response_of(2).compliance.trace() == 0);
    CHECK(rows.compliance(2) == 0);
    CHECK(point(rows.positions(), 2) == point(x, 2));
}

TEST_CASE("responses in lanes are those of each vertex", "[rows]") {
    constexpr std::size_t lanes = Lanes<double>::count;
    VertexRows<double> rows(8);
    const auto number = [](Index v, int k) { return 10 * v + k; };
    for (Index v = 0; v < 8; ++v) {
        const auto n = [&](int k) { return static_cast<double>(number(v, k)); };
        rows.set_response(v, {{n(0), n(1), n(2), n(3), n(4), n(5)}, n(6), n(7)}, 0.5);
    }
    VertexRows<double>::Begins begins, reversed;
    for (std::size_t i = 0; i < lanes; ++i) {
        begins[i] = begin_of_row(static_cast<Index>((3 * i + 1) % 8));
        reversed[i] = begin_of_row(7 - row_at(begins[i]));
    }
    rows.set_responses(reversed, rows.responses(begins));
    for (std::size_t i = 0; i < lanes; ++i) {
        const auto found = rows.response_of(row_at(reversed[i]));
        const Index from = row_at(begins[i]);
        CHECK(found.compliance.xy == number(from, 3));
        CHECK(found.compliance.yz == number(from, 5));
        CHECK(found.internal_force == number(from, 6));
        CHECK(found.internal_stiffness == number(from, 7));
    }
}

TEST_CASE("a step begins without forces of constraints", "[rows]") {
    VertexRows<double> rows(8);
    rows.begin_step();
    rows.forced.insert(1);
    rows.row(rows.force, 1).set({1, 2, 3}, 4);
    rows.added_stiffness[1] = rows.external_force[1] = 5;
    rows.has_external_forces = true;
    rows.begin_step();
    CHECK(rows.row(rows.force, 1).number == std::array<double, 4>{});
    CHECK(rows.added_stiffness[1] == 0);
    CHECK(rows.external_force[1] == 0);
    CHECK_FALSE(rows.has_external_forces);
}

TEST_CASE("the responses of the last step turn with the body", "[rows]") {
    VertexRows<double> rows(4);
    const Points<double> x = Points<double>::Random(3, 4);
    rows.begin_step();
    rows.load(1, x, OnePinned{});
    rows.set_response(1, {{1, 2, 3, 0, 0, 0}, 7, 8}, 0.5);
    Eigen::Matrix3d quarter;  // about z: x to y
    quarter << 0, -1, 0, 1, 0, 0, 0, 0, 1;
    rows.rotate(quarter);
    const auto turned = rows.response_of(1);
    CHECK(turned.compliance.xx == Approx(2));
    CHECK(turned.compliance.yy == Approx(1));
    CHECK(turned.compliance.zz == Approx(3));
    CHECK(turned.internal_force == 7);
    CHECK(turned.internal_stiffness == 8);
    CHECK(rows.compliance(1) == 0.5);
}
