# SPDX-License-Identifier: MIT
"""Tears, adhesion and friction: what is checked, what is refused, what a view shows. Same bits: test_same_bits.py."""
import gc

import membrane
import numpy
import pytest


class Torn:
    """A stretched disc with a cut of four edges through its middle, which no part has followed yet."""

    def __init__(self, law=membrane.LinearSpring(), toughness=100.0, reserve=100, criterion=None):
        self.mesh = membrane.with_reserve(membrane.disc(radius=5e-3, rings=8), reserve)
        self.network = membrane.MassSpringNetwork(self.mesh, law, stiffness=20.0, pinned=membrane.border(self.mesh))
        self.springs = membrane.TearableSprings(self.mesh, self.network)
        self.solver = membrane.QuasiStaticSolver(self.springs, layers=12)
        self.foundation = membrane.VirtualVolumeSprings(self.mesh, stiffness=1e-3)
        self.tear = membrane.Tearing(
            self.mesh, criterion or membrane.EnergyRelease(toughness=toughness, thickness=1e-5))
        self.x = 1.3 * self.mesh.positions
        surface = self.tear.surface
        path = [surface.nearest_in_direction(surface.nearest_in_direction(0, (-1, 0, 0)), (-1, 0, 0))]
        while len(path) < 5:
            path.append(surface.nearest_in_direction(path[-1], (1, 0, 0)))
        self.path = path

    def cut(self):
        return self.tear.cut_along(self.path, self.x)

    def update(self):
        return self.tear.update(self.x, 1e-3, self.springs, self.foundation)

    def follow(self, events):
        for event in events:
            membrane.follow(event, self.springs, self.foundation, self.solver)

    def tick(self):
        report = self.solver.step(self.x, 1e-3, self.springs, self.foundation, self.tear.ligaments())
        self.follow(self.update())
        return report


def torn():
    disc = Torn()
    disc.follow(disc.cut())
    for _ in range(50):
        disc.tick()
    assert disc.tear.torn_length > 0
    return disc


def law_until(broken):
    """A linear spring, which raises an error once something is in `broken`."""

    def law(k, r, l):
        if broken:
            raise RuntimeError("what is a spring?")
        return k * (l - r), k, k * (l - r)**2 / 2

    return law


def test_a_cut_doubles_its_inner_vertices():
    disc = Torn()
    whole = disc.mesh.triangles.copy()
    events = disc.cut()
    assert [event.split.vertex for event in events] == disc.path[1:-1]
    assert [event.split.copy for event in events] == [217, 218, 219] and disc.tear.surface.reserve == 97
    assert all(event.moved.vertex == membrane.no_index and 0 < event.split.area_share < 1 for event in events)
    assert sorted(tip.vertex for tip in disc.tear.tips) == sorted([disc.path[0], disc.path[-1]])
    triangles = disc.tear.surface.triangles
    for event in events:
        assert numpy.array_equal(whole[event.split.triangles] == event.split.vertex,
                                 triangles[event.split.triangles] == event.split.copy)
    assert (triangles >= 217).sum() == sum(len(event.split.triangles) for event in events)
    assert numpy.array_equal(disc.x[217:220], disc.x[disc.path[1:-1]])


def test_the_surface_is_a_view_of_the_tear_by_now():
    disc = Torn()
    triangles, rest = disc.tear.surface.triangles, disc.tear.surface.rest_positions
    assert not (triangles >= 217).any()
    disc.follow(disc.cut())
    assert (triangles >= 217).any()
    before = rest.copy()
    for _ in range(50):
        disc.tick()
    assert (rest != before).any() and triangles.flags.owndata is False
    for array in (triangles, rest):
        with pytest.raises(ValueError):
            array[0, 0] = 1
    last = triangles.copy()
    del disc
    gc.collect()
    assert numpy.array_equal(triangles, last)


def test_an_event_has_memory_of_its_own():
    disc = Torn()
    events = disc.cut()
    split = [event.split.triangles for event in events]
    expected = [array.copy() for array in split]
    assert disc.tear.cut_along([0], disc.x) == []
    disc.follow(events)
    del disc, events
    gc.collect()
    assert all(numpy.array_equal(array, copy) for array, copy in zip(split, expected))


def test_a_path_that_cannot_be_cut_changes_nothing():
    disc = Torn(reserve=2)
    triangles, x = disc.tear.surface.triangles.copy(), disc.x.copy()
    for path in ([], [0], [0, 0, 1], [-1, 0, 1], [0, 10**6], numpy.array([0, 216], dtype=numpy.int32)):
        assert disc.tear.cut_along(path, disc.x) == [] and not disc.tear.reserve_used_up
    assert disc.cut() == [] and disc.tear.reserve_used_up  # needs 3
    assert disc.tear.tips == [] and numpy.array_equal(disc.x, x)
    assert numpy.array_equal(disc.tear.surface.triangles, triangles)
    assert disc.tear.slit_at(membrane.border(disc.mesh)[0], (1, 0, 0)) == [membrane.no_index] * 3
    assert disc.tear.slit_at(-1, (1, 0, 0)) == [membrane.no_index] * 3 and disc.tear.slit_at(0, (1, 0, 0))[1] == 0


def test_each_part_follows_each_event_once_and_in_order():
    disc = Torn()
    first, second, _ = disc.cut()
    with pytest.raises(membrane.InvalidInput, match="^follow: part 1 must be of .* followed its 1 events .* got 0"):
        membrane.follow(first, disc.springs)
        membrane.follow(second, disc.springs, disc.solver)
    membrane.follow(first, disc.solver)
    membrane.follow(second, disc.springs, disc.solver)  # the refused call has left the springs as they were
    for event in (first, second):
        with pytest.raises(membrane.InvalidInput, match="^follow: part 0 .* got 2"):
            membrane.follow(event, disc.springs)
    with pytest.raises(membrane.InvalidInput, match="parts must be different, got the same for 0 and 1"):
        membrane.follow(first, disc.foundation, disc.foundation)
    other = membrane.with_reserve(membrane.disc(radius=5e-3, rings=7), 148)
    assert other.vertex_count == disc.mesh.vertex_count
    with pytest.raises(membrane.InvalidInput, match="must be of the tear's mesh"):
        membrane.follow(first, membrane.AabbTree(other))


@pytest.mark.parametrize("part", [
    lambda disc: disc.network, lambda disc: membrane.NoFoundation(), lambda disc: disc.tear, lambda disc: disc.x,
    lambda disc: None])
def test_what_does_not_follow_is_refused(part):
    disc = Torn()
    event = disc.cut()[0]
    with pytest.raises(TypeError, match="this part does not follow a tear"):
        membrane.follow(event, disc.springs, part(disc))
    membrane.follow(event, disc.springs)  # it has not followed before


def test_a_part_that_has_missed_an_event_is_refused_by_the_tick():
    disc = Torn()
    tree, tracker, tool = membrane.AabbTree(disc.mesh), membrane.ContactTracker(disc.mesh), membrane.Tool()
    events = disc.cut()
    with pytest.raises(membrane.InvalidInput, match="^Tearing: the network must have followed the same 3 events"):
        disc.update()
    for event in events:
        membrane.follow(event, disc.springs, tree)
    for match, part in (("the foundation must have followed the same 3 events of a tear, got 0", disc.foundation),
                        ("the network must have followed the same 0 events of a tear, got 3", disc.solver)):
        with pytest.raises(membrane.InvalidInput, match=match):
            disc.solver.step(disc.x, 1e-3, disc.springs, disc.foundation)
        other = Torn()
        for event in other.cut():
            membrane.follow(event, part)
    with pytest.raises(membrane.InvalidInput, match="^ContactTracker: the tree must have followed"):
        tracker.update(tree, disc.x, tool)
    assert disc.tick().status == membrane.StepStatus.advanced
    later = membrane.QuasiStaticSolver(disc.springs)  # of springs as they are
    assert later.step(disc.x, 1e-3, disc.springs, disc.foundation).status == membrane.StepStatus.advanced


def test_the_tear_takes_less_energy_than_the_membrane_gives_up():
    """Nothing moves the border; the rest is what the quick advance of the tear leaves to the steps."""
    disc = Torn(toughness=900.0)
    disc.follow(disc.cut())

    def tick():
        disc.solver.wake_all()
        return disc.solver.step(disc.x, 1e-3, disc.springs, membrane.NoFoundation(), disc.tear.ligaments())

    while not tick().converged:
        pass
    before = disc.springs.energy(disc.x)
    for _ in range(1000):
        tick()
        disc.follow(disc.tear.update(disc.x, 1e-3, disc.springs, membrane.NoFoundation()))
    assert disc.tear.torn_length > 5e-3 and disc.tear.tips == []
    taken = disc.tear.dissipated + disc.tear.stored(disc.x)  # the last edge may not have opened
    assert 0 < taken < before - disc.springs.energy(disc.x)


class Strip:
    """A strip between clamps, stretched along x by 1.3."""

    def __init__(self, reserve=60, toughness=200.0):
        whole = membrane.sheet(width=8e-3, height=4e-3, columns=16, rows=8)
        clamps = numpy.flatnonzero(numpy.abs(whole.positions[:, 0]) > 3.9e-3).astype(numpy.int32)
        self.mesh = membrane.with_reserve(whole, reserve)
        self.network = membrane.MassSpringNetwork(self.mesh, stiffness=20.0, pinned=clamps)
        self.tissue = membrane.Tissue(membrane.TearableSprings(self.mesh, self.network))
        self.tear = membrane.Tearing(self.mesh, membrane.EnergyRelease(toughness=toughness, thickness=1e-5))
        self.x = self.mesh.positions * (1.3, 1, 1)

    def at(self, x, y):
        """The vertex that is nearest at rest."""
        vertices = self.mesh.vertex_count - self.tear.surface.reserve
        return int(numpy.argmin(((self.mesh.positions[:vertices] - (x, y, 0))**2).sum(axis=1)))

    def start(self, flaw, v=None):
        return self.tear.start_at(self.at(0, -2e-3) if v is None else v, flaw, self.x, self.tissue)


def test_the_state_of_a_border():
    strip = Strip()
    state = membrane.border_state(strip.tear.surface, strip.at(0, -2e-3), strip.x, strip.tissue)
    assert state.along == pytest.approx((1, 0, 0)) and state.inward == pytest.approx((0, 1, 0))
    assert state.stretch == pytest.approx(1.3) and state.tension > 0 and state.energy > 0
    force = membrane.flaw_driving_force(state, 0.3e-3)
    assert force == pytest.approx(2 * 1.1215**2 * numpy.pi / 1.3**0.5 * state.energy * 0.3e-3, rel=1e-12)
    inside = membrane.border_state(strip.tear.surface, strip.at(0, 0), strip.x, strip.tissue)
    assert not inside.along.any() and not inside.inward.any() and inside.energy == 0
    slack = membrane.border_state(strip.tear.surface, strip.at(0, -2e-3), strip.mesh.positions, strip.tissue)
    assert membrane.flaw_driving_force(slack, 0.3e-3) == 0


def test_a_tear_starts_where_a_flaw_releases_enough():
    strip = Strip()
    v = strip.at(0, -2e-3)
    state = membrane.border_state(strip.tear.surface, v, strip.x, strip.tissue)
    critical = 200.0 * 1e-5 / membrane.flaw_driving_force(state, 1.0)  # [m]
    assert strip.start(0.99 * critical) == []
    path = strip.start(1.01 * critical)
    rest = strip.mesh.positions
    assert path[0] == v and 2.02 * critical <= rest[path[-1], 1] - rest[v, 1] < 2.02 * critical + 0.75e-3
    for nothing in (0, -1e-3, numpy.inf, numpy.nan):
        assert strip.start(nothing) == []
    assert strip.start(1e-3, strip.at(0, 0)) == [] and strip.start(1e-3, strip.at(-4e-3, -2e-3)) == []
    events = strip.tear.cut_along(path, strip.x)
    assert len(events) == len(path) - 1 and [tip.vertex for tip in strip.tear.tips] == [path[-1]]
    short = Strip(reserve=1)
    assert short.start(1e-3) == [] and short.tear.reserve_used_up


def test_a_slit_under_a_tool_is_that_at_the_corner_nearest_to_the_contact():
    strip = Strip()
    tool = membrane.Tool(position=(2e-3, 0, 0.5e-3), radius=0.6e-3)
    tree, tracker = membrane.AabbTree(strip.mesh), membrane.ContactTracker(strip.mesh)
    tree.refit(strip.x)
    contact = tracker.update(tree, strip.x, tool)
    assert contact.touching
    nearest = contact.corners[int(numpy.argmax(contact.barycentric))]
    reaction = 0.02 * contact.normal
    for direction in ((1, 0, 0), (0, 1, 0)):
        slit = strip.tear.slit_under(contact, reaction, 0.0199, direction)
        assert slit == strip.tear.slit_at(nearest, direction) and slit[1] == nearest
    none = [membrane.no_index] * 3
    assert strip.tear.slit_under(contact, reaction, 0.0201, (1, 0, 0)) == none
    assert strip.tear.slit_under(contact, -reaction, 0.0199, (1, 0, 0)) == none
    assert strip.tear.slit_under(contact, (numpy.nan, 0, 0), 0.0, (1, 0, 0)) == none
    away = tracker.update(tree, strip.x, membrane.Tool(position=(0, 0, 1), radius=0.6e-3))
    assert strip.tear.slit_under(away, reaction, 0.0, (1, 0, 0)) == none


def test_arguments_of_a_start_are_checked():
    strip, other = Strip(), Torn()
    surface, x, tissue, v = strip.tear.surface, strip.x, strip.tissue, strip.at(0, -2e-3)
    calls = (("Tearing", strip.tear.start_at, (1e-3,)), ("border_state", membrane.border_state, ()))
    for name, call, flaw in calls:
        of = () if flaw else (surface,)
        count = strip.mesh.vertex_count
        for vertex in (-1, count):
            with pytest.raises(membrane.InvalidInput, match=f"^{name}: vertices must be 0 to {count - 1}, got"):
                call(*of, vertex, *flaw, x, tissue)
        with pytest.raises(membrane.InvalidInput, match=f"^{name}: x must have {count} vertices, got {count - 1}"):
            call(*of, v, *flaw, x[:-1], tissue)
        with pytest.raises(membrane.InvalidInput, match=f"^{name}: the network must have {count} vertices, got 317"):
            call(*of, v, *flaw, x, other.springs)
        with pytest.raises(membrane.InvalidInput, match=f"^{name}: the network must be TearableSprings or a Tissue"):
            call(*of, v, *flaw, x, strip.network)
    contact = membrane.ContactTracker(other.mesh).update(membrane.AabbTree(other.mesh), other.x, membrane.Tool())
    with pytest.raises(membrane.InvalidInput, match="^Tearing: the contact must have .* got 317"):
        strip.tear.slit_under(contact, (0, 0, 1), 0.5, (1, 0, 0))
    events = strip.tear.cut_along(strip.start(1e-3), x)
    assert len(events) > 1
    for name, call, flaw in calls:
        of = () if flaw else (surface,)
        with pytest.raises(membrane.InvalidInput, match=f"^{name}: the network must have followed the same .* got 0"):
            call(*of, v, *flaw, x, tissue)
    for event in events:
        membrane.follow(event, tissue)
    assert membrane.border_state(surface, v, x, tissue).stretch > 0


def test_an_error_of_a_law_is_raised_by_a_start():
    broken = []
    disc = Torn(membrane.PythonSpring(law_until(broken)))
    v = membrane.border(membrane.disc(radius=5e-3, rings=8))[0]
    assert membrane.border_state(disc.tear.surface, v, disc.x, disc.springs).tension > 0
    broken.append(True)
    with pytest.raises(RuntimeError, match="what is a spring"):
        membrane.border_state(disc.tear.surface, v, disc.x, disc.springs)


def test_a_friction_follows_a_tear():
    """Where a vertex under the tool becomes two, the copy is held at the same place, by its share of the force."""
    strip = Strip()
    tree, tracker = membrane.AabbTree(strip.mesh), membrane.ContactTracker(strip.mesh)
    solver = membrane.QuasiStaticSolver(strip.tissue, layers=membrane.unlimited, sweeps=8)
    friction, missed = membrane.ToolFriction(coefficient=0.4), membrane.ToolFriction(coefficient=0.4)
    tree.refit(strip.x)
    tool = membrane.Tool(position=(0, 0, 0.4e-3), radius=0.6e-3)
    for each in (missed, friction):
        press = each.press(tool, tracker.update(tree, strip.x, tool))
        solver.step(strip.x, 1e-3, strip.tissue, membrane.NoFoundation(), press)
        tree.refit(strip.x)
        assert each.vertices
    pressed = max(friction.vertices, key=lambda v: numpy.linalg.norm(v.normal_force))
    path = strip.tear.slit_at(pressed.vertex, (1, 0, 0))
    event, = strip.tear.cut_along(path, strip.x)
    with pytest.raises(membrane.InvalidInput, match="parts must be different, got the same for 0 and 1"):
        membrane.follow(event, friction, friction)
    membrane.follow(event, friction, strip.tissue, solver, tree, tracker)
    after = {v.vertex: v for v in friction.vertices}
    halves = [after[event.split.vertex], after[event.split.copy]]
    assert event.split.vertex == pressed.vertex
    assert all((half.offset == pressed.offset).all() for half in halves)
    numpy.testing.assert_allclose(sum(half.normal_force for half in halves), pressed.normal_force, rtol=1e-12)
    assert event.split.copy not in [v.vertex for v in missed.vertices]
    with pytest.raises(membrane.InvalidInput, match="part 1 must be of the tear's mesh"):
        membrane.follow(event, friction, strip.tissue)


def test_springs_after_a_tear():
    """Each spring of a torn surface is one of its edges; the forces of all sum up to zero."""
    disc = torn()
    triangles = disc.tear.surface.triangles
    edges = {tuple(sorted((a, b))) for f in triangles.tolist() for a, b in zip(f, f[1:] + f[:1])}
    assert {tuple(sorted(spring[:2])) for spring in disc.springs.springs} == edges
    forces = disc.springs.forces(disc.x)
    assert numpy.abs(forces.sum(axis=0)).max() < 1e-12 and not forces[-disc.tear.surface.reserve:].any()
    tissue = membrane.Tissue(membrane.TearableSprings(disc.mesh, disc.network))
    assert tissue.energy(disc.x) == disc.network.energy(disc.x) and tissue.springs == disc.network.springs
    assert isinstance(disc.springs, membrane.MassSpringNetwork) and isinstance(tissue, membrane.ElasticNetwork)


def test_an_error_of_a_law_is_raised_by_the_tear():
    broken = []
    disc = Torn(membrane.PythonSpring(law_until(broken)))
    disc.follow(disc.cut())
    assert disc.tick().status == membrane.StepStatus.advanced
    broken.append(True)
    with pytest.raises(RuntimeError, match="what is a spring"):
        disc.update()


@pytest.mark.parametrize("words, build", [
    (r"^EnergyRelease: toughness must be finite and positive \[J/m\^2\], got 0",
     lambda mesh: membrane.EnergyRelease(toughness=0, thickness=1)),
    (r"^LargestTension: strength must be finite and positive \[N/m\], got nan",
     lambda mesh: membrane.LargestTension(strength=numpy.nan)),
    (r"^Tearing: patch_radius must be 2 to 100 \[edges\], got 1",
     lambda mesh: membrane.Tearing(mesh, membrane.LargestTension(strength=1), patch_radius=1)),
    (r"^Tearing: max_tips must be at least 1, got 0",
     lambda mesh: membrane.Tearing(mesh, membrane.LargestTension(strength=1), max_tips=0)),
    (r"^with_reserve: count must not be negative, got -1", lambda mesh: membrane.with_reserve(mesh, -1)),
    (r"^TearableSprings: network must be of the mesh of 217 vertices, got one of 42",
     lambda mesh: membrane.TearableSprings(
         mesh, membrane.MassSpringNetwork(membrane.icosphere(subdivisions=1), stiffness=1.0))),
    (r"^TearableSprings: network must be a MassSpringNetwork, got one that tears",
     lambda mesh: membrane.TearableSprings(mesh, Torn().springs)),
    (r"^CohesiveSprings: strength \[Pa\] is required",
     lambda mesh: membrane.CohesiveSprings(mesh, stiffness=1.0, energy=1.0)),
    (r"^CohesiveSprings: strength of vertex 0 must be below sqrt\(2 energy stiffness\)",
     lambda mesh: membrane.CohesiveSprings(mesh, stiffness=1.0, energy=1.0, strength=2.0)),
    (r"^ToolFriction: coefficient must be at most 10, got 11", lambda mesh: membrane.ToolFriction(coefficient=11)),
    (r"^Grasper: jaw_length must be positive \[m\], got 0", lambda mesh: membrane.Grasper(mesh, jaw_length=0)),
])
def test_errors_have_the_words_of_the_library(words, build):
    with pytest.raises(membrane.InvalidInput, match=words):
        build(membrane.disc(rings=8))


def test_arguments_are_checked():
    disc = Torn()
    with pytest.raises(membrane.InvalidInput, match="^Tearing: x must have 317 vertices, got 316"):
        disc.tear.cut_along(disc.path, disc.x[:-1])
    with pytest.raises(membrane.InvalidInput, match="^Tearing: x must have 317"):
        disc.tear.stored(disc.x[:-1])
    with pytest.raises(membrane.InvalidInput, match="^Tearing: the network must be TearableSprings or a Tissue"):
        disc.tear.update(disc.x, 1e-3, disc.network, disc.foundation)
    with pytest.raises(TypeError, match="writeable"):
        disc.tear.update(disc.mesh.positions, 1e-3, disc.springs, disc.foundation)
    for vertex in (-1, 317):
        with pytest.raises(membrane.InvalidInput, match="^TornSurface: vertices must be 0 to 316"):
            disc.tear.surface.mean_edge(vertex)
    with pytest.raises(TypeError):
        membrane.EnergyRelease(toughness=1)
    with pytest.raises(TypeError):
        membrane.ToolFriction()
    with pytest.raises(TypeError):
        membrane.Tissue(disc.network)
    small = membrane.icosphere(subdivisions=1)
    network = membrane.MassSpringNetwork(small, stiffness=1.0)
    with pytest.raises(membrane.InvalidInput, match="the tear must have 42 vertices, got 317"):
        membrane.QuasiStaticSolver(network).step(small.positions.copy(), 1e-3, network, membrane.NoFoundation(),
                                                 disc.tear.ligaments())
    adhesion = membrane.CohesiveSprings(disc.mesh, stiffness=1.0, strength=0.5, energy=1.0)
    with pytest.raises(membrane.InvalidInput, match="^CohesiveSprings: moved vertices must be 0 to 316, got 317"):
        adhesion.update(disc.x, numpy.array([317], dtype=numpy.int32))


def test_what_is_static_refuses_what_is_not():
    disc = Torn()
    tool, press = membrane.Tool(radius=1e-3), membrane.ToolFriction(coefficient=0.3).press
    contact = membrane.ContactTracker(disc.mesh).update(membrane.AabbTree(disc.mesh), disc.x, tool)
    static = membrane.MassSpringNetwork(disc.mesh, stiffness=20.0)
    adhesion = membrane.CohesiveSprings(disc.mesh, stiffness=1.0, strength=0.5, energy=1.0)
    for constraint, words in ((press(tool, contact), "one with friction"), (disc.tear.ligaments(), "ligaments")):
        with pytest.raises(membrane.InvalidInput, match=f"^equilibrium: constraints .* got {words}"):
            membrane.equilibrium(disc.x, disc.mesh, static, disc.foundation, constraint)
        with pytest.raises(membrane.InvalidInput, match=f"^ErrorBound: constraints .* got {words}"):
            membrane.ErrorBound(static).compute(disc.x, static, disc.foundation, constraint)
    with pytest.raises(membrane.InvalidInput, match="^equilibrium: the network must .* got one that tears"):
        membrane.equilibrium(disc.x, disc.mesh, disc.springs, disc.foundation)
    with pytest.raises(membrane.InvalidInput, match="^equilibrium: the foundation .* got CohesiveSprings"):
        membrane.equilibrium(disc.x, disc.mesh, static, adhesion)
    with pytest.raises(membrane.InvalidInput, match="^ErrorBound: the springs must be linear, .* springs that tear"):
        membrane.ErrorBound(disc.springs)


def test_a_friction_acts_once_in_a_step():
    mesh = membrane.icosphere(subdivisions=2)
    network = membrane.MassSpringNetwork(mesh, stiffness=40.0)
    solver = membrane.QuasiStaticSolver(network)
    tool = membrane.Tool(position=(0, 0, 11e-3), radius=2e-3)
    contact = membrane.ContactTracker(mesh).update(membrane.AabbTree(mesh), mesh.positions, tool)
    friction, x = membrane.ToolFriction(coefficient=0.3), mesh.positions.copy()
    press = friction.press(tool, contact)
    with pytest.raises(membrane.InvalidInput, match="friction of its own, got the same for 0 and 2"):
        solver.step(x, 1e-3, network, membrane.NoFoundation(), press, membrane.pin([5]), friction.press(tool, contact))
    assert friction.vertices == [] and not friction.slips
    del friction
    gc.collect()  # the constraint keeps it
    report = solver.step(x, 1e-3, network, membrane.NoFoundation(), press)
    assert report.status == membrane.StepStatus.advanced and report.reactions[0][2] > 0


def test_adhesion_by_its_law():
    """One vertex drawn along its normal: K up to S, then linearly to zero at 2 G / S, with the area G."""
    mesh = membrane.sheet(width=2e-3, height=2e-3, columns=2, rows=2)
    stiffness, strength, energy = 1e8, 1e3, 0.05
    adhesion = membrane.CohesiveSprings(mesh, stiffness=stiffness, strength=strength, energy=energy)
    area = membrane.vertex_areas(mesh)[4]
    x = mesh.positions.copy()
    for opening in (0.5 * strength / stiffness, energy / strength, 2.1 * energy / strength):
        x[4, 2] = opening
        adhesion.update(x, numpy.array([4], dtype=numpy.int32))
        stress = min(stiffness * opening, strength * max(0.0, 1 - (opening - 1e-5) / (2 * energy / strength - 1e-5)))
        assert adhesion.energy(x)[4] == pytest.approx(area * stress * opening / 2, abs=1e-18)
        assert adhesion.damage[4] == pytest.approx(1 - stress / (stiffness * opening), abs=1e-12)
    assert adhesion.adheres.tolist() == [v != 4 for v in range(9)] and adhesion.adheres.dtype == bool
    assert adhesion.dissipated == pytest.approx(area * energy, rel=1e-12)
    adhesion.reset()
    assert adhesion.adheres.all() and adhesion.dissipated == 0 and not adhesion.damage.any()


def test_a_correction_follows_a_tear_and_is_refused_where_it_has_not():
    disc = Torn()
    coarse = membrane.CoarseCorrection(disc.mesh, disc.springs, disc.foundation, points=30)
    disc.solver.step(disc.x, 1e-3, disc.springs, disc.foundation)
    assert coarse.correct(disc.x, disc.solver).step_length <= 1
    for count, event in enumerate(disc.cut()):
        membrane.follow(event, disc.springs, disc.foundation, disc.solver)
        missed = f"CoarseCorrection: the solver must have followed the same {count} events of a tear, got {count + 1}"
        with pytest.raises(ValueError, match=missed):
            coarse.correct(disc.x, disc.solver)
        with pytest.raises(ValueError, match=missed):
            coarse.reaction_error(disc.x, disc.solver)
        membrane.follow(event, coarse)
    disc.solver.wake_all()
    disc.solver.step(disc.x, 1e-3, disc.springs, disc.foundation)
    report = coarse.correct(disc.x, disc.solver)
    assert report.corrected and numpy.isfinite(report.reaction_error).all()
    with pytest.raises(ValueError, match="x must"):
        coarse.correct(disc.x[1:], disc.solver)
    with pytest.raises(ValueError, match="points must be at least 1, got 0"):
        membrane.CoarseCorrection(disc.mesh, disc.springs, disc.foundation, points=0)
    coarse.update()
    coarse.reset()


def test_a_correction_keeps_its_network_and_raises_the_error_of_its_law():
    broken: list[str] = []
    disc = Torn(membrane.PythonSpring(law_until(broken)))
    coarse = membrane.CoarseCorrection(disc.mesh, disc.springs, disc.foundation, points=30)
    solver = disc.solver
    solver.wake_all()
    solver.step(disc.x, 1e-3, disc.springs, disc.foundation)
    x = disc.x
    del disc
    gc.collect()
    coarse.update()
    assert coarse.correct(x, solver).corrected
    broken.append("law")
    with pytest.raises(RuntimeError, match="what is a spring"):
        coarse.correct(x, solver)
