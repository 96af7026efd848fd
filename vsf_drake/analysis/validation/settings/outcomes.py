"""Outcome measures of one stance, the same for a simulated walk and for a force plate.

Of the force, low-passed at 40 Hz, over the foot's own stance (20 N), in body weights (BW):

    resultant_first, resultant_second   largest resultant in the first and in the second half of stance
    vertical_first, vertical_second     largest vertical force in these halves
    vertical_trough                     smallest vertical force between these two
    propulsion                          largest fore-aft force (forward positive) in the second half
    propulsion_impulse                  integral of the fore-aft force over where it is positive (BW s)
    resultant_rms                       root mean square of the resultant over stance

Of the centre of pressure, low-passed at 6 Hz, along the walking direction, in lengths of the prosthetic foot (FL): its
excursion (foremost less rearmost) and where it is at half of stance, ahead of its rearmost place in that stance. Both
are told by the force record alone: where the foot stands in the laboratory does not enter.

Of the keel's strain energy (J), which no plate measures: stored, its maximum in stance less its value at touch-down;
returned, that maximum less its value at lift-off and less what the keel's damping takes in between.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vsf_drake.analysis.comparison import (
    COP_CUTOFF_HZ,
    FORCE_CUTOFF_HZ,
    PERCENT,
    THRESHOLD_N,
    filtered_while_loaded,
    percent_instants,
    resample,
    walk_axes,
)
from vsf_drake.analysis.series import cumulative_integral, uniform_grid
from vsf_drake.motion.events import Stance, find_stances
from vsf_drake.motion.filters import low_pass

OUTCOMES: dict[str, tuple[str, str]] = {
    "resultant_first_bw": ("first peak of the resultant", "BW"),
    "resultant_second_bw": ("second peak of the resultant", "BW"),
    "vertical_first_bw": ("first peak of the vertical force", "BW"),
    "vertical_trough_bw": ("trough of the vertical force", "BW"),
    "vertical_second_bw": ("second peak of the vertical force", "BW"),
    "propulsion_bw": ("peak of the propulsive force", "BW"),
    "propulsion_impulse_bws": ("propulsive impulse", "BW s"),
    "resultant_rms_bw": ("RMS of the resultant over stance", "BW"),
    "cop_excursion_fl": ("CoP excursion", "FL"),
    "cop_mid_stance_fl": ("CoP at mid-stance", "FL"),
    "energy_stored_j": ("keel energy stored", "J"),
    "energy_returned_j": ("keel energy returned", "J"),
}
"""Name: (what it is, unit)."""
NAMES = tuple(OUTCOMES)
MEASURED = tuple(name for name in NAMES if not name.startswith("energy"))
"""Those that a force plate tells."""


@dataclass(frozen=True, eq=False)
class StanceRecord:
    """One stance in numbers.

    Attributes:
        values: (12,) outcomes in the order of NAMES; NaN for what the record does not tell.
        resultant: (101,) BW at 0-100 % of the own stance. cop: (101,) FL ahead of its rearmost place; NaN unloaded.
        time_s, locked: (n,) evenly spaced instants and the resultant (BW) there, not shifted in time.
    """

    values: np.ndarray
    resultant: np.ndarray
    cop: np.ndarray
    time_s: np.ndarray
    locked: np.ndarray


def own_stance(time_s: np.ndarray, vertical_n: np.ndarray, near: Stance) -> Stance | None:
    """The complete stance that overlaps `near` most, or None."""
    def overlap(stance: Stance) -> float:
        return min(stance.end_s, near.end_s) - max(stance.start_s, near.start_s)

    found = [s for s in find_stances(time_s, vertical_n, threshold_n=THRESHOLD_N) if s.complete and overlap(s) > 0.0]
    return max(found, key=overlap, default=None)


def stance_record(
    time_s: np.ndarray, grf_W: np.ndarray, cop_W: np.ndarray | None, *, near: Stance, heading: np.ndarray,
    weight_n: float, foot_length_m: float, energy: Mapping[str, np.ndarray] | None = None
) -> StanceRecord | None:
    """Outcomes of the stance that overlaps `near` most; None if there is none as a whole.

    Args:
        time_s: (n,). grf_W: (n, 3) N on the foot. cop_W: (n, 3) m, NaN unloaded; None where nobody measured it.
        heading: (2,) unit vector of progression in W.
        energy: (n,) J by name: `keel_strain` and `keel_loss` of the ledger.
    """
    axes = walk_axes(heading)
    stance = own_stance(time_s, grf_W[:, 2], near)
    if stance is None:
        return None
    grid = uniform_grid(time_s)
    step = float(grid[1] - grid[0])
    cutoff = min(FORCE_CUTOFF_HZ, 0.45 / step)
    force = low_pass(resample(grid, time_s, grf_W @ axes.T), rate_hz=1.0 / step, cutoff_hz=cutoff) / weight_n
    resultant = np.linalg.norm(force, axis=1)
    inside = (grid >= stance.start_s) & (grid <= stance.end_s)
    first = inside & (grid <= stance.start_s + 0.5 * stance.duration_s)
    second = inside & ~first
    along, up = force[:, 0], force[:, 2]
    peaks = [int(np.argmax(np.where(half, up, -np.inf))) for half in (first, second)]
    values = dict.fromkeys(NAMES, np.nan)
    values |= {
        "resultant_first_bw": resultant[first].max(), "resultant_second_bw": resultant[second].max(),
        "vertical_first_bw": up[peaks[0]], "vertical_second_bw": up[peaks[1]],
        "vertical_trough_bw": up[peaks[0]:peaks[1] + 1].min(), "propulsion_bw": along[second].max(),
        "propulsion_impulse_bws": cumulative_integral(np.maximum(along[inside], 0.0), step)[-1],
        "resultant_rms_bw": np.sqrt(np.mean(resultant[inside] ** 2))}
    instants = percent_instants(stance)
    cop = np.full(len(PERCENT), np.nan)
    if cop_W is not None:
        path = filtered_while_loaded(
            (cop_W @ axes.T)[:, :1], time_s, grf_W[:, 2], cop_W, instants, threshold_n=THRESHOLD_N,
            force_cutoff_hz=FORCE_CUTOFF_HZ, cutoff_hz=min(COP_CUTOFF_HZ, 0.45 / step))[:, 0] / foot_length_m
        if np.isfinite(path).any():
            cop = path - np.nanmin(path)
            values |= {"cop_excursion_fl": np.nanmax(cop), "cop_mid_stance_fl": cop[len(PERCENT) // 2]}
    if energy is not None:
        values |= _energy(time_s, energy["keel_strain"], energy["keel_loss"], stance)
    return StanceRecord(values=np.array([values[name] for name in NAMES]), cop=cop,
                        resultant=np.interp(instants, grid, resultant), time_s=grid, locked=resultant)


def _energy(time_s: np.ndarray, strain: np.ndarray, loss: np.ndarray, stance: Stance) -> dict[str, float]:
    rows = np.flatnonzero((time_s >= stance.start_s) & (time_s <= stance.end_s))
    top = rows[np.argmax(strain[rows])]
    start, end = np.interp([stance.start_s, stance.end_s], time_s, strain)
    lost = np.interp(stance.end_s, time_s, loss) - loss[top]
    return {"energy_stored_j": float(strain[top] - start), "energy_returned_j": float(strain[top] - end - lost)}
