# SPDX-License-Identifier: MIT
"""The loops and calls of same_loop.cpp in Python: each returns the numbers that the program prints, in its order."""
import time

import numpy
import membrane

dt = 1e-3  # [s]


def sphere():
    """A sphere is pressed, grasped and pulled, with a load and two pinned vertices."""
    mesh = membrane.icosphere(radius=10e-3, subdivisions=3)
    network = membrane.MassSpringNetwork(mesh, stiffness=40.0)
    foundation = membrane.VirtualVolumeSprings(mesh, stiffness=8.0, damping=0.02)
    solver = membrane.QuasiStaticSolver(network, layers=6, sweeps=2)
    tree = membrane.AabbTree(mesh)
    tracker = membrane.ContactTracker(mesh)
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
    press, clock = membrane.press, time.perf_counter_ns
    x = mesh.positions.copy()
    times = []
    for _ in range(ticks):
        start = clock()
        tool = device.read()
        contact = tracker.update(tree, x, tool)
        report = solver.step(x, dt, network, foundation, press(tool, contact))
        tree.refit(x, report)
        normals.update(x, report)
        device.write(feel(tool, contact, report))
        times.append(clock() - start)
    return times
