"""The foot as a model of MuJoCo, whose text is in `engines/templates`."""

from __future__ import annotations

import math

from vsf_drake.engines.written import written
from vsf_drake.laws.contact_laws import FITTED_LAW
from vsf_drake.model.parameters import FootParameters

REACH_M = 10.0
"""Length (m) of the tendon that is MuJoCo's support: its upper end strays x (m) along the keel as
the keel bends, which lengthens it by x^2 / 2 / REACH_M, some tenths of a micrometre."""
CARRIAGE_SERVO_HZ = 30.0
"""Of MuJoCo's actuator that holds the carriage, critically damped (a choice)."""
IMPRATIO = 4.0
"""MuJoCo's contact that sticks creeps by its force along the ground over `impratio` times its
damping, the foot's own by that force over mu_static / threshold velocity times its load. This makes
both alike in the mean, as sums over all instants and loaded spheres of a roll-over of the nominal
foot, the damping as `calibrate` has it: 4.1, 4.1 and 4.3 at 66, 108 and 151 mm, in whole numbers.
"""


def foot_mjcf(parameters: FootParameters, *, fulcrum_m: float, law: str = FITTED_LAW) -> str:
    """The rigid foot with the springs in its keel and its support at `fulcrum_m` (m from A) as an
    MJCF model's text, named vsf. Names are as `add_foot` gives them; the mount M is a site.
    `law` is the contact law of the parameters: the head of the file tells what MuJoCo has instead.

    MuJoCo takes springs at the start of a step h and dampers at its end. The support's damping is
    therefore c + h k, which makes of it the spring at the end of the step, -k (r + h v) - c v.
    """
    return written(
        "foot.mjcf.j2",
        parameters,
        fulcrum_m,
        law=law,
        reach_m=REACH_M,
        impratio=IMPRATIO,
        servo=2.0 * math.pi * CARRIAGE_SERVO_HZ,
    )
