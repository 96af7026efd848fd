"""A foot by the clauses of a published test (`device.protocols`): pressed at angles and rolled over
by the machines of the bench and the stiffness map, whose numbers these are."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsf_drake.base.errors import InputError, SimulationError, require
from vsf_drake.base.progress import Progress
from vsf_drake.base.schema import to_plain
from vsf_drake.device.bench_metrics import BenchTable, bench_table
from vsf_drake.device.inclined import press_inclined
from vsf_drake.device.protocols import PROTOCOLS, ROLL, Clause, clauses_of
from vsf_drake.device.roll_over import SECOND_PEAK_S, iso_roll_over
from vsf_drake.model.model_file import check_fulcrum, check_model, check_movable
from vsf_drake.model.parameters import FootParameters, ModelParameters
from vsf_drake.model.setting import AtSetting, moves, setting_of
from vsf_drake.simulation.archive import provenance
from vsf_drake.simulation.bench import (
    PUBLISHED_FULCRUMS_M,
    PUBLISHED_SPEED_M_PER_S,
    STEPS_PER_MM,
    check_pass,
    run_bench,
)
from vsf_drake.simulation.options import BenchOptions
from vsf_drake.simulation.roll_over import RollOver
from vsf_drake.walks.recorded_walk import reached

FORMAT = "vsf_drake bench protocol 1"
ROLL_STEPS = 600
"""Of the stance. Twice as many change no quantity of the nominal foot at 66 and 151 mm by more than
0.3 %."""


@dataclass(frozen=True, kw_only=True)
class ProtocolRow:
    """A clause, and the foot's answer at each setting."""

    clause: Clause
    values: tuple[float | None, ...]
    """in the clause's unit, one a setting; none where nothing is computed, None where it cannot be
    known"""

    @property
    def computed(self) -> bool:
        """Whether the model answers this clause."""
        return bool(self.clause.method)


@dataclass(frozen=True, kw_only=True)
class Bearing:
    """Which zones of the sole bear when a part of the foot is pressed to the load."""

    part: str
    setting: str
    zones: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class ProtocolTable:
    """The content of protocol.json."""

    format: str
    protocol: str
    title: str
    settings: tuple[AtSetting, ...]
    load_n: float  # of every press, and at the first peak of the roll-over
    speed_mm_per_min: float  # of the platen
    rows: tuple[ProtocolRow, ...]
    bearing: tuple[Bearing, ...]
    bench: BenchTable | None  # under the load point and at the heel, level; None where it failed
    missing: tuple[str, ...]  # sentences on what failed
    processor_s: float  # with what was compiled first, if anything
    parameters: dict[str, Any]
    provenance: dict[str, Any]


@dataclass(frozen=True, kw_only=True, eq=False)
class BenchProtocol:
    """A foot by the clauses of a test, and its curves.

    Of the i-th setting: `displacement_mm/PART_i`, `load_n/PART_i` (n,) of a press, loading and
    unloading; `forward_m/i`, `up_m/i` (n,) of the roll-over shape, the centre of pressure seen from
    the pylon's end, along and across the sole.
    """

    table: ProtocolTable
    arrays: dict[str, np.ndarray]


def bench_protocol(
    model: ModelParameters,
    protocol: str,
    *,
    fulcrums_m: Sequence[float] | None = None,
    load_n: float = BenchOptions.max_load_n,
    speed_m_per_s: float = PUBLISHED_SPEED_M_PER_S,
    progress: Progress | None = None,
    inputs: dict[str, str] | None = None,
) -> BenchProtocol:
    """A foot by the clauses of a published test, each answered or not computed.

    Args:
        model: of the foot, with its contact.
        protocol: iso16955, iso22675 or aopa.
        fulcrums_m: positions (m from the keel's posterior end). If None, those of the paper that
            the carriage reaches, else the ends of its reach; of a passive foot its only one.
        load_n: to which the foot is pressed (N, above 200 and at most 5000), and the first peak of
            the roll-over.
        speed_m_per_s: of the platen (m/s).
        progress: called with what is being done and the finished fraction.
        inputs: SHA-256 of the model's files by name.

    Returns:
        `table`, with a row a clause and its values by setting, and `arrays` of the curves. What the
        foot does not bear is None, with a sentence in `table.missing`.

    Raises:
        InputError: an unknown protocol, a value out of range, positions of a passive foot.
    """
    clauses = clauses_of(protocol)
    check_model(model)
    check_pass(max_load_n=load_n, speed_m_per_s=speed_m_per_s)
    foot = model.foot
    positions = _positions(foot, fulcrums_m)
    began = time.process_time()
    show: Progress = progress or (lambda what, fraction: None)
    show("pressing on the bench", 0.0)
    arrays: dict[str, np.ndarray] = {}
    missing: list[str] = []
    bench = None
    try:
        bench = bench_table(
            run_bench(model, fulcrums_m=positions, max_load_n=load_n, speed_m_per_s=speed_m_per_s)
        )
    except (InputError, SimulationError) as error:
        missing.append(f"The level bench beside the clauses, to {load_n:g} N: {error}.")
    bearing: list[Bearing] = []
    answers: list[dict[str, dict[str, float | None]]] = [{} for _ in positions]
    angles = {each.part: each.angle_deg for each in clauses if each.angle_deg is not None}
    rolled = {each.part for each in clauses if each.method == ROLL}
    machine = RollOver(foot, friction=False)
    for i, position in enumerate(positions):
        words = setting_of(foot, position).setting_short
        show(f"testing, {words}", (i + 1) / (len(positions) + 1))
        for part, angle in angles.items():
            try:
                pressed, curve = press_inclined(
                    machine,
                    angle_deg=angle,
                    fulcrum_m=position,
                    load_n=load_n,
                    speed_m_per_s=speed_m_per_s,
                    steps_per_mm=STEPS_PER_MM,
                )
            except (InputError, SimulationError) as error:
                missing.append(f"Pressed at the {part}, {words}: {error}.")
                continue
            answers[i][part] = vars(pressed) | {"returned_share": curve.returned_share}
            bearing.append(Bearing(part=part, setting=words, zones=pressed.zones_loaded))
            arrays[f"displacement_mm/{part}_{i}"] = 1e3 * curve.displacement_m
            arrays[f"load_n/{part}_{i}"] = curve.load_n
        for part in rolled:
            rows, curves, failed = iso_roll_over(foot, [position], force_n=load_n, steps=ROLL_STEPS)
            missing += failed
            for row in rows:
                answers[i][part] = vars(row)
                known = curves["iso_time_s"] <= SECOND_PEAK_S
                for axis in ("forward", "up"):
                    seen = curves[f"iso_{1e3 * position:.0f}_cop_{axis}_m"]
                    arrays[f"{axis}_m/{i}"] = np.where(known, seen, np.nan)
    return BenchProtocol(
        table=ProtocolTable(
            format=FORMAT,
            protocol=protocol,
            title=PROTOCOLS[protocol],
            settings=tuple(setting_of(foot, position) for position in positions),
            load_n=load_n,
            speed_mm_per_min=60e3 * speed_m_per_s,
            rows=tuple(
                ProtocolRow(
                    clause=clause,
                    values=tuple(
                        answer.get(clause.part, {}).get(clause.quantity) for answer in answers
                    )
                    if clause.method
                    else (),
                )
                for clause in clauses
            ),
            bearing=tuple(bearing),
            bench=bench,
            missing=tuple(missing),
            processor_s=time.process_time() - began,
            parameters=to_plain(model),
            provenance=provenance(inputs),
        ),
        arrays=arrays,
    )


def _positions(foot: FootParameters, fulcrums_m: Sequence[float] | None) -> list[float]:
    """Where the fulcrum is to stand (m from A), checked."""
    reach = [foot.fulcrum.rearmost_m, foot.fulcrum.foremost_m]
    if fulcrums_m is None:
        return (reached(foot, PUBLISHED_FULCRUMS_M) or reach) if moves(foot) else reach[:1]
    check_movable(foot, "A passive foot has no fulcrum to place: leave the positions out")
    positions = [check_fulcrum(x, foot, where="fulcrums_m") for x in fulcrums_m]
    require(bool(positions), "is empty", "fulcrums_m", "Give one position or more")
    require(
        len(set(positions)) == len(positions),
        "has a position twice",
        "fulcrums_m",
        "Give each once",
    )
    return positions
