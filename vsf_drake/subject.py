"""The person as measured, what is not known being scaled from the stature; and the names of a person's coordinates.

Schema only, as in `parameters`, which re-exports it. Lengths in metres, angles in radians. Whatever has a
direction is signed by anatomy, not by the world, so that one set of numbers means the same on either side.
"""

from __future__ import annotations

from dataclasses import dataclass

from vsf_drake.schema import choice, quantity

SIDES = ("left", "right")
PELVIS_TRANSLATIONS = ("pelvis_tx", "pelvis_ty", "pelvis_tz")
PELVIS_ROTATIONS = ("pelvis_tilt", "pelvis_list", "pelvis_rotation")
PELVIS_COORDINATES = PELVIS_TRANSLATIONS + PELVIS_ROTATIONS


def leg_coordinates(side: str, intact: bool) -> tuple[str, ...]:
    """Names of the joint coordinates of the leg on `side` ("right" or "left"), hip to ankle; as in OpenSim."""
    joints = (("hip", "flexion"), ("knee", "angle"), ("ankle", "angle"))[:3 if intact else 2]
    return tuple(f"{joint}_{motion}_{side[0]}" for joint, bending in joints
                 for motion in (bending, "adduction", "rotation"))


def person_coordinates(prosthetic_side: str) -> tuple[str, ...]:
    """The 21 recorded coordinates of a person who has no ankle on `prosthetic_side` ("left" or "right")."""
    return PELVIS_COORDINATES + tuple(
        name for side in ("right", "left") for name in leg_coordinates(side, side != prosthetic_side))


@dataclass(frozen=True, kw_only=True)
class Subject:
    """The person: measured where known, scaled from the stature (de Leva 1996) where None.

    Thigh, shank, ankle height and foot length are the intact leg's; the prosthetic thigh is as long unless
    measured. The prosthetic leg below the knee is described by `prosthesis_length_m` and by how the foot
    sits under the pylon, relative to its standard place (pylon axis `foot.pylon_x_m` ahead of the keel's
    posterior end, in the middle of its width, foot and shank at right angles, toes forward); None: there.

        prosthesis_length_m     prosthetic knee centre to sole along the shank's long axis; None: as the
                                intact knee centre to sole (shank plus ankle height)
        prosthesis_fore_aft_m   + foot forward
        prosthesis_lateral_m    + foot away from the midline
        prosthesis_alignment_rad    + toe up (dorsiflexion), as the ankle coordinate
        prosthesis_inversion_rad    + inversion (medial edge up), as the ankle coordinate
        prosthesis_toe_out_rad      + external rotation, against the sign of the ankle coordinate
    """

    mass_kg: float = quantity(unit="kg", low=20.0, high=250.0, source="measured, prosthesis included")
    stature_m: float = quantity(unit="m", low=0.8, high=2.5, source="measured")
    sex: str = choice(options=("male", "female"), source="stated")
    prosthetic_side: str = choice(options=SIDES, source="stated")
    name: str = "subject"
    thigh_length_m: float | None = quantity(None, unit="m", low=0.1, high=0.8, source="measured: hip to knee centre")
    shank_length_m: float | None = quantity(None, unit="m", low=0.1, high=0.8, source="measured: knee to ankle centre")
    ankle_height_m: float | None = quantity(None, unit="m", low=0.02, high=0.2, source="measured: ankle centre to sole")
    foot_length_m: float | None = quantity(None, unit="m", low=0.1, high=0.4, source="measured: heel to toe tip")
    hip_forward_m: float | None = quantity(
        None, unit="m", low=-0.2, high=0.2, source="measured: hip centre ahead of the pelvis origin")
    hip_up_m: float | None = quantity(
        None, unit="m", low=-0.3, high=0.2, source="measured: hip centre above the pelvis origin")
    hip_lateral_m: float | None = quantity(
        None, unit="m", low=0.03, high=0.2, source="measured: hip centre beside the pelvis origin")
    prosthetic_thigh_length_m: float | None = quantity(
        None, unit="m", low=0.1, high=0.8, source="measured: hip to knee centre on the prosthetic side")
    prosthesis_length_m: float | None = quantity(
        None, unit="m", low=0.15, high=0.9, source="measured: prosthetic knee centre to sole along the shank")
    prosthesis_fore_aft_m: float | None = quantity(
        None, unit="m", low=-0.1, high=0.1, source="measured: foot forward of its standard place under the pylon")
    prosthesis_lateral_m: float | None = quantity(
        None, unit="m", low=-0.1, high=0.1, source="measured: foot away from the midline, from under the pylon")
    prosthesis_alignment_rad: float | None = quantity(
        None, unit="rad", low=-0.5, high=0.5, source="measured: foot turned toe up against the pylon")
    prosthesis_inversion_rad: float | None = quantity(
        None, unit="rad", low=-0.5, high=0.5, source="measured: foot inverted against the pylon")
    prosthesis_toe_out_rad: float | None = quantity(
        None, unit="rad", low=-0.7, high=0.7, source="measured: foot turned outward about the pylon")
