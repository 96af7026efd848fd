"""The sensitivity chapter: made of a saved table alone, with what the table lacks."""

from __future__ import annotations

import copy
import json
from typing import Any

import pytest
from matplotlib.colors import to_hex
from shown_chapter import Shown

from vsf_drake.report.validation.sensitivity_chapter import (
    GROUPS,
    MAIN,
    MOST,
    OUTPUTS,
    indices_figure,
    screening_figure,
    sensitivity_chapter,
)

NAMES = [f"{group} {n}" for group in GROUPS for n in (1, 2, 3)]


def made_table() -> dict[str, Any]:
    """A table as the section saves it, of round numbers: the i-th factor's mu* is (18 - i) thousandths."""
    factors = [{"name": name, "group": name.split()[0], "unit": "mm", "low": -1.0, "high": 1.0, "why": "a choice",
                "variables": ["v"], "local_grf_bw": 0.01} for name in NAMES]
    effects = [{"name": name, "group": name.split()[0], "mu": -0.5e-3 * (18 - i), "mu_star": 1e-3 * (18 - i),
                "mu_star_conf": 1e-3, "sigma": 2e-3} for i, name in enumerate(NAMES)]

    def indices(names: list[str]) -> list[dict[str, Any]]:
        return [{"name": name, "s1": 0.3, "s1_conf": 0.2 if i else 0.05, "st": 0.5 - 0.02 * i, "st_conf": 0.1,
                 "s1_wide": bool(i), "st_wide": False} for i, name in enumerate(names)]

    def each(value: Any) -> dict[str, Any]:
        return {name: copy.deepcopy(value) for name in OUTPUTS}

    table = {
        "factors": factors, "conditions": [{"label": f"walk_{x}", "fulcrum_mm": x, "role": "held out"}
                                           for x in (66.0, 108.0)],
        "indexed": 1, "baseline": each({"mean": 0.03, "by_condition": [0.02, 0.04]}), "morris": each(effects),
        "morris_by_condition": each([[row["mu_star"] for row in effects]] * 2), "stability": each(0.91),
        "local_agreement": 0.95, "ranking": each(NAMES), "sobol": each(indices([*GROUPS])),
        "sobol_factors": each(indices(NAMES[:4])), "strongest": NAMES[:4],
        "spread": each({"mean": 0.05, "sd": 0.01, "p05": 0.04, "p50": 0.05, "p95": 0.07}), "explained": each(0.8),
        "interaction": each(0.2), "interaction_conf": each(0.1), "walks": 1000, "failures": {
            "count": 0, "examples": [], "dropped": each({"trajectories": 0, "group_blocks": 0, "factor_blocks": 0})},
        "unconverged": 0, "trajectories": 16, "samples": {"groups": 256, "factors": 128}, "seed": 0, "quick": False,
        "synthetic": True}
    return json.loads(json.dumps(table))


def shown(table: dict[str, Any]) -> Shown:
    return Shown(sensitivity_chapter(table, {}))


def test_the_chapter_names_the_strongest_factors_with_their_intervals_and_says_synthetic():
    chapter = shown(made_table())
    assert "kinematics 1 1.8 ± 0.1, kinematics 2 1.7 ± 0.1" in chapter.words
    assert "synthetic walk_66" in chapter.words
    assert list(chapter.alts) == ["sensitivity_screening", "sensitivity_indices"]
    for alt in chapter.alts.values():
        assert "kinematics" in alt and any(character.isdigit() for character in alt)


def test_every_grid_has_its_columns_in_every_row_and_a_name_of_its_own():
    grids = shown(made_table()).grids
    assert len(grids) == 6
    for grid in grids.values():
        keys = {column.key for column in grid.columns}
        assert all(keys <= set(row) for row in grid.rows), grid.name


def test_indices_with_an_interval_wider_than_themselves_are_counted():
    table = made_table()
    table["sobol"]["grf_rmse_bw"][2]["st_wide"] = True
    text = shown(table).words
    # Of each output 5 of 6 groups and 3 of 4 factors.
    assert f"{3 * 8} of {3 * 10} first-order indices" in text
    assert f"total index of {table['sobol']['grf_rmse_bw'][2]['name']} (resultant GRF error)" in text


def test_the_short_form_shows_the_screening_alone():
    table = made_table()
    table |= {"sobol": dict.fromkeys(OUTPUTS), "sobol_factors": dict.fromkeys(OUTPUTS), "samples": None, "quick": True,
              "spread": dict.fromkeys(OUTPUTS), "explained": dict.fromkeys(OUTPUTS), "local_agreement": None,
              "interaction": dict.fromkeys(OUTPUTS), "interaction_conf": dict.fromkeys(OUTPUTS),
              "stability": dict.fromkeys(OUTPUTS), "conditions": table["conditions"][:1], "indexed": 0}
    chapter = shown(table)
    assert list(chapter.alts) == ["sensitivity_screening"]
    assert "sensitivity_conditions" not in chapter.grids


def test_without_a_centre_of_pressure_the_other_outputs_are_shown():
    table = made_table()
    centres = ("cop_rmse_fl", "cop_shift_mm")
    for key in ("morris", "sobol", "sobol_factors", "spread", "explained", "interaction", "interaction_conf",
                "stability"):
        table[key] |= dict.fromkeys(centres)
    table["ranking"] |= {name: [] for name in centres}
    table["baseline"] |= {name: {"mean": None, "by_condition": [None, None]} for name in centres}
    chapter = shown(table)
    assert "CoP error" not in chapter.alts["sensitivity_screening"]
    assert len(screening_figure(table).axes) == len(MAIN) - 1


def test_without_any_effects_the_chapter_says_so_and_draws_nothing():
    table = made_table()
    for key in ("morris", "sobol", "sobol_factors"):
        table[key] = dict.fromkeys(OUTPUTS)
    table["local_agreement"] = None
    chapter = shown(table)
    assert chapter.missing and not chapter.alts


def test_failures_are_counted_and_the_first_is_quoted():
    table = made_table()
    table["failures"] |= {"count": 3, "examples": ["point 4: the run diverges"]}
    table["failures"]["dropped"]["grf_rmse_bw"] = {"trajectories": 1, "group_blocks": 2, "factor_blocks": None}
    text = shown(table).words
    assert "3 failed" in text and "the run diverges" in text and "3 for the resultant GRF error" in text


@pytest.mark.parametrize("draw", [screening_figure, indices_figure])
def test_every_axis_of_the_figures_is_labelled(draw):
    figure = draw(made_table())
    assert figure.axes
    for axes in figure.axes:
        assert axes.get_xlabel().endswith(")") and axes.get_ylabel() and axes.get_title(loc="left")


def test_a_panel_has_the_strongest_factors_in_order_from_above():
    axes = screening_figure(made_table()).axes[0]
    assert [tick.get_text() for tick in axes.get_yticklabels()] == NAMES[:MOST]
    assert axes.get_ylim()[0] > axes.get_ylim()[1]
    assert axes.patches[0].get_width() == pytest.approx(1.8)


def test_groups_differ_by_colour_and_by_hatch():
    assert len({to_hex(colour) for colour, _ in GROUPS.values()}) == len(GROUPS)
    assert len({hatch for _, hatch in GROUPS.values()}) == len(GROUPS)
