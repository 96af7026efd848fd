"""Reads a roll-over machine and its Context into the arrays of a `Mechanism`."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import Context

from vsf_drake.plants.roll_over_machine import RollOverDiagram
from vsf_drake.simulation.mechanism import coordinate_limits, fulcrum_arrays, ground_sites, keel_springs
from vsf_drake.simulation.stepping.stepper import Mechanism
from vsf_drake.simulation.stepping.tree import tree_of


def roll_over_mechanism(machine: RollOverDiagram, context: Context) -> Mechanism:
    """The machine with the parameters in `context` (the diagram's)."""
    plant, foot = machine.plant, machine.foot
    own = plant.GetMyContextFromRoot(context)
    springs, index = keel_springs(plant, foot, machine.device, context)
    return Mechanism(
        plant=plant, context=own, tree=tree_of(plant, own), sites=ground_sites(machine.ground, context),
        site_bodies=np.array([int(body) for body in foot.sites.body_indices], dtype=np.int64), ground_height=0.0,
        springs=springs, spring_index=index, **fulcrum_arrays(plant, foot, machine.device, context),
        limits=coordinate_limits(plant.num_velocities(), keel=index))
