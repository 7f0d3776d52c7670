// SPDX-License-Identifier: MIT
#include <membrane/solve/packed_elements.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <numeric>
#include <type_traits>
#include <utility>
#include <vector>

#include <membrane/tissue/bending.hpp>
#include <membrane/tissue/pressure.hpp>
#include <membrane/tissue/tissue.hpp>
#include <membrane/tissue/triangular_springs.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/meshes.hpp"
#include "support/random.hpp"

using namespace membrane;
using test::Random;

static_assert(ElementInLanes<TriangularSpring<double>, double> && ElementInLanes<Hinge<float>, float>);
static_assert(!HasElements<MassSpringNetwork<double, LinearSpring>>);

namespace {

template <Real S>
auto random_tissue(const TriangleMesh<S>& mesh, Random& random) {
    const Material material{.young_modulus = 1e3, .poisson_ratio = random.number(0.0, 0.45), .thickness = 1e-3};
    const auto springs = MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = S(1)});
    return Tissue(springs, triangular_springs(mesh, material, 1.1), bending_springs(mesh, 1e-6), pressure(mesh, 10.0));
}

/// The vertices of a mesh in packs of random sizes.
template <Real S>
std::vector<std::vector<Index>> random_packs(Index vertices, Random& random) {
    std::vector<std::vector<Index>> packs;
    for (Index v = 0; v < vertices;) {
        const Index end = std::min(vertices, v + 1 + random.index(static_cast<Index>(Lanes<S>::count)));
        packs.emplace_back();
        while (v < end) packs.back().push_back(v++);
    }
    return packs;
}

/// Number of slots for these vertices: for each kind and place the most elements at one of them.
template <Real S, class Network>
std::size_t slots_for(const Network& network, const std::vector<Index>& vertices) {
    std::size_t slots = 0;
    network.for_each_kind([&]<class E>(const Elements<S, E>& elements) {
        std::array<std::size_t, E::corner_count> most{};
        for (const Index v : vertices) {
            std::array<std::size_t, E::corner_count> count{};
            for (const auto& at : elements.at(v)) ++count[at.place];
            for (std::size_t k = 0; k < count.size(); ++k) most[k] = std::max(most[k], count[k]);
        }
        slots = std::accumulate(most.begin(), most.end(), slots);
    });
    return slots;
}

}  // namespace

TEMPLATE_TEST_CASE("each lane of a pack sums the elements of its vertex, to the bit", "[packed][tissue]", float,
                   double) {
    using S = TestType;
    using Wide = Lanes<S>;
    for (int seed = 1; seed <= cases(60); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh = test::random_surface<S>(random).mesh();
        const auto tissue = random_tissue(mesh, random);
        const Index vertices = mesh.vertex_count();
        const Points<S> x = test::jittered(mesh.positions(), S(0.1), random);
        std::vector<PaddedPoint<S>> rows(static_cast<std::size_t>(vertices) + 1);
        for (Index v = 0; v < vertices; ++v) rows[static_cast<std::size_t>(v)].set(point(x, v));
        const auto packs = random_packs<S>(vertices, random);
        PackedElements<S> packed(tissue, static_cast<std::size_t>(vertices) * Wide::count, packs.size());
        for (std::size_t p = 0; p < packs.size(); ++p) {
            typename PackedElements<S>::Begins own;
            own.fill(numbers_in_point * vertices);  // an unused row
            for (std::size_t l = 0; l < packs[p].size(); ++l) own[l] = numbers_in_point * packs[p][l];
            REQUIRE(packed.append(packs[p], own, tissue));
            CornerForce<Wide> sum{{}, {}, {}};
            std::size_t slots = 0;
            packed.for_each(p, gather(rows.data(), own.data()), rows.data(), tissue,
                            [&](const auto& element, const auto& at, std::size_t i) {
                                sum += element.force_on(at, i);
                                ++slots;
                            });
            REQUIRE(slots == slots_for<S>(tissue, packs[p]));
            for (std::size_t l = 0; l < Wide::count; ++l) {
                CornerForce<S> alone{{}, {}, {}};
                if (l < packs[p].size()) {
                    tissue.for_each_kind([&](const auto& elements) {
                        elements.for_each(packs[p][l], x, [&](const auto& instance, const auto& at, std::size_t i) {
                            alone += instance.element.force_on(at, i);
                        });
                    });
                }
                for (Eigen::Index k = 0; k < 3; ++k) REQUIRE(sum.force[k][l] == alone.force[k]);
                REQUIRE((sum.hessian.xx[l] == alone.hessian.xx && sum.hessian.yz[l] == alone.hessian.yz));
                REQUIRE((sum.remainder.second[l] == alone.remainder.second));
                REQUIRE((sum.remainder.fourth[l] == alone.remainder.fourth));
                REQUIRE((sum.remainder.per_range[l] == alone.remainder.per_range));
            }
        }
        REQUIRE(packed.size() == packs.size());
    }
}

TEST_CASE("a vertex with many elements fits, and no pack beyond the capacity", "[packed][tissue]") {
    const auto mesh = test::fan<double>(200).mesh();
    const auto tissue = Tissue(MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 1.0}),
                               triangular_springs(mesh, Material{.young_modulus = 1e3, .thickness = 1e-3}));
    const Index middle = 0;
    PackedElements<double>::Begins own;
    own.fill(0);
    const std::size_t packs = 10'000;
    PackedElements<double> packed(tissue, 1, packs);
    while (packed.append({&middle, 1}, own, tissue)) REQUIRE(packed.size() < packs);
    CHECK(packed.size() >= 64);
    for (std::size_t p = 0; p < packed.size(); ++p) {
        std::size_t slots = 0;
        packed.for_each(p, {0, 0, 0}, std::vector<PaddedPoint<double>>(202).data(), tissue,
                        [&](const auto&, const auto&, std::size_t) { ++slots; });
        REQUIRE(slots == 200);
    }
}

TEST_CASE("a pack beyond the capacity is refused whole, and fits after others are removed", "[packed][tissue]") {
    Random random(1);
    const auto mesh = test::random_surface<double>(random).mesh();
    const auto tissue = random_tissue(mesh, random);
    PackedElements<double> packed(tissue, static_cast<std::size_t>(mesh.vertex_count()), 2);
    const Index v = 0;
    typename PackedElements<double>::Begins own;
    own.fill(0);
    CHECK(packed.append({&v, 1}, own, tissue));
    CHECK(packed.append({&v, 1}, own, tissue));
    CHECK(!packed.append({&v, 1}, own, tissue));
    CHECK(packed.size() == 2);
    packed.truncate(1);
    CHECK(packed.size() == 1);
    CHECK(packed.append({&v, 1}, own, tissue));

    const auto springs = MassSpringNetwork(mesh, LinearSpring{}, {.stiffness = 1.0});
    STATIC_REQUIRE_FALSE(HasElements<std::remove_const_t<decltype(springs)>>);
    CHECK(PackedElements<double>(springs, 10, 2).size() == 0);  // of a network that appends none
}
