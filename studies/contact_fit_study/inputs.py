"""What the study reads, and the hashes of it."""

from __future__ import annotations

import json
from functools import cache

from floor_of_the_reference_subject import RESULTS, hashes
from make_reference_subject import DATA

from contact_fit_study.cases import TIERS, TRIALS
from contact_fit_study.keeping import made_by
from vsf_drake.base.files import sha256
from vsf_drake.model.bench_curves import BenchMeasurement, load_bench_file
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.batch.cases import digest

BENCH, FLOORS = DATA / "bench.yaml", RESULTS / "floor.json"


@cache
def trial(tier: str, name: str) -> Trial:
    return load_trial(DATA / tier / f"{name}.yaml")


@cache
def bench() -> BenchMeasurement:
    return load_bench_file(BENCH)


@cache
def input_hashes() -> dict[str, str]:
    """SHA-256 of all that is read, by path in the reference subject's folder; of floor.json, by its
    name, the trials' floors alone."""
    found = {
        "bench.yaml": sha256(BENCH),
        FLOORS.name: digest(json.loads(FLOORS.read_text(encoding="utf-8"))["trials"]),
    }
    for tier in TIERS:
        for name in TRIALS:
            found |= hashes(trial(tier, name))
    return found


@cache
def key() -> str:
    """Of everything that the study's numbers depend on: inputs, versions, sources of model,
    analysis and study."""
    return digest({**provenance(input_hashes()), **made_by("contact_fit.py")})
