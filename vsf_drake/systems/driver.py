"""Drives chosen joints along a recorded motion under Drake's Simulator."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.symbolic import Expression
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from vsf_drake.systems._lifetime import PEERS
from vsf_drake.systems._parameters import NamedParameters


@TemplateSystem.define("GaitDriver_", T_list=[float, AutoDiffXd, Expression], scope=sys.modules[__name__])
def GaitDriver_(T):
    class Impl(NamedParameters, LeafSystem_[T]):
        """Proportional-derivative servo on p joints: position_gain (q_d - q) + velocity_gain (v_d - v).

        .. pydrake_system::

            name: GaitDriver
            input_ports:
            - state
            - desired_state
            output_ports:
            - generalized_force
            - tracking_error

        Inputs: state (2 num_velocities,), [q; v] of the plant, every joint of one degree of freedom;
        desired_state (2 p,), [q_d; v_d]. Outputs: generalized_force (num_velocities,), zero outside
        the p; tracking_error (p,), q_d - q, rad or m.

        Wiring: state from MultibodyPlant, desired_state from a trajectory source;
        generalized_force, added to those of the other systems, to the plant's
        applied_generalized_force.

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

        def _construct(
            self,
            *,
            num_velocities: int,
            velocity_indices: Sequence[int],
            position_gain: np.ndarray,
            velocity_gain: np.ndarray,
            converter=None,
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self._arguments = {
                "num_velocities": num_velocities, "velocity_indices": list(velocity_indices),
                "position_gain": position_gain, "velocity_gain": velocity_gain,
            }
            self._count, self._at = num_velocities, np.array(velocity_indices, dtype=int)
            joints = len(self._at)
            self._state_port = self.DeclareVectorInputPort("state", 2 * num_velocities)
            self._desired_port = self.DeclareVectorInputPort("desired_state", 2 * joints)
            self._declare_parameters(
                T, position_gain=(position_gain, (joints,)), velocity_gain=(velocity_gain, (joints,)))
            self.DeclareVectorOutputPort("generalized_force", num_velocities, self._calc_generalized_force)
            self.DeclareVectorOutputPort("tracking_error", joints, self._calc_tracking_error)

        def _construct_copy(self, other, converter=None) -> None:
            Impl._construct(self, converter=converter, **other._arguments)

        def _errors(self, context) -> tuple[np.ndarray, np.ndarray]:
            state, desired = self._state_port.Eval(context), self._desired_port.Eval(context)
            joints = len(self._at)
            return desired[:joints] - state[self._at], desired[joints:] - state[self._count + self._at]

        def _calc_generalized_force(self, context, output) -> None:
            constants = self._constants(context)
            position_error, velocity_error = self._errors(context)
            force = np.zeros(self._count, dtype=T if T is float else object)
            force[self._at] = (
                constants["position_gain"] * position_error + constants["velocity_gain"] * velocity_error)
            output.SetFromVector(force)

        def _calc_tracking_error(self, context, output) -> None:
            output.SetFromVector(self._errors(context)[0])

    return Impl


GaitDriver = GaitDriver_[float]
