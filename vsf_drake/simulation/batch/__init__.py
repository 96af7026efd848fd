"""Many walks at once: parameter sets, trials and fulcrum positions, on one core, on all of them or
on a cluster.

    outcomes = simulate_batch([WalkCase(trial=trial, values=v) for v in sample_values(...)],
        cache="sweep")
"""

from vsf_drake.simulation.batch.cases import DEFAULT_KEEP, WalkCase, grid_values, sample_values
from vsf_drake.simulation.batch.processes import ProcessWorkers, SweepProgress
from vsf_drake.simulation.batch.run import WalkOutcome, simulate_batch

__all__ = [
    "DEFAULT_KEEP",
    "ProcessWorkers",
    "SweepProgress",
    "WalkCase",
    "WalkOutcome",
    "grid_values",
    "sample_values",
    "simulate_batch",
]
