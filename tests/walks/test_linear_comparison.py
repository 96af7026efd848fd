"""Derivatives go through a comparison as the series themselves do."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_results import make_plate, make_walk, turned

from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.reactions import ReactionSensitivity
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.comparison import compare, compare_sensitivity
from vsf_drake.walks.embedded import embedded_trials

SMALL = 1e-3
"""What a made derivative is multiplied by to make another walk: too little to load another
sample."""
NAMES = ("one", "two", "three")


def made_sensitivity(walk, seed=0):
    """Rough derivatives (N, m), those of the centre of pressure where there is one."""
    rng = np.random.default_rng(seed)
    n = len(walk.time_s)
    cop = rng.normal(scale=1e-2, size=(n, 2, len(NAMES)))
    cop[np.isnan(walk.cop_W[:, 0])] = np.nan
    grf = rng.normal(size=(n, 3, len(NAMES)))
    grf[walk.grf_W[:, 2] < 60.0] = 0.0
    return ReactionSensitivity(
        names=NAMES, grf_W=grf, cop_W=cop, free_moment_nm=np.zeros((n, len(NAMES)))
    )


def changed(walk, by, i):
    cop = walk.cop_W.copy()
    cop[:, :2] += SMALL * by.cop_W[:, :, i]
    return dataclasses.replace(walk, grf_W=walk.grf_W + SMALL * by.grf_W[:, :, i], cop_W=cop)


def uneven(walk):
    keep = np.ones(len(walk.time_s), dtype=bool)
    keep[100:400:3] = False
    return dataclasses.replace(
        walk,
        **{
            f.name: getattr(walk, f.name)[keep]
            for f in dataclasses.fields(walk)
            if isinstance(getattr(walk, f.name), np.ndarray)
        },
    )


TWO = ((0.4, 0.9), (1.1, 1.6))
PAIRS = {
    "across the laboratory": turned(make_walk(), make_plate(), 2.0),
    "two stances, one cut": (make_walk(stances=TWO, end_s=1.5), make_plate(stances=TWO)),
    "plate shorter than the walk": (make_walk(), make_plate(start_s=0.7, end_s=1.2)),
    "slow plate, uneven steps": (uneven(make_walk()), make_plate(rate_hz=100.0)),
}


@pytest.mark.parametrize("pair", PAIRS.values(), ids=PAIRS)
def test_derivative_is_what_another_walk_makes_of_the_comparison(pair):
    """All of it is linear, so that a walk changed by a finite amount must be off by that times the
    derivative.

    Rounding: 1e-16 of 1000 N or 1 m, times some (rate / cut-off)^2 in a recursive filter, over
    SMALL.
    """
    walk, plate = pair
    sensitivity = made_sensitivity(walk)
    base = compare(walk, plate)
    by = compare_sensitivity(base, walk, sensitivity)
    assert by.names == NAMES
    assert by.model.shape == (*base.model.shape, 3) and len(by.cop) == len(base.stances) > 0
    for i in range(3):
        other = compare(changed(walk, sensitivity, i), plate)
        np.testing.assert_allclose(
            by.model[..., i], (other.model - base.model) / SMALL, rtol=0.0, atol=1e-6
        )
        for cop, a, b in zip(by.cop, base.stances, other.stances, strict=True):
            np.testing.assert_array_equal(np.isnan(cop[..., i]), np.isnan(a.model_cop))
            np.testing.assert_array_equal(np.isnan(a.model_cop), np.isnan(b.model_cop))
            assert np.isfinite(cop[..., i]).any()
            np.testing.assert_allclose(
                cop[..., i], (b.model_cop - a.model_cop) / SMALL, rtol=0.0, atol=1e-8
            )


def test_without_a_stance_there_is_no_centre_of_pressure_and_another_walks_is_refused():
    walk = make_walk()
    comparison = compare(walk, make_plate(stances=()))
    assert compare_sensitivity(comparison, walk, made_sensitivity(walk)).cop == ()
    with pytest.raises(ValueError, match="not of a walk"):
        compare_sensitivity(comparison, walk, made_sensitivity(make_walk(end_s=1.6)))


def test_compared_series_of_a_trial_change_as_central_differences_say():
    """Changes too small for an event, and for a sample to be loaded or not: but for Newton's
    tolerance, exact."""
    trial = load_trial(embedded_trials("exact")[3])
    walker = Walker(trial.subject, trial.model)
    names = {
        "offset.height": 1e-7,
        "contact.forefoot.stiffness": 0.1,
        "friction.mu_static": 1e-6,
        "coordinate.pelvis_tx": 1e-2,
    }

    def walked(values, **options):
        return walker.walk(
            trial.trajectory,
            fulcrum_m=trial.fulcrum_m,
            start_s=trial.start_s,
            end_s=trial.end_s,
            step_s=2e-3,
            values=values,
            **options,
        )

    def compared(walk):
        result = walker.result(walk, trial, GeometricOffsets(), energy=False)
        return result, compare(result, trial.prosthetic_plate)

    at = {
        name: 0.0 if walker.variables[name].added else walker.variables[name].default
        for name in names
    }
    walk = walked({}, with_respect_to=tuple(names))
    result, base = compared(walk)
    by = compare_sensitivity(base, result, walk.sensitivity)
    for i, (name, change) in enumerate(names.items()):
        low, high = (compared(walked({name: at[name] + sign * change}))[1] for sign in (-1.0, 1.0))
        wanted = (high.model - low.model) / (2.0 * change)
        scale = max(np.abs(wanted).max(), 1e-3)
        np.testing.assert_allclose(
            by.model[..., i], wanted, rtol=0.0, atol=1e-3 * scale, err_msg=name
        )
        for cop, a, b in zip(by.cop, low.stances, high.stances, strict=True):
            wanted = (b.model_cop - a.model_cop) / (2.0 * change)
            assert np.isfinite(wanted).any()
            np.testing.assert_allclose(
                cop[..., i], wanted, rtol=0.0, atol=1e-3 * np.nanmax(np.abs(wanted))
            )
