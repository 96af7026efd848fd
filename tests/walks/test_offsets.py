"""Fit of the three geometric offsets."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.embedded import embedded_trials
from vsf_drake.walks.offsets import (
    BOUNDS,
    ENOUGH,
    NAMES,
    OffsetFit,
    OffsetProblem,
    fit_offsets,
    minimise,
)

TRUTH = GeometricOffsets(height_m=-0.004, fore_aft_m=0.008, alignment_rad=0.03)


@pytest.fixture(scope="module")
def trial():
    return load_trial(embedded_trials("exact")[0])


@pytest.fixture(scope="module")
def walker(trial):
    return Walker(trial.subject, trial.model)


def test_offsets_that_made_the_data_are_found_again(trial, walker):
    """The plate is the model's own force at known offsets; the priors pull by less than 2 standard
    errors."""
    walk = walker.walk(
        trial.trajectory,
        fulcrum_m=trial.fulcrum_m,
        start_s=trial.start_s,
        end_s=trial.end_s,
        offsets=TRUTH,
    )
    plate = PlateRecording(
        time_s=walk.record.time_s,
        force_W=walk.prosthetic.grf_W,
        cop_W=walk.prosthetic.cop_W,
        free_moment_nm=walk.prosthetic.free_moment_nm,
        has_cop=True,
    )
    made = dataclasses.replace(trial, plates=trial.plates | {"right": plate})
    calls = []
    fit = fit_offsets(made, walker=walker, progress=lambda count, cost: calls.append((count, cost)))
    assert fit.success and not fit.at_bound
    nowhere = OffsetProblem(walker, made).residuals(np.zeros(3))
    assert fit.cost < 0.005 * nowhere @ nowhere
    for name in NAMES:
        fitted, truth, error = (
            getattr(item, name) for item in (fit.offsets, TRUTH, fit.standard_error)
        )
        assert abs(fitted - truth) < 2 * error, name
    assert len({count for count, _ in calls}) == len(calls)


def by_differences(residuals, steps):
    """Jacobian of `residuals` by central differences with `steps`, inside the bounds."""

    def jacobian(x):
        columns = []
        for i, step in enumerate(steps):
            ends = np.repeat(x[None], 2, axis=0)
            ends[:, i] = np.clip(x[i] + np.array([-step, step]), -BOUNDS[i], BOUNDS[i])
            columns.append((residuals(ends[1]) - residuals(ends[0])) / (ends[1, i] - ends[0, i]))
        return np.column_stack(columns)

    return jacobian


WIDE = np.array([5e-4, 1e-3, np.radians(0.25)])
"""Steps (m, m, rad) well above the scatter of contact events; a thousandth of them passes none."""


@pytest.mark.parametrize(
    ("number", "share"),
    [
        (0, 1e-3),
        *(pytest.param(*case, marks=pytest.mark.slow) for case in ((0, 1.0), (6, 1.0), (6, 1e-3))),
    ],
)
def test_exact_jacobian_leads_to_the_minimum_that_differences_lead_to(number, share):
    """Gauss-Newton from the same start. With narrow differences, which are exact but for 1e-4, the
    path is the same; with wide ones the end is, within the half of a standard error that a fit may
    be off when it stops (ENOUGH)."""
    one = load_trial(embedded_trials("exact")[number])
    problems = [OffsetProblem(Walker(one.subject, one.model), one) for _ in range(2)]
    start = np.array([5e-3, 0.0, 0.0])
    exact = minimise(problems[0].residuals, problems[0].jacobian, start)
    other = minimise(
        problems[1].residuals, by_differences(problems[1].residuals, share * WIDE), start
    )
    assert exact.success and other.success
    apart = exact.jac @ (exact.x - other.x)
    assert np.linalg.norm(apart) < (0.5 if share == 1.0 else 0.01)
    if share < 1.0:
        assert exact.cost == pytest.approx(other.cost, rel=ENOUGH)
        assert exact.nfev == other.nfev
    assert problems[0].simulations == exact.nfev
    assert problems[1].simulations >= 7 * other.njev


def test_jacobian_is_the_derivative_of_the_residuals(trial, walker):
    """At a point with all three offsets: central differences that pass no event."""
    problem, x = OffsetProblem(walker, trial), np.array([5e-3, 0.01, 0.02])
    exact = problem.jacobian(x)
    problem.residuals(x)
    assert problem.simulations == 1
    other = by_differences(problem.residuals, 1e-3 * WIDE)(x)
    assert exact.shape == other.shape
    assert np.all(np.abs(exact - other) < 1e-3 * np.abs(other).max(axis=0))


def test_a_trial_without_a_stance_that_is_known_from_end_to_end_is_refused(trial, walker):
    [first, *_] = find_stances(trial.prosthetic_plate.time_s, trial.prosthetic_plate.force_W[:, 2])
    cut = dataclasses.replace(
        trial,
        end_s=first.end_s,
        unmeasured={trial.subject.prosthetic_side: ((first.start_s - 0.1, first.start_s + 0.1),)},
    )
    with pytest.raises(
        InputError, match=r"every stance of the right \(prosthetic\) foot .* lies in unknown_force"
    ):
        fit_offsets(cut, walker=walker)


def test_person_far_above_the_ground_is_reported_not_fitted(trial, walker):
    values = np.array(trial.trajectory.values)
    values[:, trial.trajectory.names.index("pelvis_ty")] += 0.3
    floating = dataclasses.replace(
        trial,
        trajectory=type(trial.trajectory)(trial.trajectory.time_s, values, trial.trajectory.names),
    )
    with pytest.raises(InputError, match="cannot carry the recorded load"):
        fit_offsets(floating, walker=walker)


def test_what_is_doubtful_in_fitted_offsets_is_said_in_one_place():
    """No convergence, a bound, and more than 20 mm or 5 degrees; of a sound fit nothing."""
    near = GeometricOffsets(height_m=0.019, fore_aft_m=-0.019, alignment_rad=np.radians(4.9))
    sound = OffsetFit(
        offsets=near, standard_error=near, cost=1.0, success=True, message="", at_bound=()
    )
    assert sound.doubts == []
    far = GeometricOffsets(height_m=0.021, fore_aft_m=-0.019, alignment_rad=np.radians(-5.1))
    lost = dataclasses.replace(
        sound, offsets=far, success=False, message="too many steps.", at_bound=("height_m",)
    )
    bound, ended, *both = lost.doubts
    assert "height_m ended on its bound" in bound and "did not converge: too many steps." in ended
    assert [" ".join(doubt.split()[:6]) for doubt in both] == [
        "FAR OFFSET: the fitted height is",
        "FAR OFFSET: the fitted alignment is",
    ]
