from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.systems import GroundReaction


def make(rig, **changes):
    return GroundReaction(**({"body_indices": rig.site_bodies, "p_BS": rig.p_BS, "radius": rig.radius} | changes))


def loads(seed):
    rng = np.random.default_rng(seed)
    normal = rng.uniform(0.0, 300.0, 5)
    friction = np.zeros((5, 3))
    friction[:, :2] = 0.3 * normal[:, None] * rng.uniform(-1.0, 1.0, (5, 2))
    return normal, friction


def contact_points(rig, context):
    p_WS, _, _ = rig.points(context)
    return p_WS - rig.radius[:, None] * [0.0, 0.0, 1.0]


def test_ports_have_their_names(rig, port_names):
    assert port_names(make(rig)) == (["body_poses", "normal_force", "friction_force"], ["grf", "cop", "free_moment"])


@pytest.mark.parametrize("ground_height", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(4))
def test_moment_of_all_forces_about_the_centre_of_pressure_is_the_free_moment(rig, evaluate, seed, ground_height):
    context = rig.context(seed)
    normal, friction = loads(seed)
    out = evaluate(
        make(rig, ground_height=ground_height), context, normal_force=normal, friction_force=friction.ravel())
    force = friction + normal[:, None] * [0.0, 0.0, 1.0]
    moment = sum(np.cross(p - out["cop"], f) for p, f in zip(contact_points(rig, context), force, strict=True))
    np.testing.assert_allclose(moment, [0.0, 0.0, out["free_moment"][0]], atol=1e-10)
    np.testing.assert_allclose(out["grf"], force.sum(axis=0), rtol=1e-12)
    assert out["cop"][2] == ground_height


def test_centre_of_pressure_of_points_in_the_plane_is_their_force_weighted_mean(rig, evaluate):
    """The paper's equation (4)."""
    context = rig.plant.CreateDefaultContext()
    p_BS = np.array([[0.0, 0.0, 0.03], [0.1, 0.02, 0.03], [0.1, -0.03, 0.03], [0.2, 0.01, 0.03], [0.05, 0.0, 0.03]])
    system = make(rig, body_indices=[rig.frame] * 5, p_BS=p_BS, radius=0.03)
    normal, friction = loads(7)
    out = evaluate(system, context, normal_force=normal, friction_force=friction.ravel())
    np.testing.assert_allclose(out["cop"][:2], normal @ p_BS[:, :2] / normal.sum(), rtol=1e-12)


def test_centre_of_pressure_differs_from_the_mean_by_at_most_friction_coefficient_times_depth(rig, evaluate):
    context = rig.context(3)
    normal, friction = loads(3)
    out = evaluate(make(rig), context, normal_force=normal, friction_force=friction.ravel())
    points = contact_points(rig, context)
    mean = normal @ points[:, :2] / normal.sum()
    assert np.linalg.norm(out["cop"][:2] - mean) <= 0.3 * np.sqrt(2) * np.abs(points[:, 2]).max()


def test_everything_is_zero_without_load(rig, evaluate):
    out = evaluate(make(rig), rig.context(), normal_force=np.zeros(5), friction_force=np.zeros(15))
    for value in out.values():
        np.testing.assert_array_equal(value, 0.0)
