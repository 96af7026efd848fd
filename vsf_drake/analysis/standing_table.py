"""Standing in numbers: what the ground carries against the weight, and whether the pelvis stays where it is."""

from __future__ import annotations

from typing import Any

import numpy as np

from vsf_drake.simulation.standing_result import NUDGE_M, NUDGE_RAD, Standing

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
