"""How much of the validation is done, and how. No Drake, so that the command has it before it
loads."""

from __future__ import annotations

from dataclasses import dataclass

from vsf_drake.base.schema import SEED, option, quantity
from vsf_drake.simulation.options import StepOptions


@dataclass(frozen=True, kw_only=True)
class StudyOptions:
    """How much of the validation is done, and how."""

    quick: bool = option(
        False, "The short form: one embedded walk per setting, coarser steps, small samples."
    )
    full: bool = option(False, "Compute energies in steps of 0.125 ms instead of 0.25.")
    seed: int = quantity(0, unit="1", low=0, source="choice", help=SEED)
    workers: int | None = quantity(
        None,
        unit="1",
        low=1,
        source="choice",
        help="Processes for many walks. Default: one per core. The numbers do not depend on it.",
    )
    iso_force_n: float | None = quantity(
        None,
        unit="N",
        low=1.0,
        high=10_000.0,  # beyond what any structural test presses a foot with (a choice)
        source="choice",
        help="Largest force of the ISO 22675 loading profile. Default: the subject's weight.",
    )

    @property
    def step_s(self) -> float:
        """Step (s) of the walks that are reported."""
        return 2e-3 if self.quick else 1e-3 * StepOptions.step_ms
