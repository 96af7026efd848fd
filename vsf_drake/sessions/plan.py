"""Which file is what: `session.csv`, a row a file, as somebody wrote it or as the files are guessed
to be.

    file, role, fulcrum_mm, use, remark

`role` is one of ROLES, or `setting`, which says where the fulcrum stood at a setting that other
rows name: `soft, setting, 66, ,`. The rows of a passive foot have an empty cell there. `use` is yes
or no. The file is written where there is none, and never again.
"""

from __future__ import annotations

import csv
import dataclasses
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsf_drake.base.errors import require
from vsf_drake.base.files import csv_cells, read_bytes, write_text
from vsf_drake.base.sentences import say
from vsf_drake.device.bench_lines import CURVES
from vsf_drake.model.parameters import FootParameters
from vsf_drake.model.setting import moves
from vsf_drake.sessions.found import (
    BENCH,
    MAP,
    OTHER,
    PLAN_FILE,
    ROLES,
    STANDING,
    WALK,
    FoundFile,
)
from vsf_drake.simulation.fulcrum_place import fulcrum_place

SETTING = "setting"
COLUMNS = ("file", "role", "fulcrum_mm", "use", "remark")
MOST_BYTES = 2**20
USE = {"yes": True, "no": False}
DAY_S = 86_400.0
MASS_APART = 0.08
STATURE_APART = 0.03
"""Shares by which files of one person may differ in what they state of mass and stature (choices:
clothes and a year; shoes)."""


@dataclass(frozen=True, kw_only=True)
class PlanRow:
    """One row."""

    file: str  # its name in the folder; of role `setting` the name of that
    role: str
    fulcrum_mm: str = ""  # see `fulcrum_place`; or the name of a setting, or nothing
    use: bool = True
    remark: str = ""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Which files are used, and as what."""

    rows: tuple[PlanRow, ...]
    standing: Path | None
    walks: tuple[Path, ...]
    fulcrums_mm: tuple[float, ...]  # one a walk
    bench: Path | None
    marker_map: Path | None
    notes: tuple[str, ...]  # what a reader of the results should know of the choice


def guess(found: Sequence[FoundFile], foot: FootParameters) -> list[PlanRow]:
    """The rows as the files say them, walked on `foot`; of several standing trials that nearest in
    time to the walks is used, of several benches that of curves."""
    walks = [file for file in found if file.role == WALK and file.usable]
    middle = float(np.median([file.when_s for file in walks])) if walks else 0.0
    standing = [file for file in found if file.role == STANDING]
    nearest = min(standing, key=lambda file: abs(file.when_s - middle), default=None)
    benches = sorted(
        (file for file in found if file.role == BENCH), key=lambda file: file.path.suffix != CURVES
    )
    rows = []
    for file in found:
        use = file.usable
        remark = file.remark
        if file.role == STANDING and file is not nearest:
            assert nearest is not None
            use = False
            [remark] = say(
                "session",
                "farther",
                nearest=nearest.path.name,
                days=round(abs(file.when_s - nearest.when_s) / DAY_S),
            )
        elif file.role == BENCH and file is not benches[0]:
            use = False
            [remark] = say("session", "second_bench", first=benches[0].path.name)
        rows.append(
            PlanRow(
                file=file.path.name,
                role=file.role,
                fulcrum_mm=file.setting if moves(foot) else "",
                use=use,
                remark=remark,
            )
        )
    named = dict.fromkeys(row.fulcrum_mm for row in rows if row.use and _is_name(row.fulcrum_mm))
    return [*rows, *(PlanRow(file=name, role=SETTING) for name in named)]


def write_rows(path: Path, rows: Iterable[PlanRow]) -> None:
    """Writes the table."""
    words = {use: word for word, use in USE.items()}
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in rows:
        use = "" if row.role == SETTING else words[row.use]
        writer.writerow(csv_cells([row.file, row.role, row.fulcrum_mm, use, row.remark]))
    write_text(path, text.getvalue())


def read_rows(path: Path) -> list[PlanRow]:
    """The table that somebody wrote, with commas, semicolons or tabs between its cells; InputError
    with the line of what cannot be used."""
    content = read_bytes(path, most=MOST_BYTES)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("cp1252", errors="replace")  # as Excel saves it
    [head, *_] = text.splitlines() or [""]
    separator = max(",;\t", key=head.count)
    lines = csv.reader(io.StringIO(text), delimiter=separator)
    columns = [cell.strip() for cell in next(lines, [])]
    lacking = [name for name in COLUMNS[:4] if name not in columns]
    require(
        not lacking,
        f"has no column {' and no column '.join(lacking)}",
        "line 1",
        f"Its columns are {', '.join(COLUMNS)}",
        file=path,
    )
    rows = []
    for number, cells in enumerate(lines, start=2):
        told = {name: cell.strip() for name, cell in zip(columns, cells, strict=False)}
        if any(told.values()):
            rows.append(_row(told, path, f"line {number}"))
    twice = next((row.file for i, row in enumerate(rows) if row.file in _names(rows[:i])), None)
    require(twice is None, f"names {twice} twice", right="Keep one row a file", file=path)
    return rows


def _row(told: dict[str, str], path: Path, where: str) -> PlanRow:
    role = told.get("role", "").lower()
    known = (*ROLES, SETTING)
    require(
        role in known, f"{role!r} is no role", f"{where}, role", f"It is one of {', '.join(known)}",
        file=path,
    )  # fmt: skip
    use = told.get("use", "").lower() or "yes"
    require(use in USE, f"{use!r} is neither yes nor no", f"{where}, use", file=path)
    file = told.get("file", "").removeprefix("'")
    return PlanRow(
        file=file.lower() if role == SETTING else file,
        role=role,
        fulcrum_mm=told.get("fulcrum_mm", "").lower(),
        use=USE[use],
        remark=told.get("remark", "").removeprefix("'"),
    )


def missing(rows: Sequence[PlanRow], foot: FootParameters) -> list[str]:
    """What has to be stated before anything can be made of the rows, walked on `foot`, in
    sentences."""
    settings = {row.file: row.fulcrum_mm for row in rows if row.role == SETTING}
    walks = [row for row in rows if row.role == WALK and row.use]
    named: dict[str, list[str]] = {}
    for row in walks:
        if _is_name(row.fulcrum_mm) and moves(foot):
            named.setdefault(row.fulcrum_mm, []).append(row.file)
    return say(
        "session",
        "missing",
        walks=[row.file for row in walks],
        unset=[row.file for row in walks if not row.fulcrum_mm and moves(foot)],
        unknown={name: files for name, files in named.items() if name not in settings},
        unplaced=[name for name in named if settings.get(name) == ""],
        standing=any(row.role == STANDING and row.use for row in rows),
    )


def make_plan(
    rows: Sequence[PlanRow], found: Sequence[FoundFile], folder: Path, foot: FootParameters
) -> Plan:
    """What the rows ask for of `foot`; InputError for files that are not there, or files of two
    persons."""
    by_name = {file.path.name: file for file in found}
    used = [row for row in rows if row.use and row.role != SETTING]
    absent = [row.file for row in used if row.file not in by_name]
    require(
        not absent,
        f"not among the recordings of the folder: {', '.join(absent)}",
        right="Correct the name, or write no in the column use",
        file=folder / PLAN_FILE,
    )
    check_one_person([by_name[row.file] for row in used])
    settings = {row.file: row.fulcrum_mm for row in rows if row.role == SETTING}
    walks = [by_name[row.file] for row in used if row.role == WALK]
    chosen = {
        role: [by_name[row.file] for row in used if row.role == role]
        for role in (STANDING, BENCH, MAP)
    }
    middle = float(np.median([file.when_s for file in walks]))
    standing = sorted(chosen[STANDING], key=lambda file: abs(file.when_s - middle))
    return Plan(
        rows=tuple(rows),
        standing=_first(standing),
        walks=tuple(file.path for file in walks),
        fulcrums_mm=tuple(
            round(1e3 * _fulcrum_m(row, settings, foot, folder), 6)
            for row in used
            if row.role == WALK
        ),
        bench=_first(chosen[BENCH]),
        marker_map=_first(chosen[MAP]),
        notes=tuple(
            say(
                "session",
                "plan_notes",
                standing=[file.path.name for file in standing],
                days=[round(abs(file.when_s - middle) / DAY_S) for file in standing],
                rates=sorted({file.rate_hz for file in walks if file.rate_hz}),
                unlisted=sorted(set(by_name) - set(_names(rows))),
            )
        ),
    )


def check_one_person(files: Sequence[FoundFile]) -> None:
    """Raises InputError for files that say they are of two persons."""
    by_name: dict[str, list[str]] = {}
    for file in files:
        for name in file.subjects:
            by_name.setdefault(name, []).append(file.path.name)
    right = "Keep one person a folder, or write no in the column use of the other's files"
    require(
        len(by_name) < 2,
        "the files are of several persons: "
        + "; ".join(f"{name} ({', '.join(of)})" for name, of in by_name.items()),
        right=right,
    )
    for key, apart, unit in (("mass_kg", MASS_APART, "kg"), ("stature_m", STATURE_APART, "m")):
        stated = {file.path.name: file.person[key] for file in files if key in file.person}
        if not stated:
            continue
        low = min(stated, key=lambda name: stated[name])
        high = max(stated, key=lambda name: stated[name])
        require(
            stated[high] <= (1.0 + apart) * stated[low],
            f"{low} states {stated[low]:g} {unit} and {high} {stated[high]:g} {unit}: that is not "
            "one person",
            right=right,
        )


def _fulcrum_m(row: PlanRow, settings: dict[str, str], foot: FootParameters, folder: Path) -> float:
    """Where the fulcrum stood in this walk (m from A)."""
    named = row.fulcrum_mm in settings
    said = settings[row.fulcrum_mm] if named else row.fulcrum_mm
    return fulcrum_place(
        said.replace(",", ".") or None,  # as spreadsheets of many countries write numbers
        foot,
        file=folder / PLAN_FILE,
        where=f"{row.fulcrum_mm if named else row.file}, fulcrum_mm",
    )


def _is_name(text: str) -> bool:
    return bool(text) and not text[0].isdigit()


def _names(rows: Iterable[PlanRow]) -> list[str]:
    return [row.file for row in rows]


def _first(files: Sequence[FoundFile]) -> Path | None:
    return files[0].path if files else None


def with_guesses(rows: Sequence[PlanRow], found: Sequence[FoundFile]) -> list[PlanRow]:
    """Rows of somebody's with the remarks of the files where they have none."""
    remarks = {file.path.name: file.remark for file in found}
    return [
        row if row.remark else dataclasses.replace(row, remark=remarks.get(row.file, ""))
        for row in rows
    ]


def unused(rows: Iterable[PlanRow]) -> list[PlanRow]:
    """Files that are left out."""
    return [row for row in rows if row.role != SETTING and (not row.use or row.role == OTHER)]
