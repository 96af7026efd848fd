"""A compiled function whose many arrays are looked through once, not at every call.

At a call from Python numba asks every array for its address, shape and strides, 0.2 us each. Here
they are asked once, and kept as numba has them inside compiled code. A call goes to the machine
code that is there already, so nothing is compiled a second time.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numba.core import cgutils, types
from numba.extending import intrinsic

from vsf_drake.laws.compiled import compiled


@intrinsic  # type: ignore[misc]
def _store(_: Any, place: Any, arguments: Any) -> Any:
    """Writes the arguments, as compiled code has them, to the address `place`; returns how many
    bytes that are, and writes nothing where it is 0."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        address, given = values
        size = context.get_constant(types.intp, context.get_abi_sizeof(given.type))
        with builder.if_then(cgutils.is_not_null(builder, address)):
            builder.store(given, builder.inttoptr(address, given.type.as_pointer()))
        return size

    return types.intp(place, arguments), generate


@intrinsic  # type: ignore[misc]
def _call(_: Any, code: Any, place: Any, begin: Any, last: Any, kinds: Any) -> Any:
    """Calls the machine code at the address `code` with begin, last and what is at `place`, whose
    types are `kinds`."""
    arguments = kinds.instance_type

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        code, place, begin, last, _ = values
        taken = (types.intp, types.intp, *arguments.types)
        kind = context.call_conv.get_function_type(types.none, taken).as_pointer()
        kept = context.get_value_type(arguments).as_pointer()
        unpacked = cgutils.unpack_tuple(builder, builder.load(builder.inttoptr(place, kept)))
        context.call_conv.call_function(
            builder,
            builder.inttoptr(code, kind),
            types.none,
            taken,
            (begin, last, *unpacked),
        )
        return context.get_dummy_value()

    return types.none(code, place, begin, last, kinds), generate


@compiled
def _pack(place: int, arguments: tuple[Any, ...]) -> int:
    size: int = _store(place, arguments)
    return size


def _go(code: int, place: int, begin: int, last: int, kinds: Any) -> None:
    _call(code, place, begin, last, kinds)


_unpack_and_go: Any = compiled(_go, nogil=True)


class Packed:
    """`function(begin, last, *arguments)`, a compiled function that returns nothing and raises
    nothing, for any begin and last. The arguments are kept."""

    def __init__(self, function: Any, *arguments: Any) -> None:
        self._function = function
        self._arguments = arguments
        self._go: Any = None
        if not hasattr(function, "overloads"):  # nothing is compiled
            return
        function(0, 0, *arguments)
        kinds = numba.typeof(arguments)
        code = function.overloads[(types.intp, types.intp, *kinds.types)]
        size = _pack(0, arguments)
        self._place = np.zeros(-(-size // 8))
        _pack(self._place.ctypes.data, arguments)
        self._kinds = kinds
        address = code.library.get_pointer_to_function(code.fndesc.llvm_func_name)
        self._first = (address, self._place.ctypes.data)
        _unpack_and_go(*self._first, 0, 0, kinds)
        self._go = _unpack_and_go.overloads[
            (*[types.intp] * 4, numba.typeof(kinds))
        ].entry_point

    def __call__(self, begin: int, last: int) -> None:
        if self._go is None:
            self._function(begin, last, *self._arguments)
        else:
            self._go(*self._first, begin, last, self._kinds)
