"""What a person and a device would notice of a setting: numbers of one walk, averaged over its stances.

Peaks are those of the forces low-passed as for the costs, over stance with its margins. The loading rate is the mean
slope of the vertical force from 20 to 80 % of its first peak, the largest of the first half of stance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.tuning.level1.frame import StanceFrame
from vsf_drake.analysis.tuning.level1.trial_tuning import TrialTuning, WalkOutcome
from vsf_drake.analysis.validation.energy.rows import stance_energy
from vsf_drake.analysis.validation.energy.steps import prosthesis_energy
from vsf_drake.motion.events import find_stances

RISE = (0.2, 0.8)


@dataclass(frozen=True)
class OutcomeKind:
    """One number of a walk: its name, what it is, its unit."""

    name: str
    label: str
    unit: str


KINDS = (
    OutcomeKind("stored_energy", "energy stored in keel, foam and support", "J"),
    OutcomeKind("returned_energy", "energy returned by toe-off", "J"),
    OutcomeKind("push_off_work", "push-off work on the shank", "J/kg"),
    OutcomeKind("joint_work_energy", "joint-work estimate of metabolic energy", "J/kg"),
    OutcomeKind("hip_moment", "peak prosthetic hip flexion moment, either sign", "N m/kg"),
    OutcomeKind("knee_moment", "peak prosthetic knee flexion moment, either sign", "N m/kg"),
    OutcomeKind("first_peak", "first peak of the vertical force", "BW"),
    OutcomeKind("second_peak", "second peak of the vertical force", "BW"),
    OutcomeKind("loading_rate", "loading rate of the vertical force", "BW/s"),
    OutcomeKind("socket_force", "peak force on the residual limb", "BW"),
    OutcomeKind("socket_moment", "peak moment on the residual limb", "N m/kg"),
    OutcomeKind("force_change", "change of the ground reaction force from the recorded setting, RMS", "BW"),
    OutcomeKind("pelvis_residual", "force at the pelvis that no leg makes, RMS over stance", "BW"))
ENERGIES = ("stored_energy", "returned_energy")
NAMES = tuple(kind.name for kind in KINDS)


def outcomes(part: TrialTuning, found: WalkOutcome, *, energies: bool = True) -> dict[str, float]:
    """KINDS of one walk; NaN for stored and returned energy where the foot has no whole stance.

    Args:
        energies: whether to work these two out, which takes a third of a walk's time; they are NaN else.
    """
    frame, loads = found.frame, found.loads
    inside = frame.inside > 0.0
    vertical = loads.grf.value[:, 2] / frame.weight_n
    joints = dict(zip(part.options.joints, np.abs(loads.joints.value[inside] / frame.mass_kg).T, strict=True))
    socket = loads.socket.value[inside]
    residual = np.sum(loads.pelvis**2, axis=1) @ frame.inside / frame.inside.sum()
    numbers = {
        **(_energies(part, found) if energies else dict.fromkeys(ENERGIES, float("nan"))),
        "push_off_work": -sum(term.value for term in found.terms["push_off"]),
        "joint_work_energy": sum(term.value for term in found.terms["metabolic"]),
        "hip_moment": _largest(joints.get("hip_flexion")), "knee_moment": _largest(joints.get("knee_angle")),
        **_vertical(frame, vertical),
        "socket_force": float(np.linalg.norm(socket[:, :3], axis=1).max() / frame.weight_n),
        "socket_moment": float(np.linalg.norm(socket[:, 3:], axis=1).max() / frame.mass_kg),
        "force_change": float(np.sqrt(sum(term.value for term in found.terms["consistency"]))),
        "pelvis_residual": float(np.sqrt(residual) / frame.weight_n)}
    return {name: numbers[name] for name in NAMES}


def _largest(history: np.ndarray | None) -> float:
    return float("nan") if history is None else float(history.max())


def _energies(part: TrialTuning, found: WalkOutcome) -> dict[str, float]:
    energy = prosthesis_energy(part.walker, found.walk)
    stances = [s for s in find_stances(energy.time_s, energy.vertical_n) if s.complete]
    rows = [stance_energy(energy, stance, foot=part.trial.model.foot, fulcrum_m=float(found.walk.fulcrum_m[0])).row
            for stance in stances]
    return {name: float(np.mean([row[name.replace("energy", "j")] for row in rows])) if rows else float("nan")
            for name in ENERGIES}


def _vertical(frame: StanceFrame, vertical: np.ndarray) -> dict[str, float]:
    time, found = frame.time_s, []
    margin = 0.5 * (frame.inside.sum() - frame.duration_s) / frame.count
    for stance in frame.stances:
        middle = 0.5 * (stance.start_s + stance.end_s)
        early = (time >= stance.start_s - margin) & (time <= middle)
        late = (time >= middle) & (time <= stance.end_s + margin)
        first, second = float(vertical[early].max()), float(vertical[late].max())
        rising, t = vertical[early][: int(vertical[early].argmax()) + 1], time[early]
        at = [float(np.interp(share * first, np.maximum.accumulate(rising), t[: len(rising)])) for share in RISE]
        found.append((first, second, (RISE[1] - RISE[0]) * first / max(at[1] - at[0], frame.step_s)))
    means = np.mean(found, axis=0)
    return dict(zip(("first_peak", "second_peak", "loading_rate"), map(float, means), strict=True))
