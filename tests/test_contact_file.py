"""Contact files: what is read is what was written, and nothing else is taken for a fitted contact."""

from __future__ import annotations

import dataclasses
import json
import math

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from made_contact import CURVE, OWN, made_contact

from vsf_drake.contact_file import check_contact, load_contact, save_contact, variable_unit
from vsf_drake.errors import UNPRINTABLE, InputError
from vsf_drake.schema import to_plain


def test_a_contact_is_written_and_read_back_equal(tmp_path):
    contact = made_contact()
    save_contact(contact, tmp_path / "contact.yaml")
    assert load_contact(tmp_path / "contact.yaml") == contact
    assert [path.name for path in tmp_path.iterdir()] == ["contact.yaml"]


NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


PRINTABLE = st.text(max_size=30).filter(lambda text: not UNPRINTABLE.search(text))


@given(numbers=st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4), value=NUMBERS, words=PRINTABLE)
def test_every_digit_and_every_letter_comes_back(tmp_path_factory, numbers, value, words):
    path = tmp_path_factory.mktemp("contact") / "contact.yaml"
    trial = dataclasses.replace(OWN, name=words, path={"pelvis_tx": tuple(numbers)})
    contact = made_contact(values={"fulcrum.stiffness": value}, trials=(trial,), verdict=(words, "b"),
                           provenance={"said": words, "number": value})
    save_contact(contact, path)
    assert load_contact(path) == contact


@pytest.mark.parametrize("words", [
    "two\nlines", "", " ", "height_m: 3", "# no", "a: b # c", "- x", "'\"", "null", "1.0", "\u2028", "üß\t",
    "trials:\n- name: x"])
def test_texts_that_look_like_yaml_are_texts(tmp_path, words):
    contact = made_contact(strategy=words, trials=(dataclasses.replace(OWN, name=words),), provenance={words: words})
    save_contact(contact, tmp_path / "contact.yaml")
    assert load_contact(tmp_path / "contact.yaml") == contact


@pytest.mark.parametrize("words", ["\x1b[31m", "\x85end", "a\0", "\ud800", "\u202e"])
def test_a_text_that_cannot_be_printed_is_neither_written_nor_read(tmp_path, words):
    path = tmp_path / "contact.yaml"
    with pytest.raises(InputError, match="unprintable"):
        save_contact(made_contact(strategy=words), path)
    save_contact(made_contact(strategy="HERE"), path)
    path.write_text(path.read_text(encoding="utf-8").replace("HERE", json.dumps(words)), encoding="utf-8")
    with pytest.raises(InputError, match=r"line \d+.*unprintable"):
        load_contact(path)


def test_every_physical_number_has_its_unit_behind_it(tmp_path):
    save_contact(made_contact(), tmp_path / "contact.yaml")
    lines = (tmp_path / "contact.yaml").read_text(encoding="utf-8").splitlines()
    unit = {line.split(":")[0].strip(" -"): line.split("# ")[1] for line in lines if "# " in line[1:]}
    assert unit["mass_kg"] == "kg" and unit["height_m"] == "m" and unit["pelvis_tx"] == "m"
    assert unit["contact.forefoot.stiffness"] == "N/m^exponent" and unit["contact.forefoot.exponent"] == "1"
    assert unit["socket.tz.stiffness"] == "N/m" and unit["socket.flexion.stiffness"] == "N m/rad"
    assert unit["coordinate.hip_flexion_r"] == "rad" and unit["coordinate.pelvis_ty"] == "m"
    assert set(made_contact().values) <= set(unit)


def test_a_fit_that_did_not_converge_is_written_as_such_and_not_read_as_one_that_did(tmp_path):
    failed = made_contact(converged=False)
    save_contact(failed, tmp_path / "contact.yaml")
    assert "NOT TO BE USED" in (tmp_path / "contact.yaml").read_text(encoding="utf-8").splitlines()[0]
    with pytest.raises(InputError, match=r"contact\.yaml: converged: this fit did not converge"):
        load_contact(tmp_path / "contact.yaml")
    assert load_contact(tmp_path / "contact.yaml", even_if_failed=True) == failed


def spoiled(change):
    plain = to_plain(made_contact())
    change(plain)
    return plain


def put(*keys, value):
    def change(plain):
        for key in keys[:-1]:
            plain = plain[key]
        plain[keys[-1]] = value
    return change


@pytest.mark.parametrize(("change", "words"), [
    (put("value", value={}), ["value: unknown key", "Did you mean values?"]),
    (lambda plain: plain.pop("converged"), ["converged: the key is missing"]),
    (lambda plain: plain.pop("format"), ["format: the key is missing"]),
    (put("format", value="vsf_drake contact 2"), ["format", "not known", "vsf_drake contact 1"]),
    (put("converged", value="perhaps"), ["converged", "true or false"]),
    (put("subject", "age", value=40), ["subject.age: unknown key"]),
    (put("subject", "mass_kg", value=7.8), ["subject.mass_kg", "between 20 and 250 kg"]),
    (put("subject", "prosthetic_side", value="both"), ["prosthetic_side", "left, right"]),
    (put("verdict", value={"good": True}), ["verdict", "must be a list"]),
    (put("values", "contact.forefoot.stiffness", value=math.nan), ["values.contact.forefoot.stiffness", "finite"]),
    (put("values", "contact.forefoot.stiffness", value="soft"), ["values.contact.forefoot.stiffness", "not a number"]),
    (put("values", "contact.forefoot.colour", value=1.0), ["values.contact.forefoot.colour", "there is no"]),
    (put("values", "fulcrum.shift", value=0.01), ["values.fulcrum.shift", "there is no 'fulcrum.shift'"]),
    (put("values", "socket.up.stiffness", value=1e4), ["values.socket.up.stiffness"]),
    (put("values", "coordinate.ankle_angle_r", value=0.1), ["ankle_angle_r", "no coordinate"]),
    (put("curves", 0, "coordinate", value="knee"), ["curves[0].coordinate", "'knee' is no coordinate"]),
    (put("curves", 0, "coefficients", value=[0.1, 0.1, 0.1]), ["curves[0].coefficients", "At least 4"]),
    (put("curves", 0, "coefficients", value=[0.1, 0.1, 0.1, 5.7]), ["curves[0].coefficients", "between -1 and 1"]),
    (put("curves", value=[to_plain(CURVE), to_plain(CURVE)]), ["curves[1]", "two curves"]),
    (put("trials", 0, "height_m", value=2.0), ["trials[0].height_m", "between -0.2 and 0.2 m"]),
    (put("trials", 0, "fingerprint", value="low_1"), ["trials[0].fingerprint", "64 hexadecimal digits"]),
    (put("trials", value=[to_plain(OWN), to_plain(OWN)]), ["trials[1].fingerprint", "stands twice"]),
    (put("trials", 0, "path", value={"pelvis_ty": [0.0] * 4}), ["trials[0].path", "pelvis_tx, pelvis_tz"]),
    (put("values", "coordinate.hip_flexion_r", value=5.7), ["values.coordinate.hip_flexion_r", "between -1 and 1"]),
    (put("trials", 0, "path", "pelvis_tx", value=[0.0, 0.0, -1.5, 0.0]), ["path.pelvis_tx[2]", "between -1 and 1"]),
    (lambda plain: plain.pop("provenance"), ["provenance: is missing", "cut short"]),
    (put("trials", 0, "path", "pelvis_tx", value=[0.0]), ["trials[0].path.pelvis_tx", "cubic"]),
    (put("trials", 0, "path", "pelvis_tx", value=[0.0, math.inf, 0.0, 0.0]),
     ["line ", "trials[0].path.pelvis_tx[1]: inf"]),
])
def test_what_is_no_contact_is_refused_with_file_and_key(tmp_path, change, words):
    path = tmp_path / "contact.yaml"
    path.write_text(yaml.safe_dump(spoiled(change)), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_contact(path)
    for word in (str(path), *words):
        assert word in str(caught.value)


def test_a_name_that_stands_twice_is_refused(tmp_path):
    path = tmp_path / "contact.yaml"
    save_contact(made_contact(values={"fulcrum.stiffness": 1e5}), path)
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("values:\n", "values:\n  fulcrum.stiffness: 2e5\n"), encoding="utf-8")
    with pytest.raises(InputError, match=r"line \d+, values\.fulcrum\.stiffness: the key stands twice"):
        load_contact(path)


def test_a_file_that_was_cut_between_its_keys_is_refused(tmp_path):
    path, keys = tmp_path / "contact.yaml", ("values:", "curves:", "trials:", "provenance:")
    save_contact(made_contact(), path)
    text = path.read_text(encoding="utf-8")
    for key in keys:
        path.write_text(text[: text.index(f"\n{key}") + 1], encoding="utf-8")
        with pytest.raises(InputError, match="cut short"):
            load_contact(path)


def test_a_model_file_is_no_contact_file(tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text("foot: {mass_kg: 0.7}\n", encoding="utf-8")
    with pytest.raises(InputError, match="foot: unknown key"):
        load_contact(path)


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
    with pytest.raises(InputError, match=r"values\.keel\.colour"):
        check_contact(made_contact(values={"keel.colour": 1.0}))
    with pytest.raises(InputError, match=r"True is not a finite number"):
        check_contact(made_contact(values={"fulcrum.stiffness": True}))
    left = dataclasses.replace(made_contact().subject, prosthetic_side="left")
    with pytest.raises(InputError, match="ankle_angle_l"):
        check_contact(made_contact(subject=left, values={"coordinate.ankle_angle_l": 0.1}, curves=()))
    endless = dataclasses.replace(OWN, path={"pelvis_tz": (0.0, math.nan, 0.0, 0.0)})
    with pytest.raises(InputError, match=r"trials\[0\]\.path\.pelvis_tz\[1\]: nan"):
        check_contact(made_contact(trials=(endless,)))


def test_units_are_those_of_the_walks_variables():
    from vsf_drake.motion.trial import default_model  # noqa: PLC0415
    from vsf_drake.parameters import Subject  # noqa: PLC0415
    from vsf_drake.simulation.walk import Walker  # noqa: PLC0415

    person = Subject(mass_kg=78.0, stature_m=1.81, sex="male", prosthetic_side="left")
    variables = Walker(person, default_model()).variables
    for name, variable in variables.items():
        if name != "fulcrum.shift":
            assert variable_unit(name) == variable.unit, name
