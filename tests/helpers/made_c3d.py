"""C3D files for tests, written with ezc3d: markers, and force plates whose channels follow from a
stated load."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import ezc3d
import numpy as np

SENSORS = (0.12, 0.2, 0.054)
"""m: places (+-a, +-b) and depth of the four sensors of a plate of type 3, 6 or 7, or depth
alone."""
BY_SENSORS = (3, 6, 7)
CALIBRATED = {
    kind: np.eye(*shape) + 0.1 * np.random.default_rng(kind).uniform(size=shape)
    for kind, shape in {4: (6, 6), 6: (12, 12), 7: (8, 8)}.items()
}
"""What the channels of each type are multiplied by."""
KISTLER_9281E = [
    [1.1604e-14, -8.39091e-10, -1.44293e-6, -2.85927e-10, 2.05575e-5, -0.113525],
    [1.27251e-14, -3.13238e-10, -3.33888e-6, -6.49641e-10, 1.53937e-5, 1.12624e-1],
]
"""P1 to P6 of x and of y, in mm: Kistler, instruction manual of type 9287C, 8.4.3."""


@dataclass
class MadePlate:
    """A plate on which a load acts.

    Attributes:
        kind: 1 to 4, 6 or 7.
        force, cop, twist: (n, 3) N on the person, (n, 3) m on the surface, (n,) N m about the
            laboratory's vertical.
        corners: (4, 3) m in the laboratory, in the order that the format asks for.
        up: the laboratory's vertical.
        origin_sign: -1 as the format asks for (the surface lies above the sensors, z points down),
            or 1 as many write.
        offset: what every channel shows more, in its own unit.
        on_plate: whether the channels hold the person's force on the plate, instead of the plate's
            on the person.
    """

    kind: int
    force: np.ndarray
    cop: np.ndarray
    twist: np.ndarray
    corners: np.ndarray
    up: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    origin_sign: float = -1.0
    on_plate: bool = False
    offset: float = 0.0

    def axes(self) -> np.ndarray:
        """Columns: the plate's x (corner 2 to 1), y (corner 4 to 1) and z (into the floor)."""
        x, y = self.corners[0] - self.corners[1], self.corners[0] - self.corners[3]
        x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
        return np.column_stack([x, y, np.cross(x, y)])

    def channels(self, length: float) -> np.ndarray:
        """(n, 6, 8 or 12) as the file stores them, lengths in multiples of `length` m."""
        axes, centre = self.axes(), self.corners.mean(axis=0)
        sign = -1.0 if self.on_plate else 1.0
        force = sign * self.force @ axes
        sensors = centre - SENSORS[2] * self.up
        about = np.cross(self.cop - sensors, self.force) + self.twist[:, None] * self.up
        moment = sign * about @ axes
        if self.kind == 1:
            place = (self.cop - centre) @ axes
            twist = sign * (self.twist[:, None] * self.up) @ axes
            return np.column_stack([force, place[:, :2] / length, twist[:, 2] / length])
        channels = np.column_stack([force, moment / length])
        if self.kind in BY_SENSORS:
            wrench = np.column_stack([force, moment])
            channels = wrench @ np.linalg.pinv(self.sensor_wrenches()).T
        if self.kind in CALIBRATED:
            channels = channels @ np.linalg.inv(CALIBRATED[self.kind]).T
        return channels + self.offset

    def sensor_wrenches(self) -> np.ndarray:
        """(6, 8 or 12): force and moment about the sensors' middle of each channel's unit force, by
        cross products."""
        a, b, _ = SENSORS
        at = np.array([[a, b, 0], [-a, b, 0], [-a, -b, 0], [a, -b, 0]])
        x, y, z = np.eye(3)
        channels = [((0, 1), x), ((2, 3), x), ((0, 3), y), ((1, 2), y)] + [
            ((k,), z) for k in range(4)
        ]
        if self.kind == 6:
            channels = [((k,), way) for k in range(4) for way in (x, y, z)]
        return np.column_stack(
            [
                np.concatenate([way, np.mean([np.cross(at[k], way) for k in used], axis=0)])
                for used, way in channels
            ]
        )


def rectangle(
    centre: tuple[float, float],
    *,
    turn_deg: float = 0.0,
    size: tuple[float, float] = (0.4, 0.6),
    height: float = 0.0,
) -> np.ndarray:
    """(4, 3) m: corners of a plate in a z-up laboratory, its x axis turned by `turn_deg` from the
    laboratory's."""
    angle = np.radians(turn_deg)
    x, y = np.array([np.cos(angle), np.sin(angle)]), np.array([np.sin(angle), -np.cos(angle)])
    quadrants = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    out = [np.array(centre) + 0.5 * (i * size[0] * x + j * size[1] * y) for i, j in quadrants]
    return np.column_stack([np.array(out), np.full(4, height)])


def write_c3d(
    path: Path,
    markers: dict[str, np.ndarray],
    *,
    rate: float = 100.0,
    unit: str | None = "mm",
    length: float = 1e-3,
    plates: tuple[MadePlate, ...] = (),
    subframes: int = 10,
    screen: tuple[str, str] | None = ("+X", "+Z"),
    first_frame: int = 1,
    moment_unit: str | None = None,
    zero: tuple[int, int] = (1, 0),
) -> Path:
    """Writes markers (label -> (frames, 3) m, NaN in gaps) and plates of subframes * frames
    samples."""
    c3d = ezc3d.c3d()
    places = np.stack(list(markers.values()), axis=1)
    points = np.ones((4, places.shape[1], len(places)))
    points[:3] = (places / length).transpose(2, 1, 0)
    residuals = np.where(np.isnan(points[:1]), -1.0, 0.0)
    points[:3][np.isnan(points[:3])] = 0.0
    c3d["data"]["points"] = points
    c3d["data"]["meta_points"]["residuals"] = residuals
    point = c3d["parameters"]["POINT"]
    point["RATE"]["value"] = [rate]
    point["LABELS"]["value"] = list(markers)
    if unit is None:
        point["UNITS"]["value"] = []
    else:
        point["UNITS"]["value"] = [unit]
    if screen is not None:
        c3d.add_parameter("POINT", "X_SCREEN", [screen[0]])
        c3d.add_parameter("POINT", "Y_SCREEN", [screen[1]])
    c3d["header"]["points"]["first_frame"] = first_frame - 1
    samples = [plate.channels(length) for plate in plates]
    if plates:
        analog = np.concatenate(samples, axis=1).T
        c3d["data"]["analogs"] = analog[None]
        c3d["parameters"]["ANALOG"]["RATE"]["value"] = [rate * subframes]
        c3d["parameters"]["ANALOG"]["LABELS"]["value"] = [f"A{i}" for i in range(len(analog))]
        moment = moment_unit or f"N{unit}"
        c3d["parameters"]["ANALOG"]["UNITS"]["value"] = (
            ["V"] * len(analog)
            if any(p.kind != 2 for p in plates)
            else ["N", "N", "N", *[moment] * 3] * len(plates)
        )
        _write_plates(c3d, plates, samples, length)
        c3d["parameters"]["FORCE_PLATFORM"]["ZERO"]["value"] = list(zero)
    c3d.write(str(path))
    return path


def _write_plates(
    c3d: ezc3d.c3d,
    plates: tuple[MadePlate, ...],
    samples: list[np.ndarray],
    length: float,
) -> None:
    widest = max(sample.shape[1] for sample in samples)
    channel = np.zeros((widest, len(plates)), dtype=int)
    first = 1
    for k, sample in enumerate(samples):
        channel[: sample.shape[1], k] = np.arange(first, first + sample.shape[1])
        first += sample.shape[1]
    origins = [
        np.array([*(SENSORS[:2] if p.kind in BY_SENSORS else (0, 0)), p.origin_sign * SENSORS[2]])
        for p in plates
    ]
    matrices = np.zeros((12, 12, len(plates)))
    for k, plate in enumerate(plates):
        own = CALIBRATED.get(plate.kind, np.eye(6))
        matrices[: own.shape[0], : own.shape[1], k] = own
    for name, value in (
        ("USED", np.array([len(plates)])),
        ("TYPE", np.array([plate.kind for plate in plates])),
        ("CORNERS", np.stack([plate.corners.T / length for plate in plates], axis=2)),
        ("ORIGIN", np.column_stack(origins) / length),
        ("CHANNEL", channel),
        ("CAL_MATRIX", matrices[: max(6, widest), :widest]),
    ):
        c3d["parameters"]["FORCE_PLATFORM"][name]["value"] = value


def with_parameters(path: Path, group: str, **values: Any) -> Path:
    """The file with other or more parameters of a group."""
    c3d = ezc3d.c3d(str(path))
    for name, value in values.items():
        if name in c3d["parameters"].get(group, {}):
            c3d["parameters"][group][name]["value"] = value
        else:
            c3d.add_parameter(group, name, value)
    c3d.write(str(path))
    return path
