"""What a contact fit leaves on disk: the contact, its table, curves, figures and page. All of it or
nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from vsf_drake.base.errors import InputError
from vsf_drake.base.files import write_text
from vsf_drake.base.sentences import say
from vsf_drake.fit.assessment import FITTED, HELD_OUT, LEFT_OUT, NOISE_TOO_SMALL, Beside
from vsf_drake.fit.parameters import REFERENCE_DEPTH_M
from vsf_drake.fit.solution import ParameterRow
from vsf_drake.fit.table import FitTable, FitTrialRow, fit_arrays, fit_json
from vsf_drake.model.contact_file import FittedContact, save_contact
from vsf_drake.report.fit_figures import fit_figures, is_smooth, trial_name
from vsf_drake.report.page import UNKNOWN, number, render, said, shown
from vsf_drake.report.results_folder import PAGE, ResultsFolder
from vsf_drake.report.style import save_figure
from vsf_drake.simulation.archive import remove_result
from vsf_drake.walks.null_model import several_settings
from vsf_drake.walks.prediction import LAYERS, PHYSICS, LayerTable
from vsf_drake.walks.quantities import (
    FLOOR,
    IN_LATE_STANCE,
    JUDGED,
    NULL,
    STRETCHED,
    mean,
    quantity,
)

CONTACT = "contact.yaml"
CHECKPOINT = "checkpoint.json"
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
"""Of the cells of `trial_cells`, each with its unit."""


def clear_fit(out: Path, *, checkpoint: bool = True) -> None:
    """Removes what an earlier fit left in `out`, its checkpoint too unless told otherwise; files of
    others stay."""
    try:
        remove_result(out, FIT.kind, (CONTACT,))
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
    percent = quantity(JUDGED).told

    def off(name: str) -> str:
        return percent(mean(score.number(name) for score in held_out or every))

    layer = (table.layers and table.layers.earned) or PHYSICS
    unknown = [score.metrics.null_model_unknown for score in held_out or every]
    return {
        "no_null": unknown[0] if all(unknown) else "",
        "t": table,
        "scores": held_out or every,
        "held_out": bool(held_out),
        "nulls": sum(score.metrics.beats_null is not None for score in held_out),
        "beaten": [score.label for score in held_out if score.metrics.beats_null is False],
        "percent": percent,
        "off": off,
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
    bench = table.bench
    joint = table.strategy == "joint"
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
                    shown(row, JUDGED),
                    shown(row, f"{JUDGED}_worst"),
                    f"{row.beats_null} of {row.beats_null_of}",
                )
                for row in table.angle_errors
            ],
            foot_length_m=scores[0].metrics.foot_length_m if scores else None,
            layer_headings=LAYER_HEADINGS,
            layer_rows=layer_rows(table.layers) if table.layers else [],
            null_known=any(score.null_bw is not None for score in scores),
            floor_known=any(score.number(FLOOR) is not None for score in scores),
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
                        else (shown(row, name) for name in LEFT_OUT)
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
    return not several_settings(
        1e-3 * trial.fulcrum_mm for trial in table.trials if trial.role == FITTED
    )


def _bench_rows(fulcrum_mm: Sequence[float], quantity: Beside | None) -> list[tuple[str, ...]]:
    """Measured, fitted and difference at each position and the heel; none where nothing was
    judged."""
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


_NULLS = (NULL, IN_LATE_STANCE, STRETCHED)
LAYER_HEADINGS = (
    *_FIRST,
    "physics % BW",
    "+ momentum % BW",
    "+ discrepancy % BW",
    *_headings(_NULLS),
    "fore-aft, three layers % BW",
    "CoP, physics and + momentum % FL",
    "CoP lateral, the same % FL",
    "momentum's correction",
)
"""Of the cells of `layer_rows`."""


def layer_rows(table: LayerTable) -> list[tuple[str, ...]]:
    """Every trial in layers as text."""

    def beside(name: str, layers: Sequence[str] = LAYERS) -> list[str]:
        return [shown(row.layers[layer], name) for layer in layers]

    rows = []
    for row in table.trials:
        done = row.correction
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
                *beside(JUDGED),
                *(shown(row, name) for name in _NULLS),
                ", ".join(beside("fore_aft_rmse_bw")),
                # the discrepancy moves none
                ", ".join(beside("cop_rmse_fl", LAYERS[:2])),
                ", ".join(beside("cop_ml_rmse_fl", LAYERS[:2])),
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
        *(shown(score, name) for name in _SCORES),
        right,
    )


def told_columns(trials: Sequence[FitTrialRow]) -> list[int]:
    """Columns of `trial_cells` in which any of those trials that were judged has something to
    tell."""
    cells = [trial_cells(trial) for trial in trials if trial.score is not None]
    return [i for i, column in enumerate(zip(*cells, strict=True)) if {*column} != {UNKNOWN}]
