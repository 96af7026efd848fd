"""Rolling over: shapes and arms of known answer, the profile of ISO 22675, and what physics asks of
the section."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from made_study import embedded_study, saved_section

from vsf_drake.base.errors import InputError
from vsf_drake.device.roll_over import (
    DURATION_S,
    Load,
    described,
    fit_arc,
    force_share,
    iso_22675,
    iso_roll_over,
    mean_moment_arm,
    rolled_row,
    tilt_rad,
)
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import Stance
from vsf_drake.motion.formats.recording import PlateRecording
from vsf_drake.simulation.roll_over import RollOver
from vsf_drake.validation.roll_over_section import (
    OPPOSITE_STRIKE,
    TOE_OFF,
    RollOverFrames,
    _arm,
    _shank,
    roll_over_section,
    walked_shapes,
)
from vsf_drake.walks.comparison import compare


def arc(radius, centre=(0.02, 0.2), start=-0.25, end=0.5, n=60):
    angle = np.linspace(start, end, n)
    return np.column_stack([centre[0] + radius * np.sin(angle), centre[1] - radius * np.cos(angle)])


def numbers(points, heel_m=0.0):
    return described(points, heel_m=heel_m, foot_length_m=0.245, arm_m=None)


@pytest.mark.parametrize("radius", [0.05, 0.3, 0.9])
def test_arc_of_a_circle_has_its_radius_and_centre(radius):
    np.testing.assert_allclose(fit_arc(arc(radius)), (0.02, 0.2, radius), rtol=1e-9, atol=1e-9)


def test_fit_is_the_least_sum_of_squared_distances_wherever_the_arc_lies_and_however_it_is_turned():
    """No circle nearby is nearer to a noisy arc; checked by moving each of its three numbers both
    ways."""
    points = arc(0.3) + 2e-3 * np.random.default_rng(2).normal(size=(60, 2))
    best = fit_arc(points)

    def cost(x, z, r):
        return np.sum((np.linalg.norm(points - [x, z], axis=1) - r) ** 2)

    for step in 1e-6 * np.vstack([np.eye(3), -np.eye(3)]):
        assert cost(*(best + step)) > cost(*best)
    turned = points @ np.array([[0.0, 1.0], [-1.0, 0.0]]) + [1.5, -0.7]
    assert fit_arc(turned)[2] == pytest.approx(best[2], rel=1e-9)


@pytest.mark.parametrize(
    "points",
    [
        np.column_stack([np.linspace(0, 0.2, 30), np.full(30, -0.08)]),
        np.full((30, 2), np.nan),
        np.zeros((30, 2)),
        arc(0.3)[:3],
    ],
)
def test_a_straight_line_a_point_or_nothing_has_no_radius(points):
    assert fit_arc(points) is None


def test_dwelling_of_the_load_does_not_change_the_arc():
    """The same shape, no circle, a quarter of the samples in its first tenth."""
    slow = np.concatenate([np.linspace(-0.25, -0.175, 75), np.linspace(-0.174, 0.5, 200)])
    shape = np.column_stack([0.3 * np.sin(slow), -0.3 * np.cos(slow) ** 2])
    even = np.linspace(-0.25, 0.5, 400)
    same = np.column_stack([0.3 * np.sin(even), -0.3 * np.cos(even) ** 2])
    assert numbers(shape).radius_m == pytest.approx(numbers(same).radius_m, rel=1e-3)


def test_effective_length_runs_from_the_heel_to_the_front_end():
    points = np.vstack([[np.nan, np.nan], arc(0.3, centre=(0.0, 0.2))])
    found = numbers(points, heel_m=-0.055)
    assert found.effective_foot_length_ratio == pytest.approx((0.055 + 0.3 * np.sin(0.5)) / 0.245)
    assert found.radius_m == pytest.approx(0.3, rel=1e-3)
    assert set(vars(numbers(np.full((101, 2), np.nan))).values()) == {None}


def test_mean_arm_weighs_by_force_and_leaves_out_what_is_unknown():
    """A quarter of the impulse at 20 mm, the rest at 60 mm; instants without a centre of pressure
    do not count."""
    time = np.linspace(0.0, 1.0, 1001)
    force, arm = np.where(time < 0.5, 100.0, 300.0), np.where(time < 0.5, 0.02, 0.06)
    assert mean_moment_arm(time, arm * force, force) == pytest.approx(0.05, abs=1e-4)
    moment = np.where(time < 0.5, np.nan, arm * force)
    assert mean_moment_arm(time, moment, force) == pytest.approx(0.06, abs=1e-4)
    assert mean_moment_arm(time, np.full(1001, np.nan), force) is None


PROFILE_S = np.linspace(0.0, DURATION_S, 6001)


def test_peaks_and_valley_have_the_published_instants_forces_and_tilts():
    """Between nothing at both ends; the tilt runs from -20 to +40 degrees."""
    for low, high, sign, at_s, share, tilt_deg in (
        (0.0, 0.3, 1, 0.151, 1.0, -15.0),
        (0.3, 0.6, 1, 0.4475, 0.987, 19.8),
        (0.2, 0.4, -1, 0.3, 0.668, -0.1),
    ):
        time = PROFILE_S[(PROFILE_S > low) & (PROFILE_S < high)]
        at = time[np.argmax(sign * force_share(time))]
        assert at == pytest.approx(at_s, abs=2e-3 if sign < 0 else 1e-3)
        assert force_share(np.array([at]))[0] == pytest.approx(share, abs=1e-3)
        # the valley is flat: its tilt is that at the published instant
        tilt = np.degrees(tilt_rad(np.array([at_s if sign < 0 else at])))[0]
        assert tilt == pytest.approx(tilt_deg, abs=0.15 if sign < 0 else 0.1)
    ends = np.array([0.0, DURATION_S])
    np.testing.assert_allclose(force_share(ends), 0.0, atol=1e-3)
    np.testing.assert_allclose(np.degrees(tilt_rad(ends)), [-20.04, 40.1], atol=0.1)
    assert force_share(PROFILE_S).min() == 0.0 and np.all(np.diff(tilt_rad(PROFILE_S)) > 0.0)


@pytest.fixture(scope="module")
def section(quick_validation):
    return saved_section(quick_validation, "roll_over")


def test_profile_is_followed_at_the_subjects_weight_which_is_said(section):
    iso = section.table.iso
    assert iso.force_n == pytest.approx(78.0 * GRAVITY)
    assert iso.force_from == "weight" and iso.follows and section.missing == ()
    for row in iso.positions:
        force = section.arrays[f"iso_{row.fulcrum_mm:.0f}_force_n"]
        assert np.abs(force - section.arrays["iso_wanted_n"]).max() < 0.01 * iso.force_n


def test_friction_changes_what_is_lost_and_hardly_the_shape(section):
    """Geometry is of the tilt and the deflection; friction, at most half of the normal force, acts
    across them."""
    iso = section.table.iso
    for smooth, rough in zip(iso.positions, iso.with_friction, strict=True):
        assert rough.radius_m == pytest.approx(smooth.radius_m, rel=0.1)
        assert rough.lost_by_sliding_j > 1.0 > smooth.lost_by_sliding_j == 0.0
        assert 0.0 < rough.return_ratio < smooth.return_ratio < 1.0


def test_softer_settings_deflect_more_store_more_and_roll_on_a_smaller_arc(section):
    for name, sign in (
        ("deflection_forefoot_mm", -1),
        ("stored_forefoot_j", -1),
        ("radius_m", 1),
        ("effective_foot_length_ratio", 1),
        ("dorsiflexing_moment_nm", 1),
    ):
        assert np.all(
            sign * np.diff([getattr(row, name) for row in section.table.iso.positions]) > 0.0
        ), name
    forefoot = [row for row in section.table.inclined if row.angle_deg > 0.0]
    assert np.all(np.diff([row.stiffness_n_per_mm for row in forefoot]) > 0.0)
    assert np.all(np.diff([row.energy_stored_j for row in forefoot]) < 0.0)


def test_fulcrum_has_hardly_a_part_at_the_heel(section):
    """Foam on the heel block carries the load; what of it is under the keel's rear end bends that a
    little."""
    heel, toe = (
        [row for row in section.table.inclined if (row.angle_deg < 0.0) == rear]
        for rear in (True, False)
    )
    apart = [
        np.ptp(values) / np.mean(values)
        for values in ([row.displacement_mm for row in of] for of in (heel, toe))
    ]
    assert apart[0] < 0.01 and apart[1] > 0.5
    assert all(set(row.zones_loaded) <= {"heel_posterior", "heel", "heel_anterior"} for row in heel)


@pytest.mark.parametrize("force", [-100.0, 1e6, np.nan])
def test_a_force_no_foot_is_tested_with_is_refused_by_name(force):
    study = embedded_study()
    wrong = replace(study, options=replace(study.options, iso_force_n=force))
    with pytest.raises(InputError, match="iso_force_n"):
        roll_over_section(wrong)


def test_with_friction_the_grounds_moment_about_the_mount_is_what_the_drive_holds():
    """But for the foot's own weight, at most at the foot's length, and an inertia with
    accelerations below g."""
    foot, time = embedded_study().model.foot, np.linspace(0.0, DURATION_S, 301)
    machine = RollOver(foot, friction=True)
    run, following = machine.roll(
        fulcrum_m=0.108, time_s=time, tilt_rad=tilt_rad(time), force_n=765.0 * force_share(time)
    )
    moment = rolled_row(machine, run, following, 0.108, iso_22675())[1]["moment_nm"]
    loaded, most = following.wanted_n > 100.0, 2.0 * foot.mass_kg * GRAVITY * foot.length_m
    np.testing.assert_allclose(-run.load[loaded, 2], moment[loaded], atol=most)
    assert np.abs(run.mount[:, 1] * run.grf_W[:, 0]).max() > 10.0 * most, (
        "friction has a part in it"
    )


@pytest.fixture(scope="module")
def walk():
    return embedded_study().walks[1]


def with_plates(walk, plates):
    recorded = replace(walk.recorded, plates=plates)
    return replace(
        walk, recorded=recorded, comparison=compare(walk.result, recorded.prosthetic_plate)
    )


def test_a_plate_that_recorded_the_models_own_load_has_the_models_shape(walk):
    r = walk.result
    own = PlateRecording(r.time_s, r.grf_W, r.cop_W, r.free_moment_nm, True)
    shapes, missing = walked_shapes(with_plates(walk, {**walk.recorded.plates, r.side: own}))
    assert not missing
    row, seen = shapes[0]
    assert vars(row.measured) == pytest.approx(vars(row.model), rel=1e-9)
    np.testing.assert_allclose(seen["measured"], seen["model"], atol=1e-12)


def test_the_shape_ends_when_the_other_foot_strikes(walk):
    row, seen = walked_shapes(walk)[0][0]
    other = walk.recorded.plates["left" if walk.result.side == "right" else "right"]
    start = walk.comparison.stances[0].measured
    struck = other.time_s[(other.force_W[:, 2] > 20.0) & (other.time_s > start.start_s + 0.3)][0]
    end = 100 * (struck - start.start_s) / start.duration_s
    percent, own = np.arange(101), seen["measured"]
    assert row.ends_at == OPPOSITE_STRIKE
    assert np.isnan(own[percent > end + 0.3]).all()
    assert np.isfinite(own[(percent > 5) & (percent < end - 1.3)]).all()
    side = walk.result.side
    shapes, missing = walked_shapes(with_plates(walk, {side: walk.recorded.plates[side]}))
    assert shapes[0][0].ends_at == TOE_OFF and np.isfinite(shapes[0][1]["measured"][98]).all()
    assert any("toe-off" in sentence for sentence in missing)
    [other_side] = {"left", "right"} - {side}
    unknown = {other_side: ((struck - 0.1, struck + 0.2),)}  # that plate saw the stance in part
    partly = replace(walk, recorded=replace(walk.recorded, unmeasured=unknown))
    assert walked_shapes(partly)[0][0][0].ends_at == TOE_OFF


def test_without_a_centre_of_pressure_only_the_model_has_a_shape(walk):
    side = walk.result.side
    plate = walk.recorded.plates[side]
    blind = replace(plate, cop_W=np.full_like(plate.cop_W, np.nan), has_cop=False)
    shapes, missing = walked_shapes(with_plates(walk, {**walk.recorded.plates, side: blind}))
    assert set(vars(shapes[0][0].measured).values()) == {None}
    assert shapes[0][0].model == walked_shapes(walk)[0][0][0].model
    assert any("no centre of pressure" in sentence for sentence in missing)


def test_a_walk_without_a_whole_stance_has_no_shape(walk):
    cut = replace(
        walk.comparison,
        stances=tuple(replace(item, inside=False) for item in walk.comparison.stances),
    )
    shapes, missing = walked_shapes(replace(walk, comparison=cut))
    assert not shapes and walk.label in missing[0]


def test_load_runs_under_the_foot_from_heel_to_toe(walk):
    """The centre of pressure stays between the foot's ends and near its sole, but for what the
    socket gives."""
    (_, seen), foot = walked_shapes(walk)[0][0], walk.trial.model.foot
    forward, up = seen["model"][np.isfinite(seen["model"][:, 0])].T
    heel = _shank(walk)[1]  # with the fitted place of the foot
    assert heel == pytest.approx(
        foot.heel_x_m - foot.pylon_x_m + walk.trial.offsets.fore_aft_m, abs=2e-3
    )
    assert (
        heel < forward.min()
        and forward.max() < heel + foot.length_m
        and forward[-1] - forward[0] > 0.15
    )
    assert np.all((up < -0.02) & (up > -foot.build_height_m - 0.01))


def test_model_and_virtual_laboratory_agree_on_the_moment_arm():
    """Two independent models of the same foot: softer settings have the shorter arm in both, within
    5 mm."""
    rows = [walked_shapes(walk)[0][0][0] for walk in embedded_study().walks]
    for side in ("model", "measured"):
        assert np.all(np.diff([getattr(row, side).mean_moment_arm_m for row in rows]) > 0.0)
    for row in rows:
        assert row.model.mean_moment_arm_m == pytest.approx(
            row.measured.mean_moment_arm_m, abs=5e-3
        )


@pytest.mark.slow
def test_the_arm_in_walking_and_under_the_profile_differ_by_their_loads_alone():
    """One foot in one machine: under the tilt and the force of a walk it has that walk's arm, but
    for what socket and friction do; under ISO 22675, whose ground stays lowered in front for
    longer, by a third less."""
    study = embedded_study()
    walked: list[float] = []
    driven: list[float] = []
    machine = RollOver(study.model.foot, friction=False)
    for walk in study.walks:
        (item,) = (one for one in walk.comparison.stances if one.inside)
        time = np.linspace(item.measured.start_s, item.measured.end_s, 301)
        forward = _shank(walk)[0].at(time).axes[:, :, 0]
        tilt = -np.arctan2(forward[:, 2], np.hypot(forward[:, 0], forward[:, 1]))
        force = np.interp(time, walk.result.time_s, walk.result.grf_W[:, 2].clip(0.0)) * np.cos(
            tilt
        )
        force[0] = 0.0
        place = {"fulcrum_m": walk.trial.fulcrum_m, "time_s": time - time[0]}
        run, following = machine.roll(**place, tilt_rad=tilt, force_n=force)
        load = Load(
            name=walk.label,
            time_s=place["time_s"],
            tilt_rad=tilt,
            force_bw=force,
            shape_ends_s=time[-1] - time[0],
        )
        row, _ = rolled_row(machine, run, following, walk.trial.fulcrum_m, load)
        driven.append(1e3 * row.mean_moment_arm_m)
        walked.append(1e3 * walked_shapes(walk)[0][0][0].model.mean_moment_arm_m)
    rows, _, _ = iso_roll_over(
        study.model.foot,
        [walk.trial.fulcrum_m for walk in study.walks],
        steps=600,
        force_n=study.walks[0].trial.subject.mass_kg * 9.81,
    )
    profiled = [1e3 * row.mean_moment_arm_m for row in rows]
    guide = (Path(__file__).parents[2] / "docs/guide/stiffness_map.md").read_text(encoding="utf-8")
    for found in (walked, profiled, driven):
        first, second, third = (f"{arm:.0f}" for arm in found)
        assert f"{first}, {second} and {third} mm" in guide.replace("\n  ", " ")
    np.testing.assert_allclose(driven, walked, atol=6.0)
    assert np.all(np.array(profiled) < 0.7 * np.array(walked))


def test_on_the_heel_the_shapes_are_farther_apart_than_later_and_without_it_the_radii_agree():
    """The circle through the whole shape is off by 10 to 20 % at all three settings; without the
    first tenth of stance the same two shapes have radii within 8 %."""
    for walk in embedded_study().walks:
        ((row, seen),) = walked_shapes(walk)[0]
        model, measured = row.model, row.measured
        whole = abs(model.radius_m / measured.radius_m - 1.0)
        assert abs(model.radius_after_heel_m / measured.radius_after_heel_m - 1.0) < min(
            0.08, 0.6 * whole
        )
        assert row.heel_apart_m > 3.0 * row.later_apart_m
        later = seen["measured"].copy()
        later[:10] = np.nan
        assert numbers(later).radius_m == measured.radius_after_heel_m


def test_a_free_moment_counts_as_the_two_forces_that_make_it():
    """Forces of 350 N that push 200 mm apart in opposite directions across: at their middle 700 N
    and a moment of 8 N m about the vertical, which turns a shank that leans sideways by half a
    radian forward or back as well."""
    lean = np.array(
        [[1.0, 0.0, 0.0], [0.0, np.cos(0.5), -np.sin(0.5)], [0.0, np.sin(0.5), np.cos(0.5)]]
    )
    ankle, middle, apart = (
        np.array([0.0, 0.02, 0.1]),
        np.array([0.05, 0.0, 0.0]),
        np.array([0.1, 0.0, 0.0]),
    )
    pair = (
        (middle + apart, np.array([30.0, 40.0, 350.0])),
        (middle - apart, np.array([30.0, -40.0, 350.0])),
    )
    moment = sum(np.cross(place - ankle, force) for place, force in pair)
    time = np.array([0.0, 0.5, 1.0])
    shank = RollOverFrames(time, np.tile(ankle, (3, 1)), np.tile(lean, (3, 1, 1)))
    arm = _arm(
        shank,
        SimpleNamespace(measured=Stance(0.0, 1.0)),
        time,
        np.tile([60.0, 0.0, 700.0], (3, 1)),
        np.tile(middle, (3, 1)),
        np.full(3, 8.0),
    )
    assert arm == pytest.approx(-moment @ lean[:, 1] / 700.0, rel=1e-12)
