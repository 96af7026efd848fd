"""The page of a contact fit: the verdict first, then tables and figures with what they mean. One file, no network."""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping
from typing import Any

from matplotlib.figure import Figure

from vsf_drake.report.fit_figures import trial_name
from vsf_drake.report.fit_page_parts import (
    grid,
    made_of,
    mid_range_part,
    options_part,
    parameter_part,
    search_part,
    sentence,
)
from vsf_drake.report.fit_text import shown, synthetic_of, title_of, told_columns, trial_cells, trial_headings
from vsf_drake.report.page import bullets, document, picture

_STYLE = """
img,tr,.kept{break-inside:avoid}h2,h3{break-after:avoid}h1.error{color:#b3261e}th.number{text-align:right}.wide{overflow-x:auto}
.wide table{font-size:.88rem}@media print{body{max-width:none;padding:0;font-size:10pt}}
"""
_ALWAYS = (
    "GRF is the resultant ground reaction force and R² the share of its variance that the model explains; fore-aft is "
    "its forward part, CoP the centre of pressure along the foot, impulse that of the resultant as it adds up over "
    "stance. All are root mean square differences of model and plate; BW: body weight, FL: foot length.",
    "Stance error is how much longer the model's stance lasts than the measured one (seconds).")
_WHERE_KNOWN = {
    "null_model_grf_rmse_bw":
        "The null model is another trial's measured curve, stretched to this one's stance: a model that does not "
        "beat it has told nothing.",
    "floor_grf_rmse_bw":
        "The floor is what the true foot itself would be left with on this recorded motion, where it is known: an "
        "error below it means that noise was fitted, or that errors happen to cancel.",
    "sweep": "The sweep moves the fulcrum through its range; where the error is least should be where it stood."}
"""What a column means, by what a trial must have for it to be there."""


def fit_page(table: Mapping[str, Any], figures: Mapping[str, Figure]) -> str:
    """The page as HTML; figures as `fit_figures` makes them of the same table."""
    pictures, title = {name: picture(figure, name=name) for name, figure in figures.items()}, title_of(table)

    def show(name: str) -> str:
        return pictures.get(name, "")

    parts = [f'<h1 class="{"done" if table["success"] else "error"}">{html.escape(title)}</h1>']
    if not table["success"]:
        parts.append(f'<p class="error">{html.escape(table["message"])}</p>'
                     "<p>No contact file was written: there is nothing here to be used.</p>")
    if synthetic_of(table):
        parts.append('<p class="synthetic">SYNTHETIC, not recorded: '
                     f"{html.escape(', '.join(synthetic_of(table)))}.</p>")
    if table["bench"] is None and not table["verdict"]:
        parts.append(sentence("No bench was given: the walks alone decide how stiff the foot is."))
    parts += [_verdict(table), _trials(table, show), _bench(table, show), parameter_part(table, show),
              _knowledge(table, show), _left_out(table), search_part(table, show), options_part(table)]
    return document(title, [part for part in parts if part], more_style=_STYLE)


def _verdict(table: Mapping[str, Any]) -> str:
    return f"<h2>Verdict</h2>{bullets(table['verdict'])}" if table["verdict"] else ""


def _trials(table: Mapping[str, Any], show: Callable[[str], str]) -> str:
    trials = table["trials"]
    judged = [trial for trial in trials if trial["metrics"] is not None]
    if not judged:
        rows = [(trial["label"], trial["role"], f"{trial['fulcrum_mm']:g}") for trial in trials]
        return f"<h2>Trials</h2>{grid(trial_headings()[:3], rows)}"
    kept = told_columns(judged)
    cells = [[trial_cells(trial)[i] for i in kept] for trial in judged]
    parts = ["<h2>Trials</h2>", grid([trial_headings()[i] for i in kept], cells), bullets(
        [*_ALWAYS, *(text for key, text in _WHERE_KNOWN.items() if any(trial[key] is not None for trial in judged))])]
    if show("errors"):
        parts += ["<h3>Errors by trial</h3>", sentence(
            "Each dot is a trial"
            + ("; one right of its diamond is worse than no model" if any(
                trial["null_model_grf_rmse_bw"] is not None for trial in judged) else "")
            + ". Grey is what the paper's model was left with (doi 10.1115/1.4050456)."), show("errors")]
    if show("sweep"):
        parts += ["<h3>Fulcrum sweep</h3>", sentence(
            "Resultant error with the fulcrum moved (mm from the keel's posterior end); a least error at an end of the "
            "range may lie beyond it."), show("sweep")]
    curves = "".join(show(trial_name(i, trial)) for i, trial in enumerate(trials))
    if curves:
        parts += ["<h3>Curves</h3>", sentence(
            "Forces in body weights, low-passed at 40 Hz, time-locked; centre of pressure in foot lengths ahead of "
            "the plate's rearmost one."), curves]
    return "".join(parts)


def _bench(table: Mapping[str, Any], show: Callable[[str], str]) -> str:
    bench = table["bench"]
    if bench is None or bench["model_n_per_mm"] is None:
        return ""
    rows = [(f"{x:g}", f"{k:.2f}", f"{fitted:.2f}", shown(fitted - k, "{:+.2f}")) for x, k, fitted in
            zip(bench["fulcrum_mm"], bench["measured_n_per_mm"], bench["model_n_per_mm"], strict=True)]
    if bench["heel_measured_n_per_mm"] is not None:
        k, fitted = bench["heel_measured_n_per_mm"], bench["heel_model_n_per_mm"]
        rows.append(("heel", f"{k:.2f}", f"{fitted:.2f}", shown(fitted - k, "{:+.2f}")))
    told = (f"Stiffness (N/mm) between 200 and {bench['max_load_n']:g} N. The forefoot is "
            f"{bench['rmse_n_per_mm']:.2f} N/mm off (root mean square; the paper's model "
            f"{table['published']['bench_rmse_n_per_mm']:g} N/mm), at a measured uncertainty of "
            f"{bench['uncertainty_n_per_mm']:g} N/mm.")
    head = ("fulcrum mm", "measured N/mm", "fitted N/mm", "difference N/mm")
    return f"<h2>Bench</h2>{sentence(told)}{grid(head, rows)}{mid_range_part(bench)}{show('bench')}"


def _knowledge(table: Mapping[str, Any], show: Callable[[str], str]) -> str:
    """Correlations, singular values, series of residuals."""
    if not table.get("correlations"):
        return ""
    parts = ["<h2>What the data tell</h2>", sentence(
        "Correlations of errors: two parameters near +1 or -1 are known only together."), show("correlations")]
    if table["together"]:
        parts.append(bullets([f"{' and '.join(row['names'])}: {row['correlation']:+.2f}" for row in table["together"]]))
    parts += ["<h3>Directions</h3>", sentence(
        "A singular value is how much more the data know of a combination of parameters than the prior did; below 1 "
        "they know less, and what comes out is mostly what was put in."), show("singular_values")]
    weakest = [row for row in table["weakest"] if row["made_of"]]
    if weakest:
        rows = [(f"{row['singular_value']:.3g}", made_of(row["made_of"])) for row in weakest[::-1]]
        parts.append("<details><summary>The directions that the data tell less of than the prior, weakest first"
                     f"</summary>{grid(('data over prior', 'made of (share of each)'), rows)}</details>")
    ratios = [(row["trial"], row["series"], f"{row['ratio']:.2f}") for row in table["noise"]["ratios"]]
    parts += ["<h3>Residuals</h3>", sentence(
        "Root mean square of each compared series over the noise that was assumed: near 1 the errors of the "
        "parameters are told right, well above 1 too small, well below too large."),
        grid(("trial", "series", "over assumed noise"), ratios)]
    return "".join(parts)


def _left_out(table: Mapping[str, Any]) -> str:
    if not table["left_out"]:
        return ""
    rows = [(row["kind"], ", ".join(row["left_out"]), *(
        (f"failed: {row['failed']}", "") if row["failed"] else
        tuple("–" if row[key] is None else f"{100.0 * row[key]:.1f}" for key in ("grf_rmse_bw", "cop_rmse_fl"))))
        for row in table["left_out"]]
    return ("<h2>Left out in turn</h2>" + sentence(
        "The fit was done again without each trial, and without all trials of each fulcrum position; the errors are "
        "those on what it had then not seen.")
        + grid(("without each", "left out", "GRF % BW", "CoP % FL"), rows))
