"""Reads a finished diagram and its Context into the arrays of a `Mechanism`.

The numbers are the ones that the diagram's systems hold in that Context, so that changing a
parameter there changes both ways of advancing the same diagram.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    ForceElementIndex,
    PrismaticSpring,
    RevoluteSpring,
    UniformGravityFieldElement,
)
from pydrake.systems.framework import Context

from vsf_drake.base.errors import InputError, require
from vsf_drake.laws import kelvin_voigt
from vsf_drake.laws.contact import LAWS
from vsf_drake.laws.contact_law import LawConstants
from vsf_drake.laws.contact_laws import CONTACT_LAWS
from vsf_drake.plants.bench import BenchDiagram, RollOverDiagram
from vsf_drake.plants.contact_geometry import dissipation
from vsf_drake.plants.foot_handles import FootHandles
from vsf_drake.plants.foot_wiring import WiredFoot
from vsf_drake.plants.gait import GaitDiagram
from vsf_drake.plants.wiring import velocity_indices
from vsf_drake.simulation.stepping.assembly import SITE_COLUMNS
from vsf_drake.simulation.stepping.directions import ParameterTangent
from vsf_drake.simulation.stepping.runs import Mechanism
from vsf_drake.simulation.stepping.tree import tree_of
from vsf_drake.simulation.variables import Variable, check_number
from vsf_drake.systems._system import System
from vsf_drake.systems.foot_forces import FootForces

UNLIMITED = 1e30
DISSIPATION = SITE_COLUMNS.index("dissipation")
MATCHED = [SITE_COLUMNS.index(name) for name in ("stiffness", "exponent", "damping")]
"""Columns of a site that its dissipation is matched to."""
# turn of one keel joint (rad) beyond which a leaf spring would long have broken (a choice)
LARGEST_KEEL_ANGLE = 1.0
LARGEST_SOCKET_SHIFT, LARGEST_SOCKET_ANGLE = 0.1, 1.0
"""Displacement of the socket (m, rad) beyond which it is no longer on the limb (a choice)."""


def bench_mechanism(bench: BenchDiagram, context: Context) -> Mechanism:
    """The bench with the parameters in `context` (the diagram's)."""
    read = _reader(bench.machine, context)
    points = read("p_BS")
    names = kelvin_voigt.LAW.constants
    # the platen's balls touch the foot in points and do not rub
    constants = LawConstants(**{name: read(name) for name in names})
    columns = (np.broadcast_to(value, len(points)) for value in constants)
    return _mechanism(
        bench.plant,
        bench.foot,
        bench.forces,
        context,
        bodies=bench.machine_bodies,
        sites=np.column_stack([points, np.zeros(len(points)), *columns]),
        ground_height=bench.contact_height,
    )


def roll_over_mechanism(machine: RollOverDiagram, context: Context) -> Mechanism:
    """The roll-over machine with the parameters in `context` (the diagram's)."""
    return _mechanism(
        machine.plant,
        machine.foot,
        machine.forces,
        context,
        bodies=machine.foot.sites.body_indices,
        sites=_ground_sites(machine.forces, context),
        law=machine.forces.law,
        ground_height=0.0,
    )


def gait_mechanism(gait: GaitDiagram, context: Context) -> Mechanism:
    """The walking person with the parameters in `context` (the diagram's); prosthetic spheres
    first.

    ValueError if the two feet do not stand on one level plane, the only ground that the stepper
    knows.
    """
    foot = gait.person.foot
    bushing = _reader(gait.bushing, context)
    heights = [_level_ground(forces, context) for forces in gait.forces.values()]
    if heights[0] != heights[1]:
        raise ValueError(
            f"the ground is at {heights[0]:g} m under one foot and at {heights[1]:g} m under the "
            "other; the stepper knows one level"
        )
    names = ("stiffness", "stiffness_negative", "damping", "limit", "rate_limit")
    socket = np.column_stack(
        [*(bushing(name) for name in names), np.full(6, bushing("stop_ratio"))]
    )
    return _mechanism(
        gait.plant,
        foot,
        gait.forces["prosthetic"],
        context,
        ground_height=heights[0],
        law=gait.forces["prosthetic"].law,
        sites=np.vstack([_ground_sites(forces, context) for forces in gait.forces.values()]),
        bodies=[*foot.sites.body_indices, *gait.person.intact_sites.body_indices],
        others=len(gait.person.intact_sites.body_indices),
        socket=socket,
        socket_index=_integers(velocity_indices(gait.plant, gait.person.socket.coordinate_names)),
    )


def leg_mechanism(
    plant: MultibodyPlant, wired: WiredFoot, context: Context
) -> tuple[Mechanism, np.ndarray]:
    """A plant on one foot with the parameters in `context` (the diagram's), and the torques (n,)
    that springs of its joints exert at 0.

    InputError if the plant or the foot has what the stepper does not know.
    """
    foot = wired.foot
    known = {
        "contact is Drake's own": foot.contact in CONTACT_LAWS,
        "plant has a time step": foot.support is None,
        "plant has constraints": plant.num_constraints() == 0,
    }
    for what, absent in known.items():
        require(
            absent,
            f"the {what}, which the stepper does not know",
            "wired",
            f"Take a continuous plant and contact {' or '.join(CONTACT_LAWS)}",
        )
    joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
    moving = [joint.name() for joint in joints if joint.num_velocities()]
    require(
        len(set(moving)) == len(moving),
        "two joints have one name, as those of two feet have",
        "plant",
        "Take a plant with one foot, and rename joints that occur twice",
    )
    own = plant.GetMyContextFromRoot(context)
    try:
        mechanism = _mechanism(
            plant,
            foot,
            wired.forces,
            context,
            bodies=foot.sites.body_indices,
            sites=_ground_sites(wired.forces, context),
            law=wired.forces.law,
            ground_height=_level_ground(wired.forces, context),
        )
    except ValueError as error:  # a joint, or the ground
        raise InputError(str(error), where="plant") from error
    n = plant.num_velocities()
    stiffness = np.zeros(n)
    damping = np.zeros(n)
    constant = np.zeros(n)
    for joint in joints:
        if joint.num_velocities() and joint.model_instance() != foot.instance:
            damping[joint.velocity_start()] = joint.GetDampingVector(own)[0]
    for motor in plant.GetJointActuatorIndices():
        actuator = plant.get_joint_actuator(motor)
        require(
            actuator.rotor_inertia(own) == 0.0,
            f"the rotor of {actuator.name()!r} has inertia, which the stepper does not know",
            "plant",
            "Add it to the inertia of the body that it turns",
        )
    for place in range(plant.num_force_elements()):
        element = plant.get_force_element(ForceElementIndex(place))
        if isinstance(element, RevoluteSpring):
            k, rest = element.GetStiffness(own), element.GetNominalAngle(own)
        elif isinstance(element, PrismaticSpring):
            k, rest = element.stiffness(), element.nominal_position()
        else:
            require(
                isinstance(element, UniformGravityFieldElement),
                f"has a {type(element).__name__}, which the stepper does not know",
                "plant",
                "Take springs in joints, or work its force out and give it by the input torques",
            )
            continue
        at = element.joint().velocity_start()
        stiffness[at] += k
        constant[at] += k * rest
    sprung = np.flatnonzero((stiffness > 0.0) | (damping > 0.0))
    never = np.full(len(sprung), UNLIMITED)
    rows = [stiffness[sprung], stiffness[sprung], damping[sprung], never, never, 0.0 * never]
    whole = dataclasses.replace(
        mechanism,
        springs=np.vstack([mechanism.springs, np.column_stack(rows)]),
        spring_index=np.concatenate([mechanism.spring_index, sprung]),
    )
    return whole, constant


def _mechanism(
    plant: MultibodyPlant,
    foot: FootHandles,
    forces: FootForces,
    context: Context,
    *,
    sites: np.ndarray,
    bodies: Iterable[Any],
    ground_height: float,
    others: int = 0,
    law: int = 0,
    socket: np.ndarray | None = None,
    socket_index: np.ndarray | None = None,
) -> Mechanism:
    """`others`: how many of the sites, the last ones, are on the other foot."""
    read = _reader(forces, context)
    own = plant.GetMyContextFromRoot(context)
    limits = np.full(plant.num_velocities(), UNLIMITED)
    stiffness = read("joint_stiffness")
    damping = read("joint_damping")
    keel = _integers(velocity_indices(plant, foot.keel_joint_names))
    never = np.full(len(stiffness), UNLIMITED)
    springs = np.column_stack(
        [stiffness, stiffness, damping, never, never, np.zeros(len(stiffness))]
    )
    limits[keel] = LARGEST_KEEL_ANGLE
    if socket_index is not None:
        limits[socket_index] = np.repeat([LARGEST_SOCKET_SHIFT, LARGEST_SOCKET_ANGLE], 3)
    return Mechanism(
        plant=plant,
        context=own,
        tree=tree_of(plant, own),
        sites=sites,
        site_bodies=_integers(bodies),
        feet=np.repeat([0, 1], [len(sites) - others, others]),
        ground_height=ground_height,
        springs=springs if socket is None else np.vstack([springs, socket]),
        spring_index=keel if socket_index is None else np.concatenate([keel, socket_index]),
        fulcrum=np.array([float(read("fulcrum_stiffness")), float(read("fulcrum_damping"))]),
        keel_bodies=_integers(body.index() for body in foot.keel),
        keel_starts=foot.keel_starts,
        keel_coordinates=keel,
        frame_body=int(foot.frame.index()),
        limits=limits,
        law=law,
    )


def mounted(mechanism: Mechanism, foot: FootHandles) -> Mechanism:
    """The mechanism with the foot's mount as its Context has it now; the rest is as it was read."""
    tree = mechanism.tree
    frames = tree.frames.copy()
    X_MB = foot.mount.CalcPoseInBodyFrame(mechanism.context).inverse()
    [row] = np.flatnonzero(tree.links[:, 2] == int(foot.frame.index()))
    frames[row, 12:21] = X_MB.rotation().matrix().ravel()
    frames[row, 21:24] = X_MB.translation()
    return dataclasses.replace(mechanism, tree=dataclasses.replace(tree, frames=frames))


def edited(
    mechanism: Mechanism, variables: Mapping[str, Variable], values: Mapping[str, float]
) -> Mechanism:
    """The mechanism with contact, springs and support as the checked `values` say; the rest is the
    caller's. A dissipation is matched to what is changed (`plants.contact_geometry`)."""
    arrays = {name: getattr(mechanism, name).copy() for name in ("sites", "springs", "fulcrum")}
    for name, value in values.items():
        for key, array in arrays.items():
            unit = getattr(variables[name].by_unit, key)
            if unit is not None:
                array[...] = (
                    array + value * unit
                    if variables[name].added
                    else np.where(unit, value * unit, array)
                )
    if "dissipation" in LAWS[mechanism.law].constants:
        before, after = (_matched(sites)[0] for sites in (mechanism.sites, arrays["sites"]))
        arrays["sites"][:, DISSIPATION] = np.where(
            after == before, mechanism.sites[:, DISSIPATION], after
        )
    return dataclasses.replace(mechanism, **arrays)


def tangents_of(
    mechanism: Mechanism, tangents: Iterable[ParameterTangent]
) -> tuple[ParameterTangent, ...]:
    """`tangents` at the mechanism's numbers: with what a matched dissipation changes by."""
    if "dissipation" not in LAWS[mechanism.law].constants:
        return tuple(tangents)
    _, *by = _matched(mechanism.sites)
    whole = []
    for by_unit in tangents:
        sites = by_unit.sites
        if sites is not None:
            sites = sites.copy()
            sites[:, DISSIPATION] += np.sum(sites[:, MATCHED] * np.transpose(by), axis=1)
        whole.append(dataclasses.replace(by_unit, sites=sites))
    return tuple(whole)


def _matched(sites: np.ndarray) -> tuple[np.ndarray, ...]:
    return dissipation(*sites[:, MATCHED].T)


def supported_over(mechanism: Mechanism, width_m: float) -> Mechanism:
    """The mechanism whose support passes from one piece of the keel to the next over `width_m` on
    either side."""
    width = check_number(width_m, "support_width_m")
    most = 0.5 * float(np.diff(mechanism.keel_starts).min())
    if not 0.0 <= width <= most:
        raise InputError(
            f"{1e3 * width:g} mm is not usable",
            where="support_width_m",
            right=(
                f"It must be from 0 to {1e3 * most:.4g} mm, half the least distance of keel joints"
            ),
        )
    return dataclasses.replace(mechanism, support_width=width)


def _reader(system: System, context: Context) -> Callable[[str], Any]:
    system_context = system.GetMyContextFromRoot(context)
    return lambda name: system.GetParameter(system_context, name)


def _integers(indices: Iterable[Any]) -> np.ndarray:
    return np.array([int(index) for index in indices], dtype=np.int64)


def _ground_sites(forces: FootForces, context: Context) -> np.ndarray:
    """Rows of the foot's contact sites, on a ground of one patch."""
    read = _reader(forces, context)
    points = read("p_BS")
    columns = (np.broadcast_to(read(name), len(points)) for name in SITE_COLUMNS[3:])
    return np.column_stack([points, *columns])


def _level_ground(forces: FootForces, context: Context) -> float:
    """Height (m) of the one rigid level plane under a foot; ValueError for another ground."""
    read = _reader(forces, context)
    if len(read("ground_height")) != 1 or any(
        read(f"ground_{name}")[0] for name in ("slope", "bank", "compliance", "speed")
    ):
        raise ValueError(
            "the stepper knows one level plane as ground, neither patches nor slopes nor belts nor "
            "what gives way"
        )
    return float(read("ground_height")[0])
