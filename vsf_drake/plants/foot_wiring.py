"""A foot's forces in any diagram: one system between the plant's kinematics and its force ports."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, InputPort, OutputPort

from vsf_drake.errors import InputError
from vsf_drake.ground import Ground, check_ground, ground_arrays
from vsf_drake.laws.hunt_crossley import matched_dissipation
from vsf_drake.model_file import check_fulcrum
from vsf_drake.plants.device import SERVO_FREQUENCY
from vsf_drake.plants.foot import ContactSites, FootHandles
from vsf_drake.plants.wiring import connect_kinematics, share_generalized_forces, share_spatial_forces
from vsf_drake.systems.foot_forces import CONTACT_LAWS, FootForces

FULCRUM_M = 0.108
"""Of a foot that nobody sets: the middle of the five published positions (McGeehan 2021)."""
MATCHED_DEPTH_M = 6e-3
"""Depth to which the Hunt-Crossley law loses what the paper's law loses; about that of the nominal foot's spheres under
body weight (a choice)."""
DEPTH_WIDTH_M, RATE_WIDTH_M_PER_S = 5e-4, 0.02
"""Corners of the smooth law (choices)."""


@dataclass(frozen=True)
class WiredFoot:
    """A foot with its forces in a diagram.

    Attributes:
        forces: the system that exerts them; its constants change in its Context.
    """

    foot: FootHandles
    forces: FootForces

    @property
    def fulcrum_position(self) -> InputPort:
        """Input (1,) m from A; where it stays unconnected the parameter `fulcrum_m` of `forces` holds."""
        return self.forces.GetInputPort("fulcrum_position")

    def GetOutputPort(self, name: str) -> OutputPort:
        """An output of the foot by its name, see `FootForces`.

        Raises:
            InputError: there is none of that name.
        """
        if not self.forces.HasOutputPort(name):
            ports = [self.forces.get_output_port(i).get_name() for i in range(self.forces.num_output_ports())]
            raise InputError(f"there is no output {name!r}", where=self.forces.get_name(),
                             right=f"There are {', '.join(ports)}")
        return self.forces.GetOutputPort(name)


def wire_foot(
    builder: DiagramBuilder, plant: MultibodyPlant, foot: FootHandles, *, ground: Ground | None = None,
    fulcrum_m: float = FULCRUM_M
) -> WiredFoot:
    """Connects what acts on `foot`: contact, friction, fulcrum support, keel springs, the carriage's servo.

    Adds the system `FootForces` under the name `<foot>_forces`. The plant's force ports are shared with whatever else
    uses them (`share_spatial_forces`, `share_generalized_forces`). No port is exported.

    Args:
        plant: finalised, and in `builder`.
        ground: by default the plane z = 0 of W with the foot's friction.
        fulcrum_m: position (m from A) where no `fulcrum_position` is connected.

    Raises:
        InputError: the plant is not finalised, not in `builder` or not the foot's; the foot is wired already; ground or
            position cannot be.
    """
    name = f"{foot.name}_forces"
    _check_wiring(builder, plant, foot, name)
    check_fulcrum(fulcrum_m, foot.parameters)
    ground = check_ground(ground or Ground())
    names = (*foot.keel_joint_names, foot.carriage_joint_name)
    joints = [plant.GetJointByName(joint, foot.instance) for joint in names]
    law = foot.contact if foot.contact in CONTACT_LAWS else None
    constants = _device_constants(foot, fulcrum_m) | (_contact_constants(foot, ground) if law else {})
    keel_index = {int(body.index()): i for i, body in enumerate(foot.keel)}
    forces = builder.AddNamedSystem(name, FootForces(
        num_positions=plant.num_positions(), num_velocities=plant.num_velocities(),
        position_indices=[joint.position_start() for joint in joints],
        velocity_indices=[joint.velocity_start() for joint in joints], frame_body_index=foot.frame.index(),
        keel_starts=foot.keel_starts, law=law, constants=constants,
        site_keel=[keel_index.get(int(body), -1) for body in foot.sites.body_indices]))
    connect_kinematics(builder, plant, [forces])
    share_spatial_forces(builder, plant, forces.GetOutputPort("spatial_forces"))
    share_generalized_forces(builder, plant, forces.GetOutputPort("generalized_force"))
    return WiredFoot(foot=foot, forces=forces)


def _check_wiring(builder: DiagramBuilder, plant: MultibodyPlant, foot: FootHandles, name: str) -> None:
    if not plant.is_finalized():
        raise InputError("is not finalised", where="plant", right="Call plant.Finalize() after the last add_foot")
    if not any(system is plant for system in builder.GetSystems()):
        raise InputError("is not in this builder", where="plant",
                         right="Add it first: builder.AddSystem(plant), or AddMultibodyPlantSceneGraph(builder, ...)")
    if not plant.HasModelInstanceNamed(foot.name) or plant.get_body(foot.frame.index()) is not foot.frame:
        raise InputError(f"the foot {foot.name!r} is part of another plant", where="foot",
                         right="Wire it in the diagram of the plant that it was added to")
    if builder.HasSubsystemNamed(name):
        raise InputError(f"the foot {foot.name!r} is wired already", where="foot",
                         right="Keep what the first wire_foot returned; a second foot needs a name of its own")


def _device_constants(foot: FootHandles, fulcrum_m: float) -> dict[str, Any]:
    fulcrum = foot.parameters.fulcrum
    return {
        "joint_stiffness": foot.joint_stiffness, "joint_damping": foot.joint_damping, "fulcrum_m": fulcrum_m,
        "fulcrum_stiffness": fulcrum.stiffness_n_per_m,
        "fulcrum_damping": fulcrum.stiffness_n_per_m * fulcrum.damping_time_s,
        "carriage_gain": SERVO_FREQUENCY**2 * fulcrum.carriage_mass_kg,
        "carriage_rate_gain": 2 * SERVO_FREQUENCY * fulcrum.carriage_mass_kg,
    }


def _contact_constants(foot: FootHandles, ground: Ground) -> dict[str, Any]:
    friction = foot.parameters.friction
    return {
        "p_BS": foot.sites.p_BS, "radius": foot.sites.radius, **foot.sites.law, "dissipation": dissipation(foot.sites),
        "depth_width": DEPTH_WIDTH_M, "rate_width": RATE_WIDTH_M_PER_S,
        "threshold_velocity": friction.threshold_velocity_m_per_s,
        **ground_arrays(ground, mu_static=friction.mu_static, mu_kinetic=friction.mu_kinetic),
    }


def dissipation(sites: ContactSites) -> np.ndarray:
    """(N,) s/m of the Hunt-Crossley law that loses what the paper's law loses in a stroke to MATCHED_DEPTH_M."""
    rows = zip(sites.stiffness, sites.exponent, sites.damping, strict=True)
    return np.array([matched_dissipation(stiffness=k, exponent=n, damping=b, depth=MATCHED_DEPTH_M)
                     for k, n, b in rows])
