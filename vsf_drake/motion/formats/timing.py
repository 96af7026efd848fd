"""Times of a recording's rows: one even rate, freed from rounding."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError

LATEST_S = 1e7
"""Seconds; four months of recording."""
RATE_SHARE = 2e-3
"""A stated rate may differ from that of the times by this share (29.97 against 30 Hz is 1e-3)."""
STEP_SHARE = 0.05
"""A time may lie this share of a step off the even ones (clock jitter), or by its rounding."""
ROUNDING_SHARE = 0.6
"""Of the last decimal: rounding and cutting both stay within half of it, about their middle."""


def even_rate(time_s: np.ndarray, lines: np.ndarray, path: Path, *, stated_hz: float | None = None) -> float:
    """The rate (1/s) of rows that are evenly spaced but for rounding; the stated one where the times agree.

    Args:
        time_s: (n,) s.
        lines: (n,) the file's line of each.
        path: the file, for messages.
        stated_hz: what the header says.

    Raises:
        InputError: there are fewer than two rows, or the times are uneven or do not increase.
    """
    if len(time_s) < 2:
        raise InputError(f"has {len(time_s)} rows of numbers", file=path, right="At least 2 are needed")
    bad = ~(np.abs(time_s) < LATEST_S)
    if bad.any():
        raise InputError("the time is not a believable number", file=path,
                         where=f"line {lines[int(np.argmax(bad))]}, column Time")
    index = np.arange(len(time_s))
    span = float(time_s[-1] - time_s[0])
    if span <= 0.0:
        raise InputError(f"the times run from {time_s[0]:g} to {time_s[-1]:g} s", file=path, where="column Time",
                         right="They must increase")
    rate = float(1.0 / np.polynomial.Polynomial.fit(index, time_s, 1).convert().coef[1])
    if not 0.0 < rate < np.inf:
        raise InputError("the times do not increase evenly", file=path, where="column Time")
    rounding = _rounding(time_s)
    if stated_hz is not None and abs(stated_hz / rate - 1.0) <= RATE_SHARE + 2.0 * rounding / span:
        slack = abs(stated_hz / rate - 1.0) * span
        rate = stated_hz
    else:
        slack = 0.0
    step = 1.0 / rate
    centred = time_s - index * step
    away = np.abs(centred - (centred.min() + centred.max()) / 2.0)
    allowed = max(STEP_SHARE * step, ROUNDING_SHARE * rounding) + slack
    if away.max() > allowed:
        jump = int(np.argmax(np.abs(np.diff(time_s) - step))) + 1
        raise InputError(f"time {time_s[jump]:g} s follows {time_s[jump - 1]:g} s, where rows are "
                         f"{np.median(np.diff(time_s)):.6g} s apart", file=path, where=f"line {lines[jump]}",
                         right="Rows must be evenly spaced, without a missing one")
    if rate != stated_hz:
        rate = _whole(rate, time_s, rounding)
    return rate


def _rounding(time_s: np.ndarray) -> float:
    """The last decimal of the times, s; zero where they have more than seven."""
    sample = time_s[:: max(1, len(time_s) // 1000)]
    for decimals in range(1, 8):
        if np.abs(sample - np.round(sample, decimals)).max() < 1e-10 * max(1.0, np.abs(sample).max()):
            return 10.0**-decimals
    return 0.0


def _whole(rate: float, time_s: np.ndarray, rounding: float) -> float:
    """A whole number of rows a second where rounding allows it."""
    whole = float(round(rate))
    drift = abs(1.0 / rate - 1.0 / whole) * len(time_s) if whole else np.inf
    return whole if drift <= max(2.0 * rounding, 1e-9) else rate
