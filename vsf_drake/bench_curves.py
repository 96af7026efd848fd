"""Load-displacement curves of a materials testing machine, from a CSV file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsf_drake.errors import InputError


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredCurve:
    """One pass of the machine while it loads.

    Attributes:
        fulcrum_m: m from the keel's posterior end A; None for the heel.
        repeat: number of the pass at this setting, from 1.
        displacement_m: (n,) m of the platen, increasing, 0 where it touches the foot.
        load_n: (n,) N.
    """

    fulcrum_m: float | None
    repeat: int
    displacement_m: np.ndarray
    load_n: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class BenchCurves:
    """Measured curves of one foot.

    Attributes:
        name: whose foot, or the file's name. synthetic: whether nobody measured it.
        curves: at least one, by fulcrum position and repeat, the heel last.
    """

    name: str
    synthetic: bool
    curves: tuple[MeasuredCurve, ...]


def load_bench_curves(path: str | Path) -> BenchCurves:
    """Reads a file of load-displacement curves.

    Raises:
        InputError: always, yet.
    """
    raise InputError("cannot be read yet", file=path)
