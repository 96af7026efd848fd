"""Runs the sections of the validation one after the other, and puts together what `validation.json`
and `.npz` hold.

What is finished survives an interruption.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Container, Iterable, Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vsf_drake.base.errors import FitError, InputError, SimulationError
from vsf_drake.base.files import (
    plain,
    read_json,
    read_npz,
    record,
    replaced,
    sha256,
    table_of,
    write_json,
)
from vsf_drake.base.progress import Progress
from vsf_drake.base.schema import to_plain
from vsf_drake.base.sentences import say
from vsf_drake.laws.compiled import sources_sha256
from vsf_drake.model.bench_curves import bench_doubts
from vsf_drake.motion.fitted_trial import fingerprint
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.batch.cases import digest, software
from vsf_drake.validation.bench_section import (
    BenchSectionTable,
    StoodTable,
    bench_section,
    standing_section,
)
from vsf_drake.validation.energy_section import EnergyTable, energy_section
from vsf_drake.validation.moved_section import MovedTable, moved_section
from vsf_drake.validation.roll_over_section import RollOverTable, roll_over_section
from vsf_drake.validation.sensitivity_section import SensitivityTable
from vsf_drake.validation.settings_section import SettingsTable
from vsf_drake.validation.study import HELD_OUT, Section, Study
from vsf_drake.validation.walking_section import (
    LayersTable,
    WalkingTable,
    layers_section,
    summary,
    walk_row,
    walking_section,
)

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

SHIPPED = "data/validation"
"""Sections of the embedded study that take long, as `studies/ship_validation.py` makes them."""


class Part(NamedTuple):
    """A section: what computes it, the record that it then holds, and about how long that takes
    (s)."""

    make: Callable[..., Section[object]]
    table: type
    about_s: float  # which only the progress depends on


_SECTIONS = {  # what a page needs first comes first
    "moved": Part(moved_section, MovedTable, 2.0),
    "bench": Part(bench_section, BenchSectionTable, 5.0),
    "walking": Part(walking_section, WalkingTable, 20.0),
    "energy": Part(energy_section, EnergyTable, 30.0),
    "layers": Part(layers_section, LayersTable, 5.0),
    "standing": Part(standing_section, StoodTable, 5.0),
    "roll_over": Part(roll_over_section, RollOverTable, 20.0),
}
EXACT = {f"{name}_exact": _SECTIONS[name] for name in ("layers", "walking")}
"""Sections of a second study: the same walks without errors of measurement."""
SETTINGS = ("bench", "energy", "roll_over")
"""Sections of settings, of which a passive foot has one."""
COMPARED = ("moved", "walking", "layers")
"""Sections of the walks that have a plate."""
LONG = {"settings": SettingsTable, "sensitivity": SensitivityTable}
"""Sections that come with the package, with the record that each holds."""
NAMES = (*_SECTIONS, *EXACT, *LONG)
EVERY_S = 5.0
PAGE_SHARE = 0.1
"""Least time between two pages that grow, and the share of it that writing them may take
(choices)."""
_PACKAGE = Path(__file__).resolve().parents[1]


def tables() -> dict[str, type]:
    """The records of the sections, by name."""
    return {name: part.table for name, part in (_SECTIONS | EXACT).items()} | LONG


@dataclass(frozen=True, kw_only=True, eq=False)
class Finished:
    """A section with how long it took (s); `section` is None if it failed, and `failure` says
    why."""

    section: Section[object] | None
    wall_s: float
    failure: str = ""
    computed: str = ""  # the date, of one that comes with the package


def run_sections(
    study: Study,
    *,
    exact: Study | None = None,
    folder: str | Path | None = None,
    shipped: SectionStore | None = None,
    grown: Callable[[Mapping[str, Finished], list[str]], None] | None = None,
    progress: Progress | None = None,
) -> dict[str, Finished]:
    """Every section of the validation, and of `exact`, the same walks without errors of
    measurement.

    A section that fails (a bench that gives way, a simulation that diverges) is named with the
    reason and stops no other. Finished sections are kept in `folder`, so that an interrupted run of
    the same study goes on; those that take long may come from `shipped`. `grown` is called with
    what is finished and what is to come, after the first section that was computed and then, not
    too often, after others but the last.
    """
    finished: dict[str, Finished] = {}
    taught = study.contact and (study.contact.momentum or study.contact.person_curve)
    stored = {
        name: one for name, table in LONG.items() if shipped and (one := shipped.read(name, table))
    }
    compared = study.compared
    plan = [
        (name, part, compared if name in COMPARED else study)
        for name, part in _SECTIONS.items()
        # no plate taught it any layers, or there is none
        if (taught or name != "layers")
        and (compared.walks or name not in COMPARED)
        and not (study.passive and name in SETTINGS)
    ]
    if exact is not None:
        plan += [(name, part, exact) for name, part in EXACT.items()]
    total = sum(part.about_s for _, part, _ in plan)
    before = 0.0
    next_s = -math.inf
    for i, (name, part, own) in enumerate(plan):

        def show(
            what: str, fraction: float, name: str = name, before: float = before, part: Part = part
        ) -> None:
            if progress:
                share = part.about_s * min(max(fraction, 0.0), 1.0)
                progress(f"{name.replace('_', ' ')}: {what}", (before + share) / total)

        before += part.about_s
        store = None if folder is None else SectionStore(Path(folder), study_key(own))
        earlier = store.read(name, part.table) if store else None
        if earlier is not None:
            finished[name] = replace(earlier, computed="")
            continue
        show("starting", 0.0)
        began = time.perf_counter()
        section = None
        failure = ""
        try:
            section = part.make(own, progress=show)
        except (InputError, SimulationError, FitError) as error:
            failure = str(error)
        finished[name] = Finished(
            section=section, wall_s=time.perf_counter() - began, failure=failure
        )
        if store:
            store.write(name, finished[name])
        ended_s = time.perf_counter()
        if grown and i + 1 < len(plan) and ended_s > next_s:
            show("writing the page", 1.0)
            grown(finished, [*(name for name, _, _ in plan[i + 1 :]), *stored])
            shown_s = time.perf_counter()
            next_s = shown_s + max(EVERY_S, (shown_s - ended_s) / PAGE_SHARE)
    return finished | stored


def study_key(study: Study) -> str:
    """Of all that a section's numbers depend on: files, contact, options, software; not the number
    of workers."""
    return digest(
        {
            **_given(study),
            "full": study.options.full,
            "software": software(),
            "spm1d": find_spec("spm1d") is not None,
            "sources": sources_sha256(_PACKAGE, ["."]),
        }
    )


def shipped_key(study: Study) -> str:
    """Of what sections that come with the package were computed from: files, contact and options.
    That present sources give the same is for `studies/check_stored.py` to tell."""
    return digest(_given(study))


def _given(study: Study) -> dict[str, object]:
    return {
        "inputs": dict(study.inputs),
        "walks": [(walk.label, walk.role) for walk in study.walks],
        "failed": [list(pair) for pair in study.failed],
        "model": to_plain(study.model),
        "options": {
            name: value
            for name, value in to_plain(study.options).items()
            if name not in ("workers", "full")
        },
        "contact": None if study.contact is None else study.contact.values,
    }


class SectionStore:
    """A folder of finished sections of an unfinished validation, each complete or not there; it is
    created when the first is written. What another key (see `study_key`) left is not read."""

    def __init__(self, folder: Path, key: str) -> None:
        self.folder = folder
        self.key = key

    def read(self, name: str, table: type[DataclassInstance]) -> Finished | None:
        """The section; None if it is not there, damaged, or of another key."""
        path = self.folder / f"{name}.json"
        try:
            saved = read_json(path)
            if saved["key"] != self.key or saved["arrays_sha256"] != sha256(
                path.with_suffix(".npz")
            ):
                return None
            section = Section(
                table=record(table, saved["table"]),
                arrays=read_npz(path.with_suffix(".npz")),
                missing=tuple(saved["missing"]),
            )
            return Finished(
                section=section, wall_s=float(saved["wall_s"]), computed=str(saved["computed"])
            )
        except (ValueError, TypeError, KeyError, InputError):
            return None

    def write(self, name: str, finished: Finished) -> None:
        """Keeps a section that did not fail; InputError if the folder cannot be written."""
        arrays = self.folder / f"{name}.npz"
        section = finished.section
        if section is None:
            return
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with replaced(arrays, "wb", lasting=True) as stream:
                np.savez_compressed(stream, allow_pickle=False, **section.arrays)
            write_json(
                self.folder / f"{name}.json",
                {
                    "key": self.key,
                    "computed": time.strftime("%Y-%m-%d", time.gmtime()),
                    "wall_s": finished.wall_s,
                    "table": plain(section.table),
                    "missing": list(section.missing),
                    "arrays_sha256": sha256(arrays),
                },
                sort=False,
            )
        except OSError as error:
            raise InputError(
                f"cannot be written ({error.strerror or error})", file=self.folder
            ) from None

    def remove(self, names: Iterable[str]) -> None:
        """Takes away these sections, and the folder if nothing else is in it."""
        names = frozenset(names)
        with contextlib.suppress(OSError):
            for path in [path for path in self.folder.iterdir() if is_kept(path, names)]:
                path.unlink()
            self.folder.rmdir()


def is_kept(path: Path, names: Container[str]) -> bool:
    """Whether a file of a store's folder is of one of these sections, complete or not."""
    return (
        path.suffix in (".json", ".npz", ".part")
        and path.name.lstrip(".").partition(".")[0] in names
    )


# What the files hold: a finished study as records and arrays.


@dataclass(frozen=True, kw_only=True)
class SavedSection:
    """A section as `validation.json` has it; no table if it failed."""

    table: object | None
    missing: tuple[str, ...]
    wall_s: float
    failure: str


@dataclass(frozen=True, kw_only=True)
class SummaryRow:
    """A line of the summary: `value` as its section holds it at `key`, and whether it is as
    `asked`, which only measured data can tell."""

    what: str
    key: str  # "section/key/key"
    value: float | bool | None
    unit: str
    paper: str | None
    shown: str | None
    asked: str | None
    met: bool | None
    synthetic: bool  # what it is about; the paper's figure then does not stand beside it


@dataclass(frozen=True, kw_only=True)
class Validation:
    """A finished validation, as `validation.json` has it."""

    title: str
    verdict: tuple[str, ...]  # sentences, the one that decides first
    first_line: str
    synthetic: bool  # any walk, or the bench
    sections: Mapping[str, SavedSection]
    options: Mapping[str, object]  # of `StudyOptions`, with the step
    contact: str
    failed: tuple[tuple[str, str], ...]  # labels of what could not be used, and why
    notes: tuple[str, ...]
    trials: tuple[Mapping[str, object], ...]
    """of each walk what is known beforehand, and how the prosthesis sits under its pylon (height +
    shorter, fore-aft + forward, alignment + toe up)"""
    provenance: Mapping[str, object]
    summary: tuple[SummaryRow, ...]


def validation_content(
    study: Study, finished: Mapping[str, Finished], *, exact: Study | None = None
) -> tuple[Validation, dict[str, np.ndarray]]:
    """Content and arrays ("section/name") of a validation from its sections, of `run_sections`."""
    sections = {name: one.section for name, one in finished.items()}
    found = {name: section.table for name, section in sections.items() if section}
    bench_synthetic = study.bench is not None and study.bench.synthetic
    rows = summary_rows(found, synthetic=study.synthetic, bench_synthetic=bench_synthetic)
    held_out = summary([walk_row(walk) for walk in study.walks if walk.role == HELD_OUT])
    content = Validation(
        title=f"Validation: {study.walks[0].trial.subject.name or 'a walking person'}",
        first_line=first_line(study),
        verdict=tuple(
            say(
                "validation",
                "verdict",
                found=found,
                held_out=held_out,
                synthetic=study.synthetic,
                to_come="walking" not in finished and bool(study.compared.walks),
                summary=rows,
                passive=study.passive,
            )
        ),
        synthetic=study.synthetic or bench_synthetic,
        sections={
            name: SavedSection(
                table=one.section.table if one.section else None,
                missing=(
                    *say("validation", "shipped", date=one.computed),
                    *(one.section.missing if one.section else ()),
                ),
                wall_s=one.wall_s,
                failure=one.failure,
            )
            for name, one in finished.items()
        },
        options=to_plain(study.options) | {"step_s": study.options.step_s},
        contact=say("validation", "contact", contact=study.contact, name=study.contact_name)[0],
        failed=study.failed,
        notes=tuple(_notes(study, finished)),
        trials=tuple(
            {
                "height_mm": 1e3 * walk.trial.offsets.height_m,
                "fore_aft_mm": 1e3 * walk.trial.offsets.fore_aft_m,
                "alignment_deg": math.degrees(walk.trial.offsets.alignment_rad),
                "label": walk.label,
                "role": walk.role,
                **vars(walk.setting),
                "synthetic": walk.trial.synthetic,
                "warnings": " ".join(walk.warnings) or None,
            }
            for walk in study.walks
        ),
        provenance=provenance(
            dict(study.inputs)
            | {
                f"exact, {name}": digest for name, digest in (exact.inputs if exact else {}).items()
            },
            seed=study.options.seed,
        ),
        summary=rows,
    )
    return content, {
        f"{name}/{key}": array
        for name, section in sections.items()
        if section
        for key, array in section.arrays.items()
    }


def first_line(study: Study) -> str:
    """Where the data come from, in one sentence."""
    return say("validation", "first_line", walks=study.walks, bench=study.bench)[0]


def _notes(study: Study, finished: Mapping[str, Finished]) -> list[str]:
    recordings: dict[str, list[str]] = {}
    for walk in study.walks:
        recordings.setdefault(fingerprint(walk.recorded), []).append(walk.label)
    return say(
        "validation",
        "notes",
        study=study,
        bench=bench_doubts(study.bench) if study.bench else (),
        recordings=recordings.values(),
        finished=finished,
    )


# What the validation comes to: its main figures beside the paper's and beside what is asked of this
# model.
#
# Published: McGeehan, Adamczyk, Nichols and Hahn 2021, doi 10.1115/1.4050456.


def summary_rows(
    sections: Mapping[str, object], *, synthetic: bool, bench_synthetic: bool
) -> tuple[SummaryRow, ...]:
    """The summary of the sections' tables by name; what is not there gives a row with an unknown
    value. `synthetic` are the walks."""
    saved = plain(sections)

    def at(key: str) -> Any:
        value = saved
        for part in key.split("/"):
            value = value.get(part) if isinstance(value, Mapping) else None
        return value

    rows = []
    # Where a value stands, what it is, its unit as it is shown, by what it is multiplied then, its
    # format (none for yes or no), the published figure in words, and what is asked of it.
    for line in table_of("validation/summary.csv"):
        key = line["key"]
        what = line["what"]
        scale = float(line["scale"])
        asked = line["asked"]
        value = at(key)
        fitted = key.startswith("bench/") and bool(at("bench/contact_on_bench"))
        made = bench_synthetic if key.startswith("bench/") else synthetic
        if fitted:
            what += " (fitted to a bench)"
        if key == "energy/ledger_remainder_share_max" and value is not None:
            what += f" (in steps of {1e3 * at('energy/step_s'):g} ms)"
        if made or fitted:
            asked = ""
        if value is None:
            shown = None
        elif line["form"]:
            shown = line["form"].format(scale * value)
        else:
            shown = "yes" if value else "no"
        rows.append(
            SummaryRow(
                what=what,
                key=key,
                value=value,
                unit=line["unit"],
                paper=line["paper"] or None,
                shown=shown,
                asked=asked or None,
                met=_met(value, asked, scale),
                synthetic=made,
            )
        )
    return tuple(rows)


def _met(value: Any, asked: str, scale: float) -> bool | None:
    """Whether a value is as a line of the summary asks; None where that cannot be told."""
    if value is None or not asked:
        return None
    relation, _, limit = asked.rpartition(" ")
    if not relation:
        return bool(value)
    most = float(limit) / scale
    return bool(value <= most if relation == "at most" else value >= most)
