"""Tunes the foot's stiffness to recorded motion that is given: the first of two levels.

    trials = [trial_with(load_trial(path), contact) for path in paths]
    solution = solve(StiffnessTuning(
        trials, cost="joint_load", options=TuningOptions(design=("alignment",))))
    solution.fulcrum_mm, tuning_table(solution)

Each name stands in its own module: `options`, `problem`, `solve`, `solution`.
"""
