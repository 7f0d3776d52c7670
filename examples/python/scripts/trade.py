# SPDX-License-Identifier: MIT
"""The trade of error against time: each number of layers and sweeps on one press, and what choose_settings finds."""
import math

import matplotlib.pyplot
import membrane

TICK = 1e-3  # [s]


def press(mesh):
    """A tool that goes 1.5 mm deep and slides around: one for each tick."""
    tools = []
    for tick in range(300):
        part, turn = min(tick / 100, 1.0), 0.01 * max(tick - 100, 0)
        distance = 12.1e-3 - 1.6e-3 * part
        tools.append(membrane.Tool(position=(distance * math.sin(turn), 0, distance * math.cos(turn)), radius=2e-3,
                                   time=tick * TICK))
    return membrane.ToolTrajectory(mesh, tools, TICK)


def main():
    mesh = membrane.icosphere(radius=10e-3, subdivisions=3)
    network = membrane.MassSpringNetwork(mesh, stiffness=40.0)
    foundation = membrane.VirtualVolumeSprings(mesh, stiffness=8.0)
    trajectory = press(mesh)
    references = membrane.equilibria(mesh, network, foundation, trajectory, tick_stride=20)
    axes = matplotlib.pyplot.figure(figsize=(6, 4.2)).add_subplot()
    print("layers  sweeps   error [%]   tick [us]")
    for layers in (2, 4, 6, 8):
        results = []
        for sweeps in (1, 2, 4, 8):
            result = membrane.run_trial(mesh, network, foundation, trajectory, references, layers=layers,
                                        sweeps=sweeps)
            results.append(result)
            print(f"{layers:6} {sweeps:7} {100 * result.force_error:11.3f} {1e6 * result.time:11.1f}")
        axes.loglog([1e6 * result.time for result in results], [100 * result.force_error for result in results], "o-",
                    label=f"{layers} layers")
    axes.set(xlabel="tick [us]", ylabel="error of the force [%]", title="642 vertices, 1 to 8 sweeps")
    axes.legend()
    axes.figure.savefig("trade.png", dpi=120)
    choice = membrane.choose_settings(mesh, network, foundation, trajectory, force_error=0.01, layers=[2, 4, 6, 8],
                                      sweeps=[1, 2, 4, 8], contact_iterations=[2, 4], tick_stride=20)
    print(f"for 1 %: {choice.options.layers} layers, {choice.options.sweeps} sweeps, "
          f"{choice.options.contact_iterations} contact iterations"
          f"{'' if choice.satisfied else '; no setting is sufficient, this comes closest'}")
    print("picture: build/python/pictures/trade.png")


if __name__ == "__main__":
    main()
