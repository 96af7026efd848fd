"""What every LeafSystem of this package has: named parameters within bounds, ports by name, an end.

Drake keeps a system's callbacks in C++, where Python's garbage collector does not see that they
refer to the system: a bound method, or a lambda that names `self`, would keep it for ever
(RobotLocomotion/drake#22515, #24162). So callbacks here refer to their system weakly; whoever owns
the diagram keeps the system.

With pydrake 1.51 under Python 3.11 the `__dict__` of a Python class under a pybind11 class is
counted twice, and what is in it is never freed. So what holds the ports, PEERS of pydrake and our
own, are slots.
"""

from __future__ import annotations

import math
import sys
import warnings
import weakref
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import fields
from functools import partial, wraps
from inspect import signature
from types import MethodType
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.common.cpp_template import TemplateMethod
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform_
from pydrake.multibody.math import SpatialForce_, SpatialVelocity_
from pydrake.multibody.plant import ExternallyAppliedSpatialForce_
from pydrake.multibody.tree import BodyIndex
from pydrake.symbolic import Expression
from pydrake.systems import framework, scalar_conversion
from pydrake.systems.scalar_conversion import TemplateSystem

from vsf_drake.base.errors import InputError
from vsf_drake.model import parameters
from vsf_drake.model.ground import GroundPatch

PEERS = "_pydrake_internal_ref_cycle_peers"
FARTHEST_M = 10.0
"""Beyond it a fulcrum position is in mm (a choice, wide because a trial step of an integrator may
overshoot)."""


def _of(schema: type, before: str = "", **names: str) -> dict[str, tuple[str, float, float]]:
    metadata = {field.name: field.metadata for field in fields(schema)}
    return {
        name: (metadata[field]["unit"], metadata[field]["low"], metadata[field]["high"])
        for name, field in (names or {f"{before}{field}": field for field in metadata}).items()
    }


def _positive(unit: str, *names: str, low: float = 0.0) -> dict[str, tuple[str, float, float]]:
    return dict.fromkeys(names, (unit, low, math.inf))


BOUNDS: dict[str, tuple[str, float, float]] = {
    **_of(parameters.ContactZone, exponent="exponent", full_damping_depth="full_damping_depth_m"),
    "radius": ("m", 0.0, 0.2),
    **_positive("N s/m", "damping"),
    **_positive("N/m^exponent", "stiffness"),
    **_of(
        parameters.FrictionParameters,
        mu_static="mu_static",
        mu_kinetic="mu_kinetic",
        threshold_velocity="threshold_velocity_m_per_s",
    ),
    **_of(
        GroundPatch,
        ground_bounds="to_x_m",
        ground_reference_x="reference_x_m",
        ground_height="height_m",
        ground_speed="belt_m_per_s",
    ),
    **dict.fromkeys(("ground_slope", "ground_bank"), ("1", -1.0, 1.0)),
    "ground_compliance": ("m/N", 0.0, 1.0),
    **_of(
        parameters.FulcrumParameters,
        fulcrum_m="foremost_m",
        rearmost="rearmost_m",
        foremost="foremost_m",
        carriage_mass="carriage_mass_kg",
    ),
    **_of(parameters.BushingAxis, "socket_"),
    **_of(parameters.SocketParameters, socket_stop_ratio="stop_ratio"),
    **_of(parameters.ActuatorParameters),
    "p_BS": ("m", -math.inf, math.inf),
    **_positive("s/m", "dissipation"),
    **_positive("m", "depth_width", "reached", low=1e-9),
    **_positive("m/s", "rate_width", low=1e-9),
    **_positive("N m/rad", "joint_stiffness"),
    **_positive("N m s/rad", "joint_damping"),
    **_positive("N/m", "fulcrum_stiffness", "carriage_gain"),
    **_positive("N s/m", "fulcrum_damping", "carriage_rate_gain"),
    **_positive("N/m or N m/rad", "position_gain"),
    **_positive("N s/m or N m s/rad", "velocity_gain"),
    **_positive("N", "unload_force", "load_force"),
    **_positive("rad/s", "swing_rate", "stop_rate"),
    "least_lean": ("rad", -math.pi, math.pi),
    **_positive("s", "debounce", "least_stance"),
}
"""Unit, least and largest value of every parameter in a Context: the schemas' where they have it,
else what its law bears. Keel, fulcrum and socket have joint_, fulcrum_ and socket_ before the names
of their own systems."""


if TYPE_CHECKING:
    _Leaf = framework.LeafSystem
else:
    _Leaf = object  # `system_template` puts the LeafSystem of each scalar type beside it

R = TypeVar("R")


class System(_Leaf):
    """A system whose physical constants are numeric parameters in the Context, for any scalar type.

    Each named constant is one numeric parameter group, stored row by row; a scalar stands for an
    array of equal values. `__init__` takes keywords only; a copy for another scalar type is made of
    the same.

    Attributes:
        parameter_index: name of each constant -> index of its numeric parameter group.
        template: of the classes for all scalar types.
    """

    parameter_index: dict[str, int]
    template: ClassVar[TemplateSystem]
    _T: type[Any]  # the scalar type
    _arguments: dict[str, Any]
    _ports: dict[str, framework.InputPort]
    _shapes: dict[str, tuple[int, ...]]
    _constants: Callable[[framework.Context], dict[str, np.ndarray]]

    def _arguments_for(self, T: type) -> dict[str, Any]:
        return self._arguments

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names that `GetParameter` and `SetParameters` know."""
        return tuple(self.parameter_index)

    def GetParameter(self, context: framework.Context, name: str) -> np.ndarray:
        """Value of the constant `name` in this system's `context`, a copy in the shape it was
        declared with."""
        self._check_known(context, name)
        return np.array(self._constants(context)[name])

    def SetParameters(self, context: framework.Context, **values: Any) -> None:
        """Sets constants by name in this system's `context`; a scalar fills a whole array. What is
        out of bounds is refused where the system is evaluated next.

        Raises:
            ValueError: there is no constant of that name, or the value does not fit its shape or is
                no finite number.
            InputError: the Context is another system's, such as the whole diagram's. Nothing has
                been set then.
        """
        self._check_known(context, *values)
        checked = {}
        for name, value in values.items():
            index = self.parameter_index[name]
            shape = self._shapes[name]
            try:
                vector = checked[index] = np.broadcast_to(value, shape).ravel()
            except ValueError:
                raise ValueError(
                    f"{name} has shape {shape}, but was given {np.shape(value)}"
                ) from None
            numbers = (
                all(item is not None for item in vector)
                if vector.dtype == object
                else (vector.dtype.kind in "biuf" and np.isfinite(vector).all())
            )
            if not numbers:
                raise ValueError(
                    f"{name} must be a finite number or numbers, but was given {value!r}"
                )
        for index, vector in checked.items():
            context.get_mutable_numeric_parameter(index).SetFromVector(vector)

    def _check_known(self, context: framework.Context, *names: str) -> None:
        """The numeric parameters of a diagram are numbered on; those of another system would be
        changed unseen."""
        try:
            self.ValidateContext(context)
        except (RuntimeError, TypeError):
            raise InputError(
                "belongs to another system than this",
                where=f"context of {self.get_name()!r}",
                right="Take system.GetMyMutableContextFromRoot(root_context)",
            ) from None
        for name in names:
            if name not in self.parameter_index:
                raise ValueError(
                    f"there is no parameter {name!r}; known are {', '.join(self.parameter_index)}"
                )

    def _declare_parameters(
        self, of: str = "", /, **constants: tuple[Any, tuple[int, ...]]
    ) -> None:
        """Declares name=(value, shape); in BOUNDS `of` is before the names.
        `self._constants(context)` reads and checks them."""
        self._bounds = {name: BOUNDS[f"{of}{name}"] for name in constants}
        for name, (value, shape) in constants.items():
            try:
                vector = np.broadcast_to(np.asarray(value, dtype=float), shape).ravel()
            except ValueError:
                raise ValueError(
                    f"{name} must have shape {shape}, but has {np.shape(value)}"
                ) from None
            self.parameter_index[name] = self.DeclareNumericParameter(
                framework.BasicVector_[self._T](vector)
            )
            self._shapes[name] = shape
        self._constants = self._declare_cached(
            "constants", self._read_parameters, self.all_parameters_ticket()
        )

    def _read_parameters(self, context: framework.Context) -> dict[str, np.ndarray]:
        read = {
            name: context.get_numeric_parameter(index).CopyToVector()
            for name, index in self.parameter_index.items()
        }
        for name, (unit, low, high) in self._bounds.items() if self._T is not Expression else ():
            outside = [value for value in read[name] if not low <= value <= high]
            if outside:
                worst = outside[0].value() if isinstance(outside[0], AutoDiffXd) else outside[0]
                raise InputError(
                    f"is {worst:g} {unit}",
                    where=f"{name} of {self.get_name()!r}",
                    right=f"It must be from {low:g} to {high:g} {unit}",
                )
        return {name: value.reshape(self._shapes[name])[()] for name, value in read.items()}

    def _declare_inputs(self, **sizes: int) -> None:
        for name, size in sizes.items():
            self._ports[name] = self.DeclareVectorInputPort(name, size)

    def _declare_kinematics(self, *names: str) -> None:
        """The inputs that take MultibodyPlant's ports `body_poses` and `body_spatial_velocities`,
        or those `names`."""
        kinds = {"body_poses": RigidTransform_, "body_spatial_velocities": SpatialVelocity_}
        for name in names or kinds:
            self._ports[name] = self.DeclareAbstractInputPort(
                name, AbstractValue.Make([kinds[name][self._T]()])
            )

    def _value(self, context: framework.Context, name: str) -> Any:
        return self._ports[name].Eval(context)

    def _fulcrum_place(self, context: framework.Context) -> Any:
        """The input `fulcrum_position`, or the parameter fulcrum_m where it is not connected (m
        from A)."""
        given = "fulcrum_m" not in self.parameter_index or self._ports["fulcrum_position"].HasValue(
            context
        )
        position = (
            self._value(context, "fulcrum_position")[0]
            if given
            else self._constants(context)["fulcrum_m"]
        )
        if self._T is not Expression and not -FARTHEST_M <= position <= FARTHEST_M:
            raise InputError(
                f"the fulcrum at {position} m from A is under no foot",
                where=f"fulcrum_position of {self.get_name()!r}",
                right="It is in metres: 0.066 to 0.151 for the nominal foot",
            )
        return position

    def _declare_output(
        self,
        name: str,
        size: int,
        calc: Callable[[framework.Context], Any],
        *sources: framework.DependencyTicket,
    ) -> None:
        value = weakly(calc)

        def write(context: framework.Context, out: Any) -> None:
            out.SetFromVector(value(context))

        # which Drake stores as numbers that are not: numpy would warn of each
        if self._T is Expression:
            write = np.errstate(invalid="ignore")(write)
        self.DeclareVectorOutputPort(name, size, write, *([set(sources)] if sources else []))

    def _declare_parts(self, entry: Callable[[framework.Context], Any], **sizes: int) -> None:
        for name, size in sizes.items():
            self._declare_part(name, size, entry, name)

    def _declare_part(
        self,
        name: str,
        size: int,
        entry: Callable[[framework.Context], Any],
        key: object,
        *sources: framework.DependencyTicket,
    ) -> None:
        self._declare_output(name, size, lambda context: entry(context)[key], *sources)

    def _declare_spatial_forces(
        self, calc: Callable[[framework.Context], Iterable[tuple[int, np.ndarray]]]
    ) -> None:
        """An output of the pairs that `calc(context)` returns: body, (6,) moment and force in W at
        its origin."""
        pairs = weakly(calc)
        applied = ExternallyAppliedSpatialForce_[self._T]
        force = SpatialForce_[self._T]

        def packed(body: int, F_Bo_W: np.ndarray) -> Any:
            one = applied()
            one.body_index = BodyIndex(body)
            one.p_BoBq_B = np.zeros(3)
            one.F_Bq_W = force(F_Bo_W)
            return one

        def write(context: Any, out: Any) -> None:
            out.set_value([packed(*pair) for pair in pairs(context)])

        self.DeclareAbstractOutputPort(
            "spatial_forces", lambda: AbstractValue.Make([applied()]), write
        )

    def _declare_cached(
        self,
        name: str,
        calc: Callable[[framework.Context], R],
        *sources: framework.DependencyTicket,
    ) -> Callable[[framework.Context], R]:
        """What the method `calc(context)` returns, kept until a source changes, by default inputs
        and parameters."""
        compute = weakly(calc)
        owner: Callable[[], Any] = weakref.ref(self)

        def write(context: Any, value: Any) -> None:
            value.set_value(compute(context))

        index = self.DeclareCacheEntry(
            name,
            framework.ValueProducer(allocate=lambda: AbstractValue.Make(()), calc=write),
            set(sources or (self.all_input_ports_ticket(), self.all_parameters_ticket())),
        ).cache_index()
        return lambda context: owner().get_cache_entry(index).Eval(context)

    def _declare_start(self, publish: Callable[[framework.Context], None]) -> None:
        self.DeclareInitializationPublishEvent(weakly(publish))

    def _warn_if_deep(self, depth: float, foam_thickness: float) -> None:
        if depth > foam_thickness:
            warnings.warn(
                f"{self.get_name()!r}: the foot starts {1e3 * depth:.0f} mm deep in the ground, "
                f"and its foam is {1e3 * foam_thickness:g} mm thick: expect it to be thrown out. "
                "Raise what carries it",
                stacklevel=2,
            )

    def _declare_periodic(
        self, period: float, update: Callable[[framework.Context, framework.DiscreteValues], None]
    ) -> None:
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, weakly(update))


# (a_i b_j) flattened row by row, times this, is a × b: faster for small N than np.cross or
# components
_CROSS = np.zeros((9, 3))
_CROSS[[5, 6, 1], [0, 1, 2]] = 1.0
_CROSS[[7, 2, 3], [0, 1, 2]] = -1.0


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a × b of (N, 3) arrays, or of (3,) arrays."""
    product: np.ndarray = (a[..., :, None] * b[..., None, :]).reshape(*a.shape[:-1], 9) @ _CROSS
    return product


def weakly(method: Callable[..., R]) -> Callable[..., R]:
    """The method without a reference to its owner."""
    if not isinstance(method, MethodType):
        return method
    function, owner = method.__func__, weakref.ref(method.__self__)
    return lambda *args: function(owner(), *args)


S = TypeVar("S", bound=System)


def system_template(*others: type) -> Callable[[type[S]], type[S]]:
    """A System becomes the class for float; those for float and `others`, by default AutoDiffXd,
    are its `template`."""

    def decorate(cls: type[S]) -> type[S]:
        define: Any = TemplateSystem.define
        module = sys.modules[cls.__module__]
        cls.template = define(
            f"{cls.__name__}_", T_list=[float, *(others or [AutoDiffXd])], scope=module
        )(lambda T: _instantiation(cls, T))
        for_float: type[S]
        # Not told its module, pydrake looks for it in the sources of all that is imported.
        makes: Any = scalar_conversion
        makes.TemplateMethod = partial(TemplateMethod, scope=module)
        try:
            for_float, *_ = map(cls.template.__getitem__, cls.template.param_list)
        finally:
            makes.TemplateMethod = TemplateMethod
        return for_float

    return decorate


def _ours(cls: type) -> list[str]:
    """What this package gave to a system's class, for help() and dir(): Drake's own part of it
    would be two thousand lines."""
    classes = (
        base
        for base in cls.__mro__
        if type(base) is type and base.__module__.startswith(__package__)
    )
    names = {name for base in classes for name in vars(base) if not name.startswith("_")}
    return sorted(names - {"template"})


_Metaclass: Any = type(framework.LeafSystem)
# From Drake 1.58 on its classes take no metaclass but their own, and help() has all of theirs
with suppress(TypeError):
    _Metaclass = type("_Metaclass", (_Metaclass,), {"__dir__": _ours})


def _instantiation(cls: type[S], T: type) -> type:
    """The class for scalar type T, which TemplateSystem gives the `__init__` that chooses between
    these two."""
    leaf = framework.LeafSystem_[T]
    construct = cls.__init__

    @wraps(construct)
    def _construct(self: Any, *, converter: Any = None, **arguments: Any) -> None:
        leaf.__init__(self, converter=converter)
        self._arguments = arguments
        self._ports = {}
        self.parameter_index = {}
        self._shapes = {}
        construct(self, **arguments)

    def _construct_copy(self: Any, other: S, converter: Any = None) -> None:
        _construct(self, converter=converter, **other._arguments_for(T))

    made: type = _Metaclass(
        cls.__name__,
        (cls, leaf),
        {
            "__doc__": cls.__doc__,
            "__signature__": signature(construct).replace(
                parameters=list(signature(construct).parameters.values())[1:]
            ),
            "__slots__": (PEERS, "_ports"),
            "_T": T,
            "_construct": _construct,
            "_construct_copy": _construct_copy,
        },
    )
    return made
