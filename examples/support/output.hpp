// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <fstream>
#include <ios>
#include <iostream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "support/command_line.hpp"
#include "support/pictures.hpp"
#include "support/report.hpp"
#include "support/text.hpp"

namespace examples {

/// The output files of `press_and_pull`, as options of the command line. For an empty name no file.
struct OutputOptions {
    std::filesystem::path pictures;
    std::string json = {}, csv = {};

    void add_to(CommandLine& command) {
        command.add("--out", pictures, "folder for the pictures and index.html");
        command.add("--json", json, "write every figure to this file");
        command.add("--csv", csv, "write time, tool, depth and force of every frame to this file");
    }
};

/// The output files of `press_and_pull`. The constructor checks that they can be written; `write` overwrites existing
/// ones.
///
///     Output output({.pictures = "pictures", .json = "figures.json"});
///     output.write(outcomes, layers);
class Output {
  public:
    /// @throws std::runtime_error for a folder or file that cannot be written
    explicit Output(const OutputOptions& options)
        : folder_(options.pictures), page_(folder_ / "index.html"), json_(options.json), csv_(options.csv) {
        std::error_code failed;
        std::filesystem::create_directories(folder_, failed);
        if (failed) throw std::runtime_error("cannot make the folder " + folder_.string());
        for (const auto& file : {page_, json_, csv_}) {
            if (!file.empty()) save(file, "", std::ios::app);
        }
    }

    /// Prints the tables, writes the pictures and the requested files.
    void write(const std::vector<Outcome>& outcomes, membrane::Index layers) const {
        print(std::cout, speed_table(outcomes, layers), speed_note());
        print(std::cout, force_table(outcomes), force_note());
        std::vector<Drawing> drawings;
        for (const Outcome& outcome : outcomes) {
            for (const auto draw : {pressed_and_pulled, recovered}) {
                drawings.push_back(draw(outcome));
                save(folder_ / (drawings.back().name + ".svg"), drawings.back().svg);
            }
            if (outcome.scene.film_interval > 0) {
                drawings.push_back(moving(outcome));
                save(folder_ / (drawings.back().name + ".svg"), drawings.back().svg);
            }
            const auto file = folder_ / (outcome.scene.key + "_force");
            std::cout << plot(file, curves(outcome), "press_and_pull", settings(outcome)) << '\n';
            std::ifstream svg(file.string() + ".svg");
            if (!svg) continue;
            drawings.push_back({file.stem().string(),
                                force_caption,
                                {std::istreambuf_iterator<char>(svg), std::istreambuf_iterator<char>()}});
        }
        save(page_, page(outcomes, drawings, layers));
        if (!json_.empty()) save(json_, json(outcomes, layers).dump(2) + '\n');
        if (!csv_.empty()) save(csv_, csv(outcomes));
        std::cout << "\npictures: " << page_.string() << std::endl;
    }

  private:
    std::filesystem::path folder_, page_, json_, csv_;
};

}  // namespace examples
