"""What a station looks like: a SceneGraph connected with its plant, and the ground's plates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from vsf_drake.ground import Ground
from vsf_drake.plants.ground_geometry import box_under

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
        (from_x_m, to_x_m), (from_y_m, to_y_m) = (_shown(patch.from_x_m, patch.to_x_m, patch.reference_x_m),
                                                  _shown(patch.from_y_m, patch.to_y_m, 0.0))
        plate = replace(patch, from_x_m=from_x_m, to_x_m=to_x_m, from_y_m=from_y_m, to_y_m=to_y_m)
        plant.RegisterVisualGeometry(plant.world_body(), *box_under(plate, _THICKNESS_M), f"ground_{i}_{patch.name}",
                                     np.array(GROUND_COLOUR))


def _shown(start: float, end: float, about: float) -> tuple[float, float]:
    """From where to where (m) a patch from `start` to `end` is drawn."""
    middle = min(max(about, start), end)
    return max(start, middle - _SHOWN_M), min(end, middle + _SHOWN_M)
