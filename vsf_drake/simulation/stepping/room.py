"""What a step works on beside its numbers: which coordinates are free, and room so that nothing is allocated in it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vsf_drake.simulation.stepping.assembly import Contact, Forces, contact_space
from vsf_drake.simulation.stepping.dynamics import Motion, chains, work_space
from vsf_drake.simulation.stepping.tree import Tree

TOLERANCE = 1e-7
"""Of a step, in sqrt(kg) m/s: what is left of 1 N after 0.1 us on 1 kg."""


class Split(NamedTuple):
    """Which coordinates are free and what they move.

    prescribed, free: indices. above (f, f), counts (f,): see `dynamics.chains`, over the free ones. place: (n,)
    place among the free ones, or -1. body_moves (B,), site_moves (S,): whether a free coordinate moves it.
    moving, still: links whose body one moves, parents first, and the others.
    """

    prescribed: np.ndarray
    free: np.ndarray
    above: np.ndarray
    counts: np.ndarray
    place: np.ndarray
    body_moves: np.ndarray
    site_moves: np.ndarray
    moving: np.ndarray
    still: np.ndarray


class Room(NamedTuple):
    """Work space of a step: nothing is allocated in it. f free of n coordinates, k springs.

    tolerance: a step has converged when sqrt(r^T M^-1 r) is below it, in sqrt(kg) m/s. fulcrum (3,), keel (1,): where
    the support is (m from A), and of the foremost of the keel's bodies that bear it the weight, the derivative of that
    by the place (1/m), and which it is. applied: (n,) torques on free coordinates.
    """

    motion: Motion
    contact: Contact
    v0: np.ndarray
    acceleration: np.ndarray
    bias: np.ndarray
    applied: np.ndarray
    tau: np.ndarray
    trial: np.ndarray
    delta: np.ndarray
    r: np.ndarray
    dx: np.ndarray
    y: np.ndarray
    M: np.ndarray
    L: np.ndarray
    A: np.ndarray
    springs: np.ndarray
    fulcrum: np.ndarray
    keel: np.ndarray
    tolerance: float


def split_coordinates(tree: Tree, forces: Forces, prescribed: np.ndarray) -> Split:
    """The split for `prescribed` coordinates."""
    free = np.setdiff1d(np.arange(tree.num_coordinates), prescribed)
    above, counts = chains(tree, free)
    place_of = np.full(tree.num_coordinates, -1)
    place_of[free] = np.arange(len(free))
    moves = tree.ancestors[:, free].any(axis=1)
    return Split(prescribed=np.asarray(prescribed, dtype=np.int64), free=free, above=above, counts=counts,
                 place=place_of, body_moves=moves, site_moves=moves[forces.site_bodies],
                 moving=np.flatnonzero(moves[tree.links[:, 2]]), still=np.flatnonzero(~moves[tree.links[:, 2]]))


def step_room(tree: Tree, forces: Forces, split: Split, tolerance: float = TOLERANCE) -> Room:
    """Room for a step of this tree."""
    n, f = tree.num_coordinates, len(split.free)
    vectors = {name: np.zeros(n) for name in ("v0", "acceleration", "bias", "applied", "tau", "trial")}
    return Room(
        motion=work_space(tree), contact=contact_space(len(forces.sites), len(tree.body_names), n), **vectors,
        delta=np.zeros((len(tree.body_names), 6)), r=np.zeros(f), dx=np.zeros((f, 1)), y=np.zeros(f),
        M=np.zeros((f, f)), L=np.zeros((f, f)), A=np.zeros((f, f)), springs=np.zeros(len(forces.springs)),
        fulcrum=np.zeros(3), keel=np.zeros(1, dtype=np.int64), tolerance=tolerance)
