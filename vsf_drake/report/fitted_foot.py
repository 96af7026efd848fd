"""A foot from its curves, as a model file with a picture beside it."""

from __future__ import annotations

import textwrap
from pathlib import Path

from matplotlib.figure import Figure

from vsf_drake.base.errors import require
from vsf_drake.base.files import read_text, write_text
from vsf_drake.base.sentences import say
from vsf_drake.device.foot_from_curves import FittedFoot
from vsf_drake.model.foot_curves import PARTS, PUBLISHED_N_PER_MM
from vsf_drake.model.model_file import model_yaml
from vsf_drake.report.style import (
    MARK_COLOURS,
    MEASURED,
    NEUTRAL,
    PANEL,
    SIMULATED,
    drawing,
    label,
    save_figure,
)

FOLLOWED = 0.05  # root mean square of a curve's residuals over its largest load: more is a misfit
_FIRST = "# A foot from its curves, written by vsf-drake foot"
_LINE = 100  # characters of a comment
_MOST = 1_000_000  # bytes of a model file
_COLOURS = ("#31688e", "#b7791f", MARK_COLOURS["good"], "#6d4c91")


def foot_figure(foot: FittedFoot) -> Figure:
    """Each curve beside the model's with its 90 % interval, the forefoot and the heel."""
    width, height = PANEL
    shown = [part for part in PARTS if any(each.curve.part == part for each in foot.curves)]
    with drawing(width * len(shown), height) as figure:
        for axes, part in zip(figure.subplots(1, len(shown), squeeze=False)[0], shown, strict=True):
            fitted = [each for each in foot.curves if each.curve.part == part]
            for colour, each in zip(_COLOURS * len(fitted), fitted, strict=False):
                curve = each.curve
                x = 1e3 * curve.displacement_m
                axes.fill_between(
                    x,
                    each.load_n - each.half_width_n,
                    each.load_n + each.half_width_n,
                    color=colour,
                    alpha=0.18,
                    linewidth=0.0,
                )
                axes.plot(x, curve.load_n, color=colour, label=curve.name, **MEASURED)
                axes.plot(x, each.load_n, color=colour, **SIMULATED)
                if curve.unloading is not None:
                    back, load = curve.unloading
                    axes.plot(1e3 * back, load, color=colour, linewidth=0.7, linestyle=":")
            axes.plot([], [], color=NEUTRAL, label="model, 90 % interval", **SIMULATED)
            axes.set_xlim(left=0.0)
            axes.set_ylim(bottom=0.0)
            axes.legend(loc="upper left")
            label(axes, x="displacement of the platen (mm)", y="load (N)", title=part.capitalize())
    return figure


def said_of(foot: FittedFoot) -> list[str]:
    """What the foot is worth, in sentences."""
    return say("foot", **vars(foot), most=FOLLOWED, published=PUBLISHED_N_PER_MM)


def misses(foot: FittedFoot) -> bool:
    """Whether the model does not follow one of the curves."""
    return max(each.rms_share for each in foot.curves) > FOLLOWED


def check_foot_file(out: Path) -> None:
    """InputError unless `out` is the name of a model file that may be written, and so may the
    picture beside it: where there is no such model yet, no picture is written over."""
    require(
        out.suffix.lower() in (".yaml", ".yml"),
        "is no name of a model file",
        "--out",
        "Give a file that ends in .yaml",
        file=out,
    )
    require(out.parent.is_dir(), "there is no such folder", "--out", file=out.parent)
    require(
        not out.exists() or read_text(out, most=_MOST).startswith(_FIRST),
        "exists, and was not written by this command",
        "--out",
        "Give another name, or delete it",
        file=out,
    )
    picture = out.with_suffix(".png")
    require(
        out.exists() or not picture.exists(),
        "exists, and was not written by this command",
        "--out",
        "Give another name, or delete it: the picture is written beside the model file",
        file=picture,
    )


def write_fitted_foot(foot: FittedFoot, out: Path) -> Path:
    """Writes the model file, with intervals and what it is worth in its comments, and the picture
    beside it, whose path is returned. InputError as `check_foot_file`."""
    check_foot_file(out)
    rows = [
        f"{each.name}: {each.value:.3g}{' ' * bool(each.unit)}{each.unit} "
        f"({each.low:.3g} to {each.high:.3g}{'' if each.told else '; not told by the curves'})"
        for each in foot.values
    ]
    lines = [
        line
        for text in (*said_of(foot), "Values, with 90 % intervals:", *rows)
        for line in textwrap.wrap(text, _LINE, initial_indent="# ", subsequent_indent="#   ")
    ]
    [picture] = save_figure(foot_figure(foot), out.with_suffix(""), svg=False)
    write_text(out, "\n".join([_FIRST, *lines, model_yaml(foot.model)]))
    return picture
