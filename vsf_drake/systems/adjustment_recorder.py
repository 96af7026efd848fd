"""How many strides and how much energy each adjustment of the fulcrum takes."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.systems.framework import BasicVector_, LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from vsf_drake.errors import InputError
from vsf_drake.systems._lifetime import PEERS
from vsf_drake.systems._parameters import NamedParameters


@TemplateSystem.define("AdjustmentRecorder_", T_list=[float, AutoDiffXd], scope=sys.modules[__name__])
def AdjustmentRecorder_(T):
    class Impl(NamedParameters, LeafSystem_[T]):
        """Counts the adjustments of the fulcrum, and the swings and the energy that each of them took.

        An adjustment begins when the motor is enabled with an error above `reached` and ends when it is off again
        with an error within: it may take several swings, and a new desired position in between prolongs it. Its
        energy is what the supply gave from its beginning to its end. A motor that is seen enabled was enabled up to a
        period earlier, so the energy is counted from the sample before: the inrush is in it.

        .. pydrake_system::

            name: AdjustmentRecorder
            input_ports:
            - enabled
            - energy
            - position_error
            output_ports:
            - adjustments
            - adjustment_energy
            - adjustment_swings

        Inputs: enabled (1,) 0 or 1; energy (1,) J; position_error (1,) m. Outputs: adjustments (1,), how many have
        ended; adjustment_energy (1,) J and adjustment_swings (1,) of the last that ended, zero before the first.
        Sampled at a fixed period, without feedthrough.

        Wiring: enabled from `SwingController`, energy and position_error from `FulcrumActuator`.

        Args:
            period: s; at most that of the controller.
            reached: error (m) within which the fulcrum is where it should be.

        Parameters in the Context: reached.

        Raises:
            InputError: the period or `reached` is not above 0.
        """

        __slots__ = (PEERS, "_inputs")

        def _construct(self, *, period: float = 5e-3, reached: float = 1e-3, converter=None) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            for name, value in (("period", period), ("reached", reached)):
                if not value > 0.0:
                    raise InputError(f"is {value}", where=name, right="It must be above 0")
            self._arguments = {"period": period, "reached": reached}
            self._inputs = [self.DeclareVectorInputPort(name, 1) for name in ("enabled", "energy", "position_error")]
            self._declare_parameters(T, reached=(reached, ()))
            # ended, energy and swings of the last; energy at the start and swings of the present (0: none); enabled and
            # energy at the sample before
            self.DeclareDiscreteState(BasicVector_[T](np.zeros(7)))
            self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
            for i, name in enumerate(("adjustments", "adjustment_energy", "adjustment_swings")):
                self.DeclareVectorOutputPort(
                    name, 1, lambda context, out, i=i: out.SetFromVector(np.array([_state(context)[i]])),
                    {self.xd_ticket()})

        def _construct_copy(self, other, converter=None) -> None:
            Impl._construct(self, converter=converter, **other._arguments)

        def _update(self, context, discrete) -> None:
            ended, last_energy, last_swings, start, swings, before, energy_before = _state(context)
            enabled, energy, error = (port.Eval(context)[0] for port in self._inputs)
            reached = abs(error) <= self._constants(context)["reached"]
            if enabled > 0.5 and swings == 0.0 and not reached:
                start, swings = energy_before, T(1.0)
            elif enabled > 0.5 and swings > 0.0 and before < 0.5:
                swings = swings + 1.0
            elif enabled < 0.5 and swings > 0.0 and reached:
                ended, last_energy, last_swings = ended + 1.0, energy - start, swings
                swings = T(0.0)
            discrete.set_value(np.array([ended, last_energy, last_swings, start, swings, enabled, energy]))

    return Impl


def _state(context) -> Any:
    return context.get_discrete_state_vector().CopyToVector()


AdjustmentRecorder = AdjustmentRecorder_[float]
