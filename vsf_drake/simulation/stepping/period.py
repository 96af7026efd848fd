"""Some steps of one run again and again, each time from a state that is given: what a discrete
system does at each update.

At a call from Python numba asks every array for its address, shape and strides, 0.2 us each, and
`advance` has a hundred. Here they are asked once, and kept as numba has them inside compiled code;
a call goes to the machine code of `advance` that is there already, so nothing is compiled a second
time.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.core import types
from numba.extending import intrinsic

from vsf_drake.laws.compiled import compiled, internal
from vsf_drake.simulation.stepping.advance import Drive, State, Written, advance
from vsf_drake.simulation.stepping.assembly import TOLERANCE, Forces, FreePrescribed, Workspace
from vsf_drake.simulation.stepping.block import Block
from vsf_drake.simulation.stepping.directions import Tangent, TangentDirections
from vsf_drake.simulation.stepping.runs import Run
from vsf_drake.simulation.stepping.sensitivity import Carried
from vsf_drake.simulation.stepping.tree import TreeArrays

typeof: Any = numba.typeof
generated: Callable[[Any], Any] = intrinsic
cgutils: Any = numba.core.cgutils


class Arguments(NamedTuple):
    """Those of `advance` beside the steps."""

    tree: TreeArrays
    forces: Forces
    dofs: FreePrescribed
    workspace: Workspace
    drive: Drive
    max_speed: float
    state: State
    written: Written
    rows: np.ndarray
    live: bool
    directions: TangentDirections | None
    tangent: Tangent | None
    carried: Carried


@generated
def _store(_: Any, place: Any, arguments: Any) -> Any:
    """Writes the arguments, as compiled code has them, to the address `place`, unless that is 0;
    returns how many bytes they are."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        address, given = values
        with builder.if_then(cgutils.is_not_null(builder, address)):
            builder.store(given, builder.inttoptr(address, given.type.as_pointer()))
        return context.get_constant(types.intp, context.get_abi_sizeof(given.type))

    return types.intp(place, arguments), generate


@generated
def _load(_: Any, place: Any, kind: Any) -> Any:
    """What `_store` wrote there, of the type `kind`."""
    arguments = kind.instance_type

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kept = context.get_value_type(arguments).as_pointer()
        return builder.load(builder.inttoptr(values[0], kept))

    return arguments(place, kind), generate


@generated
def _call(_: Any, code: Any, begin: Any, last: Any, arguments: Any) -> Any:
    """Calls `advance`, whose machine code is at the address `code`; it raises nothing."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        code, begin, last, given = values
        taken = (types.intp, types.intp, *arguments.types)
        kind = context.call_conv.get_function_type(types.none, taken).as_pointer()
        context.call_conv.call_function(
            builder,
            builder.inttoptr(code, kind),
            types.none,
            taken,
            (begin, last, *cgutils.unpack_tuple(builder, given)),
        )
        return context.get_dummy_value()

    return types.none(code, begin, last, arguments), generate


@compiled
def _keep(place: int, arguments: Arguments) -> int:
    size: int = _store(place, arguments)
    return size


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
    place: int,
    kind: Any,
    x: np.ndarray,
    ends: np.ndarray,
    torques: np.ndarray,
    told: np.ndarray,
) -> bool:
    arguments: Any = _load(place, kind)
    _begin(arguments, x, ends, torques)
    _call(code, 0, arguments.drive.time_s.shape[0] - 1, arguments)
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
        self.block = Block([self.run], TOLERANCE, sites=False, forward=None)
        each_itself = np.zeros((0, self.block.row_size))
        self._arguments = Arguments(*self.block.arguments(each_itself))
        advance(0, 0, *self._arguments)
        self._compiled = hasattr(advance, "overloads")
        if not self._compiled:
            return
        kind: Any = typeof(self._arguments)
        machine = advance.overloads[(types.intp, types.intp, *kind.types)]  # type: ignore[attr-defined]
        self._kept = np.zeros(-(-_keep(0, self._arguments) // 8))
        place = self._kept.ctypes.data
        _keep(place, self._arguments)
        code = machine.library.get_pointer_to_function(machine.fndesc.llvm_func_name)
        self._where = (code, place, kind)
        vector = types.Array(types.float64, 1, "C")
        given = (types.intp, types.intp, typeof(kind), *[vector] * 4)
        _go_compiled.compile(given)
        # without looking at the types of what it is given
        self._go = _go_compiled.overloads[given].entry_point

    def __deepcopy__(self, memo: dict[int, Any]) -> Period:
        return Period(self.run)

    def __call__(
        self, x: np.ndarray, ends: np.ndarray, torques: np.ndarray, told: np.ndarray
    ) -> bool:
        """Advances x, see `_begin` and `_end`; whether no coordinate diverged. Arrays of float64
        without gaps."""
        if self._compiled:
            ended: bool = self._go(*self._where, x, ends, torques, told)
            return ended
        _begin(self._arguments, x, ends, torques)
        advance(0, len(self.run.inputs.time_s) - 1, *self._arguments)
        return _end(self._arguments, x, told)
