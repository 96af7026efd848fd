"""Rigid poses of marker clusters: exact on rigid clusters, least squares on others, never a mirror
or a guess."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from vsf_drake.motion.markers.segments import cluster_width, determines, mean_shape, rigid_poses

CLUSTER = np.array(
    [[0.05, 0.02, -0.1], [-0.03, 0.06, -0.25], [0.02, -0.07, -0.3], [0.08, 0.01, -0.2]]
)


def moved(cluster, seed=0, frames=40):
    rng = np.random.default_rng(seed)
    R = Rotation.random(frames, random_state=seed).as_matrix()
    p = rng.normal(size=(frames, 3))
    return R, p, cluster @ R.transpose(0, 2, 1) + p[:, None, :]


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.integers(3, 8), flat=st.booleans())
def test_a_rigid_cluster_gives_back_its_pose(seed, count, flat):
    cluster = 0.1 * np.random.default_rng(seed).normal(size=(count, 3))
    cluster[:, 1] *= not flat
    if cluster_width(cluster) < 0.01:
        return
    R, p, seen = moved(cluster, seed)
    poses = rigid_poses(cluster, seen)
    np.testing.assert_allclose(poses.R_WB, R, atol=1e-11)
    np.testing.assert_allclose(poses.p_WB, p, atol=1e-11)
    assert poses.residual_m.max() < 1e-12


def test_noisy_clusters_get_the_least_squares_of_a_general_minimiser():
    R, p, seen = moved(CLUSTER, frames=5)
    seen += 0.01 * np.random.default_rng(1).normal(size=seen.shape)
    poses = rigid_poses(CLUSTER, seen)
    for n in range(5):

        def residual(x, n=n):
            fitted = CLUSTER @ (Rotation.from_rotvec(x[:3]).as_matrix() @ R[n]).T + x[3:]
            return (fitted - seen[n]).ravel()

        best = least_squares(
            residual, np.r_[np.zeros(3), p[n]], xtol=1e-15, ftol=1e-15, gtol=1e-15
        ).x
        np.testing.assert_allclose(
            poses.R_WB[n], Rotation.from_rotvec(best[:3]).as_matrix() @ R[n], atol=1e-7
        )
        np.testing.assert_allclose(poses.p_WB[n], best[3:], atol=1e-8)
        own = np.linalg.norm(poses.R_WB[n] @ CLUSTER.T + poses.p_WB[n][:, None] - seen[n].T, axis=0)
        np.testing.assert_allclose(poses.residual_m[n], own, atol=1e-14)


def test_a_mirrored_cluster_is_rotated_not_reflected():
    poses = rigid_poses(CLUSTER, moved(CLUSTER * [1, -1, 1])[2])
    np.testing.assert_allclose(np.linalg.det(poses.R_WB), 1.0, atol=1e-12)
    assert (poses.residual_m.max(axis=1) > 0.01).all()


def test_markers_out_of_sight_are_left_out_of_their_frames_only():
    R, _, seen = moved(CLUSTER)
    seen[3:7, 1] = np.nan
    seen[5, 2, 0] = np.nan
    poses = rigid_poses(CLUSTER, seen)
    assert poses.known.tolist() == [n != 5 for n in range(40)]
    np.testing.assert_allclose(poses.R_WB[poses.known], R[poses.known], atol=1e-12)
    assert np.isnan(poses.R_WB[5]).all() and np.isnan(poses.p_WB[5]).all()
    assert (
        np.isnan(poses.residual_m[3:7, 1]).all()
        and not np.isnan(poses.residual_m[3, [0, 2, 3]]).any()
    )


@pytest.mark.parametrize(
    "cluster", [CLUSTER[:2], np.outer([0, 1, 2, 5], [0.1, 0.2, -0.1]), np.zeros((4, 3))]
)
def test_markers_on_a_line_give_no_pose(cluster):
    poses = rigid_poses(cluster, moved(cluster)[2])
    assert not poses.known.any() and np.isnan(poses.R_WB).all()
    assert cluster_width(cluster) < 1e-9
    assert not determines("pelvis", CLUSTER[:2]) and determines("foot_left", CLUSTER[:2]), (
        "with the joint's centre"
    )


def test_mean_shape_is_that_of_the_markers_in_motion():
    """Two positions of a marker, in turn, about the place where the mean is to be, and gaps."""
    cluster = CLUSTER - CLUSTER.mean(axis=0)
    R, _, seen = moved(cluster)
    np.testing.assert_allclose(
        rigid_poses(mean_shape(cluster * 1.05, seen), seen).residual_m, 0.0, atol=1e-12
    )
    spread = np.where(np.arange(40) % 2, 2e-4, -2e-4)[:, None] * np.array([0.0, 0.0, 1.0])
    seen[:, 0] += np.einsum("nij,nj->ni", R, spread)
    seen[3:7, 1] = np.nan
    shape = mean_shape(cluster, seen)
    between = [np.linalg.norm(s[:, None] - s[None], axis=2) for s in (shape, cluster)]
    np.testing.assert_allclose(*between, atol=2e-5)
