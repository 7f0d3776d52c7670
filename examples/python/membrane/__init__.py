# SPDX-License-Identifier: MIT
"""The library `membrane` in Python: thin tissue under a tool, and the force on the hand that holds it.

SI units everywhere: metres, newtons, seconds. Points are the rows of an array V x 3 of float64, which the library reads
and writes in place. Docstrings are the comments of the headers of C++; their 3 x V is V x 3 here.
"""
from ._membrane import *  # noqa: F403
from ._membrane import __version__, devices, materials  # noqa: F401
