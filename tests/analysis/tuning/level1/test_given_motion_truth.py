"""Tunings whose answer is known beforehand."""

import dataclasses

import numpy as np
import pytest

from vsf_drake.analysis.tuning.level1 import solve, tuning_table
from vsf_drake.motion.formats.recording import PlateRecording

TRUE_MM = 93.4


def walked(trial, walker, fulcrum_mm, **options):
    """The trial with the force of its own model, with the fulcrum there, as the plate."""
    walk = walker.walk(trial.trajectory, fulcrum_m=1e-3 * fulcrum_mm, start_s=trial.start_s, end_s=trial.end_s,
                       step_s=2e-3, offsets=trial.offsets, support_width_m=4e-3, **options)
    reaction = walk.prosthetic
    plate = PlateRecording(time_s=walk.record.time_s, force_W=reaction.grf_W, cop_W=reaction.cop_W,
                           free_moment_nm=reaction.free_moment_nm, has_cop=True)
    return dataclasses.replace(trial, plates=dict(trial.plates) | {trial.subject.prosthetic_side: plate})


def test_tracking_finds_the_fulcrum_that_made_the_force(tuned_trials, shared_walker, made_tuning):
    tuning = made_tuning(walked(tuned_trials["medium_2"], shared_walker, TRUE_MM), cost="tracking", sweep_mm=5.0)
    solution = solve(tuning)
    assert solution.fulcrum_mm == pytest.approx(TRUE_MM, abs=0.05)
    assert solution.cost < 1e-8


@pytest.mark.slow
def test_tracking_finds_fulcrum_heel_and_alignment_together(tuned_trials, shared_walker, made_tuning):
    values = {"offset.alignment": 0.012} | {
        name: 1.25 * variable.default for name, variable in shared_walker.variables.items()
        if name.startswith("contact.heel") and name.endswith(".stiffness")}
    tuning = made_tuning(walked(tuned_trials["medium_2"], shared_walker, TRUE_MM, values=values), cost="tracking",
                         design=("heel_stiffness", "alignment"), sweep_mm=10.0, more_starts=0)
    found = solve(tuning).values
    assert found["fulcrum"] == pytest.approx(TRUE_MM, abs=0.3)
    assert found["heel_stiffness"] == pytest.approx(1.25, abs=0.02)
    assert found["alignment"] == pytest.approx(0.012, abs=3e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("label", "true_mm"), [("low_1", 66.0), ("medium_1", 108.0), ("high_1", 151.0)])
def test_tracking_the_virtual_laboratory_finds_its_setting(made_tuning, label, true_mm):
    """Another model than the one that walks made these plates: within half the distance of the device's settings."""
    tuning = made_tuning(label, cost="tracking", sweep_mm=5.0)
    assert solve(tuning).fulcrum_mm == pytest.approx(true_mm, abs=10.5)


def test_costs_at_the_recorded_setting_have_no_change_of_force(made_tuning):
    tuning = made_tuning()
    at = tuning.evaluate(tuning.parts[0].own, derivatives=False)
    assert at.terms["consistency"][0] == pytest.approx(0.0, abs=1e-20)
    assert at.cost == pytest.approx(tuning.combination.size, rel=1e-9)


def test_each_part_of_a_weighted_cost_is_its_weight_at_the_recorded_setting(made_tuning):
    tuning = made_tuning(cost="weighted", weights={"joint_load": 3.0, "push_off": 1.0})
    at = tuning.evaluate(tuning.parts[0].own, derivatives=False)
    assert {name: term[0] for name, term in at.terms.items()} == pytest.approx(
        {"joint_load": 0.75, "push_off": -0.25, "consistency": 0.0}, abs=1e-9)


@pytest.mark.slow
def test_a_softer_foot_stores_less_under_the_same_motion_and_more_under_the_same_load(made_tuning):
    """A spring pressed as far stores k x^2 / 2, one that bears the same F^2 / 2 k."""
    tuning = made_tuning(same_load=True, sweep_mm=20.0)
    solution = solve(tuning)
    rows = {row["name"]: row for row in tuning_table(solution)["outcomes"]}
    for name in ("stored_energy", "push_off_work"):
        assert rows[name]["softest"] < rows[name]["recorded"] < rows[name]["stiffest"]
        same = rows[f"{name}_same_load"]
        assert same["softest"] > same["recorded"] > same["stiffest"]
    assert rows["force_change"]["recorded"] == pytest.approx(0.0, abs=1e-12)
    assert np.isfinite([row["softest"] for row in rows.values()]).all()
