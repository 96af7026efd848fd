"""Springs and servos on joints: the socket's bushing, the driver of prescribed joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.symbolic import Expression
from pydrake.systems.framework import Context

from vsf_drake.laws.bushing import axis_force
from vsf_drake.systems._system import System, system_template


class _JointForces(System):
    """The `_force` of a subclass as generalized force of a plant, all of whose joints have one
    degree of freedom."""

    def _declare_joints(self, num_velocities: int, velocity_indices: Sequence[int]) -> int:
        """Input state and output generalized_force; returns how many joints have a force."""
        self._count = num_velocities
        self._at = np.array(velocity_indices, dtype=int)
        self._declare_inputs(state=2 * num_velocities)
        self._declare_output("generalized_force", num_velocities, self._generalized_force)
        return len(self._at)

    def _force(self, context: Context) -> np.ndarray:
        raise NotImplementedError

    def _motion(self, context: Context) -> tuple[np.ndarray, np.ndarray]:
        """q and v of the joints."""
        state = self._value(context, "state")
        return state[self._at], state[self._count + self._at]

    def _generalized_force(self, context: Context) -> np.ndarray:
        values = self._force(context)
        force = np.zeros(self._count, dtype=values.dtype)
        force[self._at] = values
        return force


@system_template()
class SocketBushing(_JointForces):
    """Six springs and dampers with limits on the six coordinates between residual limb and socket.

    The law of each axis is `vsf_drake.laws.bushing.axis_force`. The socket hangs on the limb by six
    joints of one degree of freedom, so that limb and socket feel equal and opposite actions.

    Inputs: state (2 num_velocities,), [q; v] of the plant, every joint of one degree of freedom.
    Outputs: generalized_force (num_velocities,), zero outside the six; wrench (6,), on the socket
    along tx, ty, tz (N) and about flexion, adduction, rotation (N m).

    Args:
        velocity_indices: 6 indices into the plant's v (and q): tx, ty, tz, flexion, adduction,
            rotation.

    Parameters in the Context: stiffness, stiffness_negative, damping, limit, rate_limit (6,) of the
    law, SI; stop_ratio.
    """

    def __init__(
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
    ) -> None:
        if len(velocity_indices) != 6:
            raise ValueError(f"velocity_indices must be 6, but are {len(velocity_indices)}")
        self._declare_joints(num_velocities, velocity_indices)
        self._declare_parameters(
            "socket_",
            stiffness=(stiffness, (6,)),
            stiffness_negative=(stiffness_negative, (6,)),
            damping=(damping, (6,)),
            limit=(limit, (6,)),
            rate_limit=(rate_limit, (6,)),
            stop_ratio=(stop_ratio, ()),
        )
        self._declare_output("wrench", 6, self._force)

    def _force(self, context: Context) -> np.ndarray:
        force: np.ndarray
        force, _, _ = axis_force(*self._motion(context), **self._constants(context))
        return force


@system_template(AutoDiffXd, Expression)
class GaitDriver(_JointForces):
    """Proportional-derivative servo on p joints, which drives them along a recorded motion under
    Drake's Simulator: position_gain (q_d - q) + velocity_gain (v_d - v).

    Inputs: state (2 num_velocities,), [q; v] of the plant, every joint of one degree of freedom;
    desired_state (2 p,), [q_d; v_d]. Outputs: generalized_force (num_velocities,), zero outside the
    p; tracking_error (p,), q_d - q, rad or m.

    Args:
        velocity_indices: p indices into the plant's v (and q).

    Parameters in the Context: position_gain (p,) N/m or N m/rad; velocity_gain (p,) N s/m or N m
    s/rad.
    """

    def __init__(
        self,
        *,
        num_velocities: int,
        velocity_indices: Sequence[int],
        position_gain: np.ndarray,
        velocity_gain: np.ndarray,
    ) -> None:
        p = self._declare_joints(num_velocities, velocity_indices)
        self._declare_inputs(desired_state=2 * p)
        self._declare_parameters(
            position_gain=(position_gain, (p,)), velocity_gain=(velocity_gain, (p,))
        )
        self._declare_output("tracking_error", p, self._tracking_error)

    def _errors(self, context: Context) -> tuple[np.ndarray, np.ndarray]:
        """q_d - q and v_d - v, each (p,)."""
        (q, v), (q_d, v_d) = (
            self._motion(context),
            self._value(context, "desired_state").reshape(2, -1),
        )
        return q_d - q, v_d - v

    def _tracking_error(self, context: Context) -> np.ndarray:
        return self._errors(context)[0]

    def _force(self, context: Context) -> np.ndarray:
        constants, (error, rate_error) = self._constants(context), self._errors(context)
        force: np.ndarray = (
            constants["position_gain"] * error + constants["velocity_gain"] * rate_error
        )
        return force


SocketBushing_ = SocketBushing.template
GaitDriver_ = GaitDriver.template
