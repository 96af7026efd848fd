"""How a person answers the setting: what a made person does is found again, turned walks are the
same walks, and what cannot be told is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import resource
from vsf_drake.motion.events import known_stances
from vsf_drake.motion.formats.recording import os_to_world, world_to_os
from vsf_drake.motion.markers.joints import joint_angles, joint_rotation
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.trial import load_trial
from vsf_drake.plants.anthropometry import scale_body
from vsf_drake.walks.answer import LEG_ANGLES, SEEN, Answer, answer_of, answer_sentences

SOFT_M, MIDDLE_M, STIFF_M = 0.066, 0.1085, 0.151


@pytest.fixture(scope="module")
def trial():
    return load_trial(resource("data/reference_subject/exact/medium_1.yaml"))


def with_angles(trial, fulcrum_m, **degrees):
    """The recorded walk at a setting, joint angles moved by constants."""
    motion = trial.trajectory
    values = motion.values.copy()
    for name, by in degrees.items():
        values[:, motion.names.index(name)] += np.radians(by)
    return replace(trial, fulcrum_m=fulcrum_m, trajectory=motion.with_values(values))


def turned(trial, by_rad):
    """The walk in another direction of the laboratory."""
    motion = trial.trajectory
    names = list(motion.names)
    path, angles = (
        [names.index(f"pelvis_{end}") for end in ends]
        for ends in (("tx", "ty", "tz"), ("tilt", "list", "rotation"))
    )
    c, s = np.cos(by_rad), np.sin(by_rad)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    values = motion.values.copy()
    values[:, path] = world_to_os(os_to_world(values[:, path]) @ R.T)
    pelvis = R @ joint_rotation(values[:, angles], "pelvis", "right")
    values[:, angles] = np.unwrap(joint_angles(pelvis, "pelvis", "right"), axis=0)
    plates = {
        side: replace(plate, force_W=plate.force_W @ R.T, cop_W=plate.cop_W @ R.T)
        for side, plate in trial.plates.items()
    }
    return replace(trial, trajectory=motion.with_values(values), plates=plates)


def slower(trial, factor):
    """The same walk at 1 / factor of the speed."""
    motion = trial.trajectory
    plates = {
        side: replace(plate, time_s=factor * plate.time_s) for side, plate in trial.plates.items()
    }
    return replace(
        trial,
        trajectory=CoordinateTrajectory(factor * motion.time_s, motion.values, motion.names),
        plates=plates,
        start_s=factor * trial.start_s,
        end_s=factor * trial.end_s,
    )


def test_an_answer_that_is_linear_in_the_fulcrum_is_found_between_the_settings(trial):
    side = trial.subject.prosthetic_side[0]
    soft = with_angles(trial, SOFT_M, **{f"knee_angle_{side}": 4.0, f"hip_flexion_{side}": 1.0})
    stiff = with_angles(trial, STIFF_M)
    answer = answer_of([soft, stiff])
    middle = answer.trial_at(MIDDLE_M)
    own = with_angles(trial, MIDDLE_M, **{f"knee_angle_{side}": 2.0, f"hip_flexion_{side}": 0.5})
    assert middle.start_s == pytest.approx(answer.share[0] * answer.stance_s(MIDDLE_M))
    from_plate = next(s.start_s for s in known_stances(trial.prosthetic_plate) if s.complete)
    at = np.linspace(0.0, 0.6, 40)
    known = own.trajectory.sample(from_plate + at)[0]
    found = middle.trajectory.sample(at)[0]
    columns = [own.trajectory.names.index(name) for name in LEG_ANGLES]
    assert np.degrees(np.abs(found - known)[:, columns]).max() < 0.05
    table = {row.name: row for row in answer.table().coordinates}
    assert table[f"knee_angle_{side}"].answer == pytest.approx(4.0, abs=1e-6)


def test_the_foot_of_a_mean_walk_is_as_high_as_the_mean_of_the_feet(trial):
    """The thigh stays, the shank turns by 5 degrees to either side: the end of the mean shank is
    farther than the mean of the ends, by length (1 - cos 5 deg) along the shank. The pelvis rises
    by the vertical part."""
    side = trial.subject.prosthetic_side[0]
    bent, straight = (
        with_angles(trial, at, **{f"knee_angle_{side}": by})
        for at, by in ((SOFT_M, 10.0), (STIFF_M, 0.0))
    )
    answer = answer_of([bent, straight])
    upright = int(np.argmin(np.abs(answer.share - 0.4)))  # within 15 degrees
    column = answer.names.index("pelvis_ty")
    soft, middle, stiff = (
        answer.trial_at(at).trajectory.values[upright, column] for at in (SOFT_M, MIDDLE_M, STIFF_M)
    )
    body = scale_body(trial.subject, trial.model.foot, trial.model.socket)
    longer = (body.residual_length + body.pylon_length) * (1.0 - np.cos(np.radians(5.0)))
    assert np.cos(np.radians(15.0)) * longer < middle - 0.5 * (soft + stiff) < longer


@pytest.mark.parametrize("by_deg", [30.0, 180.0])
def test_a_walk_in_another_direction_is_the_same_walk(trial, by_deg):
    soft = replace(trial, fulcrum_m=SOFT_M)
    stiff = replace(turned(trial, np.radians(by_deg)), fulcrum_m=STIFF_M)
    answer = answer_of([soft, stiff])
    assert np.abs(np.diff(answer.values, axis=0)).max() < 1e-9
    assert answer.table().answer_deg < 1e-6
    assert np.allclose(answer.walks[0].force_n, answer.walks[1].force_n, atol=1e-6)


def test_spread_is_the_standard_deviation_between_walks_of_one_setting(trial):
    side = trial.subject.prosthetic_side[0]
    walks = [
        with_angles(trial, at, **{f"knee_angle_{side}": by + answered})
        for at, answered in ((SOFT_M, 3.0), (STIFF_M, 0.0))
        for by in (-1.0, 1.0)
    ]
    table = answer_of(walks).table()
    knee = next(row for row in table.coordinates if row.name == f"knee_angle_{side}")
    assert knee.spread == pytest.approx(np.sqrt(2.0))
    assert knee.answer == pytest.approx(3.0)
    assert table.chance_deg == pytest.approx(table.spread_deg)  # two walks each: sqrt(1/2 + 1/2)
    assert table.larger_than_chance


def test_what_walks_differ_by_anyhow_is_no_answer(trial):
    side = trial.subject.prosthetic_side[0]
    walks = [
        with_angles(trial, at, **{f"knee_angle_{side}": by})
        for at in (SOFT_M, STIFF_M)
        for by in (-1.0, 1.0)
    ]
    table = answer_of(walks).table()
    assert table.larger_than_chance is False
    told = [line for line in answer_sentences(table) if "no answer to the setting is seen" in line]
    assert f"not more than {SEEN:g} times" in told[0]


def test_few_walks_tell_an_interval_of_their_own_setting_alone(trial):
    """Two walks at each end: of numbers a side's spread the mean's standard error is 1 / sqrt(2) at
    an end and 1 / 2 in the middle, and Student's t of two degrees of freedom 4.303."""
    walks = [replace(trial, fulcrum_m=at) for at in (SOFT_M, STIFF_M) for _ in range(2)]
    numbers = np.array([-1.0, 1.0, 4.0, 6.0]) / np.sqrt(2.0)
    answer = answer_of(walks)
    assert answer.half_width(numbers, STIFF_M) == pytest.approx(4.3027 / np.sqrt(2.0), rel=1e-4)
    assert answer.half_width(numbers, MIDDLE_M) == pytest.approx(4.3027 / 2.0, rel=1e-4)
    assert answer_of(walks[1:3]).half_width(numbers[1:3], STIFF_M) is None


def test_settings_walked_at_different_speeds_are_told(trial):
    stiff = replace(slower(trial, 1.08), fulcrum_m=STIFF_M)
    table = answer_of([replace(trial, fulcrum_m=SOFT_M), stiff]).table()
    assert table.speeds_m_per_s[0] == pytest.approx(1.08 * table.speeds_m_per_s[1], rel=2e-2)
    told = answer_sentences(table)
    assert any("differ in speed" in line for line in told)
    assert any("No setting was walked twice" in line for line in told)
    assert any("does not know how people adapt" in line for line in told)


def test_between_unequal_times_of_stance_lies_their_mean(trial):
    stiff = replace(slower(trial, 1.08), fulcrum_m=STIFF_M)
    answer: Answer = answer_of([replace(trial, fulcrum_m=SOFT_M), stiff])
    soft_s, stiff_s = (answer.stance_s(at) for at in (SOFT_M, STIFF_M))
    assert stiff_s == pytest.approx(1.08 * soft_s, rel=1e-3)
    assert answer.stance_s(MIDDLE_M) == pytest.approx(0.5 * (soft_s + stiff_s))


def test_a_walk_moved_to_its_own_setting_is_itself_and_elsewhere_keeps_its_own_way(trial):
    """Two walks a setting, a degree to either side of an answer of 3: at the other setting the
    walk that bends the knee more still does by the same."""
    side = trial.subject.prosthetic_side[0]
    walks = [
        with_angles(trial, at, **{f"knee_angle_{side}": by + answered})
        for at, answered in ((SOFT_M, 3.0), (STIFF_M, 0.0))
        for by in (-1.0, 1.0)
    ]
    answer = answer_of(walks)
    knee = answer.names.index(f"knee_angle_{side}")
    own = answer.moved(1, SOFT_M).trajectory.values[:, knee]
    assert np.allclose(own, answer.walks[1].values[:, knee], atol=1e-12)
    moved = answer.moved(1, STIFF_M)
    assert np.allclose(np.degrees(own - moved.trajectory.values[:, knee]), 3.0, atol=1e-9)
    stance = (answer.share > 0.05) & (answer.share < 0.95)
    force = moved.prosthetic_plate.force_W[stance]
    assert np.allclose(force, answer.walks[1].force_n[stance], atol=1e-6)  # all have one plate


def without_prosthetic_plate(trial):
    return replace(trial, plates={})


@pytest.mark.parametrize(
    ("second", "says"),
    [
        (None, "one walk tells nothing"),
        (lambda t: replace(t, fulcrum_m=SOFT_M + 0.003), "all walks are of one setting"),
        (lambda t: replace(slower(t, 1.5), fulcrum_m=STIFF_M), "it was walked at"),
        (
            lambda t: replace(
                t, subject=replace(t.subject, mass_kg=t.subject.mass_kg + 9.0), fulcrum_m=STIFF_M
            ),
            "its subject or model is not that of",
        ),
        (
            lambda t: replace(without_prosthetic_plate(t), fulcrum_m=STIFF_M),
            "has no force of the prosthetic foot",
        ),
        (lambda t: replace(t, end_s=t.start_s + 0.4, fulcrum_m=STIFF_M), "has no whole stance"),
    ],
    ids=["one walk", "one setting", "mixed speeds", "other person", "no plate", "cut stance"],
)
def test_what_tells_no_answer_is_refused(trial, second, says):
    soft = replace(trial, fulcrum_m=SOFT_M)
    with pytest.raises(InputError, match=says):
        answer_of([soft, *([second(soft)] if second else [])])


@pytest.mark.parametrize("fulcrum_m", [0.0655, 0.1515])
def test_a_setting_outside_of_the_recorded_ones_is_refused(trial, fulcrum_m):
    answer = answer_of([replace(trial, fulcrum_m=SOFT_M), replace(trial, fulcrum_m=STIFF_M)])
    with pytest.raises(InputError, match="outside of the recorded settings"):
        answer.trial_at(fulcrum_m)
