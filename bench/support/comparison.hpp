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

/// How much a value differs from that of `base`, relative.
[[nodiscard]] inline double difference(const Column& column, const Column& base, std::size_t i) {
    return column.values[i] / base.values[i] - 1;
}

/// The first columns of `ours` are those that the bound is for; in the others an assumption is switched.
struct Comparison {
    std::string key, title, load, quantity;
    double bound;             ///< of the relative difference
    double bound_from = 0;    ///< for loads of at least this
    std::size_t bounded = 1;  ///< number of columns that the bound is for
    std::vector<double> loads;
    Column reference = {};
    std::vector<Column> ours = {};
    Column switched = {};        ///< the other program with an assumption of ours, if that explains the difference
    std::string explained = {};  ///< the column of ours that would explain a difference beyond the bound

    /// The largest difference from `base` where the bound counts.
    [[nodiscard]] double largest_difference(const Column& base) const;
    /// Of one column.
    [[nodiscard]] double largest_difference(const Column& column, const Column& base) const;
    /// A row of the table of all scenes: difference, bound, and the difference with an assumption switched.
    void print_summary(std::FILE* file) const;
    /// As a Markdown table: differences and changes in percent.
    void print(std::FILE* file) const;
    void print_head(std::FILE* file) const;
    void print_rows(std::FILE* file) const;
    /// The column that explains a difference beyond the bound, or that which differs most; null if all are bounded.
    [[nodiscard]] const Column* other_column() const;
    void write_tsv(const std::string& path) const;
};

inline double Comparison::largest_difference(const Column& column, const Column& base) const {
    double largest = 0;
    for (std::size_t i = 0; i < loads.size(); ++i) {
        const double found = difference(column, base, i);
        if (loads[i] > bound_from * (1 - 1e-9) && !(std::abs(found) <= std::abs(largest))) largest = found;
    }
    return largest;
}

inline double Comparison::largest_difference(const Column& base) const {
    double largest = 0;
    for (std::size_t c = 0; c < bounded; ++c) {
        const double found = largest_difference(ours[c], base);
        if (!(std::abs(found) <= std::abs(largest))) largest = found;
    }
    return largest;
}

inline const Column* Comparison::other_column() const {
    const bool is_missed = !(std::abs(largest_difference(reference)) <= bound);
    const Column* other = nullptr;
    double largest = -1;
    for (std::size_t c = bounded; c < ours.size(); ++c) {
        if (is_missed && ours[c].name == explained) return &ours[c];
        const double found = std::abs(largest_difference(ours[c], reference));
        if (found > largest) other = &ours[c], largest = found;
    }
    return other;
}

inline void Comparison::print_summary(std::FILE* file) const {
    const double largest = largest_difference(reference);
    const char* const mark = std::abs(largest) <= bound ? "" : "**";
    std::fprintf(file, "| %s | %s%+.2g %%%s | %g %% |", title.c_str(), mark, 100 * largest, mark, 100 * bound);
    if (!switched.values.empty()) {
        std::fprintf(file, " %+.2g %% from %s", 100 * largest_difference(switched), switched.name.c_str());
    } else if (const Column* const other = other_column()) {
        std::fprintf(file, " %+.2g %%: %s", 100 * largest_difference(*other, reference), other->name.c_str());
    }
    std::fprintf(file, " |\n");
}

inline void Comparison::print(std::FILE* file) const {
    const double largest = largest_difference(reference);
    std::fprintf(file, "\n### %s\n\nBound %g %%: %s, largest difference %+.2f %%. ", title.c_str(), 100 * bound,
                 std::abs(largest) <= bound ? "kept" : "missed", 100 * largest);
    std::fprintf(file, "Time: CalculiX %.1f s", reference.seconds);
    for (const Column& column : ours) std::fprintf(file, ", %s %.1f s", column.name.c_str(), column.seconds);
    std::fprintf(file, ".\n\n");
    print_head(file);
    print_rows(file);
    std::fflush(file);
}

inline void Comparison::print_head(std::FILE* file) const {
    std::vector<std::string> names{load, "CalculiX, " + quantity, "its mesh"};
    for (const Column& column : ours) {
        names.push_back(column.name);
        if (!column.coarse.empty()) names.emplace_back("its mesh");
    }
    if (!switched.values.empty()) {
        names.insert(names.end(), {switched.name + ", " + quantity, "its mesh"});
        for (std::size_t c = 0; c < bounded; ++c) names.push_back(ours[c].name + " from that");
    }
    for (const std::string& name : names) std::fprintf(file, "| %s ", name.c_str());
    std::fprintf(file, "|\n");
    for (std::size_t i = 0; i < names.size(); ++i) std::fprintf(file, "|---");
    std::fprintf(file, "|\n");
}

inline void Comparison::print_rows(std::FILE* file) const {
    const auto percent = [&](double part) {
        if (std::isnan(part)) {
            std::fprintf(file, " none |");
        } else {
            std::fprintf(file, " %+.2f %% |", 100 * part);
        }
    };
    const auto base = [&](const Column& column, std::size_t i) {
        std::fprintf(file, " %.5g |", column.values[i]);
        percent(column.mesh_change(i));
    };
    for (std::size_t i = 0; i < loads.size(); ++i) {
        std::fprintf(file, "| %g |", loads[i]);
        base(reference, i);
        for (const Column& column : ours) {
            percent(difference(column, reference, i));
            if (!column.coarse.empty()) percent(column.mesh_change(i));
        }
        if (!switched.values.empty()) {
            base(switched, i);
            for (std::size_t c = 0; c < bounded; ++c) percent(difference(ours[c], switched, i));
        }
        std::fprintf(file, "\n");
    }
}

inline void Comparison::write_tsv(const std::string& path) const {
    std::ofstream file(path);
    file.precision(8);
    file << "load\treference";
    for (const Column& column : ours) file << '\t' << column.name;
    if (!switched.values.empty()) file << '\t' << switched.name;
    file << '\n';
    for (std::size_t i = 0; i < loads.size(); ++i) {
        file << loads[i] << '\t' << reference.values[i];
        for (const Column& column : ours) file << '\t' << column.values[i];
        if (!switched.values.empty()) file << '\t' << switched.values[i];
        file << '\n';
    }
}

}  // namespace bench
