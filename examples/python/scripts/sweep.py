# SPDX-License-Identifier: MIT
"""A sweep of parameters over all cores: the peak force of a press for each stiffness of springs and foundation. A process
for each core, since the calls of a tick hold Python's lock.
"""
import concurrent.futures
import itertools
import time

import membrane


def press(parameters):
    """Peak force of a press of 1 mm [N]."""
    springs, foundation_stiffness = parameters
    mesh = membrane.icosphere(radius=10e-3, subdivisions=3)
    network = membrane.MassSpringNetwork(mesh, stiffness=springs)
    foundation = membrane.VirtualVolumeSprings(mesh, stiffness=foundation_stiffness, damping=0.02)
    solver = membrane.QuasiStaticSolver(network)
    tree, tracker = membrane.AabbTree(mesh), membrane.ContactTracker(mesh)
    device = membrane.ScriptedDevice([(0, (0, 0, 13e-3)), (0.2, (0, 0, 11e-3)), (0.4, (0, 0, 13e-3)),
                                      (0.5, (0, 0, 13e-3))], radius=2e-3)
    x = mesh.positions.copy()
    peak = 0.0
    while device.running:
        tool = device.read()
        report = solver.step(x, 1e-3, network, foundation, membrane.press(tool, tracker.update(tree, x, tool)))
        tree.refit(x, report.moved)
        peak = max(peak, report.reactions[0][2])
    return peak


def main():
    springs, foundations = (10.0, 20.0, 40.0, 80.0), (2.0, 4.0, 8.0, 16.0)
    grid = list(itertools.product(springs, foundations))
    start = time.perf_counter()
    with concurrent.futures.ProcessPoolExecutor() as pool:
        results = dict(zip(grid, pool.map(press, grid)))
    print("peak force [mN]; rows: springs, columns: foundation [N/m]")
    print("      " + "".join(f"{k:9.0f}" for k in foundations))
    for k in springs:
        print(f"{k:6.0f}" + "".join(f"{1e3 * results[k, f]:9.1f}" for f in foundations))
    print(f"{len(grid)} scenes of 500 ticks in {time.perf_counter() - start:.1f} s")


if __name__ == "__main__":
    main()
