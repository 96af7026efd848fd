"""Costs of walks whose forces and motions are known in closed form."""

import dataclasses

import numpy as np
import pytest

from vsf_drake.motion.events import Stance
from vsf_drake.motion.trajectory import CoordinateTrajectory, low_pass
from vsf_drake.simulation.walk import Walker
from vsf_drake.tuning.common import Checks
from vsf_drake.tuning.costs import (
    CONSISTENCY,
    NEGATIVE_EFFICIENCY,
    POSITIVE_EFFICIENCY,
    StanceFrame,
    WalkLoads,
    deviation,
    joint_load,
    metabolic,
    positive_part,
    push_off,
    value_of,
    walk_terms,
)
from vsf_drake.tuning.options import DesignVariable, TuningOptions
from vsf_drake.tuning.problem import TrialTuning
from vsf_drake.tuning.quantities import GIVEN_TERMS

N, STEP, MASS, LEG = 1000, 1e-3, 80.0, 0.9
WEIGHT, LASTS = MASS * 9.81, 0.6
BY = 2.0  # change of every series by the one design variable, per unit of the series


def constant(*values):
    return np.tile(np.array(values, dtype=float), (N, 1))


def signal(*values):
    return np.stack([constant(*values), BY * constant(*values)], axis=2)


def loads(*, force=(0.0, 0.0, 0.0), moment=(0.0, 0.0, 0.0), joints=(0.0, 0.0), socket=(0.0,) * 6):
    return WalkLoads(ground=signal(*moment, *force), joints=signal(*joints), socket=signal(*socket))


def frame(*, rates=(0.0, 0.0), twist=(0.0,) * 6, own=None, plate=None):
    time = STEP * (1.0 + np.arange(N))
    inside = np.where((time >= 0.2 - 1e-9) & (time < 0.2 + LASTS - 1e-9), STEP, 0.0)
    late = np.where(time >= 0.2 + LASTS / 2 - 1e-9, inside, 0.0)
    return StanceFrame(
        time_s=time,
        step_s=STEP,
        stances=(Stance(0.2, 0.2 + LASTS),),
        inside=inside,
        late=late,
        rates=constant(*rates),
        twist=constant(*twist),
        weight_n=WEIGHT,
        mass_kg=MASS,
        leg_m=LEG,
        own=own or loads(),
        plate_W=None if plate is None else constant(*plate),
    )


def test_a_check_is_judged_by_a_whole_number_too():
    checks = Checks(1)
    checks.add("force_change", 0.2, 1)
    checks.add("force_change", 2.0, 1)
    assert [check.met for check in checks] == [True, False]


def test_joints_and_socket_count_by_their_squares_over_weight_and_leg():
    terms = joint_load(frame(), loads(joints=(60.0, -20.0)), socket_weight=0.01)
    assert terms["joint_moments"][0] == pytest.approx(
        (60.0**2 + 20.0**2) / (WEIGHT * LEG) ** 2, rel=1e-12
    )
    assert terms["socket"][0] == 0.0
    terms = joint_load(
        frame(), loads(socket=(0.0, 300.0, 700.0, 40.0, 0.0, 5.0)), socket_weight=0.01
    )
    wanted = (300.0**2 + 700.0**2) / WEIGHT**2 + (40.0**2 + 5.0**2) / (WEIGHT * LEG) ** 2
    assert terms["socket"][0] == pytest.approx(0.01 * wanted, rel=1e-12)


def test_positive_work_costs_four_times_itself_and_negative_work_five_sixths():
    terms = metabolic(frame(rates=(2.0, -1.0)), loads(joints=(50.0, 60.0)))
    assert terms["positive_work"][0] == pytest.approx(100.0 * LASTS / 0.25 / MASS, rel=1e-12)
    assert terms["negative_work"][0] == pytest.approx(60.0 * LASTS / 1.2 / MASS, rel=1e-12)


def test_push_off_is_the_late_work_of_the_ground_on_the_moving_shank_and_never_negative():
    terms = push_off(
        frame(twist=(0.0, 0.5, 0.0, 1.2, 0.0, 0.1)),
        loads(force=(100.0, 0.0, 900.0), moment=(0.0, 80.0, 0.0)),
    )
    power = 80.0 * 0.5 + 100.0 * 1.2 + 900.0 * 0.1
    assert value_of(terms) == pytest.approx(-power * (LASTS / 2) / MASS, rel=1e-12)
    taken = push_off(frame(twist=(0.0, 0.0, 0.0, 0.0, 0.0, -0.2)), loads(force=(0.0, 0.0, 900.0)))
    assert value_of(taken) == 0.0


def test_tracking_and_consistency_are_squared_body_weights_from_plate_and_own_force():
    given = frame(
        own=loads(force=(0.0, 0.0, 0.5 * WEIGHT)), plate=(0.0, 0.1 * WEIGHT, 0.8 * WEIGHT)
    )
    terms = walk_terms(given, loads(force=(0.2 * WEIGHT, 0.0, WEIGHT)), TuningOptions())
    parts = {name: term[0] for name, term in terms["tracking"].items()}
    assert parts == pytest.approx({"fore_aft": 0.04, "lateral": 0.01, "vertical": 0.04}, rel=1e-12)
    assert value_of(terms[CONSISTENCY]) == pytest.approx(0.04 + 0.25, rel=1e-12)
    assert "tracking" not in walk_terms(frame(), loads(), TuningOptions()), "without a plate"


def test_a_force_that_is_unknown_for_half_of_stance_is_not_tracked_there():
    """The plate says zero there; where it is known the model's force is 0.2 body weights above
    it."""
    half = 0.2 + LASTS / 2 - STEP / 2
    given = dataclasses.replace(frame(plate=(0.0, 0.0, 0.8 * WEIGHT)), unknown_s=((0.0, half),))
    given.plate_W[given.time_s < half] = 0.0
    terms = walk_terms(given, loads(force=(0.0, 0.0, WEIGHT)), TuningOptions())
    assert terms["tracking"]["vertical"][0] == pytest.approx(0.04, rel=1e-12)
    assert value_of(terms[CONSISTENCY]) == pytest.approx(1.0, rel=1e-12), (
        "the model's own force is known throughout"
    )


def test_derivatives_are_those_of_series_that_grow_in_proportion():
    """d/ds of c((1 + 2 s) series) at 0: twice that for a quadratic cost, once for one that is
    linear in the force."""
    given = loads(
        force=(50.0, 0.0, 700.0), joints=(60.0, 10.0), socket=(1.0, 2.0, 700.0, 30.0, 4.0, 5.0)
    )
    squares = joint_load(frame(), given, socket_weight=0.01) | deviation(
        frame(), given, np.zeros((N, 3))
    )
    for value, by in squares.values():
        assert by == pytest.approx(2.0 * BY * value)
    moving = frame(rates=(2.0, -1.0), twist=(0.0, 0.0, 0.0, 1.0, 0.0, 0.1))
    for value, by in (metabolic(moving, given) | push_off(moving, given)).values():
        assert by == pytest.approx(BY * value, rel=1e-12)


def test_the_positive_part_is_exact_but_for_a_quarter_of_its_width_at_zero():
    power = np.array([-500.0, -1.0, -0.5, 0.0, 0.5, 1.0, 500.0])
    part, slope = positive_part(np.column_stack([power, np.ones(7)]), 1.0).T
    assert part[[0, 1, 5, 6]].tolist() == [0.0, 0.0, 1.0, 500.0]
    assert part[3] == 0.25
    assert part == pytest.approx(np.maximum(power, 0.0), abs=0.25)
    ahead, behind = (positive_part(power[:, None] + side, 1.0)[:, 0] for side in (1e-5, -1e-5))
    assert slope == pytest.approx((ahead - behind) / 2e-5, abs=1e-5)


@pytest.mark.parametrize("margin_s", [0.0, 0.03])
def test_the_margin_counts_before_touch_down_and_after_toe_off(made_tuning, margin_s):
    """And half a stance and one margin of push-off: sums of the steps, one more or less."""
    made = made_tuning(margin_s=margin_s, late_share=0.5).parts[0].frame(2e-3)
    (stance,) = made.stances
    counted = made.time_s[made.inside > 0.0]
    assert counted[[0, -1]] == pytest.approx(
        [stance.start_s - margin_s, stance.end_s + margin_s], abs=2e-3
    )
    assert made.inside.sum() == pytest.approx(stance.duration_s + 2.0 * margin_s, abs=2.1e-3)
    pushing = made.time_s[made.late > 0.0]
    assert pushing[[0, -1]] == pytest.approx(
        [stance.start_s + 0.5 * stance.duration_s, counted[-1]], abs=2e-3
    )


def test_a_load_that_only_moves_a_joints_inertia_works_by_the_change_of_half_its_rate_squared(
    made_tuning,
):
    """Whatever happens in between: what a step's load accelerates passes through the mean of its
    two rates."""
    part = made_tuning().parts[0]
    walk = part.walker.walk(
        part.trial.trajectory,
        fulcrum_m=part.trial.fulcrum_m,
        start_s=part.trial.start_s,
        end_s=part.trial.end_s,
        step_s=2e-3,
        offsets=part.trial.offsets,
    )
    joints = [walk.mechanism.tree.index(name) for name in part.joints]
    v = np.vstack([walk.record.v0, walk.record.v])[:, joints]
    work = np.cumsum(part.frame(2e-3).rates * np.diff(v, axis=0), axis=0)
    np.testing.assert_allclose(work, 0.5 * (v[1:] ** 2 - v[0] ** 2), atol=1e-9)


def test_labels_of_the_joints_work_tell_the_efficiencies_by_which_it_counts():
    for name, efficiency in (
        ("positive_work", POSITIVE_EFFICIENCY),
        ("negative_work", NEGATIVE_EFFICIENCY),
    ):
        assert GIVEN_TERMS[name].label.endswith(f"/ {efficiency:g}")


def test_moments_of_the_ground_are_about_the_origin_wherever_the_floor_is(tuned_trials):
    """Against the sum of p x F over the spheres, at their lowest points; and a floor that is raised
    together with the motion gives the same push-off, whose shank moves past another place."""
    trial = tuned_trials["medium_2"]
    high = 0.3
    names = trial.trajectory.names
    values = trial.trajectory.values.copy()
    values[:, names.index("pelvis_ty")] += high
    motion = CoordinateTrajectory(trial.trajectory.time_s, values, names)
    raised = dataclasses.replace(trial, trajectory=motion)
    walker = Walker(trial.subject, trial.model)
    for forces in walker.gait.forces.values():
        forces.SetParameters(forces.GetMyContextFromRoot(walker.context), ground_height=high)
    design, options = (DesignVariable("fulcrum", "", "mm", 66.0, 151.0, np.nan),), TuningOptions()
    level = TrialTuning(Walker(trial.subject, trial.model), trial, "level", design, options)
    tuning = TrialTuning(walker, raised, "raised", design, options)
    one, other = (part.at(part.own, step_s=2e-3, derivatives=True) for part in (level, tuning))

    record = other.walk.record
    x, y, depth, fx, fy, fz = (
        record.site(name)[:, : other.walk.spheres]
        for name in ("x", "y", "depth", "friction_x", "friction_y", "normal_force")
    )
    z = high - depth
    moment = np.stack([y * fz - z * fy, z * fx - x * fz, x * fy - y * fx], axis=2).sum(axis=1)
    wanted = low_pass(moment, rate_hz=1.0 / other.walk.step_s, cutoff_hz=options.cutoff_hz)
    assert np.abs(other.loads.ground[:, :3, 0] - wanted).max() < 1e-6
    assert np.abs(wanted).max() > 100.0
    assert one.terms["push_off"]["push_off_work"] == pytest.approx(
        other.terms["push_off"]["push_off_work"], rel=1e-6
    ), "and its derivative by the fulcrum"
