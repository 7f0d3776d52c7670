// SPDX-License-Identifier: MIT
#include <pybind11/stl.h>

#include "coarse.hpp"
#include "loop_call.hpp"
#include "solver.hpp"

namespace membrane_python {

namespace {

using Surface = membrane::TornSurface<double>;
using Tip = membrane::TearTip<double>;
using Border = membrane::BorderState<double>;
using membrane::EnergyRelease;
using membrane::LargestTension;
using membrane::TearOptions;

/// An event with memory of its own.
class Event {
  public:
    Event(const membrane::TearEvent<double>& event, const SurfaceVersion& before)
        : event_(event),
          triangles_(event.split.triangles.begin(), event.split.triangles.end()),
          corners_(event.split.corners.begin(), event.split.corners.end()),
          reshaped_(event.moved.triangles.begin(), event.moved.triangles.end()),
          before_(before),
          after_(before.after(event)) {
        event_.split.triangles = triangles_;
        event_.split.corners = corners_;
        event_.moved.triangles = reshaped_;
    }
    Event(const Event&) = delete;
    Event& operator=(const Event&) = delete;

    [[nodiscard]] const membrane::TearEvent<double>& event() const noexcept { return event_; }
    [[nodiscard]] const SurfaceVersion& before() const noexcept { return before_; }
    [[nodiscard]] const SurfaceVersion& after() const noexcept { return after_; }

  private:
    membrane::TearEvent<double> event_;
    std::vector<Index> triangles_;
    std::vector<std::array<Index, 3>> corners_;
    std::vector<membrane::ReshapedTriangle<double>> reshaped_;
    SurfaceVersion before_, after_;
};
using Events = std::vector<std::unique_ptr<Event>>;

}  // namespace

/// Tears by one of the criteria.
struct Tear {
    std::variant<membrane::Tearing<double, EnergyRelease>, membrane::Tearing<double, LargestTension>> any;
    Index vertex_count;
    SurfaceVersion version;

    /// What `of(tearing)` is.
    template <class Of>
    [[nodiscard]] decltype(auto) get(Of of) const {
        return std::visit(of, any);
    }
    [[nodiscard]] const Surface& surface() const {
        return get([](const auto& one) -> const Surface& { return one.surface(); });
    }
    /// The events of a call, which the parts are to follow.
    [[nodiscard]] Events to_follow(std::span<const membrane::TearEvent<double>> events) {
        Events list;
        for (const auto& event : events) {
            list.push_back(std::make_unique<Event>(event, version));
            version = list.back()->after();
        }
        return list;
    }
};

namespace {

constexpr auto component = "Tearing";

/// The surface of a tear, with the events that it has followed.
struct TornSurface {
    const Tear* tear;

    [[nodiscard]] const Surface& surface() const { return tear->surface(); }
};

/// Refuses what is not of the tear's mesh, or has not followed it.
void check_state(std::string_view where, const Tear& self, const Positions& x, const Network& network) {
    check_count(where, "x", x.count, self.vertex_count);
    check_count(where, "the network", network.vertex_count(), self.vertex_count);
    check_version(where, "the network", network.version, self.version);
}

/// What `of(springs)` is, for springs that may tear. @throws also what a law of Python raises
template <class Of>
[[nodiscard]] auto of_springs(std::string_view where, const Network& network, Of of) {
    using Result = decltype(of(std::get<TearableOf<membrane::LinearSpring>>(network.any)));
    Result result = std::visit(
        [&]<class Springs>(const Springs& springs) -> Result {
            if constexpr (membrane::FollowsSplit<Springs>) {
                return of(springs);
            } else {
                refuse(where, "the network must be TearableSprings or a Tissue, got a MassSpringNetwork");
            }
        },
        network.any);
    network.rethrow();
    return result;
}

[[nodiscard]] Events update(Tear& self, MovingPositions x, double dt, const Network& network,
                            const Foundation& foundation, const std::vector<Index>& held) {
    check_fit(component, self.vertex_count, x.count, network, foundation);
    check_version(component, "the network", network.version, self.version);
    auto events = std::visit(
        [&]<class Springs>(auto& tearing, const Springs& springs, const auto& volume) -> Events {
            if constexpr (membrane::FollowsSplit<Springs>) {
                return self.to_follow(tearing.update(x.map(), dt, springs, volume, held));
            } else {
                refuse(component, "the network must be TearableSprings or a Tissue, got a MassSpringNetwork");
            }
        },
        self.any, network.any, foundation.any);
    if (events.empty()) network.rethrow();  // else the next call raises it: these events are to be followed
    return events;
}

///@{
/// Whether a class of Python may follow a tear, and its part that does.
[[nodiscard]] auto& part_of(Normals& of) { return of.normals; }
[[nodiscard]] auto& part_of(Tree& of) { return of.tree; }
[[nodiscard]] auto& part_of(Tracker& of) { return of.tracker; }
[[nodiscard]] auto& part_of(Forceps& of) { return of.grasper; }
[[nodiscard]] auto& part_of(ToolFriction& of) { return of; }
[[nodiscard]] auto& part_of(Solver& of) { return of.any; }
[[nodiscard]] auto& part_of(Coarse& of) { return of.coarse; }
[[nodiscard]] auto& part_of(Network& of) { return of.any; }
[[nodiscard]] auto& part_of(Foundation& of) { return of.any; }
///@}

template <class Part>
inline constexpr bool follows = membrane::FollowsSplit<Part> || membrane::FollowsMovedVertex<Part, double>;

/// The version of a part, or null for one that is of no mesh: a friction. Each point that it keeps names its triangle
/// and corners, and acts at a contact point that has the same ones.
template <class Class>
[[nodiscard]] SurfaceVersion* version_of(Class& of) {
    if constexpr (requires { of.version; }) {
        return &of.version;
    } else {
        return nullptr;
    }
}

/// Calls `act(part, version)` for what an object holds.
template <class Act>
void with_part(const py::handle& object, Act act) {
    const auto refuse_part = [&] {
        throw py::type_error("this part does not follow a tear: " +
                             py::cast<std::string>(py::type::handle_of(object).attr("__name__")));
    };
    const auto act_if_follows = [&](auto& part, SurfaceVersion* version) {
        if constexpr (follows<std::remove_reference_t<decltype(part)>>) {
            act(part, version);
        } else {
            refuse_part();
        }
    };
    const auto try_class = [&]<class Class>(std::type_identity<Class>) {
        if (!py::isinstance<Class>(object)) return false;
        auto& of = object.cast<Class&>();
        auto& part = part_of(of);
        if constexpr (requires { part.index(); }) {
            std::visit([&](auto& one) { act_if_follows(one, version_of(of)); }, part);
        } else {
            act_if_follows(part, version_of(of));
        }
        return true;
    };
    const auto try_classes = [&]<class... Class>(std::type_identity<Class>... classes) {
        return (try_class(classes) || ...);
    };
    const bool found =
        try_classes(std::type_identity<Network>(), std::type_identity<Foundation>(), std::type_identity<Solver>(),
                    std::type_identity<Tree>(), std::type_identity<Tracker>(), std::type_identity<Forceps>(),
                    std::type_identity<Normals>(), std::type_identity<ToolFriction>(), std::type_identity<Coarse>());
    if (!found) refuse_part();
}

/// All parts, or none: an error leaves each as it was.
void follow(const Event& event, const py::args& parts) {
    for (std::size_t i = 0; i < parts.size(); ++i) {
        with_part(parts[i], [&](const auto&, const SurfaceVersion* version) {
            if (version == nullptr || *version == event.before()) return;
            refuse("follow", "part ", i, " must be of the tear's mesh and have followed its ", event.before().events(),
                   " events before this one, got ", version->events());
        });
        for (std::size_t k = 0; k < i; ++k) {
            if (parts[i].is(parts[k])) refuse("follow", "parts must be different, got the same for ", k, " and ", i);
        }
    }
    for (const auto& part : parts) {
        with_part(part, [&](auto& one, SurfaceVersion* version) {
            membrane::follow(event.event(), one);
            if (version != nullptr) *version = event.after();
        });
    }
}

void bind_criteria(py::module_& module) {
    py::class_<EnergyRelease>(module, "EnergyRelease", doc("EnergyRelease"))
        .def(py::init([](double toughness, double thickness) {
                 const EnergyRelease criterion{.toughness = toughness, .thickness = thickness};
                 criterion.validate();
                 return criterion;
             }),
             py::kw_only(), py::arg("toughness"), py::arg("thickness"), doc("EnergyRelease::validate"))
        .def_readonly("toughness", &EnergyRelease::toughness, doc("EnergyRelease::toughness"))
        .def_readonly("thickness", &EnergyRelease::thickness, doc("EnergyRelease::thickness"));
    py::class_<LargestTension>(module, "LargestTension", doc("LargestTension"))
        .def(py::init([](double strength) {
                 const LargestTension criterion{.strength = strength};
                 criterion.validate();
                 return criterion;
             }),
             py::kw_only(), py::arg("strength"), doc("LargestTension::validate"))
        .def_readonly("strength", &LargestTension::strength, doc("LargestTension::strength"));
}

void bind_events(py::module_& module) {
    using membrane::VertexSplit;
    using Moved = membrane::MovedVertex<double>;
    py::class_<Moved>(module, "MovedVertex", doc("MovedVertex"))
        .def_readonly("vertex", &Moved::vertex, doc("MovedVertex::vertex"))
        .def_readonly("rest", &Moved::rest, doc("MovedVertex::rest"));
    py::class_<VertexSplit>(module, "VertexSplit", doc("VertexSplit"))
        .def_readonly("vertex", &VertexSplit::vertex, doc("VertexSplit::vertex"))
        .def_readonly("copy", &VertexSplit::copy, doc("VertexSplit::copy"))
        .def_property_readonly(
            "triangles", [](const py::object& self) { return view(self.cast<const VertexSplit&>().triangles, self); },
            doc("VertexSplit::triangles"))
        .def_readonly("area_share", &VertexSplit::area_share, doc("VertexSplit::area_share"));
    py::class_<Event>(module, "TearEvent", doc("TearEvent"))
        .def_property_readonly(
            "moved", [](const Event& self) -> const Moved& { return self.event().moved; }, doc("TearEvent::moved"))
        .def_property_readonly(
            "split", [](const Event& self) -> const VertexSplit& { return self.event().split; },
            doc("TearEvent::split"));
    module.def("follow", &follow, py::arg("event"), doc("follow"));
}

void check_vertex(std::string_view where, Index v, const Surface& surface) {
    const auto vertices = static_cast<Index>(surface.rest_positions().cols());
    if (v < 0 || v >= vertices) refuse(where, "vertices must be 0 to ", vertices - 1, ", got ", v);
}

/// What `of(surface, v)` is.
template <class Of>
[[nodiscard]] auto at_vertex(const TornSurface& self, Index v, Of of) {
    check_vertex("TornSurface", v, self.surface());
    return of(self.surface(), v);
}

void bind_torn_surface(py::module_& module) {
    py::class_<TornSurface>(module, "TornSurface", doc("TornSurface"))
        .def_property_readonly(
            "triangles",
            [](const py::object& self) { return view(self.cast<const TornSurface&>().surface().triangles(), self); },
            doc("TornSurface::triangles"))
        .def_property_readonly(
            "rest_positions",
            [](const py::object& self) {
                return view(self.cast<const TornSurface&>().surface().rest_positions(), self);
            },
            doc("TornSurface::rest_positions"))
        .def_property_readonly(
            "reserve", [](const TornSurface& self) { return self.surface().reserve(); }, doc("TornSurface::reserve"))
        .def(
            "has_inner_edge",
            [](const TornSurface& self, Index v, Index other) {
                return at_vertex(self, v, [&](const Surface& of, Index at) { return of.has_inner_edge(at, other); });
            },
            py::arg("v"), py::arg("other"), doc("TornSurface::has_inner_edge"))
        .def(
            "nearest_in_direction",
            [](const TornSurface& self, Index v, const Vector& direction) {
                return at_vertex(self, v,
                                 [&](const Surface& of, Index at) { return of.nearest_in_direction(at, direction); });
            },
            py::arg("v"), py::arg("direction"), doc("TornSurface::nearest_in_direction"))
        .def(
            "mean_edge",
            [](const TornSurface& self, Index v) {
                return at_vertex(self, v, [](const Surface& of, Index at) { return of.mean_edge(at); });
            },
            py::arg("v"), doc("TornSurface::mean_edge"))
        .def(
            "rest_normal",
            [](const TornSurface& self, Index v) {
                return at_vertex(self, v, [](const Surface& of, Index at) { return of.rest_normal(at); });
            },
            py::arg("v"), doc("TornSurface::rest_normal"));
    py::class_<Tip>(module, "TearTip", doc("TearTip"))
        .def_readonly("vertex", &Tip::vertex, doc("TearTip::vertex"))
        .def_readonly("behind", &Tip::behind, doc("TearTip::behind"))
        .def_readonly("heading", &Tip::heading, doc("TearTip::heading"))
        .def_readonly("advanced", &Tip::advanced, doc("TearTip::advanced"))
        .def_readonly("driving_force", &Tip::driving_force, doc("TearTip::driving_force"));
}

template <class Class>
void bind_tear_results(Class& tear) {
    tear.def_property_readonly(
            "tips",
            [](const Tear& self) {
                return self.get([](const auto& one) { return std::vector(one.tips().begin(), one.tips().end()); });
            },
            doc("Tearing::tips"))
        .def_property_readonly(
            "surface", py::cpp_function([](const Tear& self) { return TornSurface{&self}; }, py::keep_alive<0, 1>()),
            doc("Tearing::surface"))
        .def_property_readonly(
            "reserve_used_up",
            [](const Tear& self) { return self.get([](const auto& one) { return one.reserve_used_up(); }); },
            doc("Tearing::reserve_used_up"))
        .def_property_readonly(
            "torn_length", [](const Tear& self) { return self.get([](const auto& one) { return one.torn_length(); }); },
            doc("Tearing::torn_length"))
        .def_property_readonly(
            "dissipated", [](const Tear& self) { return self.get([](const auto& one) { return one.dissipated(); }); },
            doc("Tearing::dissipated"))
        .def(
            "stored",
            [](const Tear& self, Positions x) {
                check_count(component, "x", x.count, self.vertex_count);
                return self.get([&](const auto& one) { return one.stored(x.map()); });
            },
            py::arg("x"), doc("Tearing::stored"));
}

void bind_border(py::module_& module) {
    py::class_<Border>(module, "BorderState", doc("BorderState"))
        .def_readonly("along", &Border::along, doc("BorderState::along"))
        .def_readonly("inward", &Border::inward, doc("BorderState::inward"))
        .def_readonly("stretch", &Border::stretch, doc("BorderState::stretch"))
        .def_readonly("tension", &Border::tension, doc("BorderState::tension"))
        .def_readonly("energy", &Border::energy, doc("BorderState::energy"));
    module.def(
        "border_state",
        [](const TornSurface& surface, Index v, Positions x, const Network& network) {
            constexpr auto where = "border_state";
            check_vertex(where, v, surface.surface());
            check_state(where, *surface.tear, x, network);
            return of_springs(where, network, [&](const auto& springs) {
                return membrane::border_state<double>(surface.surface(), v, x.map(), springs);
            });
        },
        py::arg("surface"), py::arg("v"), py::arg("x"), py::arg("network"), doc("border_state"));
    module.def("flaw_driving_force", &membrane::flaw_driving_force<double>, py::arg("border"), py::arg("length"),
               doc("flaw_driving_force"));
}

template <class Class>
void bind_starts(Class& tear) {
    tear.def(
            "slit_at",
            [](const Tear& self, Index v, const Vector& direction) {
                return self.get([&](const auto& one) { return one.slit_at(v, direction); });
            },
            py::arg("v"), py::arg("direction"), doc("Tearing::slit_at"))
        .def(
            "slit_under",
            [](const Tear& self, const Contact& contact, const Vector& reaction, double force,
               const Vector& direction) {
                check_count(component, "the contact", contact.vertex_count, self.vertex_count);
                return self.get([&](const auto& one) { return one.slit_under(contact, reaction, force, direction); });
            },
            py::arg("contact"), py::arg("reaction"), py::arg("force"), py::arg("direction"), doc("Tearing::slit_under"))
        .def(
            "start_at",
            [](Tear& self, Index v, double flaw, Positions x, const Network& network) {
                check_vertex(component, v, self.surface());
                check_state(component, self, x, network);
                return of_springs(component, network, [&](const auto& springs) {
                    const auto start = [&](auto& one) {
                        const auto path = one.start_at(v, flaw, x.map(), springs);
                        return std::vector<Index>(path.begin(), path.end());
                    };
                    return std::visit(start, self.any);
                });
            },
            py::arg("v"), py::arg("flaw"), py::arg("x"), py::arg("network"), doc("Tearing::start_at"));
}

void bind_tearing(py::module_& module) {
    const Keywords options("TearOptions", std::pair("max_tips", &TearOptions::max_tips),
                           std::pair("patch_radius", &TearOptions::patch_radius),
                           std::pair("min_angle", &TearOptions::min_angle),
                           std::pair("move_vertices", &TearOptions::move_vertices));
    using Criterion = std::variant<EnergyRelease, LargestTension>;
    auto tear = py::class_<Tear>(module, "Tearing", doc("Tearing"));
    options.def_init(tear,
                     options.taking<const Mesh&, const Criterion&>([](const Mesh& mesh, const Criterion& criterion,
                                                                      const TearOptions& o) {
                         const auto build = [&](const auto& one) {
                             return Tear{membrane::Tearing(mesh, one, o), mesh.vertex_count(), SurfaceVersion(mesh)};
                         };
                         return std::visit(build, criterion);
                     }),
                     py::arg("mesh"), py::arg("criterion"));
    tear.def(
        "cut_along",
        [](Tear& self, const std::vector<Index>& path, MovingPositions x) {
            check_count(component, "x", x.count, self.vertex_count);
            return std::visit([&](auto& one) { return self.to_follow(one.cut_along(path, x.map())); }, self.any);
        },
        py::arg("path"), py::arg("x"), doc("Tearing::cut_along"));
    bind_starts(tear);
    def_in_loop(
        tear, "ligaments",
        [](const py::object& self) {
            const auto& of = self.cast<const Tear&>();
            return Acting{.any = of.get([](const auto& one) { return one.ligaments(); }),
                          .vertex_count = of.vertex_count,
                          .owner = self};
        },
        doc("Tearing::ligaments"));
    def_in_loop(
        tear, "update",
        [](Tear& self, MovingPositions x, double dt, const Network& network, const Foundation& foundation,
           const std::vector<Index>& held) { return update(self, x, dt, network, foundation, held); },
        py::arg("x"), py::arg("dt"), py::arg("network"), py::arg("foundation"), py::arg("held") = std::vector<Index>(),
        doc("Tearing::update"));
    bind_tear_results(tear);
}

}  // namespace

void bind_tear(py::module_& module) {
    bind_criteria(module);
    bind_events(module);
    bind_torn_surface(module);
    bind_border(module);
    bind_tearing(module);
}

}  // namespace membrane_python
