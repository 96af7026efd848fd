"""The figure and the table of a person standing still say what was measured, and when that is not standing."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from vsf_drake.report.figures import standing_figure
from vsf_drake.report.outputs import write_standing
from vsf_drake.simulation.results import Standing, standing_table

STEPS, STEP_S, WEIGHT_N = 2000, 1e-3, 700.0


def made(**changes) -> Standing:
    """Two seconds at 40 % on the prosthesis, the pelvis moving evenly by 0.6 mm forward and 0.8 mm to the right."""
    time = STEP_S * np.arange(1, STEPS + 1)
    pelvis = np.zeros((STEPS + 1, 6))
    pelvis[:, 0], pelvis[:, 2] = np.linspace(0, 0.6e-3, STEPS + 1), np.linspace(0, 0.8e-3, STEPS + 1)
    pelvis[:, 4] = np.radians(2.0)
    standing = Standing(
        time_s=time, prosthetic_n=np.full(STEPS, 0.4 * WEIGHT_N), intact_n=np.full(STEPS, 0.6 * WEIGHT_N),
        pelvis=pelvis, weight_n=WEIGHT_N, fulcrum_m=0.108, side="left", name="somebody",
        free=("pelvis_tx", "pelvis_ty", "pelvis_tz"),
        held_nm={"pelvis_tilt": -21.0, "pelvis_list": 3.0, "pelvis_rotation": 0.0}, stiffness_nm_per_rad=None,
        com_height_m=1.0, leg_lengths_m=(0.95, 0.96), unconverged_steps=0, notes=("A note.",))
    return dataclasses.replace(standing, **changes)


def test_table_states_forces_shares_and_drift():
    table = standing_table(made())
    assert table.mean_vertical_n == pytest.approx(WEIGHT_N)
    assert table.weight_error == pytest.approx(0.0, abs=1e-12)
    assert (table.prosthetic_share, table.intact_share) == (pytest.approx(0.4), pytest.approx(0.6))
    assert table.drift_mm == pytest.approx(1.0), "0.6 and 0.8 at right angles"
    assert table.turn_deg == 0.0
    assert table.pelvis_deg["list"] == pytest.approx(2.0)
    assert table.toppling_nm_per_rad == pytest.approx(700.0)
    assert len(table.series.time_s) == 100
    assert table.series.time_s[-1] == pytest.approx(2.0)


@pytest.mark.parametrize(("changes", "stands"), [
    ({}, True), ({"prosthetic_n": np.full(STEPS, 0.42 * WEIGHT_N)}, False), ({"unconverged_steps": 3}, False)])
def test_standing_is_weight_within_a_percent_a_millimetre_and_convergence(changes, stands):
    still = np.zeros((STEPS + 1, 6))
    assert standing_table(made(pelvis=still, **changes)).stands is stands


def test_a_fall_is_no_standing_even_though_the_mean_force_is_the_weight():
    fallen = np.zeros((STEPS + 1, 6))
    fallen[:, 1] = np.linspace(1.0, 0.2, STEPS + 1)
    table = standing_table(made(pelvis=fallen))
    assert table.weight_error == pytest.approx(0.0, abs=1e-12)
    assert table.stands is False
    assert "DOES NOT STAND" in standing_figure(table).get_suptitle()


def test_figure_draws_each_foot_their_sum_and_the_weight():
    figure = standing_figure(standing_table(made()))
    forces, drift = figure.axes
    drawn = {line.get_label().split(",")[0]: line.get_ydata() for line in forces.lines}
    assert set(drawn) == {"weight", "both feet", "intact foot", "prosthetic foot"}
    np.testing.assert_allclose(drawn["both feet"], WEIGHT_N)
    np.testing.assert_allclose(drawn["prosthetic foot"], 0.4 * WEIGHT_N)
    np.testing.assert_allclose(drawn["weight"], WEIGHT_N)
    assert np.max(drift.lines[0].get_ydata()) == pytest.approx(1.0)
    for axes in figure.axes:
        assert axes.get_xlabel().endswith("(s)")
        assert axes.get_ylabel().endswith((" (N)", " (mm)"))
    shown = drift.texts[0].get_text()
    assert "tilt -21.0 N m" in shown and "free: tx, ty, tz" in shown


def test_steps_that_did_not_converge_are_shouted():
    assert "3 STEPS NOT CONVERGED" in standing_figure(standing_table(made(unconverged_steps=3))).get_suptitle()


def test_output_is_numbers_and_figure(tmp_path):
    table = write_standing(made(), tmp_path / "new" / "folder")
    assert table.notes == ("A note.",)
    assert sorted(p.name for p in (tmp_path / "new" / "folder").glob("[!.]*")) == [
        "standing.json", "standing.png", "standing.svg"]
