// SPDX-License-Identifier: MIT
#include <membrane/replay/script.hpp>

#include <algorithm>
#include <cmath>
#include <locale>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace membrane;
using test::Random;

namespace {

template <class S = double>
std::vector<Waypoint<S>> read(const std::string& text) {
    std::istringstream stream(text);
    return read_script<S>(stream);
}

std::string refused(const std::string& text) {
    return test::refusal([&] { (void)read(text); });
}

bool is(const Waypoint<double>& waypoint, double time, double x, double y, double z, bool grasping) {
    return waypoint.time == time && waypoint.position == Vector3<double>(x, y, z) && waypoint.grasping == grasping;
}

const std::string name = "read_script: ";
const std::string none = name + "the script must have a line with a waypoint, got none";

std::string no_number(int line, const std::string& field) {
    return name + "line " + std::to_string(line) + " must hold finite numbers, got \"" + field + "\"";
}
std::string columns(int line, int count) {
    return name + "line " + std::to_string(line) + " must be time,x,y,z or time,x,y,z,grasping, got " +
           std::to_string(count) + " columns";
}

/// Writes 1.5 as 1,5 and 1000 as 1.000.
struct German : std::numpunct<char> {
    char do_decimal_point() const override { return ','; }
    char do_thousands_sep() const override { return '.'; }
    std::string do_grouping() const override { return "\3"; }
};

}  // namespace

TEST_CASE("a script is read line by line", "[script]") {
    const auto script = read(
        "time,x,y,z,grasping\n"
        "0,0,0,0.012\n"
        "# comes down\n"
        "\n"
        "0.25,0.001,-2e-3,+.009,1\n"
        "  \t \n"
        "5.,-0,0,1E-2,0");
    REQUIRE(script.size() == 3);
    CHECK(is(script[0], 0, 0, 0, 0.012, false));
    CHECK(is(script[1], 0.25, 0.001, -2e-3, 0.009, true));
    CHECK(is(script[2], 5, 0, 0, 0.01, false));
    CHECK(std::signbit(script[2].position.x()));
}

TEST_CASE("a script is read whatever its lines end with, and however it is spaced", "[script]") {
    for (const std::string text :
         {"0,1,2,3,1\n1,4,5,6,0\n", "0,1,2,3,1\r\n1,4,5,6,0\r\n", "0,1,2,3,1\n1,4,5,6,0", "0,1,2,3,1\r\n1,4,5,6,0",
          "0,1,2,3,1\n\r\n\n1,4,5,6,0\r\n\r\n", "\n0,1,2,3,1\n1,4,5,6,0\n# the end",
          "#\n0,1,2,3,1\r\n#\r\n1,4,5,6,0\n#", " 0, 1 ,2\t,\t3 , 1 \n1,4,5,6,0 \t\n", "time\n0,1,2,3,1\n1,4,5,6,0\n",
          "# recorded\n\ntime [s],x [m],y [m],z [m],grasping\r\n0,1,2,3,1\r\n1,4,5,6,0\r\n"}) {
        CAPTURE(text);
        const auto script = read(text);
        REQUIRE(script.size() == 2);
        CHECK(is(script[0], 0, 1, 2, 3, true));
        CHECK(is(script[1], 1, 4, 5, 6, false));
    }
}

TEST_CASE("numbers come back as they were written, to the last digit", "[script]") {
    for (int seed = 1; seed <= cases(200); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        std::ostringstream text;
        text.precision(17);
        std::vector<Waypoint<double>> expected(static_cast<std::size_t>(1 + random.index(10)));
        for (auto& waypoint : expected) {
            waypoint = {random.number(-1e3, 1e3), std::pow(10, random.number(-9.0, 3.0)) * random.vector(),
                        random.chance(0.5)};
            text << waypoint.time;
            for (int k = 0; k < 3; ++k) text << "," << waypoint.position[k];
            text << "," << waypoint.grasping << "\n";
        }
        const auto script = read(text.str());
        REQUIRE(script.size() == expected.size());
        for (std::size_t i = 0; i < script.size(); ++i) {
            const auto& p = expected[i].position;
            REQUIRE(is(script[i], expected[i].time, p.x(), p.y(), p.z(), expected[i].grasping));
        }
    }
    const auto script = read<float>("0.1,0.2,0.3,0.4,1");
    REQUIRE(script.size() == 1);
    CHECK(script[0].time == 0.1F);
    CHECK(script[0].position == Vector3<float>(0.2F, 0.3F, 0.4F));
    const std::string digits = "0." + std::string(400, '3');
    CHECK(read("0," + digits + ",0,0")[0].position.x() == 1.0 / 3);
}

TEST_CASE("a script reads the same in any locale", "[script]") {
    const std::locale before = std::locale::global(std::locale(std::locale::classic(), new German));
    const auto script = read("0.5,1.25,1000,-2e-3\n1234.5,0,0,0\n");
    const std::string comma = refused("0,1,5,0,0,0,0\n");
    std::istringstream german("0.5,1.25,1000,-2e-3\n");
    german.imbue(std::locale(std::locale::classic(), new German));
    const auto other = read_script<double>(german);
    std::locale::global(before);
    REQUIRE(script.size() == 2);
    CHECK(is(script[0], 0.5, 1.25, 1000, -2e-3, false));
    CHECK(is(script[1], 1234.5, 0, 0, 0, false));
    CHECK(comma == columns(1, 7));
    REQUIRE(other.size() == 1);
    CHECK(is(other[0], 0.5, 1.25, 1000, -2e-3, false));
}

TEST_CASE("a script with nothing in it is refused", "[script][bad]") {
    CHECK(refused("") == none);
    CHECK(refused("\n") == none);
    CHECK(refused("\r\n\r\n") == none);
    CHECK(refused("  \t\n") == none);
    CHECK(refused("time,x,y,z,grasping\n") == none);
    CHECK(refused("time,x,y,z,grasping") == none);
    CHECK(refused("# only a comment") == none);
    std::istringstream broken("0,0,0,0\n");
    broken.setstate(std::ios::badbit);  // as a file that cannot be opened
    CHECK(test::refusal([&] { (void)read_script<double>(broken); }) == none);
}

TEST_CASE("fields that are no finite numbers are refused with line and text", "[script][bad]") {
    const std::vector<std::string> fields{
        "",  " ",  "x",   "nan", "NaN", "-nan",  "inf", "-inf", "Infinity", "1e999", "-1e999", "0x10",    "1e",
        "-", "1f", "1e+", "--1", "+-1", "1.2.3", "1;2", "1 2",  "\"1\"",    ".",     "1_000",  "\xC2\xA0"};
    for (const std::string& field : fields) {
        CAPTURE(field);
        CHECK(refused("0,0,0,0\n1,0," + field + ",0,1\n") == no_number(2, field));
        CHECK(refused("0,0,0,0\n" + field + ",0,0,0,1\n") != "");
    }
    CHECK(refused("0,0,0,0\n1,0,1,5,0,0\n") == columns(2, 6));
    const std::string long_text(1000, 'a');
    CHECK(refused("0,0," + long_text + ",0\n") == no_number(1, long_text.substr(0, 40)));
    CHECK(refused("0,0,0,0\n1,0," + std::string(1, '\0') + ",0\n") != "");
    CHECK(refused("0,0,0,0\n1,0,2" + std::string(1, '\0') + "3,0\n") != "");
    CHECK(test::refusal([&] { (void)read<float>("0,1e39,0,0"); }) == no_number(1, "1e39"));
    // What is too small to distinguish from zero is zero, or refused: not something else.
    const std::string tiny = "0,1e-999,0,0\n";
    if (refused(tiny).empty()) CHECK(read(tiny)[0].position.x() == 0);
}

TEST_CASE("lines with too few or too many columns are refused with their number", "[script][bad]") {
    CHECK(refused("0\n") == columns(1, 1));
    CHECK(refused("0,0\n") == columns(1, 2));
    CHECK(refused("0,0,0\n") == columns(1, 3));
    CHECK(refused("0,0,0,0,0,0\n") == columns(1, 6));
    CHECK(refused("\n\n0,0,0\n") == columns(3, 3));
    CHECK(refused("time,x,y,z\n0,0,0,0\n1;0;0;0\n") == columns(3, 1));
    CHECK(refused("0 0 0 0\n") == columns(1, 1));
    CHECK(refused("0,0,0,0\ntime,x,y,z\n") != "");        // names stand above
    CHECK(refused("0,0,0,0\r1,0,0,0\r2,0,0,0\r") != "");  // lines that end with CR alone
    // What is cut off in the middle is not read as something else.
    const std::string whole = "0,1,2,3,1\n1,4,5,6,1\n";
    for (std::size_t length = 0; length < whole.size(); ++length) {
        const std::string part = whole.substr(0, length);
        CAPTURE(part);
        std::string last = part;
        if (const auto line = part.rfind('\n'); line != std::string::npos) last = part.substr(line + 1);
        const auto commas = std::count(last.begin(), last.end(), ',');
        const bool complete = last.empty() ? length > 0 : commas >= 3 && last.back() != ',';
        CHECK(refused(part).empty() == complete);
    }
}

TEST_CASE("a column that is begun and left empty is refused", "[script][bad]") {
    for (const std::string line : {"0,0,0,0,", "0,0,0,0,,", "0,0,0,", "0,,0,0", ",0,0,0", ",,,", ",,,,", "0,0,0,0, "}) {
        CAPTURE(line);
        CHECK_THAT(refused(line + "\n"), ContainsSubstring(name + "line 1 "));
        CHECK_THAT(refused("0,0,0,0\n" + line), ContainsSubstring(name + "line 2 "));
    }
}

TEST_CASE("grasping is 0 or 1", "[script][bad]") {
    CHECK(refused("0,0,0,0,2\n") == name + "line 1: grasping must be 0 or 1, got 2");
    CHECK(refused("0,0,0,0,0.5\n") == name + "line 1: grasping must be 0 or 1, got 0.5");
    CHECK(refused("0,0,0,0,-1\n") == name + "line 1: grasping must be 0 or 1, got -1");
    CHECK(refused("0,0,0,0,true\n") == no_number(1, "true"));
    CHECK(read("0,0,0,0,1.0\n")[0].grasping);
}

TEST_CASE("other encodings are refused, in the first line", "[script][bad]") {
    const std::string byte_order_mark = "\xEF\xBB\xBF";
    CHECK_THAT(refused(byte_order_mark + "0,0,0,0\n"), ContainsSubstring(name + "line 1 "));
    std::string wide = "\xFF\xFE";
    for (const char c : std::string("0,0,0,0\n")) wide += {c, '\0'};
    CHECK_THAT(refused(wide), ContainsSubstring(name + "line 1 "));
    std::string big_endian = "\xFE\xFF";
    for (const char c : std::string("time,x,y,z\n0,0,0,0\n")) big_endian += {'\0', c};
    CHECK_THAT(refused(big_endian), ContainsSubstring(name + "line 1 "));
}

TEST_CASE("a line of a megabyte is refused in a short message", "[script][bad]") {
    const std::string megabyte(1'000'000, '1');
    CHECK(refused("0,0,0,0\n" + megabyte + "\n") == columns(2, 1));
    CHECK(refused("0,0,0," + megabyte + "\n") == no_number(1, megabyte.substr(0, 40)));
    CHECK(refused("0,0,0,0\n" + std::string(1'000'000, ',')).size() < 200);
    CHECK(refused("0,0,0," + std::string(1'000'000, ' ') + "\n").size() < 200);
    CHECK(read("# " + megabyte + "\n0,0,0,0\n").size() == 1);
    CHECK(read("0,0,0," + std::string(1'000'000, '0') + "1\n")[0].position.z() == 1);
}

TEST_CASE("random bytes end in waypoints or in a refusal", "[script][bad]") {
    const std::string alphabet = "0123456789,,,,....eE+-\n\n\r #timexyzna\t" + std::string(1, '\0') + "\xFF";
    for (int seed = 1; seed <= cases(5000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        std::string text = random.chance(0.5) ? "0,1,2,3,1\n1,4,5,6,0\n" : "";
        for (Index n = random.index(30); n > 0; --n) {
            const auto byte = alphabet[static_cast<std::size_t>(random.index(static_cast<Index>(alphabet.size())))];
            text.insert(text.begin() + random.index(static_cast<Index>(text.size()) + 1), byte);
        }
        std::vector<Waypoint<double>> script;
        const std::string message = test::refusal([&] { script = read(text); });
        REQUIRE(message.empty() == !script.empty());
        for (const auto& waypoint : script) {
            REQUIRE(is_finite(waypoint.time));
            REQUIRE(is_finite(waypoint.position));
        }
    }
}

TEST_CASE("a script drives a device", "[script]") {
    std::istringstream text("time,x,y,z,grasping\n0,0,0,0.012,0\n1,0,0,0.009,1\n");
    ScriptedDevice<double> device(read_script<double>(text), {.tick = 0.5, .radius = 1e-3});
    CHECK(device.read().position == Vector3<double>(0, 0, 0.012));
    CHECK(device.read().position.z() == Approx(0.0105));
    CHECK(device.read().grasping);
    CHECK_FALSE(device.running());
}
