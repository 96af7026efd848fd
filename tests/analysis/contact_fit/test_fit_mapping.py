"""From parameters of a fit to variables of a walk: what each means, and exact derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.analysis.contact_fit.parameters import (
    ANGLES,
    CURVE_COEFFICIENTS,
    PATH_COEFFICIENTS,
    REFERENCE_DEPTH_M,
    FitParameter,
    FitParameters,
    TrialMap,
    curve_coefficients,
    standard_parameters,
)
from vsf_drake.errors import InputError
from vsf_drake.motion.fitted_trial import gait_phase
from vsf_drake.motion.trajectory import periodic_bsplines, window_bsplines

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
    return np.clip(np.random.default_rng(seed).normal(0.0, 0.3, len(parameters)), 0.9 * low, 0.9 * high)


def one(name, value=0.1, **more):
    return FitParameter(name=name, unit="m", start=value, low=-10.0, high=10.0, mean=0.0, scale=1.0, **more)


@pytest.mark.parametrize("damping_by_zone", [False, True])
@pytest.mark.parametrize("label", ["soft", None])
def test_derivatives_of_every_parameter_are_those_of_differences(variables, soft, damping_by_zone, label):
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


def test_names_are_all_variables_of_the_walk_or_courses(variables, soft):
    walk = TrialMap(everything(variables), variables, "soft", soft)
    courses = {f"course.{course.name}" for course in walk.courses}
    assert set(walk.at(somewhere(walk.parameters)).values) <= set(variables) | courses
    assert len(courses) == len(ANGLES) * CURVE_COEFFICIENTS + 2 * PATH_COEFFICIENTS


def test_the_start_is_the_models_own_foot_but_for_exponents_that_may_fall(variables):
    """Where the model's law is linear, the start has its force at the depth that counts and exponent 1.2."""
    parameters = standard_parameters(variables, "right", ["soft"])
    values = TrialMap(parameters, variables, "soft", None).at(parameters.start).values
    for zone in ZONES:
        k, n = (values[f"contact.{zone}.{name}"] for name in ("stiffness", "exponent"))
        own = {name: variables[f"contact.{zone}.{name}"].default for name in ("stiffness", "exponent")}
        assert n == max(own["exponent"], 1.2)
        assert k * REFERENCE_DEPTH_M**n == pytest.approx(own["stiffness"] * REFERENCE_DEPTH_M ** own["exponent"])
    of_laws = tuple(f"contact.{zone}.{name}" for zone in ZONES for name in ("stiffness", "exponent", "damping"))
    others = {name: value for name, value in values.items() if name in variables and name not in of_laws}
    assert others == pytest.approx({name: variables[name].default for name in others})


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


def test_damping_of_one_zone_is_its_own(variables):
    parameters = everything(variables, damping_by_zone=True)
    walk = TrialMap(parameters, variables, None, None)
    before = walk.at(parameters.start).values
    u = parameters.start
    u[parameters.names.index("contact.heel.damping_time")] += 1.0
    changed = {name for name, value in walk.at(u).values.items() if value != before[name]}
    assert changed == {"contact.heel.damping"}


def test_heights_of_trials_are_deviations_from_their_mean(variables, soft):
    parameters = everything(variables)
    own = {"soft": 3e-3, "stiff": -1e-3, "third": 4e-3}
    values = parameters.values(parameters.start) | {f"trial.{label}.height": h for label, h in own.items()}
    values["offset.height"] = 5e-3
    u = parameters.u(values)
    heights = {label: TrialMap(parameters, variables, label, soft).at(u).values["offset.height"] for label in own}
    assert heights == pytest.approx({"soft": 6e-3, "stiff": 2e-3, "third": 7e-3})
    for without in (TrialMap(parameters, variables, None, soft), TrialMap(parameters, variables, None, None)):
        assert without.at(u).values["offset.height"] == pytest.approx(5e-3)
    raised = u + 0.7 * np.array([name.endswith(".height") and name.startswith("trial") for name in parameters.names])
    for label in own:
        assert TrialMap(parameters, variables, label, soft).at(raised).values["offset.height"] == pytest.approx(
            heights[label]), "what all heights have in common changes nothing"


def test_one_trial_has_no_height_of_its_own(variables):
    assert not [name for name in standard_parameters(variables, "right", ["soft"]).by_name if "trial" in name]
    names = standard_parameters(variables, "right", ["soft", "stiff"]).by_name
    assert [name for name in names if "trial" in name] == ["trial.soft.height", "trial.stiff.height"]


def test_curves_are_the_periodic_splines_of_the_trials_own_gait_cycle(variables, soft):
    parameters = everything(variables, paths=False)
    walk = TrialMap(parameters, variables, "soft", soft)
    times = np.linspace(soft.start_s, soft.end_s, 300)
    basis = periodic_bsplines(CURVE_COEFFICIENTS)(gait_phase(soft)(times))
    by_name = {course.name: course for course in walk.courses}
    for angle in ANGLES:
        family = [by_name[f"curve.{angle}_r.{i}"] for i in range(CURVE_COEFFICIENTS)]
        assert {course.coordinate for course in family} == {f"{angle}_r"}
        np.testing.assert_allclose(np.stack([course.shape(times) for course in family], axis=1), basis, atol=1e-12)
        np.testing.assert_allclose(sum(course.shape(times) for course in family), 1.0)


def test_paths_are_of_the_labelled_trial_alone(variables, soft):
    parameters = everything(variables)
    u = somewhere(parameters, seed=2)
    values, times = parameters.values(u), np.linspace(soft.start_s, soft.end_s, 50)
    walk = TrialMap(parameters, variables, "stiff", soft)
    at = walk.at(u).values
    paths = [course for course in walk.courses if course.name.startswith("path.")]
    assert sorted({course.coordinate for course in paths}) == ["pelvis_tx", "pelvis_tz"]
    basis = window_bsplines(soft.start_s, soft.end_s, PATH_COEFFICIENTS)(times)
    for course in paths:
        _, coordinate, i = course.name.split(".")
        assert at[f"course.{course.name}"] == values[f"trial.stiff.path.{coordinate}.{i}"]
        np.testing.assert_allclose(course.shape(times), basis[:, int(i)], atol=1e-12)
    assert not [c for c in TrialMap(parameters, variables, None, soft).courses if c.name.startswith("path.")]
    assert TrialMap(parameters, variables, None, None).courses == ()


def test_the_left_side_has_the_left_angles(variables):
    names = standard_parameters(variables, "left", ["soft"]).by_name
    angles = {name.split(".")[1] for name in names if name.startswith(("coordinate.", "curve."))}
    assert angles == {f"{angle}_l" for angle in ANGLES}


@pytest.mark.parametrize("name", [
    "offset.hight", "contact.toe.force", "contact.heel.colour", "coordinate.knee_angle", "socket.tz", "course.a", "",
    "keel.length", "Contact.heel.force"])
def test_unknown_names_are_refused(variables, soft, name):
    with pytest.raises(InputError, match=f"{name} is no parameter of a contact fit"):
        TrialMap(FitParameters([one(name)]), variables, "soft", soft)


def test_a_law_without_damping_is_refused(variables, soft):
    with pytest.raises(InputError, match="law of zone heel is told by half"):
        TrialMap(FitParameters([one("contact.heel.force"), one("contact.heel.exponent")]), variables, "soft", soft)


@pytest.mark.parametrize("indices", [(0, 1, 2, 4), (1, 2, 3, 4), (0, 1, 1, 2), (0, 1, 2, -1)])
def test_curves_with_missing_coefficients_are_refused(indices):
    names = [f"curve.knee_angle_r.{i}" for i in indices]
    with pytest.raises(InputError, match=r"not 0, 1, 2 \.\.\."):
        curve_coefficients(names)
    assert curve_coefficients([f"curve.knee_angle_r.{i}" for i in (2, 0, 3, 1)]) == 4


def test_curves_of_different_lengths_are_refused():
    names = [f"curve.{angle}.{i}" for angle, count in (("a", 4), ("b", 5)) for i in range(count)]
    with pytest.raises(InputError, match="up to the same number"):
        curve_coefficients(names)


@pytest.mark.parametrize("names", [
    ["contact"], ["contact.damping_time"], ["curve.knee_angle_r"], ["curve.knee_angle_r.0"], ["curve.knee_angle_r.x"],
    ["trial.soft.colour"], ["trial.soft.path.pelvis_tx"], ["trial.soft.path.pelvis_tx.99"],
    ["contact.heel.force", "contact.heel.exponent", "contact.damping_time", "contact.heel.stiffness"]])
def test_names_in_the_wrong_form_are_refused(variables, soft, names):
    parameters = FitParameters(one(name) for name in names)
    with pytest.raises(InputError):
        walk = TrialMap(parameters, variables, "soft", soft)
        walk.at(parameters.start)
        [course.shape(np.linspace(0.0, 1.0, 9)) for course in walk.courses]


def test_paths_of_a_trial_whose_name_goes_on_are_not_taken(variables, soft):
    parameters = standard_parameters(variables, "right", ["walk", "walk.2"], paths=True)
    walk = TrialMap(parameters, variables, "walk", soft)
    assert not [course.name for course in walk.courses if "2." in course.name]
