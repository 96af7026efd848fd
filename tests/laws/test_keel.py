"""The chain of keel pieces: closed form of two pieces, and its slopes by the turns."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.laws.keel import chain, piece_at

STARTS = np.array([0.0, 0.033, 0.078, 0.101])


def test_joints_lie_at_the_ends_of_the_pieces_behind_them():
    c, s, x, z = chain(np.array([0.0, 0.3]), np.array([np.pi / 6, np.pi / 3]))
    np.testing.assert_allclose([x, z], [[0.0, 0.3 * np.cos(np.pi / 6)], [0.0, 0.15]], atol=1e-15)
    np.testing.assert_allclose([c, s], [[np.cos(np.pi / 6), 0.0], [0.5, 1.0]], atol=1e-15)


def test_a_turn_moves_what_is_beyond_its_joint_about_it(assert_gradient, autodiff_gradient):
    """Virtual work: a joint's height grows by its lever arm to each joint behind it."""
    turns = np.array([0.1, -0.2, 0.3, 0.05])

    def last_height(turns):
        return chain(STARTS, turns)[3][-1:]

    _, _, x, _ = chain(STARTS, turns)
    np.testing.assert_allclose(autodiff_gradient(last_height, turns), [x[-1] - x], atol=1e-15)
    assert_gradient(last_height, turns)
    many = np.repeat(turns[:, None], 3, axis=1) + 1e-20j * np.eye(4, 3)
    np.testing.assert_allclose(chain(STARTS, many)[3][-1].imag / 1e-20, x[-1] - x[:3], atol=1e-15)


@pytest.mark.parametrize(
    ("position", "piece"), [(0.0, 0), (0.0329, 0), (0.033, 1), (0.09, 2), (0.101, 3), (0.3, 3)]
)
def test_a_point_is_on_the_piece_that_begins_at_or_behind_it(position, piece):
    assert piece_at(STARTS, position) == piece
