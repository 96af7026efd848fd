"""Able-bodied walking at a speed, scaled to a person: what a stride that adapts is held to.

Joint angles and the ground's force by the phase (Schwartz, Rozumalski & Trost 2008, doi
10.1016/j.jbiomech.2008.03.015, typically developing children and adolescents;
data/published/able_bodied_by_speed.csv says what is derived), linear in the dimensionless speed v /
sqrt(g L), L the length of the leg; forces in body weights. Deviations count in standard deviations
between persons. Stride time and length are not among them.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from vsf_drake.base.errors import require
from vsf_drake.base.files import MOST_JSON_BYTES, read_text, resource
from vsf_drake.model.parameters import GRAVITY

TABLE = "data/published/able_bodied_by_speed.csv"
ANGLES = {
    "pelvis_tilt": ("pelvis_anterior_tilt", -1.0),
    "hip_flexion": ("hip_flexion", 1.0),
    "knee_angle": ("knee_flexion", 1.0),
    "ankle_angle": ("ankle_dorsiflexion", 1.0),
}
"""By coordinate without its side: the published angle, and the sign to it."""
FORCES = ("force_forward", "force_up")
# dimensionless speeds of the groups very slow and fast; beyond those of the table its lines go on
REACH = 0.17, 0.56


@dataclass(frozen=True, eq=False)
class NormalGait:
    """Curves over the phase of one leg's cycle, 0 its foot's strike."""

    series: dict[str, np.ndarray]  # by quantity: a0, a1, b1, a2, b2, ... in degrees or body weights
    sd: dict[str, float]  # standard deviation between persons, root mean square over the cycle

    def at(self, quantity: str, phase: np.ndarray, rank: int = 0) -> np.ndarray:
        """(N,) at phases (N,), in degrees or body weights; of the rank-th derivative by the
        phase."""
        a = self.series[quantity]
        turn = 2.0j * np.pi * np.arange((len(a) + 1) // 2)
        waves = np.append(a[0], a[1::2] - 1j * a[2::2]) * turn**rank
        return np.asarray((np.exp(np.multiply.outer(phase, turn)) @ waves).real)

    def angle_sd(self, coordinates: Sequence[str]) -> np.ndarray:
        """(n,) rad, infinite of coordinates that are no angles of the source."""
        return np.array(
            [
                np.radians(self.sd[ANGLES[name][0]]) if name in ANGLES else np.inf
                for name in map(without_side, coordinates)
            ]
        )


def without_side(coordinate: str) -> str:
    """A coordinate's name without "_r" or "_l"."""
    return coordinate[:-2] if coordinate.endswith(("_r", "_l")) else coordinate


@cache
def _table() -> dict[str, tuple[np.ndarray, ...]]:
    """By quantity: dimensionless speeds (G,), coefficients (G, 1 + 2 harmonics), standard
    deviations (G,)."""
    lines = [
        line
        for line in read_text(resource(TABLE), most=MOST_JSON_BYTES).splitlines()
        if not line.startswith("#")
    ]
    rows: dict[str, list[tuple[float, list[float], float]]] = {}
    for row in csv.DictReader(lines):
        series = [
            float(value)
            for name, value in row.items()
            if value and name[0] in "ab" and name[1:].isdigit()
        ]
        own = rows.setdefault(row["quantity"], [])
        own.append((float(row["speed"]), series, float(row["sd"])))
    return {
        quantity: tuple(map(np.array, zip(*own, strict=True))) for quantity, own in rows.items()
    }


def normal_gait(speed_m_per_s: float, leg_m: float, where: str = "speed_m_per_s") -> NormalGait:
    """InputError at a speed out of REACH; `where` says whose it is."""
    table = _table()
    unit = float(np.sqrt(GRAVITY * leg_m))
    speed, (low, high) = speed_m_per_s / unit, (unit * reach for reach in REACH)
    require(
        low <= speed_m_per_s <= high,
        f"{speed_m_per_s:.2f} m/s is out of what was published of able-bodied walking",
        where,
        f"With a leg of {leg_m:.2f} m it must lie from {low:.2f} to {high:.2f} m/s",
    )

    def between(speeds: np.ndarray, values: np.ndarray) -> np.ndarray:
        at = int(np.clip(np.searchsorted(speeds, speed) - 1, 0, len(speeds) - 2))
        share = (speed - speeds[at]) / (speeds[at + 1] - speeds[at])
        return np.asarray((1.0 - share) * values[at] + share * values[at + 1])

    return NormalGait(
        series={name: between(speeds, series) for name, (speeds, series, _) in table.items()},
        sd={name: float(between(speeds, sd)) for name, (speeds, _, sd) in table.items()},
    )
