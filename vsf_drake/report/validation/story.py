"""The story of a validation, one screen: a walk whose curves, foot and replay follow a slider of
the setting, and three numbers with a picture each. All of it SVG, of saved sections."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from vsf_drake.base.files import record
from vsf_drake.model.setting import AtSetting
from vsf_drake.report.page import Chapter
from vsf_drake.report.style import Arrays

_PERCENT = np.linspace(0.0, 100.0, 101)
_LATE = _PERCENT >= 50.0
_LEFT = 34.0
_RIGHT = 14.0
_TOP = 22.0
_BOTTOM = 32.0
_TICK_PX = 20.0
"""Least distance of ticks one above the other."""
_ARROW_MM = 45.0
"""Length of the arrow of the largest load of all settings on the keel."""
_ABOVE_MM = 52.0
"""Of the pylon that is drawn above its mount."""
_TOE = (1.0, 0.5)
"""How far before the tip the foam begins to thin, in its own thicknesses, and its share there."""


@dataclass(frozen=True, kw_only=True)
class Panel:
    """Axes of an SVG `wide` by `high`, from data to its points."""

    name: str
    title: str
    x_label: str = ""
    x_range: tuple[float, float]
    y_range: tuple[float, float]
    wide: float = 360.0
    high: float = 136.0

    def across(self, x: Any) -> np.ndarray:
        """Where these are from left to right."""
        low, high = self.x_range
        return _LEFT + (np.asarray(x) - low) / (high - low) * (self.wide - _LEFT - _RIGHT)

    def down(self, y: Any) -> np.ndarray:
        """Where these are from top to bottom."""
        low, high = self.y_range
        room = self.high - _TOP - _BOTTOM
        return self.high - _BOTTOM - (np.asarray(y) - low) / (high - low) * room

    def points(self, x: Any, y: Any) -> str:
        """A line for SVG, without what is not known."""
        return _points(self.across(x), self.down(y))

    @property
    def ticks(self) -> dict[str, list[tuple[str, str]]]:
        """Of each axis: where, as SVG has it, and what stands there."""
        found = {}
        room = self.high - _TOP - _BOTTOM
        for axis, place, (low, high), most in (
            ("x", self.across, self.x_range, 5),
            ("y", self.down, self.y_range, int(room / _TICK_PX)),
        ):
            ticks = np.asarray(MaxNLocator(most).tick_values(low, high))
            found[axis] = [
                (f"{at:.1f}", f"{tick:g}")
                for at, tick in zip(place(ticks), ticks, strict=True)
                if low <= tick <= high
            ]
        return found


def _points(across: np.ndarray, down: np.ndarray) -> str:
    places = zip(np.atleast_1d(across), np.atleast_1d(down), strict=True)
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in places if np.isfinite(a + b))


def story_chapter(content: Mapping[str, Any], moved: Arrays) -> Chapter:
    """`moved`: the arrays of the section of that name, which may be none."""
    tables = {
        name: (section or {}).get("table") or {}
        for name, section in content["sections"].items()
        if isinstance(section, Mapping)
    }
    walk = tables.get("moved")
    return Chapter(
        name="story",
        title="",
        template="validation/story.html.j2",
        missing=content.get("notes", ()),
        facts={
            "verdict": (),
            "failed": (),
            "to_come": (),
            **content,
            "walk": walk,
            "setting": record(AtSetting, walk) if walk else None,
            "moved": moved_walk(walk, moved) if walk and "fulcrum_mm" in moved else None,
            "numbers": {
                "error": _error_bars(tables.get("walking", {}), tables.get("layers", {})),
                "stiffness": _stiffness(tables.get("bench", {})),
                "energy": _returned(tables.get("energy", {})),
            },
        },
    )


# One walk with the fulcrum at each position that was computed, which a slider chooses.


def moved_walk(walk: Mapping[str, Any], arrays: Arrays) -> dict[str, Any]:
    """Panels with what stands still in them, the foot, and a frame for each position of the
    fulcrum: points and numbers by the `id` of what shows them."""
    own = int(np.argmin(np.abs(arrays["fulcrum_mm"] - (walk["fulcrum_mm"] or 0.0))))
    force = arrays["resultant_model"]
    change = force - force[own]
    push_off = np.nanmax(force[:, _LATE], axis=1)
    frames: list[dict[str, str]] = [
        {
            "moved-mm": f"{x:.0f}",
            "moved-change": f"{100.0 * rms:.0f}",
            "moved-push-off": f"{100.0 * push:+.0f}" if i != own else "0",
            "moved-load": f"{load:.0f}",
            "moved-tip": f"{z:.0f}",
        }
        for i, (x, rms, push, (load, _), z) in enumerate(
            zip(
                arrays["fulcrum_mm"],
                np.sqrt(np.nanmean(change**2, axis=1)),
                push_off - push_off[own],
                arrays["load"],
                arrays["keel_mm"][:, -1, 1],
                strict=True,
            )
        )
    ]
    panels = []
    still = {}
    for name, title, scale in (
        ("resultant", "Ground reaction force (body weights)", 1.0),
        ("cop", "Centre of pressure (% of the foot's length)", 100.0),
    ):
        if f"{name}_model" not in arrays:
            continue
        lines = {
            key: scale * arrays[f"{name}_{key}"]
            for key in ("measured", "null")
            if f"{name}_{key}" in arrays
        }
        models = scale * arrays[f"{name}_model"]
        every = np.vstack([*lines.values(), models])
        panel = Panel(
            name=name,
            title=title,
            x_label="stance on the plate (%)",
            x_range=(0.0, 100.0),
            y_range=(min(np.nanmin(every), 0.0), 1.05 * np.nanmax(every)),
        )
        panels.append(panel)
        still[name] = {key: panel.points(_PERCENT, line) for key, line in lines.items()}
        for frame, model in zip(frames, models, strict=True):
            frame[f"moved-{name}"] = panel.points(_PERCENT, model)
    foot = _Foot(walk["drawn"])
    longest = float(arrays["load"][:, 0].max())
    for frame, x, keel, (load, at) in zip(
        frames, arrays["fulcrum_mm"], arrays["keel_mm"], arrays["load"], strict=True
    ):
        frame.update(foot.bent(x, keel, at, _ARROW_MM * load / longest))
    return {
        "panels": panels,
        "still": still,
        "foot": foot.still(arrays["keel_mm"]),
        "frames": frames,
        "own": own,
    }


class _Foot:
    """The foot from its side in the keel frame, in equal scales, as SVG."""

    def __init__(self, drawn: Mapping[str, float]) -> None:
        self.drawn = drawn
        self.keel_mm = drawn["keel_thickness_mm"]
        self.rail_mm = 0.65 * drawn["mount_z_mm"]
        self.low_mm = -(drawn["foam_mm"] + self.keel_mm + _ARROW_MM - 8.0)
        self.high_mm = drawn["mount_z_mm"] + _ABOVE_MM
        self.rear_mm = drawn["rear_x_mm"] - 22.0
        self.scale = 352.0 / (drawn["front_x_mm"] + 40.0 - self.rear_mm)  # px a mm
        self.high = _TOP + self.scale * (self.high_mm - self.low_mm)

    def at(self, x: Any, z: Any) -> str:
        """Points of what is at x, z (mm)."""
        across = 4.0 + self.scale * (np.asarray(x, dtype=float) - self.rear_mm)
        return _points(across, _TOP + self.scale * (self.high_mm - np.asarray(z, dtype=float)))

    def box(self, x: float, wide: float, low: float, high: float) -> str:
        """A rectangle about x."""
        return self.at(x + 0.5 * wide * np.array([-1, 1, 1, -1]), np.array([low, low, high, high]))

    def still(self, keels: np.ndarray) -> dict[str, Any]:
        """What the setting does not move, and where labels stand."""
        d = self.drawn
        tip = float(keels[0, -1, 0])
        places = {
            "pylon": (d["pylon_x_mm"] + 22.0, self.high_mm - 12.0),
            "fulcrum": (d["pylon_x_mm"] + 50.0, self.rail_mm + 34.0),
            "keel": (tip - 42.0, self.high_mm - 12.0),
            "heel": (self.rear_mm + 2.0, self.low_mm + 12.0),
            "foam": (0.42 * tip, self.low_mm + 6.0),
            "load": (tip - 8.0, self.low_mm + 6.0),
        }
        marked = {
            "pylon": (d["pylon_x_mm"], self.high_mm - 16.0),
            "heel": (d["rear_x_mm"] + 14.0, -0.8 * d["foam_mm"]),
            "foam": (0.5 * tip, -0.8 * d["foam_mm"]),
        }
        return {
            "high": f"{self.high:.0f}",
            "wide_px": f"{self.scale * self.keel_mm:.1f}",
            "unbent": self.at([0.0, tip], [0.0, 0.0]),
            "rail": self.box(0.35 * tip, 0.8 * tip, self.rail_mm, self.rail_mm + self.keel_mm),
            "hinge": self.box(0.0, 12.0, 0.0, self.rail_mm),
            "pylon": self.box(d["pylon_x_mm"], 30.0, d["mount_z_mm"], self.high_mm),
            "adapter": self.box(d["pylon_x_mm"], 36.0, self.rail_mm, d["mount_z_mm"]),
            "labels": {name: self.at(x, z).split(",") for name, (x, z) in places.items()},
            "leaders": {
                name: f"{self.at(*_beside(places[name], at))} {self.at(*at)}"
                for name, at in marked.items()
            },
        }

    def bent(
        self, fulcrum: float, keel: np.ndarray, load_at: float, arrow: float
    ) -> dict[str, str]:
        """What the setting moves: points by `id`."""
        d = self.drawn
        x, z = keel.T
        slope = np.gradient(z, x)
        across = np.array([-slope, np.ones_like(slope)]) / np.sqrt(1.0 + slope**2)  # up from it
        thick = d["foam_mm"] * np.where(x > x[-1] - _TOE[0] * d["foam_mm"], _TOE[1], 1.0)
        top = keel.T - 0.5 * self.keel_mm * across
        sole = top - thick * across
        rear = d["rear_x_mm"]
        foam_x = np.concatenate([[rear], top[0], sole[0, ::-1], [rear]])
        foam_z = np.concatenate([[top[1, 0]], top[1], sole[1, ::-1], [sole[1, 0]]])
        at_fulcrum = float(np.interp(fulcrum, x, z)) + 0.5 * self.keel_mm
        head = float(np.interp(load_at, x, z)) - 0.5 * self.keel_mm - d["foam_mm"] - 2.0
        arrow_x = load_at + np.array([0.0, 0.0, -4.0, 4.0, 0.0])
        arrow_z = head + np.array([-arrow, 0.0, -8.0, -8.0, 0.0])
        label = (d["pylon_x_mm"] + 52.0, self.rail_mm + 30.0)
        return {
            "moved-keel": self.at(x, z),
            "moved-foam": self.at(foam_x, foam_z),
            "moved-support": self.at(
                fulcrum + np.array([0.0, 9.0, 9.0, -9.0, -9.0]),
                [at_fulcrum, at_fulcrum + 9.0, self.rail_mm, self.rail_mm, at_fulcrum + 9.0],
            ),
            "moved-arrow": self.at(arrow_x, arrow_z),
            "moved-to-support": self.at([label[0], fulcrum], [label[1], 0.8 * self.rail_mm]),
            "moved-to-keel": self.at([x[-1] - 20.0, x[-1] - 8.0], [self.high_mm - 16.0, z[-1]]),
        }


def _beside(label: tuple[float, float], at: tuple[float, float]) -> tuple[float, float]:
    """Where a line from a label begins: below or above its first letters."""
    x, z = label
    return x + 6.0, z + (10.0 if at[1] > z else 2.0)


# Three numbers, each with a picture 240 by 84; None as long as it is not known.


def _error_bars(walking: Mapping[str, Any], layers: Mapping[str, Any]) -> dict[str, Any] | None:
    """The errors of held-out walks, % of body weight, as bars: of the physics, of the person's own
    curve, and of the harder null."""
    held_out = walking.get("held_out") or {}
    rows = [row for row in layers.get("rows") or () if row["role"] == "held out"]

    def mean(name: str) -> float | None:
        known = [row[name] for row in rows if row.get(name) is not None]
        return float(np.mean(known)) if known else None

    nulls = [
        held_out.get("null_model_grf_rmse_bw"),
        mean("null_model_grf_rmse_bw"),
        mean("null_model_predicted_times_grf_rmse_bw"),
    ]
    bars = [
        ("model: physics", held_out.get("grf_rmse_bw"), "model"),
        ("and own curve", mean("person_grf_rmse_bw"), "model"),
        ("harder null", min((one for one in nulls if one is not None), default=None), "null"),
    ]
    return _bars([(name, 100.0 * one, kind) for name, one, kind in bars if one is not None])


def _returned(energy: Mapping[str, Any]) -> dict[str, Any] | None:
    """Energy that the foot returns in a stance, J, by setting."""
    return _bars(
        [
            (f"{row['fulcrum_mm']:g} mm", row["returned_j"], "model")
            for row in energy.get("conditions") or ()
            if row.get("returned_j") is not None
        ]
    )


def _bars(rows: Sequence[tuple[str, float, str]]) -> dict[str, Any] | None:
    """Bars of one unit from the same zero: where each begins and how long it is, and its number."""
    if not rows:
        return None
    most = max(value for _, value, _ in rows)
    high = 72.0 / len(rows)
    return {
        "values": [value for _, value, _ in rows],
        "bars": [
            {
                "name": name,
                "shown": f"{value:.1f}",
                "kind": kind,
                "y": f"{4.0 + i * high:.1f}",
                "middle": f"{4.0 + (i + 0.4) * high + 4.0:.1f}",
                "long": f"{104.0 * value / most:.1f}",
                "high": f"{min(0.78 * high, 22.0):.1f}",
            }
            for i, (name, value, kind) in enumerate(rows)
        ],
    }


def _stiffness(bench: Mapping[str, Any]) -> dict[str, Any] | None:
    """The foot's stiffness on the bench over the fulcrum, N/mm, and the published end points."""
    rows = [
        row
        for row in bench.get("settings") or ()
        if row["fulcrum_mm"] is not None and row.get("model")  # not the heel's
    ]
    if len(rows) < 2:
        return None
    x = [row["fulcrum_mm"] for row in rows]
    model = [row["model"]["stiffness_n_per_mm"] for row in rows]
    published = [
        (row["fulcrum_mm"], row["published_n_per_mm"])
        for row in rows
        if row.get("published_n_per_mm") is not None
    ]
    panel = Panel(
        name="stiffness",
        title="",
        x_range=(min(x) - 5.0, max(x) + 5.0),
        y_range=(0.0, 1.15 * max(model)),
        wide=240.0,
        high=96.0,
    )
    return {
        "panel": panel,
        "line": panel.points(x, model),
        "places": [panel.points(*place).split(",") for place in published],
        "published": [value for _, value in published],
        "values": model,
        "at": x,
    }
