# SPDX-License-Identifier: MIT
"""What the module offers beyond the loop, against closed forms or another component."""
import math
import sys
import threading
import time

import membrane
import numpy
import pytest


def pressed(law=membrane.LinearSpring(), depth=1e-3, network=None):
    """A sphere under a tool, by steps until they converge: no residual force exceeds the network's tolerance, 1e-9 of
    the rest length times the stiffness. Its mesh, network, foundation, positions, report, press."""
    mesh = membrane.icosphere(subdivisions=2)
    network = network or membrane.MassSpringNetwork(mesh, law, stiffness=40.0)
    foundation = membrane.VirtualVolumeSprings(mesh, stiffness=8.0)
    solver = membrane.QuasiStaticSolver(network, layers=membrane.unlimited, sweeps=8)
    tree, tracker = membrane.AabbTree(mesh), membrane.ContactTracker(mesh)
    tool = membrane.Tool(position=(0, 0, 12e-3 - depth), radius=2e-3)
    x = mesh.positions.copy()
    for _ in range(500):
        press = membrane.press(tool, tracker.update(tree, x, tool))
        report = solver.step(x, 1e-3, network, foundation, press)
        tree.refit(x, report.moved)
        if report.converged:
            return mesh, network, foundation, x, report, press
    raise AssertionError("no equilibrium")


def test_errors_have_the_words_of_the_library():
    mesh = membrane.icosphere(subdivisions=0)
    with pytest.raises(membrane.InvalidInput, match=r"^MassSpringNetwork: stiffness of the springs \[N/m\] is req"):
        membrane.MassSpringNetwork(mesh)
    with pytest.raises(ValueError, match=r"stiffness of spring 17 must be finite and not negative \[N/m\], got -3"):
        membrane.MassSpringNetwork(mesh, stiffness=[-3.0 if s == 17 else 1.0 for s in range(30)])
    with pytest.raises(membrane.InvalidInput, match="^QuasiStaticSolver: sweeps must be at least 1, got 0"):
        membrane.QuasiStaticSolver(membrane.MassSpringNetwork(mesh, stiffness=1.0), sweeps=0)
    with pytest.raises(TypeError):
        membrane.QuasiStaticSolver(membrane.MassSpringNetwork(mesh, stiffness=1.0), sweps=2)


def test_shapes():
    assert membrane.icosphere(subdivisions=3).vertex_count == 642
    assert membrane.sheet(columns=4, rows=3).vertex_count == 20
    assert membrane.disc(rings=3).vertex_count == 37
    cap = membrane.spherical_cap(radius=1.0, diameter=1.0, rings=4)
    assert len(membrane.border(cap)) == 24 and cap.triangles.shape == (96, 3)
    sphere = membrane.icosphere(subdivisions=2)
    again = membrane.TriangleMesh(sphere.positions.astype(numpy.float64), sphere.triangles.astype(numpy.int64))
    assert numpy.array_equal(again.positions, sphere.positions) and len(membrane.edges(again)) == 480


def test_tree_finds_the_surface():
    mesh = membrane.icosphere(radius=1.0, subdivisions=3)
    tree = membrane.AabbTree(mesh)
    found = tree.closest_point(mesh.positions, (0, 0, 2))
    assert abs(found.squared_distance**0.5 - 1) < 0.01 and found.point[2] > 0.99
    hit = tree.first_hit(mesh.positions, (0, 0, 2), (0, 0, 0))
    assert hit.triangle != membrane.no_index and abs(hit.fraction - 0.5) < 0.01
    assert found.triangle in tree.overlap_sphere(mesh.positions, (0, 0, 1), 0.1)


def distance(x, y):
    """Of the vertex that is farthest [m]."""
    return numpy.linalg.norm(x - y, axis=1).max()


def test_equilibrium_is_that_of_the_steps():
    """Both are within their certified bounds of it; the reaction balances the forces on all vertices."""
    mesh, network, foundation, x, report, press = pressed()
    rest = membrane.equilibrium(x, mesh, network, foundation, press)
    assert rest.converged and rest.reactions.shape == (1, 3)
    bound = membrane.ErrorBound(network)
    positions, forces = [], []
    for state, reaction in ((x, report.reactions[0]), (rest.x, rest.reactions[0])):
        error = bound.compute(state, network, foundation, press, rest=rest, mesh=mesh)
        assert error.certified
        positions.append(error.position)
        forces.append(error.reactions[0].max_distance_to(reaction))
    assert distance(rest.x, x) <= sum(positions)
    assert numpy.linalg.norm(rest.reactions[0] - report.reactions[0]) <= sum(forces)

    # Springs act on both their ends: what is left of the sum over the vertices is the foundation, and residual forces.
    for state, reaction, residual in ((x, report.reactions[0], report.residual),
                                      (rest.x, rest.reactions[0], rest.residual)):
        on_vertices = network.forces(state) - 8.0 * (state - mesh.positions)
        rounding = numpy.finfo(float).eps * numpy.abs(on_vertices).sum()
        assert numpy.linalg.norm(on_vertices.sum(axis=0) - reaction) <= mesh.vertex_count * (residual + rounding)
    assert bound.compute(x, network, foundation, press).status == membrane.BoundStatus.contact


def test_safe_step_has_the_same_equilibrium():
    """Within the bound: residuals over the smallest eigenvalue of the stiffness, of steps and of Newton's method."""
    mesh, network, foundation = pressed()[:3]
    solver = membrane.QuasiStaticSolver(network, membrane.SafeStep(), layers=membrane.unlimited, sweeps=8)
    pull = membrane.pull(0, mesh.positions[0] * 1.05)
    x = mesh.positions.copy()
    while not (report := solver.step(x, 1e-3, network, foundation, pull)).converged:
        pass
    rest = membrane.equilibrium(x, mesh, network, foundation, pull)
    bound = membrane.ErrorBound(network)
    of_rest = bound.compute(rest.x, network, foundation, pull).position
    error = bound.compute(x, network, foundation, pull)
    assert error.certified and 0 < error.convexity <= 8 and distance(rest.x, x) <= error.position + of_rest
    assert error.position <= 3 * math.sqrt(mesh.vertex_count) * report.residual / error.convexity


def test_laws_of_python_and_of_tables():
    calls = []

    def linear_law(k, rest_length, length):
        calls.append(length)
        e = length - rest_length
        return k * e, k, k * e * e / 2

    mesh, network, foundation, x, report, press = pressed()
    in_python = pressed(membrane.PythonSpring(linear_law))
    assert calls and numpy.array_equal(in_python[3], x) and numpy.array_equal(in_python[4].reactions, report.reactions)

    # Of a table the last digits of a force differ, so that other updates are the last: the bounds hold for both.
    by_table = pressed(membrane.TableSpring([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]))[3]
    rest = membrane.equilibrium(x, mesh, network, foundation, press)
    bound = membrane.ErrorBound(network)
    errors = [bound.compute(state, network, foundation, press, rest=rest, mesh=mesh).position
              for state in (x, by_table)]
    assert distance(x, by_table) <= sum(errors) < math.inf
    for strain in (-3.0, -0.3, 0.1, 0.7, 3.0):
        for table in ([-1, 1], [0, 1], [-1, 0], [1, 2], [-2, -1], [-0.1, 0.5]):
            assert numpy.allclose(membrane.TableSpring(table, table)(40.0, 2e-3, 2e-3 * (1 + strain)),
                                  membrane.LinearSpring()(40.0, 2e-3, 2e-3 * (1 + strain)), rtol=1e-12)


def test_a_table_is_consistent():
    """Tension is the derivative of the energy, by central differences; the energy at rest is 0."""
    law = membrane.TableSpring([-0.2, -0.1, 0.05, 0.1, 0.3], [-0.1, -0.1, 0.05, 0.4, 3.0])
    assert law(40.0, 1.0, 1.0)[0] == 0 and law(40.0, 1.0, 1.0)[2] == 0
    gains = [law(40.0, 1.0, 1 + strain)[2] for strain in (1e-12, -1e-12)]  # below the rounding of the table's energies
    assert numpy.allclose(gains, 40 * 1e-24 / 2, rtol=1e-3)
    for length in (0.7, 0.85, 0.97, 1.07, 1.2, 1.5):
        low, high = law(40.0, 1.0, length - 1e-6), law(40.0, 1.0, length + 1e-6)
        tension, stiffness, _ = law(40.0, 1.0, length)
        assert abs((high[2] - low[2]) / 2e-6 - tension) < 1e-6
        assert abs((high[0] - low[0]) / 2e-6 - stiffness) < 1e-6
    for strain, tension in (([0.0], [0.0]), ([0, 0], [0, 0]), ([0, 1], [0, -1]), ([0, 1], [1, 2]),
                            ([0, 1], [0, numpy.nan])):
        with pytest.raises(membrane.InvalidInput, match="TableSpring"):
            membrane.TableSpring(strain, tension)


def test_an_error_of_a_law_is_raised_by_the_step():
    def broken(k, r, l):
        raise RuntimeError("what is a spring?")

    mesh = membrane.icosphere(subdivisions=1)
    network = membrane.MassSpringNetwork(mesh, membrane.PythonSpring(broken), stiffness=40.0)
    x = mesh.positions.copy()
    solver = membrane.QuasiStaticSolver(network)
    for _ in range(2):
        with pytest.raises(RuntimeError, match="what is a spring"):
            solver.step(x, 1e-3, network, membrane.NoFoundation(), membrane.pull(0, (0, 0, 0.011)))
    assert numpy.array_equal(x, mesh.positions)
    with pytest.raises(RuntimeError, match="what is a spring"):
        membrane.equilibrium(x, mesh, network, membrane.NoFoundation(), membrane.pull(0, (0, 0, 0.011)))


def test_force_policies():
    *_, report, _ = scene = pressed()
    mesh, x = scene[0], scene[3]
    tool = membrane.Tool(position=(0, 0, 11e-3), radius=2e-3, velocity=(0, 0, -0.1))
    tracker = membrane.ContactTracker(mesh)
    contact = tracker.update(membrane.AabbTree(mesh), mesh.positions, tool)
    force = membrane.SpringDamperForce(stiffness=100, damping=0.5)(tool, contact, report)
    assert contact.touching and abs(numpy.linalg.norm(force) - (100 * contact.depth + 0.05 * contact.normal[2])) < 1e-12
    assert numpy.array_equal(membrane.ReactionForce(scale=2)(tool, contact, report), 2 * report.reactions[0])
    limit = membrane.ForceLimiter(membrane.devices.touch, soft_start=0, rise_time=0)
    assert numpy.linalg.norm(limit((0, 0, 10), 0.0, 1)) <= 3.3 and limit.active_limits.peak
    weak = membrane.DeviceProfile("mine", peak_force=1, continuous_force=0.5, stiffness=100)
    assert numpy.linalg.norm(membrane.ForceLimiter(weak, soft_start=0, rise_time=0)((0, 0, 10), 0.0, 1)) <= 1
    assert not limit((numpy.nan, 0, 0), 1e-3, 2).any() and limit.active_limits.fault


def test_a_policy_of_python_is_a_function_in_the_loop():
    mesh, *_, report, _ = pressed()
    tool = membrane.Tool(position=(0, 0, 11e-3), radius=2e-3, velocity=(0, 0, -0.1))
    contact = membrane.ContactTracker(mesh).update(membrane.AabbTree(mesh), mesh.positions, tool)

    def feel(tool, contact, report):
        return 2 * report.reactions[0] if contact.touching else numpy.zeros(3)

    device = membrane.ScriptedDevice([(0, (0, 0, 0)), (1, (0, 0, 1))])
    device.write(feel(tool, contact, report))
    assert numpy.array_equal(device.force, membrane.ReactionForce(scale=2)(tool, contact, report))


def test_a_hand_yields():
    """At rest the spring of the hand balances the force; without a force it goes to its target."""
    hand = membrane.SimulatedHand(mass=0.1, damping=2, stiffness=300)
    hand.reset_to((0, 0, 0.01))
    hand.set_target((0, 0, 0.01), (0, 0, 0))
    assert hand.advance((0, 0, 3), 10.0)  # the slow rate is 10 1/s: e^-100 is left
    assert numpy.allclose(hand.position, (0, 0, 0.02), rtol=1e-12) and numpy.abs(hand.velocity).max() < 1e-12
    assert not hand.advance((0, 0, numpy.nan), 1.0) and not hand.advance((0, 0, 3), -1.0)
    assert numpy.allclose(hand.position, (0, 0, 0.02), rtol=1e-12)
    with pytest.raises(membrane.InvalidInput, match=r"^SimulatedHand: mass must be finite and positive \[kg\], got 0"):
        membrane.SimulatedHand(damping=2, stiffness=300)
    device = membrane.ScriptedDevice([(0, (0, 0, 0)), (0.1, (0, 0, 0))], hand=hand)
    device.read()
    device.write((0, 0, 3))
    assert device.read().position[2] > 0 and numpy.allclose(hand.position, (0, 0, 0.02))  # the device has a copy


def test_the_rule_as_published_needs_a_mass():
    mesh = membrane.icosphere(subdivisions=1)
    with pytest.raises(membrane.InvalidInput, match="mass"):
        membrane.QuasiStaticSolver(membrane.MassSpringNetwork(mesh, stiffness=40.0), membrane.MassStep())
    light = membrane.MassSpringNetwork(mesh, stiffness=40.0, mass=1e-7)
    x = mesh.positions.copy()
    report = membrane.QuasiStaticSolver(light, membrane.MassStep()).step(
        x, 1e-3, light, membrane.NoFoundation(), membrane.pull(0, (0, 0, 0.011)))
    assert report.status == membrane.StepStatus.unstable and numpy.array_equal(x, mesh.positions)


def test_none_is_no_component():
    """Where an argument may not be left out."""
    mesh = membrane.icosphere(subdivisions=1)
    tool = membrane.Tool()
    with pytest.raises(TypeError):
        membrane.ContactTracker(mesh).update(None, mesh.positions, tool)
    with pytest.raises(TypeError):
        membrane.press(tool, None)
    with pytest.raises(TypeError):
        membrane.ReactionForce()(tool, None, None)


def test_recordings(tmp_path):
    recorder = membrane.Recorder(10, 42)
    for tick in range(3):
        recorder.add(membrane.Tool(position=(tick, 0.1, 0), time=1e-3 * tick, grasping=tick == 2), (0, 0, tick / 3))
    membrane.write_recording(tmp_path / "run.rec", recorder.recording())
    again = membrane.read_recording(tmp_path / "run.rec", 42)
    assert numpy.array_equal(again.forces, [[0, 0, 0], [0, 0, 1 / 3], [0, 0, 2 / 3]]) and len(again) == 3
    assert [tool.grasping for tool in again.tools] == [False, False, True]
    with pytest.raises(membrane.InvalidInput, match="must have 43 vertices, got 42"):
        membrane.read_recording(tmp_path / "run.rec", 43)
    replay = membrane.ReplayDevice(again)
    for force in ((0, 0, 0), (0, 0, 0.3), (0, 0, 2 / 3)):
        assert replay.running
        replay.read()
        replay.write(force)
    assert not replay.running and replay.differing == 1 and replay.first_difference == 1
    membrane.write_csv(tmp_path / "run.csv", again)
    assert (tmp_path / "run.csv").read_text().startswith("x_m,y_m,z_m")
    with pytest.raises(RuntimeError, match="cannot open"):
        membrane.read_recording(tmp_path / "none.rec")


def test_meshes_are_checked_and_repaired():
    sphere = membrane.icosphere(subdivisions=1)
    triangles = sphere.triangles.copy()
    triangles[3] = triangles[3][::-1]
    report = membrane.validate(sphere.positions, triangles)
    assert not report.valid and "repair with .orient" in str(report)
    with pytest.raises(membrane.InvalidInput):
        membrane.TriangleMesh(sphere.positions, triangles)
    repaired = membrane.repair(sphere.positions, triangles, orient=True)
    assert str(repaired.report) == "reversed 1 triangles"
    assert membrane.validate(repaired.positions, repaired.triangles).facts.genus == 0
    assert membrane.quality_of(sphere).smallest_angle > 50


def test_distmesh_of_a_function():
    spoken = []
    torus = membrane.distmesh(lambda p: numpy.hypot(numpy.hypot(p[0], p[1]) - 1, p[2]) - 0.4, edge_length=0.4,
                              bounds=((-1.5, -1.5, -0.5), (1.5, 1.5, 0.5)), iterations=2,
                              progress=lambda now: spoken.append(now.iteration))
    assert membrane.validate(torus.positions, torus.triangles).facts.genus == 1 and spoken[0] == 1
    with pytest.raises(ZeroDivisionError):
        membrane.distmesh(lambda p: 1 / 0, edge_length=0.3, bounds=((-1, -1, -1), (1, 1, 1)))
    with pytest.raises(membrane.InvalidInput, match="bounds"):
        membrane.distmesh(lambda p: p[2], edge_length=0.3)
    bowl = membrane.distmesh(membrane.difference(membrane.Ball(radius=1), membrane.Ball(radius=0.6)), edge_length=0.4)
    assert membrane.validate(bowl.positions, bowl.triangles).facts.components == 2


def test_settings_are_found():
    mesh = membrane.icosphere(subdivisions=2)
    network = membrane.MassSpringNetwork(mesh, stiffness=40.0)
    foundation = membrane.VirtualVolumeSprings(mesh, stiffness=8.0)
    tools = [membrane.Tool(position=(0, 0, 12e-3 - 2e-5 * tick), radius=2e-3, time=1e-3 * tick) for tick in range(40)]
    trajectory = membrane.ToolTrajectory(mesh, tools, 1e-3)
    references = membrane.equilibria(mesh, network, foundation, trajectory, tick_stride=10)
    choice = membrane.choose_settings(mesh, network, foundation, trajectory, force_error=0.05, layers=[1, 4, 8],
                                      sweeps=[1, 4], contact_iterations=[2], tick_stride=10, repetitions=1)
    assert choice.satisfied and choice.force_error <= 0.05 and choice.options.sweeps in (1, 4)
    assert choice.keeps_error and choice.keeps_time and choice.edge_factor == 1
    assert choice.max_force_error >= choice.force_error
    assert choice.max_displacement > 0 and abs(choice.max_speed - 0.02) < 1e-9
    again = membrane.run_trial(mesh, network, foundation, trajectory, references, layers=choice.options.layers,
                               sweeps=choice.options.sweeps, contact_iterations=choice.options.contact_iterations)
    assert again.force_error == choice.force_error
    with pytest.raises(membrane.InvalidInput, match="mass"):
        membrane.choose_settings(mesh, network, foundation, trajectory, rule=membrane.MassStep(), time=1.0)
    with pytest.raises(membrane.InvalidInput, match="a force_error or a time must"):
        membrane.choose_settings(mesh, network, foundation, trajectory)


def test_a_fit_finds_its_constants():
    depths = numpy.linspace(0.1, 1, 8)
    found = membrane.fit(depths, 3 * depths**2, [1.0, 1.0], lambda c, d: c[0] * d ** c[1])
    assert found.converged and numpy.allclose(found.constants, [3, 2], rtol=1e-6)
    with pytest.raises(KeyError):
        membrane.fit(depths, depths, [1.0], lambda c, d: {}["force"])


def long_calls():
    """Each call that is long, by name."""
    mesh = membrane.icosphere(subdivisions=2)
    network = membrane.MassSpringNetwork(mesh, stiffness=40.0)
    foundation = membrane.VirtualVolumeSprings(mesh, stiffness=8.0)
    pull = membrane.pull(0, 1.01 * mesh.positions[0])
    tools = [membrane.Tool(position=(0, 0, 11.5e-3), radius=2e-3)]
    path = membrane.ToolTrajectory(mesh, tools, 1e-3)
    scene = mesh, network, foundation
    references = membrane.equilibria(*scene, path)
    model = membrane.Indentation(mesh, membrane.Tool(position=(0, 0, 0.015), radius=1e-3), (0, 0, -1),
                                 lambda constants: (network, foundation))
    depths = numpy.linspace(0.1, 1, 8)
    return {
        "equilibrium": lambda: membrane.equilibrium(mesh.positions, *scene, pull),
        "equilibria": lambda: membrane.equilibria(*scene, path),
        "run_trial": lambda: membrane.run_trial(*scene, path, references),
        "choose_settings": lambda: membrane.choose_settings(*scene, path, time=1.0, layers=[2], sweeps=[1],
                                                            contact_iterations=[2], repetitions=1),
        "ErrorBound": lambda: membrane.ErrorBound(network).compute(mesh.positions, network, foundation, pull),
        "Indentation": lambda: model([1.0], [1e-4]),
        "fit": lambda: membrane.fit(depths, depths, [1.0], lambda constants, d: constants[0] * d),
        "distmesh": lambda: membrane.distmesh(membrane.Ball(radius=1), edge_length=0.5, iterations=1),
        "validate": lambda: membrane.validate(mesh.positions, mesh.triangles),
        "repair": lambda: membrane.repair(mesh.positions, mesh.triangles),
    }


CALLS = long_calls()


def another_thread_runs(call, repetitions):
    """Whether another thread gets Python's lock from `call`, where Python does not give it by itself."""
    turns, done = [], threading.Event()

    def take_turns():
        while not done.is_set():
            turns.append(1)
            time.sleep(0)

    interval = sys.getswitchinterval()
    thread = threading.Thread(target=take_turns)
    thread.start()
    sys.setswitchinterval(3600)
    try:
        start = len(turns)
        while len(turns) < start + 3:  # until it waits by the new interval
            time.sleep(1e-3)
        before = len(turns)
        for _ in range(repetitions):
            call()
            if len(turns) > before:
                return True
        return False
    finally:
        sys.setswitchinterval(interval)
        done.set()
        thread.join()


def test_tissue_slips_out_of_forceps():
    mesh = membrane.icosphere(radius=10e-3, subdivisions=3)
    network = membrane.MassSpringNetwork(mesh, stiffness=40.0)
    foundation = membrane.VirtualVolumeSprings(mesh, stiffness=8.0)
    solver = membrane.QuasiStaticSolver(network, layers=6, sweeps=20)
    tree, tracker = membrane.AabbTree(mesh), membrane.ContactTracker(mesh)
    grasper = membrane.Grasper(mesh, holding_force=0.02, jaw_length=1e-3)
    x = mesh.positions.copy()
    slipped, held = 0, []
    for i in range(400):
        height = 11.9e-3 + max(i - 1, 0) * 2e-5
        tool = membrane.Tool(position=(0, 0, height), radius=2e-3, grasping=i > 0)
        contact = tracker.update(tree, x, tool)
        grasp = grasper.update(contact, x, tool)
        report = solver.step(x, 1e-3, network, foundation, membrane.pull(tool, grasp))
        slipped += grasper.slip(x, tool, report.reactions[0])
        tree.refit(x, report.moved)
        held.append(numpy.linalg.norm(report.reactions[0]))
    assert slipped > 10
    assert max(held) == pytest.approx(0.02)
    assert grasper.dissipated == pytest.approx(0.02 * 1e-3, rel=0.1)
    assert not grasper.update(contact, x, tool).holding


@pytest.mark.parametrize("name", CALLS)
def test_the_lock_is_released(name):
    assert another_thread_runs(CALLS[name], 10_000)


def test_a_short_call_keeps_the_lock():
    mesh = membrane.icosphere(subdivisions=2)
    assert not another_thread_runs(lambda: membrane.quality_of(mesh), 100)
