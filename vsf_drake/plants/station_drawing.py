"""What a station looks like: a SceneGraph connected with its plant, and the ground's plates."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import Box, SceneGraph
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.ground import Ground, GroundPatch

GROUND_COLOUR = (0.72, 0.70, 0.66, 1.0)
_SHOWN_M, _THICKNESS_M = 3.0, 0.02


def connect_scene_graph(builder: DiagramBuilder, plant: MultibodyPlant, scene_graph: SceneGraph) -> None:
    """Adds `scene_graph` to `builder`, registers `plant` with it and connects the two both ways.

    As AddMultibodyPlantSceneGraph does it, which in pydrake 1.51 keeps what it made alive for ever: 80 kB a call.

    Args:
        plant: in `builder` already, before its Finalize and before its shapes.
        scene_graph: in no diagram yet.
    """
    builder.AddNamedSystem("scene_graph", scene_graph)
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    builder.Connect(scene_graph.get_query_output_port(), plant.get_geometry_query_input_port())
    builder.Connect(plant.get_geometry_pose_output_port(), scene_graph.get_source_pose_port(plant.get_source_id()))


def draw_ground(plant: MultibodyPlant, ground: Ground | None) -> None:
    """Gives the world a plate for each patch of `ground` (None: the plane z = 0).

    A plate ends 3 m from the patch's point that is nearest to x = reference_x, y = 0.
    """
    for i, patch in enumerate((ground or Ground()).patches):
        plant.RegisterVisualGeometry(plant.world_body(), *_plate(patch), f"ground_{i}_{patch.name}",
                                     np.array(GROUND_COLOUR))


def _plate(patch: GroundPatch) -> tuple[RigidTransform, Box]:
    x = _shown(patch.from_x_m, patch.to_x_m, patch.reference_x_m)
    y = _shown(patch.from_y_m, patch.to_y_m, 0.0)
    slope, bank = np.tan(np.radians([patch.slope_deg, patch.bank_deg]))
    middle = np.array([x.mean(), y.mean(), 0.0])
    middle[2] = patch.height_m + slope * (middle[0] - patch.reference_x_m) + bank * middle[1]
    along = np.array([1.0, 0.0, slope]) / np.hypot(1.0, slope)
    normal = np.array([-slope, -bank, 1.0]) / np.sqrt(1.0 + slope**2 + bank**2)
    R_WG = RotationMatrix(np.column_stack((along, np.cross(normal, along), normal)))
    size = np.ptp(x) * np.hypot(1.0, slope), np.ptp(y) * np.hypot(1.0, bank)
    return RigidTransform(R_WG, middle - 0.5 * _THICKNESS_M * normal), Box(*size, _THICKNESS_M)


def _shown(start: float, end: float, about: float) -> np.ndarray:
    """(2,) m, the part of a patch from `start` to `end` that is drawn."""
    middle = np.clip(about, start, end)
    return np.clip([start, end], middle - _SHOWN_M, middle + _SHOWN_M)
