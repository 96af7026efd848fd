"""One look for every figure: measured solid, simulated dashed, one colour a setting, units on
axes.

The colours run along `viridis` without its light end: told apart with any colour vision, and
ordered by lightness, so that the order survives grey print. Nothing global changes and no display
is needed.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from matplotlib import colormaps, rc_context, rcParamsDefault
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.layout_engine import TightLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import LogFormatter
from matplotlib.typing import ColorType

from vsf_drake.base.files import replaced
from vsf_drake.model.setting import AtSetting

MEASURED: dict[str, Any] = {"linestyle": "-", "linewidth": 2.6, "alpha": 0.55}
SIMULATED: dict[str, Any] = {"linestyle": (0, (4, 1.6)), "linewidth": 1.6}
HEEL_COLOUR = "0.15"
NEUTRAL = "0.45"
SHADE = "0.92"
MARK_COLOURS = {"good": "#2e7d4f", "doubtful": "#b7791f", "unusable": "#b3261e"}
MARKERS = ("o", "s", "^", "D", "v")
DOTS_PER_INCH = 150
PANEL = (4.6, 3.1)
"""Inches of a figure of one panel: two stand side by side on a screen, and a telephone shows
letters of 9 pixels."""
_RANGE_MM = (66.0, 151.0)
_LIGHTEST = 0.66
_FEET = ("#31688e", "#c8553d", "#5e3c99", "#4d7c2a", "0.35")
"""Colours of passive feet, which have no order."""
_SETTINGS: dict[str, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titley": 1.0,  # no axis is above its panel: looking for one measures every label again
    "axes.labelsize": 9.0,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "svg.hashsalt": "vsf_drake",
    "svg.fonttype": "none",
    "text.parse_math": False,  # a name may hold dollar signs
}


def style() -> AbstractContextManager[None]:
    """A context in which figures are made and drawn in this look."""
    settings: dict[Any, Any] = {
        key: value for key, value in rcParamsDefault.items() if key != "backend"
    }
    return rc_context(settings | _SETTINGS)


def new_figure(width: float, height: float) -> Figure:
    """An empty figure (inches) that needs no display."""
    # None measures once, not twice
    margins = _Margins(pad=0.9, w_pad=1.6, h_pad=1.3, rect=None)  # type: ignore[arg-type]
    figure = Figure(figsize=(width, height), dpi=DOTS_PER_INCH, layout=margins)
    FigureCanvasAgg(figure)
    return figure


class _Margins(TightLayoutEngine):
    """Margins as labels and titles need them, found in one pass, with room for the figure's own
    legends: a third of what Matplotlib's constrained layout takes, which alone knows subfigures."""

    def execute(self, fig: Figure) -> None:
        low = 0.0
        right = 1.0
        # of FigureCanvasAgg
        renderer = fig.canvas.get_renderer()  # type: ignore[attr-defined]
        for legend in fig.legends:
            extent = legend.get_window_extent(renderer).transformed(fig.transFigure.inverted())
            if extent.y1 < 0.5:  # below the panels
                low = max(low, extent.y1)
            else:
                right = min(right, extent.x0)
        if low > 0.0 or right < 1.0:
            self.set(rect=(0.0, low, right, 1.0))
        for title in fig.texts if fig.get_suptitle() else ():
            if title.get_text() == fig.get_suptitle():
                title.set_y(1.0 - 0.08 / fig.get_figheight())  # inches, however high the figure is
        super().execute(fig)


@contextmanager
def drawing(width: float, height: float) -> Iterator[Figure]:
    """An empty figure (inches) to be filled in this look; its layout is settled at the end."""
    with style():
        figure = new_figure(width, height)
        yield figure
        if engine := figure.get_layout_engine():
            engine.execute(figure)
        figure.set_layout_engine("none")  # settled: it need not be found again for each file


Arrays = Mapping[str, np.ndarray]
FULCRUM = "fulcrum from the keel's posterior end (mm)"
ASIDE_S = 0.1  # of time shown before and after what a figure is about (a choice)
LINES = ("-", (0, (4, 1.6)), (0, (1, 1)), (0, (6, 1.5, 1, 1.5)), (0, (2, 2)))
"""Kinds of line that are told apart without a colour."""


def colour_of(at: AtSetting | float | None, among: Iterable[AtSetting] = ()) -> ColorType:
    """The colour of a setting or a fulcrum position (mm from the keel's posterior end), or of the
    heel for None; of a passive foot by its place `among` those of the figure."""
    if at is None:
        return HEEL_COLOUR
    if isinstance(at, AtSetting) and at.fulcrum_mm is None:
        feet = sorted({other.foot for other in among} | {at.foot})
        return _FEET[feet.index(at.foot) % len(_FEET)]
    low, high = _RANGE_MM
    position_mm = at.fulcrum_mm if isinstance(at, AtSetting) else at
    assert position_mm is not None
    return colormaps["viridis"](_LIGHTEST * min(max((position_mm - low) / (high - low), 0.0), 1.0))


def name_of(at: AtSetting | float | None) -> str:
    """The name of a setting, a fulcrum position (mm) or the heel in legends."""
    if at is None:
        return "heel"
    return (at if isinstance(at, AtSetting) else AtSetting(fulcrum_mm=at)).setting_words


def say_synthetic(figure: Figure, synthetic: bool, what: str) -> None:
    """That nobody recorded these walks, or trials."""
    if synthetic:
        figure.suptitle(f"SYNTHETIC {what}, not recorded", x=0.01, ha="left", fontsize=9.5)


def label(axes: Axes, *, x: str, y: str, title: str = "") -> None:
    """Names both axes, each with its unit in parentheses."""
    axes.set(xlabel=x, ylabel=y)
    if title:
        axes.set_title(title, loc="left")


def tag(
    axes: Axes,
    text: str,
    at: tuple[float, float],
    colour: ColorType,
    *,
    offset: tuple[float, float] = (4, 0),
    ha: str = "left",
    va: str = "baseline",
) -> None:
    """Names a curve beside it, in its colour; `offset` in points from `at`."""
    axes.annotate(
        text,
        at,
        offset,
        textcoords="offset points",
        color=colour,
        fontweight="bold",
        ha=ha,
        va=va,
        annotation_clip=False,
    )


def entry(name: str, **look: Any) -> Line2D:
    """What a legend shows of a line or mark in this look."""
    return Line2D([], [], label=name, **look)


def legend_below(figure: Figure, handles: Sequence[Artist]) -> None:
    """A legend under all panels, in as many columns as fit."""
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined] # of FigureCanvasAgg
    for columns in (3, 2, 1):
        legend = figure.legend(
            handles=handles, loc="outside lower center", ncols=columns, columnspacing=1.2
        )
        if columns == 1 or legend.get_window_extent(renderer).width <= figure.bbox.width:
            break
        legend.remove()


def log_scale(axis: Axis, base: float = 10.0) -> None:
    """Makes an axis logarithmic, labelled in digits."""
    # no stub
    set_scale = axis.axes.set_xscale if axis.axis_name == "x" else axis.axes.set_yscale  # type: ignore[attr-defined]
    set_scale("log", base=base)
    axis.set_major_formatter(_Digits(base))
    axis.set_minor_formatter(_Digits(base, labelOnlyBase=False))


class _Digits(LogFormatter):
    """Labels what Matplotlib's own formatter labels, without mathtext."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        return f"{x:g}" if super().__call__(x, pos) else ""


def png(figure: Figure) -> bytes:
    """The finished figure as an image, the same bytes for the same figure; drawn once."""
    if figure not in _drawn:
        stream = io.BytesIO()
        figure.set_dpi(DOTS_PER_INCH)
        with style():  # not `savefig`, which draws twice
            canvas: Any = FigureCanvasAgg(figure)
            canvas.print_png(stream, metadata={"Software": None}, pil_kwargs={"compress_level": 3})
        _drawn[figure] = stream.getvalue()
    return _drawn[figure]


_drawn: WeakKeyDictionary[Figure, bytes] = WeakKeyDictionary()


def save_figure(
    figure: Figure, stem: str | Path, *, svg: bool = True, letters: str = "none"
) -> tuple[Path, ...]:
    """Writes `stem`.png and with `svg` `stem`.svg, the same bytes for the same figure; returns
    their paths.

    `letters` of the SVG are as Matplotlib's `svg.fonttype` has them: "none" is text, "path" needs
    no font.
    """
    paths = [
        path.with_name(path.name + end)
        for path, end in ((Path(stem), ".png"), (Path(stem), ".svg"))
    ]
    with replaced(paths[0], "wb") as stream:
        stream.write(png(figure))
    if svg:
        # settled with the PNG; it asks for what no canvas of SVG has
        figure.set_layout_engine("none")
        with style(), rc_context({"svg.fonttype": letters}), replaced(paths[1], "wb") as stream:
            canvas: Any = FigureCanvasSVG(figure)
            canvas.print_svg(stream, metadata={"Date": None})
    return tuple(paths if svg else paths[:1])
