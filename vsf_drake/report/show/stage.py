"""A scene on Meshcat: everything drawn where values of the controls put it, now or at a time of a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform

from vsf_drake.report.show import overlay
from vsf_drake.report.show.scene import LOAD, Scene

_FIELD_OF_VIEW_DEG, _ASPECT = 35.0, 1.6
_TRIAD_M = {"foot": 0.05, "bench": 0.05, "person": 0.12}


@dataclass(frozen=True)
class Readings:
    """What the bent keel tells.

    Attributes:
        rise_mm: of the load point in K.
        support_force_n: on the keel along z_K, negative while the toe is pressed up.
    """

    rise_mm: float
    support_force_n: float


class Stage:
    """Draws `scene` on `meshcat` at rest, then as `draw` is told."""

    def __init__(self, meshcat: Meshcat, scene: Scene) -> None:
        self.meshcat, self.scene = meshcat, scene
        meshcat.SetProperty("/Axes", "visible", False)
        meshcat.SetProperty("/Grid", "visible", scene.what == "person")
        for letter in scene.frames:
            overlay.add_triad(meshcat, letter, _TRIAD_M[scene.what])
        overlay.add_load(meshcat)
        meshcat.SetCamera(Meshcat.PerspectiveCamera(fov=_FIELD_OF_VIEW_DEG, aspect=_ASPECT))
        meshcat.SetCameraPose(*scene.camera)
        self.draw(scene.rest)

    def draw(self, values: Mapping[str, float], time_s: float | None = None) -> Readings:
        """Moves everything; at `time_s` of the recording, if one is being made.

        Raises:
            SimulationError: the keel finds no rest under the load; everything stays where it was.
        """
        scene = self.scene
        shape = scene.place(values)
        scene.context.SetTime(time_s or 0.0)
        scene.diagram.ForcedPublish(scene.context)
        poses = {letter: frame.CalcPoseInWorld(scene.plant_context) for letter, frame in scene.frames.items()}
        overlay.place_triads(self.meshcat, poses, time_s)
        x, z = self._load_point()
        overlay.place_load(self.meshcat, poses["K"] @ RigidTransform([x, 0.0, z]), values[LOAD], time_s)
        return Readings(1e3 * float(shape.load_point_K[1]), shape.support_force_n)

    def _load_point(self) -> tuple[float, float]:
        """x and z in K of the load point as it is drawn, with what single joints add."""
        scene, foot = self.scene, self.scene.foot
        piece = foot.keel_body_at(foot.parameters.load_point_m)
        context = scene.plant_context
        X_KB = foot.frame.EvalPoseInWorld(context).inverse() @ foot.keel[piece].EvalPoseInWorld(context)
        p_KC = X_KB @ np.array([foot.parameters.load_point_m - foot.keel_starts[piece], 0.0, 0.0])
        return float(p_KC[0]), float(p_KC[2])
