"""Many walks: what a second process brings, and whether memory stays flat.

    python tests/benchmarks/sweeps.py
"""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import replace

import psutil
from table import Row

from vsf_drake.analysis.validation import embedded_trials
from vsf_drake.motion.trial import Trial, load_trial
from vsf_drake.simulation.batch import ProcessWorkers, WalkCase, WalkOutcome, simulate_batch

WALKS, WALK_S, WORKERS, ROUNDS = 200, 1.2, 2, 3
RUNS, SHORT_S, BATCH = 2000, 0.1, 100


def rows() -> list[Row]:
    """Both; about two minutes."""
    trial = load_trial(embedded_trials("exact")[0])
    return [*speed(trial), memory(trial)]


def speed(trial: Trial, walks: int = WALKS) -> list[Row]:
    """The same sweep in this process, in this and another from nothing, in two others that run already, on two threads.

    In turn, ROUNDS times over, and the best of each: what else the machine does would else decide the ratios.
    """
    part = replace(trial, start_s=trial.end_s - WALK_S)
    cases = [WalkCase(trial=part, fulcrum_m=0.066 + 0.085 * i / walks) for i in range(walks)]
    with ProcessWorkers(WORKERS) as pool, ThreadPoolExecutor(WORKERS) as threads:
        pool.start()
        wait([pool.submit(time.sleep, 0.5) for _ in range(WORKERS)])
        for executor in (pool, threads):  # each of their workers builds its person and loads the compiled code
            simulate_batch(cases[: 4 * WORKERS], executor=executor, workers=WORKERS)
        ways = ({"workers": 1}, {"workers": WORKERS}, {"executor": pool, "workers": WORKERS}, {"executor": threads})
        rounds = [[timed(cases, **options) for options in ways] for _ in range(ROUNDS)]
    walls = [min(wall for wall, _ in column) for column in zip(*rounds, strict=True)]
    alone, *others = (outcomes for _, outcomes in rounds[-1])
    names = (f"{WORKERS} processes, with the start of the second", f"{WORKERS} processes that run already",
             f"{WORKERS} threads")
    return [Row(f"{walks} walks, one process", walks * WALK_S, walls[0], f"{sum(o.ok for o in alone)} finished"),
            *(Row(f"{walks} walks, {name}", walks * WALK_S, wall,
                  f"{same(alone, outcomes)}; {walls[0] / wall:.2f} times one process")
              for name, wall, outcomes in zip(names, walls[1:], others, strict=True))]


def memory(trial: Trial, runs: int = RUNS) -> Row:
    """Resident memory after the first BATCH walks in this process, and after all."""
    part = replace(trial, start_s=0.5 * (trial.start_s + trial.end_s))
    part = replace(part, end_s=part.start_s + SHORT_S)
    sizes, started = [], time.perf_counter()
    for first in range(0, runs, BATCH):
        simulate_batch([WalkCase(trial=part, fulcrum_m=0.066 + 0.085 * i / runs) for i in range(first, first + BATCH)],
                       workers=1)
        sizes.append(resident_mb())
    return Row(f"{runs} walks, memory of the process", runs * SHORT_S, time.perf_counter() - started,
               f"{sizes[0]:.0f} MB after {BATCH}, {sizes[-1]:.0f} MB after all: {sizes[-1] / sizes[0] - 1:+.1%}")


def timed(cases: list[WalkCase], **options: object) -> tuple[float, list[WalkOutcome]]:
    """Wall time (s) and outcomes."""
    started = time.perf_counter()
    outcomes = simulate_batch(cases, **options)
    return time.perf_counter() - started, outcomes


def same(a: list[WalkOutcome], b: list[WalkOutcome]) -> str:
    """Whether all arrays agree to the last bit."""
    equal = all(x.arrays[name].tobytes() == y.arrays[name].tobytes() for x, y in zip(a, b, strict=True)
                for name in x.arrays)
    return "same bits" if equal else "DIFFERENT numbers"


def resident_mb() -> float:
    """Memory that this process holds now."""
    return psutil.Process().memory_info().rss / 1e6


if __name__ == "__main__":
    for row in rows():
        print(*row, sep="\t")
