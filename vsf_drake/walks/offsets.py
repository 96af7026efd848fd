"""Height, fore-aft position and alignment of the prosthesis, fitted to one recording.

No recording tells these three well enough: 1 mm or 1 degree moves the force by several percent of
body weight. They are set by bounded least squares on the sagittal components of the ground reaction
force and the fore-aft centre of pressure, with weak priors. Each simulation brings its own exact
derivatives: residuals and Jacobian are one run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import trapezoid
from scipy.optimize import OptimizeResult, least_squares

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.base.sentences import say
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import common, known_stances, within, words
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.walk import Walk, Walker
from vsf_drake.walks.comparison import compare, compare_sensitivity

NAMES = ("height_m", "fore_aft_m", "alignment_rad")
# the same among the variables of a walk
VARIABLES = ("offset.height", "offset.fore_aft", "offset.alignment")
BOUNDS = np.array([0.10, 0.06, np.radians(15.0)])  # largest offsets (m, m, rad), both ways
# standard deviations (choices): wider than what clinics leave
PRIOR = np.array([0.05, 0.03, np.radians(8.0)])
# expected error of the force components (a choice: the paper's 5.3 % body weight)
FORCE_NOISE_BW = 0.05
COP_NOISE_FL = 0.05  # and of the centre of pressure, in foot lengths (the paper's 5.7 to 9.5 %)
# the fit ends when a step betters the cost by less than this part: below half a standard error
ENOUGH = 1e-4
FAR_OFFSET = {"m": 0.020, "rad": math.radians(5.0)}
"""A fitted offset beyond this makes up for more than how a foot sits under its pylon (choices)."""
FIT_STEP_S = 2e-3
SCAN_STEP_S = 4e-3
# every fourth instant of the 40 Hz force series is a residual: no more of them are independent
STRIDE = 4


@dataclass(frozen=True)
class OffsetFit:
    """What the fit found; costs are half the sum of squared weighted residuals."""

    offsets: GeometricOffsets
    standard_error: GeometricOffsets  # of each, from the Jacobian and the assumed noise
    cost: float
    success: bool  # the optimiser's own verdict
    message: str  # in its words
    at_bound: tuple[str, ...]  # names of offsets that ended on a bound

    @property
    def doubts(self) -> list[str]:
        """Sentences if the fit did not converge, ended on a bound or far away."""
        named = {
            name.rsplit("_", 1)[0].replace("_", "-"): (
                getattr(self.offsets, name),
                name.rsplit("_", 1)[1],
            )
            for name in NAMES
        }
        return [
            *say(
                "offsets",
                "unfinished",
                at_bound=self.at_bound,
                success=self.success,
                message=self.message,
            ),
            *far_offsets(named),
        ]


def far_offsets(found: Mapping[str, tuple[float, str]]) -> list[str]:
    """A sentence for each fitted offset (value and unit, m or rad, by name) that is beyond
    FAR_OFFSET."""
    return [
        sentence
        for name, (value, unit) in found.items()
        if abs(value) > FAR_OFFSET[unit]
        for sentence in say(
            "offsets", "far", name=name, value=value, unit=unit, limit=FAR_OFFSET[unit]
        )
    ]


def fit_offsets(
    trial: Trial,
    *,
    walker: Walker | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> OffsetFit:
    """Fits the three offsets to the plate under the prosthetic foot, from the height at which the
    impulse fits.

    `walker` is a person built before; `progress` is called with the number of simulations so far
    and the current cost. Refused where every stance lies in unknown force at least in part, and
    where the foot meets the ground as the plate says at no height within the bounds;
    SimulationError where a run diverges.
    """
    _check_known(trial)
    problem = OffsetProblem(walker or Walker(trial.subject, trial.model), trial, progress)
    start = np.array([_height_by_impulse(problem), 0.0, 0.0])
    solution = minimise(problem.residuals, problem.jacobian, start)
    covariance = np.linalg.inv(solution.jac.T @ solution.jac)
    return OffsetFit(
        offsets=_offsets(solution.x),
        standard_error=_offsets(np.sqrt(np.diag(covariance))),
        cost=float(solution.cost),
        success=bool(solution.success),
        message=str(solution.message),
        at_bound=tuple(
            name for name, active in zip(NAMES, solution.active_mask, strict=True) if active
        ),
    )


def _check_known(trial: Trial) -> None:
    plate = trial.prosthetic_plate
    window = (trial.start_s, trial.end_s)
    side = trial.subject.prosthetic_side
    known = (
        stance for stance in known_stances(plate) if common((stance.start_s, stance.end_s), window)
    )
    if plate.unknown_s and not any(known):
        raise InputError(
            f"every stance of the {side} (prosthetic) foot from {words(window)} lies in "
            f"unknown_force, at least in part ({', '.join(map(words, plate.unknown_s))}): there "
            "is nothing to fit the offsets to",
            file=trial.path,
            where="forces",
            right="Choose a window or a trial with a stance that its plate saw from end to end",
        )


def _offsets(x: np.ndarray) -> GeometricOffsets:
    return GeometricOffsets(**dict(zip(NAMES, map(float, x), strict=True)))


class OffsetProblem:
    """Weighted residuals of a trial and their derivatives, as functions of the three offsets x (m,
    m, rad).

    Residuals: every STRIDE-th scored instant of fore-aft and vertical force, every STRIDE-th
    percent of each stance of the fore-aft centre of pressure, the offsets themselves over PRIOR.
    `simulations` counts what was run.
    """

    def __init__(
        self, walker: Walker, trial: Trial, progress: Callable[[int, float], None] | None = None
    ) -> None:
        self.walker = walker
        self.trial = trial
        self.simulations = 0
        self._progress = progress
        self._last = np.full(3, np.nan), np.zeros(0), np.zeros((0, 3))

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """(m,) at `x`. Raises SimulationError if the run diverges."""
        return self._evaluate(x)[0]

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """(m, 3) at `x`, without a simulation where the last residuals were asked for."""
        return self._evaluate(x)[1]

    def walk(
        self, offsets: GeometricOffsets, step_s: float, with_respect_to: Sequence[str] = ()
    ) -> Walk:
        """The trial's walk with these offsets."""
        self.simulations += 1
        return self.walker.walk_trial(
            self.trial, step_s=step_s, offsets=offsets, with_respect_to=with_respect_to
        )

    def _evaluate(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if np.array_equal(x, self._last[0]):
            return self._last[1:]
        trial = self.trial
        offsets = _offsets(x)
        walk = self.walk(offsets, FIT_STEP_S, VARIABLES)
        assert walk.sensitivity is not None
        c = compare(walk, trial.prosthetic_plate)
        by = compare_sensitivity(c, walk, walk.sensitivity)

        # Forces fore-aft and vertical and the centre of pressure over their noise, the offsets over
        # their prior.
        rows = np.flatnonzero(c.scored)[::STRIDE]
        noise_n = trial.subject.mass_kg * GRAVITY * FORCE_NOISE_BW
        noise_m = trial.model.foot.length_m * COP_NOISE_FL
        values = [(c.model - c.measured)[rows][:, [0, 2]].ravel() / noise_n]
        slopes = [by.model[rows][:, [0, 2]].reshape(-1, 3) / noise_n]
        if trial.prosthetic_plate.has_cop:
            for stance, cop_by in zip(c.stances, by.cop, strict=True):
                values.append(
                    np.nan_to_num((stance.model_cop - stance.measured_cop)[::STRIDE, 0]) / noise_m
                )
                slopes.append(np.nan_to_num(cop_by[::STRIDE, 0]) / noise_m)
        residuals = np.concatenate([*values, x / PRIOR])
        jacobian = np.vstack([*slopes, np.diag(1 / PRIOR)])
        self._last = np.array(x), residuals, jacobian
        if self._progress:
            self._progress(self.simulations, 0.5 * float(residuals @ residuals))
        return residuals, jacobian


def minimise(
    residuals: Callable[[np.ndarray], np.ndarray],
    jacobian: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
) -> OptimizeResult:
    """The least squares from `start` on, within BOUNDS."""
    return least_squares(
        residuals,
        start,
        jac=jacobian,
        bounds=(-BOUNDS, BOUNDS),
        x_scale=PRIOR,
        xtol=1e-4,
        ftol=ENOUGH,
        max_nfev=30,
    )


def _known(plate: PlateRecording, time_s: np.ndarray, vertical_n: np.ndarray) -> np.ndarray:
    """(n,) a force over time, zero where the plate's is unknown."""
    return np.where(within(time_s, plate.unknown_s), 0.0, vertical_n)


def _height_by_impulse(problem: OffsetProblem) -> float:
    """Height (m) at which the model's vertical impulse equals the plate's: bisection, the impulse
    falls with height."""
    trial = problem.trial
    plate = problem.trial.prosthetic_plate
    inside = (plate.time_s >= trial.start_s) & (plate.time_s <= trial.end_s)
    wanted = float(
        trapezoid(_known(plate, plate.time_s, plate.force_W[:, 2])[inside], plate.time_s[inside])
    )

    def surplus(height: float) -> float:
        try:
            walk = problem.walk(GeometricOffsets(height_m=height), SCAN_STEP_S)
        except SimulationError:  # the foot is too deep in the ground, except at the very top
            if height >= BOUNDS[0]:
                raise
            return np.inf
        return (
            float(_known(plate, walk.record.time_s, walk.prosthetic.grf_W[:, 2]).sum())
            * SCAN_STEP_S
            - wanted
        )

    low = -BOUNDS[0]
    high = BOUNDS[0]
    if not surplus(low) > 0 > surplus(high):
        raise InputError(
            "the prosthetic foot cannot carry the recorded load at any height within "
            f"{1e3 * high:g} mm of the recorded pelvis path",
            file=trial.path,
            where="offsets",
            right=(
                "Check the subject's lengths and that kinematics and forces share time and "
                "laboratory frame"
            ),
        )
    for _ in range(8):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if surplus(middle) > 0 else (low, middle)
    return float(0.5 * (low + high))
