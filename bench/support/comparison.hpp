// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

/// Tables of one quantity by load, by the other program and by the library.
///
///     bench::Comparison table{.key = "pressure", .title = "...", .load = "Pa", .quantity = "mm", .loads = loads};
///     table.reference = {"CalculiX", deflections, coarse_deflections, seconds};
///     table.ours = {{"2,437 vertices", ...}};
///     table.print();
namespace bench {

/// One column.
struct Column {
    std::string name;
    std::vector<double> values;
    std::vector<double> coarse = {};  ///< on a mesh of twice the edge length
    double seconds = 0;

    /// The change from the coarse mesh, relative; NaN without it.
    [[nodiscard]] double mesh_change(std::size_t i) const {
        return coarse.empty() ? std::numeric_limits<double>::quiet_NaN() : coarse[i] / values[i] - 1;
    }
};

/// The first columns of `ours` are those that the bound is for; in the others an assumption is switched.
struct Comparison {
    std::string key, title, load, quantity;
    double bound;             ///< of the relative difference
    double bound_from = 0;    ///< for loads of at least this
    std::size_t bounded = 1;  ///< number of columns that the bound is for
    std::vector<double> loads;
    Column reference = {};
    std::vector<Column> ours = {};

    [[nodiscard]] double difference(const Column& column, std::size_t i) const {
        return column.values[i] / reference.values[i] - 1;
    }
    /// The largest difference where the bound counts.
    [[nodiscard]] double largest_difference() const;
    /// Of one column, where the bound counts.
    [[nodiscard]] double largest_difference(const Column& column) const;
    /// A row of the table of all scenes: difference, bound, and the other column that differs most.
    void print_summary(std::FILE* file) const;
    /// As a Markdown table: differences and changes in percent.
    void print(std::FILE* file) const;
    void print_rows(std::FILE* file) const;
    void write_tsv(const std::string& path) const;
};

inline double Comparison::largest_difference(const Column& column) const {
    double largest = 0;
    for (std::size_t i = 0; i < loads.size(); ++i) {
        const double found = difference(column, i);
        if (loads[i] > bound_from * (1 - 1e-9) && !(std::abs(found) <= std::abs(largest))) largest = found;
    }
    return largest;
}

inline double Comparison::largest_difference() const {
    double largest = 0;
    for (std::size_t c = 0; c < bounded; ++c) {
        const double found = largest_difference(ours[c]);
        if (!(std::abs(found) <= std::abs(largest))) largest = found;
    }
    return largest;
}

inline void Comparison::print_summary(std::FILE* file) const {
    const double largest = largest_difference();
    const char* const mark = std::abs(largest) <= bound ? "" : "**";
    std::fprintf(file, "| %s | %s%+.2g %%%s | %g %% |", title.c_str(), mark, 100 * largest, mark, 100 * bound);
    std::size_t other = bounded;
    for (std::size_t c = bounded; c < ours.size(); ++c) {
        if (std::abs(largest_difference(ours[c])) > std::abs(largest_difference(ours[other]))) other = c;
    }
    if (other < ours.size()) {
        std::fprintf(file, " %+.2g %%: %s", 100 * largest_difference(ours[other]), ours[other].name.c_str());
    }
    std::fprintf(file, " |\n");
}

inline void Comparison::print(std::FILE* file) const {
    const double largest = largest_difference();
    std::fprintf(file, "\n### %s\n\nBound %g %%: %s, largest difference %+.2f %%. ", title.c_str(), 100 * bound,
                 std::abs(largest) <= bound ? "kept" : "missed", 100 * largest);
    std::fprintf(file, "Time: CalculiX %.1f s", reference.seconds);
    for (const Column& column : ours) std::fprintf(file, ", %s %.1f s", column.name.c_str(), column.seconds);
    std::fprintf(file, ".\n\n| %s | CalculiX, %s | its mesh |", load.c_str(), quantity.c_str());
    for (const Column& column : ours) {
        std::fprintf(file, " %s |%s", column.name.c_str(), column.coarse.empty() ? "" : " its mesh |");
    }
    std::fprintf(file, "\n|---|---|---|");
    for (const Column& column : ours) std::fprintf(file, "---|%s", column.coarse.empty() ? "" : "---|");
    std::fprintf(file, "\n");
    print_rows(file);
    std::fflush(file);
}

inline void Comparison::print_rows(std::FILE* file) const {
    const auto percent = [&](double part) {
        if (std::isnan(part)) {
            std::fprintf(file, " none |");
        } else {
            std::fprintf(file, " %+.2f %% |", 100 * part);
        }
    };
    for (std::size_t i = 0; i < loads.size(); ++i) {
        std::fprintf(file, "| %g | %.5g |", loads[i], reference.values[i]);
        percent(reference.mesh_change(i));
        for (const Column& column : ours) {
            percent(difference(column, i));
            if (!column.coarse.empty()) percent(column.mesh_change(i));
        }
        std::fprintf(file, "\n");
    }
}

inline void Comparison::write_tsv(const std::string& path) const {
    std::ofstream file(path);
    file.precision(8);
    file << "load\treference";
    for (const Column& column : ours) file << '\t' << column.name;
    file << '\n';
    for (std::size_t i = 0; i < loads.size(); ++i) {
        file << loads[i] << '\t' << reference.values[i];
        for (const Column& column : ours) file << '\t' << column.values[i];
        file << '\n';
    }
}

}  // namespace bench
