"""A session: from a folder of recordings to a verdict. What is done is kept in the results' folder
with a key of all that it was made of; the next run repeats what has another key.

    import   recordings to trials: import/        key: files and rows, what is stated of the person
    search   contact fitted to the softest and the stiffest walk: fit/      key: these, the bench
    judge    all other walks, the null model, the setting's effect          key: all trials, bench
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from vsf_drake.base.errors import InputError, require
from vsf_drake.base.files import plain, read_json, record, sha256, user_path, write_json
from vsf_drake.base.progress import Progress, part_of
from vsf_drake.base.sentences import say
from vsf_drake.device.bench_lines import load_measured_bench
from vsf_drake.fit.options import ContactFitOptions
from vsf_drake.fit.problem import ContactFit, check_recordings
from vsf_drake.model.contact_file import FittedContact, load_contact
from vsf_drake.model.model_file import load_model
from vsf_drake.model.parameters import FootParameters
from vsf_drake.model.setting import moves, setting_of
from vsf_drake.motion.import_options import ImportOptions
from vsf_drake.motion.manifest import load_stated_subject
from vsf_drake.motion.markers.person_facts import PersonFacts, check_facts
from vsf_drake.motion.trial import RecordingMark, Trial, default_model, load_trial
from vsf_drake.recording.import_walks import gather, import_walks
from vsf_drake.report.fit_output import CHECKPOINT, CONTACT
from vsf_drake.report.import_outputs import IMPORT, write_import
from vsf_drake.report.results_folder import PAGE
from vsf_drake.report.session_page import FIT_FOLDER, IMPORT_FOLDER, SESSION, STEPS
from vsf_drake.sessions.curves import WRITERS, excel_writer, walked_with
from vsf_drake.sessions.fitting import Checkpoint, FitTask, run_task
from vsf_drake.sessions.found import PLAN_FILE, SUBJECT_FILE, find_files, folders_below
from vsf_drake.sessions.plan import (
    Plan,
    guess,
    make_plan,
    missing,
    read_rows,
    with_guesses,
    write_rows,
)
from vsf_drake.sessions.table import (
    FITTED,
    HELD_OUT,
    LEFT_OUT,
    FitOutcome,
    SessionTable,
    SessionWalk,
    StepTime,
    judged_walks,
    outcome_of,
    outer_walks,
    verdict_of,
    what_next,
)
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.batch.cases import digest, software
from vsf_drake.walks.recorded_walk import labels_of

T = TypeVar("T")
SEARCH = "search.json"  # the end of the search, from which walks are judged again
_LOOKED, _IMPORTED, _JUDGED = 0.05, 0.3, 0.97
"""Shares of the bar at which looking, importing and fitting end."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Session:
    """A folder of recordings of one person, and what it is worth.

    Attributes:
        table: all that `session.json` holds: walks with role, mark, error and null (body weights),
            sentences, what to record next.
        trials: the imported walks that could be used, in the order of the folder.
        contact: fitted to two of them; None where the fit failed.
        failures: by file, why a walk that was to be used could not be imported.
    """

    table: SessionTable
    trials: tuple[Trial, ...]
    contact: FittedContact | None
    failures: Mapping[str, str]

    @property
    def verdict(self) -> str:
        """In a sentence or two."""
        return self.table.verdict


def session(
    folder: str | Path,
    *,
    out: str | Path,
    subject: str | Path | None = None,
    sex: str | None = None,
    prosthetic_side: str | None = None,
    model: str | Path | None = None,
    foot_length_mm: float | None = None,
    synthetic: bool = False,
    laboratory: Mapping[str, str | None] | None = None,
    curves: Sequence[str] = (),
    progress: Progress | None = None,
) -> Session:
    """From a folder of recordings of one person to a verdict, written to `out`.

    Reads every file of the folder, and `session.csv` in it, which says which file is what; where
    that is missing it is written as guessed. Imports the walks, fits the contact to the softest and
    the stiffest setting, and judges it by all other walks. A second call repeats only what
    depends on what has changed since.

    Args:
        folder: of the recordings (.c3d; .trc with forces beside them), a bench and a marker map;
            files in folders below it are not read. Nothing but session.csv is written there.
        out: folder for the results; it may not be `folder`.
        subject: YAML file of the person; `subject.yaml` in the folder if None and there is one.
        sex, prosthetic_side: where no such file says them.
        model: model file of the foot, one a session; the nominal one if None.
        foot_length_mm: of the prosthetic foot's shell; the model's if None.
        synthetic: nobody was recorded; all results say so.
        laboratory: `up`, `forward` and `length_unit` where the files do not say them.
        curves: what else is written, "csv", "excel" (with pandas) or "opensim" (see
            `sessions.curves`).

    Raises:
        InputError: something is missing or wrong; where session.csv has to be corrected it says
            what. SimulationError: a walk fails where it is imported.
    """
    folder = user_path(folder)
    out = user_path(out)
    require(
        folder.resolve() != out.resolve(),
        "is the folder of the recordings",
        "--out",
        "Choose another one: in the recordings' folder nothing is written but session.csv",
        file=out,
    )
    for kind in curves:
        require(
            kind in WRITERS,
            f"{kind!r} is no kind of curves",
            "curves",
            f"It is {', '.join(WRITERS)}",
        )
    if "excel" in curves:
        excel_writer()
    facts, stated, of_person = _person(folder, subject, sex, prosthetic_side)
    laboratory = {name: axis for name, axis in (laboratory or {}).items() if axis is not None}
    model = None if model is None else user_path(model)
    foot = (default_model() if model is None else load_model(model)).foot
    plan = _plan(folder, facts, laboratory, foot, part_of(progress, 0.0, _LOOKED))
    SESSION.check(out)
    _check_own(out, folder)
    steps = _Steps(out)
    options = ImportOptions(
        person=facts,
        stated=stated,
        marker_map=None if plan.marker_map is None else str(plan.marker_map),
        fulcrum_mm=tuple(map(str, plan.fulcrums_mm)) if moves(foot) else (),
        model=model,
        laboratory=laboratory,
        foot_length_mm=foot_length_mm,
        synthetic=synthetic,
    )
    walks, trials, failures = _imported(
        plan, options, of_person, out, steps, part_of(progress, _LOOKED, _IMPORTED - _LOOKED)
    )
    walks = _fit_for_fitting(walks, trials)
    usable = [trial for walk, trial in zip(walks, trials, strict=True) if walk.role != LEFT_OUT]
    require(
        usable,
        "no walk can be used",
        right=f"{out / IMPORT_FOLDER / IMPORT.kind}.html says why; record others",
        file=folder,
    )
    fitted = [usable[i] for i in outer_walks(usable)]
    walks = [
        replace(walk, role=FITTED) if trial in fitted else walk
        for walk, trial in zip(walks, trials, strict=True)
    ]
    outcome = _fitted(
        fitted,
        [trial for trial in usable if trial not in fitted],
        plan.bench,
        out,
        steps,
        part_of(progress, _IMPORTED, _JUDGED - _IMPORTED),
    )
    not_read = [
        SessionWalk(
            file=path.name,
            label=path.stem,
            role=LEFT_OUT,
            why=why,
            **vars(setting_of(foot, 1e-3 * mm)),
        )
        for path, mm in zip(plan.walks, plan.fulcrums_mm, strict=True)
        if (why := failures.get(str(path)))
    ]
    walks = sorted(
        [*judged_walks(walks, outcome), *not_read], key=lambda walk: (walk.setting_order, walk.file)
    )
    named = (*plan.walks, plan.standing, plan.bench, model)
    read = [path for path in named if path is not None]
    pages = [path.relative_to(out) for path in sorted((out / IMPORT_FOLDER).glob("*.html"))]
    table = SessionTable(
        folder=folder.resolve().name,
        person=usable[0].subject.name,
        side=usable[0].subject.prosthetic_side,
        synthetic=usable[0].synthetic,
        success=outcome.success,
        verdict=verdict_of(walks, outcome, usable[0].synthetic),
        sentences=outcome.headline,
        next=tuple(what_next(walks, bench=plan.bench is not None)),
        walks=tuple(walks),
        layer=outcome.layer,
        effect=outcome.effect,
        answer=outcome.answer,
        files=plan.rows,
        chosen=tuple(say("session", "chosen", walks=walks, bench=plan.bench and plan.bench.name)),
        notes=plan.notes,
        steps=tuple(steps.times),
        pages={path.stem: path.as_posix() for path in pages} | {"fit": f"{FIT_FOLDER}/{PAGE}"},
        provenance=provenance({path.name: sha256(path) for path in read}),
    )
    contact = load_contact(out / FIT_FOLDER / CONTACT) if outcome.success else None
    show = part_of(progress)

    def more(made: Path, _: object) -> None:
        for number, kind in enumerate(curves):
            show(f"writing curves ({kind})", _JUDGED + number * (1.0 - _JUDGED) / len(curves))
            WRITERS[kind](made, walked)

    walked = walked_with(usable, contact) if curves else []
    show("writing the page", _JUDGED)
    SESSION.write(out, plain(table), more=more)
    return Session(table=table, trials=tuple(usable), contact=contact, failures=failures)


def _check_own(out: Path, folder: Path) -> None:
    """Raises InputError if `out` holds what was made of another folder."""
    if not (out / SESSION.table).is_file():
        return
    made_of = read_json(out / SESSION.table, damaged="Remove it").get("folder")
    require(
        made_of == folder.resolve().name,
        f"holds the session of {made_of}",
        "--out",
        "Choose another folder, or remove this one",
        file=out,
    )


class _Steps:
    """What was done in a folder, by key."""

    def __init__(self, out: Path) -> None:
        self.path = out / STEPS
        self.kept: dict[str, Any] = {}
        self.times: list[StepTime] = []
        if self.path.is_file():
            self.kept = read_json(self.path, damaged="Remove it: every step is then done again")

    def done(self, name: str, key: str, make: Callable[[], Any], there: Path) -> Any:
        """What `make` made, as plain values, now or in an earlier run with the same key whose file
        `there` is still as it was. Where it is made again, the verdict of before goes."""
        began = time.perf_counter()
        kept = self.kept.get(name, {})
        same = kept.get("key") == key and there.is_file() and kept.get("sha256") == sha256(there)
        if not same:
            self._save(name, None)
            for verdict in (SESSION.table, PAGE):
                (self.path.parent / verdict).unlink(missing_ok=True)
            made = plain(make())
            digest_of = sha256(there) if there.is_file() else ""
            self._save(name, {"key": key, "sha256": digest_of, "made": made})
        self.times.append(StepTime(name=name, seconds=time.perf_counter() - began, kept=bool(same)))
        return self.kept[name]["made"]

    def _save(self, name: str, value: Any) -> None:
        self.kept.pop(name, None)
        if value is not None:
            self.kept[name] = value
        self.path.parent.mkdir(parents=True, exist_ok=True)
        write_json(self.path, self.kept)


def _person(
    folder: Path, subject: str | Path | None, sex: str | None, side: str | None
) -> tuple[PersonFacts, dict[str, float], dict[str, Any]]:
    """The person as stated, fields of `Subject` that win over the markers, and all of it as plain
    values."""
    file = folder / SUBJECT_FILE if subject is None else user_path(subject)
    if subject is None and not file.is_file():
        facts = PersonFacts(sex=sex, prosthetic_side=side, name=folder.resolve().name or "subject")
        return facts, {}, plain(facts)
    for name, given in (("--sex", sex), ("--prosthetic-side", side)):
        require(given is None, f"is given beside {file.name}, which says it", name, "Leave it out")
    facts, stated = load_stated_subject(file)
    return facts, stated, {**plain(facts), "stated": stated}


def _plan(
    folder: Path,
    facts: PersonFacts,
    laboratory: Mapping[str, str | None],
    foot: FootParameters,
    progress: Progress,
) -> Plan:
    """The plan of `session.csv`, which is written if there is none; InputError, after that, for
    what has to be stated first."""
    found = find_files(folder, laboratory, progress)
    below = say("session", "below", folders=folders_below(folder))
    require(
        found,
        "holds no recording (.c3d or .trc)",
        right=". ".join(("Name the folder in which the files themselves lie", *below)),
        file=folder,
    )
    path = folder / PLAN_FILE
    there = path.is_file()
    rows = with_guesses(read_rows(path), found) if there else guess(found, foot)
    written = there
    if not there and os.access(folder, os.W_OK):
        write_rows(path, rows)
        written = True
    to_correct = missing(rows, foot)
    unstated = [key for key in ("prosthetic_side", "sex") if getattr(facts, key) is None]
    asked = [
        *(f"{PLAN_FILE}: {sentence}" for sentence in to_correct),
        *say("session", "unstated", keys=unstated),
    ]
    if asked:
        lines = [*asked, *below]
        raise InputError(
            "\n".join(("more has to be stated:", *(f"- {sentence}" for sentence in lines))),
            file=folder,
            right="\n" + say("session", "correct", written=written, there=there)[0]
            if to_correct
            else None,
        )
    check_facts(facts)
    plan = make_plan(rows, found, folder, foot)
    return replace(plan, notes=(*plan.notes, *(f"! {sentence}" for sentence in below)))


def _imported(
    plan: Plan,
    options: ImportOptions,
    of_person: Mapping[str, Any],
    out: Path,
    steps: _Steps,
    progress: Progress,
) -> tuple[list[SessionWalk], list[Trial], dict[str, str]]:
    """The walks, a trial of each, and by file why others could not be imported."""
    folder = out / IMPORT_FOLDER
    gathered = gather(plan.standing, plan.walks)
    used = (gathered.standing, gathered.standing_forces, *gathered.walks, *gathered.forces)
    key = digest(
        {
            "files": [None if path is None else (path.name, sha256(path)) for path in used],
            "map": None if plan.marker_map is None else sha256(plan.marker_map),
            "fulcrum_mm": plan.fulcrums_mm,
            "model": None if options.model is None else sha256(options.model),
            "person": of_person,
            "laboratory": dict(options.laboratory),
            "foot_length_mm": options.foot_length_mm,
            "synthetic": options.synthetic,
            "software": software(),
        }
    )

    def make() -> dict[str, str]:
        try:
            imported = import_walks(gathered, options, progress=progress)
        except InputError as error:
            where, named, _ = (error.where or "").partition(" (--")
            if not named:
                raise
            right = " ".join(filter(None, (error.right, *say("session", "here"))))
            raise InputError(error.what, file=error.file, where=where, right=right) from None
        progress("writing the import", 0.95)
        write_import(imported, folder)
        return imported.failures

    failures: dict[str, str] = steps.done("import", key, make, folder / IMPORT.table)
    files = [path for path in gathered.walks if str(path) not in failures]
    rows = IMPORT.read(folder)[0]["trials"]
    trials = [_judged(folder / row["manifest"], row) for row in rows]
    walks = [
        SessionWalk(
            file=path.name,
            label=label,
            role=LEFT_OUT if row["mark"] == "unusable" else HELD_OUT,
            **vars(trial.setting),
            mark=row["mark"],
            expected_error_bw=row["expected_error_bw"],
            verdict=row["verdict"],
            why=row["verdict"] if row["mark"] == "unusable" else "",
        )
        for path, label, row, trial in zip(files, labels_of(trials), rows, trials, strict=True)
    ]
    return walks, trials, failures


def _fit_for_fitting(walks: Sequence[SessionWalk], trials: Sequence[Trial]) -> list[SessionWalk]:
    """The walks, those left out that no fit can use beside the others before them: a stance that a
    plate saw in part, the same recording again."""
    accepted: list[Trial] = []
    told = []
    for walk, trial in zip(walks, trials, strict=True):
        try:
            if walk.role != LEFT_OUT:
                check_recordings([*accepted, trial], series=ContactFitOptions().series)
                accepted.append(trial)
            told.append(walk)
        except InputError as error:
            why = str(error).removeprefix(f"{trial.path}: ")
            told.append(replace(walk, role=LEFT_OUT, why=why))
    return told


def _judged(manifest: Path, row: Mapping[str, Any]) -> Trial:
    """The trial with what the import said of its recording."""
    mark = RecordingMark(
        mark=row["mark"], expected_error_bw=row["expected_error_bw"], verdict=row["verdict"]
    )
    trial = load_trial(manifest)
    return replace(trial, judged=mark, notes=(mark.note, *trial.notes))


def _fitted(
    fitted: Sequence[Trial],
    held_out: Sequence[Trial],
    bench_file: Path | None,
    out: Path,
    steps: _Steps,
    progress: Progress,
) -> FitOutcome:
    """The contact fitted to some walks and judged by the others."""
    folder = out / FIT_FOLDER
    bench = None if bench_file is None else load_measured_bench(bench_file)
    problem = ContactFit(fitted, bench=bench, options=ContactFitOptions(starts=1))
    key = digest(
        {
            "fit": problem.key,
            "held_out": [(trial.path.name, trial.inputs, trial.fulcrum_m) for trial in held_out],
            "judged": [plain(trial.judged) for trial in (*fitted, *held_out)],
            "software": software(),
        }
    )

    def make() -> FitOutcome:
        task = FitTask(
            problem=problem,
            held_out=held_out,
            quick=True,
            own_height=False,
            options={"quick": True, "bench": bench_file and bench_file.name},
            inputs={} if bench_file is None else {f"bench: {bench_file.name}": sha256(bench_file)},
        )
        begun = folder / CHECKPOINT
        if not _is_of(begun, problem) and _is_of(out / SEARCH, problem):
            write_json(begun, read_json(out / SEARCH))
        checkpoint = _KeptCheckpoint(begun, resume=_is_of(begun, problem), copy=out / SEARCH)
        table = run_task(task, folder, checkpoint, progress)
        contact = load_contact(folder / CONTACT) if table.success else None
        return outcome_of(table, contact, [*fitted, *held_out])

    return record(FitOutcome, steps.done("fit", key, make, folder / "fit.json"))


class _KeptCheckpoint(Checkpoint):
    """One whose last state stays when the fit is done."""

    def __init__(self, path: Path, *, resume: bool, copy: Path) -> None:
        super().__init__(path, resume=resume)
        self.copy = copy

    def save(self, state: Mapping[str, Any]) -> None:
        """Replaces the state on disk, and its copy."""
        super().save(state)
        write_json(self.copy, state)


def _is_of(path: Path, problem: ContactFit) -> bool:
    """Whether a checkpoint is of this fit."""
    try:
        return path.is_file() and read_json(path).get("key") == problem.key
    except InputError:
        return False
