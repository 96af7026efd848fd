"""Stretches in which something is true."""

from __future__ import annotations

import numpy as np

from vsf_drake.motion.events import longest_run, runs


def test_runs_are_the_true_stretches():
    assert runs([True, False, True, True, False]) == [(0, 1), (2, 4)]
    assert runs([False, False]) == []
    assert runs([True]) == [(0, 1)]
    assert runs(np.zeros(0, bool)) == []


def test_longest_run_is_the_first_of_equals_and_none_of_nothing():
    assert longest_run(np.array([1, 1, 0, 1, 1, 1], bool)).tolist() == [3, 4, 5]
    assert longest_run([True, False, True]).tolist() == [0]
    assert len(longest_run(np.zeros(5, bool))) == 0
