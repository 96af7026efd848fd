"""Derivatives in closed form, by complex steps and by differences."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.simulation.sagittal.linearise import linearise
from vsf_drake.simulation.sagittal.model import IMAGINARY_STEP, Smoothing

SMOOTHINGS = [Smoothing(depth_m=0.002), Smoothing(depth_m=0.01, friction_velocity_m_per_s=0.5, damping=0.0)]
SIZES = (8, 8, 8, 12, 12, 4)


def stepped(at, steps):
    """The arguments (n, 52, N), each changed by its own of `steps` (52,)."""
    wide = np.repeat(np.concatenate(at.all)[:, None], sum(SIZES), 1).astype(np.result_type(steps))
    every = np.arange(sum(SIZES))
    wide[every, every] += steps[:, None]
    return np.split(wide, np.cumsum(SIZES)[:-1])


@pytest.mark.parametrize("smoothing", SMOOTHINGS)
def test_closed_form_is_that_of_complex_steps(person, drawn, smoothing):
    _, model = person
    at = drawn(model, 40, seed=4)
    values, by = linearise(model, *at.all, smoothing)
    known = model.evaluate(*stepped(at, np.full(sum(SIZES), 1j * IMAGINARY_STEP)), smoothing).imag / IMAGINARY_STEP
    plain = model.evaluate(*at.all, smoothing)
    np.testing.assert_allclose(values, plain, atol=1e-12 * np.abs(plain).max())
    largest = np.abs(known).max(axis=(1, 2), keepdims=True)
    assert (np.abs(by - known) / largest).max() < 1e-12


@pytest.mark.parametrize("smoothing", SMOOTHINGS)
def test_derivatives_are_those_of_central_differences(person, drawn, smoothing):
    """Off by h^2 / 6 of the third derivative, of some 1 / width^2, over smooth corners no narrower than 0.2 mm."""
    _, model = person
    at = drawn(model, 6, seed=5)
    by = linearise(model, *at.all, smoothing)[1]
    h = 1e-6 * np.repeat([1.0, 10.0, 10.0, 0.1, 1.0, 0.1], SIZES)
    more, less = (model.evaluate(*stepped(at, sign * h), smoothing) for sign in (1.0, -1.0))
    known = (more - less) / (2.0 * h[:, None])
    largest = np.abs(known).max(axis=2, keepdims=True) + 1e-3 * np.abs(known).max(axis=(1, 2), keepdims=True)
    assert (np.abs(by - known) / largest).max() < 1e-4


def test_values_do_not_depend_on_how_many_instants_are_asked_for(person, drawn):
    _, model = person
    at = drawn(model, 5, seed=6)
    together, by = linearise(model, *at.all, Smoothing())
    for i in range(5):
        alone = model.evaluate(*(x[:, i] for x in at.all), Smoothing())
        np.testing.assert_allclose(together[:, i], alone, atol=1e-12 * np.abs(alone).max())
        own = linearise(model, *(x[:, i:i + 1] for x in at.all), Smoothing())[1][:, :, 0]
        np.testing.assert_allclose(by[:, :, i], own, atol=1e-12 * np.abs(own).max())
