"""What a foot adds to the derivatives of a diagram: a leg on a rail, with its foot 26 states, alone
and with the foot wired."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, InitializeAutoDiff
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from table import Row

from vsf_drake.base.files import resource
from vsf_drake.model.parameters import FootParameters
from vsf_drake.plants import FootHandles, add_foot, wire_foot
from vsf_drake.plants.foot import set_mount

HIP_M = 0.84
"""Height of the hip: all spheres are pressed into the ground."""
ROUNDS, CALLS = 40, 50


def leg(wired: bool) -> tuple[Diagram, MultibodyPlant, FootHandles]:
    """The leg with its foot."""
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", MultibodyPlant(0.0))
    Parser(plant).AddModels(str(resource("models/leg.urdf")))
    rail = PrismaticJoint("rail", plant.world_frame(), plant.GetFrameByName("hip"), [0, 0, 1])
    plant.AddJoint(rail)
    foot = add_foot(plant, plant.GetFrameByName("pylon_end"), FootParameters())
    plant.Finalize()
    if wired:
        wire_foot(builder, plant, foot)
    return builder.Build(), plant, foot


def some_state(plant: MultibodyPlant, foot: FootHandles) -> np.ndarray:
    """Standing on the foot, moving somewhat."""
    context = plant.CreateDefaultContext()
    plant.GetJointByName("rail").set_translation(context, HIP_M)
    foot.carriage_joint(plant).set_translation(context, foot.fulcrum_m)
    state = plant.GetPositionsAndVelocities(context)
    moved: np.ndarray = state + 1e-3 * np.random.default_rng(0).normal(size=len(state))
    return moved


def call(diagram: Any, context: Context, state: np.ndarray, now: Any) -> Callable[[int], None]:
    """One evaluation at a new time and state, as integrators ask for it."""

    def evaluate(i: int) -> None:
        context.SetTime(now(1e-6 * i))
        context.SetContinuousState(state)
        diagram.EvalTimeDerivatives(context)

    return evaluate


def least_s(calls: list[Callable[[int], None]], count: int) -> list[float]:
    """Processor time of one of each, the least of ROUNDS that go through all in turn."""
    least = [np.inf] * len(calls)
    for _ in range(ROUNDS):
        for k, evaluate in enumerate(calls):
            started = time.process_time()
            for i in range(count):
                evaluate(i)
            least[k] = min(least[k], (time.process_time() - started) / count)
    return least


def diagrams() -> list[Row]:
    """Over the plant alone, in floats and by AutoDiffXd seeded with all states."""
    bare, plant, foot = leg(wired=False)
    whole, whole_plant, whole_foot = leg(wired=True)
    state = some_state(plant, foot)
    contexts = [diagram.CreateDefaultContext() for diagram in (bare, whole, whole)]
    set_mount(whole_plant.GetMyMutableContextFromRoot(contexts[2]), whole_foot, height=1e-3)
    floats = least_s(
        [
            call(diagram, context, state, float)
            for diagram, context in zip((bare, whole, whole), contexts, strict=True)
        ],
        CALLS,
    )
    seeded = InitializeAutoDiff(state).ravel()
    general = [diagram.ToAutoDiffXd() for diagram in (bare, whole)]
    derived = least_s(
        [call(diagram, diagram.CreateDefaultContext(), seeded, AutoDiffXd) for diagram in general],
        CALLS // 10,
    )
    names = ("plant alone", "with the foot", "with the foot, its mount moved in the Context")
    both = [
        (f"a leg's derivatives, {name}", spent, spent / floats[0])
        for name, spent in zip(names, floats, strict=True)
    ] + [
        (f"the same by AutoDiffXd seeded by all states, {name}", spent, spent / derived[0])
        for name, spent in zip(names[:2], derived, strict=True)
    ]
    return [
        Row(name, None, spent, f"{1e6 * spent:.0f} us, {over:.2f} times the plant")
        for name, spent, over in both
    ]
