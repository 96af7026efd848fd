"""Unbroken stretches of frames or samples in which something is true."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def runs(flags: ArrayLike) -> list[tuple[int, int]]:
    """The stretches [start, stop) in which `flags` (n,) is True, in order."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], np.asarray(flags, dtype=bool), [False]))))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def longest_run(flags: ArrayLike) -> np.ndarray:
    """Indices of the longest stretch in which `flags` (n,) is True, the first of equals; none if it never is."""
    return np.arange(*max(runs(flags), key=lambda run: run[1] - run[0], default=(0, 0)))
