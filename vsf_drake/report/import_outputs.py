"""Everything that an import or a check leaves on disk. All of it or nothing."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vsf_drake.analysis.intake import Intake
from vsf_drake.analysis.recording.check import EXPECTED, GOOD_BW, MARKS, Check, costs, expected_error
from vsf_drake.analysis.recording.examine import mass_budget, overall_mark, person_table, trial_table
from vsf_drake.analysis.recording.foot import Examined
from vsf_drake.files import replaced
from vsf_drake.json_file import write_json
from vsf_drake.motion.kinematics import PELVIS_TRANSLATIONS
from vsf_drake.motion.plates import SIDES
from vsf_drake.motion.trial import Trial, load_trial, write_trial_files
from vsf_drake.report.import_figures import (
    MARK_COLOURS,
    angle_figure,
    floor_figure,
    force_figure,
    height_figure,
    residual_figure,
)
from vsf_drake.report.page import bullets, document, picture
from vsf_drake.schema import dump_yaml, to_plain
from vsf_drake.simulation.archive import check_target, provenance, result_folder
from vsf_drake.yaml_file import dump

IMPORT, CHECK = "import", "check"
SUBJECT_FILE, MODEL_FILE = "subject.yaml", "model.yaml"


def check_folder(out: Path, kind: str) -> None:
    """Whether an import or a check (`kind`) can go to `out`.

    Raises:
        InputError: `out` cannot be written, holds a result of another kind, or anything else but an earlier `kind`.
    """
    check_target(out, kind, lambda out: (out / f"{kind}.json").is_file())


def write_import(intake: Intake, out: Path) -> dict[str, Any]:
    """Writes subject.yaml, a manifest with angles and forces for each walk, import.json and import.html to `out`.

    Every manifest is read back before anything appears in `out`. Files of an earlier import there are removed.

    Returns:
        What import.json holds.

    Raises:
        InputError: `out` cannot be written, or a manifest cannot be read back.
    """
    first = intake.items[0]
    files = [SUBJECT_FILE, f"{IMPORT}.json", f"{IMPORT}.html", *([MODEL_FILE] if intake.scaled else [])]
    with result_folder(out, IMPORT) as folder:
        _text(folder / SUBJECT_FILE, dump_yaml(first.trial.subject))
        if intake.scaled:
            _text(folder / MODEL_FILE, dump_yaml(first.trial.model))
        tables = []
        for item, name in zip(intake.items, intake.names, strict=True):
            written = _write_trial(item.trial, folder, name, scaled=intake.scaled)
            files += written.values()
            tables.append({**trial_table(item), **written})
        table = {"kind": IMPORT, "mark": "unusable" if intake.failures else overall_mark(intake.items),
                 "trials": tables, "failures": intake.failures, **person_table(first), "files": sorted(files),
                 **provenance(intake.inputs)}
        write_json(folder / f"{IMPORT}.json", table)
        title = f"Import of {first.trial.subject.name}"
        write_import_page(folder / f"{IMPORT}.html", intake.items, title=title, person=_person(first),
                          failures={Path(path).name: why for path, why in intake.failures.items()})
    return table


def write_check(items: Sequence[Examined], failures: dict[str, str], out: Path) -> dict[str, Any]:
    """Writes check.json and check.html to `out`; returns what check.json holds.

    Raises:
        InputError: `out` cannot be written.
    """
    table = {"kind": CHECK, "mark": "unusable" if failures else overall_mark(items),
             "trials": [{**trial_table(item), **person_table(item), "manifest": str(item.trial.path)}
                        for item in items],
             "failures": failures, **provenance()}
    with result_folder(out, CHECK) as folder:
        write_json(folder / f"{CHECK}.json", table)
        write_import_page(folder / f"{CHECK}.html", items, title="Check of recordings", failures=failures,
                          person=_person(items[0]) if len({item.trial.subject for item in items}) == 1 else None)
    return table


def _write_trial(trial: Trial, folder: Path, name: str, *, scaled: bool) -> dict[str, str]:
    """Manifest, kinematics and forces of one trial, read back once; their names."""
    kinematics, forces = write_trial_files(trial, folder, name)
    manifest = f"{name}.yaml"
    _text(folder / manifest, _manifest(trial, kinematics, forces, scaled=scaled))
    load_trial(folder / manifest)
    return {"manifest": manifest, "kinematics": kinematics, "forces": forces}


def _manifest(trial: Trial, kinematics: str, forces: str, *, scaled: bool) -> str:
    """The manifest's text; what the belt carried is in the files already."""
    content: dict[str, Any] = {
        "name": trial.name, "subject": SUBJECT_FILE, "kinematics": kinematics,
        "forces": {"file": forces, **{side: f"ground_force_{side[0]}" for side in SIDES if side in trial.plates}},
        "prosthesis": {"fulcrum_mm": round(1e3 * trial.fulcrum_m, 6)},
        "window": {"start_s": float(trial.start_s), "end_s": float(trial.end_s)}}
    if scaled:
        content["model"] = MODEL_FILE
    if trial.synthetic:
        content["synthetic"] = True
    origin = " ".join(str(trial.path.name).split())
    return f"# Made by vsf-drake import from {origin}.\n" + dump(content)


def _text(path: Path, text: str) -> None:
    with replaced(path) as stream:
        stream.write(text)


def _person(item: Examined) -> dict[str, Any]:
    """What the page says of the person."""
    subject = item.trial.subject
    shown = {"name": subject.name, "mass, prosthesis included": f"{subject.mass_kg:z.1f} kg",
             "stature": f"{subject.stature_m:.3f} m", "sex": subject.sex, "prosthesis": subject.prosthetic_side}
    budget = mass_budget(item.trial)
    masses = ", ".join(f"{name} {mass:.2f}" for name, mass in budget.items())
    rows = [*shown.items(), ("mass budget", f"{masses}: {sum(budget.values()):.2f} kg in all")]
    for name, value in to_plain(subject).items():
        if name.endswith("_rad"):
            rows.append((name.removesuffix("_rad").replace("_", " "), f"{np.degrees(value):z.1f}°"))
        elif name.endswith("_m") and name != "stature_m":
            rows.append((name.removesuffix("_m").replace("_", " "), f"{1e3 * value:z.1f} mm"))
    lists: list[tuple[str, Sequence[str]]] = []
    if item.markers is not None:
        calibration = item.markers.calibration
        lengths = calibration.lengths_m
        for key in [name for name in lengths if name.endswith("_right")]:
            left = lengths.get(f"{key.removesuffix('_right')}_left")
            pair = f"{1e3 * lengths[key]:z.1f} mm" + (f" / {1e3 * left:z.1f} mm" if left is not None else "")
            rows.append((f"{key.removesuffix('_right').replace('_', ' ')}, right / left (standing trial)", pair))
        lists = [("How joint centres and axes were found", calibration.method),
                 ("What was assumed or looks doubtful", calibration.notes),
                 ("Angles at standing", _standing(calibration.angles_rad))]
    return {"rows": rows, "lists": lists}


def _standing(angles_rad: Mapping[str, float]) -> list[str]:
    """The angles at standing: a line for the pelvis and one for each leg."""
    lines = []
    for name in ("pelvis", "right", "left"):
        own = {key: value for key, value in angles_rad.items() if key not in PELVIS_TRANSLATIONS
               and (key.startswith("pelvis_") if name == "pelvis" else key.endswith(f"_{name[0]}"))}
        words = (f"{key.removeprefix('pelvis_').removesuffix(f'_{name[0]}').replace('_', ' ')} "
                 f"{np.degrees(value):z.1f}°" for key, value in own.items())
        lines.append(f"{name}: {', '.join(words)}")
    return lines


# The page of an import or a check: how good each trial is, in words, numbers and figures. One file, no network.


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
        parts.append(_person_part(person))
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


def _person_part(person: Mapping[str, Any]) -> str:
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
