// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstddef>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

/// Tables of tests/data: column names in the first line, then rows; no quotes, no comments.
///
///     for (const auto& row : test::reference_table("equilibria.csv")) {
///         CAPTURE(row.line());
///         const double k = row.number("k");
namespace test {

class ReferenceRow {
  public:
    ReferenceRow(const std::vector<std::string>& names, const std::string& line) : names_(names), line_(line) {
        std::istringstream text(line);
        for (std::string field; std::getline(text, field, ',');) fields_.push_back(field);
        if (fields_.size() != names_.size()) throw std::runtime_error("a row of another length: " + line);
    }

    const std::string& line() const { return line_; }
    const std::string& text(const std::string& name) const {
        const auto column = std::find(names_.begin(), names_.end(), name);
        if (column == names_.end()) throw std::runtime_error("no column " + name);
        return fields_[static_cast<std::size_t>(column - names_.begin())];
    }
    bool given(const std::string& name) const { return !text(name).empty(); }
    double number(const std::string& name) const { return std::stod(text(name)); }
    int integer(const std::string& name) const { return std::stoi(text(name)); }

  private:
    std::vector<std::string> names_, fields_;
    std::string line_;
};

inline std::vector<ReferenceRow> reference_table(const std::string& file_name) {
    std::ifstream file(MEMBRANE_TEST_DATA "/" + file_name);
    std::vector<std::string> names;
    std::vector<ReferenceRow> rows;
    for (std::string line; std::getline(file, line);) {
        if (!names.empty()) {
            rows.emplace_back(names, line);
            continue;
        }
        std::istringstream text(line);
        for (std::string name; std::getline(text, name, ',');) names.push_back(name);
    }
    if (rows.empty()) throw std::runtime_error("no rows in " + file_name);
    return rows;
}

}  // namespace test
