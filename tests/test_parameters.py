"""Parameters: what is read is what was written, and nothing unphysical gets in."""

from __future__ import annotations

import dataclasses

import pytest
import yaml

from vsf_drake.errors import InputError
from vsf_drake.model_file import check_fulcrum, check_model, load_model
from vsf_drake.parameters import (
    ContactZone,
    FootParameters,
    FrictionParameters,
    FulcrumParameters,
    KeelParameters,
    ModelParameters,
    Subject,
)
from vsf_drake.schema import check, dump_yaml, load_yaml
from vsf_drake.simulation.walk import Walker

ONE_OF_EVERYTHING = """\
foot:
  keel: {element_lengths_m: [0.06, 0.08, 0.09], width_m: 0.07, thickness_m: 0.006, flexural_modulus_pa: 1.5e10,
         density_kg_m3: 1800, damping_time_s: 0.002}
  fulcrum: {stiffness_n_per_m: 2e5, damping_time_s: 0.001, carriage_mass_kg: 0.05, rearmost_m: 0.05, foremost_m: 0.15}
  friction: {mu_static: 0.6, mu_kinetic: 0.4, threshold_velocity_m_per_s: 0.05}
  zones:
    - {name: heel, x_mm: [10], y_mm: [0], rise_mm: [2], radius_m: 0.03, stiffness: 1034, exponent: 7.66,
       damping_n_s_per_m: 3585, full_damping_depth_m: 0.0013}
    - {name: toe, x_mm: [180, 180], y_mm: [20, -20], rise_mm: [0, 0], radius_m: 0.002, stiffness: 7000,
       damping_n_s_per_m: 80}
  series_stiffness_n_per_m: 5e7
  series_exponent: 2.1
  series_patch_m: 0.03
  load_point_m: 0.2
  mass_kg: 0.8
  build_height_m: 0.09
  foam_thickness_m: 0.02
  length_m: 0.25
  heel_x_m: -0.01
  pylon_x_m: 0.05
  side: left
socket:
  tx: &axis {stiffness: 3e4, stiffness_negative: 2e4, damping: 300, limit: 0.01, rate_limit: 0.4}
  ty: *axis
  tz: *axis
  flexion: *axis
  adduction: *axis
  rotation: *axis
  stop_ratio: 5
  socket_mass_kg: 0.7
  pylon_mass_kg: 0.3
  pylon_radius_m: 0.014
  residual_length_ratio: 0.5
intact_foot:
  zones:
    - {name: heel, x_mm: [30], y_mm: [0], rise_mm: [0], radius_m: 0.02, stiffness: 2e4, damping_n_s_per_m: 200}
  friction: {mu_static: 0.8}
  reference_length_m: 0.26
  ankle_x_ratio: 0.2
"""


def test_one_of_everything_is_read_and_written_back_equal(tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text(ONE_OF_EVERYTHING, encoding="utf-8")
    model = load_model(path)
    assert model.foot.keel.element_lengths_m == (0.06, 0.08, 0.09)
    assert model.foot.zones[0].exponent == 7.66
    assert model.foot.zones[1].exponent == 1.0
    assert model.socket.rotation.stiffness_negative == 2e4
    assert model.intact_foot.friction == FrictionParameters(mu_static=0.8)
    path.write_text(dump_yaml(model), encoding="utf-8")
    assert load_model(path) == model


def test_the_example_names_every_key():
    def keys(plain):
        if isinstance(plain, dict):
            return {k for key, value in plain.items() for k in {key} | keys(value)}
        return {k for item in plain for k in keys(item)} if isinstance(plain, list) else set()

    assert keys(yaml.safe_load(dump_yaml(ModelParameters()))) <= keys(yaml.safe_load(ONE_OF_EVERYTHING))


def test_defaults_are_within_their_own_ranges():
    assert check_model(ModelParameters()) == ModelParameters()


SUBJECT = {"mass_kg": 78.0, "stature_m": 1.81, "sex": "male", "prosthetic_side": "right"}


@pytest.mark.parametrize(
    ("change", "where", "right"),
    [
        ({"mass_kg": -3}, "mass_kg", "at least|between"),
        ({"mass_kg": float("nan")}, "mass_kg", "finite"),
        ({"mass_kg": "heavy"}, "mass_kg", "not a number"),
        ({"mass_kg": True}, "mass_kg", "not a number"),
        ({"stature_m": 181}, "stature_m", "between"),
        ({"sex": "other"}, "sex", "male, female"),
        ({"prosthetic_side": "Right"}, "prosthetic_side", "left, right"),
        ({"statur_m": 1.8}, "statur_m", "Did you mean stature_m"),
        ({"thigh_length_m": [0.4]}, "thigh_length_m", "single number"),
    ],
)
def test_unphysical_subject_is_refused_with_file_line_and_key(tmp_path, change, where, right):
    path = tmp_path / "subject.yaml"
    path.write_text(yaml.safe_dump(SUBJECT | change), encoding="utf-8")
    with pytest.raises(InputError, match=right) as caught:
        load_yaml(path, Subject)
    message = str(caught.value)
    assert str(path) in message
    assert where in message
    assert "line" in message


NOT_MEASURED = [field.name for field in dataclasses.fields(Subject) if field.default is None]


def test_a_subject_without_measurements_is_written_without_them_and_one_with_all_comes_back_equal(tmp_path):
    """Files of earlier subjects stay as they were, and 0 measured is not the same as not measured."""
    path = tmp_path / "subject.yaml"
    assert yaml.safe_load(dump_yaml(Subject(**SUBJECT))) == {**SUBJECT, "name": "subject"}
    lengths = {name: 0.4 for name in NOT_MEASURED if name.endswith("_length_m")}
    whole = Subject(**SUBJECT, **{name: 0.0 for name in NOT_MEASURED if name.startswith("prosthesis_")
                                  and name not in lengths}, **lengths)
    path.write_text(dump_yaml(whole), encoding="utf-8")
    assert load_yaml(path, Subject) == whole
    assert whole.prosthesis_fore_aft_m == 0.0


@pytest.mark.parametrize(("key", "value"), [
    ("prosthesis_length_m", 440.0), ("prosthesis_alignment_rad", 5.0), ("prosthesis_toe_out_rad", 7.0),
    ("prosthesis_lateral_m", 12.0), ("prosthetic_thigh_length_m", 0.0)])
def test_lengths_in_millimetres_and_angles_in_degrees_are_refused(tmp_path, key, value):
    path = tmp_path / "subject.yaml"
    path.write_text(yaml.safe_dump(SUBJECT | {key: value}), encoding="utf-8")
    with pytest.raises(InputError, match=f"{key}.*physical range"):
        load_yaml(path, Subject)


@pytest.mark.parametrize("key", SUBJECT)
def test_missing_key_is_named(tmp_path, key):
    path = tmp_path / "subject.yaml"
    path.write_text(yaml.safe_dump({k: v for k, v in SUBJECT.items() if k != key}), encoding="utf-8")
    with pytest.raises(InputError, match=f"{key}: the key is missing"):
        load_yaml(path, Subject)


@pytest.mark.parametrize(
    ("text", "said"),
    [("", "is empty"), ("mass_kg: [", "YAML"), ("- 1", "must be a mapping"), ("mass_kg: 70\n" * 2, "twice"),
     ("mass_kg: !!python/object:os.system 7", "not plain YAML")],
)
def test_malformed_yaml_is_refused(tmp_path, text, said):
    path = tmp_path / "subject.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        load_yaml(path, Subject)


def test_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.yaml: there is no such file"):
        load_yaml(tmp_path / "none.yaml", Subject)


def test_number_without_decimal_point_is_a_number(tmp_path):
    path = tmp_path / "keel.yaml"
    path.write_text("flexural_modulus_pa: 2e10\nwidth_m: 1e-1", encoding="utf-8")
    keel = load_yaml(path, KeelParameters)
    assert (keel.flexural_modulus_pa, keel.width_m) == (2e10, 0.1)


def test_zone_with_lists_of_different_length_is_refused():
    zone = ContactZone(name="heel", x_mm=(1.0, 2.0), y_mm=(0.0,), rise_mm=(0.0,), radius_m=0.01, stiffness=1e4,
                       damping_n_s_per_m=100.0)
    with pytest.raises(InputError, match=r"zones\[0\] \(heel\)"):
        check_model(ModelParameters(foot=FootParameters(zones=(zone,))))


def test_fulcrum_range_must_lie_within_the_keel():
    foot = FootParameters(fulcrum=FulcrumParameters(foremost_m=0.3))
    with pytest.raises(InputError, match=r"foot\.fulcrum"):
        check_model(ModelParameters(foot=foot))


@pytest.mark.parametrize("position", [0.05, 0.2, float("nan")])
def test_fulcrum_outside_the_carriages_reach_is_refused(position):
    with pytest.raises(InputError, match="between 66 and 151 mm"):
        check_fulcrum(position, FootParameters())


def test_python_users_meet_the_same_checks():
    subject = Subject(**(SUBJECT | {"mass_kg": -1.0}))
    with pytest.raises(InputError, match="mass_kg"):
        check(subject)
    with pytest.raises(InputError, match="mass_kg"):
        Walker(subject, ModelParameters())
    heavy = dataclasses.replace(FootParameters(), mass_kg=float("inf"))
    with pytest.raises(InputError, match=r"foot\.mass_kg"):
        check_model(ModelParameters(foot=heavy))
