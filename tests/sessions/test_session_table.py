"""Which walks are fitted, what the verdict says of numbers, and what to record next."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from vsf_drake.sessions.table import (
    FITTED,
    HELD_OUT,
    LEFT_OUT,
    FitOutcome,
    SessionWalk,
    judged_walks,
    outer_walks,
    verdict_of,
    what_next,
)


def trial(mm, expected=0.0):
    return SimpleNamespace(fulcrum_m=1e-3 * mm, judged=SimpleNamespace(expected_error_bw=expected))


def walk(mm=66.0, role=HELD_OUT, **more):
    return SessionWalk(file=f"{mm:g}.c3d", label=f"{mm:g}", role=role, fulcrum_mm=mm, **more)


def outcome(**more):
    told = {"success": True, "message": "", "headline": (), "layer": "person", "layers": {}}
    return FitOutcome(**{**told, "answer": None, "effect": (), **more})


def test_of_the_outer_settings_the_best_recordings_are_fitted():
    trials = [trial(108, 0.0), trial(151, 0.04), trial(66, 0.02), trial(149, 0.03), trial(66, 0.01)]
    assert outer_walks(trials) == [4, 3]
    assert outer_walks([trial(66, 0.02), trial(68, 0.01)]) == [1], "one setting, within 5 mm"
    assert outer_walks([trial(66)]) == [0]


def test_a_fitted_walk_shows_no_error():
    errors = {"physics": 0.05, "person": 0.03, "null": 0.04}
    walks = [walk(66.0, FITTED), walk(151.0), walk(108.0, LEFT_OUT)]
    told = judged_walks(walks, outcome(layers={one.label: errors for one in walks}))
    assert [(one.error_bw, one.null_bw) for one in told] == [(None,) * 2, (0.03, 0.04), (None,) * 2]


@pytest.mark.parametrize(
    ("gains", "said"),
    [
        # t for 2 degrees of freedom is 4.303: 1 +- 0.1 is 1 +- 4.303 * 0.1 / sqrt(3)
        ((0.009, 0.010, 0.011), "beats the harder null model"),
        ((-0.009, -0.010, -0.011), "harder null model beats"),
        ((0.03, 0.01, -0.01), "No clear difference"),
        ((0.02,), "One held-out walk decides nothing"),
        ((), "no walk was left to judge by"),
    ],
)
def test_the_verdict_holds_the_difference_against_its_spread(gains, said):
    walks = [walk(error_bw=0.04 - gain, null_bw=0.04) for gain in gains]
    assert said in verdict_of([walk(151.0, FITTED), *walks], outcome(), False)


def test_the_interval_is_students():
    walks = [walk(error_bw=0.04 - gain, null_bw=0.04) for gain in (0.01, 0.02, 0.03)]
    # 4.3027 * 1 % / sqrt(3)
    assert "2.0 % nearer, 95 % interval ± 2.5" in verdict_of(walks, outcome(), False)


def test_a_failed_fit_and_synthetic_walks_are_named():
    said = verdict_of([walk()], outcome(success=False, message="no way."), True)
    assert "failed" in said and "no way." in said and "SYNTHETIC" in said


def test_what_is_missing_is_asked_for():
    one = what_next([walk(66.0, FITTED)], bench=True)
    assert "second setting" in one[0] and "none is left" in one[1]
    two = what_next([walk(66.0), walk(151.0, FITTED)], bench=False)
    assert "between 66 and 151" in two[0] and "1 at 66 mm, 1 at 151 mm" in two[1]
    assert "testing machine" in two[2]
    full = [walk(mm) for mm in (66.0, 108.0, 151.0) for _ in range(3)]
    assert what_next(full, bench=True) == []
    bad = what_next(
        [*full, walk(87.0, LEFT_OUT, why="is truncated"), walk(66.0, mark="doubtful",
         expected_error_bw=0.05, verdict="doubtful, slips")], bench=True
    )  # fmt: skip
    assert "87.c3d again" in bad[0] and "1 walk is doubtful" in bad[1] and "slips" in bad[1]


def test_of_a_passive_foot_no_second_setting_is_asked_for():
    walks = [
        SessionWalk(file=f"{i}.c3d", label=f"{i}", role=HELD_OUT, fulcrum_mm=None, foot="soft")
        for i in range(2)
    ]
    few, curves, *rest = what_next(walks, bench=False)
    assert few.startswith("More walks: with 3 or more") and "force-displacement curves" in curves
    assert not rest
    assert what_next([*walks, walks[0]], bench=True) == []
