"""Prints how fast each way of advancing is and how right, as one table.

    python tests/benchmarks/run.py [--quick] [--only NAME ...] [--store FILE.json]

Simulated time over wall time on one core, compilation excluded, with the accuracy beside it: of
walking the root mean square difference of the 40 Hz resultants of the prosthetic foot's ground
reaction in percent of body weight (BW), of the bench the largest difference of the load. Of a foot
in a diagram it is the processor time of one evaluation, over that of its plant alone, of whole
commands their processor time: they take some ten minutes, and are run if `--only commands` asks for
them. Nothing is asserted: times belong to the machine.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import platform
import sys
from pathlib import Path

# the runs under Drake's Simulator
sys.path.append(str(Path(__file__).resolve().parents[1] / "helpers"))
sys.path.append(str(Path(__file__).resolve().parents[2] / "studies" / "examples"))
import diagrams
import walks
from commands import commands
from table import Row, format_table

from vsf_drake.simulation.archive import provenance


def mujoco() -> list[Row]:
    """The same foot in MuJoCo, if that is installed."""
    if importlib.util.find_spec("mujoco") is None:
        return [
            Row(
                "the same foot in MuJoCo",
                None,
                None,
                "MuJoCo is not installed: pip install 'vsf-drake[bench]'",
            )
        ]
    from mujoco_foot import rows  # noqa: PLC0415 - optional

    return rows()


GROUPS = {
    "stepper": walks.stepper,
    "side_by_side": walks.side_by_side,
    "stepped": walks.stepped,
    "simulator": walks.simulator,
    "mujoco": mujoco,
    "diagrams": diagrams.diagrams,
    "sweeps": walks.sweeps,
    "commands": commands,
}


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Speed and accuracy of every way of advancing, as one table."
    )
    parser.add_argument(
        "--only", nargs="+", metavar="NAME", choices=GROUPS, help=f"of {', '.join(GROUPS)}"
    )
    parser.add_argument(
        "--quick", action="store_true", help="without sweeps, unless --only names them"
    )
    parser.add_argument(
        "--store", type=Path, metavar="FILE.json", help="rows, versions and the processor's name"
    )
    options = parser.parse_args()
    left_out = {"commands", "sweeps"} if options.quick else {"commands"}
    names = options.only or [name for name in GROUPS if name not in left_out]
    rows = [row for name in names for row in GROUPS[name]()]
    print(format_table(rows))
    if options.store:
        made = {
            "processor": processor(),
            "versions": provenance()["versions"],
            "rows": [row._asdict() | {"faster": row.faster} for row in rows],
        }
        options.store.write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")


def processor() -> str:
    """Its name, as the system tells it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.processor()


if __name__ == "__main__":
    main()
