"""Markers and plates of a made person become the trial that was made, and can be written as OpenSim files."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import yaml
from made_person import Person
from made_walk import ANGLES, FORCE_TIME, MASS, feet, plates, standing, walk
from virtual_laboratory.trc import write_trc

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.tables import write_forces_mot
from vsf_drake.motion.manifest import Window
from vsf_drake.motion.markers.person_facts import PersonFacts
from vsf_drake.motion.trial import (
    PLACEHOLDER_KG,
    TrialOptions,
    load_trial,
    model_ankle,
    trial_from_recordings,
    write_trial_files,
)
from vsf_drake.schema import dump_yaml

PERSON = PersonFacts(mass_kg=MASS, stature_m=1.8, sex="male", prosthetic_side="right")


def make(side="right", person=PERSON, walked=None, still=True, **options):
    facts = dataclasses.replace(person, prosthetic_side=side)
    return trial_from_recordings(standing() if still else None, walked or walk(), None, facts,
                                 TrialOptions(**({"cutoff_hz": None} | options)), fulcrum_m=0.066)


@pytest.mark.parametrize("side", ["right", "left"])
def test_angles_and_forces_come_back(side):
    trial = make(side)
    for name in trial.trajectory.names:
        wanted = np.broadcast_to(ANGLES.get(name, 0.93 if name == "pelvis_ty" else 0.0), (300,))
        got = trial.trajectory.values[:, trial.trajectory.names.index(name)]
        assert np.allclose(got, wanted, atol=2e-3), name
    assert f"ankle_angle_{'l' if side == 'right' else 'r'}" in trial.trajectory.names
    assert f"ankle_angle_{side[0]}" not in trial.trajectory.names
    for foot, plate in zip(("right", "left"), plates(Person()), strict=True):
        loaded = plate.force_n[:, 2] > 20.0
        assert np.allclose(trial.plates[foot].force_W[loaded], plate.force_n[loaded])
        assert np.allclose(trial.plates[foot].cop_W[loaded], plate.cop_m[loaded])
        assert np.allclose(trial.plates[foot].free_moment_nm[loaded], 2.0)


def test_what_it_was_made_of_is_kept():
    trial = make()
    assert trial.recording is not None and trial.calibration is not None and trial.tracked is not None
    assert [c.side for c in trial.contacts] == ["right", "left"] * 3
    assert trial.subject.mass_kg == MASS and trial.subject.thigh_length_m == pytest.approx(0.43, abs=3e-3)
    assert any("rajagopal, which knows" in note for note in trial.notes)


@pytest.mark.parametrize("side", ["right", "left"])
def test_prosthetic_ankle_of_the_model_is_where_the_markers_show_it(side):
    """Also with a thigh that is stated 3 cm longer than it is: the pelvis makes up for it."""
    trial = make(side, stated={"prosthetic_thigh_length_m": 0.46})
    assert trial.subject.prosthetic_thigh_length_m == 0.46
    moved = dataclasses.replace(trial.tracked, values=np.array(trial.tracked.values))
    for name in ("pelvis_tx", "pelvis_ty", "pelvis_tz"):
        moved.values[:, moved.names.index(name)] = trial.trajectory.values[:, trial.trajectory.names.index(name)]
    assert np.allclose(model_ankle(moved, trial.calibration, trial.subject), feet(Person())[side].ankle_W, atol=1e-3)
    assert any("prosthetic_thigh_length_m is stated as 0.460 m; the markers tell 0.4" in n for n in trial.notes)


def test_mass_that_is_not_stated_comes_from_a_stride():
    trial = make(person=dataclasses.replace(PERSON, mass_kg=None))
    assert trial.subject.mass_kg == pytest.approx(MASS, rel=0.01)
    assert any("mean vertical force over" in note for note in trial.notes)
    with pytest.raises(InputError, match=r"mass_kg .*not stated, and there is no stride in which both feet"):
        make(person=dataclasses.replace(PERSON, mass_kg=None),
             walked=walk(missed=[("left", 0), ("right", 1), ("left", 1), ("right", 2)]))


def test_mass_and_stature_are_those_that_a_file_states_unless_the_user_does():
    """The walk's forces would tell 80 kg; the file says 76, and the check of the plates is to find that out."""
    walked = dataclasses.replace(walk(), person={"mass_kg": 76.0, "stature_m": 1.75})
    unknown = dataclasses.replace(PERSON, mass_kg=None, stature_m=None)
    trial = make(person=unknown, walked=walked)
    assert (trial.subject.mass_kg, trial.subject.stature_m) == (76.0, 1.75)
    assert any("body mass of 76 kg is what" in note and "states (PROCESSING)" in note for note in trial.notes)
    stated = make(walked=walked)
    assert (stated.subject.mass_kg, stated.subject.stature_m) == (MASS, 1.8)
    assert any(f"states a body mass of 76 kg, where {MASS:g} kg is stated" in note for note in stated.notes)


def test_steps_beside_the_plates_are_left_out_of_the_window():
    trial = make("right", walked=walk(missed=[("right", 2)]))
    ((start, end),) = trial.unmeasured["right"]
    assert start == pytest.approx(2.14 - 0.05, abs=0.05) and end == pytest.approx(2.84 + 0.05, abs=0.05)
    assert (trial.start_s, trial.end_s) == (0.0, pytest.approx(start))
    assert any("was cut to 0.000 to 2.09" in n and "no plate measures" in n for n in trial.notes)
    kept = make("right", walked=walk(missed=[("right", 2)]), window=Window(start_s=0.5, end_s=2.9))
    assert kept.end_s == 2.9
    assert any("zero is compared with the model's force there" in note for note in kept.notes)


def test_intact_steps_beside_the_plates_cost_nothing():
    trial = make("right", walked=walk(missed=[("left", 1)]))
    assert (trial.start_s, trial.end_s) == (0.0, pytest.approx(2.99)) and trial.unmeasured["left"]


def test_prosthetic_foot_that_misses_every_plate_is_refused():
    with pytest.raises(InputError, match=r"forces: no plate carries the right \(prosthetic\) foot alone"):
        make("right", walked=walk(missed=[("right", i) for i in range(3)]))


def test_stated_plates_win_over_the_centre_of_pressure():
    trial = make("right", plate_sides={"right": "plate_l", "left": "plate_r"})
    assert {c.plate: c.side for c in trial.contacts} == {"plate_l": "right", "plate_r": "left"}
    assert any("it is stated as the right foot's" in note for note in trial.notes)


def test_labels_that_no_shipped_map_knows_are_refused():
    strange = dataclasses.replace(walk(), markers={f"M{i}": x for i, x in enumerate(walk().markers.values())})
    with pytest.raises(InputError, match=r"marker_map \(--map\): no shipped .*: M0, M1.*--list-markers"):
        make(walked=strange, still=False)


def test_a_mass_that_only_the_walk_tells_makes_the_person_that_stating_it_makes():
    """The weight says how far the prosthesis was pressed together while it was measured."""
    found = make(person=dataclasses.replace(PERSON, mass_kg=None))
    stated = make(person=dataclasses.replace(PERSON, mass_kg=found.subject.mass_kg))
    assert abs(found.subject.mass_kg - PLACEHOLDER_KG) > 1.0
    assert found.subject == stated.subject
    assert found.calibration.method == stated.calibration.method


def test_force_in_another_unit_is_refused():
    big = walk()
    big = dataclasses.replace(big, plates=tuple(dataclasses.replace(p, force_n=9.81 * p.force_n) for p in big.plates))
    with pytest.raises(InputError, match="times the body weight of 78 kg"):
        make(walked=big)


@pytest.mark.parametrize("side", ["right", "left"])
def test_written_files_load_as_the_same_trial(side, tmp_path):
    trial = make(side, cutoff_hz=6.0)
    names = write_trial_files(trial, tmp_path, "walk")
    assert names == ("walk_ik.mot", "walk_grf.mot")
    (tmp_path / "subject.yaml").write_text(dump_yaml(trial.subject))
    (tmp_path / "trial.yaml").write_text(yaml.safe_dump({
        "subject": "subject.yaml", "kinematics": names[0], "forces": names[1], "prosthesis": {"fulcrum_mm": 66},
        "window": {"start_s": trial.start_s, "end_s": trial.end_s}}))
    again = load_trial(tmp_path / "trial.yaml")
    assert again.trajectory.names == trial.trajectory.names and again.subject == trial.subject
    assert (again.start_s, again.end_s) == (trial.start_s, trial.end_s)
    assert np.allclose(again.trajectory.time_s, trial.trajectory.time_s, atol=1e-9)
    assert np.allclose(again.trajectory.values, trial.trajectory.values, atol=1e-9)
    for foot, plate in trial.plates.items():
        for field in ("time_s", "force_W", "cop_W", "free_moment_nm"):
            assert np.allclose(getattr(again.plates[foot], field), getattr(plate, field), atol=1e-6, equal_nan=True)
    header = (tmp_path / "walk_ik.mot").read_text().splitlines()[6]
    assert {"ankle_angle_r", "ankle_angle_l"} <= set(header.split("\t"))


def write_manifest(folder, **changed):
    """A laboratory's own files: TRC for markers, MOT for plates."""
    write_trc(folder / "walk.trc", walk())
    write_trc(folder / "static.trc", standing())
    made = dict(zip("12", plates(Person()), strict=True))
    write_forces_mot(folder / "walk.mot", time_s=FORCE_TIME, plates=made)
    (folder / "subject.yaml").write_text(yaml.safe_dump(
        {"mass_kg": MASS, "stature_m": 1.8, "sex": "male", "prosthetic_side": "right"} | changed.pop("subject", {})))
    keys = {"subject": "subject.yaml", "markers": "walk.trc", "standing": "static.trc", "forces": "walk.mot",
            "marker_map": "rajagopal", "prosthesis": {"fulcrum_mm": 108}, "already_filtered": True}
    path = folder / "trial.yaml"
    path.write_text(yaml.safe_dump({k: v for k, v in (keys | changed).items() if v is not None}))
    return path


def test_manifest_with_markers_is_the_same_trial(tmp_path):
    trial, wanted = load_trial(write_manifest(tmp_path)), make()
    assert trial.name == "trial" and trial.fulcrum_m == pytest.approx(0.108)
    assert set(trial.inputs) == {"trial.yaml", "subject.yaml", "walk.trc", "static.trc", "walk.mot"}
    assert np.allclose(trial.trajectory.values, wanted.trajectory.values, atol=1e-6)
    assert np.allclose(trial.prosthetic_plate.force_W, wanted.prosthetic_plate.force_W, atol=1e-6)
    assert not any("No marker map was stated" in note for note in trial.notes)


def test_manifest_states_lengths_plates_map_and_filter(tmp_path):
    (tmp_path / "ours.yaml").write_text("description: ours\nprefix: any\nright: {}\nleft: {}\nmiddle: {}\n")
    path = write_manifest(tmp_path, subject={"prosthesis_length_m": 0.52}, already_filtered=None, marker_cutoff_hz=10,
                          forces={"file": "walk.mot", "right": "ground_force_1", "left": "ground_force_2"})
    trial = load_trial(path)
    assert trial.subject.prosthesis_length_m == 0.52
    assert [c.side for c in trial.contacts][:2] == ["right", "left"]
    assert not any("filtered already" in note for note in trial.notes)
    with pytest.raises(InputError, match=r"marker_map: there is no file theirs\.yaml"):
        load_trial(write_manifest(tmp_path, marker_map="theirs.yaml"))
    with pytest.raises(InputError, match=r"ours\.yaml"):
        load_trial(write_manifest(tmp_path, marker_map="ours.yaml"))


@pytest.mark.parametrize("key", ["markers", "standing", "forces"])
def test_missing_file_is_named_with_its_key(tmp_path, key):
    with pytest.raises(InputError, match=rf"trial\.yaml: {key}: there is no file absent\.trc"):
        load_trial(write_manifest(tmp_path, **{key: "absent.trc"}))
