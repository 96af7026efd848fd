"""What a materials testing machine told of a foot, as a file: stiffness and displacement by fulcrum position.

    name: subject 3's foot
    synthetic: false
    forefoot: [{fulcrum_mm: 66, stiffness_n_per_mm: 10.0}, {fulcrum_mm: 151, stiffness_n_per_mm: 32.0}]
    heel_stiffness_n_per_mm: 65.0
    stiffness_uncertainty_n_per_mm: 0.5
    max_load_n: 600

Stiffness is the mean slope from 200 N, above which the foam no longer dominates, up to `max_load_n` (McGeehan 2021,
eq. 3, doi 10.1115/1.4050456). `synthetic` and the heel may be left out. The mid-range displacement, that of the platen
since it touched the foot at half of `max_load_n`, may be added, at all settings or at none:

    forefoot: [{fulcrum_mm: 66, stiffness_n_per_mm: 10.0, mid_range_displacement_mm: 30.2}]
    heel_mid_range_displacement_mm: 5.1
    displacement_uncertainty_mm: 0.5
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from vsf_drake.errors import InputError
from vsf_drake.schema import load_yaml, quantity

STIFFNESS_ABOVE_N = 200.0
"""Load (N) from which the slope counts."""
_LOWEST, _HIGHEST = 0.1, 1000.0
_SHORTEST, _LONGEST = 0.01, 300.0


@dataclass(frozen=True, kw_only=True)
class BenchMeasurement:
    """A measured bench, SI.

    Attributes:
        name: whose foot; synthetic: whether nobody measured it.
        fulcrum_m: (n,) m from the keel's posterior end A, increasing.
        stiffness_n_per_m: (n,) N/m of the forefoot there, the mean slope from 200 N to `max_load_n`.
        heel_stiffness_n_per_m: N/m, likewise; None where it was not measured.
        uncertainty_n_per_m: N/m, standard deviation of each stiffness.
        max_load_n: N.
        mid_range_m: (n,) m of the platen since it touched the forefoot at half of `max_load_n`; None if not known.
        heel_mid_range_m: m, likewise; known where `mid_range_m` and the heel's stiffness are.
        mid_range_uncertainty_m: m, standard deviation of each of these; known where they are.
    """

    name: str
    synthetic: bool
    fulcrum_m: tuple[float, ...]
    stiffness_n_per_m: tuple[float, ...]
    heel_stiffness_n_per_m: float | None
    uncertainty_n_per_m: float
    max_load_n: float
    mid_range_m: tuple[float, ...] | None = None
    heel_mid_range_m: float | None = None
    mid_range_uncertainty_m: float | None = None


@dataclass(frozen=True, kw_only=True)
class _Setting:
    """The forefoot at one position of the fulcrum."""

    fulcrum_mm: float = quantity(unit="mm", low=10.0, high=1000.0, source="set on the device, from the keel's end A")
    stiffness_n_per_mm: float = quantity(unit="N/mm", low=_LOWEST, high=_HIGHEST, source="measured")
    mid_range_displacement_mm: float | None = quantity(None, unit="mm", low=_SHORTEST, high=_LONGEST, source="measured")


@dataclass(frozen=True, kw_only=True)
class _BenchFile:
    """The keys of a bench file; see the module's example."""

    name: str
    synthetic: bool = False
    forefoot: tuple[_Setting, ...]
    heel_stiffness_n_per_mm: float | None = quantity(None, unit="N/mm", low=_LOWEST, high=_HIGHEST, source="measured")
    stiffness_uncertainty_n_per_mm: float = quantity(unit="N/mm", low=1e-4, high=_HIGHEST, source="stated")
    max_load_n: float = quantity(unit="N", low=0.0, high=1e5, source="measured")
    heel_mid_range_displacement_mm: float | None = quantity(
        None, unit="mm", low=_SHORTEST, high=_LONGEST, source="measured")
    displacement_uncertainty_mm: float | None = quantity(None, unit="mm", low=1e-4, high=_LONGEST, source="stated")


def load_bench_file(path: str | Path) -> BenchMeasurement:
    """Reads a bench file.

    Raises:
        InputError: the file is missing or is not YAML; a key is unknown, doubled or missing; a value has the wrong
            type, is not finite or is out of range; there is no setting, or the fulcrum positions do not increase;
            the largest load is not above 200 N; mid-range displacements are given of some settings only.
    """
    read = load_yaml(path, _BenchFile)
    if not read.forefoot:
        raise InputError("holds no setting", file=path, where="forefoot",
                         right="It must list fulcrum_mm and stiffness_n_per_mm at one position or more")
    for i, (before, after) in enumerate(pairwise(read.forefoot), start=1):
        if not after.fulcrum_mm > before.fulcrum_mm:
            twice = after.fulcrum_mm == before.fulcrum_mm
            raise InputError(
                f"{after.fulcrum_mm:g} mm " + ("stands twice" if twice else f"follows {before.fulcrum_mm:g} mm"),
                file=path, where=f"forefoot[{i}].fulcrum_mm", right="Positions must increase, each given once")
    if not read.max_load_n > STIFFNESS_ABOVE_N:
        raise InputError(f"{read.max_load_n:g} N leaves nothing of the curve: stiffness is the mean slope above "
                         f"{STIFFNESS_ABOVE_N:g} N", file=path, where="max_load_n",
                         right="It must be the largest load of the test, in N")
    heel, heel_x, sd = (read.heel_stiffness_n_per_mm, read.heel_mid_range_displacement_mm,
                        read.displacement_uncertainty_mm)
    displaced = _mid_range_mm(read, path)
    return BenchMeasurement(
        name=read.name, synthetic=read.synthetic, fulcrum_m=tuple(s.fulcrum_mm / 1e3 for s in read.forefoot),
        stiffness_n_per_m=tuple(1e3 * s.stiffness_n_per_mm for s in read.forefoot),
        heel_stiffness_n_per_m=None if heel is None else 1e3 * heel,
        uncertainty_n_per_m=1e3 * read.stiffness_uncertainty_n_per_mm, max_load_n=read.max_load_n,
        mid_range_m=None if displaced is None else tuple(x / 1e3 for x in displaced),
        heel_mid_range_m=None if heel_x is None else heel_x / 1e3,
        mid_range_uncertainty_m=None if sd is None else sd / 1e3)


def _mid_range_mm(read: _BenchFile, path: str | Path) -> tuple[float, ...] | None:
    """The forefoot's mid-range displacements; None where the file has none. Raises InputError for half of them."""
    given = {f"forefoot[{i}].mid_range_displacement_mm": s.mid_range_displacement_mm
             for i, s in enumerate(read.forefoot)}
    needed: dict[str, float | None] = {**given, "displacement_uncertainty_mm": read.displacement_uncertainty_mm}
    right = "Give the mid-range displacement of every setting that has a stiffness, and displacement_uncertainty_mm"
    if read.heel_stiffness_n_per_mm is not None:
        needed["heel_mid_range_displacement_mm"] = read.heel_mid_range_displacement_mm
    elif read.heel_mid_range_displacement_mm is not None:
        raise InputError("there is no heel_stiffness_n_per_mm beside it", file=path,
                         where="heel_mid_range_displacement_mm", right=right)
    missing = [key for key, value in needed.items() if value is None]
    if missing and len(missing) < len(needed):
        raise InputError("the key is missing, and others of the mid-range displacement are there", file=path,
                         where=missing[0], right=right)
    return None if missing else tuple(x for x in given.values() if x is not None)
