"""Global inverse kinematics: the pose of the whole model that fits all markers of a frame best.

In each frame n, over the 24 coordinates q of pelvis and both legs with the model's own joints and segment lengths:

    minimise    sum_m w_m |p_m(q) - x_m(n)|^2        p_m: marker m on its segment of the model, x_m: where it was seen
    subject to  q_low <= q <= q_high                 wide: what no joint reaches, against mirrored solutions

(Lu & O'Connor 1999, doi 10.1016/S0021-9290(98)00158-4). Unlike `motion.markers.tracking`, whose segments may come
apart, the joints hold here, and skin motion of one segment is shared out to its neighbours. Markers are filled, checked
and filtered as there, and its angles start the solver: the first frame at them, every next one at the last solution
plus their change. A frame is solved by Gauss-Newton steps, each a quadratic program in Drake's `MathematicalProgram`
with the limits as bounds and a Levenberg term that shortens steps which make things worse (it acts on the step only, so
it moves no solution).

Markers of the intact foot count double, since the foot's height above the floor decides the contact force. Those of the
prosthetic foot count a tenth: it bends, and the skeleton gives it an ankle of its own, so it hardly informs the shank.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia
from pydrake.solvers import ClarabelSolver, MathematicalProgram

from vsf_drake.errors import InputError
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.motion.from_markers import reaching_pelvis
from vsf_drake.motion.markers.gaps import LONGEST_GAP_S
from vsf_drake.motion.markers.joint_angles import COORDINATES, coordinates_of
from vsf_drake.motion.markers.poses import RigidPoses
from vsf_drake.motion.markers.schema import SEGMENTS, Calibration, SegmentMarkers, TrackedMotion
from vsf_drake.motion.markers.tracking import CUTOFF_HZ, describe, smooth_poses
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.trial import Trial
from vsf_drake.parameters import ModelParameters
from vsf_drake.plants.anthropometry import Body, scale_body
from vsf_drake.plants.person import PELVIS_COORDINATES, leg_coordinates
from vsf_drake.plants.solids import FORWARD, LEFTWARD, RIGHTWARD, UPWARD, add_chain, rotations, translations
from vsf_drake.simulation.stepping.tree import PRISMATIC, Tree, forward_kinematics, tree_of

INTACT_FOOT_WEIGHT, PROSTHETIC_FOOT_WEIGHT, OTHER_WEIGHT = 2.0, 0.1, 1.0
LIMITS_DEG = {
    "pelvis_tilt": (-90, 90), "pelvis_list": (-60, 60), "hip_flexion": (-60, 150), "hip_adduction": (-70, 70),
    "hip_rotation": (-80, 80), "knee_angle": (-40, 170), "knee_adduction": (-40, 40), "knee_rotation": (-70, 70),
    "ankle_angle": (-80, 60), "ankle_adduction": (-70, 70), "ankle_rotation": (-70, 70)}
"""Beyond any joint's range (a choice); pelvis translations and rotation (the heading) have none."""
MOST_ITERATIONS = 50
SMALLEST_STEP = 1e-6
"""A solution has been reached when no coordinate moves by more (m, rad): a thousandth of what markers resolve."""
AT_LIMIT_RAD = 1e-4
"""An interior-point solution stays this little short of an active limit, at most."""
LEVENBERG, MOST_LEVENBERG = 1e-7, 1e3
MOST_LISTED = 5


@dataclass(frozen=True, eq=False)
class InverseKinematics:
    """What the solver made of a trial.

    Attributes:
        success: (frames,) bool.
        iterations: (frames,) Gauss-Newton steps.
        cost_m2: (frames,) weighted squared distance.
        at_limit: names of coordinates that lie at a limit in some frame.
        attempted: the motion, whether it succeeded or not; read `motion`.
    """

    success: np.ndarray
    iterations: np.ndarray
    cost_m2: np.ndarray
    at_limit: tuple[str, ...]
    attempted: TrackedMotion

    @property
    def motion(self) -> TrackedMotion:
        """The motion.

        Raises:
            InputError: a frame failed.
        """
        failed = np.flatnonzero(~self.success)
        if failed.size:
            times = ", ".join(f"{t:.3f}" for t in self.attempted.time_s[failed[:MOST_LISTED]])
            raise InputError(f"inverse kinematics failed in {failed.size} of {len(self.success)} frames, first at "
                             f"{times} s", right="Look at the markers there, or use the segments' own poses")
        return self.attempted


def solve_inverse_kinematics(
    recording: Recording, calibration: Calibration, model: ModelParameters | None = None, *,
    cutoff_hz: float | None = CUTOFF_HZ, longest_gap_s: float = LONGEST_GAP_S,
    weights: Mapping[str, float] | None = None,
) -> InverseKinematics:
    """The model's motion that fits all markers of `recording` best.

    Args:
        recording: the walk.
        calibration: from the standing trial of the same session.
        model: the device, whose lengths enter the prosthetic leg.
        cutoff_hz, longest_gap_s: as for `tracking.track`.
        weights: of single markers, instead of their segment's.

    Raises:
        InputError: as for `tracking.track`; a weight is of no marker, or not positive.
    """
    filled, markers, times, poses = smooth_poses(
        recording, calibration, cutoff_hz=cutoff_hz, longest_gap_s=longest_gap_s)
    start = coordinates_of({name: pose.R_WB for name, pose in poses.items()}, poses["pelvis"].p_WB)
    body = make_marker_model(calibration, filled.segments, model or ModelParameters())
    w = marker_weights(filled.segments, calibration.subject.prosthetic_side, weights)
    seen = np.stack([markers[label] for label in body.labels], axis=1)
    solver = _FrameSolver(body, np.array([w[label] for label in body.labels]))
    values, iterations = np.empty_like(start), np.zeros(len(start), dtype=int)
    success, cost = np.zeros(len(start), dtype=bool), np.empty(len(start))
    for n, x in enumerate(seen):
        guess = start[n] if n == 0 or not success[n - 1] else values[n - 1] + start[n] - start[n - 1]
        values[n], cost[n], iterations[n], success[n] = solver.solve(guess, x)
    at_limit = tuple(name for k, name in enumerate(COORDINATES)
                     if np.minimum(values[:, k] - solver.low[k], solver.high[k] - values[:, k]).min() < AT_LIMIT_RAD)
    notes = [f"{name} lies at the limit of inverse kinematics" for name in at_limit]
    motion = describe(calibration, filled, markers, times, _poses(body, filled.segments, markers, values), values,
                      notes=("angles are from global inverse kinematics", *notes))
    return InverseKinematics(success=success, iterations=iterations, cost_m2=cost, at_limit=at_limit, attempted=motion)


def marker_weights(segments: Mapping[str, SegmentMarkers], prosthetic_side: str,
                   stated: Mapping[str, float] | None = None) -> dict[str, float]:
    """The weight of every marker by label.

    Raises:
        InputError: `stated` has a label that is on no segment, or a weight that is not positive.
    """
    weights: dict[str, float] = {}
    for name, segment in segments.items():
        weight = OTHER_WEIGHT
        if name.startswith("foot"):
            weight = PROSTHETIC_FOOT_WEIGHT if name.endswith(prosthetic_side) else INTACT_FOOT_WEIGHT
        weights |= dict.fromkeys(segment.labels, weight)
    for label, weight in (stated or {}).items():
        if label not in weights:
            raise InputError(f"no segment has a marker {label}", where="weights",
                             right=f"There are: {', '.join(weights)}")
        if not (np.isfinite(weight) and weight > 0):
            raise InputError(f"the weight {weight:g} is not positive", where=f"weights.{label}")
        weights[label] = weight
    return weights


class _FrameSolver:
    """Bounded Gauss-Newton; one quadratic program, of which every step changes the numbers.

    Attributes:
        low, high: (24,) the limits.
    """

    def __init__(self, body: MarkerModel, weights: np.ndarray) -> None:
        self._body, self._root = body, np.sqrt(weights)
        bounds = [LIMITS_DEG.get(name.removesuffix("_r").removesuffix("_l"), (-np.inf, np.inf)) for name in COORDINATES]
        self.low, self.high = np.radians(np.array(bounds, dtype=float)).T
        n = len(COORDINATES)
        self._program = MathematicalProgram()
        self._step = self._program.NewContinuousVariables(n, "step")
        self._cost = self._program.AddQuadraticCost(np.eye(n), np.zeros(n), self._step, is_convex=True)
        self._bounds = self._program.AddBoundingBoxConstraint(self.low, self.high, self._step)
        self._solver = ClarabelSolver()

    def solve(self, guess: np.ndarray, seen: np.ndarray) -> tuple[np.ndarray, float, int, bool]:
        """Coordinates, cost (m^2), iterations and success for one frame's markers (M, 3)."""
        q, levenberg = np.clip(guess, self.low, self.high), LEVENBERG
        residual, jacobian = self._linearise(q, seen)
        cost = float(residual @ residual)
        for iteration in range(1, MOST_ITERATIONS + 1):
            hessian = jacobian.T @ jacobian + levenberg * np.eye(len(q))
            self._cost.evaluator().UpdateCoefficients(hessian, jacobian.T @ residual, is_convex=True)
            self._bounds.evaluator().set_bounds(self.low - q, self.high - q)
            result = self._solver.Solve(self._program, None, None)
            if not result.is_success():
                return q, cost, iteration, False
            step = np.clip(q + result.GetSolution(self._step), self.low, self.high) - q
            residual_there, jacobian_there = self._linearise(q + step, seen)
            cost_there = float(residual_there @ residual_there)
            small = bool(np.abs(step).max() < SMALLEST_STEP)
            if cost_there <= cost:
                q, cost, residual, jacobian = q + step, cost_there, residual_there, jacobian_there
                levenberg = max(levenberg / 10, LEVENBERG)
            elif not small:
                levenberg *= 10
            if small:
                return q, cost, iteration, True
            if levenberg > MOST_LEVENBERG:
                break
        return q, cost, iteration, False

    def _linearise(self, q: np.ndarray, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Weighted residual (3M,) and its Jacobian (3M, 24)."""
        p_WM, jacobian = self._body.markers(q)
        return ((p_WM - seen) * self._root[:, None]).ravel(), (jacobian * self._root[:, None, None]).reshape(-1, len(q))


def _poses(body: MarkerModel, segments: Mapping[str, SegmentMarkers], markers: Mapping[str, np.ndarray],
           values: np.ndarray) -> dict[str, RigidPoses]:
    """The model's segments, with the distances of their markers."""
    rows = [body.poses(q)[:2] for q in values]
    R, p = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
    poses = {}
    for name, index in body.segment_bodies.items():
        fitted = segments[name].p_BM @ R[:, index].transpose(0, 2, 1) + p[:, index, None]
        seen = np.stack([markers[label] for label in segments[name].labels], axis=1)
        poses[name] = RigidPoses(R_WB=R[:, index], p_WB=p[:, index], found=np.ones(len(values), dtype=bool),
                                 residual_m=np.linalg.norm(fitted - seen, axis=2))
    return poses


# Markers on the model's segments: where they are for given coordinates, and how they move with them.


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


# A trial from markers with the angles of global inverse kinematics instead of the segments' own.


def refined(trial: Trial, *, cutoff_hz: float | None = CUTOFF_HZ, longest_gap_s: float = LONGEST_GAP_S,
            weights: Mapping[str, float] | None = None) -> Trial:
    """`trial` with the joint angles that fit all its markers best with joints that hold.

    The feet stay where their own markers show them, and the pelvis is moved so that the prosthetic ankle is there, as
    for any trial from markers. What is said of the markers' quality (residuals, motion of clusters, joints that come
    apart) stays that of the segments' own poses, since joints that hold hide it.

    Args:
        trial: made from markers (`from_markers`), with the same cut-off and longest gap.
        cutoff_hz, longest_gap_s, weights: see `solve_inverse_kinematics`.

    Raises:
        InputError: the trial has no markers; see `solve_inverse_kinematics`; a frame was not solved.
    """
    tracked, calibration, recording = trial.tracked, trial.calibration, trial.recording
    if tracked is None or calibration is None or recording is None:
        raise InputError("inverse kinematics needs markers, and this trial has joint angles only", file=trial.path)
    calibration = dataclasses.replace(calibration, subject=trial.subject)
    solution = solve_inverse_kinematics(recording, calibration, trial.model, cutoff_hz=cutoff_hz,
                                        longest_gap_s=longest_gap_s, weights=weights)
    motion = solution.motion
    distances = motion.residual_rms_m
    worst = max(distances, key=lambda label: distances[label])
    note = (f"Angles are from global inverse kinematics, which leaves the markers "
            f"{1e3 * np.sqrt(np.mean(np.square(list(distances.values())))):.1f} mm (RMS) from the model, "
            f"most {worst} with {1e3 * distances[worst]:.1f} mm.")
    limits = tuple(f"{name} lies at the limit of inverse kinematics." for name in solution.at_limit)
    fitted = dataclasses.replace(tracked, values=motion.values, notes=(*tracked.notes, note, *limits))
    names = trial.trajectory.names
    columns = [tracked.names.index(name) for name in names]
    before, after = (reaching_pelvis(one, calibration, trial.subject)[0][:, columns] for one in (tracked, fitted))
    on_belt = trial.trajectory.values - before
    trajectory = CoordinateTrajectory(trial.trajectory.time_s, after + on_belt, names, source=trial.trajectory.source)
    return dataclasses.replace(trial, trajectory=trajectory, tracked=fitted, notes=(*trial.notes, note, *limits))


# The person's joints without mass: what markers are fitted to. Both legs end in a foot with an ankle of its own.
#
# Joints, their order, axes and places are those of `person.add_person`, made by the same functions. Only the prosthetic
# side differs below the knee: there the model has socket, pylon and foot, whose bending no marker set resolves, and the
# skeleton has a shank of the measured length with an ankle, so that a foot that deforms need not turn its shank.


SIDES = ("right", "left")


def add_skeleton(plant: MultibodyPlant, body: Body, *, prosthetic_side: str,
                 p_ShankAnkle: np.ndarray) -> dict[str, RigidBody]:
    """Adds the seven segments and their 24 coordinates; returns the bodies by the names of `markers.schema.SEGMENTS`.

    Args:
        plant: not yet finalized.
        body: the scaled person.
        prosthetic_side: "right" or "left".
        p_ShankAnkle: (3,) m, where the prosthetic side has its ankle in the shank's frame.
    """
    instance = plant.AddModelInstance("skeleton")

    def segment(name: str) -> RigidBody:
        return plant.AddRigidBody(name, instance, SpatialInertia.Zero())

    bodies = {"pelvis": segment("pelvis")}
    steps = translations(PELVIS_COORDINATES[:3], (FORWARD, UPWARD, RIGHTWARD))
    steps += rotations(PELVIS_COORDINATES[3:], mirrored=False)
    add_chain(plant, instance, plant.world_frame(), np.zeros(3), bodies["pelvis"], steps)
    for side in SIDES:
        intact, mirrored = side != prosthetic_side, side == "left"
        names = leg_coordinates(side, intact=True)
        thigh, shank, foot = (segment(f"{kind}_{side}") for kind in ("thigh", "shank", "foot"))
        hip = np.array([body.hip_forward, body.hip_lateral if mirrored else -body.hip_lateral, body.hip_up])
        knee = np.array([0.0, 0.0, -body.thigh_length_of(intact=intact)])
        ankle = np.array([0.0, 0.0, -body.shank_length]) if intact else np.asarray(p_ShankAnkle, dtype=float)
        add_chain(plant, instance, bodies["pelvis"].body_frame(), hip, thigh, rotations(names[:3], mirrored))
        add_chain(plant, instance, thigh.body_frame(), knee, shank, rotations(names[3:6], mirrored, LEFTWARD))
        add_chain(plant, instance, shank.body_frame(), ankle, foot, rotations(names[6:], mirrored))
        bodies |= {f"thigh_{side}": thigh, f"shank_{side}": shank, f"foot_{side}": foot}
    return bodies
