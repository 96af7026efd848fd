"""Global inverse kinematics: the truth from exact markers, the optimum from others, no joint that
comes apart."""

import dataclasses

import numpy as np
import pytest
from flat_feet import PERSON, flat_feet
from made_calibration import true_calibration
from made_person import Person, label_of, markers, poses, recording_of, walking_angles
from pydrake.multibody.plant import MultibodyPlant
from scipy.optimize import least_squares

from vsf_drake.base.errors import InputError
from vsf_drake.base.sentences import say
from vsf_drake.model.parameters import ModelParameters
from vsf_drake.motion.markers.calibration import calibrate
from vsf_drake.motion.markers.joints import COORDINATES, orientations_of
from vsf_drake.motion.markers.maps import load_marker_map
from vsf_drake.motion.markers.posture import prepared
from vsf_drake.motion.markers.tracking import smooth_poses
from vsf_drake.plants.person import add_person
from vsf_drake.recording import inverse_kinematics as ik

TIME = np.arange(40) / 50.0
ANGLES = walking_angles(TIME)
KNEE = COORDINATES.index("knee_angle_r")
LABEL_SET = "rajagopal"


def made(angles=ANGLES, label_set=LABEL_SET, noise=0.0, seed=0):
    rng = np.random.default_rng(seed)
    exact = markers(angles, label_set=label_set, medial=False, frames=40)
    return recording_of(
        {label: p + noise * rng.normal(size=p.shape) for label, p in exact.items()}, rate_hz=50.0
    )


def truth(angles=ANGLES):
    height = poses(angles)["pelvis"][1][:, 2]
    return np.stack(
        [
            height if name == "pelvis_ty" else np.broadcast_to(angles.get(name, 0.0), (40,))
            for name in COORDINATES
        ],
        axis=1,
    )


def calibration(side="right", label_set=LABEL_SET):
    made_one = true_calibration(label_set=label_set)
    return dataclasses.replace(
        made_one, subject=dataclasses.replace(made_one.subject, prosthetic_side=side)
    )


def solve(recording, side="right", label_set=LABEL_SET):
    return ik.solve_inverse_kinematics(
        recording,
        calibration(side, label_set),
        ModelParameters(),
        cutoff_hz=None,
        longest_gap_s=0.1,
    )


def test_a_foot_whose_markers_do_not_show_its_roll_is_solved_with_that_of_its_own_pose():
    standing, walk, _ = flat_feet(0.0)
    pig = load_marker_map("plug_in_gait")
    walk = dataclasses.replace(walk, markers={m: x[:8] for m, x in walk.markers.items()})
    walk = prepared(walk, pig)
    made_one = calibrate(standing, pig, PERSON)
    options = {"cutoff_hz": None, "longest_gap_s": 0.1}
    motion, at_limit = ik.solve_inverse_kinematics(walk, made_one, ModelParameters(), **options)
    _, _, own, _ = smooth_poses(walk, made_one, **options)
    R_W, _ = orientations_of(motion.values)
    assert not at_limit
    np.testing.assert_allclose(
        R_W["foot_left"][:, 2, 1], own["foot_left"].R_WB[:, 2, 1], atol=np.radians(1.0)
    )


def skeleton(side="right"):
    made_one = calibration(side)
    return ik.Skeleton(made_one, made_one.segments, ModelParameters())


@pytest.mark.parametrize("label_set", ["plug_in_gait", "rajagopal", "ior"])
@pytest.mark.parametrize("side", ["right", "left"])
def test_the_angles_that_the_markers_were_made_from_come_back(label_set, side):
    motion, at_limit = solve(made(label_set=label_set), side, label_set)
    np.testing.assert_allclose(motion.values, truth(), atol=1e-9)
    assert (
        max(motion.residual_rms_m.values()) < 1e-9
        and max(motion.joint_gap_m.values()) < 1e-9
        and not at_limit
    )
    R, p = poses(ANGLES)["foot_left"]
    np.testing.assert_allclose(
        motion.feet["left"].heel_W, R @ Person().sole("left")[0] + p, atol=1e-9
    )


@pytest.mark.parametrize("side", ["right", "left"])
def test_segments_are_where_the_simulated_person_has_them(side):
    body = skeleton(side)
    plant = MultibodyPlant(0.0)
    person = add_person(plant, calibration(side).subject, ModelParameters())
    plant.Finalize()
    context = plant.CreateDefaultContext()
    rng = np.random.default_rng(2)
    for _ in range(5):
        q = rng.uniform(-1.0, 1.0, len(COORDINATES))
        positions = np.zeros(plant.num_positions())
        for name in person.coordinate_names:
            positions[plant.GetJointByName(name).position_start()] = q[COORDINATES.index(name)]
        plant.SetPositions(context, positions)
        R, p = body.poses(q)
        for name, segment in person.segments.items():
            X = segment.EvalPoseInWorld(context)
            np.testing.assert_allclose(R[name], X.rotation().matrix(), atol=1e-12)
            np.testing.assert_allclose(p[name], X.translation(), atol=1e-12)


def test_noisy_markers_get_the_optimum_that_a_general_minimiser_finds():
    recording = made(noise=0.01)
    motion, body = solve(recording)[0], skeleton()
    for n in (0, 17, 39):
        seen = np.stack([recording.markers[label][n] for label in body.labels])
        best = least_squares(
            body.residuals, truth()[n], xtol=1e-14, ftol=1e-14, gtol=1e-14, args=(seen,)
        )
        np.testing.assert_allclose(motion.values[n], best.x, atol=2e-6)
        assert np.sum(body.residuals(motion.values[n], seen) ** 2) == pytest.approx(
            2 * best.cost, rel=1e-9
        )


def test_a_prosthetic_foot_that_bends_hardly_turns_its_shank():
    """Its markers are 20 mm off; they weigh a twentieth of an intact foot's."""
    recording = made()
    for label in [label_of(role, "right", LABEL_SET) for role in ("heel", "toe", "met5")]:
        recording.markers[label][:] += [0.0, 0.0, 0.02]
    knee = {
        side: np.abs(solve(recording, side)[0].values[:, KNEE] - truth()[:, KNEE]).max()
        for side in ("right", "left")
    }
    assert knee["right"] < 0.2 * knee["left"]


def test_joints_stop_at_their_limits_and_the_notes_say_so():
    beyond = ANGLES | {"knee_angle_r": np.full_like(TIME, np.radians(-48.0))}
    motion, at_limit = solve(made(beyond))
    assert at_limit == ("knee_angle_r",)
    np.testing.assert_allclose(motion.values[:, KNEE], np.radians(-40.0), atol=1e-5)
    notes = say(
        "import", "inverse_kinematics", rms_m=0.01, worst="RTHI", worst_m=0.02, at_limit=at_limit
    )
    assert notes[1:] == ["knee_angle_r lies at the limit of inverse kinematics."]


def test_a_failed_frame_is_refused(monkeypatch):
    monkeypatch.setattr(ik, "MOST_EVALUATIONS", 1)
    with pytest.raises(InputError, match=r"failed at 0\.000 s"):
        solve(made(noise=0.01))
