"""Stiffness tuning in which the motion adapts: trajectory optimisation of one stride in the
sagittal plane.

    solution = solve(StrideTuning(
        [trial], cost="joint_load", options=StrideOptions(design=("alignment_rad",))))
    solution.fulcrum_mm, stride_table(solution)

Each name stands in its own module: `stride`, `search`, `solve`, `saved`.
"""
