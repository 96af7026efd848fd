"""The page of a contact fit: the verdict first, then tables and figures with what they mean. One file, no network."""

from __future__ import annotations

import html
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from vsf_drake.analysis.contact_fit.parameters import REFERENCE_DEPTH_M
from vsf_drake.report.fit_figures import trial_name
from vsf_drake.report.fit_text import (
    UNKNOWN,
    interval_of,
    own_parameters,
    shown,
    smooth_errors,
    synthetic_of,
    title_of,
    told_columns,
    trial_cells,
    trial_headings,
    unit_of,
    value_of,
)
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


# Parts of the page of a contact fit: tables, parameters, searches, how it was made.


_NAMES = (
    f"In a zone of the foot, force is the load of one sphere that is pressed in by {1e3 * REFERENCE_DEPTH_M:g} mm, "
    "exponent that of its law, rise how much higher its spheres sit than drawn; damping time is damping over the "
    "law's slope at that depth. Offsets move the foot under the pylon, coordinates are errors of joint angles that all "
    "trials share.")
_NUMBER = r"[+-]?[0-9.]+(e[+-]?[0-9]+)?"


def sentence(text: str) -> str:
    """A paragraph of plain text."""
    return f"<p>{html.escape(text)}</p>"


def grid(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of plain texts; what begins like a number stands right."""
    kinds = ["number" if rows and all(_is_number(row[i]) for row in rows) else "text" for i in range(len(headings))]
    head = "".join(f'<th class="{kind}">{html.escape(name)}</th>' for kind, name in zip(kinds, headings, strict=True))
    body = "".join("<tr>" + "".join(_cell(text) for text in row) + "</tr>" for row in rows)
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def made_of(parts: Sequence[Mapping[str, Any]]) -> str:
    """A direction in the space of parameters."""
    return ", ".join(f"{part['name']} {part['share']:+.2f}" for part in parts)


def parameter_part(table: Mapping[str, Any], show: Callable[[str], str]) -> str:
    """The fitted parameters, those of single trials and the frozen ones."""
    if not table["parameters"]:
        return ""
    if table["strategy"] != "joint":
        rows = [(row["name"], value_of(row, "value"), value_of(row, "start"), unit_of(row))
                for row in table["parameters"]]
        return "<h2>Parameters</h2>" + sentence(
            "What the paper's procedure varied, and its initial guess; nothing is known of their errors."
        ) + grid(("parameter", "value", "initial guess", "unit"), rows)
    head = ("parameter", "value", "95 % interval", "unit", "share of prior %", "spread over starts", "")
    own = own_parameters(table)
    parts = ["<h2>Parameters</h2>", sentence(
        "The 95 % interval is where the value lies if the model and the assumed noise are right. Share of prior is the "
        "standard error over that of what was believed before: near 100 % the data said nothing. Spread is the largest "
        "difference among searches that ended alike."), sentence(_NAMES),
        grid(head, [_parameter(row, table) for row in own])]
    rest = [row for row in table["parameters"] if not row["frozen"] and row not in own]
    parts.append(sentence(smooth_errors(table)) if smooth_errors(table) else "")
    if rest:
        parts.append(f"<details><summary>Curves and single trials ({len(rest)} parameters)</summary>"
                     f"{grid(head, [_parameter(row, table) for row in rest])}</details>")
    frozen = [row for row in table["parameters"] if row["frozen"]]
    if frozen:
        stuck = [(row["name"], value_of(row, "value"), unit_of(row)) for row in frozen]
        parts.append(f"<details><summary>Frozen ({len(frozen)} parameters)</summary>"
                     f"{grid(('parameter', 'value', 'unit'), stuck)}</details>")
    if show("parameters"):
        parts += [sentence("Value and 95 % interval in standard deviations of the prior; an interval as wide as the "
                           "bands is the prior again."), show("parameters")]
    return "".join(parts)


def mid_range_part(bench: Mapping[str, Any]) -> str:
    """Mid-range displacements of a judged bench; nothing where none were measured."""
    found = bench.get("mid_range")
    if found is None:
        return ""
    values = [*zip(bench["fulcrum_mm"], found["measured_mm"], found["model_mm"], strict=True)]
    if found["heel_measured_mm"] is not None:
        values.append(("heel", found["heel_measured_mm"], found["heel_model_mm"]))
    rows = [(x if isinstance(x, str) else f"{x:g}", f"{measured:.2f}", f"{fitted:.2f}",
             shown(fitted - measured, "{:+.2f}")) for x, measured, fitted in values]
    told = ("Mid-range displacement (mm), that of the platen since it touched the foot, at "
            f"{0.5 * bench['max_load_n']:g} N. The forefoot is {found['rmse_mm']:.2f} mm off (root mean square; the "
            f"paper's model {found['published_rmse_mm']:g} mm), at a measured uncertainty of "
            f"{found['uncertainty_mm']:g} mm.")
    return sentence(told) + grid(("fulcrum mm", "measured mm", "fitted mm", "difference mm"), rows)


def search_part(table: Mapping[str, Any], show: Callable[[str], str]) -> str:
    """How the search went."""
    if table["searches"]:
        rows = [(str(i), shown(s["start_cost"], "{:.1f}"), shown(s["cost"], "{:.1f}"), str(s["evaluations"]),
                 str(s["failed"]), "yes" if s["success"] else "NO", s["message"])
                for i, s in enumerate(table["searches"], start=1)]
        return "<h2>Searches</h2>" + sentence(
            "Cost is half the sum of the squared residuals, each over its noise (no unit). Searches that end at one "
            "cost speak for one minimum" + ("; the lowest converged one was taken." if table["success"] else ".")
        ) + show("searches") + grid(("search", "cost at start", "cost at end", "evaluations", "failed walks",
                                     "converged", "how it ended"), rows)
    if table["history"]:
        return "<h2>Search</h2>" + sentence(
            f"{table['message'].capitalize()}. The resultant was {table['initial_rms_n']:.1f} N off at the initial "
            f"guess and {table['rms_n']:.1f} N in the end (root mean square), after {table['simulations']} walks, "
            f"{table['failed_simulations']} of which failed.") + show("searches")
    return ""


def options_part(table: Mapping[str, Any]) -> str:
    """Options, versions, hashes."""
    rows = [(name, _said(value)) for name, value in sorted(table["options"].items())]
    if "seed" not in table["options"]:
        rows.append(("seed", _said(table["seed"])))
    rows += [("wall time (s)", shown(table["wall_s"], "{:.1f}"))]
    versions = [(name, str(version)) for name, version in sorted(table["versions"].items())]
    inputs = sorted(table["inputs_sha256"].items())
    return ("<h2>How it was made</h2>" + f"<details open><summary>Options</summary>{grid(('option', 'value'), rows)}"
            f"</details><details><summary>Versions</summary>{grid(('software', 'version'), versions)}</details>"
            f"<details><summary>Files ({len(inputs)})</summary>{grid(('file', 'SHA-256'), inputs)}</details>")


def _parameter(row: Mapping[str, Any], table: Mapping[str, Any]) -> tuple[str, ...]:
    doubts = [*(["at a bound"] if row["at_bound"] else []),
              *(["not identified"] if row["name"] in table["unidentified"] else [])]
    return (row["name"], value_of(row, "value"), interval_of(row), unit_of(row),
            shown(row["share_of_prior"], "{:.0f}", 100.0), value_of(row, "spread_over_starts"), ", ".join(doubts))


def _cell(text: str) -> str:
    return f'<td class="{"number" if _is_number(text) else "text"}">{html.escape(text)}</td>'


def _is_number(text: str) -> bool:
    return text == UNKNOWN or re.fullmatch(rf"{_NUMBER}( to {_NUMBER})?", text) is not None


def _said(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_said(item)}" for name, item in sorted(value.items()))
    if isinstance(value, (list, tuple)):
        return ", ".join(map(_said, value)) or UNKNOWN
    if isinstance(value, bool):
        return "yes" if value else "no"
    return UNKNOWN if value is None else f"{value:g}" if isinstance(value, float) else str(value)
