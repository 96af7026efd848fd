"""Elasticity of the keel: springs and dampers in its joints."""

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

        def _construct(
            self,
            *,
            num_velocities: int,
            velocity_indices: Sequence[int],
            stiffness: np.ndarray,
            damping: np.ndarray,
            converter=None,
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self._arguments = {
                "num_velocities": num_velocities, "velocity_indices": list(velocity_indices),
                "stiffness": stiffness, "damping": damping,
            }
            self._count, self._at = num_velocities, np.array(velocity_indices, dtype=int)
            joints = len(self._at)
            self._state_port = self.DeclareVectorInputPort("state", 2 * num_velocities)
            self._declare_parameters(T, "joint_", stiffness=(stiffness, (joints,)), damping=(damping, (joints,)))
            self.DeclareVectorOutputPort("generalized_force", num_velocities, self._calc_generalized_force)
            self._declare_value("joint_moment", joints, self._calc_moment)

        def _construct_copy(self, other, converter=None) -> None:
            Impl._construct(self, converter=converter, **other._arguments)

        def _calc_moment(self, context) -> np.ndarray:
            constants = self._constants(context)
            state = self._state_port.Eval(context)
            return -(constants["stiffness"] * state[self._at] + constants["damping"] * state[self._count + self._at])

        def _calc_generalized_force(self, context, output) -> None:
            force = np.zeros(self._count, dtype=T if T is float else object)
            force[self._at] = self._calc_moment(context)
            output.SetFromVector(force)

    return Impl


KeelElasticity = KeelElasticity_[float]
