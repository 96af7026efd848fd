"""One stance of the prosthesis' energy ledger in numbers: stored, returned, lost, and how well it closes.

Stored is the strain of keel, foam and fulcrum support above what it was at touch-down, at its largest. Of it,
`released` is gone again at toe-off; `returned` is what of that the foot gave back: released without what keel, foam,
support and friction lost on the way. The return ratio is returned over stored. The efficiency is returned over what
was put into the foot up to the largest strain, stored and lost.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.analysis.series import cumulative_integral
from vsf_drake.analysis.validation.energy.steps import (
    FOOT_LOSSES,
    FOOT_STRAINS,
    INPUT,
    REMAINDER,
    TERMS,
    ProsthesisEnergy,
)
from vsf_drake.laws.beam import lumped_stiffness, section_inertia
from vsf_drake.motion.events import Stance
from vsf_drake.parameters import FootParameters

PERCENT = np.linspace(0.0, 100.0, 201)
"""Of stance, where curves are given; powers are means between neighbours."""
LATE = 0.5
"""Share of stance after which the largest vertical load is that of push-off."""
PHASES = {"loading": (0.0, 0.15), "middle": (0.15, 0.75), "push_off": (0.75, 1.0)}
"""Shares of stance by which the remainder is looked at (a choice)."""


@dataclass(frozen=True, eq=False)
class StanceEnergy:
    """Numbers of one stance, and curves on PERCENT: `terms_j` (len(TERMS), 201) from touch-down on, and
    `pylon_power_w`, `shank_power_w` (200,)."""

    row: dict[str, Any]
    curves: dict[str, np.ndarray]


def stance_energy(energy: ProsthesisEnergy, stance: Stance, *, foot: FootParameters, fulcrum_m: float) -> StanceEnergy:
    """The ledger from the last instant before touch-down to the first after toe-off."""
    first = max(int(np.searchsorted(energy.time_s, stance.start_s)) - 1, 0)
    last = min(int(np.searchsorted(energy.time_s, stance.end_s)), len(energy.time_s) - 1)
    cut, time = slice(first, last + 1), energy.time_s[first : last + 1]
    step = float(time[1] - time[0])

    def since(history: np.ndarray) -> np.ndarray:
        own: np.ndarray = history[cut] - history[first]
        return own

    terms = {name: since(energy.terms[name]) for name in TERMS}
    strain = np.sum([terms[name] for name in FOOT_STRAINS], axis=0)
    lost = np.sum([terms[name] for name in FOOT_LOSSES], axis=0)
    top = int(strain.argmax())
    stored, released = float(strain[top]), float(strain[top] - strain[-1])
    returned = released - float(lost[-1] - lost[top])
    absorbed = stored + float(lost[top])
    pylon, shank = (cumulative_integral(power[cut], step) for power in (energy.pylon_power, energy.shank_power))
    remainder = terms[REMAINDER]
    grid = time[0] + 0.01 * PERCENT * (time[-1] - time[0])
    bins = np.diff(grid)
    powers = {name: np.diff(np.interp(grid, time, work)) / bins
              for name, work in (("pylon_power_w", pylon), ("shank_power_w", shank))}
    vertical, half = energy.vertical_n[cut], int(LATE * len(time))
    load, place = energy.keel_load[cut][top]
    row: dict[str, Any] = {
        "fulcrum_mm": round(1e3 * fulcrum_m, 6), "start_s": stance.start_s, "end_s": stance.end_s, "step_s": step,
        "stored_j": stored, "stored_at_percent": 100.0 * top / (len(time) - 1),
        "keel_stored_j": float(terms["keel_strain"].max()),
        **{f"{name.removesuffix('_strain')}_at_most_j": float(terms[name][top]) for name in FOOT_STRAINS},
        "released_j": released, "returned_j": returned, "return_ratio": _ratio(returned, stored),
        "absorbed_j": absorbed, "efficiency": _ratio(returned, absorbed), "lost_j": float(lost[-1]),
        "lost_before_j": float(lost[top]), "lost_after_j": float(lost[-1] - lost[top]),
        **{f"{name}_j": float(terms[name][-1]) for name in TERMS},
        "remainder_max_j": float(np.abs(remainder).max()),
        "remainder_share": _ratio(float(np.abs(remainder).max()), stored),
        "remainder_by_phase_j": {name: _between(remainder, *ends) for name, ends in PHASES.items()},
        "socket_work_j": float(since(energy.socket_work)[-1]), "balance_work_j": float(since(energy.balance_work)[-1]),
        "balance_share": _ratio(float(np.abs(since(energy.balance_work) - terms[INPUT]).max()), stored),
        "distal_work_j": float(pylon[-1]), "distal_absorbed_j": -float(pylon[top]),
        "distal_returned_j": float(pylon[-1] - pylon[top]), "distal_peak_w": float(powers["pylon_power_w"].max()),
        "distal_lowest_w": float(powers["pylon_power_w"].min()), "shank_distal_work_j": float(shank[-1]),
        "shank_distal_peak_w": float(powers["shank_power_w"].max()),
        "distal_share": _ratio(float(np.abs(pylon + strain + lost).max()), stored),
        "late_load_n": float(vertical[half:].max()),
        "late_load_at_percent": 100.0 * (half + int(vertical[half:].argmax())) / (len(time) - 1),
        "keel_load_n": float(load), "keel_load_point_mm": float(1e3 * place) if np.isfinite(place) else None,
        "beam_j": _beam_energy(foot, fulcrum_m, float(load), float(place)),
    }
    row["bent_at_most_j"] = row["keel_at_most_j"] + row["fulcrum_at_most_j"]
    curves = {"terms_j": np.array([np.interp(grid, time, terms[name]) for name in TERMS]), **powers}
    return StanceEnergy(row=row, curves=curves)


def _ratio(part: float, whole: float) -> float | None:
    return part / whole if whole > 0.0 else None


def _between(history: np.ndarray, start: float, end: float) -> float:
    last = len(history) - 1
    return float(history[round(end * last)] - history[round(start * last)])


def _beam_energy(foot: FootParameters, fulcrum_m: float, load_n: float, place_m: float) -> float | None:
    """F²/2k of keel and support in closed form under one load across the keel; None if it is not ahead of the fulcrum.

    A second method: small deflections, one load in place of the spheres', no time.
    """
    keel = foot.keel
    if not place_m > fulcrum_m:
        return None
    stiffness = lumped_stiffness(
        bending_stiffness=keel.flexural_modulus_pa * section_inertia(keel.width_m, keel.thickness_m),
        element_lengths=keel.element_lengths_m, support=fulcrum_m, load_point=place_m,
        fulcrum_stiffness=foot.fulcrum.stiffness_n_per_m)
    return 0.5 * load_n**2 / stiffness
