# SPDX-License-Identifier: MIT
"""The paper's figure 4: a sphere at rest, pressed and pulled, drawn from the arrays that the solver moves in place."""
import matplotlib.pyplot
import numpy
import membrane

TICK = 1e-3  # [s]
ABOVE, DEEP, HIGH = 13e-3, 10e-3, 14e-3  # of the tool's centre [m]


def positions(script, until):
    """The membrane when the tool has followed the script for a time."""
    mesh = membrane.icosphere(radius=10e-3, subdivisions=3)
    network = membrane.MassSpringNetwork(mesh, stiffness=40.0)
    foundation = membrane.VirtualVolumeSprings(mesh, stiffness=4.0, damping=0.02)
    solver = membrane.QuasiStaticSolver(network)
    tree, tracker, grasper = membrane.AabbTree(mesh), membrane.ContactTracker(mesh), membrane.Grasper(mesh)
    device = membrane.ScriptedDevice(script, radius=2.5e-3)
    x = mesh.positions.copy()
    force = 0.0
    while device.running and device.time < until:
        tool = device.read()
        contact = tracker.update(tree, x, tool)
        grasp = grasper.update(contact, x, tool)
        report = solver.step(x, TICK, network, foundation, membrane.press(tool, contact, grasp),
                             membrane.pull(tool, grasp))
        tree.refit(x, report.moved)
        force = float(numpy.linalg.norm(report.total_reaction()))
    return mesh.triangles, x, force


def main():
    touching = [(0.0, (0, 0, ABOVE)), (0.3, (0, 0, DEEP))]
    pulling = [(0.0, (0, 0, ABOVE)), (0.1, (0, 0, 12.4e-3)), (0.15, (0, 0, 12.4e-3), True),
               (0.4, (0, 0, HIGH + 2.4e-3), True)]
    figure = matplotlib.pyplot.figure(figsize=(12, 4.2))
    for column, (title, script, until) in enumerate([("at rest", touching, 0.0), ("pressed", touching, 1.0),
                                                     ("pulled", pulling, 1.0)]):
        triangles, x, force = positions(script, until)
        axes = figure.add_subplot(1, 3, column + 1, projection="3d")
        axes.plot_trisurf(*(1e3 * x.T), triangles=triangles, color="#e8b4a0", edgecolor="#904030", linewidth=0.2)
        axes.set(title=f"{title}: {1e3 * force:.0f} mN", box_aspect=(1, 1, 1.2), xlim=(-10, 10), ylim=(-10, 10),
                 zlim=(-10, 14))
        axes.view_init(elev=15)
        print(f"{title:8} {1e3 * force:6.1f} mN, top at {1e3 * x[:, 2].max():.2f} mm")
    figure.savefig("figure_4.png", dpi=120)
    print("picture: build/python/pictures/figure_4.png")


if __name__ == "__main__":
    main()
