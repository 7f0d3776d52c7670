// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

/// The tables of the report.
namespace bench {

/// One line of a table: a benchmark in all columns.
struct Row {
    enum Kind { time, share, gain, rate, each, counter, percent };

    std::string name, benchmark;
    Kind kind = time;
    std::string other =
        {};  ///< share, gain: the benchmark to compare with; each, counter, percent: a counter of this one
    std::string unit = "s";
};

struct Table {
    std::string topic, key, title;
    std::vector<Row> rows;
    std::string column = "vertices";
    std::vector<int> columns = {162, 642, 2562, 10242};
    std::string scene = {};  ///< end of the benchmark's name in all columns
};

}  // namespace bench
