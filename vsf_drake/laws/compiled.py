"""The two ways in which this package compiles functions; the machine code is kept on disk for later processes.

Division by zero gives infinity as in numpy arrays, not an exception, which would cost a branch each time; the
steppers look for numbers that are not finite.
"""

from __future__ import annotations

import numba

compiled = numba.njit(cache=True, error_model="numpy")
"""For functions that Python calls too."""
internal = numba.njit(cache=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""For functions that only compiled ones call, which take half the time to compile: calling one from Python ends the
interpreter."""
