"""What wiring the foot adds to one evaluation of a plant's derivatives, by how many other bodies the plant has."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, RevoluteJoint, SpatialInertia
from pydrake.systems.framework import DiagramBuilder
from table import Row

from vsf_drake.parameters import FootParameters
from vsf_drake.plants import add_foot, wire_foot

LIMIT_US = 60.0
BATCH = 20
PLANTS = ((0, 1), (30, 1), (60, 1), (30, 2))
"""Other bodies, in limbs of six on one floating trunk, and feet under it."""
STANDING_HEIGHT_M = 0.075
"""Of the trunk: all spheres of a foot are in the ground, the dearest case."""


def rows(quick: bool = False) -> list[Row]:
    """In the quick form with fewer repeats."""
    return [_row(bodies, feet, repeats=30 if quick else 150) for bodies, feet in PLANTS]


def _row(bodies: int, feet: int, *, repeats: int) -> Row:
    """Least and median of the processor's time over batches that alternate, for other programs disturb them."""
    bare, wired = (_evaluation(bodies, feet, wired=w) for w in (False, True))
    times = np.array([[_batch(bare), _batch(wired)] for _ in range(repeats)]) * 1e6
    least, median = (np.diff(f(times, axis=0))[0] / feet for f in (np.min, np.median))
    return Row(f"wiring {'a foot' if feet == 1 else f'each of {feet} feet'} beside {bodies} bodies", None, None, (
        f"adds {least:.0f} us (median {median:.0f}) to {times[:, 0].min():.0f} us an evaluation; "
        f"limit {LIMIT_US:.0f}"))


def _batch(evaluate: Callable[[], None]) -> float:
    started = time.thread_time()
    for _ in range(BATCH):
        evaluate()
    return (time.thread_time() - started) / BATCH


def _evaluation(bodies: int, feet: int, *, wired: bool) -> Callable[[], None]:
    """One evaluation of the derivatives in a state that has just been set."""
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    trunk = parent = plant.AddRigidBody("trunk", SpatialInertia.SolidBoxWithMass(30.0, 0.3, 0.3, 0.3))
    for i in range(bodies):
        body = plant.AddRigidBody(f"body_{i}", SpatialInertia.SolidBoxWithMass(1.0, 0.1, 0.1, 0.1))
        parent = trunk if i % 6 == 0 else parent
        place = plant.AddFrame(FixedOffsetFrame(f"frame_{i}", parent.body_frame(), RigidTransform([0.0, 0.0, 0.1])))
        plant.AddJoint(RevoluteJoint(f"joint_{i}", place, body.body_frame(), np.eye(3)[i % 3]))
        parent = body
    handles = [add_foot(plant, trunk.body_frame(), FootParameters(), name=f"foot_{i}") for i in range(feet)]
    plant.Finalize()
    for foot in handles if wired else ():
        wire_foot(builder, plant, foot)
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    own = plant.GetMyMutableContextFromRoot(context)
    plant.SetFreeBodyPose(own, trunk, RigidTransform([0.0, 0.0, STANDING_HEIGHT_M]))
    state, derivatives = plant.GetPositionsAndVelocities(own), diagram.AllocateTimeDerivatives()

    def evaluate() -> None:
        plant.SetPositionsAndVelocities(own, state)
        diagram.CalcTimeDerivatives(context, derivatives)

    evaluate()
    return evaluate
