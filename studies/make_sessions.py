"""Makes data/sessions: what a gait laboratory would have recorded of three synthetic persons.
Nobody walked.

Each person (virtual_laboratory/people.py) walks with a foot of their own, moved and carried as the
reference subject is; each session (virtual_laboratory/session.py) then gets wrong what laboratories
do. Embedded are all persons at 1.1 m/s; the other speeds are written on demand, with --out.
data/sessions/README.md says what the result is and is not. The same files come out again on the
same machine, however many processes make them; after Ctrl-C the same command goes on.
"""

from __future__ import annotations

import argparse
import dataclasses
import os
import shutil
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

if __name__ == "__main__":  # sums in the same order whatever the machine has free
    os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")
sys.path.insert(0, str(Path(__file__).resolve().parent))

from contact_fit_study.keeping import kept, made_by
from make_reference_subject import QUICK_STEPS, STEPS, walk_trial
from virtual_laboratory.bench_truth import write_bench, write_bench_curves
from virtual_laboratory.figures import stance_curve, trial_figures
from virtual_laboratory.floor import session_floor
from virtual_laboratory.motion import Person
from virtual_laboratory.people import TruePerson, true_persons
from virtual_laboratory.session import Session, draw_session, session_tier
from virtual_laboratory.targets import (
    LEG_M,
    REFERENCE_STATURE_M,
    SETTINGS,
    Draw,
    describe,
    draw_trials,
)
from virtual_laboratory.writing import (
    Label,
    write_session_readme,
    write_subject,
    write_tables,
    write_trial,
)

from vsf_drake.base.schema import to_plain
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.motion.trial import default_model
from vsf_drake.simulation.batch.cases import digest

DATA = Path(__file__).resolve().parents[1] / "data" / "sessions"
SEED = 1
NOTICE = "SYNTHETIC, nobody walked this (made by studies/make_sessions.py)"
SPEEDS = {"0p9": 0.9, "1p1": 1.1, "1p4": 1.4}
"""Aimed at, m/s, by name of the folder."""
EMBEDDED = "1p1"
DAYS = {"A": (1, 2), "B": (1,), "C": (1,)}
"""Sessions by person; the second one is at the embedded speed alone."""


@dataclass(frozen=True)
class Task:
    """One trial: whose, on which day, at which speed, which of its draws."""

    person: str
    day: int
    speed: str
    number: int
    steps: int

    @property
    def folder(self) -> str:
        return f"{self.person.lower()}/day_{self.day}"

    @property
    def draw(self) -> Draw:
        return draws(self.person, self.day, self.speed)[self.number]

    @property
    def name(self) -> str:
        return f"{self.folder}/{self.speed}/{self.draw.name}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--out", type=Path, help=f"folder to write to; without it the embedded part goes to {DATA}"
    )
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument(
        "--speed", choices=[f"{value:g}" for value in SPEEDS.values()], help="one speed, m/s"
    )
    parser.add_argument("--person", choices=[name.lower() for name in DAYS], help="one person")
    parser.add_argument("--quick", action="store_true", help="one trial, coarsely; needs --out")
    arguments = parser.parse_args()
    if not arguments.out and (arguments.quick or arguments.person or arguments.speed):
        parser.error("a part of the set must not replace it: give --out")
    speeds = [name for name, value in SPEEDS.items() if arguments.speed in (None, f"{value:g}")]
    wanted = [
        Task(person, day, speed, number, QUICK_STEPS if arguments.quick else STEPS)
        for person, days in DAYS.items()
        if arguments.person in (None, person.lower())
        for day in days
        for speed in (speeds if arguments.out else [EMBEDDED])
        if day == 1 or speed == EMBEDDED
        for number in range(len(draws(person, day, speed)))
    ]
    make(arguments.out or DATA, wanted[: 1 if arguments.quick else None], arguments.workers)


def make(out: Path, wanted: list[Task], workers: int) -> None:
    """Writes the trials `wanted` to `out`; finished ones of an interrupted run are not made
    again."""
    began = time.perf_counter()
    for person in dict.fromkeys(task.person for task in wanted):
        of_person(out / person.lower(), persons()[person])
    parts: dict[Task, dict[str, Any]] = {}
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        running = {pool.submit(part, out, task): task for task in wanted}
        try:
            for i, done in enumerate(as_completed(running), 1):
                parts[running[done]] = done.result()
                print(
                    f"{i:3d}/{len(wanted)} {running[done].name} "
                    f"({time.perf_counter() - began:.0f} s)",
                    flush=True,
                )
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    rows = {task.name: parts[task] for task in wanted}
    write_tables(
        out,
        {
            f"{table}.csv": {name: dict(sorted(row[table].items())) for name, row in rows.items()}
            # sorted, as kept parts are
            for table in ("figures", "draws")
        },
        NOTICE,
    )
    write_session_readme(out, rows)
    shutil.rmtree(out / ".made")


def of_person(out: Path, person: TruePerson) -> None:
    """What belongs to all sessions of a person: the foot on its bench."""
    name = f"SYNTHETIC bench of person {person.name}'s foot"
    for write in (write_bench, write_bench_curves):
        write(out, person.foot, name=name, notice=NOTICE, seed=SEED + ord(person.name))


def part(out: Path, task: Task) -> dict[str, Any]:
    """What is known of a trial once it is written."""
    key = digest({"task": dataclasses.asdict(task), "seed": SEED, **made_by("make_sessions.py")})
    return kept(
        out / ".made" / Path(task.name).parent, task.draw.name, key, lambda: write(out, task)
    )[0]


def write(out: Path, task: Task) -> dict[str, Any]:
    """Makes a trial and writes its files; its figures, draw and curve."""
    person, of_day, draw = persons()[task.person], session(task.person, task.day), task.draw
    prosthesis = person.prosthesis(draw.fulcrum_m)
    trial = walk_trial(moving(task.person), prosthesis, draw, task.steps)
    index = (list(SPEEDS).index(task.speed), task.number)
    tier, own = (
        session_tier(trial, one, task.speed, index) for one in (of_day, of_day.of_trials_alone())
    )
    folder = out / task.folder
    subject = {key: value for key, value in to_plain(of_day.written).items() if value is not None}
    write_subject(
        folder,
        f"# {NOTICE}.\n# As measured on this day.\n"
        + "".join(
            f"{key}: {value}\n"
            for key, value in {**subject, "prosthetic_side": person.side}.items()
        ),
    )
    write_trial(
        folder,
        trial,
        tier,
        Label(
            name=of_day.written.name,
            notice=NOTICE,
            subject="../subject.yaml",
            mirrored=person.side == "left",
        ),
    )
    weight = person.subject.mass_kg * GRAVITY
    floors = {
        "floor_bw": session_floor(prosthesis, of_day, trial, tier),
        "own_floor_bw": session_floor(prosthesis, of_day.of_trials_alone(), trial, own),
    }
    figures = trial_figures(trial, moving(task.person)) | {
        name: found["grf_rmse_bw"] for name, found in floors.items()
    }
    return {
        "figures": figures,
        "draws": describe(trial.draw),
        "condition": draw.condition,
        "curve": stance_curve(trial, weight).tolist(),
    }


@cache
def persons() -> dict[str, TruePerson]:
    return {person.name: person for person in true_persons(SEED)}


@cache
def session(person: str, day: int) -> Session:
    return draw_session(
        persons()[person].subject,
        seed=(SEED, ord(person), day),
        name=f"SYNTHETIC person {person}, day {day}",
    )


@cache
def moving(person: str) -> Person:
    return Person(persons()[person].subject, default_model())


@cache
def draws(person: str, day: int, speed: str) -> list[Draw]:
    true = persons()[person]
    passive = ("passive",) if true.passive and speed == EMBEDDED else ()
    return draw_trials(
        [SEED, ord(person), day, list(SPEEDS).index(speed)],
        SPEEDS[speed],
        leg_m=LEG_M * true.subject.stature_m / REFERENCE_STATURE_M,
        conditions=(*SETTINGS, *passive),
    )


if __name__ == "__main__":
    main()
