"""Recordings that the model itself made with known parameters.

True parameters are drawn from the prior of the fit, all at once, within the bounds. With them the
model walks the kinematics of the reference subject's exact trials in the step of the fit, and what
the ground then does to the foot is the plate: force and centre of pressure at the instants of the
walk (500 Hz), so that at the truth the fit's residuals vanish but for the prior's. Smooth errors of
joint angles run over the gait cycle, which the fit reads off the plate that they made: the walk is
repeated until strike and lift-off stay where they are. The bench is the model's own stiffness.

Noise is as the fit assumes it: Gaussian, with an exponential correlation, on each component of the
force and on the centre of pressure both ways, in the walk's axes; independent on each stiffness of
the bench. An unloaded plate reads nothing: there is none in swing, where the model's force is zero
whatever the parameters.

Not any drawn foot carries the person. A recording counts if the plate saw one whole stance in each
trial, whose vertical impulse is within a part IMPULSE of what was recorded there; otherwise truth
and noise are drawn again. That asks nothing but what the plate shows, noise included, so that it
does not change what the plate tells about the parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vsf_drake.base.errors import InputError, SimulationError
from vsf_drake.fit.options import FORCES, SERIES, ContactFitOptions, FitNoise
from vsf_drake.fit.problem import ContactFit
from vsf_drake.fit.solve import prior_samples
from vsf_drake.model.bench_curves import BenchMeasurement
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import THRESHOLD_N, find_stances
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trial import Trial
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.comparison import walk_axes

IMPULSE = 0.15
MOST_DRAWS, MOST_WALKS = 1000, 8
SETTLED_S = 1e-5
"""By which strike and lift-off may still move: a hundredth of a sample of a plate."""


@dataclass(frozen=True, eq=False)
class Made:
    """A problem whose solution is known.

    Attributes:
        fit: of the made recordings. truth: (P,) the parameters that they were made with, in the
            fit's coordinates.
        draws: how often truth and noise were drawn.
    """

    fit: ContactFit
    truth: np.ndarray
    draws: int


def assuming(made: Made, scale: float) -> Made:
    """The same recordings for a fit that assumes `scale` times the noise that `made.fit` does, on
    the bench too."""
    fit, bench = made.fit, made.fit.bench
    noise = replace(
        fit.options.noise, **{name: scale * getattr(fit.options.noise, name) for name in SERIES}
    )
    if bench is not None:
        bench = replace(bench, uncertainty_n_per_m=scale * bench.uncertainty_n_per_m)
    return replace(
        made,
        fit=ContactFit(
            fit.trials,
            bench=bench,
            parameters=fit.parameters,
            walker=fit.walker,
            labels=fit.labels,
            options=replace(fit.options, noise=noise),
        ),
    )


def make(
    trials: Sequence[Trial],
    bench: BenchMeasurement,
    walker: Walker,
    seed: Sequence[int],
    *,
    drawn: float,
    options: ContactFitOptions,
) -> Made:
    """Draws a truth and makes its recordings.

    Args:
        trials: whose kinematics are walked. bench: which stiffnesses are measured, and how well.
        seed: of truth and noise.
        drawn: the recordings' noise over that of the options and of the bench; 0 for none.
        options: of the fit.
    """
    labels = tuple(trial.path.stem for trial in trials)
    parameters = ContactFit(trials, bench=bench, walker=walker, labels=labels).parameters
    for draw in range(MOST_DRAWS):
        truth = prior_samples(parameters, 1, [*seed, draw, 0])[0]
        rng = np.random.default_rng([*seed, draw, 1])
        try:
            made = _own_plates(trials, labels, bench, walker, truth, options)
            noisy = [
                _with_noise(trial, heading, options.noise, drawn, rng) for trial, heading in made
            ]
            if not all(map(_carries_the_person, noisy, trials)):
                continue
            fit = ContactFit(noisy, bench=bench, walker=walker, labels=labels, options=options)
            measured = _own_bench(fit, truth, bench, drawn, rng)
            return Made(
                fit=ContactFit(
                    noisy, bench=measured, walker=walker, labels=labels, options=options
                ),
                truth=truth,
                draws=draw + 1,
            )
        except (InputError, SimulationError):
            continue
    raise RuntimeError(f"none of {MOST_DRAWS} drawn feet carries the person")


def _own_plates(
    trials: Sequence[Trial],
    labels: Sequence[str],
    bench: BenchMeasurement,
    walker: Walker,
    truth: np.ndarray,
    options: ContactFitOptions,
) -> list[tuple[Trial, np.ndarray]]:
    """The trials with the model's own plates, and the directions of walking (2,).

    Raises:
        InputError: there is no whole stance, or strike and lift-off do not settle.
        SimulationError: a walk diverges.
    """
    made, events = list(trials), np.zeros(0)
    for _ in range(MOST_WALKS):
        fit = ContactFit(made, bench=bench, walker=walker, labels=labels, options=options)
        before, headings = events, []
        for i, (trial, label) in enumerate(zip(made, labels, strict=True)):
            comparison, result = fit.terms_of(trial, label).walk(truth)
            plate = PlateRecording(
                time_s=result.time_s,
                force_W=result.grf_W,
                cop_W=result.cop_W,
                free_moment_nm=result.free_moment_nm,
                has_cop=True,
            )
            made[i] = replace(trial, plates={**trial.plates, trial.subject.prosthetic_side: plate})
            headings.append(comparison.heading)
        events = np.array([(s.start_s, s.end_s) for trial in made for s in _stances(trial)]).ravel()
        if before.shape == events.shape and np.abs(events - before).max(initial=0.0) < SETTLED_S:
            return list(zip(made, headings, strict=True))
    raise InputError("strike and lift-off do not settle")


def _with_noise(
    trial: Trial, heading: np.ndarray, noise: FitNoise, drawn: float, rng: np.random.Generator
) -> Trial:
    plate = trial.prosthetic_plate
    axes, on = walk_axes(heading), plate.force_W[:, 2] > THRESHOLD_N
    sizes = [drawn * getattr(noise, name) * trial.subject.mass_kg * GRAVITY for name in FORCES]
    force = np.column_stack([size * _correlated(plate.time_s, noise, rng) for size in sizes]) @ axes
    cop = (
        np.stack(
            [
                drawn * size * trial.model.foot.length_m * _correlated(plate.time_s, noise, rng)
                for size in (noise.cop_fore_aft, noise.cop_lateral)
            ],
            axis=1,
        )
        @ axes[:2]
    )
    spoilt = replace(plate, force_W=plate.force_W + force * on[:, None], cop_W=plate.cop_W + cop)
    return replace(trial, plates={**trial.plates, trial.subject.prosthetic_side: spoilt})


def _correlated(times_s: np.ndarray, noise: FitNoise, rng: np.random.Generator) -> np.ndarray:
    """(n,) of variance one, with the noise's exponential correlation, at evenly spaced times
    (n,)."""
    kept = np.exp(-np.median(np.diff(times_s)) / noise.correlation_s)
    values = rng.standard_normal(len(times_s))
    for i in range(1, len(values)):
        values[i] = kept * values[i - 1] + np.sqrt(1.0 - kept**2) * values[i]
    return values


def _own_bench(
    fit: ContactFit,
    truth: np.ndarray,
    bench: BenchMeasurement,
    drawn: float,
    rng: np.random.Generator,
) -> BenchMeasurement:
    stiffness = fit.bench_stiffness(truth)
    stiffness = stiffness + drawn * bench.uncertainty_n_per_m * rng.standard_normal(len(stiffness))
    count = len(bench.stiffness_n_per_m)
    return replace(
        bench,
        stiffness_n_per_m=tuple(map(float, stiffness[:count])),
        heel_stiffness_n_per_m=float(stiffness[count]) if len(stiffness) > count else None,
    )


def _carries_the_person(made: Trial, recorded: Trial) -> bool:
    own, real = (impulse(trial) for trial in (made, recorded))
    return len(_stances(made)) == len(_stances(recorded)) and abs(own / real - 1.0) < IMPULSE


def _stances(trial: Trial) -> list:
    return find_stances(*_vertical(trial))


def impulse(trial: Trial) -> float:
    """Vertical, N s."""
    time_s, force = _vertical(trial)
    return float(np.trapezoid(force, time_s))


def _vertical(trial: Trial) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) s in the trial's window and the vertical force (n,) N then."""
    plate = trial.prosthetic_plate
    walked = (plate.time_s >= trial.start_s) & (plate.time_s <= trial.end_s)
    return plate.time_s[walked], plate.force_W[walked, 2]
