"""Contact files: what is read is what was written, and nothing else is taken for a fitted
contact."""

from __future__ import annotations

import dataclasses
import math

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from made_contact import (
    CURVE,
    MOMENTUM,
    OF_THE_MODEL,
    OF_THE_TRIAL,
    OWN,
    PERSON_CURVE,
    made_contact,
)

from vsf_drake.base.errors import UNPRINTABLE, InputError
from vsf_drake.base.schema import to_plain
from vsf_drake.model.contact_file import (
    check_contact,
    fitted_model,
    load_contact,
    model_with,
    save_contact,
    variable_unit,
)
from vsf_drake.model.model_file import in_shell
from vsf_drake.model.parameters import BushingAxis, ModelParameters, Subject
from vsf_drake.simulation.walk import Walker

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
WORDS = st.text(max_size=30).filter(lambda text: not UNPRINTABLE.search(text)) | st.sampled_from(
    ["two\nlines", "", "height_m: 3", "a: b # c", "null", "1.0", "\u2028", "trials:\n- name: x"]
)


@settings(max_examples=30)
@given(numbers=st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4), value=NUMBERS, words=WORDS)
def test_every_digit_and_every_letter_comes_back(tmp_path_factory, numbers, value, words):
    path = tmp_path_factory.getbasetemp() / "contact.yaml"
    trial = dataclasses.replace(OWN, name=words, path={"pelvis_tx": tuple(numbers)})
    contact = made_contact(
        values={"fulcrum.stiffness": value},
        trials=(trial,),
        verdict=(words, "b"),
        strategy=words,
        provenance={words: words, "number": value},
    )
    save_contact(contact, path)
    assert load_contact(path) == contact


def test_every_physical_number_has_its_unit_behind_it(tmp_path):
    save_contact(made_contact(), tmp_path / "contact.yaml")
    lines = (tmp_path / "contact.yaml").read_text(encoding="utf-8").splitlines()
    unit = {
        line.split(":")[0].strip(" -"): line.split("# ")[1] for line in lines if "# " in line[1:]
    }
    assert unit["mass_kg"] == "kg" and unit["height_m"] == "m" and unit["pelvis_tx"] == "m"
    assert (
        unit["contact.forefoot.stiffness"] == "N/m^exponent"
        and unit["contact.forefoot.exponent"] == "1"
    )
    assert unit["socket.tz.stiffness"] == "N/m" and unit["socket.flexion.stiffness"] == "N m/rad"
    assert unit["coordinate.hip_flexion_r"] == "rad" and unit["coordinate.pelvis_ty"] == "m"
    assert set(made_contact().values) <= set(unit)


def test_a_fit_that_did_not_converge_is_written_as_such_and_not_read_as_one_that_did(tmp_path):
    failed = made_contact(converged=False)
    save_contact(failed, tmp_path / "contact.yaml")
    assert (
        "NOT TO BE USED" in (tmp_path / "contact.yaml").read_text(encoding="utf-8").splitlines()[0]
    )
    with pytest.raises(InputError, match=r"contact\.yaml: converged: this fit did not converge"):
        load_contact(tmp_path / "contact.yaml")
    assert load_contact(tmp_path / "contact.yaml", even_if_failed=True) == failed


def test_what_the_plates_taught_comes_back_with_its_units_and_need_not_be_there(tmp_path):
    path, taught = (
        tmp_path / "contact.yaml",
        made_contact(momentum=MOMENTUM, person_curve=PERSON_CURVE),
    )
    save_contact(taught, path)
    assert load_contact(path) == taught
    lines = path.read_text(encoding="utf-8").splitlines()
    assert all(
        line.endswith("# BW")
        for line in lines
        if line.strip(" -").startswith(("vertical_bw:", "model_lateral_bw:"))
    )
    save_contact(made_contact(), path)
    assert load_contact(path).momentum is load_contact(path).person_curve is None


def put(*keys, value):
    def change(plain):
        for key in keys[:-1]:
            plain = plain[key]
        plain[keys[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            put("format", value="vsf_drake contact 2"),
            ["format", "not known", "vsf_drake contact 1"],
        ),
        (
            put("values", "contact.forefoot.stiffness", value=math.nan),
            ["values.contact.forefoot.stiffness", "finite"],
        ),
        (
            put("values", "contact.forefoot.colour", value=1.0),
            ["values.contact.forefoot.colour", "there is no"],
        ),
        (put("values", "coordinate.ankle_angle_r", value=0.1), ["ankle_angle_r", "no coordinate"]),
        (
            put("curves", 0, "coordinate", value="knee"),
            ["curves[0].coordinate", "'knee' is no coordinate"],
        ),
        (
            put("curves", 0, "coefficients", value=[0.1, 0.1, 0.1]),
            ["curves[0].coefficients", "At least 4"],
        ),
        (put("curves", value=[to_plain(CURVE), to_plain(CURVE)]), ["curves[1]", "two curves"]),
        (
            put("trials", 0, "fingerprint", value="low_1"),
            ["trials[0].fingerprint", "64 hexadecimal digits"],
        ),
        (
            put("trials", value=[to_plain(OWN), to_plain(OWN)]),
            ["trials[1].fingerprint", "stands twice"],
        ),
        (
            put("values", "coordinate.hip_flexion_r", value=5.7),
            ["values.coordinate.hip_flexion_r", "between -1 and 1"],
        ),
        (
            put("trials", 0, "path", value={"pelvis_ty": [0.0] * 4}),
            ["trials[0].path", "pelvis_tx, pelvis_tz"],
        ),
        (
            put("trials", 0, "path", "pelvis_tx", value=[0.0, 0.0, -1.5, 0.0]),
            ["path.pelvis_tx[2]", "between -1 and 1"],
        ),
        (lambda plain: plain.pop("provenance"), ["provenance: is missing", "cut short"]),
        (
            put("momentum", "trials", value=["f" * 64]),
            ["momentum.trials[0]", "none of the recordings"],
        ),
        (
            put("momentum", "vertical_bw", value=[0.0, 0.1]),
            ["momentum.vertical_bw", "has 2 numbers", "must have 3"],
        ),
        (
            put("momentum", "fore_aft_bw", value=[0.0, 700.0, 0.0]),
            ["momentum.fore_aft_bw[1]", "between -5 and 5 BW"],
        ),
        (
            put("person_curve", "walks", 0, "fingerprint", value="f" * 64),
            ["walks[0].fingerprint", "none of the record"],
        ),
        (
            put("person_curve", "walks", 0, "lateral_bw", value=[0.0] * 100),
            ["lateral_bw", "has 100 numbers", "have 101"],
        ),
        (
            put("discrepancy", value={"curves": []}),
            ["discrepancy", "third layer of earlier versions", "Fit again, or delete this key"],
        ),
    ],
)
def test_what_is_no_contact_is_refused_with_file_and_key(tmp_path, change, words):
    path, plain = (
        tmp_path / "contact.yaml",
        to_plain(made_contact(momentum=MOMENTUM, person_curve=PERSON_CURVE)),
    )
    change(plain)
    path.write_text(yaml.safe_dump(plain), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_contact(path)
    for word in (str(path), *words):
        assert word in str(caught.value)


def test_what_cannot_be_read_back_is_not_written(tmp_path):
    path = tmp_path / "contact.yaml"
    save_contact(made_contact(), path)
    before = path.read_bytes()
    with pytest.raises(InputError, match=r"values\.fulcrum\.stiffness: nan is not a finite number"):
        save_contact(made_contact(values={"fulcrum.stiffness": math.nan}), path)
    assert path.read_bytes() == before
    with pytest.raises(InputError, match="cannot be written"):
        save_contact(made_contact(), tmp_path / "nowhere" / "contact.yaml")


def test_python_users_meet_the_same_checks():
    left = dataclasses.replace(made_contact().subject, prosthetic_side="left")
    endless = dataclasses.replace(OWN, path={"pelvis_tz": (0.0, math.nan, 0.0, 0.0)})
    for changes, said in (
        ({"values": {"keel.colour": 1.0}}, r"values\.keel\.colour"),
        ({"strategy": "\x1b[31m"}, "unprintable"),
        ({"values": {"fulcrum.stiffness": True}}, "True is not a finite number"),
        (
            {"values": {"contact.heel.rise": 0.0, "fulcrum.stiffness": 2e6}},
            r"keel\.flexural_modulus: is missing",
        ),
        (
            {"subject": left, "values": {"coordinate.ankle_angle_l": 0.1}, "curves": ()},
            "ankle_angle_l",
        ),
        ({"trials": (endless,)}, r"trials\[0\]\.path\.pelvis_tz\[1\]: nan"),
    ):
        with pytest.raises(InputError, match=said):
            check_contact(made_contact(**changes))


def test_units_are_those_of_the_walks_variables():
    person = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="left")
    for name, variable in Walker(person, ModelParameters()).variables.items():
        if name != "fulcrum.shift":
            assert variable_unit(name) == variable.unit, name


# Fitted values in a model, field by field; that the walk is the same is shown in tests/simulation.

MODEL = ModelParameters()
FOOT = MODEL.foot


def zone(model, name):
    return next(zone for zone in model.foot.zones if zone.name == name)


def test_each_value_goes_to_its_field_and_nothing_else_changes():
    fitted = model_with(MODEL, OF_THE_MODEL)
    forefoot = zone(fitted, "forefoot")
    assert (forefoot.stiffness, forefoot.exponent, forefoot.damping_n_s_per_m) == (9e4, 1.4, 150.0)
    assert zone(fitted, "midfoot") == dataclasses.replace(
        zone(MODEL, "midfoot"), full_damping_depth_m=2e-3
    )
    assert zone(fitted, "heel") == dataclasses.replace(zone(MODEL, "heel"), rise_mm=(-1.0,))
    assert zone(fitted, "heel_posterior") == zone(MODEL, "heel_posterior")
    assert vars(fitted.foot.friction) == {
        "mu_static": 0.6,
        "mu_kinetic": 0.4,
        "threshold_velocity_m_per_s": 0.08,
    }
    assert fitted.foot.keel == dataclasses.replace(FOOT.keel, flexural_modulus_pa=17.7e9)
    assert fitted.foot.fulcrum == dataclasses.replace(FOOT.fulcrum, stiffness_n_per_m=150e3)
    axis = fitted.socket.tz
    assert axis == dataclasses.replace(
        MODEL.socket.tz, stiffness=8.3e4, stiffness_negative=axis.stiffness_negative
    )
    assert axis.stiffness_negative == pytest.approx(0.15 * 8.3e4)
    assert fitted.intact_foot == MODEL.intact_foot
    assert (fitted.foot.mass_kg, fitted.foot.load_point_m) == (FOOT.mass_kg, FOOT.load_point_m)
    assert model_with(MODEL, OF_THE_TRIAL) == MODEL, (
        "what belongs to the trial leaves the model alone"
    )


def test_a_rise_is_added_to_that_of_each_sphere():
    uneven = dataclasses.replace(zone(MODEL, "heel_posterior"), rise_mm=(1.0, -2.0))
    model = dataclasses.replace(
        MODEL, foot=dataclasses.replace(FOOT, zones=(uneven, *FOOT.zones[1:]))
    )
    fitted = model_with(model, {"contact.heel_posterior.rise": 5e-4})
    assert zone(fitted, "heel_posterior").rise_mm == pytest.approx((1.5, -1.5))


def test_the_benchs_foam_is_that_of_the_spheres_under_its_load():
    fitted = model_with(
        MODEL,
        {
            "contact.forefoot.stiffness": 9e4,
            "contact.forefoot.exponent": 1.4,
            "contact.forefoot.rise": 2e-3,
        },
    )
    assert (fitted.foot.series_stiffness_n_per_m, fitted.foot.series_exponent) == (
        pytest.approx(8 * 9e4),
        1.4,
    )
    # It stays where they keep their law.
    other = dataclasses.replace(MODEL, foot=dataclasses.replace(FOOT, series_stiffness_n_per_m=5e4))
    for name in (
        "contact.heel.stiffness",
        "contact.midfoot.rise",
        "contact.forefoot.damping",
        "contact.forefoot.rise",
    ):
        fitted = model_with(other, {name: 1e-3 if name.endswith("rise") else 300.0})
        assert (fitted.foot.series_stiffness_n_per_m, fitted.foot.series_exponent) == (5e4, 1.0), (
            name
        )


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (
            {"contact.toe.stiffness": 1e4},
            ["contact.toe.stiffness", "no contact zones 'toe'", "heel_posterior"],
        ),
        ({"fulcrum.shift": 0.01}, ["fulcrum.shift"]),
        ({"keel.flexural_modulus": -1.0}, ["flexural_modulus_pa", "between"]),
        ({"contact.heel.rise": float("nan")}, ["rise_mm", "finite"]),
    ],
)
def test_values_that_make_no_model_are_refused_with_file_and_name(values, words):
    with pytest.raises(InputError) as caught:
        model_with(MODEL, values, file="contact.yaml")
    for word in ("contact.yaml", *words):
        assert word in str(caught.value)


def test_a_contact_is_of_the_shell_that_it_was_fitted_in():
    """Refused for another model's; a foot that nobody stated is put into it."""
    contact = made_contact(foot_length_m=0.275)
    in_it = dataclasses.replace(MODEL, foot=in_shell(FOOT, 0.275))
    fitted = fitted_model(in_it, contact)
    assert fitted.foot.length_m == 0.275
    assert fitted_model(MODEL, contact, in_its_shell=True) == fitted
    with pytest.raises(InputError, match=r"c.yaml.*foot_length_m.*a foot of 275 mm.*245 mm"):
        fitted_model(MODEL, contact, file="c.yaml")
    unknown = made_contact()
    assert fitted_model(MODEL, unknown, in_its_shell=True) == fitted_model(MODEL, unknown)


def test_two_zones_of_one_name_and_an_axis_without_stiffness_are_refused():
    twice = dataclasses.replace(
        MODEL, foot=dataclasses.replace(FOOT, zones=(*FOOT.zones, FOOT.zones[0]))
    )
    with pytest.raises(InputError, match="2 contact zones 'heel_posterior'"):
        model_with(twice, {"contact.heel_posterior.stiffness": 1e4})
    loose = BushingAxis(
        stiffness=0.0, stiffness_negative=10.0, damping=1.0, limit=0.1, rate_limit=1.0
    )
    with pytest.raises(InputError, match="tx axis has no stiffness"):
        socket = dataclasses.replace(MODEL.socket, tx=loose)
        model_with(dataclasses.replace(MODEL, socket=socket), {"socket.tx.stiffness": 1e4})
