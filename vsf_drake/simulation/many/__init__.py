"""Many walks at once: parameter sets, trials and fulcrum positions, on one core, on all of them or on a cluster.

    outcomes = simulate_many([WalkCase(trial=trial, values=v) for v in sample_values(...)], cache="sweep")
"""

from vsf_drake.simulation.many.cases import DEFAULT_KEEP, WalkCase
from vsf_drake.simulation.many.processes import ProcessWorkers, SweepProgress
from vsf_drake.simulation.many.run import simulate_many
from vsf_drake.simulation.many.samples import grid_values, sample_values
from vsf_drake.simulation.many.worker import WalkOutcome

__all__ = ["DEFAULT_KEEP", "ProcessWorkers", "SweepProgress", "WalkCase", "WalkOutcome", "grid_values", "sample_values",
           "simulate_many"]
