// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <membrane/membrane.hpp>
#include <membrane/solve/tool_friction.hpp>
#include <membrane/tear/cohesive_springs.hpp>
#include <membrane/tear/tearable_springs.hpp>
#include <membrane/tear/tearing.hpp>
#include <membrane/tissue/foundation_layer.hpp>
#include <membrane/tissue/tissue.hpp>

#include "arrays.hpp"
#include "documentation.hpp"
#include "instances.hpp"
#include "springs.hpp"

/// What the classes of Python hold. Numbers are doubles; where the library has a type parameter there is a variant.
namespace membrane_python {

using membrane::refuse;
using Mesh = membrane::TriangleMesh<double>;
using Tool = membrane::Tool<double>;
using Grasp = membrane::Grasp<double>;
using StepReport = membrane::StepReport<double>;
using SolverOptions = membrane::SolverOptions<double>;

/// Which surface a part is of: its triangles, and the events of a tear that it has followed. For a part of another
/// surface, or that has missed an event, an index may be out of range.
class SurfaceVersion {
  public:
    SurfaceVersion() = default;
    explicit SurfaceVersion(const Mesh& mesh);

    /// After an event.
    [[nodiscard]] SurfaceVersion after(const membrane::TearEvent<double>& event) const;

    /// Number of events.
    [[nodiscard]] Index events() const noexcept { return events_; }

    friend bool operator==(const SurfaceVersion&, const SurfaceVersion&) = default;

  private:
    void add(Index number) noexcept { hash_ = (hash_ ^ static_cast<std::uint32_t>(number)) * 1099511628211U; }

    std::uint64_t hash_ = 14695981039346656037U;  // FNV-1a
    Index events_ = 0;
};

/// Refuses a part that has not followed the tear as the others have.
void check_version(std::string_view component, std::string_view what, const SurfaceVersion& found,
                   const SurfaceVersion& expected);

template <class Law>
using SpringsOf = membrane::MassSpringNetwork<double, Law>;
template <class Law>
using TearableOf = membrane::TearableSprings<double, Law>;
template <class Network>
inline constexpr bool is_tearable = false;
template <class Law>
inline constexpr bool is_tearable<TearableOf<Law>> = true;

/// Springs of one law, or those that may tear, or a tissue of these. Linear ones alone are updated several at a time.
struct Network {
    std::variant<SpringsOf<membrane::LinearSpring>, SpringsOf<AnySpring>, TearableOf<membrane::LinearSpring>,
                 TearableOf<AnySpring>, membrane::Tissue<TearableOf<membrane::LinearSpring>>,
                 membrane::Tissue<TearableOf<AnySpring>>>
        any;
    SurfaceVersion version = {};

    [[nodiscard]] Index vertex_count() const {
        return std::visit([](const auto& network) { return network.vertex_count(); }, any);
    }
    /// Throws the error that a law of Python has raised.
    void rethrow() const {
        const auto rethrow_of = [](const auto& network) {
            if constexpr (std::same_as<std::remove_cvref_t<decltype(network.law())>, AnySpring>) {
                if (const auto* law = std::get_if<PythonSpring>(&network.law().law)) law->rethrow();
            }
        };
        std::visit(rethrow_of, any);
    }
};

///@{
/// The networks' classes of Python.
struct PlainSprings : Network {};
struct TearableSprings : PlainSprings {};
struct Tissue : Network {};
///@}

struct Foundation {
    std::variant<membrane::VirtualVolumeSprings<double>, membrane::FoundationSprings<double>, membrane::NoFoundation,
                 membrane::CohesiveSprings<double>>
        any;
    SurfaceVersion version = {};  // of no meaning for `NoFoundation`

    [[nodiscard]] Index vertex_count(Index otherwise) const {
        const auto count = [&](const auto& volume) {
            if constexpr (requires { volume.anchors(); }) return static_cast<Index>(volume.anchors().cols());
            return otherwise;
        };
        return std::visit(count, any);
    }
};

///@{
/// The foundations' classes of Python.
struct VolumeSprings : Foundation {};
struct LayerSprings : Foundation {};
struct NoSprings : Foundation {};
struct CohesiveSprings : Foundation {
    [[nodiscard]] auto& springs() { return std::get<membrane::CohesiveSprings<double>>(any); }
    [[nodiscard]] const auto& springs() const { return std::get<membrane::CohesiveSprings<double>>(any); }
};
///@}

/// A contact and the mesh it belongs to.
struct Contact : membrane::Contact<double> {
    Index vertex_count = 0;
};

/// Normals, boxes, tracker, grasper: with the number of vertices, so that arrays are checked.
struct Normals {
    membrane::VertexNormals<double> normals;
    Index vertex_count;
    SurfaceVersion version;
};
struct Tree {
    membrane::AabbTree<double> tree;
    Index vertex_count;
    SurfaceVersion version;
};
struct Tracker {
    membrane::ContactTracker<double> tracker;
    Index vertex_count;
    SurfaceVersion version;
    Contact contact = {};  // of the last update
};
struct Forceps {
    membrane::Grasper<double> grasper;
    Index vertex_count;
    SurfaceVersion version;
    Grasp grasp = {};  // of the last update
};

using ToolFriction = membrane::ToolFriction<double>;

/// A constraint of a step.
struct Acting {
    using Any = std::variant<membrane::ToolContact<double>, membrane::PointAttachment<double>,
                             membrane::VertexAttachment<double>, membrane::PinnedVertices, membrane::PointLoad<double>,
                             membrane::FrictionalContact<double>, membrane::LigamentForces<double>>;

    Any any;
    py::object contact = {};                              // keeps the memory of a tool's contact
    std::shared_ptr<const std::vector<Index>> pins = {};  // memory of pinned vertices
    Index vertex_count = membrane::no_index;              // of the mesh of contact or tear
    py::object owner = {};                                // keeps the memory of friction or ligaments

    [[nodiscard]] membrane::ConstraintRef<double> reference() const {
        return std::visit([](const auto& one) { return membrane::ConstraintRef<double>(one); }, any);
    }
    /// The friction that acts, or null.
    [[nodiscard]] const ToolFriction* friction() const {
        const auto* frictional = std::get_if<membrane::FrictionalContact<double>>(&any);
        return frictional == nullptr ? nullptr : frictional->friction;
    }
};

struct Solver;
struct Tear;

///@{
/// Classes of the loop.
template <>
inline constexpr bool is_in_loop<Tool> = true;
template <>
inline constexpr bool is_in_loop<Grasp> = true;
template <>
inline constexpr bool is_in_loop<StepReport> = true;
template <>
inline constexpr bool is_in_loop<Network> = true;
template <>
inline constexpr bool is_in_loop<Foundation> = true;
template <>
inline constexpr bool is_in_loop<Contact> = true;
template <>
inline constexpr bool is_in_loop<Normals> = true;
template <>
inline constexpr bool is_in_loop<Tree> = true;
template <>
inline constexpr bool is_in_loop<Tracker> = true;
template <>
inline constexpr bool is_in_loop<Forceps> = true;
template <>
inline constexpr bool is_in_loop<Acting> = true;
template <>
inline constexpr bool is_in_loop<Solver> = true;
template <>
inline constexpr bool is_in_loop<ToolFriction> = true;
template <>
inline constexpr bool is_in_loop<Tear> = true;
///@}

inline constexpr std::size_t max_constraints = membrane::max_constraints;

/// A constraint or none, for functions that take their constraints one by one: there are always `max_constraints`.
class Described : public membrane::ConstraintRef<double> {
  public:
    Described() : ConstraintRef(none) {}
    explicit Described(const Acting& acting) : ConstraintRef(acting.reference()), acting_(&acting) {}

    /// What is described. @pre it is not none
    [[nodiscard]] const Acting& acting() const noexcept { return *acting_; }

    template <class Terms>
    friend void describe(const Described& constraint, Terms& terms) {
        if (constraint.acting_ == nullptr) return;
        const auto describe_one = [&](const auto& one) {
            if constexpr (requires { describe(one, terms); }) describe(one, terms);
        };
        std::visit(describe_one, constraint.acting_->any);
    }

  private:
    inline static const membrane::PointAttachment<double> none{};
    const Acting* acting_ = nullptr;
};

/// The constraints among the arguments of a call; behind them, none.
struct Constraints {
    std::array<Described, max_constraints> all = {};
    std::size_t count = 0;

    /// @throws InvalidInput if one is of another mesh, there are too many, or two have the same friction
    Constraints(std::string_view component, const py::args& arguments, Index vertex_count);

    /// @throws InvalidInput if one acts in a step alone
    void check_static(std::string_view component) const;
};

/// Options of the solver, as keywords of Python.
[[nodiscard]] inline auto solver_keywords() {
    return Keywords("SolverOptions", std::pair("layers", &SolverOptions::layers),
                    std::pair("adaptive_layers", &SolverOptions::adaptive_layers),
                    std::pair("sweeps", &SolverOptions::sweeps),
                    std::pair("contact_iterations", &SolverOptions::contact_iterations),
                    std::pair("order", &SolverOptions::order), std::pair("predict", &SolverOptions::predict),
                    std::pair("max_vertex_updates", &SolverOptions::max_vertex_updates),
                    std::pair("force_tolerance", &SolverOptions::force_tolerance),
                    std::pair("rigid_stiffness", &SolverOptions::rigid_stiffness),
                    std::pair("max_contact_points", &SolverOptions::max_contact_points),
                    std::pair("max_packed_vertices", &SolverOptions::max_packed_vertices));
}

using Rule = std::variant<membrane::BlockStep, membrane::SafeStep, membrane::MassStep>;

/// Refuses a membrane whose parts are of different meshes, or have not followed the same events of a tear.
void check_fit(std::string_view component, Index vertex_count, Eigen::Index points, const Network& network,
               const Foundation& foundation);

///@{
/// What each source file adds to the module.
void bind_surface(py::module_& module);
void bind_mesh_check(py::module_& module);
void bind_meshing(py::module_& module);
void bind_model(py::module_& module);
void bind_material(py::module_& module);
void bind_contact(py::module_& module);
void bind_solve(py::module_& module);
void bind_coarse(py::module_& module);
void bind_tear(py::module_& module);
void bind_haptics(py::module_& module);
void bind_recording(py::module_& module);
void bind_equilibrium(py::module_& module);
void bind_error_bound(py::module_& module);
void bind_settings(py::module_& module);
void bind_calibration(py::module_& module);
///@}

}  // namespace membrane_python
