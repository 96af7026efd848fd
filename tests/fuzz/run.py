"""The long form of the fuzzers; the short one runs with the tests.

    python tests/fuzz/run.py files --count 101000 [--reader c3d] [--seed 0] [--validation FOLDER]
    python tests/fuzz/run.py walks --count 10000 [--step-ms 1]
    python tests/fuzz/run.py kills --moments 30 [--command sweep] [--signal KILL]

Each prints its progress and every fault, and ends with exit code 1 if there was any. A fault of a
file is found again by its reader and number: `--reader NAME --seed NUMBER --count 1`.
"""

from __future__ import annotations

import argparse
import math
import random
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "helpers"), str(HERE.parents[1] / "studies")]


def files(given: argparse.Namespace) -> Iterator[str]:
    """Damaged files."""
    from readers import READERS, Workbench  # noqa: PLC0415 (not every form needs it)

    chosen = [reader for reader in READERS if given.reader in (None, reader.name)]
    share = given.count / sum(1.0 / reader.slow for reader in chosen)
    with tempfile.TemporaryDirectory() as folder:
        workbench = Workbench(Path(folder), validation=given.validation)
        for reader in chosen:
            numbers = range(given.seed, given.seed + math.ceil(share / reader.slow))
            print(f"{reader.name}: {len(numbers)} mutations", flush=True)
            yield from (
                f"{reader.name} {n}: {fault}"
                for n in numbers
                if (fault := workbench.fault(reader, n))
            )


def walks(given: argparse.Namespace) -> Iterator[str]:
    """Walks with random parameters."""
    from drawn_walks import assert_sound, drawn  # noqa: PLC0415

    for i, first in enumerate(range(0, given.count, 100)):
        done = drawn(
            i % 3, min(100, given.count - first), seed=given.seed + i, step_s=1e-3 * given.step_ms
        )
        print(
            f"{len(done)} walks, {sum(one.failure is not None for one in done)} left the model's "
            "range",
            flush=True,
        )
        try:
            assert_sound(done)
        except AssertionError as fault:
            yield f"not sound: {fault}"


def kills(given: argparse.Namespace) -> Iterator[str]:
    """Commands ended by signals."""
    from kills import CODES, commands, content, differences, interrupted, started  # noqa: PLC0415

    rng = random.Random(given.seed)
    with tempfile.TemporaryDirectory() as name:
        (inputs := Path(name, "inputs")).mkdir()
        for command in (each for each in commands(inputs) if given.command in (None, each.name)):
            whole, again = (Path(name, command.name, part) for part in ("out", "again"))
            for out in (whole, again):  # the first compiles
                process, began = started(command, out), time.monotonic()
                said = process.communicate()[1]
                usual_s = time.monotonic() - began
                if process.returncode:
                    yield f"{command.name} ends with {process.returncode}: {said}"
            yield from (
                f"{command.name} twice: {fault}"
                for fault in differences(content(whole), content(again))
            )
            for signal in [given.signal] if given.signal else CODES:
                for i in range(given.moments):
                    at, out = (
                        rng.uniform(0.0, usual_s),
                        Path(name, f"{command.name}_{signal}_{i}", "out"),
                    )
                    out.parent.mkdir()
                    yield from (
                        f"{command.name} {signal} at {at:.2f} s: {fault}"
                        for fault in interrupted(command, signal, at, out, whole, always=i % 5 == 0)
                    )


def main() -> int:
    """Runs one of the three; 1 if there were faults."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=("files", "walks", "kills"))
    parser.add_argument("--count", type=int, default=1000, help="mutations, or walks")
    parser.add_argument("--seed", type=int, default=0, help="the first number")
    parser.add_argument("--reader", help="only this one")
    parser.add_argument(
        "--validation", type=Path, help="folder of a finished `vsf-drake validate --quick`"
    )
    parser.add_argument("--step-ms", type=float, default=1.0)
    parser.add_argument("--moments", type=int, default=30)
    parser.add_argument("--command", help="only this one")
    parser.add_argument("--signal", choices=("INT", "TERM", "KILL"), help="only this one")
    given = parser.parse_args()
    faults = 0
    for fault in {"files": files, "walks": walks, "kills": kills}[given.what](given):
        faults += 1
        print(fault, flush=True)
    print(f"{faults} faults")
    return min(faults, 1)


if __name__ == "__main__":
    sys.exit(main())
