"""What a tuning leaves on disk and says: numbers against those of made-up parabolas."""

from __future__ import annotations

import csv
import dataclasses
import json
import re
import shutil

import numpy as np
import pytest
from browser import chromium, look
from command_line import read_json
from made_tuning import (
    BEST_MM,
    cost_of,
    failed_table,
    made_arrays,
    made_stride_arrays,
    made_stride_table,
    made_table,
    small_table,
)
from page_layers import both_layers
from page_reader import Balanced
from readable import assert_readable

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import plain
from vsf_drake.report.page import _PAGES, chapter_page
from vsf_drake.report.tuning.chapters import TUNING, answer, first_line, tuning_page, write_tuning
from vsf_drake.report.tuning.figures import (
    cost_curve_figure,
    outcomes_figure,
    pareto_figure,
    stance_force_figure,
    terms_figure,
)
from vsf_drake.report.tuning.reading import root_mean_squares
from vsf_drake.tuning import quantities
from vsf_drake.tuning.table import SweepPoint, Term, tuning_of

HARDLY = "THE SETTING HARDLY MATTERS"
MADE = {
    "level_1": (made_table, made_arrays),
    "level_2": (made_stride_table, made_stride_arrays),
    "failed": (failed_table, dict),
}


def shown_page(**content):
    """Of one layer."""
    return chapter_page(**content)[0][0]


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A folder of tunings of level 1."""
    home = tmp_path_factory.mktemp("tunings")
    for kind in ("level_1", "failed"):
        write_tuning(home / kind, *(make() for make in MADE[kind]))
    return home


def files(folder):
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def body(folder):
    return re.sub("<!doctype.*?<body>", "", both_layers(folder), flags=re.DOTALL).lstrip()


def rows(path):
    with path.open(encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def test_everything_is_written_and_read_back_in_every_digit(folders):
    assert {
        "figures/cost.png",
        "figures/outcomes.png",
        "figures/force.png",
        "figures/pareto.png",
        "figures/robustness.png",
        "tables/sweep.csv",
        "tables/outcomes.csv",
        "tables/checks.csv",
        "tables/confirmed_by.csv",
    } <= set(files(folders / "level_1"))
    stride = tuning_page(plain(made_stride_table()), made_stride_arrays(), lenient=False)[
        "chapters"
    ]
    shown = {name for chapter in stride for name in chapter.figures}
    assert {"motion", "torque", "stride_force"} <= shown and "force" not in shown, (
        "of a stride, both feet are shown"
    )
    for kind, (table, arrays) in (pair for pair in MADE.items() if pair[0] != "level_2"):
        saved, read = TUNING.read(folders / kind)
        assert tuning_of(saved) == table()
        assert list(plain(table())) == [key for key in saved if key != "arrays_sha256"]
        assert {name: values.tolist() for name, values in read.items()} == {
            name: values.tolist() for name, values in arrays().items()
        }
    sweep = rows(folders / "level_1" / "tables" / "sweep.csv")
    assert [(float(row["cost"]), float(row["term_knee"])) for row in sweep] == [
        (point.cost, point.terms["knee"]) for point in made_table().sweep
    ]


def test_the_report_made_again_is_the_same_to_the_byte_and_its_tags_close(run, folders, tmp_path):
    for kind in ("level_1", "failed"):
        reader = Balanced()
        reader.feed((folders / kind / "report.html").read_text(encoding="utf-8").partition("\n")[2])
        assert reader.open == []
        shutil.copytree(folders / kind, tmp_path / kind)
        for path in [*(tmp_path / kind).glob("*.html"), *(tmp_path / kind).glob("[ft]*/*")]:
            path.unlink()
        assert run("report", tmp_path / kind)[::2] == (0, "")
        assert files(tmp_path / kind) == files(folders / kind)


@pytest.mark.parametrize("kind", ["level_1", "level_2", "not optimal"])
def test_every_figure_can_be_read_on_a_telephone(kind):
    tables = {
        "level_1": made_table(),
        "level_2": made_stride_table(),
        "not optimal": made_table(optimal=False),
    }
    arrays = made_stride_arrays() if kind == "level_2" else made_arrays()
    chapters = tuning_page(plain(tables[kind]), arrays, lenient=False)["chapters"]
    figures = {name: figure for chapter in chapters for name, figure in chapter.figures.items()}
    assert len(figures) == {"level_1": 6, "level_2": 8, "not optimal": 6}[kind]
    for name, figure in figures.items():
        assert_readable(figure, name)


LABELS = {
    1: (
        quantities.GIVEN_OUTCOMES | quantities.SAME_LOAD,
        quantities.GIVEN_TERMS,
        quantities.GIVEN_COSTS,
    ),
    2: (quantities.FREE_OUTCOMES, quantities.FREE_TERMS, quantities.FREE_TERMS),
}
"""Of a level: outcomes with their units, terms, and costs."""


@pytest.mark.parametrize("level", [1, 2])
def test_every_label_that_there_is_fits_its_figure(level):
    """Titles of all outcomes, the longest names of terms and costs, and trials with long names."""
    kinds, terms, costs = LABELS[level]
    terms, costs = ({name: own.label for name, own in each.items()} for each in (terms, costs))
    like, first = made_table().outcomes[0], made_table().sweep[0]
    outcomes = tuple(
        dataclasses.replace(like, name=name, label=label, unit=unit, matters=False)
        for name, (label, unit) in kinds.items()
    )
    sweep = tuple(
        dataclasses.replace(
            row,
            terms={name: row.cost for name in (*list(terms)[:5], "consistency")},
            outcomes={name: row.cost - first.cost for name in kinds},
        )
        for row in made_table().sweep
    )
    table = made_table(
        level=level, outcomes=outcomes, sweep=sweep, trials=("person_B_day_2_fast_0123456789_WALK",)
    )
    assert_readable(outcomes_figure(table), "outcomes")
    longest = sorted(terms, key=lambda name: len(terms[name]))[-4:]
    rows = tuple(dataclasses.replace(row, terms=dict.fromkeys(longest, row.cost)) for row in sweep)
    assert_readable(
        terms_figure(
            dataclasses.replace(
                table,
                sweep=rows,
                terms=tuple(Term(name, f"0.33 × {terms[name]} / 0.0123", 1.0) for name in longest),
            )
        ),
        "terms",
    )
    held = dataclasses.replace(
        table,
        cost_label=max(costs.values(), key=len),
        terms=(Term("consistency", "the hold", 1.0),),
    )
    assert_readable(cost_curve_figure(held, {}), "cost")
    if level == 1:
        assert_readable(stance_force_figure(table, made_arrays()), "force")
        assert_readable(
            pareto_figure(dataclasses.replace(table, pareto_names=("tracking", "push_off"))),
            "pareto",
        )


@pytest.mark.slow
@pytest.mark.skipif(
    chromium() is None, reason="there is no Chromium (Debian: apt-get install chromium)"
)
def test_page_reads_on_a_desk_and_on_a_telephone(folders, tmp_path):
    for width in (1280, 390):
        (tmp_path / str(width)).mkdir()
        images = 0
        for name in ("report.html", "appendix.html"):
            work = tmp_path / str(width) / name
            work.mkdir()
            seen = look(folders / "level_1" / name, work, width=width)
            assert (seen.console, seen.requests, seen.out) == ([], [], [])
            assert (seen.broken, seen.unnamed) == (0, 0)
            assert seen.scroll <= width and 100 < seen.words <= 600
            images += seen.images
        assert images == 6


def test_what_is_no_optimum_is_marked_above_everything_and_recommends_nothing(folders):
    page = body(folders / "failed")
    assert (
        '<p class="alarm" role="alert">NOT OPTIMAL: the iteration limit was reached.'
        in page.partition("<h1>")[0]
    )
    assert (
        "<h1>NOT OPTIMAL: stiffness tuned: load of the intact knee</h1>" in page
        and "has the least" not in page
    )
    assert "alarm" not in body(folders / "level_1")
    for table in (
        failed_table(),
        failed_table(fulcrum_mm=None, cost=None),
        made_table(optimal=False),
    ):
        words = " ".join(answer(table))
        assert "least" not in words and "less than" not in words
    stopped = made_table(optimal=False, pareto=(), robustness=())
    page = shown_page(**tuning_page(plain(stopped), {}, lenient=False))
    assert "NOT OPTIMAL: the last iterate is at 104.2 mm" in page, (
        "the alternative text of the figure"
    )
    assert "The optimum is at" not in page and ">optimum</th>" not in page
    figure = cost_curve_figure(made_table(optimal=False), {})
    labels = [str(line.get_label()) for line in figure.axes[0].get_lines()]
    assert "last iterate, NOT OPTIMAL" in labels and not any(
        name.startswith("optimum") for name in labels
    )


def test_another_tuning_in_the_same_folder_leaves_nothing_of_the_first(tmp_path):
    out = tmp_path / "out"
    write_tuning(out, small_table(), {})
    (out / "figures" / "notes.txt").write_text("mine", encoding="utf-8")
    write_tuning(out, failed_table(wall_s=float("nan")), {})
    assert {path.name for path in (out / "figures").iterdir()} == {"notes.txt"}
    assert not (out / "tables" / "sweep.csv").exists()
    assert read_json(out / "tuning.json")["wall_s"] is None


def test_damaged_results_are_refused_with_file_and_reason_or_shown_as_far_as_they_go(tmp_path):
    out = tmp_path / "out"
    write_tuning(out, small_table(), {})
    table, path = read_json(out / "tuning.json"), out / "tuning.json"
    for change in ({"level": 3}, {"format": "vsf_drake tuning 1"}, {"fulcrum_mm": None}):
        with pytest.raises(ValueError, match=r"level|format|optimum"):
            made_table(**change)
    path.write_text(json.dumps(table | {"checks": [{"label": "fine sweep"}]}), encoding="utf-8")
    assert any(sentence.startswith("Checks") for sentence in TUNING.remake(out))
    assert (
        "This version cannot show what the results hold of it (ValueError: checks[0].name is "
        "missing"
    ) in body(out)
    assert "has the least" in body(out)
    for name, text, words in (
        ("tuning.json", "{", "cannot be read as JSON"),
        ("tuning.json", '{"format": "fit"}', "not the table of"),
        ("tuning.json", '{"format": "vsf_drake tuning 2"}', "level is missing"),
        ("tuning.json", json.dumps(table), ""),
        ("tuning.npz", "other", "SHA-256"),
    ):
        (out / name).write_text(text, encoding="utf-8")
        if words:
            with pytest.raises(InputError, match=words) as raised:
                TUNING.remake(out)
            assert name in str(raised.value)
    path.unlink()
    with pytest.raises(InputError, match="vsf-drake tune --out"):
        TUNING.remake(out)


def test_a_folder_of_something_else_is_not_written_to(tmp_path):
    TUNING.check(tmp_path / "new")
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="other things than an earlier tuning"):
        TUNING.check(tmp_path)
    with pytest.raises(InputError, match="is a file"):
        TUNING.check(tmp_path / "thesis.txt")


# What is said of a tuning.


def matters(value, start=0):
    """The outcomes of the made-up table, all of which matter or not."""
    return tuple(dataclasses.replace(row, matters=value) for row in made_table().outcomes[start:])


def said(**changes):
    return " ".join(answer(made_table(**changes)))


def test_setting_interval_and_savings_are_those_of_the_parabola():
    """2e-4 (66 - 104.2)² = 0.292 on 2: 12.7 % less than at the softest; 18.0 % less than at the
    stiffest."""
    soft, stiff = (100.0 * (1.0 - 2.0 / cost_of(mm)) for mm in (66.0, 151.0))
    words = said()
    assert (
        first_line(made_table())[0]
        == "Data are SYNTHETIC, not recorded: low_2, medium_2 and high_2."
    )
    assert first_line(made_stride_table(synthetic=False))[0] == "Recorded trials: medium_2."
    assert words.startswith(
        "Of all settings between 66 and 151 mm, the fulcrum at 104.2 mm has the least cost: 2 BW "
        "(load of the intact knee). Its interval is 98 to 111 mm: cost within its uncertainty."
    )
    assert f"{soft:.1f} % less than at the softest setting (66 mm, also recorded)" in words
    assert f"{stiff:.1f} % less than at the stiffest (151 mm, also recorded)" in words
    assert "another recorded one (108 mm, within the interval: not told apart)" in words
    assert "% MORE than at the recorded setting (108 mm" in said(recorded_mm=(108.0,), cost=2.5)
    end = said(fulcrum_mm=66.0, cost=float(cost_of(66.0)), at_bound=("fulcrum",))
    apart = "itself; no setting within the interval is told apart from it."
    assert f"It is the softest setting {apart}" in end
    one = (66.0, 66.0)
    alone = said(fulcrum_mm=66.0, cost=float(cost_of(66.0)), fulcrum_interval_mm=one)
    assert "It is the softest setting itself." in alone
    assert end.startswith(
        "THE RANGE DECIDES, not the cost: at the optimum fulcrum is at an end of its range"
    )


def test_level_2_recommends_an_interval_or_says_first_that_the_model_does_not_decide():
    assert answer(made_stride_table(own=True))[0] == (
        "The recommendation is an interval, 98 to 111 mm."
    )
    assert (
        "recommendation" not in " ".join(answer(made_stride_table(at_bound=("fulcrum",)))) + said()
    )
    wide = made_stride_table(
        own=True, undecided="70 to 140 mm, 82 % of the range, are as good as the model can tell."
    )
    assert answer(wide)[0].startswith(
        "THE MODEL DOES NOT DECIDE THIS SETTING: 70 to 140 mm, 82 % of the range"
    )
    page = shown_page(**tuning_page(plain(wide), made_stride_arrays(), lenient=False))
    assert "Set no foot by this" in page


def test_a_stride_that_is_not_the_person_s_is_no_answer():
    """No interval, no gain and no setting to record next: first that nothing follows."""
    why = "not to be believed: the stride is 11.6 % BW off the person's own force (limit 6 %)."
    table = made_stride_table(own=True, believed=False, undecided=why, at_bound=("fulcrum",))
    assert answer(table) == [
        f"THE MODEL DOES NOT DECIDE THIS SETTING: {why}",
        "The strides computed are of another walk than this person's. Their cost is least at "
        f"{BEST_MM:.1f} mm: this is no setting to choose.",
    ]
    drawn = cost_curve_figure(table, made_stride_arrays())
    labels = drawn.axes[0].get_legend_handles_labels()[1]
    assert "least cost, NOT TO BE BELIEVED" in labels
    assert "its interval" not in labels and not any("optimum" in label for label in labels)
    page = shown_page(**tuning_page(plain(table), made_stride_arrays(), lenient=False))
    assert "<h1>NOT TO BE BELIEVED: stiffness tuned" in page
    assert "Set no foot by this. Tune with more intervals" in page
    assert "Record this person" not in page and "within the interval choose" not in page


def test_of_one_recorded_setting_level_2_says_first_that_the_hold_makes_the_optimum():
    hold = "THE HOLD MAKES THIS OPTIMUM: one recorded setting does not show how the person answers"
    assert answer(made_stride_table())[0].startswith(hold)
    assert hold not in " ".join([*answer(made_stride_table(own=True)), said()])
    assert hold not in " ".join(answer(made_stride_table(cost_name="tracking")))
    page = shown_page(
        **tuning_page(plain(made_stride_table()), made_stride_arrays(), lenient=False)
    )
    assert "walks at two settings or more: then the stride is held to the person" in page


def test_own_strides_before_they_adapt_are_told_and_drawn_beside_the_cost():
    """3 at 66 mm, 4 percent more at 151 mm."""
    table = made_stride_table(own=True)
    points = tuple(
        dataclasses.replace(point, walked=3.0 + 0.12 * (point.fulcrum_mm - 66.0) / 85.0)
        for point in table.sweep
    )
    table = dataclasses.replace(table, sweep=points)
    assert (
        "Walked as recorded, before anything adapts, the cost is least at 66 mm and 4.0 % more at "
        "151 mm."
    ) in answer(table)
    page = shown_page(**tuning_page(plain(table), made_stride_arrays(), lenient=False))
    assert "own strides before they adapt (dash-dotted)" in page


def test_the_spring_alone_stands_beside_the_strides_on_page_and_screen():
    """From 2 at 66 mm to 2.2 at 151 mm, 10 percent more; its activations beside the strides'."""
    table = made_stride_table(own=True)
    name = table.outcomes[-1].name
    points = tuple(
        dataclasses.replace(
            point, equal_load={"cost": 2.0 + 0.2 * (point.fulcrum_mm - 66.0) / 85.0, name: 7.125}
        )
        for point in table.sweep
    )
    table = dataclasses.replace(table, sweep=points)
    said = "Under an equal load the spring alone, to which nobody answers, has its least cost at 66"
    assert f"{said} mm and 10.0 % more at 151 mm." in answer(table)
    page = shown_page(**tuning_page(plain(table), made_stride_arrays(), lenient=False))
    assert "of the spring alone under an equal load (grey dots)" in page
    assert "spring alone, softest" in page and "7.12" in page
    without = shown_page(
        **tuning_page(plain(made_stride_table()), made_stride_arrays(), lenient=False)
    )
    assert "spring alone" not in without


def test_what_only_holds_to_the_recording_is_told_apart_from_the_gain():
    """The whole parabola is such a term but for 1e-3 (mm - 66) BW: without it the softest setting
    is the best."""
    sweep = tuple(
        SweepPoint(
            row.fulcrum_mm,
            row.cost,
            {
                "knee": 1.0 + 1e-3 * (row.fulcrum_mm - 66.0),
                "consistency": row.cost - 1.0 - 1e-3 * (row.fulcrum_mm - 66.0),
            },
        )
        for row in made_table().sweep
    )
    terms = (
        Term("knee", "intact knee", 1.0382),
        Term("consistency", "change of the force", 2.0 - 1.0382),
    )
    held = made_table(sweep=sweep, terms=terms, recorded_mm=())
    words = " ".join(answer(held))
    assert words.startswith(
        "THE DATA DO NOT DECIDE THIS SETTING. Of the settings swept, the cost by itself (load of "
        "the intact knee) is least at 66.0 mm, the "
        "softest setting; at 104.2 mm it is 3.8 % more. What puts the optimum at 104.2 mm is "
        '"change of the force", a '
        "term that holds"
    )
    drawn = {line.get_label() for line in cost_curve_figure(held, {}).axes[0].get_lines()}
    assert {"cost by itself", "its least, 66.0 mm"} < drawn
    assert "12.7 % less than at the softest setting" in words
    assert (
        'Without "change of the force", the part of the cost that only holds to the recording, '
        "it is 3.8 % MORE "
        "than at the softest setting (66 mm) and 4.3 % less than at the stiffest (151 mm)."
    ) in words
    walked = " ".join(
        answer(
            dataclasses.replace(
                held,
                level=2,
                terms=tuple(
                    dataclasses.replace(term, name=term.name.replace("consistency", "normal"))
                    for term in terms
                ),
                sweep=tuple(
                    dataclasses.replace(
                        row,
                        terms={
                            name.replace("consistency", "normal"): value
                            for name, value in row.terms.items()
                        },
                    )
                    for row in sweep
                ),
            )
        )
    )
    assert "a term that holds the walk to able-bodied walking." in walked
    assert "the part of the cost that only holds to able-bodied walking, it is 3.8 % MORE" in walked
    assert "Without" not in said() and "DO NOT DECIDE" not in said()
    # another stride, better by itself than all of the sweep
    less = dataclasses.replace(held, cost=held.cost - 0.1)
    assert (
        held.held_from and less.held_from is None and "DO NOT DECIDE" not in " ".join(answer(less))
    )
    table = made_table()
    assert table.cost_at(73.5) == pytest.approx(float(np.mean(cost_of(np.array([71.0, 76.0]))))), (
        "a straight line"
    )
    assert table.cost_at(60.0) is None and failed_table().cost_at(73.5) is None


def test_a_setting_that_hardly_matters_is_called_so_before_anything_else():
    first = answer(made_table(outcomes=matters(False)))[0]
    assert first.startswith(HARDLY) and "± 0.05 BW" in first and HARDLY not in said()
    cost, push_off, peak = made_table().outcomes
    assert "changes by 0.4374 BW, more than its uncertainty (± 0.05 BW)." in said(
        outcomes=(dataclasses.replace(cost, sentence=""),)
    )
    none = (
        f"{HARDLY}: none of the outcomes changes by more than both its uncertainty and what a "
        "laboratory sees."
    )
    assert none in said(outcomes=matters(False, 1))
    assert "by more than both twice their uncertainty and what a laboratory sees: " in said(level=2)
    assert HARDLY not in said(outcomes=(push_off, peak))
    assert "unknown" in said(outcomes=()), "nothing was compared with an uncertainty"
    assert HARDLY not in said(outcomes=matters(None)), "not known is not no"


def test_figures_draw_the_sweep_the_trials_the_optimum_and_what_hardly_changes():
    [left], [right] = (
        cost_curve_figure(made_table(), made_arrays()).axes,
        terms_figure(made_table()).axes,
    )
    named = {line.get_label(): line for line in left.get_lines()}
    np.testing.assert_allclose(named["cost"].get_ydata(), cost_of(named["cost"].get_xdata()))
    assert named["optimum, 104.2 mm"].get_xdata() == [BEST_MM]
    assert len([line for line in left.get_lines() if line.get_color() == "0.75"]) == 3
    parts = [line for line in right.get_lines() if len(line.get_xdata()) == 18]
    np.testing.assert_allclose(
        sum(line.get_ydata() for line in parts),
        cost_of(parts[0].get_xdata()) - 2.0,
        atol=1e-12,
        err_msg="terms add up",
    )
    np.testing.assert_allclose(root_mean_squares(made_stride_arrays(), "q"), 0.02)
    titles = [
        axes.get_title(loc="left").replace("\n", " ")
        for axes in outcomes_figure(made_table()).axes
        if axes.axison
    ]
    assert titles == [
        "load of the intact knee",
        "push-off work",
        "first peak of the force: hardly changes",
    ]


def test_an_interval_is_told_no_narrower_than_it_is():
    """Around 104.53 mm from there to 106.0: "105 to 106 mm" would leave the optimum out."""
    assert made_table(fulcrum_interval_mm=(104.53, 106.0)).interval_says == "104 to 106 mm"
    assert made_table(fulcrum_interval_mm=(98.0, 111.0)).interval_says == "98 to 111 mm"
    assert "Its interval is 104 to 106 mm" in said(fulcrum_interval_mm=(104.53, 106.0))


def test_settings_within_the_interval_are_not_told_to_cost_more():
    words = said(fulcrum_interval_mm=(60.0, 111.0))
    assert "(66 mm, also recorded, within the interval: not told apart)" in words
    assert "(151 mm, also recorded)" in words


def columns(chapter, name):
    """Headings of a table of the page, by what its columns are called in the CSV file."""
    caught = {}

    def table(stem, rows, shown, caller=None):
        caught[stem] = {column[0]: column[1] for column in shown}
        return ""

    template = _PAGES.get_template(chapter.template)
    template.render({**chapter.facts, "table": table, "figure": lambda *words, **more: ""})
    return caught[name]


def test_the_weight_of_the_front_is_that_of_its_first_cost():
    """The made-up front: at weight 1 the second cost is least, which the made-up columns would give
    away."""
    page = {
        chapter.name: chapter
        for chapter in tuning_page(plain(made_table()), {}, lenient=False)["chapters"]
    }
    headings = columns(page["pareto"], "pareto")
    assert headings["weight"] == "weight of joint load", "of pareto_names the first"
    assert headings["first"] == "load on the prosthetic leg and residual limb (1)"
    assert headings["second"] == "push-off work, with a minus (J/kg)"


def test_no_two_columns_have_one_name_and_the_recorded_setting_is_no_recorded_motion():
    """A cost of level 2 counts over its size: what it adds to the sum is not the outcome of that
    name."""
    name, label = "activation", "squared activations of the muscles"
    terms = (
        Term(name, f"{label} / 0.5", 1.2),
        Term("normal", "deviation from able-bodied walking", 0.8),
    )
    table = made_stride_table(
        cost_name=name,
        cost_label=label,
        cost_unit="1",
        terms=terms,
        sweep=tuple(
            SweepPoint(row.fulcrum_mm, row.cost, {name: 1.2, "normal": row.cost - 1.2}, {name: 0.6})
            for row in made_table().sweep
        ),
        outcomes=(
            dataclasses.replace(made_table().outcomes[1], name=name, label=label, tracked=0.9),
        ),
    )
    page = {
        chapter.name: chapter
        for chapter in tuning_page(plain(table), {}, lenient=False)["chapters"]
    }
    headings = columns(page["range"], "sweep")
    assert len(set(headings.values())) == len(headings)
    assert headings[f"term_{name}"] == f"in the cost: {label} / 0.5" and headings[
        f"outcome_{name}"
    ].startswith(label)
    shown = columns(page["outcomes"], "outcomes")
    assert (shown["recorded"], shown["tracked"]) == ("recorded setting", "recorded motion")
    axis = cost_curve_figure(table, {}).axes[0].get_ylabel().replace("\n", " ")
    assert axis == f"{label}, scaled, plus the hold to able-bodied walking (1)"
    assert axis.removesuffix(" (1)") in " ".join(answer(table))
