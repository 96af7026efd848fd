"""Parts of the page of a contact fit: tables, parameters, searches, how it was made."""

from __future__ import annotations

import html
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from vsf_drake.analysis.contact_fit.standard import REFERENCE_DEPTH_M
from vsf_drake.report.fit_text import (
    UNKNOWN,
    interval_of,
    own_parameters,
    shown,
    smooth_errors,
    unit_of,
    value_of,
)

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
