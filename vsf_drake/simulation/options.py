"""What commands and functions ask of a walk, a bench and a standing person: defaults and ranges. No
Drake, so that a command has them before it loads."""

from __future__ import annotations

from dataclasses import dataclass

from vsf_drake.base.schema import choice, option, quantity
from vsf_drake.laws.contact_laws import CONTACT_LAWS

_PAPER = "McGeehan 2021"
MAX_STEP_MS = 10.0  # a choice: the foam is stiff
STARTS_LOADED = "STARTS LOADED"  # how the note of a walk begins that starts in mid-stance
TRANSIENT_S = 0.2
"""How long a walk that starts in mid-stance is not scored (a choice): its foot starts at rest,
without the shear that it had, which comes back by creep over half a second."""
TRANSIENT_BW = (0.21, 0.10, 0.02)
"""How far its force is off at most (body weights): at first, at any instant after TRANSIENT_S, and
the resultant's root mean square from then to lift-off. Measured on the eighteen walks of the
synthetic reference subject, started at 5 to 95 % of stance, against the whole walks. (The shear of
the pose pressed into the foam at rest, with friction, is nearer in the first fifth of stance and up
to six times as far off later.)"""


@dataclass(frozen=True, kw_only=True)
class StepOptions:
    """The grid of a walk."""

    step_ms: float = quantity(
        1.0,
        unit="ms",
        low=1e-3,
        high=MAX_STEP_MS,
        source="choice",
        help="Step of the simulations.",
    )


@dataclass(frozen=True, kw_only=True)
class LawOptions:
    """How the feet and the ground press each other."""

    law: str | None = choice(
        None,
        options=tuple(CONTACT_LAWS),
        source="choice",
        metavar="|".join(CONTACT_LAWS),
        help="Contact law. Default: that of the fitted contact, else of the model.",
    )


@dataclass(frozen=True, kw_only=True)
class BenchOptions:
    """Passes of a testing machine."""

    fulcrum_mm: tuple[float, ...] = quantity(
        (66.0, 87.0, 108.0, 129.0, 151.0),
        unit="mm",
        source=_PAPER,
    )
    """from the keel's posterior end; a passive foot is pressed as it is"""
    max_load_n: float = quantity(600.0, unit="N", source=_PAPER, help="Load at which a pass ends.")
    speed_mm_per_min: float = quantity(
        50.0, unit="mm/min", source=_PAPER, help="Speed of the platen."
    )
    heel: bool = option(
        True,
        "Test the heel too.",
    )


@dataclass(frozen=True, kw_only=True)
class StandingOptions:
    """How somebody stands."""

    duration_s: float = quantity(10.0, unit="s", source="choice", help="How long to stand.")
    upright: bool = option(
        False, "Hold the pelvis's angles; otherwise as many of them are free as stay stable."
    )
