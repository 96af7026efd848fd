"""The keel as a planar chain of rigid pieces, of any kind of number.

    A                P           K: x along the straight keel, z up
    o====o====o===o==^==o==o     joint i, `starts[i]` from A on the straight keel, turns its piece
                                 and all beyond it toe up; P a point of a piece

Arrays are (m,) or (m, ...), of m joints.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vsf_drake.laws._elementwise import Array
from vsf_drake.laws.compiled import generic


@generic
def lay_chain(starts: Array, turns: Array, c: Array, s: Array, x: Array, z: Array) -> None:
    """Writes of each piece the cosine and sine of its angle, the sum of the turns up to it (rad),
    and of its joint the place x, z (m) in K."""
    angle = turns[0]
    x[0] = starts[0] + 0.0 * angle
    z[0] = 0.0 * angle
    c[0] = np.cos(angle)
    s[0] = np.sin(angle)
    for i in range(1, len(starts)):
        length = starts[i] - starts[i - 1]
        x[i] = x[i - 1] + length * c[i - 1]
        z[i] = z[i - 1] + length * s[i - 1]
        angle = angle + turns[i]
        c[i] = np.cos(angle)
        s[i] = np.sin(angle)


@generic
def piece_at(starts: Array, position: Any) -> int:
    """The piece that has the point `position` (m) from A."""
    piece = 0
    while piece + 1 < len(starts) and starts[piece + 1] <= position:
        piece += 1
    return piece


def chain(starts: Array, turns: Array) -> tuple[Array, Array, Array, Array]:
    """c, s, x, z of `lay_chain`, each of the shape of `turns` (m, ...), real or complex."""
    c, s, x, z = (np.zeros_like(turns) for _ in range(4))
    if len(starts):
        lay_chain(starts, turns, c, s, x, z)
    return c, s, x, z
