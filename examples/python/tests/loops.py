# SPDX-License-Identifier: MIT
"""The loops and calls of same_loop.cpp in Python: each returns the numbers that the program prints, in its order."""
import time

import numpy
import membrane

dt = 1e-3  # [s]


def sphere():
    """A sphere is pressed, grasped and pulled, with a load and two pinned vertices; vertices carry the contact."""
    mesh = membrane.icosphere(radius=10e-3, subdivisions=3)
    network = membrane.MassSpringNetwork(mesh, stiffness=40.0)
    foundation = membrane.VirtualVolumeSprings(mesh, stiffness=8.0, damping=0.02)
    solver = membrane.QuasiStaticSolver(network, layers=6, sweeps=2)
    tree = membrane.AabbTree(mesh)
    tracker = membrane.ContactTracker(mesh, fine_triangles=0.5)
    grasper = membrane.Grasper(mesh)
    normals = membrane.VertexNormals(mesh)
    feel = membrane.SpringDamperForce(stiffness=100, damping=0.5)
    device = membrane.ScriptedDevice([(0.0, (0, 0, 13e-3)),
                                      (0.1, (0, 0, 11e-3)),
                                      (0.2, (1e-3, 0, 11e-3), True),
                                      (0.3, (1e-3, 1e-3, 14e-3), True),
                                      (0.4, (0, 0, 16e-3))], radius=2e-3)
    x = mesh.positions.copy()
    rows = []
    while device.running:
        tool = device.read()
        contact = tracker.update(tree, x, tool)
        grasp = grasper.update(contact, x, tool)
        report = solver.step(x, dt, network, foundation, membrane.press(tool, contact, grasp),
                             membrane.pull(tool, grasp),
                             membrane.load((0, 42, 44), (0.5, 0.25, 0.25), (0, 1e-3, 0)), membrane.pin([100, 200]))
        tree.refit(x, report.moved)
        normals.update(x, report.moved)
        device.write(feel(tool, contact, report, grasp))
        rows += [device.force, *report.reactions.copy()]
    return numpy.vstack([rows, x, normals.values])


def cap():
    """A cornea on a layer, its rim pinned, by the other rule, with a limited force."""
    mesh = membrane.spherical_cap()
    material = membrane.materials.cornea().typical
    layer = membrane.FoundationLayer(young_modulus=2e3, poisson_ratio=0.45, thickness=1e-3)
    network = membrane.MassSpringNetwork(mesh, membrane.TensionSpring(),
                                         stiffness=membrane.spring_stiffnesses(mesh, material),
                                         pinned=membrane.border(mesh))
    foundation = membrane.FoundationSprings(mesh, normal=membrane.normal_stiffnesses(mesh, layer),
                                            tangential=membrane.tangential_stiffnesses(mesh, layer),
                                            recovery_time=0.05)
    solver = membrane.QuasiStaticSolver(network, membrane.SafeStep(), layers=4, sweeps=3,
                                        order=membrane.UpdateOrder.breadth_first)
    tree = membrane.AabbTree(mesh)
    tracker = membrane.ContactTracker(mesh)
    limit = membrane.ForceLimiter(membrane.devices.touch)
    feel = membrane.ReactionForce(scale=20)
    device = membrane.ScriptedDevice([(0.0, (0, 0, 10e-3)), (0.3, (1e-3, 0, 8.2e-3))], radius=1e-3)
    x = mesh.positions.copy()
    forces: list[numpy.ndarray] = []
    while device.running:
        tool = device.read()
        contact = tracker.update(tree, x, tool)
        report = solver.step(x, dt, network, foundation, membrane.press(tool, contact))
        tree.refit(x, report.moved)
        device.write(limit(feel(tool, contact, report), tool.time, len(forces)))
        forces.append(device.force)
    return numpy.vstack([forces, x])


def offline():
    """Meshes, an equilibrium, a fit."""
    half = membrane.distmesh(membrane.Ball(radius=1), edge_length=0.3, within=membrane.HalfSpace(), iterations=50)
    cube = membrane.distmesh(lambda p: numpy.abs(p).max() - 0.5, edge_length=0.3,
                             bounds=((-1, -1, -1), (1, 1, 1)), iterations=20)
    mesh = membrane.icosphere(subdivisions=2)
    network = membrane.MassSpringNetwork(mesh, membrane.ExponentialSpring(), stiffness=40.0)
    foundation = membrane.VirtualVolumeSprings(mesh, stiffness=8.0)
    rest = membrane.equilibrium(mesh.positions, mesh, network, foundation,
                                membrane.pull(0, (0, 6e-3, 9.2e-3)), membrane.pin([]))

    def build(constants):
        return (membrane.MassSpringNetwork(mesh, stiffness=constants[0]),
                membrane.VirtualVolumeSprings(mesh, stiffness=constants[1]))

    tip = membrane.Tool(position=(0, 0, 0.015), radius=1e-3)
    model = membrane.Indentation(mesh, tip, (0, 0, -1), build)
    depths = [2e-4, 5e-4, 1e-3, 2e-3]
    found = membrane.fit(depths, model([40.0, 8.0], depths), [30.0, 10.0], model)
    points = numpy.vstack([half.positions, cube.positions, rest.x, rest.reactions])
    return numpy.concatenate([points.ravel(), found.constants])


def published():
    """A hand that yields presses a sphere, by the rule as published."""
    mesh = membrane.icosphere(subdivisions=2)
    network = membrane.MassSpringNetwork(mesh, stiffness=40.0, mass=2e-4)
    foundation = membrane.VirtualVolumeSprings(mesh, stiffness=8.0, damping=0.02)
    solver = membrane.QuasiStaticSolver(network, membrane.MassStep(), layers=6, sweeps=4)
    tree = membrane.AabbTree(mesh)
    tracker = membrane.ContactTracker(mesh)
    feel = membrane.ReactionForce()
    device = membrane.ScriptedDevice([(0.0, (0, 0, 13e-3)), (0.2, (1e-3, 0, 9e-3))], radius=2e-3,
                                     hand=membrane.SimulatedHand(mass=0.1, damping=2, stiffness=300))
    x = mesh.positions.copy()
    rows = []
    while device.running:
        tool = device.read()
        contact = tracker.update(tree, x, tool)
        report = solver.step(x, dt, network, foundation, membrane.press(tool, contact))
        tree.refit(x, report.moved)
        device.write(feel(tool, contact, report))
        rows += [device.force, tool.position, tool.velocity]
    return numpy.vstack([rows, x])


def cubic(k, rest_length, length):
    """Tension, stiffness and energy of a law with a cubic term."""
    e = length - rest_length
    return k * (e + 1e5 * (e * e * e)), k * (1 + 3e5 * (e * e)), k * (e * e / 2 + 1e5 * (e * e * e * e) / 4)


def law():
    """Steps under a tool and their equilibrium, of springs by a law of the user's."""
    mesh = membrane.icosphere(subdivisions=2)
    network = membrane.MassSpringNetwork(mesh, membrane.PythonSpring(cubic), stiffness=40.0)
    foundation = membrane.VirtualVolumeSprings(mesh, stiffness=8.0)
    solver = membrane.QuasiStaticSolver(network, layers=membrane.unlimited, sweeps=8)
    tree = membrane.AabbTree(mesh)
    tracker = membrane.ContactTracker(mesh)
    tool = membrane.Tool(position=(0, 0, 11e-3), radius=2e-3)
    x = mesh.positions.copy()
    forces = []
    for _ in range(20):
        contact = tracker.update(tree, x, tool)
        report = solver.step(x, dt, network, foundation, membrane.press(tool, contact))
        tree.refit(x, report.moved)
        forces.append(report.reactions[0].copy())
    contact = tracker.update(tree, x, tool)
    rest = membrane.equilibrium(x, mesh, network, foundation, membrane.press(tool, contact))
    return numpy.vstack([forces, x, rest.x, rest.reactions])


def accuracy():
    """Trials of each rule, and the error bounds of a state in contact and of one that is pulled."""
    mesh = membrane.icosphere(subdivisions=2)
    network = membrane.MassSpringNetwork(mesh, stiffness=40.0, mass=2e-4)
    foundation = membrane.VirtualVolumeSprings(mesh, stiffness=8.0)
    tools = [membrane.Tool(position=(0, 0, 12e-3 - 2e-5 * tick), radius=2e-3, time=1e-3 * tick) for tick in range(40)]
    trajectory = membrane.ToolTrajectory(mesh, tools, dt)
    references = membrane.equilibria(mesh, network, foundation, trajectory, tick_stride=10)
    rows = [reference.x for reference in references]
    rules: list[membrane.BlockStep | membrane.SafeStep | membrane.MassStep] = [
        membrane.BlockStep(), membrane.SafeStep(), membrane.MassStep()]
    for rule in rules:
        for layers in (0, 8):
            result = membrane.run_trial(mesh, network, foundation, trajectory, references, rule, layers=layers,
                                        sweeps=4)
            rows.append(numpy.array([[result.force_error, result.position_error, result.layers_reached]]))

    def show(error):
        return numpy.array([[error.position, error.convexity, error.reactions[0].radius], error.reactions[0].centre])

    bound = membrane.ErrorBound(network)
    contact = membrane.ContactTracker(mesh).update(membrane.AabbTree(mesh), mesh.positions, tools[-1])
    press = membrane.press(tools[-1], contact)
    rest = membrane.equilibrium(mesh.positions, mesh, network, foundation, press)
    rows.append(show(bound.compute(references[-1].x, network, foundation, press, rest=rest, mesh=mesh)))
    pull = membrane.pull(0, 1.001 * mesh.positions[0])
    rows.append(show(bound.compute(mesh.positions, network, foundation, pull)))
    return numpy.vstack(rows)


def peel():
    """Forceps that slip peel a sheet off the plane that it adheres to."""
    mesh = membrane.sheet(width=4e-3, height=0.48e-3, columns=25, rows=3)
    network = membrane.MassSpringNetwork(mesh, stiffness=2.5)
    strengths = numpy.where(mesh.positions[:, 0] < -1.5e-3, 0.0, 100.0)
    adhesion = membrane.CohesiveSprings(mesh, stiffness=2e6, strength=strengths, energy=0.05, tangential_strength=150)
    solver = membrane.QuasiStaticSolver(network, layers=membrane.unlimited, sweeps=8)
    tree = membrane.AabbTree(mesh)
    tracker = membrane.ContactTracker(mesh)
    grasper = membrane.Grasper(mesh, snap_to_vertex=True, holding_force=17e-6, jaw_length=0.3e-3)
    device = membrane.ScriptedDevice([(0.0, (-1.9e-3, 0, 3e-4)), (0.1, (-1.84e-3, 0, 1.5e-4), True),
                                      (0.8, (0.5e-3, 0, 2e-3), True)], radius=1.6e-4)
    x = mesh.positions.copy()
    rows = []
    while device.running:
        tool = device.read()
        contact = tracker.update(tree, x, tool)
        grasp = grasper.update(contact, x, tool)
        report = solver.step(x, dt, network, adhesion, membrane.pull(tool, grasp))
        adhesion.update(x, report.moved)
        slipped = grasper.slip(x, tool, report.reactions[0])
        tree.refit(x, report.moved)
        device.write(report.total_reaction())
        rows += [report.reactions[0].copy(), numpy.array([slipped, grasp.holding, adhesion.dissipated])]
    states = numpy.column_stack([adhesion.adheres, adhesion.damage, adhesion.energy(x)])
    return numpy.append(numpy.vstack([rows, x, states]).ravel(), network.energy(x))


def friction():
    """A tool drags a sphere by friction."""
    mesh = membrane.icosphere(subdivisions=2)
    network = membrane.MassSpringNetwork(mesh, stiffness=40.0)
    foundation = membrane.VirtualVolumeSprings(mesh, stiffness=8.0, damping=0.02)
    friction = membrane.ToolFriction(coefficient=0.4)
    solver = membrane.QuasiStaticSolver(network, layers=6, sweeps=4)
    tree = membrane.AabbTree(mesh)
    tracker = membrane.ContactTracker(mesh)
    device = membrane.ScriptedDevice([(0.0, (0, 0, 13e-3)), (0.1, (0, 0, 11e-3)), (0.3, (2e-3, 0, 11e-3))], radius=2e-3)
    x = mesh.positions.copy()
    numbers: list[numpy.ndarray] = []
    while device.running:
        tool = device.read()
        contact = tracker.update(tree, x, tool)
        report = solver.step(x, dt, network, foundation, friction.press(tool, contact))
        tree.refit(x, report.moved)
        device.write(report.total_reaction())
        numbers += [report.reactions[0].copy(), numpy.array([friction.slips])]
    numbers.append(x.ravel())
    for v in friction.vertices:
        numbers += [v.offset, v.force, v.normal_force, numpy.array([v.vertex])]
    return numpy.concatenate(numbers)


def tear_disc(mesh, springs, criterion):
    """A stretched disc is pressed, held and torn; the springs and the criterion are as given."""
    foundation = membrane.VirtualVolumeSprings(mesh, stiffness=1e-3)
    solver = membrane.QuasiStaticSolver(springs, layers=12, sweeps=4)
    tree = membrane.AabbTree(mesh)
    tracker = membrane.ContactTracker(mesh)
    grasper = membrane.Grasper(mesh)
    normals = membrane.VertexNormals(mesh)
    tear = membrane.Tearing(mesh, criterion)
    x = 1.3 * mesh.positions
    rows: list = []

    def follow_all(events):
        for event in events:
            membrane.follow(event, springs, foundation, solver, tree, tracker, grasper, normals)
            rows.append([event.moved.vertex, event.split.vertex, event.split.copy])

    tree.refit(x)
    path = [tear.surface.nearest_in_direction(tear.slit_at(0, (1, 0, 0))[0], (-1, 0, 0))]
    while len(path) < 5:
        path.append(tear.surface.nearest_in_direction(path[-1], (1, 0, 0)))
    follow_all(tear.cut_along(path, x))
    for tick in range(200):
        tool = membrane.Tool(position=(0, 3e-3, 0.5e-3 + 2e-6 * tick), radius=0.6e-3, time=dt * tick,
                             grasping=tick > 20)
        contact = tracker.update(tree, x, tool)
        grasp = grasper.update(contact, x, tool)
        report = solver.step(x, dt, springs, foundation, membrane.press(tool, contact, grasp),
                             membrane.pull(tool, grasp), tear.ligaments())
        follow_all(tear.update(x, dt, springs, foundation))
        tree.refit(x, report.moved)
        normals.update(x, report.moved)
        rows += [*report.reactions.copy(), [tear.torn_length, tear.dissipated, tear.stored(x)]]
        rows += [tip.driving_force for tip in tear.tips]
    return numpy.vstack([rows, x, tear.surface.rest_positions, normals.values, tear.surface.triangles])


def tear():
    """Tears by each criterion, of springs and of a tissue, linear and not."""
    mesh = membrane.with_reserve(membrane.disc(radius=5e-3, rings=8), 100)
    rim = membrane.border(mesh)
    linear = membrane.MassSpringNetwork(mesh, stiffness=20.0, pinned=rim)
    taut = membrane.MassSpringNetwork(mesh, membrane.TensionSpring(), stiffness=20.0, pinned=rim)
    energy = membrane.EnergyRelease(toughness=1.4e3, thickness=8e-6)
    return numpy.vstack([
        tear_disc(mesh, membrane.Tissue(membrane.TearableSprings(mesh, linear)), energy),
        tear_disc(mesh, membrane.TearableSprings(mesh, linear), energy),
        tear_disc(mesh, membrane.Tissue(membrane.TearableSprings(mesh, taut)), energy),
        tear_disc(mesh, membrane.TearableSprings(mesh, taut), membrane.LargestTension(strength=15))])


def start():
    """A stretched strip tears from a flaw of its border, and where a tool perforates it that drags it by friction."""
    whole = membrane.sheet(width=8e-3, height=4e-3, columns=16, rows=8)
    along, across = whole.positions[:, 0], whole.positions[:, 1]
    middle = numpy.flatnonzero((numpy.abs(along) < 1e-6) & (across < -1.9e-3))[-1].item()  # of a side
    mesh = membrane.with_reserve(whole, 60)
    clamps = numpy.flatnonzero(numpy.abs(along) > 3.9e-3).astype(numpy.int32)
    network = membrane.MassSpringNetwork(mesh, stiffness=20.0, pinned=clamps)
    tissue = membrane.Tissue(membrane.TearableSprings(mesh, network))
    foundation = membrane.VirtualVolumeSprings(mesh, stiffness=1e-3)
    solver = membrane.QuasiStaticSolver(tissue, layers=12, sweeps=4)
    tree, tracker = membrane.AabbTree(mesh), membrane.ContactTracker(mesh)
    friction = membrane.ToolFriction(coefficient=0.4)
    tear = membrane.Tearing(mesh, membrane.EnergyRelease(toughness=200, thickness=1e-5))
    x = mesh.positions * (1.3, 1, 1)
    tree.refit(x)
    numbers: list[float] = []

    def follow_all(events):
        for event in events:
            membrane.follow(event, tissue, foundation, solver, tree, tracker, friction)
        numbers.append(len(events))

    for v in membrane.border(whole):
        state = membrane.border_state(tear.surface, v, x, tissue)
        numbers.extend([*state.along, *state.inward, state.stretch, state.tension, state.energy,
                        membrane.flaw_driving_force(state, 0.3e-3)])
    perforated = False
    for tick in range(80):
        tool = membrane.Tool(position=(2e-3 + 2e-6 * tick, 0, 0.6e-3 - 8e-6 * tick), radius=0.6e-3, time=dt * tick)
        contact = tracker.update(tree, x, tool)
        report = solver.step(x, dt, tissue, foundation, friction.press(tool, contact), tear.ligaments())
        slit = tear.slit_under(contact, report.reactions[0], 2e-3, (0, 1, 0))
        if not perforated and slit[0] != membrane.no_index:
            perforated = True
            follow_all(tear.cut_along(slit, x))
            for flaw in (1e-9, 0.3e-3):
                path = tear.start_at(middle, flaw, x, tissue)
                numbers.extend([len(path), *path])
                follow_all(tear.cut_along(path, x))
        follow_all(tear.update(x, dt, tissue, foundation))
        tree.refit(x, report.moved)
        numbers.extend([*report.reactions[0], *slit, len(friction.vertices)])
        for v in friction.vertices:
            numbers.extend(v.force)
        numbers.extend(tip.advanced for tip in tear.tips)
    assert perforated and tear.torn_length > 1e-3
    return numpy.concatenate([numbers, x.ravel()])


def coarse():
    """A ball is pressed into a stretched disc that its rim holds, corrected after each step; then it tears."""
    mesh = membrane.with_reserve(membrane.disc(radius=5e-3, rings=8), 60)
    tissue = membrane.Tissue(membrane.TearableSprings(
        mesh, membrane.MassSpringNetwork(mesh, stiffness=20.0, pinned=membrane.border(mesh))))
    foundation = membrane.NoFoundation()
    coarse = membrane.CoarseCorrection(mesh, tissue, foundation, points=40, tolerance=0.02)
    solver = membrane.QuasiStaticSolver(tissue, layers=3, sweeps=2)
    tree, tracker = membrane.AabbTree(mesh), membrane.ContactTracker(mesh)
    tear = membrane.Tearing(mesh, membrane.EnergyRelease(toughness=200, thickness=1e-5))
    x = mesh.positions.copy()
    numbers: list[float] = []
    for tick in range(100):
        if tick == 50:
            for event in tear.cut_along(tear.slit_at(0, (1, 0, 0)), x):
                membrane.follow(event, tissue, solver, tree, tracker, coarse)
        tool = membrane.Tool(position=(1e-3, 0, 1e-3 - 4e-6 * tick), radius=1e-3)
        contact = tracker.update(tree, x, tool)
        report = solver.step(x, dt, tissue, foundation, membrane.press(tool, contact), tear.ligaments())
        numbers.extend(coarse.reaction_error(x, solver))
        corrected = coarse.correct(x, solver)
        solver.wake(corrected.unbalanced)
        tree.refit(x)
        numbers.extend([*report.reactions[0], *corrected.reaction_error, corrected.corrected, corrected.step_length,
                        len(corrected.unbalanced), *corrected.unbalanced])
    return numpy.concatenate([numbers, x.ravel()])


def time_ticks(ticks):
    """The loop of the README for this number of ticks: the nanoseconds of each."""
    mesh = membrane.icosphere(radius=10e-3, subdivisions=3)
    network = membrane.MassSpringNetwork(mesh, stiffness=40.0)
    foundation = membrane.VirtualVolumeSprings(mesh, stiffness=8.0, damping=0.02)
    feel = membrane.ReactionForce()
    solver = membrane.QuasiStaticSolver(network, layers=6, sweeps=2)
    tree = membrane.AabbTree(mesh)
    tracker = membrane.ContactTracker(mesh)
    normals = membrane.VertexNormals(mesh)
    script = [(0.2 * i, (0, 0, 11.9e-3 if i % 2 == 0 else 10.5e-3)) for i in range(ticks // 200 + 1)]
    device = membrane.ScriptedDevice(script, radius=2e-3)
    clock = time.perf_counter_ns
    x = mesh.positions.copy()
    times = []
    for _ in range(ticks):
        start = clock()
        tool = device.read()
        contact = tracker.update(tree, x, tool)
        report = solver.step(x, dt, network, foundation, membrane.press(tool, contact))
        tree.refit(x, report.moved)
        normals.update(x, report.moved)
        device.write(feel(tool, contact, report))
        times.append(clock() - start)
    return times
