"""The chapters of a validation: functions of its saved sections, which say what is there and cope
with what is not."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from made_study import saved_section, shipped_section
from readable import LEAST_PX, letters_px
from shown_chapter import Shown

from vsf_drake.base.files import plain
from vsf_drake.report.page import cell
from vsf_drake.report.validation.bench_chapter import bench_chapter, standing_chapter
from vsf_drake.report.validation.chapters import make_chapters
from vsf_drake.report.validation.energy_chapter import energy_chapter
from vsf_drake.report.validation.roll_over_chapter import roll_over_chapter
from vsf_drake.report.validation.sensitivity_chapter import (
    MAIN,
    MOST,
    OUTPUTS,
    indices_figure,
    screening_figure,
    sensitivity_chapter,
)
from vsf_drake.report.validation.settings_chapter import poor_judge, settings_chapter
from vsf_drake.report.validation.walking_chapter import walking_chapter
from vsf_drake.validation.bench_section import FallenRow
from vsf_drake.validation.energy_section import Softer
from vsf_drake.validation.run import LONG
from vsf_drake.validation.sensitivity_section import (
    Effect,
    FactorRange,
    Index,
    OutputRow,
    SensitivityTable,
    WalkedCondition,
)
from vsf_drake.validation.settings_section import PairRow, SettingsTable
from vsf_drake.walks.numbers import Spread

MAKERS = {
    "bench": bench_chapter,
    "standing": standing_chapter,
    "walking": walking_chapter,
    "energy": energy_chapter,
    "roll_over": roll_over_chapter,
    "settings": settings_chapter,
    "sensitivity": sensitivity_chapter,
}
FIGURES = {
    "bench": ["bench_curves", "bench_stiffness", "bench_errors"],
    "standing": [],
    "walking": [
        "walking_errors",
        "walking_forces",
        "walking_others",
        "walking_sweep",
        "walking_differences",
    ],
    "energy": ["energy_stance", "energy_position", "energy_balance", "energy_power"],
    "roll_over": [
        "roll_over_shapes",
        "roll_over_measures",
        "iso_22675_profile",
        "inclined_loading",
    ],
    "settings": ["settings_apart", "settings_change"],
    "sensitivity": ["sensitivity_screening", "sensitivity_indices"],
}


@pytest.fixture(autouse=True)
def unsettled(monkeypatch):
    """The layout of a figure is settled when it is saved, not in every test."""
    monkeypatch.setattr("vsf_drake.report.style._Margins.execute", lambda engine, figure: None)


@pytest.fixture(scope="module")
def saved(quick_validation):
    """Table and arrays of a section of the quick validation, or of one that comes with the
    package."""

    def _saved(name):
        section = shipped_section(name) if name in LONG else saved_section(quick_validation, name)
        return section.table, dict(section.arrays)

    return _saved


def assert_sound(chapter, table, arrays):
    """Figures tell their finding in a title and in numbers, with units on their axes and letters
    for a telephone; every table can be shown and written; what is open is short."""
    shown = Shown(chapter(table, arrays))
    for name, alt in shown.alts.items():
        assert (
            re.search(r"\d", alt) and len(alt) > 50 and shown.captions[name] and shown.titles[name]
        ), name
        for text in (alt, shown.titles[name]):
            assert not re.search(r"\b(nan|none)\b|–", text, re.IGNORECASE), (name, text)
        assert letters_px(shown.figures[name]) >= LEAST_PX, name
        for axes in shown.figures[name].axes:
            if axes.axison:
                assert re.search(r"\(.+\)$", axes.get_xlabel()) or axes.get_subplotspec(), name
    for grid in shown.grids.values():
        assert (
            grid.rows
            and len({column.heading for column in grid.columns if column.heading not in "±SDR²"})
            > 1
        )
        for row in plain(grid.rows):
            texts = [cell(column, row.get(column.key)) for column in grid.columns]
            assert all(texts) and not any(
                "nan" in text.lower() or text == "None" for text in texts
            ), grid.name
    seen = re.sub(r"<details.*?</details>", "", shown.html, flags=re.DOTALL)
    assert len(re.sub(r"<[^>]+>", " ", seen).split()) <= 450 and seen.count("<table") <= 2, (
        "the rest is folded"
    )
    assert ">nan<" not in shown.html and ">None<" not in shown.html and "None" not in shown.words
    return shown


@pytest.mark.parametrize("name", MAKERS)
def test_every_chapter_has_its_figures_and_tables(saved, name):
    shown = assert_sound(MAKERS[name], *saved(name))
    assert list(shown.alts) == FIGURES[name]
    for figure, title in shown.titles.items():
        assert re.search(r"\d", title) or figure == "iso_22675_profile", (
            title,
            "a title says what was found",
        )


def test_a_page_that_grows_shows_a_finished_chapter_again_and_another_result_anew():
    section = shipped_section("settings")

    def shown(table, arrays):
        content = {"sections": {"settings": {"table": table}}}
        own = {f"settings/{name}": array for name, array in arrays.items()}
        chapters = make_chapters(content, own, LONG, lenient=True)
        return next(one.figures for one in chapters if one.name == "settings")

    first = plain(section.table)
    arrays = section.arrays
    again = shown(first, arrays)
    assert again and again == shown(plain(section.table), arrays)
    changed = {name: array.copy() for name, array in arrays.items()}
    for other in (shown(first, changed), shown({**first, "seed": -1}, arrays)):
        assert not set(other.values()) & set(again.values())


def test_chapters_are_made_without_drake():
    code = (
        "import sys, vsf_drake.report.validation.chapters; "
        "sys.exit(any(name.split('.')[0] == 'pydrake' for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# The bench.


def test_synthetic_curves_neither_meet_nor_miss_the_paper_s_criteria_and_measured_ones_do(saved):
    table, arrays = saved("bench")
    shown = Shown(bench_chapter(table, arrays))
    ours = shown.grids["bench_comparison"].rows[0]
    assert (
        ours["mid_range_rmse_mm"] == table.mid_range_rmse_mm
        and "RMSE 1.37 N/mm and 0.45 mm" in shown.words
    )
    assert (
        "SYNTHETIC" in shown.words
        and "can neither meet nor miss them" in shown.words
        and "(met)" not in shown.words
    )
    assert not shown.missing
    limits = {**table.within_limits, "stiffness_rmse_n_per_mm": True, "mid_range_rmse_mm": False}
    shown = Shown(
        bench_chapter(replace(table, measured_synthetic=False, within_limits=limits), arrays)
    )
    assert "1.37 N/mm (met) and 0.45 mm (NOT met)" in shown.words


def test_bench_without_curves_rates_and_load_points_shows_the_published_end_points(saved):
    table, arrays = saved("bench")
    lines = tuple(replace(line, statistics=None, held_out=None) for line in table.lines[:3])
    settings = tuple(
        replace(
            row,
            repeats=0,
            lines={
                key: value and replace(value, mid_range_offset_mm=None, curve_rmse_mm=None)
                for key, value in row.lines.items()
            }
            | {"measured": None},
        )
        for row in table.settings
    )
    bare = replace(
        table,
        lines=lines,
        settings=settings,
        measured_name=None,
        measured_synthetic=None,
        rates=(),
        load_points=(),
    )
    arrays |= {"measured_mm": np.full_like(arrays["measured_mm"], np.nan)}
    shown = assert_sound(bench_chapter, bare, arrays)
    assert list(shown.alts) == FIGURES["bench"][:2] and "bench_comparison" not in shown.grids
    assert (
        "published end points" in shown.words
        and "R²" not in shown.words
        and "SYNTHETIC" not in shown.words
    )


# Standing.


def test_the_weight_that_is_carried_is_told_with_the_prosthetic_share_and_a_fall_stays_empty(saved):
    table, arrays = saved("standing")
    shown = assert_sound(standing_chapter, table, arrays)
    shares = [f"{100 * row.prosthetic_share:.0f}" for row in table.rows]
    assert "weight within 0.01 %" in shown.paragraphs[0]
    assert f"carries {min(shares)} to {max(shares)} %" in shown.paragraphs[0]

    fallen = FallenRow(fulcrum_mm=66.0, mass_known_kg=78.0, failure="the person fell")
    table = replace(table, rows=(fallen, *table.rows[1:]), worst_mass_error=-0.031, all_stand=False)
    shown = assert_sound(standing_chapter, table, arrays)
    assert "within 3.10 %" in shown.paragraphs[0]
    assert "At some positions the person does not stand still" in shown.paragraphs[0]
    shown = Shown(
        standing_chapter(replace(table, rows=(fallen,), worst_mass_error=None, all_stand=None), {})
    )
    assert shown.paragraphs[0] == "No standing could be simulated."


# Walking.


def test_the_papers_row_stands_beside_a_persons_walks_and_never_beside_synthetic_ones(saved):
    table, arrays = saved("walking")
    shown = Shown(walking_chapter(table, arrays))
    assert not any(row["source"] == "paper" for row in shown.grids["walking_table_3"].rows)
    assert (
        "resultant error of 10, 13 and 14 % BW" in shown.words
        and "not to be compared" in shown.words
    )
    shown = Shown(walking_chapter(replace(table, synthetic=False), arrays))
    rows = shown.grids["walking_table_3"].rows
    paper, own = (
        [row for row in rows if row["source"] == source] for source in ("paper", "held out")
    )
    assert [
        (
            row["grf_rmse_bw"],
            row["cop_rmse_fl"],
            row["stance_measured_s"],
            row["stance_measured_s_sd"],
        )
        for row in paper
    ] == [(0.10, 0.089, 0.73, 0.02), (0.13, 0.095, 0.79, 0.01), (0.14, 0.057, 0.71, 0.02)]
    published = {"grf_rmse_bw", "cop_rmse_fl", "stance_measured_s", "stance_measured_s_sd"}
    columns = {c.key for c in shown.grids["walking_table_3"].columns} - {"setting", "source", "n"}
    assert all(row.get(key) is None for row in paper for key in columns - published)
    assert [row["grf_rmse_bw"] for row in own] == [row.error_bw for row in table.rows]
    assert "SYNTHETIC" not in shown.words


def test_walking_begins_with_the_error_beside_the_null_models_and_what_worse_angles_make_of_it(
    saved,
):
    table, arrays = saved("walking")
    shown, own = Shown(walking_chapter(table, arrays)), table.held_out
    first = shown.paragraphs[0]
    assert (
        f"{100 * own.scores['grf_rmse_bw']:.1f} % BW over {own.n} SYNTHETIC held-out walks" in first
    )
    assert f"beats it on {own.beats_null} of {own.beats_null_of}" in first
    assert {row.role for row in shown.grids["walking_angle_errors"].rows} == {"held out"}
    bare = replace(table, held_out=None, offsets_fitted=own)
    assert "which is no prediction" in Shown(walking_chapter(bare, arrays)).paragraphs[0]


def test_a_bare_trial_without_a_whole_stance_whose_sweep_failed_has_a_chapter_too(saved):
    table, _ = saved("walking")
    unknown = dict.fromkeys(
        (
            "stance_model_s",
            "stance_error_s",
            "heel_strike_error_s",
            "toe_off_error_s",
            "cop_rmse_fl",
            "null_model_grf_rmse_bw",
        )
    )
    sweep = replace(table.rows[0].sweep, grf_rmse_bw=(None,) * 6, best_mm=None, off_mm=None)
    rows = tuple(
        replace(row, scores=row.scores | unknown, beats_null=None, sweep=sweep)
        for row in table.rows[:1]
    )
    bare = replace(
        table,
        rows=rows,
        differences=(),
        difference_method=None,
        stance_r=None,
        conditions=table.conditions[:1],
    )
    shown = assert_sound(walking_chapter, bare, {})
    assert list(shown.alts) == ["walking_errors"] and "too few walks" in shown.words
    assert "No walk could be scored with the fulcrum elsewhere." in shown.words


def test_more_conditions_than_fit_side_by_side_get_more_figures(saved):
    table, arrays = saved("walking")
    arrays = {
        key: value for key, value in arrays.items() if "_vertical_" in key or "_impulse_" in key
    }
    conditions, differences = list(table.conditions), list(table.differences)
    for i, fulcrum in ((3, 160.0), (4, 170.0)):
        conditions.append(replace(conditions[0], fulcrum_mm=fulcrum, name=None, paper=None))
        differences += [replace(d, group=i) for d in table.differences if d.group == 0]
        arrays |= {
            key.replace("group_0_", f"group_{i}_"): value
            for key, value in arrays.items()
            if key.startswith("group_0_")
        }
    rows = (*table.rows, replace(table.rows[0], label="a $ walk", fulcrum_mm=160.0))
    batch = replace(table, conditions=tuple(conditions), differences=tuple(differences), rows=rows)
    assert {"walking_forces_1", "walking_forces_2", "walking_others_1"} <= set(
        Shown(walking_chapter(batch, arrays)).alts
    )


# Energy.


def test_energy_says_what_is_stored_where_and_that_nobody_measured_it(saved):
    table, arrays = saved("energy")
    shown = Shown(energy_chapter(table, arrays))
    for c in table.conditions:
        assert (
            f"{c.means['returned_j']:.1f} J with the fulcrum at {c.fulcrum_mm:g} mm"
            in shown.paragraphs[0]
        )
    assert "SYNTHETIC" in shown.paragraphs[0] and "No energy was measured" in shown.missing[0]
    assert (
        "in every trial at all positions, the softer setting stores and returns more" in shown.words
    )
    assert "With the same motion the opposite holds" in shown.words
    assert len(shown.items) == 3 and all(re.search(r"\d", line) for line in shown.items)
    for row in table.trials:
        limb, *others = row.terms_j.values()
        assert limb == row.terms_j["limb_work_j"] == pytest.approx(sum(others), abs=1e-9)


def test_one_setting_no_other_position_and_no_stance_have_a_chapter(saved):
    table, arrays = saved("energy")
    unknown = Softer(
        recorded=None, same_load=None, same_load_against=(), same_motion=None, both=None
    )
    one = replace(
        table,
        trials=table.trials[:1],
        conditions=table.conditions[:1],
        same_load=(),
        same_motion=(),
        softer={"stored_j": unknown, "returned_j": unknown},
    )
    own = {
        "percent": arrays["percent"],
        **{key: arrays[key][:1] for key in ("terms_j", "pylon_power_w", "shank_power_w")},
    }
    shown = Shown(energy_chapter(one, own))
    assert (
        "there are not two settings to compare" in shown.words
        and len(shown.figures["energy_position"].axes) == 1
    )
    shown = Shown(
        energy_chapter(replace(one, trials=(), conditions=()), {"percent": arrays["percent"]})
    )
    assert "no energy can be given" in shown.paragraphs[0] and not shown.alts and not shown.grids


# Rolling over.


def test_rolling_over_gives_the_numbers_of_the_table_and_shouts_what_is_not_followed(saved):
    table, arrays = saved("roll_over")
    shown = Shown(roll_over_chapter(table, arrays))
    for condition in table.conditions:
        model = condition.model["radius_m"].mean
        off = 100.0 * (model / condition.measured["radius_m"].mean - 1.0)
        assert re.search(rf"{1e3 * model:.0f} mm \(plate \d+, {off:+.0f} %\)", shown.paragraphs[0])
    assert "the model misses the plate's roll-over radius by up to" in shown.paragraphs[0], (
        "a miss is called one"
    )
    assert (
        "Without the first 10 % of stance, when the foot lands on its heel," in shown.paragraphs[1]
    )
    assert "no load level of the standard" in shown.words and "SYNTHETIC" in shown.paragraphs[0]
    positions = (replace(table.iso.positions[0], follows=False), *table.iso.positions[1:])
    iso = replace(table.iso, force_n=1000.0, force_from="given", follows=False, positions=positions)
    shown = Shown(roll_over_chapter(replace(table, iso=iso), arrays))
    assert "1000 N, as given" in shown.words and "no load level" not in shown.words
    assert "DOES NOT FOLLOW" in shown.words
    assert "NO" in [row["follows"] for row in shown.grids["iso_22675_profile"].rows]


def test_without_walks_profile_inclined_loading_or_a_measured_path_the_rest_is_shown(saved):
    table, arrays = saved("roll_over")
    for part in (
        {"walks": (), "conditions": ()},
        {"iso": replace(table.iso, positions=())},
        {"inclined": ()},
    ):
        shown = assert_sound(roll_over_chapter, replace(table, **part), arrays)
        assert len(shown.alts) == (2 if part.get("walks") == () else 3) and len(shown.missing) == 1
    walk, condition = table.walks[0], table.conditions[0]
    blind = replace(walk, measured=replace(walk.measured, **dict.fromkeys(vars(walk.measured))))
    none = dict.fromkeys(condition.measured, Spread(None, None, 0))
    arrays |= {f"walk_0_measured_{axis}_m": np.full(101, np.nan) for axis in ("forward", "up")}
    one = replace(table, walks=(blind,), conditions=(replace(condition, measured=none),))
    shown = assert_sound(roll_over_chapter, one, arrays)
    assert "plate unknown" in shown.alts["roll_over_shapes"] and len(shown.alts) == 4


# Settings.


def test_marks_right_of_one_are_the_outcomes_in_which_the_ends_are_distinguishable(saved):
    table, arrays = saved("settings")
    shown = Shown(settings_chapter(table, arrays))
    said = " ".join(shown.items)
    assert f"seed {table.seed}" in said and f"{table.draws} sessions" in said and "1.2°" in said
    assert (
        "SYNTHETIC" in shown.figures["settings_apart"].get_suptitle()
        and "10, 13 and 14 % BW" in shown.words
    )
    ends = [row for row in table.pairs if (row.from_mm, row.to_mm) == (66.0, 151.0)]
    marks = [
        line
        for line in shown.figures["settings_apart"].axes[0].get_lines()
        if line.get_marker() == "o"
    ]
    apart = [abs(row.effect) > row.limits["limit_same_recording"] for row in ends]
    assert [mark.get_xdata()[0] > 1.0 for mark in marks] == apart
    plates = {row.name for row in table.outcomes if row.limits["sdd_same_recording"] is not None}
    told = sum(apart[i] for i, row in enumerate(ends) if row.outcome in plates)
    assert f"distinguishable in {told} of {len(plates)} outcomes" in shown.paragraphs[0]
    pairs = shown.grids["settings_pairs"].rows
    assert sum(int(row["same_session"].split()[0]) for row in pairs) == sum(
        abs(row.effect) > row.limits["limit_same_session"] for row in table.pairs
    )


def test_settings_without_model_error_or_without_any_walk_have_a_chapter(saved):
    table, arrays = saved("settings")
    outcomes = tuple(
        replace(
            row,
            model_error_sd=None,
            limits={
                key: None if key.startswith(("sdd", "smallest")) else value
                for key, value in row.limits.items()
            },
        )
        for row in table.outcomes
    )
    shown = assert_sound(settings_chapter, replace(table, outcomes=outcomes, as_walked=()), arrays)
    assert "by kinematic noise alone" in shown.paragraphs[0]
    assert len(shown.alts) == 2 and "As the settings were walked" not in shown.html
    empty = SettingsTable(answer="No walk of this study can tell.")
    shown = Shown(settings_chapter(empty, {}))
    assert shown.paragraphs == [empty.answer] and shown.missing


@pytest.mark.parametrize(
    ("first", "second", "told", "said"),
    [(2.0, -2.0, False, True), (2.0, -2.9, True, False), (-2.0, 2.0, False, False)],
)
def test_energy_cannot_tell_the_ends_apart_only_if_it_does_not_and_rises_in_between(
    first, second, told, said
):
    def pair(low, high, effect, apart):
        return PairRow(
            outcome="energy_stored_j",
            from_mm=low,
            to_mm=high,
            effect=effect,
            limits={"limit_same_recording": abs(effect) + (-0.1 if apart else 0.1)},
        )

    ends = pair(66.0, 151.0, first + second, told)
    found = poor_judge([pair(66.0, 108.0, first, True), pair(108.0, 151.0, second, True), ends])
    assert found == (ends if said else None)


# Sensitivity, of a made table of the long form: the i-th factor's mu* is (18 - i) thousandths.

GROUPS = ("kinematics", "geometry", "bushing", "contact", "friction", "keel")
NAMES = [f"{group} {n}" for group in GROUPS for n in (1, 2, 3)]


def indices(names):
    return tuple(
        Index(name=name, s1=0.3, s1_conf=0.2 if i else 0.05, st=0.5 - 0.02 * i, st_conf=0.1)
        for i, name in enumerate(names)
    )


ROW = OutputRow(
    baseline=0.03,
    baseline_indexed=0.04,
    p05=0.04,
    p50=0.05,
    p95=0.07,
    stability=0.91,
    interaction=0.2,
    interaction_conf=0.1,
    dropped=0,
    sobol=indices(GROUPS),
    morris=tuple(
        Effect(
            name=name, mu=-0.5e-3 * (18 - i), mu_star=1e-3 * (18 - i), mu_star_conf=1e-3, sigma=2e-3
        )
        for i, name in enumerate(NAMES)
    ),
)
TABLE = SensitivityTable(
    factors=tuple(
        FactorRange(name=name, group=name.split()[0], unit="mm", low=-1.0, high=1.0, why="a choice")
        for name in NAMES
    ),
    conditions=tuple(
        WalkedCondition(label=f"walk_{x:g}", fulcrum_mm=x, role="held out") for x in (66.0, 108.0)
    ),
    indexed=1,
    walks=1000,
    unconverged=0,
    trajectories=16,
    failed=3,
    first_failure="point 4: the run diverges",
    blocks=256,
    seed=0,
    synthetic=True,
    outputs=dict.fromkeys(OUTPUTS, ROW) | {"grf_rmse_bw": replace(ROW, dropped=3)},
)


def test_sensitivity_names_the_strongest_factors_counts_wide_intervals_and_quotes_a_failure():
    own = TABLE.outputs["grf_rmse_bw"]
    rows = own.sobol
    wide = replace(
        TABLE,
        outputs=TABLE.outputs
        | {
            "grf_rmse_bw": replace(own, sobol=(*rows[:2], replace(rows[2], st_conf=0.3), *rows[3:]))
        },
    )
    shown = assert_sound(sensitivity_chapter, wide, {})
    assert (
        list(shown.alts) == ["sensitivity_screening", "sensitivity_indices"]
        and len(shown.grids) == 4
    )
    assert (
        "kinematics 1 1.8 ± 0.1, kinematics 2 1.7 ± 0.1" in shown.words
        and "SYNTHETIC walk_66" in shown.words
    )
    assert f"{3 * 5} of {3 * 6} first-order indices" in shown.words  # of each output 5 of 6 groups
    assert f"total index of {rows[2].name} (resultant GRF error)" in shown.words
    assert "3 failed" in shown.words and "the run diverges" in shown.words
    assert "3 for the resultant GRF error" in shown.words
    axes = screening_figure(TABLE).axes[0]
    assert [tick.get_text() for tick in axes.get_yticklabels()] == NAMES[:MOST]
    assert axes.get_ylim()[0] > axes.get_ylim()[1] and axes.patches[0].get_width() == pytest.approx(
        1.8
    )
    for axes in (*screening_figure(TABLE).axes, *indices_figure(TABLE).axes):
        assert axes.get_xlabel().endswith(")") and axes.get_title(loc="left")


def test_without_a_centre_of_pressure_or_any_effects_the_rest_of_the_sensitivity_is_shown():
    gone = OutputRow(**dict.fromkeys(vars(ROW)) | {"dropped": 0})
    blind = replace(
        TABLE, outputs=TABLE.outputs | dict.fromkeys(("cop_rmse_fl", "cop_shift_mm"), gone)
    )
    shown = assert_sound(sensitivity_chapter, blind, {})
    assert "CoP error" not in shown.alts["sensitivity_screening"]
    assert len(screening_figure(blind).axes) == len(MAIN) - 1
    none = replace(TABLE, outputs=dict.fromkeys(OUTPUTS, gone))
    shown = Shown(sensitivity_chapter(none, {}))
    assert shown.missing and not shown.alts
