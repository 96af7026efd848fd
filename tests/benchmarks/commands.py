"""Processor time of commands as a user gives them, each in processes of its own."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from table import Row

from vsf_drake.base.files import resource as shipped

HERE = shipped("data/reference_subject")
TRIAL = HERE / "laboratory/low_1.yaml"
CONTACT = ("--contact", HERE / "laboratory/contact.yaml")
SWEEP = ("sweep", TRIAL, *CONTACT, "--yes", "--fulcrum-mm")
FIT = ("fit", TRIAL, HERE / "laboratory/high_1.yaml", "--bench", HERE / "bench.yaml")
LEVEL_2 = ("--cost", "activation", "--level", "2", "--quick")
PROGRAM = "from vsf_drake.cli import main; main()"

WARM = {
    "simulate": ("simulate", TRIAL, *CONTACT),
    "sweep of 400 walks": (*SWEEP, "66:151:400"),
    "sweep of 1 400 walks": (*SWEEP, "66:151:1400"),
    "fit --quick of one trial": ("fit", TRIAL, "--quick"),
    "fit of two trials and bench, all starts": FIT,
    "map": ("map",),
    "tune, level 1": ("tune", TRIAL, *CONTACT),
    "tune --level 2 --quick": ("tune", TRIAL, *CONTACT, *LEVEL_2),
}
COLD = {
    "simulate": WARM["simulate"],
    "validate, the README's first command": ("validate",),
}
"""With an empty cache of compiled code."""


def commands() -> list[Row]:
    """All of them with code that is compiled, and COLD without."""
    rows = [Row(name, None, spent(*words), "processor time") for name, words in WARM.items()]
    for name, words in COLD.items():
        with tempfile.TemporaryDirectory() as empty:
            rows.append(Row(f"{name}, cold", None, spent(*words, cache=empty), "the same"))
    return rows


def spent(*words: str | Path, cache: str = "") -> float:
    """Processor time (s) of the command and its processes; without a `cache` of compiled code that
    is its own, once more if it had to compile."""
    own = {"OPENBLAS_NUM_THREADS": "1"} | ({"NUMBA_CACHE_DIR": cache} if cache else {})
    with tempfile.TemporaryDirectory() as out:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        ran = subprocess.run(
            [sys.executable, "-c", PROGRAM, *map(str, words), "--out", f"{out}/out"],
            env=os.environ | own,
            capture_output=True,
            text=True,
            check=True,
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if "compiling once" in ran.stderr and not cache:
        return spent(*words)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
