"""What a contact fit leaves on disk: the contact, its table, curves, figures and page. All of it or nothing."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from vsf_drake.analysis.contact_fit.assessment import (
    FITTED,
    HELD_OUT,
    NOISE_TOO_SMALL,
    Beside,
    TrialScore,
)
from vsf_drake.analysis.contact_fit.parameters import REFERENCE_DEPTH_M
from vsf_drake.analysis.contact_fit.solution import ParameterRow
from vsf_drake.analysis.contact_fit.table import FitTable, FitTrialRow, fit_arrays, fit_json
from vsf_drake.analysis.prediction import LAYERS, PHYSICS, LayerTable
from vsf_drake.contact_file import FittedContact, save_contact
from vsf_drake.errors import InputError
from vsf_drake.files import write_text
from vsf_drake.report.fit_figures import fit_figures, is_smooth, trial_name
from vsf_drake.report.page import UNKNOWN, number, render, said
from vsf_drake.report.results_folder import PAGE, ResultsFolder
from vsf_drake.report.style import save_figure
from vsf_drake.sentences import say
from vsf_drake.simulation.archive import remove_result

CONTACT, CHECKPOINT = "contact.yaml", "checkpoint.json"
FIT = ResultsFolder(
    kind="fit",
    command="fit",
    table="fit.json",
    arrays="fit.npz",
    known=lambda table: table.get("kind") == "fit",
    damaged_too=False,
    names=(CONTACT, PAGE, CHECKPOINT),
    stale=(CONTACT,),
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
_FIRST = ("trial", "role", "fulcrum mm")
_SCORES: tuple[tuple[str, Callable[[TrialScore], float | None], str, float], ...] = (
    ("GRF % BW", lambda score: score.metrics.grf_rmse_bw, "{:.1f}", 100.0),
    ("R²", lambda score: score.metrics.grf_r2, "{:.3f}", 1.0),
    ("fore-aft % BW", lambda score: score.metrics.fore_aft_rmse_bw, "{:.1f}", 100.0),
    ("CoP % FL", lambda score: score.metrics.cop_rmse_fl, "{:.1f}", 100.0),
    ("CoP lateral % FL", lambda score: score.metrics.cop_ml_rmse_fl, "{:.1f}", 100.0),
    ("impulse BW s", lambda score: score.metrics.impulse_rmse_bws, "{:.3f}", 1.0),
    ("stance error s", lambda score: score.metrics.stance_error_s, "{:+.3f}", 1.0),
    ("null model % BW", lambda score: score.metrics.null_model_grf_rmse_bw, "{:.1f}", 100.0),
    ("floor % BW", lambda score: score.floor_grf_rmse_bw, "{:.1f}", 100.0),
    (
        "sweep: best mm",
        lambda score: None if score.sweep is None else score.sweep.best_mm,
        "{:.0f}",
        1.0,
    ),
)
"""Columns of the table of trials: heading, number, form and factor."""
HEADINGS = (*_FIRST, *(heading for heading, *_ in _SCORES), "right")
"""Of the cells of `trial_cells`, each with its unit."""


def clear_fit(out: Path, *, checkpoint: bool = True) -> None:
    """Removes what an earlier fit left in `out`, its checkpoint too unless told otherwise; files of others stay."""
    try:
        remove_result(out, FIT.kind, (CONTACT,))
        if checkpoint:
            (out / CHECKPOINT).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror})", file=out) from None


def write_fit(table: FitTable, out: Path, *, contact: FittedContact | None = None) -> None:
    """Writes everything of a fit to `out`; what an earlier fit left there goes, and so does the checkpoint,
    unless the fit did not converge: from there it can go on.

    Args:
        contact: what was fitted; not for a fit that failed.

    Raises:
        InputError: `out` cannot be written. ValueError: a contact is given with the table of a fit that failed.
    """
    if contact is not None and not table.success:
        raise ValueError("a fit that failed leaves no contact")
    figures, arrays = fit_figures(table), fit_arrays(table)
    files = [
        FIT.table,
        PAGE,
        *(f"{name}{suffix}" for name in figures for suffix in (".png", ".svg")),
        *([FIT.arrays] if arrays else []),
        *([CONTACT] if contact is not None else []),
    ]

    def more(folder: Path, _: object) -> None:
        write_text(folder / PAGE, fit_page(table, figures))
        for name, figure in figures.items():
            save_figure(figure, folder / name)
        if contact is not None:
            save_contact(contact, folder / CONTACT)

    FIT.write(out, {**fit_json(table), "files": sorted(files)}, arrays or None, more=more)
    if table.success or not table.parameters:
        (out / CHECKPOINT).unlink(missing_ok=True)


# The page, and numbers of the table as text: in the units that people use.


def fit_result(table: FitTable) -> list[str]:
    """What a fit that succeeded is worth, in few lines; one that begins with "! " is a warning."""
    return say("fit_result", **found(table))


def found(table: FitTable) -> dict[str, Any]:
    """What screen and page tell of a fit that succeeded, as their templates call it."""
    every = [trial.score for trial in table.trials if trial.score is not None]
    held_out = [score for score in every if score.role == HELD_OUT]
    beside = [
        (score.label, error, null)
        for score in held_out
        if (error := score.metrics.grf_rmse_bw) is not None
        and (null := score.metrics.null_model_grf_rmse_bw) is not None
    ]
    layer = (table.layers and table.layers.earned) or PHYSICS
    return {
        "t": table,
        "scores": held_out or every,
        "held_out": bool(held_out),
        "nulls": len(beside),
        "beaten": [label for label, error, null in beside if error >= null],
        "one_setting": _one_setting(table),
        "swept": [score for score in every if score.sweep is not None],
        "disturbed": [
            row
            for row in table.angle_errors
            if row.role == HELD_OUT and row.sd_deg and row.layer == layer
        ],
        "large": [
            f"{row.trial} {row.series}" for row in table.noise_ratios if row.ratio > NOISE_TOO_SMALL
        ],
    }


def fit_page(table: FitTable, figures: Mapping[str, Figure]) -> str:
    """The page as HTML; figures as `fit_figures` makes them of the same table."""
    bench, joint = table.bench, table.strategy == "joint"
    scores = [trial.score for trial in table.trials if trial.score is not None]
    columns = told_columns(table.trials) if scores else [0, 1, 2]
    kind = "contact fit" if joint else "contact fit by the paper's procedure"
    title = f"{kind}, {table.subject.name}{' (SYNTHETIC)' if table.synthetic else ''}"
    own = own_parameters(table)
    curves = {
        trial_name(i, trial): trial.role
        for i, trial in enumerate(table.trials)
        if trial_name(i, trial) in figures
    }
    return str(
        render(
            "fit.html.j2",
            fit=table,
            figures=figures,
            synthetic=synthetic_of(table),
            title=title[0].upper() + title[1:] if table.success else f"FAILED: {title}",
            judged=bool(scores),
            trial_headings=[HEADINGS[i] for i in columns],
            trial_rows=[
                [trial_cells(trial)[i] for i in columns]
                for trial in table.trials
                if trial.score or not scores
            ],
            angle_error_rows=[
                (
                    row.role,
                    row.layer,
                    f"{row.sd_deg:g}",
                    str(row.walks),
                    str(row.failed),
                    number(row.grf_rmse_bw, "{:.1f}", 100.0),
                    number(row.grf_rmse_bw_worst, "{:.1f}", 100.0),
                    f"{row.beats_null} of {row.beats_null_of}",
                )
                for row in table.angle_errors
            ],
            foot_length_m=scores[0].metrics.foot_length_m if scores else None,
            layer_headings=LAYER_HEADINGS,
            layer_rows=layer_rows(table.layers) if table.layers else [],
            null_known=any(score.metrics.null_model_grf_rmse_bw is not None for score in scores),
            floor_known=any(score.floor_grf_rmse_bw is not None for score in scores),
            sweep_known=any(score.sweep is not None for score in scores),
            result=fit_result(table) if table.success and scores else [],
            one_setting=_one_setting(table),
            held_out=any(trial.role == HELD_OUT for trial in table.trials),
            curves=list(curves),
            shown_curve=next(
                (name for name, role in curves.items() if role == HELD_OUT),
                next(iter(curves), None),
            ),
            bench_rows=[] if bench is None else _bench_rows(bench.fulcrum_mm, bench.stiffness),
            mid_range_rows=[] if bench is None else _bench_rows(bench.fulcrum_mm, bench.mid_range),
            own_rows=[
                _parameter(row, table)
                if joint
                else (
                    row.name,
                    shown_value(row, row.value),
                    shown_value(row, row.start),
                    shown_unit(row),
                )
                for row in (own if joint else table.parameters)
            ],
            rest_rows=[
                _parameter(row, table)
                for row in table.parameters
                if not row.frozen and row not in own
            ],
            frozen_rows=[
                (row.name, shown_value(row, row.value), shown_unit(row))
                for row in table.parameters
                if row.frozen
            ],
            reference_depth_mm=1e3 * REFERENCE_DEPTH_M,
            smooth=[row for row in table.curves if row.largest_deg != 0.0],
            noise_rows=[(row.trial, row.series, f"{row.ratio:.2f}") for row in table.noise_ratios],
            left_out_rows=[
                (
                    row.kind,
                    ", ".join(row.left_out),
                    *(
                        (f"failed: {row.failed}", "", "")
                        if row.failed
                        else (
                            number(error, "{:.1f}", 100.0)
                            for error in (row.grf_rmse_bw, row.cop_rmse_fl, row.cop_ml_rmse_fl)
                        )
                    ),
                )
                for row in table.left_out
            ],
            search_rows=[
                (
                    str(i),
                    _cost(s.start_cost),
                    _cost(s.cost),
                    str(s.evaluations),
                    str(s.failed),
                    "yes" if s.success else "NO",
                    str(s.met or ""),
                    s.message,
                )
                for i, s in enumerate(table.searches, start=1)
            ],
            option_rows=[
                *(
                    (
                        name,
                        said(dict(sorted(value.items())) if isinstance(value, Mapping) else value),
                    )
                    for name, value in sorted(table.options.items())
                ),
                ("wall time (s)", number(table.wall_s, "{:.1f}")),
            ],
        )
    )


def _one_setting(table: FitTable) -> bool:
    return len({trial.fulcrum_mm for trial in table.trials if trial.role == FITTED}) == 1


def _bench_rows(fulcrum_mm: Sequence[float], quantity: Beside | None) -> list[tuple[str, ...]]:
    """Measured, fitted and difference at each position and the heel; none where nothing was judged."""
    if quantity is None:
        return []
    rows = [
        (f"{x:g}", k, fitted)
        for x, k, fitted in zip(fulcrum_mm, quantity.measured, quantity.model, strict=True)
    ]
    if quantity.heel_measured is not None and quantity.heel_model is not None:
        rows.append(("heel", quantity.heel_measured, quantity.heel_model))
    return [
        (x, f"{k:.2f}", f"{fitted:.2f}", number(fitted - k, "{:+.2f}")) for x, k, fitted in rows
    ]


def _parameter(row: ParameterRow, table: FitTable) -> tuple[str, ...]:
    warnings = [
        *(["at a bound"] if row.at_bound else []),
        *(
            ["not identified"]
            if table.uncertainty and row.name in table.uncertainty.unidentified
            else []
        ),
    ]
    return (
        row.name,
        shown_value(row, row.value),
        shown_interval(row),
        shown_unit(row),
        number(row.share_of_prior, "{:.0f}", 100.0),
        shown_value(row, row.spread_over_starts),
        ", ".join(warnings),
    )


def _cost(cost: float) -> str:
    return number(cost if math.isfinite(cost) else None, "{:.1f}")


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


LAYER_HEADINGS = (
    "trial",
    "role",
    "fulcrum mm",
    "physics % BW",
    "+ momentum % BW",
    "+ discrepancy % BW",
    "null model % BW",
    "null, predicted stance % BW",
    "fore-aft, three layers % BW",
    "CoP, physics and + momentum % FL",
    "CoP lateral, the same % FL",
    "momentum's correction",
)
"""Of the cells of `layer_rows`."""


def layer_rows(table: LayerTable) -> list[tuple[str, ...]]:
    """Every trial in layers as text."""

    def percent(error: float | None) -> str:
        return number(error, "{:.1f}", 100.0)

    rows = []
    for row in table.trials:
        done, scores = row.correction, [row.layers[layer] for layer in LAYERS]
        turned = [
            math.degrees(done.hip_flexion_rad),
            math.degrees(done.knee_angle_rad),
            math.degrees(done.alignment_rad),
        ]
        rows.append(
            (
                row.label,
                FITTED if row.fitted else HELD_OUT.replace(" ", "\u00a0"),
                f"{row.fulcrum_mm:g}",
                *(percent(score.grf_rmse_bw) for score in scores),
                percent(row.null_model_grf_rmse_bw),
                percent(row.null_model_predicted_times_grf_rmse_bw),
                ", ".join(percent(score.fore_aft_rmse_bw) for score in scores),
                ", ".join(
                    percent(score.cop_rmse_fl) for score in scores[:2]
                ),  # the discrepancy moves none
                ", ".join(percent(score.cop_ml_rmse_fl) for score in scores[:2]),
                "height {:+.1f} mm, hip {:+.1f}°, knee {:+.1f}°, alignment {:+.1f}°".format(
                    1e3 * done.height_m, *turned
                )
                if done.believed
                else f"none: {say('not_corrected', 'words', why_not=done.why_not)[0]}",
            )
        )
    return rows


def synthetic_of(table: FitTable) -> list[str]:
    """What of a fit's data nobody measured."""
    names = [trial.label for trial in table.trials if trial.synthetic]
    return [*names, *(["the bench"] if table.bench is not None and table.bench.synthetic else [])]


def trial_cells(trial: FitTrialRow) -> tuple[str, ...]:
    """One trial of a fit as text; of one that was not judged, what it is."""
    score = trial.score
    if score is None:
        return trial.label, trial.role, f"{trial.fulcrum_mm:g}"
    right = UNKNOWN if score.sweep is None else "yes" if score.sweep.right else "NO"
    own = "" if score.own_height_m is None else f", own height {1e3 * score.own_height_m:+.1f} mm"
    return (
        trial.label,
        f"{trial.role}{own}".replace(" ", "\u00a0"),
        f"{trial.fulcrum_mm:g}",
        *(number(value(score), form, factor) for _, value, form, factor in _SCORES),
        right,
    )


def told_columns(trials: Sequence[FitTrialRow]) -> list[int]:
    """Columns of `trial_cells` in which any of those trials that were judged has something to tell."""
    cells = [trial_cells(trial) for trial in trials if trial.score is not None]
    return [i for i, column in enumerate(zip(*cells, strict=True)) if {*column} != {UNKNOWN}]
