"""Every number of ours in the paper is drawn from a stored result that it names; none is left
over."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from quoted import left_over, page, percent, stored

from vsf_drake.walks.prediction import PERSON, PHYSICS

PAPER = "docs/paper/paper.md"
NO_RESULTS = {
    "affiliation: 1": "metadata",
    "index: 1": "metadata",
    "date: 30 November 2026": "metadata",
    "@Glanzer2018": "a source",
    "@McGeehan2021gait": "a source",
    "@McGeehan2021": "a source",
    "@Seth2018": "a source",
    "@Dembia2020": "a source",
    "@Hammond2025": "a source",
    "@Todorov2012": "a source",
    "@Lam2015": "a source",
    "C3D": "a format",
}
"""Pieces of the paper whose numbers are no results, and why."""

pytestmark = pytest.mark.regression


def pairs() -> Iterator[str]:
    """Nine pairs of fitted walks of the laboratory tier, SYNTHETIC."""
    found = stored("studies/results/contact_fit.json")["laboratory"]["all_pairs"]
    foot = percent(found["held_out_grf_rmse_bw"]["mean"])
    null = percent(found["held_out_null_model_grf_rmse_bw"]["mean"])
    yield (
        f"the fitted foot leaves {foot} % of body weight on the held-out walks, and the null model "
        f"{null} % (`studies/results/contact_fit.json`)"
    )


def people() -> Iterator[str]:
    """Able-bodied recordings with one foot replaced, as tests/test_real_walks.py found them."""
    found = stored("studies/results/session_fit.json")["seen_on_people"]
    model = [f"{100.0 * error:.0f}" for error in found["held_out_grf_rmse_bw"]]
    curve = [f"{100.0 * error:.0f}" for error in found["stretched_null_grf_rmse_bw"]]
    yield (
        "it was off by {} to {} % of body weight, a stretched curve of another walk by {} to {} % "
        "(`studies/results/session_fit.json`)"
    ).format(*model, *curve)


def persons() -> Iterator[str]:
    """Three SYNTHETIC persons, walks counted once."""
    found = stored("studies/results/session_fit.json")
    cases = found["cases"]
    first = found["against_null"]["first_days"]["held_out"]
    errors = [
        cases[name]["mean"]["held out"]["layers"][PERSON]["grf_rmse_bw"]
        for name in ("a_day_1", "b_day_1", "c_day_1")
    ]
    other = [cases[day]["mean"]["another day"] for day in ("a_day_1", "a_day_2")]
    nearer = sum(day["layers"][PERSON]["beats_null"] for day in other)
    yield (
        f"corrected by physics leaves {percent(float(np.mean(errors)))} % of body weight and is "
        f"nearer than the null model in {first[PERSON]['nearer']} of {first['walks']} held-out "
        f"walks of the day; physics alone is in {first[PHYSICS]['nearer']}. On another day of the "
        f"same person it is in {nearer} of {sum(day['n'] for day in other)} "
        "(`studies/results/session_fit.json`)"
    )


def feet() -> Iterator[str]:
    """Made feet, SYNTHETIC."""
    found = stored("studies/results/foot_from_curves.json")
    assert len(found["feet"]) == 30
    yield (
        f"by at most {percent(found['largest_error'])} % of the largest load, root mean square "
        "(`studies/results/foot_from_curves.json`)"
    )


def strides() -> Iterator[str]:
    """Three SYNTHETIC walks at the chosen weight, and the foot alone under an equal load."""
    found = stored("studies/results/adaptive_stride.json")
    weight = found["able_bodied"]["least_that_meets_all"]
    chosen = [row for row in found["signs"] if row["weight"] == weight]
    assert len(chosen) == 3 and {load["count"] for load in found["equal_load"].values()} == {6}
    assert not any(row["beyond"]["knee extension"] for row in chosen)
    yield "has six; strides that adapt show the seventh at every step in none of three walks"


CLAIMS = (pairs, people, persons, feet, strides)


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim.__name__)
def test_the_paper_says_what_is_stored(claim):
    text = page(PAPER)
    for piece in claim():
        assert piece in text


def test_no_number_of_the_paper_is_without_a_stored_result():
    text = page(PAPER)
    unused = [piece for piece in NO_RESULTS if piece not in text]
    assert not unused
    assert not left_over(text, [*NO_RESULTS, *(piece for claim in CLAIMS for piece in claim())])
