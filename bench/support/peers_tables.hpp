// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "table.hpp"

/// The tables of the comparisons with other libraries.
namespace bench {

/// One query or operation, for all trees.
inline void add_query(std::vector<Row>& rows, const std::string& title, const std::string& query,
                      const std::vector<std::pair<std::string, std::string>>& trees) {
    const std::string first = query + "/double";
    rows.push_back({title + ", double", first});
    for (const auto& [name, tree] : trees) rows.push_back({"  " + name, query + "/" + tree, Row::gain, first});
}

inline Table peers_tree_table() {
    using Trees = std::vector<std::pair<std::string, std::string>>;
    const Trees all{{"float", "float"}, {"Embree", "embree"}, {"CGAL", "cgal"}, {"FCL", "fcl"}};
    const Trees with_rays{{"float", "float"}, {"Embree", "embree"}, {"CGAL", "cgal"}, {"Bullet", "bullet"}};
    const Trees with_refit{{"float", "float"}, {"Embree", "embree"}, {"FCL", "fcl"}};
    Table table{.topic = "peers_tree",
                .key = "peers_tree",
                .title = "Our tree, and the speed of others relative to it; queries near a sphere",
                .rows = {},
                .column = "triangles",
                .columns = {1'280, 81'920, 1'310'720}};
    add_query(table.rows, "closest, along a path", "path", all);
    add_query(table.rows, "closest, at random", "random", all);
    add_query(table.rows, "triangles in a ball", "sphere", all);
    add_query(table.rows, "first hit of a segment", "segment", with_rays);
    add_query(table.rows, "build", "build", all);
    add_query(table.rows, "refit of all", "refit", with_refit);
    table.rows.push_back({"contact, by our tree", "contact/tree"});
    table.rows.push_back({"  by the tracker", "contact/tracker", Row::gain, "contact/tree"});
    table.rows.push_back({"  a triangle touched", "contact/tracker", Row::each, "touched"});
    table.rows.push_back({"  triangles touched", "contact/tracker", Row::counter, "touched", ""});
    return table;
}

inline Table peers_sweep_table() {
    const auto row = [](const std::string& name, const std::string& benchmark) {
        return Row{name, benchmark, Row::each, "vertex_updates"};
    };
    return {.topic = "peers_sweep",
            .key = "peers_sweep",
            .title = "A vertex, in one sweep over all of them",
            .rows = {row("Bullet, position iteration", "bullet"), row("(4), plain loop, double", "plain/double"),
                     row("(4), double", "ours/double/mass"), row("safe step, double", "ours/double/safe"),
                     row("(4), float", "ours/float/mass"), row("safe step, float", "ours/float/safe")},
            .columns = {642, 2562}};
}

inline Table peers_tick_table(const std::string& topic, const std::string& tool, const std::string& title,
                              const std::vector<int>& columns) {
    Table table{.topic = topic, .key = topic + "_" + tool, .title = title, .rows = {}, .columns = columns};
    const std::string first = tool + "/double/block";
    table.rows = {{"block step, double", first},
                  {"safe step, double", tool + "/double/safe", Row::gain, first},
                  {"block step, float", tool + "/float/block", Row::gain, first},
                  {"safe step, float", tool + "/float/safe", Row::gain, first},
                  {"Bullet", tool + "/bullet", Row::gain, first},
                  {"ticks in a second", first, Row::rate, {}, ""},
                  {"  Bullet's", tool + "/bullet", Row::rate, {}, ""},
                  {"vertices moved", first, Row::counter, "moved", ""}};
    return table;
}

inline Table peers_rest_table() {
    const auto error = [](const std::string& benchmark) {
        return Row{"  error of the force, %", benchmark, Row::percent, "force_error", ""};
    };
    const auto gain = [](const std::string& name, const std::string& benchmark) {
        return Row{name, benchmark, Row::gain, "steps/block"};
    };
    return {.topic = "peers_rest",
            .key = "peers_rest",
            .title = "From rest to a force within 1 % of the equilibrium's; a vertex held 0.2 R inside, 642 vertices",
            .rows = {{"block step", "steps/block"},
                     error("steps/block"),
                     gain("safe step", "steps/safe"),
                     error("steps/safe"),
                     gain("(4), best mass", "steps/published"),
                     error("steps/published"),
                     gain("Newton, these layers", "newton/layers"),
                     error("newton/layers"),
                     gain("Newton, whole mesh", "newton/whole"),
                     error("newton/whole"),
                     gain("  its pattern anew", "newton/whole_anew")},
            .column = "layers",
            .columns = {2, 3, 4, 6}};
}

inline Table peers_distmesh_table() {
    Table table{.topic = "peers_distmesh",
                .key = "peers_distmesh",
                .title = "A mesh of a signed distance, and the relative speed of CGAL's mesher; angles in degrees",
                .rows = {},
                .column = "thousandths",
                .columns = {200, 100}};
    for (const std::string body : {"sphere", "lens", "capsule", "merged", "torus", "ellipsoid"}) {
        const std::string ours = body + "/ours", theirs = body + "/cgal";
        table.rows.push_back({body, ours});
        table.rows.push_back({"  CGAL", theirs, Row::gain, ours});
        for (const auto& [suffix, benchmark] : {std::pair<std::string, std::string>{"", ours}, {", CGAL", theirs}}) {
            table.rows.push_back({"  smallest angle" + suffix, benchmark, Row::counter, "smallest_angle", ""});
            table.rows.push_back({"  mean smallest" + suffix, benchmark, Row::counter, "mean_smallest_angle", ""});
            table.rows.push_back({"  even edges, %" + suffix, benchmark, Row::percent, "even_edges", ""});
            table.rows.push_back({"  mean edge" + suffix, benchmark, Row::counter, "mean_edge", ""});
            table.rows.push_back({"  vertices" + suffix, benchmark, Row::counter, "vertices", ""});
        }
    }
    return table;
}

inline std::vector<Table> peers_tables() {
    const std::vector<int> same{162, 642, 2'562, 10'242, 40'962};
    const std::vector<int> fine{642, 2'562, 10'242, 40'962, 163'842, 655'362};
    return {peers_tree_table(),
            peers_sweep_table(),
            peers_tick_table("peers_tick", "same", "A tick while a tool of 2 mm slides", same),
            peers_tick_table("peers_tick", "fine", "The same; a tool that is as many edges wide on all meshes", fine),
            peers_tick_table("peers_tick_avx2", "same", "A tick, a tool of 2 mm; our registers of 32 bytes", same),
            peers_tick_table("peers_tick_avx2", "fine", "The same; as many edges wide on all meshes", fine),
            peers_rest_table(),
            peers_distmesh_table()};
}

}  // namespace bench
