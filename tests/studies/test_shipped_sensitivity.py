"""The sensitivity study: known effects and indices, its factors, its walks, and what the table
holds."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from made_study import embedded_study
from shipped_sections import sensitivity
from shipped_sections.sensitivity import (
    GROUPS,
    OUTPUTS,
    REFERENCE_DEPTH_M,
    DesignWalks,
    Factor,
    chosen_walks,
    sensitivity_factors,
    sensitivity_section,
    values_at,
)
from shipped_sections.sensitivity_indices import (
    dropped,
    morris_design,
    morris_rows,
    sobol_design,
    sobol_rows,
)

from vsf_drake.motion.events import find_stances
from vsf_drake.simulation.variables import Variable
from vsf_drake.simulation.walk import Walker
from vsf_drake.validation.study import FITTED, HELD_OUT, Study, StudyOptions
from vsf_drake.walks.comparison import compare, compare_sensitivity
from vsf_drake.walks.energy_ledger import prosthesis_energy
from vsf_drake.walks.metrics import walk_metrics
from vsf_drake.walks.recorded_walk import STEP_S

SLOPES = np.array([3.0, -2.0, 0.5, 0.0])
LETTERS = ("a", "b", "c", "d")


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
    return np.array([first, second, 0.0]) / total, np.array(
        [first + together, second, together]
    ) / total


def test_effects_of_a_linear_function_are_its_slopes_everywhere():
    design = morris_design(LETTERS, 6, seed=3)
    rows = morris_rows(design, linear(design.points), seed=3)
    assert design.points.shape == (6 * 5, 4)
    np.testing.assert_allclose([row.mu for row in rows], SLOPES, atol=1e-12)
    np.testing.assert_allclose([row.mu_star for row in rows], np.abs(SLOPES), atol=1e-12)
    np.testing.assert_allclose([(row.sigma, row.mu_star_conf) for row in rows], 0.0, atol=1e-12)


def test_an_interaction_shows_as_scatter_of_the_effects():
    design = morris_design(("x", "y"), 200, seed=1)
    rows = morris_rows(design, design.points[:, 0] * design.points[:, 1], seed=1)
    # The effect of x is y, which stands on 0, 1/3, 2/3, 1: on average 1/2, with the spread of
    # these.
    assert rows[0].mu == pytest.approx(0.5, abs=0.06)
    assert rows[0].sigma == pytest.approx(np.std([0.0, 1 / 3, 2 / 3, 1.0]), abs=0.05)
    assert rows[0].mu == pytest.approx(0.5, abs=1.5 * rows[0].mu_star_conf)


def test_indices_of_ishigamis_function_are_the_known_ones():
    design = sobol_design(("x", "y", "z"), 2048, seed=0)
    rows = sobol_rows(design, ishigami(design.points), seed=0)
    first, total = ishigami_indices()
    for row, s1, st in zip(rows, first, total, strict=True):
        assert row.s1 == pytest.approx(s1, abs=max(1.5 * row.s1_conf, 0.01))
        assert row.st == pytest.approx(st, abs=max(1.5 * row.st_conf, 0.01))
        assert row.st_conf < 0.1


def test_indices_of_groups_of_a_sum_are_the_sums_of_their_squared_slopes():
    design = sobol_design(LETTERS, 1024, seed=5, groups=("left", "right", "left", "right"))
    rows = sobol_rows(design, linear(design.points), seed=5)
    assert design.labels == ("left", "right")
    assert design.block == 4
    share = (SLOPES[0] ** 2 + SLOPES[2] ** 2) / np.sum(SLOPES**2)
    for row, expected in zip(rows, (share, 1.0 - share), strict=True):
        assert (row.s1, row.st) == pytest.approx((expected, expected), abs=0.05)


def test_a_trajectory_with_a_failure_is_dropped_as_a_whole_and_leaves_the_others_right():
    design = morris_design(LETTERS, 6, seed=3)
    y = linear(design.points)
    y[[7, 8, 22]] = np.nan  # rows of the second trajectory and of the fifth
    rows = morris_rows(design, y, seed=3)
    assert dropped(design, y) == 2
    np.testing.assert_allclose([row.mu for row in rows], SLOPES, atol=1e-12)


def test_a_block_with_a_failure_is_dropped_as_a_whole():
    design = sobol_design(("x", "y", "z"), 1024, seed=2)
    y = ishigami(design.points)
    y[::97] = np.nan
    lost = {i // design.block for i in range(0, len(y), 97)}
    rows = sobol_rows(design, y, seed=2)
    assert dropped(design, y) == len(lost)
    for row, st in zip(rows, ishigami_indices()[1], strict=True):
        assert row.st == pytest.approx(st, abs=0.1)


def test_too_few_whole_samples_or_no_variance_give_nothing_rather_than_noise():
    screen, blocks = morris_design(LETTERS, 6, seed=3), sobol_design(LETTERS, 32, seed=3)
    y = linear(screen.points)
    y[::8] = np.nan
    assert morris_rows(screen, y, seed=3) is None
    assert morris_rows(screen, np.full(len(screen.points), np.nan), seed=3) is None
    assert sobol_rows(blocks, np.full(len(blocks.points), np.nan), seed=3) is None
    assert sobol_rows(blocks, np.full(len(blocks.points), 4.2), seed=3) is None


@pytest.mark.parametrize("seed", [0, 1])
def test_the_same_seed_gives_the_same_numbers_to_the_last_digit(seed):
    def once() -> list:
        screen, blocks = morris_design(LETTERS, 5, seed), sobol_design(LETTERS, 16, seed)
        return [
            screen.points.tolist(),
            blocks.points.tolist(),
            morris_rows(screen, np.exp(linear(screen.points)), seed),
            sobol_rows(blocks, np.exp(linear(blocks.points)), seed),
        ]

    assert once() == once()


@pytest.fixture(scope="module")
def variables() -> dict[str, Variable]:
    trial = embedded_study().walks[0].trial
    return Walker(trial.subject, trial.model).variables


@pytest.fixture(scope="module")
def factors(variables) -> tuple[Factor, ...]:
    return sensitivity_factors(variables, "right")


def test_in_the_middle_of_all_ranges_the_model_is_the_studys_own(factors, variables):
    values = values_at(factors, np.full(len(factors), 0.5), variables)
    for name, value in values.items():
        assert value == pytest.approx(variables[name].default, rel=1e-12, abs=1e-15), name


def test_the_ends_of_all_ranges_are_values_that_the_model_takes(factors, variables):
    for share in (0.0, 1.0):
        for name, value in values_at(factors, np.full(len(factors), share), variables).items():
            assert variables[name].minimum <= value <= variables[name].maximum, name


def test_shifts_are_in_si_units_and_ratios_even_in_the_logarithm(variables):
    alignment = Factor(
        name="alignment",
        group="geometry",
        unit="deg",
        low=-1.0,
        high=1.0,
        why="",
        variables=("offset.alignment",),
    )
    ratio = Factor(
        name="modulus",
        group="keel",
        unit="×",
        low=0.5,
        high=2.0,
        why="",
        kind="ratio",
        variables=("keel.flexural_modulus",),
    )
    values = values_at((alignment, ratio), np.array([1.0, 0.75]), variables)
    assert values["offset.alignment"] == pytest.approx(math.radians(1.0))
    assert values["keel.flexural_modulus"] == pytest.approx(
        variables["keel.flexural_modulus"].default * math.sqrt(2.0)
    )


def test_a_change_of_the_exponent_keeps_the_force_at_the_reference_depth(factors, variables):
    exponent = next(factor for factor in factors if factor.kind == "exponent")
    for share in (0.0, 0.3, 1.0):
        values = values_at((exponent,), np.array([share]), variables)
        for name in exponent.variables:
            stiffness = name.replace(".exponent", ".stiffness")
            before = variables[stiffness].default * REFERENCE_DEPTH_M ** variables[name].default
            assert values[stiffness] * REFERENCE_DEPTH_M ** values[name] == pytest.approx(before)
            assert values[name] >= 1.0


def test_stiffness_and_exponent_of_a_zone_change_together(factors, variables):
    chosen = [
        factor
        for factor in factors
        if factor.kind == "exponent" or factor.name == "heel foam stiffness"
    ]
    values = values_at(chosen, np.ones(2), variables)
    n, k = values["contact.heel.exponent"], values["contact.heel.stiffness"]
    stiffness, exponent = (
        variables[f"contact.heel.{name}"].default for name in ("stiffness", "exponent")
    )
    before = stiffness * REFERENCE_DEPTH_M**exponent
    assert k * REFERENCE_DEPTH_M**n == pytest.approx(1.5 * before)


def test_a_fulcrum_at_the_end_of_its_reach_moves_only_inward(factors, variables):
    fulcrum = next(factor for factor in factors if factor.name == "fulcrum position")
    found = [
        values_at((fulcrum,), np.array([share]), variables, {"fulcrum.shift": (0.0, 0.085)})[
            "fulcrum.shift"
        ]
        for share in (0.0, 0.5, 1.0)
    ]
    np.testing.assert_allclose(found, [0.0, 2.5e-3, 5e-3])


def test_the_joint_angles_are_those_of_the_prosthetic_side(variables):
    names = {name for factor in sensitivity_factors(variables, "left") for name in factor.variables}
    assert "coordinate.hip_flexion_l" in names
    assert not any(name.endswith("_r") for name in names)


@pytest.fixture(scope="module")
def walks() -> DesignWalks:
    """All three conditions."""
    return DesignWalks(embedded_study().walks)


@pytest.fixture(scope="module")
def by_name(walks) -> dict[str, Factor]:
    return {
        factor.name: factor for factor in sensitivity_factors(walks.trials[0].variables, "right")
    }


def walked(walks: DesignWalks, trial: int, values: dict[str, float]):
    """A walk of a trial with other values, as the program makes it, and its result with all of
    it."""
    own, walker = walks.trials[trial].trial, walks.trials[trial].walker
    run = walker.walk(
        own.trajectory,
        fulcrum_m=own.fulcrum_m,
        start_s=own.start_s,
        end_s=own.end_s,
        step_s=STEP_S,
        offsets=own.offsets,
        values=values,
    )
    return run, walker.result(run, own, own.offsets)


def test_the_studys_own_walks_have_the_errors_that_the_metrics_say(walks):
    baseline = walks.baseline()
    for row, walk in zip(baseline, embedded_study().walks, strict=True):
        assert row[OUTPUTS.index("grf_rmse_bw")] == pytest.approx(
            walk.metrics.grf_rmse_bw, rel=1e-12
        )
        assert row[OUTPUTS.index("cop_rmse_fl")] == pytest.approx(
            walk.metrics.cop_rmse_fl, rel=1e-12
        )
        peaks = walk.metrics.stances[0].model_peaks_bw
        assert row[OUTPUTS.index("peak_vertical_bw")] == pytest.approx(
            max(peaks.vertical_first_half, peaks.vertical_second_half), rel=1e-12
        )


def test_a_changed_walk_is_scored_as_comparison_and_metrics_would(walks, by_name):
    chosen = (by_name["prosthesis height"], by_name["axial socket stiffness"])
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
        1e3 * np.nanmean(stance.model_cop[:, 0] - stance.measured_cop[:, 0]), rel=1e-9
    )


def spring(walks, trial, step_s):
    """(stored, returned) J of the spring by the prosthesis' own ledger."""
    own, walker = walks.trials[trial].trial, walks.trials[trial].walker
    run = walker.walk(
        own.trajectory,
        fulcrum_m=own.fulcrum_m,
        start_s=own.start_s,
        end_s=own.end_s,
        step_s=step_s,
        offsets=own.offsets,
    )
    energy = prosthesis_energy(walker, run)
    stance = find_stances(energy.time_s, energy.vertical_n)[0]
    down, off = np.searchsorted(energy.time_s, [stance.start_s, stance.end_s])
    strain = energy.terms["keel_strain"] + energy.terms["fulcrum_strain"]
    loss = energy.terms["keel_loss"] + energy.terms["fulcrum_loss"]
    full = down + int(np.argmax(strain[down : off + 1]))
    return strain[full] - strain[down], strain[full] - strain[off] - (loss[off] - loss[full])


def test_a_second_ledger_of_the_prosthesis_has_the_same_energies_and_finer_steps_lead_to_them(
    walks,
):
    """What is returned has the loss in it: at push-off some 0.1 s long, where a step of the first
    order of 2 ms leaves up to 0.5 %. That falls at least with the step: two halvings later a
    halving changes it a quarter as much, or less; from one to the next it jumps a little, as strike
    and lift-off fall where the steps are."""
    for trial, row in enumerate(walks.baseline()):
        stored, returned = np.transpose(
            [spring(walks, trial, h) for h in STEP_S / 2.0 ** np.arange(4)]
        )
        assert row[OUTPUTS.index("spring_stored_j")] == pytest.approx(stored[0], rel=1e-9)
        assert row[OUTPUTS.index("spring_returned_j")] == pytest.approx(returned[0], rel=1e-9)
        assert stored[0] == pytest.approx(stored[-1], rel=2e-3)
        first, _, third = np.abs(np.diff(returned))
        assert third < 0.55**2 * first
        assert third < 2e-3 * returned[-1]


def test_on_level_ground_a_person_further_ahead_only_moves_the_centre_of_pressure(walks, by_name):
    found = walks(np.array([[0.5], [1.0]]), factors=(by_name["pelvis fore-aft"],))
    change = found[1] - found[0]
    # fore-aft is where the person walks
    along = [one.comparison.heading[0] for one in walks.trials]
    np.testing.assert_allclose(
        change[:, OUTPUTS.index("cop_shift_mm")], 2.0 * np.array(along), atol=1e-6
    )
    for name in ("grf_rmse_bw", "peak_vertical_bw", "spring_stored_j", "spring_returned_j"):
        np.testing.assert_allclose(change[:, OUTPUTS.index(name)], 0.0, atol=1e-8)


def test_on_small_ranges_morris_effects_are_the_exact_derivatives(walks, by_name):
    """Over a two-hundredth of the ranges the mean CoP is linear in the factors, so that mu is its
    derivative; over a fiftieth an instant at the end of a stance may come or go."""
    names = ("hip flexion", "axial socket stiffness", "foam exponent")
    chosen = []
    for name in names:
        one = by_name[name]
        ends = (
            (one.low**0.005, one.high**0.005)
            if one.kind == "ratio"
            else (0.005 * one.low, 0.005 * one.high)
        )
        chosen.append(dataclasses.replace(one, low=ends[0], high=ends[1]))
    alone = DesignWalks(embedded_study().walks[1:2])
    design = morris_design(names, 4, seed=0)
    y = alone(design.points, factors=chosen)[:, 0, OUTPUTS.index("cop_shift_mm")]
    rows = morris_rows(design, y, seed=0)
    own = alone.trials[0]
    trial, middle, step = own.trial, np.full(len(chosen), 0.5), 5e-5 * np.eye(len(chosen))
    ahead, behind = (
        np.array([[*own.values(chosen, middle + sign * one).values()] for one in step])
        for sign in (1.0, -1.0)
    )
    run = own.walker.walk(
        trial.trajectory,
        fulcrum_m=trial.fulcrum_m,
        start_s=trial.start_s,
        end_s=trial.end_s,
        step_s=STEP_S,
        offsets=trial.offsets,
        with_respect_to=tuple(own.values(chosen, middle)),
    )
    by = compare_sensitivity(own.comparison, own.result, run.sensitivity)
    exact = 1e3 * np.nanmean(by.cop[0][:, 0], axis=0) @ (ahead - behind).T / 1e-4
    largest = np.abs(exact).max()
    np.testing.assert_allclose([row.mu for row in rows], exact, rtol=0.05, atol=0.01 * largest)
    assert all(row.sigma < 0.05 * largest for row in rows)


def test_a_walk_that_fails_is_counted_named_and_has_no_values():
    alone = DesignWalks(embedded_study().walks[1:2])
    absurd = Factor(
        name="height",
        group="geometry",
        unit="mm",
        low=-1.0,
        high=900.0,
        why="",
        variables=("offset.height",),
    )
    found = alone(np.array([[0.0], [1.0]]), factors=(absurd,))
    assert np.isfinite(found[0]).all() and np.isnan(found[1]).all()
    assert alone.walked == 2
    assert len(alone.failures) == 1 and "offset.height" in alone.failures[0]


def only(study: Study, *roles: str) -> Study:
    """A study whose first condition has as many repeats as `roles`, named by their place, and no
    other."""
    one = study.walks[0]
    return dataclasses.replace(
        study,
        walks=tuple(
            dataclasses.replace(one, label=f"low_{i + 1}", role=role)
            for i, role in enumerate(roles)
        ),
    )


@pytest.mark.parametrize(
    ("roles", "label"),
    [
        ((FITTED, HELD_OUT, HELD_OUT), "low_2"),
        ((HELD_OUT, FITTED, FITTED), "low_1"),
        ((FITTED, FITTED, FITTED), "low_2"),
        ((FITTED,), "low_1"),
    ],
)
def test_the_walk_of_a_condition_is_the_middle_repeat_of_those_that_the_fit_has_not_seen(
    roles, label
):
    assert [walk.label for walk in chosen_walks(only(embedded_study(), *roles))] == [label]


def test_the_short_form_has_every_output_and_no_indices():
    section = sensitivity_section(embedded_study())
    table = section.table
    assert any("no Sobol" in sentence for sentence in section.missing)
    assert tuple(table.outputs) == OUTPUTS and table.blocks is None
    names = [row.name for row in table.factors]
    for row in table.outputs.values():
        assert row.sobol is row.p05 is row.interaction is None
        assert [
            effect.name for effect in row.morris
        ] == names and row.baseline == row.baseline_indexed > -1e3
    assert len(set(names)) >= 30
    assert {row.group for row in table.factors} == set(GROUPS) and all(
        row.why for row in table.factors
    )
    assert table.failed == 0 and table.walks == 1 + table.trajectories * (len(names) + 1)


def test_without_a_measured_centre_of_pressure_the_other_outputs_are_there(monkeypatch):
    monkeypatch.setattr(sensitivity, "QUICK_TRAJECTORIES", 4)
    monkeypatch.setattr(
        sensitivity, "sensitivity_factors", lambda *of: sensitivity_factors(*of)[:3]
    )
    study = embedded_study()
    one = study.walks[1]
    plates = {
        side: dataclasses.replace(plate, cop_W=np.full_like(plate.cop_W, np.nan), has_cop=False)
        for side, plate in one.trial.plates.items()
    }
    blind = dataclasses.replace(one, trial=dataclasses.replace(one.trial, plates=plates))
    section = sensitivity_section(dataclasses.replace(study, walks=(blind,)))
    assert any(
        sentence.startswith("No centre of pressure was measured in medium_2")
        for sentence in section.missing
    )
    for name, row in section.table.outputs.items():
        assert (row.morris is None) == name.startswith("cop_")
    assert section.table.outputs["cop_rmse_fl"].baseline is None


@pytest.mark.slow
def test_the_long_form_has_indices_of_groups(monkeypatch):
    """Of one walk with few samples, in several portions."""
    for name, value in (("TRAJECTORIES", 4), ("GROUP_SAMPLES", 16), ("AT_ONCE", 100)):
        monkeypatch.setattr(sensitivity, name, value)
    study = embedded_study()
    long = sensitivity_section(
        dataclasses.replace(study, walks=study.walks[1:2], options=StudyOptions(workers=1))
    )
    table = long.table
    assert table.failed == 0 and any("One condition only" in sentence for sentence in long.missing)
    for row in table.outputs.values():
        assert [one.name for one in row.sobol] == [
            "contact",
            "friction",
            "geometry",
            "kinematics",
            "bushing",
            "keel",
        ]
        assert row.p05 < row.p50 < row.p95 and row.dropped == 0
        assert row.interaction == pytest.approx(1.0 - sum(one.s1 for one in row.sobol))
    effects = {row.name: row.mu_star for row in table.outputs["grf_rmse_bw"].morris}
    # a place on the floor moves no force
    assert max(effects["pelvis fore-aft"], effects["pelvis sideways"]) < 1e-9
    # 1.2 degrees move the foot by 2 cm about the hip and by half of that about the knee; foam and
    # socket give by 1 cm
    assert 0.06 < effects["hip flexion"] and 0.04 < effects["knee flexion"] < effects["hip flexion"]
