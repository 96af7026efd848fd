"""Walks some of whose steps do not converge at once, and what a walk was driven by."""

from __future__ import annotations

from functools import cache

import numpy as np

from vsf_drake.motion.trial import load_trial
from vsf_drake.simulation.stepping.runs import Inputs
from vsf_drake.simulation.walk import Walk, Walker
from vsf_drake.walks.embedded import embedded_trials

LANDING = {
    "contact.heel_posterior.stiffness": 444000.0,
    "friction.mu_static": 1.68,
    "friction.threshold_velocity": 0.00858,
    "socket.ty.stiffness": 43500.0,
    "socket.tz.stiffness": 35900.0,
    "offset.height": 0.00429,
    "offset.fore_aft": -0.0728,
    "offset.alignment": 0.0357,
}
"""A hard heel in a soft socket lands far behind on sticky ground: two of the 2 ms steps are halved
(medium setting). This and the next were found among random parameters; what did not matter is left
at its default."""
CATCHING = {
    "contact.forefoot.exponent": 2.0,
    "contact.forefoot.damping": 160.0,
    "friction.mu_kinetic": 2.0,
    "fulcrum.shift": 0.046,
    "offset.height": -0.02,
    "offset.alignment": -0.11,
}
"""A toe that catches and lets go in swing: a dozen of the 1 ms steps are cut, into up to 4 (soft
setting)."""
LOST = {
    "contact.forefoot.damping": 1170.0,
    "friction.mu_kinetic": 2.07,
    "fulcrum.stiffness": 54700.0,
    "offset.fore_aft": 0.0529,
    "offset.alignment": 0.15,
}
"""One of the 10 ms steps converges in no size (medium setting)."""
SETTINGS = {"landing": (1, LANDING, 2e-3), "catching": (0, CATCHING, 1e-3), "lost": (1, LOST, 1e-2)}
"""Setting, values and step (s) of each."""


@cache
def hard_walker(setting: int):
    """(walker, trial) of an embedded trial: setting 0 soft, 1 medium, 2 stiff."""
    trial = load_trial(embedded_trials("exact")[3 * setting])
    return Walker(trial.subject, trial.model), trial


def cut_walk(name: str) -> Walk:
    """One of SETTINGS."""
    setting, values, step_s = SETTINGS[name]
    walker, trial = hard_walker(setting)
    return walker.walk(
        trial.trajectory,
        values=values,
        fulcrum_m=trial.fulcrum_m,
        start_s=trial.start_s,
        end_s=trial.end_s,
        step_s=step_s,
    )


def inputs_of(walk: Walk, walker: Walker) -> Inputs:
    """What drove a walk, so that a stepper can run it again from `walk.record.q0` and `v0`."""
    tree, record = walk.mechanism.tree, walk.record
    prescribed = np.array([tree.index(name) for name in (*walker.gait.prescribed, "fulcrum")])
    rows = np.column_stack([walk.commanded, walk.fulcrum_m[1:]])
    return Inputs(
        time_s=np.concatenate([[record.time_s[0] - walk.step_s], record.time_s]),
        prescribed=prescribed,
        prescribed_q=np.vstack([record.q0[prescribed], rows]),
        fulcrum=walk.fulcrum_m,
        ground=np.full(len(walk.fulcrum_m), walk.mechanism.ground_height),
    )
