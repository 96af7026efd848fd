"""What lets Python free the LeafSystems of this package, and with them the diagrams that hold them.

Drake keeps a system's callbacks in C++, where Python's garbage collector does not see that they refer to the system: a
bound method, or a lambda that names `self`, would keep it for ever (RobotLocomotion/drake#22515, #24162). So callbacks
here refer to their system weakly; whoever owns the diagram keeps the system.

A port refers to its system and the system to its ports. pydrake stores that where the collector sees it, in the
attribute PEERS; but with pydrake 1.51 under Python 3.11 the `__dict__` of a Python class under a pybind11 class is
counted twice (`gc.get_referents` shows it), and what is in it is then never freed. So PEERS and the attributes that
hold ports are slots: every system begins with `__slots__ = (PEERS, "_some_port", ...)`. If pydrake renames its
attribute, systems live longer than they should, and nothing else happens.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable
from functools import partial, wraps
from types import MethodType
from typing import Any

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.multibody.plant import ExternallyAppliedSpatialForce_
from pydrake.symbolic import Expression
from pydrake.systems.framework import CacheIndex, Context, DependencyTicket, LeafSystem_, OutputPort, ValueProducer

PEERS = "_pydrake_internal_ref_cycle_peers"


def weakly(callback: Callable[..., Any]) -> Callable[..., Any]:
    """A method, or a `functools.partial` of one, as a callable that does not own the method's object.

    Anything else is returned as it is.
    """
    method, first = (callback.func, callback.args) if isinstance(callback, partial) else (callback, ())
    if not isinstance(method, MethodType):
        return callback
    function, owner = method.__func__, weakref.ref(method.__self__)
    return lambda *args: function(owner(), *first, *args)


def _quietly(calc: Callable[..., Any]) -> Callable[..., Any]:
    """`calc` for symbolic expressions, which Drake stores as numbers that are not: numpy would warn of each."""
    def quiet(*args: Any) -> Any:
        with np.errstate(invalid="ignore"):
            return calc(*args)

    return quiet


class Cached:
    """A cache entry of a system, held without owning the system as Drake's CacheEntry does."""

    def __init__(self, system: Any, index: CacheIndex, ticket: DependencyTicket) -> None:
        self._system, self._index, self._ticket = weakref.ref(system), index, ticket

    def Eval(self, context: Context) -> Any:
        """Its value, computed if what it depends on has changed."""
        return self._system().get_cache_entry(self._index).Eval(context)

    def ticket(self) -> DependencyTicket:
        """What others that depend on it declare as prerequisite."""
        return self._ticket


class Collectable:
    """Mixin, before LeafSystem, for systems that end with the last reference to them. Callbacks are methods.

    Attributes:
        why_not_symbolic: what `plants.to_symbolic` says of a system that has no form in symbolic expressions.
    """

    why_not_symbolic = "it chooses between branches of its law by the size of its inputs, which an expression has not"

    def _begin(self, converter: Any, arguments: dict[str, Any]) -> None:
        super().__init__(converter=converter)  # type: ignore[call-arg]
        self._arguments = arguments

    def DeclareVectorOutputPort(self, name: str, model: Any, calc: Callable[..., None], *more: Any) -> OutputPort:
        """As Drake's, without owning the system that the method `calc` belongs to."""
        calc = _quietly(weakly(calc)) if isinstance(self, LeafSystem_[Expression]) else weakly(calc)
        return super().DeclareVectorOutputPort(name, model, calc, *more)  # type: ignore[misc]

    def DeclareAbstractOutputPort(
        self, name: str, alloc: Callable[[], AbstractValue], calc: Callable[..., None], *more: Any
    ) -> OutputPort:
        """As Drake's, without owning the system that the method `calc` belongs to."""
        return super().DeclareAbstractOutputPort(name, alloc, weakly(calc), *more)  # type: ignore[misc]

    def DeclarePeriodicDiscreteUpdateEvent(
        self, period_sec: float, offset_sec: float, update: Callable[..., Any]
    ) -> None:
        """As Drake's, without owning the system that the method `update` belongs to."""
        super().DeclarePeriodicDiscreteUpdateEvent(period_sec, offset_sec, weakly(update))  # type: ignore[misc]

    def _declare_value(self, name: str, size: int, calc: Callable[[Context], Any], *more: Any) -> OutputPort:
        """An output port (size,) whose value is what the method `calc(context)` returns."""
        value = weakly(calc)
        return self.DeclareVectorOutputPort(
            name, size, lambda context, out: out.SetFromVector(value(context)), *more)

    def _declare_parts(self, entry: Cached, **sizes: int) -> None:
        """An output port name=size for each of these parts of a cached mapping."""
        for name, size in sizes.items():
            self._declare_value(name, size, lambda context, name=name: entry.Eval(context)[name])

    def _declare_spatial_forces(self, T: type, calc: Callable[[Context], list]) -> None:
        """The output port for a plant's `applied_spatial_force`: the list that the method `calc(context)` returns."""
        forces = weakly(calc)
        self.DeclareAbstractOutputPort(
            "spatial_forces", lambda: AbstractValue.Make([ExternallyAppliedSpatialForce_[T]()]),
            lambda context, out: out.set_value(forces(context)))

    def _declare_cached(self, name: str, calc: Callable[[Context], Any], prerequisites: set) -> Cached:
        """A cache entry that holds whatever Python object the method `calc(context)` returns."""
        compute = weakly(calc)
        entry = self.DeclareCacheEntry(  # type: ignore[attr-defined]
            name, ValueProducer(allocate=lambda: AbstractValue.Make(()),
                                calc=lambda context, value: value.set_value(compute(context))), prerequisites)
        return Cached(self, entry.cache_index(), entry.ticket())


def constructor(construct: Callable[..., None]) -> Callable[..., None]:
    """Decorates the `_construct` of a Collectable template: it begins as LeafSystem and keeps its arguments."""
    @wraps(construct)
    def _construct(self: Collectable, *, converter: Any = None, **arguments: Any) -> None:
        self._begin(converter, arguments)
        construct(self, **arguments)

    return _construct


def copied(self: Any, other: Any, converter: Any = None) -> None:
    """The `_construct_copy` of a template whose `_construct` is a `constructor`: the same for another scalar type."""
    self._construct(converter=converter, **other._arguments)
