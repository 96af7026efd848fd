"""One thread for the linear algebra of small blocks.

OpenBLAS hands even a block of 170 rows to all cores. On a machine that is busy with other work each call then waits
for the slowest of them: a solve was seen to take fifty times longer. The wheels of NumPy and SciPy bring one OpenBLAS
each; where they do not (other builds), nothing is changed.
"""

from __future__ import annotations

import contextlib
import ctypes
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import numpy
import scipy

SUFFIXES = ("", "64_")


@contextlib.contextmanager
def one_thread() -> Iterator[None]:
    """Linear algebra of this process runs on one thread within the block."""
    libraries = _libraries()
    before = [get() for get, _ in libraries]
    try:
        for _, put in libraries:
            put(1)
        yield
    finally:
        for (_, put), count in zip(libraries, before, strict=True):
            put(count)


@cache
def _libraries() -> tuple[tuple[Callable[[], int], Callable[[int], None]], ...]:
    """Reader and setter of the number of threads of each OpenBLAS in the wheels' folders."""
    found = []
    for package in (numpy, scipy):
        home = Path(package.__file__).parent
        folders = (home.parent / f"{home.name}.libs", home / ".dylibs")
        for path in sorted(file for folder in folders if folder.is_dir() for file in folder.glob("*openblas*")):
            with contextlib.suppress(OSError):
                library = ctypes.CDLL(str(path))
                for suffix in SUFFIXES:
                    get = getattr(library, f"scipy_openblas_get_num_threads{suffix}", None)
                    put = getattr(library, f"scipy_openblas_set_num_threads{suffix}", None)
                    if get is not None and put is not None:
                        get.restype, put.argtypes = ctypes.c_int, [ctypes.c_int]
                        found.append((get, put))
    return tuple(found)
