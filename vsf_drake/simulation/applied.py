"""Torques on the coordinates of a person that are not prescribed, with feedback of their motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.simulation.stepping.torques import Torques, no_torques

Sampled = np.ndarray | Callable[[np.ndarray], np.ndarray]
"""Values at the instants of a run's grid: an array, one row for each step (a last row for the end of the last step may
stand there and has no part), or a function of the times (n,) at which the n steps start."""


@dataclass(frozen=True, eq=False)
class AppliedTorques:
    """What a sampled controller applies to c free coordinates of a person, of whom f are free.

    Over a step that starts at t it holds tau = feedforward(t) - gain(t) @ (state - reference(t)), with the state at t.
    A state is the f positions (rad, m) and then the f velocities (rad/s, m/s) of the free anatomical coordinates, in
    the order of `Walker.free`; socket and keel have no part in it.

    Attributes:
        names: the coordinates that are driven.
        feedforward: (n, c) N m (N for translations), in the direction of the coordinate.
        gain: (n, c, 2 f); None for no feedback.
        reference: (n, 2 f); needed with a gain.
    """

    names: tuple[str, ...]
    feedforward: Sampled
    gain: Sampled | None = None
    reference: Sampled | None = None


def torques_on_grid(
    applied: AppliedTorques | None, *, free: Sequence[str], coordinate_names: Sequence[str], moments: np.ndarray
) -> Torques:
    """The torques of a run on the grid `moments` (n + 1,), for the stepper.

    Args:
        free: the person's free coordinates. coordinate_names: all of the plant.

    Raises:
        InputError: a name is not free or comes twice, an array has another shape, or a number is not finite.
    """
    steps = len(moments) - 1
    if applied is None:
        return no_torques(steps)
    if not isinstance(applied, AppliedTorques):
        raise InputError(f"is a {type(applied).__name__}, no AppliedTorques", where="applied")
    if isinstance(applied.names, str) or not applied.names:
        raise InputError(f"{applied.names!r} is no list of names", where="applied.names",
                         right="Name the driven coordinates")
    for i, name in enumerate(applied.names):
        if name not in free:
            raise InputError(f"{name!r} is not a free coordinate", where="applied.names",
                             right=f"Free are: {', '.join(free) or 'none; see Walker(free=...)'}")
        if name in applied.names[:i]:
            raise InputError(f"{name} stands twice", where="applied.names")
    if (applied.gain is None) != (applied.reference is None):
        raise InputError("feedback needs both a gain and a reference", where="applied.gain, applied.reference")
    starts, driven = moments[:-1], len(applied.names)
    sensed = () if applied.gain is None else tuple(free)
    size = 2 * len(sensed)
    gain, reference = np.zeros((steps, driven, 0)), np.zeros((steps, 0))
    if sensed:
        gain = _rows(applied.gain, starts, (driven, size), "applied.gain")
        reference = _rows(applied.reference, starts, (size,), "applied.reference")
    index = [np.array([coordinate_names.index(name) for name in names], dtype=np.int64)
             for names in (applied.names, sensed)]
    return Torques(coordinates=index[0], sensed=index[1], gain=gain, reference=reference,
                   feedforward=_rows(applied.feedforward, starts, (driven,), "applied.feedforward"))


def _rows(given: Sampled, starts: np.ndarray, shape: tuple[int, ...], where: str) -> np.ndarray:
    steps = len(starts)
    found = np.asarray(given(starts.copy()) if callable(given) else given)
    if found.dtype.kind not in "iuf" or found.shape[1:] != shape or len(found) not in (steps, steps + 1):
        raise InputError(f"has {found.dtype} numbers of shape {found.shape}", where=where,
                         right=f"It must be {(steps, *shape)}, one row for each step")
    found = np.ascontiguousarray(found[:steps], dtype=float)
    if not np.isfinite(found).all():
        row = int(np.argwhere(~np.isfinite(found))[0][0])
        raise InputError(f"is not finite at {starts[row]:g} s", where=where)
    return found
