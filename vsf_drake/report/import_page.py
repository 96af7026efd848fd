"""The page of an import or a check: how good each trial is, in words, numbers and figures. One file, no network."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from vsf_drake.analysis.recording.check import MARKS, Check
from vsf_drake.analysis.recording.evidence import Examined
from vsf_drake.files import replaced
from vsf_drake.report.import_figures import (
    MARK_COLOURS,
    angle_figure,
    floor_figure,
    force_figure,
    height_figure,
    residual_figure,
)
from vsf_drake.report.style import style

_STYLE = """
body{font:15px/1.5 system-ui,sans-serif;color:#222;max-width:1120px;margin:0 auto;padding:1.5rem}
h1{font-size:1.5rem;margin:0 0 .3rem}h2{font-size:1.2rem;margin:2.2rem 0 .4rem;border-bottom:1px solid #ddd}
h3{font-size:1rem;margin:1.2rem 0 .3rem}table{border-collapse:collapse;margin:.5rem 0}
td,th{padding:.22rem .7rem .22rem 0;text-align:left;vertical-align:top;border-bottom:1px solid #eee}
td.number{white-space:nowrap;text-align:right;font-variant-numeric:tabular-nums}
.mark{color:#fff;border-radius:3px;padding:0 .45rem;font-size:.85rem;white-space:nowrap}
.synthetic{background:#fff3cd;padding:.4rem .8rem;border-radius:4px}ul{margin:.3rem 0;padding-left:1.2rem}
img{max-width:100%;margin:.4rem 0}.error{color:#b3261e}summary{cursor:pointer}.quiet{color:#666}
@media print{details{display:block}}
"""
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
    parts.append('<p class="quiet">A mark says what an error would cost in the predicted ground reaction: good is '
                 'below about 3 % of body weight, doubtful below 10 %; where that cannot be derived, the limits are '
                 'choices. A trial is as good as its worst check.</p>')
    if person:
        parts.append(_person(person))
    parts += [_trial(item, number) for number, item in enumerate(items)]
    return (f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{html.escape(full)}</title>'
            f'<meta name="viewport" content="width=device-width"><style>{_STYLE}</style></head><body>\n'
            + "\n".join(parts) + "\n</body></html>\n")


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
    rows = ["<tr><th>trial</th><th>overall</th>" + "".join(f"<th>{mark}</th>" for mark in MARKS) + "<th></th></tr>"]
    for number, item in enumerate(items):
        counts = [sum(check.mark == mark for check in item.checks) for mark in MARKS]
        bad = dict.fromkeys(check.name for check in item.checks if check.mark == item.mark != MARKS[0])
        rows.append(f'<tr><td><a href="#trial-{number}">{html.escape(item.trial.name)}</a></td><td>{_badge(item.mark)}'
                    "</td>" + "".join(f'<td class="number">{count}</td>' for count in counts)
                    + f"<td>{html.escape(', '.join(bad))}</td></tr>")
    for file, why in failures.items():
        rows.append(f'<tr><td>{html.escape(file)}</td><td>{_badge("unusable", "not imported")}</td>'
                    f'<td colspan="4" class="error">{html.escape(why)}</td></tr>')
    return f"<table>{''.join(rows)}</table>"


def _person(person: Mapping[str, Any]) -> str:
    rows = "".join(f"<tr><td>{html.escape(name)}</td><td>{html.escape(str(text))}</td></tr>"
                   for name, text in person.get("rows", ()))
    lists = "".join(f"<h3>{html.escape(name)}</h3>{_list(lines)}" for name, lines in person.get("lists", ()) if lines)
    return f"<h2>The person</h2><table>{rows}</table>{lists}"


def _trial(item: Examined, number: int) -> str:
    order = sorted(item.checks, key=lambda check: -MARKS.index(check.mark))
    rows = "".join(f"<tr><td>{_badge(check.mark)}</td><td>{html.escape(_name(check))}</td>"
                   f'<td class="number">{_value(check)}</td><td>{html.escape(check.sentence)}</td></tr>'
                   for check in order)
    figures = "".join(_image(figure) for make in _FIGURES if (figure := make(item)) is not None)
    notes = f"<details><summary>Notes ({len(item.notes)})</summary>{_list(item.notes)}</details>" if item.notes else ""
    head = f'<h2 id="trial-{number}">{html.escape(item.trial.name)} {_badge(item.mark)}</h2>'
    return (f"{head}<table><tr><th>mark</th><th>check</th><th>value</th><th>what it means</th></tr>{rows}</table>"
            f"{notes}{figures}")


def _name(check: Check) -> str:
    parts = [check.name, *([check.side] if check.side else []), *([str(check.stance)] if check.stance else [])]
    return ", ".join(parts)


def _value(check: Check) -> str:
    if check.value is None:
        return ""
    value, unit = (1e3 * check.value, "ms") if check.unit == "s" and abs(check.value) < 1 else (check.value, check.unit)
    unit = {"1": "", "deg": "°"}.get(unit, unit)
    return html.escape(f"{value:.3g} {unit}".strip())


def _badge(mark: str, text: str | None = None) -> str:
    return f'<span class="mark" style="background:{MARK_COLOURS[mark]}">{html.escape(text or mark)}</span>'


def _list(lines: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{html.escape(line)}</li>" for line in lines) + "</ul>"


def _image(figure: Figure) -> str:
    """The figure as SVG within the page; letters are drawn as paths, so that no font is needed."""
    stream = io.BytesIO()
    with style(), rc_context({"svg.fonttype": "path"}):
        figure.savefig(stream, format="svg", metadata={"Date": None})
    return f'<img alt="" src="data:image/svg+xml;base64,{base64.b64encode(stream.getvalue()).decode("ascii")}">'


