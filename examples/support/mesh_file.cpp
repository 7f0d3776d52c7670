// SPDX-License-Identifier: MIT
#include "support/mesh_file.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
#include <string>
#include <system_error>
#include <vector>

#include <assimp/mesh.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <assimp/Importer.hpp>

#define TINYOBJLOADER_IMPLEMENTATION
#define TINYOBJLOADER_USE_DOUBLE
#include <tiny_obj_loader.h>

#include <membrane/core/check.hpp>

#include "support/mesh_syntax.hpp"

namespace examples {
namespace {

using membrane::refuse;

/// A surface under construction.
struct Soup {
    const std::string& file;
    std::vector<Eigen::Vector3d> points = {};
    std::vector<Eigen::Matrix<membrane::Index, 3, 1>> triangles = {};

    void add_point(const Eigen::Vector3d& p) {
        if (!membrane::is_finite(p)) refuse(file, "vertex ", points.size(), " is not finite, or too large to be read");
        points.push_back(p);
    }

    /// A polygon as a fan; `corner(k)` is its k-th vertex.
    template <class Corner>
    void add_polygon(std::size_t corners, const Corner& corner) {
        for (std::size_t k = 2; k < corners; ++k) triangles.emplace_back(corner(0), corner(k - 1), corner(k));
    }
};

/// A library's message, as a part of one line.
std::string one_line(const std::string& says) { return says.substr(0, std::min<std::size_t>(says.find('\n'), 120)); }

Soup read_obj(const std::string& file, const std::string& text) {
    std::istringstream stream(text);
    tinyobj::attrib_t attributes;
    std::vector<tinyobj::shape_t> shapes;
    std::vector<tinyobj::material_t> materials;
    std::string warning, error;
    const bool read = tinyobj::LoadObj(&attributes, &shapes, &materials, &warning, &error, &stream, nullptr, false);
    if (!read || !warning.empty() || !error.empty()) refuse(file, "tinyobjloader: ", one_line(error + warning));
    Soup soup{file};
    for (std::size_t at = 0; at < attributes.vertices.size(); at += 3) {
        soup.add_point(Eigen::Map<const Eigen::Vector3d>(&attributes.vertices[at]));
    }
    for (const auto& shape : shapes) {
        std::size_t begin = 0;
        for (const std::size_t corners : shape.mesh.num_face_vertices) {
            soup.add_polygon(corners, [&](std::size_t k) { return shape.mesh.indices[begin + k].vertex_index; });
            begin += corners;
        }
    }
    return soup;
}

Soup read_by_assimp(const std::string& file, const std::string& text, const std::string& kind) {
    Assimp::Importer importer;
    const aiScene* scene =
        importer.ReadFileFromMemory(text.data(), text.size(), aiProcess_ValidateDataStructure, kind.c_str());
    if (scene == nullptr) refuse(file, "assimp: ", one_line(importer.GetErrorString()));
    Soup soup{file};
    std::map<std::array<double, 3>, membrane::Index> known;  // for STL
    for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
        const aiMesh& part = *scene->mMeshes[m];
        std::vector<membrane::Index> index(part.mNumVertices);
        for (unsigned v = 0; v < part.mNumVertices; ++v) {
            const Eigen::Vector3d p(part.mVertices[v].x, part.mVertices[v].y, part.mVertices[v].z);
            const auto next = static_cast<membrane::Index>(soup.points.size());
            const bool weld = kind == "stl" && membrane::is_finite(p);
            index[v] = weld ? known.try_emplace({p.x(), p.y(), p.z()}, next).first->second : next;
            if (index[v] == next) soup.add_point(p);
        }
        for (unsigned f = 0; f < part.mNumFaces; ++f) {
            const aiFace& face = part.mFaces[f];
            soup.add_polygon(face.mNumIndices, [&](std::size_t k) { return index.at(face.mIndices[k]); });
        }
    }
    return soup;
}

std::string bytes_of(const std::filesystem::path& path, const std::string& file) {
    std::error_code failed;
    if (!std::filesystem::is_regular_file(path, failed)) refuse(file, "there is no such file");
    std::ifstream stream(path, std::ios::binary);
    std::string bytes{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
    if (!stream) refuse(file, "cannot be read");
    if (bytes.empty()) refuse(file, "is empty");
    return bytes;
}

}  // namespace

Surface read_mesh(const std::filesystem::path& path, double unit) {
    const std::string file = path.string();
    const std::string ending = lower(path.extension().string());
    const std::map<std::string, std::string (*)(const std::string&, std::string_view)> kinds{
        {".obj", checked_obj}, {".off", checked_off}, {".ply", checked_ply}, {".stl", checked_stl}};
    const auto kind = kinds.find(ending);
    if (kind == kinds.end()) refuse(file, "expected a file .obj, .off, .ply or .stl");

    const std::string text = kind->second(file, bytes_of(path, file));
    const Soup soup = ending == ".obj" ? read_obj(file, text) : read_by_assimp(file, text, ending.substr(1));
    if (soup.triangles.empty()) refuse(file, "has no triangles");
    Surface surface{membrane::Points<double>(3, soup.points.size()), membrane::Triangles(3, soup.triangles.size())};
    for (std::size_t v = 0; v < soup.points.size(); ++v) {
        surface.points.col(static_cast<Eigen::Index>(v)) = unit * soup.points[v];
    }
    for (std::size_t f = 0; f < soup.triangles.size(); ++f) {
        surface.triangles.col(static_cast<Eigen::Index>(f)) = soup.triangles[f];
    }
    return surface;
}

}  // namespace examples
