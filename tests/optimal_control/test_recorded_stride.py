"""A periodic sagittal stride out of a recorded 3-D walk: exact where the walk is one, near where it
is not."""

from __future__ import annotations

import csv
import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import resource
from vsf_drake.model.contact_file import load_contact
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import find_stances
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.trial import load_trial
from vsf_drake.optimal_control import recorded_stride as made
from vsf_drake.optimal_control.recorded_projection import body_points
from vsf_drake.optimal_control.recorded_stride import recorded_stride
from vsf_drake.optimal_control.search import StrideTuning
from vsf_drake.optimal_control.stride import StrideOptions
from vsf_drake.simulation.sagittal.model import sagittal_coordinates
from vsf_drake.simulation.walk import Walker
from vsf_drake.walks.embedded import embedded_contact, embedded_trials

WEIGHT_N = 78.0 * GRAVITY
KINDS = (("laboratory", "medium_1"), ("exact", "high_1"))


def embedded(tier, name):
    path = next(path for path in embedded_trials(tier) if path.stem == name)
    return trial_with(load_trial(path), load_contact(embedded_contact(tier)))


@pytest.fixture(
    scope="module",
    params=[
        pytest.param(kind, marks=() if i == 0 else pytest.mark.slow) for i, kind in enumerate(KINDS)
    ],
    ids=lambda p: f"{p[0]}-{p[1]}",
)
def embedded_stride(request):
    """(name, trial, walker, stride) of an embedded trial with its fitted contact."""
    trial = embedded(*request.param)
    walker = Walker(trial.subject, trial.model)
    return request.param[1], trial, walker, recorded_stride(trial, walker)


@pytest.fixture(scope="module")
def planar():
    """(trial, stride): a walk that is sagittal and periodic, made of an embedded one, cut as that
    was cut."""
    trial = embedded("laboratory", "medium_1")
    source = recorded_stride(trial)
    names = trial.trajectory.names
    time = trial.trajectory.time_s
    values = np.zeros((len(time), len(names)))
    values[:, [names.index(name) for name in source.names]] = source.sample(time - source.start_s)[
        0
    ]
    motion = CoordinateTrajectory(time, values, names)
    side = {"prosthetic": trial.subject.prosthetic_side, "intact": "left"}
    plates = {side[foot]: plate(trial.plates[side[foot]].time_s, source, foot) for foot in side}
    return dataclasses.replace(
        trial, trajectory=motion, plates=plates, start_s=time[0], end_s=time[-1]
    ), source


@pytest.fixture
def known_period(planar, monkeypatch):
    """The period is not sought but the walk's own."""
    monkeypatch.setattr(made, "find_period", lambda *_, **__: (planar[1].period_s, "its own"))


def plate(time, stride, foot):
    """What a plate would record of the stride, all of it in the sagittal plane."""
    force, cop = stride.forces[foot].sample(time - stride.start_s)
    zero = np.zeros(len(time))
    return PlateRecording(
        time,
        np.column_stack([force[:, 0], zero, force[:, 1]]),
        np.column_stack([cop, zero, zero]),
        zero,
        True,
    )


def turned(trial, angle):
    """The same walk in a laboratory whose axes are turned by `angle` about the vertical."""
    names, values = trial.trajectory.names, np.array(trial.trajectory.values)
    place = [names.index(name) for name in ("pelvis_tx", "pelvis_tz")]
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    ground = values[:, place] * [1.0, -1.0]
    values[:, place] = (ground @ turn.T) * [1.0, -1.0]
    columns = [names.index(name) for name in ("pelvis_tilt", "pelvis_list", "pelvis_rotation")]
    # tilt about -y, then list about x, then rotation about z, each in the axes that the former have
    # turned
    pelvis = Rotation.from_euler("YXZ", values[:, columns] * [-1.0, 1.0, 1.0])
    values[:, columns] = (Rotation.from_euler("z", angle) * pelvis).as_euler("YXZ") * [
        -1.0,
        1.0,
        1.0,
    ]

    def on_floor(vectors):
        return np.column_stack([vectors[:, :2] @ turn.T, vectors[:, 2]])

    plates = {
        side: dataclasses.replace(p, force_W=on_floor(p.force_W), cop_W=on_floor(p.cop_W))
        for side, p in trial.plates.items()
    }
    return dataclasses.replace(
        trial,
        trajectory=CoordinateTrajectory(trial.trajectory.time_s, values, names),
        plates=plates,
    )


def mirrored(trial):
    """The same walk in a mirror: left is right, and what points left points right."""
    swap = {"r": "l", "l": "r"}
    names = tuple(
        name[:-1] + swap[name[-1]] if name[-2:] in ("_r", "_l") else name
        for name in trial.trajectory.names
    )
    values = trial.trajectory.values * [
        -1.0 if name in ("pelvis_tz", "pelvis_list", "pelvis_rotation") else 1.0 for name in names
    ]
    plates = {
        side: dataclasses.replace(
            p, force_W=p.force_W * [1.0, -1.0, 1.0], cop_W=p.cop_W * [1.0, -1.0, 1.0]
        )
        for side, p in zip(
            ("left", "right"), (trial.plates["right"], trial.plates["left"]), strict=True
        )
    }
    return dataclasses.replace(
        trial,
        trajectory=CoordinateTrajectory(trial.trajectory.time_s, values, names),
        plates=plates,
        subject=dataclasses.replace(trial.subject, prosthetic_side="left"),
    )


def test_a_walk_that_is_sagittal_and_periodic_comes_back(planar, known_period, monkeypatch):
    trial, source = planar
    monkeypatch.setattr(made.periodic, "forced_acceleration", lambda forces, mass: None)
    stride = recorded_stride(trial)
    t = np.linspace(0.0, source.period_s, 200)
    difference = np.abs(stride.sample(t)[0] - source.sample(t)[0]).max(axis=0)
    assert stride.start_s == pytest.approx(source.start_s, abs=1e-3)
    assert np.degrees(difference[[0, 3, 4, 5, 6, 7]]).max() < 0.1
    assert difference[1:3].max() < 3e-4
    assert stride.advance_m == pytest.approx(source.advance_m, abs=3e-4)
    assert stride.errors["prosthetic_foot_up_mm"] < 0.02
    for foot in ("prosthetic", "intact"):
        np.testing.assert_allclose(
            stride.measured(foot, t)[0][:, :2], source.measured(foot, t)[0][:, :2], atol=15.0
        )


def test_the_way_of_walking_in_the_laboratory_does_not_matter(embedded_stride):
    _, trial, walker, stride = embedded_stride
    other = recorded_stride(turned(trial, 0.6), walker)
    # The period is sought to 10 microseconds; all else follows from it.
    np.testing.assert_allclose(
        other.forward, Rotation.from_euler("z", 0.6).as_matrix()[:2, :2] @ stride.forward, atol=1e-6
    )
    t = np.linspace(0.0, 1.0, 50)
    np.testing.assert_allclose(other.period_s, stride.period_s, atol=2e-5)
    np.testing.assert_allclose(other.sample(t)[0], stride.sample(t)[0], atol=1e-4)
    np.testing.assert_allclose(
        other.measured("prosthetic", t)[0], stride.measured("prosthetic", t)[0], atol=0.2
    )


def test_left_mirrors_right(embedded_stride):
    _, trial, _, stride = embedded_stride
    other = recorded_stride(mirrored(trial))
    assert other.names == sagittal_coordinates("left")
    t = np.linspace(0.0, 1.0, 50)
    np.testing.assert_allclose(other.sample(t)[0], stride.sample(t)[0], atol=1e-4)
    np.testing.assert_allclose(
        other.measured("intact", t)[0], stride.measured("intact", t)[0], atol=0.2
    )


def test_period_is_that_of_the_walk_as_it_was_drawn(embedded_stride):
    name, *_, stride = embedded_stride
    lines = resource("data/reference_subject/draws.csv").read_text(encoding="utf-8").splitlines()
    drawn = {
        row["trial"]: row
        for row in csv.DictReader(line for line in lines if not line.startswith("#"))
    }[name]
    assert stride.period_s == pytest.approx(
        float(drawn["stance_s"]) / float(drawn["duty"]), rel=0.01
    )


def test_soles_follow_the_3d_model_while_they_stand(embedded_stride):
    _, trial, walker, stride = embedded_stride
    time = trial.trajectory.time_s
    names = trial.trajectory.names
    flat = np.zeros((len(time), len(names)))
    flat[:, [names.index(name) for name in stride.names]] = stride.sample(time - stride.start_s)[0]
    place = {"fulcrum_m": trial.fulcrum_m}
    solid = body_points(walker, trial.offsets, names, trial.trajectory.values, **place)
    seen = body_points(walker, trial.offsets, names, flat, **place)
    zero = body_points(walker, trial.offsets, (), np.zeros((1, 0)), **place)
    start, end = stride.prosthetic_stance
    rows = (time > stride.start_s + start + 0.05) & (time < stride.start_s + end - 0.05)
    heel, toe = (
        np.abs(
            seen.of("sphere P")[rows][:, columns, 2].mean(axis=1)
            - solid.of("sphere P")[rows][:, columns, 2].mean(axis=1)
        )
        for columns in ends(zero)
    )
    # A millimetre is about 3 % of body weight; the end that carries is the heel early and the toe
    # late.
    half = rows.sum() // 2
    assert np.sqrt(np.mean(heel[:half] ** 2)) < 5e-4
    assert np.sqrt(np.mean(toe[half:] ** 2)) < 5e-4


def ends(points):
    """Columns of the four hindmost and of the four foremost prosthetic spheres."""
    order = np.argsort(points.of("sphere P")[0, :, 0])
    return order[:4], order[-4:]


def test_legs_are_the_persons_and_both_feet_carry_body_weight_and_push_by_what_the_body_gains(
    embedded_stride,
):
    """Mean force less the weight is the mass by what the 3-D body's centre gains in speed over a
    stride, whose forces are blended over its overlap as the quintic of `closing_weights` rises: by
    parts, its slope weighs the gain. The embedded walks are not quite steady: they gain 0.16 to
    0.18 m/s, which alone is 1.4 % of body weight."""
    _, trial, walker, stride = embedded_stride
    body = walker.gait.person.body
    upright = stride.chain.points(np.zeros((1, 8)))[0]
    for upper, lower, length in (
        ("hip P", "knee P", body.prosthetic_thigh_length),
        ("hip I", "knee I", body.thigh_length),
        ("knee I", "ankle I", body.shank_length),
    ):
        (above,), (below,) = (upright[stride.chain.rows(name)] for name in (upper, lower))
        assert abs(above - below) == pytest.approx(length, rel=1e-12)
    t = np.linspace(0.0, stride.period_s, 2001)
    total = sum(stride.measured(foot, t)[0][:, :2] for foot in stride.forces) / (
        trial.subject.mass_kg * GRAVITY
    )
    along, up = np.trapezoid(total, t, axis=0) / stride.period_s
    points = body_points(
        walker,
        trial.offsets,
        trial.trajectory.names,
        trial.trajectory.values,
        fulcrum_m=trial.fulcrum_m,
    )
    center = np.einsum("k,nkc->nc", points.mass, points.places) / points.mass.sum()
    time, speed = trial.trajectory.time_s, np.gradient(center, trial.trajectory.time_s, axis=0)
    first, last = made.periodic.one_stride(
        (time[0], time[-1]), stride.start_s + 0.5 * sum(stride.prosthetic_stance), stride.period_s
    )
    overlap = time[(time >= first) & (time + stride.period_s <= last)]
    share = (overlap - first) / (last - stride.period_s - first)
    gain = [
        np.average(
            np.interp(overlap + stride.period_s, time, own) - np.interp(overlap, time, own),
            weights=share**2 * (1.0 - share) ** 2,
        )
        / (GRAVITY * stride.period_s)
        for own in (speed[:, :2] @ stride.forward, speed[:, 2])
    ]
    assert up == pytest.approx(1.0 + gain[1], abs=0.005)
    assert along == pytest.approx(gain[0], abs=0.005)


def test_moment_about_the_origin_is_that_of_the_force_at_the_centre_of_pressure(embedded_stride):
    stride = embedded_stride[3]
    for foot, (start, end) in (
        ("prosthetic", stride.prosthetic_stance),
        ("intact", stride.intact_stance),
    ):
        t = np.linspace(start + 0.05, end - 0.05, 50)
        force, cop = stride.measured(foot, t)
        # p x f of p = (x, 0, 0) has -x f_z about y
        np.testing.assert_allclose(force[:, 2], -cop * force[:, 1], atol=1.0)
        assert np.isfinite(stride.measured(foot, t + stride.period_s)[1]).all()
        assert np.ptp(cop) < 0.3
    t = np.array([0.3])
    later, now = (stride.measured("prosthetic", t + shift)[1] for shift in (stride.period_s, 0.0))
    np.testing.assert_allclose(later - now, stride.advance_m, atol=1e-9)


def test_a_swing_that_the_recording_cuts_is_no_stance_without_a_plate(embedded_stride):
    """Cut while the intact foot still goes back after its last lift-off, its motion shows none; the
    plate does."""
    _, trial, walker, whole = embedded_stride
    intact = trial.plates["left"]
    lifted = find_stances(intact.time_s, intact.force_W[:, 2])[-1].end_s
    motion = trial.trajectory
    for after_s in (0.06, 0.1, 0.13):
        rows = motion.time_s <= lifted + after_s
        cut = CoordinateTrajectory(motion.time_s[rows], motion.values[rows], motion.names)
        stride = recorded_stride(
            dataclasses.replace(trial, trajectory=cut, end_s=min(trial.end_s, cut.end_s)), walker
        )
        t = np.linspace(0.0, whole.period_s, 200)
        force = stride.measured("intact", t)[0]
        np.testing.assert_allclose(force, whole.measured("intact", t)[0], atol=0.05 * WEIGHT_N)


def test_a_recording_shorter_than_a_stride_is_refused(embedded_stride):
    _, trial, walker, stride = embedded_stride
    motion = trial.trajectory
    since = motion.time_s - stride.start_s
    rows = (since > -0.05) & (since < stride.prosthetic_stance[1] + 0.05)
    short = dataclasses.replace(
        trial,
        trajectory=CoordinateTrajectory(motion.time_s[rows], motion.values[rows], motion.names),
    )
    with pytest.raises(InputError, match="record longer"):
        recorded_stride(short, walker)


def test_what_makes_no_stride_is_refused(planar, known_period):
    trial, _ = planar
    values, side = np.array(trial.trajectory.values), trial.subject.prosthetic_side
    values[:, trial.trajectory.names.index("pelvis_tx")] = 0.0
    still = dataclasses.replace(
        trial,
        trajectory=CoordinateTrajectory(trial.trajectory.time_s, values, trial.trajectory.names),
    )
    with pytest.raises(InputError, match="belt_speed_m_per_s"):
        recorded_stride(still)
    unloaded = dataclasses.replace(trial.plates[side], force_W=0.0 * trial.plates[side].force_W)
    with pytest.raises(InputError, match="no strike of the prosthetic foot"):
        recorded_stride(dataclasses.replace(trial, plates=trial.plates | {side: unloaded}))
    with pytest.raises(InputError, match="prosthesis is on the left"):
        recorded_stride(
            trial, Walker(dataclasses.replace(trial.subject, prosthetic_side="left"), trial.model)
        )


def test_forces_of_one_foot_alone_are_not_followed(planar, known_period):
    trial, _ = planar
    one = dataclasses.replace(trial, plates={trial.subject.prosthetic_side: trial.prosthetic_plate})
    stride = recorded_stride(one)
    assert made.periodic.forced_acceleration(stride.forces, trial.subject.mass_kg) is None
    assert set(stride.forces) == {"prosthetic"}
    assert np.isnan(stride.measured("intact", 0.1)[0]).all()


def turned_out(trial, toe_out_rad, inversion_rad=0.0):
    own = trial.subject.prosthesis_toe_out_rad or 0.0
    return dataclasses.replace(
        trial,
        subject=dataclasses.replace(trial.subject, prosthesis_toe_out_rad=own + toe_out_rad),
        offsets=dataclasses.replace(
            trial.offsets, inversion_rad=trial.offsets.inversion_rad + inversion_rad
        ),
    )


def test_a_foot_turned_out_of_the_plane_is_seen_from_the_side_up_to_an_angle(planar):
    """The plane's foot stays; what is told of the foot in space follows the angle between them: of
    its length along the way the cosine is left, and of an inverted sole the edges lift."""
    trial, _ = planar
    straight = recorded_stride(turned_out(trial, 0.0))
    out = recorded_stride(turned_out(trial, 0.1))
    inverted = recorded_stride(turned_out(trial, 0.0, inversion_rad=0.05))
    assert np.array_equal(out.chain.local, straight.chain.local)
    assert np.array_equal(inverted.chain.local, straight.chain.local)
    more = out.errors["toe_out_deg"] - straight.errors["toe_out_deg"]
    assert more == pytest.approx(np.degrees(0.1), abs=0.3)
    assert straight.errors["sole_tilt_mm"] < 0.3
    assert inverted.errors["sole_tilt_mm"] > 0.8
    assert "5." in next(note for note in out.notes if "turned" in note)
    with pytest.raises(InputError, match=r"turned out of the way of walking by 2\d°"):
        recorded_stride(turned_out(trial, 0.4))


def test_the_sagittal_person_of_a_turned_foot_is_that_of_a_straight_one(planar):
    trial, _ = planar
    straight, out = (
        StrideTuning([one], cost="tracking", options=StrideOptions(intervals=12))
        for one in (turned_out(trial, 0.0), turned_out(trial, 0.1, inversion_rad=0.05))
    )
    for name in ("x", "z", "count"):
        assert getattr(out.stride.model.spheres, name) == pytest.approx(
            getattr(straight.stride.model.spheres, name), abs=1e-12
        )
    assert out.trial.offsets == straight.trial.offsets
