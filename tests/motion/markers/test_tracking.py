"""Tracking: a made person's angles come back, and what is not that person's walk, or exchanged, is
refused by name."""

import dataclasses
import re

import numpy as np
import pytest
from flat_feet import PERSON, flat_feet
from hypothesis import given, settings
from hypothesis import strategies as st
from made_calibration import true_calibration
from made_person import Person, markers, poses, recording_of, walking_angles
from scipy.spatial.transform import Rotation

from vsf_drake.base.errors import InputError
from vsf_drake.motion.formats.read import read_trial
from vsf_drake.motion.markers.calibration import PersonFacts, calibrate
from vsf_drake.motion.markers.joints import orientations_of
from vsf_drake.motion.markers.maps import load_marker_map
from vsf_drake.motion.markers.posture import prepared
from vsf_drake.motion.markers.tracking import fill_gaps, track

TIME = np.arange(200) / 100.0
ANGLES = walking_angles(TIME)
LABEL_SETS = pytest.mark.parametrize("label_set", ["plug_in_gait", "rajagopal", "opensim", "ior"])


def made(label_set="rajagopal", person=None, **changes):
    return recording_of(markers(ANGLES, person, label_set=label_set, medial=False) | changes)


def path(label, label_set="rajagopal"):
    return made(label_set).markers[label].copy()


@LABEL_SETS
@pytest.mark.parametrize("medial", [True, False])
def test_the_angles_that_the_markers_were_made_from_come_back(label_set, medial):
    recording = recording_of(markers(ANGLES, label_set=label_set, medial=medial))
    motion = track(recording, true_calibration(label_set=label_set, medial=medial), cutoff_hz=None)
    for k, name in enumerate(motion.names):
        truth = poses(ANGLES)["pelvis"][1][:, 2] if name == "pelvis_ty" else ANGLES.get(name, 0.0)
        np.testing.assert_allclose(motion.values[:, k], truth, atol=1e-9)
    np.testing.assert_allclose(motion.time_s, TIME)
    assert max(motion.residual_rms_m.values()) < 1e-9 and max(motion.joint_gap_m.values()) < 1e-9
    assert max(motion.cluster_motion_m.values()) < 1e-9
    assert set(motion.joint_gap_m) == {
        f"{joint}_{side}" for joint in ("hip", "knee", "ankle") for side in ("right", "left")
    }


@LABEL_SETS
def test_feet_are_where_their_markers_put_them(label_set):
    person = Person(heel_behind_ankle=0.05, foot=(0.25, 0.28), ankle_height=(0.085, 0.095))
    motion = track(made(label_set, person), true_calibration(person, label_set), cutoff_hz=None)
    for side in ("right", "left"):
        R, p = poses(ANGLES, person)[f"foot_{side}"]
        heel, toe = person.sole(side)
        np.testing.assert_allclose(motion.feet[side].heel_W, R @ heel + p, atol=1e-9)
        np.testing.assert_allclose(motion.feet[side].toe_W, R @ toe + p, atol=1e-9)
        np.testing.assert_allclose(motion.feet[side].ankle_W, p, atol=1e-9)


def test_a_foot_of_markers_on_a_line_with_its_ankle_keeps_the_line_and_rolls_with_the_shank():
    person = Person(ankle_height=(0.045, 0.045))
    motion = track(
        made("plug_in_gait", person), true_calibration(person, "plug_in_gait"), cutoff_hz=None
    )
    R_W, _ = orientations_of(motion.values)
    for side in ("right", "left"):
        truth = poses(ANGLES, person)
        R, p = truth[f"foot_{side}"]
        places = {role: person.points(side)[role][1] for role in ("heel", "toe")}
        line = R @ (places["toe"] - places["heel"])
        turned = R_W[f"foot_{side}"] @ (places["toe"] - places["heel"])
        np.testing.assert_allclose(turned, line, atol=2e-4)
        np.testing.assert_allclose(motion.feet[side].ankle_W, p, atol=2e-3)
        # Across the line, as near to the shank's axis to the left as can be.
        line /= np.linalg.norm(line, axis=1, keepdims=True)
        left = truth[f"shank_{side}"][0][:, :, 1]
        across = left - np.sum(left * line, axis=1, keepdims=True) * line
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        np.testing.assert_allclose(R_W[f"foot_{side}"][:, :, 1], across, atol=2e-3)
        assert np.abs(R[:, :, 1] - across).max() > 0.02, "the ankle's own roll is not seen"


def test_a_foot_that_rolls_with_its_shank_is_level_in_the_posture_of_the_standing_trial():
    """Legs apart on level soles: each ankle is adducted by what its hip is abducted."""
    person = Person(ankle_height=(0.045, 0.045))
    apart = {f"hip_adduction_{s}": -0.1 for s in "rl"} | {f"ankle_adduction_{s}": 0.1 for s in "rl"}
    facts = PersonFacts(mass_kg=80.0, stature_m=1.75, sex="male", prosthetic_side="right")
    standing = recording_of(markers(apart, person, label_set="plug_in_gait", frames=100))
    calibration = calibrate(standing, load_marker_map("plug_in_gait"), facts)
    R_W, _ = orientations_of(track(standing, calibration).values)
    for side in ("right", "left"):
        np.testing.assert_allclose(R_W[f"foot_{side}"][:, 2, 1], 0.0, atol=1e-3)
        assert np.abs(R_W[f"shank_{side}"][:, 2, 1]).min() > 0.05


@pytest.mark.parametrize("below_m", [0.0, 0.003, 0.006, 0.009, 0.012])
def test_plug_in_gait_with_heel_toe_and_ankle_at_a_height_loses_the_intact_foots_roll_alone(
    below_m,
):
    """The error is a turn about the line; the prosthetic ankle is rigid, so there it is none."""
    standing, walk, truth = flat_feet(below_m)
    pig = load_marker_map("plug_in_gait")
    motion = track(prepared(walk, pig), calibrate(standing, pig, PERSON), cutoff_hz=None)
    R_W, _ = orientations_of(motion.values)
    for side, most_deg in (("right", 0.1), ("left", 4.0)):
        wrong = Rotation.from_matrix(truth[side].swapaxes(-1, -2) @ R_W[f"foot_{side}"])
        roll, *others = np.abs(np.degrees(wrong.as_rotvec())).max(axis=0)
        assert roll < most_deg and max(others) < 0.1


@pytest.mark.parametrize("below_m", [0.0, 0.012])
def test_heel_and_toe_exchanged_on_a_foot_that_rolls_with_its_shank_are_named(below_m):
    """On a line the foot fits the exchange to 25 mm, upside down."""
    standing, walk, _ = flat_feet(below_m)
    pig = load_marker_map("plug_in_gait")
    wrong = exchanged(prepared(walk, pig), "RHEE", "RTOE", 0, walk.frames)
    with pytest.raises(InputError, match="markers RHEE and RTOE are exchanged"):
        track(wrong, calibrate(standing, pig, PERSON))


def test_skin_motion_hardly_turns_a_foot_that_rolls_with_its_shank():
    """At 12 mm from the line 3 mm of skin turn a foot by 14 degrees if the ankle centre says its
    roll."""
    standing, walk, truth = flat_feet(0.012)
    rng = np.random.default_rng(1)
    time = walk.marker_time_s[:, None]
    skin = {
        label: x + 0.003 * np.sin(2 * np.pi * (time + rng.uniform(0, 1, 3)))
        for label, x in walk.markers.items()
    }
    pig = load_marker_map("plug_in_gait")
    walk = prepared(dataclasses.replace(walk, markers=skin), pig)
    R_W, _ = orientations_of(track(walk, calibrate(standing, pig, PERSON)).values)
    wrong = Rotation.from_matrix(truth["right"].swapaxes(-1, -2) @ R_W["foot_right"])
    assert np.degrees(wrong.as_rotvec())[:, 0].std() < 1.5


def test_skin_motion_shows_in_residual_and_cluster_motion_not_in_rigid_segments():
    wobble = 0.01 * np.sin(2 * np.pi * 2 * TIME)[:, None] * [0.0, 0.0, 1.0]
    motion = track(made(RTH1=path("RTH1") + wobble), true_calibration(), cutoff_hz=None)
    assert motion.residual_rms_m["RTH1"] > 2e-3 and motion.residual_rms_m["LTH1"] < 1e-9
    assert (
        motion.cluster_motion_m["thigh_right"] > 1e-3
        and motion.cluster_motion_m["thigh_left"] < 1e-9
    )
    assert motion.joint_gap_m["knee_right"] > 1e-3 and motion.joint_gap_m["knee_left"] < 1e-9


def test_a_marker_that_jumps_is_named_with_time_and_distance():
    ghost = path("LTB2")
    ghost[120:123] += [0.0, 0.0, 0.4]
    with pytest.raises(InputError, match=r"marker LTB2 jumps by 4\d\d mm at 1\.200 s"):
        track(made(LTB2=ghost), true_calibration())


@pytest.mark.parametrize("scale", [0.8, 1.15])
def test_a_standing_trial_of_another_person_is_refused(scale):
    other = {label: scale * p for label, p in made().markers.items()}
    with pytest.raises(InputError, match="another person"):
        track(recording_of(other), true_calibration())


@pytest.mark.parametrize("scale", [1000.0, 0.001, 1 / 25.4])
def test_a_wrong_unit_is_told_from_another_person(scale):
    with pytest.raises(InputError, match="another unit"):
        track(
            recording_of({label: scale * p for label, p in made().markers.items()}),
            true_calibration(),
        )


def test_real_walks_of_four_laboratories_are_tracked(shared_data):
    """Knees flex by 55 to 75 degrees in swing and end near straight; clusters keep their shape
    within millimetres."""
    core = shared_data / "opensim_core"
    walks = [
        (
            core / "gait2354" / "subject01_static.trc",
            core / "gait2354" / "subject01_walk1.trc",
            "rajagopal",
        ),
        (core / "example3DWalking" / "markers_walk.trc", None, "rajagopal"),
        (core / "c3d" / "walking2.c3d", None, "rajagopal"),
        (shared_data / "bmc_gait" / "walk1.trc", None, "ior"),
    ]
    for standing, walk, name in walks:
        marker_map = load_marker_map(name)
        person = PersonFacts(mass_kg=75.0, stature_m=1.8, sex="male", prosthetic_side="left")
        recording = prepared(read_trial(walk or standing), marker_map)
        motion = track(recording, calibrate(read_trial(standing), marker_map, person))
        for side in ("r", "l"):
            knee = np.degrees(motion.values[:, motion.names.index(f"knee_angle_{side}")])
            assert 55 < knee.max() < 75 and knee.min() > -10
        assert (
            max(motion.cluster_motion_m.values()) < 0.006
            and max(motion.joint_gap_m.values()) < 0.02
        )


SWAP_FRAMES = 200


def exchanged(recording, a, b, start, stop):
    paths = {label: path.copy() for label, path in recording.markers.items()}
    paths[a][start:stop], paths[b][start:stop] = (
        recording.markers[b][start:stop],
        recording.markers[a][start:stop],
    )
    return dataclasses.replace(recording, markers=paths)


def walk_of(label_set="rajagopal"):
    return recording_of(
        markers(walking_angles(np.arange(SWAP_FRAMES) / 100.0), label_set=label_set, medial=False)
    )


@pytest.fixture(scope="module")
def session(shared_data):
    """A walk whose shanks have three markers each, and its calibration."""
    folder = shared_data / "opensim_core" / "gait2354"
    person = PersonFacts(mass_kg=72.6, stature_m=1.803, sex="male", prosthetic_side="right")
    standing = read_trial(folder / "subject01_static.trc")
    return read_trial(folder / "subject01_walk1.trc"), calibrate(
        standing, load_marker_map("rajagopal"), person
    )


@pytest.mark.parametrize(
    ("a", "b", "start", "stop"), [("RTH1", "RTH2", 80, 95), ("LTB1", "LTB3", 0, 30)]
)
def test_markers_that_change_places_for_a_while_are_named(a, b, start, stop):
    time = f"{start / 100:.3f} s" if start else r"0\.\d+ s"
    with pytest.raises(
        InputError,
        match=rf"made\.c3d: markers ({a} and {b}|{b} and {a}) .*exchange places at {time}",
    ):
        track(exchanged(walk_of(), a, b, start, stop), true_calibration())


@pytest.mark.parametrize(
    ("a", "b", "frames"),
    [("R.Shank.Upper", "R.Shank.Front", 3), ("L.Thigh.Rear", "L.Thigh.Front", 20)],
)
def test_two_of_three_markers_are_named_though_their_mirror_image_fits(session, a, b, frames):
    walk, calibration = session
    time = walk.marker_time_s[60]
    with pytest.raises(
        InputError, match=rf"({a} and {b}|{b} and {a}) .*exchange places at {time:.3f} s"
    ) as refused:
        track(exchanged(walk, a, b, 60, 60 + frames), calibration)
    assert f"{frames} frames" in refused.value.what


@pytest.mark.parametrize("a, b", [("R.Shank.Upper", "L.Shank.Upper"), ("R.ASIS", "V.Sacral")])
def test_markers_exchanged_throughout_are_named(session, a, b):
    walk, calibration = session
    with pytest.raises(
        InputError, match=rf"markers {a} and {b} are exchanged with respect to the standing trial"
    ):
        track(exchanged(walk, a, b, 0, walk.frames), calibration)


@pytest.mark.parametrize(
    ("a", "b", "stop"),
    [("R.Thigh.Upper", "L.Thigh.Upper", None), ("R.Midfoot.Sup", "R.Midfoot.Lat", 80)],
)
def test_an_exchanged_pair_of_clusters_can_be_left_out_of_the_map_as_the_message_says(
    shared_data, a, b, stop
):
    """Without it the angles are those of the right walk without it."""
    folder = shared_data / "opensim_core" / "gait2354"
    person = PersonFacts(mass_kg=72.6, stature_m=1.803, sex="male", prosthetic_side="right")
    standing = read_trial(folder / "subject01_static.trc")
    right = read_trial(folder / "subject01_walk1.trc")
    rajagopal = load_marker_map("rajagopal")
    wrong = exchanged(right, a, b, 60 if stop else 0, stop or right.frames)
    with pytest.raises(InputError) as refused:
        track(wrong, calibrate(standing, rajagopal, person))
    advised = re.search(r"or leave (.*) and (.*) out of the marker map", str(refused.value))
    assert advised and {*advised.groups()} == {a, b}
    fewer = dataclasses.replace(
        rajagopal,
        clusters={
            name: tuple(label for label in labels if label not in (a, b))
            for name, labels in rajagopal.clusters.items()
        },
    )
    calibration = calibrate(standing, fewer, person)
    np.testing.assert_array_equal(
        track(wrong, calibration).values, track(right, calibration).values
    )


@pytest.mark.parametrize("a, b", [("R.ASIS", "V.Sacral"), ("R.Shank.Upper", "R.Shank.Front")])
def test_a_joint_centres_markers_and_two_of_a_shanks_three_are_not_advised_to_be_left_out(
    session, a, b
):
    walk, calibration = session
    with pytest.raises(InputError, match="are exchanged with respect to the standing") as refused:
        track(exchanged(walk, a, b, 0, walk.frames), calibration)
    assert "leave" not in str(refused.value)


@pytest.mark.parametrize(
    "pairs",
    [
        [("R.Heel", "R.Midfoot.Sup"), ("R.Toe.Lat", "R.Toe.Tip")],
        [("L.ASIS", "V.Sacral"), ("R.Thigh.Upper", "R.Thigh.Rear")],
    ],
)
def test_two_exchanged_pairs_are_both_named_and_no_other_with_what_undoing_them_leaves(
    session, pairs
):
    """Undone by hand, the walk is as it was: the residuals that the message promises are those of
    the right walk."""
    walk, calibration = session
    right = track(walk, calibration).residual_rms_m
    wrong = walk
    for pair in pairs:
        wrong = exchanged(wrong, *pair, 0, walk.frames)
    with pytest.raises(
        InputError, match="are exchanged with respect to the standing trial"
    ) as refused:
        track(wrong, calibration)
    named, shown = refused.value.what.split(" are exchanged")
    assert {
        frozenset(words.split(" and ")) for words in named.removeprefix("markers ").split(", ")
    } == {frozenset(pair) for pair in pairs}
    for words in shown.split("(mm RMS): ")[1].split(", "):
        label, before, _, after = words.split()
        assert float(after) < float(before) or float(before) < 10
        assert float(after) == pytest.approx(1e3 * right[label], abs=1.0), (
            "the walk as it is filtered"
        )


LONG = np.arange(300) / 100.0
TRUTH = markers(walking_angles(LONG), label_set="rajagopal", medial=False)
PLUG_IN_GAIT = markers(walking_angles(LONG), label_set="plug_in_gait", medial=False)


def lacking(gaps, truth=TRUTH, **changes):
    """The recording with `gaps`, (label, first frame, frame after) each."""
    seen = {label: path.copy() for label, path in truth.items()}
    for label, start, stop in gaps:
        seen[label][start:stop] = np.nan
    return recording_of(seen | changes)


def fill(recording, label_set="rajagopal", **options):
    return fill_gaps(recording, true_calibration(label_set=label_set).segments, **options)


@pytest.mark.parametrize(
    ("start", "stop"), [(100, 105), (100, 110), (100, 180), (0, 60), (250, 300)]
)
def test_a_rigid_cluster_knows_where_its_lost_marker_is(start, stop):
    """RTH1 is one of four on the thigh: exactly restored, however long the gap, and at either
    end."""
    filled = fill(lacking([("RTH1", start, stop)]))
    np.testing.assert_allclose(filled.markers["RTH1"], TRUTH["RTH1"], atol=1e-12)
    assert np.flatnonzero(~filled.seen["RTH1"]).tolist() == list(range(start, stop))
    (gap,) = filled.gaps
    assert (gap.label, gap.how) == ("RTH1", "rigid cluster")
    assert (gap.start_s, gap.end_s) == pytest.approx((start / 100, (stop - 1) / 100))
    assert len(filled.notes) == (stop - start > 10)
    assert stop - start <= 10 or "RTH1 was not seen" in filled.notes[0]


def test_a_marker_off_its_cluster_enters_and_leaves_the_gap_without_a_step():
    """Skin moves RTH1 by 20 mm over the gap; the fill passes from the one offset to the other."""
    sliding = TRUTH["RTH1"] + np.clip((np.arange(300) - 90) / 100, 0, 1)[:, None] * [0.0, 0.0, 0.02]
    filled = fill(lacking([("RTH1", 100, 180)], truth=TRUTH | {"RTH1": sliding}))
    step = np.abs(np.diff(filled.markers["RTH1"] - sliding, axis=0))
    assert step.max() < 3e-4
    assert np.abs(filled.markers["RTH1"] - sliding).max() < 3e-3


@pytest.mark.parametrize("length", [1, 5, 10])
def test_short_gaps_without_a_cluster_are_splined(length):
    """Plug-in Gait has two markers on a foot. A cubic spline errs by at most 5/384 h^4 max|d4x/dt4|
    (Hall & Meyer)."""
    filled = fill(lacking([("RTOE", 100, 100 + length)], PLUG_IN_GAIT), "plug_in_gait")
    fourth = np.abs(np.diff(PLUG_IN_GAIT["RTOE"], 4, axis=0)[90:120]).max(axis=0) * 100.0**4
    error = np.abs(filled.markers["RTOE"] - PLUG_IN_GAIT["RTOE"]).max(axis=0)
    assert (error < 5 / 384 * ((length + 1) / 100) ** 4 * fourth + 1e-9).all()
    assert error.max() < 2e-3
    (gap,) = filled.gaps
    assert gap.how == "spline" and gap.end_s - gap.start_s == pytest.approx((length - 1) / 100)


def test_longer_gaps_are_refused_by_name_and_interval():
    with pytest.raises(
        InputError, match=r"made\.c3d: marker RTOE is missing from 1\.000 to 1\.100 s"
    ) as error:
        fill(lacking([("RTOE", 100, 111)], PLUG_IN_GAIT), "plug_in_gait")
    assert "0.1 s" in str(error.value)
    assert fill(
        lacking([("RTOE", 100, 111)], PLUG_IN_GAIT), "plug_in_gait", longest_gap_s=0.11
    ).gaps
    with pytest.raises(InputError, match=r"marker RTOE is missing from 1\.000 to 1\.000 s"):
        fill(lacking([("RTOE", 100, 101)], PLUG_IN_GAIT), "plug_in_gait", longest_gap_s=0.0)


@pytest.mark.parametrize(("start", "stop"), [(100, 108), (100, 160), (0, 60)])
def test_two_others_and_the_joint_centre_know_where_a_lost_marker_is(start, stop):
    """Two of four on the thigh; two of three on the foot (LMT2, LMT5), where a spline over the
    swing errs by 20 mm."""
    filled = fill(lacking([("RTH1", start, stop), ("RTH2", start, stop), ("LCAL", start, stop)]))
    assert {gap.how for gap in filled.gaps} == {"rigid cluster and joint centre"}
    for label in ("RTH1", "RTH2", "LCAL"):
        np.testing.assert_allclose(filled.markers[label], TRUTH[label], atol=1e-9)


def test_ends_without_markers_are_trimmed():
    """A person walks into the volume and out of it: everything appears and disappears bit by
    bit."""
    gaps = [(label, 0, 20 + k) for k, label in enumerate(TRUTH)] + [
        (label, 250 + k, 300) for k, label in enumerate(TRUTH)
    ]
    filled = fill(lacking(gaps))
    assert 20 < filled.start_frame <= 20 + len(TRUTH)
    assert all(np.isfinite(path).all() for path in filled.markers.values())
    assert 250 <= filled.start_frame + len(filled.markers["RTH1"]) < 250 + len(TRUTH)
    assert any("is used" in note for note in filled.notes)
    for gap in filled.gaps:
        assert gap.start_s >= filled.start_frame / 100


def test_segments_without_enough_markers_are_refused_by_name():
    with pytest.raises(
        InputError, match=r"RASI, LASI never appear.*the pelvis \(left: RPSI, LPSI\)"
    ):
        fill(lacking([("RASI", 0, 300), ("LASI", 0, 300)]))
    with pytest.raises(InputError, match=r"RTOE never appears.*the foot right \(left: RHEE\)"):
        fill(lacking([("RTOE", 0, 300)], PLUG_IN_GAIT), "plug_in_gait")
    with pytest.raises(InputError, match="no markers"):
        fill(recording_of({}))


def test_markers_that_never_appear_together_are_named():
    with pytest.raises(
        InputError,
        match=r"no frame shows every needed marker: RHEE in 50% of the frames, RTOE in 50% "
        "of the frames$",
    ):
        fill(lacking([("RTOE", 0, 150), ("RHEE", 150, 300)], PLUG_IN_GAIT), "plug_in_gait")
    with pytest.raises(InputError, match=r"only 4 frames show every needed marker; RTOE"):
        fill(lacking([("RTOE", 0, 296)], PLUG_IN_GAIT), "plug_in_gait")


@settings(max_examples=30, deadline=None)
@given(
    st.lists(
        st.tuples(st.sampled_from(sorted(TRUTH)), st.integers(0, 299), st.integers(1, 60)),
        max_size=12,
    )
)
def test_any_gaps_are_filled_well_or_refused(gaps):
    """Exactly by clusters; a spline across a quick swing, a tenth of a second long, may be
    centimetres off."""
    try:
        filled = fill(lacking([(label, start, start + length) for label, start, length in gaps]))
    except InputError:
        return
    start, count = filled.start_frame, len(filled.markers["RTH1"])
    exact = all(gap.how != "spline" for gap in filled.gaps)
    for label, path in filled.markers.items():
        truth, seen = TRUTH[label][start : start + count], filled.seen[label]
        np.testing.assert_array_equal(path[seen], truth[seen])
        np.testing.assert_allclose(path, truth, atol=1e-9 if exact else 0.06)
