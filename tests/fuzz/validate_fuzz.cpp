// SPDX-License-Identifier: MIT
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include <membrane/mesh_check/repair.hpp>
#include <membrane/mesh_check/validate.hpp>

#include "bytes.hpp"

// Any bytes as a mesh: validation comes back, its verdict is that of `TriangleMesh`, and so it is after a repair.

using test::Bytes;
using test::require;

namespace {

template <class Scalar>
bool taken(const membrane::Points<Scalar>& x, const membrane::Triangles& triangles) {
    try {
        membrane::TriangleMesh<Scalar> mesh(x, triangles);
    } catch (const membrane::InvalidInput&) {
        return false;
    }
    return true;
}

template <class Scalar>
void examine(Bytes bytes) {
    const test::Switches switches(bytes.next<std::uint8_t>());
    membrane::Points<Scalar> x(3, bytes.index(32));
    membrane::Triangles triangles(3, bytes.index(48));
    const bool wild_numbers = switches.on(0), wild_indices = switches.on(1);
    for (Scalar& coordinate : x.reshaped()) {
        coordinate = wild_numbers ? bytes.next<Scalar>() : static_cast<Scalar>(bytes.next<std::int8_t>() % 8);
    }
    for (membrane::Index& corner : triangles.reshaped()) {
        corner = wild_indices ? bytes.next<membrane::Index>()
                              : bytes.next<std::uint8_t>() % (static_cast<membrane::Index>(x.cols()) + 1);
    }
    const membrane::MeshReport report = membrane::validate(x, triangles);
    require(report.valid() == taken(x, triangles));
    require(report.empty() == to_string(report).empty() || !report.complete);

    const membrane::RepairOptions options{
        .weld = switches.on(2) ? std::optional<double>(switches.on(3) ? 0.0 : 1.0) : std::nullopt,
        .drop_repeated = switches.on(4),
        .drop_zero_area = switches.on(5),
        .drop_duplicates = switches.on(5),
        .orient = switches.on(6),
        .split_vertices = switches.on(7),
        .flip_inward = switches.on(3),
        .drop_isolated = switches.on(4)};
    try {
        const auto repaired = membrane::repair(x, triangles, options);
        require(membrane::validate(repaired.positions, repaired.triangles).valid() ==
                taken(repaired.positions, repaired.triangles));
    } catch (const membrane::InvalidInput&) {
        require(report.count(membrane::MeshDefect::index_out_of_range) > 0);
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    Bytes bytes(data, size);
    if (bytes.next<std::uint8_t>() % 2 == 0) {
        examine<float>(bytes);
    } else {
        examine<double>(bytes);
    }
    return 0;
}
