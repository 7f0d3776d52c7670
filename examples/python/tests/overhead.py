# SPDX-License-Identifier: MIT
"""overhead.py PROGRAM [TICKS] [ROUNDS]: what Python adds to a tick of the README's loop, 642 vertices.

PROGRAM is same_loop.cpp, compiled with the options of the module. Both loops run in turns, so that a change of the
processor's clock or of the machine's load meets both. Printed are the medians over the ticks of all rounds, their
difference, and the difference of the lower quartiles.
"""
import os
import statistics
import subprocess
import sys

from loops import time_ticks


def main(program, ticks=10_000, rounds=5):
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    native, python = [], []
    for _ in range(int(rounds)):
        run = subprocess.run([program, "time", str(ticks)], capture_output=True, text=True, check=True)
        native += [float(line) for line in run.stdout.split()]
        python += time_ticks(int(ticks))
    print("          C++ [us]  Python [us]  difference [us]")
    for name, of in (("median", statistics.median), ("quartile", lambda times: statistics.quantiles(times)[0])):
        both = [of(times) / 1e3 for times in (native, python)]
        print(f"{name:9} {both[0]:8.2f} {both[1]:12.2f} {both[1] - both[0]:16.2f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
