"""Which hand a laboratory's axes are of, which way a person faces who does not travel, and exchanged labels."""

from __future__ import annotations

import dataclasses

import made_person
import numpy as np
import pytest
from made_standing import EVEN, FLEXED, assert_truth, calibrated, standing

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.recording import Plate
from vsf_drake.motion.markers.maps import load_marker_map
from vsf_drake.motion.markers.posture import NOTE, prepared


def test_axes_of_a_left_hand_are_mirrored_with_a_note():
    recording = standing(FLEXED, EVEN)
    flipped = made_person.recording_of({label: x * [1, -1, 1] for label, x in recording.markers.items()})
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
    """On a treadmill the markers do not travel: the laboratory's x may be behind or beside the person."""
    pig = load_marker_map("plug_in_gait")
    turn = made_person.poses({"pelvis_rotation": 0.5 * np.pi * quarters})["pelvis"][0][0]
    straight = standing(FLEXED, EVEN)
    force, cop = np.array([[-80.0, 20.0, 700.0]]), np.array([[0.1, -0.1, 0.0]])
    plate = Plate("1", force, cop, np.array([3.0]))
    seen = dataclasses.replace(
        straight, markers={label: x @ turn.T for label, x in straight.markers.items()}, force_rate_hz=1000.0,
        plates=(dataclasses.replace(plate, force_n=force @ turn.T, cop_m=cop @ turn.T),))
    turned = prepared(seen, pig)
    for label, x in straight.markers.items():
        assert turned.markers[label] == pytest.approx(x, abs=1e-12)
    assert turned.plates[0].force_n == pytest.approx(force) and turned.plates[0].cop_m == pytest.approx(cop)
    assert turned.plates[0].free_moment_nm == pytest.approx([3.0])
    assert turned.rotation_W @ turn == pytest.approx(np.eye(3), abs=1e-12)
    assert f"faces the laboratory's {axis}" in turned.notes[-1]


def test_exchanged_sides_are_told_from_mirrored_axes_by_the_plates():
    """Corners that go round as in a right-handed frame show that the axes are right: the labels are not."""
    pig = load_marker_map("plug_in_gait")
    corners = np.array([[0.3, 0.2, 0.0], [0.3, -0.2, 0.0], [-0.3, -0.2, 0.0], [-0.3, 0.2, 0.0]])
    plate = Plate("1", np.zeros((1, 3)), np.zeros((1, 3)), np.zeros(1), corners)
    right = standing(FLEXED, EVEN)
    other = {"R": "L", "L": "R"}
    exchanged = dataclasses.replace(right, plates=(plate,),
                                    markers={other[label[0]] + label[1:]: x for label, x in right.markers.items()})
    with pytest.raises(InputError, match="left and right labels are exchanged"):
        prepared(exchanged, pig)
    flip = np.array([1.0, -1.0, 1.0])
    flipped = dataclasses.replace(right, plates=(dataclasses.replace(plate, corners_m=plate.corners_m * flip),),
                                  markers={label: x * flip for label, x in right.markers.items()})
    assert NOTE in prepared(flipped, pig).notes
