"""Scenario files: everything in one, and what is refused with which words."""

from __future__ import annotations

import pytest
import yaml
from made_scenario import one_of_everything, written

from vsf_drake.base.errors import InputError
from vsf_drake.base.schema import dump_yaml
from vsf_drake.model.ground import Ground
from vsf_drake.model.parameters import Subject
from vsf_drake.model.scenario import (
    CONTACTS,
    Scenario,
    ScenarioFoot,
    check_scenario,
    load_scenario,
    scenario_ground,
)
from vsf_drake.plants.foot import CONTACTS as FOOT_CONTACTS


def test_one_of_everything_is_read_and_survives_being_written(tmp_path):
    scenario = load_scenario(one_of_everything(tmp_path))
    assert scenario.robot == str(tmp_path / "two_legs.dmd.yaml")
    assert scenario.feet[1] == ScenarioFoot(
        name="right",
        parent_frame="b::pylon_end",
        side="right",
        model=str(tmp_path / "foot.yaml"),
        contact="hunt_crossley",
    )
    assert [patch.name for patch in scenario_ground(scenario).patches] == ["floor", "mat"]
    assert load_scenario(written(tmp_path, dump_yaml(scenario), "again.yaml")) == scenario


def test_a_person_may_have_subject_inline_and_ground_in_a_file(tmp_path):
    written(tmp_path, "patches: [{slope_deg: 3}]\n", "ground.yaml")
    subject = "{mass_kg: 78, stature_m: 1.81, sex: male, prosthetic_side: right}"
    scenario = load_scenario(
        written(tmp_path, f"kind: person\nsubject: {subject}\nground: ground.yaml")
    )
    assert (
        isinstance(scenario.subject, Subject)
        and scenario_ground(scenario).patches[0].slope_deg == 3.0
    )
    assert CONTACTS == FOOT_CONTACTS


REFUSED = {
    "kind: dog": r"scenario.yaml: .*kind.*bench, person, leg",
    "kind: bench\nfree: [knee_angle_l]": r"scenario.yaml: free: is not for the kind 'bench'",
    "kind: person": r"scenario.yaml: subject: the key is missing",
    "kind: leg": r"robot: there is no model",
    "kind: leg\nrobot: package://vsf_drake/leg.urdf": r"feet: there is no foot",
    (
        "kind: leg\nrobot: package://vsf_drake/no.urdf\nfeet: [{name: vsf}]"
    ): r"robot: there is no file package",
    "kind: bench\nmodel: package://elsewhere/no.yaml": r"model: .*package that is not known",
    "kind: bench\ncontact_file: nowhere.yaml": r"contact_file: there is no file",
    (
        "kind: leg\nrobot: package://vsf_drake/leg.urdf\nfeet: [{name: a}, {name: a}]"
    ): r"feet\[1\]: 'a' stands twice",
    (
        "kind: leg\nrobot: package://vsf_drake/leg.urdf\nfeet: [{name: a}]\ndirectives: "
        "[{add_weld: {}}]"
    ): r"begin with - add_model",
    (
        "kind: leg\nrobot: package://vsf_drake/leg.urdf\nfeet: [{name: a}]\nground: {patches: []}"
    ): "patches: has no patch",
}


@pytest.mark.parametrize("text", REFUSED)
def test_a_wrong_file_is_refused_with_its_place(text, tmp_path):
    with pytest.raises(InputError, match=REFUSED[text]):
        load_scenario(written(tmp_path, text))


def test_a_scenario_made_in_python_is_checked_too():
    with pytest.raises(InputError, match="fulcrum_mm"):
        check_scenario(Scenario(kind="bench", fulcrum_mm=-1.0))
    with pytest.raises(InputError, match="heel: is not for"):
        check_scenario(
            Scenario(kind="leg", robot="x", feet=(ScenarioFoot(),), heel=True, ground=Ground())
        )


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        (
            "directives",
            [{"add_weld": {"X_PC": {"translation": [0.0, 0.0, float("nan")]}}}],
            "not a number",
        ),
        ("robot", "x" * 5000, "cannot be used as a path"),
    ],
)
def test_nothing_that_is_no_number_and_no_path_comes_in_with_the_file_s_name(
    tmp_path, key, value, said
):
    with pytest.raises(InputError, match=rf"scenario\.yaml: .*{said}"):
        load_scenario(written(tmp_path, yaml.safe_dump({"kind": "leg", key: value})))
