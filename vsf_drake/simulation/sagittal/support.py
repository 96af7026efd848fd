"""The fulcrum under the keel, as a function of the keel's turns: the pair of forces moves nothing else.

    A                P        K: x along the undeformed keel, z up
    o====o====o===o==^=o==o   joints o turn the toe up, one after the other; P at the fulcrum's position

The force goes from one rigid piece to the next over SUPPORT_WIDTH on both sides of the joint between them, so that
everything has a derivative by the fulcrum's position. There the deflection is off from the stepper's by at most 0.087
of that width times the joint's turn.
"""

from __future__ import annotations

import numpy as np

SUPPORT_WIDTH = 4e-3
"""m; a choice: half the shortest distance of two joints is 11.6 mm."""


class Support:
    """A two-sided stiff support of a chain whose pieces begin at `starts` (K,) m from A.

    Args:
        stiffness, damping: N/m, N s/m.
        signs: (K,) of the joints' coordinates, 1 where positive ones lift the toe.
    """

    def __init__(self, starts: np.ndarray, signs: np.ndarray, stiffness: float, damping: float) -> None:
        self.starts, self.signs, self.stiffness, self.damping = starts, signs, stiffness, damping

    def deflection(self, w: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Height (...) of P over the undeformed keel (m) at the turns w (K, ...), and (K, ...) its derivatives by w."""
        tall = (-1, *(1,) * (w.ndim - 1))
        starts, signs = self.starts.reshape(tall), self.signs.reshape(tall)
        angle = np.cumsum(signs * w, axis=0)
        c, s = np.cos(angle), np.sin(angle)
        lengths = np.diff(starts, axis=0)
        zero = np.zeros_like(c[:1])
        x = np.concatenate([zero, np.cumsum(lengths * c[:-1], axis=0)])
        z = np.concatenate([zero, np.cumsum(lengths * s[:-1], axis=0)])
        along = position - starts
        past = np.concatenate([zero + 1.0, _blend(along[1:] / SUPPORT_WIDTH), zero])
        share = past[:-1] - past[1:]
        # Of all beyond a joint: their share, and where they bear.
        ahead = np.cumsum((share * (x + along * c))[::-1], axis=0)[::-1]
        return (share * (z + along * s)).sum(axis=0), signs * (ahead - past[:-1] * x)

    def load(self, w: np.ndarray, u: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(K, ...) N m that the joints must give against the support, (...) J stored in it, the deflection's (K, ...)
        derivatives by w."""
        deflection, by = self.deflection(w, position)
        force = self.stiffness * deflection + self.damping * (by * u).sum(axis=0)
        return force * by, 0.5 * self.stiffness * deflection * deflection, by


def _blend(s: np.ndarray) -> np.ndarray:
    """0 below -1, 1 above 1, between them the cubic with level ends."""
    t = 0.5 * (s + 1.0)
    return np.where(s.real <= -1.0, 0.0, np.where(s.real >= 1.0, 1.0, t * t * (3.0 - 2.0 * t)))
