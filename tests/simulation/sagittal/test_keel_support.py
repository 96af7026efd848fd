"""The fulcrum under the keel: where it bears, and what happens on its way over a joint."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.simulation.sagittal.linearise import linearise
from vsf_drake.simulation.sagittal.model import IMAGINARY_STEP, SUPPORT_WIDTH, Smoothing


def turns(model, count, seed):
    return 0.08 * np.random.default_rng(seed).standard_normal((len(model.support.starts), count))


def one_piece(starts, signs, w, position):
    """Height of the point at `position` of the piece under it, the others having no part."""
    j = np.searchsorted(starts, position, side="right") - 1
    angle = np.cumsum(signs * w)
    lengths = np.append(np.diff(starts[:j + 1]), position - starts[j])
    return float(np.sum(lengths * np.sin(angle[:j + 1])))


def test_deflection_is_the_height_of_the_plants_keel_at_the_fulcrum(person, drawn, plant_state):
    walker, model = person
    at, starts, foot, plant = drawn(model, 30, seed=7), model.support.starts, walker.gait.person.foot, walker.gait.plant
    for i in range(30):
        context, _ = plant_state(walker, model, at, i)
        position = at.p[0, i]
        keel = foot.keel_body_at(position)
        point = plant.CalcPointsPositions(context, foot.keel[keel].body_frame(), [position - starts[keel], 0.0, 0.0],
                                          foot.frame.body_frame())
        found = model.support.deflection(at.w[3:, i], position)[0]
        far = np.abs(position - starts[1:]).min() > SUPPORT_WIDTH
        near = 0.09 * SUPPORT_WIDTH * np.abs(at.w[3:, i]).max()
        assert found == pytest.approx(point[2, 0], abs=1e-15 if far else near)


def test_near_a_joint_deflection_is_off_by_at_most_its_turn_times_a_share_of_the_width(person):
    """The piece on the other side would bear at a distance e from the joint with the share 1 - blend(e / width)."""
    _, model = person
    s = np.linspace(0.0, 1.0, 10001)
    t = 0.5 * (s + 1.0)
    most = np.max(s * (1.0 - t * t * (3.0 - 2.0 * t))) * SUPPORT_WIDTH
    assert most == pytest.approx(0.087 * SUPPORT_WIDTH, rel=1e-2)
    w, support = turns(model, 1, seed=8), model.support
    for j, start in enumerate(support.starts[1:], start=1):
        e = np.linspace(-1.2, 1.2, 481) * SUPPORT_WIDTH
        found = support.deflection(np.repeat(w, len(e), 1), start + e)[0]
        hard = np.array([one_piece(support.starts, support.signs, w[:, 0], start + x) for x in e])
        error = np.abs(found - hard)
        before, after = np.cumsum(support.signs * w[:, 0])[[j - 1, j]]
        assert error.max() == pytest.approx(most * abs(np.sin(after) - np.sin(before)), rel=1e-3)
        assert error.max() <= most * abs(w[j, 0])
        np.testing.assert_allclose(error[np.abs(e) > SUPPORT_WIDTH], 0.0, atol=1e-16)
        assert error[240] < 1e-16


def test_everything_has_one_derivative_by_the_fulcrum_at_and_around_a_joint(person, drawn):
    """Two instants d = 2e-9 m apart see the same derivatives, but for d / width of the largest of the keel's joints."""
    _, model = person
    at = drawn(model, 10, seed=9)
    keel = [name.startswith("balance_keel") for name in model.outputs]
    by_fulcrum = 3 * 8 + 2 * 12
    for start in model.support.starts[3:6]:
        for edge in (-SUPPORT_WIDTH, 0.0, SUPPORT_WIDTH):
            by = []
            for side in (-1e-9, 1e-9):
                at.p[0] = start + edge + side
                by.append(linearise(model, *at.all, Smoothing())[1][:, by_fulcrum])
            largest = np.abs(by[0]).max(axis=1) + 1e-9
            largest[keel] = largest[keel].max()
            assert (np.abs(by[1] - by[0]).max(axis=1) / largest).max() < 10.0 * 2e-9 / SUPPORT_WIDTH


def test_support_bends_the_keel_and_moves_nothing_else(person, drawn):
    """A pair of forces at one place on foot and keel: no other joint feels it."""
    _, model = person
    at = drawn(model, 10, seed=10)
    with_support = model.evaluate(*at.all, Smoothing())
    support, model.support.stiffness = model.support.stiffness, 0.0
    try:
        without = model.evaluate(*at.all, Smoothing())
    finally:
        model.support.stiffness = support
    changed = np.abs(with_support - without).max(axis=1) > 1e-9
    names = {name for name, is_changed in zip(model.outputs, changed, strict=True) if is_changed}
    assert names <= {f"balance_{name}" for name in model.quasi_static[3:]} | {"stored_energy"}
    assert "balance_keel_pin" in names


def test_support_gives_back_what_is_stored_in_it(person):
    """Its load on the keel's joints is the slope of its energy; its damping takes rate squared."""
    _, model = person
    w = turns(model, 20, seed=11)
    u, position = turns(model, 20, seed=12), np.linspace(0.066, 0.151, 20)
    support = model.support
    elastic = support.load(w, 0.0 * u, position)[0]
    for i in range(len(w)):
        step = np.zeros_like(w, dtype=complex)
        step[i] = 1j * IMAGINARY_STEP
        slope = support.load(w + step, u, position)[1].imag / IMAGINARY_STEP
        np.testing.assert_allclose(elastic[i], slope, atol=1e-12 * np.abs(elastic).max())
    rate = (support.deflection(w + 1e-7 * u, position)[0] - support.deflection(w - 1e-7 * u, position)[0]) / 2e-7
    lost = ((support.load(w, u, position)[0] - elastic) * u).sum(axis=0)
    np.testing.assert_allclose(lost, support.damping * rate**2, rtol=1e-6, atol=1e-9)
