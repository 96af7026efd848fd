"""Parameters of a fit: bounds, priors, the coordinates of the search, and the variables of a walk
with derivatives."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from vsf_drake.base.errors import InputError
from vsf_drake.fit.parameters import (
    CONSTANT_DEG,
    CURVE_COEFFICIENTS,
    CURVE_DEG,
    REFERENCE_DEPTH_M,
    SLOW_COEFFICIENTS,
    FitParameter,
    FitParameters,
    TrialMap,
    standard_parameters,
)
from vsf_drake.motion.fitted_trial import gait_phase
from vsf_drake.motion.trajectory import periodic_bsplines, window_bsplines

PLAIN = FitParameter(
    name="offset.height", unit="m", start=0.002, low=-0.04, high=0.03, mean=0.001, scale=0.01
)
LOG = FitParameter(
    name="contact.heel.force",
    unit="N",
    start=150.0,
    low=25.0,
    high=1600.0,
    mean=200.0,
    scale=0.5,
    logarithmic=True,
)
FROZEN = replace(PLAIN, name="friction.mu_static", frozen=True, start=0.02)
EVERY = FitParameters([PLAIN, FROZEN, LOG])


@st.composite
def drawn(draw):
    """Any parameter, and a value within its bounds."""
    logarithmic = draw(st.booleans())
    low = draw(st.floats(1e-6, 1e3) if logarithmic else st.floats(-1e3, 1e3))
    high = low + draw(st.floats(1e-6, 1e3))
    assume(high > low * (1 + 1e-12))
    inside = st.floats(low, high)
    return FitParameter(
        name="a",
        unit="m",
        low=low,
        high=high,
        start=draw(inside),
        mean=draw(inside),
        scale=draw(st.floats(1e-3, 1e3)),
        logarithmic=logarithmic,
    ), draw(inside)


@given(drawn(), st.floats(-1e3, 1e3))
def test_search_coordinate_and_value_are_each_others_inverse_within_the_bounds(case, u):
    item, value = case
    assert item.from_u(item.to_u(value)) == pytest.approx(value, rel=1e-9, abs=1e-9 * item.scale)
    assert item.to_u(item.mean) == 0.0
    if not item.logarithmic or abs(u) * item.scale < 700.0:
        assert item.low <= item.from_u(u) <= item.high


@pytest.mark.parametrize("item", [PLAIN, LOG], ids=lambda item: item.name)
def test_a_step_of_one_is_a_standard_deviation_of_the_prior(item):
    one = item.from_u(1.0)
    assert (math.log(one / item.mean) if item.logarithmic else one - item.mean) == pytest.approx(
        item.scale
    )
    for u in (-0.7, 0.0, 0.4):
        slope = (item.from_u(u + 1e-5) - item.from_u(u - 1e-5)) / 2e-5
        assert FitParameters([item]).slopes(np.array([u])) == pytest.approx(slope, rel=1e-8)


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"low": 0.03, "high": 0.03}, "bounds 0.03 to 0.03 m cross"),
        ({"mean": -1.0}, "its mean, -1, lies"),
        ({"start": 0.05}, "its start, 0.05, lies outside its bounds -0.04 to 0.03"),
        ({"scale": 0.0}, "scale is 0"),
        ({"start": math.nan}, "start: nan is not usable"),
        ({"low": True}, "low: True is not usable"),
        ({"low": None}, "low: None is not usable"),
        ({"high": "0.03"}, "high: '0.03' is not usable"),
        ({"logarithmic": True}, "bounds are -0.04"),
    ],
)
def test_what_makes_no_parameter_is_refused_by_name(changes, match):
    with pytest.raises(InputError, match=match) as caught:
        replace(PLAIN, **changes)
    assert caught.value.where.startswith("parameter offset.height")


def test_a_set_holds_each_name_once_and_something_free():
    with pytest.raises(InputError, match=r"offset.height stands twice"):
        FitParameters([PLAIN, LOG, replace(PLAIN, start=0.0)])
    with pytest.raises(InputError, match="all parameters are frozen"):
        EVERY.changed([PLAIN.name, LOG.name], frozen=True)


def test_frozen_parameters_stay_at_their_start_and_have_no_coordinate():
    assert EVERY.names == (PLAIN.name, LOG.name)
    assert len(EVERY) == 2
    u = np.array([0.3, -0.2])
    values = EVERY.values(u)
    assert values == {
        PLAIN.name: pytest.approx(0.004),
        FROZEN.name: FROZEN.start,
        LOG.name: pytest.approx(200.0 * math.exp(-0.1)),
    }
    np.testing.assert_allclose(EVERY.u(values), u)
    np.testing.assert_allclose(EVERY.slopes(u), [0.01, 0.5 * values[LOG.name]])
    assert EVERY.values(EVERY.start)[LOG.name] == pytest.approx(LOG.start)


def test_bounds_in_search_coordinates_are_those_of_the_values():
    low, high = EVERY.bounds
    np.testing.assert_allclose(low, [-4.1, math.log(25 / 200) / 0.5])
    np.testing.assert_allclose(high, [2.9, math.log(1600 / 200) / 0.5])
    np.testing.assert_allclose(
        EVERY.u({PLAIN.name: 1.0, LOG.name: 1.0}), [high[0], low[1]], err_msg="moved to them"
    )
    with pytest.raises(ValueError, match="2 free parameters"):
        EVERY.values(np.zeros(3))


def test_changes_reach_the_named_parameters_and_no_others():
    changed = EVERY.changed([FROZEN.name, LOG.name], frozen=False, prior=False)
    assert changed.by_name[PLAIN.name] is PLAIN and changed.by_name[LOG.name] == replace(
        LOG, prior=False
    )
    assert changed.names == (PLAIN.name, FROZEN.name, LOG.name)
    with pytest.raises(InputError, match=r"no parameter 'offset.hight'.*offset.height"):
        EVERY.changed(["offset.hight"], frozen=True)


ZONES = ("heel_posterior", "heel", "heel_anterior", "midfoot", "forefoot")
LABELS = ("soft", "stiff", "third")


@pytest.fixture(scope="module")
def variables(fit_walker):
    return fit_walker.variables


def everything(variables, **changes):
    """All standard parameters, none of them frozen."""
    found = standard_parameters(variables, "right", LABELS, **{"paths": True, **changes})
    return found.changed([*found.by_name], frozen=False)


def somewhere(parameters, seed=0):
    low, high = parameters.bounds
    return np.clip(
        np.random.default_rng(seed).normal(0.0, 0.3, len(parameters)), 0.9 * low, 0.9 * high
    )


def one(name, value=0.1, **more):
    return FitParameter(
        name=name, unit="m", start=value, low=-10.0, high=10.0, mean=0.0, scale=1.0, **more
    )


@pytest.mark.parametrize("damping_by_zone", [False, True])
@pytest.mark.parametrize("label", ["soft", None])
def test_derivatives_of_every_parameter_are_those_of_differences(
    variables, soft, damping_by_zone, label
):
    parameters = everything(variables, damping_by_zone=damping_by_zone)
    walk = TrialMap(parameters, variables, label, soft)
    u = somewhere(parameters)
    at, step = walk.at(u), 1e-5
    assert set(at.names) <= set(at.values)
    for p, name in enumerate(parameters.names):
        moved = [walk.at(u + sign * step * np.eye(len(u))[p]).values for sign in (-1.0, 1.0)]
        for variable in at.values:
            wanted = (moved[1][variable] - moved[0][variable]) / (2.0 * step)
            exact = at.by[at.names.index(variable), p] if variable in at.names else 0.0
            size = abs(at.values[variable]) or 1.0
            assert exact == pytest.approx(wanted, rel=1e-7, abs=1e-9 * size), (name, variable)


def test_the_start_is_the_models_own_foot_but_for_exponents_that_may_fall(variables):
    """Where the model's law is linear, the start has its force at the depth that counts and
    exponent 1.2."""
    parameters = standard_parameters(variables, "right", ["soft"])
    assert all(item.start == item.mean for item in parameters.items)
    k, n, b = (
        variables[f"contact.forefoot.{name}"].default
        for name in ("stiffness", "exponent", "damping")
    )
    damping_time = parameters.by_name["contact.damping_time"].mean
    assert damping_time == pytest.approx(b / (k * n * REFERENCE_DEPTH_M ** (n - 1.0)))
    values = TrialMap(parameters, variables, "soft", None).at(parameters.start).values
    for zone in ZONES:
        k, n = (values[f"contact.{zone}.{name}"] for name in ("stiffness", "exponent"))
        own = {
            name: variables[f"contact.{zone}.{name}"].default for name in ("stiffness", "exponent")
        }
        assert n == max(own["exponent"], 1.2)
        assert k * REFERENCE_DEPTH_M**n == pytest.approx(
            own["stiffness"] * REFERENCE_DEPTH_M ** own["exponent"]
        )
    of_laws = tuple(
        f"contact.{zone}.{name}" for zone in ZONES for name in ("stiffness", "exponent", "damping")
    )
    others = {
        name: value for name, value in values.items() if name in variables and name not in of_laws
    }
    assert others == pytest.approx({name: variables[name].default for name in others})


def test_keel_and_support_are_sought_only_where_a_bench_tells_them(variables):
    for bench, told in ((False, []), (True, ["fulcrum.stiffness", "keel.flexural_modulus"])):
        free = [
            item.name
            for item in standard_parameters(variables, "right", labels=("one",), bench=bench).free
        ]
        assert sorted(name for name in free if name.startswith(("keel.", "fulcrum."))) == told


@pytest.mark.parametrize("damping_by_zone", [False, True])
def test_law_has_its_force_and_its_damping_at_the_reference_depth(variables, damping_by_zone):
    parameters = everything(variables, damping_by_zone=damping_by_zone)
    u = somewhere(parameters, seed=1)
    values, walk = parameters.values(u), TrialMap(parameters, variables, None, None).at(u).values
    for zone in ZONES:
        k, n, b = (walk[f"contact.{zone}.{name}"] for name in ("stiffness", "exponent", "damping"))
        assert k * REFERENCE_DEPTH_M**n == pytest.approx(values[f"contact.{zone}.force"])
        slope = k * n * REFERENCE_DEPTH_M ** (n - 1.0)
        own = f"contact.{zone}.damping_time" if damping_by_zone else "contact.damping_time"
        assert b == pytest.approx(values[own] * slope)
        assert walk[f"contact.{zone}.rise"] == values[f"contact.{zone}.rise"]


def test_heights_of_trials_are_deviations_from_their_mean(variables, soft):
    parameters = everything(variables)
    own = {"soft": 3e-3, "stiff": -1e-3, "third": 4e-3}
    values = parameters.values(parameters.start) | {
        f"trial.{label}.height": h for label, h in own.items()
    }
    values["offset.height"] = 5e-3
    u = parameters.u(values)
    heights = {
        label: TrialMap(parameters, variables, label, soft).at(u).values["offset.height"]
        for label in own
    }
    assert heights == pytest.approx({"soft": 6e-3, "stiff": 2e-3, "third": 7e-3})
    assert TrialMap(parameters, variables, None, None).at(u).values[
        "offset.height"
    ] == pytest.approx(5e-3)
    raised = u + 0.7 * np.array(
        [name.endswith(".height") and name.startswith("trial") for name in parameters.names]
    )
    for label in own:
        assert TrialMap(parameters, variables, label, soft).at(raised).values[
            "offset.height"
        ] == pytest.approx(heights[label]), "what all heights have in common changes nothing"


def test_curves_are_the_periodic_splines_of_the_trials_own_gait_cycle(variables, soft):
    parameters = everything(variables, paths=False)
    walk = TrialMap(parameters, variables, "soft", soft)
    times = np.linspace(soft.start_s, soft.end_s, 300)
    basis = periodic_bsplines(CURVE_COEFFICIENTS)(gait_phase(soft)(times))
    by_name = {perturbation.name: perturbation for perturbation in walk.perturbations}
    for angle in CURVE_DEG:
        family = [by_name[f"curve.{angle}_r.{i}"] for i in range(CURVE_COEFFICIENTS)]
        assert {perturbation.coordinate for perturbation in family} == {f"{angle}_r"}
        np.testing.assert_allclose(
            np.stack([perturbation.shape(times) for perturbation in family], axis=1),
            basis,
            atol=1e-12,
        )
        np.testing.assert_allclose(sum(perturbation.shape(times) for perturbation in family), 1.0)


def test_paths_and_slow_curves_are_of_the_labelled_trial_alone(variables, soft):
    parameters = everything(variables)
    u = somewhere(parameters, seed=2)
    values, times = parameters.values(u), np.linspace(soft.start_s, soft.end_s, 50)
    walk = TrialMap(parameters, variables, "stiff", soft)
    at = walk.at(u).values
    slow = ("path.", "slow.")
    paths = [
        perturbation for perturbation in walk.perturbations if perturbation.name.startswith(slow)
    ]
    assert sorted({perturbation.coordinate for perturbation in paths}) == [
        "hip_flexion_r",
        "knee_angle_r",
        "pelvis_tx",
        "pelvis_tz",
    ]
    basis = window_bsplines(soft.start_s, soft.end_s, SLOW_COEFFICIENTS)(times)
    for perturbation in paths:
        kind, coordinate, i = perturbation.name.split(".")
        own = f"trial.stiff.{'path' if kind == 'path' else 'curve'}.{coordinate}.{i}"
        assert at[f"perturbation.{perturbation.name}"] == values[own]
        np.testing.assert_allclose(perturbation.shape(times), basis[:, int(i)], atol=1e-12)
    assert not [
        c
        for c in TrialMap(parameters, variables, None, soft).perturbations
        if c.name.startswith(slow)
    ]
    assert TrialMap(parameters, variables, None, None).perturbations == ()


def test_kinetic_friction_is_a_share_of_static_friction(variables):
    parameters = everything(variables)
    values = parameters.values(parameters.start) | {
        "friction.mu_static": 0.3,
        "friction.kinetic_share": 0.9,
    }
    walk = TrialMap(parameters, variables, None, None).at(parameters.u(values)).values
    assert walk["friction.mu_static"] == pytest.approx(0.3) and walk[
        "friction.mu_kinetic"
    ] == pytest.approx(0.27)
    assert parameters.by_name["friction.kinetic_share"].high == 1.0, (
        "it never exceeds static friction"
    )


def test_names_go_by_side_and_label(variables, soft):
    names = standard_parameters(variables, "left", ["soft"]).by_name
    angles = {name.split(".")[1] for name in names if name.startswith(("coordinate.", "curve."))}
    assert angles == {f"{angle}_l" for angle in CONSTANT_DEG}
    assert not [name for name in names if "trial" in name], "one trial has no height of its own"
    parameters = standard_parameters(variables, "right", ["walk", "walk.2"], paths=True)
    perturbations = TrialMap(parameters, variables, "walk", soft).perturbations
    assert not [perturbation.name for perturbation in perturbations if "2." in perturbation.name]


HEEL = ("contact.heel.force", "contact.heel.exponent")


@pytest.mark.parametrize(
    ("names", "match"),
    [
        (["offset.hight"], "offset.hight is no parameter of a contact fit"),
        (["contact.toe.force"], "is no parameter"),
        (["contact.damping_time"], "has no law"),
        (["friction.kinetic_share"], "is a share of friction.mu_static"),
        (HEEL, "law of contact.heel is told by half"),
        ((*HEEL, "contact.damping_time", "contact.heel.stiffness"), "set the same"),
        (["trial.soft.path.pelvis_tx.99"], "beyond the 6 coefficients"),
        (["curve.knee_angle_r.x"], "not 0, 1, 2"),
        ([f"curve.knee_angle_r.{i}" for i in (0, 1, 2, 4)], "not 0, 1, 2"),
        (["curve.knee_angle_r.0"], "no periodic"),
        (
            [f"curve.{angle}.{i}" for angle, count in (("a", 4), ("b", 5)) for i in range(count)],
            "same number",
        ),
    ],
)
def test_names_that_stand_for_nothing_are_refused(variables, soft, names, match):
    with pytest.raises(InputError, match=match):
        TrialMap(FitParameters(one(name) for name in names), variables, "soft", soft)
