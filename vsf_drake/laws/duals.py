"""A number with its derivatives in seven directions, for compiled code that is written once for
float64 and for this.

`Dual` holds the number and its derivatives (`DIRECTIONS`) in one register of the processor; numba
works on it as on float64, with the rules of differentiation. It is compared by its number alone,
so that `if` and `select` choose the branch that float64 takes, and its number is that of float64.
"""

from __future__ import annotations

import math
import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.core.imputils import impl_ret_borrowed
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import (
    intrinsic,
    lower_cast,
    lower_getattr,
    models,
    register_model,
)

from vsf_drake.laws.lanes import DOUBLES, WIDTH, as_lanes, of_each, operators

DIRECTIONS = WIDTH - 1


class Dual(types.Type):
    """A float64 and DIRECTIONS derivatives of it."""

    def __init__(self) -> None:
        super().__init__("Dual")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Whether a number of `other` can stand for one without derivatives."""
        return Conversion.promote if isinstance(other, (types.Float, types.Integer)) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """The type that holds both."""
        return self if isinstance(other, (types.Float, types.Integer)) else None


DUAL = Dual()
_FIRST = ir.Constant(ir.IntType(32), 0)


@register_model(Dual)
class _DualModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, DOUBLES)


@infer_getattr
class _DualAttributes(AttributeTemplate):
    key = Dual

    def resolve_value(self, kind: Any) -> Any:
        return types.float64


@lower_getattr(Dual, "value")
def _value_of(context: Any, builder: Any, kind: Any, x: Any) -> Any:
    return _number(builder, x)


def _number(builder: Any, x: Any) -> Any:
    return builder.extract_element(x, _FIRST)


def _with(builder: Any, number: Any, derivatives: Any) -> Any:
    return builder.insert_element(derivatives, number, _FIRST)


def _times(builder: Any, x: Any, factor: Any) -> Any:
    return builder.fmul(x, of_each(builder, factor))


@lower_cast(types.Float, Dual)
@lower_cast(types.Integer, Dual)
def _number_to_dual(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
    number = context.cast(builder, value, fromty, types.float64)
    return _with(builder, number, ir.Constant(DOUBLES, [0.0] * WIDTH))


def _product(builder: Any, x: Any, y: Any) -> Any:
    a = _number(builder, x)
    b = _number(builder, y)
    derivatives = builder.fadd(_times(builder, x, b), _times(builder, y, a))
    return _with(builder, builder.fmul(a, b), derivatives)


def _quotient(builder: Any, x: Any, y: Any) -> Any:
    b = _number(builder, y)
    ratio = builder.fdiv(_number(builder, x), b)
    rest = builder.fsub(x, _times(builder, y, ratio))
    return _with(builder, ratio, builder.fdiv(rest, of_each(builder, b)))


def _call(builder: Any, name: str, *numbers: Any) -> Any:
    function = builder.module.declare_intrinsic(f"llvm.{name}", [ir.DoubleType()])
    return builder.call(function, numbers)


def _where_positive(builder: Any, number: Any, value: Any) -> Any:
    zero = ir.Constant(ir.DoubleType(), 0.0)
    return builder.select(builder.fcmp_ordered(">", number, zero), value, zero)


def _root(builder: Any, x: Any) -> Any:
    number = _number(builder, x)
    root = _call(builder, "sqrt", number)
    slope = builder.fdiv(ir.Constant(ir.DoubleType(), 0.5), root)
    return _with(builder, root, _times(builder, x, _where_positive(builder, number, slope)))


def _logarithm(builder: Any, x: Any) -> Any:
    number = _number(builder, x)
    slope = builder.fdiv(ir.Constant(ir.DoubleType(), 1.0), number)
    return _with(builder, _call(builder, "log", number), _times(builder, x, slope))


def _magnitude(builder: Any, x: Any) -> Any:
    zero = ir.Constant(ir.DoubleType(), 0.0)
    negative = builder.fcmp_ordered("<", _number(builder, x), zero)
    return builder.select(negative, builder.fneg(x), x)


def _sine(builder: Any, x: Any) -> Any:
    number = _number(builder, x)
    slope = _call(builder, "cos", number)
    return _with(builder, _call(builder, "sin", number), _times(builder, x, slope))


def _cosine(builder: Any, x: Any) -> Any:
    number = _number(builder, x)
    slope = builder.fneg(_call(builder, "sin", number))
    return _with(builder, _call(builder, "cos", number), _times(builder, x, slope))


def _power(builder: Any, x: Any, n: Any) -> Any:
    base = _number(builder, x)
    exponent = _number(builder, n)
    power = _call(builder, "pow", base, exponent)
    by_base = builder.fmul(exponent, builder.fdiv(power, base))
    by_exponent = builder.fmul(power, _call(builder, "log", base))
    derivatives = builder.fadd(
        _times(builder, x, _where_positive(builder, base, by_base)),
        _times(builder, n, _where_positive(builder, base, by_exponent)),
    )
    return _with(builder, power, derivatives)


_NUMBER = (types.Float, types.Integer)
for _functions, _emit in (
    ((operator.add, operator.iadd), lambda builder, x, y: builder.fadd(x, y)),
    ((operator.sub, operator.isub), lambda builder, x, y: builder.fsub(x, y)),
    ((operator.mul, operator.imul), _product),
    ((operator.truediv, operator.itruediv), _quotient),
    ((operator.pow,), _power),
    ((operator.neg,), lambda builder, x: builder.fneg(x)),
    ((math.sqrt,), _root),
    ((math.log,), _logarithm),
    ((math.fabs, abs), _magnitude),
    ((np.sin,), _sine),
    ((np.cos,), _cosine),
):
    operators(_functions, DUAL, _NUMBER, DUAL, _emit)
for _function, _sign in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.eq, "=="),
):
    operators(
        (_function,),
        DUAL,
        _NUMBER,
        types.boolean,
        lambda builder, x, y, sign=_sign: builder.fcmp_ordered(
            sign, _number(builder, x), _number(builder, y)
        ),
    )


@intrinsic
def _duals(typingctx: Any, array: Any) -> Any:
    made = types.Array(DUAL, array.ndim - 1, "C", aligned=False)

    def emit(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        new = as_lanes(context, builder, array, made, args[0])
        return impl_ret_borrowed(context, builder, made, new)

    return made(array), emit


duals: Any = _duals
"""A contiguous array (..., WIDTH) of float64, a number and its derivatives in each row, as one of
Duals; nothing is copied."""
