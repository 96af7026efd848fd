"""Prints how fast each way of advancing is and how right, as one table.

    python tests/benchmarks/run.py [--quick] [--only NAME ...]

Simulated time over wall time on one core, compilation excluded, with the accuracy beside it: of walking the root mean
square difference of the 40 Hz resultants of the prosthetic foot's ground reaction in percent of body weight (BW),
of the bench the largest difference of the load; of the wiring what the foot adds to one evaluation of a plant's
derivatives. Nothing is asserted: times belong to the machine.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import sys
from pathlib import Path

from table import Row, format_table

REPOSITORY = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(REPOSITORY / "studies"), str(REPOSITORY / "tests" / "helpers")]  # cost of a walk; reference runs
QUICK = ("stepper", "integrators", "mujoco_foot", "wiring")
LONG = ("sweeps", "scaling")
GROUPS = tuple(name for name in QUICK + LONG if importlib.util.find_spec(name))


def measure(name: str, quick: bool) -> list[Row]:
    """The rows of the module `name`; only those in QUICK have a quick form."""
    rows = importlib.import_module(name).rows
    return rows(quick=quick) if name in QUICK else rows()


def main() -> None:
    parser = argparse.ArgumentParser(description="Speed and accuracy of every way of advancing, as one table.")
    parser.add_argument("--only", nargs="+", metavar="NAME", choices=GROUPS, help=f"of {', '.join(GROUPS)}")
    parser.add_argument("--quick", action="store_true",
                        help=f"shorter runs, about a minute; without {' and '.join(LONG)} unless --only names them")
    options = parser.parse_args()
    names = dict.fromkeys(options.only or ()) or (QUICK if options.quick else GROUPS)
    print(format_table([row for name in names for row in measure(name, options.quick)]))


if __name__ == "__main__":
    main()
