"""Fitted contacts, made up."""

from __future__ import annotations

import dataclasses
from typing import Any

from vsf_drake.model.contact_file import (
    CURVES,
    FORMAT,
    STANCE_POINTS,
    FittedContact,
    FittedSubject,
    FittedTrial,
    JointCurve,
    MomentumBias,
    PersonCurve,
    PersonWalk,
)

MASS_KG, STATURE_M = 78.0, 1.81
OF_THE_MODEL = {
    "contact.forefoot.stiffness": 9e4,
    "contact.forefoot.exponent": 1.4,
    "contact.forefoot.damping": 150.0,
    "contact.midfoot.full_damping_depth": 2e-3,
    "contact.heel.rise": -1e-3,
    "friction.mu_static": 0.6,
    "friction.mu_kinetic": 0.4,
    "friction.threshold_velocity": 0.08,
    "keel.flexural_modulus": 17.7e9,
    "fulcrum.stiffness": 150e3,
    "socket.tz.stiffness": 8.3e4,
    "socket.flexion.stiffness": 1130.0,
}
"""One value of each kind that a model holds."""
OF_THE_TRIAL = {
    "offset.height": 1e-3,
    "offset.fore_aft": -2e-3,
    "offset.alignment": 0.01,
    "offset.inversion": -0.05,
    "offset.toe_out": 0.02,
    "coordinate.hip_flexion_r": 0.012,
    "coordinate.pelvis_ty": -5e-4,
}
CURVE = JointCurve(coordinate="knee_angle_r", coefficients=(0.0, 0.01, -0.012, 0.004, 0.0, 1 / 300))
FINGERPRINT = "0123456789abcdef" * 4
OWN = FittedTrial(
    name="low 1",
    fingerprint=FINGERPRINT,
    height_m=5e-4,
    path={"pelvis_tx": (0.0, 1e-3, 2e-3, -1e-3, 0.0), "pelvis_tz": (0.0, 1e-4, 0.0, 1e-4)},
    curves={"hip_flexion_r": (0.0, 0.01, -0.01, 1 / 300)},
)

MOMENTUM = MomentumBias(
    fore_aft_bw=(-0.01, 0.02, 1 / 30), vertical_bw=(0.0, 0.01, -0.02), trials=(FINGERPRINT,)
)


def made_person_walk(**changes: Any) -> PersonWalk:
    """A fitted walk whose plate and model show the weight all the stance long."""
    whole = {
        "fingerprint": FINGERPRINT,
        "fulcrum_m": 0.066,
        "stance_s": 0.7,
        "strike_error_s": 0.004,
        "lift_off_error_s": -1 / 300,
        "needed_bw": (0.9, 0.0, 1 / 3),
        "intact_lift_off_percent": 18.0,
        **dict.fromkeys(CURVES, (0.0,) * STANCE_POINTS),
        "vertical_bw": (1.0,) * STANCE_POINTS,
        "model_vertical_bw": (1.0,) * STANCE_POINTS,
    }
    return PersonWalk(**whole | changes)


PERSON_CURVE = PersonCurve(walks=(made_person_walk(),), vertical_sd_bw=(1 / 30,) * STANCE_POINTS)


def made_contact(**changes: Any) -> FittedContact:
    """A converged fit with everything in it, to the right side of the reference subject, with these
    fields instead."""
    whole = FittedContact(
        format=FORMAT,
        subject=FittedSubject(mass_kg=MASS_KG, stature_m=STATURE_M, prosthetic_side="right"),
        strategy="joint",
        converged=True,
        verdict=("Two settings were fitted.",),
        values={**OF_THE_MODEL, **OF_THE_TRIAL},
        curves=(CURVE,),
        trials=(OWN,),
        provenance={"versions": {"drake": "1.51"}, "seed": 3, "inputs_sha256": {}},
    )
    return dataclasses.replace(whole, **changes)
