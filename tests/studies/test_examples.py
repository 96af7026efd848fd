"""The examples: every one says of mechanics what closed forms, a second method or a balance say
too."""

from __future__ import annotations

import csv
import json
import math

import biped
import contact_alternatives
import foot_of_two_stiffnesses
import friction_monte_carlo
import fulcrum_by_gradient
import fulcrum_in_swing
import leg_drop
import numpy as np
import planned_stance
import predict_setting
import protocol
import pytest
import robot_arm
import robot_arm_emulator
import standing_lqr
import stepped_leg
import walking_over_grounds
from pressed_keel import chain_stiffness
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.tree import JacobianWrtVariable
from standing_leg import inverted_pendulum
from walking_over_grounds import (
    CONTACT,
    EDGE_M,
    GROUNDS,
    SLOPE_DEG,
    STEP_M,
    TRIAL,
    in_ground,
    off,
    uphill,
    walk_on,
)

from vsf_drake.base.files import resource
from vsf_drake.model.contact_file import load_contact
from vsf_drake.model.ground import Ground
from vsf_drake.model.parameters import GRAVITY, FootParameters
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import load_trial
from vsf_drake.plants.gait import make_gait

pytestmark = pytest.mark.slow

# A setting that was not recorded: what plates saw there is the second method.


def test_the_middle_setting_is_predicted_from_the_outer_ones_within_four_percent_of_body_weight():
    assert predict_setting.main()["predicted_bw"] < 0.04


# A published test of the foot: the heel as the paper's bench measured it, wherever the fulcrum is.


def test_the_heel_by_its_clause_is_as_stiff_as_it_was_measured():
    assert protocol.main()["heel"] == pytest.approx((65.0, 65.0, 65.0), rel=0.01)


# A foot from two stiffnesses: the machine finds load over stiffness again.


def test_a_foot_from_two_stiffnesses_yields_by_load_over_stiffness_in_the_machine():
    travel_mm = foot_of_two_stiffnesses.main()
    assert travel_mm["forefoot"] == pytest.approx(800.0 / 28.0, rel=0.01)
    assert travel_mm["heel"] == pytest.approx(800.0 / 60.0, rel=0.01)


# A biped: the law of its centre of mass.


def test_a_biped_stands_on_two_feet_with_their_pressure_under_its_mass(tmp_path):
    numbers = biped.main(tmp_path, quick=True)
    assert numbers["settled"] == pytest.approx(numbers["weight"], rel=2e-3)
    assert abs(numbers["off_forward"]) < 0.01 and abs(numbers["off_sideways"]) < 0.01
    assert numbers["right_peak"] > 1.3 * numbers["left_peak"]
    assert (tmp_path / "biped.png").stat().st_size > 30_000


# Contact alternatives: what runs at 1 ms stands on its weight, is as stiff as the bench, near the
# law.


@pytest.fixture(scope="module")
def alternatives(tmp_path_factory):
    folder = tmp_path_factory.mktemp("contact_alternatives")
    return contact_alternatives.main(folder, quick=True), folder


def test_drakes_contact_at_a_millisecond_is_right_in_the_end_and_near_the_law_on_the_way(
    alternatives,
):
    numbers, folder = alternatives
    reference = json.loads((folder / "contact_alternatives.json").read_text())["reference_peak_n"]
    assert numbers["weight"] == pytest.approx((10.0 + 0.649) * 9.81)
    for contact in ("drake_point", "hydroelastic"):
        assert numbers[f"{contact}_settled"] == pytest.approx(1.0, abs=5e-3)
        assert numbers[f"{contact}_stiffness_n_per_m"] == pytest.approx(
            numbers["bench_stiffness"], rel=0.02
        )
        assert numbers[f"{contact}_peak_n"] == pytest.approx(reference, rel=0.15)
        assert numbers[f"{contact}_rms_n"] < 0.1 * reference


def test_what_is_refused_or_wrong_is_said_in_its_row(alternatives):
    with open(alternatives[1] / "contact_alternatives.csv", newline="") as stream:
        rows = {
            (row["contact"], row["plant and integrator"]): row for row in csv.DictReader(stream)
        }
    assert len(rows) == len(contact_alternatives.QUICK_CONTACTS) * len(
        contact_alternatives.QUICK_WAYS
    )
    refused, wrong = (
        rows["kelvin_voigt", "discrete 1 ms"],
        rows["kelvin_voigt", "cenic, steps to 1 ms"],
    )
    assert refused["runs"] == "no" and "explicit force" in refused["remark"]
    assert wrong["runs"] == "no" or "not on its weight" in wrong["remark"]


# Pulled over uncertain ground, the foot slips when, as often and as far as closed forms say.


@pytest.fixture(scope="module")
def draws(tmp_path_factory):
    return friction_monte_carlo.main(tmp_path_factory.mktemp("friction"), quick=True)


def test_a_draw_slips_if_and_only_if_the_pull_exceeds_static_friction(draws):
    """Who creeps shows the pull, who slips kinetic friction, reached at 1.5 times the threshold
    speed of 0.1 m/s."""
    slips, fast = draws["slips"], draws["speed"] > 0.15
    np.testing.assert_array_equal(slips, draws["mu_static"] < friction_monte_carlo.PULL)
    assert 0 < slips.sum() < len(slips) and fast.sum() > 0.8 * slips.sum()
    # The way is that of one block on one friction law.
    np.testing.assert_allclose(draws["distance"], draws["expected_distance"], rtol=0.01)
    np.testing.assert_allclose(draws["ratio"][~slips], friction_monte_carlo.PULL, rtol=2e-3)
    np.testing.assert_allclose(
        draws["ratio"][fast],
        friction_monte_carlo.KINETIC_SHARE * draws["mu_static"][fast],
        rtol=2e-3,
    )


# The fulcrum in swing: still in stance, as far as the motor goes, energy in balance, stiffness as
# of the beam.


def test_in_swing_the_fulcrum_moves_unloaded_by_a_third_of_its_range_and_energy_is_balanced(
    tmp_path,
):
    """The whole range of 85 mm takes three such swings."""
    stride = fulcrum_in_swing.main(tmp_path, quick=True)
    assert (
        stride["moved_in_stance"] < 1e-9
        and stride["load_while_enabled"] == 0.0
        and stride["swings"] == 1
    )
    assert 0.085 / 3 < stride["last"] - fulcrum_in_swing.START_M < 0.085 / 2
    assert stride["energy"] > 0.3
    assert stride["balance"] == pytest.approx(0.0, abs=0.02 * stride["energy"])
    at = stride["position_1"]
    assert (
        chain_stiffness(FootParameters(), at, 0.219)
        < stride["stiffness_1"]
        < chain_stiffness(FootParameters(), at, 0.199)
    )


def test_whole_range_takes_three_strides_at_most_and_the_ground_meets_each_position(tmp_path):
    """Glanzer & Adamczyk 2018 (PMC6289620): full-scale adjustment within three strides, a moderate
    one within one. Push-off meets the stiffness of the overhung keel, under the forefoot's centre
    of pressure, which is between the load point and 10 mm behind the keel's tip."""
    walk = fulcrum_in_swing.main(tmp_path)
    assert (
        walk["adjustments"] == 2
        and walk["adjustment_1_swings"] <= 3
        and walk["adjustment_2_swings"] == 1
    )
    assert walk["furthest"] == pytest.approx(0.151, abs=1e-3)
    assert walk["last"] == pytest.approx(fulcrum_in_swing.BACK_M, abs=1e-3)
    assert walk["moved_in_stance"] < 1e-9
    assert 0.0 < walk["adjustment_2_energy"] < walk["adjustment_1_energy"] < 5.0
    for k in range(1, 6):
        at = walk[f"position_{k}"]
        assert (
            chain_stiffness(FootParameters(), at, 0.219)
            < walk[f"stiffness_{k}"]
            < chain_stiffness(FootParameters(), at, 0.199)
        )


# The dropped leg: free fall, momentum, weight and energy are those of mechanics.


def test_a_dropped_leg_falls_freely_lands_and_rests_on_its_weight_and_makes_no_energy(tmp_path):
    """Springs at their rest angle and no rail friction: sqrt(2 h / g), less a step of the
    integrator."""
    drop = leg_drop.main(tmp_path, quick=True)
    assert drop["touch_down"] == pytest.approx(math.sqrt(2 * leg_drop.DROP_M / 9.81), abs=1e-3)
    assert drop["weight"] == pytest.approx((10.0 + 5.0 + 2.0 + 0.649) * 9.81, rel=1e-6)
    assert drop["settled"] == pytest.approx(drop["weight"], rel=5e-3)
    assert drop["foam_force"] == pytest.approx(drop["weight"], rel=5e-3)
    assert 0.0 < drop["largest_depth"] < 0.03
    # The impulse of ground and weight is the change of momentum.
    change = drop["impulse"] - drop["weight"] * drop["duration"]
    assert change == pytest.approx(drop["momentum"], abs=1e-3 * drop["weight"] * drop["duration"])
    assert drop["peak"] > 2.0 * drop["weight"]
    assert drop["largest_rise"] < 1e-6 * drop["dropped_energy"]
    assert drop["unaccounted"] < 0.02 * drop["dropped_energy"]
    assert drop["friction_loss"] > 0.0 and drop["foam_loss"] > 0.0


# The robot arm's test of the foot: forces by a second integrator, work by energies, the arm's
# yielding by statics.


ARM_SOFT, ARM_MIDDLE = robot_arm_emulator.FULCRUMS_M


@pytest.fixture(scope="module")
def arm_tests(tmp_path_factory):
    return robot_arm_emulator.main(tmp_path_factory.mktemp("arm"), quick=True)


@pytest.mark.parametrize("fulcrum_m", [ARM_SOFT, ARM_MIDDLE])
def test_the_implicit_stepper_finds_the_same_force_and_centre_of_pressure_on_the_same_path(
    arm_tests, fulcrum_m
):
    """Other wiring, other integrator, 1 ms: within 2 % of the peak but where spheres leave the
    ground."""
    run, stepper = arm_tests[fulcrum_m], arm_tests[fulcrum_m]["stepper"]
    inner = (stepper.time_s > 0.02) & (stepper.time_s < 0.65)
    grf = np.column_stack(
        [np.interp(stepper.time_s, run["time"], run["grf"][:, k]) for k in (0, 2)]
    )
    assert np.abs(grf - stepper.grf_W[:, [0, 2]])[inner].max() < 0.02 * run["peak"]
    cop = np.interp(stepper.time_s, run["time"], run["cop"][:, 0])
    assert np.abs(cop - stepper.cop_W[:, 0])[inner].max() < 3e-3
    # The work in the mount is what the foot holds and loses.
    assert run["unaccounted_j"] < 0.01 * run["stored_j"]
    assert 0.0 < run["returned_j"] < run["stored_j"]
    assert all(lost[-1] > 0.0 for lost in run["lost"].values())


def test_the_load_goes_heel_to_toe_in_two_humps_and_a_softer_foot_returns_less_at_the_toe(
    arm_tests,
):
    for run in arm_tests.values():
        cop, time = run["cop"][run["loaded"], 0], run["time"][run["loaded"]]
        assert np.diff(np.interp(np.arange(0.05, 0.65, 0.02), time, cop)).min() > 0.0
        up = np.interp([0.15, 0.32, 0.55], run["time"], run["grf"][:, 2])
        assert up[1] < 0.95 * min(up[0], up[2])
    late = {
        fulcrum_m: np.interp(0.55, run["time"], run["grf"][:, 2])
        for fulcrum_m, run in arm_tests.items()
    }
    assert late[ARM_SOFT] < 0.7 * late[ARM_MIDDLE]
    assert arm_tests[ARM_SOFT]["returned_j"] < arm_tests[ARM_MIDDLE]["returned_j"]


def test_the_arm_yields_by_its_load_over_inertia_and_squared_frequency(arm_tests):
    """Inverse dynamics leaves M (e'' + 2 w e' + w² e) = J' F: slow at the second hump, hence e =
    M⁻¹ J' F / w²."""
    run = arm_tests[ARM_MIDDLE]
    arm, late = run["arm"], run["time"] > 0.4
    i = int(np.argmax(np.where(late, run["grf"][:, 2], 0.0)))
    plant, context = arm.plant, arm.plant.CreateDefaultContext()
    plant.SetPositions(context, arm.arm, arm.joints.value(run["time"][i]).ravel())
    tool, world = plant.GetFrameByName("tool"), plant.world_frame()
    axes = [plant.GetJointByName(f"axis_{k}").velocity_start() for k in range(1, 7)]
    inertia = plant.CalcMassMatrix(context)[np.ix_(axes, axes)]

    def jacobian(p_WP):
        point = tool.CalcPoseInWorld(context).inverse().multiply(p_WP).reshape(3, 1)
        return plant.CalcJacobianTranslationalVelocity(
            context, JacobianWrtVariable.kV, tool, point, world, world
        )[:, axes]

    torque = jacobian(run["cop"][i]).T @ run["grf"][i]
    angles = np.linalg.solve(inertia, torque) / (2.0 * np.pi * robot_arm.SERVO_HZ) ** 2
    mount = jacobian(arm.wired.foot.mount.CalcPoseInWorld(context).translation()) @ angles
    assert run["error"][i, 1] == pytest.approx(mount[2], rel=0.1)


# Standing on the keel: at rest, linearised by two methods, unstable alone and stable with LQR.


SOFT, STIFF = standing_lqr.FULCRUMS_M


@pytest.fixture(scope="module")
def standing(tmp_path_factory):
    return standing_lqr.main(tmp_path_factory.mktemp("standing"), quick=True)


@pytest.mark.parametrize("fulcrum_m", [SOFT, STIFF])
def test_at_rest_the_weight_is_under_the_centre_of_mass_and_derivatives_equal_central_differences(
    standing, fulcrum_m
):
    """Row by row: accelerations of keel pieces have derivatives of 1e7, those of the trunk of
    10."""
    run = standing[fulcrum_m]
    np.testing.assert_allclose(run["grf"], [0.0, 0.0, run["weight"]], atol=1e-6 * run["weight"])
    assert run["cop"][0] == pytest.approx(run["com"][0], abs=1e-6)
    largest = np.abs(run["A"]).max(axis=1, keepdims=True)
    assert np.abs((run["A"] - run["difference"]) / largest).max() < 1e-5
    # The horizontal place is neutral and out of the torques' reach: creep sums the impulse of
    # friction, which torques can only change together with the momentum.
    assert np.abs(run["A"][:, run["leg"].index("x")]).max() < 1e-6
    assert run["neutral_B"] < 1e-6


@pytest.mark.parametrize("fulcrum_m", [SOFT, STIFF])
def test_constant_torques_let_the_person_fall_and_lqr_keeps_the_person_up(standing, fulcrum_m):
    run = standing[fulcrum_m]
    moving = run["closed"][np.abs(run["closed"]) > standing_lqr.NEUTRAL]
    assert run["open"].real.max() > 1.0 and moving.real.max() < -0.5
    at = [run["leg"].index(name) for name in standing_lqr.POSTURE]
    fallen, instant = (
        run["dropped"]["state"][-1, at] - run["x0"][at],
        len(run["dropped"]["time"]) - 1,
    )
    upright, linear = (
        state[:, at] - run["x0"][at] for state in (run["regulated"]["state"], run["predicted"])
    )
    assert np.abs(fallen).max() > 10.0 * np.abs(upright[instant]).max()
    assert np.abs(upright[-1]).max() < 0.5 * np.abs(upright).max()
    # It moves as its linear model says.
    assert (np.abs(upright - linear).max(axis=0) < 0.1 * np.abs(linear).max(axis=0)).all()


def test_with_joints_locked_the_leg_is_an_inverted_pendulum_on_the_spring_of_its_foot(standing):
    """Rate² = (weight times height - stiffness against tilt) / inertia, stiffness from statics: the
    soft foot falls.

    Within 10 %: the pendulum knows no damping, no sinking and no sway of the keel.
    """
    for fulcrum_m, run in standing.items():
        stiffness, weight_height, inertia = inverted_pendulum(fulcrum_m)
        squared = (weight_height - stiffness) / inertia
        slow = run["locked"][
            (np.abs(run["locked"]) < 10.0) & (np.abs(run["locked"]) > standing_lqr.NEUTRAL)
        ]
        rate = slow[np.argmax(slow.real)]
        assert np.sign(squared) == (1.0 if fulcrum_m == SOFT else -1.0)
        assert np.abs(rate) == pytest.approx(np.sqrt(np.abs(squared)), rel=0.1)
        assert (rate.real > 1.0) == (squared > 0)
    assert standing[SOFT]["open"].real.max() > standing[STIFF]["open"].real.max()


# The whole person on five grounds: what rotation, friction, springs in series and the other foot
# say of each.


PAPER_BW = 0.053
"""Body weights, root mean square, that McGeehan's model left in the very trial it was fitted to."""
SOLE_M = 0.24
ROW_M = 0.0105
"""Between two rows of the forefoot's spheres."""
SAME_BW = 1e-3
"""What the integrator's accuracy of 1e-3 is worth, in body weights."""


@pytest.fixture(scope="module")
def trial():
    return trial_with(load_trial(resource(TRIAL)), load_contact(resource(CONTACT)))


@pytest.fixture(scope="module")
def weight(trial):
    return GRAVITY * trial.subject.mass_kg


@pytest.fixture(scope="module")
def gait(trial):
    """The person, for poses."""
    return make_gait(trial.subject, trial.model)


@pytest.fixture(scope="module")
def over_grounds(tmp_path_factory):
    """Until the foot is flat, the other one leaving the ground."""
    folder = tmp_path_factory.mktemp("grounds")
    runs = walking_over_grounds.main(folder, quick=True)
    assert {path.name for path in folder.iterdir()} == {
        "grounds.json",
        "walking_over_grounds.png",
        "walking_over_grounds.svg",
    }
    return runs


def test_uphill_every_anatomical_body_has_the_level_pose_turned_about_the_worlds_lateral_axis(
    trial, gait
):
    """Also with list and rotation of the pelvis, as the trial has them, and between samples."""
    plant, names = gait.plant, gait.person.coordinate_names
    at = [plant.GetJointByName(name).position_start() for name in names]
    # x turns up, towards z
    turn = RigidTransform(RotationMatrix.MakeYRotation(-np.radians(SLOPE_DEG)), np.zeros(3))
    context = plant.CreateDefaultContext()
    columns = [names.index(f"pelvis_{name}") for name in ("list", "rotation")]

    def poses(motion, time_s):
        q = np.zeros(plant.num_positions())
        q[at] = motion.ordered(names).sample(time_s)[0][0]
        plant.SetPositions(context, q)
        return {name: body.EvalPoseInWorld(context) for name, body in gait.person.segments.items()}

    times = np.array([0.4123, 0.6, 0.8, 1.2])
    assert np.all(
        np.ptp(trial.trajectory.ordered(names).sample(times)[0][:, columns], axis=0)
        > np.radians(1.0)
    )
    for time_s in times:
        level, tilted = (
            poses(trial.trajectory, time_s),
            poses(uphill(trial.trajectory, SLOPE_DEG), time_s),
        )
        for name, pose in level.items():
            np.testing.assert_allclose(
                tilted[name].GetAsMatrix4(), (turn @ pose).GetAsMatrix4(), atol=1e-9
            )


def test_in_the_slopes_axes_forces_are_those_of_level_ground_but_for_weight_that_hangs_free(
    over_grounds, gait, weight
):
    """Gravity turns against the motion. It moves nothing prescribed, but bears on socket, pylon and
    foot. The strike catches that weight suddenly: on a spring such a load has at most twice its
    effect at rest.
    """
    slope, level, ground = over_grounds["slope"], over_grounds["level"], GROUNDS["slope"]
    np.testing.assert_allclose(
        in_ground(slope.intact_grf_W, ground), level.intact_grf_W, atol=SAME_BW * weight
    )
    plant, anatomy = gait.plant, {body.index() for body in gait.person.segments.values()}
    free_kg = sum(
        plant.get_body(index).default_mass()
        for index in plant.GetBodyIndices(gait.person.foot.instance)
    )
    free_kg += sum(plant.GetBodyByName(name).default_mass() for name in ("socket_body", "pylon"))
    prescribed_kg = sum(plant.get_body(index).default_mass() for index in anatomy)
    assert prescribed_kg + free_kg == pytest.approx(weight / GRAVITY)  # nothing is left out
    turned_weight = free_kg * GRAVITY * 2.0 * np.sin(0.5 * np.radians(SLOPE_DEG))
    difference = in_ground(slope.grf_W, ground) - level.grf_W
    assert np.linalg.norm(difference, axis=1).max() < 2.0 * turned_weight + SAME_BW * weight
    loaded = level.grf_W[:, 2] > 200.0
    np.testing.assert_allclose(
        in_ground(slope.cop_W[loaded], ground),
        level.cop_W[loaded],
        atol=turned_weight / 200.0 * SOLE_M,
    )
    np.testing.assert_allclose(
        slope.cop_W[loaded, 2], np.tan(np.radians(SLOPE_DEG)) * slope.cop_W[loaded, 0], atol=1e-9
    )


@pytest.mark.parametrize("name", ["step", "mat", "ice"])
def test_what_is_under_the_prosthesis_alone_changes_nothing_for_the_other_foot(
    over_grounds, weight, name
):
    """Pelvis and joints are prescribed, so the feet do not feel each other; each of the two runs
    has the integrator's error."""
    level = over_grounds["level"].intact_grf_W
    assert level[:, 2].max() > 0.5 * weight
    np.testing.assert_allclose(over_grounds[name].intact_grf_W, level, atol=2.0 * SAME_BW * weight)
    assert (
        np.abs(over_grounds[name].grf_W - over_grounds["level"].grf_W).max()
        > 10.0 * SAME_BW * weight
    )


def test_the_step_is_felt_from_when_a_sphere_beyond_its_edge_is_lower_than_it_and_then_adds_load(
    over_grounds, gait, weight
):
    step, level = over_grounds["step"], over_grounds["level"]
    first = next(i for i, q in enumerate(level.q) if lowest_beyond_the_edge(gait, q) < STEP_M)
    more = step.grf_W[:, 2] - level.grf_W[:, 2]
    assert level.grf_W[first, 2] > 0.5 * weight  # on the heel
    assert np.abs(more[:first]).max() < SAME_BW * weight
    assert more.min() > -SAME_BW * weight
    assert more[-1] > 20.0 * SAME_BW * weight
    loaded = step.grf_W[:, 2] > 20.0
    assert np.all((step.cop_W[loaded, 2] > -1e-12) & (step.cop_W[loaded, 2] < STEP_M))
    assert step.cop_W[-1, 2] > 0.0


def lowest_beyond_the_edge(gait, q):
    """Least z (m) of the prosthetic spheres whose centres are beyond EDGE_M."""
    context, sites = gait.plant.CreateDefaultContext(), gait.person.foot.sites
    gait.plant.SetPositions(context, q)
    centres = np.array(
        [
            gait.plant.get_body(index).EvalPoseInWorld(context) @ centre
            for index, centre in zip(sites.body_indices, sites.p_BS, strict=True)
        ]
    )
    return (centres[:, 2] - sites.radius)[centres[:, 0] >= EDGE_M].min()


def test_the_mat_in_series_with_the_foam_lowers_load_and_loading_rate(over_grounds, weight):
    mat, level = over_grounds["mat"].grf_W[:, 2], over_grounds["level"].grf_W[:, 2]
    assert np.all(mat <= level + SAME_BW * weight)
    assert mat.max() < 0.9 * level.max()
    assert np.diff(mat).max() < 0.9 * np.diff(level).max()


def test_friction_stays_in_the_cone_of_each_ground_and_ice_limits_braking(over_grounds, trial):
    own = trial.model.foot.friction.mu_static
    for name, run in over_grounds.items():
        patch, force = GROUNDS[name].patches[-1], in_ground(run.grf_W, GROUNDS[name])
        mu = own if patch.mu_static is None else patch.mu_static
        assert np.all(np.hypot(force[:, 0], force[:, 1]) <= mu * force[:, 2] + 1e-9), name
    ice, level = over_grounds["ice"], over_grounds["level"]
    braking = level.grf_W[:, 0] < -1.5 * GROUNDS["ice"].patches[-1].mu_static * level.grf_W[:, 2]
    assert np.any(braking)  # more than ice can give
    assert np.all(ice.grf_W[braking, 0] > level.grf_W[braking, 0])
    assert ice.grf_W[:, 0].min() > 0.5 * level.grf_W[:, 0].min()


def test_over_a_stance_on_level_ground_the_load_is_what_was_recorded_and_goes_from_heel_to_toe(
    trial, weight
):
    """A synthetic trial that the contact was not fitted to; nearer than the paper came to one that
    it was fitted to."""
    run = walk_on(trial, Ground())
    force, share = run.grf_W, (run.time_s - run.time_s[0]) / (run.time_s[-1] - run.time_s[0])
    assert off(force[:, 2], run.time_s, trial.prosthetic_plate) < PAPER_BW * weight
    # Two humps, braking and propulsion stand out by more than that error.
    first, middle, last = (
        force[(share >= a) & (share < b), 2] for a, b in ((0.0, 0.35), (0.35, 0.6), (0.6, 1.0))
    )
    assert min(first.max(), last.max()) - middle.min() > 2.0 * PAPER_BW * weight
    assert force[share < 0.35, 0].min() < -PAPER_BW * weight
    assert force[share > 0.6, 0].max() > PAPER_BW * weight
    loaded = force[:, 2] > 0.1 * weight
    way = run.cop_W[loaded, 0]
    assert way[-1] - way[0] > 0.8 * SOLE_M
    # nearer than its rows the sole does not know where it is
    assert np.max(np.maximum.accumulate(way) - way) < ROW_M
    assert force[0, 2] == 0.0
    assert force[-1, 2] == 0.0


# Optimised over a massless keel: the full foot walks what was planned, a gradient finds what a
# sweep does.


def test_a_stance_planned_on_a_massless_keel_is_walked_by_the_full_foot(tmp_path):
    numbers = planned_stance.main(tmp_path)
    assert numbers["solved"]
    assert numbers["rms"] < 0.03, "body weights"
    assert numbers["peak"] > 1.0, "one leg bears the body"
    assert (tmp_path / "planned_stance.png").stat().st_size > 30_000


def test_the_fulcrum_that_gradients_find_is_better_than_any_of_a_sweep_and_stiffness_grows(
    tmp_path,
):
    numbers = fulcrum_by_gradient.main(tmp_path, quick=True)
    assert numbers["gradient_error"] < 1e-5
    assert 0.0 < numbers["off"] <= numbers["least_swept"]
    rest = fulcrum_by_gradient.Rest()
    sunk = [fulcrum_by_gradient.fulcrum_for(rest, at, at).sunk[-1] for at in (0.08, 0.11, 0.14)]
    assert sunk[0] > sunk[1] > sunk[2]
    assert (tmp_path / "fulcrum_by_gradient.png").stat().st_size > 20_000


# The stepper as a system: an environment, a controller, many draws.


def test_a_stepped_leg_stands_on_its_weight_tracks_and_is_shaken_about_it(tmp_path):
    numbers = stepped_leg.main(tmp_path, quick=True)
    weight = 17.65 * GRAVITY
    assert numbers["force"] == pytest.approx(weight, rel=2e-3)
    assert numbers["error"] < 0.04, "rad"
    assert abs(numbers["shaken"] - weight) < 3.0 * numbers["spread"] < 0.5 * weight
    assert (tmp_path / "stepped_leg.png").stat().st_size > 10_000


def test_an_environment_that_is_reset_repeats_itself_and_ends_when_it_is_thrown():
    environment = stepped_leg.LegEnvironment()
    runs = []
    for _ in range(2):
        first, _ = environment.reset()
        runs.append([first, *(environment.step(np.array([0.0, 9.0, -9.0]))[0] for _ in range(20))])
    np.testing.assert_array_equal(*runs)
    environment.reset()
    *_, reward, terminated, truncated, _ = environment.step(np.array([0.0, 1e9, 0.0]))
    assert reward < 0.0 and terminated and not truncated
    observed, _ = environment.reset()
    np.testing.assert_array_equal(observed, runs[0][0])
