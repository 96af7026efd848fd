"""The page of an import or a check: how good each trial is, in words, numbers and figures. One file, no network."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from vsf_drake.analysis.recording.check import EXPECTED, GOOD_BW, MARKS, Check, costs, expected_error
from vsf_drake.analysis.recording.foot import Examined
from vsf_drake.files import replaced
from vsf_drake.report.import_figures import (
    MARK_COLOURS,
    angle_figure,
    floor_figure,
    force_figure,
    height_figure,
    residual_figure,
)
from vsf_drake.report.page import bullets, document, picture

_FIGURES = (angle_figure, force_figure, floor_figure, height_figure, residual_figure)


def import_page(items: Sequence[Examined], *, title: str, person: Mapping[str, Any] | None = None,
                failures: Mapping[str, str] | None = None) -> str:
    """The page as HTML.

    Args:
        items: the trials. title: of the page.
        person: what to say of the person: `rows`, pairs of a name and a text; `lists`, names with sentences.
        failures: by file, why it could not be imported.
    """
    synthetic = any(item.trial.synthetic for item in items)
    full = f"{title} (SYNTHETIC)" if synthetic else title
    parts = [f"<h1>{html.escape(full)}</h1>"]
    if synthetic:
        names = ", ".join(item.trial.name for item in items if item.trial.synthetic)
        parts.append(f'<p class="synthetic">SYNTHETIC, not recorded: {html.escape(names)}.</p>')
    parts.append(_summary(items, failures or {}))
    parts.append(f'<p class="quiet">{html.escape(EXPECTED)} Independent errors add as squares; the model has an error '
                 'of its own on top. Limits of single checks are choices where no cost is known, and their doubts '
                 'remarks.</p>')
    if person:
        parts.append(_person(person))
    parts += [_trial(item, number) for number, item in enumerate(items)]
    return document(full, parts)


def write_import_page(path: str | Path, items: Sequence[Examined], *, title: str,
                      person: Mapping[str, Any] | None = None, failures: Mapping[str, str] | None = None) -> None:
    """Writes `import_page` to `path`, all of it or nothing.

    Raises:
        InputError: it cannot be written.
    """
    page = import_page(items, title=title, person=person, failures=failures)
    with replaced(path) as stream:
        stream.write(page)


def _summary(items: Sequence[Examined], failures: Mapping[str, str]) -> str:
    heads = ("trial", "overall", "expected error", *MARKS, "")
    rows = [f"<tr>{''.join(f'<th>{head}</th>' for head in heads)}</tr>"]
    for number, item in enumerate(items):
        counts = [sum(check.mark == mark for check in item.checks) for mark in MARKS]
        bad = dict.fromkeys([*(check.name for check in item.checks if check.mark == MARKS[2]),
                             *(name for name, share in costs(item.checks).items() if share > 0.5 * GOOD_BW)])
        rows.append(f'<tr><td><a href="#trial-{number}">{html.escape(item.trial.name)}</a></td><td>{_badge(item.mark)}'
                    f'</td><td class="number">{_share(expected_error(item.checks))}</td>'
                    + "".join(f'<td class="number">{count}</td>' for count in counts)
                    + f"<td>{html.escape(', '.join(bad))}</td></tr>")
    for file, why in failures.items():
        rows.append(f'<tr><td>{html.escape(file)}</td><td>{_badge("unusable", "not imported")}</td>'
                    f'<td colspan="5" class="error">{html.escape(why)}</td></tr>')
    return f"<table>{''.join(rows)}</table>"


def _person(person: Mapping[str, Any]) -> str:
    rows = "".join(f"<tr><td>{html.escape(name)}</td><td>{html.escape(str(text))}</td></tr>"
                   for name, text in person.get("rows", ()))
    lists = "".join(f"<h3>{html.escape(name)}</h3>{bullets(lines)}" for name, lines in person.get("lists", ()) if lines)
    return f"<h2>The person</h2><table>{rows}</table>{lists}"


def _trial(item: Examined, number: int) -> str:
    order = sorted(item.checks, key=lambda check: -MARKS.index(check.mark))
    rows = "".join(f"<tr><td>{_badge(check.mark)}</td><td>{html.escape(_name(check))}</td>"
                   f'<td class="number">{_value(check)}</td><td class="number">{_share(check.cost_bw)}</td>'
                   f"<td>{html.escape(check.sentence)}</td></tr>"
                   for check in order)
    figures = "".join(picture(figure) for make in _FIGURES if (figure := make(item)) is not None)
    notes = (f"<details><summary>Notes ({len(item.notes)})</summary>{bullets(item.notes)}</details>"
             if item.notes else "")
    head = f'<h2 id="trial-{number}">{html.escape(item.trial.name)} {_badge(item.mark)}</h2>'
    return (f"{head}<table><tr><th>mark</th><th>check</th><th>value</th><th>cost</th><th>what it means</th></tr>"
            f"{rows}</table>{notes}{figures}")


def _name(check: Check) -> str:
    parts = [check.name, *([check.side] if check.side else []), *([str(check.stance)] if check.stance else [])]
    return ", ".join(parts)


def _value(check: Check) -> str:
    if check.value is None:
        return ""
    value, unit = (1e3 * check.value, "ms") if check.unit == "s" and abs(check.value) < 1 else (check.value, check.unit)
    unit = {"1": "", "deg": "°"}.get(unit, unit)
    return html.escape(f"{value:.3g} {unit}".strip())


def _share(share_bw: float | None) -> str:
    return "" if share_bw is None else f"{100 * share_bw:.1f} % BW"


def _badge(mark: str, text: str | None = None) -> str:
    return f'<span class="mark" style="background:{MARK_COLOURS[mark]}">{html.escape(text or mark)}</span>'
