"""Body mass from the force plates of a walk."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.contacts import Assignment
from vsf_drake.motion.formats.recording import Recording
from vsf_drake.parameters import GRAVITY

LONGEST_STRIDE_S = 2.5
LIGHTEST_KG, HEAVIEST_KG = 20.0, 250.0


def mass_from_walk(walk: Recording, assignment: Assignment) -> tuple[float, str]:
    """Mean vertical force of both feet over a stride, in kg, and a note that says so.

    Over a stride the body's vertical momentum returns, so the mean force is the weight. Only strides, from one strike
    of a foot on a plate to its next, in which both feet stand on plates throughout, count; the mean of all is taken.

    Raises:
        InputError: there is no such stride, or the mass is nobody's.
    """
    time = walk.force_time_s
    vertical = sum(plate.force_W[:, 2] for plate in assignment.plates.values())
    missing = [span for spans in assignment.unmeasured.values() for span in spans]
    strides = []
    for side in assignment.plates:
        strikes = [c.start_s for c in assignment.contacts if c.side == side and c.start_seen]
        for start, end in pairwise(strikes):
            if end - start < LONGEST_STRIDE_S and not any(a < end and b > start for a, b in missing):
                strides.append((start, end))
    where, right = "mass_kg (--mass-kg)", "State the body mass, prosthesis included"
    if len(assignment.plates) < 2 or not strides:
        raise InputError("the body mass is not stated, and there is no stride in which both feet stand on plates "
                         "throughout", file=walk.force_path or walk.path, where=where, right=right)
    means = [float(np.mean(vertical[(time >= a) & (time < b)])) for a, b in strides]
    mass = float(np.mean(means)) / GRAVITY
    if not LIGHTEST_KG <= mass <= HEAVIEST_KG:
        raise InputError(f"the plates carry {mass * GRAVITY:.0f} N over a stride, which is nobody's weight",
                         file=walk.force_path or walk.path, where=where, right=right)
    spans = ", ".join(f"{a:.3f} to {b:.3f} s" for a, b in strides)
    return mass, (f"Body mass {mass:.1f} kg is the mean vertical force over {spans}, a stride; it is good to one or "
                  "two percent: state mass_kg (--mass-kg).")
