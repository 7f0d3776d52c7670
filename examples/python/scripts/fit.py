# SPDX-License-Identifier: MIT
"""Constants from a measurement: springs and foundation of a lens from a table of depths and forces."""
import pathlib

import matplotlib.pyplot
import numpy
import membrane

TABLE = pathlib.Path(__file__).parents[2] / "data/lens_indentation.csv"


def main():
    depth, force = numpy.genfromtxt(TABLE, delimiter=",", comments="#", invalid_raise=False).T[:2]
    is_row = numpy.isfinite(depth) & numpy.isfinite(force)
    depth, force = depth[is_row], force[is_row]
    lens = membrane.spherical_cap(radius=10e-3, diameter=9e-3, rings=6)

    def build(constants):
        springs, foundation = constants
        return (membrane.MassSpringNetwork(lens, stiffness=springs, pinned=membrane.border(lens)),
                membrane.VirtualVolumeSprings(lens, stiffness=foundation))

    tip = membrane.Tool(position=(0, 0, 12e-3), radius=1e-3)
    model = membrane.Indentation(lens, tip, (0, 0, -1), build)
    found = membrane.fit(depth, force, [10.0, 10.0], model)
    print("constant            value   95 % interval     identifiable")
    for name, value, (lower, upper), known in zip(("springs", "foundation"), found.constants, found.intervals,
                                                  found.identifiable):
        print(f"{name:10} [N/m] {value:8.2f}   {lower:6.2f} to {upper:6.2f}   {'yes' if known else 'no'}")
    print(f"misfit {100 * found.misfit:.1f} %, correlation {found.correlation[0, 1]:.2f}, "
          f"{found.evaluations} evaluations")
    axes = matplotlib.pyplot.figure(figsize=(6, 4.2)).add_subplot()
    fine = numpy.linspace(depth.min() / 4, depth.max(), 20)
    axes.plot(1e3 * depth, 1e3 * force, "o", label="measured")
    axes.plot(1e3 * fine, 1e3 * model(found.constants, fine), label="fitted")
    axes.set(xlabel="depth [mm]", ylabel="force [mN]")
    axes.legend()
    axes.figure.savefig("fit.png", dpi=120)
    print("picture: build/python/pictures/fit.png")


if __name__ == "__main__":
    main()
