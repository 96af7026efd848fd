"""The time column of a recording: increasing, without gaps, and freed from rounding."""

from __future__ import annotations

import numpy as np

from vsf_drake.errors import InputError
from vsf_drake.motion.storage import Storage

GAP_S = 0.1
GAP_STEPS = 5.0


def check_clock(storage: Storage, *, rows: int = 2) -> None:
    """Refuses a recording whose time cannot be interpolated.

    Args:
        storage: the recording.
        rows: how many instants are needed.

    Raises:
        InputError: there are fewer rows; time does not increase; a step is longer than 0.1 s or
            than five times the median step. The message names the line and the time.
    """
    time = storage.time_s
    if len(time) < rows:
        raise InputError(f"has {len(time)} rows", file=storage.path, right=f"At least {rows} are needed")
    step = np.diff(time)
    if (step <= 0.0).any():
        row = int(np.argmax(step <= 0.0)) + 1
        raise InputError(f"time does not increase: {time[row]:g} s follows {time[row - 1]:g} s",
                         file=storage.path, where=storage.place(row))
    longest = min(GAP_S, GAP_STEPS * float(np.median(step)))
    gap = step > longest * (1.0 + 1e-9)
    if gap.any():
        row = int(np.argmax(gap)) + 1
        raise InputError(f"there is a gap of {step[row - 1]:.4g} s after {time[row - 1]:g} s (median step "
                         f"{np.median(step):.4g} s)", file=storage.path, where=storage.place(row),
                         right="Fill the gap in the recording, or cut it there")


def even_time(time_s: np.ndarray) -> np.ndarray:
    """The evenly spaced instants behind a time column that was rounded to few decimals.

    Recordings at 60 Hz often carry times such as 0.4, 0.417, 0.433; differentiated twice, that
    rounding alone makes accelerations of tens of rad/s^2. Times at a whole number of samples per second,
    or failing that the least-squares even times, replace them where the difference is no more than
    their rounding explains; otherwise (truly uneven, or already even to a microsecond) they come
    back as they are.

    Args:
        time_s: (n,) s, increasing.
    """
    index = np.arange(len(time_s))
    line = np.polynomial.Polynomial.fit(index, time_s, 1)(index)
    decimals = next((d for d in range(2, 7) if np.allclose(time_s, np.round(time_s, d), rtol=0.0, atol=1e-10)), None)
    if decimals is None or np.abs(line - time_s).max() <= 1e-6:
        return time_s
    rate = max(1.0, np.round(1.0 / (line[1] - line[0])))
    for even, share in ((time_s[0] + index / rate, 0.5), (line, 0.7)):
        if np.abs(even - time_s).max() <= share * 1.000001 * 10.0**-decimals:
            return even
    return time_s
