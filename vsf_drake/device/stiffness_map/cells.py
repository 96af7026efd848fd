"""One cell of the map: a load, the foot under it in the roll-over machine, and what describes the
foot then.

The load is a force along the pylon, in body weights, and the tilt of the ground, over one stance;
the cell's mass makes newtons of it. A slope turns the ground by its angle all through the stance
(uphill positive), an alignment the foot against the pylon (toe up positive), and the force stays
along the pylon: how a person changes on a slope is not in it. In the machine the foot's own axis is
the line of force. Without friction the ground's force is its normal one, N = F / cos(tilt), so a
turned foot is given the force that leads to the same N.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator

from vsf_drake.base.errors import InputError, SimulationError, require
from vsf_drake.base.text_table import table_rows, text_lines
from vsf_drake.device.roll_over import STEP_S, Load, energy_taken, returned_late, rolled_row
from vsf_drake.model.parameters import GRAVITY, FootParameters
from vsf_drake.simulation.bench_stiffness import BenchStiffness
from vsf_drake.simulation.roll_over import Following, Rolling, RollOver, RollOverRun

# over which a loading rate is taken: shorter ones tell the time step (a choice)
RATE_WINDOW_S = 0.02
COLUMNS = ("time_s", "tilt_deg", "force_bw")
_FEWEST_ROWS = 10
_DURATION_S = (0.2, 3.0)
_LARGEST_TILT_DEG = 45.0
_PEAK_BW = (0.3, 5.0)
_FIRST_SHARE = 0.05
_HEEL = "heel"  # how the names of the heel's contact zones begin


@dataclass(frozen=True, kw_only=True)
class Cell:
    """Where the map is asked; the fields are its axes."""

    mass_kg: float
    slope_deg: float
    fulcrum_mm: float
    alignment_deg: float
    heel_ratio: float  # of the heel's contact stiffness to the model's own


ROLLED = {
    "stiffness": (
        "N/mm",
        "forefoot stiffness in the testing machine, mean slope from 200 to 600 N",
    ),
    "radius": ("m", "radius of the circle nearest to the roll-over shape"),
    "eflr": ("1", "effective foot length, along the sole, over the foot's length"),
    "moment_arm": (
        "mm",
        (
            "mean moment arm under the load about the pylon's end, toe up positive: not that in "
            "walking"
        ),
    ),
    "stored": ("J", "largest energy in keel, fulcrum and foam in the second half of stance"),
    "returned": ("J", "energy given back after that"),
    "loading_rate": (
        "kN/s",
        "largest mean rate of the ground's force over 20 ms in the first half of stance; the "
        "load's own, since the force is given",
    ),
}
"""What the machines tell of a cell: unit and meaning; the load does not change the stiffness."""
# it passes through zero downhill: errors and bands of it are no shares of itself
SIGNED = "moment_arm"


def load_profile(path: str | Path, step_s: float = STEP_S) -> Load:
    """A load of one's own: a CSV file with the columns of `COLUMNS`, one row an instant of one
    stance."""
    path = Path(path)
    lines = (
        (number, line)
        for number, line in text_lines(path)
        if line.strip() and not line.startswith("#")
    )
    number, heading = next(lines, (0, ""))
    labels = [cell.strip() for cell in heading.split(",")]
    needed = f"It needs the columns {', '.join(COLUMNS)}"
    require(
        sorted(labels) == sorted(COLUMNS),
        f"has the columns {heading[:60]!r}" if number else "is empty",
        f"line {number}",
        needed,
        file=path,
    )
    rows, _, _ = table_rows(lines, labels, path, lambda line: line.split(","))
    require(
        np.isfinite(rows).all(),
        "a cell is blank",
        "rows",
        "Every row needs three numbers",
        file=path,
    )
    require(
        len(rows) >= _FEWEST_ROWS,
        f"has {len(rows)} rows",
        "rows",
        f"It needs {_FEWEST_ROWS} or more",
        file=path,
    )
    time, tilt, force = (rows[:, labels.index(name)] for name in COLUMNS)
    time = time - time[0]
    low, high = _DURATION_S
    require((np.diff(time) > 0.0).all(), "does not rise", "time_s", file=path)
    require(
        low <= time[-1] <= high,
        f"lasts {time[-1]:g} s",
        "time_s",
        f"A stance lasts {low:g} to {high:g} s",
        file=path,
    )
    require(
        np.abs(tilt).max() <= _LARGEST_TILT_DEG,
        f"reaches {np.abs(tilt).max():g} degrees",
        "tilt_deg",
        f"It must be within {_LARGEST_TILT_DEG:g} degrees",
        file=path,
    )
    low, high = _PEAK_BW
    require(
        low <= force.max() <= high,
        f"peaks at {force.max():g} body weights",
        "force_bw",
        f"It must peak between {low:g} and {high:g}: divide newtons by the weight",
        file=path,
    )
    require(
        force.min() >= 0.0 and force[0] <= _FIRST_SHARE * force.max(),
        f"begins with {force[0]:g} and falls to {force.min():g} body weights",
        "force_bw",
        f"It must not be negative, and begin below {100 * _FIRST_SHARE:g} % of its peak",
        file=path,
    )
    even = np.linspace(0.0, time[-1], round(time[-1] / step_s) + 1)
    share = np.maximum(PchipInterpolator(time, force)(even), 0.0)
    late = even > 0.5 * even[-1]
    return Load(
        name=path.name,
        time_s=even,
        tilt_rad=np.radians(PchipInterpolator(time, tilt)(even)),
        force_bw=share,
        shape_ends_s=float(even[late][np.argmax(share[late])]),
    )


def with_heel(foot: FootParameters, ratio: float) -> FootParameters:
    """The foot with its heel's contact stiffness and damping times `ratio`."""
    zones = tuple(
        replace(
            zone, stiffness=ratio * zone.stiffness, damping_n_s_per_m=ratio * zone.damping_n_s_per_m
        )
        if zone.name.startswith(_HEEL)
        else zone
        for zone in foot.zones
    )
    if ratio != 1.0 and zones == foot.zones:
        raise InputError(
            f"the model has no contact zone whose name begins with {_HEEL!r}",
            where="heel_ratio",
            right="Leave it at 1",
        )
    return replace(foot, zones=zones)


@dataclass(frozen=True, kw_only=True)
class Rolled:
    """What a cell came to."""

    values: dict[str, float]  # of ROLLED, NaN where it cannot be known
    residual: float  # largest difference from the wanted force, over its largest
    follows: bool
    failure: str = ""


def roll_cells(foot: FootParameters, load: Load, cells: Sequence[Cell]) -> list[Rolled]:
    """Rolls one foot (its heel as it is) through cells, in one machine; a task for a worker
    process."""
    machine = RollOver(foot, friction=False)
    positions = sorted({1e-3 * cell.fulcrum_mm for cell in cells})
    pressed = BenchStiffness(foot, fulcrums_m=positions, heel=False).evaluate({})[0]
    stiffness = dict(zip(positions, 1e-3 * pressed, strict=True))
    outcomes = machine.roll_side_by_side([_rolling(load, cell) for cell in cells])
    return [
        _failed(cell, outcome)
        if isinstance(outcome, SimulationError)
        else _rolled(machine, load, cell, outcome, float(stiffness[1e-3 * cell.fulcrum_mm]))
        for cell, outcome in zip(cells, outcomes, strict=True)
    ]


def _rolling(load: Load, cell: Cell) -> Rolling:
    line = _line(load, cell)
    tilt = line - np.radians(cell.alignment_deg)
    return Rolling(
        fulcrum_m=1e-3 * cell.fulcrum_mm,
        time_s=load.time_s,
        tilt_rad=tilt,
        force_n=cell.mass_kg * GRAVITY * load.force_bw * np.cos(tilt) / np.cos(line),
    )


def _line(load: Load, cell: Cell) -> np.ndarray:
    """(n + 1,) rad, of the pylon's line against the ground."""
    return np.asarray(load.tilt_rad + np.radians(cell.slope_deg))


def _failed(cell: Cell, error: SimulationError) -> Rolled:
    return Rolled(
        values=dict.fromkeys(ROLLED, np.nan),
        residual=np.nan,
        follows=False,
        failure=(
            f"{cell.mass_kg:g} kg, slope {cell.slope_deg:g} deg, fulcrum {cell.fulcrum_mm:g} "
            f"mm: {error}"
        ),
    )


def _rolled(
    machine: RollOver,
    load: Load,
    cell: Cell,
    outcome: tuple[RollOverRun, Following],
    stiffness: float,
) -> Rolled:
    run, following = outcome
    row, _ = rolled_row(machine, run, following, 1e-3 * cell.fulcrum_mm, load)
    step = float(load.time_s[1])
    window = max(1, round(RATE_WINDOW_S / step))
    normal = cell.mass_kg * GRAVITY * load.force_bw / np.cos(_line(load, cell))
    rises = (normal[window:] - normal[:-window])[load.time_s[window:] <= 0.5 * load.duration_s]
    values = {
        "stiffness": stiffness,
        "radius": row.radius_m,
        "eflr": row.effective_foot_length_ratio,
        "moment_arm": None if row.mean_moment_arm_m is None else 1e3 * row.mean_moment_arm_m,
        "stored": row.stored_forefoot_j,
        "returned": returned_late(run.time_s, *energy_taken(run)),
        "loading_rate": 1e-3 * float(rises.max()) / (window * step),
    }
    return Rolled(
        values={name: np.nan if value is None else value for name, value in values.items()},
        residual=row.residual_n / float(following.wanted_n.max()),
        follows=row.follows,
    )
