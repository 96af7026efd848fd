"""What the certificate asks of engines at rest: no poses, no roll-over, no spheres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from pressed_keel import keel_names

from vsf_drake.engines.certificate.asked import Asked
from vsf_drake.laws.beam import section_inertia
from vsf_drake.model.parameters import GRAVITY, FootParameters


def asked_of(foot: FootParameters, *, fulcrums_m: Sequence[float], loads_n: npt.ArrayLike) -> Asked:
    """Of `foot` with the fulcrum at each position under each load on its load point."""
    keel = foot.keel
    hinges, starts = keel_names(foot)
    return Asked(
        fulcrum_mm=1e3 * np.array(fulcrums_m),
        load_n=np.array(loads_n),
        load_point_m=foot.load_point_m,
        hinges=np.array(hinges),
        bodies=np.array([f"keel_body_{i}" for i in range(len(hinges))]),
        starts_m=starts,
        poses_rad=np.zeros((0, len(hinges))),
        gravity=GRAVITY,
        roll_fulcrum_mm=108.0,
        time_s=np.zeros(0),
        mount=np.zeros((0, 3)),
        beam_ei_nm2=keel.flexural_modulus_pa * section_inertia(keel.width_m, keel.thickness_m),
        keel_length_m=sum(keel.element_lengths_m),
        support_n_per_m=foot.fulcrum.stiffness_n_per_m,
        sphere_bodies=np.array([], dtype=str),
        sphere_p_BS=np.zeros((0, 3)),
        sphere_radius=np.zeros(0),
        sphere_stiffness=np.zeros(0),
        sphere_exponent=np.zeros(0),
        sphere_damping=np.zeros(0),
        sphere_full_damping_depth=np.zeros(0),
    )
