"""Springs and servos on joints: the keel's elasticity, the socket's bushing, the driver of prescribed joints."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.symbolic import Expression
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from vsf_drake.laws.bushing import axis_force
from vsf_drake.systems._lifetime import PEERS, constructor, copied
from vsf_drake.systems._parameters import NamedParameters
from vsf_drake.systems._sites import scattered


@TemplateSystem.define("KeelElasticity_", T_list=[float, AutoDiffXd, Expression], scope=sys.modules[__name__])
def KeelElasticity_(T):
    class Impl(NamedParameters, LeafSystem_[T]):
        """Moment -(stiffness q + damping v) in each of m joints of the keel.

        A lumped-parameter beam: a joint in the middle of each element with stiffness E I / L_element
        and damping proportional to it (MathWorks, Flexible Beam, lumped-parameter method; McGeehan
        2021, doi 10.1115/1.4050456). The springs are here rather than in the plant's joints so that
        they can be changed in the Context and differentiated.

        .. pydrake_system::

            name: KeelElasticity
            input_ports:
            - state
            output_ports:
            - generalized_force
            - joint_moment

        Inputs: state (2 num_velocities,), [q; v] of the plant, every joint of one degree of freedom.
        Outputs: generalized_force (num_velocities,), zero outside the m; joint_moment (m,) N m.

        Wiring: state from MultibodyPlant; generalized_force, added to those of the other systems,
        to its applied_generalized_force.

        Args:
            num_velocities: of the plant.
            velocity_indices: m indices into v (and q), one per joint.
            stiffness: (m,) N m/rad; zero for a free pin.
            damping: (m,) N m s/rad.

        Parameters in the Context: stiffness, damping.

        Raises:
            ValueError: an array has the wrong shape.
        """

        __slots__ = (PEERS, "_state_port")

        @constructor
        def _construct(
            self, *, num_velocities: int, velocity_indices: Sequence[int], stiffness: np.ndarray, damping: np.ndarray
        ) -> None:
            self._count, self._at = num_velocities, np.array(velocity_indices, dtype=int)
            joints = len(self._at)
            self._state_port = self.DeclareVectorInputPort("state", 2 * num_velocities)
            self._declare_parameters(T, "joint_", stiffness=(stiffness, (joints,)), damping=(damping, (joints,)))
            self._declare_value("generalized_force", num_velocities, self._generalized_force)
            self._declare_value("joint_moment", joints, self._moment)

        _construct_copy = copied

        def _moment(self, context) -> np.ndarray:
            constants, state = self._constants(context), self._state_port.Eval(context)
            return -(constants["stiffness"] * state[self._at] + constants["damping"] * state[self._count + self._at])

        def _generalized_force(self, context) -> np.ndarray:
            return scattered(self._moment(context), self._at, self._count)

    return Impl


KeelElasticity = KeelElasticity_[float]


@TemplateSystem.define("SocketBushing_", T_list=[float, AutoDiffXd], scope=sys.modules[__name__])
def SocketBushing_(T):
    class Impl(NamedParameters, LeafSystem_[T]):
        """Six springs and dampers with limits on the six coordinates between residual limb and socket.

        The law of each axis is `vsf_drake.laws.bushing.axis_force`. The socket hangs on the limb by six joints of one
        degree of freedom, so that the law's force on a coordinate is that coordinate's generalized force, and limb and
        socket feel equal and opposite actions.

        .. pydrake_system::

            name: SocketBushing
            input_ports:
            - state
            output_ports:
            - generalized_force
            - wrench

        Inputs: state (2 num_velocities,), [q; v] of the plant, every joint of one degree of freedom.
        Outputs: generalized_force (num_velocities,), zero outside the six; wrench (6,), on the socket along tx, ty, tz
        (N) and about flexion, adduction, rotation (N m).

        Wiring: state from MultibodyPlant; generalized_force, added to those of the other systems, to its
        applied_generalized_force.

        Args:
            num_velocities: of the plant.
            velocity_indices: 6 indices into v (and q): tx, ty, tz, flexion, adduction, rotation.
            stiffness, stiffness_negative, damping, limit, rate_limit: (6,) constants of the law, SI.
            stop_ratio: scalar, constant of the law.

        Parameters in the Context: stiffness, stiffness_negative, damping, limit, rate_limit, stop_ratio.

        Raises:
            ValueError: there are not six indices, or an array has the wrong shape.
        """

        __slots__ = (PEERS, "_state_port")

        @constructor
        def _construct(
            self, *, num_velocities: int, velocity_indices: Sequence[int], stiffness: np.ndarray,
            stiffness_negative: np.ndarray, damping: np.ndarray, limit: np.ndarray, rate_limit: np.ndarray,
            stop_ratio: float
        ) -> None:
            if len(velocity_indices) != 6:
                raise ValueError(f"velocity_indices must be 6, but are {len(velocity_indices)}")
            self._count, self._at = num_velocities, np.array(velocity_indices, dtype=int)
            self._state_port = self.DeclareVectorInputPort("state", 2 * num_velocities)
            self._declare_parameters(
                T, "socket_", stiffness=(stiffness, (6,)), stiffness_negative=(stiffness_negative, (6,)),
                damping=(damping, (6,)), limit=(limit, (6,)), rate_limit=(rate_limit, (6,)),
                stop_ratio=(stop_ratio, ()))
            self._declare_value("generalized_force", num_velocities, self._generalized_force)
            self._declare_value("wrench", 6, self._wrench)

        _construct_copy = copied

        def _wrench(self, context) -> np.ndarray:
            state = self._state_port.Eval(context)
            return axis_force(state[self._at], state[self._count + self._at], **self._constants(context))

        def _generalized_force(self, context) -> np.ndarray:
            return scattered(self._wrench(context), self._at, self._count)

    return Impl


SocketBushing = SocketBushing_[float]


@TemplateSystem.define("GaitDriver_", T_list=[float, AutoDiffXd, Expression], scope=sys.modules[__name__])
def GaitDriver_(T):
    class Impl(NamedParameters, LeafSystem_[T]):
        """Proportional-derivative servo on p joints: position_gain (q_d - q) + velocity_gain (v_d - v).

        It drives chosen joints along a recorded motion under Drake's Simulator.

        .. pydrake_system::

            name: GaitDriver
            input_ports:
            - state
            - desired_state
            output_ports:
            - generalized_force
            - tracking_error

        Inputs: state (2 num_velocities,), [q; v] of the plant, every joint of one degree of freedom; desired_state (2
        p,), [q_d; v_d]. Outputs: generalized_force (num_velocities,), zero outside the p; tracking_error (p,), q_d - q,
        rad or m.

        Wiring: state from MultibodyPlant, desired_state from a trajectory source; generalized_force, added to those of
        the other systems, to the plant's applied_generalized_force.

        Args:
            num_velocities: of the plant.
            velocity_indices: p indices into v (and q).
            position_gain: (p,) N/m or N m/rad.
            velocity_gain: (p,) N s/m or N m s/rad.

        Parameters in the Context: position_gain, velocity_gain.

        Raises:
            ValueError: an array has the wrong shape.
        """

        __slots__ = (PEERS, "_state_port", "_desired_port")

        @constructor
        def _construct(
            self, *, num_velocities: int, velocity_indices: Sequence[int], position_gain: np.ndarray,
            velocity_gain: np.ndarray
        ) -> None:
            self._count, self._at = num_velocities, np.array(velocity_indices, dtype=int)
            joints = len(self._at)
            self._state_port = self.DeclareVectorInputPort("state", 2 * num_velocities)
            self._desired_port = self.DeclareVectorInputPort("desired_state", 2 * joints)
            self._declare_parameters(
                T, position_gain=(position_gain, (joints,)), velocity_gain=(velocity_gain, (joints,)))
            self._declare_value("generalized_force", num_velocities, self._generalized_force)
            self._declare_value("tracking_error", joints, self._position_error)

        _construct_copy = copied

        def _position_error(self, context) -> np.ndarray:
            return self._desired_port.Eval(context)[:len(self._at)] - self._state_port.Eval(context)[self._at]

        def _generalized_force(self, context) -> np.ndarray:
            constants, state = self._constants(context), self._state_port.Eval(context)
            rate_error = self._desired_port.Eval(context)[len(self._at):] - state[self._count + self._at]
            force = constants["position_gain"] * self._position_error(context) + constants["velocity_gain"] * rate_error
            return scattered(force, self._at, self._count)

    return Impl


GaitDriver = GaitDriver_[float]
