"""How wrong measurement and model are expected to be together, and how long an error lasts.

Residuals are in units of their standard deviation. Errors of neighbouring instants are alike: as long as
`correlation_s` lasts, n samples tell no more than one. So n residuals of a series with spacing dt weigh together as
n dt / (2 correlation_s) independent ones (the integral time of an exponential correlation), which keeps
priors from being outvoted by a sampling rate.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from vsf_drake.errors import InputError

FORCES = ("fore_aft", "lateral", "vertical")
RESULTANT = "resultant"
COP = ("cop_fore_aft",)
SERIES = (*FORCES, RESULTANT, *COP)


@dataclass(frozen=True, kw_only=True)
class FitNoise:
    """Standard deviations of model minus measurement, choices: half of what McGeehan 2021 (doi 10.1115/1.4050456) is
    left with on its fitted trial, 5.3 % body weight and 5.7 % foot length.

    Attributes:
        fore_aft, lateral, vertical, resultant: of the force, in body weights.
        cop_fore_aft: of the centre of pressure, in foot lengths.
        correlation_s: s, of the exponential correlation of errors in time. Errors of motion are as slow as the motion
            (6 Hz: 1 / (2 pi 6 Hz) = 27 ms), those of the model last as long as a phase of stance; a choice between.
    """

    fore_aft: float = 0.025
    lateral: float = 0.025
    vertical: float = 0.025
    resultant: float = 0.025
    cop_fore_aft: float = 0.03
    correlation_s: float = 0.05

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 < value < 1.0:
                raise InputError(f"{value!r} is no standard deviation or time", where=f"noise.{field.name}",
                                 right="It must be a positive number below 1: parts of body weight or foot length "
                                       "(not percent), or seconds")

    def weight(self, spacing_s: float) -> float:
        """What each of many residuals in units of its standard deviation counts for, at most 1."""
        return float(min(1.0, np.sqrt(spacing_s / (2.0 * self.correlation_s))))

    def correlation(self, times_s: np.ndarray) -> np.ndarray:
        """(n, n) correlation of the errors at the times (n,)."""
        apart = np.abs(times_s[:, None] - times_s[None, :])
        return np.asarray(np.exp(-apart / self.correlation_s))
