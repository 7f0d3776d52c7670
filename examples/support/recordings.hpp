// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <fstream>
#include <stdexcept>

#include <membrane/haptics/recording_file.hpp>

namespace examples {

/// @throws std::runtime_error for a file that cannot be read, InvalidInput for one that is no recording
[[nodiscard]] inline membrane::Recording<double> read(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    if (!file) throw std::runtime_error("cannot read " + path.string());
    return membrane::read_recording<double>(file);
}

/// The recording, and beside it a table, `path`.csv.
/// @throws std::runtime_error for a file that cannot be written
inline void save(const std::filesystem::path& path, const membrane::Recording<double>& recording) {
    std::ofstream file(path, std::ios::binary), table(path.string() + ".csv");
    write_recording(file, recording);
    write_csv(table, recording);
    if (!file.flush() || !table.flush()) throw std::runtime_error("cannot write " + path.string());
}

}  // namespace examples
