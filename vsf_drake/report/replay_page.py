"""The page around a replay: a title and a caption written into Meshcat's self-contained HTML."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence

from vsf_drake.report.style import condition_label
from vsf_drake.simulation.results import WalkResult

RGB = tuple[float, float, float]

_STYLE = ("position:fixed;left:12px;right:12px;bottom:10px;padding:5px 12px;font:13px/1.5 sans-serif;color:#222;"
          "background:rgba(255,255,255,.82);border-radius:4px;pointer-events:none")


def kind(result: WalkResult) -> str:
    """What the trial is; a synthetic one is called so."""
    return "synthetic walk, not recorded" if result.synthetic else "recorded walk"


def finish_page(page: str, result: WalkResult, legend: Sequence[tuple[RGB, str]]) -> str:
    """Meshcat's static `page` with the trial's title, and a caption along its lower edge.

    Args:
        page: what `Meshcat.StaticHtml` returns.
        result: the walk that the page shows; its texts are escaped.
        legend: colours (0 to 1) and what they stand for.

    Raises:
        ValueError: `page` has no title or no body.
    """
    title = f"{result.trial_name}: {kind(result)}"
    return with_caption(page, title, *_facts(result, legend))


def with_caption(page: str, title: str, text: str, extra: str = "") -> str:
    """Meshcat's static `page` with `title`, and a caption along its lower edge.

    Args:
        page: what `Meshcat.StaticHtml` returns.
        title: above `text`; both are escaped.
        extra: a last line, as HTML.

    Raises:
        ValueError: `page` has no title or no body.
    """
    page, titles = re.subn(r"<title>.*?</title>", lambda _: f"<title>{html.escape(title)}</title>", page, count=1,
                           flags=re.DOTALL)
    head, tag, tail = page.rpartition("</body>")
    if not titles or not tag:
        raise ValueError("Meshcat's page has no title or no body to write into")
    lines = "<br>".join(line for line in (f"<b>{html.escape(title)}</b>", html.escape(text), extra) if line)
    return f'{head}<div id="caption" style="{_STYLE}">{lines}</div>\n{tag}{tail}'


def _facts(result: WalkResult, legend: Sequence[tuple[RGB, str]]) -> tuple[str, str]:
    """What is said of the walk, and the legend as HTML."""
    lowest, highest = float(result.fulcrum_m.min()), float(result.fulcrum_m.max())
    fulcrum = condition_label(round(lowest, 6))
    if highest - lowest > 1e-6:
        fulcrum += f" to {1e3 * highest:g} mm"
    facts = [f"{result.side} prosthesis", fulcrum, f"0 s here is {result.time_s[0]:.3f} s of the trial"]
    if not result.converged:
        facts.append(f"{result.unconverged_steps} STEPS NOT CONVERGED")
    facts.append("Open Controls, Animations: pause, time, speed (timeScale)")
    swatches = "".join(f'<span style="white-space:nowrap;margin-right:2em"><span style="color:{_css(colour)}">&#9632;'
                       f"</span> {html.escape(name)}</span> " for colour, name in legend)
    return "; ".join(facts), swatches


def _css(colour: RGB) -> str:
    return "#" + "".join(f"{round(255 * c):02x}" for c in colour)
