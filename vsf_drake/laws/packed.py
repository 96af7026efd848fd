"""Named tuples of arrays for compiled code, by their address.

Between compiled functions numba hands a tuple on as the numbers of all its arrays, some nine of
each, and a step has a hundred arrays: two fifths of what there would be to compile only packed and
unpacked them. Here they are written once to memory that nothing changes, and a member is read from
there where code names it. It uses the low-level interface of numba.
"""

from __future__ import annotations

import hashlib
import sys
from functools import cache
from typing import Any

import numpy as np
from numba import config, extending, from_dtype, typeof
from numba.core import cgutils, types
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import NativeValue, lower_getattr_generic, models, register_model, unbox

from vsf_drake.laws.lanes import LANE, SHARED, WIDTH

_settings: Any = config
_intrinsic: Any = extending.intrinsic
_WORD = 8


class Packed(types.Type):
    """The address of a named tuple's members, one after the other: arrays as numba has them,
    numbers in words of their own."""

    def __init__(self, name: str, members: tuple[tuple[str, Any], ...]) -> None:
        self.kinds = dict(members)
        self.places = {}
        self.size = 0
        for member, kind in members:
            self.places[member] = self.size
            self.size += _size(kind)
        # by its name machine code of several processes is told apart
        digest = hashlib.sha256(repr(members).encode()).hexdigest()[:16]
        super().__init__(f"Packed{name}-{digest}")


def _size(kind: Any) -> int:
    """How many bytes a member takes."""
    if isinstance(kind, Packed):
        return kind.size
    return _WORD * (5 + 2 * kind.ndim if isinstance(kind, types.Array) else 1)


register_model(Packed)(models.OpaqueModel)


@infer_getattr
class _Members(AttributeTemplate):
    key = Packed

    def generic_resolve(self, packed: Any, name: str) -> Any:  # type: ignore[override]
        """The type of a member."""
        return packed.kinds.get(name)


@lower_getattr_generic(Packed)
def _member(context: Any, builder: Any, packed: Any, address: Any, name: str) -> Any:
    kind = packed.kinds[name]
    place = builder.gep(address, [context.get_constant(types.int32, packed.places[name])])
    if isinstance(kind, Packed):
        return place
    held = types.intp if kind == types.boolean else kind
    member = builder.load(builder.bitcast(place, context.get_value_type(held).as_pointer()))
    member.set_metadata("invariant.load", builder.module.add_metadata([]))
    return context.cast(builder, member, held, kind)


@unbox(Packed)
def _address(kind: Any, value: Any, c: Any) -> Any:
    address = c.pyapi.object_getattr_string(value, "address")
    pointer = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    return NativeValue(pointer)


class InMemory:
    """A named tuple that was written to memory."""

    def __init__(self, value: Any, *, walks: bool) -> None:
        form, words = _written(value, walks, "")
        self._numba_type_ = _type(form)
        self._holds = value, np.array(words, dtype=np.int64)
        self.address = self._holds[1].ctypes.data

    def __reduce__(self) -> Any:
        raise TypeError("an address is of this process and these arrays: pack a copy of the tuple")


def _written(value: Any, walks: bool, name: str) -> tuple[Any, list[int]]:
    """Form (see `_type`) and words of a member of this name."""
    if hasattr(value, "_fields"):
        forms: list[Any] = [type(value), walks]
        words = []
        for field, member in zip(value._fields, value, strict=True):
            form, own = _written(member, walks, field)
            forms.append(form)
            words += own
        return tuple(forms), words
    if value is None or isinstance(value, InMemory):
        return "", [0 if value is None else value.address]
    if not isinstance(value, np.ndarray):
        number = np.asarray(value)
        return number.dtype.str, [int.from_bytes(number.tobytes(), sys.byteorder, signed=True)]
    if not value.flags.c_contiguous:
        raise TypeError(f"{name or 'an array'} is not contiguous")
    shape = value.shape
    strides = value.strides
    size = value.itemsize
    laned = walks and value.dtype == np.float64 and name not in SHARED
    if laned:
        if shape[-1] != WIDTH:
            raise TypeError(
                f"the last axis of {name or 'an array'} is {shape[-1]}, not {WIDTH} walks"
            )
        shape = shape[:-1]
        strides = strides[:-1]
        size *= WIDTH
    count = value.nbytes // size
    where = value.__array_interface__["data"][0]
    return (value.dtype.str, len(shape), laned), [0, 0, count, size, where, *shape, *strides]


@cache
def _type(form: Any) -> Any:
    """Of a named tuple (class, whether of walks, members), an array (dtype, axes, whether of
    lanes), a number (its dtype), or what is written elsewhere ("")."""
    if not form:
        return types.voidptr
    if isinstance(form, str):
        return from_dtype(np.dtype(form))
    kind, count, *members = form
    if isinstance(kind, str):
        laned = members[0]
        of = LANE if laned else from_dtype(np.dtype(kind))
        return types.Array(of, count, "C", aligned=not laned)
    named = zip(kind._fields, map(_type, members), strict=True)
    return Packed(f"{kind.__name__}{WIDTH if count else ''}", tuple(named))


packed: Any = (
    (lambda value, *, walks=False: value)
    if _settings.DISABLE_JIT
    else (lambda value, *, walks=False: InMemory(value, walks=walks))
)
"""A named tuple of contiguous arrays, float, int, bool and such tuples, for compiled code, which
reads its members and does not replace them; what one holds that is `packed` already is an address
there. Of `walks` side by side arrays of float64, whose last axis is the walk's, are arrays of
lanes, but for the fields `lanes.SHARED`. With NUMBA_DISABLE_JIT=1 it stays as it is, which serves
for kinematics; walks then go alone."""


def code_of(function: Any, *given: Any) -> Any:
    """The address of a compiled function's machine code for such arguments, for `call`; with
    NUMBA_DISABLE_JIT=1 the function."""
    if _settings.DISABLE_JIT:
        return function
    kinds = tuple(typeof(value) for value in given)
    function.compile(kinds)
    machine = function.overloads[kinds]
    return machine.library.get_pointer_to_function(machine.fndesc.llvm_func_name)


@_intrinsic
def _call(_: Any, code: Any, given: Any) -> Any:
    taken = tuple(map(types.unliteral, given))

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kind = context.call_conv.get_function_type(types.none, taken).as_pointer()
        machine = builder.inttoptr(values[0], kind)
        arguments = cgutils.unpack_tuple(builder, values[1])
        status, _ = context.call_conv.call_function(builder, machine, types.none, taken, arguments)
        with cgutils.if_unlikely(builder, status.is_error):
            context.call_conv.return_status_propagate(builder, status)
        return context.get_dummy_value()

    return types.none(code, given), emit


call: Any = (lambda code, given: code(*given)) if _settings.DISABLE_JIT else _call
"""Calls what is at the address `code` with the tuple that is given, of a function that returns
nothing; what it raises goes on."""
