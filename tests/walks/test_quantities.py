"""One table says what each number of a compared walk is; pages, CSV and print take it there."""

from __future__ import annotations

import dataclasses
import typing

import pytest
from made_fit import made_trial
from made_results import make_plate, make_walk

from vsf_drake.base.errors import InputError
from vsf_drake.report.fit_output import trial_cells
from vsf_drake.report.page import column, shown
from vsf_drake.walks.metrics import WalkMetrics, walk_metrics
from vsf_drake.walks.quantities import QUANTITIES, quantity
from vsf_drake.walks.sweep_table import SCORES, sweep_table

ERROR = "grf_rmse_bw"


def test_every_number_of_a_compared_walk_has_unit_format_label_and_meaning():
    hints = typing.get_type_hints(WalkMetrics)
    for field in dataclasses.fields(WalkMetrics):
        own = QUANTITIES[field.name]
        assert own.label and own.meaning, field.name
        is_number = hints[field.name] in (int, int | None, float, float | None)
        assert is_number == bool(own.form) == bool(own.unit), field.name


@pytest.mark.parametrize(("name", "own"), QUANTITIES.items())
def test_a_shown_number_says_its_unit_and_a_share_is_a_hundredth(name, own):
    """The suffix of a name is the unit in which the number is kept."""
    if not own.form:
        return
    kept = name.removesuffix("_error").rpartition("_")[2]
    scales = {"bw": {1.0: "BW", 100.0: "% BW"}, "fl": {100.0: "% FL"}, "s": {1.0: "s", 1e3: "ms"}}
    if kept in scales:
        assert scales[kept][own.scale] == own.shown
    assert own.told(None) == "unknown" and own.form.format(0.5)


@pytest.fixture
def other_words(monkeypatch):
    """A table in which the error that judges is told as it is kept."""
    own = dataclasses.replace(
        QUANTITIES[ERROR], meaning="told anew", form="{:.4f}", shown="BW", scale=1.0
    )
    monkeypatch.setitem(QUANTITIES, ERROR, own)
    return own


def test_pages_and_csv_show_a_number_as_the_table_says(other_words):
    assert column(ERROR) == (ERROR, "GRF (BW)", "{:.4f}", 1.0)
    assert shown({f"{ERROR}_worst": 0.0234}, f"{ERROR}_worst") == "0.0234"
    assert "0.0200" in trial_cells(made_trial())
    table, _ = sweep_table([], {}, variables={}, fulcrum=True, plan={}, fits={})
    assert table.columns[ERROR] == {"unit": "body weights", "meaning": "told anew"}
    assert {name: table.columns[name] for name in SCORES} == {
        name: {"unit": quantity(name).unit, "meaning": quantity(name).meaning} for name in SCORES
    }


def test_a_name_with_its_layer_or_its_worst_is_the_same_quantity():
    for name in (f"{ERROR}_worst", f"momentum_{ERROR}"):
        assert quantity(name) is QUANTITIES[ERROR]
    with pytest.raises(KeyError):
        quantity("no_such_number")


def test_printed_metrics_are_a_short_table():
    metrics = walk_metrics(make_walk(), make_plate())
    lines = str(metrics).splitlines()
    assert len(lines) < 40 and max(map(len, lines)) < 50
    [line] = [line for line in lines if line.startswith("GRF ")]
    assert line.split() == ["GRF", "(%", "BW)", f"{100.0 * metrics.grf_rmse_bw:.1f}"]
    assert not any("null model" in line for line in lines), "unknown without another walk"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ((None, make_plate()), "takes no NoneType"),
        ((None, None), "takes no NoneType"),
        ((make_walk(), make_walk()), "trial's plate"),
    ],
)
def test_metrics_of_something_else_say_what_they_want(given, said):
    with pytest.raises(InputError, match=f"walk_metrics.*{said}"):
        walk_metrics(*given)
