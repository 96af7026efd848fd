"""Makes docs/pictures/drop.png: the README's ten lines of Drake, run with the fulcrum at three
positions.

python docs/make_drop_picture.py
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from make_example_pictures import keep
from pydrake.systems.framework import Context, EventStatus

from vsf_drake.report.style import PANEL, colour_of, label, new_figure, save_figure, style

DOCS = Path(__file__).resolve().parent
FULCRUMS_MM = (66.0, 108.0, 151.0)
KN = 1e-3


def falls() -> dict[float, np.ndarray]:
    """By position of the fulcrum (mm) rows of time (s) and vertical force (N)."""
    readme = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    [block] = re.findall(r"^```python\n(.*?)^```$", readme, flags=re.MULTILINE | re.DOTALL)
    until = block.split("simulator.AdvanceTo")[0]
    found = {}
    for mm in FULCRUMS_MM:
        names: dict[str, Any] = {}
        exec(until.replace("fulcrum_m=0.108", f"fulcrum_m={1e-3 * mm}"), names)
        rows = []

        def note(root: Context, names=names, rows=rows) -> EventStatus:
            wired = names["wired"]
            force = wired.GetOutputPort("grf").Eval(wired.forces.GetMyContextFromRoot(root))
            rows.append((root.get_time(), force[2]))
            return EventStatus.DidNothing()

        names["simulator"].set_monitor(note)
        names["simulator"].AdvanceTo(1.0)
        found[mm] = np.array(rows)
    return found


def main(out: Path) -> None:
    """Writes the picture to `out`."""
    with style(), tempfile.TemporaryDirectory() as folder:
        figure = new_figure(*PANEL)
        axes = figure.subplots()
        for mm, rows in falls().items():
            axes.plot(rows[:, 0], KN * rows[:, 1], color=colour_of(mm), label=f"fulcrum {mm:g} mm")
        label(axes, x="time (s)", y="vertical force (kN)")
        axes.legend()
        save_figure(figure, Path(folder) / "drop", svg=False)
        keep(Path(folder) / "drop.png", out)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else DOCS / "pictures" / "drop.png")
