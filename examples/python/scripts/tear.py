# SPDX-License-Identifier: MIT
"""When does a strip tear? In pure shear an advance of the tear releases the energy density times the height, whatever
the length of the tear: the driving force at its tip beside this closed form, and the strip as it tears.
"""
import math

import matplotlib.collections
import matplotlib.pyplot
import numpy
import membrane

EDGE, COLUMNS, ROWS, NOTCH = 1e-3, 32, 16, 10  # of equilateral triangles [m]; of the strip and its notch [edges]
HEIGHT = math.sqrt(0.75) * ROWS * EDGE
TISSUE = membrane.Material(young_modulus=1e6, poisson_ratio=1 / 3, thickness=1e-5)
TOUGHNESS = 1000.0  # [J/m^2]
RESISTANCE = TOUGHNESS * TISSUE.thickness


def strip():
    """Its mesh, and its rows of vertices from the lower clamp to the upper one."""
    i, j = numpy.meshgrid(numpy.arange(COLUMNS + 1), numpy.arange(ROWS + 1))
    positions = EDGE * numpy.stack([i + j % 2 / 2, math.sqrt(0.75) * j, 0 * i], axis=-1).reshape(-1, 3)
    rows = numpy.arange(positions.shape[0]).reshape(i.shape)
    triangles = []
    for row in range(ROWS):
        far, near = rows[row + row % 2], rows[row + 1 - row % 2]  # the row that begins at 0, the one half an edge on
        pairs = numpy.vstack([numpy.column_stack([far[:-1], far[1:], near[:-1]]),
                              numpy.column_stack([near[:-1], far[1:], near[1:]])])
        triangles.append(pairs[:, ::-1] if row % 2 else pairs)
    return membrane.with_reserve(membrane.TriangleMesh(positions, numpy.vstack(triangles)), 50), rows


def energy_density(stretch):
    """Of the springs of equilateral triangles, stretched across one of their sides [J/m^2]."""
    return TISSUE.young_modulus * TISSUE.thickness * (numpy.sqrt((1 + 3 * stretch**2) / 4) - 1)**2


class TornStrip:
    """Springs between two clamps, with a notch."""

    def __init__(self):
        mesh, rows = strip()
        self.clamp = rows[-1]
        springs = membrane.MassSpringNetwork(mesh, stiffness=membrane.spring_stiffnesses(mesh, TISSUE),
                                             pinned=[*rows[0], *rows[-1]])
        self.springs = membrane.TearableSprings(mesh, springs)
        self.solver = membrane.QuasiStaticSolver(self.springs, layers=membrane.unlimited, sweeps=6, predict=False)
        self.tear = membrane.Tearing(mesh, membrane.EnergyRelease(toughness=TOUGHNESS, thickness=TISSUE.thickness))
        self.x = mesh.positions.copy()
        self.work = self.force = 0.0
        self.follow(self.tear.cut_along(rows[ROWS // 2, :NOTCH + 1], self.x))

    def follow(self, events):
        for event in events:
            membrane.follow(event, self.springs, self.solver)

    def draw(self, by):
        """Moves the upper clamp, to equilibrium or for a while. Whether it is one."""
        self.x[self.clamp, 1] += by
        for _ in range(30):
            self.solver.wake_all()
            report = self.solver.step(self.x, 1e-3, self.springs, membrane.NoFoundation(), self.tear.ligaments(),
                                      membrane.pin(self.clamp))
            if report.residual < 3e-4 * RESISTANCE:
                break
        before, self.force = self.force, -report.reactions[1][1]
        self.work += (before + self.force) / 2 * by
        self.follow(self.tear.update(self.x, 1e-3, self.springs, membrane.NoFoundation()))
        return report.residual < 3e-4 * RESISTANCE


def show(strip, released):
    figure, (left, right) = matplotlib.pyplot.subplots(1, 2, figsize=(11, 4.2), gridspec_kw={"width_ratios": (1, 1.4)})
    stretch, driving_force = numpy.array(released).T
    left.plot(stretch, 1e3 * energy_density(stretch) * HEIGHT, "k--", label="energy density times height")
    left.plot(stretch, 1e3 * driving_force, label="driving force at the tip")
    left.axhline(1e3 * RESISTANCE, color="0.6", label="toughness times thickness")
    left.set(xlabel="stretch", ylabel="energy per length of the tear [mN]")
    left.legend(loc="lower right")
    ends = 1e3 * strip.x[[spring[:2] for spring in strip.springs.springs], :2]
    right.add_collection(matplotlib.collections.LineCollection(ends, colors="#904030", linewidths=0.6))
    right.autoscale()
    right.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]",
              title=f"torn by {strip.tear.torn_length / EDGE:.0f} edges of 1 mm")
    figure.tight_layout()
    figure.savefig("tear.png", dpi=120)
    print("picture: build/python/pictures/tear.png")


def main():
    strip = TornStrip()
    released, stretch, by = [], 1.0, 0.01 * HEIGHT
    while strip.tear.torn_length < 12 * EDGE:
        at_rest = strip.draw(by)
        if at_rest and strip.tear.torn_length == 0:
            stretch = strip.x[strip.clamp[0], 1] / HEIGHT
            released.append((stretch, numpy.linalg.norm(strip.tear.tips[0].driving_force)))
        by = 0.0 if not at_rest else (0.01 if energy_density(stretch) * HEIGHT < 0.9 * RESISTANCE else 1e-3) * HEIGHT
    root = 1 + math.sqrt(RESISTANCE / (TISSUE.young_modulus * TISSUE.thickness * HEIGHT))
    print(f"begins to tear at a stretch of {stretch:.3f}, by the closed form {math.sqrt((4 * root**2 - 1) / 3):.3f}")
    stored = strip.springs.energy(strip.x) + strip.tear.stored(strip.x)
    print(f"work of the clamps {1e3 * strip.work:.3f} mJ: {1e3 * stored:.3f} stored, "
          f"{1e3 * strip.tear.dissipated:.3f} in {1e3 * strip.tear.torn_length:.1f} mm of tear")
    show(strip, released)


if __name__ == "__main__":
    main()
