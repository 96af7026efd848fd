"""What the study reads, and the hashes of it."""

from __future__ import annotations

import sys
from functools import cache

from floor_of_the_reference_subject import RESULTS, hashes
from make_reference_subject import DATA

from contact_fit_study.cases import TIERS, TRIALS
from vsf_drake.bench_file import BenchMeasurement, load_bench_file
from vsf_drake.files import sha256
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.simulation.many.keys import digest, software

BENCH, FLOORS = DATA / "bench.yaml", RESULTS / "floor.json"
_ONLY_SHOWS = ("vsf_drake.report", *(f"contact_fit_study.{name}" for name in ("figures", "results", "table")))


@cache
def trial(tier: str, name: str) -> Trial:
    return load_trial(DATA / tier / f"{name}.yaml")


@cache
def bench() -> BenchMeasurement:
    return load_bench_file(BENCH)


@cache
def input_hashes() -> dict[str, str]:
    """SHA-256 of all that is read, by path in the reference subject's folder; floor.json by its own name."""
    found = {"bench.yaml": sha256(BENCH), FLOORS.name: sha256(FLOORS)}
    for tier in TIERS:
        for name in TRIALS:
            found |= hashes(trial(tier, name))
    return found


@cache
def key() -> str:
    """Of everything that the study's numbers depend on: inputs, versions, sources of model, analysis and study."""
    loaded = {name: sha256(module.__file__) for name, module in sorted(sys.modules.items())
              if name.startswith(("vsf_drake.", "contact_fit_study.")) and module.__file__
              and not name.startswith(_ONLY_SHOWS)}
    return digest({"software": software(), "loaded": loaded, "inputs": input_hashes()})
