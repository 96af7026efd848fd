"""The same foot in MuJoCo: how far its walk is from this model's, and how fast it is.

The exported MJCF under socket and shank of the finished Drake plant: masses, the keel's sprung
hinges, the bushing's six joints, the support as a spring tendon, positions, radii, stiffness and
damping of the spheres are the same. MuJoCo has no other law for the rest: a sphere's damping acts
in unloading too, and from first touch on; friction is a Coulomb cone of mu_static, where the
project's falls to mu_kinetic; the bushing has no stops. `implicitfast` finds the contact forces
with the bare mass matrix and makes the dampers implicit afterwards; with dampers as strong as these
on pieces of 20 g its walk at 1 ms is not converged. It takes springs at the start of the step: as
the file does for its own step, the support's damping is made such that its spring is taken at the
end of this one, as by the stepper.

The shank is led from outside: its six joints carry ARMATURE, so that no load moves it. A mocap body
would not do: MuJoCo takes it for a body at rest, and neither slip nor inertia below it would know
its motion.

A sphere on the floor: MuJoCo's constraint force is f = (aref - a) / R with aref = -(b v + k r), v
and r at the start of the step, a the acceleration in it, R = (1 - d) / d * weight; d is solimp's
impedance and `weight` the compiled inverse inertia of the constraint (MuJoCo documentation,
Computation: constraint model). A spring and damper written at the end of the step is f = -K (r + h
v + h^2 a) - C (v + h a), which is that form with 1 / R = h C + h^2 K, k = K R and b = (C + h K) R.
A direct solref is (-d k, -d b), since MuJoCo divides the one by d^2, multiplies it by d again, and
divides the other by d.
"""

from __future__ import annotations

import time
from typing import NamedTuple

import mujoco
import numpy as np
from table import Row
from walks import (
    EXACT_STEP_S,
    WALK_S,
    best,
    difference,
    processor_s,
    shared_motion,
    stance,
    the_trial,
    the_walker,
)

from vsf_drake.engines.mjcf import foot_mjcf
from vsf_drake.model.parameters import GRAVITY
from vsf_drake.simulation.walk import Walk, Walker

DRIVEN = ("x", "y", "z", "yaw", "roll", "pitch")
ARMATURE = 1e6
"""Inertia (kg, kg m^2) of the driven joints: 1000 N bends their motion by 1e-3 m/s^2 within one
step."""
PREFIX = "foot_"
"""Of the names of the exported foot's parts in the whole model."""


class Run(NamedTuple):
    """(n, 3) N of the floor on the foot at the ends of the steps, the state at the end, seconds of
    the processor that it took."""

    force: np.ndarray
    state: mujoco.MjData
    wall_s: float


def rows() -> list[Row]:
    """Only the prosthesis and its foot: the shank is led, there is no other foot and no inverse
    dynamics. And the whole person in the same run, alone and eight times, over MuJoCo's time."""
    exact = stance(EXACT_STEP_S)
    ours, converged, made = exact.prosthetic.grf_W, walk(exact, EXACT_STEP_S).force, []
    for step_s in (1e-3, 2.5e-4):
        run = best(lambda step_s=step_s: walk(exact, step_s))
        made.append(
            Row(
                f"prosthesis only, MuJoCo implicitfast at {1e3 * step_s:g} ms",
                len(run.force) * step_s,
                run.wall_s,
                (
                    f"{difference(run.force, step_s, ours, EXACT_STEP_S):.2f} % BW from the "
                    "stepper at 0.0625 ms, "
                    f"{difference(run.force, step_s, converged, EXACT_STEP_S):.2f} from MuJoCo "
                    f"at 0.0625 ms; peak {np.linalg.norm(run.force, axis=1).max():.0f} N of "
                    f"{np.linalg.norm(ours, axis=1).max():.0f} N"
                ),
            )
        )
    mujoco_s = made[0].wall_s
    requests = shared_motion()
    for name, asked in (("person", requests[:1]), ("eight persons side by side", requests)):
        spent = processor_s(lambda asked=asked: the_walker().walk_many(asked))
        ratio = spent / len(asked) / mujoco_s
        made.append(
            Row(
                f"{name}, beside MuJoCo",
                len(asked) * WALK_S,
                spent,
                f"each {ratio:.2f} of the time of MuJoCo's prosthesis at 1 ms",
            )
        )
    return made


def walk(like: Walk, step_s: float) -> Run:
    """The prosthesis over the time of `like` and from its state at the start."""
    walker, record, tree = the_walker(), like.record, like.mechanism.tree
    model, names = walking_model(walker, fulcrum_m=the_trial().fulcrum_m, step_s=step_s)
    start, end = record.time_s[0] - like.step_s, record.time_s[-1]
    moments = np.minimum(start + step_s * np.arange(round((end - start) / step_s) + 1), end)
    own = [tree.index(name) for name in names[len(DRIVEN) :]]
    return lead(model, shank_path(walker, moments), record.q0[own], record.v0[own])


def shank_path(walker: Walker, moments: np.ndarray) -> np.ndarray:
    """(n, 6) driven coordinates of the residual shank in W at `moments` (s): place (m), then turns
    z, x, y (rad)."""
    gait = walker.gait
    context = gait.plant.CreateDefaultContext()
    shank = gait.person.segments[f"shank_{walker.subject.prosthetic_side}"]
    columns = [gait.plant.GetJointByName(name).position_start() for name in gait.prescribed]
    q, path = np.zeros(gait.plant.num_positions()), np.zeros((len(moments), len(DRIVEN)))
    for row, prescribed in zip(
        path, the_trial().trajectory.ordered(gait.prescribed).sample(moments)[0], strict=True
    ):
        q[columns] = prescribed
        gait.plant.SetPositions(context, q)
        X_WS = shank.EvalPoseInWorld(context)
        R = X_WS.rotation().matrix()
        row[:3] = X_WS.translation()
        row[3:] = np.arctan2(-R[0, 1], R[1, 1]), np.arcsin(R[2, 1]), np.arctan2(-R[2, 0], R[2, 2])
    path[:, 3:] = np.unwrap(path[:, 3:], axis=0)
    return path


def lead(model: mujoco.MjModel, path: np.ndarray, own_q: np.ndarray, own_v: np.ndarray) -> Run:
    """Leads the driven joints along `path` (n + 1, 6), one row a step, from the others' state
    `own_q`, `own_v`.

    At the start of each step they are put on the path, with the velocity of the last step and the
    force that gives their armature the next one: what hangs from them feels the velocity and
    acceleration of the path. The force on the foot is what the constraint forces do on the three
    driven slides.
    """
    data, step_s, n = mujoco.MjData(model), model.opt.timestep, len(DRIVEN)
    velocity = np.diff(path, axis=0, prepend=2 * path[:1] - path[1:2]) / step_s
    push = ARMATURE * np.diff(velocity, axis=0) / step_s
    data.qpos[n:], data.qvel[n:] = own_q, own_v
    force, started = np.zeros((len(push), 3)), time.process_time()
    for i in range(len(push)):
        data.qpos[:n], data.qvel[:n], data.qfrc_applied[:n] = path[i], velocity[i], push[i]
        mujoco.mj_step(model, data)
        force[i] = data.qfrc_constraint[:3]
    wall_s = time.process_time() - started
    if not np.isfinite(force).all() or data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
        raise RuntimeError(f"MuJoCo diverged at steps of {1e3 * step_s:g} ms")
    return Run(force, data, wall_s)


def walking_model(
    walker: Walker, *, fulcrum_m: float, step_s: float
) -> tuple[mujoco.MjModel, list[str]]:
    """Socket and foot below the driven shank at one fulcrum position, all spheres of the foot on
    the floor; and the names of the coordinates in MuJoCo's order, beyond the driven ones as in
    Drake."""
    gait = walker.gait
    plant, context, foot, socket = (
        gait.plant,
        gait.plant_context(walker.context),
        gait.person.foot,
        gait.person.socket,
    )
    if np.any(foot.sites.exponent != 1.0):
        raise ValueError("MuJoCo's contact is linear in depth: every exponent must be 1")
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = step_s, [0.0, 0.0, -GRAVITY]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[10, 10, 0.1], contype=0, conaffinity=0
    )
    root = spec.worldbody.add_body(
        name="shank", mass=1e-3, inertia=[1e-6] * 3, explicitinertial=True
    )
    kinds = [mujoco.mjtJoint.mjJNT_SLIDE] * 3 + [mujoco.mjtJoint.mjJNT_HINGE] * 3
    for name, kind, axis in zip(DRIVEN, kinds, [*np.eye(3), *np.eye(3)[[2, 0, 1]]], strict=True):
        root.add_joint(name=name, type=kind, axis=axis, armature=ARMATURE)

    # The prosthesis on the bushing's six sprung joints; what pressing is stiffer than pulling, a
    # soft limit at 0 adds.
    inertia = plant.CalcSpatialInertia(
        context, socket.socket.body_frame(), [socket.socket.index(), socket.pylon.index()]
    )
    centre = inertia.get_com()
    I = inertia.Shift(centre).CalcRotationalInertia().CopyToFullMatrix3()  # noqa: E741
    first = plant.GetJointByName(socket.coordinate_names[0]).frame_on_parent()
    hanger = root.add_body(
        name="prosthesis",
        pos=first.GetFixedPoseInBodyFrame().translation(),
        mass=inertia.get_mass(),
        ipos=centre,
        explicitinertial=True,
        fullinertia=[*np.diag(I), I[0, 1], I[0, 2], I[1, 2]],
    )
    for name, axis in zip(socket.coordinate_names, socket.axes, strict=True):
        joint = plant.GetJointByName(name)
        slides = joint.type_name() == "prismatic"
        hanger.add_joint(
            name=name,
            type=kinds[0 if slides else -1],
            axis=joint.translation_axis() if slides else joint.revolute_axis(),
            stiffness=[min(axis.stiffness, axis.stiffness_negative), 0, 0],
            damping=[axis.damping, 0, 0],
            limited=axis.stiffness > axis.stiffness_negative,
            range=[-1.0, 0.0],
        )

    # The exported foot without drawings and spheres, its carriage fixed, and the spheres of the
    # plant.
    made = mujoco.MjSpec.from_string(foot_mjcf(foot.parameters, fulcrum_m=fulcrum_m))
    for option in ("timestep", "integrator", "cone", "gravity"):
        setattr(made.option, option, getattr(spec.option, option))
    for part in (*made.keys, *made.actuators, *made.geoms, made.joint(foot.carriage_joint_name)):
        made.delete(part)
    frame = made.body(foot.frame.name())
    X_TK = plant.CalcRelativeTransform(context, socket.socket.body_frame(), foot.frame.body_frame())
    frame.pos, frame.quat = X_TK.translation(), X_TK.rotation().ToQuaternion().wxyz()
    hanger.add_frame().attach_body(frame, PREFIX, "")
    friction = walker.model.foot.friction.mu_static
    for i, (body, p_BS, radius) in enumerate(
        zip(foot.sites.body_indices, foot.sites.p_BS, foot.sites.radius, strict=True)
    ):
        spec.body(PREFIX + plant.get_body(body).name()).add_geom(
            name=f"sphere_{i}",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[radius, 0, 0],
            mass=0.0,
            pos=p_BS,
            contype=0,
            conaffinity=0,
        )
        spec.add_pair(
            name=f"sphere_{i}",
            geomname1="floor",
            geomname2=f"sphere_{i}",
            condim=3,
            friction=[friction, friction, 0, 0, 0],
        )
    model = spec.compile()

    # Numbers that need the compiled inverse inertias; and the solver's scale without the driven
    # joints' armature.
    for i, (stiffness, damping) in enumerate(
        zip(foot.sites.stiffness, foot.sites.damping, strict=True)
    ):
        body = model.geom(f"sphere_{i}").bodyid[0]
        model.pair_solref[i], model.pair_solimp[i] = soft_constraint(
            stiffness, damping, step_s, model.body_invweight0[body, 0]
        )
    for name, axis in zip(socket.coordinate_names, socket.axes, strict=True):
        joint = model.joint(name)
        if axis.stiffness > axis.stiffness_negative:
            model.jnt_solref[joint.id], model.jnt_solimp[joint.id] = soft_constraint(
                axis.stiffness - axis.stiffness_negative,
                0.0,
                step_s,
                model.dof_invweight0[joint.dofadr[0]],
            )
    # The support's spring at the end of the step too: f = -k (r + h v) - c v has the damping c + h
    # k, implicit.
    model.tendon_damping[:] = (
        foot.parameters.fulcrum.damping_time_s + step_s
    ) * model.tendon_stiffness
    model.stat.meaninertia = model.dof_M0[len(DRIVEN) :].mean()
    model.opt.tolerance = 1e-14
    return model, [*DRIVEN, *socket.coordinate_names, *foot.keel_joint_names]


def soft_constraint(
    stiffness: float, damping: float, step_s: float, weight: float
) -> tuple[list, list]:
    """solref and solimp that make a constraint a linearly implicit spring (N/m) and damper (N s/m);
    weight is its inverse inertia (1/kg) in the compiled model."""
    R = 1.0 / (step_s * damping + step_s**2 * stiffness)
    d = weight / (weight + R)
    return [-d * stiffness * R, -d * (damping + step_s * stiffness) * R], [d, d, 1.0, 0.5, 1.0]
