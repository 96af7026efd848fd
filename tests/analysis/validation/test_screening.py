"""Morris effects and Sobol indices of functions whose effects and indices are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from vsf_drake.analysis.validation.sensitivity_section import (
    dropped,
    morris_design,
    morris_rows,
    ranked,
    sobol_design,
    sobol_rows,
)

SLOPES = np.array([3.0, -2.0, 0.5, 0.0])
NAMES = ("a", "b", "c", "d")


def linear(points: np.ndarray) -> np.ndarray:
    return 7.0 + points @ SLOPES


def ishigami(points: np.ndarray, a: float = 7.0, b: float = 0.1) -> np.ndarray:
    x, y, z = (np.pi * (2.0 * points - 1.0)).T
    return np.sin(x) + a * np.sin(y) ** 2 + b * z**4 * np.sin(x)


def ishigami_indices(a: float = 7.0, b: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """First-order and total indices (Ishigami and Homma 1990)."""
    first = 0.5 * (1.0 + b * np.pi**4 / 5.0) ** 2
    second = a**2 / 8.0
    together = b**2 * np.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    total = first + second + together
    return np.array([first, second, 0.0]) / total, np.array([first + together, second, together]) / total


def test_effects_of_a_linear_function_are_its_slopes_everywhere():
    design = morris_design(NAMES, 6, seed=3)
    rows = morris_rows(design, linear(design.points), seed=3)
    assert design.points.shape == (6 * 5, 4)
    np.testing.assert_allclose([row["mu"] for row in rows], SLOPES, atol=1e-12)
    np.testing.assert_allclose([row["mu_star"] for row in rows], np.abs(SLOPES), atol=1e-12)
    np.testing.assert_allclose([(row["sigma"], row["mu_star_conf"]) for row in rows], 0.0, atol=1e-12)
    assert ranked(rows, "mu_star")[:3] == ["a", "b", "c"]


def test_an_interaction_shows_as_scatter_of_the_effects():
    design = morris_design(("x", "y"), 200, seed=1)
    rows = morris_rows(design, design.points[:, 0] * design.points[:, 1], seed=1)
    # The effect of x is y, which stands on 0, 1/3, 2/3, 1: on average 1/2, with the spread of these.
    assert rows[0]["mu"] == pytest.approx(0.5, abs=0.06)
    assert rows[0]["sigma"] == pytest.approx(np.std([0.0, 1 / 3, 2 / 3, 1.0]), abs=0.05)
    assert rows[0]["mu"] == pytest.approx(0.5, abs=1.5 * rows[0]["mu_star_conf"])


def test_indices_of_ishigamis_function_are_the_known_ones():
    design = sobol_design(("x", "y", "z"), 2048, seed=0)
    rows = sobol_rows(design, ishigami(design.points), seed=0)
    first, total = ishigami_indices()
    for row, s1, st in zip(rows, first, total, strict=True):
        assert row["s1"] == pytest.approx(s1, abs=max(1.5 * row["s1_conf"], 0.01))
        assert row["st"] == pytest.approx(st, abs=max(1.5 * row["st_conf"], 0.01))
        assert row["st_conf"] < 0.1
    assert rows[2]["s1_wide"] and not rows[2]["st_wide"]


def test_indices_of_groups_of_a_sum_are_the_sums_of_their_squared_slopes():
    design = sobol_design(NAMES, 1024, seed=5, groups=("left", "right", "left", "right"))
    rows = sobol_rows(design, linear(design.points), seed=5)
    assert design.labels == ("left", "right")
    assert design.block == 4
    share = (SLOPES[0] ** 2 + SLOPES[2] ** 2) / np.sum(SLOPES**2)
    for row, expected in zip(rows, (share, 1.0 - share), strict=True):
        assert row["s1"] == pytest.approx(expected, abs=0.05)
        assert row["st"] == pytest.approx(expected, abs=0.05)


def test_a_trajectory_with_a_failure_is_dropped_as_a_whole_and_leaves_the_others_right():
    design = morris_design(NAMES, 6, seed=3)
    y = linear(design.points)
    y[[7, 8, 22]] = np.nan  # rows of the second trajectory and of the fifth
    rows = morris_rows(design, y, seed=3)
    assert dropped(design, y) == 2
    np.testing.assert_allclose([row["mu"] for row in rows], SLOPES, atol=1e-12)


def test_a_block_with_a_failure_is_dropped_as_a_whole():
    design = sobol_design(("x", "y", "z"), 1024, seed=2)
    y = ishigami(design.points)
    y[::97] = np.nan
    lost = {i // design.block for i in range(0, len(y), 97)}
    rows = sobol_rows(design, y, seed=2)
    assert dropped(design, y) == len(lost)
    for row, st in zip(rows, ishigami_indices()[1], strict=True):
        assert row["st"] == pytest.approx(st, abs=0.1)


def test_too_few_whole_samples_or_no_variance_give_nothing_rather_than_noise():
    screen, blocks = morris_design(NAMES, 6, seed=3), sobol_design(NAMES, 32, seed=3)
    y = linear(screen.points)
    y[::8] = np.nan
    assert morris_rows(screen, y, seed=3) is None
    assert morris_rows(screen, np.full(len(screen.points), np.nan), seed=3) is None
    assert sobol_rows(blocks, np.full(len(blocks.points), np.nan), seed=3) is None
    assert sobol_rows(blocks, np.full(len(blocks.points), 4.2), seed=3) is None


@pytest.mark.parametrize("seed", [0, 1, 12])
def test_the_same_seed_gives_the_same_numbers_to_the_last_digit(seed):
    def once() -> list:
        screen, blocks = morris_design(NAMES, 5, seed), sobol_design(NAMES, 16, seed)
        return [screen.points.tolist(), blocks.points.tolist(),
                morris_rows(screen, np.exp(linear(screen.points)), seed),
                sobol_rows(blocks, np.exp(linear(blocks.points)), seed)]

    assert once() == once()


def test_another_seed_gives_another_design():
    assert not np.array_equal(morris_design(NAMES, 5, 0).points, morris_design(NAMES, 5, 1).points)
