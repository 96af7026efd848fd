"""What a tuning and a schedule leave on disk, all of it or nothing, and the pages made again of it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vsf_drake.analysis.tuning.common import FORMAT, check_tuning_table
from vsf_drake.analysis.tuning.schedule import DESCRIPTORS, POLICY_FORMAT, schedule_of
from vsf_drake.report.page import write_csv
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.report.tuning.chapters import schedule_page, tuning_page

SCHEDULE_KEYS = ("cost_name", "cost_label", "cost_unit", "level", "synthetic", "notes", "wall_s", "provenance")
"""What the table has besides the policy itself (`analysis.tuning.schedule.policy_table`)."""
POLICY_CSV = "policy.csv"
_COLUMNS = ("label", *DESCRIPTORS, "fulcrum_mm", "exact_mm", "interval_low_mm", "interval_high_mm", "cost",
            "cost_common", "matters", "optimal", "status")


TUNING = ResultsFolder(
    kind="tuning", command="tune", table="tuning.json", arrays="tuning.npz",
    show=lambda table, arrays, *, folder, lenient: tuning_page(table, arrays, lenient=lenient),
    known=lambda table: str(table.get("format")).startswith(FORMAT.rpartition(" ")[0]),
    valid=lambda table, path: check_tuning_table(table))
"""The table is that of `analysis.tuning.common.KEYS`; besides, where known, `recorded_mm`, where the fulcrum stood in
each trial. Arrays are any of level 1: `sweep_mm` (s,), `sweep_cost_trials` (s, trials), and for trial K from 0
`trial_K_time` (n,) s, `trial_K_softest`, `trial_K_optimum`, `trial_K_stiffest`, `trial_K_recorded` (n, 3) N in W, or of
one trial `grf_time`, `grf_softest` and so on; of level 2: `phase` (n,) 0 to 1, `names` (8,), `q`, `q_recorded` (n, 8)
rad and m, `torque`, `torque_recorded` (n, 5) N m, `grf_prosthetic`, `grf_intact` (n, 2) N (forward, up), and these two
with `_recorded`, `_resimulated_prescribed`, `_resimulated_feedback`. Others are kept, and not shown."""


def _check_schedule(table: Mapping[str, Any], path: Path) -> None:
    missing = [key for key in SCHEDULE_KEYS if key not in table]
    if missing:
        raise ValueError(f"the table of a schedule lacks {', '.join(missing)}")
    schedule_of(table, file=path)


SCHEDULE = ResultsFolder(
    kind="schedule", command="schedule", table="policy.json", names=(POLICY_CSV,),
    show=lambda table, arrays, *, folder, lenient: schedule_page(table, lenient=lenient),
    known=lambda table: str(table.get("format")).startswith(POLICY_FORMAT.rpartition(" ")[0]), valid=_check_schedule)
"""The table is that of `policy_table`, with SCHEDULE_KEYS, and for every task `trials` (labels), `sweep` (lists of
`fulcrum_mm` and `cost`), and if known `rest`, `rest_common`: its cost at its own setting and at the one for all,
without terms that only hold to the recording."""


def write_schedule(out: str | Path, table: Mapping[str, Any]) -> dict[str, Any]:
    """Writes a schedule with its policy.csv; see `ResultsFolder.write`."""
    return SCHEDULE.write(out, table, more=_write_policy)


def _write_policy(folder: Path, table: Mapping[str, Any]) -> None:
    rows = []
    for row in table["tasks"]:
        low, high = row["interval_mm"] or (None, None)
        rows.append({**row, "interval_low_mm": low, "interval_high_mm": high})
    write_csv(folder / POLICY_CSV, _COLUMNS, ([row[name] for name in _COLUMNS] for row in rows))
