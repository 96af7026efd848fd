"""For mypy, where pydrake's stubs say less than is so.

An array is there `ndarray[float64[3, 1]]` or `ndarray[float64, flags.writeable]`, which numpy's
types have no word for: here it is a bare `np.ndarray`. What a builder or a plant adds it gives back
as it was given, not as some System, Frame or Joint.
"""

from __future__ import annotations

from collections.abc import Callable

from mypy.plugin import AnalyzeTypeContext, MethodContext, Plugin
from mypy.types import AnyType, Type, TypeOfAny, UnboundType

BUILDER, PLANT = (
    "pydrake.systems.framework.DiagramBuilder",
    "pydrake.multibody.plant.MultibodyPlant",
)
ADDING = (
    f"{BUILDER}.AddSystem",
    f"{BUILDER}.AddNamedSystem",
    f"{PLANT}.AddFrame",
    f"{PLANT}.AddJoint",
)


class Pydrake(Plugin):
    """What the two functions below say of the stubs."""

    def get_type_analyze_hook(self, fullname: str) -> Callable[[AnalyzeTypeContext], Type] | None:
        return _array if fullname == "numpy.ndarray" else None

    def get_method_hook(self, fullname: str) -> Callable[[MethodContext], Type] | None:
        return _added if fullname in ADDING else None


def _array(context: AnalyzeTypeContext) -> Type:
    anything, given, api = AnyType(TypeOfAny.explicit), context.type.args, context.api
    if (
        len(given) == 2
        and isinstance(given[0], UnboundType)
        and given[0].name not in ("numpy.float64", "object")
    ):
        return api.named_type("numpy.ndarray", [api.analyze_type(part) for part in given])
    shape = api.named_type("builtins.tuple", [anything])
    return api.named_type("numpy.ndarray", [shape, api.named_type("numpy.dtype", [anything])])


def _added(context: MethodContext) -> Type:
    return context.arg_types[-1][0]


def plugin(version: str) -> type[Plugin]:
    """What mypy asks a plugin's module for."""
    return Pydrake
