"""Zero-phase low-pass filter of recordings and results.

A Butterworth section run forward and then backward has no phase lag and twice the order,
but also twice the attenuation: its amplitude at the design cut-off is 1/2, not 1/sqrt(2). So
the section is designed with a higher cut-off, such that -3 dB of the *whole* lies at the
frequency that was asked for (Winter 2009, Biomechanics and Motor Control of Human Movement,
4th ed., section 3.4.4.2: for two passes of second order the factor is (sqrt(2) - 1)**(1/4) =
0.802). The correction is applied to the pre-warped frequency tan(pi f / f_s), where it is
exact for the discrete filter; applied to f itself it would be off near the Nyquist frequency.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfiltfilt

from vsf_drake.errors import InputError


def low_pass(values: np.ndarray, *, rate_hz: float, cutoff_hz: float, order: int = 4) -> np.ndarray:
    """`values` (n,) or (n, m) without what is faster than `cutoff_hz`, in phase with the input.

    At the cut-off the amplitude is 1/sqrt(2). `order` is that of the result: two passes of order / 2. The ends are
    extended by odd reflection over two periods of the cut-off (or the length of the record), which keeps level and
    slope there. InputError where the cut-off is impossible at this rate, or a value is not finite.
    """
    values = np.asarray(values, dtype=float)
    if order < 2 or order % 2:
        raise ValueError(f"the order of a filter with two passes must be even, not {order}")
    if not 0.0 < cutoff_hz < rate_hz / 2:
        raise InputError(f"a cut-off of {cutoff_hz:g} Hz is impossible at {rate_hz:g} samples per second",
                         right=f"It must be above 0 and below {rate_hz / 2:g} Hz")
    if len(values) < 2:
        raise InputError(f"{len(values)} samples cannot be filtered")
    if not np.isfinite(values).all():
        row = int(np.argwhere(~np.isfinite(values))[0][0])
        raise InputError(f"sample {row} (after {row / rate_hz:g} s) is not a finite number and cannot be filtered")
    warped = np.tan(np.pi * cutoff_hz / rate_hz) / (np.sqrt(2.0) - 1.0) ** (1.0 / order)
    sos = butter(order // 2, rate_hz / np.pi * np.arctan(warped), fs=rate_hz, output="sos")
    extension = min(len(values) - 1, int(np.ceil(2.0 * rate_hz / cutoff_hz)))
    return sosfiltfilt(sos, values, axis=0, padtype="odd", padlen=extension)
