// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <fstream>
#include <map>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "support/peers_tables.hpp"
#include "support/tick_tables.hpp"

// report FOLDER TOPIC...: prints tables of the results of these topics in FOLDER, and writes the figures there as
// summary.json and, for the plots, a .tsv for each table; all settings of `trade` as trade.csv, the figures of `tick`
// for all instruction sets as tick.csv.

namespace {

using bench::Row;
using bench::Table;
using Json = nlohmann::json;

/// Medians by topic and name, as "frame/part/solve/vertices:642".
using Results = std::map<std::string, Json>;

Table threshold_table(const std::string& vertices) {
    return {.topic = "tree",
            .key = "threshold_" + vertices,
            .title = "The tree's balance threshold, " + vertices + " vertices",
            .rows = {{"build", "threshold/build"},
                     {"closest point", "threshold/closest"},
                     {"touching sphere", "threshold/sphere"},
                     {"first hit", "threshold/segment"},
                     {"refit of the moved", "threshold/refit"},
                     {"triangles in a leaf", "threshold/build", Row::counter, "leaf", ""}},
            .column = "threshold",
            .columns = {1, 2, 4, 8, 16, 32, 64},
            .scene = "/vertices:" + vertices};
}

Table trade_table(const std::string& vertices) {
    const auto of = [](const std::string& rule, const std::string& iterations, const std::string& predicted = "1") {
        return "scene:slide/foundation:0.1/scalar:double/rule:" + rule + "/predicted:" + predicted +
               "/layers:3/contact_iterations:" + iterations;
    };
    return {.topic = "trade",
            .key = "trade_" + vertices,
            .title =
                "Time of a tick, and error of its force in percent: a tool slides, 3 layers, " + vertices + " vertices",
            .rows = {{"(4) as published", of("published", "1", "0")},
                     {"  error", of("published", "1", "0"), Row::percent, "force_error", ""},
                     {"  dt^2 k / m", of("published", "1", "0"), Row::counter, "part", ""},
                     {"(4), contact 3 x, predicted", of("published", "3")},
                     {"  error, 3 x", of("published", "3"), Row::percent, "force_error", ""},
                     {"safe step", of("safe", "3")},
                     {"  error, safe", of("safe", "3"), Row::percent, "force_error", ""},
                     {"block step, the default", of("block", "3")},
                     {"  error, block", of("block", "3"), Row::percent, "force_error", ""},
                     {"  error, not predicted", of("block", "3", "0"), Row::percent, "force_error", ""}},
            .column = "sweeps",
            .columns = {1, 2, 4, 8, 16},
            .scene = "/vertices:" + vertices};
}

/// The error of the solver, and what viscosity adds to the force.
Table damped_table() {
    Table table{.topic = "trade",
                .key = "trade_damped",
                .title = "A damped foundation, 3 layers: the error of the force in percent",
                .rows = {},
                .column = "sweeps",
                .columns = {1, 2, 4, 8, 16}};
    for (const std::string vertices : {"162", "642", "2562"}) {
        const std::string scene =
            "scene:slide_damped/foundation:0.2/scalar:double/rule:block/predicted:1/layers:3/contact_iterations:3/"
            "vertices:" +
            vertices;
        table.rows.push_back({vertices + " vertices", scene});
        table.rows.push_back({"  from the exact step, " + vertices, scene, Row::percent, "exact_error", ""});
        table.rows.push_back({"  viscosity adds, " + vertices, scene, Row::percent, "viscous", ""});
        table.rows.push_back({"  from equilibrium, " + vertices, scene, Row::percent, "force_error", ""});
    }
    return table;
}

/// By one integer option, the others at their defaults.
Table option_table(const std::string& option, const std::string& title, const std::vector<int>& numbers) {
    Table table{.topic = "defaults",
                .key = "defaults_" + option,
                .title = title,
                .rows = {},
                .column = option,
                .columns = numbers};
    const auto add = [&](const std::string& name, const std::string& short_name, const std::string& scene) {
        table.rows.push_back({name, scene});
        table.rows.push_back({"  error, " + short_name, scene, Row::percent, "force_error", ""});
    };
    for (const std::string vertices : {"162", "642", "2562"}) {
        add(vertices + " vertices", vertices, "scene:slide/vertices:" + vertices);
    }
    add("642 vertices, forceps", "forceps", "scene:draw_out/vertices:642");
    return table;
}

/// By alternatives to one default each.
Table choice_table(const std::string& scene, const std::string& title, const std::vector<int>& vertices) {
    Table table{.topic = "defaults", .key = "defaults_" + scene, .title = title, .rows = {}, .columns = vertices};
    const auto add = [&](const std::string& name, const std::string& short_name, const std::string& choice) {
        const std::string benchmark = "scene:" + scene + "/" + choice;
        table.rows.push_back({name, benchmark});
        table.rows.push_back({"  error, " + short_name, benchmark, Row::percent, "force_error", ""});
    };
    add("default", "default", "default");
    add("breadth first", "breadth first", "breadth_first");
    add("default, float", "float", "float");
    add("breadth first, float", "breadth first, float", "breadth_first_float");
    add("not predicted", "not predicted", "unpredicted");
    add("safe step", "safe", "safe");
    add("(4), lightest stable mass", "(4)", "published");
    return table;
}

Table sweep_table(const std::string& topic, const std::string& title) {
    const auto row = [](const std::string& name, const std::string& benchmark) {
        return Row{name, benchmark, Row::each, "vertex_updates"};
    };
    return {
        .topic = topic,
        .key = topic,
        .title = title,
        .rows = {row("(4), plain loop, double", "plain/double/mass"), row("(4), double", "lanes/double/mass"),
                 row("safe step, double", "lanes/double/safe"),
                 row("block step, plain loop, double", "plain/double/newton"),
                 row("block step, double", "lanes/double/newton"),
                 row("contiguous numbers, double", "contiguous/double"),
                 row("(4), plain loop, float", "plain/float/mass"), row("(4), float", "lanes/float/mass"),
                 row("safe step, float", "lanes/float/safe"),
                 row("block step, plain loop, float", "plain/float/newton"),
                 row("block step, float", "lanes/float/newton"), row("contiguous numbers, float", "contiguous/float")},
        .columns = {642, 2562, 10242}};
}

/// A step of springs and of tissues with more and more elements.
Table elements_table() {
    Table table{.topic = "elements",
                .key = "elements",
                .title = "A step of a tissue, and its ratio to one of springs",
                .rows = {},
                .columns = {469}};
    for (const std::string scalar : {"double", "float"}) {
        table.rows.push_back({"springs, " + scalar, "springs/" + scalar});
        for (const std::string kinds : {"triangles", "triangles, pressure", "triangles, pressure, bending"}) {
            std::string name = kinds;
            std::erase(name, ' ');
            std::replace(name.begin(), name.end(), ',', '_');
            table.rows.push_back({kinds + ", " + scalar, name + "/" + scalar});
            table.rows.push_back({"  ratio", name + "/" + scalar, Row::counter, "ratio", ""});
        }
    }
    return table;
}

/// A vertex in one of the 16 sweeps of a step over the whole mesh, by order and scalar.
Table threads_table() {
    Table table{.topic = "threads",
                .key = "threads",
                .title = "A step over the whole mesh, 16 sweeps; one thread, unless all are named",
                .rows = {},
                .columns = {2562, 10242, 40962, 163842}};
    for (const std::string scalar : {"double", "float"}) {
        const std::string first = "colour_layers/" + scalar;
        table.rows.push_back({"colour_layers, " + scalar, first});
        if (scalar == "double") table.rows.push_back({"  breadth_first", "breadth_first/double", Row::gain, first});
        table.rows.push_back({"  colour_all", "colour_all/" + scalar, Row::gain, first});
        table.rows.push_back({"  colour_all, all threads", "threads/" + scalar, Row::gain, first});
    }
    table.rows.push_back({"threads", "threads/double", Row::counter, "threads", ""});
    table.rows.push_back({"residual, colour_layers", "colour_layers/double", Row::counter, "residual", "N"});
    table.rows.push_back({"  residual, colour_all", "colour_all/double", Row::counter, "residual", "N"});
    return table;
}

Table stability_table(const std::string& column, const std::string& title, const std::vector<int>& columns) {
    const auto row = [&](const std::string& name, const std::string& rule) {
        return Row{name, column + "/" + rule, Row::counter, "diverging", ""};
    };
    Table table{.topic = "stability",
                .key = "stability_" + column,
                .title = title,
                .rows = {row("explicit Euler", "euler"), row("all at once", "at_once"),
                         row("(4), one by one", "one_by_one"), row("(4), with refusal", "published")},
                .column = column,
                .columns = columns};
    if (column == "dt") {
        table.rows.push_back(row("safe step", "safe"));
        table.rows.push_back(row("block step", "block"));
    }
    return table;
}

const std::vector<Table> all_tables{
    threads_table(),
    {"frame",
     "frame",
     "A frame and its parts: the tool presses and slides",
     {{"frame", "whole"},
      {"  contact", "part/contact", Row::share, "whole"},
      {"  solve", "part/solve", Row::share, "whole"},
      {"  refit", "part/refit", Row::share, "whole"},
      {"  normals", "part/normals", Row::share, "whole"},
      {"  force", "part/force", Row::share, "whole"},
      {"frames in a second", "whole", Row::rate, {}, ""}}},
    {"solver",
     "solver",
     "To equilibrium with a vertex prescribed 0.2 R inside, to the same residual",
     {{"explicit Euler at its best", "explicit_euler"},
      {"quasi-static, all layers", "quasi_static/all_layers", Row::gain, "explicit_euler"},
      {"  with omega 1.4", "quasi_static/omega_1_4", Row::gain, "explicit_euler"},
      {"quasi-static, 6 layers", "quasi_static/six_layers", Row::gain, "explicit_euler"},
      {"Euler: best dt", "explicit_euler", Row::counter, "dt"},
      {"Euler: best viscosity", "explicit_euler", Row::counter, "viscosity", "Ns/m"},
      {"Euler: steps", "explicit_euler", Row::counter, "steps", ""},
      {"Euler: a vertex and step", "explicit_euler", Row::each, "vertex_updates"},
      {"quasi-static: a vertex update", "quasi_static/all_layers", Row::each, "vertex_updates"}}},
    {"tree",
     "tree",
     "The tree against brute force over all triangles",
     {{"closest point, brute force", "all_triangles/closest"},
      {"closest point, tree", "tree/closest", Row::gain, "all_triangles/closest"},
      {"touching sphere, brute force", "all_triangles/sphere"},
      {"touching sphere, tree", "tree/sphere", Row::gain, "all_triangles/sphere"},
      {"first hit, brute force", "all_triangles/segment"},
      {"first hit, tree", "tree/segment", Row::gain, "all_triangles/segment"},
      {"build", "tree/build"}}},
    trade_table("162"),
    trade_table("642"),
    damped_table(),
    option_table("layers", "Time of a tick, and error of its force in percent, by layers: the default is 6",
                 {1, 2, 3, 4, 6, 8, 12}),
    option_table("sweeps", "The same by sweeps: the default is 2", {1, 2, 3, 4, 6, 8}),
    option_table("contact_iterations", "The same by contact iterations in a sweep: the default is 3",
                 {1, 2, 3, 4, 6, 8}),
    choice_table("slide", "The same with an alternative to one default: a tool slides", {162, 642, 2562}),
    choice_table("draw_out", "The same: forceps draw out", {642}),
    stability_table("dt", "Of 200 scenes, percent that diverge; dt in hundredths of sqrt(m / k)",
                    {20, 25, 30, 35, 40, 45, 50, 55, 60, 65, 70, 75, 80, 90, 100, 200, 500, 1000}),
    stability_table("limit", "The same; dt in hundredths of the theoretical limit of each scene",
                    {80, 85, 90, 95, 98, 99, 100, 101, 102, 105, 110, 115, 120, 125, 130}),
    elements_table(),
    sweep_table("sweep", "A vertex update, in a sweep over all vertices; registers of 16 bytes"),
    sweep_table("sweep_avx2", "The same; registers of 32 bytes"),
    threshold_table("642"),
    threshold_table("10242"),
    {"tracker",
     "tracker",
     "The contact: by tree queries in every frame, or by the tracker",
     {{"sphere of 2 mm, tree", "tree/sphere_2mm"},
      {"sphere of 2 mm, tracker", "tracker/sphere_2mm", Row::gain, "tree/sphere_2mm"},
      {"sphere of 4 mm, tree", "tree/sphere_4mm"},
      {"sphere of 4 mm, tracker", "tracker/sphere_4mm", Row::gain, "tree/sphere_4mm"},
      {"capsule of 2 mm, tree", "tree/capsule_2mm"},
      {"capsule of 2 mm, tracker", "tracker/capsule_2mm", Row::gain, "tree/capsule_2mm"}}},
    {"update",
     "update",
     "Boxes and normals: of all vertices, or of the moved ones",
     {{"refit, all", "update/refit_all"},
      {"refit, moved", "update/refit_moved", Row::gain, "update/refit_all"},
      {"normals, all", "update/normals_all"},
      {"normals, moved", "update/normals_moved", Row::gain, "update/normals_all"},
      {"normals, plain loop, double", "normals_plain"},
      {"  ours, double", "normals<double>", Row::gain, "normals_plain"},
      {"  ours, float", "normals<float>", Row::gain, "normals_plain"},
      {"moved vertices", "update/refit_moved", Row::counter, "moved", ""}}}};

/// Reads the output of Google Benchmark: its medians, or the single figure.
void read(const std::string& folder, const std::string& topic, Results& results, Json& context) {
    const std::string path = folder + "/" + topic + ".json";
    std::ifstream file(path);
    if (!file) throw std::runtime_error("there is no " + path);
    const Json all = Json::parse(file);
    context = all.at("context");
    for (const Json& run : all.at("benchmarks")) {
        if (run.value("aggregate_name", "median") != "median") continue;
        const std::string name = run.at("run_name");
        results[topic + "/" + name.substr(0, name.find("/iterations:"))] = run;
    }
}

double time_of(const Json& run) {
    static const std::map<std::string, double> second{{"ns", 1e-9}, {"us", 1e-6}, {"ms", 1e-3}, {"s", 1.0}};
    const bool manual = run.at("run_name").get<std::string>().find("/manual_time") != std::string::npos;
    return run.at(manual ? "real_time" : "cpu_time").get<double>() * second.at(run.at("time_unit"));
}

std::optional<double> value_in(const Results& results, const Table& table, const Row& row, int column) {
    const std::string scene = table.scene + "/" + table.column + ":" + std::to_string(column);
    const auto found = results.find(table.topic + "/" + row.benchmark + scene);
    if (found == results.end()) return std::nullopt;
    const Json& run = found->second;
    switch (row.kind) {
        case Row::rate: return 1 / time_of(run);
        case Row::each: return time_of(run) / run.at(row.other).get<double>();
        case Row::counter: return run.at(row.other).get<double>();
        case Row::percent: return 100 * run.at(row.other).get<double>();
        default: return time_of(run);
    }
}

std::string print(const char* format, double number) {
    char text[32];
    std::snprintf(text, sizeof text, format, number);
    return text;
}

/// Three digits and the unit: "91.4 us".
std::string readable(std::optional<double> value, const std::string& unit) {
    if (!value) return "-";
    const std::string prefix = "num kM";
    double number = *value;
    std::size_t at = 3;
    for (; !unit.empty() && number < 0.9995 && number > 0 && at > 0; --at) number *= 1000;
    const std::string digits = print(number < 9.995 ? "%.2f" : number < 99.95 ? "%.1f" : "%.0f", number);
    if (unit.empty()) return digits;
    return digits + " " + (at == 3 ? "" : prefix.substr(at, 1)) + unit;
}

/// The row relative to the one it is compared with: "87 %" of it, or "19 x" as fast.
std::string comparison(const Results& results, const Table& table, const Row& row, int column) {
    if (row.kind != Row::share && row.kind != Row::gain) return "";
    const auto value = value_in(results, table, row, column);
    const auto other = value_in(results, table, {"", row.other}, column);
    if (!value || !other) return "";
    if (row.kind == Row::share) return print("%.0f %%", 100 * *value / *other);
    const double gain = *other / *value;
    return print(gain < 0.0995 ? "%.3f x" : gain < 0.995 ? "%.2f x" : gain < 9.95 ? "%.1f x" : "%.0f x", gain);
}

bool has_results(const Results& results, const Table& table) {
    return std::any_of(table.rows.begin(), table.rows.end(), [&](const Row& row) {
        return std::any_of(table.columns.begin(), table.columns.end(),
                           [&](int column) { return value_in(results, table, row, column).has_value(); });
    });
}

/// `text` with spaces before it up to `width`.
std::string right(std::string text, std::size_t width) {
    text.insert(0, width - std::min(width, text.size()), ' ');
    return text;
}

void print_line(std::string line) {
    line.erase(line.find_last_not_of(' ') + 1);
    std::puts(line.c_str());
}

void print_table(const Results& results, const Table& table) {
    const auto first = [](std::string name) { return name.append(33 - std::min<std::size_t>(33, name.size()), ' '); };
    const bool grows = table.column == "vertices";
    const bool compares = std::any_of(table.rows.begin(), table.rows.end(),
                                      [](const Row& row) { return row.kind == Row::gain || row.kind == Row::share; });
    const std::size_t gap = compares || grows ? 8 : 1;  // holds the comparison
    std::string line = first("  " + table.column);
    for (const int column : table.columns) line += right(std::to_string(column), 9) + right("", gap);
    print_line("\n" + table.title);
    const auto& columns = table.columns;
    const bool has_162 = std::find(columns.begin(), columns.end(), 162) != columns.end();
    print_line(line + (grows && has_162 ? "642/162" : ""));
    for (const Row& row : table.rows) {
        line = first("  " + row.name);
        for (const int column : table.columns) {
            line += right(readable(value_in(results, table, row, column), row.unit), 9) +
                    right(comparison(results, table, row, column), gap);
        }
        const auto small = value_in(results, table, row, 162), large = value_in(results, table, row, 642);
        print_line(line + (grows && small && large ? print("%7.2f", *large / *small) : ""));
    }
}

Json summary_of(const Results& results, const Table& table) {
    Json rows = Json::array();
    for (const Row& row : table.rows) {
        Json values = Json::array();
        for (const int column : table.columns) {
            const auto value = value_in(results, table, row, column);
            values.push_back(value ? Json(*value) : Json());
        }
        rows.push_back(
            {{"name", row.name.substr(row.name.find_first_not_of(' '))}, {"unit", row.unit}, {"values", values}});
    }
    return {{"title", table.title}, {table.column, table.columns}, {"rows", rows}};
}

void write_tsv(const std::string& path, const Results& results, const Table& table) {
    std::ofstream file(path);
    file << table.column;
    for (const Row& row : table.rows) file << '\t' << row.name.substr(row.name.find_first_not_of(' '));
    file << '\n';
    for (const int column : table.columns) {
        file << column;
        for (const Row& row : table.rows) file << '\t' << value_in(results, table, row, column).value_or(std::nan(""));
        file << '\n';
    }
}

/// The words of a benchmark's name that have a value, as in "layers:6/sweeps:2".
std::map<std::string, std::string> words_of(const std::string& name) {
    std::map<std::string, std::string> values;
    std::istringstream words(name);
    for (std::string word; std::getline(words, word, '/');) {
        if (const auto colon = word.find(':'); colon != std::string::npos) {
            values[word.substr(0, colon)] = word.substr(colon + 1);
        }
    }
    return values;
}

/// A setting of the solver in a scene, with its time and errors.
struct Trial {
    std::map<std::string, std::string> setting;  ///< by the words of its name, as in "rule:block/sweeps:2"
    double time, force_error, position_error;

    [[nodiscard]] bool same_scene(const Trial& other) const {
        return std::all_of(scene_words.begin(), scene_words.end(),
                           [&](const std::string& word) { return setting.at(word) == other.setting.at(word); });
    }

    static inline const std::vector<std::string> scene_words{"scene",  "vertices", "foundation",
                                                             "scalar", "rule",     "predicted"};
    static inline const std::vector<std::string> words{
        "scene", "vertices", "foundation", "scalar", "rule", "predicted", "layers", "sweeps", "contact_iterations"};
};

std::vector<Trial> trials_in(const Results& results) {
    std::vector<Trial> trials;
    for (const auto& [name, run] : results) {
        if (name.rfind("trade/", 0) != 0) continue;
        trials.push_back({words_of(name), time_of(run), run.at("force_error"), run.at("position_error")});
    }
    std::stable_sort(trials.begin(), trials.end(), [](const Trial& a, const Trial& b) { return a.time < b.time; });
    return trials;
}

/// All settings in SI units, by increasing time. A setting is on the front if no other of the same scene and rule beats
/// it in both time and force error; position errors are relative to the depth.
void write_trials(const std::string& path, const std::vector<Trial>& trials) {
    std::ofstream file(path);
    for (const auto& word : Trial::words) file << word << ',';
    file << "time,force_error,position_error,front\n";
    for (const Trial& trial : trials) {
        const bool beaten = std::any_of(trials.begin(), trials.end(), [&](const Trial& other) {
            return other.time < trial.time && other.force_error <= trial.force_error && trial.same_scene(other);
        });
        for (const auto& word : Trial::words) file << trial.setting.at(word) << ',';
        file << trial.time << ',' << trial.force_error << ',' << trial.position_error << ',' << (beaten ? 0 : 1)
             << '\n';
    }
}

/// Times in microseconds, of a tick and of its parts, ours and Bullet's.
void write_ticks(const std::string& path, const Results& results) {
    std::ofstream file(path);
    file << "build,scalar,vertices,layers,sweeps,us,us_contact,us_sweep,us_other,error_percent,bullet_us\n";
    const auto write = [&](const std::string& name) {
        const auto found = results.find(name);
        if (found == results.end()) return;
        const Json& run = found->second;
        file << run.at("label").get<std::string>();
        const auto words = words_of(name);
        for (const char* word : {"scalar", "vertices", "layers", "sweeps"}) file << ',' << words.at(word);
        const auto counter = [&](const char* of) { return run.at(of).get<double>(); };
        for (const double time : {time_of(run), counter("contact"), counter("sweep"), counter("other")}) {
            file << ',' << 1e6 * time;
        }
        file << ',' << 100 * counter("force_error") << ',' << 1e6 * counter("bullet") << '\n';
    };
    for (const Table& table : bench::tick_tables()) {
        for (const Row& row : table.rows) {
            if (row.kind != Row::time || row.benchmark.rfind("path/", 0) != 0) continue;
            for (const int vertices : table.columns) {
                write(table.topic + "/" + row.benchmark + "/vertices:" + std::to_string(vertices));
            }
        }
    }
}

void report(const std::string& folder, const std::vector<std::string>& topics) {
    Results results;
    Json summary{{"context", {}}, {"tables", Json::object()}};
    Json& context = summary["context"];
    for (const auto& topic : topics) read(folder, topic, results, context);
    const auto context_text = [&](const char* name) { return context.at(name).get<std::string>(); };
    std::printf(
        "%s at %d MHz\n%s %s\none core, medians of the processor time; %%: of the frame; x: speed relative to the "
        "first "
        "line of its kind\n",
        context_text("processor").c_str(), context.at("mhz_per_cpu").get<int>(), context_text("compiler").c_str(),
        context_text("flags").c_str());
    std::vector<Table> tables = all_tables;
    for (const auto& more : {bench::peers_tables(), bench::tick_tables()}) {
        tables.insert(tables.end(), more.begin(), more.end());
    }
    for (const Table& table : tables) {
        if (std::find(topics.begin(), topics.end(), table.topic) == topics.end()) continue;
        if (!has_results(results, table)) continue;
        print_table(results, table);
        summary["tables"][table.key] = summary_of(results, table);
        write_tsv(folder + "/" + table.key + ".tsv", results, table);
    }
    if (const auto trials = trials_in(results); !trials.empty()) write_trials(folder + "/trade.csv", trials);
    if (std::any_of(topics.begin(), topics.end(), [](const auto& topic) { return topic.rfind("tick", 0) == 0; })) {
        write_ticks(folder + "/tick.csv", results);
    }
    std::ofstream(folder + "/summary.json") << summary.dump(2) << '\n';
}

}  // namespace

int main(int argc, char** argv) {
    try {
        if (argc < 3) throw std::runtime_error("report FOLDER TOPIC...");
        report(argv[1], {argv + 2, argv + argc});
        return 0;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "report: %s\n", error.what());
        return 2;
    }
}
