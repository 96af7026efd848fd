"""What a contact fit leaves on disk: the contact, its table, curves, figures and page. All of it or
nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from vsf_drake.base.errors import InputError
from vsf_drake.base.sentences import say
from vsf_drake.fit.assessment import FITTED, HELD_OUT
from vsf_drake.fit.parameters import REFERENCE_DEPTH_M
from vsf_drake.fit.solution import ParameterRow
from vsf_drake.fit.table import FitTable, FitTrialRow, fit_arrays, fit_json
from vsf_drake.model.contact_file import FittedContact, save_contact
from vsf_drake.report.fit_figures import fit_figures, is_smooth, trial_name
from vsf_drake.report.page import UNKNOWN, Chapter, number, render, shown
from vsf_drake.report.results_folder import APPENDIX, CHAPTERS, PAGE, ResultsFolder
from vsf_drake.simulation.archive import remove_result
from vsf_drake.walks.null_model import several_settings
from vsf_drake.walks.quantities import (
    FLOOR,
    JUDGED,
    NULL,
    STRETCHED,
    quantity,
)

CONTACT = "contact.yaml"
CHECKPOINT = "checkpoint.json"
FIT = ResultsFolder(
    layered=True,
    kind="fit",
    command="fit",
    table="fit.json",
    arrays="fit.npz",
    known=lambda table: table.get("kind") == "fit",
    damaged_too=False,
    names=(CONTACT, PAGE, APPENDIX, CHECKPOINT, *CHAPTERS),
    stale=(CONTACT, *CHAPTERS),
    unfinished=lambda out: (out / CHECKPOINT).exists(),
)
_SHOWN = {
    "m": ("mm", 1e3),
    "s": ("ms", 1e3),
    "rad": ("°", 180.0 / math.pi),
    "N/m": ("N/mm", 1e-3),
    "Pa": ("GPa", 1e-9),
    "1": ("", 1.0),
}
PLACE = "fulcrum mm"
_FIRST = ("trial", "role", PLACE)
_SCORES = (
    JUDGED,
    "grf_r2",
    "fore_aft_rmse_bw",
    "cop_rmse_fl",
    "cop_ml_rmse_fl",
    "impulse_rmse_bws",
    "stance_error_s",
    NULL,
    STRETCHED,
    FLOOR,
    "sweep_best_mm",
)


def _headings(names: Sequence[str]) -> list[str]:
    return [f"{own.label} {own.shown}".rstrip() for own in map(quantity, names)]


HEADINGS = (*_FIRST, *_headings(_SCORES), "right")
"""Of the cells of `trial_cells`, each with its unit; under PLACE a passive foot's name."""


def clear_fit(out: Path, *, checkpoint: bool = True) -> None:
    """Removes what an earlier fit left in `out`, its checkpoint too unless told otherwise; files of
    others stay."""
    try:
        remove_result(out, FIT.kind, (CONTACT,), stale=FIT.stale)
        if checkpoint:
            (out / CHECKPOINT).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror})", file=out) from None


def write_fit(table: FitTable, out: Path, *, contact: FittedContact | None = None) -> None:
    """Writes everything of a fit to `out`; what an earlier fit left there goes, and so does the
    checkpoint, unless the fit did not converge: from there it can go on.

    Args:
        contact: what was fitted; not for a fit that failed.

    Raises:
        InputError: `out` cannot be written. ValueError: a contact is given with the table of a fit
            that failed.
    """
    if contact is not None and not table.success:
        raise ValueError("a fit that failed leaves no contact")
    arrays = fit_arrays(table)

    def more(folder: Path, told: dict[str, Any]) -> None:
        files, _ = FIT.write_page(folder, fit_page(table), svg=True)
        if contact is not None:
            save_contact(contact, folder / CONTACT)
        others = (FIT.table, *([FIT.arrays] if arrays else []), *([CONTACT] if contact else []))
        told["files"] = sorted((*others, *(path.as_posix() for path in files)))

    FIT.write(out, fit_json(table), arrays or None, more=more)
    if table.success or not table.parameters:
        (out / CHECKPOINT).unlink(missing_ok=True)


# The page, and numbers of the table as text: in the units that people use.


def fit_page(table: FitTable) -> dict[str, Any]:
    """What `page.chapter_page` is to be given of a fit."""
    judged = [trial for trial in table.trials if trial.score is not None]
    columns = told_columns(judged) if judged else [0, 1, 2]
    kind = "Contact fit" if table.strategy == "joint" else "Contact fit by the paper's procedure"
    title = f"{kind}, {table.subject.name}{' (SYNTHETIC)' if table.synthetic else ''}"
    own = own_parameters(table)
    passive = table.trials[0].fulcrum_mm is None  # all are on one foot
    place = "foot" if passive else PLACE
    synthetic = synthetic_of(table)
    figures = fit_figures(table)
    curves = {trial_name(i, trial): trial.role for i, trial in enumerate(table.trials)}
    drawn = [name for name in curves if name in figures]
    facts = {
        "fit": table,
        "figures": figures,
        "passive": passive,
        "place": place,
        "trial_headings": [place if HEADINGS[i] == PLACE else HEADINGS[i] for i in columns],
        "trial_rows": [
            [trial_cells(trial)[i] for i in columns] for trial in judged or table.trials
        ],
        "one_setting": not several_settings(
            1e-3 * trial.fulcrum_mm
            for trial in table.trials
            if trial.role == FITTED and trial.fulcrum_mm is not None
        ),
        "heading": lambda name: _headings([name])[0],
        "curves": drawn,
        "shown_curve": min(drawn, key=lambda name: curves[name] != HELD_OUT, default=None),
        "own": own,
        "rest": [row for row in table.parameters if not row.frozen and row not in own],
        "reference_depth_mm": 1e3 * REFERENCE_DEPTH_M,
        "infinity": math.inf,
        "degrees": math.degrees,
        "why_not": lambda reason: say("not_corrected", "words", why_not=reason)[0],
        "shown_value": shown_value,
        "shown_unit": shown_unit,
        "shown_interval": shown_interval,
    }
    bench = table.bench is not None and table.bench.stiffness is not None
    searched = table.searches or (table.paper is not None and table.paper.history)
    chapters = (
        ("story", "", True),
        ("verdict", "The verdict in full", table.headline),
        ("trials", "Trials", True),
        ("layers", "Prediction in three layers", table.layers),
        ("angle_errors", "With errors of hip and knee", table.angle_errors),
        ("sweep", "Error over the position of the fulcrum", "sweep" in figures),
        ("curves", "Force and centre of pressure of every trial", drawn),
        ("bench", "Bench", bench),
        ("parameters", "Parameters", table.parameters),
        ("uncertainty", "What the data determine", table.uncertainty),
        ("left_out", "Fits without each trial in turn", table.left_out),
        ("searches", "Searches", searched),
        ("made", "How it was made", True),
    )
    return {
        "title": title if table.success else f"FAILED: {title[0].lower()}{title[1:]}",
        "chapters": [
            Chapter(
                name=name,
                title=heading,
                template=f"fit/{name}.html.j2",
                facts=facts,
                figures=figures,
            )
            for name, heading, told in chapters
            if told
        ],
        "synthetic": bool(synthetic),
        "alarm": "" if table.success else render("fit/failed.txt.j2", fit=table),
        "first_line": render("fit/first_line.txt.j2", synthetic=synthetic, bench=table.bench),
    }


def shown_unit(row: ParameterRow) -> str:
    """In which a parameter is shown."""
    return _SHOWN.get(row.unit, (row.unit, 1.0))[0]


def shown_value(row: ParameterRow, value: float | None) -> str:
    """A number of a parameter in `shown_unit`."""
    return number(value, "{:.3g}", _SHOWN.get(row.unit, ("", 1.0))[1])


def shown_interval(row: ParameterRow) -> str:
    """Its 95 % interval in `shown_unit`."""
    return (
        UNKNOWN
        if row.interval_95 is None
        else " to ".join(shown_value(row, end) for end in row.interval_95)
    )


def own_parameters(table: FitTable) -> list[ParameterRow]:
    """The fitted parameters of foot and person: without those of curves and of single trials."""
    return [
        row
        for row in table.parameters
        if not row.frozen and not is_smooth(row.name) and not row.name.startswith("trial.")
    ]


def synthetic_of(table: FitTable) -> list[str]:
    """What of a fit's data nobody measured."""
    names = [trial.label for trial in table.trials if trial.synthetic]
    return [*names, *(["the bench"] if table.bench is not None and table.bench.synthetic else [])]


def trial_cells(trial: FitTrialRow) -> tuple[str, ...]:
    """One trial of a fit as text; of one that was not judged, what it is."""
    score = trial.score
    if score is None:
        return trial.label, trial.role, trial.setting_cell
    right = UNKNOWN if score.sweep is None else "yes" if score.sweep.right else "NO"
    own = "" if score.own_height_m is None else f", own height {1e3 * score.own_height_m:+.1f} mm"
    return (
        trial.label,
        f"{trial.role}{own}".replace(" ", "\u00a0"),
        trial.setting_cell,
        *(shown(score, name) for name in _SCORES),
        right,
    )


def told_columns(trials: Sequence[FitTrialRow]) -> list[int]:
    """Columns of `trial_cells` in which any of those trials that were judged has something to
    tell."""
    cells = [trial_cells(trial) for trial in trials if trial.score is not None]
    return [i for i, column in enumerate(zip(*cells, strict=True)) if {*column} != {UNKNOWN}]
