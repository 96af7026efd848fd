"""Makes docs/pictures/engines.png: the keel under the same load in four engines, each of which
solves the file that it reads. Needs them all: pip install 'vsf-drake[engines]'.

python docs/make_engines_picture.py
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
import opensim
from make_example_pictures import keep
from matplotlib.axes import Axes

from vsf_drake.engines.certificate import in_drake, in_exudyn, in_mujoco, in_opensim
from vsf_drake.engines.certificate.ask import questions, write_full
from vsf_drake.model.parameters import FootParameters
from vsf_drake.report.style import PANEL, colour_of, new_figure, save_figure, style

DOCS = Path(__file__).resolve().parent
FULCRUMS_MM = (66.0, 151.0)
LOAD_N = 600.0
MM = 1e3
ARROW_MM = 16.0


def shapes() -> dict[str, np.ndarray]:
    """By engine (F, P, 2) mm, x and z of the bent keel, from its posterior end to the load."""
    opensim.Logger.setLevelString("error")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        asked = questions(FootParameters())
        write_full(folder, FootParameters())
        load = int(np.flatnonzero(asked.load_n == LOAD_N)[0])
        found = {
            "Drake, from the SDF": [in_drake.shapes(asked, folder, mm) for mm in FULCRUMS_MM],
            "OpenSim, from the .osim": [in_opensim.shapes(asked, folder, mm) for mm in FULCRUMS_MM],
            "MuJoCo, from the MJCF": [in_mujoco.shapes(asked, folder, mm) for mm in FULCRUMS_MM],
            "Exudyn, an exact beam": [in_exudyn.shapes(asked, 1e-3 * mm) for mm in FULCRUMS_MM],
        }
    return {engine: MM * np.array(each)[:, load] for engine, each in found.items()}


def draw(axes: Axes, engine: str, bent: np.ndarray) -> None:
    """The keel with the fulcrum at each position, over the straight one."""
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set_title(engine, loc="left", y=0.78)
    axes.plot([0.0, bent[:, -1, 0].max()], [0.0, 0.0], color="0.75", linewidth=1.0, linestyle="--")
    axes.plot(0.0, 0.0, marker="o", color="0.2", zorder=5)
    for fulcrum_mm, points in zip(FULCRUMS_MM, bent, strict=True):
        colour = colour_of(fulcrum_mm)
        x, z = points[-1]
        axes.plot(*points.T, color=colour, linewidth=2.6, solid_capstyle="round")
        axes.plot(fulcrum_mm, 4.5, marker="v", color="#e8b200", markeredgecolor=colour, zorder=5)
        axes.annotate(
            "",
            (x, z - 1.0),
            (x, z - 1.0 - ARROW_MM),
            arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 1.4},
        )
        axes.text(x + 5.0, z, f"{z:.2f} mm", color=colour, va="center")
    axes.set_xlim(-5.0, 240.0)
    axes.set_ylim(-10.0, 61.0)


def main(out: Path) -> None:
    """Writes the picture to `out`."""
    with style(), tempfile.TemporaryDirectory() as folder:
        figure = new_figure(PANEL[0], 5.8)
        panels = figure.subplots(4, 1)
        for axes, (engine, bent) in zip(panels, shapes().items(), strict=True):
            draw(axes, engine, bent)
        save_figure(figure, Path(folder) / "engines", svg=False)
        keep(Path(folder) / "engines.png", out)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else DOCS / "pictures" / "engines.png")
