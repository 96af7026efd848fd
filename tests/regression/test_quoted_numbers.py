"""Every number that the README, its page of limits and that of installing quote is drawn from what
has it; none is left over.

A claim is a piece of them with its numbers filled in: from walks that are simulated here,
from stored results and tables, or from a page whose own test computes them. What numbers
they have beside claims are settings, versions and places, which NO_RESULTS lists with the reason
why they need no source.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
import pytest
from quoted import ROOT, left_over, page, percent, rows_in_layers, stored

from vsf_drake.device.bench_metrics import published_stiffness
from vsf_drake.model.parameters import FootParameters
from vsf_drake.walks.metrics import UNFITTED_BW
from vsf_drake.walks.prediction import MOMENTUM, PHYSICS

NO_RESULTS = {
    "66 mm": "a setting",
    "108 mm": "a setting",
    "151 mm": "a setting",
    "x86-64 Linux (glibc 2.34)": "Drake's wheel",
    "Python 3.11 or newer": "requires-python",
    "Python 3.13 or newer on a Mac": "Drake's wheel",
    "macOS 15": "Drake's wheel",
    "Python 3.11 (Drake 1.51": "a version",
    "3.12 and 3.13 (Drake 1.58)": "versions",
    "Python 3.14": "a version",
    "BSD-3-Clause": "the licence",
    "15 to 30 s of processor time": "measured on one machine, with room for others",
    "(later 5 to 10: the": "likewise",
    "(18 s on an idle machine)": "likewise",
    "after 5 to 10 s (5.6)": "likewise",
    "Nichols and Hahn (2021)": "a year",
    "doi 10.1115/1.4050456": "a source",
    "under 600 N": "a setting of a picture",
}
"""Pieces of the pages whose numbers are no results, and why."""

pytestmark = pytest.mark.regression


PAGES = " ".join(map(page, ("README.md", "docs/guide/limits.md", "docs/guide/install.md")))


def bench_and_tutorial() -> Iterator[str]:
    """Published ends of the bench; the tutorial's own test computes what it prints."""
    for mm in (66, 151):
        yield f"{1e-3 * published_stiffness(1e-3 * mm):.0f} N/mm at {mm} mm"
    page = (ROOT / "docs/tutorials/researcher.md").read_text(encoding="utf-8")
    soft, middle, stiff = re.findall(r"mm: vertical force in push-off ([\d.]+) body weight", page)
    yield f"push-off {soft}, {middle} and {stiff} body weight at 66, 108 and 151 mm"
    yield f"Vertical force on 60 kg that fall {1e3 * (0.10 - 0.087):.0f} mm"


def simulated() -> Iterator[str]:
    """Nine SYNTHETIC walks of the laboratory tier with the contact that was fitted to two of
    them."""
    rows = rows_in_layers("laboratory")
    held = [row for row in rows if not row.fitted]
    null = np.array([row.null_model_grf_rmse_bw for row in held])
    error = {
        layer: np.array([row.layers[layer]["grf_rmse_bw"] for row in held])
        for layer in (PHYSICS, MOMENTUM)
    }
    assert len(held) == 7
    yield f"the null model leaves {percent(null.mean())} % BW (mean of seven held-out walks)"
    yield (
        f"with the person's momentum | {percent(error[PHYSICS].mean())}; "
        f"{percent(error[MOMENTUM].mean())} | {percent(null.mean())} |"
    )
    yield (
        f"the fitted foot {percent(error[PHYSICS].mean())} %, at worst "
        f"{percent(error[PHYSICS].max())} %, and {percent(error[MOMENTUM].mean())} % with the "
        "person's own momentum"
    )
    words = ("none", "one", "two", "three")
    nearer = [words[int(np.sum(null < error[layer]))] for layer in (PHYSICS, MOMENTUM)]
    yield f"nearer in {nearer[0]} of the seven walks, and in {nearer[1]} once momentum is used"
    unseen = np.array(
        [row.fulcrum_mm not in {one.fulcrum_mm for one in rows if one.fitted} for row in held]
    )
    foot = percent(error[PHYSICS][unseen].mean())
    assert unseen.sum() == 3 and foot == percent(null[unseen].mean())
    yield f"the foot alone is no nearer on average (both {foot} %)"
    pairs = stored("studies/results/contact_fit.json")["laboratory"]["all_pairs"]
    assert pairs["reported_pair"]["rank_of_nine"] == 1
    mean = [percent(pairs[f"held_out_{name}grf_rmse_bw"]["mean"]) for name in ("", "null_model_")]
    yield f"the best of nine (on average {mean[0]} %, null model {mean[1]} %)"


def angle_errors() -> Iterator[str]:
    rows = [
        row
        for row in stored("studies/results/angle_errors.json")["rows"]
        if row["role"] == "held out"
    ]
    sizes = sorted({row["sd_deg"] for row in rows} - {0.0})
    left = {(row["layer"], row["sd_deg"]): percent(row["grf_rmse_bw"]) for row in rows}
    foot = [left[PHYSICS, sd] for sd in sizes]
    person = [left[MOMENTUM, sd] for sd in sizes]
    yield "only within {:g}, {:g} or {:g}° (SD)".format(*sizes)
    yield "the foot leaves {}, {} and {} %".format(
        *foot
    ) + ", and {}, {} and {} % with momentum".format(*person)


def sessions() -> Iterator[str]:
    """Three SYNTHETIC persons, walks counted once."""
    found = stored("studies/results/session_fit.json")
    first = found["against_null"]["first_days"]["held_out"]
    same = found["against_null"]["first_days"]["same_setting"]
    unseen = found["against_null"]["first_days"]["unseen_setting"]
    third = found["cases"]["c_day_1"]["mean"]["held out"]
    other = [found["cases"][day]["mean"]["another day"] for day in ("a_day_1", "a_day_2")]
    identified = found["intervals"]["identified"]
    assert (identified["contained_as_found"]["n"], identified["contained_as_found"]["held"]) == (
        10,
        8,
    )
    assert identified["contained"]["held"] == 5
    persons = [
        found["cases"][name]["mean"]["held out"] for name in ("a_day_1", "b_day_1", "c_day_1")
    ]
    errors = [person["layers"]["person"]["grf_rmse_bw"] for person in persons]
    null = [person["null_model_grf_rmse_bw"] for person in persons]
    both = [f"{100.0 * np.mean(each):.1f}" for each in (errors, null)]
    yield "leaves {} % BW, the null model {} %".format(*both)
    yield (
        f"(nearer in {first['person']['nearer']} of {first['walks']} walks) | {{}} | {{}} |".format(
            *both
        )
    )
    yield f"in {first['person']['nearer']} of {first['walks']} first-day walks"
    yield f"{same['person']['nearer']} of {same['walks']} at the fitted settings"
    yield f"{unseen['person']['nearer']} of {unseen['walks']} at the other"
    yield (
        f"{third['layers']['person']['beats_null']} of {third['n']} of the person by whom no "
        "choice was made"
    )
    yield (
        f"(momentum alone {first['momentum']['nearer']} of {first['walks']}, physics alone "
        f"{first['physics']['nearer']})"
    )
    yield (
        f"nearer in {sum(day['layers']['person']['beats_null'] for day in other)} of "
        f"{sum(day['n'] for day in other)}"
    )
    yield "Of the ten 95 % intervals of parameters that these fits identify, eight hold the truth"


def strides() -> Iterator[str]:
    """Three SYNTHETIC walks at the chosen weight, and the foot alone under an equal load."""
    found = stored("studies/results/adaptive_stride.json")
    chosen = [
        row
        for row in found["signs"]
        if row["weight"] == found["able_bodied"]["least_that_meets_all"]
    ]
    assert len(chosen) == 3 and {load["count"] for load in found["equal_load"].values()} == {6}
    assert not any(row["beyond"]["knee extension"] for row in chosen)
    yield "six of the seven a spring has under an equal load, with nobody on it"
    yield (
        "the seventh (knee extension) holds at every step in none of three walks of one "
        "synthetic person, at the chosen weight"
    )


def elsewhere() -> Iterator[str]:
    """What tells two settings apart; recordings of people, by tests/test_real_walks.py."""
    reach = FootParameters().fulcrum
    table = stored("data/validation/settings.json")["table"]
    outcomes = table["outcomes"]
    apart = re.search(
        r"66 and 151 mm are distinguishable in (\d+) of (\d+)", table["answer"]
    ).groups()
    yield "66 and 151 mm are distinguishable by the plate in {} of {} outcomes".format(*apart)
    travels = [row["smallest_travel_mm_two_sessions"] for row in outcomes]
    least = min(travel for travel in travels if travel is not None)
    yield f"{least:.0f} of the fulcrum's {1e3 * (reach.foremost_m - reach.rearmost_m):.0f} mm apart"
    people = stored("studies/results/session_fit.json")["seen_on_people"]
    low, high = people["held_out_grf_rmse_bw"]
    curve = people["stretched_null_grf_rmse_bw"]
    yield f"were {100 * low:.0f} to {100 * high:.0f} % BW off"
    yield (
        f"one foot replaced in the model | {100 * low:.0f} to {100 * high:.0f} "
        f"| {100 * curve[0]:.0f} to {100 * curve[1]:.0f} |"
    )
    yield f"a stretched curve of another walk {100 * curve[0]:.0f} to {100 * curve[1]:.0f} %"
    yield f"a first guess: {100 * UNFITTED_BW[0]:.0f} to {100 * UNFITTED_BW[1]:.0f} % BW off"


SOURCES = (bench_and_tutorial, simulated, angle_errors, sessions, strides, elsewhere)


@pytest.fixture(scope="module")
def claims() -> dict[str, list[str]]:
    return {source.__name__: list(source()) for source in SOURCES}


@pytest.mark.parametrize("source", [source.__name__ for source in SOURCES])
def test_the_pages_say_what_their_sources_have(claims, source):
    assert [claim for claim in claims[source] if claim not in PAGES] == []


def test_no_number_of_the_pages_is_left_without_a_source(claims):
    pieces = [claim for own in claims.values() for claim in own]
    assert left_over(PAGES, [*pieces, *NO_RESULTS]) == []
