"""Two sides beside each other: what is known to differ is found as large as it is, and walks that
do not differ are not told apart."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from made_results import make_walk

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import resource
from vsf_drake.base.schema import to_plain
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.events import known_stances
from vsf_drake.motion.trial import load_trial
from vsf_drake.walks.between_settings import half_width, spread_of
from vsf_drake.walks.difference import (
    DIFFERENCES,
    Side,
    difference_of,
    difference_sentences,
    side_of,
    trial_of,
)

SESSIONS = Path(__file__).resolve().parents[2] / "data" / "sessions"
FORCE_NAMES = ("vertical", "fore_aft", "medio_lateral")


def trials(folder, *names):
    return [load_trial(folder / f"{name}.yaml") for name in names]


@pytest.fixture(scope="module")
def soft():
    return side_of("soft", trials(SESSIONS / "a" / "day_1" / "1p1", "low_1", "low_2", "low_3"))


@pytest.fixture(scope="module")
def stiff():
    return side_of("stiff", trials(SESSIONS / "a" / "day_1" / "1p1", "high_1", "high_2", "high_3"))


def changed(side: Side, name: str, *, force: float = 1.0, longer_s: float = 0.0) -> Side:
    """The same walks in other files, with a larger force and a longer stance."""
    walks = tuple(
        dataclasses.replace(
            walk,
            stance_s=walk.stance_s + longer_s,
            plate=walk.plate * [force, force, force, 1.0, 1.0, 1.0, 1.0],
        )
        for walk in side.walks
    )
    moved = tuple(
        dataclasses.replace(trial, path=trial.path.parent / name / trial.path.name, inputs={})
        for trial in side.trials
    )
    return dataclasses.replace(side, name=name, walks=walks, trials=moved)


def test_a_known_change_of_force_and_time_is_found_as_large_as_it_is(soft):
    table = difference_of(soft, changed(soft, "other", force=1.1, longer_s=0.05))
    found = {one.name: one for one in table.differences}
    for name in ("first_peak_bw", "push_off_bw"):
        assert found[name].difference == pytest.approx(0.1 * found[name].a)
    # impulses grow with force and time
    stance = np.array([walk.stance_s for walk in soft.walks])
    grown = soft.numbers["braking_bws"] * (1.1 * (stance + 0.05) / stance - 1.0)
    assert found["braking_bws"].difference == pytest.approx(grown.mean())
    assert found["stance_s"].difference == pytest.approx(0.05)
    assert found["cop_50_m"].difference == 0.0 and found["cop_50_m"].larger is False
    force = np.sqrt(sum(np.mean(soft.curves[n].mean(axis=0) ** 2) for n in FORCE_NAMES))
    assert table.force_bw == pytest.approx(0.1 * force)


def test_impulse_is_that_of_the_recorded_plate(soft):
    """Braking by the samples of the plate, without any share of stance."""
    trial, found = soft.trials[0], soft.numbers["braking_bws"][0]
    plate = trial.prosthetic_plate
    [stance] = [one for one in known_stances(plate) if one.complete]
    rows = (plate.time_s >= stance.start_s) & (plate.time_s <= stance.end_s)
    backward = np.minimum(plate.force_W[rows, 0], 0.0).sum() * (plate.time_s[1] - plate.time_s[0])
    own = backward / (trial.subject.mass_kg * GRAVITY)
    assert found == pytest.approx(own, rel=0.03)  # low-passed, and laid on shares


def test_both_feet_press_the_body_to_its_midline_whichever_side_the_prosthesis_is_on():
    sides = [
        side_of(letter, trials(SESSIONS / letter / "day_1" / "1p1", "medium_1"))
        for letter in ("a", "b")
    ]
    assert {side.subject.prosthetic_side for side in sides} == {"left", "right"}
    assert all(side.curves["medio_lateral"][:, 20:80].mean() > 0.0 for side in sides)
    assert "have not the same subject file" in " ".join(difference_sentences(difference_of(*sides)))


def test_walks_that_do_not_differ_are_told_apart_in_one_comparison_of_twenty_at_most():
    """Eleven numbers of three walks a side that differ by chance alone."""
    rng = np.random.default_rng(0)
    sides = np.repeat([0.0, 1.0], 3)
    shares = np.repeat([-1.0, 1.0], 3) / 3
    draws = rng.standard_normal((4000, 6, len(DIFFERENCES)))
    beyond = {1: 0, len(DIFFERENCES): 0}
    for walks in draws:
        spread = spread_of(sides, walks)
        for together in beyond:
            covered = 1.0 - 0.05 / together
            wide = [half_width(sides, one, shares, covered=covered) for one in spread]
            beyond[together] += bool(np.any(np.abs(shares @ walks) > wide))
    # 1 - 0.95^11 = 0.43; of 4000 draws one standard error is 0.003
    assert beyond[1] / len(draws) == pytest.approx(0.43, abs=0.03)
    assert 0.03 < beyond[len(DIFFERENCES)] / len(draws) < 0.06


def test_a_setting_that_moves_the_centre_of_pressure_is_seen_and_one_that_does_not_is_not(
    soft, stiff
):
    """A stiffer foot takes the load farther forward in mid-stance (the fulcrum is where the keel
    begins to bend)."""
    table = difference_of(soft, stiff)
    found = {one.name: one for one in table.differences}
    assert found["cop_50_m"].larger and found["cop_50_m"].difference > 0.02
    assert difference_sentences(table)[0].startswith("B differs from A beyond the spread")
    same = difference_of(soft, changed(soft, "other"))
    assert difference_sentences(same)[0].startswith("Not larger than the spread")
    assert same.force_bw == 0.0


@pytest.mark.parametrize("walks", [1, 2])
def test_of_one_walk_against_one_or_two_nothing_is_judged(soft, stiff, walks):
    table = difference_of(side_of("one", soft.trials[:1]), side_of("other", stiff.trials[:walks]))
    assert all(each.larger is None for each in table.differences)
    assert all((each.spread is None) == (walks == 1) for each in table.differences)
    assert difference_sentences(table)[0].startswith("Too few walks")


def test_a_walk_is_on_one_side_only_and_a_side_of_one_person_at_one_setting(soft, stiff):
    with pytest.raises(InputError, match=r"low_1\.yaml: is on both sides"):
        difference_of(soft, soft)
    with pytest.raises(InputError, match=r"walks of 2 settings \(66, 151 mm\).* both@66"):
        side_of("both", [*soft.trials, *stiff.trials])
    other = trials(SESSIONS / "b" / "day_1" / "1p1", "low_1")
    with pytest.raises(InputError, match=r"its subject is not that of low_1\.yaml"):
        side_of("mixed", [*soft.trials, *other])


def test_a_side_is_of_one_foot(soft):
    """A passive foot that is clamped where the fulcrum of the other stood is another foot."""
    first, second, *_ = soft.trials
    foot = second.model.foot
    clamp = dataclasses.replace(
        foot.fulcrum, rearmost_m=second.fulcrum_m, foremost_m=second.fulcrum_m
    )
    passive = dataclasses.replace(foot, name="firm", fulcrum=clamp)
    model = dataclasses.replace(second.model, foot=passive)
    with pytest.raises(InputError, match=r"walks on 2 feet \(firm, one with a fulcrum\)"):
        side_of("both", [first, dataclasses.replace(second, model=model)])


def test_a_saved_walk_has_its_own_force_and_the_driver_s_loads_as_moments(tmp_path):
    trial = load_trial(resource("data/reference_subject/exact/low_1.yaml"))
    plate = trial.prosthetic_plate
    bare = make_walk(start_s=trial.start_s, end_s=trial.end_s)
    time = bare.time_s
    names = trial.trajectory.names
    q = trial.trajectory.sample(time)[0]
    load = np.zeros_like(q)
    load[:, names.index("knee_angle_r")] = 2.0 * trial.subject.mass_kg
    force = np.column_stack([np.interp(time, plate.time_s, x) for x in plate.force_W.T])
    result = dataclasses.replace(
        bare,
        coordinate_names=names,
        q=q,
        v=np.zeros_like(q),
        generalized_force=load,
        prescribed_names=names,
        prescribed_q=q,
        grf_W=force,
        cop_W=np.column_stack([time, 0.0 * time, 0.0 * time]),
        side="right",
        parameters={
            "subject": to_plain(trial.subject),
            "model": to_plain(trial.model),
            "offsets": to_plain(trial.offsets),
        },
    )
    model = side_of("model", [trial_of(result, tmp_path)], simulated=True)
    recorded = side_of("recorded", [trial])
    assert np.abs(model.curves["vertical"] - recorded.curves["vertical"]).max() < 0.01
    np.testing.assert_allclose(model.curves["prosthetic_moment_knee_angle"], 2.0, rtol=1e-3)
    np.testing.assert_allclose(
        model.curves["intact_knee_angle"], recorded.curves["intact_knee_angle"], atol=0.5
    )
    assert "the model's error is in the difference" in " ".join(
        difference_sentences(difference_of(model, recorded))
    )
