"""A variable does what changing the thing it names does; what has no meaning is refused; nothing is left behind."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from vsf_drake.errors import InputError
from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.simulation.mechanism import edited, gait_mechanism
from vsf_drake.simulation.stepping.assembly import SPRING_COLUMNS
from vsf_drake.simulation.variables import OFFSETS, SOCKET_AXES, gait_variables
from vsf_drake.simulation.walk import Walker

SUBJECT = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="right")
FULCRUM_M = 0.108
SPAN = {"start_s": 0.1, "end_s": 0.4, "step_s": 2e-3}
"""Touch-down and the first half of stance."""
LAW = ("stiffness", "exponent", "damping", "full_damping_depth")


def walked(walker, motion, **options):
    return walker.walk(motion("right"), **({"fulcrum_m": FULCRUM_M} | SPAN | options))


def assert_same_walk(found, wanted, tolerance=0.0):
    for name in ("q", "v", "load", "sites"):
        a, b = getattr(found.record, name), getattr(wanted.record, name)
        np.testing.assert_allclose(a, b, rtol=0.0, atol=tolerance * np.abs(b).max(), err_msg=name)
    assert found.prosthetic.grf_W[:, 2].max() > 100.0


@contextmanager
def parameter(system, context, name, change):
    """The system's parameter in the diagram's `context`, changed by a function for a while."""
    own = system.GetMyContextFromRoot(context)
    before = system.GetParameter(own, name)
    system.SetParameters(own, **{name: change(before.copy())})
    try:
        yield
    finally:
        system.SetParameters(own, **{name: before})


def zone_rows(gait, zone):
    sites = gait.person.foot.sites
    return np.flatnonzero(sites.zone == sites.zone_names.index(zone))


def put(rows, value):
    def change(array):
        array[rows] = value
        return array

    return change


@pytest.mark.parametrize("name", LAW)
@pytest.mark.parametrize("zone", ["forefoot", "heel"])
def test_contact_variable_is_that_parameter_of_the_zones_spheres_in_the_systems_context(walker, motion, zone, name):
    person = walker("right")
    variable = person.variables[f"contact.{zone}.{name}"]
    value = 1.1 * variable.default
    found = walked(person, motion, values={variable.name: value})
    rows = zone_rows(person.gait, zone)
    with parameter(person.gait.forces["prosthetic"], person.context, name, put(rows, value)):
        wanted = walked(person, motion)
    assert_same_walk(found, wanted)
    assert np.abs(found.record.q - walked(person, motion).record.q).max() > 0.0


@pytest.mark.parametrize("name", ["mu_static", "mu_kinetic", "threshold_velocity"])
def test_friction_variable_is_that_parameter_of_the_prosthetic_foots_friction(walker, motion, name):
    person = walker("right")
    value = 0.7 * person.variables[f"friction.{name}"].default
    found = walked(person, motion, values={f"friction.{name}": value})
    with parameter(person.gait.forces["prosthetic"], person.context, name, lambda _: value):
        wanted = walked(person, motion)
    assert_same_walk(found, wanted)


def test_intact_foot_keeps_its_contact_and_friction(walker):
    person = walker("right")
    mechanism = gait_mechanism(person.gait, person.context)
    count = len(person.gait.person.foot.sites.radius)
    values = {name: 1.2 * variable.default + 1e-3 for name, variable in person.variables.items()
              if name.startswith(("contact", "friction"))}
    changed = edited(mechanism, person.variables, values).sites
    np.testing.assert_array_equal(changed[count:], mechanism.sites[count:])
    assert np.all(np.any(changed[:count] != mechanism.sites[:count], axis=1))


def test_rise_is_another_height_of_the_zones_spheres_in_the_model(walker, motion):
    model = ModelParameters()
    zones = [replace(zone, rise_mm=tuple(value + 2.0 for value in zone.rise_mm)) if zone.name == "forefoot" else zone
             for zone in model.foot.zones]
    other = Walker(SUBJECT, replace(model, foot=replace(model.foot, zones=tuple(zones))))
    found = walked(walker("right"), motion, values={"contact.forefoot.rise": 2e-3})
    assert_same_walk(found, walked(other, motion), 1e-9)


@pytest.fixture(scope="module")
def default():
    """A person with the default model, built here so that a test may build another one beside it."""
    return Walker(SUBJECT, ModelParameters())


def with_foot(**changes):
    model = ModelParameters()
    return Walker(SUBJECT, replace(model, foot=replace(model.foot, **changes)))


def test_modulus_is_that_of_a_keel_built_with_it(default, motion):
    keel = ModelParameters().foot.keel
    other = with_foot(keel=replace(keel, flexural_modulus_pa=12e9))
    assert_same_walk(walked(default, motion, values={"keel.flexural_modulus": 12e9}), walked(other, motion), 1e-9)


def test_fulcrum_stiffness_is_that_of_a_support_built_with_it(default, motion):
    """Its damping comes with it, as it does in the model: a time constant."""
    fulcrum = ModelParameters().foot.fulcrum
    other = with_foot(fulcrum=replace(fulcrum, stiffness_n_per_m=5e4))
    assert_same_walk(walked(default, motion, values={"fulcrum.stiffness": 5e4}), walked(other, motion), 1e-9)


def test_modulus_leaves_masses_alone(default):
    mechanism = gait_mechanism(default.gait, default.context)
    changed = edited(mechanism, default.variables, {"keel.flexural_modulus": 12e9})
    assert changed.tree is mechanism.tree
    rows = len(default.gait.person.foot.keel_joint_names)
    ratio = 12e9 / ModelParameters().foot.keel.flexural_modulus_pa
    np.testing.assert_allclose(changed.springs[:rows, :3], ratio * mechanism.springs[:rows, :3], rtol=1e-12)
    np.testing.assert_array_equal(changed.springs[:rows, 3:], mechanism.springs[:rows, 3:])
    np.testing.assert_array_equal(changed.springs[rows:], mechanism.springs[rows:])


@pytest.mark.parametrize("axis", SOCKET_AXES)
def test_socket_stiffness_keeps_the_ratio_of_its_signs_and_its_damping(default, motion, axis):
    name, row = f"socket.{axis}.stiffness", SOCKET_AXES.index(axis)
    bushing, value = default.gait.bushing, 1.7 * default.variables[f"socket.{axis}.stiffness"].default
    own = bushing.GetMyContextFromRoot(default.context)
    positive, negative = (bushing.GetParameter(own, key)[row] for key in ("stiffness", "stiffness_negative"))
    found = walked(default, motion, values={name: value})
    with (parameter(bushing, default.context, "stiffness", put(row, value)),
          parameter(bushing, default.context, "stiffness_negative", put(row, value * negative / positive))):
        wanted = walked(default, motion)
    assert_same_walk(found, wanted, 1e-9)


def test_socket_that_pulls_otherwise_than_it_presses_keeps_that_ratio(default):
    """tz of the default is stiffer pushed in than pulled out, or the test would not tell."""
    mechanism = gait_mechanism(default.gait, default.context)
    row = len(mechanism.springs) - 6 + SOCKET_AXES.index("tz")
    columns = [SPRING_COLUMNS.index(name) for name in ("stiffness", "stiffness_negative")]
    before = mechanism.springs[row, columns] * [1.0, 0.25]
    springs = mechanism.springs.copy()
    springs[row, columns] = before
    variables = gait_variables(default.gait, replace(mechanism, springs=springs))
    changed = edited(replace(mechanism, springs=springs), variables, {"socket.tz.stiffness": 3.0 * before[0]})
    np.testing.assert_allclose(changed.springs[row, columns], 3.0 * before, rtol=1e-12)
    np.testing.assert_array_equal(np.delete(changed.springs, row, 0), np.delete(springs, row, 0))
    np.testing.assert_array_equal(changed.springs[row, 2:], springs[row, 2:])


@pytest.mark.parametrize("name", OFFSETS)
def test_offset_is_the_one_of_a_manifest_and_adds_to_it(default, motion, name):
    field = {"height": "height_m", "fore_aft": "fore_aft_m", "alignment": "alignment_rad"}[name]
    found = walked(default, motion, values={f"offset.{name}": 0.004})
    assert_same_walk(found, walked(default, motion, offsets=GeometricOffsets(**{field: 0.004})))
    both = walked(default, motion, values={f"offset.{name}": 0.003}, offsets=GeometricOffsets(**{field: 0.001}))
    assert_same_walk(both, found, 1e-9)


@pytest.mark.parametrize("name", ["pelvis_ty", "hip_flexion_r", "ankle_angle_l"])
def test_coordinate_is_a_shift_of_the_whole_recorded_curve(default, motion, name):
    curve = motion("right")
    values = curve.values.copy()
    values[:, curve.names.index(name)] += 0.005
    shifted = default.walk(CoordinateTrajectory(curve.time_s, values, curve.names), fulcrum_m=FULCRUM_M, **SPAN)
    assert_same_walk(walked(default, motion, values={f"coordinate.{name}": 0.005}), shifted, 1e-6)


def test_every_prescribed_coordinate_is_a_variable_and_no_free_one(default):
    named = [name.removeprefix("coordinate.") for name in default.variables if name.startswith("coordinate.")]
    assert named == list(default.gait.prescribed)
    assert all(default.variables[f"coordinate.{name}"].unit == ("m" if name[-3:-1] == "_t" else "rad")
               for name in named)


def test_shift_of_the_fulcrum_is_another_position_constant_or_moving(default, motion):
    found = walked(default, motion, values={"fulcrum.shift": -0.02})
    assert_same_walk(found, walked(default, motion, fulcrum_m=FULCRUM_M - 0.02), 1e-12)
    moving = walked(default, motion, values={"fulcrum.shift": -0.02}, fulcrum_m=lambda t: 0.1 + 0.05 * t)
    assert_same_walk(moving, walked(default, motion, fulcrum_m=lambda t: 0.08 + 0.05 * t), 1e-12)
    assert moving.fulcrum_m[0] == pytest.approx(0.085)


@pytest.mark.parametrize("shift", [-0.08, 0.08])
def test_shift_out_of_the_carriages_reach_is_refused(default, motion, shift):
    with pytest.raises(InputError, match="out of the carriage's reach") as error:
        walked(default, motion, values={"fulcrum.shift": shift})
    assert f"{1e3 * (FULCRUM_M + shift):g}" in str(error.value) or f"{FULCRUM_M + shift:g}" in str(error.value)


def test_defaults_change_nothing(default, motion):
    values = {name: variable.default for name, variable in default.variables.items()}
    assert_same_walk(walked(default, motion, values=values), walked(default, motion), 1e-9)


def test_values_hold_for_one_walk_only(default, motion):
    before, mechanism = walked(default, motion), gait_mechanism(default.gait, default.context)
    walked(default, motion, values={name: 0.7 * variable.default + 0.002 * variable.added
                                    for name, variable in default.variables.items() if "exponent" not in name})
    assert_same_walk(walked(default, motion), before)
    after = gait_mechanism(default.gait, default.context)
    for name in ("sites", "springs", "fulcrum"):
        np.testing.assert_array_equal(getattr(after, name), getattr(mechanism, name))


def test_values_that_fail_do_not_stay_either(default, motion):
    before = walked(default, motion)
    with pytest.raises(InputError):
        walked(default, motion, values={"contact.forefoot.stiffness": 1.0, "offset.height": 0.01, "no.such": 1.0})
    with pytest.raises(InputError):
        walked(default, motion, values={"offset.height": 0.01, "fulcrum.shift": 1.0})
    assert_same_walk(walked(default, motion), before)


def test_what_the_caller_passed_is_left_alone(default, motion):
    values = {"contact.forefoot.stiffness": 5e3}
    walked(default, motion, values=values)
    assert values == {"contact.forefoot.stiffness": 5e3}


@pytest.mark.parametrize(("name", "near"), [
    ("contact.forfoot.stiffness", "contact.forefoot.stiffness"), ("keel.flexural_modulos", "keel.flexural_modulus"),
    ("socket.tz.stifness", "socket.tz.stiffness"), ("fulcrum.shft", "fulcrum.shift")])
def test_unknown_name_is_refused_with_the_nearest_one(default, motion, name, near):
    with pytest.raises(InputError, match=f"no variable '{name}'.*Did you mean {near}") as error:
        walked(default, motion, values={name: 1.0})
    assert error.value.exit_code == 2


def test_name_like_no_other_is_refused_with_a_list(default, motion):
    with pytest.raises(InputError, match=r"no variable 'qqqq'.*There are: contact\."):
        walked(default, motion, values={"qqqq": 1.0})


@pytest.mark.parametrize(("name", "value"), [
    ("contact.forefoot.stiffness", float("nan")), ("contact.forefoot.stiffness", float("inf")),
    ("contact.forefoot.stiffness", -1.0), ("contact.forefoot.stiffness", 0.0), ("contact.forefoot.stiffness", "5000"),
    ("contact.forefoot.stiffness", None), ("contact.forefoot.stiffness", True),
    ("contact.forefoot.stiffness", np.array([1.0, 2.0])), ("contact.forefoot.exponent", 0.9),
    ("contact.forefoot.damping", -1e-9), ("contact.forefoot.full_damping_depth", 0.0),
    ("friction.mu_static", -0.1), ("friction.threshold_velocity", 0.0), ("keel.flexural_modulus", 0.0),
    ("fulcrum.stiffness", -1.0), ("socket.flexion.stiffness", 0.0), ("offset.height", float("nan")),
    ("coordinate.pelvis_ty", float("-inf")), ("fulcrum.shift", float("nan")), ("fulcrum.shift", 1j),
    ("fulcrum.shift", np.complex128(0.01)), ("fulcrum.shift", np.True_)])
def test_value_without_meaning_is_refused_by_name(default, motion, name, value):
    with pytest.raises(InputError, match="is not usable") as error:
        walked(default, motion, values={name: value})
    assert name in str(error.value)
    assert default.variables[name].unit in str(error.value)


@pytest.mark.parametrize("value", [5000, np.float32(5000.0), np.int64(5000), np.float64(5000.0)])
def test_any_kind_of_real_number_will_do(default, motion, value):
    found = walked(default, motion, values={"contact.forefoot.stiffness": value})
    assert_same_walk(found, walked(default, motion, values={"contact.forefoot.stiffness": 5000.0}))


def test_bounds_hold_the_default_and_lie_within_what_has_meaning(default):
    for name, variable in default.variables.items():
        assert variable.name == name
        assert variable.minimum <= variable.low <= variable.default <= variable.high, name
        assert np.isfinite([variable.low, variable.high]).all()
        assert variable.added == (variable.default == 0.0), name
        assert variable.unit
