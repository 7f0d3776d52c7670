// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "table.hpp"

/// The tables of a whole tick, by instruction set.
namespace bench {

inline Table tick_table(const std::string& topic, const std::string& title) {
    Table table{.topic = topic, .key = topic, .title = title, .rows = {}, .columns = {642, 2'562, 10'242, 40'962}};
    for (const std::string scalar : {"double", "float"}) {
        for (const auto& [layers, sweeps] : {std::pair<std::string, std::string>{"6", "2"}, {"3", "1"}}) {
            const std::string benchmark = "path/scalar:" + scalar + "/layers:" + layers + "/sweeps:" + sweeps;
            const auto add = [&](const std::string& name, Row::Kind kind, const std::string& counter,
                                 const std::string& unit) {
                table.rows.push_back({"  " + name, benchmark, kind, counter, unit});
            };
            table.rows.push_back({scalar + " {" + layers + ", " + sweeps + "}", benchmark});
            const std::string of = ", " + scalar + " " + layers;
            add("contact" + of, Row::counter, "contact", "s");
            add("sweep" + of, Row::counter, "sweep", "s");
            add("other" + of, Row::counter, "other", "s");
            add("after 1,500 ticks" + of, Row::counter, "late", "s");
            add("error, %" + of, Row::percent, "force_error", "");
            add("largest force" + of, Row::counter, "largest_force", "");
            add("penetration, %" + of, Row::percent, "penetration", "");
            add("Bullet" + of, Row::counter, "bullet", "s");
            add("Bullet / ours" + of, Row::counter, "ratio", "");
        }
    }
    return table;
}

inline Table tick_scenes_table(const std::string& topic, const std::string& title) {
    Table table{.topic = topic,
                .key = topic + "_scenes",
                .title = title,
                .rows = {{"a sphere slides", "scene/sphere"}},
                .columns = {642, 2'562, 10'242}};
    const auto add = [&](const std::string& name, const std::string& scene) {
        table.rows.push_back({name, "scene/" + scene, Row::gain, "scene/sphere"});
    };
    add("contact by faces", "by_faces");
    add("two spheres", "two_tools");
    add("a capsule", "capsule");
    add("a point", "point");
    add("forceps", "forceps");
    add("a pinned rim", "pinned");
    add("a body that turns", "turning");
    add("a body that beats", "beating");
    add("a stiffening law", "stiffening");
    add("(4) as published", "published");
    add("a constraint of one's own", "suction");
    add("a deadline", "deadline");
    add("a tissue", "tissue");
    return table;
}

inline std::vector<Table> tick_tables() {
    const std::string title = "A tick by {layers, sweeps}, and its parts; penetration in percent of an edge; ";
    const std::string scenes = "A tick of other scenes, double {6, 2}; ";
    std::vector<Table> tables;
    for (const auto& [topic, set] : {std::pair<std::string, std::string>{"tick", "registers of 16 bytes"},
                                     {"tick_avx2", "registers of 32 bytes"},
                                     {"tick_avx512", "AVX-512"}}) {
        tables.push_back(tick_table(topic, title + set));
        tables.push_back(tick_scenes_table(topic, scenes + set));
    }
    return tables;
}

}  // namespace bench
