// SPDX-License-Identifier: MIT
#include <membrane/mesh_check/mesh_report.hpp>

#include "support/catch.hpp"

using namespace membrane;

TEST_CASE("a report lists what is found, and counts what it does not list", "[mesh]") {
    MeshReport report;
    CHECK(report.empty());
    CHECK(report.valid());
    CHECK(to_string(report).empty());
    const detail::Recorder found(report, 2);
    for (Index v = 0; v < 5; ++v) found(MeshDefect::isolated_vertex, {v}, {}, "no triangle names vertex ", v);
    CHECK(report.count(MeshDefect::isolated_vertex) == 5);
    CHECK(report.findings.size() == 2);
    CHECK(report.findings[1].vertices == std::vector<Index>{1});
    CHECK(report.valid());
    CHECK(!report.empty());
    found(MeshDefect::repeated_vertex, {3}, {7}, "triangle ", 7, " names vertex ", 3, " twice");
    CHECK(!report.valid());
    report.unfinished = {MeshDefect::t_junction, MeshDefect::self_intersection};
    CHECK(to_string(report) ==
          "error: repeated vertex: 1; repair with .drop_repeated\n"
          "warning: isolated vertex: 5; repair with .drop_isolated\n"
          "search stopped at its limit, there may be more: T-junction\n"
          "search stopped at its limit, there may be more: self-intersection\n"
          "repeated vertex: triangle 7 names vertex 3 twice\n"
          "isolated vertex: no triangle names vertex 0\n"
          "isolated vertex: no triangle names vertex 1\n"
          "isolated vertex: 3 more\n");
    const detail::Recorder all(report, 100);
    for (Index v = 0; v < 50; ++v) all(MeshDefect::coincident_vertices, {v}, {}, "vertex ", v);
    CHECK_THAT(to_string(report), ContainsSubstring("coincident vertices: vertex 9\ncoincident vertices: 40 more\n"));
}
