"""How far the condensed foot is from the full one while they are rolled over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from vsf_drake.base.errors import SimulationError
from vsf_drake.device.roll_over import energy_taken, iso_22675, returned_late
from vsf_drake.engines.condensed import CondensedFoot
from vsf_drake.engines.sagittal_foot import rolled
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.simulation.reactions import LOADED_N
from vsf_drake.simulation.roll_over import Rolling, RollOver

MASSES_KG = (40.0, 75.0, 110.0)
POSITIONS = 9
"""All but the ends are between those that the condensed foot is fitted at: the full foot has a
corner in its stiffness where the fulcrum passes a joint of its keel."""


@dataclass(frozen=True, kw_only=True)
class RollOverError:
    """Of one roll-over by the profile of ISO 22675 without friction, condensed against full on the
    same path of the mount."""

    force_largest: float  # of the vertical force, over its peak
    force_rms: float
    centre_largest_m: float  # of the centre of pressure, while both are loaded
    centre_rms_m: float
    stored: float  # of the most strain of the second half of stance, over that
    returned: float  # of what is given back after it, over that


@dataclass(frozen=True, kw_only=True)
class CondensedError:
    """Roll-overs at positions of the fulcrum and body masses: of each error the worst."""

    fulcrums_m: tuple[float, ...]
    masses_kg: tuple[float, ...]
    loaded_n: float = LOADED_N  # that both bear where their centres of pressure are compared
    worst: RollOverError
    each: tuple[RollOverError, ...]  # by position, then by mass


def error_against_full(
    condensed: CondensedFoot,
    *,
    fulcrums_m: Sequence[float] | None = None,
    masses_kg: Sequence[float] = MASSES_KG,
) -> CondensedError:
    """Rolls both over at each position (m from A; POSITIONS of them, evenly over the reach, if left
    out) under each mass, the full one by the stepper, with its mass, the condensed one without any.

    InputError if the carriage cannot reach a position; SimulationError if a foot cannot be rolled.
    """
    load = iso_22675()
    reach = condensed.full.fulcrum
    if fulcrums_m is None:
        fulcrums_m = np.linspace(reach.rearmost_m, reach.foremost_m, POSITIONS).tolist()
    cases = [
        Rolling(
            fulcrum_m=fulcrum,
            time_s=load.time_s,
            tilt_rad=load.tilt_rad,
            force_n=mass * GRAVITY * load.force_bw,
        )
        for fulcrum in fulcrums_m
        for mass in masses_kg
    ]
    runs = []
    for outcome in RollOver(condensed.full, friction=False).roll_side_by_side(cases):
        if isinstance(outcome, SimulationError):
            raise outcome
        runs.append(outcome[0])
    mount = np.stack([run.mount for run in runs], axis=1)
    # the path before the first step
    mount = np.concatenate([2.0 * mount[:1] - mount[1:2], mount])
    feet = condensed.sagittal(np.array([case.fulcrum_m for case in cases]))
    roll = rolled(feet, load.time_s, mount)
    errors = []
    for i, run in enumerate(runs):
        force = run.grf_W[:, 2]
        off = (roll.force_n[:, i] - force) / force.max()
        both = (force > LOADED_N) & (roll.force_n[:, i] > LOADED_N)
        apart = (roll.centre_m[:, i] - run.cop_W[:, 0])[both]
        late = run.time_s > 0.5 * load.duration_s
        full, own = (
            np.array([strain[late].max(), returned_late(run.time_s, strain, taken)])
            for strain, taken in (energy_taken(run), (roll.strain_j[:, i], roll.taken_j[:, i]))
        )
        stored, returned = np.abs(own / full - 1.0)
        errors.append(
            RollOverError(
                force_largest=float(np.abs(off).max()),
                force_rms=float(np.sqrt(np.mean(off**2))),
                centre_largest_m=float(np.abs(apart).max()),
                centre_rms_m=float(np.sqrt(np.mean(apart**2))),
                stored=float(stored),
                returned=float(returned),
            )
        )
    return CondensedError(
        fulcrums_m=tuple(fulcrums_m),
        masses_kg=tuple(masses_kg),
        worst=RollOverError(
            **{
                field.name: max(getattr(error, field.name) for error in errors)
                for field in fields(RollOverError)
            }
        ),
        each=tuple(errors),
    )
