# SPDX-License-Identifier: MIT
"""Does the force depend on the mesh? A lens capsule on its cortex, the same tissue on meshes of smaller and smaller
triangles, each at equilibrium under the same tool; and how far a solver's steps are from it.
"""
import numpy
import membrane

DEPTH, RADIUS = 0.4e-3, 2e-3  # of the press, of the tool [m]


def membrane_of(rings):
    mesh = membrane.spherical_cap(radius=10e-3, diameter=9e-3, rings=rings)
    tissue = membrane.materials.lens_capsule().typical
    cortex = membrane.FoundationLayer(young_modulus=2e3, poisson_ratio=0.45, thickness=1e-3)
    network = membrane.MassSpringNetwork(mesh, stiffness=membrane.spring_stiffnesses(mesh, tissue),
                                         pinned=membrane.border(mesh))
    foundation = membrane.FoundationSprings(mesh, normal=membrane.normal_stiffnesses(mesh, cortex),
                                            tangential=membrane.tangential_stiffnesses(mesh, cortex))
    return mesh, network, foundation


def forces(rings, ticks=400):
    """At equilibrium, and after that many ticks of the solver [N]."""
    mesh, network, foundation = membrane_of(rings)
    tool = membrane.Tool(position=(0, 0, 10e-3 + RADIUS - DEPTH), radius=RADIUS)
    tree, tracker = membrane.AabbTree(mesh), membrane.ContactTracker(mesh)
    solver = membrane.QuasiStaticSolver(network, layers=membrane.unlimited, sweeps=4)
    x = mesh.positions.copy()
    for _ in range(ticks):
        contact = tracker.update(tree, x, tool)
        report = solver.step(x, 1e-3, network, foundation, membrane.press(tool, contact))
        tree.refit(x, report.moved)
    stepped = report.reactions[0][2]
    rest = membrane.equilibrium(x, mesh, network, foundation, membrane.press(tool, contact))
    assert rest.converged
    return mesh, rest.reactions[0][2], stepped


def main():
    print("vertices   edge [mm]   equilibrium [mN]   change [%]   steps off by [%]")
    before = numpy.nan
    for rings in (8, 12, 18, 27):
        mesh, force, stepped = forces(rings)
        print(f"{mesh.vertex_count:8} {1e3 * membrane.mean_edge(mesh):11.3f} {1e3 * force:18.3f} "
              f"{100 * (force / before - 1):12.2f} {100 * abs(stepped / force - 1):18.1e}")
        before = force


if __name__ == "__main__":
    main()
