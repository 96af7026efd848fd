"""Markers on the model's segments: where they are for given coordinates, and how they move with them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant

from vsf_drake.motion.markers.joint_angles import COORDINATES
from vsf_drake.motion.markers.schema import SEGMENTS, Calibration, SegmentMarkers
from vsf_drake.parameters import ModelParameters
from vsf_drake.plants.anthropometry import scale_body
from vsf_drake.plants.skeleton import add_skeleton
from vsf_drake.simulation.stepping.tree import PRISMATIC, Tree, forward_kinematics, tree_of


@dataclass(frozen=True, eq=False)
class MarkerModel:
    """M markers on the skeleton; coordinates q (24,) in the order of `COORDINATES`.

    Attributes:
        labels: (M,).
        p_BM: (M, 3) m, in their segments' frames.
        bodies: (M,) the tree's body of each marker.
        segment_bodies: the tree's body of each of `SEGMENTS`.
        tree: the skeleton's.
        order: (24,) place in `COORDINATES` of each of the tree's coordinates.
    """

    labels: tuple[str, ...]
    p_BM: np.ndarray
    bodies: np.ndarray
    segment_bodies: dict[str, int]
    tree: Tree
    order: np.ndarray

    def poses(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """R (B, 3, 3) and p (B, 3) of all bodies in W, joint axes and origins (24, 3), tree's order."""
        bodies, n = len(self.tree.body_names), self.tree.num_coordinates
        R, p, axes, origins = np.empty((bodies, 3, 3)), np.empty((bodies, 3)), np.empty((n, 3)), np.empty((n, 3))
        forward_kinematics(q[self.order], self.tree.links, self.tree.frames, R, p, axes, origins)
        return R, p, axes, origins

    def markers(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places (M, 3) m of the markers in W and their Jacobian (M, 3, 24) with respect to q."""
        R, p, axes, origins = self.poses(q)
        p_WM = p[self.bodies] + np.einsum("mij,mj->mi", R[self.bodies], self.p_BM)
        sliding = np.zeros(len(axes), dtype=bool)
        links = self.tree.links
        sliding[links[links[:, 0] == PRISMATIC, 3]] = True
        turned = np.cross(axes[None], p_WM[:, None, :] - origins[None])
        columns = np.where(sliding[None, :, None], axes[None], turned) * self.tree.ancestors[self.bodies][:, :, None]
        jacobian = np.empty((len(p_WM), 3, len(axes)))
        jacobian[:, :, self.order] = columns.transpose(0, 2, 1)
        return p_WM, jacobian


def make_marker_model(calibration: Calibration, segments: Mapping[str, SegmentMarkers],
                      model: ModelParameters) -> MarkerModel:
    """The skeleton of the calibration's subject with the markers of `segments` on it.

    Raises:
        InputError: see `anthropometry.scale_body`.
    """
    side = calibration.subject.prosthetic_side
    plant = MultibodyPlant(0.0)
    bodies = add_skeleton(plant, scale_body(calibration.subject, model.foot, model.socket), prosthetic_side=side,
                          p_ShankAnkle=calibration.segments[f"foot_{side}"].p_PB)
    plant.Finalize()
    tree = tree_of(plant, plant.CreateDefaultContext())
    index = {name: int(bodies[name].index()) for name in SEGMENTS}
    return MarkerModel(
        labels=tuple(label for name in SEGMENTS for label in segments[name].labels),
        p_BM=np.concatenate([segments[name].p_BM for name in SEGMENTS]),
        bodies=np.concatenate([np.full(len(segments[name].labels), index[name]) for name in SEGMENTS]),
        segment_bodies=index, tree=tree, order=np.array([COORDINATES.index(name) for name in tree.coordinate_names]))
