"""What the foot's coordinates, forces and ground slopes do where they are positive, asked of the systems themselves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, PrismaticJoint, RevoluteJoint, SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.ground import Ground, GroundPatch
from vsf_drake.parameters import FootParameters
from vsf_drake.plants.bench import make_bench
from vsf_drake.plants.foot import add_foot
from vsf_drake.plants.foot_wiring import wire_foot
from vsf_drake.plants.inertia import FORWARD, UPWARD
from vsf_drake.report.frames.foot_positions import DrawnFoot, FootPositions, foot_positions
from vsf_drake.simulation.keel_shape import keel_shape

FULCRUM_M, LOAD_N, SUNK_M = 0.108, 500.0, 0.003
KEEL_ANGLE_RAD, SLOPE_DEG = np.radians(3.0), 10.0
SLIDING_M_PER_S, TURNING_RAD_PER_S = 0.3, -2.0


@dataclass(frozen=True)
class GroundForces:
    """A foot held on the ground, and what the ground does to it.

    Attributes:
        foot: where it is.
        grf: (3,) N in W, on the foot. cop: (3,) m in W. free_moment: N m about the ground's normal, on the foot.
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
        rest: the unloaded foot. lifted: every sprung joint of the keel at +KEEL_ANGLE_RAD. rear, front: the carriage at
            both ends. loaded: LOAD_N up on the load point. support_force: of the fulcrum on the keel then (N).
        sliding, turning: the foot pressed onto a level ground while it slides forward, and turns clockwise seen from
            above. sloping, banked: pressed onto grounds of +SLOPE_DEG.
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
        rest=drawn.positions(FULCRUM_M), lifted=drawn.positions(FULCRUM_M, lifted),
        rear=drawn.positions(fulcrum.rearmost_m), front=drawn.positions(fulcrum.foremost_m),
        loaded=drawn.positions(FULCRUM_M, shape.angles),
        support_force=support_force(parameters, FULCRUM_M, shape.angles),
        sliding=ground_forces(parameters, speed=SLIDING_M_PER_S),
        turning=ground_forces(parameters, turning=TURNING_RAD_PER_S),
        sloping=ground_forces(parameters, slope_deg=SLOPE_DEG), banked=ground_forces(parameters, bank_deg=SLOPE_DEG))


def support_force(parameters: FootParameters, fulcrum_m: float, angles: np.ndarray) -> float:
    """What `FulcrumSupport` says (N) of the bench's foot with its keel at `angles` (m,) rad."""
    bench = make_bench(parameters)
    context = bench.diagram.CreateDefaultContext()
    own = bench.plant.GetMyMutableContextFromRoot(context)
    for name, angle in zip(bench.foot.keel_joint_names, angles, strict=True):
        bench.plant.GetJointByName(name).set_angle(own, float(angle))
    bench.diagram.GetInputPort("fulcrum_position").FixValue(context, [fulcrum_m])
    system = bench.device.fulcrum
    return float(system.GetOutputPort("support_force").Eval(system.GetMyContextFromRoot(context))[0])


def ground_forces(parameters: FootParameters, *, speed: float = 0.0, turning: float = 0.0, slope_deg: float = 0.0,
                  bank_deg: float = 0.0) -> GroundForces:
    """The straight foot, its sole parallel to the ground and SUNK_M below it, moving along +x and turning about +z.

    Args:
        speed: m/s. turning: rad/s about z, through the pylon's axis. slope_deg, bank_deg: of the ground.
    """
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    instance = plant.AddModelInstance("holder")
    carrier, holder = (plant.AddRigidBody(name, instance, SpatialInertia.SolidSphereWithMass(1.0, 0.1))
                       for name in ("carrier", "holder"))
    slide = plant.AddJoint(PrismaticJoint("slide", plant.world_frame(), carrier.body_frame(), FORWARD))
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
    grf, cop, free = (np.array(wired.GetOutputPort(name).Eval(seen)) for name in ("grf", "cop", "free_moment"))
    return GroundForces(foot=positions, grf=grf, cop=cop, free_moment=float(free[0]), normal=normal)
