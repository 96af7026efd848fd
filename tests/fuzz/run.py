"""The long form of the fuzzers; the short one runs with the tests.

    python tests/fuzz/run.py files --count 101000 [--reader c3d] [--seed 0] [--validation FOLDER]
    python tests/fuzz/run.py walks --count 10000 [--step-ms 1]
    python tests/fuzz/run.py kills --moments 30 [--command sweep] [--signal KILL]

Each prints its progress and every fault, and ends with exit code 1 if there was any. A fault of a file is found again
by its reader and number: `--reader NAME --seed NUMBER --count 1`.
"""

from __future__ import annotations

import argparse
import faulthandler
import math
import multiprocessing
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "helpers"), str(HERE.parents[1] / "studies")]

CHUNK = 25
HANGS_S = 120.0
"""A call that no signal ends is ended with its process after this time."""
ALWAYS = 5
"""Each so many-th interruption is followed by the next run, even where the interrupted one left nothing."""
_workbench = None


def main() -> int:
    """Runs one of the three; how many faults there were, at most 1."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("files", "walks", "kills"))
    parser.add_argument("--count", type=int, default=1000, help="mutations, or walks")
    parser.add_argument("--seed", type=int, default=0, help="the first number")
    parser.add_argument("--reader", help="only this one")
    parser.add_argument("--validation", type=Path, help="folder of a finished `vsf-drake validate --quick`")
    parser.add_argument("--step-ms", type=float, default=1.0)
    parser.add_argument("--moments", type=int, default=30)
    parser.add_argument("--command", help="only this one")
    parser.add_argument("--signal", choices=("INT", "TERM", "KILL"), help="only this one")
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    started = time.monotonic()
    faults = {"files": files, "walks": walks, "kills": kills}[given.what](given)
    print(f"{faults} faults, {time.monotonic() - started:.0f} s")
    return min(faults, 1)


def files(given: argparse.Namespace) -> int:
    """Damaged files."""
    from readers import READERS  # noqa: PLC0415 (not every form needs it)

    chosen = [reader for reader in READERS if given.reader in (None, reader.name)]
    share = given.count / sum(1.0 / reader.slow for reader in chosen)
    ends = {reader.name: given.seed + math.ceil(share / reader.slow) for reader in chosen}
    chunks = [(name, first, min(CHUNK, end - first)) for name, end in ends.items()
              for first in range(given.seed, end, CHUNK)]
    faults, kinds = 0, set[str]()
    with tempfile.TemporaryDirectory() as folder, ProcessPoolExecutor(
            given.workers, mp_context=multiprocessing.get_context("spawn"), initializer=_begin,
            initargs=(folder, given.validation)) as pool:
        todo = {pool.submit(_damaged, *chunk): chunk for chunk in chunks}
        try:
            for i, future in enumerate(as_completed(todo), start=1):
                name = todo[future][0]
                for number, fault in future.result():
                    faults += 1
                    if (kind := f"{name}: {fault[:60]}") not in kinds:
                        kinds.add(kind)
                        print(f"{name} {number}: {fault}", flush=True)
                if i % 200 == 0 or i == len(todo):
                    print(f"{i} of {len(todo)} chunks, {faults} faults of {len(kinds)} kinds", flush=True)
        except BrokenProcessPool:
            lost = [chunk for future, chunk in todo.items() if not future.done() or future.exception()]
            print(f"a process ended (killed, or hung for {HANGS_S:g} s); among the first of: {lost[:4]}")
            return faults + 1
    return faults


def _begin(folder: str, validation: Path | None) -> None:
    global _workbench  # noqa: PLW0603 (one a process)
    from readers import Workbench  # noqa: PLC0415

    _workbench = Workbench(Path(tempfile.mkdtemp(dir=folder)), validation=validation)


def _damaged(name: str, first: int, count: int) -> list[tuple[int, str]]:
    """Faults by number."""
    from readers import READERS  # noqa: PLC0415

    assert _workbench is not None
    reader, faults = next(reader for reader in READERS if reader.name == name), []
    for number in range(first, first + count):
        faulthandler.dump_traceback_later(HANGS_S, exit=True)
        fault = _workbench.fault(reader, number)
        faults += [(number, fault)] if fault is not None else []
    faulthandler.cancel_dump_traceback_later()
    return faults


def walks(given: argparse.Namespace) -> int:
    """Walks with random parameters."""
    from drawn_walks import assert_sound, report  # noqa: PLC0415

    drawn, chunk = [], 100
    with ProcessPoolExecutor(given.workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        for future in as_completed([
                pool.submit(_drawn, i % 3, min(chunk, given.count - first), given.seed + i, given.step_ms)
                for i, first in enumerate(range(0, given.count, chunk))]):
            drawn += future.result()
            print(f"{len(drawn)} of {given.count} walks", flush=True)
    print(report(drawn))
    try:
        assert_sound(drawn)
    except AssertionError as fault:
        print(f"not sound: {fault}")
        return 1
    return 0


def _drawn(setting: int, count: int, seed: int, step_ms: float) -> list[Any]:
    from drawn_walks import drawn  # noqa: PLC0415

    return drawn(setting, count, seed=seed, step_s=1e-3 * step_ms)


def kills(given: argparse.Namespace) -> int:
    """Commands ended by signals."""
    from kills import CODES, commands, content, differences, interrupted, moments, started  # noqa: PLC0415

    faults: list[str] = []
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(given.workers) as pool:
        inputs, todo = Path(name, "inputs"), {}
        inputs.mkdir()
        for command in (each for each in commands(inputs) if given.command in (None, each.name)):
            whole, again = (Path(name, command.name, part) for part in ("out", "again"))
            for out in (whole, again):  # the first compiles
                process, began = started(command, out), time.monotonic()
                said = process.communicate()[1]
                usual_s = time.monotonic() - began
                if process.returncode:
                    print(f"exit code {process.returncode}: {said}")
                    return 1
            faults += [f"{command.name}, uninterrupted twice: {fault}" for fault in differences(
                content(whole), content(again))]
            for signal in [given.signal] if given.signal else CODES:
                for i, at in enumerate(moments(usual_s, given.moments, f"{given.seed} {command.name} {signal}")):
                    out = Path(name, f"{command.name}_{signal}_{i}", "out")
                    out.parent.mkdir()
                    todo[pool.submit(interrupted, command, signal, at, out, whole, always=i % ALWAYS == 0)] = (
                        f"{command.name} {signal} at {at:.2f} s")
        for i, future in enumerate(as_completed(todo), start=1):
            faults += [f"{todo[future]}: {fault}" for fault in future.result()[:5]]
            if i % 15 == 0 or i == len(todo):
                print(f"{i} of {len(todo)} interruptions", *faults, sep="\n", flush=True)
    return len(faults)


if __name__ == "__main__":
    sys.exit(main())
