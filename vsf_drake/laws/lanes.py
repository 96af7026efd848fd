"""A number of eight walks side by side, for compiled code that is written once for one walk and
for eight; or eight numbers of one walk.

`Lane` holds a float64 of each walk in one register of the processor, `Mask` a truth value of each;
numba works on them as on float and bool, but `if` cannot choose for each walk: such code says
`select`, and asks `some` or `every` walk where work can be left out. One operation on lanes is to
the bit what it is on the float64 of each walk: nothing is contracted, and sine, cosine and powers
are the functions of this module.

`laws.packed` hands arrays whose last axis is the walk's to compiled code as arrays of lanes,
`eights` takes those whose numbers are treated alike. It uses the low-level interface of numba.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import extending
from numba.core import cgutils, config, types
from numba.core.imputils import impl_ret_borrowed
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import (
    lower_builtin,
    lower_cast,
    models,
    overload,
    register_jitable,
    register_model,
)
from numba.np.arrayobj import populate_array

WIDTH = 8
"""Walks in a lane: as fast as any other number on processors with registers of two, four and eight
numbers."""
SHARED = ("inertias", "gravity", "keel_starts", "rows")
"""Fields of float arrays that are not in lanes: the walks have them in common."""


class Lane(types.Type):
    """A float64 of each of WIDTH walks."""

    def __init__(self) -> None:
        super().__init__("Lane")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Whether a number of `other` can stand for one of each walk."""
        return Conversion.promote if isinstance(other, (types.Float, types.Integer)) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """The type that holds both."""
        return self if isinstance(other, (types.Float, types.Integer)) else None


class Mask(types.Type):
    """A truth value of each of WIDTH walks."""

    def __init__(self) -> None:
        super().__init__("Mask")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Whether `other` can stand for one of each walk."""
        return Conversion.promote if isinstance(other, types.Boolean) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """The type that holds both."""
        return self if isinstance(other, types.Boolean) else None


LANE = Lane()
MASK = Mask()
_intrinsic: Any = extending.intrinsic
DOUBLES = ir.VectorType(ir.DoubleType(), WIDTH)
_BITS = ir.VectorType(ir.IntType(1), WIDTH)


@register_model(Lane)
class _LaneModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, DOUBLES)


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _BITS)


def of_each(builder: Any, value: Any) -> Any:
    """The same value for each walk."""
    kind = ir.VectorType(value.type, WIDTH)
    if isinstance(value, ir.Constant):
        return ir.Constant(kind, [value.constant] * WIDTH)
    none = ir.Constant(kind, ir.Undefined)
    first = builder.insert_element(none, value, ir.Constant(ir.IntType(32), 0))
    places = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(first, none, places)


@lower_cast(types.Float, Lane)
@lower_cast(types.Integer, Lane)
def _number_to_lane(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
    return of_each(builder, context.cast(builder, value, fromty, types.float64))


@lower_cast(types.Boolean, Mask)
def _truth_to_mask(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
    return of_each(builder, value)


def operators(
    functions: tuple[Any, ...], kind: Any, single: Any, result: Any, emit: Callable[..., Any]
) -> None:
    """Gives `functions` of one or two arguments of `kind` (an instance), or one and a `single`."""

    def typed(self: Any, args: Any, kws: Any) -> Any:
        own = any(arg == kind for arg in args)
        if own and all(arg == kind or isinstance(arg, single) for arg in args):
            return signature(result, *(kind for _ in args))
        return None

    for function in functions:
        template = type("_Template", (AbstractTemplate,), {"key": function, "generic": typed})
        # as a decorator it asks for the module, which ufuncs of NumPy 1 do not know
        infer_global(function, types.Function(template))
        for count in (1, 2):
            lower_builtin(function, *[type(kind)] * count)(
                lambda context, builder, sig, args: emit(builder, *args)
            )


def _llvm(name: str) -> Callable[..., Any]:
    """A function of LLVM's own on the numbers of all walks."""

    def emit(builder: Any, *args: Any) -> Any:
        kind = ir.FunctionType(DOUBLES, [DOUBLES] * len(args))
        function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{WIDTH}f64")
        return builder.call(function, args)

    return emit


_NUMBER = (types.Float, types.Integer)
for _functions, _emit in (
    ((operator.add, operator.iadd), lambda builder, x, y: builder.fadd(x, y)),
    ((operator.sub, operator.isub), lambda builder, x, y: builder.fsub(x, y)),
    ((operator.mul, operator.imul), lambda builder, x, y: builder.fmul(x, y)),
    ((operator.truediv, operator.itruediv), lambda builder, x, y: builder.fdiv(x, y)),
    ((operator.neg,), lambda builder, x: builder.fneg(x)),
    ((math.sqrt,), _llvm("sqrt")),
    ((math.fabs, abs), _llvm("fabs")),
    ((math.copysign,), _llvm("copysign")),
):
    operators(_functions, LANE, _NUMBER, LANE, _emit)
for _function, _sign in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
):
    operators(
        (_function,),
        LANE,
        _NUMBER,
        MASK,
        lambda builder, x, y, sign=_sign: builder.fcmp_ordered(sign, x, y),
    )
for _functions, _emit in (
    ((operator.and_, operator.iand), lambda builder, x, y: builder.and_(x, y)),
    ((operator.or_, operator.ior), lambda builder, x, y: builder.or_(x, y)),
):
    operators(_functions, MASK, types.Boolean, MASK, _emit)


# In place of `if` on numbers: of float and bool, of lanes and masks, and in Python of numpy arrays
# and of arrays of AutoDiffXd.


def select(where: Any, yes: Any, no: Any) -> Any:
    """`yes` where `where` holds, else `no`; both are worked out."""
    if isinstance(where, (bool, np.bool_)):
        chosen = yes if where else no
        # as of np.where, what is written to either one later does not change it
        return chosen.copy() if isinstance(chosen, np.ndarray) else chosen
    return np.where(where, yes, no)


def some(where: Any) -> bool:
    """Whether it holds in any walk."""
    return bool(np.any(where))


def every(where: Any) -> bool:
    """Whether it holds in all walks."""
    return bool(np.all(where))


def negated(where: Any) -> Any:
    """Where it does not hold."""
    return np.logical_not(where)


def first(where: Any) -> Any:
    """The first walk in which it holds, alone."""
    return where


def _compiled_form(function: Any, typed: Callable[..., Any], emit: Callable[..., Any]) -> None:
    """Gives a function of this module its compiled form: typed(*types) says the type of the result
    and those of the arguments, emit(builder, kind, *values) makes it, with the first one's type.
    As an operator, without a function of its own that each call would have to be resolved to."""

    def generic(self: Any, args: Any, kws: Any) -> Any:
        return None if kws else signature(*typed(*args))

    infer_global(function)(type("_Template", (AbstractTemplate,), {"generic": generic}))
    count = function.__code__.co_argcount
    lower_builtin(function, *[types.Any] * count)(
        lambda context, builder, sig, args: emit(builder, sig.args[0], *args)
    )


def _select_types(where: Any, yes: Any, no: Any) -> tuple[Any, ...]:
    own = [kind for kind in (yes, no) if not isinstance(kind, _NUMBER)]
    kind = LANE if MASK == where else [*own, types.float64][0]
    return kind, where, kind, kind


def _first_bit(builder: Any, kind: Any, where: Any) -> Any:
    if kind != MASK:
        return where
    number = builder.bitcast(where, ir.IntType(WIDTH))
    return builder.bitcast(builder.and_(number, builder.neg(number)), _BITS)


def _reduced(sign: str, against: int) -> Callable[..., Any]:
    """Whether the bits of a mask, read as one number, are as `sign` says to `against`."""

    def emit(builder: Any, kind: Any, where: Any) -> Any:
        if kind != MASK:
            return where
        bits = ir.IntType(WIDTH)
        return builder.icmp_unsigned(sign, builder.bitcast(where, bits), ir.Constant(bits, against))

    return emit


_compiled_form(select, _select_types, lambda builder, kind, *values: builder.select(*values))
_compiled_form(negated, lambda where: (where, where), lambda builder, kind, x: builder.not_(x))
_compiled_form(first, lambda where: (where, where), _first_bit)
_compiled_form(some, lambda where: (types.boolean, where), _reduced("!=", 0))
_compiled_form(every, lambda where: (types.boolean, where), _reduced("==", (1 << WIDTH) - 1))


# Functions that are the same to the bit for one walk and for eight.


def floor(x: Any) -> Any:
    """The largest whole number that is not above x."""
    return np.floor(x)


@_intrinsic
def _floor(typingctx: Any, x: Any) -> Any:
    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        if x == LANE:
            return _llvm("floor")(builder, *args)
        return builder.call(builder.module.declare_intrinsic("llvm.floor", [args[0].type]), args)

    return x(x), emit


@overload(floor, strict=False)
def _floor_of(x: Any) -> Any:
    return lambda x: _floor(x)  # noqa: PLW0108


def _one_by_one(name: str) -> Any:
    """A function of the library's on the float64 of one walk after the other."""

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        function = builder.module.declare_intrinsic(name, [ir.DoubleType()])
        result = ir.Constant(DOUBLES, ir.Undefined)
        for walk in range(WIDTH):
            place = ir.Constant(ir.IntType(32), walk)
            given = [builder.extract_element(value, place) for value in args]
            result = builder.insert_element(result, builder.call(function, given), place)
        return result

    return emit


@_intrinsic
def _power(typingctx: Any, x: Any, n: Any) -> Any:
    return LANE(LANE, LANE), _one_by_one("llvm.pow")


@_intrinsic
def _logarithm(typingctx: Any, x: Any) -> Any:
    return LANE(LANE), _one_by_one("llvm.log")


def power(x: Any, n: Any) -> Any:
    """x to the power n, of x >= 0 and n > 0; the gradient at x = 0 by an n that is an AutoDiffXd is
    zero."""
    if np.asarray(n).dtype != object:
        return x**n
    # AutoDiffXd ** AutoDiffXd does not exist
    safe = select(x > 0.0, x, 0.0 * x + 1.0)
    value = np.exp(n * np.log(safe))
    return select(x > 0.0, value, 0.0 * value)


@overload(power, strict=False)
def _power_of(x: Any, n: Any) -> Any:
    if LANE not in (x, n):
        if all(isinstance(kind, _NUMBER) for kind in (x, n)):
            return lambda x, n: x if n == 1.0 else x**n
        return lambda x, n: x**n

    def lanes_power(x: Any, n: Any) -> Any:
        if every((n >= 1.0) & (n <= 1.0)):  # what the library gives, too
            return x
        return _power(x, n)

    return lanes_power


def logarithm(x: Any) -> Any:
    """Natural logarithm of x > 0."""
    return np.log(x)


@overload(logarithm, strict=False)
def _logarithm_of(x: Any) -> Any:
    if x == LANE:
        return lambda x: _logarithm(x)  # noqa: PLW0108
    return lambda x: math.log(x)  # noqa: PLW0108


def root(x: Any) -> Any:
    """Square root of x >= 0, whose gradient at 0 is zero."""
    safe = select(x > 0.0, x, 0.0 * x + 1.0)
    return select(x > 0.0, np.sqrt(safe), 0.0 * x)


@overload(root, strict=False)
def _root_of(x: Any) -> Any:
    return lambda x: math.sqrt(x)  # noqa: PLW0108


def plain(x: Any) -> Any:
    """The number without its derivatives."""
    return x.value() if hasattr(x, "value") else x


@overload(plain, strict=False)
def _plain_of(x: Any) -> Any:
    if isinstance(x, _NUMBER):
        return lambda x: x
    return lambda x: x.value


HALF_PI_1 = float.fromhex("0x1.921fb544p+0")
HALF_PI_2 = float.fromhex("0x1.0b4611a6p-34")
HALF_PI_3 = float.fromhex("0x1.3198a2e037073p-69")
"""pi / 2 in three parts; the first two have 33 bits, so that their products with whole numbers up
to 2^20 are exact."""


@register_jitable
def sine_cosine(x: Any) -> tuple[Any, Any]:
    """Sine and cosine of an angle (rad), within two units in the last place of 1 up to 1e6 rad.

    The nearest multiple of pi / 2 is taken from the angle in three parts (Cody, Waite 1980,
    Software Manual for the Elementary Functions). For what is left, at most pi / 4, the series of
    Taylor end where their next terms are below the rounding of 1.
    """
    turns: Any = floor(x * (2.0 / math.pi) + 0.5)
    r = ((x - turns * HALF_PI_1) - turns * HALF_PI_2) - turns * HALF_PI_3
    y = r * r
    s = 1.0 / 6227020800.0 - y / 1307674368000.0
    s = 1.0 / 362880.0 - y * (1.0 / 39916800.0 - y * s)
    s = 1.0 / 6.0 - y * (1.0 / 120.0 - y * (1.0 / 5040.0 - y * s))
    s = r - r * (y * s)
    c = 1.0 / 87178291200.0 - y / 20922789888000.0
    c = 1.0 / 3628800.0 - y * (1.0 / 479001600.0 - y * c)
    c = 1.0 / 24.0 - y * (1.0 / 720.0 - y * (1.0 / 40320.0 - y * c))
    c = 1.0 - y * (0.5 - y * c)

    # the quarter of the circle, 0 to 3, which exchanges them and turns their signs
    quarter = turns - 4.0 * floor(0.25 * turns)
    odd = ((quarter > 0.5) & (quarter < 1.5)) | (quarter > 2.5)
    sine = select(odd, c, s)
    cosine = select(odd, s, c)
    return (
        select(quarter > 1.5, -sine, sine),
        select((quarter > 0.5) & (quarter < 2.5), -cosine, cosine),
    )


# Arrays whose last axis is the walk's.


def as_lanes(context: Any, builder: Any, kind: Any, made: Any, value: Any) -> Any:
    """An array of the type `kind` as one of the type `made`, without a copy."""
    array = context.make_array(kind)(context, builder, value)
    view = context.make_array(made)(context, builder)
    populate_array(
        view,
        data=builder.bitcast(array.data, context.get_data_type(LANE).as_pointer()),
        shape=cgutils.unpack_tuple(builder, array.shape)[:-1],
        strides=cgutils.unpack_tuple(builder, array.strides)[:-1],
        itemsize=context.get_constant(types.intp, 8 * WIDTH),
        meminfo=array.meminfo,
        parent=array.parent,
    )
    return view._getvalue()


@_intrinsic
def _eights(typingctx: Any, array: Any) -> Any:
    made = types.Array(LANE, array.ndim, "C", aligned=False)

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        old = context.make_array(array)(context, builder, args[0])
        shape = cgutils.unpack_tuple(builder, old.shape)
        strides = cgutils.unpack_tuple(builder, old.strides)
        width = context.get_constant(types.intp, WIDTH)
        view = context.make_array(made)(context, builder)
        populate_array(
            view,
            data=builder.bitcast(old.data, context.get_data_type(LANE).as_pointer()),
            shape=[*shape[:-1], builder.sdiv(shape[-1], width)],
            strides=[*strides[:-1], builder.mul(strides[-1], width)],
            itemsize=context.get_constant(types.intp, 8 * WIDTH),
            meminfo=old.meminfo,
            parent=old.parent,
        )
        return impl_ret_borrowed(context, builder, made, view._getvalue())

    return made(array), emit


_settings: Any = config
eights: Any = (
    (lambda array: array.reshape(*array.shape[:-1], array.shape[-1] // WIDTH, WIDTH))
    if _settings.DISABLE_JIT
    else _eights
)
"""A contiguous array whose last axis has a multiple of WIDTH numbers as one of lanes, each of WIDTH
numbers that follow each other; nothing is copied. With NUMBA_DISABLE_JIT=1 a lane is a row of
numbers."""


def side_by_side(
    shape: tuple[int, ...], *, make: Callable[..., np.ndarray] = np.zeros
) -> np.ndarray:
    """Zeros, or what else `make` makes, (*shape, WIDTH) each of whose lanes is in one line of the
    processor's cache; one that is in two takes more than twice as long."""
    line = 8 * WIDTH
    size = line * math.prod(shape)
    memory = make(size + line, dtype=np.uint8)
    begin = -memory.ctypes.data % line
    return memory[begin : begin + size].view(np.float64).reshape(*shape, WIDTH)


TOGETHER = 1 if _settings.DISABLE_JIT else WIDTH
"""How many walks go side by side."""
