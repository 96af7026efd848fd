"""SHA-256 of what numbers depend on: of values, of arrays, and of the software that makes them.

A key is the same on any day, in any process and whatever the order of a mapping, and differs as soon as one bit of
one number does.
"""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.laws.compiled import sources_sha256
from vsf_drake.simulation.provenance import provenance

PACKAGE = Path(__file__).resolve().parents[2]
SOURCES = ("laws", "systems", "plants", "simulation", "motion/trajectory.py", "actuator_parameters.py", "ground.py",
           "model_file.py", "parameters.py", "schema.py", "subject.py")
"""Parts of the package that the numbers of a walk come from, once its recording is read."""


def digest(plain: Any, arrays: Mapping[str, np.ndarray] | None = None) -> str:
    """64 hexadecimal digits for plain values (as `schema.to_plain` gives them) and named arrays.

    Raises:
        ValueError: a number in `plain` is not finite.
        TypeError: something in `plain` is not a plain value.
    """
    found = hashlib.sha256(json.dumps(plain, sort_keys=True, allow_nan=False).encode())
    for name, array in sorted((arrays or {}).items()):
        found.update(f"\0{name} {array.dtype.str} {array.shape}\0".encode())
        found.update(np.ascontiguousarray(array).data)
    return found.hexdigest()


@cache
def software() -> dict[str, str]:
    """Versions of what computes a walk, kind of processor, and the digest of this package's own sources.

    A version number alone would let a changed law in a checkout return old numbers. Read when the package is
    imported, so that it describes the code that runs.
    """
    return {**provenance()["versions"], "machine": platform.machine(),
            "sources_sha256": sources_sha256(PACKAGE, SOURCES)}


software()
