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
from vsf_drake.motion.formats.recording import SIDES, Recording
from vsf_drake.motion.markers.gaps import LONGEST_GAP_S
from vsf_drake.motion.markers.joints import COORDINATES, coordinates_of
from vsf_drake.motion.markers.segments import SEGMENTS, Calibration, RigidPoses, SegmentMarkers, TrackedMotion
from vsf_drake.motion.markers.tracking import CUTOFF_HZ, describe, smooth_poses
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.motion.trial import reaching_pelvis
from vsf_drake.motion.trial_record import Trial
from vsf_drake.parameters import PELVIS_ROTATIONS, PELVIS_TRANSLATIONS, ModelParameters, leg_coordinates
from vsf_drake.plants.anthropometry import Body, scale_body
from vsf_drake.plants.solids import FORWARD, LEFTWARD, RIGHTWARD, UPWARD, add_chain, rotations, translations
from vsf_drake.sentences import say
from vsf_drake.simulation.stepping.tree import PRISMATIC, Tree, forward_kinematics, tree_of

INTACT_FOOT_WEIGHT, PROSTHETIC_FOOT_WEIGHT = 2.0, 0.1
LIMITS_DEG = {
    "pelvis_tilt": (-90, 90), "pelvis_list": (-60, 60), "hip_flexion": (-60, 150), "hip_adduction": (-70, 70),
    "hip_rotation": (-80, 80), "knee_angle": (-40, 170), "knee_adduction": (-40, 40), "knee_rotation": (-70, 70),
    "ankle_angle": (-80, 60), "ankle_adduction": (-70, 70), "ankle_rotation": (-70, 70)}
"""Beyond any joint's range (a choice); pelvis translations and rotation (the heading) have none."""
MOST_ITERATIONS = 50
SMALLEST_STEP = 1e-6
"""A solution has been reached when no coordinate moves by more (m, rad): a thousandth of what markers resolve."""
AT_LIMIT_RAD = 1e-4  # an interior-point solution stays this little short of an active limit, at most
LEVENBERG, MOST_LEVENBERG = 1e-7, 1e3


def refined(trial: Trial, *, cutoff_hz: float | None = CUTOFF_HZ, longest_gap_s: float = LONGEST_GAP_S) -> Trial:
    """`trial`, made from markers with this cut-off and longest gap, with the joint angles that fit all of them best.

    The feet stay where their own markers show them, and the pelvis is moved so that the prosthetic ankle is there, as
    for any trial from markers. What is said of the markers' quality (residuals, motion of clusters, joints that come
    apart) stays that of the segments' own poses, since joints that hold hide it. Refused where a frame is not solved.
    """
    tracked, calibration, recording = trial.tracked, trial.calibration, trial.recording
    if tracked is None or calibration is None or recording is None:
        raise InputError("inverse kinematics needs markers, and this trial has joint angles only", file=trial.path)
    calibration = dataclasses.replace(calibration, subject=trial.subject)
    motion, at_limit = solve_inverse_kinematics(recording, calibration, trial.model, cutoff_hz=cutoff_hz,
                                                longest_gap_s=longest_gap_s)
    distances = motion.residual_rms_m
    worst = max(distances, key=lambda label: distances[label])
    notes = say("import", "inverse_kinematics", rms_m=np.sqrt(np.mean(np.square(list(distances.values())))),
                worst=worst, worst_m=distances[worst], at_limit=at_limit)
    fitted = dataclasses.replace(tracked, values=motion.values, notes=(*tracked.notes, *notes))
    names = trial.trajectory.names
    columns = [tracked.names.index(name) for name in names]
    before, after = (reaching_pelvis(one, calibration, trial.subject)[0][:, columns] for one in (tracked, fitted))
    on_belt = trial.trajectory.values - before
    trajectory = CoordinateTrajectory(trial.trajectory.time_s, after + on_belt, names, source=trial.trajectory.source)
    return dataclasses.replace(trial, trajectory=trajectory, tracked=fitted, notes=(*trial.notes, *notes))


def solve_inverse_kinematics(
    recording: Recording, calibration: Calibration, model: ModelParameters, *, cutoff_hz: float | None,
    longest_gap_s: float
) -> tuple[TrackedMotion, tuple[str, ...]]:
    """The model's motion that fits all markers of `recording` best, and the coordinates that lie at a limit.

    Arguments as for `tracking.track`; the model's lengths enter the prosthetic leg.
    """
    filled, markers, poses = smooth_poses(recording, calibration, cutoff_hz=cutoff_hz, longest_gap_s=longest_gap_s)
    start = coordinates_of({name: pose.R_WB for name, pose in poses.items()}, poses["pelvis"].p_WB)
    body = make_marker_model(calibration, filled.segments, model)
    seen = np.stack([markers[label] for label in body.labels], axis=1)
    solver = _FrameSolver(body)
    values, success = np.empty_like(start), np.zeros(len(start), dtype=bool)
    for n, x in enumerate(seen):
        guess = start[n] if n == 0 or not success[n - 1] else values[n - 1] + start[n] - start[n - 1]
        values[n], success[n] = solver.solve(guess, x)
    failed = np.flatnonzero(~success)
    if failed.size:
        raise InputError(f"inverse kinematics failed in {failed.size} of {len(success)} frames, first at "
                         f"{', '.join(f'{t:.3f}' for t in filled.time_s[failed[:5]])} s", file=recording.path,
                         right="Look at the markers there, or use the segments' own poses")
    away = np.minimum(values - solver.low, solver.high - values).min(axis=0)
    at_limit = tuple(name for name, least in zip(COORDINATES, away, strict=True) if least < AT_LIMIT_RAD)
    motion = describe(calibration, filled, markers, body.rigid_poses(values, filled.segments, markers), values)
    return motion, at_limit


class _FrameSolver:
    """Bounded Gauss-Newton; one quadratic program, of which every step changes the numbers; `low`, `high`: (24,)."""

    def __init__(self, body: MarkerModel) -> None:
        self._body, self._root = body, np.sqrt(body.weights)
        bounds = [LIMITS_DEG.get(name.removesuffix("_r").removesuffix("_l"), (-np.inf, np.inf)) for name in COORDINATES]
        self.low, self.high = np.radians(np.array(bounds, dtype=float)).T
        n = len(COORDINATES)
        self._program = MathematicalProgram()
        self._step = self._program.NewContinuousVariables(n, "step")
        self._cost = self._program.AddQuadraticCost(np.eye(n), np.zeros(n), self._step, is_convex=True)
        self._bounds = self._program.AddBoundingBoxConstraint(self.low, self.high, self._step)
        self._solver = ClarabelSolver()

    def solve(self, guess: np.ndarray, seen: np.ndarray) -> tuple[np.ndarray, bool]:
        q, levenberg = np.clip(guess, self.low, self.high), LEVENBERG
        residual, jacobian = self._linearise(q, seen)
        for _ in range(MOST_ITERATIONS):
            # minimise |r + J s|^2 / 2 + levenberg |s|^2 / 2 over the step s, low - q <= s <= high - q
            hessian = jacobian.T @ jacobian + levenberg * np.eye(len(q))
            self._cost.evaluator().UpdateCoefficients(hessian, jacobian.T @ residual, is_convex=True)
            self._bounds.evaluator().set_bounds(self.low - q, self.high - q)
            result = self._solver.Solve(self._program, None, None)
            if not result.is_success():
                break

            # A step that makes things worse is not taken; the next one is shorter.
            step = np.clip(q + result.GetSolution(self._step), self.low, self.high) - q
            residual_there, jacobian_there = self._linearise(q + step, seen)
            small = bool(np.abs(step).max() < SMALLEST_STEP)
            if residual_there @ residual_there <= residual @ residual:
                q, residual, jacobian = q + step, residual_there, jacobian_there
                levenberg = max(levenberg / 10, LEVENBERG)
            elif not small:
                levenberg *= 10
            if small:
                return q, True
            if levenberg > MOST_LEVENBERG:
                break
        return q, False

    def _linearise(self, q: np.ndarray, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Weighted residual (3M,) and its Jacobian (3M, 24)."""
        p_WM, jacobian = self._body.markers(q)
        return ((p_WM - seen) * self._root[:, None]).ravel(), (jacobian * self._root[:, None, None]).reshape(-1, len(q))


# Markers on the model's segments: where they are for given coordinates, and how they move with them.


@dataclass(frozen=True, eq=False)
class MarkerModel:
    """M markers on the skeleton; coordinates q (24,) in the order of `COORDINATES`."""

    labels: tuple[str, ...]  # (M,)
    weights: np.ndarray  # (M,)
    p_BM: np.ndarray  # (M, 3) m in their segments' frames
    bodies: np.ndarray  # (M,) the tree's body of each marker
    segment_bodies: dict[str, int]  # the tree's body of each of `SEGMENTS`
    tree: Tree  # the skeleton's
    order: np.ndarray  # (24,) place in `COORDINATES` of each of the tree's coordinates

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

        # dp/dq_j: the axis of a sliding joint, axis x (p - origin) of a turning one; zero if it does not carry p.
        turned = np.cross(axes[None], p_WM[:, None, :] - origins[None])
        columns = np.where(sliding[None, :, None], axes[None], turned) * self.tree.ancestors[self.bodies][:, :, None]
        jacobian = np.empty((len(p_WM), 3, len(axes)))
        jacobian[:, :, self.order] = columns.transpose(0, 2, 1)
        return p_WM, jacobian

    def rigid_poses(self, values: np.ndarray, segments: Mapping[str, SegmentMarkers],
                    markers: Mapping[str, np.ndarray]) -> dict[str, RigidPoses]:
        """The model's segments over the frames (n, 24), with the distances of their markers."""
        rows = [self.poses(q)[:2] for q in values]
        R, p = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
        poses = {}
        for name, index in self.segment_bodies.items():
            fitted = segments[name].p_BM @ R[:, index].transpose(0, 2, 1) + p[:, index, None]
            seen = np.stack([markers[label] for label in segments[name].labels], axis=1)
            poses[name] = RigidPoses(R_WB=R[:, index], p_WB=p[:, index], known=np.ones(len(values), dtype=bool),
                                     residual_m=np.linalg.norm(fitted - seen, axis=2))
        return poses


def make_marker_model(calibration: Calibration, segments: Mapping[str, SegmentMarkers],
                      model: ModelParameters) -> MarkerModel:
    """The skeleton of the calibration's subject with the markers of `segments` on it."""
    side = calibration.subject.prosthetic_side
    plant = MultibodyPlant(0.0)
    bodies = _add_skeleton(plant, scale_body(calibration.subject, model.foot, model.socket), side,
                           calibration.segments[f"foot_{side}"].p_PB)
    plant.Finalize()
    tree = tree_of(plant, plant.CreateDefaultContext())
    index = {name: int(bodies[name].index()) for name in SEGMENTS}
    counts = [len(segments[name].labels) for name in SEGMENTS]
    weights = [1.0 if not name.startswith("foot") else PROSTHETIC_FOOT_WEIGHT if name.endswith(side) else
               INTACT_FOOT_WEIGHT for name in SEGMENTS]
    return MarkerModel(
        labels=tuple(label for name in SEGMENTS for label in segments[name].labels),
        weights=np.repeat(weights, counts), p_BM=np.concatenate([segments[name].p_BM for name in SEGMENTS]),
        bodies=np.repeat([index[name] for name in SEGMENTS], counts),
        segment_bodies=index, tree=tree, order=np.array([COORDINATES.index(name) for name in tree.coordinate_names]))


def _add_skeleton(plant: MultibodyPlant, body: Body, prosthetic_side: str, p_ShankAnkle: np.ndarray
                  ) -> dict[str, RigidBody]:
    """Adds the person's joints without mass, as `person.add_person` does, 24 coordinates; the bodies of `SEGMENTS`."""
    instance = plant.AddModelInstance("skeleton")
    bodies = {name: plant.AddRigidBody(name, instance, SpatialInertia.Zero()) for name in SEGMENTS}
    steps = translations(PELVIS_TRANSLATIONS, (FORWARD, UPWARD, RIGHTWARD))
    steps += rotations(PELVIS_ROTATIONS, mirrored=False)
    add_chain(plant, instance, plant.world_frame(), np.zeros(3), bodies["pelvis"], steps)
    for side in SIDES:
        intact, mirrored = side != prosthetic_side, side == "left"
        names = leg_coordinates(side, intact=True)
        thigh, shank, foot = (bodies[f"{kind}_{side}"] for kind in ("thigh", "shank", "foot"))
        hip = np.array([body.hip_forward, body.hip_lateral if mirrored else -body.hip_lateral, body.hip_up])
        knee = np.array([0.0, 0.0, -body.thigh(intact=intact)[-1]])
        # No marker set resolves how socket, pylon and foot bend: a shank of the measured length with an ankle, instead.
        ankle = np.array([0.0, 0.0, -body.shank_length]) if intact else p_ShankAnkle
        add_chain(plant, instance, bodies["pelvis"].body_frame(), hip, thigh, rotations(names[:3], mirrored))
        add_chain(plant, instance, thigh.body_frame(), knee, shank, rotations(names[3:6], mirrored, LEFTWARD))
        add_chain(plant, instance, shank.body_frame(), ankle, foot, rotations(names[6:], mirrored))
    return bodies
