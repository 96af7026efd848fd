"""The keel as a geometrically exact beam, in Exudyn: what the chain of rigid pieces converges to.

    A             B        C       A: pin; B: spring of the support, along z of the straight beam;
    o=============^========|       C: load along z
    |<- fulcrum ->|                what lies behind C stays straight and is left out

Exudyn's ANCF cable in the plane (Gerstmayr & Irschik 2008, doi 10.1016/j.jsv.2008.04.019): an
Euler-Bernoulli beam of cubic elements, large deflections and rotations. The keel does not stretch,
the cable hardly does.

    python -m vsf_drake.engines.certificate.in_exudyn FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import exudyn
import numpy as np
from exudyn.itemInterface import (
    CoordinateConstraint,
    CoordinateSpringDamper,
    LoadCoordinate,
    MarkerNodeCoordinate,
    NodePoint2DSlope1,
    NodePointGround,
    ObjectANCFCable2D,
)

from vsf_drake.engines.certificate.asked import Asked

ELEMENTS = 32
"""Between A and B, and between B and C."""
STRETCH = 3e5
"""Axial stiffness over bending stiffness / C^2 of the cable. Its stretch makes the rise at most
1e-5 larger (measured, against the elastica); ten times as much has the elements lock instead."""
ROUNDING = 1e-12
"""Of the cable's axial stiffness (N): force that may be left over, ten times what rounding leaves
(measured)."""
LOAD_STEPS = 4
"""Of each load, from the one before."""


def answer(folder: Path) -> None:
    """Writes exudyn.npz into `folder`, of the questions there: `rise_m` (F, L) of C, and
    `version`."""
    asked = Asked.read(folder)
    np.savez(
        folder / "exudyn.npz",
        rise_m=[shapes(asked, 1e-3 * mm)[:, -1, 1] for mm in asked.fulcrum_mm],
        version=exudyn.__version__,
    )


def shapes(asked: Asked, fulcrum_m: float) -> np.ndarray:
    """(L, P, 2) m, x and z in K of the nodes from A to C under each load."""
    container = exudyn.SystemContainer()
    beam = container.AddSystem()
    x = np.unique(
        [
            *np.linspace(0.0, fulcrum_m, ELEMENTS + 1),
            *np.linspace(fulcrum_m, asked.load_point_m, ELEMENTS + 1),
        ]
    )
    axial_n = STRETCH * asked.beam_ei_nm2 / asked.load_point_m**2
    nodes = [beam.AddNode(NodePoint2DSlope1(referenceCoordinates=[at, 0, 1, 0])) for at in x]
    for i, length in enumerate(np.diff(x)):
        beam.AddObject(
            ObjectANCFCable2D(
                length=length,
                massPerLength=1.0,  # without effect at rest
                bendingStiffness=asked.beam_ei_nm2,
                axialStiffness=axial_n,
                nodeNumbers=[nodes[i], nodes[i + 1]],
                useReducedOrderIntegration=2,
            )
        )
    ground = beam.AddMarker(
        MarkerNodeCoordinate(nodeNumber=beam.AddNode(NodePointGround()), coordinate=0)
    )

    def along(node: Any, coordinate: int) -> Any:
        return beam.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate))

    for coordinate in (0, 1):
        beam.AddObject(CoordinateConstraint(markerNumbers=[ground, along(nodes[0], coordinate)]))
    beam.AddObject(
        CoordinateSpringDamper(
            markerNumbers=[ground, along(nodes[ELEMENTS], 1)], stiffness=asked.support_n_per_m
        )
    )
    load = beam.AddLoad(LoadCoordinate(markerNumber=along(nodes[-1], 1)))
    beam.Assemble()
    settings = exudyn.SimulationSettings()
    settings.solution.file.write = False
    settings.staticSolver.numberOfLoadSteps = LOAD_STEPS
    settings.staticSolver.verboseMode = 0
    settings.staticSolver.newton.relativeTolerance = 1e-8
    settings.staticSolver.newton.absoluteTolerance = ROUNDING * axial_n
    found = []
    for load_n in asked.load_n:
        beam.SetLoadParameter(load, "load", load_n)
        beam.SolveStatic(settings, updateInitialValues=True)
        position = exudyn.OutputVariableType.Position
        found.append([beam.GetNodeOutput(node, position)[:2] for node in nodes])
    return np.array(found)


if __name__ == "__main__":
    answer(Path(sys.argv[1]))
