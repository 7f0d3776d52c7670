# SPDX-License-Identifier: MIT
"""The loops of loops.py have the same bits as those of same_loop.cpp."""
import os
import subprocess

import loops
import numpy
import pytest

PROGRAM = os.environ.get("MEMBRANE_SAME_LOOP")


def numbers_of(name):
    """What the program of C++ prints: digits enough for each bit."""
    run = subprocess.run([PROGRAM, name], capture_output=True, text=True, check=True)
    return numpy.array([float(word) for word in run.stdout.split()])


@pytest.mark.skipif(not PROGRAM, reason="MEMBRANE_SAME_LOOP is the program, compiled of same_loop.cpp")
@pytest.mark.parametrize("name", ["sphere", "cap", "offline", "published", "law", "accuracy", "peel", "friction",
                                  "tear", "start", "coarse"])
def test_same_bits(name):
    native, python = numbers_of(name), numpy.ravel(getattr(loops, name)())
    assert native.size == python.size and native.size > 300
    assert numpy.count_nonzero(native) > 100
    assert numpy.array_equal(native.view(numpy.uint64), python.view(numpy.uint64))


@pytest.mark.skipif(not PROGRAM, reason="MEMBRANE_SAME_LOOP is the program, compiled of same_loop.cpp")
def test_time_of_both_loops_is_that_of_the_same_ticks():
    run = subprocess.run([PROGRAM, "time", "50"], capture_output=True, text=True, check=True)
    assert len(run.stdout.split()) == len(loops.time_ticks(50)) == 50
