"""What a station looks like: a SceneGraph beside it, exported as `query`, and Meshcat where one is given."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydrake.geometry import Box, Meshcat, MeshcatVisualizer, SceneGraph
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.rendering import MultibodyPositionToGeometryPose

from vsf_drake.ground import Ground, GroundPatch

GROUND_COLOUR = (0.72, 0.70, 0.66, 1.0)
_SHOWN_M, _THICKNESS_M = 3.0, 0.02


def show(builder: DiagramBuilder, scene_graph: SceneGraph, meshcat: Meshcat | None) -> None:
    """Exports `query` of `scene_graph`, and shows it where there is a `meshcat`."""
    builder.ExportOutput(scene_graph.get_query_output_port(), "query")
    if meshcat is not None:
        MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)


def draw_twin(
    builder: DiagramBuilder, build: Callable[[MultibodyPlant], None], state: OutputPort, meshcat: Meshcat | None
) -> MultibodyPlant:
    """Draws a plant that has no shapes by a twin that has them and takes its `state`, without a part in the physics.

    Args:
        build: adds the bodies, in the plant's own order, and their shapes.
    """
    scene_graph = builder.AddNamedSystem("scene_graph", SceneGraph())
    twin = MultibodyPlant(0.0)
    twin.RegisterAsSourceForSceneGraph(scene_graph)
    build(twin)
    twin.Finalize()
    poses = builder.AddNamedSystem("drawn_poses", MultibodyPositionToGeometryPose(twin, input_multibody_state=True))
    builder.Connect(state, poses.get_input_port())
    builder.Connect(poses.get_output_port(), scene_graph.get_source_pose_port(twin.get_source_id()))
    show(builder, scene_graph, meshcat)
    return twin


def draw_ground(plant: MultibodyPlant, ground: Ground | None) -> None:
    """Gives the world a plate for each patch of `ground` (None: the plane z = 0), cut off 3 m from its middle."""
    for i, patch in enumerate((ground or Ground()).patches):
        plant.RegisterVisualGeometry(plant.world_body(), *_plate(patch), f"ground_{i}_{patch.name}",
                                     np.array(GROUND_COLOUR))


def _plate(patch: GroundPatch) -> tuple[RigidTransform, Box]:
    x = np.clip([patch.from_x_m, patch.to_x_m], patch.reference_x_m - _SHOWN_M, patch.reference_x_m + _SHOWN_M)
    y = np.clip([patch.from_y_m, patch.to_y_m], -_SHOWN_M, _SHOWN_M)
    slope, bank = np.tan(np.radians([patch.slope_deg, patch.bank_deg]))
    middle = np.array([x.mean(), y.mean(), 0.0])
    middle[2] = patch.height_m + slope * (middle[0] - patch.reference_x_m) + bank * middle[1]
    along = np.array([1.0, 0.0, slope]) / np.hypot(1.0, slope)
    normal = np.array([-slope, -bank, 1.0]) / np.sqrt(1.0 + slope**2 + bank**2)
    R_WG = RotationMatrix(np.column_stack((along, np.cross(normal, along), normal)))
    size = np.maximum([np.ptp(x) * np.hypot(1.0, slope), np.ptp(y) * np.hypot(1.0, bank)], 1e-3)
    return RigidTransform(R_WG, middle - 0.5 * _THICKNESS_M * normal), Box(*size, _THICKNESS_M)
