"""The foot rolled over by the loading profile of ISO 22675, at each fulcrum position.

The pylon stays on a fixed line, the platform tilts; force along that line and tilt follow the profile, and the mount's
height is what it takes (`simulation.roll_over_paths`, `roll_over_control`). Idealised are: the platform has no
friction, so that the guide of the line bears what is sideways and the place of the tilt axis has no part in the forces;
the pylon cannot turn about a joint at its top; the foot's inertia in the turning frame is left out.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vsf_drake.analysis.validation.roll_over.iso_22675 import DURATION_S, force_share, tilt_rad
from vsf_drake.analysis.validation.roll_over.shape import mean_moment_arm, shape_numbers
from vsf_drake.analysis.validation.study import Progress
from vsf_drake.errors import SimulationError
from vsf_drake.parameters import FootParameters
from vsf_drake.simulation.roll_over import RollOver, RollOverRun
from vsf_drake.simulation.roll_over_control import Following
from vsf_drake.simulation.roll_over_paths import in_mount_frame

SECOND_PEAK_S = 0.4475
"""The shape ends at the second peak of the force: later the load only leaves the toe."""
CURVE_POINTS = 301


def iso_roll_over(
    foot: FootParameters, fulcrums_m: tuple[float, ...], *, force_n: float, steps: int, friction: bool = False,
    progress: Progress | None = None
) -> tuple[list[dict[str, Any]], dict[str, np.ndarray], list[str]]:
    """Rolls the foot at every fulcrum position (m).

    Args:
        force_n: F_1cmax, the profile's first peak (N). steps: of the 600 ms.
        friction: the foot's own friction with the platform, whose tilt axis then matters: it is put into the
            platform's surface, under the pylon (a choice). The foot slides under a line that is held.

    Returns:
        Rows of the table, curves by name, and sentences on what failed and, without friction, on what does not follow
        the profile.
    """
    machine = RollOver(foot, friction=friction)
    time = np.linspace(0.0, DURATION_S, steps + 1)
    tilt, force = tilt_rad(time), force_n * force_share(time)
    kept = np.unique(np.round(np.linspace(1, steps, CURVE_POINTS)).astype(int)) - 1
    curves = {"iso_time_s": time[1:][kept], "iso_tilt_deg": np.degrees(tilt[1:][kept]), "iso_wanted_n": force[1:][kept]}
    rows, missing = [], []
    for i, fulcrum in enumerate(fulcrums_m):
        if progress:
            progress("rolling the foot over", i / len(fulcrums_m))
        place = f"The ISO 22675 profile, fulcrum {1e3 * fulcrum:g} mm{', with friction' if friction else ''}"
        try:
            run, following = machine.roll(fulcrum_m=fulcrum, time_s=time, tilt_rad=tilt, force_n=force)
        except SimulationError as error:
            missing.append(f"{place}: {error}.")
            continue
        row, found = _row(machine, run, following, fulcrum)
        rows.append(row)
        if not row["follows"] and not friction:
            missing.append(f"{place}: the force misses the profile by up to {row['residual_n']:.0f} N; its numbers are "
                           "not those of the profile.")
        curves |= {f"iso_{1e3 * fulcrum:.0f}_{name}": values[kept] for name, values in found.items()}
    return rows, curves, missing


def _row(
    machine: RollOver, run: RollOverRun, following: Following, fulcrum: float
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    foot, e = machine.parameters, run.energy
    cop = in_mount_frame(run.cop_W, run.mount)
    arm = run.cop_W - np.column_stack([run.mount[:, 0], np.zeros(len(cop)), run.mount[:, 1]])
    moment = arm[:, 0] * run.grf_W[:, 2] - arm[:, 2] * run.grf_W[:, 0]
    strain = e["keel_strain"] + e["fulcrum_strain"] + e["contact_strain"]
    lost = e["keel_loss"] + e["fulcrum_loss"] + e["contact_loss"] + e["friction_loss"]
    steps = np.diff(strain + lost, prepend=0.0)
    taken, given = float(steps[steps > 0.0].sum()), -float(steps[steps < 0.0].sum())
    half = run.time_s <= 0.5 * DURATION_S
    rolled = run.time_s <= SECOND_PEAK_S
    shape = shape_numbers(np.where(rolled[:, None], cop, np.nan), heel_m=foot.heel_x_m - foot.pylon_x_m,
                          foot_length_m=foot.length_m)
    loaded = np.isfinite(cop[:, 0])
    row = {
        "fulcrum_mm": 1e3 * fulcrum, "follows": following.follows, "residual_n": following.residual_n,
        "residual_rms_n": float(np.sqrt(np.mean((following.force_n - following.wanted_n) ** 2))),
        "deflection_heel_mm": 1e3 * float(following.deflection_m[half].max()),
        "deflection_forefoot_mm": 1e3 * float(following.deflection_m[~half].max()),
        "dorsiflexing_moment_nm": float(np.nanmax(moment)), "plantarflexing_moment_nm": -float(np.nanmin(moment)),
        "cop_first_mm": 1e3 * float(cop[loaded][0, 0]), "cop_last_mm": 1e3 * float(cop[loaded][-1, 0]),
        "stored_heel_j": float(strain[half].max()), "stored_forefoot_j": float(strain[~half].max()),
        "energy_in_j": taken, "energy_out_j": given, "return_ratio": given / taken, "lost_j": float(lost[-1]),
        "lost_by_sliding_j": float(e["friction_loss"][-1]), "left_j": float(strain[-1]),
        "mean_moment_arm_m": mean_moment_arm(run.time_s, moment, following.force_n),
        "unconverged_steps": run.unconverged_steps, **shape,
    }
    return row, {"force_n": following.force_n, "deflection_mm": 1e3 * following.deflection_m,
                 "cop_forward_m": cop[:, 0], "cop_up_m": cop[:, 1], "moment_nm": moment, "strain_j": strain,
                 "lost_j": lost}
