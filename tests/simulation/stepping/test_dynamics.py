"""The compiled rigid-body dynamics are Drake's, at random states of every plant that they are used
for.

Scale of a quantity: the largest of its numbers; they agree to TOLERANCE of it, rounding over some
twenty joints.
"""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BodyIndex,
    FixedOffsetFrame,
    JacobianWrtVariable,
    MultibodyForces,
    PrismaticJoint,
    RevoluteJoint,
    SpatialInertia,
    UnitInertia,
    WeldJoint,
)

from vsf_drake.laws.compiled import compiled
from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants.bench import make_bench
from vsf_drake.plants.foot import set_mount
from vsf_drake.simulation.reactions import follow
from vsf_drake.simulation.stepping.tree import (
    chains,
    inverse_dynamics,
    mass_matrix,
    place,
    tree_arrays,
    tree_of,
    work_space,
)

place, inverse_dynamics, mass_matrix = (
    compiled(each.py_func) for each in (place, inverse_dynamics, mass_matrix)
)
"""To be called from Python."""
TOLERANCE = 1e-12
STATES = 3
PLANTS = ("left", "shifted foot", "other masses", "bench", "askew")


def other_masses(plant, context, rng):
    """Gives every body of the plant another mass, centre of mass and unit inertia in `context`."""
    for b in range(1, plant.num_bodies()):
        body = plant.get_body(BodyIndex(b))
        if body.CalcSpatialInertiaInBodyFrame(context).get_mass() > 0.0:
            p = rng.uniform(-0.1, 0.1, 3)
            G = UnitInertia.SolidBox(*rng.uniform(0.05, 0.4, 3)).ShiftFromCenterOfMass(p)
            body.SetSpatialInertiaInBodyFrame(context, SpatialInertia(rng.uniform(0.1, 20.0), p, G))


def askew(rng):
    """A tree of ten bodies on joints of every kind, whose frames and axes lie anyhow; our own lie
    mostly in a plane."""
    plant, bodies = MultibodyPlant(0.0), []

    def pose():
        return RigidTransform(RollPitchYaw(*rng.uniform(-1.5, 1.5, 3)), rng.uniform(-0.5, 0.5, 3))

    def frame(body):
        return plant.AddFrame(FixedOffsetFrame(f"frame{plant.num_frames()}", body, pose()))

    for i in range(10):
        p = rng.uniform(-0.1, 0.1, 3)
        G = UnitInertia.SolidBox(*rng.uniform(0.05, 0.4, 3)).ShiftFromCenterOfMass(p)
        body = plant.AddRigidBody(f"body{i}", SpatialInertia(rng.uniform(0.1, 20.0), p, G))
        parent = plant.world_body() if i == 0 else bodies[rng.integers(i)]
        joint, axis = (RevoluteJoint, PrismaticJoint, WeldJoint)[i % 3], rng.normal(size=3)
        plant.AddJoint(
            joint(
                f"joint{i}",
                frame(parent),
                frame(body),
                pose() if joint is WeldJoint else axis / np.linalg.norm(axis),
            )
        )
        bodies.append(body)
    plant.Finalize()
    return plant


class Case:
    """One plant in one state, beside the compiled dynamics of the same state with random
    accelerations."""

    def __init__(self, plant: MultibodyPlant, context, rng) -> None:
        self.plant, self.context, self.tree = plant, context, tree_of(plant, context)
        n = plant.num_velocities()
        self.q, self.v, self.a = (
            rng.uniform(-1.0, 1.0, n),
            rng.uniform(-5.0, 5.0, n),
            rng.uniform(-50.0, 50.0, n),
        )
        plant.SetPositionsAndVelocities(context, np.concatenate([self.q, self.v]))
        self.arrays, self.motion, self.tau = (
            tree_arrays(self.tree),
            work_space(self.tree),
            np.zeros(n),
        )
        place(self.arrays, self.arrays.all, self.q, self.motion)
        inverse_dynamics(self.arrays, self.v, self.a, self.motion, self.tau)

    def matrix(self, coordinates) -> np.ndarray:
        above, counts = chains(self.tree, coordinates)
        M = np.full((len(coordinates), len(coordinates)), np.nan)
        mass_matrix(self.arrays, self.motion, coordinates, above, counts, M)
        return M

    def bodies(self):
        return [(b, self.plant.get_body(BodyIndex(b))) for b in range(1, self.plant.num_bodies())]


@pytest.fixture(
    params=[(name, i) for name in PLANTS for i in range(STATES)], ids=lambda p: f"{p[0]}-{p[1]}"
)
def case(request, walker):
    name, seed = request.param
    rng = np.random.default_rng(seed)
    if name in ("bench", "askew"):
        plant = make_bench(FootParameters()).plant if name == "bench" else askew(rng)
        return Case(plant, plant.CreateDefaultContext(), rng)
    gait = walker("left" if name == "left" else "right").gait
    context = gait.plant.CreateDefaultContext()
    if name == "shifted foot":
        set_mount(context, gait.person.foot, height=0.011, fore_aft=-0.017, alignment=0.09)
    if name == "other masses":
        other_masses(gait.plant, context, rng)
    return Case(gait.plant, context, rng)


def assert_equal(found, wanted):
    wanted = np.asarray(wanted)
    np.testing.assert_allclose(
        found, wanted, rtol=0.0, atol=TOLERANCE * max(np.abs(wanted).max(), 1e-3)
    )


def test_poses_joint_motions_velocities_and_accelerations_are_drakes(case):
    """Spatial vectors are of the point at the world's origin: v - w x p, and for accelerations a -
    alpha x p - w x v, with gravity as one of the world."""
    world, accelerations = (
        case.plant.world_frame(),
        case.plant.CalcSpatialAccelerationsFromVdot(case.context, case.a),
    )
    for b, body in case.bodies():
        X, V = body.EvalPoseInWorld(case.context), body.EvalSpatialVelocityInWorld(case.context)
        p, w, v = X.translation(), V.rotational(), V.translational()
        assert_equal(case.motion.R[b], X.rotation().matrix())
        assert_equal(case.motion.p[b], p)
        J = case.plant.CalcJacobianSpatialVelocity(
            case.context,
            JacobianWrtVariable.kV,
            body.body_frame(),
            X.inverse().translation(),
            world,
            world,
        )
        assert_equal(np.where(case.tree.ancestors[b], case.motion.S.T, 0.0), J)
        assert_equal(case.motion.V[b], [*w, *(v - np.cross(w, p))])
        alpha, a = accelerations[b].rotational(), accelerations[b].translational()
        assert_equal(
            case.motion.A[b],
            [*alpha, *(a - np.cross(alpha, p) - np.cross(w, v) - case.tree.gravity)],
        )


def test_inverse_dynamics_with_gravity_are_drakes(case):
    own = MultibodyForces(case.plant)
    case.plant.CalcForceElementsContribution(case.context, own)
    assert_equal(case.tau, case.plant.CalcInverseDynamics(case.context, case.a, own))


def test_mass_matrix_is_drakes(case):
    """Also its rows and columns of some coordinates."""
    M = case.matrix(np.arange(len(case.q)))
    assert_equal(M, case.plant.CalcMassMatrix(case.context))
    some = np.arange(1, len(case.q), 3)
    np.testing.assert_array_equal(case.matrix(some), M[np.ix_(some, some)])


def test_energies_are_drakes(case):
    motion = follow(
        case.tree,
        np.tile(case.q, (2, 1)),
        np.array([case.v, np.zeros_like(case.v)]),
        bodies=(0,),
        coordinates=(),
        inside=np.ones(len(case.tree.body_names), dtype=bool),
    )
    potential, kinetic = -motion.mass_moment @ case.tree.gravity, motion.kinetic_j
    assert_equal(kinetic, [case.plant.CalcKineticEnergy(case.context), 0.0])
    assert_equal(potential, [case.plant.CalcPotentialEnergy(case.context)] * 2)
