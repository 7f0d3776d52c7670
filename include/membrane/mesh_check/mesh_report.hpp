// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <membrane/core/check.hpp>
#include <membrane/mesh_check/surface_facts.hpp>
#include <membrane/surface/mesh_defect.hpp>

/// Facts and defects of a mesh.
///
///     const membrane::MeshReport report = membrane::validate(x, triangles);
///     std::cout << to_string(report);
namespace membrane {

/// One defect and its location.
struct MeshFinding {
    MeshDefect defect;  ///< Its kind.
    ///@{
    /// Those concerned; empty if it is the whole mesh.
    std::vector<Index> vertices, triangles;
    ///@}
    std::string text;  ///< Says what was found and what is expected.
};

/// Facts and defects of a mesh.
struct MeshReport {
    SurfaceFacts facts;                                   ///< Of the triangles with three different vertices.
    std::vector<MeshFinding> findings;                    ///< In the order of the search; limited for each kind.
    std::array<std::size_t, mesh_defect_count> counts{};  ///< Of each kind, listed or not.
    bool complete = true;                                 ///< False: a search stopped early, there may be more.
    std::vector<MeshDefect> unfinished;                   ///< The kinds of the searches that stopped early.

    /// Number of defects of one kind, listed or not.
    [[nodiscard]] std::size_t count(MeshDefect defect) const noexcept {
        return counts[static_cast<std::size_t>(defect)];
    }

    /// Whether no defect has been found.
    [[nodiscard]] bool empty() const noexcept {
        return std::all_of(counts.begin(), counts.end(), [](std::size_t count) { return count == 0; });
    }

    /// Whether no error has been found: `TriangleMesh` takes the mesh.
    [[nodiscard]] bool valid() const noexcept {
        for (std::size_t i = 0; i < mesh_defect_count; ++i) {
            if (counts[i] > 0 && severity(static_cast<MeshDefect>(i)) == Severity::error) return false;
        }
        return true;
    }
};

/// A line for each kind, with its number and remedy; then one for each of the first ten findings of a kind.
[[nodiscard]] inline std::string to_string(const MeshReport& report) {
    constexpr std::size_t most = 10;
    std::string text, list;
    for (std::size_t i = 0; i < mesh_defect_count; ++i) {
        const auto defect = static_cast<MeshDefect>(i);
        if (report.counts[i] == 0) continue;
        text += severity(defect) == Severity::error ? "error: " : "warning: ";
        const bool counts_parts = defect == MeshDefect::several_components;  // one finding names them all
        const auto number = counts_parts ? std::to_string(report.facts.components) : std::to_string(report.counts[i]);
        (((((text += name(defect)) += ": ") += number) += "; ") += remedy(defect)) += "\n";
        std::size_t listed = 0;
        for (const MeshFinding& finding : report.findings) {
            if (finding.defect != defect || listed == most) continue;
            (((list += name(defect)) += ": ") += finding.text) += "\n";
            ++listed;
        }
        if (report.counts[i] > listed) {
            (((list += name(defect)) += ": ") += std::to_string(report.counts[i] - listed)) += " more\n";
        }
    }
    for (const MeshDefect defect : report.unfinished) {
        ((text += "search stopped at its limit, there may be more: ") += name(defect)) += "\n";
    }
    return text + list;
}

namespace detail {

/// Records the findings of the checks.
class Recorder {
  public:
    Recorder(MeshReport& report, Index max_findings_per_kind)
        : report_(&report), max_findings_per_kind_(max_findings_per_kind) {}

    template <class... Parts>
    void operator()(MeshDefect defect, std::vector<Index> vertices, std::vector<Index> triangles,
                    const Parts&... parts) const {
        const std::size_t count = ++report_->counts[static_cast<std::size_t>(defect)];
        if (count > static_cast<std::size_t>(max_findings_per_kind_)) return;
        std::string text;
        (append(text, parts), ...);
        report_->findings.push_back({defect, std::move(vertices), std::move(triangles), std::move(text)});
    }

  private:
    MeshReport* report_;
    Index max_findings_per_kind_;
};

}  // namespace detail

}  // namespace membrane
