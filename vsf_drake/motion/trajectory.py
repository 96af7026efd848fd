"""Recorded coordinates as smooth functions of time, slow corrections of them, and their low-pass
filter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.linalg.lapack import dtbtrs

from vsf_drake.base.errors import InputError, require

SPLINE_ORDER = 5


class CoordinateTrajectory:
    """Positions, velocities and accelerations of named coordinates at any time within a recording.

    Each coordinate is the natural quintic spline through its samples: of all smooth functions
    through them the one with the least squared jerk. Its acceleration is C2 and of fourth order in
    the sample spacing; at both ends jerk and its rate are zero, so accelerations are less exact
    over the first and last three or so samples. Nothing is filtered.

    `time_s` (n,) s and `values` (n, m) rad and m are as recorded, `names` the m coordinates,
    `source` the file.
    """

    def __init__(
        self,
        time_s: np.ndarray,
        values: np.ndarray,
        names: Sequence[str],
        *,
        source: str | None = None,
    ) -> None:
        """Fits the splines to (n, m) values of m different names at n >= 6 increasing times."""
        self.time_s = np.array(time_s, dtype=float)
        self.values = np.array(values, dtype=float)
        self.names = tuple(names)
        self.source = source
        if self.values.shape != (len(self.time_s), len(self.names)) or len(set(self.names)) != len(
            self.names
        ):
            raise ValueError(
                f"time {self.time_s.shape}, values {self.values.shape} and {len(self.names)} "
                "different names do not fit"
            )
        if (
            len(self.time_s) <= SPLINE_ORDER
            or not np.isfinite(self.values).all()
            or (np.diff(self.time_s) <= 0).any()
        ):
            raise ValueError(
                f"a trajectory needs more than {SPLINE_ORDER} finite samples at increasing times"
            )
        self.time_s.setflags(write=False)
        self.values.setflags(write=False)
        zero = np.zeros(len(self.names))
        natural = [(3, zero), (4, zero)]
        spline = make_interp_spline(
            self.time_s, self.values, k=SPLINE_ORDER, bc_type=(natural, natural)
        )
        self._splines = (spline, spline.derivative(1), spline.derivative(2))

    @property
    def start_s(self) -> float:
        return float(self.time_s[0])

    @property
    def end_s(self) -> float:
        return float(self.time_s[-1])

    def sample(self, times: float | np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions, velocities and accelerations, (n, m) for n times within the recording, (1, m)
        for one."""
        inside = self.inside(times)
        q, v, a = (spline(inside) for spline in self._splines)
        return q, v, a

    def inside(self, times: float | np.ndarray) -> np.ndarray:
        """(n,) the times, which may be 1 ns outside the recording; InputError beyond that."""
        wanted = np.atleast_1d(np.asarray(times, dtype=float))
        outside = ~((wanted >= self.start_s - 1e-9) & (wanted <= self.end_s + 1e-9))
        if outside.any():
            raise InputError(
                f"time {wanted[np.argmax(outside)]:g} s lies outside the recording of "
                f"{self.start_s:g} to {self.end_s:g} s",
                file=self.source,
            )
        return np.asarray(np.clip(wanted, self.start_s, self.end_s))

    def with_values(self, values: np.ndarray) -> CoordinateTrajectory:
        """The same coordinates at the same instants with other values."""
        return CoordinateTrajectory(self.time_s, values, self.names, source=self.source)

    def ordered(self, names: Sequence[str]) -> CoordinateTrajectory:
        """The same motion with the coordinates `names`, in that order; InputError where one is
        missing."""
        missing = [name for name in names if name not in self.names]
        if missing:
            raise InputError(
                f"the motion has no coordinate {', '.join(missing)}",
                file=self.source,
                right=f"It has: {', '.join(self.names)}",
            )
        columns = [self.names.index(name) for name in names]
        chosen = copy(self)
        chosen.names = tuple(names)
        chosen.values = self.values[:, columns]
        chosen.values.setflags(write=False)
        chosen._splines = tuple(
            BSpline.construct_fast(s.t, s.c[:, columns], s.k) for s in self._splines
        )
        return chosen


def spacing(times: np.ndarray) -> float:
    """The usual step of times (n,)."""
    return float(np.median(np.diff(times)))


def columns_at(
    times: np.ndarray, known: np.ndarray, values: np.ndarray, beyond: float | None = None
) -> np.ndarray:
    """(n, m) columns of `values` (k, m) at other times (n,), straight between the known ones (k,);
    `beyond` these the last values, or what is given."""
    return np.column_stack(
        [np.interp(times, known, column, left=beyond, right=beyond) for column in values.T]
    )


def window_bsplines(start_s: float, end_s: float, count: int) -> Callable[[np.ndarray], np.ndarray]:
    """Slow corrections over a window: cubic B-splines (n, count) of times (n,) s, C2, not negative,
    their sum is 1.

    The clamped cubic B-splines on `count` + 1 even intervals of the window, of which the first
    three are added up, and the last three: so they begin and end with zero rate and acceleration,
    and go on as constants outside.
    """
    clamped = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, count + 2), np.ones(3)])
    group = np.concatenate([np.zeros(3, dtype=int), np.arange(1, count - 1), np.full(3, count - 1)])
    spline = BSpline(clamped, np.eye(count)[group], 3)

    def basis(times: np.ndarray) -> np.ndarray:
        share = (np.asarray(times, dtype=float) - start_s) / (end_s - start_s)
        return np.asarray(spline(np.clip(share, 0.0, 1.0)))

    return basis


def periodic_bsplines(count: int) -> Callable[[np.ndarray], np.ndarray]:
    """Corrections over a cycle: cubic B-splines (n, count) of phases (n,), periodic, C2, not
    negative, sum 1.

    The knots are `count` phases, evenly spaced from 0; the j-th spline is centred on j / count.
    """
    one, centres = BSpline.basis_element(np.arange(-2.0, 3.0), extrapolate=False), np.arange(count)

    def basis(phase: np.ndarray) -> np.ndarray:
        from_centre = np.asarray(phase, dtype=float)[:, None] * count - centres
        return np.asarray(np.nan_to_num(one((from_centre + 0.5 * count) % count - 0.5 * count)))

    return basis


# Zero-phase low-pass filter of recordings and results.
#
# A Butterworth section of second order run forward and then backward has no phase lag and twice the
# order, but its amplitude at the design cut-off is 1/2, not 1/sqrt(2). So the section is designed
# with a higher cut-off, such that -3 dB of the *whole* lies at the frequency that was asked for
# (Winter 2009, Biomechanics and Motor Control of Human Movement, 4th ed., section 3.4.4.2:
# (sqrt(2) - 1)**(1/4) = 0.802), on the pre-warped frequency tan(pi f / f_s), where it is exact.
#
# W² / (s² + sqrt(2) W s + W²) with s = (1 - q) / (1 + q), q a delay by one sample, is
#
#     y_k = gain (x_k + 2 x_(k-1) + x_(k-2)) - past_1 y_(k-1) - past_2 y_(k-2),
#
# a banded triangular system of equations for all y. (scipy.signal has the same, and loads
# scipy.stats with it: a sixth of the time in which a walk is simulated from the command line.)


def low_pass(values: np.ndarray, *, rate_hz: float, cutoff_hz: float) -> np.ndarray:
    """`values` (n, ...) without what is faster than `cutoff_hz`, in phase with the input.

    At the cut-off the amplitude is 1/sqrt(2); the order is four, in two passes. The ends are
    extended by odd reflection, each pass begins at rest. InputError where the cut-off is
    impossible at this rate, or a value is not finite.
    """
    values = np.asarray(values, dtype=float)
    require(
        0.0 < cutoff_hz < rate_hz / 2,
        f"a cut-off of {cutoff_hz:g} Hz is impossible at {rate_hz:g} samples per second",
        right=f"It must be above 0 and below {rate_hz / 2:g} Hz",
    )
    require(len(values) > 1, f"{len(values)} samples cannot be filtered")
    if not np.isfinite(values).all():
        row = int(np.argwhere(~np.isfinite(values))[0][0])
        raise InputError(
            f"sample {row} (after {row / rate_hz:g} s) is not a finite number and cannot be "
            "filtered"
        )
    warped = np.tan(np.pi * cutoff_hz / rate_hz) / (np.sqrt(2.0) - 1.0) ** 0.25
    if not values.size:  # LAPACK writes where it must not for no column
        return values.copy()
    columns = values.reshape(len(values), -1)
    extension = min(len(columns) - 1, int(np.ceil(2.0 * rate_hz / cutoff_hz)))
    before = 2.0 * columns[0] - columns[extension:0:-1]
    after = 2.0 * columns[-1] - columns[-2 : -extension - 2 : -1]
    forward = _one_pass(np.concatenate([before, columns, after]), warped)
    filtered = _one_pass(forward[::-1], warped)[::-1][extension : extension + len(columns)]
    return filtered.reshape(values.shape)


def _one_pass(columns: np.ndarray, warped: float) -> np.ndarray:
    """(n, m) after the section whose analogue cut-off is `warped` (rad per half a sample), as if
    the first row had stood there for ever."""
    first_row = columns[0]
    whole = 1.0 + np.sqrt(2.0) * warped + warped**2
    band = np.empty((3, len(columns)))
    band[0] = 1.0
    band[1] = 2.0 * (warped**2 - 1.0) / whole
    band[2] = (1.0 - np.sqrt(2.0) * warped + warped**2) / whole
    scaled = warped**2 / whole * (columns - first_row)
    summed = scaled.copy()
    summed[1:] += 2.0 * scaled[:-1]
    summed[2:] += scaled[:-2]
    filtered: np.ndarray = dtbtrs(band, summed, uplo="L", diag="U")[0]
    filtered += first_row
    return filtered
