// SPDX-License-Identifier: MIT
#pragma once

#include <charconv>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <membrane/surface/triangle_mesh.hpp>

#include "support/surface_state.hpp"

/// Membranes for other programs: files of VTK for ParaView, a time series of them, and PLY for MeshLab. Numbers are
/// written with enough digits to read equal ones.
///
///     write_vtp("pressed.vtp", mesh.triangles(), surface_state(mesh, x, network, foundation));
///     Series series("frames", "sphere", mesh.triangles(), 0.02);
///     if (series.due(tool.time)) series.add(tool.time, surface_state(mesh, x, network, foundation));  // in the loop
namespace examples {

namespace detail {

/// With a '.', whatever the locale.
template <class Number>
void append_number(std::string& text, Number value) {
    char digits[32];
    text.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

/// The columns of a matrix, one a line.
template <class Matrix>
void append_rows(std::string& text, const Matrix& columns) {
    for (Eigen::Index column = 0; column < columns.cols(); ++column) {
        for (Eigen::Index row = 0; row < columns.rows(); ++row) {
            append_number(text, columns(row, column));
            text += row + 1 < columns.rows() ? ' ' : '\n';
        }
    }
}

inline void save(const std::filesystem::path& file, const std::string& text) {
    std::ofstream stream(file, std::ios::binary);
    if (!(stream << text << std::flush)) throw std::runtime_error("cannot write " + file.string());
}

template <class Matrix>
void append_array(std::string& text, std::string_view type, std::string_view name, const Matrix& columns) {
    text += "<DataArray type='" + std::string(type) + "' Name='" + std::string(name) + "' NumberOfComponents='" +
            std::to_string(columns.rows()) + "' format='ascii'>\n";
    append_rows(text, columns);
    text += "</DataArray>\n";
}

}  // namespace detail

/// PolyData of VTK with the vectors `displacement` [m] and `force` [N] and the number `tension` [N/m] of each vertex.
/// @throws std::runtime_error for a file that cannot be written
inline void write_vtp(const std::filesystem::path& file, const membrane::Triangles& triangles,
                      const SurfaceState& state) {
    std::string text =
        "<?xml version='1.0'?>\n<VTKFile type='PolyData' version='0.1'>\n<PolyData>\n<Piece NumberOfPoints='" +
        std::to_string(state.points.cols()) + "' NumberOfPolys='" + std::to_string(triangles.cols()) +
        "'>\n<PointData Vectors='displacement' Scalars='tension'>\n";
    detail::append_array(text, "Float64", "displacement", state.displacement);
    detail::append_array(text, "Float64", "force", state.force);
    detail::append_array(text, "Float64", "tension", state.tension.transpose());
    text += "</PointData>\n<Points>\n";
    detail::append_array(text, "Float64", "points", state.points);
    text += "</Points>\n<Polys>\n";
    detail::append_array(text, "Int32", "connectivity", triangles.reshaped(1, triangles.size()));
    const Eigen::RowVectorXi ends =
        Eigen::RowVectorXi::LinSpaced(triangles.cols(), 3, 3 * static_cast<int>(triangles.cols()));
    detail::append_array(text, "Int32", "offsets", ends);
    detail::save(file, text + "</Polys>\n</Piece>\n</PolyData>\n</VTKFile>\n");
}

/// PLY in ASCII with these values for each vertex, and the norm of its displacement [m] as `quality`, which MeshLab
/// turns into colours.
/// @throws std::runtime_error for a file that cannot be written
inline void write_ply(const std::filesystem::path& file, const membrane::Triangles& triangles,
                      const SurfaceState& state) {
    std::string text = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(state.points.cols()) + '\n';
    for (const char* name : {"x", "y", "z", "displacement_x", "displacement_y", "displacement_z", "force_x", "force_y",
                             "force_z", "tension", "quality"}) {
        text += std::string("property double ") + name + '\n';
    }
    text +=
        "element face " + std::to_string(triangles.cols()) + "\nproperty list uchar int vertex_indices\nend_header\n";
    Eigen::MatrixXd rows(11, state.points.cols());
    rows << state.points, state.displacement, state.force, state.tension.transpose(),
        state.displacement.colwise().norm();
    detail::append_rows(text, rows);
    Eigen::MatrixXi faces(4, triangles.cols());
    faces << Eigen::RowVectorXi::Constant(triangles.cols(), 3), triangles;
    detail::append_rows(text, faces);
    detail::save(file, text);
}

/// A time series for ParaView: FOLDER/NAME.pvd, which names a .vtp for each time. Beside it, for MeshLab, NAME.ply: the
/// state with the largest displacement.
class Series {
  public:
    /// At most one state each `interval` [s]. Nothing is written if `folder` is empty.
    /// @throws std::runtime_error for a folder that cannot be made
    Series(const std::filesystem::path& folder, std::string name, membrane::Triangles triangles, double interval)
        : folder_(folder), name_(std::move(name)), triangles_(std::move(triangles)), interval_(interval) {
        std::error_code failed;
        if (!folder.empty()) std::filesystem::create_directories(folder, failed);
        if (failed) throw std::runtime_error("cannot make the folder " + folder.string());
    }

    [[nodiscard]] bool due(double time) const {
        return !folder_.empty() && (times_.empty() || time > times_.back() + interval_ * (1 - 1e-9));
    }

    /// The state at `time` [s], moved by `shift` [m]. The series is whole after each, should the program end.
    void add(double time, SurfaceState state, const Eigen::Vector3d& shift = Eigen::Vector3d::Zero()) {
        times_.push_back(time);
        state.points.colwise() += shift;
        write_vtp(folder_ / vtp(times_.size() - 1), triangles_, state);
        std::string text = "<?xml version='1.0'?>\n<VTKFile type='Collection' version='0.1'>\n<Collection>\n";
        for (std::size_t i = 0; i < times_.size(); ++i) {
            text += "<DataSet timestep='";
            detail::append_number(text, times_[i]);
            text += "' part='0' file='" + vtp(i) + "'/>\n";
        }
        detail::save(folder_ / (name_ + ".pvd"), text + "</Collection>\n</VTKFile>\n");
        const double farthest = state.displacement.colwise().norm().maxCoeff();
        if (farthest < farthest_) return;
        farthest_ = farthest;
        write_ply(folder_ / (name_ + ".ply"), triangles_, state);
    }

  private:
    [[nodiscard]] std::string vtp(std::size_t i) const { return name_ + '_' + std::to_string(i) + ".vtp"; }

    std::filesystem::path folder_;
    std::string name_;
    membrane::Triangles triangles_;
    double interval_, farthest_ = 0;
    std::vector<double> times_;
};

}  // namespace examples
