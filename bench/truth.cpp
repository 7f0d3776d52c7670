// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>
#include <iterator>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/truth_ball.hpp"
#include "support/truth_curved.hpp"
#include "support/truth_flat.hpp"
#include "support/truth_shell.hpp"

// truth FOLDER [--short] [SCENE...]: equilibria of the library beside those of CalculiX, another program with other
// elements. Prints a Markdown table for each scene and one of all; writes truth.md and a .tsv for each plot to FOLDER.

namespace {

using bench::Comparison;
using bench::truth::Effort;

struct Scene {
    const char* name;
    Comparison (*compare)(const Effort&);
};

constexpr Scene scenes[] = {
    {"pressure", bench::truth::pressure},
    {"patch", bench::truth::patch},
    {"foundation", bench::truth::foundation},
    {"cap", bench::truth::cap},
    {"irregular", bench::truth::irregular_pressure},
    {"irregular", bench::truth::irregular_patch},
    {"ball_a", bench::truth::small_ball},
    {"ball_b", bench::truth::middle_ball},
    {"ball_c", bench::truth::large_ball},
    {"capsule", bench::truth::capsule},
    {"shell", bench::truth::dent},
    {"shell", bench::truth::plate},
    {"tools", bench::truth::two_balls},
};

void run(const std::filesystem::path& folder, const std::vector<std::string>& names, const Effort& effort) {
    for (const std::string& name : names) {
        const auto is_named = [&](const Scene& scene) { return scene.name == name; };
        if (std::none_of(std::begin(scenes), std::end(scenes), is_named)) {
            throw std::runtime_error("there is no scene " + name);
        }
    }
    std::vector<Comparison> tables;
    std::FILE* page = std::fopen((folder / "truth.md").c_str(), "w");
    for (const Scene& scene : scenes) {
        if (!names.empty() && std::find(names.begin(), names.end(), scene.name) == names.end()) continue;
        const Comparison table = scene.compare(effort);
        for (std::FILE* file : {stdout, page}) table.print(file);
        table.write_tsv(folder / ("truth_" + table.key + ".tsv"));
        tables.push_back(table);
    }
    for (std::FILE* file : {stdout, page}) {
        std::fprintf(file,
                     "\n| scene | largest difference | bound | with an assumption switched |\n|---|---|---|---|\n");
        for (const Comparison& table : tables) table.print_summary(file);
    }
    std::fclose(page);
}

}  // namespace

int main(int argc, char** argv) {
    try {
        if (argc < 2) throw std::runtime_error("truth FOLDER [--short] [SCENE...]");
        if (!bench::has_calculix()) {
            std::fprintf(stderr, "truth: skipped, there is no ccx (Debian's calculix-ccx)\n");
            return 0;
        }
        const std::filesystem::path folder = argv[1];
        std::filesystem::create_directories(folder);
        Effort effort{.folder = folder / "calculix"};
        std::vector<std::string> names;
        for (int i = 2; i < argc; ++i) {
            if (std::strcmp(argv[i], "--short") == 0) {
                effort = {.folder = effort.folder, .rings = 14, .across = 4, .loads = 1};
            } else {
                names.push_back(argv[i]);
            }
        }
        run(folder, names, effort);
        return 0;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "truth: %s\n", error.what());
        return 2;
    }
}
