"""Parameters: what is read is what was written, and nothing unphysical gets in."""

from __future__ import annotations

import dataclasses

import pytest
import yaml
from pydrake.multibody.plant import MultibodyPlant

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import resource
from vsf_drake.base.schema import dump_yaml, load_yaml, to_plain
from vsf_drake.model import model_file
from vsf_drake.model.parameters import (
    GRAVITY,
    ContactZone,
    FootParameters,
    FrictionParameters,
    FulcrumParameters,
    ModelParameters,
    Subject,
)
from vsf_drake.simulation.walk import Walker


def changed(plain):
    """Every number a little larger, so that none is its default."""
    if isinstance(plain, dict):
        return {key: changed(value) for key, value in plain.items()}
    if isinstance(plain, list):
        return [changed(value) for value in plain]
    return 1.001 * plain if isinstance(plain, float) else plain


def test_every_number_of_a_model_file_is_read_and_written_back_equal(tmp_path):
    path, plain = tmp_path / "model.yaml", changed(to_plain(ModelParameters()))
    path.write_text(yaml.safe_dump(plain), encoding="utf-8")
    model = model_file.load_model(path)
    assert (
        to_plain(model) == plain and model_file.check_model(ModelParameters()) == ModelParameters()
    )
    path.write_text(dump_yaml(model), encoding="utf-8")
    assert model_file.load_model(path) == model
    path.write_text("intact_foot: {friction: {mu_static: 0.8}}", encoding="utf-8")
    assert model_file.load_model(path).intact_foot.friction == FrictionParameters(mu_static=0.8)


SUBJECT = {"mass_kg": 78.0, "stature_m": 1.81, "sex": "male", "prosthetic_side": "right"}


def test_a_subject_without_measurements_is_written_without_them_and_one_with_all_comes_back_equal(
    tmp_path,
):
    """Files of earlier subjects stay as they were, and 0 measured is not the same as not
    measured."""
    assert yaml.safe_load(dump_yaml(Subject(**SUBJECT))) == {**SUBJECT, "name": "subject"}
    names = [field.name for field in dataclasses.fields(Subject) if field.default is None]
    whole = Subject(
        **SUBJECT,
        **{
            name: 0.4 if name.endswith("_length_m") else 0.0
            for name in names
            if name.startswith("prosthe") or name.endswith("_length_m")
        },
    )
    (tmp_path / "subject.yaml").write_text(dump_yaml(whole), encoding="utf-8")
    assert load_yaml(tmp_path / "subject.yaml", Subject) == whole
    assert whole.prosthesis_fore_aft_m == 0.0


def test_a_body_weight_is_what_a_body_weighs_in_drake():
    assert list(MultibodyPlant(0.0).gravity_field().gravity_vector()) == [0.0, 0.0, -GRAVITY]


def test_a_shipped_model_has_the_name_that_the_command_line_knows_it_by():
    named = model_file.load_model("package://vsf_drake/soft_support.yaml")
    assert named == model_file.load_model(resource("models/soft_support.yaml"))
    assert named != ModelParameters()
    with pytest.raises(InputError, match=r"softer\.yaml"):
        model_file.load_model("package://vsf_drake/softer.yaml")


def test_python_users_meet_the_same_checks():
    with pytest.raises(InputError, match="mass_kg"):
        Walker(Subject(**(SUBJECT | {"mass_kg": -1.0})), ModelParameters())
    with pytest.raises(InputError, match=r"foot\.mass_kg"):
        model_file.check_model(
            ModelParameters(foot=dataclasses.replace(FootParameters(), mass_kg=float("inf")))
        )


FOOT = FootParameters()
NOMINAL = model_file.load_model(resource("models/nominal.yaml"))
ZONE = ContactZone(
    name="heel",
    x_mm=(1.0, 2.0),
    y_mm=(0.0,),
    rise_mm=(0.0,),
    radius_m=0.01,
    stiffness=1e4,
    damping_n_s_per_m=100.0,
)


def moved(zone, x_mm):
    return dataclasses.replace(zone, x_mm=(x_mm, *zone.x_mm[1:]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"zones": (ZONE,)},
            r"zones\[0\] \(heel\): x_mm, y_mm and rise_mm must have the same length",
        ),
        (
            {"zones": (*FOOT.zones[:4], moved(FOOT.zones[4], 400.0))},
            r"foot\.zones: .* ahead of keel and shell",
        ),
        ({"zones": FOOT.zones[3:]}, "no contact sphere sits on the heel block"),
        ({"fulcrum": FulcrumParameters(foremost_m=0.3)}, r"foot\.fulcrum: .* within the keel"),
        ({"load_point_m": 0.3}, "within the keel"),
        (
            {"fulcrum": FulcrumParameters(carriage_mass_kg=1.9)},
            r"foot\.mass_kg: keel and carriage weigh",
        ),
        (
            {"keel": dataclasses.replace(FOOT.keel, taper_from_m=0.3)},
            r"foot\.keel\.taper_from_m: the keel of 0\.2290 m does not reach to 0\.3 m",
        ),
        ({"build_height_m": 0.02}, r"foot\.build_height_m: .* leaves no room"),
    ],
)
def test_parts_that_make_no_foot_are_refused_by_name(change, message):
    with pytest.raises(InputError, match=f"model.yaml: .*{message}"):
        model_file.check_model(
            ModelParameters(foot=dataclasses.replace(FOOT, **change)), file="model.yaml"
        )


PASSIVE = "package://vsf_drake/passive.yaml"


def test_the_shipped_passive_foot_is_the_nominal_device_clamped_in_the_middle_with_the_same_heel():
    foot = model_file.load_model(PASSIVE).foot
    heel = dict.fromkeys(("heel_posterior", "heel", "heel_anterior"), 0.5)
    zones = tuple(
        dataclasses.replace(
            zone,
            stiffness=heel.get(zone.name, 1.0) * zone.stiffness,
            damping_n_s_per_m=heel.get(zone.name, 1.0) * zone.damping_n_s_per_m,
        )
        for zone in FOOT.zones
    )
    clamped = dataclasses.replace(FOOT.fulcrum, rearmost_m=0.108, foremost_m=0.108)
    own = dataclasses.replace(FOOT, name="passive", fulcrum=clamped, zones=zones)
    assert (
        foot
        == own
        == dataclasses.replace(
            NOMINAL.foot, **{name: getattr(own, name) for name in ("name", "fulcrum", "zones")}
        )
    )


def test_a_passive_foot_is_written_with_its_clamp_and_read_back_equal(tmp_path):
    model = model_file.load_model(PASSIVE)
    path = tmp_path / "again.yaml"
    path.write_text(model_file.model_yaml(model), encoding="utf-8")
    assert yaml.safe_load(path.read_text(encoding="utf-8"))["foot"]["clamp_m"] == 0.108
    assert model_file.load_model(path) == model
    path.write_text(model_file.model_yaml(NOMINAL), encoding="utf-8")
    assert "clamp_m" not in path.read_text(encoding="utf-8")
    assert model_file.load_model(path) == NOMINAL


@pytest.mark.parametrize(
    ("foot", "message"),
    [
        ("{clamp_m: 0.1, fulcrum: {foremost_m: 0.12}}", "does not go with clamp_m"),
        ("{clamp_m: 0.2}", r"foot\.clamp_m: clamp 0\.2 m and load point 0\.199 m must increase"),
        ("{clamp_m: 100}", r"foot\.clamp_m: 100 m is outside .* Is it in millimetres"),
        ("{clamp_m: 0.002}", r"behind the clamp, 2 mm"),
        ("{clamp_m: rear}", r"foot\.clamp_m: 'rear' is not a number"),
    ],
)
def test_a_clamp_that_cannot_be_is_refused_by_name(tmp_path, foot, message):
    path = tmp_path / "model.yaml"
    path.write_text(f"foot: {foot}", encoding="utf-8")
    with pytest.raises(InputError, match=f"model.yaml: .*{message}"):
        model_file.load_model(path)


def test_an_intact_foot_without_zones_and_a_fulcrum_out_of_reach_are_refused():
    intact = dataclasses.replace(ModelParameters().intact_foot, zones=())
    with pytest.raises(InputError, match=r"intact_foot\.zones: there are no contact zones"):
        model_file.check_model(ModelParameters(intact_foot=intact))
    for position in (0.05, 0.2, float("nan")):
        with pytest.raises(InputError, match="between 66 and 151 mm"):
            model_file.check_fulcrum(position, FOOT)


def mixed_foot():
    """Two spheres under the load, of other exponents, one a millimetre higher."""
    law = {"radius_m": 1e-3, "damping_n_s_per_m": 10.0, "y_mm": (0.0,)}
    return dataclasses.replace(
        FOOT,
        zones=(
            FOOT.zones[0],
            ContactZone(name="a", x_mm=(195.0,), rise_mm=(1.0,), stiffness=8e4, **law),
            ContactZone(
                name="b", x_mm=(203.0,), rise_mm=(2.0,), stiffness=3e6, exponent=1.7, **law
            ),
            ContactZone(name="far", x_mm=(229.0,), rise_mm=(0.0,), stiffness=1e9, **law),
        ),
    )


def test_spheres_of_several_laws_bear_as_the_power_law_at_both_loads():
    stiffness, exponent = model_file.foam_under_load(mixed_foot())
    for load in model_file.FOAM_LOADS_N:
        depth = (load / stiffness) ** (1.0 / exponent)
        assert 8e4 * depth + 3e6 * (depth - 1e-3) ** 1.7 == pytest.approx(load, rel=1e-9)
        assert model_file.secant_stiffness(stiffness, exponent, load) == pytest.approx(load / depth)
    assert exponent > 1.0


def test_a_foam_that_bears_nothing_is_none():
    zones = tuple(
        dataclasses.replace(zone, stiffness=1e-2 * (i + 1))
        for i, zone in enumerate(mixed_foot().zones)
    )
    assert model_file.foam_under_load(dataclasses.replace(FOOT, zones=zones)) is None
    assert model_file.foam_under_load(dataclasses.replace(FOOT, series_patch_m=1e-3)) is None
