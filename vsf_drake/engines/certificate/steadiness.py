"""Whether an engine's own fixed steps are steady with the foot's files: what is done, and what is
made of it.

Held: the mount stands still, without weight; the keel's joints start with a strike, because a keel
that nobody disturbs stays on the edge of a cliff; a load rises on the load point in `RAMP_S` and
stays. What is left after that of a passive keel dies away: its slowest mode has a time constant of
some 10 ms, so after 0.9 s nothing is left but rounding.

Dropped: `DROPPED_KG` on a vertical rail, with the foot under it, fall by `FALL_M` on a floor, with
the engine's own contact. Of kinetic energy, energy of weight and energy of the foot's springs, less
the work of the floor, dampers only take. These engines take a step h from speeds v to v+ under the
springs of its start, and from there to q+ = q + h v+; so speeds belong to the middle between the
pose before and their own, and the potential energy that goes with them is the mean of both. With it
the balance is exact for springs without damping, but for K (h v)^2 / 4, which does not grow.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vsf_drake.engines.certificate.asked import NOMINAL, Asked, foot_file

STEPS_S = (1e-3, 2e-3)
"""Beside the file's own step."""
LOADS_N = (0.0, 400.0, 600.0)
RAMP_S = 0.1
TIME_S = 1.0  # of each run
LAST_S = 0.1  # of it, in which it must be at rest
STRIKE_RAD_PER_S = 1.0  # of all joints of the keel
SPREAD_M = 1e-6
"""Largest less smallest rise at rest: 1e-4 of the rise of the stiffest setting under 600 N; what is
steady has 1e-12 (a choice)."""
CREATED_J = 1e-6
"""Energy out of nothing in a drop that counts as none: rounding, and what an engine's solver leaves
of a step's equations, on a drop of 12 J (a choice)."""
DROPPED_KG = 60.0
FALL_M = 0.02


class Held(NamedTuple):
    """What an engine is to hold: `load_n` on the point `x_m` from A along the keel's `body`."""

    file: Path
    step_s: float
    hinges: list[str]
    body: str
    x_m: float
    load_n: float


class Drop(NamedTuple):
    """A run of the rail, n steps."""

    kinetic_j: np.ndarray  # (n,) at the start of each
    potential_j: np.ndarray  # (n,) of weight and of the foot's springs, there
    work_j: np.ndarray  # (n,) of the floor in each
    force_n: np.ndarray  # (n,) vertical, of the floor

    @property
    def created_j(self) -> float:
        """The most by which the balance of energy rises above an earlier one."""
        energy = self.kinetic_j[1:] + 0.5 * (self.potential_j[1:] + self.potential_j[:-1])
        balance = energy - np.cumsum(self.work_j[:-1])
        return float((balance - np.minimum.accumulate(balance)).max())


def write_answer(
    folder: Path,
    engine: str,
    *,
    ending: str,
    own_step: Callable[[Path], float],
    held: Callable[[Held], np.ndarray],
    dropped: Callable[[Path, float], Drop],
    version: str,
) -> None:
    """Writes steady_ENGINE.npz into `folder`: for S steps (the file's own, then `STEPS_S`), F
    positions of the fulcrum and L loads

        step_s            (S, F)
        load_n            (L,)
        rest_rise_m       (S, F, L)   rise of the load point at the end, mean
        spread_m          (S, F, L)   and its largest less its smallest value there
        steady            (S, F, L)   whether the engine ended without warning, with a small spread
        energy_created_j  (S, F)      in a drop
        passive           (S, F)      whether that is none
        borne_n           (S, F)      force of the floor at the end of a drop, mean
        version

    Args:
        ending: of the foot's files for it.
        own_step: s, for which a file is written.
        held: (n,) rise (m) in the last `LAST_S`; NaN if the engine failed.
        dropped: with a file at a step; NaN if the engine failed.
    """
    asked = Asked.read(folder)
    files = [foot_file(folder, NOMINAL, mm, ending) for mm in asked.fulcrum_mm]
    step_s = np.array([[own_step(file) for file in files], *([s] * len(files) for s in STEPS_S)])
    rise, spread = (np.full((*step_s.shape, len(LOADS_N)), np.nan) for _ in range(2))
    created, borne = (np.full(step_s.shape, np.nan) for _ in range(2))
    for at, file in enumerate(files):
        for step in np.unique(step_s[:, at]):
            same = step_s[:, at] == step
            for which, load in enumerate(LOADS_N):
                asking = Held(
                    file=file,
                    step_s=float(step),
                    hinges=[str(name) for name in asked.hinges],
                    body=str(asked.bodies[asked.carrier]),
                    x_m=float(asked.p_BC[0]),
                    load_n=load,
                )
                rises = held(asking)
                rise[same, at, which] = rises.mean()
                spread[same, at, which] = np.ptp(rises)
            drop = dropped(file, float(step))
            created[same, at] = drop.created_j
            borne[same, at] = drop.force_n[-round(LAST_S / step) :].mean()
    np.savez(
        folder / f"steady_{engine}.npz",
        step_s=step_s,
        load_n=LOADS_N,
        rest_rise_m=rise,
        spread_m=spread,
        steady=spread < SPREAD_M,
        energy_created_j=created,
        passive=created < CREATED_J,
        borne_n=borne,
        version=version,
    )
