"""A scene as one page that opens without a network: sliders are gone, so every control moves in turn."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pydrake.geometry import Meshcat

from vsf_drake.files import replaced
from vsf_drake.report.replay_page import with_caption
from vsf_drake.report.show.controls import FULCRUM, LOAD, Control
from vsf_drake.report.show.scene import Scene
from vsf_drake.report.show.stage import Stage

FRAMES_PER_SECOND = 20.0
SHOWN_LOAD_N = 400.0
"""Under which the fulcrum moves."""
BEND_S, MOVE_S = 1.0, 2.0
"""How long the load takes to come and to go, and the fulcrum from end to end."""
COORDINATE_S = 0.8
"""How long a coordinate takes to its positive value and back."""
_LARGEST_SHARE = 0.5
_ENDLESS = 100_000


def write_page(meshcat: Meshcat, scene: Scene, path: str | Path) -> None:
    """Writes `scene` as one HTML file with an animation; nothing half-written is left.

    The load comes on with the fulcrum at its rearmost position, the fulcrum moves to its foremost one under it, the
    load goes; then every other control goes to a positive value and back, in the order of the caption.

    Raises:
        InputError: the file cannot be written. SimulationError: the keel does not bear the load.
    """
    stage = Stage(meshcat, scene)
    meshcat.StartRecording(FRAMES_PER_SECOND, set_visualizations_while_recording=False)
    for i, values in enumerate(course(scene)):
        stage.draw(values, i / FRAMES_PER_SECOND)
    meshcat.StopRecording()
    meshcat.get_mutable_recording().set_repetitions(_ENDLESS)
    meshcat.PublishRecording()
    page = with_caption(meshcat.StaticHtml(), f"vsf_drake: {scene.what}", _caption(scene))
    with replaced(path) as stream:
        stream.write(page)


def course(scene: Scene) -> Iterator[dict[str, float]]:
    """Values of all controls, frame after frame."""
    first, last = _reach_mm(scene)
    start = scene.rest | {FULCRUM: first}
    for load in _ramp(0.0, SHOWN_LOAD_N, BEND_S):
        yield start | {LOAD: load}
    for fulcrum in _ramp(first, last, MOVE_S):
        yield start | {FULCRUM: fulcrum, LOAD: SHOWN_LOAD_N}
    for load in _ramp(SHOWN_LOAD_N, 0.0, BEND_S):
        yield start | {FULCRUM: last, LOAD: load}
    for control in _others(scene):
        top = control.rest + min(control.high - control.rest, _LARGEST_SHARE * (control.high - control.low))
        there = _ramp(control.rest, top, 0.5 * COORDINATE_S)
        for value in (*there, *there[::-1]):
            yield start | {FULCRUM: last, control.name: value}


def _reach_mm(scene: Scene) -> tuple[float, float]:
    fulcrum = scene.foot.parameters.fulcrum
    return 1e3 * fulcrum.rearmost_m, 1e3 * fulcrum.foremost_m


def _others(scene: Scene) -> list[Control]:
    return [control for control in scene.controls if control.name not in (FULCRUM, LOAD)]


def _ramp(start: float, end: float, duration_s: float) -> list[float]:
    return [float(x) for x in np.linspace(start, end, round(duration_s * FRAMES_PER_SECOND) + 1)]


def _caption(scene: Scene) -> str:
    first, last = _reach_mm(scene)
    text = (f"Up to {SHOWN_LOAD_N:g} N on the load point (orange), and under it the fulcrum from {first:g} to "
            f"{last:g} mm. Frames W (world), K (keel), M (mount): x red, y green, z blue; Scene, frames hides them. ")
    names = ", ".join(control.name for control in _others(scene))
    if names:
        text += f"Then each to a positive value and back: {names}. "
    return text + "Open Controls, Animations: pause, time, speed (timeScale)"
