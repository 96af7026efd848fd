"""Named numeric parameters for the LeafSystems of this package."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.systems.framework import BasicVector_, Context

from vsf_drake.errors import InputError
from vsf_drake.systems._lifetime import Cached, Collectable


class NamedParameters(Collectable):
    """Mixin for a LeafSystem whose physical constants are numeric parameters in the Context.

    Each named constant is one numeric parameter group, stored row by row. Values can so be
    changed without rebuilding the diagram, and differ between Contexts.

    Attributes:
        parameter_index: name of each constant -> index of its numeric parameter group.
    """

    parameter_index: dict[str, int]

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names that `GetParameter` and `SetParameters` know."""
        return tuple(self.parameter_index)

    def GetParameter(self, context: Context, name: str) -> np.ndarray:
        """Value of the constant `name` in this system's `context`, a copy in the shape it was declared with.

        Raises:
            ValueError: there is no constant of that name.
            InputError: the Context is another system's, such as the whole diagram's.
        """
        self._check_own(context)
        index, shape = self._lookup(name)
        return context.get_numeric_parameter(index).CopyToVector().reshape(shape)

    def SetParameters(self, context: Context, **values: Any) -> None:
        """Sets constants by name in this system's `context`; a scalar fills a whole array.

        Raises:
            ValueError: there is no constant of that name, or the value does not fit its shape or is no finite number.
            InputError: the Context is another system's, such as the whole diagram's.
                Nothing has been set then.
        """
        self._check_own(context)
        checked = {}
        for name, value in values.items():
            index, shape = self._lookup(name)
            try:
                vector = checked[index] = np.broadcast_to(value, shape).ravel()
            except ValueError:
                raise ValueError(f"{name} has shape {shape}, but was given {np.shape(value)}") from None
            numbers = all(item is not None for item in vector) if vector.dtype == object else (
                vector.dtype.kind in "biuf" and np.isfinite(vector).all())
            if not numbers:
                raise ValueError(f"{name} must be a finite number or numbers, but was given {value!r}")
        for index, vector in checked.items():
            context.get_mutable_numeric_parameter(index).SetFromVector(vector)

    def _check_own(self, context: Context) -> None:
        """The numeric parameters of a diagram are numbered on; those of another system would be changed unseen."""
        try:
            self.ValidateContext(context)
        except (RuntimeError, TypeError):
            raise InputError("belongs to another system than this", where=f"context of {self.get_name()!r}",
                             right="Take system.GetMyMutableContextFromRoot(root_context)") from None

    def _lookup(self, name: str) -> tuple[int, tuple[int, ...]]:
        if name not in self.parameter_index:
            raise ValueError(f"there is no parameter {name!r}; known are {', '.join(self.parameter_index)}")
        return self.parameter_index[name], self._parameter_shapes[name]

    def _declare_parameters(self, T: type, **constants: tuple[Any, tuple[int, ...]]) -> None:
        """Declares name=(value, shape); the value is broadcast to the shape."""
        self.parameter_index, self._parameter_shapes = {}, {}
        for name, (value, shape) in constants.items():
            try:
                vector = np.broadcast_to(np.asarray(value, dtype=float), shape).ravel()
            except ValueError:
                raise ValueError(f"{name} must have shape {shape}, but has {np.shape(value)}") from None
            self.parameter_index[name] = self.DeclareNumericParameter(BasicVector_[T](vector))
            self._parameter_shapes[name] = shape
        self._constants_entry = self._declare_cached(
            "constants", self._read_parameters, {self.all_parameters_ticket()})

    def _read_parameters(self, context: Context) -> dict[str, Any]:
        return {
            name: context.get_numeric_parameter(index).CopyToVector().reshape(self._parameter_shapes[name])[()]
            for name, index in self.parameter_index.items()
        }

    def _constants(self, context: Context) -> dict[str, Any]:
        """All constants by name; scalars as scalars. Read once per change of a parameter."""
        return self._constants_entry.Eval(context)

    def _declare_inputs_cache(self, name: str, calc: Callable[[Context], Any]) -> Cached:
        """A cache entry that depends on the input ports and parameters declared so far."""
        return self._declare_cached(name, calc, {self.all_input_ports_ticket(), self.all_parameters_ticket()})
