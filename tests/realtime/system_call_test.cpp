// SPDX-License-Identifier: MIT
#include <csignal>
#include <cstdlib>
#include <vector>

#include <sys/syscall.h>
#include <unistd.h>

#include <membrane/replay/recording.hpp>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/child_process.hpp"
#include "support/haptic_loop.hpp"
#include "support/system_call_guard.hpp"
#include "support/torn_loop.hpp"
#include "support/whole_loop.hpp"

namespace {

/// How a process ends that does `act` without being allowed to call the system.
template <class Act>
test::ChildResult without_system_calls(Act act) {
    return test::in_child([&] {
        test::forbid_system_calls();
        act();
    });
}

}  // namespace

TEST_CASE("the guard kills whatever calls the system", "[system_call]") {
    CHECK(without_system_calls([] {}).signal == 0);
    CHECK(without_system_calls([] { syscall(SYS_getpid); }).signal == SIGSYS);
    CHECK(without_system_calls([] { sleep(1); }).signal == SIGSYS);
    CHECK(without_system_calls([] {
              void* volatile large = std::malloc(100'000'000);  // glibc asks the system
              std::free(large);
          }).signal == SIGSYS);
}

namespace {

template <class Loop>
void check_without_system_calls(int ticks) {
    Loop loop(1);
    const auto child = without_system_calls([&] {
        for (int i = 0; i < ticks; ++i) loop.tick();
        if (!loop.x.allFinite()) std::abort();
    });
    CHECK(child.signal == 0);
    CHECK(child.code == 0);
}

}  // namespace

TEST_CASE("a million ticks do not call the system", "[system_call]") {
    check_without_system_calls<test::WholeLoop<double>>(cases(30'000, 1'000'000));
}

TEMPLATE_TEST_CASE("a million ticks of the complete loop of a hand do not call the system, whatever goes wrong",
                   "[system_call]", TEST_SCALARS) {
    test::HapticLoop<TestType> loop(10);
    test::FaultInjector faults(11);
    const auto child = without_system_calls([&] {
        for (int i = 0; i < cases(6'000, 500'000); ++i) loop.tick(i % 2'000 < 1'000 ? test::Fault() : faults.next());
        if (!loop.x.allFinite() || !loop.drawn_right || loop.solves == 0) std::abort();
    });
    CHECK(child.signal == 0);
    CHECK(child.code == 0);
}

TEMPLATE_TEST_CASE("the loop of a membrane that tears off its body does not call the system", "[system_call]",
                   TEST_SCALARS) {
    test::TearingHand<TestType> hand(12);
    test::TornLoop<TestType> loop;
    const auto child = without_system_calls([&] {
        for (int i = 0; i < cases(3'000, 100'000); ++i) loop.tick(hand.next());
        if (!loop.x.allFinite() || !loop.drawn_right || (loop.splits == 0 && !cases_are_slow)) std::abort();
    });
    CHECK(child.signal == 0);
    CHECK(child.code == 0);
}

TEST_CASE("neither a recorder, full or not, nor a replay calls the system", "[system_call]") {
    membrane::Recorder<double> recorder(100, 12);
    membrane::ReplayDevice<double> replay({.ticks = std::vector<membrane::RecordedTick<double>>(100)});
    const auto child = without_system_calls([&] {
        for (int i = 0; i < 150; ++i) recorder.add({}, {1, 2, 3});
        while (replay.running()) {
            const auto tool = replay.read();
            replay.write(tool.position);
        }
        if (recorder.missed() != 50 || replay.differing() != 0) std::abort();
    });
    CHECK(child.signal == 0);
    CHECK(child.code == 0);
}

TEMPLATE_PRODUCT_TEST_CASE("nor do the ticks of other loops", "[system_call]", (test::WholeLoop, test::OddLoop),
                           (TEST_SCALARS)) {
    check_without_system_calls<TestType>(cases(5'000));
}
