"""Settings as they were walked, on made-up strides whose scatter and whose model error are known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import t as student

from vsf_drake.analysis.validation.settings_section import walked_rows
from vsf_drake.analysis.validation.settings_walks import NAMES
from vsf_drake.analysis.validation.study import FITTED, HELD_OUT

AT = (66.0, 108.0, 151.0)


def bases(measured, simulated, role=HELD_OUT):
    """A walk for each row of (walks, 3 settings), all outcomes alike."""
    return [SimpleNamespace(walk=SimpleNamespace(fulcrum_mm=x, role=role),
                            measured=SimpleNamespace(values=np.full(len(NAMES), measured[i, j])),
                            simulated=SimpleNamespace(values=np.full(len(NAMES), simulated[i, j])))
            for j, x in enumerate(AT) for i in range(len(measured))]


def ends(found):
    return next(row for row in found if row["from_mm"] == AT[0] and row["to_mm"] == AT[-1])


@pytest.mark.parametrize("error", [0.0, 0.1, 1.0, 5.0])
def test_without_a_difference_of_settings_at_most_one_in_twenty_is_told_apart(error):
    """However well the model follows each stride: then it tells strides apart, and settings no better."""
    random = np.random.default_rng(5)
    told = 0
    for _ in range(400):
        measured = random.standard_normal((3, 3))
        told += ends(walked_rows(bases(measured, measured + error * random.standard_normal((3, 3)))))["told_apart"]
    assert told <= 0.05 * 400 + 3.0 * np.sqrt(400 * 0.05 * 0.95)


def test_half_widths_are_t_times_the_standard_errors_within_settings():
    random = np.random.default_rng(2)
    measured, error = random.standard_normal((3, 3)), random.standard_normal((3, 3))
    row = ends(walked_rows(bases(measured, measured + error)))
    width = student.ppf(0.975, 6) * np.sqrt(2.0 / 3.0)
    assert row["error_half_width"] == pytest.approx(width * np.sqrt(error.var(axis=0, ddof=1).mean()))
    assert row["stride_half_width"] == pytest.approx(width * np.sqrt((measured + error).var(axis=0, ddof=1).mean()))
    assert row["measured"] == pytest.approx(measured[:, 2].mean() - measured[:, 0].mean())


def test_difference_far_beyond_strides_and_error_is_told_apart_unless_the_model_has_its_sign_wrong():
    random = np.random.default_rng(4)
    measured = 0.1 * random.standard_normal((3, 3)) + np.array([0.0, 5.0, 10.0])
    error = 0.1 * random.standard_normal((3, 3))
    assert all(row["told_apart"] is True for row in walked_rows(bases(measured, measured + error)))
    assert all(row["told_apart"] is False for row in walked_rows(bases(measured, error - measured)))


def test_one_walk_a_setting_or_walks_that_the_fit_has_seen_tell_nothing():
    measured = np.array([[0.0, 5.0, 10.0]])
    assert all(row["told_apart"] is None and row["beyond_strides"] is None
               for row in walked_rows(bases(measured, measured)))
    three = np.repeat(measured, 3, axis=0) + 0.1 * np.random.default_rng(1).standard_normal((3, 3))
    assert all(row["told_apart"] is None for row in walked_rows(bases(three, three, role=FITTED)))
