// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstdlib>
#include <exception>
#include <functional>
#include <iostream>
#include <string>

#include <CLI/CLI.hpp>

/// The command line, the same for all examples: `--help` says what the program does and takes; a wrong option, a wrong
/// file or refused input end in one line on stderr and exit code 2.
///
///     CLI::App app("Presses a sphere.");
///     double depth = 1e-3;
///     app.add_option("--depth", depth, "how deep [m]");
///     return examples::run(app, argc, argv, [&] { press(depth); });
namespace examples {

/// Reads the command line into `app`'s options and runs the program; returns the exit code.
[[nodiscard]] inline int run(CLI::App& app, int argc, char** argv, const std::function<void()>& program) {
    const std::string path = argv[0];
    app.name(path.substr(path.find_last_of('/') + 1));
    std::string wrong;
    try {
        app.parse(argc, argv);
        program();
        return 0;
    } catch (const CLI::CallForHelp&) {
        std::cout << app.help();
        return 0;
    } catch (const CLI::ParseError& error) {
        wrong = std::string(error.what()) + " (see --help)";
    } catch (const std::exception& error) {
        wrong = error.what();
    }
    std::replace(wrong.begin(), wrong.end(), '\n', ' ');
    std::cerr << app.get_name() << ": " << wrong << '\n';
    return 2;
}

/// Reads the command line and runs what comes before the program itself: ends the program unless that has been done.
inline void run_first(CLI::App& app, int argc, char** argv, const std::function<void()>& first) {
    bool done = false;
    const int code = run(app, argc, argv, [&] {
        first();
        done = true;
    });
    if (!done) std::exit(code);
}

}  // namespace examples
