// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

/// The command line, the same for all examples: `--help` says what the program does and takes; a wrong option, a wrong
/// file or refused input end in one line on stderr and exit code 2.
///
///     CommandLine command("Presses a sphere.");
///     double depth = 1e-3;
///     command.add("--depth", depth, "how deep [m]");
///     return command.run(argc, argv, [&] { press(depth); });
namespace examples {

/// Each option is read into the value it was added with, which the help shows as its default.
class CommandLine {
  public:
    explicit CommandLine(const std::string& purpose);
    ~CommandLine();

    void add(const std::string& name, std::string& value, const std::string& what);
    void add(const std::string& name, std::filesystem::path& value, const std::string& what);
    void add(const std::string& name, double& value, const std::string& what);
    void add(const std::string& name, int& value, const std::string& what);
    void add_within(const std::string& name, double& value, double least, double most, const std::string& what);
    void add_word(const std::string& name, std::string& value, const std::vector<std::string>& words,
                  const std::string& what);
    /// A file that exists.
    void add_file(const std::string& name, std::string& file, const std::string& what);
    void add_two_files(const std::string& name, std::vector<std::string>& files, const std::string& what);
    void add_flag(const std::string& name, const std::function<void()>& act, const std::string& what);

    /// Reads the command line into the options and runs the program; returns the exit code.
    [[nodiscard]] int run(int argc, char** argv, const std::function<void()>& program);
    /// Reads the command line and runs the preparation of the program; if that fails, ends the program.
    void run_first(int argc, char** argv, const std::function<void()>& first);

  private:
    struct Parser;  // its header is long: it is compiled once, for all examples
    std::unique_ptr<Parser> parser_;
};

}  // namespace examples
