"""How this package compiles functions; the machine code is kept on disk for later processes.

numba takes kept code for valid as long as the file of the function is the same, but that code also
holds the functions of other files that it calls: so the folder is named after the content of all
files with compiled functions.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

from vsf_drake.laws.compiled import sources_sha256

_HERE = Path(__file__).parent
_SOURCES = ("assembly.py", "device.py", "dynamics.py", "laws.py", "stepping.py")
_FOLDER = str(_HERE / "__pycache__" / sources_sha256(_HERE, _SOURCES)[:16])


def compiled(function: Callable[..., Any]) -> Any:
    """`function` in machine code."""
    settings: Any = numba.config
    users, settings.CACHE_DIR = settings.CACHE_DIR, _FOLDER  # is read when a function is decorated
    try:
        return numba.njit(cache=True)(function)
    finally:
        settings.CACHE_DIR = users
