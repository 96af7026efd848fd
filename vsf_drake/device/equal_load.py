"""The foot under one load with nobody on it: the null of what a setting of the foot does to a
person.

The foot alone is rolled over by the roll-over machine, without friction, along the force and tilt
of ISO 22675 to the person's weight, whatever its setting: no motion is anybody's, nothing adapts.
What strides that adapt show beyond this is theirs; what is in here already is the mechanics of a
spring under an equal load.

A knee is a point on the pylon's line here, as high above the pylon's end as the person's own; the
ground's normal force has a moment about it, and no leg answers. Its extension, and what the other
leg does, have no null.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.base.errors import SimulationError
from vsf_drake.base.sentences import say
from vsf_drake.device.roll_over import (
    DURATION_S,
    IsoRow,
    energy_taken,
    iso_22675,
    returned_late,
    rolled_row,
)
from vsf_drake.model.parameters import GRAVITY, ModelParameters, Subject
from vsf_drake.plants.anthropometry import scale_body
from vsf_drake.simulation.roll_over import FOLLOWS_WITHIN, Rolling, RollOver, line_of_force

# of a stance; 1200 change no outcome by more than 0.5 % (nominal foot, 66, 108 and 151 mm)
STEPS = 600
WINDOW_S = 0.02  # over which power is a mean: shorter ones tell the time step (a choice)


@dataclass(frozen=True, kw_only=True)
class EqualLoad:
    """One setting under the load."""

    row: IsoRow
    early_j: float  # largest energy in keel, fulcrum and foam in the first half of stance
    knee_extensor_moment: float  # N m/kg, largest in the first half of stance
    outcomes: dict[str, float]
    """as `optimal_control.outcomes` names them; NaN where there is nobody to have one"""

    @property
    def stiffness(self) -> float:
        """N m/(deg kg), of the ankle: the largest moment over the largest turn of the keel's
        end."""
        return self.outcomes["ankle_moment"] / self.outcomes["dorsiflexion"]


def at_equal_load(
    subject: Subject, model: ModelParameters, settings_m: Sequence[float], *, steps: int = STEPS
) -> list[EqualLoad]:
    """The model's foot at every position (m) of its fulcrum, softest first, under this person's
    weight.

    SimulationError where a setting cannot be rolled or its steps do not converge. One that misses
    the load by more than a roll-over may is there: see `missed`.
    """
    machine = RollOver(model.foot, friction=False)
    load = iso_22675(DURATION_S / steps)
    body = scale_body(subject, model.foot, model.socket)
    knee_m = body.residual_length + body.pylon_length
    mass_kg = subject.mass_kg
    late = load.time_s[1:] > 0.5 * DURATION_S
    window = max(1, round(WINDOW_S * steps / DURATION_S))
    found = []
    force = mass_kg * GRAVITY * load.force_bw
    outcomes = machine.roll_side_by_side(
        [
            Rolling(fulcrum_m=fulcrum, time_s=load.time_s, tilt_rad=load.tilt_rad, force_n=force)
            for fulcrum in settings_m
        ]
    )
    for fulcrum, outcome in zip(settings_m, outcomes, strict=True):
        if isinstance(outcome, SimulationError):
            raise outcome
        run, following = outcome
        row, _ = rolled_row(machine, run, following, fulcrum, load)
        if row.unconverged_steps:
            raise SimulationError(
                f"{row.unconverged_steps} steps of the foot alone with the fulcrum at "
                f"{row.fulcrum_mm:g} mm did not converge",
                time_s=DURATION_S,
            )
        strain, taken = energy_taken(run)
        ankle = np.column_stack([run.mount[:, 0], np.zeros(steps), run.mount[:, 1]])
        arm = run.cop_W - (ankle + knee_m * line_of_force(run.mount[:, 2]))
        # positive: a flexor's
        knee = (arm[:, 0] * run.grf_W[:, 2] - arm[:, 2] * run.grf_W[:, 0]) / mass_kg
        given = (taken[:-window] - taken[window:])[late[window:]] / WINDOW_S
        found.append(
            EqualLoad(
                row=row,
                early_j=float(strain[~late].max()),
                knee_extensor_moment=-float(np.nanmin(knee[~late])),
                outcomes={
                    "dorsiflexion": float(np.degrees(run.keel_turn_rad.max())),
                    "ankle_moment": row.dorsiflexing_moment_nm / mass_kg,
                    "knee_extension": float("nan"),
                    "knee_flexor_moment": float(np.nanmax(knee[late])),
                    "push_off_power": float(given.max()) / mass_kg,
                    "stored_energy": row.stored_forefoot_j,
                    "returned_energy": returned_late(run.time_s, strain, taken),
                },
            )
        )
    return found


def missed(rolled: Sequence[EqualLoad]) -> str:
    """By how much the load of some of them is not the equal one, in words; "" where all follow
    it."""
    off = [one.row for one in rolled if not one.row.follows]
    return say("roll_over", "not_quite_equal", rows=off, within=FOLLOWS_WITHIN)[0] if off else ""
