"""Named numeric parameters for the LeafSystems of this package, each within bounds, and the fulcrum's position."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.symbolic import Expression
from pydrake.systems.framework import BasicVector_, Context, LeafSystem_

from vsf_drake.errors import InputError
from vsf_drake.ground import GroundPatch
from vsf_drake.parameters import (
    ActuatorParameters,
    BushingAxis,
    ContactZone,
    FrictionParameters,
    FulcrumParameters,
    SocketParameters,
)
from vsf_drake.systems._lifetime import Cached, Collectable

Bounds = tuple[str, float, float]
"""Unit, least and largest value."""


def _of(schema: type, before: str = "", **names: str) -> dict[str, Bounds]:
    """Bounds of the parameters name=field as the schema has them; without names of all, with `before` before theirs."""
    metadata = {field.name: field.metadata for field in fields(schema)}
    return {name: (metadata[field]["unit"], metadata[field]["low"], metadata[field]["high"])
            for name, field in (names or {f"{before}{field}": field for field in metadata}).items()}


def _positive(unit: str, *names: str, low: float = 0.0) -> dict[str, Bounds]:
    return dict.fromkeys(names, (unit, low, math.inf))


BOUNDS: dict[str, Bounds] = {
    **_of(ContactZone, radius="radius_m", stiffness="stiffness", exponent="exponent", damping="damping_n_s_per_m",
          full_damping_depth="full_damping_depth_m"),
    "radius": ("m", 0.0, 0.2), **_positive("N s/m", "damping"), **_positive("N/m^exponent", "stiffness"),
    **_of(FrictionParameters, mu_static="mu_static", mu_kinetic="mu_kinetic",
          threshold_velocity="threshold_velocity_m_per_s"),
    **_of(GroundPatch, ground_bounds="to_x_m", ground_reference_x="reference_x_m", ground_height="height_m"),
    **dict.fromkeys(("ground_slope", "ground_bank"), ("1", -1.0, 1.0)), "ground_compliance": ("m/N", 0.0, 1.0),
    **_of(FulcrumParameters, fulcrum_m="foremost_m", rearmost="rearmost_m", foremost="foremost_m",
          carriage_mass="carriage_mass_kg"),
    **_of(BushingAxis, "socket_"), **_of(SocketParameters, socket_stop_ratio="stop_ratio"), **_of(ActuatorParameters),
    "p_BS": ("m", -math.inf, math.inf), **_positive("s/m", "dissipation"),
    **_positive("m", "depth_width", "reached", low=1e-9), **_positive("m/s", "rate_width", low=1e-9),
    **_positive("N m/rad", "joint_stiffness"), **_positive("N m s/rad", "joint_damping"),
    **_positive("N/m", "fulcrum_stiffness", "carriage_gain"),
    **_positive("N s/m", "fulcrum_damping", "carriage_rate_gain"),
    **_positive("N/m or N m/rad", "position_gain"), **_positive("N s/m or N m s/rad", "velocity_gain"),
    **_positive("N", "unload_force", "load_force"), **_positive("rad/s", "swing_rate", "stop_rate"),
    "least_lean": ("rad", -math.pi, math.pi), **_positive("s", "debounce", "least_stance"),
}
"""Of every parameter in a Context: what the schemas say where they have it (a slope is at most 45 degrees, a patch's
stiffness at least 1 N/m), else what its law bears. Keel, fulcrum and socket have joint_, fulcrum_ and socket_ before
the names of their own systems."""


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
            InputError: the Context is another system's, such as the whole diagram's; a constant is out of bounds.
        """
        self._check_own(context)
        self._lookup(name)
        return np.array(self._constants(context)[name])

    def SetParameters(self, context: Context, **values: Any) -> None:
        """Sets constants by name in this system's `context`; a scalar fills a whole array.

        What is out of bounds is refused where the system is evaluated next, as what is written into the Context itself.

        Raises:
            ValueError: there is no constant of that name, or the value does not fit its shape or is no finite number.
            InputError: the Context is another system's, such as the whole diagram's. Nothing has been set then.
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

    def _declare_parameters(self, T: type, of: str = "", **constants: tuple[Any, tuple[int, ...]]) -> None:
        """Declares name=(value, shape); the value is broadcast to the shape. In BOUNDS `of` is before the names."""
        self.parameter_index, self._parameter_shapes = {}, {}
        self._bounds = {name: BOUNDS[f"{of}{name}"] for name in constants}
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
        read = {name: context.get_numeric_parameter(index).CopyToVector()
                for name, index in self.parameter_index.items()}
        for name, (unit, low, high) in self._bounds.items() if not isinstance(self, LeafSystem_[Expression]) else ():
            outside = [value for value in read[name] if not low <= value <= high]
            if outside:
                worst = outside[0].value() if isinstance(outside[0], AutoDiffXd) else outside[0]
                raise InputError(f"is {worst:g} {unit}", where=f"{name} of {self.get_name()!r}",
                                 right=f"It must be from {low:g} to {high:g} {unit}")
        return {name: value.reshape(self._parameter_shapes[name])[()] for name, value in read.items()}

    def _constants(self, context: Context) -> dict[str, Any]:
        """All constants by name; scalars as scalars. Read and checked once per change of a parameter.

        Raises:
            InputError: one is out of its BOUNDS, or not a number.
        """
        return self._constants_entry.Eval(context)

    def _declare_inputs_cache(self, name: str, calc: Callable[[Context], Any]) -> Cached:
        """A cache entry that depends on the input ports and parameters declared so far."""
        return self._declare_cached(name, calc, {self.all_input_ports_ticket(), self.all_parameters_ticket()})


FARTHEST_M = 10.0
"""Beyond it a fulcrum position is in mm (a choice, wide because a trial step of an integrator may overshoot)."""


def fulcrum_place(position: Any, system: Any) -> Any:
    """`position` (m from A), a float or AutoDiffXd, that `system` was given.

    Raises:
        InputError: it is not a number within FARTHEST_M.
    """
    if not -FARTHEST_M <= position <= FARTHEST_M:
        raise InputError(f"the fulcrum at {position} m from A is under no foot",
                         where=f"fulcrum_position of {system.get_name()!r}",
                         right="It is in metres: 0.066 to 0.151 for the nominal foot")
    return position
