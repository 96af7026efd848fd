"""The foot pulled over uncertain ground slips when, as often and as far as closed forms say."""

from __future__ import annotations

import friction_monte_carlo as example
import numpy as np
import pytest
from scipy.optimize import brentq

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def draws(tmp_path_factory):
    return example.main(tmp_path_factory.mktemp("friction"), quick=True)


def test_a_draw_slips_if_and_only_if_the_pull_exceeds_static_friction(draws):
    np.testing.assert_array_equal(draws["slips"], draws["mu_static"] < example.PULL)
    assert 0 < draws["slips"].sum() < len(draws["slips"])


def test_the_way_is_that_of_one_block_on_one_friction_law(draws):
    np.testing.assert_allclose(draws["distance"], draws["expected_distance"], rtol=0.01)


def test_who_creeps_shows_the_pull_and_who_slips_kinetic_friction(draws):
    """Kinetic friction is reached at 1.5 times the threshold speed, 0.1 m/s in the nominal model."""
    slips, fast = draws["slips"], draws["speed"] > 0.15
    np.testing.assert_allclose(draws["ratio"][~slips], example.PULL, rtol=2e-3)
    assert fast.sum() > 0.8 * slips.sum()
    np.testing.assert_allclose(draws["ratio"][fast], example.KINETIC_SHARE * draws["mu_static"][fast], rtol=2e-3)


def test_the_interval_of_the_fraction_holds_the_probability(draws):
    assert draws["fraction_low"] < draws["probability"] < draws["fraction_high"]


def test_the_interval_ends_where_a_score_test_just_rejects():
    """Wilson's interval inverts |p - fraction| = z sqrt(p (1 - p) / n)."""
    low, high = example.wilson(3, 40)

    def score(p):
        return abs(p - 3 / 40) - 1.96 * np.sqrt(p * (1 - p) / 40)

    assert low == pytest.approx(brentq(score, 1e-6, 3 / 40), abs=1e-9)
    assert high == pytest.approx(brentq(score, 3 / 40, 0.9), abs=1e-9)
