"""The low-pass of what is defined under load only."""

from __future__ import annotations

import numpy as np

from vsf_drake.analysis.comparison import filtered_while_loaded


def path_of(time: np.ndarray) -> np.ndarray:
    """A step of 0.7 s with a noisy centre of pressure, whose smooth load passes 20 N later than the raw one."""
    loaded = (time > 0.4195) & (time < 1.1175)
    vertical = np.where(loaded, 22.0 + 800.0 * np.sin(np.pi * np.clip((time - 0.4695) / 0.598, 0.0, 1.0)), 0.0)
    noise = 0.02 * np.random.default_rng(3).standard_normal(len(time))
    cop = np.where(loaded, time + noise, np.nan)[:, np.newaxis]
    instants = np.linspace(0.44, 1.09, 101)
    return filtered_while_loaded(cop, time, vertical, cop, instants)[:, 0]


def test_clock_that_is_off_by_rounding_gives_the_same_path():
    """A time of 0.42 s in a file and 420 steps of 1 ms are not the same double; no sample may hang on that."""
    written = np.array([float(f"{i / 1000:.3f}") for i in range(1500)])
    exact = path_of(written)
    for off in (1e-12, -1e-12):
        clock = written + off * (written > 0.0)  # the first sample stands, so that no even grid follows
        assert np.nanmax(np.abs(path_of(clock) - exact)) < 1e-6
        assert (np.isfinite(path_of(clock)) == np.isfinite(exact)).all()
