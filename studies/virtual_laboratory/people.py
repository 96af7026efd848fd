"""The persons of the session tier as they truly are, and their feet. All synthetic; only who they
are is set.

Lengths, hip centres, placement and every foot are drawn about what the model under test would
assume, so that it is wrong about each of them. Standard deviations are choices unless a source is
named: nobody publishes most of them.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from virtual_laboratory.bench import forefoot_stiffness, heel_stiffness
from virtual_laboratory.design import (
    Design,
    FrameDesign,
    KeelDesign,
    SocketDesign,
    SoleDesign,
    SupportDesign,
    in_shell,
    longer,
)
from virtual_laboratory.prosthesis import STEP_S, Prosthesis, prosthesis_of
from vsf_drake.model.parameters import FootParameters, SocketParameters, Subject
from vsf_drake.plants.anthropometry import scale_body

LENGTH_SD = 0.04
"""Of a segment's length at one stature, as a share of it."""
FOOT_RATIO = 0.147
"""Foot length / stature of men and of women (http://jcmad.com/allpapers/117h.php); the model has de
Leva's."""
HIP_SD_M = 7.6e-3
"""Of a hip centre about a regression, along each axis: the 13.2 mm of Fiorentino et al. 2016
(doi 10.1007/s10439-015-1522-1) shared equally. The model's regression is another one."""
THIGH_SD, SHORTER_M, SHORTER_SD_M, RESIDUAL_RATIO, RESIDUAL_SD = 0.01, 3e-3, 5e-3, 0.62, 0.04
"""Of the prosthetic thigh's length to the intact one's; by how much the prosthesis is the shorter
leg; residual shank to intact shank."""
PLACEMENT = {
    "prosthesis_fore_aft_m": (0.0, 8e-3),
    "prosthesis_lateral_m": (0.0, 4e-3),
    "prosthesis_alignment_rad": (0.0, np.radians(1.5)),
    "prosthesis_inversion_rad": (0.0, np.radians(2.0)),
    "prosthesis_toe_out_rad": (np.radians(5.0), np.radians(2.0)),
}
"""Mean and standard deviation of how the foot sits under the pylon."""
REFERENCE_MASS_KG = 78.0
"""Person for whom the reference foot is made, McGeehan 2021 (doi 10.1115/1.4050456)."""
SPECIMEN_SD = {
    "modulus_pa": 0.08,
    "shear_modulus_pa": 0.15,
    "thickness_rear_m": 0.02,
    "thickness_tip_m": 0.02,
    "clamp_nm_per_rad": 0.3,
    "stiffness_n_per_m": 0.2,
    "foam_modulus_pa": 0.12,
    "heel_modulus_pa": 0.12,
    "hysteresis_s_per_m": 0.2,
    "friction": 0.1,
    "mass_kg": 0.05,
    "play_m": 0.3,
}
"""Of one foot about its make, as a share."""
SOCKET_SD = 0.2
"""Of each stiffness and damping of a socket, and of its mass, as a share."""
FOREFOOT_N_PER_M, HEEL_N_PER_M = (28e3, 76e3), (45e3, 68e3)
"""Linear stiffness of commercial feet (abstract of an ASME Summer Bioengineering Conference 2012
paper: forefoot 28 to 76, hindfoot 27 to 68 N/mm); a passive foot is drawn evenly from it. This
level foam block is no softer than 41."""


@dataclass(frozen=True)
class TruePerson:
    """One person; the simulation is of a right-sided one, and what is written of a left-sided one
    is mirrored.

    Attributes:
        subject: lengths, masses and the foot's placement as they are, prosthetic side "right" as
            simulated.
        side: which it is.
        residual_length_m: m, knee to the end of the residual limb.
        foot: variable-stiffness foot and socket. passive: another foot in the same socket, if there
            is one.
    """

    name: str
    subject: Subject
    side: str
    residual_length_m: float
    foot: Design
    passive: Design | None = None

    def prosthesis(self, fulcrum_m: float | None, step_s: float = STEP_S) -> Prosthesis:
        """With the variable-stiffness foot set to `fulcrum_m` (m from A), or None with the passive
        foot."""
        design = self.foot if fulcrum_m is not None else self.passive
        if design is None:
            raise ValueError(f"{self.name} has no passive foot")
        return prosthesis_of(
            self.subject,
            fulcrum_m,
            design=design,
            residual_length=self.residual_length_m,
            step_s=step_s,
        )


def true_persons(seed: int) -> tuple[TruePerson, TruePerson, TruePerson]:
    """A, as heavy and tall as the subject of McGeehan 2021; B, light, prosthesis on the left; C,
    heavy.

    Sizes of feet against the published 245 mm (choices): a tenth longer for A; B's own foot
    measures some 225 mm, so hers is as short as the prototype is; C's is the longest.
    """
    return (
        _person(seed, "A", 78.0, 1.81, "male", "right", 1.10),
        _person(seed, "B", 56.0, 1.62, "female", "left", 1.0),
        _person(seed, "C", 102.0, 1.86, "male", "right", 1.14, passive=True),
    )


def person_in_shell(seed: int, length_m: float) -> TruePerson:
    """S, as heavy and tall as A, with a foot of the published size in a shell of `length_m`; person
    and foot are the same in all shells."""
    person = _person(seed, "S", 78.0, 1.81, "male", "right", 1.0)
    return dataclasses.replace(person, foot=in_shell(person.foot, length_m))


def _person(
    seed: int,
    name: str,
    mass_kg: float,
    stature_m: float,
    sex: str,
    side: str,
    size: float,
    *,
    passive: bool = False,
) -> TruePerson:
    random = np.random.default_rng([seed, ord(name)])
    stated = Subject(
        mass_kg=mass_kg,
        stature_m=stature_m,
        sex=sex,
        prosthetic_side="right",
        name=f"SYNTHETIC person {name}",
    )
    body = scale_body(stated, FootParameters(), SocketParameters())
    usual = [body.thigh_length, body.shank_length, body.ankle_height, FOOT_RATIO * stature_m]
    thigh, shank, ankle, foot = usual * (1.0 + LENGTH_SD * random.normal(size=4))
    regression = [body.hip_forward, body.hip_up, body.hip_lateral]
    forward, up, lateral = regression + HIP_SD_M * random.normal(size=3)
    lengths = {
        "thigh_length_m": thigh,
        "shank_length_m": shank,
        "ankle_height_m": ankle,
        "foot_length_m": foot,
        "hip_forward_m": forward,
        "hip_up_m": up,
        "hip_lateral_m": lateral,
        "prosthetic_thigh_length_m": thigh * (1.0 + THIGH_SD * random.normal()),
        "prosthesis_length_m": shank + ankle - SHORTER_M + SHORTER_SD_M * random.normal(),
    }
    placement = {key: mean + sd * random.normal() for key, (mean, sd) in PLACEMENT.items()}
    true = {key: float(round(value, 4)) for key, value in (lengths | placement).items()}
    subject = dataclasses.replace(stated, **true)
    residual = float(round(shank * (RESIDUAL_RATIO + RESIDUAL_SD * random.normal()), 4))
    socket = _drawn(
        SocketDesign(),
        random,
        {
            field.name: SOCKET_SD
            for field in dataclasses.fields(SocketDesign)
            if field.name.endswith(
                ("_force_n", "_n_per_m", "_nm_per_rad", "_n_s_per_m", "_nm_s", "_mass_kg")
            )
        },
    )
    return TruePerson(
        name,
        subject,
        side,
        residual,
        dataclasses.replace(_specimen(mass_kg, size, random), socket=socket),
        dataclasses.replace(_passive(size, random), socket=socket) if passive else None,
    )


def _drawn(part: Any, random: np.random.Generator, sd: dict[str, float]) -> Any:
    """`part` with each number of it that `sd` names drawn about itself (log-normally, so that none
    changes sign)."""
    values = {
        name: getattr(part, name) * float(np.exp(share * random.normal()))
        for name, share in sd.items()
        if hasattr(part, name)
    }
    return dataclasses.replace(part, **values)


def _specimen(mass_kg: float, size: float, random: np.random.Generator) -> Design:
    """A foot of another make than the reference one: on a clamp, under a roller that it can leave,
    able to twist.

    A maker takes a thicker keel for heavier users and longer feet, so that the toe yields alike
    under body weight.
    """
    thicker = (size**2 * mass_kg / REFERENCE_MASS_KG) ** (1.0 / 3.0)
    keel = KeelDesign(
        thickness_rear_m=6.9e-3 * thicker,
        thickness_tip_m=4.4e-3 * thicker,
        thickness_from_m=0.140,
        width_tip_m=0.050,
        width_from_m=0.120,
        modulus_pa=KeelDesign().modulus_pa,
        twists=6,
        clamp_nm_per_rad=150.0,
    )
    support = SupportDesign(stiffness_n_per_m=1.5e6, one_sided=True, play_m=1.5e-4)
    sole = SoleDesign(rocker_radius_m=2.0, toe_radius_m=0.32, heel_radius_m=0.030)
    parts = [_drawn(part, random, SPECIMEN_SD) for part in (keel, support, FrameDesign(), sole)]
    return longer(Design(*parts), size)


def _passive(size: float, random: np.random.Generator) -> Design:
    """A foot without fulcrum: a stiff cantilever built in at A, keel and heel as stiff on the bench
    as drawn."""
    forefoot, heel = random.uniform(*FOREFOOT_N_PER_M), random.uniform(*HEEL_N_PER_M)
    keel = KeelDesign(
        thickness_rear_m=9.5e-3,
        thickness_tip_m=5.0e-3,
        twists=6,
        clamp_nm_per_rad=1e5,
        density_kg_m3=1600.0,
    )
    design = longer(
        Design(
            keel,
            None,
            FrameDesign(mass_kg=0.55, foam_thickness_m=0.040),
            SoleDesign(foam_modulus_pa=1.5e6, densification=0.9),
        ),
        size,
    )

    def with_(modulus: float, heel_modulus: float) -> Design:
        return dataclasses.replace(
            design,
            keel=dataclasses.replace(design.keel, modulus_pa=modulus),
            sole=dataclasses.replace(design.sole, heel_modulus_pa=heel_modulus),
        )

    heel_modulus = brentq(lambda e: heel_stiffness(with_(3e10, e)) - heel, 2e5, 4e6)
    modulus = brentq(
        lambda e: forefoot_stiffness(with_(e, heel_modulus), None) - forefoot, 3e9, 4e11
    )
    return with_(float(modulus), float(heel_modulus))
