"""Reads a finished diagram and its Context into the arrays of a `Mechanism`.

The numbers are the ones that the diagram's systems hold in that Context, so that changing a
parameter there changes both ways of advancing the same diagram.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context, LeafSystem

from vsf_drake.errors import InputError
from vsf_drake.plants.bench import BenchDiagram
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.plants.gait import GaitDiagram
from vsf_drake.plants.wiring import velocity_indices
from vsf_drake.simulation.stepping.stepper import Mechanism
from vsf_drake.simulation.stepping.tree import tree_of
from vsf_drake.simulation.variables import Variable, check_number, walk_variables
from vsf_drake.systems.foot_forces import FootForces

UNLIMITED = 1e30
LARGEST_KEEL_ANGLE = 1.0
"""Turn of one keel joint (rad) beyond which a leaf spring would long have broken (a choice)."""
LARGEST_SOCKET_SHIFT, LARGEST_SOCKET_ANGLE = 0.1, 1.0
"""Displacement of the socket (m, rad) beyond which it is no longer on the limb (a choice)."""


def bench_mechanism(bench: BenchDiagram, context: Context) -> Mechanism:
    """The bench with the parameters in `context` (the diagram's)."""
    machine = _reader(bench.machine, context)
    points = machine("p_BS")
    law = [machine(name) for name in ("stiffness", "exponent", "damping", "full_damping_depth")]
    # The platen's balls touch the foot in points and do not rub; the threshold velocity then has no part.
    frictionless = [np.zeros(len(points)), np.zeros(len(points)), np.ones(len(points))]
    plant_context = bench.plant.GetMyContextFromRoot(context)
    springs, index = keel_springs(bench.plant, bench.foot, bench.forces, context)
    return Mechanism(
        plant=bench.plant, context=plant_context, tree=tree_of(bench.plant, plant_context),
        sites=np.column_stack([points, np.zeros(len(points)), *law, *frictionless]),
        site_bodies=_integers(bench.machine_bodies), ground_height=bench.contact_height,
        springs=springs, spring_index=index, **fulcrum_arrays(bench.plant, bench.foot, bench.forces, context),
        limits=coordinate_limits(bench.plant.num_velocities(), keel=index))


def gait_mechanism(gait: GaitDiagram, context: Context) -> Mechanism:
    """The walking person with the parameters in `context` (the diagram's); prosthetic spheres first.

    Raises:
        ValueError: the two feet do not stand on one level plane, the only ground that the stepper knows.
    """
    plant_context, foot = gait.plant_context(context), gait.person.foot
    keel, keel_index = keel_springs(gait.plant, foot, gait.forces["prosthetic"], context)
    socket, socket_index = _socket_springs(gait, context)
    heights = [level_ground(forces, context) for forces in gait.forces.values()]
    if heights[0] != heights[1]:
        raise ValueError(f"the ground is at {heights[0]:g} m under one foot and at {heights[1]:g} m under the other; "
                         "the stepper knows one level")
    return Mechanism(
        plant=gait.plant, context=plant_context, tree=tree_of(gait.plant, plant_context),
        sites=np.vstack([ground_sites(forces, context) for forces in gait.forces.values()]),
        site_bodies=_integers([*foot.sites.body_indices, *gait.person.intact_sites.body_indices]),
        ground_height=heights[0],
        springs=np.vstack([keel, socket]), spring_index=np.concatenate([keel_index, socket_index]),
        **fulcrum_arrays(gait.plant, foot, gait.forces["prosthetic"], context),
        limits=coordinate_limits(gait.plant.num_velocities(), keel=keel_index, socket=socket_index))


def gait_variables(gait: GaitDiagram, mechanism: Mechanism) -> dict[str, Variable]:
    """The numbers of this person's walk that studies change, with the values of `mechanism` as defaults."""
    foot = gait.person.foot
    return walk_variables(foot.parameters, foot.sites, mechanism.sites, mechanism.springs, mechanism.fulcrum,
                          gait.prescribed)


def edited(mechanism: Mechanism, variables: Mapping[str, Variable], values: Mapping[str, float]) -> Mechanism:
    """The mechanism with contact, springs and support as the checked `values` say; the rest is the caller's."""
    arrays = {name: getattr(mechanism, name).copy() for name in ("sites", "springs", "fulcrum")}
    for name, value in values.items():
        for key, array in arrays.items():
            unit = getattr(variables[name].edit, key)
            if unit is not None:
                array[...] = array + value * unit if variables[name].added else np.where(unit, value * unit, array)
    return dataclasses.replace(mechanism, **arrays)


def supported_over(mechanism: Mechanism, width_m: float) -> Mechanism:
    """The mechanism whose support passes from one piece of the keel to the next over `width_m` on either side.

    Raises:
        InputError: the width is no number from 0 to half the distance of two joints.
    """
    width = check_number(width_m, "support_width_m")
    most = 0.5 * float(np.diff(mechanism.keel_starts).min())
    if not 0.0 <= width <= most:
        raise InputError(f"{1e3 * width:g} mm is not usable", where="support_width_m",
                         right=f"It must be from 0 to {1e3 * most:.4g} mm, half the least distance of keel joints")
    return dataclasses.replace(mechanism, support_width=width)


def coordinate_limits(count: int, *, keel: np.ndarray, socket: np.ndarray | None = None) -> np.ndarray:
    """(count,) coordinates beyond which the model means nothing; `keel` and `socket` are indices."""
    limits = np.full(count, UNLIMITED)
    limits[keel] = LARGEST_KEEL_ANGLE
    if socket is not None:
        limits[socket] = np.repeat([LARGEST_SOCKET_SHIFT, LARGEST_SOCKET_ANGLE], 3)
    return limits


def _reader(system: LeafSystem, context: Context):
    own = system.GetMyContextFromRoot(context)
    return lambda name: system.GetParameter(own, name)


def _integers(indices) -> np.ndarray:
    return np.array([int(index) for index in indices], dtype=np.int64)


def keel_springs(plant, foot: FootHandles, forces: FootForces, context: Context) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the keel's springs, and their coordinates."""
    read = _reader(forces, context)
    stiffness, damping = read("joint_stiffness"), read("joint_damping")
    never = np.full(len(stiffness), UNLIMITED)
    rows = np.column_stack([stiffness, stiffness, damping, never, never, np.zeros(len(stiffness))])
    return rows, _integers(velocity_indices(plant, foot.keel_joint_names))


def _socket_springs(gait: GaitDiagram, context: Context) -> tuple[np.ndarray, np.ndarray]:
    bushing = _reader(gait.bushing, context)
    names = ("stiffness", "stiffness_negative", "damping", "limit", "rate_limit")
    rows = np.column_stack([*(bushing(name) for name in names), np.full(6, bushing("stop_ratio"))])
    return rows, _integers(velocity_indices(gait.plant, gait.person.socket.coordinate_names))


def fulcrum_arrays(plant: MultibodyPlant, foot: FootHandles, forces: FootForces, context: Context) -> dict:
    """What a `Mechanism` knows of the fulcrum and of the keel over it, by name."""
    read = _reader(forces, context)
    return {
        "fulcrum": np.array([float(read("fulcrum_stiffness")), float(read("fulcrum_damping"))]),
        "keel_bodies": _integers(body.index() for body in foot.keel), "keel_starts": foot.keel_starts,
        "keel_coordinates": _integers(velocity_indices(plant, foot.keel_joint_names, foot.instance)),
        "frame_body": int(foot.frame.index())}


def ground_sites(forces: FootForces, context: Context) -> np.ndarray:
    """Rows of the foot's contact sites, on a ground of one patch."""
    read = _reader(forces, context)
    names = ("radius", "stiffness", "exponent", "damping", "full_damping_depth", "mu_static", "mu_kinetic",
             "threshold_velocity")
    points = read("p_BS")
    return np.column_stack([points, *(np.broadcast_to(read(name), len(points)) for name in names)])


def level_ground(forces: FootForces, context: Context) -> float:
    """Height (m) of the one rigid level plane under a foot.

    Raises:
        ValueError: the ground is another one.
    """
    read = _reader(forces, context)
    if len(read("ground_height")) != 1 or any(read(f"ground_{name}")[0] for name in ("slope", "bank", "compliance")):
        raise ValueError("the stepper knows one level plane as ground, neither patches nor slopes nor what gives way")
    return float(read("ground_height")[0])
