// SPDX-License-Identifier: MIT
#include "support/command_line.hpp"

#include <algorithm>
#include <cstdlib>
#include <exception>
#include <iostream>

#include <CLI/CLI.hpp>

namespace examples {

struct CommandLine::Parser {
    explicit Parser(const std::string& purpose) : app(purpose) {}

    /// Empty defaults are not shown.
    template <class Value>
    CLI::Option* add(const std::string& name, Value& value, const std::string& what) {
        auto* option = app.add_option(name, value, what);
        if constexpr (requires { value.empty(); }) {
            if (value.empty()) return option;
        }
        return option->capture_default_str();
    }

    CLI::App app;
};

CommandLine::CommandLine(const std::string& purpose) : parser_(std::make_unique<Parser>(purpose)) {}

CommandLine::~CommandLine() = default;

void CommandLine::add(const std::string& name, std::string& value, const std::string& what) {
    parser_->add(name, value, what);
}

void CommandLine::add(const std::string& name, std::filesystem::path& value, const std::string& what) {
    parser_->add(name, value, what);
}

void CommandLine::add(const std::string& name, double& value, const std::string& what) {
    parser_->add(name, value, what);
}

void CommandLine::add(const std::string& name, int& value, const std::string& what) { parser_->add(name, value, what); }

void CommandLine::add_within(const std::string& name, double& value, double least, double most,
                             const std::string& what) {
    parser_->add(name, value, what)->check(CLI::Range(least, most));
}

void CommandLine::add_word(const std::string& name, std::string& value, const std::vector<std::string>& words,
                           const std::string& what) {
    parser_->add(name, value, what)->check(CLI::IsMember(words));
}

void CommandLine::add_file(const std::string& name, std::string& file, const std::string& what) {
    parser_->add(name, file, what)->check(CLI::ExistingFile);
}

void CommandLine::add_two_files(const std::string& name, std::vector<std::string>& files, const std::string& what) {
    parser_->add(name, files, what)->expected(2)->check(CLI::ExistingFile);
}

void CommandLine::add_flag(const std::string& name, const std::function<void()>& act, const std::string& what) {
    parser_->app.add_flag_callback(name, act, what);
}

int CommandLine::run(int argc, char** argv, const std::function<void()>& program) {
    auto& app = parser_->app;
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

void CommandLine::run_first(int argc, char** argv, const std::function<void()>& first) {
    bool done = false;
    const int code = run(argc, argv, [&] {
        first();
        done = true;
    });
    if (!done) std::exit(code);
}

}  // namespace examples
