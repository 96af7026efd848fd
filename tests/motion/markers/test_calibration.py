"""A made person's truth comes back from markers; a real one's lengths are those between its
markers."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping

import made_person
import numpy as np
import pytest
from made_person import Person

from vsf_drake.base.errors import InputError
from vsf_drake.model.parameters import GRAVITY, FootParameters, ModelParameters
from vsf_drake.motion.formats.recording import SIDES, Plate, Recording
from vsf_drake.motion.markers.calibration import calibrate
from vsf_drake.motion.markers.maps import load_marker_map
from vsf_drake.motion.markers.person_facts import PersonFacts
from vsf_drake.motion.markers.posture import NOTE, prepared, settling
from vsf_drake.motion.markers.segments import PARENTS, SEGMENTS, Calibration
from vsf_drake.plants.anthropometry import foot_placement

MAPS = {
    "plug_in_gait": "plug_in_gait",
    "rajagopal": "rajagopal",
    "opensim": "rajagopal",
    "ior": "ior",
}
UNEQUAL = Person(
    thigh=(0.43, 0.41), shank=(0.40, 0.42), ankle_height=(0.07, 0.07), foot=(0.26, 0.25)
)
"""Both soles are on the floor when the legs are straight."""
EVEN = Person(ankle_height=(0.075, 0.075), foot=(0.26, 0.25))
"""Both soles are on the floor in any symmetrical posture."""
FLEXED = {"pelvis_tx": 1.3, "pelvis_tz": -0.2, "pelvis_tilt": -0.1}
for s in "rl":
    FLEXED |= {f"hip_flexion_{s}": 0.2, f"knee_angle_{s}": 0.3, f"ankle_angle_{s}": 0.2}
BACKWARD = {
    "hip_flexion_r": -0.06,
    "hip_flexion_l": -0.06,
    "ankle_angle_r": 0.06,
    "ankle_angle_l": 0.06,
}
"""Legs slanting backwards on flat soles."""


def facts(person: Person = UNEQUAL, **more) -> PersonFacts:
    """Those of `person` that a laboratory measures, and `more`."""
    stated = {
        "mass_kg": 80.0,
        "stature_m": 1.75,
        "sex": "male",
        "prosthetic_side": "right",
        "leg_length_mm": 1e3 * person.leg_length,
        "knee_width_mm": 1e3 * person.knee_width,
        "ankle_width_mm": 1e3 * person.ankle_width,
    }
    return PersonFacts(**(stated | more))


def standing(
    angles: Mapping[str, object] | None = None,
    person: Person = UNEQUAL,
    *,
    label_set: str = "plug_in_gait",
    medial: bool = True,
    frames: int = 120,
    **more,
) -> Recording:
    """Somebody who stands in this posture."""
    return made_person.recording_of(
        made_person.markers(
            angles or {}, person, label_set=label_set, medial=medial, frames=frames
        ),
        **more,
    )


def calibrated(
    recording: Recording,
    person: Person = UNEQUAL,
    *,
    label_set: str = "plug_in_gait",
    hip: str = "harrington",
    **more,
) -> Calibration:
    """What the recording of `person` gives with the map of its labels; `more` are facts."""
    return calibrate(recording, load_marker_map(MAPS[label_set]), facts(person, **more), hip=hip)


def assert_truth(
    calibration: Calibration, person: Person, label_set: str, tolerance: float = 1e-9
) -> None:
    """Every marker and every joint centre is where the person was made with it."""
    for i, side in enumerate(SIDES):
        truth = {
            made_person.label_of(role, side, label_set): (segment, p)
            for role, (segment, p) in person.points(side).items()
            if role in made_person._label_sets()[label_set]
        }
        for segment, markers in calibration.segments.items():
            for label, p_BM in zip(markers.labels, markers.p_BM, strict=True):
                if label in truth:
                    assert truth[label][0] == segment
                    assert p_BM == pytest.approx(truth[label][1], abs=tolerance), label
        for name, length in (
            ("thigh", person.thigh),
            ("shank", person.shank),
            ("ankle_height", person.ankle_height),
        ):
            assert calibration.lengths_m[f"{name}_{side}"] == pytest.approx(
                length[i], abs=tolerance
            )
        forward, lateral, up = person.hip_centre
        out = -1 if side == "right" else 1
        assert calibration.segments[f"thigh_{side}"].p_PB == pytest.approx(
            [forward, out * lateral, up], abs=tolerance
        )


POSTURES = pytest.mark.parametrize(
    "angles, person", [({}, UNEQUAL), (FLEXED, EVEN)], ids=["straight", "flexed"]
)


@pytest.mark.parametrize("label_set", MAPS)
@POSTURES
def test_medial_markers_give_the_person_back_in_any_posture(label_set, angles, person):
    calibration = calibrated(
        standing(angles, person, label_set=label_set), person, label_set=label_set
    )
    assert set(calibration.segments) == set(SEGMENTS) == set(PARENTS)
    assert_truth(calibration, person, label_set)


def test_nothing_is_zeroed_while_standing():
    angles = calibrated(standing(FLEXED, person=Person()), Person()).angles_rad
    truth = dict.fromkeys(angles, 0.0) | FLEXED
    truth["pelvis_ty"] = angles["pelvis_ty"]
    assert angles == pytest.approx(truth, abs=1e-9)
    straight = calibrated(standing(person=Person()), Person()).angles_rad
    assert straight["pelvis_ty"] > angles["pelvis_ty"]


def settled(subject):
    """What the prosthesis gave (m) under half of the weight while the person stood on it."""
    return settling(0.5 * GRAVITY * subject.mass_kg, ModelParameters())


@pytest.mark.parametrize("prosthetic, intact", [("right", "left"), ("left", "right")])
def test_the_subject_is_the_intact_leg_and_the_prosthesis_the_other(prosthetic, intact):
    subject = calibrated(standing(), prosthetic_side=prosthetic).subject
    i, k = SIDES.index(intact), SIDES.index(prosthetic)
    assert subject.thigh_length_m == pytest.approx(UNEQUAL.thigh[i])
    assert subject.shank_length_m == pytest.approx(UNEQUAL.shank[i])
    assert subject.prosthetic_thigh_length_m == pytest.approx(UNEQUAL.thigh[k])
    assert subject.prosthesis_length_m - settled(subject) == pytest.approx(
        UNEQUAL.shank[k] + UNEQUAL.ankle_height[k]
    )
    assert (subject.hip_forward_m, subject.hip_lateral_m, subject.hip_up_m) == pytest.approx(
        UNEQUAL.hip_centre
    )
    assert (subject.mass_kg, subject.stature_m) == (80.0, 1.75)


@pytest.mark.parametrize("side", SIDES)
def test_the_model_puts_the_prosthesis_where_it_was_measured(side):
    s = side[0]
    person = Person(shank=(0.40, 0.40), heel_behind_ankle=0.075)
    angles = BACKWARD | {f"ankle_rotation_{s}": -0.12}
    R, p = (x[0] for x in made_person.poses(angles, person)[f"foot_{side}"])
    assert R[2] == pytest.approx([0, 0, 1], abs=1e-12), "the sole is to be flat"
    subject = calibrated(standing(angles, person), person, prosthetic_side=side).subject
    assert subject.prosthesis_alignment_rad == pytest.approx(0.06)
    assert subject.prosthesis_toe_out_rad == pytest.approx(0.12)
    foot, place = FootParameters(), foot_placement(subject)
    X_DP = place.pose(mirrored=side == "left")
    p_SD = np.array(
        [
            0,
            0,
            place.sole_below(foot.build_height_m) - subject.prosthesis_length_m + settled(subject),
        ]
    )
    heel = p_SD + X_DP.multiply(np.array([-foot.pylon_x_m, 0, -foot.build_height_m]))
    R_WS, p_WS = (x[0] for x in made_person.poses(angles, person)[f"shank_{side}"])
    assert heel == pytest.approx(R_WS.T @ (p + R @ person.sole(side)[0] - p_WS), abs=1e-9)


def test_a_walk_can_stand_in_for_a_standing_trial_and_says_so():
    """Skating: both soles flat on the floor throughout, knees turning through more than
    30 degrees."""
    person, time = Person(), np.arange(300) / 100
    angles = {"pelvis_tx": 1.2 * time}
    for s, phase in (("r", 0.0), ("l", np.pi)):
        hip = 0.05 + 0.35 * np.sin(2 * np.pi * time + phase)
        height = 0.93 * (person.thigh[0] + person.shank[0])
        knee = hip + np.arccos((height - person.thigh[0] * np.cos(hip)) / person.shank[0])
        angles |= {f"hip_flexion_{s}": hip, f"knee_angle_{s}": knee, f"ankle_angle_{s}": knee - hip}
    for label_set in ("opensim", "plug_in_gait"):
        walk = standing(angles, person, label_set=label_set, medial=False)
        calibration = calibrated(walk, person, label_set=label_set)
        assert_truth(calibration, person, label_set, 1e-7)
        assert "Nobody stood still" in calibration.notes[0]
        assert calibration.lengths_m["foot_right"] == pytest.approx(person.foot[0], abs=1e-7)


def test_the_plates_tell_the_mass_of_somebody_who_stands():
    def plate(newton):
        force = np.zeros((600, 3))
        force[:, 2] = newton
        return Plate("1", force, np.zeros((600, 3)), np.zeros(600))

    on_plates = standing(plates=(plate(400.0), plate(380.0)), force_rate_hz=500.0)
    calibration = calibrated(on_plates, mass_kg=None)
    assert calibration.subject.mass_kg == pytest.approx(780 / 9.81)
    assert any("both feet stood on plates" in note for note in calibration.notes)
    with pytest.raises(InputError, match="nobody's weight"):
        calibrated(standing(plates=(plate(3.0),), force_rate_hz=500.0), mass_kg=None)
    with pytest.raises(InputError, match=r"mass_kg.*no force plates"):
        calibrated(standing(), mass_kg=None)


# The load under which a prosthesis was measured, where plates tell it.


def test_plates_under_both_feet_tell_the_share_of_the_weight_and_one_under_both_none():
    """0.6 of it on the prosthesis settles it by more than the half that is taken without plates."""
    person, weight, samples = Person(), 80.0 * GRAVITY, 2000

    def plate_under(point, share):
        return Plate(
            "1",
            np.tile([0.0, 0.0, share * weight], (samples, 1)),
            np.tile([point[0], point[1], 0.0], (samples, 1)),
            np.zeros(samples),
        )

    def length_on(*plates):
        recording = standing(
            {},
            person,
            label_set="rajagopal",
            plates=plates,
            force_rate_hz=1000.0 if plates else None,
        )
        return calibrated(recording, person, label_set="rajagopal").subject.prosthesis_length_m

    feet = [made_person.poses({}, person)[f"foot_{side}"][1][0] for side in SIDES]
    plates = [plate_under(foot, share) for foot, share in zip(feet, (0.6, 0.4), strict=True)]
    model = ModelParameters()
    expected = settling(0.6 * weight, model) - settling(0.5 * weight, model)
    assert length_on(*plates) - length_on() == pytest.approx(expected, abs=1e-9)
    assert expected > 5e-4
    assert length_on(plate_under((0.0, 0.0), 1.0)) == length_on()


# Markers that are not where their labels say are refused, and named.


def standing_markers(label_set="rajagopal", frames=100):
    return made_person.markers({}, label_set=label_set, frames=frames)


def woman(markers, name="rajagopal", **more):
    return calibrate(
        made_person.recording_of(markers, **more),
        load_marker_map(name),
        PersonFacts(mass_kg=80, sex="female", prosthetic_side="left"),
    )


@pytest.mark.parametrize(
    ("label_set", "pairs", "named"),
    [
        ("rajagopal", [("RASI", "LASI")], ["RASI", "LASI"]),
        ("rajagopal", [("RLFC", "LLFC")], ["RLFC", "LLFC"]),
        ("rajagopal", [("RCAL", "LCAL")], ["RCAL", "LCAL"]),
        ("rajagopal", [("RASI", "RPSI")], ["RASI", "RPSI"]),
        ("rajagopal", [("RASI", "RPSI"), ("LASI", "LPSI")], ["RASI", "RPSI", "LASI", "LPSI"]),
        ("rajagopal", [("RLFC", "RLMAL")], ["RLFC", "RLMAL"]),
        ("rajagopal", [("LLFC", "LMFC")], ["LLFC", "LMFC"]),
        ("rajagopal", [("LLMAL", "LMMAL")], ["LLMAL", "LMMAL"]),
        ("rajagopal", [("RCAL", "RMT2")], ["RCAL", "RMT2"]),
        ("rajagopal", [("RTH1", "LTH1")], ["RTH1"]),
        ("rajagopal", [("RTH1", "RTB3")], ["RTH1"]),
        ("rajagopal", [("LTB2", "LPSI")], []),
        ("ior", [("LFM", "LVM")], ["LFM", "LVM"]),
    ],
)
def test_exchanged_markers_are_named(label_set, pairs, named):
    markers = standing_markers(label_set)
    exchanged = markers | {a: markers[b] for pair in pairs for a, b in (pair, pair[::-1])}
    with pytest.raises(InputError) as caught:
        woman(exchanged, label_set)
    assert all(label in str(caught.value.where) for label in named) and caught.value.right
    woman(markers, label_set)


@pytest.mark.parametrize("pair", [("RTH1", "LTH1"), ("RTH2", "RTB3"), ("LTB2", "RTB2")])
def test_an_exchanged_pair_of_clusters_can_be_left_out_of_the_map_as_the_message_says(pair):
    markers = standing_markers()
    a, b = pair
    wrong = markers | {a: markers[b], b: markers[a]}
    with pytest.raises(InputError) as refused:
        woman(wrong)
    advised = re.search(r"or leave (.*) and (.*) out of the marker map", str(refused.value))
    assert advised and {*advised.groups()} == {a, b}
    left = {label: x for label, x in wrong.items() if label not in pair}
    assert woman(left).lengths_m == pytest.approx(woman(markers).lengths_m, abs=1e-12)
    with pytest.raises(InputError) as refused:
        woman(markers | {"RLFC": markers["LTH1"], "LTH1": markers["RLFC"]})
    assert "leave" not in str(refused.value)


def test_what_cannot_be_a_standing_person_is_refused():
    markers = standing_markers(frames=300)
    shaken = markers["RLFC"] + 0.05 * np.sin(np.linspace(0, 60, 300))[:, None] * [1, 0, 0]
    for wrong, words in (
        ({"RLMAL": markers["RMMAL"].copy()}, "RLMAL, RMMAL: lie in the same place"),
        (
            {label: x + np.array([0, 0, 1.0]) for label, x in markers.items()},
            r"1\.0\d\d m above the floor",
        ),
        ({"RLFC": shaken}, r"RLFC.*moves 3\d mm RMS"),
        ({"RLFC": np.full((300, 3), np.nan)}, "knee lateral right"),
    ):
        with pytest.raises(InputError, match=words):
            woman(markers | wrong, rate_hz=100.0)
    for scale in (1e3, 1e-3):
        with pytest.raises(InputError):
            woman({label: scale * x for label, x in markers.items()})


def test_markers_never_seen_together_are_refused():
    markers = standing_markers(frames=300)
    markers["RLFC"][:150], markers["LLFC"][150:] = np.nan, np.nan
    both = woman(markers, rate_hz=100.0)
    assert both.lengths_m == pytest.approx(woman(standing_markers()).lengths_m), (
        "both are seen within one second"
    )
    markers["RLFC"][:200], markers["LLFC"][100:] = np.nan, np.nan
    with pytest.raises(InputError, match="not seen together"):
        woman(markers, rate_hz=100.0)


def test_it_does_not_matter_where_the_person_faces():
    heading = -2.4
    c, s = np.cos(heading), np.sin(heading)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    straight = woman(standing_markers())
    turned = woman({label: x @ R.T for label, x in standing_markers().items()})
    assert turned.lengths_m == pytest.approx(straight.lengths_m)
    for name, segment in straight.segments.items():
        assert turned.segments[name].p_BM == pytest.approx(segment.p_BM, abs=1e-12)
    assert turned.angles_rad["pelvis_rotation"] == pytest.approx(heading)


def test_axes_of_a_left_hand_are_mirrored_with_a_note():
    recording = standing(FLEXED, EVEN)
    flipped = made_person.recording_of(
        {label: x * [1, -1, 1] for label, x in recording.markers.items()}
    )
    calibration = calibrated(flipped, EVEN)
    assert_truth(calibration, EVEN, "plug_in_gait")
    assert NOTE in calibration.notes
    pig = load_marker_map("plug_in_gait")
    assert not prepared(recording, pig).notes
    again = prepared(prepared(flipped, pig), pig)
    assert again.markers["LASI"] == pytest.approx(recording.markers["LASI"])
    assert np.linalg.det(again.rotation_W) == pytest.approx(-1)


@pytest.mark.parametrize("quarters, axis", [(1, "+y"), (2, "-x"), (3, "-y")])
def test_person_who_walks_in_place_goes_where_the_pelvis_faces(quarters, axis):
    """On a treadmill the markers do not travel: the laboratory's x may be behind or beside the
    person."""
    pig = load_marker_map("plug_in_gait")
    turn = made_person.poses({"pelvis_rotation": 0.5 * np.pi * quarters})["pelvis"][0][0]
    straight = standing(FLEXED, EVEN)
    force, cop = np.array([[-80.0, 20.0, 700.0]]), np.array([[0.1, -0.1, 0.0]])
    plate = Plate("1", force, cop, np.array([3.0]))
    seen = dataclasses.replace(
        straight,
        markers={label: x @ turn.T for label, x in straight.markers.items()},
        force_rate_hz=1000.0,
        plates=(dataclasses.replace(plate, force_n=force @ turn.T, cop_m=cop @ turn.T),),
    )
    turned = prepared(seen, pig)
    for label, x in straight.markers.items():
        assert turned.markers[label] == pytest.approx(x, abs=1e-12)
    assert turned.plates[0].force_n == pytest.approx(force) and turned.plates[
        0
    ].cop_m == pytest.approx(cop)
    assert turned.plates[0].free_moment_nm == pytest.approx([3.0])
    assert turned.rotation_W @ turn == pytest.approx(np.eye(3), abs=1e-12)
    assert f"faces the laboratory's {axis}" in turned.notes[-1]


def test_exchanged_sides_are_told_from_mirrored_axes_by_the_plates():
    """Corners that go round as in a right-handed frame show that the axes are right: the labels are
    not."""
    pig = load_marker_map("plug_in_gait")
    corners = np.array([[0.3, 0.2, 0.0], [0.3, -0.2, 0.0], [-0.3, -0.2, 0.0], [-0.3, 0.2, 0.0]])
    plate = Plate("1", np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(1), corners)
    right = standing(FLEXED, EVEN)
    other = {"R": "L", "L": "R"}
    exchanged = dataclasses.replace(
        right,
        plates=(plate,),
        markers={other[label[0]] + label[1:]: x for label, x in right.markers.items()},
    )
    with pytest.raises(InputError, match="left and right labels are exchanged"):
        prepared(exchanged, pig)
    flip = np.array([1.0, -1.0, 1.0])
    flipped = dataclasses.replace(
        right,
        plates=(dataclasses.replace(plate, corners_m=plate.corners_m * flip),),
        markers={label: x * flip for label, x in right.markers.items()},
    )
    assert NOTE in prepared(flipped, pig).notes
