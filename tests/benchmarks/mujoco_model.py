"""The project's foot as a MuJoCo model: the exported MJCF under socket and shank of the finished Drake plant.

    world -- 6 driven joints -- shank -- socket joints (walking) -- prosthesis -- frame -- keel pin -- keel ... keel
                                                                                    \\__ fulcrum: spring tendon __/

What is the same: masses and inertias; the keel's sprung hinges; the bushing's six joints; the support, a spring tendon
(see `vsf_drake.plants.export`); sphere positions and radii; stiffness and damping of each. The carriage is fixed
at the fulcrum.

What differs, because MuJoCo has no such law: a sphere's damping acts in unloading too, and from first touch on, not
from full_damping_depth_m; friction is a Coulomb cone of mu_static whose stick creeps against the sphere's own damping,
where the project's falls to mu_kinetic and creeps in proportion to the normal force; the bushing has no stops.

The shank is led from outside (`mujoco_runs.lead`): its six joints carry ARMATURE, so that no load moves it. A mocap
body would not do: MuJoCo takes it for a body at rest, and neither slip nor inertia below it would know its motion.

MuJoCo's `implicitfast` finds the contact forces with the bare mass matrix and makes the dampers implicit afterwards.
With dampers as strong as these on pieces of 20 g its walk at 1 ms is therefore not converged. Its cone of friction
couples normal force and slip: a sliding sphere is pressed harder than the foam is.

A sphere on the floor: MuJoCo's constraint force is f = (aref - a) / R with aref = -(b v + k r), v and r at the start
of the step, a the acceleration in it, R = (1 - d) / d * weight; d is solimp's impedance and `weight` the compiled
inverse inertia of the constraint (MuJoCo documentation, Computation: constraint model). A spring and damper written
at the end of the step is f = -K (r + h v + h^2 a) - C (v + h a), which is that form with 1 / R = h C + h^2 K,
k = K R and b = (C + h K) R. So with these numbers MuJoCo's soft contact is the linearly implicit spring and
damper, and K and C are the foam's. A direct solref is (-d k, -d b), since MuJoCo divides the one by d^2, multiplies
it by d again, and divides the other by d.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, SpatialInertia
from pydrake.systems.framework import Context

from vsf_drake.parameters import GRAVITY
from vsf_drake.plants.export import foot_mjcf
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.plants.person import SocketHandles

DRIVEN = ("x", "y", "z", "yaw", "roll", "pitch")
ARMATURE = 1e6
"""Inertia (kg, kg m^2) of the driven joints: 1000 N bends their motion by 1e-3 m/s^2 within one step."""
PREFIX = "foot_"
"""Of the names of the exported foot's parts in the whole model."""


class Contact(NamedTuple):
    """A sphere that meets the floor: index of its body, centre in it (m), radius (m), K (N/m) and C (N s/m)."""

    body: BodyIndex
    p_BS: np.ndarray
    radius: float
    stiffness: float
    damping: float


@dataclass(frozen=True)
class MujocoFoot:
    """A compiled model and what it takes to drive and read it; the first six coordinates are the driven ones.

    Attributes:
        coordinate_names: of all coordinates, in MuJoCo's order; those beyond the driven as in Drake.
    """

    model: mujoco.MjModel
    coordinate_names: tuple[str, ...]


def soft_constraint(*, stiffness: float, damping: float, step_s: float, weight: float) -> tuple[list, list]:
    """solref and solimp that make a constraint a linearly implicit spring (N/m) and damper (N s/m); see the module.

    Args:
        weight: inverse inertia of the constraint (1/kg) in the compiled model.
    """
    regularization = 1.0 / (step_s * damping + step_s**2 * stiffness)
    impedance = weight / (weight + regularization)
    solref = [-impedance * stiffness * regularization, -impedance * (damping + step_s * stiffness) * regularization]
    return solref, [impedance, impedance, 1.0, 0.5, 1.0]


def make_mujoco_foot(
    plant: MultibodyPlant, context: Context, foot: FootHandles, *, fulcrum_m: float, step_s: float,
    contacts: Sequence[Contact], friction: float, gravity: bool = True, socket: SocketHandles | None = None,
) -> MujocoFoot:
    """Compiles the foot at one fulcrum position, driven at its frame or, with `socket`, at the residual shank.

    Args:
        context: the plant's; its mount says how the foot sits under the pylon.
        contacts: the spheres that meet the floor.
        friction: Coulomb coefficient; with 0 the contact is frictionless.
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = step_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.gravity = [0.0, 0.0, -GRAVITY if gravity else 0.0]
    spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[10, 10, 0.1], contype=0, conaffinity=0)
    root = spec.worldbody.add_body(name="shank", mass=1e-3, inertia=[1e-6] * 3, explicitinertial=True)
    kinds = [mujoco.mjtJoint.mjJNT_SLIDE] * 3 + [mujoco.mjtJoint.mjJNT_HINGE] * 3
    axes = [*np.eye(3), *np.eye(3)[[2, 0, 1]]]
    for name, kind, axis in zip(DRIVEN, kinds, axes, strict=True):
        root.add_joint(name=name, type=kind, axis=axis, armature=ARMATURE)
    names, hanger, X_TK = [*DRIVEN], root, RigidTransform()
    if socket is not None:
        hanger = _add_body(root, "prosthesis", np.zeros(3), plant.CalcSpatialInertia(
            context, socket.socket.body_frame(), [socket.socket.index(), socket.pylon.index()]))
        names += _add_bushing(plant, hanger, socket)
        X_TK = plant.CalcRelativeTransform(context, socket.socket.body_frame(), foot.frame.body_frame())
    names += foot.keel_joint_names
    _attach_foot(hanger, X_TK, foot, fulcrum_m, spec)
    for i, sphere in enumerate(contacts):
        spec.body(PREFIX + plant.get_body(sphere.body).name()).add_geom(
            name=f"sphere_{i}", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[sphere.radius, 0, 0], mass=0.0,
            pos=sphere.p_BS, contype=0, conaffinity=0)
        spec.add_pair(name=f"sphere_{i}", geomname1="floor", geomname2=f"sphere_{i}", condim=3 if friction else 1,
                      friction=[friction, friction, 0, 0, 0])
    model = spec.compile()
    _set_constraints(model, contacts, socket)
    return MujocoFoot(model=model, coordinate_names=tuple(names))


def _add_body(parent: mujoco.MjsBody, name: str, position: np.ndarray, inertia: SpatialInertia) -> mujoco.MjsBody:
    centre = inertia.get_com()
    moments = inertia.Shift(centre).CalcRotationalInertia().CopyToFullMatrix3()
    return parent.add_body(
        name=name, pos=position, mass=inertia.get_mass(), ipos=centre, explicitinertial=True,
        fullinertia=[*np.diag(moments), moments[0, 1], moments[0, 2], moments[1, 2]])


def _add_bushing(plant: MultibodyPlant, body: mujoco.MjsBody, socket: SocketHandles) -> tuple[str, ...]:
    """Six sprung joints below the shank's end; what pressing is stiffer than pulling, a soft limit at zero adds."""
    start = plant.GetJointByName(socket.coordinate_names[0]).frame_on_parent()
    body.pos = start.GetFixedPoseInBodyFrame().translation()
    for name, axis in zip(socket.coordinate_names, socket.axes, strict=True):
        joint = plant.GetJointByName(name)
        slides = joint.type_name() == "prismatic"
        body.add_joint(
            name=name, type=mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE,
            axis=joint.translation_axis() if slides else joint.revolute_axis(),
            stiffness=[min(axis.stiffness, axis.stiffness_negative), 0, 0], damping=[axis.damping, 0, 0],
            limited=axis.stiffness > axis.stiffness_negative, range=[-1.0, 0.0])
    return socket.coordinate_names


def _attach_foot(
    parent: mujoco.MjsBody, X_PK: RigidTransform, foot: FootHandles, fulcrum_m: float, spec: mujoco.MjSpec
) -> None:
    """The exported foot without drawings and spheres, its carriage fixed, its frame K at `X_PK` on `parent`."""
    made = mujoco.MjSpec.from_string(foot_mjcf(foot.parameters, fulcrum_m=fulcrum_m))
    for option in ("timestep", "integrator", "cone", "gravity"):
        setattr(made.option, option, getattr(spec.option, option))
    for part in (*made.keys, *made.actuators, *made.geoms, made.joint(foot.carriage_joint_name)):
        made.delete(part)
    frame = made.body(foot.frame.name())
    frame.pos, frame.quat = X_PK.translation(), X_PK.rotation().ToQuaternion().wxyz()
    parent.add_frame().attach_body(frame, PREFIX, "")


def _set_constraints(model: mujoco.MjModel, contacts: Sequence[Contact], socket: SocketHandles | None) -> None:
    """Numbers that need the compiled inverse inertias.

    And the solver's: its scale without the driven joints' armature, which would end it before it has begun, and
    a tolerance without which the load on the bench ripples by 0.1 N.
    """
    step_s = model.opt.timestep
    for i, sphere in enumerate(contacts):
        body = model.geom(f"sphere_{i}").bodyid[0]
        solref, solimp = soft_constraint(stiffness=sphere.stiffness, damping=sphere.damping, step_s=step_s,
                                         weight=model.body_invweight0[body, 0])
        model.pair_solref[i], model.pair_solimp[i] = solref, solimp
    for name, axis in zip(socket.coordinate_names, socket.axes, strict=True) if socket else ():
        joint = model.joint(name)
        if axis.stiffness > axis.stiffness_negative:
            solref, solimp = soft_constraint(
                stiffness=axis.stiffness - axis.stiffness_negative, damping=0.0, step_s=step_s,
                weight=model.dof_invweight0[joint.dofadr[0]])
            model.jnt_solref[joint.id], model.jnt_solimp[joint.id] = solref, solimp
    model.stat.meaninertia = model.dof_M0[len(DRIVEN):].mean()
    model.opt.tolerance = 1e-14
