"""What standing still leaves: forces, the pelvis, what it took to stay up; and that in numbers. Knows no Drake."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

NUDGE_M, NUDGE_RAD = 2e-4, 2e-4
"""How far from rest a person is let go: raised, and turned back, towards the prosthesis and outward as far as these are
free. At exact rest a model would stay even where it cannot balance; from here (some 0.2 mm at the pelvis, a choice) it
must come back by itself."""


@dataclass(frozen=True, kw_only=True)
class Standing:
    """A person who stood for `time_s[-1]` s, let go at NUDGE_M and NUDGE_RAD from rest.

    Attributes:
        time_s: (n,) ends of the steps. prosthetic_n, intact_n: (n,) vertical force on each foot (N).
        pelvis: (n + 1, 6) place (m; forward, up, right) and attitude (rad; tilt, list, rotation), start included.
        weight_n: mass times 9.81 m/s^2.
        free: the pelvis coordinates that nothing held.
        held_nm: what it took, at the end, to hold the others (N m by coordinate).
        stiffness_nm_per_rad: least stiffness, less the weight's, that keeps a free attitude; None if none is free.
        com_height_m: centre of mass above the ground. leg_lengths_m: prosthetic, intact, unloaded.
        unconverged_steps, refined_steps: of the stepper; the latter were cut into smaller ones.
        notes: sentences on what was held and why.
    """

    time_s: np.ndarray
    prosthetic_n: np.ndarray
    intact_n: np.ndarray
    pelvis: np.ndarray
    weight_n: float
    fulcrum_m: float
    side: str
    name: str
    free: tuple[str, ...]
    held_nm: dict[str, float]
    stiffness_nm_per_rad: float | None
    com_height_m: float
    leg_lengths_m: tuple[float, float]
    unconverged_steps: int
    notes: tuple[str, ...]
    refined_steps: int = 0

    @property
    def vertical_n(self) -> np.ndarray:
        """(n,) vertical force on both feet (N)."""
        return self.prosthetic_n + self.intact_n

    @property
    def weight_error(self) -> float:
        """Mean vertical force over the weight, less 1."""
        return float(self.vertical_n.mean() / self.weight_n - 1.0)

    @property
    def prosthetic_share(self) -> float:
        """Share of the mean vertical force under the prosthetic foot."""
        return float(self.prosthetic_n.mean() / self.vertical_n.mean())

    @property
    def drift(self) -> np.ndarray:
        """(n,) distance (m) of the pelvis from where it stood at the start."""
        return np.linalg.norm(self.pelvis[1:, :3] - self.pelvis[0, :3], axis=1)

    @property
    def drift_m(self) -> float:
        """Largest distance of the pelvis from where it stood at the start."""
        return float(self.drift.max())

    @property
    def turn_rad(self) -> float:
        """Largest change of an angle of the pelvis."""
        return float(np.abs(self.pelvis[1:, 3:] - self.pelvis[0, 3:]).max())


# Standing in numbers: what the ground carries against the weight, and whether the pelvis stays where it is.


LARGEST_WEIGHT_ERROR = 0.01
"""Share of the weight by which the mean vertical force may miss it (McGeehan 2021 reports 2.6 % too little)."""
LARGEST_DRIFT_M = 1e-3
"""How far the pelvis may move (m) and still be said to stand still (a choice)."""
SERIES_RATE_HZ = 50.0
"""Rate of the series in the table: standing has nothing faster to show (a choice)."""
ATTITUDE = ("tilt", "list", "rotation")


def standing_table(standing: Standing) -> dict[str, Any]:
    """The summary that `vsf-drake stand` writes as standing.json. Newtons, millimetres, degrees."""
    every = max(1, round(1.0 / SERIES_RATE_HZ / float(np.diff(standing.time_s, prepend=0.0).mean())))
    rows = slice(every - 1, None, every)
    converged = standing.unconverged_steps == 0
    stands = converged and abs(standing.weight_error) <= LARGEST_WEIGHT_ERROR and standing.drift_m <= LARGEST_DRIFT_M
    last = np.degrees(standing.pelvis[-1, 3:])
    return {
        "subject": standing.name, "prosthetic_side": standing.side, "fulcrum_mm": 1e3 * standing.fulcrum_m,
        "duration_s": float(standing.time_s[-1]), "weight_n": standing.weight_n,
        "mean_vertical_n": float(standing.vertical_n.mean()), "weight_error": standing.weight_error,
        "mean_prosthetic_n": float(standing.prosthetic_n.mean()), "mean_intact_n": float(standing.intact_n.mean()),
        "prosthetic_share": standing.prosthetic_share, "intact_share": 1.0 - standing.prosthetic_share,
        "drift_mm": 1e3 * standing.drift_m, "turn_deg": float(np.degrees(standing.turn_rad)),
        "let_go_off_rest": {"raised_mm": 1e3 * NUDGE_M, "turned_deg": float(np.degrees(NUDGE_RAD))},
        "pelvis_deg": dict(zip(ATTITUDE, last.tolist(), strict=True)),
        "free": list(standing.free), "held_nm": standing.held_nm,
        "stiffness_nm_per_rad": standing.stiffness_nm_per_rad,
        "toppling_nm_per_rad": standing.weight_n * standing.com_height_m,
        "centre_of_mass_height_mm": 1e3 * standing.com_height_m,
        "leg_length_mm": {"prosthetic": 1e3 * standing.leg_lengths_m[0], "intact": 1e3 * standing.leg_lengths_m[1]},
        "unconverged_steps": standing.unconverged_steps, "refined_steps": standing.refined_steps,
        "converged": converged, "stands": stands,
        "notes": list(standing.notes),
        "series": {"time_s": standing.time_s[rows], "prosthetic_n": standing.prosthetic_n[rows],
                   "intact_n": standing.intact_n[rows], "drift_mm": 1e3 * standing.drift[rows]},
    }
