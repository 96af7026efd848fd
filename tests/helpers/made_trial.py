"""A small constructed walk on disk, of which a test can spoil one thing."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import yaml

MASS = 80.0
WEIGHT = MASS * 9.80665
STANCES = {"r": [(0.3, 1.0)], "l": [(0.8, 1.5)]}


def angles(time: np.ndarray) -> dict[str, np.ndarray]:
    """Columns of a walk: angles in degrees, pelvis translations in m."""
    swing = 2 * np.pi * time / 1.2
    columns = {
        "pelvis_tilt": -5 + np.sin(2 * swing),
        "pelvis_list": 4 * np.sin(swing),
        "pelvis_rotation": 5 * np.cos(swing),
        "pelvis_tx": 1.1 * time,
        "pelvis_ty": 0.95 + 0.02 * np.cos(2 * swing),
        "pelvis_tz": 0.1 + 0.02 * np.sin(swing),
    }
    for side, phase in (("r", 0.0), ("l", np.pi)):
        columns[f"hip_flexion_{side}"] = 12 + 20 * np.cos(swing + phase)
        columns[f"knee_angle_{side}"] = 32 - 28 * np.cos(2 * np.pi * time / 1.2 + phase + 1.0)
        columns[f"ankle_angle_{side}"] = 3 + 9 * np.sin(swing + phase)
    return columns


def force_columns(time: np.ndarray, side: str) -> dict[str, np.ndarray]:
    """One foot's columns in OpenSim's frame: a half sine of vertical force for each stance."""
    names = [f"ground_force_{side}_{k}" for k in ("vx", "vy", "vz", "px", "py", "pz")]
    columns = {name: np.zeros_like(time) for name in names}
    columns |= {f"ground_torque_{side}_{axis}": np.zeros_like(time) for axis in "xyz"}
    for start, end in STANCES[side]:
        on = (time >= start) & (time <= end)
        phase = np.pi * (time[on] - start) / (end - start)
        columns[names[1]][on] = 1.1 * WEIGHT * np.sin(phase)
        columns[names[0]][on] = -0.15 * WEIGHT * np.sin(2 * phase)
        columns[names[2]][on] = 0.03 * WEIGHT * np.sin(phase)
        columns[names[3]][on] = 0.5 + 0.2 * phase / np.pi
        columns[names[5]][on] = 0.1
        columns[f"ground_torque_{side}_y"][on] = 2.0
    return columns


def write_table(path: Path, time: np.ndarray, columns: dict[str, np.ndarray], header: str) -> None:
    """A tab-separated OpenSim table; `header` may use {rows} and {columns}."""
    rows = zip(time, *columns.values(), strict=True)
    lines = [header.format(rows=len(time), columns=len(columns) + 1), "\t".join(["time", *columns])]
    lines += ["\t".join(f"{cell:.10g}" for cell in row) for row in rows]
    path.write_text("\n".join(lines) + "\n")


HEADER = "walk\nversion=1\nnRows={rows}\nnColumns={columns}\ninDegrees=yes\nendheader"


@dataclass
class TrialFiles:
    """Everything that makes a trial; change a part, then `write()` and use the returned manifest
    path."""

    folder: Path
    time: np.ndarray = field(default_factory=lambda: np.arange(0.0, 1.8001, 0.01))
    force_time: np.ndarray = field(default_factory=lambda: np.arange(0.0, 1.8001, 0.001))
    header: str = HEADER
    columns: dict[str, np.ndarray] = field(default_factory=dict)
    forces: dict[str, np.ndarray] = field(default_factory=dict)
    subject: dict = field(
        default_factory=lambda: {
            "mass_kg": MASS,
            "stature_m": 1.8,
            "sex": "male",
            "prosthetic_side": "right",
        }
    )
    manifest: dict = field(
        default_factory=lambda: {
            "subject": "subject.yaml",
            "kinematics": "walk_ik.mot",
            "forces": "walk_grf.mot",
            "prosthesis": {"fulcrum_mm": 66},
        }
    )

    def __post_init__(self) -> None:
        self.columns = angles(self.time)
        self.forces = force_columns(self.force_time, "r") | force_columns(self.force_time, "l")

    def write(self) -> Path:
        write_table(self.folder / "walk_ik.mot", self.time, self.columns, self.header)
        write_table(
            self.folder / "walk_grf.mot", self.force_time, self.forces, HEADER.replace("yes", "no")
        )
        (self.folder / "subject.yaml").write_text(yaml.safe_dump(self.subject))
        path = self.folder / "trial.yaml"
        path.write_text(yaml.safe_dump(self.manifest))
        return path
