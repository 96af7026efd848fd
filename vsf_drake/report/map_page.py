"""What a stiffness map leaves on disk, all of it or nothing, and its page."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from vsf_drake.base.files import plain
from vsf_drake.device.stiffness_map import MapTable, StiffnessMap, map_of
from vsf_drake.report.page import Chapter, made_chapter, render
from vsf_drake.report.results_folder import ResultsFolder
from vsf_drake.report.style import PANEL, Arrays, drawing, entry, label, legend_below
from vsf_drake.walks.published import LEG_M, Effect, published_effects

AXES = {
    "mass_kg": ("mass", "kg"),
    "slope_deg": ("slope", "°, uphill +"),
    "alignment_deg": ("alignment", "°, toe up +"),
    "heel_ratio": ("heel", "times the model's stiffness"),
}
"""What a curve over the fulcrum may be drawn for, in words."""
_PANELS = {
    "radius": "roll-over radius (m)",
    "eflr": "rolls forward to (EFLR, 1)",
    "moment_arm": "arm under the load (mm)",
    "stiffness": "stiffness (N/mm)",
    "stored": "stored (J/kg)",
    "returned": "given back (J/kg)",
}
_MEASURES = {
    "radius": ("roll-over radius", LEG_M),
    "eflr": ("effective foot length ratio", 1.0),
    "returned": ("energy returned", 1.0),
}
"""By panel: what the published table calls it, and what leads from its unit to the panel's."""
_FEET = {"LLTE": "o", "Horizon LT": "s", "daily-use": "^"}
_PUBLISHED: dict[str, Any] = {"color": "0.25", "linestyle": "", "markersize": 5}
_APART_MM = 4.0
"""Of the published feet, which stand beyond the model's curves."""
_TOLD_FIRST = ("eflr", "returned", "stiffness")
"""Quantities that a prosthetist has words for."""
_STEPS = {"mass_kg": 1.0, "slope_deg": 0.5, "fulcrum_mm": 1.0}
"""Of the sliders."""
_CURVES = 60
_ROWS = 5
_TARGETS_M = (0.2, 0.25, 0.3, 0.35, 0.4, 0.5)
_LIGHTEST = 0.66


def map_page(
    saved: Mapping[str, Any], arrays: Arrays, *, folder: Path, lenient: bool
) -> dict[str, Any]:
    """What `page.chapter_page` is to be given of map.json and map.npz."""
    mapped = StiffnessMap(map_of(saved), arrays)
    drawn = [name for name in AXES if len(mapped.table.axes[name]) > 1]
    sections: list[tuple[str, str, Callable[..., _Told]]] = [
        ("answer", "", partial(_answer, drawn=drawn[:1] or ["mass_kg"])),
        *((name, f"What {AXES[name][0]} does", partial(_axis, name=name)) for name in drawn[1:]),
        ("inverse", "Which fulcrum gives a radius", _inverse),
        ("surface", "How well the surface holds, and how it was made", _made),
    ]

    def chapter(name: str, title: str, make: Callable[..., _Told]) -> Chapter:
        template, figures, facts = make(mapped)
        middle = {axis: values[len(values) // 2] for axis, values in mapped.table.axes.items()}
        facts |= {"t": mapped.table, "middle": middle, "axes": AXES, "leg_m": LEG_M}
        path = f"map/{template}.html.j2"
        return Chapter(name=name, title=title, template=path, figures=figures, facts=facts)

    return {
        "title": "Stiffness map",
        "chapters": [
            made_chapter(section[0], section[1], partial(chapter, *section), lenient)
            for section in sections
        ],
        "synthetic": False,
        "first_line": render("map/first_line.txt.j2"),
    }


MAP = ResultsFolder(
    layered=True,
    kind="stiffness map",
    command="map",
    table="map.json",
    arrays="map.npz",
    show=map_page,
    known=lambda table: str(table.get("format")).startswith("vsf_drake stiffness map"),
    valid=lambda table, path: map_of(table),
)


def write_map(out: str | Path, table: MapTable, arrays: Arrays) -> None:
    """Writes a map, its page, figures and tables; see `ResultsFolder.write`."""
    MAP.write(out, plain(table), arrays)


def read_map(folder: str | Path) -> StiffnessMap:
    """The map that `write_map` left in a folder."""
    table, arrays = MAP.read(folder)
    return StiffnessMap(map_of(table), arrays)


def map_rows(mapped: StiffnessMap, **where: float) -> list[dict[str, float]]:
    """The quantities at a few fulcrum positions, each as NAME with NAME_low and NAME_high."""
    reach = mapped.table.axes["fulcrum_mm"]
    rows = []
    for mm in np.linspace(reach[0], reach[-1], _ROWS).tolist():
        row = {"fulcrum_mm": mm}
        for item in mapped.table.quantities:
            band = mapped.at(item.name, **where, fulcrum_mm=mm)
            row |= {
                item.name: band.value,
                f"{item.name}_low": band.low,
                f"{item.name}_high": band.high,
            }
        rows.append(row)
    return rows


_Told = tuple[str, dict[str, Figure], dict[str, Any]]
"""What a section has: the stem of its template, its figures and facts."""


def _answer(mapped: StiffnessMap, drawn: list[str]) -> _Told:
    figures = {f"by_{AXES[name][0]}": curves_figure(mapped, name, published=True) for name in drawn}
    measures = {measure for measure, _ in _MEASURES.values()}
    return (
        "answer",
        figures,
        {
            "drawn": list(figures),
            "what_if": _what_if(mapped),
            "rows": map_rows(mapped),
            "published": [
                row
                for row in published_effects()
                if row.mean is not None and row.measure in measures
            ],
        },
    )


def _what_if(mapped: StiffnessMap) -> dict[str, Any]:
    """The surface at every cell's mass and slope and at fulcrum positions 1 mm apart at most, as
    sliders of the page read it: axes, and numbers by quantity, the fulcrum running fastest."""
    axes = mapped.table.axes
    positions = _refined(axes["fulcrum_mm"])
    others = [name for name in ("mass_kg", "slope_deg") if len(axes[name]) > 1]
    places = [
        dict(zip(others, values, strict=True))
        for values in itertools.product(*(axes[name] for name in others))
    ]
    known = [item.name for item in mapped.table.quantities]
    return {
        "axes": [
            *({"name": name, "at": axes[name], "step": _STEPS[name]} for name in others),
            {"name": "fulcrum_mm", "at": positions, "step": _STEPS["fulcrum_mm"]},
        ],
        "start": {name: axes[name][len(axes[name]) // 2] for name in (*others, "fulcrum_mm")},
        "values": {
            name: [
                float(f"{value:.5g}")
                for place in places
                for value in mapped.along(name, np.array(positions), **place)[0]
            ]
            for name in _TOLD_FIRST
            if name in known
        },
    }


def _refined(values: Sequence[float]) -> list[float]:
    """Steps of 1 mm at most, all of the values among them."""
    steps = [
        np.linspace(low, high, int(np.ceil(high - low)) + 1)[:-1]
        for low, high in itertools.pairwise(values)
    ]
    return [*np.concatenate([*steps, values[-1:]]).tolist()]


def _axis(mapped: StiffnessMap, name: str) -> _Told:
    values = mapped.table.axes[name]
    word, unit = AXES[name]
    ends = [
        (value, map_rows(mapped, **{name: value})[_ROWS // 2]) for value in (values[0], values[-1])
    ]
    figures = {f"by_{word}": curves_figure(mapped, name)}
    return "axis", figures, {"name": word, "unit": unit, "ends": ends}


def _inverse(mapped: StiffnessMap) -> _Told:
    masses = mapped.table.axes["mass_kg"]
    answers = [
        mapped.inverse("radius", target, mass_kg=mass)
        for mass in dict.fromkeys((masses[0], masses[len(masses) // 2], masses[-1]))
        for target in _TARGETS_M
        if "radius" not in mapped.table.unknown
    ]
    return "inverse", {}, {"answers": answers}


def _made(mapped: StiffnessMap) -> _Told:
    return "made", {}, {}


def curves_figure(mapped: StiffnessMap, name: str, *, published: bool = False) -> Figure:
    """Every quantity over the fulcrum, with bands, for the ends and the middle of one axis; others
    in their middle."""
    table = mapped.table
    known = [item.name for item in table.quantities if item.name in _PANELS]
    shown = {panel: title for panel, title in _PANELS.items() if panel in known}
    values = table.axes[name]
    shades = dict.fromkeys((values[0], values[len(values) // 2], values[-1]))
    light = np.linspace(0.0, _LIGHTEST, len(shades))
    chosen = dict(zip(shades, colormaps["viridis"](light), strict=True))
    positions = np.linspace(table.axes["fulcrum_mm"][0], table.axes["fulcrum_mm"][-1], _CURVES)
    middle_mass = table.axes["mass_kg"][len(table.axes["mass_kg"]) // 2]
    with drawing(1.4 * PANEL[0], 2.2 * PANEL[1]) as figure:
        panels = figure.subplots(-(-len(shown) // 2), 2, sharex=True).ravel()
        for axes, (panel, title) in zip(panels, shown.items(), strict=False):
            if published and panel in _MEASURES:
                _published(axes, panel, positions[-1])
            for value, colour in chosen.items():
                mass = value if name == "mass_kg" else middle_mass
                scale = 1.0 / mass if panel in ("stored", "returned") else 1.0
                curve, low, high = scale * mapped.along(panel, positions, **{name: value})
                axes.plot(positions, curve, color=colour, linewidth=1.6)
                axes.fill_between(positions, low, high, color=colour, alpha=0.15, linewidth=0)
            label(
                axes,
                x="fulcrum (mm)" if axes.get_subplotspec().is_last_row() else "",
                y="",
                title=title,
            )
        word, unit = AXES[name]
        handles: list[Any] = [
            Line2D([], [], color=colour, label=f"{word} {value:g} {unit}")
            for value, colour in chosen.items()
        ]
        if published:
            handles += [
                entry(f"{foot}, Prost 2022", marker=marker, **_PUBLISHED)
                for foot, marker in _FEET.items()
            ]
        legend_below(figure, handles)
    return figure


def _published(axes: Axes, panel: str, last_mm: float) -> None:
    """Means ± SD of the feet of the published table, beside what the model has at its last
    position."""
    measure, scale = _MEASURES[panel]
    rows: list[Effect] = [
        row for row in published_effects() if row.measure == measure and row.condition in _FEET
    ]
    for i, row in enumerate(rows):
        if row.mean is not None and row.sd is not None:
            axes.errorbar(
                last_mm + (1 + i) * _APART_MM,
                scale * row.mean,
                yerr=scale * row.sd,
                marker=_FEET[row.condition],
                capsize=3.0,
                **_PUBLISHED,
            )
