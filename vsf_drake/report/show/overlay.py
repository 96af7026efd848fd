"""What is drawn over the bodies: triads of frames with their letters, and the load on the keel as an arrow."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from pydrake.geometry import Cylinder, Meshcat, MeshcatCone, Rgba
from pydrake.math import RigidTransform, RotationMatrix

FRAMES, LOAD = "/frames", "/load"
"""Where they stand in Meshcat's tree."""
AXES = (Rgba(0.85, 0.10, 0.10), Rgba(0.10, 0.60, 0.15), Rgba(0.15, 0.25, 0.85))
"""Colours of x, y, z."""
ARROW_M_PER_N = 2.5e-4
_ORANGE = Rgba(0.90, 0.38, 0.00)
_SHAFT_RADIUS_M, _HEAD_LENGTH_M, _HEAD_RADIUS_M = 0.0035, 0.018, 0.008
_STROKES = {
    "W": [(0.0, 1.0), (0.25, 0.0), (0.5, 0.8), (0.75, 0.0), (1.0, 1.0)],
    "K": [(0.0, 0.0), (0.0, 1.0), (0.0, 0.45), (0.9, 1.0), (0.0, 0.45), (0.9, 0.0)],
    "M": [(0.0, 0.0), (0.0, 1.0), (0.5, 0.3), (1.0, 1.0), (1.0, 0.0)],
}


def add_triad(meshcat: Meshcat, letter: str, length: float) -> None:
    """Axes of `length` (m), x red, y green, z blue, with the frame's letter behind its origin."""
    path, radius = f"{FRAMES}/{letter}", 0.02 * length
    turns = (RotationMatrix.MakeYRotation(0.5 * np.pi), RotationMatrix.MakeXRotation(-0.5 * np.pi), RotationMatrix())
    for axis, turn, colour in zip("xyz", turns, AXES, strict=True):
        meshcat.SetObject(f"{path}/{axis}", Cylinder(radius, length), colour)
        meshcat.SetTransform(f"{path}/{axis}", RigidTransform(turn, turn @ np.array([0.0, 0.0, 0.5 * length])))
    strokes = np.array(_STROKES[letter]) * 0.3 * length
    points = np.array([strokes[:, 0] - 0.45 * length, np.zeros(len(strokes)), strokes[:, 1] + 0.1 * length])
    meshcat.SetLine(f"{path}/letter", np.asfortranarray(points), 3.0, Rgba(0.1, 0.1, 0.1, 1.0))


def show_triad(meshcat: Meshcat, letter: str, shown: bool) -> None:
    """Shows or hides a triad."""
    meshcat.SetProperty(f"{FRAMES}/{letter}", "visible", shown)


def place_triads(meshcat: Meshcat, poses: Mapping[str, RigidTransform], time_s: float | None) -> None:
    """Moves the triads to `poses` in W; at `time_s` of a recording, if one is being made."""
    for letter, pose in poses.items():
        meshcat.SetTransform(f"{FRAMES}/{letter}", pose, time_in_recording=time_s)


def add_load(meshcat: Meshcat) -> None:
    """The arrow of the load, which `place_load` moves."""
    meshcat.SetObject(f"{LOAD}/shaft/rod", Cylinder(_SHAFT_RADIUS_M, 1.0), _ORANGE)
    meshcat.SetTransform(f"{LOAD}/shaft/rod", RigidTransform([0.0, 0.0, -0.5]))
    meshcat.SetObject(f"{LOAD}/head/cone", MeshcatCone(_HEAD_LENGTH_M, _HEAD_RADIUS_M, _HEAD_RADIUS_M), _ORANGE)
    turned = RotationMatrix.MakeXRotation(np.pi)  # Drake's cone has its tip at the origin and opens along +z
    meshcat.SetTransform(f"{LOAD}/head/cone", RigidTransform(turned))
    for part in ("shaft/rod", "head/cone"):  # painted last, over the platen that it stands in
        meshcat.SetProperty(f"{LOAD}/{part}/<object>", "material.depthTest", False)
        meshcat.SetProperty(f"{LOAD}/{part}/<object>", "renderOrder", 1.0)


def place_load(meshcat: Meshcat, X_WC: RigidTransform, load_n: float, time_s: float | None) -> None:
    """The arrow ends at the origin of C and points along z_C; its length shows the load (N)."""
    length = ARROW_M_PER_N * load_n
    meshcat.SetTransform(LOAD, X_WC, time_in_recording=time_s)
    meshcat.SetProperty(LOAD, "visible", length > _HEAD_LENGTH_M, time_in_recording=time_s)
    shaft = RigidTransform([0.0, 0.0, -_HEAD_LENGTH_M])
    meshcat.SetTransform(f"{LOAD}/shaft", shaft, time_in_recording=time_s)
    scale = [1.0, 1.0, max(length - _HEAD_LENGTH_M, 1e-3)]
    meshcat.SetProperty(f"{LOAD}/shaft", "scale", scale, time_in_recording=time_s)
