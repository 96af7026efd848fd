"""Files that belong together, and persons whose mass only the forces tell."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import ezc3d
import numpy as np
import pytest
from made_c3d import MadePlate, rectangle, with_parameters, write_c3d
from made_laboratory import MASS, Laboratory

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import resource
from vsf_drake.model.model_file import in_shell
from vsf_drake.model.parameters import ModelParameters
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.formats.read import read_trial
from vsf_drake.motion.manifest import Window
from vsf_drake.motion.markers.person_facts import PersonFacts
from vsf_drake.motion.trial import load_trial
from vsf_drake.plants.gait import make_gait
from vsf_drake.recording import import_walks as module
from vsf_drake.recording.examine import examine
from vsf_drake.recording.force_checks import ZERO
from vsf_drake.recording.import_walks import (
    ImportOptions,
    gather,
    import_walks,
    walk_names,
)
from vsf_drake.report.import_outputs import write_import
from vsf_drake.simulation.walk import Walker

PERSON = PersonFacts(sex="male", prosthetic_side="right", mass_kg=MASS, stature_m=1.81)


def options(**changed) -> ImportOptions:
    return ImportOptions(**{"person": PERSON, "fulcrum_mm": (108.0,)} | changed)


@pytest.fixture(autouse=True)
def shells(monkeypatch):
    """Feet that the first walk was walked with, and what came of each; two fits of the offsets take
    seconds."""
    told = SimpleNamespace(walked=[], errors_bw=[0.06, 0.05], cop_m=[0.02, 0.02])

    def walked(trial, **options):
        told.walked.append(trial.model.foot)
        return (trial.model.foot,)

    def metrics(foot, plate):
        number = (len(told.walked) - 1) % 2
        return SimpleNamespace(
            foot_length_m=foot.length_m,
            error_bw=told.errors_bw[number],
            cop_rmse_fl=told.cop_m[number] / foot.length_m,
            cop_ml_rmse_fl=0.01,
        )

    monkeypatch.setattr(module, "walk_trial", walked)
    monkeypatch.setattr(module, "walk_metrics", metrics)
    return told


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


def test_a_standing_trial_that_a_shell_names_again_among_the_walks_is_taken_out_of_them(tmp_path):
    """`import static.c3d *.c3d` names it twice; without one the walks calibrate, on --no-standing
    alone."""
    standing, *walks = touch(tmp_path, "static.c3d", "walk1.c3d", "walk2.c3d")
    files = gather(standing, [standing, *walks])
    assert (files.standing, files.walks, files.repeated) == (standing, tuple(walks), standing)
    assert gather(standing, walks).repeated is None
    assert gather(None, walks).standing is None and gather(None, walks).walks == tuple(walks)
    with pytest.raises(InputError, match=r"only file.*--no-standing"):
        gather(standing, [standing])


@pytest.mark.parametrize("newton", [30.0, -30.0])
def test_a_plate_that_was_not_zeroed_tells_no_other_mass_and_no_other_side(
    monkeypatch, tmp_path, newton
):
    """Forces that were assigned to feet are zero outside of loads, so that only the plate shows
    what it reads at rest, 30 N: 4 % of the mass. The manifest keeps it for who checks the trial."""

    def shown(*args, **axes):
        recording = read_trial(*args, **axes)
        return dataclasses.replace(
            recording,
            plates=tuple(
                dataclasses.replace(plate, force_n=plate.force_n + newton * np.eye(3)[2])
                if plate.name == under_right
                else plate
                for plate in recording.plates
            ),
        )

    folder = resource("data/reference_subject/c3d")
    files = gather(folder / "static.c3d", [folder / "low_1.c3d"])
    [right] = import_walks(files, options()).items
    [under_right] = {load.plate for load in right.trial.contacts if load.side == "right"}
    monkeypatch.setattr(module, "read_trial", shown)
    imported = import_walks(files, options())
    [item] = imported.items
    for name in ("mass from the forces", "body mass"):
        masses = [
            [check.value for check in each.checks if check.name == name] for each in (right, item)
        ]
        assert masses[1] == pytest.approx(masses[0], abs=0.5)
    assert not [check for check in item.checks if check.name == "side of the prosthesis"]
    assert item.trial.plates["right"].force_W[:, 2].max() == pytest.approx(
        right.trial.plates["right"].force_W[:, 2].max() + newton, abs=1e-6
    ), "what drives and is fitted stays as recorded"
    write_import(imported, tmp_path / "out")
    again = examine(load_trial(tmp_path / "out" / "low_1.yaml"))
    zeros, told = (
        {
            check.side: (check.mark, check.cost_bw, check.value)
            for check in each.checks
            if check.name.startswith(ZERO)
        }
        for each in (item, again)
    )
    assert told["right"][:2] == (zeros["right"][0], pytest.approx(zeros["right"][1], rel=1e-3))
    assert told["right"][2] == pytest.approx(newton, abs=0.5)
    assert abs(told["left"][2]) < 1.0
    masses = [
        [check.value for check in each.checks if check.name == "mass from the forces"]
        for each in (item, again)
    ]
    assert masses[1] == pytest.approx(masses[0], abs=0.5)


@pytest.mark.parametrize("walk", ["low_1", "medium_1", "high_1"])
def test_the_wrong_side_is_told_by_the_better_fit_of_the_other_one(walk):
    """A passive foot under its pylon and an ankle that moves: the same recording read both ways."""
    folder = resource("data/reference_subject/c3d")
    files = gather(folder / "static.c3d", [folder / f"{walk}.c3d"])
    for side in ("right", "left"):
        person = dataclasses.replace(PERSON, prosthetic_side=side)
        [item] = import_walks(files, options(person=person)).items
        doubts = [check for check in item.checks if check.name == "side of the prosthesis"]
        assert len(doubts) == (side == "left"), "the reference subject's prosthesis is on the right"
        assert all(
            "a prosthesis on the right better" in doubt.sentence and doubt.needed
            for doubt in doubts
        )
        assert item.mark == ("doubtful" if doubts else "good")


def test_one_walk_that_fits_the_other_side_better_among_others_that_do_not_casts_no_doubt(
    monkeypatch,
):
    """By chance one walk of a person may: the mean of all counts."""
    shares = {"low_1": 0.10, "medium_1": 0.02, "high_1": 0.02}  # as stated; 0.06 the other way

    def misfit(item):
        as_stated = item.trial.subject.prosthetic_side == "right"
        return shares[item.trial.path.stem] if as_stated else 0.06

    monkeypatch.setattr(module, "_misfit_bw", misfit)
    folder = resource("data/reference_subject/c3d")
    doubted = {}
    for names in (("low_1",), ("low_1", "medium_1", "high_1")):
        files = gather(folder / "static.c3d", [folder / f"{name}.c3d" for name in names])
        [*items] = import_walks(files, options()).items
        doubted[len(names)] = {
            "side of the prosthesis" in {check.name for check in item.checks} for item in items
        }
    assert doubted == {1: {True}, 3: {False}}


def test_the_other_side_is_tried_on_the_walks_that_bear_it_and_without_inverse_kinematics(
    monkeypatch,
):
    make, refined = module.trial_from_recordings, []

    def not_on_the_right_in_low_1(standing, walk, marker_map, person, *rest, **named):
        if person.prosthetic_side == "right" and walk.path.stem == "low_1":
            raise InputError("no plate carries the right foot alone")
        return make(standing, walk, marker_map, person, *rest, **named)

    monkeypatch.setattr(module, "trial_from_recordings", not_on_the_right_in_low_1)
    monkeypatch.setattr(
        module, "refined", lambda trial, **_: refined.append(trial.subject.prosthetic_side) or trial
    )
    folder = resource("data/reference_subject/c3d")
    files = gather(
        folder / "static.c3d", [folder / f"{walk}.c3d" for walk in ("low_1", "medium_1")]
    )
    person = dataclasses.replace(PERSON, prosthetic_side="left")
    told = []
    items = import_walks(
        files,
        options(person=person, inverse_kinematics=True),
        progress=lambda what, share: told.append((share, what)),
    ).items
    assert [
        "side of the prosthesis" in {check.name for check in item.checks} for item in items
    ] == [True, True]
    assert refined == ["left", "left"] and told == sorted(told), (
        "each walk once, and the bar never goes back"
    )


def test_the_fulcrum_is_never_assumed(tmp_path):
    laboratory = Laboratory(tmp_path)
    with pytest.raises(InputError, match=r"--fulcrum-mm.*must be stated"):
        import_walks(gather(laboratory.standing(), [laboratory.walk()]), options(fulcrum_mm=()))


@pytest.mark.parametrize(("length_m", "fulcrum_m"), [(0.22, 0.066), (0.30, 0.151)])
def test_a_foot_in_a_shell_of_another_size_walks(length_m, fulcrum_m):
    trial = load_trial(resource("data/reference_subject/exact/medium_1.yaml"))
    model = dataclasses.replace(trial.model, foot=in_shell(trial.model.foot, length_m))
    walk = Walker(trial.subject, model).walk(
        trial.trajectory,
        fulcrum_m=fulcrum_m,
        start_s=trial.start_s,
        end_s=trial.start_s + 0.5,
        step_s=2e-3,
    )
    weight = trial.subject.mass_kg * 9.81
    assert 0.5 * weight < walk.prosthetic.grf_W[:, 2].max() < 2.5 * weight


def test_a_walk_whose_plates_are_not_read_says_so_and_not_that_it_has_none(tmp_path):
    count = 100
    cop = np.zeros((count, 3))
    force = np.tile([0.0, 0.0, 700.0], (count, 1))
    plate = MadePlate(2, force, cop, np.zeros(count), rectangle((0.0, 0.0)))
    markers = {label: np.tile([0.1, 0.2, z], (count, 1)) for label, z in (("A", 0.1), ("B", 0.9))}
    path = write_c3d(tmp_path / "walk.c3d", markers, plates=(plate,), subframes=1)
    with_parameters(path, "FORCE_PLATFORM", TYPE=np.array([21]))
    with pytest.raises(
        InputError, match=r"Force plate 1 of walk.c3d is of type 21 \(AMTI stairs\)"
    ):
        import_walks(gather(None, [path]), options())


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
    imported = import_walks(gather(standing, walks), options(person=person))
    masses = {item.trial.subject.mass_kg for item in imported.items}
    assert len(masses) == 1
    assert len({item.trial.subject for item in imported.items}) == 1
    for item in imported.items:
        assert item.checks[0].name == "body mass"
        assert item.checks[0].mark == "doubtful"
    [mass] = masses
    stated = import_walks(
        gather(standing, walks), options(person=dataclasses.replace(PERSON, mass_kg=mass))
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
    [item] = import_walks(gather(standing, [laboratory.walk()]), options(person=person)).items
    assert (item.trial.subject.mass_kg, item.trial.subject.stature_m) == (mass, pytest.approx(1.79))
    marks = {check.name: check.mark for check in item.checks}
    assert marks["mass from the forces"] == mark and not {"body mass", "stature"} & {*marks}


def test_a_walk_keeps_its_stances_on_plates_and_a_little_around_unless_a_window_is_stated(tmp_path):
    laboratory = Laboratory(tmp_path)
    files = gather(laboratory.standing(), [laboratory.walk()])
    [item] = import_walks(files, options()).items
    trial = item.trial
    *_, last = find_stances(trial.prosthetic_plate.time_s, trial.prosthetic_plate.force_W[:, 2])
    [(_, unmeasured_end)] = trial.unmeasured["right"][1:]  # the stances before it are cut
    assert last.start_s - 0.3 > unmeasured_end and last.end_s + 0.3 > trial.trajectory.end_s
    assert (trial.start_s, trial.end_s) == (
        pytest.approx(last.start_s - 0.3, abs=6e-4),
        trial.trajectory.end_s,
    )
    assert any("0.3 s before and after" in note for note in trial.notes)
    stated = options(window=Window(start_s=0.1, end_s=2.9))
    [item] = import_walks(files, stated).items
    assert (item.trial.start_s, item.trial.end_s) == (0.1, 2.9)


@pytest.mark.parametrize(
    ("errors_bw", "cop_m", "advised"),
    [
        ([0.06, 0.05], [0.02, 0.02], True),
        ([0.05, 0.06], [0.02, 0.01], False),
        ([0.06, 0.05], [0.01, 0.02], False),
        ([0.06, None], [0.02, 0.02], False),
    ],
)
def test_a_shell_as_long_as_the_recorded_foot_is_shown_and_advised_where_force_and_cop_get_nearer(
    tmp_path, shells, errors_bw, cop_m, advised
):
    shells.errors_bw = errors_bw
    shells.cop_m = cop_m
    laboratory = Laboratory(tmp_path)
    files = gather(laboratory.standing(), [laboratory.walk()])
    imported = import_walks(files, options())
    [item] = imported.items
    recorded_m = item.trial.calibration.lengths_m["foot_right"]
    assert abs(recorded_m / 0.245 - 1.0) > 0.05
    assert [foot.length_m for foot in shells.walked] == [0.245, pytest.approx(recorded_m)]
    [told] = imported.told
    assert told in item.trial.notes and "would change of" in told
    assert (f"--foot-length-mm {1e3 * recorded_m:.0f}" in told) == advised
    assert ("do not both get nearer" in told) != advised
    assert item.trial.model.foot.length_m == 0.245


def test_a_stated_shell_is_walked_on_and_held_against_the_models(tmp_path, shells):
    laboratory = Laboratory(tmp_path)
    files = gather(laboratory.standing(), [laboratory.walk()])
    imported = import_walks(files, options(foot_length_mm=280.0))
    foot = imported.items[0].trial.model.foot
    assert foot == in_shell(ModelParameters().foot, 0.28)
    assert [each.length_m for each in shells.walked] == [0.245, 0.28]
    assert "What a shell of 280 mm changed of" in imported.told[0]
    assert any("280 mm long, as stated" in note for note in imported.items[0].trial.notes)


@pytest.mark.parametrize("length_mm", [27.5, 100.0, 310.0])
def test_a_shell_that_no_foot_has_is_refused_whoever_asks(tmp_path, length_mm):
    laboratory = Laboratory(tmp_path)
    files = gather(laboratory.standing(), [laboratory.walk()])
    with pytest.raises(InputError, match=r"foot_length_mm.*between 220 and 300 mm"):
        import_walks(files, options(foot_length_mm=length_mm))


def test_a_stated_shell_of_the_models_length_changes_nothing(tmp_path, shells):
    laboratory = Laboratory(tmp_path)
    files = gather(laboratory.standing(), [laboratory.walk()])
    [item] = import_walks(files, options(foot_length_mm=245.0)).items
    assert item.trial.model.foot == ModelParameters().foot and not shells.walked


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
