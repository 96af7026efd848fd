"""Whether a figure can be read on a telephone: the height of its letters, and what is cut off or
overlaps."""

from __future__ import annotations

from itertools import combinations

from matplotlib.figure import Figure
from matplotlib.text import Text

# width of a page's content on a telephone of 390 pixels, height of its letters
TELEPHONE_PX, LEAST_PX = 366.0, 8.0


def letters_px(figure: Figure) -> float:
    """Height of the figure's smallest letters where it is as wide as a telephone's page."""
    texts = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    return min(text.get_fontsize() for text in texts) / 72.0 * TELEPHONE_PX / figure.get_figwidth()


def assert_readable(figure: Figure, name: str) -> None:
    """Letters are large enough; nothing is cut off; titles, labels, ticks and legends keep clear of
    each other."""
    assert letters_px(figure) >= LEAST_PX, name
    figure.draw_without_rendering()
    box, whole = figure.get_tightbbox(), figure.bbox_inches
    assert box.x0 >= -0.02 and box.y0 >= -0.02, name
    assert box.x1 <= whole.x1 + 0.02 and box.y1 <= whole.y1 + 0.02, name
    texts = [*figure.texts, *(text for legend in figure.legends for text in legend.get_texts())]
    for axes in figure.axes:
        if axes.axison:
            low, high = sorted(axes.get_xlim())
            ticks = [
                tick.label1
                for tick in axes.xaxis.get_major_ticks()
                if low <= tick.get_loc() <= high
            ]
            texts += [axes.title, axes._left_title, axes.xaxis.label, axes.yaxis.label, *ticks]
    boxes = [
        (text.get_text(), text.get_window_extent())
        for text in texts
        if text.get_text() and text.get_visible()
    ]
    for (first, here), (second, there) in combinations(boxes, 2):
        assert not here.overlaps(there), f"{name}: '{first}' and '{second}'"
