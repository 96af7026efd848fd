"""Which software made a result."""

from __future__ import annotations

import platform
from functools import cache
from importlib.metadata import version


def provenance(inputs: dict[str, str] | None = None, seed: int | None = None) -> dict:
    """Versions, SHA-256 of the `inputs` by file name, and the seed, for a result's sidecar."""
    return {"versions": dict(_versions()), "inputs_sha256": dict(inputs or {}), "seed": seed}


@cache
def _versions() -> dict[str, str]:
    packages = ("vsf-drake", "drake", "numpy", "scipy", "numba")
    return {name: version(name) for name in packages} | {"python": platform.python_version()}
