"""What one file of a gait laboratory holds: markers and force plates, in the world frame W; and as
a reader has it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

SIDES = ("right", "left")
LARGEST = 1e9
"""No number of a recording is as large, in any unit; what programs write for a marker that was not
seen is larger."""


@dataclass(frozen=True, eq=False)
class Plate:
    """One force plate, in W (x forward, y left, z up, floor at z = 0)."""

    name: str  # how the file calls it, or "1", "2", ... in the file's order
    force_n: np.ndarray  # (samples, 3) N, on the person
    cop_m: np.ndarray
    """(samples, 3) m on the floor (z = 0); NaN where it carries 20 N or less, or the file has
    none"""
    free_moment_nm: np.ndarray
    """(samples,) about the vertical through the centre of pressure, up +; zero up to 20 N"""
    corners_m: np.ndarray | None = None  # (4, 3) of the plate's surface, if the file says


@dataclass(frozen=True, eq=False)
class PlateRecording:
    """What the ground did to one foot, in the world frame W (x forward, y left, z up, ground z =
    0)."""

    time_s: np.ndarray  # (n,)
    force_W: np.ndarray  # (n, 3) N, acting on the person
    cop_W: np.ndarray  # (n, 3) m, z = 0; NaN where the load is 20 N or less, or `has_cop` is False
    free_moment_nm: np.ndarray
    """(n,) about the vertical through the centre of pressure, up +; zero up to 20 N"""
    has_cop: bool  # whether the file has a centre of pressure
    unknown_s: tuple[tuple[float, float], ...] = ()
    """spans in which the foot's force is unknown, whatever stands here"""


@dataclass(frozen=True, eq=False)
class Recording:
    """Markers and plates of one file, or of a marker file and its force file. SI, world frame W."""

    path: Path
    markers: dict[str, np.ndarray]  # (frames, 3) m by label, NaN in gaps, in the file's order
    marker_rate_hz: float | None  # None without markers
    plates: tuple[Plate, ...] = ()  # in the file's order, all sampled alike
    force_rate_hz: float | None = None  # None without plates
    marker_start_s: float = 0.0
    force_start_s: float = 0.0  # on the same clock
    force_path: Path | None = None  # where the forces are in another file
    rotation_W: np.ndarray = field(default_factory=lambda: np.eye(3))
    """takes a vector of the laboratory frame to W"""
    notes: tuple[str, ...] = ()  # sentences on what was assumed (units, axes, doubled labels, ...)
    person: Mapping[str, float] = field(default_factory=dict)
    """`mass_kg` and `stature_m`, if the file states them"""

    @property
    def frames(self) -> int:
        return len(next(iter(self.markers.values()), ()))

    @property
    def marker_time_s(self) -> np.ndarray:
        return self.marker_start_s + np.arange(self.frames) / (self.marker_rate_hz or 1.0)

    @property
    def force_time_s(self) -> np.ndarray:
        """(samples,) s, on the markers' clock."""
        samples = len(self.plates[0].force_n) if self.plates else 0
        return self.force_start_s + np.arange(samples) / (self.force_rate_hz or 1.0)


# What a reader hands on: a file's content in SI units, still in its own laboratory frame.


@dataclass(eq=False)
class RawPlate:
    """One plate's load as force and torque about a point."""

    name: str
    force: np.ndarray  # (n, 3) N; on the person or on the plate, which its direction tells later
    point: np.ndarray | None
    """(n, 3) m, or (3,) where it is the same throughout; None where the file has none"""
    torque: np.ndarray  # (n, 3) N m about `point`, free moment included
    twist: np.ndarray | None = None
    """(n,) N m more about the vertical, for files that give only this"""
    corners: np.ndarray | None = None  # (4, 3) m


@dataclass(eq=False)
class RawTrial:
    """A file's content."""

    labels: list[str] = field(default_factory=list)
    positions: np.ndarray | None = None  # (frames, markers, 3) m, NaN in gaps; None without markers
    marker_rate_hz: float = 1.0
    marker_start_s: float = 0.0
    plates: list[RawPlate] = field(default_factory=list)
    force_rate_hz: float = 1.0
    force_start_s: float | None = None  # None where the file has no clock of its own
    up: str | None = None  # the signed axis such as "+z" that the file states for the vertical
    up_convention: str | None = None  # the vertical of this format where the file states none
    notes: list[str] = field(default_factory=list)
    person: dict[str, float] = field(default_factory=dict)
    """what the file states of `mass_kg` and `stature_m`"""


# Between W and OpenSim's frame (x forward, y up, z right); and the same load wherever its moment
# was taken.


def os_to_world(vectors: np.ndarray) -> np.ndarray:
    """(..., 3) vectors from OpenSim's frame to W: (x, -z, y)."""
    return np.asarray(vectors, dtype=float)[..., [0, 2, 1]] * [1.0, -1.0, 1.0]


def world_to_os(vectors: np.ndarray) -> np.ndarray:
    """(..., 3) vectors from W to OpenSim's frame: (x, z, -y)."""
    return np.asarray(vectors, dtype=float)[..., [0, 2, 1]] * [1.0, 1.0, -1.0]


def floor_load(
    point: np.ndarray, force: np.ndarray, torque: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where on z = 0 a load has a moment about the vertical only, (n, 3) m, and that moment, (n,) N
    m, up +.

    World frame W. With r = centre - point: torque = r x force + (0, 0, moment) and r_z = -point_z.
    All (n, 3); the vertical force is not zero.
    """
    r_z = -point[:, 2]
    r_x = (r_z * force[:, 0] - torque[:, 1]) / force[:, 2]
    r_y = (torque[:, 0] + r_z * force[:, 1]) / force[:, 2]
    moment = torque[:, 2] - (r_x * force[:, 1] - r_y * force[:, 0])
    return np.column_stack([point[:, 0] + r_x, point[:, 1] + r_y, np.zeros(len(point))]), moment
