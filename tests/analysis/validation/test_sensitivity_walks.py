"""The walks of the sensitivity study: what is read off them, against metrics, closed forms and exact derivatives."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_study import embedded_study

from vsf_drake.analysis.comparison import compare, compare_sensitivity
from vsf_drake.analysis.metrics import walk_metrics
from vsf_drake.analysis.validation.energy_ledger import prosthesis_energy
from vsf_drake.analysis.validation.sensitivity_section import (
    OUTPUTS,
    DesignWalks,
    Factor,
    local_changes,
    morris_design,
    morris_rows,
    sensitivity_factors,
    value_slopes,
)
from vsf_drake.analysis.validation.study import STEP_S
from vsf_drake.motion.events import find_stances
from vsf_drake.parameters import GRAVITY
from vsf_drake.simulation.many.processes import chosen


@pytest.fixture(scope="module")
def walks() -> DesignWalks:
    """All three conditions."""
    return DesignWalks(embedded_study().walks)


@pytest.fixture(scope="module")
def factors(walks) -> dict[str, Factor]:
    return {factor.name: factor for factor in sensitivity_factors(walks.trials[0].variables, "right")}


def walked(walks: DesignWalks, trial: int, values: dict[str, float]):
    """A walk of a trial with other values, as the program makes it, and its result with all of it."""
    own, walker = walks.trials[trial].trial, walks.trials[trial].walker
    run = walker.walk(own.trajectory, fulcrum_m=own.fulcrum_m, start_s=own.start_s, end_s=own.end_s, step_s=STEP_S,
                      offsets=own.offsets, values=values)
    return run, walker.result(run, own, own.offsets)


def test_the_studys_own_walks_have_the_errors_that_the_metrics_say(walks):
    baseline = walks.baseline()
    for row, walk in zip(baseline, embedded_study().walks, strict=True):
        assert row[OUTPUTS.index("grf_rmse_bw")] == pytest.approx(walk.metrics.grf_rmse_bw, rel=1e-12)
        assert row[OUTPUTS.index("cop_rmse_fl")] == pytest.approx(walk.metrics.cop_rmse_fl, rel=1e-12)
        peaks = walk.metrics.stances[0].model_peaks_bw
        assert row[OUTPUTS.index("peak_vertical_bw")] == pytest.approx(
            max(peaks.vertical_first_half, peaks.vertical_second_half), rel=1e-12)


def test_a_changed_walk_is_scored_as_comparison_and_metrics_would(walks, factors):
    chosen = (factors["prosthesis height"], factors["axial socket stiffness"])
    stiffness = walks.trials[1].variables["socket.tz.stiffness"].default
    values = {"offset.height": 2e-3, "socket.tz.stiffness": stiffness / 1.5}
    _, result = walked(walks, 1, values)
    plate = walks.trials[1].trial.prosthetic_plate
    comparison = compare(result, plate)
    metrics = walk_metrics(result, plate, comparison=comparison)
    found = dict(zip(OUTPUTS, walks(np.array([[1.0, 0.0]]), factors=chosen)[0, 1], strict=True))
    assert metrics.grf_rmse_bw > 0.05, "the change is not seen at all"
    assert found["grf_rmse_bw"] == pytest.approx(metrics.grf_rmse_bw, rel=1e-9)
    assert found["cop_rmse_fl"] == pytest.approx(metrics.cop_rmse_fl, rel=1e-9)
    stance = comparison.stances[0]
    assert found["cop_shift_mm"] == pytest.approx(
        1e3 * np.nanmean(stance.model_cop[:, 0] - stance.measured_cop[:, 0]), rel=1e-9)


def test_the_springs_energy_is_half_k_x_squared_of_its_joints_and_support(walks):
    baseline = dict(zip(OUTPUTS, walks.baseline()[0], strict=True))
    run, result = walked(walks, 0, {})
    names = walks.trials[0].walker.gait.person.foot.keel_joint_names
    columns = [run.mechanism.tree.index(name) for name in names]
    stiffness = {int(i): s[0] for i, s in zip(run.mechanism.spring_index, run.mechanism.springs, strict=True)}
    keel = sum(0.5 * stiffness.get(i, 0.0) * run.record.q[:, i] ** 2 for i in columns)
    support = 0.5 * run.mechanism.fulcrum[0] * run.record.fulcrum[:, 1] ** 2
    loaded = np.flatnonzero(result.grf_W[:, 2] > 20.0)
    stance = slice(loaded[0], loaded[-1] + 1)
    # At touch-down both are slack: what they hold of the swing is below a hundredth of a joule.
    assert baseline["keel_stored_j"] == pytest.approx(keel[stance].max(), abs=0.01)
    assert baseline["spring_stored_j"] == pytest.approx((keel + support)[stance].max(), abs=0.01)
    assert 0.0 < baseline["spring_returned_j"] < baseline["spring_stored_j"]
    assert baseline["spring_return_ratio"] == pytest.approx(
        baseline["spring_returned_j"] / baseline["spring_stored_j"])


def test_a_second_ledger_of_the_prosthesis_at_a_finer_step_has_the_same_energies(walks):
    for trial, row in enumerate(walks.baseline()):
        own, walker = walks.trials[trial].trial, walks.trials[trial].walker
        run = walker.walk(own.trajectory, fulcrum_m=own.fulcrum_m, start_s=own.start_s, end_s=own.end_s, step_s=5e-4,
                          offsets=own.offsets)
        energy = prosthesis_energy(walker, run)
        stance = find_stances(energy.time_s, energy.vertical_n)[0]
        down, off = np.searchsorted(energy.time_s, [stance.start_s, stance.end_s])
        strain = energy.terms["keel_strain"] + energy.terms["fulcrum_strain"]
        loss = energy.terms["keel_loss"] + energy.terms["fulcrum_loss"]
        full = down + int(np.argmax(strain[down : off + 1]))
        returned = strain[full] - strain[off] - (loss[off] - loss[full])
        # Steps of 2 ms against 0.5 ms, and works of first against second order.
        assert row[OUTPUTS.index("spring_stored_j")] == pytest.approx(strain[full] - strain[down], rel=2e-3)
        assert row[OUTPUTS.index("spring_returned_j")] == pytest.approx(returned, rel=2e-3)


def test_a_softer_setting_stores_more_energy_in_the_spring(walks):
    stored = walks.baseline()[:, OUTPUTS.index("spring_stored_j")]
    assert [round(1e3 * one.trial.fulcrum_m, 6) for one in walks.trials] == [66.0, 108.0, 151.0]
    assert stored[0] > stored[1] > stored[2] > 0.0


def test_on_level_ground_a_person_further_ahead_only_moves_the_centre_of_pressure(walks, factors):
    found = walks(np.array([[0.5], [1.0]]), factors=(factors["pelvis fore-aft"],))
    change = found[1] - found[0]
    along = [one.comparison.heading[0] for one in walks.trials]  # fore-aft is where the person walks
    np.testing.assert_allclose(change[:, OUTPUTS.index("cop_shift_mm")], 2.0 * np.array(along), atol=1e-6)
    for name in ("grf_rmse_bw", "peak_vertical_bw", "spring_stored_j", "spring_returned_j"):
        np.testing.assert_allclose(change[:, OUTPUTS.index(name)], 0.0, atol=1e-8)


def test_raising_the_pelvis_or_shortening_the_prosthesis_is_the_same_to_the_ground(walks, factors):
    pelvis = local_changes(walks.trials, (factors["pelvis height"],))[0]
    prosthesis = local_changes(walks.trials, (factors["prosthesis height"],))[0]
    # 1 mm against 2 mm; the pylon leans by up to 20 degrees and the socket gives, so they are alike, not equal.
    assert prosthesis / 2.0 == pytest.approx(pelvis, rel=0.1)


def test_on_small_ranges_morris_effects_are_the_exact_derivatives(walks, factors):
    """Over a fiftieth of the ranges the mean CoP is linear in the factors: mu is its derivative."""
    names = ("hip flexion", "prosthesis alignment", "forefoot foam stiffness", "axial socket stiffness", "keel modulus",
             "foam exponent")
    chosen = []
    for name in names:
        one = factors[name]
        ends = (one.low ** 0.02, one.high ** 0.02) if one.kind == "ratio" else (0.02 * one.low, 0.02 * one.high)
        chosen.append(dataclasses.replace(one, low=ends[0], high=ends[1]))
    alone = DesignWalks(embedded_study().walks[1:2])
    design = morris_design(names, 4, seed=0)
    y = alone(design.points, factors=chosen)[:, 0, OUTPUTS.index("cop_shift_mm")]
    rows = morris_rows(design, y, seed=0)
    variables, slopes = value_slopes(alone.trials[0], chosen)
    trial, walker = alone.trials[0].trial, alone.trials[0].walker
    run = walker.walk(trial.trajectory, fulcrum_m=trial.fulcrum_m, start_s=trial.start_s, end_s=trial.end_s,
                      step_s=STEP_S, offsets=trial.offsets, with_respect_to=variables)
    by = compare_sensitivity(alone.trials[0].comparison, alone.trials[0].result, run.sensitivity)
    exact = 1e3 * np.nanmean(by.cop[0][:, 0], axis=0) @ slopes
    largest = np.abs(exact).max()
    np.testing.assert_allclose([row["mu"] for row in rows], exact, rtol=0.05, atol=0.01 * largest)
    assert all(row["sigma"] < 0.05 * largest for row in rows)


def test_exact_changes_of_the_resultant_agree_with_a_walk_that_is_changed(walks, factors):
    one = factors["hip flexion"]
    small = dataclasses.replace(one, low=0.05 * one.low, high=0.05 * one.high)
    alone = DesignWalks(embedded_study().walks[1:2])
    predicted = local_changes(alone.trials, (small,))[0]
    results = [walked(alone, 0, {"coordinate.hip_flexion_r": np.radians(sign * small.high)})[1] for sign in (1.0, -1.0)]
    plate = alone.trials[0].trial.prosthetic_plate
    sides = [compare(result, plate) for result in results]
    size = [np.linalg.norm(c.model[c.scored], axis=1) for c in sides]
    weight = alone.trials[0].trial.subject.mass_kg * GRAVITY
    assert predicted == pytest.approx(np.sqrt(np.mean((0.5 * (size[0] - size[1])) ** 2)) / weight, rel=0.03)


def test_a_walk_that_fails_is_counted_named_and_has_no_values():
    alone = DesignWalks(embedded_study().walks[1:2])
    absurd = Factor(name="height", group="geometry", unit="mm", low=-1.0, high=900.0, why="",
                    variables=("offset.height",))
    found = alone(np.array([[0.0], [1.0]]), factors=(absurd,))
    assert np.isfinite(found[0]).all() and np.isnan(found[1]).all()
    assert alone.walked == 2
    assert len(alone.failures) == 1 and "offset.height" in alone.failures[0]


def test_one_worker_and_two_give_the_same_numbers_to_the_last_digit(factors):
    every = tuple(factors.values())
    points = np.random.default_rng(4).random((4, len(every)))
    found = []
    for count in (1, 2):
        with chosen(count, None, 8) as (executor, _):
            walks = DesignWalks(embedded_study().walks[:2], executor=executor, count=count)
            found.append(walks(points, factors=every))
    assert np.isfinite(found[0]).all()
    assert np.array_equal(found[0], found[1])
