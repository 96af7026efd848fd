"""Commands that a signal ends at some moment, and what the next run makes of what they left."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from command_line import read_json
from made_laboratory import STATED, Laboratory, leftovers
from sweep_files import copied

from vsf_drake.base.errors import InputError
from vsf_drake.motion.trial import load_trial
from vsf_drake.report.fit_output import FIT
from vsf_drake.report.tuning.chapters import TUNING
from vsf_drake.report.validation.output import VALIDATION
from vsf_drake.simulation.results import load_walk
from vsf_drake.walks.embedded import embedded_contact, embedded_trials

CODES = {"INT": 130, "TERM": 143, "KILL": -signal.SIGKILL}
SOON_S = 20.0
"""In which INT and TERM end a command, on a busy machine (a choice)."""
LOST_S = 5.0
"""In which a program ends with 0 that was about to: later it has not heard a signal (a choice)."""
PROGRAM = """
import signal  # tests that run in the background ignore SIGINT, and so would what they start
signal.signal(signal.SIGINT, signal.default_int_handler)
from vsf_drake.cli import main
print("begins", flush=True)
main()
"""
"""Python's own start, during which no program can answer a signal, is before the first word."""
UNLIKE = {
    "wall_s",
    "compile_s",
    "elapsed_s",
    "arrays_sha256",
    "times.csv",
    "from_cache",
    "history",
    ".vsf_drake.json",
}
"""Keys and files that are not the same in two runs: times, and hashes over them."""


@dataclass(frozen=True)
class Command:
    """A command line without `--out`."""

    name: str
    words: tuple[object, ...]
    table: str  # the file that is there when the results are
    read: Callable[[Path], Any]  # the product's own reader of them
    goes_on: str = ""  # a file with which the next run goes on if `--resume` is among its words


def commands(folder: Path) -> tuple[Command, ...]:
    """The shortest forms that pass through every stage, with their inputs in `folder`."""
    low = copied(embedded_trials("exact")[0], folder, window={"start_s": 0.4, "end_s": 1.3})
    contact = ("--contact", embedded_contact("exact"))
    laboratory = Laboratory(folder)
    recorded = laboratory.standing(), laboratory.walk()
    return (
        Command("simulate", (low, "--step-ms", 2), "result.yaml", load_walk),
        Command(
            "sweep",
            (low, "--fulcrum-mm", "66:151:8", "--workers", 2),
            "sweep.json",
            lambda out: read_json(out / "sweep.json"),
        ),
        Command(
            "fit", (low, "--quick", "--freeze", "curve.*"), "fit.json", FIT.read, "checkpoint.json"
        ),
        Command(
            "validate",
            (low, *contact, "--quick", "--workers", 2),
            "validation.json",
            VALIDATION.read,
        ),
        Command(
            "tune", (low, *contact, "--quick", "--cost", "push_off"), "tuning.json", TUNING.read
        ),
        Command(
            "import", (*recorded, *STATED), "import.json", lambda out: load_trial(out / "walk.yaml")
        ),
    )


def started(command: Command, out: Path) -> subprocess.Popen[str]:
    """The command in a session of its own, going on where it can; it has just begun."""
    words = [command.name, *command.words, "--out", out]
    if command.goes_on and (out / command.goes_on).exists():
        words.append("--resume")
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stdout is not None
    process.stdout.readline()
    return process


def interrupted(
    command: Command, name: str, moment_s: float, out: Path, whole: Path, *, always: bool = True
) -> list[str]:
    """What is wrong after a signal at `moment_s`, and after the next run, whose results are to be
    those of `whole`.

    Where nothing at all is left, the next run is a first one: without `always` it is then left out.
    """
    wrong = _wrong_end(command, name, moment_s, out, whole)
    if not always and not any(out.parent.iterdir()):
        return wrong
    again = started(command, out)
    said = again.communicate(timeout=900.0)[1]
    if again.returncode != 0:
        return [*wrong, f"the next run ends with {again.returncode}: {said[-300:]}"]
    wrong += [f"after the next run there is {part}" for part in leftovers(out.parent)]
    wrong += _unreadable(command, out)
    return wrong + list(differences(content(whole), content(out)))


def _wrong_end(command: Command, name: str, moment_s: float, out: Path, whole: Path) -> list[str]:
    """What is wrong with how the command ends after the signal, and with what it then leaves."""
    process, wrong = started(command, out), []
    try:
        process.wait(moment_s)
    except subprocess.TimeoutExpired:
        # Ctrl-C reaches every process of a terminal; who else ends a program names it
        if name == "INT":
            os.killpg(process.pid, signal.SIGINT)
        else:
            process.send_signal(signal.Signals[f"SIG{name}"])
    sent, over = time.monotonic(), process.poll() is not None
    said = process.communicate(timeout=300.0)[1]
    took, ended = time.monotonic() - sent, process.returncode
    if name != "KILL" and ended == -signal.Signals[f"SIG{name}"] and (out / command.table).exists():
        ended = 0  # the program was over, and Python about to end; a shell says 130 or 143
    if ended not in (0, CODES[name]):
        wrong.append(f"exit code {ended}: {said[-300:]}")
    if "Traceback" in said or (ended == CODES[name] and name != "KILL" and not said.strip()):
        wrong.append(f"no sentence: {said[-300:]!r}")
    if took > (SOON_S if ended else LOST_S) and not over:
        wrong.append(f"ended with {ended} only {took:.0f} s later")
    if ended == 0:
        wrong += differences(content(whole), content(out))
    if not gone_soon(process.pid):
        wrong.append(f"left running: {session_of(process.pid)}")
    if name != "KILL":
        wrong += [f"left {part}" for part in leftovers(out.parent)]
        wrong += _unreadable(command, out)
    return wrong


def content(out: Path) -> dict[str, Any]:
    """Every number and word of a folder of results, by file; pictures and pages by name only."""
    parsed: dict[str, Any] = {}
    for path in sorted(out.rglob("*")):
        if (
            path.is_file()
            and path.relative_to(out).parts[0] not in ("cache", "unfinished")
            and path.name not in UNLIKE
        ):
            parsed[path.relative_to(out).as_posix()] = _parsed(path)
    return parsed


def differences(old: Any, new: Any, place: str = "") -> Iterator[str]:
    """Where two of them differ; not in times."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted((old.keys() | new.keys()) - UNLIKE, key=str):
            if key in old and key in new:
                yield from differences(old[key], new[key], f"{place}/{key}")
            else:
                yield f"{place}/{key} is {'gone' if key in old else 'new'}"
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for i, pair in enumerate(zip(old, new, strict=True)):
            yield from differences(*pair, f"{place}[{i}]")
    elif old != new and not (
        isinstance(old, float) and isinstance(new, float) and math.isnan(old) and math.isnan(new)
    ):
        yield f"{place}: {str(old)[:60]} became {str(new)[:60]}"


def session_of(leader: int) -> list[str]:
    """Living processes of a session: what it has started stays in it, whoever its parent is now."""
    listed = subprocess.run(
        ["ps", "-o", "pid=,stat=", "-s", str(leader)], capture_output=True, text=True, check=False
    )
    return [line for line in listed.stdout.splitlines() if not line.split()[1].startswith("Z")]


def gone_soon(leader: int) -> bool:
    """Whether that session's processes end within ten seconds."""
    for _ in range(100):
        if not session_of(leader):
            return True
        time.sleep(0.1)
    return False


def _parsed(path: Path) -> Any:
    if path.suffix == ".json":
        return json.loads(path.read_text(encoding="utf-8"))
    if path.suffix == ".yaml":
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    if path.suffix == ".npz":
        with np.load(path, allow_pickle=False) as stored:
            return {name: stored[name].tolist() for name in stored.files}
    if path.suffix in (".csv", ".mot"):
        return path.read_text(encoding="utf-8").splitlines()
    return None


def _unreadable(command: Command, out: Path) -> list[str]:
    """Why results that are there cannot be read by the product itself."""
    if not (out / command.table).exists():
        return []
    try:
        command.read(out)
    except InputError as error:
        return [f"half-written: {error}"]
    return []
