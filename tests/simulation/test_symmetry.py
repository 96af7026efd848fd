"""A left prosthesis on mirrored motion answers with mirrored forces."""

from __future__ import annotations

import numpy as np
import pytest

MIRROR = np.array([1.0, -1.0, 1.0])


@pytest.fixture(scope="module")
def both(stance):
    return stance("right", 1e-3), stance("left", 1e-3)


def test_ground_reaction_is_mirrored(both, body_weight):
    right, left = both
    assert np.abs(right.prosthetic.grf_W[:, 1]).max() > 0.05 * body_weight, "a planar walk would show nothing"
    np.testing.assert_allclose(left.prosthetic.grf_W * MIRROR, right.prosthetic.grf_W, atol=1e-9 * body_weight)
    np.testing.assert_allclose(left.prosthetic.cop_W * MIRROR, right.prosthetic.cop_W, atol=1e-10)
    np.testing.assert_allclose(-left.prosthetic.free_moment_nm, right.prosthetic.free_moment_nm, atol=1e-8)


def test_joint_loads_are_mirrored(both, walker):
    """Coordinates are clinical: equal on both sides but for the pelvis's lateral ones."""
    right, left = both
    other = {"_r": "_l", "_l": "_r"}
    names = left.mechanism.tree
    for name in walker("right").gait.prescribed:
        pelvis = name.startswith("pelvis")
        sign = -1.0 if name in ("pelvis_tz", "pelvis_list", "pelvis_rotation") else 1.0
        mirrored = name if pelvis else name[:-2] + other[name[-2:]]
        load = right.record.load[:, right.mechanism.tree.index(name)]
        np.testing.assert_allclose(sign * left.record.load[:, names.index(mirrored)], load,
                                   atol=1e-9 * max(1.0, np.abs(load).max()), err_msg=name)


def test_keel_and_socket_move_alike(both):
    right, left = both
    for name in right.mechanism.tree.coordinate_names:
        if name.startswith(("keel", "socket")):
            sign = -1.0 if name == "socket_ty" else 1.0
            i, j = right.mechanism.tree.index(name), left.mechanism.tree.index(name)
            np.testing.assert_allclose(sign * left.record.q[:, j], right.record.q[:, i], atol=1e-11, err_msg=name)
