// SPDX-License-Identifier: MIT
#include <filesystem>
#include <fstream>

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <membrane/replay/recording.hpp>
#include <membrane/replay/recording_file.hpp>

#include "types.hpp"

namespace membrane_python {

namespace {

using Recording = membrane::Recording<double>;
using Recorder = membrane::Recorder<double>;
using Replay = membrane::ReplayDevice<double>;

/// Opens a file, or throws.
template <class File>
[[nodiscard]] File open(const std::filesystem::path& path) {
    File file(path, std::ios::binary);
    if (!file) throw std::filesystem::filesystem_error("cannot open", path, std::make_error_code(std::errc::io_error));
    return file;
}

/// A row of three for each tick.
template <class Part>
[[nodiscard]] FloatArray rows_of(const Recording& recording, Part part) {
    Points rows(3, static_cast<Eigen::Index>(recording.ticks.size()));
    for (std::size_t i = 0; i < recording.ticks.size(); ++i)
        rows.col(static_cast<Eigen::Index>(i)) = part(recording.ticks[i]).eigen();
    return copy(rows);
}

}  // namespace

void bind_recording(py::module_& module) {
    py::class_<Recording>(module, "Recording", doc("Recording"))
        .def_readonly("vertex_count", &Recording::vertex_count, doc("Recording::vertex_count"))
        .def("__len__", [](const Recording& self) { return self.ticks.size(); })
        .def_property_readonly(
            "tools",
            [](const Recording& self) {
                std::vector<Tool> tools;
                for (const auto& tick : self.ticks) tools.push_back(tick.tool);
                return tools;
            },
            "The tool of each tick.")
        .def_property_readonly(
            "times",
            [](const Recording& self) {
                std::vector<double> times;
                for (const auto& tick : self.ticks) times.push_back(tick.tool.time);
                return copy(times);
            },
            "The time of each tick [s].")
        .def_property_readonly(
            "positions",
            [](const Recording& self) { return rows_of(self, [](const auto& t) { return t.tool.position; }); },
            "The tool's position in each tick [m].")
        .def_property_readonly(
            "forces", [](const Recording& self) { return rows_of(self, [](const auto& tick) { return tick.force; }); },
            "The force written in each tick [N].");
    py::class_<Recorder>(module, "Recorder", doc("Recorder"))
        .def(py::init<std::size_t, Index>(), py::arg("max_ticks"), py::arg("vertex_count"), doc("Recorder::Recorder"))
        .def("add", &Recorder::add, py::arg("tool"), py::arg("force"), doc("Recorder::add"))
        .def("__len__", &Recorder::size)
        .def_property_readonly("missed", &Recorder::missed, doc("Recorder::missed"))
        .def("recording", &Recorder::recording, doc("Recorder::recording"))
        .def("clear", &Recorder::clear, doc("Recorder::clear"));
    py::class_<Replay>(module, "ReplayDevice", doc("ReplayDevice"))
        .def(py::init<Recording>(), py::arg("recording"), doc("ReplayDevice::ReplayDevice"))
        .def_property_readonly("running", &Replay::running, doc("ReplayDevice::running"))
        .def("read", &Replay::read, doc("ReplayDevice::read"))
        .def("write", &Replay::write, py::arg("force"), doc("ReplayDevice::write"))
        .def_property_readonly("differing", &Replay::differing, doc("ReplayDevice::differing"))
        .def_property_readonly("first_difference", &Replay::first_difference, doc("ReplayDevice::first_difference"))
        .def("reset", &Replay::reset, doc("ReplayDevice::reset"));
    module.def(
        "write_recording",
        [](const std::filesystem::path& path, const Recording& recording) {
            auto file = open<std::ofstream>(path);
            membrane::write_recording(file, recording);
        },
        py::arg("path"), py::arg("recording"), "Writes a recording, bit for bit.");
    module.def(
        "read_recording",
        [](const std::filesystem::path& path, Index vertex_count) {
            auto file = open<std::ifstream>(path);
            return membrane::read_recording<double>(file, vertex_count);
        },
        py::arg("path"), py::arg("vertex_count") = membrane::no_index, doc("read_recording"));
    module.def(
        "write_csv",
        [](const std::filesystem::path& path, const Recording& recording) {
            auto file = open<std::ofstream>(path);
            membrane::write_csv(file, recording);
        },
        py::arg("path"), py::arg("recording"), doc("write_csv"));
}

}  // namespace membrane_python
