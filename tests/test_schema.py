"""Plain nested values, as saved results hold them, back to dataclasses."""

from __future__ import annotations

import dataclasses

import pytest
import yaml
from pydrake.common.yaml import yaml_dump_typed, yaml_load_data, yaml_load_file, yaml_load_typed

from vsf_drake.errors import InputError
from vsf_drake.files import resource
from vsf_drake.parameters import KeelParameters, ModelParameters, Subject
from vsf_drake.scenario import Scenario
from vsf_drake.schema import dump_yaml, from_plain, load_yaml, to_plain

SUBJECT = Subject(mass_kg=85.27, stature_m=1.81, sex="male", prosthetic_side="left", thigh_length_m=0.1 + 0.3)


@pytest.mark.parametrize("instance", [
    SUBJECT, ModelParameters(), KeelParameters(element_lengths_m=(0.1, 1 / 3), flexural_modulus_pa=1e17 / 3e6)])
def test_from_plain_undoes_to_plain_exactly(instance):
    assert from_plain(type(instance), to_plain(instance)) == instance


def test_from_plain_reads_what_yaml_gives_back():
    assert from_plain(ModelParameters, yaml.safe_load(yaml.safe_dump(to_plain(ModelParameters())))) == ModelParameters()


@pytest.mark.parametrize(("change", "words"), [
    ({"mass": 80.0}, ["parameters.subject.mass: unknown key", "Did you mean mass_kg?"]),
    ({"mass_kg": "heavy"}, ["parameters.subject.mass_kg", "'heavy' is not a number"]),
    ({"mass_kg": -1.0}, ["parameters.subject.mass_kg", "outside its physical range"]),
    ({"mass_kg": 350.0}, ["It must be between 20 and 250 kg. Is it in pounds?"]),
    ({"mass_kg": 80000.0}, ["Is it in grams?"]), ({"stature_m": 180.0}, ["Is it in centimetres?"]),
    ({"stature_m": 1800.0}, ["Is it in millimetres?"]), ({"prosthesis_toe_out_rad": 7.0}, ["Is it in degrees?"]),
    ({"mass_kg": float("nan")}, ["parameters.subject.mass_kg", "not a finite number"]),
    ({"mass_kg": [80.0]}, ["parameters.subject.mass_kg", "must be a single number"]),
    ({"sex": object()}, ["parameters.subject", "not a plain value"]),
])
def test_from_plain_is_as_strict_as_a_file_and_names_the_key(change, words):
    with pytest.raises(InputError) as caught:
        from_plain(Subject, to_plain(SUBJECT) | change, where="parameters.subject", file="walk")
    assert str(caught.value).startswith("walk: parameters.subject")
    assert "line" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("values", [None, 3, ["mass_kg"]])
def test_from_plain_refuses_what_is_no_mapping(values):
    with pytest.raises(InputError, match="must be a mapping"):
        from_plain(Subject, values)


def test_from_plain_misses_a_key_that_has_no_default():
    values = to_plain(SUBJECT)
    del values["mass_kg"]
    with pytest.raises(InputError, match="mass_kg: the key is missing"):
        from_plain(Subject, values)


def test_from_plain_fills_in_defaults():
    assert from_plain(KeelParameters, {"width_m": 0.05}) == dataclasses.replace(KeelParameters(), width_m=0.05)


@pytest.mark.parametrize(("name", "schema"), [
    ("nominal.yaml", ModelParameters), *((f"scenarios/{kind}.yaml", Scenario) for kind in ("bench", "leg", "person"))])
def test_what_drake_reads_as_plain_values_is_what_we_read_and_the_other_way_round(name, schema):
    """Not by its typed calls; if they begin to take our classes, the module need no longer say that they do not."""
    path = resource(f"models/{name}")
    ours = load_yaml(path, schema)
    assert from_plain(schema, yaml_load_file(str(path))) == ours
    assert from_plain(schema, yaml_load_data(dump_yaml(ours))) == ours
    for typed in (lambda: yaml_dump_typed(ours), lambda: yaml_load_typed(schema=schema, filename=str(path))):
        with pytest.raises((AssertionError, TypeError, RuntimeError)):
            typed()
