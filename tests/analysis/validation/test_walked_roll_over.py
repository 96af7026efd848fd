"""Roll-over shapes of walks: plate and model are treated alike, and what is not recorded is said."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_study import embedded_study

from vsf_drake.analysis.comparison import compare
from vsf_drake.analysis.validation.roll_over_section import (
    OPPOSITE_STRIKE,
    TOE_OFF,
    Frames,
    _arm,
    shape_numbers,
    walked_shapes,
)
from vsf_drake.motion.events import Stance
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.plants.foot import mount_pose, sole_height


@pytest.fixture(scope="module")
def walk():
    return embedded_study().walks[1]


def with_plates(walk, plates):
    recorded = replace(walk.recorded, plates=plates)
    return replace(walk, recorded=recorded, comparison=compare(walk.result, recorded.prosthetic_plate))


def test_a_plate_that_recorded_the_models_own_load_has_the_models_shape(walk):
    r = walk.result
    own = PlateRecording(r.time_s, r.grf_W, r.cop_W, r.free_moment_nm, True)
    shapes, missing = walked_shapes(with_plates(walk, {**walk.recorded.plates, r.side: own}))
    assert not missing
    row = shapes[0].row
    for name in ("radius_m", "effective_foot_length_ratio", "mean_moment_arm_m"):
        assert row["measured"][name] == pytest.approx(row["model"][name], rel=1e-9)
    np.testing.assert_allclose(shapes[0].measured, shapes[0].model, atol=1e-12)


def test_the_shape_ends_when_the_other_foot_strikes(walk):
    shapes, _ = walked_shapes(walk)
    row = shapes[0].row
    other = walk.recorded.plates["left" if walk.result.side == "right" else "right"]
    start = walk.comparison.stances[0].measured
    struck = other.time_s[(other.force_W[:, 2] > 20.0) & (other.time_s > start.start_s + 0.3)][0]
    assert row["ends_at"] == OPPOSITE_STRIKE
    assert row["end_percent"] == pytest.approx(100 * (struck - start.start_s) / start.duration_s, abs=0.3)
    percent = np.arange(101)
    assert np.isnan(shapes[0].measured[percent > row["end_percent"]]).all()
    assert np.isfinite(shapes[0].measured[(percent > 5) & (percent < row["end_percent"] - 1)]).all()


def test_without_the_other_plate_it_ends_at_toe_off_and_says_so(walk):
    side = walk.result.side
    shapes, missing = walked_shapes(with_plates(walk, {side: walk.recorded.plates[side]}))
    assert shapes[0].row["ends_at"] == TOE_OFF
    assert shapes[0].row["end_percent"] == pytest.approx(100.0)
    assert any("toe-off" in sentence for sentence in missing)


def test_without_a_centre_of_pressure_only_the_model_has_a_shape(walk):
    side = walk.result.side
    plate = walk.recorded.plates[side]
    blind = replace(plate, cop_W=np.full_like(plate.cop_W, np.nan), has_cop=False)
    shapes, missing = walked_shapes(with_plates(walk, {**walk.recorded.plates, side: blind}))
    assert set(shapes[0].row["measured"].values()) == {None}
    full, _ = walked_shapes(walk)
    assert shapes[0].row["model"] == full[0].row["model"]
    assert any("no centre of pressure" in sentence for sentence in missing)


def test_a_walk_without_a_whole_stance_has_no_shape(walk):
    cut = replace(walk.comparison, stances=tuple(replace(item, inside=False) for item in walk.comparison.stances))
    shapes, missing = walked_shapes(replace(walk, comparison=cut))
    assert not shapes
    assert walk.label in missing[0]


def test_load_runs_under_the_foot_from_heel_to_toe(walk):
    """In the pylon's frame the centre of pressure stays between the foot's ends and near its sole."""
    shape = walked_shapes(walk)[0][0]
    foot = walk.trial.model.foot
    forward, up = shape.foot_alone[np.isfinite(shape.foot_alone[:, 0])].T
    heel = shape.row["heel_m"]  # with the fitted place of the foot
    assert heel == pytest.approx(foot.heel_x_m - foot.pylon_x_m + walk.trial.offsets.fore_aft_m, abs=2e-3)
    assert forward.min() > heel
    assert forward.max() < heel + foot.length_m
    assert forward[-1] - forward[0] > 0.15
    assert np.all((up < -0.02) & (up > -foot.build_height_m - 0.01))


def test_model_and_virtual_laboratory_agree_on_the_moment_arm():
    """Two independent models of the same foot: softer settings have the shorter arm in both, within 5 mm."""
    rows = [walked_shapes(walk)[0][0].row for walk in embedded_study().walks]
    for side in ("model", "measured"):
        assert np.all(np.diff([row[side]["mean_moment_arm_m"] for row in rows]) > 0.0)
    for row in rows:
        assert row["model"]["mean_moment_arm_m"] == pytest.approx(row["measured"]["mean_moment_arm_m"], abs=5e-3)


def test_foot_that_rolls_to_its_very_toe_has_the_effective_length_of_the_foot(walk):
    """The ratio is of two lengths from one heel: a shape whose front end is the foot's toe gives 1."""
    heel, foot = walked_shapes(walk)[0][0].row["heel_m"], walk.trial.model.foot
    p_KT = [foot.heel_x_m + foot.length_m, 0.0, sole_height(foot)]
    offsets = walk.trial.offsets
    pose = mount_pose(foot, height=offsets.height_m, fore_aft=offsets.fore_aft_m, alignment=offsets.alignment_rad)
    toe = pose.inverse() @ p_KT  # seen from the unloaded mount
    found = shape_numbers(np.array([[0.0, -0.1], [toe[0], -0.1]]), heel_m=heel, foot_length_m=foot.length_m)
    assert found["effective_foot_length_ratio"] == pytest.approx(np.cos(offsets.alignment_rad), abs=1e-9)
    assert foot.heel_x_m < 0.0 < foot.heel_x_m + foot.length_m - sum(foot.keel.element_lengths_m)
def test_a_free_moment_counts_as_the_two_forces_that_make_it():
    """Forces of 350 N that push 200 mm apart in opposite directions across: at their middle 700 N and a moment of 8 N m
    about the vertical, which turns a shank that leans sideways by half a radian forward or back as well."""
    lean = np.array([[1.0, 0.0, 0.0], [0.0, np.cos(0.5), -np.sin(0.5)], [0.0, np.sin(0.5), np.cos(0.5)]])
    ankle, middle, apart = np.array([0.0, 0.02, 0.1]), np.array([0.05, 0.0, 0.0]), np.array([0.1, 0.0, 0.0])
    pair = ((middle + apart, np.array([30.0, 40.0, 350.0])), (middle - apart, np.array([30.0, -40.0, 350.0])))
    moment = sum(np.cross(place - ankle, force) for place, force in pair)
    time = np.array([0.0, 0.5, 1.0])
    shank = Frames(time, np.tile(ankle, (3, 1)), np.tile(lean, (3, 1, 1)))
    arm = _arm(shank, SimpleNamespace(measured=Stance(0.0, 1.0)), time, np.tile([60.0, 0.0, 700.0], (3, 1)),
               np.tile(middle, (3, 1)), np.full(3, 8.0))
    assert arm == pytest.approx(-moment @ lean[:, 1] / 700.0, rel=1e-12)
