// SPDX-License-Identifier: MIT
#include "support/mesh_file.hpp"

#include <algorithm>
#include <bit>
#include <clocale>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <locale>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <sys/stat.h>
#include <unistd.h>

#include <assimp/postprocess.h>
#include <assimp/Importer.hpp>

#include <membrane/surface/shapes.hpp>

#include "mesh_texts.hpp"
#include "support/cases.hpp"
#include "support/catch.hpp"
#include "support/child_process.hpp"
#include "support/random.hpp"
#include "support/refusal.hpp"

using namespace test;

namespace {

using Name = std::string;
const examples::Surface solid = tetrahedron();
const std::vector<std::pair<Name, std::string>> texts{
    {"a.obj", obj(solid)}, {"a.off", off(solid)}, {"a.ply", ply(solid)}, {"a.stl", stl(solid)}};
const std::vector<std::pair<Name, std::string>> binaries{
    {"little.ply", binary_ply(solid, false)}, {"big.ply", binary_ply(solid, true)}, {"binary.stl", binary_stl(solid)}};
const auto files = [] {
    auto all = texts;
    all.insert(all.end(), binaries.begin(), binaries.end());
    return all;
}();

/// What is read of a file with these bytes must be a surface of arrays that can be used, or one line that names the
/// file. Returns that line without the name; empty for a surface.
std::string verdict(const std::string& name, const std::string& bytes) {
    static const Folder folder;
    const std::string file = folder.file(name, bytes);
    const std::string message = refusal([&] {
        const auto [points, triangles] = examples::read_mesh(file);
        REQUIRE(membrane::is_finite(points));
        REQUIRE(triangles.cols() > 0);
        REQUIRE(triangles.minCoeff() >= 0);
        REQUIRE(triangles.maxCoeff() < points.cols());
    });
    if (message.empty()) return message;
    REQUIRE(message.rfind(file + ": ", 0) == 0);
    REQUIRE(message.size() < file.size() + 200);
    REQUIRE(std::all_of(message.begin(), message.end(), [](char c) { return c >= ' ' && c <= '~'; }));
    return message.substr(file.size() + 2);
}

bool is_solid(const std::string& name, const std::string& bytes, double tolerance = 1e-6) {
    static const Folder folder;
    const auto [points, triangles] = examples::read_mesh(folder.file(name, bytes));
    if (points.cols() != 4 || triangles.cols() != 4) return false;
    double error = 0;
    for (Eigen::Index f = 0; f < 4; ++f) {
        for (Eigen::Index k = 0; k < 3; ++k) {
            const Eigen::Vector3d read = points.col(triangles(k, f)), written = solid.points.col(solid.triangles(k, f));
            error = std::max(error, (read - written).norm());
        }
    }
    return error <= tolerance;
}

std::string to_utf16(const std::string& text) {
    std::string result = "\xff\xfe";
    for (const char c : text) (result += c) += '\0';
    return result;
}

}  // namespace

TEST_CASE("every format gives back the surface that was written, OBJ to a few units of the last place of a double") {
    for (int seed = 1; seed <= cases(30, 300); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        const auto mesh =
            membrane::icosphere<double>({.radius = std::pow(10, random.number(-4.0, 2.0)), .subdivisions = 1});
        examples::Surface surface{mesh.positions(), mesh.triangles()};
        for (double& number : surface.points.reshaped()) number *= random.number(0.8, 1.2);
        const double size = surface.points.cwiseAbs().maxCoeff(), unit = random.number(1e-3, 1e3);
        const std::map<std::string, std::string> written{{"b.obj", obj(surface)},
                                                         {"b.off", off(surface)},
                                                         {"b.ply", ply(surface)},
                                                         {"little.ply", binary_ply(surface, false)},
                                                         {"b.stl", stl(surface)},
                                                         {"big.ply", binary_ply(surface, true)},
                                                         {"binary.stl", binary_stl(surface)}};
        for (const auto& [name, bytes] : written) {
            CAPTURE(name);
            const Folder folder;
            const auto read = examples::read_mesh(folder.file(name, bytes), unit);
            const double tolerance = (name == "b.obj" ? 2e-15 : 3e-7) * unit * size;
            REQUIRE(read.points.cols() == surface.points.cols());
            REQUIRE(read.triangles.cols() == surface.triangles.cols());
            if (name.find("stl") == name.npos) {
                CHECK(read.triangles == surface.triangles);
                CHECK((read.points - unit * surface.points).cwiseAbs().maxCoeff() <= tolerance);
            }
            for (Eigen::Index corner = 0; corner < surface.triangles.size(); ++corner) {
                const auto v = surface.triangles.reshaped()[corner], w = read.triangles.reshaped()[corner];
                REQUIRE((read.points.col(w) - unit * surface.points.col(v)).cwiseAbs().maxCoeff() <= tolerance);
            }
        }
    }
}

TEST_CASE("ends of lines, blanks, comments and marks that texts may have change nothing") {
    for (const auto& [name, text] : texts) {
        CAPTURE(name);
        const std::string comment = name == "a.ply" ? "" : "# end";
        CHECK(is_solid(name, text));
        CHECK(is_solid(name, with_all(text, "\n", "\r\n")));
        CHECK(is_solid(name, with_all(text, "\n", "\r")));
        CHECK(is_solid(name, with(with(text, "\n", "\r\n"), "\n", "\r\n")));
        CHECK(is_solid(name, "\xef\xbb\xbf" + text));
        CHECK(is_solid(name, with_all(with_all(text, " ", "\t"), "\n", " \t\n")));
        CHECK(is_solid(name, text.substr(0, text.size() - 1)));
        CHECK(is_solid(name, text + comment));
        CHECK(is_solid(name, text + "\n\n" + comment + "\n"));
    }
    for (const auto& [name, bytes] : binaries) CHECK(is_solid(name, bytes));
}

TEST_CASE("files that are no mesh are refused in one line") {
    for (const auto& [name, text] : files) {
        CAPTURE(name);
        CHECK(verdict(name, "") == "is empty");
        for (const char* bytes : {"x", "\n", "#", "\xff", "OFF", "ply", "solid", "v", "\xef\xbb\xbf"}) {
            CAPTURE(bytes);
            CHECK_FALSE(verdict(name, bytes).empty());
        }
        CHECK_FALSE(verdict(name, std::string(1, '\0')).empty());
        CHECK_FALSE(verdict(name, std::string(1000000, 'x')).empty());
        CHECK_FALSE(verdict(name, to_utf16(text)).empty());
    }
    for (const auto& [name, text] : texts) {
        CAPTURE(name);
        if (name == "a.stl" || name == "a.ply") continue;  // could be binary
        for (const auto& bytes : {to_utf16(text), with(text, "0 0", std::string("0\0 0", 4))}) {
            CHECK_THAT(verdict(name, bytes),
                       ContainsSubstring("line ") && ContainsSubstring("text in ASCII or UTF-8 without NUL"));
        }
    }
    const Folder folder;
    CHECK_THAT(refusal([&] { (void)examples::read_mesh(folder.path / "none.obj"); }),
               ContainsSubstring("there is no such file"));
    CHECK_THAT(refusal([&] { (void)examples::read_mesh(folder.path); }), ContainsSubstring("expected a file .obj"));
    std::filesystem::create_directory(folder.path / "folder.obj");
    CHECK_THAT(refusal([&] { (void)examples::read_mesh(folder.path / "folder.obj"); }),
               ContainsSubstring("no such file"));
    CHECK_THAT(verdict("a.vtk", obj(solid)), ContainsSubstring("expected a file .obj, .off, .ply or .stl"));
    CHECK(is_solid("A.OBJ", obj(solid)));
}

TEST_CASE("a file that ends anywhere before its end is refused, an OBJ where that shows") {
    for (const auto& [name, bytes] : files) {
        const bool text = std::find(texts.begin(), texts.end(), std::pair{name, bytes}) != texts.end();
        for (std::size_t size = 0; size + (text ? 1 : 0) < bytes.size(); ++size) {
            CAPTURE(name, size);
            const std::string message = verdict(name, bytes.substr(0, size));
            if (name != "a.obj" || size < bytes.find("\nf 1 2 4")) CHECK_FALSE(message.empty());
        }
    }
}

TEST_CASE("numbers that are none, not finite or too long are refused in the line where they are") {
    for (const auto& [name, text] : texts) {
        const std::string vertex = name == "a.stl" ? "vertex 1 0 0" : name == "a.obj" ? "v 1 0 0" : "\n1 0 0";
        const auto with_number = [&, &bytes = text](const std::string& number) {
            return with_all(bytes, vertex, vertex.substr(0, vertex.size() - 5) + number + " 0 0");
        };
        for (const char* number :
             {"nan", "NaN", "-nan", "inf", "-inf", "infinity", "1e999", "-1e999", "0x10", "1,5",     "1.5.2",
              "e5",  ".",   "+",    "-",   "+-1",  "1e",       "1d5",   "one",    "1_0",  "\xd9\xa1"}) {
            CAPTURE(name, number);
            CHECK_THAT(verdict(name, with_number(number)), ContainsSubstring("line ") && ContainsSubstring("number"));
        }
        for (const std::string& number : {std::string(400, '1'), "0." + std::string(400, '3'), std::string(19, '1')}) {
            CAPTURE(name, number);
            CHECK_THAT(verdict(name, with_number(number)), ContainsSubstring("line ") && ContainsSubstring("digits"));
        }
        for (const auto& [number, value] : std::map<std::string, double>{{"+1.5", 1.5},
                                                                         {".5", .5},
                                                                         {"5.", 5},
                                                                         {"-0", 0},
                                                                         {"1e-999", 0},
                                                                         {"5.e3", 5e3},
                                                                         {"-.5", -.5},
                                                                         {"+.5e-1", .05},
                                                                         {"123456789012345678", 123456789012345678.0},
                                                                         {"1E5", 1e5}}) {
            CAPTURE(name, number);
            const Folder folder;
            const auto read = examples::read_mesh(folder.file(name, with_number(number)));
            CHECK(read.points.cols() == (name == "a.stl" && value == 0 ? 3 : 4));
            const auto error = (read.points.row(0).array() - value).abs().minCoeff();
            CHECK(error <= 1e-6 * std::abs(value));
        }
        if (name != "a.obj") CHECK_THAT(verdict(name, with_number("1e39")), ContainsSubstring("too large"));
    }
    constexpr double infinity = std::numeric_limits<double>::infinity();
    for (const double number : {std::nan(""), infinity, -infinity, 1e39}) {
        auto wrong = solid;
        wrong.points(0, 1) = number;
        for (const auto& bytes : {std::pair<Name, std::string>{"little.ply", binary_ply(wrong, false)},
                                  {"big.ply", binary_ply(wrong, true)},
                                  {"binary.stl", binary_stl(wrong)}}) {
            CAPTURE(bytes.first, number);
            CHECK_THAT(verdict(bytes.first, bytes.second), ContainsSubstring("is not finite"));
        }
    }
}

TEST_CASE("a line of a megabyte and a locale with a comma change nothing") {
    const std::string comment = std::string(1 << 20, 'c');
    CHECK(is_solid("a.obj", "# " + comment + '\n' + obj(solid)));
    CHECK(is_solid("a.off", with(off(solid), "OFF\n", "OFF # " + comment + '\n')));
    CHECK(is_solid("a.ply", with(ply(solid), "element", "comment " + comment + "\nelement")));
    CHECK(is_solid("a.stl", with(stl(solid), "solid", "solid " + comment)));
    for (const auto& [name, text] : texts) CHECK_FALSE(verdict(name, with(text, " 0 0", ' ' + comment + " 0")).empty());

    struct Comma : std::numpunct<char> {
        char do_decimal_point() const override { return ','; }
        char do_thousands_sep() const override { return '.'; }
        std::string do_grouping() const override { return "\3"; }
    };
    auto fine = solid;
    fine.points(0, 1) = 1234.5;
    const auto before = std::locale::global(std::locale(std::locale::classic(), new Comma));
    const char* german = std::setlocale(LC_ALL, "de_DE.UTF-8");  // where there is one
    for (const auto& [name, text] : {std::pair<Name, std::string>{"a.obj", obj(fine)},
                                     {"a.off", off(fine)},
                                     {"a.ply", ply(fine)},
                                     {"a.stl", stl(fine)},
                                     {"b.stl", binary_stl(fine)}}) {
        const Folder folder;
        CAPTURE(name);
        CHECK(examples::read_mesh(folder.file(name, text)).points.maxCoeff() == 1234.5);
    }
    std::locale::global(before);
    if (german != nullptr) std::setlocale(LC_ALL, "C");
}

TEST_CASE("OBJ has corners of many kinds") {
    const std::string text = obj(solid);
    const std::string vt = "vt 0 0\nvn 0 0 1\n";
    CHECK(is_solid("a.obj", vt + with(text, "f 1 3 2", "f 1//1 3//1 2//1")));
    CHECK(is_solid("a.obj", vt + with(text, "f 1 3 2", "f 1/1/1 3/1/1 2/1/1")));
    CHECK(is_solid("a.obj", vt + with(text, "f 1 3 2", "f 1/1 3/1 2/1")));
    CHECK(is_solid("a.obj", with(text, "f 1 3 2", "f -4 -2 -3")));
    CHECK(is_solid("a.obj", with(text, "f 1 3 2", "f 1 3 \\\n2")));
    CHECK(is_solid("a.obj", with(text, "f 1 3 2", "# by C:\\lens\\\nf 1 3 2")));  // a comment ends with its line
    CHECK_THAT(verdict("a.obj", with(text, "v 0 0 0", "v 0 \\\n0 \\\n0") + "wrong\n"),
               ContainsSubstring("line 11: expected a statement"));
    CHECK(is_solid("a.obj", with(text, "f 1 3 2", "o body\ng one two\ns off\nusemtl skin\nf 1 3 2\ng three")));
    CHECK(is_solid("a.obj", with(text, "v 0 0 1", "v 0 0 1 1")));
    CHECK(is_solid("a.obj", with(text, "v 0 0 1", "v 0 0 1 0.5 0.5 0.5")));
    CHECK(is_solid("a.obj", with(text, "v 0 0 1", "v 0 0 1 1 0.5 0.5 0.5")));
    for (const char* face : {"f 0 1 2", "f 5 1 2", "f -5 1 2", "f 99999999999 1 2", "f 1 2", "f 1", "f", "f a b c",
                             "f 1.5 2 3", "f 1 /2 3", "f - 2 3", "f 4294967297 1 2"}) {
        CAPTURE(face);
        CHECK_THAT(verdict("a.obj", with(text, "f 1 3 2", face)),
                   ContainsSubstring("line 5") || ContainsSubstring("line 8"));
    }
    CHECK_THAT(verdict("a.obj", with(text, "v 0 0 1", "v 0 0")),
               ContainsSubstring("line 4: expected more than 3 words"));
    CHECK_THAT(verdict("a.obj", with(text, "v 0 0 1", "curv 0 0")),
               ContainsSubstring("line 4: ") && ContainsSubstring("'curv'"));
    CHECK(verdict("a.obj", with(text.substr(0, text.find('f')), "v", "v")) == "has no triangles");
    CHECK_FALSE(verdict("a.obj", "f 1 2 3\n").empty());

    std::string fan;
    for (int v = 0; v < 100000; ++v) fan += "v " + digits(std::cos(v)) + ' ' + digits(std::sin(v)) + " 0\n";
    std::string corners;
    for (int v = 1; v <= 255; ++v) corners += ' ' + std::to_string(v);
    const Folder folder;
    CHECK(examples::read_mesh(folder.file("fan.obj", fan + 'f' + corners + '\n')).triangles.cols() == 253);
    for (int v = 256; v <= 100000; ++v) corners += ' ' + std::to_string(v);
    CHECK_THAT(verdict("a.obj", fan + 'f' + corners + '\n'),
               ContainsSubstring("line 100001: expected at most 255 words in a statement"));
}

TEST_CASE("OBJ may name faces before vertices, and opens no other file") {
    const std::string text = obj(solid);
    const std::size_t faces = text.find('f');
    const std::string message = verdict("a.obj", text.substr(faces) + text.substr(0, faces));
    CHECK((message.empty() || message.find("line") != std::string::npos));

    const Folder folder;
    REQUIRE(mkfifo((folder.path / "skin.mtl").c_str(), 0600) == 0);  // a reader that opens it waits
    const std::string file = folder.file("a.obj", "mtllib skin.mtl ../skin.mtl /etc/passwd\nusemtl skin\n" + text);
    const auto child = in_child([&] {
        alarm(5);
        static_cast<void>(examples::read_mesh(file));
    });
    CHECK(child.signal == 0);
    CHECK(child.code == 0);
}

TEST_CASE("OFF has counts that agree with its body") {
    const std::string text = off(solid);
    CHECK(is_solid("a.off", with(text, "OFF\n", "OFF ")));
    CHECK(is_solid("a.off", with(text, "OFF\n", "OFF # name\n# comment\n\n")));
    CHECK(is_solid("a.off", with(text, "\n3 0 2 1", "\n# faces\n3 0 2 1 255 0 0 # red")));
    for (const char* counts :
         {"5 4 0", "4 5 0", "3 4 0", "4 3 0", "4294967295 4 0", "4 4294967295 0", "2147483647 2147483647 0", "-4 4 0",
          "4 -4 0", "0 0 0", "4 0 0", "4 4", "4", "4 4 0 0", "x y z", "4.0 4 0"}) {
        CAPTURE(counts);
        CHECK_FALSE(verdict("a.off", with(text, "4 4 0", counts)).empty());
    }
    for (const char* kind : {"COFF", "NOFF", "4OFF", "nOFF", "STOFF", "OFF BINARY", "off", "PLY"}) {
        CAPTURE(kind);
        CHECK_THAT(verdict("a.off", with(text, "OFF", kind)), ContainsSubstring("expected"));
    }
    for (const char* face :
         {"3 0 2 4", "3 0 2 -1", "3 0 2", "2 0 2", "-3 0 2 1", "300000000 0 2 1", "3 0 2 1.5", "3"}) {
        CAPTURE(face);
        CHECK_THAT(verdict("a.off", with(text, "3 0 2 1", face)), ContainsSubstring("line 7: expected"));
    }
    std::string fan = "OFF\n100000 1 0\n", corners = "100000";
    for (int v = 0; v < 100000; ++v) {
        fan += digits(std::cos(v)) + ' ' + digits(std::sin(v)) + " 0\n";
        corners += ' ' + std::to_string(v);
    }
    CHECK_THAT(verdict("a.off", fan + corners + '\n'),
               ContainsSubstring("line 100003: expected an integer from 3 to 255"));
}

TEST_CASE("PLY may have its numbers in many formats") {
    const std::string text = ply(solid);
    CHECK_THAT(verdict("a.ply", with(text, "double x", "double t")),
               ContainsSubstring("a property x, y and z of a vertex, got 'yz'"));
    CHECK(is_solid("a.ply", with(text, "vertex_indices", "vertex_index")));
    CHECK(is_solid("a.ply", with(text, "list uchar int", "list int uint")));
    CHECK(is_solid("a.ply", with(text, "list uchar int", "list ushort uint8")));
    auto turned = with(with(with(text, "double x", "double w"), "double z", "double x"), "double w", "double z");
    const Folder folder;
    const auto read = examples::read_mesh(folder.file("turned.ply", turned));
    CHECK(read.points == solid.points.colwise().reverse());
    CHECK(is_solid("a.ply", with(text, "end_header\n", "element edge 1\nproperty int a\nend_header\n") + "7\n"));
    CHECK(is_solid("a.ply",
                   with_all(with(text, "property list", "property uchar red\nproperty list"), "\n3 ", "\n200 3 ")));

    // MeshLab's texture coordinates of a face, before or after its corners.
    CHECK(is_solid("a.ply", with_all(with(text, "property list", "property list uchar float texcoord\nproperty list"),
                                     "\n3 ", "\n6 0 0.5 1 0 1 1 3 ")));
    const std::size_t vertices = text.find("element vertex"), faces = text.find("element face"),
                      rows = text.find("end_header\n") + 11, face_rows = text.find("\n3 ", rows) + 1;
    CHECK(is_solid("a.ply", text.substr(0, vertices) + text.substr(faces, rows - 11 - faces) +
                                text.substr(vertices, faces - vertices) + "end_header\n" + text.substr(face_rows) +
                                text.substr(rows, face_rows - rows)));

    for (const bool big_endian : {false, true}) {
        const std::string binary = binary_ply(solid, big_endian);
        const std::size_t v = binary.find("element vertex"), f = binary.find("element face"),
                          header_end = binary.find("end_header\n"), rows_begin = header_end + 11,
                          corners = binary.size() - 4 * 13;
        CHECK(is_solid("b.ply", binary.substr(0, v) + binary.substr(f, header_end - f) + binary.substr(v, f - v) +
                                    "end_header\n" + binary.substr(corners) +
                                    binary.substr(rows_begin, corners - rows_begin)));
        std::string with_list =
            with(binary.substr(0, corners), "end_header", "property list uchar float t\nend_header");
        for (std::size_t k = 0; k < 4; ++k) with_list += binary.substr(corners + 13 * k, 13) + '\2' + "12345678";
        CHECK(is_solid("b.ply", with_list));
        auto first = solid;
        for (const std::uint32_t bits :
             {0x3f80000aU, 0x3f800a0dU, 0x0a0a0a0aU, 0x0d0a0d0aU, 0x3f800020U, 0x3f80000dU}) {
            CAPTURE(big_endian, bits);  // a body that begins like the end of a line
            first.points(0, 0) = std::bit_cast<float>(bits);
            for (const char* end : {"\n", "\r\n", "\r"}) {
                if (end == std::string("\r") && (big_endian ? bits >> 24 : bits & 0xff) == '\n') continue;  // unknown
                const std::string bytes = binary_ply(first, big_endian);
                const std::size_t body = bytes.find("end_header\n") + 11;
                const auto file = folder.file("b.ply", with_all(bytes.substr(0, body), "\n", end) + bytes.substr(body));
                CHECK(examples::read_mesh(file).points == first.points);
            }
        }
    }
}

TEST_CASE("PLY that is not what its header says is refused") {
    for (const auto& [name, text] : files) {
        if (name.find(".ply") == name.npos) continue;
        for (const auto& [from, to] : std::vector<std::pair<std::string, std::string>>{
                 {"vertex 4", "vertex 4294967295"},
                 {"vertex 4", "vertex 2147483647"},
                 {"vertex 4", "vertex -1"},
                 {"vertex 4", "vertex 3"},
                 {"vertex 4", "vertex 5"},
                 {"vertex 4", "vertex"},
                 {"face 4", "face 2147483647"},
                 {"face 4", "face 5"},
                 {"face 4", "face 3"},
                 {"face 4", "face 0"},
                 {"list uchar", "list float"},
                 {"list uchar int", "list uchar float"},
                 {"uchar int", "uchar int128"},
                 {" x\n", " q\n"},
                 {" y\n", " x\n"},
                 {" 1.0", " 2.0"},
                 {"format", "fromat"},
                 {"ply", "plx"},
                 {"end_header", "end_footer"},
                 {"format ", "format x"},
                 {"element vertex", "element face"},
                 {"element face", "element faces"},
                 {"vertex_indices", "indices"},
                 {"element face 4\n", "element face 4\nproperty list uchar float texcoord\n"},
                 {"element vertex", "element camera 1\nproperty float a\nelement vertex"},
                 {"element face", "element nothing 2147483647\nelement face"},
                 {"end_header", "element nothing 2147483647\nend_header"},
                 {"element vertex", "property float a\nelement vertex"}}) {
            CAPTURE(name, from, to);
            CHECK_FALSE(verdict(name, with(text, from, to)).empty());
        }
        CHECK_FALSE(verdict(name, text + "1").empty());
    }
    for (const bool big_endian : {false, true}) {
        const std::string bytes = binary_ply(solid, big_endian);
        const std::size_t faces = bytes.size() - 4 * 13;
        CAPTURE(big_endian);
        const auto place = [](std::size_t byte) { return "byte " + std::to_string(byte) + ": "; };
        const auto patched = [&](std::string file, std::size_t at, const std::string& by) {
            return file.replace(at, by.size(), by);
        };
        CHECK_THAT(verdict("b.ply", patched(bytes, faces, "\xff")),
                   ContainsSubstring("expected an integer from 0 to 3"));
        CHECK_THAT(verdict("b.ply", patched(with(bytes, "list uchar", "list char"), faces - 1, "\xff")),
                   ContainsSubstring(place(faces - 1) + "expected an integer from 3 to 255, got -1"));
        CHECK_THAT(verdict("b.ply", patched(bytes, faces, std::string(1, '\2'))),
                   ContainsSubstring(place(faces) + "expected an integer from 3 to 255, got 2"));
        CHECK_THAT(verdict("b.ply", patched(bytes, faces + 1, raw(4, big_endian))),
                   ContainsSubstring(place(faces + 1) + "expected an integer from 0 to 3, got 4"));
        CHECK_THAT(verdict("b.ply", patched(bytes, faces + 14, raw(-1, big_endian))),
                   ContainsSubstring(place(faces + 14) + "expected an integer from 0 to 3, got -1"));
        std::string wide = with(bytes, "list uchar", "list uint").substr(0, faces - 1);
        CHECK_THAT(verdict("b.ply", wide + raw(0xffffffffU, big_endian) + bytes.substr(faces + 1)),
                   ContainsSubstring(place(faces - 1) + "expected an integer from 3 to 255, got 4294967295"));
    }
    const std::string text = ply(solid);
    CHECK_THAT(verdict("a.ply", with(text, "\n3 0 2 1", "\n-1 0 2 1")),
               ContainsSubstring("line 14: expected an integer from 3"));
    CHECK_THAT(verdict("a.ply", with(text, "\n3 0 2 1", "\n3 0 2 4")),
               ContainsSubstring("line 14: expected an integer from 0 to 3"));
    CHECK_THAT(verdict("a.ply", with(text, "\n3 0 2 1", "\n5 0 2 1")),
               ContainsSubstring("line 14: expected more than 4 words"));
}

TEST_CASE("STL is binary or ASCII by its size, not by its first word") {
    CHECK(is_solid("a.stl", binary_stl(solid, "solid of a tool")));
    std::string coloured = binary_stl(solid);
    for (std::size_t f = 0; f < 4; ++f) coloured.replace(84 + 50 * f + 48, 2, "\xff\x7f");
    CHECK(is_solid("a.stl", coloured));
    const std::string text = stl(solid);
    CHECK(is_solid("a.stl", with_all(text, "solid", "solid " + std::string(200, 'n'))));
    CHECK(is_solid("a.stl", with(text, "solid", "solid facet vertex # endsolid")));
    CHECK(is_solid("a.stl", "\n \t" + text));
    std::string upper = text;
    for (char& c : upper) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    CHECK(is_solid("a.stl", upper));

    const std::string bytes = binary_stl(solid);
    CHECK(is_solid("a.stl", bytes + '\0'));  // some programs write more behind the triangles
    CHECK(is_solid("a.stl", bytes + std::string(80, '\7')));
    CHECK_THAT(verdict("a.stl", bytes + bytes.substr(84, 50)),
               ContainsSubstring("expected 284 bytes of a binary STL with 4 triangles, got 334"));
    // Normals of triangles without area are NaN in the files of some programs; they are not used.
    std::string no_normals = bytes;
    for (std::size_t f = 0; f < 4; ++f) no_normals.replace(84 + 50 * f, 4, raw(0x7fc00000U));
    CHECK(is_solid("a.stl", no_normals));
    CHECK(is_solid("a.stl", with_all(text, "facet normal 0", "facet normal nan")));
    for (const std::uint32_t count : {0U, 3U, 5U, 0xffffffffU, 0x80000000U}) {
        CAPTURE(count);
        CHECK_FALSE(verdict("a.stl", bytes.substr(0, 80) + raw(count) + bytes.substr(84)).empty());
    }
    CHECK_THAT(verdict("a.stl", bytes.substr(0, 80) + raw(0U)), ContainsSubstring("no facets"));
    CHECK_THAT(verdict("a.stl", "solid\nendsolid\n"), ContainsSubstring("no vertices"));
    CHECK_THAT(verdict("a.stl", with(text, "endsolid\n", "")), ContainsSubstring("expected 'endsolid'"));
    CHECK_THAT(verdict("a.stl", with(text, "endloop", "vertex 1 2 3\n  endloop")),
               ContainsSubstring("expected 'endloop', got 'vertex'"));
    CHECK_THAT(verdict("a.stl", with(text, "vertex 1 0 0\n", "\n")),
               ContainsSubstring("line 7: expected 'vertex', got 'endloop'"));
}

TEST_CASE("what is checked is what assimp alone accepts, or does not come back from") {
    const Name x_of_one = "\n1 0 0", first_face = "\n3 0 2 1";
    struct Case {
        Name file, from, to;
    };
    const std::vector<Case> cases{{"a.off", x_of_one, "\n1,5 0 0"},
                                  {"a.off", x_of_one, "\n" + std::string(19, '1') + " 0 0"},
                                  {"a.off", x_of_one, "\n0." + std::string(400, '3') + " 0 0"},
                                  {"a.off", x_of_one, "\n1 0 0 7"},
                                  {"a.off", first_face, "\n3 0 2"},
                                  {"a.off", first_face, "\n3 0 2 4"},
                                  {"a.off", first_face, "\n2 0 2"},
                                  {"a.off", first_face, "\n3 0 2 1.5"},
                                  {"a.off", "4 4 0", "4 3 0"},
                                  {"a.off", "4 4 0", "3 4 0"},
                                  {"a.ply", x_of_one, "\n1,5 0 0"},
                                  {"a.ply", x_of_one, "\n1\n0 0"},
                                  {"a.ply", x_of_one, std::string("\n1\0 0 0", 8)},
                                  {"a.ply", first_face, "\n5 0 2 1"},
                                  {"a.ply", first_face, "\n2 0 2"},
                                  {"a.ply", first_face, "\n3 0 2 1.5"},
                                  {"a.ply", "ply", "plyx"},
                                  {"a.ply", "1.0", "2.0"},
                                  {"a.ply", "element vertex", "fnord\nelement vertex"},
                                  {"a.ply", "element vertex", "property float a\nelement vertex"},
                                  {"a.ply", "vertex 4", "vertex 4x"},
                                  {"a.ply", "face 4", "face 3"},
                                  {"a.ply", "element face", "element camera 1\nproperty float a\nelement face"},
                                  {"a.ply", "double y", "double x"},
                                  {"a.ply", "uchar int", "uchar float"},
                                  {"a.ply", "end_header", "element face 0\nproperty list int int a\nend_header"},
                                  {"little.ply", "face 4", "face 3"},
                                  {"little.ply", "vertex 4", "vertex 5"},
                                  {"a.stl", "endsolid\n", ""},
                                  {"a.stl", "outer loop", ""},
                                  {"a.stl", "endfacet", ""},
                                  {"a.stl", "vertex 1 0 0", "vertex 1 0 0 0"},
                                  {"a.stl", "endloop", "vertex 1 2 3\n  endloop"}};
    const auto check = [](const Name& name, const std::string& bytes) {
        CAPTURE(name, bytes);
        CHECK_FALSE(verdict(name, bytes).empty());
        const auto alone = in_child([&] {
            ualarm(500000, 0);  // it may not come back
            Assimp::Importer importer;
            const auto kind = name.substr(name.find('.') + 1);
            const auto* scene =
                importer.ReadFileFromMemory(bytes.data(), bytes.size(), aiProcess_ValidateDataStructure, kind.c_str());
            _exit(scene == nullptr ? 1 : 0);
        });
        CHECK((alone.signal != 0 || alone.code == 0));
    };
    for (const Case& one : cases) {
        const auto file =
            std::find_if(files.begin(), files.end(), [&](const auto& right) { return right.first == one.file; });
        check(one.file, with(file->second, one.from, one.to));
    }
    check("a.ply", ply(solid).substr(0, 20));
    check("little.ply", binary_ply(solid, false).substr(0, 60));
    const std::string bytes = binary_ply(solid, false);
    std::string two = bytes;
    two[bytes.size() - 4 * 13] = '\2';  // corners
    check("little.ply", bytes + "1");
    check("little.ply", two.erase(two.size() - 3 * 13 - 4, 4));
}

TEST_CASE("bytes of a mesh file that are changed at random come to a surface or to one line") {
    for (int seed = 1; seed <= cases(1500, 30000); ++seed) {
        CAPTURE(seed);
        Random random(static_cast<std::uint64_t>(seed));
        auto [name, bytes] = files[static_cast<std::size_t>(seed) % files.size()];
        const auto changes = 1 + random.index(4);
        for (membrane::Index change = 0; change < changes; ++change) {
            const auto at = static_cast<std::size_t>(random.index(static_cast<membrane::Index>(bytes.size())));
            const std::string pieces[]{"\n",   " ", "-",   "9", "4294967295 ", "nan", std::string(1, '\0'),
                                       "\xff", "#", "e999"};
            const auto& piece = pieces[static_cast<std::size_t>(random.index(10))];
            const auto what = random.index(3);
            if (what == 0) bytes.insert(at, piece);
            if (what == 1) bytes.replace(at, std::min<std::size_t>(1, bytes.size() - at), piece);
            if (what == 2) bytes.erase(std::min(at, bytes.size()), static_cast<std::size_t>(1 + random.index(8)));
        }
        static_cast<void>(verdict(name, bytes));
    }
}
