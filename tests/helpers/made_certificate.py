"""Certificates of made-up answers."""

from __future__ import annotations

import numpy as np
from made_condensed import MADE_ERROR

from vsf_drake.engines.certificate.rows import FAILED, NOT_RUN
from vsf_drake.engines.certificate.run import (
    ENGINES,
    KEPT,
    REFERENCE,
    Certificate,
    Ran,
    certificate_of,
)
from vsf_drake.model.parameters import FootParameters

_ASKED = {
    "fulcrum_mm": np.array([66.0, 108.0]),
    "load_n": np.array([100.0, 200.0, 300.0]),
    "time_s": np.linspace(0.0, 0.8, 9),
    "roll_fulcrum_mm": np.array(87.0),
    "poses_rad": np.array([[0.1, -0.2], [0.0, 0.1], [0.05, 0.0]]),
}
ASKED = {name: _ASKED[name] for name in KEPT}
"""As a certificate keeps it: a page must need no more."""


def made_certificate(*, apart: float = 0.0, not_run: str = "", failed: str = "") -> Certificate:
    """Drake and OpenSim answer as this package does, but for rises that are `apart` (relative); an
    engine that is `not_run` or has `failed` does not."""
    rise = np.outer([2e-5, 1e-5], ASKED["load_n"])
    half_sine = 1e3 * np.sin(np.pi * ASKED["time_s"] / 0.8)
    common = {
        "mass_matrix_kg_m2": np.eye(2)[None],
        "gravity_torque_nm": np.ones((1, 2)),
        "roll_nominal_n": half_sine,
        "roll_elastic_n": half_sine,
    }
    answers = {
        REFERENCE: {"rise_m": rise, "rise_fine_m": rise, "rise_small_m": 1.01 * rise, **common},
        "drake": {"rise_m": (1.0 + apart) * rise, **common},
        "opensim": {"rise_m": rise, **common},
    }
    status = {not_run: (NOT_RUN, "nobody installed it"), failed: (FAILED, "it broke off")}
    ran = {}
    for name in answers:
        word, why = status.get(name, ("", ""))
        ran[name] = Ran(
            name=name,
            label=ENGINES[name].label,
            status=word,
            version=None if word else "1.2",
            why=why,
        )
        if word:
            answers[name] = {}
    return certificate_of(FootParameters(), ASKED, ran, answers, MADE_ERROR, {})
