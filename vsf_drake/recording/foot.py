"""How feet moved and when they stood flat: as markers saw them, and on the model's person."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex

from vsf_drake.model.parameters import ModelParameters, Subject
from vsf_drake.motion.events import Stance, longest_run
from vsf_drake.motion.manifest import GeometricOffsets, mount_of
from vsf_drake.motion.markers.segments import FootTrack
from vsf_drake.motion.trajectory import CoordinateTrajectory
from vsf_drake.plants.foot import set_mount, sole_height
from vsf_drake.plants.person import PersonHandles, add_person

# of a flat sole from its usual angle in mid-stance (a choice): 3 mm at the foot's middle
FLAT_RAD = np.radians(1.5)
# shares of stance in which every foot is flat: forefoot down, heel not yet rising
MIDDLE = (0.25, 0.45)
SEARCH = (0.10, 0.70)  # shares of stance in which flat instants are looked for
# a foot that turns by more in `MIDDLE` does not stand (a choice: twice `FLAT_RAD`)
TURNS_RAD = np.radians(3.0)
# a foot that keeps its angle for less (a prosthesis under a turning shank): over `MIDDLE`
SHORTEST_FLAT_S = 0.10
FEWEST_FRAMES = 3
SLACK_S = 0.05  # by which mid-stance may reach over an end of the record (a choice: a third of it)
# heel to ball as a share of the foot's length, on which the heel turns when it rises (a usual
# figure)
BALL = 0.7


@dataclass(frozen=True, eq=False, kw_only=True)
class FootMotion(FootTrack):
    """One foot over time, heel and toe on the sole and equally high when it is flat; `undeformed`
    if it was put under the shank as a rigid body, or has its markers on a part that turns with the
    shank, where the sole of a prosthetic foot bends and stays flat."""

    side: str
    time_s: np.ndarray  # (n,) evenly spaced
    lowest_m: np.ndarray  # (n,) height of the foot's lowest point
    prosthetic: bool = False
    undeformed: bool = False
    left_W: np.ndarray | None = None
    """(n, 3) unit vectors across the sole, to the left; None where it is not known"""

    @property
    def roll_rad(self) -> np.ndarray | None:
        """(n,) angle of the sole against the floor about the foot's length, inversion (medial edge
        up) +."""
        if self.left_W is None:
            return None
        return np.asarray((1.0 if self.side == "right" else -1.0) * np.arcsin(self.left_W[:, 2]))

    @property
    def pitch_rad(self) -> np.ndarray:
        """(n,) angle of the sole against the floor, toe up +."""
        along = self.toe_W - self.heel_W
        return np.asarray(np.arctan2(along[:, 2], np.hypot(along[:, 0], along[:, 1])))

    @property
    def yaw_rad(self) -> np.ndarray:
        """(n,) direction from heel to toe on the floor, from x to the left +."""
        along = self.toe_W - self.heel_W
        return np.asarray(np.unwrap(np.arctan2(along[:, 1], along[:, 0])))

    @property
    def height_m(self) -> np.ndarray:
        """(n,) height of the middle of the sole."""
        return np.asarray(0.5 * (self.heel_W[:, 2] + self.toe_W[:, 2]))

    @property
    def ball_m(self) -> np.ndarray:
        """(n,) height of the sole under the ball of the foot."""
        return (1.0 - BALL) * self.heel_W[:, 2] + BALL * self.toe_W[:, 2]

    def rows(self, start_s: float, end_s: float) -> np.ndarray:
        """(n,) bool: the frames from `start_s` to `end_s`."""
        return (self.time_s >= start_s) & (self.time_s <= end_s)


def shares_of(stance: Stance, share: tuple[float, float]) -> tuple[float, float]:
    """The instants (s) at two shares of a stance."""
    return stance.start_s + share[0] * stance.duration_s, stance.start_s + share[
        1
    ] * stance.duration_s


def _whole(stance: Stance, usual_s: float | None) -> Stance | None:
    """The stance with the end that the record cuts placed so that it lasts `usual_s`; None where
    that is unknown."""
    if stance.complete:
        return stance
    if usual_s is None or not (stance.start_seen or stance.end_seen):
        return None
    if stance.start_seen:
        return Stance(stance.start_s, max(stance.end_s, stance.start_s + usual_s))
    return Stance(min(stance.start_s, stance.end_s - usual_s), stance.end_s)


def flat_phase(
    foot: FootMotion, stance: Stance, *, usual_s: float | None = None
) -> np.ndarray | None:
    """Indices of the frames in which the foot stands flat in `stance`: the longest run within
    1.5 degrees of the sole's usual angle in mid-stance; mid-stance for a foot that keeps none; None
    if that is not in the record."""
    laid_out = _whole(stance, usual_s)
    if laid_out is None:
        return None
    start, end = shares_of(laid_out, MIDDLE)
    middle = np.flatnonzero(foot.rows(start, end))
    if (
        foot.time_s[0] > start + SLACK_S
        or foot.time_s[-1] < end - SLACK_S
        or len(middle) < FEWEST_FRAMES
    ):
        return None
    pitch = foot.pitch_rad
    usual = float(np.median(pitch[middle]))
    longest = longest_run(
        foot.rows(*shares_of(laid_out, SEARCH)) & (np.abs(pitch - usual) < FLAT_RAD)
    )
    if (
        len(longest) < FEWEST_FRAMES
        or foot.time_s[longest[-1]] - foot.time_s[longest[0]] < SHORTEST_FLAT_S
    ):
        return middle
    return longest


def flat_phases(
    foot: FootMotion, stances: Sequence[Stance], *, usual_s: float | None = None
) -> dict[int, np.ndarray]:
    """By number of the stance, from 1, what `flat_phase` finds; without those in which it finds
    nothing."""
    found = {
        number: flat_phase(foot, stance, usual_s=usual_s)
        for number, stance in enumerate(stances, start=1)
    }
    return {number: rows for number, rows in found.items() if rows is not None}


def turns_in_stance(
    foot: FootMotion, stances: Sequence[Stance], *, usual_s: float | None = None
) -> bool:
    """Whether the foot keeps turning through mid-stance, as markers on the stiff part of a bending
    foot do; a stance that the record cuts counts if its mid-stance is there, laid out to last
    `usual_s`."""
    middles = [
        shares_of(laid_out, MIDDLE)
        for stance in stances
        if (laid_out := _whole(stance, usual_s)) is not None
    ]
    ranges = [
        float(np.ptp(foot.pitch_rad[rows]))
        for start, end in middles
        if foot.time_s[0] <= start
        and end <= foot.time_s[-1]
        and (rows := foot.rows(start, end)).any()
    ]
    return bool(ranges) and float(np.median(ranges)) > TURNS_RAD


def slip_velocity(foot: FootMotion, point_W: np.ndarray) -> np.ndarray:
    """(n, 2) horizontal velocity (m/s) of that part of the foot, taken as rigid, which is at
    `point_W` (n, 3): with the centre of pressure as point the slip of the sole under the load. NaN
    where the point is."""
    # A rigid frame at the heel, x to the toe, y left; v_point = v_heel + R_dot p, p the point in
    # that frame.
    x = foot.toe_W - foot.heel_W
    x = x / np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(foot.ankle_W - foot.heel_W, x)
    y = y / np.linalg.norm(y, axis=1, keepdims=True)
    R = np.stack([x, y, np.cross(x, y)], axis=2)
    fixed = np.einsum("nji,nj->ni", R, np.asarray(point_W) - foot.heel_W)
    R_dot = np.gradient(R, foot.time_s, axis=0)
    v = np.gradient(foot.heel_W, foot.time_s, axis=0)
    return np.asarray((v + np.einsum("nij,nj->ni", R_dot, fixed))[:, :2])


def floor_point(foot: FootMotion) -> np.ndarray:
    """(n, 3) m: the floor under the middle of the sole."""
    middle = 0.5 * (foot.heel_W + foot.toe_W)
    return np.column_stack([middle[:, :2], np.zeros(len(middle))])


# Where the model's feet and centre of mass are while its person follows a recording, the prosthesis
# as a rigid body: its toe and heel go "into" the floor here by as much as the device would give.


def model_motion(
    subject: Subject,
    model: ModelParameters,
    trajectory: CoordinateTrajectory,
    *,
    offsets: GeometricOffsets | None = None,
) -> tuple[dict[str, FootMotion], CoordinateTrajectory]:
    """The feet of the model's person by side, and the body's centre of mass (x, y, z in W, m), at
    the trajectory's instants. `lowest_m` is that of the contact spheres; the heel and toe of the
    prosthesis, which sits under the person with these offsets, are those of its flat sole below its
    rearmost and foremost sphere."""
    plant = MultibodyPlant(0.0)
    person = add_person(plant, subject, model)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    if offsets is not None:
        set_mount(context, person.foot, **mount_of(offsets))
    prosthetic = subject.prosthetic_side
    intact = "left" if prosthetic == "right" else "right"
    points = {prosthetic: _prosthetic(person), intact: _intact(person, model, intact)}
    motion = trajectory.ordered(person.coordinate_names)
    columns = [plant.GetJointByName(name).position_start() for name in motion.names]
    q: np.ndarray = np.zeros(plant.num_positions())
    bodies = sorted({int(body) for of_foot, _, _ in points.values() for body in of_foot})
    centre = np.empty((len(motion.time_s), 3))
    poses = np.empty((len(motion.time_s), len(bodies), 3, 4))
    for i, row in enumerate(motion.values):
        q[columns] = row
        plant.SetPositions(context, q)
        centre[i] = plant.CalcCenterOfMassPositionInWorld(context)
        poses[i] = [
            plant.EvalBodyPoseInWorld(context, plant.get_body(BodyIndex(body))).GetAsMatrix34()
            for body in bodies
        ]
    feet = {}
    for side, (of_foot, p_BP, radius) in points.items():
        X = poses[:, [bodies.index(int(body)) for body in of_foot]]
        place = np.einsum("nkij,kj->nki", X[..., :3], p_BP) + X[..., 3]
        feet[side] = FootMotion(
            place[:, 0],
            place[:, 1],
            place[:, 2],
            side=side,
            time_s=motion.time_s,
            lowest_m=(place[:, 3:, 2] - radius).min(axis=1),
            prosthetic=side == prosthetic,
            undeformed=side == prosthetic,
            left_W=X[:, 0, :, 1],
        )
    return feet, CoordinateTrajectory(motion.time_s, centre, ("x", "y", "z"), source=motion.source)


_Points = tuple[list[BodyIndex], np.ndarray, np.ndarray]
"""Of one foot: bodies, and places in them (k, 3): heel, toe, ankle, and the spheres, whose radii
are the third."""


def _prosthetic(person: PersonHandles) -> _Points:
    parameters = person.foot.parameters
    sites = person.foot.sites
    x = [1e-3 * value for zone in parameters.zones for value in zone.x_mm]
    sole = sole_height(parameters)
    frame = person.foot.frame.index()
    points = [
        [min(x), 0.0, sole],
        [max(x), 0.0, sole],
        [parameters.pylon_x_m, 0.0, sole + parameters.build_height_m],
    ]
    return [frame] * 3 + list(sites.body_indices), np.vstack([points, sites.p_BS]), sites.radius


def _intact(person: PersonHandles, model: ModelParameters, side: str) -> _Points:
    body = person.body
    sites = person.intact_sites
    rear = -model.intact_foot.ankle_x_ratio * body.foot_length
    points = [
        [rear, 0.0, -body.ankle_height],
        [rear + body.foot_length, 0.0, -body.ankle_height],
        [0.0, 0.0, 0.0],
    ]
    return (
        [person.segments[f"foot_{side}"].index()] * 3 + list(sites.body_indices),
        np.vstack([points, sites.p_BS]),
        sites.radius,
    )
