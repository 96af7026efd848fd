"""The desired states of a foot's actuators, in a plant with a time step."""

from __future__ import annotations

import sys

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.symbolic import Expression
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from vsf_drake.errors import InputError
from vsf_drake.systems._fulcrum_place import fulcrum_place
from vsf_drake.systems._lifetime import PEERS
from vsf_drake.systems._parameters import NamedParameters


@TemplateSystem.define("FulcrumCommand_", T_list=[float, AutoDiffXd, Expression], scope=sys.modules[__name__])
def FulcrumCommand_(T):
    class Impl(NamedParameters, LeafSystem_[T]):
        """Sends the carriage to the fulcrum position and the keel's joints to straight.

        For a foot whose springs and carriage are PD-controlled actuators of its model instance: q_d = 0 in the keel's
        joints, the fulcrum position in the carriage, v_d = 0.

        .. pydrake_system::

            name: FulcrumCommand
            input_ports:
            - fulcrum_position
            output_ports:
            - desired_state
            - position

        Inputs: fulcrum_position (1,) m from A; where it is not connected the parameter fulcrum_m holds. Outputs:
        desired_state (2 num_actuators,), [q_d; v_d]; position (1,) m, that fulcrum position.

        Wiring: `wire_foot` does it. desired_state to MultibodyPlant's desired_state port of the foot's instance.

        Args:
            num_actuators: of the foot's instance.
            carriage: index of the carriage's actuator among them.
            fulcrum_m: m from A.

        Parameters in the Context: fulcrum_m.

        It does not convert to AutoDiffXd, and so does no diagram that holds it, nor has either a `Clone`: a plant that
        Drake 1.51 converts or clones has actuators without gains, and the keel of that foot no springs.

        Raises:
            InputError: (when evaluated) the fulcrum's position is not a number, or in mm; (when converted) see above.
        """

        __slots__ = (PEERS, "_position_port")

        def _construct(self, *, num_actuators: int, carriage: int, fulcrum_m: float, converter=None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self._arguments = {"num_actuators": num_actuators, "carriage": carriage, "fulcrum_m": fulcrum_m}
            self._position_port = self.DeclareVectorInputPort("fulcrum_position", 1)
            self._declare_parameters(T, fulcrum_m=(fulcrum_m, ()))
            self.DeclareVectorOutputPort("desired_state", 2 * num_actuators, self._calc_desired_state)
            self._declare_value("position", 1, self._calc_position)

        def _construct_copy(self, other, converter=None) -> None:
            if T is Expression:  # Drake asks for it at every Build, to see which outputs depend on which inputs
                Impl._construct(self, converter=converter, **other._arguments)
                return
            raise InputError(
                "cannot be converted or cloned: of a plant with a time step Drake drops the gains of the actuators, "
                "which here are the keel's springs", where=other.get_name(),
                right="Build the diagram again for a second one, and take a continuous plant for derivatives")

        def _position(self, context):
            given = self._position_port.HasValue(context)
            position = self._position_port.Eval(context)[0] if given else self._constants(context)["fulcrum_m"]
            return position if T is Expression else fulcrum_place(position, self)

        def _calc_position(self, context) -> list:
            return [self._position(context)]

        def _calc_desired_state(self, context, output) -> None:
            desired = np.zeros(2 * self._arguments["num_actuators"], dtype=T if T is float else object)
            desired[self._arguments["carriage"]] = self._position(context)
            output.SetFromVector(desired)

    return Impl


FulcrumCommand = FulcrumCommand_[float]
