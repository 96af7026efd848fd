"""What a reader hands on: a file's content in SI units, still in its own laboratory frame. Schema only."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(eq=False)
class RawPlate:
    """One plate's load as force and torque about a point.

    Attributes:
        name: how the file calls it, or its number.
        force: (n, 3) N; on the person or on the plate, which its direction tells later.
        point: (n, 3) m, or (3,) where it is the same throughout, or None where the file has none.
        torque: (n, 3) N m about `point`, free moment included.
        twist: (n,) N m, added to the torque about the vertical, for files that give only this.
        corners: (4, 3) m, or None.
    """

    name: str
    force: np.ndarray
    point: np.ndarray | None
    torque: np.ndarray
    twist: np.ndarray | None = None
    corners: np.ndarray | None = None


@dataclass(eq=False)
class RawMarkers:
    """Markers as (frames, 3) m by label, NaN in gaps, with rate (1/s) and time of the first frame (s)."""

    labels: list[str]
    positions: np.ndarray
    """(frames, markers, 3) m."""
    rate_hz: float
    start_s: float


@dataclass(eq=False)
class RawForces:
    """Plates sampled alike; `start_s` is None where the file has no clock of its own."""

    plates: list[RawPlate]
    rate_hz: float
    start_s: float | None


@dataclass(eq=False)
class RawTrial:
    """A file's content.

    Attributes:
        up: the signed axis such as "+z" that the file states for the vertical; None where it states none.
        up_convention: the vertical of this format where the file states none; None where there is no convention.
        person: what the file states of `mass_kg` and `stature_m`.
    """

    markers: RawMarkers | None = None
    forces: RawForces | None = None
    up: str | None = None
    up_convention: str | None = None
    notes: list[str] = field(default_factory=list)
    person: dict[str, float] = field(default_factory=dict)
