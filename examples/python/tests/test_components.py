# SPDX-License-Identifier: MIT
"""What the module offers beyond the loop, against closed forms or another component."""
import threading

import membrane
import numpy
import pytest


def pressed(law=membrane.LinearSpring(), depth=1e-3, network=None):
    """A sphere at equilibrium by steps under a tool; its mesh, network, foundation, positions, report, press."""
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
        if report.converged or report.residual < 1e-8:
            return mesh, network, foundation, x, report, press
    raise AssertionError("no equilibrium")


def test_errors_have_the_words_of_the_library():
    mesh = membrane.icosphere(subdivisions=0)
    with pytest.raises(membrane.InvalidInput, match=r"^MassSpringNetwork: stiffness of the springs \[N/m\] is required"):
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


def test_equilibrium_is_that_of_the_steps():
    mesh, network, foundation, x, report, press = pressed()
    rest = membrane.equilibrium(x, mesh, network, foundation, press)
    assert rest.converged and rest.reactions.shape == (1, 3)
    assert numpy.abs(rest.x - x).max() < 1e-8 and numpy.abs(rest.reactions - report.reactions).max() < 1e-7
    balance = network.forces(rest.x) - 8.0 * (rest.x - mesh.positions)
    assert numpy.abs(balance.sum(axis=0) - rest.reactions[0]).max() < 1e-9
    bound = membrane.ErrorBound(network).compute(x, network, foundation, press, rest=rest, mesh=mesh)
    assert bound.certified and 0 <= bound.position < 1e-8
    assert bound.reactions[0].max_distance_to(report.reactions[0]) < 1e-6
    without = membrane.ErrorBound(network).compute(x, network, foundation, press)
    assert without.status == membrane.BoundStatus.contact


def test_safe_step_has_the_same_equilibrium():
    mesh, network, foundation, x, *_ = pressed()
    solver = membrane.QuasiStaticSolver(network, membrane.SafeStep(), layers=membrane.unlimited, sweeps=8)
    pull = membrane.pull(0, mesh.positions[0] * 1.05)
    x = mesh.positions.copy()
    while not solver.step(x, 1e-3, network, foundation, pull).converged:
        pass
    assert numpy.abs(membrane.equilibrium(x, mesh, network, foundation, pull).x - x).max() < 1e-8


def cubic(k, r, l):
    """Tension, stiffness and energy of a law with a cubic term."""
    e = l - r
    return k * (e + 1e5 * e**3), k * (1 + 3e5 * e**2), k * (e**2 / 2 + 1e5 * e**4 / 4)


def test_laws_of_python_and_of_tables():
    calls = []
    law = membrane.PythonSpring(lambda k, r, l: (calls.append(l), (k * (l - r), k, k * (l - r) ** 2 / 2))[1])
    linear, python = pressed()[3], pressed(law)[3]
    assert calls and numpy.abs(linear - python).max() < 1e-9
    table = pressed(membrane.TableSpring([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]))[3]
    assert numpy.abs(linear - table).max() < 1e-9
    for strain in (-0.3, 0.1, 0.7, 3.0):
        assert numpy.allclose(membrane.TableSpring([-1, 1], [-1, 1])(40.0, 2e-3, 2e-3 * (1 + strain)),
                              membrane.LinearSpring()(40.0, 2e-3, 2e-3 * (1 + strain)), rtol=1e-12)
    stiffening = pressed(membrane.PythonSpring(cubic))
    rest = membrane.equilibrium(stiffening[3], *stiffening[:3], stiffening[5])
    assert rest.converged and numpy.abs(rest.x - stiffening[3]).max() < 1e-8


def test_a_table_is_consistent():
    """Tension is the derivative of the energy, by central differences; the energy at rest is 0."""
    law = membrane.TableSpring([-0.2, -0.1, 0.05, 0.1, 0.3], [-0.1, -0.1, 0.05, 0.4, 3.0])
    assert abs(law(40.0, 1.0, 1.0)[0]) < 1e-14 and abs(law(40.0, 1.0, 1.0)[2]) < 1e-14
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
    errors = [membrane.run_trial(mesh, network, foundation, trajectory, references, layers=layers, sweeps=4).force_error
              for layers in (0, 8)]
    assert errors[1] < errors[0] and errors[1] < 0.02
    choice = membrane.choose_settings(mesh, network, foundation, trajectory, force_error=0.05, layers=[1, 4, 8],
                                      sweeps=[1, 4], contact_iterations=[2], tick_stride=10, repetitions=1)
    assert choice.satisfied and choice.force_error <= 0.05 and choice.options.sweeps in (1, 4)
    with pytest.raises(membrane.InvalidInput, match="either a force_error or a time"):
        membrane.choose_settings(mesh, network, foundation, trajectory)


def test_a_fit_finds_its_constants():
    depths = numpy.linspace(0.1, 1, 8)
    found = membrane.fit(depths, 3 * depths**2, [1.0, 1.0], lambda c, d: c[0] * d ** c[1])
    assert found.converged and numpy.allclose(found.constants, [3, 2], rtol=1e-6)
    with pytest.raises(KeyError):
        membrane.fit(depths, depths, [1.0], lambda c, d: {}["force"])


def test_the_lock_is_released():
    """Another thread runs while an equilibrium is found."""
    mesh = membrane.icosphere(subdivisions=4)
    network = membrane.MassSpringNetwork(mesh, stiffness=40.0)
    foundation = membrane.VirtualVolumeSprings(mesh, stiffness=8.0)
    ticks, done = [], threading.Event()

    def count():
        while not done.wait(1e-4):
            ticks.append(1)

    thread = threading.Thread(target=count)
    thread.start()
    before = len(ticks)
    membrane.equilibrium(mesh.positions, mesh, network, foundation, membrane.pull(0, (0, 0.009, 0.011)))
    during = len(ticks) - before
    done.set()
    thread.join()
    assert during > 1
