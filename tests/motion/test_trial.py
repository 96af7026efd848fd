"""A whole trial, of joint angles or of markers and plates: what comes of it, and how it cannot be
used."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Sequence

import numpy as np
import pytest
import yaml
from made_person import Person, markers, poses, recording_of, walking_angles
from virtual_laboratory.trc import write_trc

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import resource
from vsf_drake.base.schema import dump_yaml
from vsf_drake.model.model_file import in_shell
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import kinematic_stances
from vsf_drake.motion.formats.recording import Plate, Recording
from vsf_drake.motion.formats.tables import write_forces_mot
from vsf_drake.motion.manifest import Window
from vsf_drake.motion.markers.person_facts import PersonFacts
from vsf_drake.motion.markers.segments import FootTrack
from vsf_drake.motion.trial import (
    NO_PLATE,
    PLACEHOLDER_KG,
    TrialOptions,
    default_model,
    load_trial,
    model_ankle,
    trial_from_recordings,
    write_trial_files,
)

HEAVY = 80.0
WEIGHT = HEAVY * 9.80665
SPEED = 1.1


def message(files):
    with pytest.raises(InputError) as caught:
        load_trial(files.write())
    assert str(files.folder) in str(caught.value)
    return str(caught.value)


def test_constructed_walk(trial_files):
    path = trial_files.write()
    trial = load_trial(path)
    assert (trial.name, trial.synthetic, trial.fulcrum_m) == ("trial", False, pytest.approx(0.066))
    assert (trial.start_s, trial.end_s) == (0.0, pytest.approx(1.8))
    assert trial.subject.mass_kg == 80.0 and set(trial.plates) == {"left", "right"}
    assert trial.model == default_model() and trial.prosthetic_plate is trial.plates["right"]
    impulse = np.trapezoid(trial.prosthetic_plate.force_W[:, 2], trial.prosthetic_plate.time_s)
    assert impulse == pytest.approx(1.1 * WEIGHT * 0.7 * 2 / np.pi, rel=1e-4)
    assert any("right (prosthetic) foot" in n and "complete" in n for n in trial.notes)
    assert trial.inputs == {
        name: hashlib.sha256((trial_files.folder / name).read_bytes()).hexdigest()
        for name in ("trial.yaml", "subject.yaml", "walk_ik.mot", "walk_grf.mot")
    }
    assert not any("treadmill" in n for n in trial.notes)


def test_window_of_the_manifest_is_cut_to_kinematics_and_forces(trial_files):
    trial_files.manifest["window"] = {"start_s": 0.5, "end_s": 5.0}
    rows = trial_files.force_time <= 1.5
    trial_files.force_time = trial_files.force_time[rows]
    trial_files.forces = {n: v[rows] for n, v in trial_files.forces.items()}
    trial = load_trial(trial_files.write())
    assert (trial.start_s, trial.end_s) == (pytest.approx(0.5), pytest.approx(1.5))
    assert any("cut to the kinematics" in n for n in trial.notes)
    assert any("cut to the force record" in n for n in trial.notes)
    assert any(
        "right (prosthetic) foot" in n and n.endswith("cut at its start.") for n in trial.notes
    )


def test_a_stated_length_of_the_shell_is_the_models_foot_in_it_and_is_told(trial_files):
    trial_files.manifest["prosthesis"] |= {"foot_length_mm": 220}
    trial = load_trial(trial_files.write())
    assert trial.model.foot == in_shell(default_model().foot, 0.22)
    told = next(note for note in trial.notes if "The shell of the prosthetic foot is" in note)
    # rear end of the shell 12 mm behind A in 245 mm, end of the keel 229 mm ahead of it
    assert f"ends {229 - 220 * 233 / 245:.0f} mm ahead of so short a shell" in told


def test_a_passive_foot_needs_no_fulcrum_in_the_manifest_and_can_have_none(trial_files):
    trial_files.manifest["model"] = "package://vsf_drake/passive.yaml"
    with pytest.raises(InputError, match=r"trial\.yaml.*prosthesis\.fulcrum_mm: this foot has no"):
        load_trial(trial_files.write())
    del trial_files.manifest["prosthesis"]
    trial = load_trial(trial_files.write())
    assert trial.setting.setting_words == "foot passive"
    assert trial.fulcrum_m == trial.model.foot.fulcrum.rearmost_m


def test_where_the_fulcrum_of_a_foot_that_has_one_stood_must_be_stated(trial_files):
    for stated in ({}, {"foot_length_mm": 250}):
        trial_files.manifest["prosthesis"] = stated
        with pytest.raises(InputError, match=r"prosthesis\.fulcrum_mm: the key is missing.*mm"):
            load_trial(trial_files.write())


@pytest.mark.parametrize("length_mm", [27.0, 0.27, 310.0])
def test_a_length_of_the_shell_that_no_foot_has_is_refused(trial_files, length_mm):
    trial_files.manifest["prosthesis"] |= {"foot_length_mm": length_mm}
    with pytest.raises(InputError, match=r"prosthesis.foot_length_mm.*between 220 and 300 mm"):
        load_trial(trial_files.write())


def test_an_own_model_that_makes_no_foot_in_the_stated_shell_is_refused_with_the_manifest(
    trial_files,
):
    """Of its spheres the rearmost, 1 mm behind the end of the heel block, then lie ahead of it."""
    foot = default_model().foot
    zones = tuple(
        dataclasses.replace(zone, x_mm=tuple(max(x, 65.0) for x in zone.x_mm))
        for zone in foot.zones
    )
    model = dataclasses.replace(default_model(), foot=dataclasses.replace(foot, zones=zones))
    own = trial_files.folder / "own.yaml"
    own.write_text(dump_yaml(model), encoding="utf-8")
    trial_files.manifest["model"] = own.name
    load_trial(trial_files.write())
    trial_files.manifest["prosthesis"] |= {"foot_length_mm": 290}
    with pytest.raises(
        InputError, match=r"trial.yaml.*prosthesis.foot_length_mm, foot.zones.*heel block"
    ):
        load_trial(trial_files.write())


@pytest.mark.parametrize(
    ("window", "wanted"),
    [
        (
            {"start_s": 3.0},
            (
                "window: the window of 3.000 to 1.800 s and the kinematics of 0.000 to 1.800 s do "
                "not overlap"
            ),
        ),
        (
            {"start_s": 0.4, "end_s": 0.9},
            "the trial of 0.400 to 0.900 s is shorter than one stance (0.69",
        ),
        (
            {"start_s": 1.0, "end_s": 1.8},
            "the right (prosthetic) foot carries no load from 1.000 to 1.800 s. "
            "The stances of the right foot are 0.305 to 0.995 s",
        ),
    ],
)
def test_window_without_a_stance_is_refused(trial_files, window, wanted):
    trial_files.manifest["window"] = window
    assert wanted in message(trial_files)


def test_a_window_never_begins_inside_a_span_of_unknown_force_that_holds_another(trial_files):
    trial_files.manifest["unknown_force"] = {"right": [[0.0, 0.28], [0.1, 0.15]]}
    trial = load_trial(trial_files.write())
    assert (trial.start_s, trial.end_s) == (0.28, pytest.approx(1.8))
    assert trial.prosthetic_plate.unknown_s == ((0.0, 0.28),)


@pytest.mark.parametrize(
    ("share", "late_s", "wanted"),
    [
        (
            0.01,
            0.0,
            "the right (prosthetic) foot has no stance: its largest vertical force is 8.63 N. "
            "If no plate carried it, write `forces: none`",
        ),
        (0.2, 0.0, "0.22 times the body weight. Check the unit of the forces"),
        (
            1.0,
            10.0,
            (
                "forces: the forces of 10.000 to 11.800 s and the window of 0.000 to 1.800 s do "
                "not overlap"
            ),
        ),
    ],
)
def test_forces_that_are_not_this_walks_are_refused(trial_files, share, late_s, wanted):
    for axis in "xyz":
        trial_files.forces[f"ground_force_r_v{axis}"] *= share
    trial_files.force_time = trial_files.force_time + late_s
    assert wanted in message(trial_files)


def test_belt_speed_makes_the_same_trial_as_walking_over_ground_and_is_asked_for(trial_files):
    over_ground = load_trial(trial_files.write())
    trial_files.columns["pelvis_tx"] = trial_files.columns["pelvis_tx"] - SPEED * trial_files.time
    for side in "rl":
        name = f"ground_force_{side}_px"
        trial_files.forces[name] = trial_files.forces[name] - SPEED * trial_files.force_time
    assert any(
        "-0.81 m/s through stance: a treadmill?" in n for n in load_trial(trial_files.write()).notes
    )
    trial_files.manifest["belt_speed_m_per_s"] = SPEED
    treadmill = load_trial(trial_files.write())
    np.testing.assert_allclose(
        treadmill.trajectory.values, over_ground.trajectory.values, atol=1e-8
    )
    for side in ("right", "left"):
        np.testing.assert_array_equal(
            treadmill.plates[side].force_W, over_ground.plates[side].force_W
        )
        np.testing.assert_allclose(
            treadmill.plates[side].cop_W, over_ground.plates[side].cop_W, atol=1e-8
        )
    assert any("treadmill" in note for note in treadmill.notes)


def on_two_plates(trial_files):
    """The weight on the left foot, then on the right one, then on the left, shared evenly for 0.1 s
    in between."""
    right = np.interp(trial_files.force_time, [0.3, 0.4, 0.9, 1.0], [0.0, 1.0, 1.0, 0.0])
    trial_files.forces["ground_force_r_vy"][:] = WEIGHT * right
    trial_files.forces["ground_force_l_vy"][:] = WEIGHT * (1.0 - right)
    for side in "rl":
        trial_files.forces[f"ground_force_{side}_px"][:] = 0.5


@pytest.mark.parametrize(
    ("mass_kg", "words"),
    [
        (HEAVY / 0.45359237, f"Is it in pounds? 176.37 lb are {HEAVY:.1f} kg"),
        (3.0 * HEAVY, "prosthesis included"),
        (0.7 * HEAVY, "prosthesis included"),
    ],
)
def test_mass_that_the_plates_contradict_is_refused(trial_files, mass_kg, words):
    """The stance of one foot between two of the other carries the weight throughout, and momentum
    returns."""
    on_two_plates(trial_files)
    trial_files.subject["mass_kg"] = mass_kg
    text = message(trial_files)
    assert (
        "subject.yaml: mass_kg: the plates contradict" in text
        and f"the weight of {HEAVY:.1f} kg" in text
    )
    assert words in text


# Markers and plates of a made person become the trial that was made, and can be written as OpenSim
# files.


TIME = np.arange(0.0, 3.0, 0.01)
FORCE_TIME = np.arange(0.0, 2.9901, 0.001)
MASS = 78.0
ANGLES = walking_angles(TIME)


def feet(person: Person) -> dict[str, FootTrack]:
    """The true soles and ankles."""
    where = poses(ANGLES | {"pelvis_ty": np.full(len(TIME), 0.93)}, person)
    found = {}
    for side in ("right", "left"):
        R, p = where[f"foot_{side}"]
        heel, toe = (p + R @ point for point in person.sole(side))
        found[side] = FootTrack(heel, toe, p)
    return found


def stances(person: Person) -> dict[str, list]:
    pelvis = np.column_stack([ANGLES["pelvis_tx"], 0 * TIME, 0 * TIME])
    return {side: kinematic_stances(TIME, track, pelvis) for side, track in feet(person).items()}


def plates(person: Person, *, missed: Sequence[tuple[str, int]] = ()) -> tuple[Plate, ...]:
    """Two plates, one under each foot, that share the weight; `missed` steps (side, index) are
    beside them."""
    load = {}
    for side, found in stances(person).items():
        load[side] = np.zeros(len(FORCE_TIME))
        for i, s in enumerate(found):
            if (side, i) in missed:
                continue
            start = s.start_s if s.start_seen else s.start_s - 0.2
            end = s.end_s if s.end_seen else s.end_s + 0.2
            load[side] += np.clip(np.minimum(FORCE_TIME - start, end - FORCE_TIME) / 0.1, 0.0, 1.0)
    total = np.maximum(sum(load.values()), 1e-9)
    made = []
    for side, track in feet(person).items():
        share = load[side] / np.maximum(total, 1.0)
        force = np.column_stack([0.05 * share, -0.02 * share, share]) * MASS * GRAVITY
        middle = 0.5 * (track.heel_W + track.toe_W)
        cop = np.column_stack(
            [np.interp(FORCE_TIME, TIME, middle[:, i]) for i in range(2)] + [0 * FORCE_TIME]
        )
        on = force[:, 2] > 20.0
        made.append(
            Plate(
                f"plate_{side[0]}",
                force,
                np.where(on[:, None], cop, np.nan),
                np.where(on, 2.0, 0.0),
            )
        )
    return tuple(made)


def walk(
    person: Person | None = None,
    *,
    missed: Sequence[tuple[str, int]] = (),
    label_set: str = "rajagopal",
) -> Recording:
    """Markers and plates."""
    person = person or Person()
    angles = ANGLES | {"pelvis_ty": np.full(len(TIME), 0.93)}
    return recording_of(
        markers(angles, person, label_set=label_set),
        plates=plates(person, missed=missed),
        force_rate_hz=1000.0,
        path="walk.c3d",
    )


def standing(person: Person | None = None, *, label_set: str = "rajagopal") -> Recording:
    """A second and a half of standing."""
    return recording_of(
        markers({}, person or Person(), label_set=label_set, frames=150), path="static.c3d"
    )


PERSON = PersonFacts(mass_kg=MASS, stature_m=1.8, sex="male", prosthetic_side="right")
BOTH = pytest.mark.parametrize("side", ["right", "left"])


def make(side="right", person=PERSON, walked=None, still=True, **options):
    facts = dataclasses.replace(person, prosthetic_side=side)
    return trial_from_recordings(
        standing() if still else None,
        walked or walk(),
        None,
        facts,
        TrialOptions(**({"cutoff_hz": None} | options)),
        fulcrum_m=0.066,
    )


@BOTH
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
    assert [c.side for c in trial.contacts] == ["right", "left"] * 3
    assert any("rajagopal, which knows" in note for note in trial.notes)


@BOTH
def test_markers_without_plates_give_the_same_motion(side):
    bare = make(side, walked=dataclasses.replace(walk(), plates=(), force_rate_hz=None))
    assert bare.plates == {} and bare.contacts == () and bare.plate is None
    assert np.array_equal(bare.trajectory.values, make(side).trajectory.values)
    assert [note for note in bare.notes if "plate" in note.lower()] == [
        note for note in bare.notes if note.startswith(NO_PLATE)
    ]


@BOTH
def test_prosthetic_ankle_of_the_model_is_where_the_markers_show_it(side):
    """Also with a thigh that is stated 3 cm longer than it is: the pelvis makes up for it."""
    trial = make(side, stated={"prosthetic_thigh_length_m": 0.46})
    assert trial.subject.prosthetic_thigh_length_m == 0.46
    moved = dataclasses.replace(trial.tracked, values=np.array(trial.tracked.values))
    for name in ("pelvis_tx", "pelvis_ty", "pelvis_tz"):
        moved.values[:, moved.names.index(name)] = trial.trajectory.values[
            :, trial.trajectory.names.index(name)
        ]
    assert np.allclose(
        model_ankle(moved, trial.calibration, trial.subject),
        feet(Person())[side].ankle_W,
        atol=1e-3,
    )
    assert any(
        "prosthetic_thigh_length_m is stated as 0.460 m; the markers give 0.4" in n
        for n in trial.notes
    )


def test_mass_that_is_not_stated_comes_from_a_stride_and_makes_the_person_that_stating_it_makes():
    """The weight says how far the prosthesis was pressed together while it was measured."""
    unknown = dataclasses.replace(PERSON, mass_kg=None)
    weighed = make(person=unknown)
    assert weighed.subject.mass_kg == pytest.approx(MASS, rel=0.01)
    assert any("mean vertical force over" in note for note in weighed.notes)
    stated = make(person=dataclasses.replace(PERSON, mass_kg=weighed.subject.mass_kg))
    assert abs(weighed.subject.mass_kg - PLACEHOLDER_KG) > 1.0
    assert (
        weighed.subject == stated.subject
        and weighed.calibration.method == stated.calibration.method
    )
    with pytest.raises(
        InputError, match=r"mass_kg .*not stated, and there is no stride in which both feet"
    ):
        make(
            person=unknown,
            walked=walk(missed=[("left", 0), ("right", 1), ("left", 1), ("right", 2)]),
        )


def test_steps_beside_the_plates_are_left_out_of_the_window():
    missed = walk(missed=[("right", 2)])
    trial = make(walked=missed)
    ((start, end),) = trial.unmeasured["right"]
    assert start == pytest.approx(2.14 - 0.05, abs=0.05) and end == pytest.approx(
        2.84 + 0.05, abs=0.05
    )
    assert (trial.start_s, trial.end_s) == (0.0, pytest.approx(start))
    assert any("was cut to 0.000 to 2.09" in n and "no plate measures" in n for n in trial.notes)
    wished = make(walked=missed, window=Window(start_s=0.5, end_s=2.9))
    assert wished.end_s == 2.9
    assert any("these samples are compared with nothing" in note for note in wished.notes)
    intact = make(walked=walk(missed=[("left", 1)]))
    assert (intact.start_s, intact.end_s) == (0.0, pytest.approx(2.99)) and intact.unmeasured[
        "left"
    ]


def test_where_the_plates_missed_the_prosthetic_foot_it_is_a_walk_without_plates_and_says_so():
    missed = make(walked=walk(missed=[("right", i) for i in range(3)]))
    assert missed.plate is missed.intact_plate is None and not missed.unmeasured
    assert any("No plate carries the right foot alone" in note for note in missed.notes)
    assert any(note.startswith(NO_PLATE) for note in missed.notes)
    steps = [(side, i) for side in ("right", "left") for i in range(3)]
    unloaded = make(walked=walk(missed=steps))
    assert unloaded.plate is None
    assert any("Plates carry nobody from 0.000 to" in note for note in unloaded.notes)
    whole = make()
    assert (missed.start_s, missed.end_s) == (whole.trajectory.start_s, whole.trajectory.end_s)


@pytest.mark.parametrize("markers", [False, True])
def test_forces_none_leaves_out_the_plates_that_a_file_has(tmp_path, markers):
    folder = resource("data/reference_subject")
    c3d = {"markers": str(folder / "c3d/low_1.c3d"), "standing": str(folder / "c3d/static.c3d")}
    angles = {"kinematics": str(folder / "laboratory/low_1_kinematics.mot")}
    manifest = tmp_path / "walk.yaml"
    manifest.write_text(
        yaml.safe_dump(
            {
                "subject": str(folder / "subject.yaml"),
                "forces": "none",
                "prosthesis": {"fulcrum_mm": 66},
                **(c3d if markers else angles),
            }
        ),
        encoding="utf-8",
    )
    trial = load_trial(manifest)
    assert trial.plate is None and any(note.startswith(NO_PLATE) for note in trial.notes)
    if markers:
        manifest.write_text(manifest.read_text(encoding="utf-8").replace("forces: none\n", ""))
        assert load_trial(manifest).plate is not None, "that of the file"


def spoiled(recording, fault, start, stop):
    """The recording with markers exchanged, hidden or moved in frames `start` to `stop`."""
    markers = {label: np.array(path) for label, path in recording.markers.items()}
    rows = slice(start, stop)
    if fault == "exchange":
        right = np.array(markers["RASI"][rows])
        markers["RASI"][rows] = markers["RMT2"][rows]
        markers["RMT2"][rows] = right
    elif fault == "gap":
        for label in ("RASI", "LASI", "RPSI"):
            markers[label][rows] = np.nan
    else:
        markers["RASI"][rows] += [0.0, 0.4, 0.0]
    return dataclasses.replace(recording, markers=markers)


ONE_PASS = [("left", 1), ("right", 2), ("left", 2)]
"""Steps beside the plates: from 1.9 s on nothing is loaded."""


@pytest.mark.parametrize("fault", ["exchange", "gap", "jump"])
def test_a_fault_of_markers_outside_the_steps_on_plates_does_not_matter(fault):
    sound = make(walked=walk(missed=ONE_PASS))
    trial = make(walked=spoiled(walk(missed=ONE_PASS), fault, 210, 240))
    # the next strike, beside the plates, is told less surely where the record ends
    assert (trial.start_s, trial.end_s) == (sound.start_s, pytest.approx(sound.end_s, abs=0.1))
    count = len(trial.trajectory.time_s)
    np.testing.assert_allclose(trial.trajectory.values, sound.trajectory.values[:count], atol=1e-4)
    np.testing.assert_array_equal(trial.plate.force_W, sound.plate.force_W)
    [note] = [note for note in trial.notes if "as a whole they cannot be" in note]
    assert "around loads on plates" in note and ("RASI" in note or "RPSI" in note)


@pytest.mark.parametrize("fault", ["exchange", "gap", "jump"])
def test_a_fault_of_markers_on_the_plates_is_still_refused(fault):
    walked = walk(missed=[("right", 0), *ONE_PASS])
    for start in (50, 70, 120):
        with pytest.raises(InputError, match=r"RASI|LASI|RPSI"):
            make(walked=spoiled(walked, fault, start, start + 30))


def test_of_two_passes_the_longer_one_is_taken_that_can_be_followed_and_carries_the_prosthesis():
    """The first lasts longer, by half a stance."""
    two = walk(missed=[("right", 1), ("left", 1)])
    assert make(walked=spoiled(two, "exchange", 155, 170)).end_s < 1.6
    assert make(walked=spoiled(two, "exchange", 20, 40)).start_s > 1.5
    left_then_right = walk(missed=[("right", 0), ("right", 1), ("left", 1), ("left", 2)])
    assert make(walked=spoiled(left_then_right, "exchange", 155, 170)).start_s > 1.5


def test_of_a_walk_with_a_stated_window_only_that_has_to_be_followed():
    two = walk()
    bare = dataclasses.replace(two, plates=(), force_rate_hz=None)
    broken = spoiled(bare, "exchange", 20, 40)
    with pytest.raises(InputError, match="RASI"):
        make(walked=broken)
    window = make(walked=broken, window=Window(start_s=1.0, end_s=2.5))
    assert (window.start_s, window.end_s) == (1.0, 2.5)
    assert any("is followed, the window" in note for note in window.notes)


@BOTH
def test_written_files_load_as_the_same_trial(side, tmp_path):
    trial = make(side, cutoff_hz=6.0)
    names = write_trial_files(trial, tmp_path, "walk")
    assert names == ("walk_ik.mot", "walk_grf.mot")
    (tmp_path / "subject.yaml").write_text(dump_yaml(trial.subject))
    (tmp_path / "trial.yaml").write_text(
        yaml.safe_dump(
            {
                "subject": "subject.yaml",
                "kinematics": names[0],
                "forces": names[1],
                "prosthesis": {"fulcrum_mm": 66},
                "window": {"start_s": trial.start_s, "end_s": trial.end_s},
            }
        )
    )
    again = load_trial(tmp_path / "trial.yaml")
    assert again.trajectory.names == trial.trajectory.names and again.subject == trial.subject
    assert (again.start_s, again.end_s) == (trial.start_s, trial.end_s)
    assert np.allclose(again.trajectory.time_s, trial.trajectory.time_s, atol=1e-9)
    assert np.allclose(again.trajectory.values, trial.trajectory.values, atol=1e-9)
    for foot, plate in trial.plates.items():
        for field in ("time_s", "force_W", "cop_W", "free_moment_nm"):
            assert np.allclose(
                getattr(again.plates[foot], field), getattr(plate, field), atol=1e-6, equal_nan=True
            )
    header = (tmp_path / "walk_ik.mot").read_text().splitlines()[6]
    assert {"ankle_angle_r", "ankle_angle_l"} <= set(header.split("\t"))


def write_manifest(folder, **changed):
    """A laboratory's own files: TRC for markers, MOT for plates."""
    write_trc(folder / "walk.trc", walk())
    write_trc(folder / "static.trc", standing())
    made = dict(zip("12", plates(Person()), strict=True))
    write_forces_mot(folder / "walk.mot", time_s=FORCE_TIME, plates=made)
    (folder / "subject.yaml").write_text(
        yaml.safe_dump(
            {"mass_kg": MASS, "stature_m": 1.8, "sex": "male", "prosthetic_side": "right"}
            | changed.pop("subject", {})
        )
    )
    keys = {
        "subject": "subject.yaml",
        "markers": "walk.trc",
        "standing": "static.trc",
        "forces": "walk.mot",
        "marker_map": "rajagopal",
        "prosthesis": {"fulcrum_mm": 108},
        "already_filtered": True,
    }
    path = folder / "trial.yaml"
    path.write_text(yaml.safe_dump({k: v for k, v in (keys | changed).items() if v is not None}))
    return path


def test_manifest_states_lengths_plates_map_and_filter(tmp_path):
    (tmp_path / "ours.yaml").write_text(
        "description: ours\nprefix: any\nright: {}\nleft: {}\nmiddle: {}\n"
    )
    path = write_manifest(
        tmp_path,
        subject={"prosthesis_length_m": 0.52},
        already_filtered=None,
        marker_cutoff_hz=10,
        forces={"file": "walk.mot", "right": "ground_force_1", "left": "ground_force_2"},
    )
    trial = load_trial(path)
    assert trial.subject.prosthesis_length_m == 0.52
    assert [c.side for c in trial.contacts][:2] == ["right", "left"]
    assert not any("filtered already" in note for note in trial.notes)
    for changed, words in (
        ({"marker_map": "theirs.yaml"}, r"marker_map: there is no file theirs\.yaml"),
        ({"marker_map": "ours.yaml"}, r"ours\.yaml"),
        ({"standing": "absent.trc"}, r"trial\.yaml: standing: there is no file absent\.trc"),
    ):
        with pytest.raises(InputError, match=words):
            load_trial(write_manifest(tmp_path, **changed))
