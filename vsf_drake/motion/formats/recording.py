"""What one file of a gait laboratory holds: markers and force plates, in the world frame W; and as a reader has it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

SIDES = ("right", "left")


@dataclass(frozen=True, eq=False)
class Plate:
    """One force plate, in W (x forward, y left, z up, floor at z = 0).

    Attributes:
        name: how the file calls it, or "1", "2", ... in the file's order.
        force_n: (samples, 3) N, on the person.
        cop_m: (samples, 3) m, centre of pressure on the floor (z = 0); NaN where the plate carries 20 N or less, or
            where the file has none.
        free_moment_nm: (samples,) N m on the person about the vertical through the centre of pressure, up +;
            zero where the plate carries 20 N or less.
        corners_m: (4, 3) m of the plate's surface; None where the file does not say.
    """

    name: str
    force_n: np.ndarray
    cop_m: np.ndarray
    free_moment_nm: np.ndarray
    corners_m: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Recording:
    """Markers and plates of one file, or of a marker file and its force file. SI, world frame W.

    Attributes:
        path, force_path: the file, and the force file where it is another one.
        markers: (frames, 3) m by label, NaN in gaps, in the file's order.
        marker_rate_hz, force_rate_hz: frames and samples per second; None without markers or plates.
        marker_start_s, force_start_s: time of the first frame and, on the same clock, of the first sample.
        plates: in the file's order, all sampled alike.
        rotation_W: (3, 3) takes a vector of the file's laboratory frame to W.
        notes: sentences on what was assumed (units, axes, doubled labels, ...).
        person: what the file states of `mass_kg` and `stature_m`.
    """

    path: Path
    markers: dict[str, np.ndarray]
    marker_rate_hz: float | None
    plates: tuple[Plate, ...] = ()
    force_rate_hz: float | None = None
    marker_start_s: float = 0.0
    force_start_s: float = 0.0
    force_path: Path | None = None
    rotation_W: np.ndarray = field(default_factory=lambda: np.eye(3))
    notes: tuple[str, ...] = ()
    person: Mapping[str, float] = field(default_factory=dict)

    @property
    def frames(self) -> int:
        """How many frames every marker has; 0 without markers."""
        return len(next(iter(self.markers.values()), ()))

    @property
    def marker_time_s(self) -> np.ndarray:
        """(frames,) s."""
        return self.marker_start_s + np.arange(self.frames) / (self.marker_rate_hz or 1.0)

    @property
    def force_time_s(self) -> np.ndarray:
        """(samples,) s, on the markers' clock."""
        samples = len(self.plates[0].force_n) if self.plates else 0
        return self.force_start_s + np.arange(samples) / (self.force_rate_hz or 1.0)


# What a reader hands on: a file's content in SI units, still in its own laboratory frame.


@dataclass(eq=False)
class RawPlate:
    """One plate's load as force and torque about a point.

    Attributes:
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
    """Markers as (frames, markers, 3) m, NaN in gaps, with rate (1/s) and time of the first frame (s)."""

    labels: list[str]
    positions: np.ndarray
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


# Between W and OpenSim's frame (x forward, y up, z right); and the same load wherever its moment was taken.


def os_to_world(vectors: np.ndarray) -> np.ndarray:
    """(..., 3) vectors from OpenSim's frame to W: (x, -z, y)."""
    return np.asarray(vectors, dtype=float)[..., [0, 2, 1]] * [1.0, -1.0, 1.0]


def world_to_os(vectors: np.ndarray) -> np.ndarray:
    """(..., 3) vectors from W to OpenSim's frame: (x, z, -y)."""
    return np.asarray(vectors, dtype=float)[..., [0, 2, 1]] * [1.0, 1.0, -1.0]


def floor_load(point: np.ndarray, force: np.ndarray, torque: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where on z = 0 a load has a moment about the vertical only, (n, 3) m, and that moment, (n,) N m, up +.

    World frame W. With r = centre - point: torque = r x force + (0, 0, moment) and r_z = -point_z.

    Args:
        point, force, torque: (n, 3) m, N with a vertical component that is not zero, and N m about `point`.
    """
    r_z = -point[:, 2]
    r_x = (r_z * force[:, 0] - torque[:, 1]) / force[:, 2]
    r_y = (torque[:, 0] + r_z * force[:, 1]) / force[:, 2]
    moment = torque[:, 2] - (r_x * force[:, 1] - r_y * force[:, 0])
    return np.column_stack([point[:, 0] + r_x, point[:, 1] + r_y, np.zeros(len(point))]), moment
