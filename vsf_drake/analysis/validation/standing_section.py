"""Standing: the mass that the ground carries against the mass that is known, at every fulcrum position walked on."""

from __future__ import annotations

from typing import Any

import numpy as np

from vsf_drake.analysis.validation.study import Progress, Section, Study
from vsf_drake.errors import InputError, SimulationError
from vsf_drake.files import plain
from vsf_drake.parameters import GRAVITY
from vsf_drake.simulation.results import standing_table
from vsf_drake.simulation.standing import simulate_standing

DURATION_S, QUICK_DURATION_S = 10.0, 2.0
PAPER_MASS_ERROR = -0.026
"""McGeehan 2021 (doi 10.1115/1.4050456): mass predicted from standing against mass known."""
_TAKEN = (
    "weight_n", "mean_vertical_n", "weight_error", "mean_prosthetic_n", "mean_intact_n", "prosthetic_share", "drift_mm",
    "turn_deg", "pelvis_deg", "free", "held_nm", "leg_length_mm", "centre_of_mass_height_mm", "unconverged_steps",
    "refined_steps", "converged", "stands", "notes")


def standing_section(study: Study, *, progress: Progress | None = None) -> Section:
    """Stands the study's subject on its foot, at each fulcrum position.

    Joints are at their anatomical zero and the foot is mounted as the model file says: what a fit found of offsets and
    joint angles belongs to recordings of walking.

    Table:
        rows: a position each, softest first: `fulcrum_mm`, `mass_known_kg`, `mass_predicted_kg` (mean force of both
            feet over 9.81 m/s²), `mass_error` (share of the known one), the keys _TAKEN of `standing_table`, and
            `failure` (why there is nothing else; else None).
        worst_mass_error, paper_mass_error, duration_s, all_stand.
    Arrays of row I, 50 Hz: `standing_I_time_s`, `standing_I_prosthetic_n`, `standing_I_intact_n`,
        `standing_I_drift_mm`.
    """
    duration = QUICK_DURATION_S if study.options.quick else DURATION_S
    rows: list[dict[str, Any]] = []
    arrays: dict[str, np.ndarray] = {}
    missing = []
    conditions = study.conditions()
    for i, (fulcrum, (walk, *_)) in enumerate(conditions.items()):
        def show(fraction: float, i: int = i, fulcrum: float = fulcrum) -> None:
            if progress:
                progress(f"standing, fulcrum at {fulcrum:g} mm", (i + fraction) / len(conditions))

        subject = walk.trial.subject
        rows.append({"fulcrum_mm": fulcrum, "mass_known_kg": subject.mass_kg, "mass_predicted_kg": None,
                     "mass_error": None, "failure": None, **dict.fromkeys(_TAKEN)})
        try:
            stood = standing_table(simulate_standing(
                subject, study.model, fulcrum_m=walk.trial.fulcrum_m, duration_s=duration, progress=show))
        except (InputError, SimulationError) as error:
            rows[-1]["failure"] = str(error)
            missing.append(f"Standing with the fulcrum at {fulcrum:g} mm failed: {error}")
            continue
        arrays |= {f"standing_{i}_{name}": np.asarray(stood["series"][name])
                   for name in ("time_s", "prosthetic_n", "intact_n", "drift_mm")}
        predicted = stood["mean_vertical_n"] / GRAVITY
        rows[-1] |= {key: stood[key] for key in _TAKEN} | {
            "mass_predicted_kg": predicted, "mass_error": predicted / subject.mass_kg - 1.0}
    if study.options.quick:
        missing.append(f"The short form stands for {QUICK_DURATION_S:g} s, not {DURATION_S:g} s.")
    errors = [row["mass_error"] for row in rows if row["mass_error"] is not None]
    table = {"rows": rows, "worst_mass_error": max(errors, key=abs, default=None), "paper_mass_error": PAPER_MASS_ERROR,
             "duration_s": duration, "all_stand": all(row["stands"] for row in rows) if errors else None}
    return Section(table=plain(table), arrays=arrays, missing=tuple(missing))
