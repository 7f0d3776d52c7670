// SPDX-License-Identifier: MIT
#pragma once

#include <bit>
#include <charconv>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "support/mesh_file.hpp"

/// Surfaces as the text of files, written here and not by what is tested.
namespace test {

/// A folder that goes when it is no longer needed.
struct Folder {
    std::filesystem::path path;
    Folder() {
        std::string name = (std::filesystem::temp_directory_path() / "membrane_XXXXXX").string();
        if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("cannot make " + name);
        path = name;
    }
    ~Folder() { std::filesystem::remove_all(path); }
    Folder(const Folder&) = delete;
    Folder& operator=(const Folder&) = delete;

    /// A file with these bytes.
    [[nodiscard]] std::string file(const std::string& name, const std::string& bytes) const {
        std::filesystem::remove(path / name);  // a file system may wait for the disk when a file is written over
        std::ofstream(path / name, std::ios::binary) << bytes;
        return (path / name).string();
    }
};

/// A tetrahedron around the origin's corner: four vertices, four triangles that face outward.
inline examples::Surface tetrahedron() {
    examples::Surface surface{membrane::Points<double>(3, 4), membrane::Triangles(3, 4)};
    surface.points << 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1;
    surface.triangles << 0, 0, 1, 0, 2, 1, 2, 3, 1, 3, 3, 2;
    return surface;
}

inline std::string digits(double value) {
    char text[32];
    return {text, std::to_chars(text, std::end(text), value, std::chars_format::general, 17).ptr};
}

inline std::string triple(const Eigen::Vector3d& p) {
    return digits(p.x()) + ' ' + digits(p.y()) + ' ' + digits(p.z());
}

inline std::string obj(const examples::Surface& surface) {
    std::string text;
    for (const auto& p : surface.points.colwise()) text += "v " + triple(p) + '\n';
    for (const auto& t : surface.triangles.colwise())
        text += "f " + triple((t.array() + 1).matrix().cast<double>()) + '\n';
    return text;
}

inline std::string rows(const examples::Surface& surface) {
    std::string text;
    for (const auto& p : surface.points.colwise()) text += triple(p) + '\n';
    for (const auto& t : surface.triangles.colwise()) text += "3 " + triple(t.cast<double>()) + '\n';
    return text;
}

inline std::string off(const examples::Surface& surface) {
    return "OFF\n" + std::to_string(surface.points.cols()) + ' ' + std::to_string(surface.triangles.cols()) + " 0\n" +
           rows(surface);
}

inline std::string ply_header(const examples::Surface& surface, const std::string& format, const std::string& real) {
    return "ply\nformat " + format + " 1.0\nelement vertex " + std::to_string(surface.points.cols()) + "\nproperty " +
           real + " x\nproperty " + real + " y\nproperty " + real + " z\nelement face " +
           std::to_string(surface.triangles.cols()) + "\nproperty list uchar int vertex_indices\nend_header\n";
}

inline std::string ply(const examples::Surface& surface) {
    return ply_header(surface, "ascii", "double") + rows(surface);
}

/// The bytes of a number.
template <class Number>
std::string raw(Number number, bool big_endian = false) {
    using Bits =
        std::conditional_t<sizeof(Number) == 1, std::uint8_t,
                           std::conditional_t<sizeof(Number) == 2, std::uint16_t,
                                              std::conditional_t<sizeof(Number) == 4, std::uint32_t, std::uint64_t>>>;
    const auto bits = std::bit_cast<Bits>(number);
    std::string bytes;
    for (std::size_t i = 0; i < sizeof bits; ++i) {
        bytes +=
            static_cast<char>(static_cast<std::uint64_t>(bits) >> (8 * (big_endian ? sizeof bits - 1 - i : i)) & 0xff);
    }
    return bytes;
}

inline std::string binary_ply(const examples::Surface& surface, bool big_endian) {
    std::string bytes = ply_header(surface, big_endian ? "binary_big_endian" : "binary_little_endian", "float");
    for (const double number : surface.points.reshaped()) bytes += raw(static_cast<float>(number), big_endian);
    for (const auto& triangle : surface.triangles.colwise()) {
        bytes += raw(std::uint8_t{3});
        for (const std::int32_t corner : triangle) bytes += raw(corner, big_endian);
    }
    return bytes;
}

inline std::string stl(const examples::Surface& surface) {
    std::string text = "solid\n";
    for (const auto& triangle : surface.triangles.colwise()) {
        text += " facet normal 0 0 0\n  outer loop\n";
        for (const auto corner : triangle) text += "   vertex " + triple(surface.points.col(corner)) + '\n';
        text += "  endloop\n endfacet\n";
    }
    return text + "endsolid\n";
}

inline std::string binary_stl(const examples::Surface& surface, const std::string& header = "binary") {
    std::string bytes =
        header + std::string(80 - header.size(), ' ') + raw(static_cast<std::uint32_t>(surface.triangles.cols()));
    for (const auto& triangle : surface.triangles.colwise()) {
        bytes += std::string(12, '\0');
        for (const auto corner : triangle) {
            for (const double number : surface.points.col(corner)) bytes += raw(static_cast<float>(number));
        }
        bytes += std::string(2, '\0');
    }
    return bytes;
}

/// `text` with the first `from` in it as `to`.
inline std::string with(std::string text, const std::string& from, const std::string& to) {
    const auto at = text.find(from);
    return at == text.npos ? "no '" + from + "' in this file" : text.replace(at, from.size(), to);
}

/// The same everywhere.
inline std::string with_all(std::string text, const std::string& from, const std::string& to) {
    for (std::size_t at = 0; (at = text.find(from, at)) != text.npos; at += to.size())
        text.replace(at, from.size(), to);
    return text;
}

}  // namespace test
