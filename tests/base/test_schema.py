"""What a schema refuses, in a file and in plain values; tested here once for all classes."""

from __future__ import annotations

import pytest
from pydrake.common.yaml import yaml_dump_typed, yaml_load_data, yaml_load_file, yaml_load_typed

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import resource
from vsf_drake.base.schema import dump_yaml, from_plain, load_yaml, to_plain
from vsf_drake.model.parameters import KeelParameters, ModelParameters, Subject
from vsf_drake.model.scenario import Scenario

SUBJECT = Subject(
    mass_kg=85.27, stature_m=1.81, sex="male", prosthetic_side="left", thigh_length_m=0.1 + 0.3
)


@pytest.mark.parametrize(
    "instance",
    [
        SUBJECT,
        ModelParameters(),
        KeelParameters(element_lengths_m=(0.1, 1 / 3), flexural_modulus_pa=1e17 / 3e6),
    ],
)
def test_from_plain_undoes_to_plain_exactly(instance):
    assert from_plain(type(instance), to_plain(instance)) == instance


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mass": 80.0}, ["parameters.subject.mass: unknown key", "Did you mean mass_kg?"]),
        ({"mass_kg": "heavy"}, ["parameters.subject.mass_kg", "'heavy' is not a number"]),
        ({"mass_kg": 350.0}, ["It must be between 20 and 250 kg. Is it in pounds?"]),
        ({"stature_m": 180.0}, ["Is it in centimetres?"]),
        ({"sex": object()}, ["parameters.subject", "not a plain value"]),
    ],
)
def test_from_plain_is_as_strict_as_a_file_and_names_the_key(change, words):
    with pytest.raises(InputError) as caught:
        from_plain(Subject, to_plain(SUBJECT) | change, where="parameters.subject", file="walk")
    assert str(caught.value).startswith("walk: parameters.subject")
    assert "line" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


HEAVY = "mass_kg: 78.0\nstature_m: 1.81\nsex: male\nprosthetic_side: right\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty.*mass_kg"),
        ("mass_kg: [", r"line 1: is not valid YAML"),
        ("- 1", "line 1: must be a mapping"),
        (HEAVY + "mass_kg: 70\n", r"line 5, mass_kg: the key stands twice"),
        (HEAVY.replace("78.0", "!!python/object:os.system 7"), "line 1, mass_kg: .*not plain YAML"),
        (HEAVY.replace("mass_kg: 78.0\n", ""), "mass_kg: the key is missing. Its unit is kg"),
        (HEAVY.replace("78.0", "-3"), "line 1, mass_kg: .*between 20 and 250 kg"),
        (HEAVY.replace("78.0", ".nan"), "line 1, mass_kg: nan is not a finite number"),
        (HEAVY.replace("78.0", "true"), "mass_kg: 'true' is not a number"),
        (HEAVY.replace("78.0", "[78.0]"), "mass_kg: must be a single number"),
        (
            HEAVY.replace("right", "Right"),
            "prosthetic_side: 'Right' is not known. Known are: left, right",
        ),
        (HEAVY + "prosthesis_toe_out_rad: 7\n", "toe_out_rad: .* Is it in degrees?"),
        (
            HEAVY + "thigh_lenght_m: 0.4\n",
            "line 5, thigh_lenght_m: unknown key. Did you mean thigh_length_m?",
        ),
    ],
)
def test_a_file_that_is_not_of_its_schema_is_refused_with_line_and_key(tmp_path, text, message):
    path = tmp_path / "subject.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=rf"subject\.yaml: .*{message}"):
        load_yaml(path, Subject)


def test_a_file_that_is_not_there_is_named_and_defaults_are_filled_in(tmp_path):
    path = tmp_path / "keel.yaml"
    with pytest.raises(InputError, match=r"keel\.yaml: there is no such file"):
        load_yaml(path, KeelParameters)
    path.write_text("flexural_modulus_pa: 2e10\nwidth_m: 1e-1", encoding="utf-8")
    assert load_yaml(path, KeelParameters) == KeelParameters(flexural_modulus_pa=2e10, width_m=0.1)
    with pytest.raises(InputError, match="must be a mapping"):
        from_plain(KeelParameters, 3)


@pytest.mark.parametrize(
    ("name", "schema"),
    [
        ("nominal.yaml", ModelParameters),
        *((f"scenarios/{kind}.yaml", Scenario) for kind in ("bench", "leg", "person")),
    ],
)
def test_what_drake_reads_as_plain_values_is_what_we_read_and_the_other_way_round(name, schema):
    """Not by its typed calls; if they begin to take our classes, the module need no longer say that
    they do not."""
    path = resource(f"models/{name}")
    ours = load_yaml(path, schema)
    assert from_plain(schema, yaml_load_file(str(path))) == ours
    assert from_plain(schema, yaml_load_data(dump_yaml(ours))) == ours
    for typed in (
        lambda: yaml_dump_typed(ours),
        lambda: yaml_load_typed(schema=schema, filename=str(path)),
    ):
        with pytest.raises((AssertionError, TypeError, RuntimeError)):
            typed()
