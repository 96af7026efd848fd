"""Where in the gait cycle an instant lies, told by the prosthetic foot's force plate.

    phase    k at the k-th strike of the prosthetic foot, k + STANCE_SHARE at its lift-off

Between these instants the phase is the quintic through them whose second derivative vanishes at each and whose rate
there is the harmonic mean of the mean rates before and after, at most 1.25 times the smaller one: its derivative then
has positive Bernstein coefficients, so that the phase rises all the way, and it is C2 in time, where straight lines
would bend the rate at every strike and lift-off. Before the first and after the last stance, and through a trial with
a single stance, it is a straight line at that stance's own mean rate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from scipy.interpolate import BPoly

from vsf_drake.errors import InputError
from vsf_drake.motion.events import Stance, find_stances
from vsf_drake.motion.trial_record import Trial

STANCE_SHARE = 0.62
"""Foot-off of slow walking: Schwartz 2008, doi 10.1016/j.jbiomech.2008.03.015."""
STEEPEST = 1.25
"""Largest rate at an instant over the smaller of the mean rates beside it."""


def gait_phase(source: Trial | Sequence[Stance]) -> Callable[[np.ndarray], np.ndarray]:
    """The phase (n,), in cycles, of times (n,) s; it rises and is C2.

    Args:
        source: a trial, whose prosthetic plate tells its stances, or the stances of the prosthetic foot. Only those
            count that were seen from strike to lift-off; one that was missed in between counts as a cycle.

    Raises:
        InputError: no stance was seen as a whole.
        ValueError: the stances overlap or are not in order of time.
    """
    if isinstance(source, Trial):
        plate = source.prosthetic_plate
        stances: Sequence[Stance] = find_stances(plate.time_s, plate.force_W[:, 2])
    else:
        stances = source
    seen = [stance for stance in stances if stance.complete]
    if not seen:
        raise InputError("the plate saw only part of the stance" if stances else "the plate saw no stance",
                         file=source.path if isinstance(source, Trial) else None, where="forces",
                         right="A gait cycle needs strike and lift-off of the prosthetic foot")
    if any(later.start_s <= earlier.end_s for earlier, later in pairwise(seen)):
        raise ValueError("stances must follow each other")
    stride_s = np.mean([stance.duration_s for stance in seen]) / STANCE_SHARE
    cycles = np.cumsum([0, *(max(1, round((later.start_s - earlier.start_s) / stride_s))
                             for earlier, later in pairwise(seen))])
    phases = (cycles[:, None] + [0.0, STANCE_SHARE]).ravel()
    instants = np.array([(stance.start_s, stance.end_s) for stance in seen]).ravel()
    rates = STANCE_SHARE / np.array([stance.duration_s for stance in (seen[0], seen[-1])])
    mean = np.diff(phases) / np.diff(instants)
    before, after = mean[:-1], mean[1:]
    inner = np.minimum(2.0 * before * after / (before + after), STEEPEST * np.minimum(before, after))
    slopes = np.concatenate([rates[:1], inner, rates[1:]])
    between = BPoly.from_derivatives(instants, np.column_stack([phases, slopes, np.zeros(len(slopes))]))

    def phase(times: np.ndarray) -> np.ndarray:
        times = np.asarray(times, dtype=float)
        early, late = np.minimum(times - instants[0], 0.0), np.maximum(times - instants[-1], 0.0)
        return between(np.clip(times, instants[0], instants[-1])) + rates[0] * early + rates[1] * late

    return phase
