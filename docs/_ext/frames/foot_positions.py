"""Where the foot's frames, points and spheres are, asked of the plant that `add_foot` makes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, PrismaticJoint, RevoluteJoint, SpatialInertia
from pydrake.systems.framework import Context, DiagramBuilder

from vsf_drake.model.ground import Ground, GroundPatch
from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants.bench import make_bench
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.plants.foot_wiring import wire_foot
from vsf_drake.plants.solids import FORWARD, UPWARD
from vsf_drake.simulation.bench import keel_shape


@dataclass(frozen=True)
class FootPositions:
    """A foot whose unloaded sole would lie on the plane z = 0 of W, all in W (m).

    Attributes:
        X_WK, X_WM: poses of the keel frame and the mount.
        A, B, C, tip: (3,) the keel's posterior end, the point over the fulcrum, the load point, the
            keel's tip.
        joints: (m, 3) pin and sprung joints of the keel.
        carriage: (3,) origin of the carriage.
        spheres, radius, zone: (N, 3), (N,) m, (N,) index into `zone_names`.
        half_thickness, half_width: of the keel.
    """

    parameters: FootParameters
    fulcrum_m: float
    X_WK: RigidTransform
    X_WM: RigidTransform
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    tip: np.ndarray
    joints: np.ndarray
    carriage: np.ndarray
    spheres: np.ndarray
    radius: np.ndarray
    zone: np.ndarray
    zone_names: tuple[str, ...]

    @property
    def half_thickness(self) -> float:
        """Of the keel."""
        return 0.5 * self.parameters.keel.thickness_m

    @property
    def half_width(self) -> float:
        """Of the keel."""
        return 0.5 * self.parameters.keel.width_m


class DrawnFoot:
    """A foot with its mount held at (0, 0, build height) of W, and a context of its own."""

    def __init__(self, parameters: FootParameters) -> None:
        self.plant = MultibodyPlant(0.0)
        height = RigidTransform([0.0, 0.0, parameters.build_height_m])
        hung = self.plant.AddFrame(FixedOffsetFrame("place", self.plant.world_frame(), height))
        self.foot = add_foot(self.plant, hung, parameters)
        self.plant.Finalize()
        self.context = self.plant.CreateDefaultContext()

    def positions(self, fulcrum_m: float, angles: np.ndarray | None = None) -> FootPositions:
        """With the carriage at `fulcrum_m` (m from A) and the keel at `angles` (m,) rad, straight
        by default."""
        return foot_positions(self.plant, self.foot, self.context, fulcrum_m, angles)


def foot_positions(
    plant: MultibodyPlant,
    foot: FootHandles,
    context: Context,
    fulcrum_m: float,
    angles: np.ndarray | None = None,
) -> FootPositions:
    """The positions of `foot` after moving it in `context`; see `DrawnFoot.positions`."""
    q = np.zeros(len(foot.keel)) if angles is None else angles
    for name, angle in zip(foot.keel_joint_names, q, strict=True):
        plant.GetJointByName(name, foot.instance).set_angle(context, float(angle))
    slide = plant.GetJointByName(foot.carriage_joint_name, foot.instance)
    slide.set_translation(context, fulcrum_m)

    def on_keel(x: float) -> np.ndarray:
        j = foot.keel_body_at(x)
        return foot.keel[j].EvalPoseInWorld(context) @ np.array([x - foot.keel_starts[j], 0.0, 0.0])

    sites, parameters = foot.sites, foot.parameters
    spheres = [
        plant.get_body(body).EvalPoseInWorld(context) @ centre
        for body, centre in zip(sites.body_indices, sites.p_BS, strict=True)
    ]
    joints = [body.EvalPoseInWorld(context).translation() for body in foot.keel]
    return FootPositions(
        parameters=parameters,
        fulcrum_m=fulcrum_m,
        X_WK=foot.frame.EvalPoseInWorld(context),
        X_WM=foot.mount.CalcPoseInWorld(context),
        A=on_keel(0.0),
        B=on_keel(fulcrum_m),
        C=on_keel(parameters.load_point_m),
        tip=on_keel(sum(parameters.keel.element_lengths_m)),
        joints=np.array(joints),
        carriage=slide.child_body().EvalPoseInWorld(context).translation(),
        spheres=np.array(spheres),
        radius=sites.radius,
        zone=sites.zone,
        zone_names=sites.zone_names,
    )


# What the foot's coordinates, forces and ground slopes do where they are positive, asked of the
# systems themselves.


FULCRUM_M, LOAD_N, SUNK_M = 0.108, 500.0, 0.003
KEEL_ANGLE_RAD, SLOPE_DEG = np.radians(3.0), 10.0
SLIDING_M_PER_S, TURNING_RAD_PER_S = 0.3, -2.0


@dataclass(frozen=True)
class GroundForces:
    """A foot held on the ground, and what the ground does to it.

    Attributes:
        foot: where it is.
        grf: (3,) N in W, on the foot. cop: (3,) m in W. free_moment: N m about the ground's normal,
            on the foot.
        normal: (3,) of the ground, upward.
    """

    foot: FootPositions
    grf: np.ndarray
    cop: np.ndarray
    free_moment: float
    normal: np.ndarray


@dataclass(frozen=True)
class FootSigns:
    """Everything that is drawn.

    Attributes:
        rest: the unloaded foot. lifted: every sprung joint of the keel at +KEEL_ANGLE_RAD. rear,
            front: the carriage at both ends. loaded: LOAD_N up on the load point. support_force: of
            the fulcrum on the keel then (N).
        sliding, turning: the foot pressed onto a level ground while it slides forward, and turns
            clockwise seen from above. sloping, banked: pressed onto grounds of +SLOPE_DEG.
    """

    rest: FootPositions
    lifted: FootPositions
    rear: FootPositions
    front: FootPositions
    loaded: FootPositions
    support_force: float
    sliding: GroundForces
    turning: GroundForces
    sloping: GroundForces
    banked: GroundForces


def foot_signs(parameters: FootParameters) -> FootSigns:
    """Computes everything for a foot with `parameters`."""
    drawn, fulcrum = DrawnFoot(parameters), parameters.fulcrum
    lifted = np.full(len(drawn.foot.keel), KEEL_ANGLE_RAD)
    lifted[0] = 0.0
    shape = keel_shape(parameters, fulcrum_m=FULCRUM_M, load_n=LOAD_N)
    return FootSigns(
        rest=drawn.positions(FULCRUM_M),
        lifted=drawn.positions(FULCRUM_M, lifted),
        rear=drawn.positions(fulcrum.rearmost_m),
        front=drawn.positions(fulcrum.foremost_m),
        loaded=drawn.positions(FULCRUM_M, shape.angles),
        support_force=support_force(parameters, FULCRUM_M, shape.angles),
        sliding=ground_forces(parameters, speed=SLIDING_M_PER_S),
        turning=ground_forces(parameters, turning=TURNING_RAD_PER_S),
        sloping=ground_forces(parameters, slope_deg=SLOPE_DEG),
        banked=ground_forces(parameters, bank_deg=SLOPE_DEG),
    )


def support_force(parameters: FootParameters, fulcrum_m: float, angles: np.ndarray) -> float:
    """What `FootForces` says (N) of the bench's foot with its keel at `angles` (m,) rad."""
    bench = make_bench(parameters)
    context = bench.diagram.CreateDefaultContext()
    own = bench.plant.GetMyMutableContextFromRoot(context)
    for name, angle in zip(bench.foot.keel_joint_names, angles, strict=True):
        bench.plant.GetJointByName(name).set_angle(own, float(angle))
    bench.diagram.GetInputPort("fulcrum_position").FixValue(context, [fulcrum_m])
    return float(bench.diagram.GetOutputPort("support_force").Eval(context)[0])


def ground_forces(
    parameters: FootParameters,
    *,
    speed: float = 0.0,
    turning: float = 0.0,
    slope_deg: float = 0.0,
    bank_deg: float = 0.0,
) -> GroundForces:
    """The straight foot, its sole parallel to the ground and SUNK_M below it, moving along +x and
    turning about +z.

    Args:
        speed: m/s. turning: rad/s about z, through the pylon's axis. slope_deg, bank_deg: of the
            ground.
    """
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    instance = plant.AddModelInstance("holder")
    carrier, holder = (
        plant.AddRigidBody(name, instance, SpatialInertia.SolidSphereWithMass(1.0, 0.1))
        for name in ("carrier", "holder")
    )
    slide = plant.AddJoint(
        PrismaticJoint("slide", plant.world_frame(), carrier.body_frame(), FORWARD)
    )
    turn = plant.AddJoint(RevoluteJoint("turn", carrier.body_frame(), holder.body_frame(), UPWARD))
    slope, bank = np.tan(np.radians([slope_deg, bank_deg]))
    normal = np.array([-slope, -bank, 1.0]) / np.sqrt(1.0 + slope**2 + bank**2)
    forward = np.array([1.0, 0.0, slope]) / np.sqrt(1.0 + slope**2)
    R_WP = RotationMatrix(np.column_stack([forward, np.cross(normal, forward), normal]))
    X_WP = RigidTransform(R_WP, (parameters.build_height_m - SUNK_M) * normal)
    place = plant.AddFrame(FixedOffsetFrame("place", holder.body_frame(), X_WP))
    foot = add_foot(plant, place, parameters)
    plant.Finalize()
    ground = Ground(patches=(GroundPatch(slope_deg=slope_deg, bank_deg=bank_deg),))
    wired = wire_foot(builder, plant, foot, ground=ground)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    slide.set_translation_rate(own, speed)
    turn.set_angular_rate(own, turning)
    positions = foot_positions(plant, foot, own, FULCRUM_M)
    seen = wired.forces.GetMyContextFromRoot(context)
    grf, cop, free = (
        np.array(wired.GetOutputPort(name).Eval(seen)) for name in ("grf", "cop", "free_moment")
    )
    return GroundForces(foot=positions, grf=grf, cop=cop, free_moment=float(free[0]), normal=normal)
