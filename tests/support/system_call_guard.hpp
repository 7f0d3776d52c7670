// SPDX-License-Identifier: MIT
#pragma once

#include <stdexcept>

#include <seccomp.h>

/// From here on, a process that calls the system is killed, by SIGSYS; only its end is allowed. For child processes:
/// there is no return.
///
///     const auto child = test::in_child([] { test::forbid_system_calls(); solver.step(...); });
///     CHECK(child.signal == 0);
namespace test {

inline void forbid_system_calls() {
    const scmp_filter_ctx filter = seccomp_init(SCMP_ACT_KILL_PROCESS);
    if (filter == nullptr || seccomp_rule_add(filter, SCMP_ACT_ALLOW, SCMP_SYS(exit_group), 0) != 0 ||
        seccomp_load(filter) != 0) {
        throw std::runtime_error("seccomp is not to be had");
    }
}

}  // namespace test
