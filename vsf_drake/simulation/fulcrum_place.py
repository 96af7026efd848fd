"""Where the fulcrum is to stand, as people say it: in mm, or by the stiffness that they know."""

from __future__ import annotations

import re
from pathlib import Path

from scipy.optimize import brentq

from vsf_drake.base.errors import InputError, require
from vsf_drake.model.model_file import NO_FULCRUM, stated_fulcrum
from vsf_drake.model.parameters import FootParameters
from vsf_drake.model.setting import moves
from vsf_drake.simulation.bench_stiffness import BenchStiffness

READ_N_PER_MM = 0.005  # half of the last digit with which `vsf-drake bench` prints a stiffness
_SAID = re.compile(r"\s*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))\s*(\S*)\s*")
_RIGHT = (
    "Write it in mm from the keel's posterior end, such as 108, or as the forefoot's stiffness, "
    "such as 16N/mm"
)


def fulcrum_place(
    said: float | str | None,
    foot: FootParameters,
    *,
    default_m: float | None = None,
    file: str | Path | None = None,
    where: str = "fulcrum",
) -> float:
    """The fulcrum's position (m from the keel's posterior end A) that somebody `said`.

    Args:
        said: mm from A, such as 108, "108" or "108 mm"; or the forefoot's stiffness, "16 N/mm":
            the slope from 200 to 600 N that `vsf-drake bench` finds of `foot` there. None:
            `default_m`; of a passive foot, for which nothing may be said, where its keel is
            clamped.
        foot: the device, without a fitted contact, so that one saying is one position.
        file, where: what messages call it.

    Raises:
        InputError: nothing is said and nothing is the default; another unit; out of reach; a
            passive foot.
    """
    require(said is None or moves(foot), NO_FULCRUM, where, "Leave it out", file=file)
    if said is None:
        return stated_fulcrum(None, foot, default_m=default_m, file=file, where=where)
    told = _SAID.fullmatch(str(said))
    unit = told and told[2].lower()
    if told is None or unit not in ("", "mm", "n/mm"):
        raise InputError(
            f"{said!r} is no position of the fulcrum", file=file, where=where, right=_RIGHT
        )
    number = float(told[1])
    low = foot.fulcrum.rearmost_m
    high = foot.fulcrum.foremost_m
    if unit != "n/mm" and low - 1e-9 <= 1e-3 * number <= high + 1e-9:
        return stated_fulcrum(number, foot, file=file, where=where)

    def stiffness(at_m: float) -> float:
        [found] = BenchStiffness(foot, fulcrums_m=(at_m,), heel=False).evaluate({})[0]
        return float(1e-3 * found)

    soft = stiffness(low)
    stiff = stiffness(high)
    within = soft - READ_N_PER_MM <= number <= stiff + READ_N_PER_MM
    if unit != "n/mm":
        require(
            not within,
            f"the fulcrum at {number:g} mm is out of the carriage's reach",
            where,
            f"It must be between {1e3 * low:g} and {1e3 * high:g} mm. Is it a stiffness? Then "
            f"write {number:g}N/mm",
            file=file,
        )
        return stated_fulcrum(number, foot, file=file, where=where)
    require(
        within,
        f"no position of the fulcrum gives the forefoot {number:g} N/mm",
        where,
        f"This foot reaches {soft:.2f} N/mm (fulcrum at {1e3 * low:g} mm) to {stiff:.2f} N/mm "
        f"({1e3 * high:g} mm)",
        file=file,
    )
    asked = min(max(number, soft), stiff)
    return float(brentq(lambda at_m: stiffness(at_m) - asked, low, high, xtol=1e-8))
