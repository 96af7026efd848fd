"""An examined trial in numbers, for import.json and check.json."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from vsf_drake.analysis.recording.check import expected_error, worst
from vsf_drake.analysis.recording.evidence import Examined
from vsf_drake.motion.events import Stance
from vsf_drake.motion.kinematics import PELVIS_TRANSLATIONS
from vsf_drake.motion.trial import Trial
from vsf_drake.plants.anthropometry import scale_body
from vsf_drake.schema import to_plain


def trial_table(item: Examined) -> dict[str, Any]:
    """Everything that was found about one trial; units are in the names, or beside the value."""
    trial = item.trial
    table: dict[str, Any] = {
        "name": trial.name, "synthetic": trial.synthetic, "mark": item.mark,
        "expected_error_bw": expected_error(item.checks),
        "checks": [dataclasses.asdict(check) for check in item.checks], "notes": list(item.notes),
        "window_s": [trial.start_s, trial.end_s], "fulcrum_mm": 1e3 * trial.fulcrum_m,
        "prosthetic_side": trial.subject.prosthetic_side, "feet_from": "markers" if item.markers else "model",
        "stances": {side: [_stance(s) for s in stances] for side, stances in item.stances.items()},
        "measured_stances": {side: [_stance(s) for s in stances] for side, stances in item.measured.items()},
        "inputs_sha256": dict(trial.inputs),
        "contacts": [dataclasses.asdict(contact) for contact in trial.contacts],
        "unmeasured_s": {side: [list(span) for span in spans] for side, spans in trial.unmeasured.items()},
    }
    if item.markers is not None:
        tracked = item.markers.tracked
        table |= {
            "marker_cutoff_hz": item.markers.cutoff_hz,
            "residual_rms_m": dict(tracked.residual_rms_m), "cluster_motion_m": dict(tracked.cluster_motion_m),
            "joint_gap_m": dict(tracked.joint_gap_m), "gaps": [dataclasses.asdict(gap) for gap in tracked.gaps]}
    return table


def overall_mark(items: Sequence[Examined]) -> str:
    """The worst mark of all trials."""
    return worst(item.mark for item in items)


def person_table(item: Examined) -> dict[str, Any]:
    """The subject, the masses of the model's segments, and what the standing trial told where there was one.

    Raises:
        InputError: the person's segments do not fit together.
    """
    trial = item.trial
    table: dict[str, Any] = {"subject": to_plain(trial.subject), "mass_budget_kg": mass_budget(trial)}
    if item.markers is not None:
        calibration = item.markers.calibration
        standing = calibration.angles_rad
        table["calibration"] = {
            "lengths_m": dict(calibration.lengths_m), "method": list(calibration.method),
            "notes": list(calibration.notes),
            "standing_angles_deg": {name: float(np.degrees(value)) for name, value in standing.items()
                                    if name not in PELVIS_TRANSLATIONS},
            "standing_pelvis_m": {name: standing[name] for name in PELVIS_TRANSLATIONS}}
    return table


def mass_budget(trial: Trial) -> dict[str, float]:
    """Masses (kg) of the model's segments by name; they add up to the body mass.

    Raises:
        InputError: the person's segments do not fit together.
    """
    body = scale_body(trial.subject, trial.model.foot, trial.model.socket)
    return {"pelvis, head, arms and trunk": body.pelvis_mass, "two thighs": 2 * body.thigh_mass,
            "intact shank": body.shank_mass, "intact foot": body.foot_mass,
            "residual shank": body.residual_shank_mass, "prosthesis": body.prosthesis_mass}


def _stance(stance: Stance) -> dict[str, Any]:
    return dataclasses.asdict(stance)
