// SPDX-License-Identifier: MIT
#include <fstream>
#include <string>

#include <benchmark/benchmark.h>

// The main function of Google Benchmark, which also records machine, compiler and flags.

namespace {

std::string processor() {
    std::ifstream file("/proc/cpuinfo");
    for (std::string line; std::getline(file, line);) {
        if (line.rfind("model name", 0) == 0) return line.substr(line.find(": ") + 2);
    }
    return "unknown processor";
}

#ifdef __clang__
constexpr const char* compiler = "clang++ " __clang_version__;
#else
constexpr const char* compiler = "g++ " __VERSION__;
#endif

}  // namespace

int main(int argc, char** argv) {
    benchmark::AddCustomContext("processor", processor());
    benchmark::AddCustomContext("compiler", compiler);
    benchmark::AddCustomContext("flags", BENCH_FLAGS);
    benchmark::Initialize(&argc, argv);
    if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
    benchmark::RunSpecifiedBenchmarks();
    benchmark::Shutdown();
}
