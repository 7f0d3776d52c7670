// SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include <membrane/core/check.hpp>

#include "../examples/mesh_texts.hpp"
#include "bytes.hpp"
#include "support/mesh_file.hpp"

// Any bytes as a mesh file, and right files with any changes: arrays that can be used, or one line that names the file.

using test::Bytes;
using test::require;

namespace {

void examine(const std::string& name, const std::string& bytes) {
    static const test::Folder folder;
    const std::string file = folder.file(name, bytes);
    try {
        const auto [points, triangles] = examples::read_mesh(file);
        require(membrane::is_finite(points));
        require(triangles.cols() > 0 && triangles.minCoeff() >= 0 && triangles.maxCoeff() < points.cols());
    } catch (const membrane::InvalidInput& refusal) {
        const std::string message = refusal.what();
        require(message.rfind(file + ": ", 0) == 0);
        require(message.size() < file.size() + 200);
        require(std::all_of(message.begin(), message.end(), [](char c) { return c >= ' ' && c <= '~'; }));
    }
}

std::string right_file(std::size_t kind) {
    const auto solid = test::tetrahedron();
    switch (kind) {
        case 0: return test::obj(solid);
        case 1: return test::off(solid);
        case 2: return test::ply(solid);
        case 3: return test::stl(solid);
        case 4: return test::binary_ply(solid, false);
        case 5: return test::binary_ply(solid, true);
        default: return test::binary_stl(solid);
    }
}

/// Pieces of the file are written over, put in, left out, repeated.
void change(std::string& file, Bytes& bytes) {
    while (bytes.left() > 0 && !file.empty()) {
        const auto at = bytes.next<std::uint16_t>() % file.size();
        const auto length = static_cast<std::size_t>(bytes.index(16));
        std::string piece;
        switch (bytes.index(4)) {
            case 0: file.erase(at, length); break;
            case 1: file.insert(at, file.substr(bytes.next<std::uint16_t>() % file.size(), 2 * length)); break;
            default:
                for (std::size_t i = 0; i < length && bytes.left() > 0; ++i) piece += bytes.next<char>();
                file.replace(at, bytes.index(2) == 0 ? 0 : piece.size(), piece);
        }
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    constexpr std::array<const char*, 7> names{"a.obj", "a.off", "a.ply", "a.stl", "a.ply", "a.ply", "a.stl"};
    Bytes bytes(data, size);
    const auto kind = static_cast<std::size_t>(bytes.index(2 * names.size()));
    std::string file;
    if (kind < names.size()) {
        file = right_file(kind);
        change(file, bytes);
    } else {
        file.assign(reinterpret_cast<const char*>(bytes.data()), bytes.left());
    }
    examine(names[kind % names.size()], file);
    return 0;
}
