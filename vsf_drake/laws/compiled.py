"""The two ways in which this package compiles functions; the machine code is kept on disk for later processes.

Where neither the package's folder nor the user's cache can be written (a container without a home) every process
compiles anew; `NUMBA_CACHE_DIR` names a folder that can.

Division by zero gives infinity as in numpy arrays, not an exception, which would cost a branch each time; the
steppers look for numbers that are not finite.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba


def compiled(function: Callable[..., Any], **options: Any) -> Any:
    """For functions that Python calls too. `options` are numba's."""
    try:
        return numba.njit(cache=True, error_model="numpy", **options)(function)
    except RuntimeError:  # numba has found no folder to keep it in
        return numba.njit(error_model="numpy", **options)(function)


def internal(function: Callable[..., Any]) -> Any:
    """For functions that only compiled ones call, which take half the time to compile: calling one from Python ends
    the interpreter."""
    return compiled(function, no_cpython_wrapper=True, no_cfunc_wrapper=True)
