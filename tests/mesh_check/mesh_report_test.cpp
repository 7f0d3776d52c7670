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
    report.complete = false;
    CHECK(to_string(report) ==
          "warning: isolated vertex: no triangle names vertex 0; repair with .drop_isolated\n"
          "warning: isolated vertex: no triangle names vertex 1; repair with .drop_isolated\n"
          "error: repeated vertex: triangle 7 names vertex 3 twice; repair with .drop_repeated\n"
          "3 more: isolated vertex\n"
          "the search is not complete\n");
}
