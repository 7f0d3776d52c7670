// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <fstream>
#include <ios>
#include <iostream>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "support/pictures.hpp"
#include "support/report.hpp"

namespace examples {

/// Where `press_and_pull` writes to. That it can is found out before the work begins, and what was there before is
/// overwritten only at its end.
///
///     Output output("pictures", "figures.json", "");
///     output.write(outcomes, layers);
class Output {
  public:
    /// No file for an empty name.
    /// @throws std::runtime_error for a folder or file that cannot be written
    Output(const std::filesystem::path& folder, const std::string& json_name, const std::string& csv_name)
        : folder_(folder), page_(folder / "index.html"), json_(json_name), csv_(csv_name) {
        std::error_code failed;
        std::filesystem::create_directories(folder, failed);
        if (failed) throw std::runtime_error("cannot make the folder " + folder.string());
        for (const auto& file : {page_, json_, csv_}) {
            if (!file.empty()) save(file, "", std::ios::app);
        }
    }

    /// Prints the tables, writes the pictures and whatever else was asked for.
    void write(const std::vector<Outcome>& outcomes, membrane::Index layers) const {
        print(std::cout, speed_table(outcomes, layers), speed_note());
        print(std::cout, force_table(outcomes), force_note());
        std::vector<Drawing> drawings;
        for (const Outcome& outcome : outcomes) {
            for (const auto draw : {pressed_and_pulled, recovered, over_time}) drawings.push_back(draw(outcome));
        }
        for (const Drawing& drawing : drawings) save(folder_ / (drawing.name + ".svg"), drawing.svg);
        save(page_, page(outcomes, drawings, layers));
        if (!json_.empty()) save(json_, json(outcomes, layers).dump(2) + '\n');
        if (!csv_.empty()) save(csv_, csv(outcomes));
        std::cout << "\npictures: " << page_.string() << std::endl;
    }

  private:
    static void save(const std::filesystem::path& file, const std::string& text,
                     std::ios::openmode mode = std::ios::trunc) {
        std::ofstream stream(file, mode);
        if (!(stream << text << std::flush)) throw std::runtime_error("cannot write " + file.string());
    }

    std::filesystem::path folder_, page_, json_, csv_;
};

}  // namespace examples
