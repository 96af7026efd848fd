"""Some steps of one run again and again, each time from a state that is given: what a discrete
system does at each update.

A call goes to the machine code of `advance` that is there already, so nothing is compiled a second
time.
"""

from __future__ import annotations

import copy
import dataclasses
from typing import Any

import numba
import numpy as np

from vsf_drake.laws.compiled import compiled, internal
from vsf_drake.laws.packed import call, code_of
from vsf_drake.simulation.stepping.advance import Arguments, advance
from vsf_drake.simulation.stepping.assembly import TOLERANCE
from vsf_drake.simulation.stepping.block import Block
from vsf_drake.simulation.stepping.runs import Run

typeof: Any = numba.typeof


@internal
def _begin(arguments: Arguments, x: np.ndarray, ends: np.ndarray, torques: np.ndarray) -> None:
    """Makes ready the steps from x = [q; v]. `ends` (p,) are where the prescribed coordinates go,
    the last of them the fulcrum, NaN for where they are; `torques` (c,) are held."""
    state = arguments.state
    drive = arguments.drive
    n = state.q.shape[0]
    for c in range(n):
        state.q[c] = x[c]
        state.v[c] = x[n + c]
    state.failed[0] = -1.0
    state.beyond[0] = -1.0
    steps = drive.time_s.shape[0] - 1
    for i in range(ends.shape[0]):
        start = x[arguments.dofs.prescribed[i]]
        end = start if np.isnan(ends[i]) else ends[i]
        for k in range(steps):
            drive.prescribed_q[k, i] = start + (k / steps) * (end - start)
        drive.prescribed_q[steps, i] = end
    for k in range(steps + 1):
        drive.fulcrum[k] = drive.prescribed_q[k, ends.shape[0] - 1]
    for k in range(steps):
        for i in range(3):
            arguments.written.counts[k, i] = 0.0
        for i in range(torques.shape[0]):
            drive.torques.feedforward[k, i] = torques[i]


@internal
def _end(arguments: Arguments, x: np.ndarray, told: np.ndarray) -> bool:
    """Writes the state, and to `told` the last step's wrench on each foot (6), loads (n,), force of
    the support, and adds how many steps have not converged. Whether it came to that."""
    state = arguments.state
    written = arguments.written
    if state.failed[0] >= 0.0 or state.beyond[0] >= 0.0:
        return False
    n = state.q.shape[0]
    for c in range(n):
        x[c] = state.q[c]
        x[n + c] = state.v[c]
    last = written.q.shape[0] - 1
    at = 0
    for foot in range(written.wrench.shape[1]):
        for i in range(6):
            told[at] = written.wrench[last, foot, i]
            at += 1
    for c in range(n):
        told[at + c] = written.load[last, c]
    told[at + n] = written.fulcrum[last, 0]
    for k in range(last + 1):
        if written.counts[k, 2] > 0.0:
            told[at + n + 1] += 1.0
    return True


def _go(
    code: int,
    arguments: Arguments,
    x: np.ndarray,
    ends: np.ndarray,
    torques: np.ndarray,
    told: np.ndarray,
) -> bool:
    _begin(arguments, x, ends, torques)
    call(code, (0, arguments.drive.time_s.shape[0] - 1, arguments))
    return _end(arguments, x, told)


_go_compiled: Any = compiled(_go, nogil=True)


class Period:
    """The steps of a run, its inputs those of the last call. The run has torques without feedback,
    and prescribes the fulcrum last.

    A copy has arrays of its own: threads may go through both at a time.
    """

    def __init__(self, run: Run) -> None:
        # whose inputs are written anew for each period
        self.run = dataclasses.replace(run, inputs=copy.deepcopy(run.inputs))
        self.block = Block([self.run], TOLERANCE, sites=False, forward=None, ahead=False)
        arguments = self.block.arguments
        self._where = code_of(advance, 0, 0, arguments), arguments
        self._go = _go
        if hasattr(_go_compiled, "overloads"):
            kinds = tuple(map(typeof, (*self._where, *[np.zeros(0)] * 4)))
            _go_compiled.compile(kinds)
            # without looking at the types of what it is given
            self._go = _go_compiled.overloads[kinds].entry_point

    def __deepcopy__(self, memo: dict[int, Any]) -> Period:
        return Period(self.run)

    def __call__(
        self, x: np.ndarray, ends: np.ndarray, torques: np.ndarray, told: np.ndarray
    ) -> bool:
        """Advances x, see `_begin` and `_end`; whether no coordinate diverged. Arrays of float64
        without gaps."""
        return self._go(*self._where, x, ends, torques, told)
