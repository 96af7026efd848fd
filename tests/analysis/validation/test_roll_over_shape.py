"""Arcs, effective lengths and moment arms of shapes whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.analysis.validation.roll_over_section import fit_arc, mean_moment_arm, shape_numbers


def arc(radius, centre=(0.02, 0.2), start=-0.25, end=0.5, n=60):
    angle = np.linspace(start, end, n)
    return np.column_stack([centre[0] + radius * np.sin(angle), centre[1] - radius * np.cos(angle)])


@pytest.mark.parametrize("radius", [0.05, 0.3, 0.9])
def test_arc_of_a_circle_has_its_radius_and_centre(radius):
    found = fit_arc(arc(radius))
    assert found.radius_m == pytest.approx(radius, rel=1e-9)
    np.testing.assert_allclose(found.centre_m, (0.02, 0.2), atol=1e-9)
    assert found.rms_m < 1e-12


def test_radius_does_not_depend_on_where_the_arc_lies_and_how_it_is_turned():
    points = arc(0.3) + 1e-3 * np.random.default_rng(1).normal(size=(60, 2))
    turned = points @ np.array([[0.0, 1.0], [-1.0, 0.0]]) + [1.5, -0.7]
    assert fit_arc(turned).radius_m == pytest.approx(fit_arc(points).radius_m, rel=1e-9)


def test_fit_is_the_least_sum_of_squared_distances():
    """No circle nearby is nearer to a noisy arc; checked by moving each of its three numbers both ways."""
    points = arc(0.3) + 2e-3 * np.random.default_rng(2).normal(size=(60, 2))
    found = fit_arc(points)

    def cost(x, z, r):
        return np.sum((np.linalg.norm(points - [x, z], axis=1) - r) ** 2)

    best = np.array([*found.centre_m, found.radius_m])
    for step in 1e-4 * np.vstack([np.eye(3), -np.eye(3)]):
        assert cost(*(best + step)) > cost(*best)
    assert found.rms_m == pytest.approx(np.sqrt(cost(*best) / 60))


@pytest.mark.parametrize("points", [
    np.column_stack([np.linspace(0, 0.2, 30), np.full(30, -0.08)]), np.full((30, 2), np.nan), np.zeros((30, 2)),
    arc(0.3)[:3]])
def test_a_straight_line_a_point_or_nothing_has_no_radius(points):
    assert fit_arc(points) is None


def test_dwelling_of_the_load_does_not_change_the_arc():
    """The same shape, no circle, a quarter of the samples in its first tenth."""
    slow = np.concatenate([np.linspace(-0.25, -0.175, 75), np.linspace(-0.174, 0.5, 200)])
    shape = np.column_stack([0.3 * np.sin(slow), -0.3 * np.cos(slow) ** 2])
    even = np.linspace(-0.25, 0.5, 400)
    same = np.column_stack([0.3 * np.sin(even), -0.3 * np.cos(even) ** 2])
    radius, wanted = (shape_numbers(points, heel_m=0.0, foot_length_m=0.245)["radius_m"] for points in (shape, same))
    assert radius == pytest.approx(wanted, rel=1e-3)


def test_effective_length_runs_from_the_heel_to_the_front_end():
    points = np.vstack([[np.nan, np.nan], arc(0.3, centre=(0.0, 0.2))])
    numbers = shape_numbers(points, heel_m=-0.055, foot_length_m=0.245)
    length = 0.055 + 0.3 * np.sin(0.5)
    assert numbers["effective_foot_length_m"] == pytest.approx(length)
    assert numbers["effective_foot_length_ratio"] == pytest.approx(length / 0.245)
    assert numbers["radius_m"] == pytest.approx(0.3, rel=1e-3)


def test_unknown_shape_has_no_numbers():
    assert set(shape_numbers(np.full((101, 2), np.nan), heel_m=0.0, foot_length_m=0.245).values()) == {None}


def test_mean_arm_of_a_load_at_one_place_is_that_place_whatever_its_course():
    time = np.linspace(0.0, 0.7, 300)
    force = 700.0 * np.sin(np.pi * time / 0.7) ** 2
    assert mean_moment_arm(time, 0.06 * force, force) == pytest.approx(0.06)


def test_mean_arm_weighs_by_force_and_leaves_out_what_is_unknown():
    """Half of the impulse at 20 mm, half at 60 mm: 40 mm; instants without a centre of pressure do not count."""
    time = np.linspace(0.0, 1.0, 1001)
    force = np.full(1001, 100.0)
    arm = np.where(time < 0.5, 0.02, 0.06)
    assert mean_moment_arm(time, arm * force, force) == pytest.approx(0.04, abs=1e-4)
    moment = np.where(time < 0.5, np.nan, arm * force)
    assert mean_moment_arm(time, moment, force) == pytest.approx(0.06, abs=1e-4)
    assert mean_moment_arm(time, np.full(1001, np.nan), force) is None
