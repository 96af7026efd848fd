"""What joints can do, against the definitions of the constants that the source gives, and what energy it takes."""

import numpy as np
import pytest

from vsf_drake.laws.joint_strength import ACTIVE, LEAST_BY_ANGLE, LEAST_BY_RATE, Muscles, strength

EVERY = [
    constants
    for joints in ACTIVE.values()
    for directions in joints.values()
    for constants in directions
]


@pytest.mark.parametrize("constants", EVERY)
def test_three_quarters_and_half_of_the_strength_are_left_at_the_velocities_that_the_source_defines(
    constants,
):
    c1, _, c3, c4, c5, _ = constants
    assert strength(constants, np.array(c3), np.array([c4, c5])) / c1 == pytest.approx([0.75, 0.5])


@pytest.mark.parametrize("constants", EVERY)
def test_strength_is_largest_at_its_angle_and_never_vanishes(constants):
    angles = np.linspace(-1.5, 3.0, 451)
    still = strength(constants, angles, np.zeros(451))
    assert abs(angles[np.argmax(still)] - constants[2]) < 0.011
    assert still.min() >= 0.94 * constants[0] * LEAST_BY_ANGLE  # less the rounding at rest
    assert strength(constants, angles[:, None], np.linspace(-20.0, 20.0, 81)).min() >= (
        constants[0] * LEAST_BY_ANGLE * LEAST_BY_RATE
    )


def test_lengthening_changes_strength_by_the_eccentric_factor_of_the_source():
    _, _, c3, *_, c6 = constants = ACTIVE["male"]["knee"][1]
    there, back = strength(constants, np.array(c3), np.array([-2.0, 2.0]))
    assert there / back == pytest.approx(1.0 + 2.0 * c6)


def test_passive_tissue_bends_a_straight_knee_and_stops_a_hip_at_both_ends():
    straight, extended, bent = (
        Muscles(("knee", "hip"), "male", 1.0)
        .passive_torque(np.radians([[0.0, 0.0, 0.0], [0.0, -20.0, 40.0]]))
        .T
    )
    assert straight[0] == pytest.approx(6.25)
    assert extended[1] > 5.0 and bent[1] < -5.0


def test_a_torque_as_large_as_the_strength_in_its_direction_and_the_passive_one_is_an_activation_of_one():
    scale, q, v = 1400.0, np.array([[0.2, 0.2]]), np.array([[1.0, -1.5]])
    extension, flexion = ACTIVE["female"]["ankle"]
    largest = scale * np.array(
        [[strength(flexion, q[0, 0], v[0, 0]), -strength(extension, q[0, 1], -v[0, 1])]]
    )
    muscles = Muscles(("ankle",), "female", scale)
    assert muscles.activation(largest + muscles.passive_torque(q), q, v) == pytest.approx(
        np.array([[1.0, -1.0]])
    )


@pytest.mark.parametrize("sex", ACTIVE)
def test_a_muscle_that_holds_needs_a_share_of_its_torque_at_its_largest_rate(sex):
    """0.054 of activation, isometric torque and the rate where the source's strength by rate is zero."""
    scale, constants = (
        1400.0,
        np.array(list(ACTIVE[sex].values())).transpose(2, 0, 1),
    )  # by joint and direction
    c1, _, c3, c4, c5, _ = constants
    rate = np.abs(
        [
            [np.roots([b - 3.0 * a, 2.0 * a * b])[0] for a, b in zip(*way, strict=True)]
            for way in zip(c4, c5, strict=True)
        ]
    )
    power = Muscles(tuple(ACTIVE[sex]), sex, scale).metabolic_power(
        np.array([[-0.3, 0.3]] * 3), c3, np.zeros((3, 2))
    )
    assert power == pytest.approx(0.054 * 0.3 * c1 * scale * rate, rel=2e-3)


@pytest.mark.parametrize(
    ("sex", "joint", "way"),
    [(sex, joint, way) for sex in ACTIVE for joint in ACTIVE[sex] for way in (-1.0, 1.0)],
)
def test_shortening_takes_more_than_its_work_and_lengthening_less_than_holding(sex, joint, way):
    """Where walking goes, to three quarters of the largest rate; phi at a tenth of it either way is in the ratios."""
    constants = ACTIVE[sex][joint][int(way > 0.0)]
    _, _, c3, c4, c5, _ = constants
    shortening, angle = (
        abs(2.0 * c4 * c5 / (c5 - 3.0 * c4)) * np.linspace(-1.0, 0.75, 36),
        np.full((1, 36), c3),
    )
    power = Muscles((joint,), sex, 1.0).metabolic_power(
        np.full((1, 36), way), angle, way * shortening[None]
    )[0]
    assert np.all(
        power > np.maximum(strength(constants, angle, shortening[None])[0] * shortening, 0.0)
    )
    longer, still, shorter = power[[18, 20, 22]]
    assert longer / still == pytest.approx(
        0.0280 / 1.24264 / 0.054
    ) and shorter / still == pytest.approx(0.1292 / 1.01336 / 0.054)


def test_what_passive_tissue_bears_takes_no_energy():
    muscles, q, v = (
        Muscles(("hip", "ankle"), "male", 1400.0),
        np.array([[-0.4, 0.9], [0.3, -0.5]]),
        np.ones((2, 2)),
    )
    assert np.abs(muscles.passive_torque(q)).min() > 1e-3
    assert muscles.metabolic_power(
        muscles.activation(muscles.passive_torque(q), q, v), q, v
    ) == pytest.approx(0.0)


@pytest.mark.parametrize("torque", [30.0, 1.0, -40.0])
def test_a_complex_step_differentiates_an_activation(torque):
    """At 1 N m the joint is between the strengths of both directions."""
    muscles, at = Muscles(("hip",), "male", 1400.0), (torque, 0.4, 0.3)
    for k in range(3):
        ahead, behind, step = (
            muscles.activation(*(np.array([[x + d * (i == k)]]) for i, x in enumerate(at)))
            for d in (1e-6, -1e-6, 1e-20j)
        )
        assert step.imag / 1e-20 == pytest.approx((ahead - behind) / 2e-6, rel=1e-5)
