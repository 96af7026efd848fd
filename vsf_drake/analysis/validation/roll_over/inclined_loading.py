"""The foot pressed at an angle, as structural tests press feet: heel at -15 degrees, forefoot at +20 degrees.

The angles are those of the force peaks of the ISO 22675 profile (-15.0 and +19.8 degrees), rounded; below zero loads
the heel. The platen is level and the foot pitched, toes up by minus the angle; the mount moves along the platen's
normal, and force and displacement are taken along it. On a platen without friction, as here, a test that moves the
pylon along its own axis gives the same energy, its displacement divided and its force multiplied by the angle's cosine.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vsf_drake.analysis.bench_metrics import stiffness
from vsf_drake.analysis.validation.study import Progress
from vsf_drake.bench_file import STIFFNESS_ABOVE_N
from vsf_drake.errors import SimulationError
from vsf_drake.parameters import FootParameters
from vsf_drake.simulation.bench import PUBLISHED_SPEED_M_PER_S
from vsf_drake.simulation.roll_over import RollOver, RollOverRun
from vsf_drake.simulation.roll_over_paths import in_mount_frame

ANGLES_DEG = (-15.0, 20.0)
LARGEST_LOAD_N = 600.0
CURVE_POINTS = 201
"""Points of a saved curve, loading and unloading."""
BORNE_N = 1.0
"""Load (N) from which a sphere is said to bear."""


def inclined_loading(
    foot: FootParameters, fulcrums_m: tuple[float, ...], *, steps_per_mm: float, friction: bool = False,
    progress: Progress | None = None
) -> tuple[list[dict[str, Any]], dict[str, np.ndarray], list[str]]:
    """Presses the foot to 600 N and lets go, at both angles and every fulcrum position (m), at 50 mm/min.

    Args:
        friction: the foot's own friction with the platen. It hardly acts: the law's friction grows with the speed of
            slip up to 0.1 m/s, and here a foot slips by less than 1 mm/s.

    Returns:
        Rows of the table, curves by name (`inclined_A_F_...` with angle and position in whole degrees and mm), and
        sentences on what failed.
    """
    machine = RollOver(foot, friction=friction)
    rows, curves, missing = [], {}, []
    cases = [(angle, fulcrum) for angle in ANGLES_DEG for fulcrum in fulcrums_m]
    for i, (angle, fulcrum) in enumerate(cases):
        if progress:
            progress("pressing the inclined foot", i / len(cases))
        try:
            run = machine.press(fulcrum_m=fulcrum, pitch_rad=-np.radians(angle), max_load_n=LARGEST_LOAD_N,
                                speed_m_per_s=PUBLISHED_SPEED_M_PER_S, steps_per_mm=steps_per_mm)
        except SimulationError as error:
            missing.append(f"Inclined loading at {angle:+g} degrees, fulcrum {1e3 * fulcrum:g} mm: {error}.")
            continue
        row, displacement, load = _row(machine, run, angle, fulcrum)
        rows.append(row)
        name = inclined_name(angle, 1e3 * fulcrum)
        at = np.unique(np.round(np.linspace(0, len(load) - 1, CURVE_POINTS)).astype(int))
        peak = int(np.argmax(load))
        curves[f"{name}_displacement_m"] = displacement[np.union1d(at, [peak])]
        curves[f"{name}_load_n"] = load[np.union1d(at, [peak])]
    return rows, curves, missing


def inclined_name(angle_deg: float, fulcrum_mm: float) -> str:
    """Start of the names of a case's curves."""
    return f"inclined_{'minus' if angle_deg < 0 else 'plus'}{abs(angle_deg):.0f}_{fulcrum_mm:.0f}"


def _row(
    machine: RollOver, run: RollOverRun, angle: float, fulcrum: float
) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
    top = float(machine.touch_height(-np.radians(angle))[0])
    displacement = np.append(0.0, top - run.mount[:, 1])
    load = np.append(0.0, run.grf_W[:, 2])
    peak = int(np.argmax(load))
    stored = float(np.trapezoid(load[: peak + 1], displacement[: peak + 1]))
    returned = -float(np.trapezoid(load[peak:], displacement[peak:]))
    cop = in_mount_frame(run.cop_W, run.mount)
    sites = machine.machine.foot.sites
    bearing = run.sphere_normal_n[peak - 1] > BORNE_N
    return {
        "angle_deg": angle, "fulcrum_mm": 1e3 * fulcrum, "load_n": load[peak],
        "displacement_mm": 1e3 * float(np.interp(LARGEST_LOAD_N, load[: peak + 1], displacement[: peak + 1])),
        "stiffness_n_per_mm": 1e-3 * stiffness(displacement[: peak + 1], load[: peak + 1]),
        "stiffness_above_n": STIFFNESS_ABOVE_N,
        "energy_stored_j": stored, "energy_returned_j": returned, "return_ratio": returned / stored,
        "cop_forward_mm": 1e3 * float(cop[peak - 1, 0]),
        "zones_loaded": [name for i, name in enumerate(sites.zone_names) if bearing[sites.zone == i].any()],
        "unconverged_steps": run.unconverged_steps,
    }, displacement, load
