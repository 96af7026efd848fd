"""What the force plate says of many walks of a trial, where they are made: a handful of numbers a
walk, no arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.base.schema import to_plain
from vsf_drake.laws.compiled import sources_sha256
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.batch.cases import PACKAGE, digest
from vsf_drake.simulation.batch.run import WalkOutcome
from vsf_drake.simulation.walk import Walk, Walker, trial_request
from vsf_drake.walks.comparison import compare_all
from vsf_drake.walks.fulcrum_sweep import SWEEP_STEP_S
from vsf_drake.walks.metrics import agreements
from vsf_drake.walks.quantities import JUDGED

AGREED = (
    JUDGED,
    "cop_rmse_fl",
    "cop_ml_rmse_fl",
    "vertical_impulse_error",
    "peak_vertical_bw",
)
PLATE_PEAK = "measured_peak_vertical_bw"
SCORED_BY = tuple(
    f"walks/{name}.py" for name in ("comparison", "metrics", "plate_score", "quantities")
)
"""Parts of the package that scores come from, beside those of a walk."""


@dataclass(frozen=True, eq=False)
class PlateScorer:
    """Says how far walks of a trial agree with its plate, where they are made: AGREED, and the
    PLATE_PEAK; see `simulation.batch.cases.WalkScorer`."""

    plate: PlateRecording
    body_weight_n: float
    foot_length_m: float
    key: str

    def __call__(self, walks: Sequence[Walk]) -> list[dict[str, float | None]]:
        """InputError if the walks have no instant in common with the plate."""
        return [
            {name: getattr(agreed, name) for name in (*AGREED, PLATE_PEAK)}
            for agreed in agreements(
                compare_all(walks, self.plate),
                self.plate,
                body_weight_n=self.body_weight_n,
                foot_length_m=self.foot_length_m,
            )
        ]


def plate_scorer(trial: Trial) -> PlateScorer:
    """The scorer of a trial's walks, as `simulate_batch` takes it."""
    plate = trial.prosthetic_plate
    about = {
        "sources_sha256": sources_sha256(PACKAGE, SCORED_BY),
        "body_weight_n": trial.subject.mass_kg * GRAVITY,
        "foot_length_m": trial.model.foot.length_m,
        "unknown_s": to_plain(plate.unknown_s),
    }
    arrays = {name: getattr(plate, name) for name in ("time_s", "force_W", "cop_W")}
    return PlateScorer(
        plate=plate,
        body_weight_n=about["body_weight_n"],
        foot_length_m=about["foot_length_m"],
        key=digest(about, arrays),
    )


def judged(outcome: WalkOutcome) -> tuple[float | None, str]:
    """The error (BW) that a walk which a `plate_scorer` was given is judged by, or None and why."""
    if outcome.failure is not None:
        return None, outcome.failure
    error = outcome.scores[JUDGED]
    return error, "no stance was simulated" if error is None else ""


def fulcrum_errors(
    walker: Walker, trial: Trial, positions: np.ndarray, **fitted: Any
) -> np.ndarray:
    """(p,) BW, the error that the trial's walk is judged by with the fulcrum at each of the
    positions (m); NaN where it fails. `fitted` is what else `Walker.walk_trial` takes."""
    scorer = plate_scorer(trial)
    errors = np.full(len(positions), np.nan)
    requests = [
        trial_request(trial, fulcrum_m=float(x), step_s=SWEEP_STEP_S, **fitted) for x in positions
    ]
    for i, walk in enumerate(walker.walk_each(requests, sites=False)):
        if isinstance(walk, InputError):
            raise walk
        if isinstance(walk, Walk):
            error = scorer([walk])[0][JUDGED]
            errors[i] = np.nan if error is None else error
    return errors
