"""The movable support under the keel."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd
from pydrake.math import RigidTransform
from pydrake.symbolic import Expression
from pydrake.systems.framework import LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from vsf_drake.errors import InputError
from vsf_drake.systems._fulcrum_place import fulcrum_place
from vsf_drake.systems._lifetime import PEERS
from vsf_drake.systems._parameters import NamedParameters
from vsf_drake.systems._sites import (
    ForcePacker,
    cross,
    declare_body_poses,
    declare_body_spatial_velocities,
    model_spatial_forces,
)


@TemplateSystem.define("FulcrumSupport_", T_list=[float, AutoDiffXd], scope=sys.modules[__name__])
def FulcrumSupport_(T):
    class Impl(NamedParameters, LeafSystem_[T]):
        """Two-sided stiff support of the keel at a continuous position along it.

        The fulcrum holds the keel's material point P at arc coordinate l (m from the posterior end
        A). With w the height of P in the keel frame K, fixed in the foot's frame body F, and w' its
        rate for fixed l, the keel feels -(stiffness w + damping w') along z_K at P and the frame
        body the opposite at the same point, so force and moment on the two together are zero. P
        slides onto the next keel body where that body's frame begins, its joint, about which the
        force then has no moment: everything is continuous as the fulcrum passes a joint.

        It is the simple support B of McGeehan 2021 (doi 10.1115/1.4050456, Figure 1) with a finite
        stiffness. Sliding it under load takes work, which is the carriage's: no force for it acts here.

        .. pydrake_system::

            name: FulcrumSupport
            input_ports:
            - body_poses
            - body_spatial_velocities
            - fulcrum_position
            output_ports:
            - spatial_forces
            - support_force

        Inputs: body_poses and body_spatial_velocities, of all bodies of the plant; fulcrum_position
        (1,) m from A. Outputs: spatial_forces on the keel body that holds P and on F; support_force
        (1,) N on the keel along z_K, negative while the ground bends the toe up.

        Wiring: poses and velocities from MultibodyPlant, fulcrum_position from a source or from the
        carriage's coordinate; spatial_forces to MultibodyPlant's applied_spatial_force.

        Args:
            frame_body_index: body F.
            X_FK: pose of K in F.
            keel_body_indices: m bodies from A to the toe, their frames at their joints, x along the keel.
            keel_body_starts: (m,) arc coordinates of their frames (m), increasing from the first.
            stiffness: N/m.
            damping: N s/m.

        Parameters in the Context: stiffness, damping.

        Raises:
            ValueError: the starts do not increase, or do not match the bodies.
        """

        __slots__ = (PEERS, "_poses_port", "_velocities_port", "_position_port")

        def _construct(
            self,
            *,
            frame_body_index: int,
            X_FK: RigidTransform,
            keel_body_indices: Sequence[int],
            keel_body_starts: np.ndarray,
            stiffness: float,
            damping: float,
            converter=None,
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            starts = np.array(keel_body_starts, dtype=float)
            if starts.shape != (len(keel_body_indices),) or np.any(np.diff(starts) <= 0):
                raise ValueError(f"keel_body_starts must be {len(keel_body_indices)} increasing numbers")
            self._arguments = {
                "frame_body_index": frame_body_index, "X_FK": X_FK, "keel_body_indices": list(keel_body_indices),
                "keel_body_starts": starts, "stiffness": stiffness, "damping": damping,
            }
            self._frame, self._keel = int(frame_body_index), [int(index) for index in keel_body_indices]
            self._starts, self._X_FK = starts, X_FK.GetAsMatrix34()
            self._packer = ForcePacker([self._frame, *self._keel], T)
            self._poses_port = declare_body_poses(self, T)
            self._velocities_port = declare_body_spatial_velocities(self, T)
            self._position_port = self.DeclareVectorInputPort("fulcrum_position", 1)
            self._declare_parameters(T, "fulcrum_", stiffness=(stiffness, ()), damping=(damping, ()))
            self._support = self._declare_inputs_cache("support", self._calc_support)
            self.DeclareAbstractOutputPort(
                "spatial_forces", lambda: model_spatial_forces(T), self._calc_spatial_forces)
            self._declare_value("support_force", 1, self._support_force)

        def _construct_copy(self, other, converter=None) -> None:
            Impl._construct(self, converter=converter, **other._arguments)

        def _calc_support(self, context) -> dict[str, Any]:
            constants = self._constants(context)
            poses = self._poses_port.Eval(context)
            velocities = self._velocities_port.Eval(context)
            position = fulcrum_place(self._position_port.Eval(context)[0], self)
            keel = int(np.searchsorted(self._starts, float(_value(position)), side="right")) - 1
            keel = min(max(keel, 0), len(self._starts) - 1)
            body = self._keel[keel]
            X_WB, X_WF = poses[body].GetAsMatrix34(), poses[self._frame].GetAsMatrix34()
            V_WB, V_WF = velocities[body].get_coeffs(), velocities[self._frame].get_coeffs()
            p_BoP_W = X_WB[:, 0] * (position - self._starts[keel])
            p_FoP_W = X_WB[:, 3] + p_BoP_W - X_WF[:, 3]
            z_K_W = X_WF[:, :3] @ self._X_FK[:, 2]
            height = z_K_W @ (p_FoP_W - X_WF[:, :3] @ self._X_FK[:, 3])
            v_FP_W = V_WB[3:] - V_WF[3:] + cross(V_WB[:3], p_BoP_W) - cross(V_WF[:3], p_FoP_W)
            force = -(constants["stiffness"] * height + constants["damping"] * (z_K_W @ v_FP_W))
            return {"force": force, "f_P_W": force * z_K_W, "body": body, "p_BoP_W": p_BoP_W, "p_FoP_W": p_FoP_W}

        def _support_force(self, context) -> list:
            return [self._support.Eval(context)["force"]]

        def _calc_spatial_forces(self, context, output) -> None:
            support = self._support.Eval(context)
            f_P_W = support["f_P_W"]
            F_B_W = np.concatenate((cross(support["p_BoP_W"], f_P_W), f_P_W))
            F_F_W = -np.concatenate((cross(support["p_FoP_W"], f_P_W), f_P_W))
            output.set_value([self._packer.pack(support["body"], F_B_W), self._packer.pack(self._frame, F_F_W)])

    return Impl


def _value(x: Any) -> float:
    return x.value() if hasattr(x, "value") else x


FulcrumSupport = FulcrumSupport_[float]


# The desired states of a foot's actuators, in a plant with a time step.


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
