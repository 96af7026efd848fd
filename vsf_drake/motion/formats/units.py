"""How laboratory files spell labels, units and times; large arrays a piece at a time."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vsf_drake.base.errors import InputError
from vsf_drake.base.sentences import say

# metres in each unit of length
LENGTHS_M = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "dm": 1e-1, "in": 0.0254}
_LONG = {
    "meter": "m",
    "metre": "m",
    "centimeter": "cm",
    "centimetre": "cm",
    "millimeter": "mm",
    "millimetre": "mm",
    "inch": "in",
    "inches": "in",
}


def listed(labels: Sequence[str], *, most: int = 20) -> str:
    """The labels, or the first of them and how many there are more; "none" without any."""
    if len(labels) <= most:
        return ", ".join(labels) or "none"
    return f"{', '.join(labels[:most])} and {len(labels) - most} more"


def first_of_each(
    labels: Sequence[str], notes: list[str], empty: Callable[[int], bool], *, what: str = "label"
) -> list[int]:
    """Which of the labels to read, each once: the first that is not `empty`; `notes` gets what was
    left out."""
    places: dict[str, list[int]] = {}
    for i, label in enumerate(labels):
        places.setdefault(label, []).append(i)
    chosen = {
        label: columns[0]
        if len(columns) == 1
        else next((i for i in columns if not empty(i)), columns[0])
        for label, columns in places.items()
    }
    notes += [
        note
        for label, columns in places.items()
        if len(columns) > 1
        for note in say(
            "files",
            "doubled",
            what=what,
            label=label,
            times=len(columns),
            column=chosen[label] + 1,
            columns=len(labels),
        )
    ]
    return sorted(chosen.values())


def length_factor(unit: str) -> float | None:
    """Metres in a unit of length as files spell it, cut to four letters or more too; None for an
    unknown or empty one.
    """
    plain = unit.strip().lower().strip("[]().\0 ")
    cut = {short for word, short in _LONG.items() if len(plain) >= 4 and word.startswith(plain)}
    plain = _LONG.get(plain.removesuffix("s"), cut.pop() if len(cut) == 1 else plain)
    return LENGTHS_M.get(plain)


def moment_factor(unit: str) -> float | None:
    """N m in a unit such as "Nmm", "N.m", "N*mm" or "N-m"; None for anything else."""
    match = re.fullmatch(r"n(?:ewton)?\s*[.*·\-\s]?\s*(\w+)", unit.strip().lower().strip("[]()\0 "))
    return length_factor(match.group(1)) if match else None


def wanted_length_factor(wanted: str) -> float:
    """Metres in the unit that the user demands; refused if it is none."""
    factor = length_factor(wanted)
    if factor is None:
        raise InputError(
            f"{wanted!r} is no unit of length",
            where="laboratory.length_unit (--length-unit)",
            right=f"Use one of {', '.join(LENGTHS_M)}",
        )
    return factor


def file_length_factor(stated: str, wanted: str | None, path: Path, where: str) -> float:
    """Metres in the unit that the user demands, or else the file states; refused if neither tells
    it."""
    if wanted is not None:
        return wanted_length_factor(wanted)
    factor = length_factor(stated)
    if factor is None:
        what = (
            f"the unit {stated!r} is unknown" if stated.strip() else "no unit of length is stated"
        )
        raise InputError(
            what,
            file=path,
            where=where,
            right=f"Give laboratory.length_unit (--length-unit): {', '.join(LENGTHS_M)}",
        )
    return factor


# The time column of a recording: increasing, without gaps, and freed from rounding.


# a step longer than this, or than so many median ones, is a gap
LONGEST_STEP_S = 0.1
LONGEST_STEPS = 5.0
LATEST_S = 1e7  # seconds; four months of recording
# a stated rate may differ from that of the times by this share (29.97 against 30 Hz is 1e-3)
RATE_SHARE = 2e-3
# a time may lie this share of a step off the even ones (clock jitter), or by its rounding
STEP_SHARE = 0.05
FINEST_S = 5e-10  # half the finest rounding that is told from a number in full
TIE = 1e-6  # share of half a unit within which a time lies half-way between two
# steps of a clock that are tried, each of which halves what is left; after 60 no number lies
# between
MOST_PROBED = 100


class EvenClock(NamedTuple):
    """Instants `start_s` + i `step_s` whose rounding a time column is; `unit_s` is that of its
    coarsest last place."""

    start_s: float
    step_s: float
    unit_s: float

    def warnings(self, path: Path) -> list[str]:
        if self.unit_s < 0.9 * self.step_s or _whole(self.step_s, np.array(self.unit_s)):
            return []
        return say("files", "coarse_clock", file=path.name, unit_s=self.unit_s, step_s=self.step_s)


@np.errstate(all="ignore")
def even_clock(time_s: np.ndarray, *, jitter_s: float = 0.0) -> EvenClock | None:
    """The evenly spaced clock behind times (n,) s that were rounded to so many decimals, or
    significant digits.

    A clock explains the times if each lies within half a unit of its own last place, or within
    `jitter_s`. With step b, that leaves the start to [max(low_i - b i), min(high_i - b i)], whose
    length is concave in b: tried are a whole number of rows a second, the least-squares step, and
    then the side on which the interval grows. A single row that is missing or doubled is no clock
    that is slow or fast by one row in all. None where no rounding explains the times.
    """
    index = np.arange(len(time_s))
    if len(time_s) < 2 or (np.diff(time_s) < 0.0).any() or not time_s[0] < time_s[-1]:
        return None
    fitted = _fitted_step(time_s)
    if not 0.0 < fitted < np.inf:
        return None
    whole = 1.0 / max(1.0, np.round(1.0 / fitted))
    usual = np.median(np.diff(time_s))
    for unit in _last_places(time_s):
        slips = (np.abs(np.diff(time_s) - usual) > 0.9 * usual) & (unit[1:] <= usual * (1.0 + TIE))
        if np.count_nonzero(slips) == 1:
            continue
        least, most = (
            (time_s[-1] - time_s[0] + sign * (unit[0] + unit[-1] + 2.0 * jitter_s)) / index[-1]
            for sign in (-1.0, 1.0)
        )
        for probe in range(MOST_PROBED):
            step = (whole, fitted, 0.5 * (least + most))[min(probe, 2)]
            half = np.maximum(
                0.5 * unit * (1.0 + TIE * np.where(_whole(step, unit), -1.0, 1.0)),
                max(jitter_s, FINEST_S),
            )
            first = time_s - half - index * step
            last = time_s + half - index * step
            i = int(np.argmax(first))
            j = int(np.argmin(last))
            if first[i] <= last[j]:
                fits = first[i] <= time_s[0] <= last[j]
                start = time_s[0] if fits else 0.5 * (first[i] + last[j])
                return EvenClock(float(start), float(step), float(np.max(unit)))
            if first[i] - last[j] > (i - j) * ((most if i > j else least) - step):
                break
            least, most = (max(least, step), most) if i > j else (least, min(most, step))
    return None


def _fitted_step(time_s: np.ndarray) -> float:
    return float(np.polynomial.Polynomial.fit(np.arange(len(time_s)), time_s, 1).convert().coef[1])


def _whole(step_s: float, unit: np.ndarray) -> np.ndarray:
    with np.errstate(all="ignore"):
        times = step_s / unit
        return (times > 0.5) & (np.abs(times - np.round(times)) < 1e-4)


def _last_places(time_s: np.ndarray) -> Iterator[np.ndarray]:
    """(n,) s, the unit of each time's last place: if all have as many decimals, if all have as many
    digits."""
    size = np.maximum(np.abs(time_s), 1e-300)
    digits = 10.0 ** np.floor(np.log10(size) + 1e-12)
    for place in (np.ones(len(time_s)), np.maximum(digits, FINEST_S)):
        units = (place * 10.0**-n for n in range(13))
        within = np.minimum(1e-10 * np.maximum(1.0, size), 0.01 * place)
        yield next(
            (
                unit
                for unit in units
                if (np.abs(time_s - np.round(time_s / unit) * unit) < within).all()
            ),
            np.zeros(len(time_s)),
        )


def check_clock(
    time_s: np.ndarray, lines: np.ndarray, path: Path, *, rows: int = 2
) -> tuple[np.ndarray, list[str]]:
    """The instants of a recording, freed from rounding, and what is doubtful about them; refused if
    they are no clock.

    Times such as 0.4, 0.417, 0.433, differentiated twice, make accelerations of tens of rad/s^2.
    What is truly uneven, or even to a microsecond, stays. Time must increase without a step longer
    than 0.1 s or five median steps.
    """
    time = time_s
    warnings = list[str]()
    if len(time) < rows:
        raise InputError(f"has {len(time)} rows", file=path, right=f"At least {rows} are needed")
    even = even_clock(time)
    if even is not None:
        instants = even.start_s + np.arange(len(time)) * even.step_s
        time = time if np.abs(instants - time).max() <= 1e-6 else instants
        warnings = even.warnings(path)
    step = np.diff(time)
    back = step <= 0.0
    gap = step > min(LONGEST_STEP_S, LONGEST_STEPS * float(np.median(step))) * (1.0 + 1e-9)
    wrong = back if back.any() else gap
    if wrong.any():
        row = int(np.argmax(wrong)) + 1
        where = f"line {lines[row]}, time {time_s[row]:g} s"
        if back.any():
            raise InputError(
                f"time does not increase: {time[row]:g} s follows {time[row - 1]:g} s",
                file=path,
                where=where,
            )
        raise InputError(
            f"there is a gap of {step[row - 1]:.4g} s after {time[row - 1]:g} s (median step "
            f"{np.median(step):.4g} s)",
            file=path,
            where=where,
            right="Fill the gap in the recording, or cut it there",
        )
    return time, warnings


def even_rate(
    time_s: np.ndarray, lines: np.ndarray, path: Path, *, stated_hz: float | None = None
) -> tuple[float, float, list[str]]:
    """Rate (1/s) and start (s) of rows that are evenly spaced but for rounding or jitter, and what
    is doubtful.

    The rate is `stated_hz`, which the header says, where the times agree; uneven times are refused.
    """
    if len(time_s) < 2:
        raise InputError(
            f"has {len(time_s)} rows of numbers", file=path, right="At least 2 are needed"
        )
    bad = ~(np.abs(time_s) < LATEST_S)
    if bad.any():
        raise InputError(
            "the time is not a believable number",
            file=path,
            where=f"line {lines[int(np.argmax(bad))]}, column Time",
        )
    if time_s[-1] <= time_s[0]:
        raise InputError(
            f"the times run from {time_s[0]:g} to {time_s[-1]:g} s",
            file=path,
            where="column Time",
            right="They must increase",
        )
    step = _fitted_step(time_s)
    if not 0.0 < step < np.inf:
        raise InputError("the times do not increase evenly", file=path, where="column Time")
    even = even_clock(time_s)
    if even is None and even_clock(time_s, jitter_s=STEP_SHARE * step) is None:
        units = np.max(list(_last_places(time_s)), axis=0)
        steps = np.diff(time_s)
        jump = int(np.argmax(np.abs(steps - np.median(steps)) - (units[1:] + units[:-1]))) + 1
        raise InputError(
            f"time {time_s[jump]:g} s follows {time_s[jump - 1]:g} s, where rows are "
            f"{np.median(steps):.6g} s apart",
            file=path,
            where=f"line {lines[jump]}",
            right="Rows must be evenly spaced, without a missing one",
        )
    even = even or EvenClock(float(time_s[0]), step, 0.0)
    rate = 1.0 / even.step_s
    slack = RATE_SHARE + 2.0 * even.unit_s / (time_s[-1] - time_s[0])
    if stated_hz is not None and abs(stated_hz / rate - 1.0) <= slack:
        rate = stated_hz
    return rate, even.start_s, even.warnings(path)
