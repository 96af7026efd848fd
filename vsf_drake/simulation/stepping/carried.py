"""Parameters whose sensitivities a run carries along, and how the state at its start depends on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.simulation.stepping.assembly import SITE_RECORD, Forces
from vsf_drake.simulation.stepping.dynamics import tree_arrays
from vsf_drake.simulation.stepping.edit import Edit
from vsf_drake.simulation.stepping.linearise import linearise
from vsf_drake.simulation.stepping.newton import EXACT, step, tangent_matrix
from vsf_drake.simulation.stepping.room import Split, split_coordinates, step_room
from vsf_drake.simulation.stepping.tree import Tree
from vsf_drake.simulation.stepping.ways import Tangent, Ways, make_ways, tangent_room


@dataclass(frozen=True, eq=False)
class Carried:
    """P parameters.

    Attributes:
        edits: what a unit of each adds.
        measured: (S,) bool, the sites whose resultant wrench is differentiated.
        loads: whether derivatives of loads and state are left too; not for edits of a coordinate.
        q0: (n, P) derivatives of the coordinates at the start; those of the velocities are zero but for courses' rates.
    """

    edits: tuple[Edit, ...]
    measured: np.ndarray
    q0: np.ndarray
    loads: bool = False

    def prepare(self, tree: Tree, forces: Forces, split: Split, steps: int) -> tuple[Ways, Tangent]:
        """Arrays for compiled code, at the start of a run of so many steps.

        Raises:
            ValueError: a course is not on the grid of the run, or loads are asked for and a coordinate moves.
        """
        for edit in self.edits:
            if self.loads and edit.coordinate is not None:
                raise ValueError(f"loads are not differentiated by shifts of {edit.coordinate}")
            if edit.course is not None and len(edit.course) != steps + 1:
                raise ValueError(f"a course has {len(edit.course)} instants, the run {steps + 1}")
        ways = make_ways(tree, forces, split, self.edits, measured=self.measured)
        tangent = tangent_room(tree, split, ways)
        tangent.q[: len(split.free)] = self.q0[split.free]
        return ways, tangent


def rest_sensitivity(
    tree: Tree, forces: Forces, prescribed: np.ndarray, q: np.ndarray, edits: tuple[Edit, ...], *, fulcrum: float,
    ground: float
) -> np.ndarray:
    """(n, P) derivatives of a rest position by the parameters, from the linearised balance of forces.

    Args:
        prescribed: indices of the coordinates that are held.
        q: (n,) coordinates at rest.
        fulcrum: its position (m from A). ground: its height (m).

    Raises:
        InputError: no force holds one of the coordinates at rest, so that its rest has no derivative.
    """
    h, split = 1e-3, split_coordinates(tree, forces, prescribed)
    room, arrays = step_room(tree, forces, split), tree_arrays(tree)
    ways = make_ways(tree, forces, split, edits, measured=np.zeros(len(forces.sites), dtype=bool))
    tangent = tangent_room(tree, split, ways)
    end, v, sites, support = q.copy(), np.zeros_like(q), np.zeros((len(forces.sites), len(SITE_RECORD))), np.zeros(3)
    step(h, arrays, forces, split, room, ground, 0.0, fulcrum, q[prescribed], np.zeros((0, 0)), np.zeros(0),
         end, v, np.zeros_like(q), sites, support)
    tangent_matrix(h, arrays, forces, split, room, EXACT, sites)
    linearise(h, arrays, forces, split, ways, room, tangent, q, v, sites, support)
    count = len(split.free)
    by = np.zeros((len(q), len(edits)))
    try:
        by[split.free] = -np.linalg.solve(tangent.Gq[:, :count], tangent.Gq[:, count:] @ ways.unit[count:] + tangent.E)
    except np.linalg.LinAlgError:
        loose = split.free[np.argmin(np.abs(tangent.Gq[:, :count]).sum(axis=1))]
        raise InputError(f"no force holds {tree.coordinate_names[loose]} at rest: where it starts has no derivative",
                         where="with_respect_to", right="Let the recording say where it starts") from None
    shifted = ways.coordinate[count:] >= 0
    np.add.at(by, ways.coordinate[count:][shifted], ways.unit[count:][shifted])
    return by
