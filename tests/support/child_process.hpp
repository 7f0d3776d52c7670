// SPDX-License-Identifier: MIT
#pragma once

#include <csignal>
#include <cstdio>
#include <string>

#include <sys/wait.h>
#include <unistd.h>

namespace test {

/// How a child process ended: by which signal (0: by none), with which exit code, and what it wrote to stderr.
struct ChildResult {
    int signal = 0;
    int code = 0;
    std::string error_output;
};

/// Runs `call` in a child process, which exits with 0 if `call` returns.
///
///     CHECK(test::in_child([] { MEMBRANE_ASSERT(1 == 2); }).signal == SIGABRT);
template <class Call>
ChildResult in_child(Call call) {
    int pipe_ends[2];
    if (pipe(pipe_ends) != 0) return {.code = -1, .error_output = "no pipe"};
    std::fflush(nullptr);
    const pid_t child = fork();
    if (child == 0) {
        for (const int number : {SIGABRT, SIGSEGV, SIGFPE, SIGILL}) std::signal(number, SIG_DFL);  // not Catch2's
        dup2(pipe_ends[1], STDERR_FILENO);
        close(pipe_ends[0]);
        close(pipe_ends[1]);
        call();
        std::fflush(nullptr);
        _exit(0);
    }
    close(pipe_ends[1]);
    ChildResult result;
    char bytes[256];
    for (ssize_t count; (count = read(pipe_ends[0], bytes, sizeof bytes)) > 0;) {
        result.error_output.append(bytes, static_cast<std::size_t>(count));
    }
    close(pipe_ends[0]);
    int status = 0;
    waitpid(child, &status, 0);
    if (WIFSIGNALED(status)) result.signal = WTERMSIG(status);
    if (WIFEXITED(status)) result.code = WEXITSTATUS(status);
    return result;
}

}  // namespace test
