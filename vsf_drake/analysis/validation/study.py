"""What the validation is made of: its inputs with their walks, its options, and what one of its sections found."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsf_drake.analysis.comparison import Comparison
from vsf_drake.bench_curves import BenchCurves
from vsf_drake.contact_file import FittedContact
from vsf_drake.motion.trial_record import Trial
from vsf_drake.parameters import ModelParameters
from vsf_drake.simulation.results import WalkResult
from vsf_drake.simulation.walk import DEFAULT_STEP_S

FITTED, HELD_OUT, OFFSETS_FITTED = "fitted", "held out", "offsets fitted"
"""What a walk's agreement with its plate is worth: the fit has seen it, has not, or its offsets were fitted to it."""
Progress = Callable[[str, float], None]
"""Called with what is being done and the finished fraction of it."""


@dataclass(frozen=True, kw_only=True)
class StudyOptions:
    """How much of the validation is done, and how.

    Attributes:
        quick: the short form: fewer walks, coarser steps, small samples.
        seed: of all that is random.
        workers: processes for many walks; None for one a core. The numbers do not depend on it.
        iso_force_n: largest force (N) of the ISO 22675 loading profile; None for the subject's weight.
    """

    quick: bool = False
    seed: int = 0
    workers: int | None = None
    iso_force_n: float | None = None

    @property
    def step_s(self) -> float:
        """Step (s) of the walks that are reported."""
        return 2e-3 if self.quick else DEFAULT_STEP_S


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyWalk:
    """One trial of the study: what was recorded, and what was simulated.

    Attributes:
        label: its name, unlike that of any other walk of the study.
        role: FITTED, HELD_OUT or OFFSETS_FITTED.
        recorded: the trial as it was read.
        trial: the same as it was walked: with the fitted contact, or with the fitted offsets.
        result: the walk, with its energy ledger.
        comparison, metrics: of it with the plate under the prosthetic foot (`analysis.comparison`, `analysis.metrics`);
            the null model is among the metrics where there is another trial to make it of.
        doubts: sentences on what of it is doubtful.
    """

    label: str
    role: str
    recorded: Trial
    trial: Trial
    result: WalkResult
    comparison: Comparison
    metrics: Mapping[str, Any]
    doubts: tuple[str, ...]

    @property
    def fulcrum_mm(self) -> float:
        """Where the fulcrum stood, from the keel's posterior end A: the condition."""
        return round(1e3 * self.trial.fulcrum_m, 6)


@dataclass(frozen=True, kw_only=True, eq=False)
class Study:
    """Everything that the sections of the validation are computed from.

    Attributes:
        walks: at least one, by fulcrum position and name.
        failed: (label, why) of the trials that could not be read or walked.
        model: the device, with the fitted contact where there is one.
        contact: what was fitted, or None; `contact_name` is its file's name.
        bench: measured load-displacement curves, or None; `bench_problem` says why a file that was given is not used.
        inputs: SHA-256 by name of every file that was read.
    """

    walks: tuple[StudyWalk, ...]
    failed: tuple[tuple[str, str], ...] = ()
    model: ModelParameters
    contact: FittedContact | None = None
    contact_name: str = ""
    bench: BenchCurves | None = None
    bench_problem: str | None = None
    options: StudyOptions
    inputs: Mapping[str, str] = field(default_factory=dict)

    @property
    def synthetic(self) -> bool:
        """Whether any walk or the bench was constructed rather than measured."""
        return any(walk.trial.synthetic for walk in self.walks) or (self.bench is not None and self.bench.synthetic)

    def conditions(self) -> dict[float, tuple[StudyWalk, ...]]:
        """Walks by fulcrum position (mm), softest first."""
        positions = sorted({walk.fulcrum_mm for walk in self.walks})
        return {x: tuple(walk for walk in self.walks if walk.fulcrum_mm == x) for x in positions}


@dataclass(frozen=True, kw_only=True, eq=False)
class Section:
    """What one section of the validation found.

    Attributes:
        table: plain values (dicts, lists, strings, numbers, None for what is unknown); names end in their unit.
        arrays: curves for its figures, by names without "/"; units as in the names, NaN where there is nothing.
        missing: sentences on what is not there, and why.
    """

    table: dict[str, Any]
    arrays: dict[str, np.ndarray] = field(default_factory=dict)
    missing: tuple[str, ...] = ()
