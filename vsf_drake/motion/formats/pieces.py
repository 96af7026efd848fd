"""Large arrays a piece at a time, so that no step needs a second array of their size."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

PIECE = 1 << 18
"""Numbers at a time (2 MB)."""


def pieces(rows: int, width: int = 3) -> Iterator[slice]:
    """Slices that cover `rows` rows of `width` numbers."""
    step = max(1, PIECE // width)
    for first in range(0, rows, step):
        yield slice(first, min(first + step, rows))


def turn(vectors: np.ndarray, rotation: np.ndarray) -> None:
    """Rotates vectors (n, 3) in place by a (3, 3) matrix."""
    for piece in pieces(len(vectors)):
        vectors[piece] = vectors[piece] @ rotation.T
