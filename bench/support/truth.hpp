// SPDX-License-Identifier: MIT
#pragma once

#include <sys/resource.h>

#include <cstddef>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "comparison.hpp"

/// What the scenes of the comparison with CalculiX have in common.
namespace bench::truth {

/// How fine the meshes are, and where the other program works.
struct Effort {
    std::filesystem::path folder;
    int rings = 28;   ///< of our discs: 2,437 vertices
    int across = 4;   ///< quads along a side of the other program's core
    int loads = 100;  ///< at most

    [[nodiscard]] std::vector<double> some(std::vector<double> all) const {
        if (all.size() > static_cast<std::size_t>(loads)) all.resize(static_cast<std::size_t>(loads));
        return all;
    }
    [[nodiscard]] std::string rings_name() const { return std::to_string(1 + 3 * rings * (rings + 1)) + " vertices"; }
};

/// Processor time of this process and of those it waited for [s].
[[nodiscard]] inline double processor_seconds() {
    double sum = 0;
    for (const auto who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
        rusage usage{};
        getrusage(who, &usage);
        sum += static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
               1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
    }
    return sum;
}

/// The column of `solve(size)` on a mesh of this size and on one of half of it, with the time on the first.
template <class Solve>
[[nodiscard]] Column compared(const std::string& name, int size, Solve solve) {
    Column column{.name = name, .values = {}};
    column.coarse = solve(size / 2);
    const double begin = processor_seconds();
    column.values = solve(size);
    column.seconds = processor_seconds() - begin;
    return column;
}

/// The column of `solve()`, on one mesh, with the time.
template <class Solve>
[[nodiscard]] Column single(const std::string& name, Solve solve) {
    const double begin = processor_seconds();
    Column column{.name = name, .values = solve()};
    column.seconds = processor_seconds() - begin;
    return column;
}

/// `value(i)` for each load.
template <class Value>
[[nodiscard]] std::vector<double> collected(const std::vector<double>& loads, Value value) {
    std::vector<double> values;
    for (std::size_t i = 0; i < loads.size(); ++i) values.push_back(value(static_cast<int>(i)));
    return values;
}

}  // namespace bench::truth
