// SPDX-License-Identifier: MIT
#include <membrane/replay/recording_file.hpp>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <locale>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"
#include "support/wild_ticks.hpp"

using namespace membrane;
using test::Random;

namespace {

constexpr std::size_t header_size = 32;

template <class S>
constexpr std::size_t tick_size = 14 * sizeof(S) + 5;

template <Real S>
std::string written(const Recording<S>& recording) {
    std::ostringstream file;
    write_recording(file, recording);
    return file.str();
}

template <Real S = double>
std::string refused(const std::string& bytes, Index vertices = no_index) {
    std::istringstream file(bytes);
    return test::refusal([&] { static_cast<void>(read_recording<S>(file, vertices)); });
}

/// The definition of CRC-32 bit by bit: the remainder of a division of polynomials.
std::uint32_t crc(const std::string& bytes) {
    std::uint32_t remainder = 0xffffffff;
    for (const char c : bytes) {
        for (unsigned bit = 0; bit < 8; ++bit) {
            const bool in = (static_cast<unsigned char>(c) >> bit & 1U) != 0;
            const bool odd = ((remainder & 1U) != 0) != in;
            remainder = remainder >> 1U ^ (odd ? 0xedb88320U : 0U);
        }
    }
    return ~remainder;
}

std::string bytes_of(std::uint64_t value, int count) {
    std::string bytes;
    for (int i = 0; i < count; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xffU);
    return bytes;
}

const std::string magic("\x89MREC\r\n\x1a");

std::string header(std::uint64_t version, std::uint64_t size, std::uint64_t vertices, std::uint64_t ticks) {
    const auto all = magic + bytes_of(version, 4) + bytes_of(size, 4) + bytes_of(vertices, 4) + bytes_of(ticks, 8);
    return all + bytes_of(crc(all), 4);
}

struct German : std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
    char do_thousands_sep() const override { return '.'; }
    std::string do_grouping() const override { return "\3"; }
};

}  // namespace

TEMPLATE_TEST_CASE("a recording comes back from its file to the bit", "[recording]", TEST_SCALARS) {
    using S = TestType;
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto recording = test::wild_recording<S>(random, random.index(30));
        const auto bytes = written(recording);
        REQUIRE(bytes.size() == header_size + recording.ticks.size() * tick_size<S>);
        std::istringstream file(bytes);
        REQUIRE(test::identical(read_recording<S>(file, recording.vertex_count), recording));
        std::istringstream again(bytes);
        REQUIRE(test::identical(read_recording<S>(again), recording));
    }
}

TEST_CASE("the bytes of a recording are those of its description", "[recording]") {
    REQUIRE(crc("123456789") == 0xcbf43926);  // the published check value
    Recording<float> recording{.vertex_count = 642, .ticks = std::vector<RecordedTick<float>>(2)};
    auto& tick = recording.ticks[1];
    tick.tool = {{1, 2, 3}, {4, 5, 6}, 7, {8, 9, 10}, 11, true};
    tick.force = {12, 13, 14};
    const std::string numbers =
        "0000803f 00000040 00004040 00008040 0000a040 0000c040 0000e040 "
        "00000041 00001041 00002041 00003041 00004041 00005041 00006041 ";  // 1 to 14
    std::string second;
    for (std::size_t i = 0; i + 1 < numbers.size(); ++i) {
        if (numbers[i] == ' ') continue;
        second += static_cast<char>(std::stoi(numbers.substr(i++, 2), nullptr, 16));
    }
    second += '\1';
    const std::string head = header(1, 4, 642, 2), first(14 * 4 + 1, '\0');
    const std::string summed = head.substr(0, header_size - 4);
    CHECK(written(recording) ==
          head + first + bytes_of(crc(summed + first), 4) + second + bytes_of(crc(summed + first + second), 4));
}

TEST_CASE("snapshots follow the ticks, each before one of them, in their order", "[recording]") {
    const auto with = [](std::size_t first, std::size_t second) {
        return written(Recording<double>{.vertex_count = 642,
                                         .ticks = std::vector<RecordedTick<double>>(2),
                                         .snapshots = {{first, {std::byte{5}, std::byte{6}}}, {second, {}}}});
    };
    std::string expected = header(2, 8, 642, 2), summed = expected.substr(0, header_size - 4);
    const std::string tick(14 * 8 + 1, '\0');
    for (const std::string& part :
         {tick, tick, bytes_of(2, 8), bytes_of(0, 8) + bytes_of(2, 8) + "\5\6", bytes_of(1, 8) + bytes_of(0, 8)}) {
        summed += part;
        expected += part + bytes_of(crc(summed), 4);
    }
    CHECK(with(0, 1) == expected);
    std::istringstream file(expected);
    const auto read = read_recording<double>(file).snapshots;
    REQUIRE(read.size() == 2);
    CHECK((read[0].tick == 0 && read[0].state == std::vector{std::byte{5}, std::byte{6}}));
    CHECK((read[1].tick == 1 && read[1].state.empty()));
    CHECK(refused(with(1, 1)) == "");
    CHECK(refused(with(1, 0)) == "read_recording: snapshot 1 must be before a tick from 1 to 2, got 0");
    CHECK(refused(with(2, 2)) == "read_recording: snapshot 0 must be before a tick from 0 to 2, got 2");
}

TEST_CASE("a header that is not right is refused by name", "[recording][bad]") {
    const std::string name = "read_recording: ";
    const auto good = header(1, 8, 642, 0);
    CHECK(refused(good) == "");
    CHECK(refused(good, 642) == "");
    CHECK(refused(good, 162) == name + "the membrane recorded must have 162 vertices, got 642");
    CHECK(refused<float>(good) == name + "numbers must be of 4 bytes, got 8");
    CHECK(refused(header(1, 4, 642, 0)) == name + "numbers must be of 8 bytes, got 4");
    CHECK(refused(header(3, 8, 642, 0)) == name + "version must be 1 or 2, got 3");
    CHECK(refused(header(0x01000000, 8, 642, 0)) ==
          name + "version must be 1 or 2, got 16777216");  // the other byte order
    CHECK(refused(header(1, 8, 0x80000000U, 0)) == name + "vertices must be at most 2147483647, got 2147483648");
    CHECK(refused("") == name + "the file must go on, but ends after 0 bytes, in the header");
    CHECK(refused("time,x,y,z\n0,0,0,0\n") == name + "byte 0 of a recording must be 137, got 116");
    std::string as_text = good;  // line ends changed in transfer
    as_text.erase(5, 1);
    CHECK(refused(as_text) == name + "byte 5 of a recording must be 13, got 10");
    for (const std::size_t at : {16U, 20U, 27U, 28U, 31U}) {
        auto damaged = good;
        damaged[at] = static_cast<char>(damaged[at] ^ 1);
        CAPTURE(at);
        CHECK_THAT(refused(damaged), ContainsSubstring(name + "checksum of the header must be "));
    }
    std::istringstream broken(good);
    broken.setstate(std::ios::badbit);  // as a file that cannot be opened
    CHECK(test::refusal([&] { static_cast<void>(read_recording<double>(broken)); }) ==
          name + "the file must go on, but ends after 0 bytes, in the header");
}

TEST_CASE("a claim of more ticks than any memory holds ends with the file", "[recording][bad]") {
    CHECK(refused(header(1, 8, 642, ~std::uint64_t{0})) ==
          "read_recording: the file must go on, but ends after 32 bytes, in tick 0 of 18446744073709551615");
}

TEST_CASE("a tick that is not right is refused with its number", "[recording][bad]") {
    Random random(1);
    const auto bytes = written(test::wild_recording<double>(random, 5));
    constexpr std::size_t size = tick_size<double>;
    auto swapped = bytes;  // whole ticks, each with its checksum, in another order
    std::swap_ranges(swapped.begin() + header_size + size, swapped.begin() + header_size + 2 * size,
                     swapped.begin() + header_size + 2 * size);
    CHECK_THAT(refused(swapped), ContainsSubstring("read_recording: checksum of tick 1 of 5 must be "));
    auto lost = bytes;
    lost.erase(header_size + 2 * size, size);
    CHECK_THAT(refused(lost), ContainsSubstring("read_recording: checksum of tick 2 of 5 must be "));
    CHECK(refused(bytes + '\0') == "read_recording: the file must end after tick 4 of 5, but goes on beyond 617 bytes");
    std::string tick(14 * 8 + 1, '\2');  // a valid checksum over a flag that is none
    const auto head = header(1, 8, 1, 1);
    tick += bytes_of(crc(head.substr(0, header_size - 4) + tick), 4);
    CHECK(refused(head + tick) == "read_recording: grasping must be 0 or 1, got 2");
}

TEMPLATE_TEST_CASE("any bit of a recording that is flipped, and any cut, is refused", "[recording][bad]",
                   TEST_SCALARS) {
    using S = TestType;
    Random random(2);
    auto recording = test::wild_recording<S>(random, 4);
    recording.snapshots = {{1, {std::byte{5}, std::byte{6}}}, {3, {}}};
    const auto bytes = written(recording);
    for (std::size_t at = 0; at < bytes.size(); ++at) {
        CAPTURE(at);
        auto damaged = bytes;
        damaged[at] = static_cast<char>(damaged[at] ^ 1 << random.index(8));
        REQUIRE_THAT(refused<S>(damaged), ContainsSubstring("read_recording: "));
        REQUIRE_THAT(refused<S>(bytes.substr(0, at)),
                     ContainsSubstring("ends after " + std::to_string(at) + " bytes, in "));
    }
}

TEST_CASE("random damage to a recording is refused", "[recording][bad]") {
    for (int seed = 1; seed <= cases(2000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto bytes = written(test::wild_recording<float>(random, random.index(5)));
        auto damaged = bytes;
        const auto place = [&] { return static_cast<std::size_t>(random.index(static_cast<Index>(damaged.size()))); };
        for (Index n = 1 + random.index(4); n > 0 && !damaged.empty(); --n) {
            const auto byte = static_cast<char>(random.index(256));
            if (random.chance(0.4)) damaged[place()] = byte;
            if (random.chance(0.2)) damaged.insert(place(), 1, byte);
            if (random.chance(0.2)) damaged.erase(place(), static_cast<std::size_t>(1 + random.index(70)));
        }
        REQUIRE((refused<float>(damaged).empty() == (damaged == bytes)));
    }
}

TEMPLATE_TEST_CASE("every number of a recording can be read from its table", "[recording]", TEST_SCALARS) {
    using S = TestType;
    Random random(3);
    Recording<S> recording{.vertex_count = 12};
    for (int i = 0; i < 50; ++i) {
        std::array<S, 14> numbers{};
        for (S& number : numbers) number = random.number<S>(-1, 1) / S(3e-4);
        recording.ticks.push_back(detail::tick_of(numbers, random.chance(0.5)));
    }
    std::ostringstream text;
    text.imbue(std::locale(std::locale::classic(), new German));
    text.precision(2);
    write_csv(text, recording);
    std::istringstream lines(text.str());
    std::string line;
    REQUIRE(std::getline(lines, line));
    CHECK(std::count(line.begin(), line.end(), ',') == 14);
    for (const auto& tick : recording.ticks) {
        REQUIRE(std::getline(lines, line));
        const char* at = line.c_str();
        std::array<S, 14> numbers{};
        for (S& number : numbers) {
            char* end = nullptr;
            number = sizeof(S) == 4 ? static_cast<S>(std::strtof(at, &end)) : static_cast<S>(std::strtod(at, &end));
            REQUIRE(*end == ',');
            at = end + 1;
        }
        const std::string flag = at;
        REQUIRE((flag == "0" || flag == "1"));
        REQUIRE(identical(detail::tick_of(numbers, flag == "1"), tick));
    }
    CHECK_FALSE(std::getline(lines, line));
}
