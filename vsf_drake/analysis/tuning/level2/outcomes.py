"""What a person and a device would notice of a stride that was solved for."""

from __future__ import annotations

import numpy as np

from vsf_drake.analysis.collocation.solution import TrajectorySolution
from vsf_drake.analysis.tuning.level2.costs import StrideCosts

KINDS = {
    "push_off_work": ("push-off work on the residual limb", "J/kg"),
    "stored_energy": ("largest energy in keel, support and socket", "J"),
    "prosthetic_first_peak": ("prosthetic first peak of the vertical force", "BW"),
    "prosthetic_second_peak": ("prosthetic second peak of the vertical force", "BW"),
    "intact_first_peak": ("intact first peak of the vertical force", "BW"),
    "intact_knee_moment": ("peak intact knee moment, either sign", "N m/kg"),
    "prosthetic_hip_moment": ("peak prosthetic hip moment, either sign", "N m/kg"),
    "prosthetic_knee_moment": ("peak prosthetic knee moment, either sign", "N m/kg"),
    "socket_moment": ("peak moment on the residual limb", "N m/kg"),
    "metabolic": ("joint-work estimate of metabolic energy, a stride", "J/kg"),
    "joint_load": ("squared joint and socket load", "1"),
    "motion_change": ("root mean square change of the joint angles", "deg"),
    "force_change": ("root mean square change of the ground reaction force, worse foot", "BW")}
"""Labels and units."""


def outcomes(solution: TrajectorySolution, costs: StrideCosts) -> dict[str, float]:
    """KINDS of a solved stride; the changes are from the recording."""
    y, reference, index = solution.unsealed().y(), costs.reference, costs.function.index
    weights, mass, weight = solution.problem.grid.weights, costs.mass_kg, costs.weight_n

    def column(name: str) -> np.ndarray:
        return np.asarray(y[:, index(name)[0]])

    def peak(foot: str, late: bool) -> float:
        rows = np.flatnonzero(reference.stance[foot])
        # A stance that goes over the end of the period begins late in it.
        gap = np.flatnonzero(np.diff(rows) > 1)
        rows = rows if not len(gap) else np.concatenate([rows[gap[0] + 1:], rows[:gap[0] + 1]])
        half = rows[len(rows) // 2:] if late else rows[: len(rows) // 2]
        return float(column(f"{foot}_fz")[half].max() / weight) if len(half) else float("nan")

    _, _, _, hip_p, knee_p, _, knee_i, _ = costs.function.layout.coordinates
    change = np.degrees(y[:, costs.function.starting_with("q_")][:, 3:] - reference.q[:, 3:])
    force = [np.sum((y[:, index(f"{foot}_fx", f"{foot}_fz")] - known) ** 2, axis=1)[reference.known[foot]].mean()
             for foot, known in reference.force.items() if reference.known[foot].any()]
    return {
        "push_off_work": -costs.of("push_off").value(y, weights), "stored_energy": float(column("stored_energy").max()),
        "prosthetic_first_peak": peak("prosthetic", False), "prosthetic_second_peak": peak("prosthetic", True),
        "intact_first_peak": peak("intact", False),
        "intact_knee_moment": _largest(column(f"torque_{knee_i}"), mass),
        "prosthetic_hip_moment": _largest(column(f"torque_{hip_p}"), mass),
        "prosthetic_knee_moment": _largest(column(f"torque_{knee_p}"), mass),
        "socket_moment": _largest(column("force_socket_flexion"), mass),
        "metabolic": costs.of("metabolic").value(y, weights), "joint_load": costs.of("joint_load").value(y, weights),
        "motion_change": float(np.sqrt(np.mean(change**2))),
        "force_change": float(np.sqrt(max(force)) / weight) if force else float("nan")}


def _largest(moment: np.ndarray, mass_kg: float) -> float:
    return float(np.abs(moment).max() / mass_kg)
