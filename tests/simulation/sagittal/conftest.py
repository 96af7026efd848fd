"""A person in the sagittal plane at drawn instants, with a foot in the ground, and the plant in the same state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from pydrake.systems.framework import Context

from vsf_drake.motion.manifest import GeometricOffsets
from vsf_drake.plants.foot import set_mount
from vsf_drake.simulation.sagittal.model import SagittalModel, Smoothing
from vsf_drake.simulation.walk import Walker

OFFSETS = GeometricOffsets(height_m=0.004, fore_aft_m=-0.006, alignment_rad=0.03)
FULCRUMS = (0.066, 0.151)


@dataclass(frozen=True)
class Instants:
    """q, v, a (8, N), w, u (12, N), p (4, N)."""

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    w: np.ndarray
    u: np.ndarray
    p: np.ndarray

    @property
    def all(self) -> tuple[np.ndarray, ...]:
        return self.q, self.v, self.a, self.w, self.u, self.p


def drawn_instants(
    model: SagittalModel, count: int, *, seed: int, speed: float = 1.0, depth: float = 0.015
) -> Instants:
    """Instants in which the lower foot is up to `depth` (m) in the ground; every second one has the other lower."""
    rng = np.random.default_rng(seed)
    q = 0.15 * rng.standard_normal((8, count))
    v, a = speed * rng.standard_normal((8, count)), 5.0 * speed * rng.standard_normal((8, count))
    w, u = 0.03 * rng.standard_normal((12, count)), 0.2 * speed * rng.standard_normal((12, count))
    w[:2] *= 0.1
    p = np.stack([rng.uniform(*FULCRUMS, count), rng.uniform(0.5, 2.0, count), 0.03 * rng.standard_normal(count),
                  rng.uniform(0.8, 1.2, count)])
    q[4, ::2] -= 1.0
    q[6, 1::2] -= 1.0
    q[2] = 1.2
    soles = model.evaluate(q, v, a, w, u, p, Smoothing())[-2:]
    q[2] -= soles.min(axis=0) + rng.uniform(0.2, 1.0, count) * depth
    return Instants(q, v, a, w, u, p)


@cache
def _model(walker: Walker, offsets: GeometricOffsets) -> SagittalModel:
    return SagittalModel(walker, offsets=offsets)


@pytest.fixture(params=["right", "left"])
def person(request, walker) -> tuple[Walker, SagittalModel]:
    """The walker with the prosthesis on that side and its sagittal model with OFFSETS. Change neither."""
    return walker(request.param), _model(walker(request.param), OFFSETS)


@pytest.fixture
def drawn() -> Callable[..., Instants]:
    return drawn_instants


@pytest.fixture
def plant_state() -> Callable[..., tuple[Context, list[int]]]:
    """plant_state(walker, model, instants, i): the plant's context at instant i, prosthesis with OFFSETS and the
    instant's turn, and the velocity indices of q and w."""
    def made(walker: Walker, model: SagittalModel, at: Instants, i: int) -> tuple[Context, list[int]]:
        plant = walker.gait.plant
        context = plant.CreateDefaultContext()
        set_mount(context, walker.gait.person.foot, height=OFFSETS.height_m, fore_aft=OFFSETS.fore_aft_m,
                  alignment=OFFSETS.alignment_rad + at.p[2, i])
        joints = {plant.get_joint(index).name(): plant.get_joint(index) for index in plant.GetJointIndices()}
        positions, velocities = plant.GetPositions(context), plant.GetVelocities(context)
        indices = []
        for name, x, rate in zip((*model.coordinates, *model.quasi_static), (*at.q[:, i], *at.w[:, i]),
                                 (*at.v[:, i], *at.u[:, i]), strict=True):
            positions[joints[name].position_start()], velocities[joints[name].velocity_start()] = x, rate
            indices.append(joints[name].velocity_start())
        positions[joints["fulcrum"].position_start()] = at.p[0, i]
        plant.SetPositions(context, positions)
        plant.SetVelocities(context, velocities)
        return context, indices
    return made
