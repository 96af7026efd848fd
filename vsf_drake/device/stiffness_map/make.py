"""Makes a map: every cell of a grid, cells that are held out to judge the surface, and other
contacts for its bands.

All run through the executor of any sweep: this process, others, or a cluster. The bands' contacts
are those that a fit would just have allowed (`fit.draws.contact_draws`); each is
rolled at the ends of every axis and between some, and how it differs from the model is interpolated
between.
"""

from __future__ import annotations

import itertools
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsf_drake.base.errors import SimulationError, require
from vsf_drake.base.schema import to_plain
from vsf_drake.device.roll_over import Load
from vsf_drake.device.stiffness_map.cells import ROLLED, Cell, Rolled, roll_cells, with_heel
from vsf_drake.device.stiffness_map.surface import (
    FEWEST_DRAWS,
    FEWEST_VALUES,
    FORMAT,
    LoadRecord,
    MapQuantity,
    MapTable,
    StiffnessMap,
)
from vsf_drake.fit.draws import contact_draws
from vsf_drake.model.contact_file import model_with
from vsf_drake.model.model_file import check_fulcrum, check_movable
from vsf_drake.model.parameters import FootParameters, ModelParameters, Subject
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.batch.processes import checked, chosen
from vsf_drake.simulation.walk import Walker

HELD_OUT = 40  # cells between those of the grid
DRAWS = 40
FULCRUMS = 9
COARSE = {"mass_kg": 3, "slope_deg": 2, "fulcrum_mm": 5, "alignment_deg": 2, "heel_ratio": 2}
"""Values of each axis at which drawn contacts are rolled, its ends among them."""
AXES = {
    "mass_kg": (20.0, 250.0),
    "slope_deg": (-15.0, 15.0),
    "fulcrum_mm": (0.0, 1000.0),
    "alignment_deg": (-10.0, 10.0),
    "heel_ratio": (0.1, 10.0),
}
"""Each axis with what it may be; the fulcrum's reach is the foot's."""
_SIDE = "right"  # of the person whose variables the draws name; the nominal foot has no side
_AT_ONCE = 32  # cells of a task


def standard_axes(foot: FootParameters) -> dict[str, tuple[float, ...]]:
    """225 cells: five masses, five slopes, and the carriage's reach."""
    reach = np.linspace(foot.fulcrum.rearmost_m, foot.fulcrum.foremost_m, FULCRUMS)
    return {
        "mass_kg": (50.0, 65.0, 80.0, 95.0, 110.0),
        "slope_deg": (-6.0, -3.0, 0.0, 3.0, 6.0),
        "fulcrum_mm": tuple(np.round(1e3 * reach, 9).tolist()),
        "alignment_deg": (0.0,),
        "heel_ratio": (1.0,),
    }


def check_axes(
    axes: Mapping[str, Sequence[float]], foot: FootParameters
) -> dict[str, tuple[float, ...]]:
    """`axes` in the order of AXES, each checked: in range, rising, one value or enough of them for
    a surface; InputError too for a foot whose support does not move."""
    check_movable(foot, "A map is over the fulcrum")
    made = {}
    for name, (low, high) in AXES.items():
        values = tuple(float(value) for value in axes[name])
        for value in values:
            require(
                low <= value <= high,
                f"{value:g} is out of range",
                name,
                f"It must be from {low:g} to {high:g}",
            )
            if name == "fulcrum_mm":
                check_fulcrum(1e-3 * value, foot, where=name)
        require(
            list(values) == sorted(set(values)),
            f"{', '.join(f'{value:g}' for value in values)} do not rise",
            name,
        )
        require(
            len(values) == 1 or len(values) >= FEWEST_VALUES,
            f"has {len(values)} values",
            name,
            f"A surface needs {FEWEST_VALUES} or more; give one value to hold it",
        )
        made[name] = values
    require(len(made["fulcrum_mm"]) > 1, "has one value", "fulcrum_mm", "A map is over the fulcrum")
    return made


@dataclass(frozen=True, kw_only=True)
class _Task:
    foot: FootParameters
    cells: tuple[Cell, ...]
    into: np.ndarray  # (cells, ROLLED), a view that takes the values
    replies: list[Rolled] = field(default_factory=list)


def make_map(
    model: ModelParameters,
    *,
    axes: Mapping[str, Sequence[float]],
    load: Load,
    draws: int = DRAWS,
    seed: int = 0,
    workers: int | None = None,
    executor: Any = None,
    inputs: Mapping[str, str] | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> tuple[MapTable, dict[str, np.ndarray]]:
    """The map of the model's foot: its table and arrays, see `StiffnessMap`.

    Args:
        axes: values of each axis, see `standard_axes`.
        draws: other contacts for the bands of 90 %, FEWEST_DRAWS or more; 0 for no bands.
        workers, executor: as of `simulation.batch.simulate_batch`.
        inputs: SHA-256 of what model and load were read from, by name, for the record.
    """
    began = time.perf_counter()
    require(
        draws == 0 or draws >= FEWEST_DRAWS,
        f"{draws} are too few for a band of 90 %",
        "draws",
        f"Give {FEWEST_DRAWS} or more, or 0 for no bands",
    )
    grid = check_axes(axes, model.foot)
    coarse = {
        name: tuple(
            dict.fromkeys(values[round(i)] for i in np.linspace(0, len(values) - 1, COARSE[name]))
        )
        for name, values in grid.items()
    }
    rng = np.random.default_rng([seed, 24])
    low, high = (np.array([values[end] for values in grid.values()]) for end in (0, -1))
    apart = low + (high - low) * rng.random((HELD_OUT, len(grid)))
    held = [Cell(**dict(zip(grid, map(float, row), strict=True))) for row in apart]
    feet = _drawn_feet(model, draws, seed)
    arrays = {
        "cells": np.full((*map(len, grid.values()), len(ROLLED)), np.nan),
        "held_out": np.full((HELD_OUT, len(ROLLED)), np.nan),
        "draws": np.full((len(feet), *map(len, coarse.values()), len(ROLLED)), np.nan),
    }
    every = [
        _Task(foot=with_heel(foot, heel), cells=part, into=into)
        for foot, cells, array in (
            (model.foot, _product(grid), arrays["cells"]),
            (model.foot, held, arrays["held_out"]),
            *((foot, _product(coarse), arrays["draws"][k]) for k, foot in enumerate(feet)),
        )
        for heel, part, into in _parts(cells, array.reshape(-1, len(ROLLED)))
    ]
    _run(every, load, workers, executor, progress)
    rolled = [(task.into, reply) for task in every for reply in task.replies]
    own = [reply for into, reply in rolled if np.shares_memory(into, arrays["cells"])]
    failures = [reply.failure for _, reply in rolled if reply.failure]
    if failures:
        raise SimulationError(
            f"{len(failures)} of {len(rolled)} cells cannot be rolled, first {failures[0]}. "
            "Narrow the ranges",
            time_s=0.0,
        )
    made = {
        f"{kind}/{name}": array[..., i]
        for kind, array in arrays.items()
        for i, name in enumerate(ROLLED)
    }
    made |= {"held_out/at": np.array([[getattr(cell, name) for name in grid] for cell in held])}
    table = MapTable(
        format=FORMAT,
        axes=grid,
        coarse=coarse,
        draws=len(feet),
        seed=seed,
        held_out=HELD_OUT,
        quantities=tuple(
            MapQuantity(name=name, unit=unit, meaning=meaning)
            for name, (unit, meaning) in ROLLED.items()
            if all(np.isfinite(made[f"{kind}/{name}"]).all() for kind in arrays)
        ),
        unknown={
            name: int(np.isnan(made[f"cells/{name}"]).sum())
            for name in ROLLED
            if np.isnan(made[f"cells/{name}"]).any()
        },
        cells=len(own),
        not_followed=sum(not reply.follows for reply in own),
        largest_residual=max(reply.residual for reply in own),
        load=LoadRecord(
            name=load.name,
            duration_s=load.duration_s,
            steps=len(load.time_s) - 1,
            shape_ends_s=load.shape_ends_s,
        ),
        foot=to_plain(model.foot),
        inputs=dict(inputs or {}),
        provenance=provenance(),
        wall_s=0.0,
    )
    made |= {
        "load/time_s": load.time_s,
        "load/tilt_rad": load.tilt_rad,
        "load/force_bw": load.force_bw,
    }
    return StiffnessMap(table, made).judged(time.perf_counter() - began), made


def _product(axes: Mapping[str, Sequence[float]]) -> list[Cell]:
    return [
        Cell(**dict(zip(axes, values, strict=True))) for values in itertools.product(*axes.values())
    ]


def _parts(
    cells: Sequence[Cell], array: np.ndarray
) -> Iterable[tuple[float, tuple[Cell, ...], np.ndarray]]:
    """Cells of one heel, some at a time, with the rows of the array that are theirs; its heels run
    fastest."""
    heels = list(dict.fromkeys(cell.heel_ratio for cell in cells))
    if len(heels) == len(cells):  # each its own: of those held out
        yield from ((cell.heel_ratio, (cell,), array[i : i + 1]) for i, cell in enumerate(cells))
        return
    for k, heel in enumerate(heels):
        own = cells[k :: len(heels)]
        rows = array[k :: len(heels)]
        for i in range(0, len(own), _AT_ONCE):
            yield heel, tuple(own[i : i + _AT_ONCE]), rows[i : i + _AT_ONCE]


def _drawn_feet(model: ModelParameters, count: int, seed: int) -> list[FootParameters]:
    if not count:
        return []
    anybody = Subject(mass_kg=75.0, stature_m=1.75, sex="male", prosthetic_side=_SIDE)
    return [
        model_with(model, values).foot
        for values in contact_draws(Walker(anybody, model), _SIDE, count, seed)
    ]


def _run(
    tasks: Sequence[_Task],
    load: Load,
    workers: int | None,
    executor: Any,
    progress: Callable[[str, float], None] | None,
) -> None:
    """Fills the tasks' arrays."""
    queue = deque(tasks)
    running = dict[Future[list[Rolled]], _Task]()
    done = 0
    total = sum(len(task.cells) for task in tasks)
    with chosen(checked(workers, executor), executor, len(tasks)) as (pool, most, _):
        while queue or running:
            while queue and len(running) < most:
                task = queue.popleft()
                running[pool.submit(roll_cells, task.foot, load, task.cells)] = task
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                task = running.pop(future)
                task.replies.extend(future.result())
                task.into[:] = [[reply.values[name] for name in ROLLED] for reply in task.replies]
                done += len(task.cells)
                if progress:
                    progress(f"rolling the foot, {done} of {total}", done / total)
