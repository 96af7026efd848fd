"""Central differences of a walk by one of its variables, and where the two runs that they take
differ in kind."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.simulation.reactions import FootReaction, ReactionSensitivity
from vsf_drake.simulation.variables import Variable
from vsf_drake.simulation.walk import Walk, Walker

ORDINARY = {"m": 0.01, "rad": 0.1}
"""What a variable whose default is zero is typically changed by."""
MEANINGLESS = {"force": 1e-3, "centre of pressure": 1e-6, "free moment": 1e-4}
"""N, m, N m: a series whose derivative times the variable's size stays below this counts as not
depending on it."""


class Differences(NamedTuple):
    """Of n instants: force (n, 3) N, centre of pressure (n, 2) m, free moment (n, 1) N m, per unit
    of the variable.

    alike: (n,) whether both runs have every force on the same branch of its law at that step.
    """

    series: dict[str, np.ndarray]
    alike: np.ndarray


def size(variable: Variable) -> float:
    """How large the variable is, in its unit."""
    return abs(variable.default) or ORDINARY[variable.unit]


def central(
    walker: Walker, motion: CoordinateTrajectory, name: str, change: float, *, values=None, **span
) -> Differences:
    """From two walks with the variable `change` (in its unit) below and above what it is in
    `values` or by default."""
    values = values or {}
    at = values.get(name, walker.variables[name].default)
    low, high = (
        walker.walk(motion, values=values | {name: at + sign * change}, **span)
        for sign in (-1.0, 1.0)
    )
    one, other = reaction_series(low.prosthetic), reaction_series(high.prosthetic)
    return Differences(
        {key: (other[key] - one[key]) / (2.0 * change) for key in one},
        np.all(branches(low) == branches(high), axis=1),
    )


def reaction_series(reaction: FootReaction) -> dict[str, np.ndarray]:
    """The names of MEANINGLESS -> (n, k)."""
    columns = (reaction.grf_W, reaction.cop_W[:, :2], reaction.free_moment_nm[:, None])
    return dict(zip(MEANINGLESS, columns, strict=True))


def exact_series(sensitivity: ReactionSensitivity, name: str) -> dict[str, np.ndarray]:
    """The same of the derivative by one variable."""
    i = sensitivity.names.index(name)
    columns = (
        sensitivity.grf_W[:, :, i],
        sensitivity.cop_W[:, :, i],
        sensitivity.free_moment_nm[:, i, None],
    )
    return dict(zip(MEANINGLESS, columns, strict=True))


def errors(
    walker: Walker, sensitivity: ReactionSensitivity, name: str, by: Differences
) -> Iterator[tuple[str, np.ndarray]]:
    """Of each series its name and (n,) |exact - difference| over the largest of the exact
    derivative."""
    for key, exact in exact_series(sensitivity, name).items():
        assert np.array_equal(np.isnan(exact)[by.alike], np.isnan(by.series[key])[by.alike]), (
            name,
            key,
        )
        scale = max(np.nanmax(np.abs(exact)), MEANINGLESS[key] / size(walker.variables[name]))
        yield key, np.nan_to_num(np.abs(exact - by.series[key])).max(axis=1) / scale


def branches(walk: Walk) -> np.ndarray:
    """(n, k) which branch of its law each force is on at the end of each step, as integers.

    A sphere is loaded or not, approaching or not, deeper than its damping's ramp or not; sticks, is
    about to slip, slides; a spring is pulled or pushed, and at its stops; a step is cut; there is a
    centre of pressure.
    """
    record, sites, springs = walk.record, walk.mechanism.sites, walk.mechanism.springs
    loaded = record.site("normal_force") > 0.0
    speed = np.hypot(record.site("slip_x"), record.site("slip_y")) / sites[:, 10]
    x, rate = record.q[:, walk.mechanism.spring_index], record.v[:, walk.mechanism.spring_index]
    return np.hstack(
        [
            loaded,
            loaded & (record.site("depth_rate") > 0.0),
            loaded & (record.site("depth") > sites[:, 7]),
            loaded & (speed > 1.0),
            loaded & (speed > 1.5),
            (x >= 0.0) & (springs[:, 0] != springs[:, 1]),
            np.abs(x) > springs[:, 3],
            np.abs(rate) > springs[:, 4],
            record.parts[:, None],
            np.isnan(walk.prosthetic.cop_W[:, :1]),
        ]
    ).astype(int)
