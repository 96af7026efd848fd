"""A made-up error of a condensed foot."""

from __future__ import annotations

from vsf_drake.engines.condensed_error import CondensedError, RollOverError

MADE_ERROR = CondensedError(
    fulcrums_m=(0.066, 0.108),
    masses_kg=(40.0, 110.0),
    worst=RollOverError(
        force_largest=0.07,
        force_rms=0.024,
        centre_largest_m=0.0083,
        centre_rms_m=0.0018,
        stored=0.04,
        returned=0.045,
    ),
    each=(),
)
