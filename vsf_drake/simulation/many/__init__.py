"""Many walks at once: parameter sets, trials and fulcrum positions, on one core, on all of them or on a cluster.

    outcomes = simulate_many([WalkCase(trial=trial, values=v) for v in sample_values(...)], cache="sweep")
"""

from vsf_drake.simulation.many.cases import DEFAULT_KEEP, WalkCase, grid_values, sample_values
from vsf_drake.simulation.many.processes import ProcessWorkers, SweepProgress
from vsf_drake.simulation.many.run import WalkOutcome, simulate_many

__all__ = ["DEFAULT_KEEP", "ProcessWorkers", "SweepProgress", "WalkCase", "WalkOutcome", "grid_values", "sample_values",
           "simulate_many"]
