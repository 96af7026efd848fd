"""The first screen and the chapters of a validation, made of its saved sections, with what is
missing said."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from vsf_drake.base.files import record
from vsf_drake.base.sentences import say
from vsf_drake.model.setting import AtSetting, setting_column
from vsf_drake.report.page import Chapter, made_chapter
from vsf_drake.report.style import Arrays
from vsf_drake.report.validation.bench_chapter import bench_chapter, standing_chapter
from vsf_drake.report.validation.energy_chapter import energy_chapter
from vsf_drake.report.validation.roll_over_chapter import roll_over_chapter
from vsf_drake.report.validation.sensitivity_chapter import sensitivity_chapter
from vsf_drake.report.validation.settings_chapter import settings_chapter
from vsf_drake.report.validation.walking_chapter import (
    exact_chapter,
    layers_chapter,
    walking_chapter,
)
from vsf_drake.walks.quantities import JUDGED

Content = Mapping[str, Any]
"""What a `validation.json` holds, of any version, which a record of this version need not take."""


_MAKERS: dict[str, tuple[str, Callable[..., Chapter]]] = {
    "bench": ("Bench", bench_chapter),
    "standing": ("Standing", standing_chapter),
    "walking": ("Walking", walking_chapter),
    "layers": ("Prediction in layers", layers_chapter),
    "walking_exact": ("Walking without errors of measurement", exact_chapter),
    "layers_exact": (
        "Prediction in layers without errors of measurement",
        partial(layers_chapter, exact=True),
    ),
    "energy": ("Energy storage and return", energy_chapter),
    "roll_over": ("Roll-over and inclined loading", roll_over_chapter),
    "settings": ("Can two settings be distinguished?", settings_chapter),
    "sensitivity": ("Sensitivity", sensitivity_chapter),
}
"""By section: what its chapter is called, and what makes it."""
_OF_STUDIES = ("settings", "sensitivity")  # computed by studies/ship_validation.py
_made: dict[str, tuple[object, Arrays, Chapter]] = {}
"""The chapter of each section that was made last, and of what: a page that grows shows it again."""


def make_chapters(
    content: Content, arrays: Arrays, tables: Mapping[str, type], *, lenient: bool
) -> list[Chapter]:
    """The first screen, one chapter a section, and how it was made; `arrays` by "section/name",
    `tables` the records of the sections.

    If `lenient`, a section that this version cannot show is named as missing instead of raising, as
    for results that another version wrote or somebody edited.
    """
    chapters = [made_chapter("summary", "", partial(_summary, content, arrays), lenient)]
    for name, (title, _) in _MAKERS.items():
        section, chapter = content["sections"].get(name), Chapter(name=name, title=title)
        if not isinstance(section, Mapping):
            some = ("layers", "walking_exact", "layers_exact")  # only of some studies
            if name in some or _passive(content):
                continue
            why = say(
                "validation",
                "absent",
                to_come=name.replace("_", " ") in (content.get("to_come") or ()),
                by="studies/ship_validation.py" if name in _OF_STUDIES else "vsf-drake validate",
            )
        elif section.get("failure") or section.get("table") is None:
            why = say("validation", "not_computed", why=section.get("failure") or "unknown")
        else:
            make = partial(_chapter_of, name, tables[name], section["table"])
            own = _within(arrays, f"{name}/")
            chapter = made_chapter(name, title, partial(make, own), lenient)
            why = [*map(str, section.get("missing") or ()), *chapter.missing]
        chapters.append(replace(chapter, name=name, title=title, missing=why))
    return [
        *chapters,
        made_chapter("made", "How this was made", partial(_making, content), lenient),
    ]


def _passive(content: Content) -> bool:
    """Whether a foot of it is passive: chapters of settings are then none of it."""
    return any(trial.get("fulcrum_mm", 0.0) is None for trial in content.get("trials") or ())


def _chapter_of(name: str, kind: type, saved: object, arrays: Arrays) -> Chapter:
    table, own, chapter = _made.get(name, (None, {}, Chapter(name="", title="")))
    if saved != table or own.keys() != arrays.keys() or any(own[k] is not arrays[k] for k in own):
        chapter = _MAKERS[name][1](record(kind, saved), arrays)
        _made[name] = (saved, arrays, chapter)
    return chapter


def _within(arrays: Arrays, begin: str) -> Arrays:
    """Those whose names begin so, by the rest of their names."""
    return {
        key.removeprefix(begin): array for key, array in arrays.items() if key.startswith(begin)
    }


def _summary(content: Content, arrays: Arrays) -> Chapter:
    moved = _within(arrays, "walking/moved_")
    tables = {
        name: (content["sections"].get(name) or {}).get("table") or {}
        for name in ("bench", "walking")
    }
    shown = tables["walking"].get("shown")
    settings = [record(AtSetting, trial) for trial in content.get("trials") or ()]
    return Chapter(
        name="summary",
        title="",
        template="validation/summary.html.j2",
        missing=content.get("notes", ()),
        facts={
            "verdict": (),
            "failed": (),
            **content,
            **tables,
            "moved": moved_walk(moved, shown["fulcrum_mm"] or 0.0) if moved and shown else None,
            "shown_setting": record(AtSetting, shown) if shown else None,
            "passive": shown and shown["fulcrum_mm"] is None,
            "place": setting_column(settings),
        },
    )


# The first screen: one walk with the fulcrum at each position that was computed, as SVG that a
# slider redraws.

_WIDE = 360.0
_HIGH = 236.0
_LEFT = 40.0
_RIGHT = 8.0
_TOP = 26.0
_BOTTOM = 36.0
_LOAD_MM_PER_N = 0.07
"""Length of the arrow of a load on the keel."""


@dataclass(frozen=True)
class Panel:
    """Axes of an SVG of _WIDE by _HIGH, from data to its points."""

    name: str
    title: str
    x_label: str
    x_range: tuple[float, float]
    y_range: tuple[float, float]

    def across(self, x: np.ndarray) -> np.ndarray:
        """Where these are from left to right."""
        low, high = self.x_range
        return _LEFT + (x - low) / (high - low) * (_WIDE - _LEFT - _RIGHT)

    def down(self, y: np.ndarray) -> np.ndarray:
        """Where these are from top to bottom."""
        low, high = self.y_range
        return _HIGH - _BOTTOM - (y - low) / (high - low) * (_HIGH - _TOP - _BOTTOM)

    def points(self, x: np.ndarray, y: np.ndarray) -> str:
        """A line for SVG, without what is not known."""
        places = zip(self.across(x), self.down(y), strict=True)
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in places if np.isfinite(a + b))

    @property
    def ticks(self) -> dict[str, list[tuple[str, str]]]:
        """Of each axis: where, as SVG has it, and what stands there."""
        found = {}
        for axis, place, (low, high) in (
            ("x", self.across, self.x_range),
            ("y", self.down, self.y_range),
        ):
            ticks = np.asarray(MaxNLocator(5).tick_values(low, high))
            found[axis] = [
                (f"{at:.1f}", f"{tick:g}")
                for at, tick in zip(place(ticks), ticks, strict=True)
                if low <= tick <= high
            ]
        return found


def moved_walk(arrays: Arrays, own_mm: float) -> dict[str, Any]:
    """Panels with what stands still in them, and a frame for each position of the fulcrum: points
    and numbers by the `id` of what shows them."""
    percent = np.linspace(0.0, 100.0, 101)
    keel = arrays["keel_mm"]
    panels = []
    still = {}
    frames: list[dict[str, str]] = [
        {
            "moved-mm": f"{x:.0f}",
            "moved-error": f"{100.0 * error:.1f}",
            "moved-load": f"{load:.0f}",
            "moved-tip": f"{z:.0f}",
        }
        for x, error, (load, _), z in zip(
            arrays["fulcrum_mm"], arrays[JUDGED], arrays["load"], keel[:, -1, 1], strict=True
        )
    ]
    for name, title in (
        ("resultant", "Resultant ground reaction force (body weights)"),
        ("cop", "Centre of pressure along the foot (% of its length)"),
    ):
        if f"{name}_model" not in arrays:
            continue
        scale = 100.0 if name == "cop" else 1.0
        lines = {
            key: scale * arrays[f"{name}_{key}"]
            for key in ("measured", "null")
            if f"{name}_{key}" in arrays
        }
        models = scale * arrays[f"{name}_model"]
        every = np.vstack([*lines.values(), models])
        high = 1.05 * np.nanmax(every)
        panel = Panel(
            name, title, "stance on the plate (%)", (0.0, 100.0), (min(np.nanmin(every), 0.0), high)
        )
        panels.append(panel)
        still[name] = {key: panel.points(percent, line) for key, line in lines.items()}
        for frame, model in zip(frames, models, strict=True):
            frame[f"moved-{name}"] = panel.points(percent, model)
    tip = float(keel[0, -1, 0]) + 30.0
    scale_mm = tip * (_HIGH - _TOP - _BOTTOM) / (_WIDE - _LEFT - _RIGHT)  # equal scales
    panel = Panel(
        "keel",
        "Keel at its largest forefoot load (mm)",
        "from the keel's posterior end A (mm)",
        (0.0, tip),
        (-0.55 * scale_mm, 0.45 * scale_mm),
    )
    panels.append(panel)
    still["keel"] = {"unbent": panel.points(np.array([0.0, tip - 20.0]), np.zeros(2))}
    for frame, x, shape, (load, at) in zip(
        frames, arrays["fulcrum_mm"], keel, arrays["load"], strict=True
    ):
        z, head = (float(np.interp(place, *shape.T)) for place in (x, at))
        # the fulcrum bears on the keel from above, the load from below
        z = z + 2.5
        head = head - 4.0
        foot = head - _LOAD_MM_PER_N * load
        frame |= {
            "moved-keel": panel.points(*shape.T),
            "moved-fulcrum": panel.points(
                x + np.array([0.0, -7.0, 7.0]), z + np.array([0.0, 13.0, 13.0])
            ),
            "moved-arrow": panel.points(
                at + np.array([0.0, 0.0, -4.0, 4.0, 0.0]),
                np.array([foot, head, head - 8.0, head - 8.0, head]),
            ),
        }
    return {
        "panels": panels,
        "still": still,
        "frames": frames,
        "own": int(np.argmin(np.abs(arrays["fulcrum_mm"] - own_mm))),
    }


def _making(content: Content) -> Chapter:
    return Chapter(
        name="made",
        title="How this was made",
        template="validation/made.html.j2",
        facts={
            **content,
            "times": [
                {"section": name.replace("_", " "), "wall_s": section["wall_s"]}
                for name, section in content["sections"].items()
            ],
        },
    )
