"""Feet without mass in the sagittal plane: the full one against the bench's keel, and against the
stepper, which gives it its mass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vsf_drake.device.roll_over import energy_taken, iso_22675
from vsf_drake.engines.sagittal_foot import at_rest, balance, of_full, rolled, without_motion
from vsf_drake.laws.contact_law import LawConstants
from vsf_drake.model.parameters import GRAVITY, FootParameters
from vsf_drake.simulation.bench import PUBLISHED_FULCRUMS_M, keel_shape
from vsf_drake.simulation.roll_over import RollOver

NOMINAL = FootParameters()
SOFT = replace(NOMINAL, fulcrum=replace(NOMINAL.fulcrum, stiffness_n_per_m=1e5))


@pytest.mark.parametrize("foot", [NOMINAL, SOFT], ids=["nominal", "soft support"])
def test_pressed_on_its_load_point_the_keel_takes_the_shape_that_it_has_on_the_bench(foot):
    fulcrums = np.array(PUBLISHED_FULCRUMS_M)
    one = np.ones((len(fulcrums), 1))
    keel = of_full(foot, fulcrums)
    piece = np.array([np.sum(keel.starts[0] <= foot.load_point_m) - 1])
    pressed = replace(
        keel,
        piece=piece,
        x=foot.load_point_m * one,
        z=0.0 * one,
        radius=np.zeros(1),
        law=LawConstants(*(np.full(1, value) for value in LawConstants(stiffness=1e5))),
    )
    rest = at_rest(pressed, pitch_rad=0.0 * fulcrums, load_n=np.full(len(fulcrums), 400.0))
    for fulcrum, angles in zip(fulcrums, rest.q, strict=True):
        shape = keel_shape(foot, fulcrum_m=fulcrum, load_n=400.0)
        np.testing.assert_allclose(angles, shape.angles, atol=1e-8)


def test_the_slopes_of_the_moments_are_their_differences():
    """By the angles at rest: what rates do to a lever that turns is left out."""
    rng = np.random.default_rng(5)
    feet = of_full(SOFT, np.array([0.075, 0.14]))
    q = rng.uniform(-0.05, 0.05, feet.starts.shape)
    rate = rng.uniform(-1.0, 1.0, q.shape)
    mount = np.array([[0.0, 0.075, -0.1], [0.0, 0.08, 0.1]])
    mount_rate = np.array([[0.1, -0.2, 0.3], [0.2, -0.3, -0.4]])
    resting = without_motion(feet, q, mount)
    moving = balance(feet, q, rate, mount, mount_rate)
    assert (resting.force > 100.0).all()
    assert (moving.loss > 10.0).all()
    for j, step in enumerate(1e-7 * np.eye(q.shape[1])):
        by_angle = (
            without_motion(feet, q + step, mount).moment
            - without_motion(feet, q - step, mount).moment
        )
        by_rate = (
            balance(feet, q, rate + step, mount, mount_rate).moment
            - balance(feet, q, rate - step, mount, mount_rate).moment
        )
        for slope, change in ((resting.by_angle, by_angle), (moving.by_rate, by_rate)):
            np.testing.assert_allclose(
                slope[:, :, j], change / 2e-7, atol=1e-6 * np.abs(slope).max()
            )


def test_the_work_of_the_load_is_the_energy_that_is_stored():
    loads = np.array([399.5, 400.5])
    feet = of_full(NOMINAL, np.full(2, 0.108))
    rest = at_rest(feet, pitch_rad=np.full(2, -0.4), load_n=loads)
    work = 400.0 * (rest.mount[0, 1] - rest.mount[1, 1])
    assert rest.at.strain[1] - rest.at.strain[0] == pytest.approx(work, rel=1e-6)
    np.testing.assert_allclose(rest.at.force, loads, rtol=1e-9)
    np.testing.assert_allclose(without_motion(feet, rest.q, rest.mount).moment, 0.0, atol=1e-6)


def test_rolled_over_the_full_foot_does_without_its_mass_what_the_stepper_does_with_it():
    """Within 1.2 % of the peak everywhere: the mass of the keel is a few ten grams. Roots of the
    mean squares: 0.1 %, and 0.5 % of the energy."""
    load = iso_22675()
    run, _ = RollOver(NOMINAL, friction=False).roll(
        fulcrum_m=0.108,
        time_s=load.time_s,
        tilt_rad=load.tilt_rad,
        force_n=75.0 * GRAVITY * load.force_bw,
    )
    mount = np.concatenate([2.0 * run.mount[:1] - run.mount[1:2], run.mount])
    roll = rolled(of_full(NOMINAL, np.array([0.108])), load.time_s, mount[:, None])
    force = run.grf_W[:, 2]
    off = (roll.force_n[:, 0] - force) / force.max()
    assert np.abs(off).max() < 0.012
    assert np.sqrt(np.mean(off**2)) < 1e-3
    strain, taken = energy_taken(run)
    np.testing.assert_allclose(roll.strain_j[:, 0], strain, atol=5e-3 * strain.max())
    np.testing.assert_allclose(roll.taken_j[:, 0], taken, atol=5e-3 * taken.max())
