"""The whole person on five grounds: what rotation, friction, springs in series and the other foot say of each."""

from __future__ import annotations

import numpy as np
import pytest
import walking_over_grounds
from pydrake.math import RigidTransform, RotationMatrix
from walking_over_grounds import CONTACT, EDGE_M, GROUNDS, SLOPE_DEG, STEP_M, TRIAL, in_ground, off, uphill, walk_on

from vsf_drake.contact_file import load_contact
from vsf_drake.files import resource
from vsf_drake.ground import Ground
from vsf_drake.motion.fitted_trial import trial_with
from vsf_drake.motion.trial import load_trial
from vsf_drake.parameters import GRAVITY
from vsf_drake.plants.gait import make_gait

PAPER_BW = 0.053
"""Body weights, root mean square, that McGeehan's model left in the very trial it was fitted to."""
SOLE_M = 0.24
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
def runs(tmp_path_factory):
    """Until the foot is flat, the other one leaving the ground."""
    folder = tmp_path_factory.mktemp("grounds")
    runs = walking_over_grounds.main(folder, quick=True)
    assert {path.name for path in folder.iterdir()} == {
        "grounds.json", "walking_over_grounds.png", "walking_over_grounds.svg"}
    return runs


def test_uphill_every_anatomical_body_has_the_pose_of_level_ground_turned_about_the_worlds_lateral_axis(trial, gait):
    """Also with list and rotation of the pelvis, as the trial has them, and between samples."""
    plant, names = gait.plant, gait.person.coordinate_names
    at = [plant.GetJointByName(name).position_start() for name in names]
    turn = RigidTransform(RotationMatrix.MakeYRotation(-np.radians(SLOPE_DEG)), np.zeros(3))  # x turns up, towards z
    context = plant.CreateDefaultContext()
    columns = [names.index(f"pelvis_{name}") for name in ("list", "rotation")]

    def poses(motion, time_s):
        q = np.zeros(plant.num_positions())
        q[at] = motion.ordered(names).sample(time_s)[0][0]
        plant.SetPositions(context, q)
        return {name: body.EvalPoseInWorld(context) for name, body in gait.person.segments.items()}

    times = np.array([0.4123, 0.6, 0.8, 1.2])
    assert np.all(np.ptp(trial.trajectory.ordered(names).sample(times)[0][:, columns], axis=0) > np.radians(1.0))
    for time_s in times:
        level, tilted = poses(trial.trajectory, time_s), poses(uphill(trial.trajectory, SLOPE_DEG), time_s)
        for name, pose in level.items():
            np.testing.assert_allclose(tilted[name].GetAsMatrix4(), (turn @ pose).GetAsMatrix4(), atol=1e-9)


@pytest.mark.slow
def test_in_the_slopes_axes_the_forces_are_those_of_level_ground_but_for_the_weight_of_what_hangs_free(
        runs, gait, weight):
    """Gravity turns against the motion. It moves nothing prescribed, but bears on socket, pylon and foot."""
    slope, level, ground = runs["slope"], runs["level"], GROUNDS["slope"]
    np.testing.assert_allclose(in_ground(slope.intact_grf_W, ground), level.intact_grf_W, atol=SAME_BW * weight)
    plant, anatomy = gait.plant, {body.index() for body in gait.person.segments.values()}
    free_kg = sum(plant.get_body(index).default_mass() for index in plant.GetBodyIndices(gait.person.foot.instance))
    free_kg += sum(plant.GetBodyByName(name).default_mass() for name in ("socket_body", "pylon"))
    prescribed_kg = sum(plant.get_body(index).default_mass() for index in anatomy)
    assert prescribed_kg + free_kg == pytest.approx(weight / GRAVITY)  # nothing is left out
    turned_weight = free_kg * GRAVITY * 2.0 * np.sin(0.5 * np.radians(SLOPE_DEG))
    difference = in_ground(slope.grf_W, ground) - level.grf_W
    assert np.linalg.norm(difference, axis=1).max() < turned_weight + SAME_BW * weight
    loaded = level.grf_W[:, 2] > 200.0
    np.testing.assert_allclose(in_ground(slope.cop_W[loaded], ground), level.cop_W[loaded],
                               atol=turned_weight / 200.0 * SOLE_M)
    np.testing.assert_allclose(slope.cop_W[loaded, 2], np.tan(np.radians(SLOPE_DEG)) * slope.cop_W[loaded, 0],
                               atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["step", "mat", "ice"])
def test_what_is_under_the_prosthesis_alone_changes_nothing_for_the_other_foot(runs, weight, name):
    """Pelvis and joints are prescribed, so the feet do not feel each other."""
    level = runs["level"].intact_grf_W
    assert level[:, 2].max() > 0.5 * weight
    np.testing.assert_allclose(runs[name].intact_grf_W, level, atol=SAME_BW * weight)
    assert np.abs(runs[name].grf_W - runs["level"].grf_W).max() > 10.0 * SAME_BW * weight


@pytest.mark.slow
def test_the_step_is_felt_from_when_a_sphere_beyond_its_edge_is_lower_than_it_and_then_adds_load(runs, gait, weight):
    step, level = runs["step"], runs["level"]
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
    centres = np.array([gait.plant.get_body(index).EvalPoseInWorld(context) @ centre
                        for index, centre in zip(sites.body_indices, sites.p_BS, strict=True)])
    return (centres[:, 2] - sites.radius)[centres[:, 0] >= EDGE_M].min()


@pytest.mark.slow
def test_the_mat_in_series_with_the_foam_lowers_load_and_loading_rate(runs, weight):
    mat, level = runs["mat"].grf_W[:, 2], runs["level"].grf_W[:, 2]
    assert np.all(mat <= level + SAME_BW * weight)
    assert mat.max() < 0.9 * level.max()
    assert np.diff(mat).max() < 0.9 * np.diff(level).max()


@pytest.mark.slow
def test_friction_stays_in_the_cone_of_each_ground_and_ice_limits_braking(runs, trial):
    own = trial.model.foot.friction.mu_static
    for name, run in runs.items():
        patch, force = GROUNDS[name].patches[-1], in_ground(run.grf_W, GROUNDS[name])
        mu = own if patch.mu_static is None else patch.mu_static
        assert np.all(np.hypot(force[:, 0], force[:, 1]) <= mu * force[:, 2] + 1e-9), name
    ice, level = runs["ice"], runs["level"]
    braking = level.grf_W[:, 0] < -1.5 * GROUNDS["ice"].patches[-1].mu_static * level.grf_W[:, 2]
    assert np.any(braking)  # more than ice can give
    assert np.all(ice.grf_W[braking, 0] > level.grf_W[braking, 0])
    assert ice.grf_W[:, 0].min() > 0.5 * level.grf_W[:, 0].min()


@pytest.mark.slow
def test_over_a_whole_stance_on_level_ground_the_load_is_what_was_recorded_and_goes_from_heel_to_toe(trial, weight):
    """A synthetic trial that the contact was not fitted to; nearer than the paper came to one that it was fitted to."""
    run = walk_on(trial, Ground())
    force, share = run.grf_W, (run.time_s - run.time_s[0]) / (run.time_s[-1] - run.time_s[0])
    assert off(force[:, 2], run.time_s, trial.prosthetic_plate) < PAPER_BW * weight
    first, middle, last = (force[(share >= a) & (share < b), 2] for a, b in ((0.0, 0.35), (0.35, 0.6), (0.6, 1.0)))
    assert min(first.max(), last.max()) > weight > 1.1 * middle.min()
    assert force[share < 0.35, 0].min() < -0.05 * weight
    assert force[share > 0.6, 0].max() > 0.05 * weight
    loaded = force[:, 2] > 0.1 * weight
    way = run.cop_W[loaded, 0]
    assert way[-1] - way[0] > 0.8 * SOLE_M
    assert np.all(np.diff(way) > -1e-3)
    assert force[0, 2] == 0.0
    assert force[-1, 2] == 0.0
