"""Files that belong together, and persons whose mass only the forces tell."""

from __future__ import annotations

import dataclasses

import ezc3d
import numpy as np
import pytest
from made_c3d import write_c3d
from made_laboratory import MASS, Laboratory

from vsf_drake.analysis.import_walks import ImportOptions, gather, import_walks, walk_names
from vsf_drake.analysis.recording.examine import examine
from vsf_drake.errors import InputError
from vsf_drake.files import resource
from vsf_drake.motion import read_trial
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.manifest import Window
from vsf_drake.motion.markers.person_facts import PersonFacts
from vsf_drake.motion.trial import load_trial
from vsf_drake.plants.gait import make_gait

PERSON = PersonFacts(sex="male", prosthetic_side="right", mass_kg=MASS, stature_m=1.81)


@pytest.fixture(autouse=True)
def effect(monkeypatch):
    """What the effect of scaling was asked for; two fits of the offsets take seconds."""
    asked = []
    monkeypatch.setattr(
        "vsf_drake.analysis.import_walks._scaling_effect",
        lambda trial, ratio, options: asked.append(ratio) or ["the effect"],
    )
    return asked


def touch(folder, *names):
    for name in names:
        (folder / name).write_text("x", encoding="utf-8")
    return [folder / name for name in names]


def test_force_file_beside_a_trc_is_found_by_its_name(tmp_path):
    for beside in ("walk_grf.mot", "walk.forces", "walk.csv", "walk.sto", "walk.mot"):
        folder = tmp_path / beside
        folder.mkdir()
        standing, walk, _, forces = touch(folder, "static.trc", "walk.trc", "walk_ik.mot", beside)
        files = gather(standing, [walk])
        assert files.forces == (forces,)
        assert files.beside == (forces,)


def test_files_that_cannot_belong_together_are_refused(tmp_path):
    standing, walk, forces = touch(tmp_path, "static.c3d", "walk.c3d", "walk.mot")
    with pytest.raises(InputError, match="given twice"):
        gather(standing, [walk, walk])
    with pytest.raises(InputError, match="do not fit"):
        gather(standing, [walk], [forces, forces])
    with pytest.raises(InputError, match="no such file"):
        gather(tmp_path / "none.c3d", [walk])
    with pytest.raises(InputError, match="is a folder"):
        gather(tmp_path, [walk])


def test_results_get_names_of_their_own(tmp_path):
    walks = [
        tmp_path / name
        for name in ("a/walk.c3d", "b/walk.trc", "b/Walk.c3d", "subject.c3d", "ü 1.c3d")
    ]
    assert walk_names(walks) == ["walk", "walk_2", "Walk_3", "subject_trial", "ü 1"]


def test_masses_of_several_walks_become_one_person(tmp_path):
    laboratory = Laboratory(tmp_path)
    standing, walks = (
        laboratory.standing(),
        [laboratory.walk("one.trc"), laboratory.walk("two.trc")],
    )
    person = dataclasses.replace(PERSON, mass_kg=None)
    imported = import_walks(gather(standing, walks), ImportOptions(person=person))
    masses = {item.trial.subject.mass_kg for item in imported.items}
    assert len(masses) == 1
    assert len({item.trial.subject for item in imported.items}) == 1
    for item in imported.items:
        assert item.checks[0].name == "body mass"
        assert item.checks[0].mark == "doubtful"
    [mass] = masses
    stated = import_walks(
        gather(standing, walks), ImportOptions(person=dataclasses.replace(PERSON, mass_kg=mass))
    )
    assert imported.items[0].trial.subject == stated.items[0].trial.subject
    assert any("median" in note for note in imported.items[0].notes)
    assert any("which lies beside one.trc" in note for note in imported.items[0].notes)


@pytest.mark.parametrize(("mass", "mark"), [(78.5, "good"), (120.0, "unusable")])
def test_a_mass_that_the_standing_file_states_is_taken_and_held_against_the_plates(
    tmp_path, mass, mark
):
    laboratory = Laboratory(tmp_path)
    marked = read_trial(laboratory.standing())
    standing = write_c3d(tmp_path / "standing.c3d", marked.markers, rate=marked.marker_rate_hz)
    c3d = ezc3d.c3d(str(standing))
    c3d.add_parameter("PROCESSING", "Bodymass", [mass])
    c3d.add_parameter("PROCESSING", "Height", [1790.0])
    c3d.write(str(standing))
    person = dataclasses.replace(PERSON, mass_kg=None, stature_m=None)
    [item] = import_walks(gather(standing, [laboratory.walk()]), ImportOptions(person=person)).items
    assert (item.trial.subject.mass_kg, item.trial.subject.stature_m) == (mass, pytest.approx(1.79))
    marks = {check.name: check.mark for check in item.checks}
    assert marks["mass from the forces"] == mark and not {"body mass", "stature"} & {*marks}


def test_a_walk_keeps_its_stances_on_plates_and_a_little_around_unless_a_window_is_stated(tmp_path):
    laboratory = Laboratory(tmp_path)
    files = gather(laboratory.standing(), [laboratory.walk()])
    [item] = import_walks(files, ImportOptions(person=PERSON)).items
    trial = item.trial
    *_, last = find_stances(trial.prosthetic_plate.time_s, trial.prosthetic_plate.force_W[:, 2])
    [(_, unmeasured_end)] = trial.unmeasured["right"][1:]  # the stances before it are cut
    assert last.start_s - 0.3 > unmeasured_end and last.end_s + 0.3 > trial.trajectory.end_s
    assert (trial.start_s, trial.end_s) == (
        pytest.approx(last.start_s - 0.3, abs=6e-4),
        trial.trajectory.end_s,
    )
    assert any("0.3 s before and after" in note for note in trial.notes)
    stated = ImportOptions(person=PERSON, window=Window(start_s=0.1, end_s=2.9))
    [item] = import_walks(files, stated).items
    assert (item.trial.start_s, item.trial.end_s) == (0.1, 2.9)


def test_the_effect_of_a_foot_as_long_as_the_recorded_one_is_shown_where_lengths_differ(
    tmp_path, effect
):
    laboratory = Laboratory(tmp_path)
    files = gather(laboratory.standing(), [laboratory.walk()])
    imported = import_walks(files, ImportOptions(person=PERSON))
    ratio = imported.items[0].trial.calibration.lengths_m["foot_right"] / 0.245
    assert abs(ratio - 1.0) > 0.05 and not imported.scaled and effect == [pytest.approx(ratio)]
    assert imported.scaling == ("the effect",) and "the effect" in imported.items[0].notes
    assert imported.items[0].trial.model.foot.length_m == 0.245


def test_model_feet_are_those_that_the_simulation_walks_on():
    trial = load_trial(resource("data/reference_subject/exact/medium_1.yaml"))
    item = examine(trial)
    gait = make_gait(trial.subject, trial.model)
    context = gait.diagram.CreateDefaultContext()
    plant_context, person = gait.plant_context(context), gait.person
    row = len(trial.trajectory.time_s) // 2
    motion = trial.trajectory.ordered(person.coordinate_names)
    q = np.zeros(gait.plant.num_positions())
    for name, value in zip(motion.names, motion.values[row], strict=True):
        q[gait.plant.GetJointByName(name).position_start()] = value
    gait.plant.SetPositions(plant_context, q)
    for side, sites in (("right", person.foot.sites), ("left", person.intact_sites)):
        heights = [
            (gait.plant.EvalBodyPoseInWorld(plant_context, gait.plant.get_body(body)) @ place)[2]
            - radius
            for body, place, radius in zip(
                sites.body_indices, sites.p_BS, sites.radius, strict=True
            )
        ]
        assert item.feet[side].lowest_m[row] == pytest.approx(np.min(heights), abs=1e-12)


def test_offsets_of_the_manifest_move_the_prosthesis_that_is_judged():
    trial = load_trial(resource("data/reference_subject/exact/medium_1.yaml"))
    raised = dataclasses.replace(trial, offsets=dataclasses.replace(trial.offsets, height_m=0.03))
    here, there = (
        next(c for c in examine(t).checks if c.name == "height at touch-down" and c.side == "right")
        for t in (trial, raised)
    )
    # along the shank, which leans back by some 20 degrees at touch-down
    assert there.value - here.value == pytest.approx(30.0 * np.cos(np.radians(20.0)), abs=2.0)
    assert there.mark == "doubtful"
