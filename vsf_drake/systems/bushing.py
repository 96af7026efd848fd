"""The compliant interface between residual limb and socket."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from vsf_drake.laws.bushing import axis_force
from vsf_drake.systems._lifetime import PEERS
from vsf_drake.systems._parameters import NamedParameters


@TemplateSystem.define("SocketBushing_", T_list=[float, AutoDiffXd], scope=sys.modules[__name__])
def SocketBushing_(T):
    class Impl(NamedParameters, LeafSystem_[T]):
        """Six springs and dampers with limits on the six coordinates between residual limb and socket.

        The law of each axis is `vsf_drake.laws.bushing.axis_force`. The socket hangs on the limb by
        six joints of one degree of freedom, so that the law's force on a coordinate is that
        coordinate's generalized force, and limb and socket feel equal and opposite actions.

        .. pydrake_system::

            name: SocketBushing
            input_ports:
            - state
            output_ports:
            - generalized_force
            - wrench

        Inputs: state (2 num_velocities,), [q; v] of the plant, every joint of one degree of freedom.
        Outputs: generalized_force (num_velocities,), zero outside the six; wrench (6,), on the
        socket along tx, ty, tz (N) and about flexion, adduction, rotation (N m).

        Wiring: state from MultibodyPlant; generalized_force, added to those of the other systems,
        to its applied_generalized_force.

        Args:
            num_velocities: of the plant.
            velocity_indices: 6 indices into v (and q): tx, ty, tz, flexion, adduction, rotation.
            stiffness, stiffness_negative, damping, limit, rate_limit: (6,) constants of the law, SI.
            stop_ratio: scalar, constant of the law.

        Parameters in the Context: stiffness, stiffness_negative, damping, limit, rate_limit,
        stop_ratio.

        Raises:
            ValueError: there are not six indices, or an array has the wrong shape.
        """

        __slots__ = (PEERS, "_state_port")

        def _construct(
            self,
            *,
            num_velocities: int,
            velocity_indices: Sequence[int],
            stiffness: np.ndarray,
            stiffness_negative: np.ndarray,
            damping: np.ndarray,
            limit: np.ndarray,
            rate_limit: np.ndarray,
            stop_ratio: float,
            converter=None,
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            if len(velocity_indices) != 6:
                raise ValueError(f"velocity_indices must be 6, but are {len(velocity_indices)}")
            constants = {
                "stiffness": stiffness, "stiffness_negative": stiffness_negative, "damping": damping, "limit": limit,
                "rate_limit": rate_limit, "stop_ratio": stop_ratio,
            }
            self._arguments = {
                "num_velocities": num_velocities, "velocity_indices": list(velocity_indices), **constants}
            self._count, self._at = num_velocities, np.array(velocity_indices, dtype=int)
            self._state_port = self.DeclareVectorInputPort("state", 2 * num_velocities)
            shapes = dict.fromkeys(constants, (6,)) | {"stop_ratio": ()}
            self._declare_parameters(T, "socket_", **{name: (value, shapes[name]) for name, value in constants.items()})
            self.DeclareVectorOutputPort("generalized_force", num_velocities, self._calc_generalized_force)
            self._declare_value("wrench", 6, self._calc_wrench)

        def _construct_copy(self, other, converter=None) -> None:
            Impl._construct(self, converter=converter, **other._arguments)

        def _calc_wrench(self, context) -> np.ndarray:
            state = self._state_port.Eval(context)
            return axis_force(state[self._at], state[self._count + self._at], **self._constants(context))

        def _calc_generalized_force(self, context, output) -> None:
            force = np.zeros(self._count, dtype=T if T is float else object)
            force[self._at] = self._calc_wrench(context)
            output.SetFromVector(force)

    return Impl


SocketBushing = SocketBushing_[float]
