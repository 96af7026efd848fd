"""The tier `session`: what a laboratory would have recorded of a true person on one day, errors of
measurement and all.

Errors belong to segments, as markers do: an angle's error is the difference of its two segments',
so that what the thigh's markers get wrong is in hip and knee, and the shank below does not see it.
Sizes are standard deviations of `data/published` (see there which of them are choices); a segment
takes what the angles above it leave: thigh² = hip² - pelvis², shank² = knee² - thigh², so that
every angle has its published size. Drawn for each session: markers placed anew, the shape of soft
tissue's sway, joint centres, lengths and mass, the plates' places. For each trial: a constant, a
slow error, the size of the sway. The prosthesis is measured as `vsf-drake import` does, standing:
how its foot sits is told in the shank's axes as they were found, which takes a constant error of
that shank out again.

Everything is of a person with the prosthesis on the right; `writing` mirrors one who has it on the
left.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from virtual_laboratory.motion import COORDINATES
from virtual_laboratory.placing import MARGIN_S
from virtual_laboratory.recording import Foot, Recorded, in_degrees, in_radians
from virtual_laboratory.tiers import Tier, measured
from vsf_drake.model.parameters import (
    PELVIS_TRANSLATIONS,
    FootParameters,
    SocketParameters,
    Subject,
)
from vsf_drake.motion.formats.recording import world_to_os
from vsf_drake.motion.markers.joints import COORDINATES as BOTH_ANKLES
from vsf_drake.motion.markers.joints import coordinates_of, joint_angles, orientations_of
from vsf_drake.motion.markers.segments import PARENTS
from vsf_drake.plants.anthropometry import Body, foot_placement, scale_body

PUBLISHED = Path(__file__).resolve().parents[2] / "data" / "published"
ANGLES = {
    "pelvis": ("pelvis_list", "pelvis_tilt", "pelvis_rotation"),
    "thigh": ("hip_adduction", "hip_flexion", "hip_rotation"),
    "shank": ("knee_adduction", "knee_angle", "knee_rotation"),
    "foot": ("", "ankle_angle", ""),
}
"""By kind of segment, the angles that it closes: about its axes forward, left and up. The published
tables have no other angle of the ankle."""
ZEROED = tuple(
    f"{name}_{side}"
    for name in ("hip_rotation", "knee_adduction", "knee_rotation")
    for side in "rl"
)
"""Whose mean over the walk is taken off: crosstalk of the knee's axis makes their zero doubtful,
and laboratories that do not trust it report the change alone. The prosthetic foot's inversion is
left out of the subject's file likewise."""
HARMONICS = 3
PARTS = 3
"""The variance between trials in equal parts (a choice): the person's own, which the plates see
too; a constant error of the trial; a slow one within it. The first is not an error, and is in the
walks already."""
SWAY_SPREAD = 0.2
"""Standard deviation, from trial to trial, of the sway's size over its mean (a choice)."""
SLOW_WAVES = 4
"""Half periods of the slowest to the fastest part of a slow error over the recording: 1 to 4."""
KNEE_M, ANKLE_M, PLACE_M, FOOT_DEG = 5e-3, 5e-3, 2e-3, 1.0
"""Standard deviations along each axis (choices): of knee and ankle centres, of heel and sole of the
prosthetic foot in the shank, of that foot's turns (3 mm over 0.17 m from heel to forefoot
marker)."""
MASS_KG, STATURE_M, FOOT_LENGTH_M = 0.3, 5e-3, 3e-3
"""Standard deviations (choices) of scales with clothes on, of the stadiometer, of a caliper over
the shoe."""
MARKED_M = 0.4e-3
"""Of the prosthetic ankle's place, constant and slow error of a trial, each axis: markers on a
rigid shell, as in the laboratory tier."""
DECIMALS = 5
"""Of m and degrees."""


@dataclass(frozen=True)
class Sizes:
    """Standard deviations: of angles in rad by kind of segment, (3,) about its axes; of lengths in
    m.

    Attributes:
        between_sessions, between_trials, sway: by kind of segment.
        hip_centre_m: along each axis of the pelvis. plate_m: of a plate's place, each axis.
    """

    between_sessions: dict[str, np.ndarray]
    between_trials: dict[str, np.ndarray]
    sway: dict[str, np.ndarray]
    hip_centre_m: float
    plate_m: float


def published_sizes() -> Sizes:
    """From the tables in `data/published`."""
    repeated, sway = _rows("kinematic_repeatability.csv"), _rows("soft_tissue_artefact.csv")
    other = {
        row["quantity"]: 1e-3 * float(row["value"])
        for row in _rows("measurement_errors.csv")
        if row["unit"] == "mm" and row["value"]
    }
    hip = next(
        value
        for name, value in other.items()
        if name.startswith("hip joint centre: error along each axis")
    )
    centre = other["centre of pressure as installed: best of four plates"]
    return Sizes(
        between_sessions=_of_segments(repeated, "error", "between_session_sd_deg"),
        between_trials=_of_segments(repeated, "error", "between_trial_sd_deg"),
        sway=_of_segments(sway, "amplitude", "value"),
        hip_centre_m=hip,
        # from the mean distance of a normal error in the plane
        plate_m=centre / np.sqrt(0.5 * np.pi),
    )


def _rows(name: str) -> list[dict[str, str]]:
    with (PUBLISHED / name).open(encoding="utf-8") as lines:
        return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def _of_segments(rows: list[dict[str, str]], quantity: str, column: str) -> dict[str, np.ndarray]:
    """(3,) rad by kind of segment: what the published angles leave it. ValueError where that is
    less than nothing, as of no segments that err independently."""
    angles = {row["coordinate"]: float(row[column]) for row in rows if row["quantity"] == quantity}
    sizes: dict[str, np.ndarray] = {}
    above = np.zeros(3)
    for kind, names in ANGLES.items():
        squares = np.array(
            [
                angles[name] ** 2 - own**2 if name else 0.0
                for name, own in zip(names, above, strict=True)
            ]
        )
        if squares.min() < 0.0:
            raise ValueError(
                f"{column}: {names[int(squares.argmin())]} is less uncertain than the segment "
                "above it"
            )
        above = np.sqrt(squares)
        sizes[kind] = np.radians(above)
    return sizes


@dataclass(frozen=True)
class Session:
    """What a session gets wrong in all its trials.

    Attributes:
        sizes: of what is drawn for each trial.
        person: the true one; written: as the laboratory measured.
        ankle: (3,) m, the prosthetic ankle in the shank as it was found; true_ankle: in the true
            shank.
        turned: (3,) rad by segment, constant. waves: (3, HARMONICS, 2) rad by segment, over the
            gait cycle.
        plates: (2,) m by foot, how far its centre of pressure is off.
        zeroed: angles whose mean over each walk is taken off.
        seed: of its trials.
    """

    sizes: Sizes
    person: Subject
    written: Subject
    ankle: np.ndarray
    true_ankle: np.ndarray
    turned: dict[str, np.ndarray]
    waves: dict[str, np.ndarray]
    plates: dict[str, np.ndarray]
    zeroed: tuple[str, ...]
    seed: tuple[int, ...]

    def of_trials_alone(self) -> Session:
        """The same laboratory if it got nothing wrong in all trials alike."""
        none = {
            name: {key: 0.0 * value for key, value in getattr(self, name).items()}
            for name in ("turned", "waves", "plates")
        }
        return replace(self, written=self.person, ankle=self.true_ankle, zeroed=(), **none)


def draw_session(person: Subject, *, seed: tuple[int, ...], name: str) -> Session:
    """A session of `person`, whose measured lengths are all stated; `name` is that of the written
    subject."""
    random, sizes = np.random.default_rng(seed), published_sizes()
    turned = {
        segment: sizes.between_sessions[_kind(segment)] * random.standard_normal(3)
        for segment in PARENTS
    }
    waves = {
        segment: sizes.sway[_kind(segment)][:, None, None]
        / np.sqrt(2.0 * HARMONICS)
        * random.standard_normal((3, HARMONICS, 2))
        for segment in PARENTS
    }
    plates = {side: sizes.plate_m * random.standard_normal(2) for side in ("right", "left")}
    body = scale_body(person, FootParameters(), SocketParameters())
    hip = sizes.hip_centre_m * random.standard_normal(3)
    knees = {side: KNEE_M * random.standard_normal(3) for side in ("right", "left")}
    ankle = ANKLE_M * random.standard_normal(3)
    down = np.array([0.0, 0.0, -1.0])
    true_ankle = (body.prosthesis_length - body.ankle_height) * down
    found = Rotation.from_rotvec(turned["shank_right"]).inv().apply(true_ankle - knees["right"])
    written = replace(
        person,
        name=name,
        prosthesis_inversion_rad=None,
        mass_kg=round(person.mass_kg + MASS_KG * random.standard_normal(), 1),
        stature_m=round(person.stature_m + STATURE_M * random.standard_normal(), 3),
        **{
            key: round(float(value), 4)
            for key, value in {
                "hip_forward_m": body.hip_forward + hip[0],
                "hip_lateral_m": body.hip_lateral + hip[1],
                "hip_up_m": body.hip_up + hip[2],
                "thigh_length_m": np.linalg.norm(body.thigh_length * down + knees["left"] - hip),
                "prosthetic_thigh_length_m": np.linalg.norm(
                    body.prosthetic_thigh_length * down + knees["right"] - hip
                ),
                "shank_length_m": np.linalg.norm(body.shank_length * down + ankle - knees["left"]),
                "ankle_height_m": body.ankle_height + ankle[2],
                "foot_length_m": body.foot_length + FOOT_LENGTH_M * random.standard_normal(),
                **_mount(person, body, turned["shank_right"], knees["right"], random),
            }.items()
        },
    )
    return Session(
        sizes=sizes,
        person=person,
        written=written,
        ankle=found,
        true_ankle=true_ankle,
        turned=turned,
        waves=waves,
        plates=plates,
        zeroed=ZEROED,
        seed=seed,
    )


def foot_in_shank(person: Subject) -> RigidTransform:
    """X_SP of the right leg: the foot's place (`FootPlacement`) in the shank, whose origin is the
    knee."""
    body = scale_body(person, FootParameters(), SocketParameters())
    end = RigidTransform(np.array([0.0, 0.0, -body.residual_length - body.pylon_length]))
    return end @ foot_placement(person).pose(mirrored=False)


def _mount(
    person: Subject, body: Body, turned: np.ndarray, knee: np.ndarray, random: np.random.Generator
) -> dict[str, float]:
    """Length of the prosthesis and how its foot sits, measured in a shank that is `turned` (rad)
    and begins at `knee` (m from the true one); inversion is not told (see ZEROED)."""
    X_SP = foot_in_shank(person)
    R = RotationMatrix(Rotation.from_rotvec(turned).inv().as_matrix())
    marked = Rotation.from_rotvec(np.radians(FOOT_DEG) * random.standard_normal(3)).as_matrix()
    R_found = R @ X_SP.rotation() @ RotationMatrix(marked)
    end = R.multiply(X_SP.translation() - knee) + PLACE_M * random.standard_normal(3)
    alignment, _, rotation = joint_angles(R_found.matrix(), "ankle", "right")

    # The sole's plane lies build_height below the foot's place; the prosthesis runs down the
    # shank's axis to it.
    normal = R_found.matrix()[:, 2]
    length = (FootParameters().build_height_m - normal @ end) / normal[2]
    return {
        "prosthesis_length_m": length,
        "prosthesis_fore_aft_m": end[0],
        "prosthesis_lateral_m": -end[1],
        "prosthesis_alignment_rad": float(alignment),
        "prosthesis_toe_out_rad": -float(rotation),
    }


def session_tier(trial: Recorded, session: Session, name: str, index: Sequence[int]) -> Tier:
    """A trial of the session; `index` is its own, and `name` that of its folder."""
    random = np.random.default_rng([*session.seed, 1, *index])
    time = trial.time_s
    truth = np.zeros((len(time), len(BOTH_ANKLES)))
    truth[:, [BOTH_ANKLES.index(name) for name in COORDINATES]] = in_radians(trial.coordinates)
    R_W, p_W = orientations_of(truth)

    turn = (
        2.0
        * np.pi
        * np.multiply.outer((time - MARGIN_S) / trial.draw.stride_s, np.arange(1, HARMONICS + 1))
    )
    waves = np.stack([np.cos(turn), np.sin(turn)], axis=2)
    within, scale = session.sizes.between_trials, 1.0 + SWAY_SPREAD * random.standard_normal()
    found = {}
    for segment in PARENTS:
        size = within[_kind(segment)] / np.sqrt(PARTS)
        error = (
            session.turned[segment]
            + size * random.standard_normal(3)
            + scale * np.einsum("nhc,ahc->na", waves, session.waves[segment])
            + slow(time, size, random)
        )
        found[segment] = R_W[segment] @ Rotation.from_rotvec(error).as_matrix()

    values = coordinates_of(found, p_W)
    zeroed = [BOTH_ANKLES.index(name) for name in session.zeroed]
    values[:, zeroed] -= values[:, zeroed].mean(axis=0)
    ankle = (
        ankle_of(truth, session.person, session.true_ankle)
        + MARKED_M * random.standard_normal(3)
        + slow(time, np.full(3, MARKED_M), random)
    )
    shift = world_to_os(ankle - ankle_of(values, session.written, session.ankle))
    values[:, [BOTH_ANKLES.index(name) for name in PELVIS_TRANSLATIONS]] += shift
    coordinates = in_degrees(values[:, [BOTH_ANKLES.index(name) for name in COORDINATES]])
    feet = {
        side: _moved(measured(foot, random), session.plates[side])
        for side, foot in (("right", trial.right), ("left", trial.left))
    }
    return Tier(name, coordinates.round(DECIMALS), feet["right"], feet["left"])


def _kind(segment: str) -> str:
    return segment.partition("_")[0]


def slow(time_s: np.ndarray, size: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """(N, 3) smooth over `time_s` (N,), of expected root mean square `size` (3,), mean zero."""
    part = (time_s - time_s[0]) / (time_s[-1] - time_s[0])
    waves = np.sqrt(2.0 / SLOW_WAVES) * np.cos(
        np.pi * np.multiply.outer(part, np.arange(1, SLOW_WAVES + 1))
    )
    return np.asarray(waves @ random.standard_normal((SLOW_WAVES, 3)) * size)


def ankle_of(values: np.ndarray, subject: Subject, p_SA: np.ndarray) -> np.ndarray:
    """(N, 3) m in W: a point `p_SA` of the right shank under the pelvis of `values` (N, 24), with
    the subject's lengths."""
    R_W, p_W = orientations_of(values)
    body = scale_body(subject, FootParameters(), SocketParameters())
    hip = p_W + R_W["pelvis"] @ np.array([body.hip_forward, -body.hip_lateral, body.hip_up])
    knee = hip + R_W["thigh_right"] @ np.array([0.0, 0.0, -body.prosthetic_thigh_length])
    return np.asarray(knee + R_W["shank_right"] @ p_SA)


def _moved(foot: Foot, off: np.ndarray) -> Foot:
    """A plate that stands elsewhere than it says, by `off` (2,) m."""
    return replace(foot, cop=foot.cop + np.array([*off, 0.0]))
