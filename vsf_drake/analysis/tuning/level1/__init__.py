"""Tunes the foot's stiffness to recorded motion that is given: the first of two levels.

trials = [trial_with(load_trial(path), contact) for path in paths]
solution = solve(StiffnessTuning(trials, cost="joint_load", options=TuningOptions(design=("alignment",))))
solution.fulcrum_mm, tuning_table(solution)
"""

from vsf_drake.analysis.tuning.common import COSTS, DESIGN, WEIGHTED
from vsf_drake.analysis.tuning.level1.options import TuningOptions
from vsf_drake.analysis.tuning.level1.problem import StiffnessTuning
from vsf_drake.analysis.tuning.level1.solution import TuningSolution, tuning_arrays, tuning_table
from vsf_drake.analysis.tuning.level1.solve import solve

__all__ = (
    "COSTS",
    "DESIGN",
    "WEIGHTED",
    "StiffnessTuning",
    "TuningOptions",
    "TuningSolution",
    "solve",
    "tuning_arrays",
    "tuning_table",
)
