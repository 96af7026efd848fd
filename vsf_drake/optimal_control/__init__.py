"""Stiffness tuning in which the motion adapts: trajectory optimisation of one stride in the
sagittal plane.

    solution = solve(StrideTuning(
        [trial], cost="joint_load", options=StrideOptions(design=("alignment_rad",))))
    solution.fulcrum_mm, stride_table(solution)
"""

from vsf_drake.optimal_control.saved import stride_arrays, stride_table
from vsf_drake.optimal_control.search import StrideSolution, StrideTuning
from vsf_drake.optimal_control.solve import solve
from vsf_drake.optimal_control.stride import StrideOptions

__all__ = [
    "StrideOptions",
    "StrideSolution",
    "StrideTuning",
    "solve",
    "stride_arrays",
    "stride_table",
]
