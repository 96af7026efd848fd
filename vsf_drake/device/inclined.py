"""The foot pressed at an angle, as structural tests press feet: at the peaks of the ISO 22675
profile, rounded, and level.

Below zero loads the heel. The platen is level and without friction, the foot pitched by minus the
angle, toes up; it moves along the platen's normal, along which force and displacement are taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import trapezoid

from vsf_drake.device.bench_metrics import stiffness
from vsf_drake.simulation.roll_over import RollOver

HEEL_DEG = -15.0
LEVEL_DEG = 0.0
TOE_DEG = 20.0
BORNE_N = 1.0
"""Load (N) from which a sphere is said to bear."""


@dataclass(frozen=True, kw_only=True)
class InclinedRow:
    """The foot pressed at an angle to a load, and let go."""

    angle_deg: float
    fulcrum_mm: float
    displacement_mm: float
    stiffness_n_per_mm: float
    energy_stored_j: float
    zones_loaded: tuple[str, ...]
    unconverged_steps: int


@dataclass(frozen=True, kw_only=True, eq=False)
class InclinedCurve:
    """Loading and unloading, from touch-down."""

    displacement_m: np.ndarray  # (n,) of the platen along its normal
    load_n: np.ndarray  # (n,) along that normal
    peak: int  # index of the largest load, with which unloading begins

    @property
    def returned_share(self) -> float:
        """Energy given back over energy stored."""
        up = slice(None, self.peak + 1)
        down = slice(self.peak, None)
        stored = trapezoid(self.load_n[up], self.displacement_m[up])
        return float(-trapezoid(self.load_n[down], self.displacement_m[down]) / stored)


def press_inclined(
    machine: RollOver,
    *,
    angle_deg: float,
    fulcrum_m: float,
    load_n: float,
    speed_m_per_s: float,
    steps_per_mm: float,
) -> tuple[InclinedRow, InclinedCurve]:
    """Presses the foot of a machine without friction until it bears `load_n` (N), its fulcrum at
    `fulcrum_m` (m from A), and lets go; stiffness is the mean slope above 200 N.

    Raises what `RollOver.press` does.
    """
    pitch = -np.radians(angle_deg)
    run = machine.press(
        fulcrum_m=fulcrum_m,
        pitch_rad=pitch,
        max_load_n=load_n,
        speed_m_per_s=speed_m_per_s,
        steps_per_mm=steps_per_mm,
    )
    displacement = np.append(0.0, float(machine.touch_height(pitch)[0]) - run.mount[:, 1])
    load = np.append(0.0, run.grf_W[:, 2])
    peak = int(np.argmax(load))
    x = displacement[: peak + 1]
    f = load[: peak + 1]
    reached_m = float(np.interp(load_n, f, x))
    below = f < load_n  # the last step goes beyond the load, by less than a step
    sites = machine.machine.foot.sites
    bearing = sites.zone[run.sphere_normal_n[peak - 1] > BORNE_N]
    row = InclinedRow(
        angle_deg=angle_deg,
        fulcrum_mm=1e3 * fulcrum_m,
        stiffness_n_per_mm=1e-3 * stiffness(x, f),
        displacement_mm=1e3 * reached_m,
        energy_stored_j=float(
            trapezoid(np.append(f[below], load_n), np.append(x[below], reached_m))
        ),
        zones_loaded=tuple(sites.zone_names[zone] for zone in np.unique(bearing)),
        unconverged_steps=run.unconverged_steps,
    )
    return row, InclinedCurve(displacement_m=displacement, load_n=load, peak=peak)
