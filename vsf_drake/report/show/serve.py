"""Shows a scene: on Meshcat's own small server with sliders, behind a gate that keeps other pages out; or as a page."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
import webbrowser
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from pydrake.geometry import Meshcat

from vsf_drake.errors import InputError, SimulationError
from vsf_drake.files import write_text
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.report.show.drawing import ENDLESS, finish_page, open_meshcat
from vsf_drake.report.show.scene import FRAMES, FULCRUM, LARGEST_LOAD_N, LOAD, Scene

LEAST_PORT, LAST_PORT = 1024, 65535
FRAMES_PER_SECOND = 20.0
SHOWN_LOAD_N = 400.0  # under which the fulcrum moves on a page without sliders
BEND_S, MOVE_S, COORDINATE_S = 1.0, 2.0, 0.8
"""How long the load takes to come and to go, the fulcrum from end to end, a coordinate to its value and back."""
_LARGEST_SHARE = 0.5


@contextlib.contextmanager
def gate(meshcat: Meshcat, port: int | None = None) -> Iterator[str]:
    """Serves `meshcat` on `port` of this machine, or on any free one, to its own pages only; yields the address.

    A request whose Host is another (a name that was bent to this machine) or whose Origin is another page is refused.
    """
    if port is not None and not LEAST_PORT <= port <= LAST_PORT:
        raise InputError(f"{port} is no port that a page can be served on", where="--port",
                         right=f"It must be between {LEAST_PORT} and {LAST_PORT}")
    host, _, inner = meshcat.web_url().removeprefix("http://").partition(":")
    script = Path(__file__).with_name("gate_process.py")
    with subprocess.Popen([sys.executable, "-I", str(script), str(port or 0), host, inner], stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE, text=True) as server:
        assert server.stdin is not None
        assert server.stdout is not None
        with server.stdin:  # whose end ends it, also when this process is killed
            answer = server.stdout.readline().strip()
            if not answer.isdigit():
                asked = "a free port" if port is None else f"port {port}"
                raise InputError(
                    f"{asked} could not be opened on this machine ({answer})", where="--port",
                    right="Another program may use it: give another port, or leave it out for any free one")
            yield f"http://localhost:{answer}"


def show_model(what: str, model: ModelParameters, subject: Subject | None = None, *, port: int | None = None,
               browser: bool = True, keel_joints: bool = False, say: Callable[[str], None] = print) -> None:
    """Serves the scene with its sliders until Stop is pressed there, or Ctrl-C here.

    `browser`: whether to open the page in the desktop's, where there is one. `say` is told the address, and what goes
    wrong.
    """
    meshcat = open_meshcat()
    with gate(meshcat, port) as address, contextlib.suppress(KeyboardInterrupt):  # the way it is meant to end
        viewer = Viewer(Scene(meshcat, what, model, subject, keel_joints=keel_joints), say)
        say(f"{what}: {address}   (Open Controls; press Stop there or Ctrl-C here to end)")
        if browser and _has_desktop():
            webbrowser.open(address)
        viewer.run()


def write_model_page(what: str, model: ModelParameters, path: str | Path, subject: Subject | None = None, *,
                     keel_joints: bool = False) -> None:
    """Writes the scene as one HTML file with an animation instead of sliders; nothing half-written is left.

    The load comes on with the fulcrum at its rearmost position, the fulcrum moves to its foremost one under it, the
    load goes; then every other control goes to a positive value and back, in the order of the caption.
    """
    meshcat = open_meshcat()
    scene = Scene(meshcat, what, model, subject, keel_joints=keel_joints)
    fulcrum = scene.foot.parameters.fulcrum
    first, last = 1e3 * fulcrum.rearmost_m, 1e3 * fulcrum.foremost_m
    meshcat.StartRecording(FRAMES_PER_SECOND, set_visualizations_while_recording=False)
    for i, values in enumerate(_course(scene, first, last)):
        scene.draw(values, i / FRAMES_PER_SECOND)
    meshcat.StopRecording()
    meshcat.get_mutable_recording().set_repetitions(ENDLESS)
    meshcat.PublishRecording()
    others = [control.name for control in scene.controls if control.name not in (FULCRUM, LOAD)]
    write_text(path, finish_page(meshcat, f"vsf_drake: {what}", "shown.html.j2", load_n=f"{SHOWN_LOAD_N:g}",
                                 first_mm=f"{first:g}", last_mm=f"{last:g}", others=others))


def _course(scene: Scene, first: float, last: float) -> Iterator[dict[str, float]]:
    """Values of all controls, frame after frame; the fulcrum goes from `first` to `last` (mm)."""
    start = scene.rest | {FULCRUM: first}
    for load in _ramp(0.0, SHOWN_LOAD_N, BEND_S):
        yield start | {LOAD: load}
    for fulcrum in _ramp(first, last, MOVE_S):
        yield start | {FULCRUM: fulcrum, LOAD: SHOWN_LOAD_N}
    for load in _ramp(SHOWN_LOAD_N, 0.0, BEND_S):
        yield start | {FULCRUM: last, LOAD: load}
    for control in scene.controls:
        if control.name not in (FULCRUM, LOAD):
            top = control.rest + min(control.high - control.rest, _LARGEST_SHARE * (control.high - control.low))
            there = _ramp(control.rest, top, 0.5 * COORDINATE_S)
            for value in (*there, *there[::-1]):
                yield start | {FULCRUM: last, control.name: value}


def _ramp(start: float, end: float, duration_s: float) -> list[float]:
    return [float(x) for x in np.linspace(start, end, round(duration_s * FRAMES_PER_SECOND) + 1)]


def _has_desktop() -> bool:
    """Whether a browser would have a window: Python's `webbrowser` would else start one in the terminal."""
    return sys.platform in ("darwin", "win32") or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


# A scene that follows its sliders in Meshcat until Stop or Ctrl-C. Drake's `pydrake.multibody.meshcat.JointSliders`
# moves joints one by one in radians. Here one slider bends all joints of the keel at once, as a load does, angles are
# in degrees and lengths in millimetres, and the numbers that follow from the pose stand below.


STOP, RESET = "Stop", "Reset"
RISE, SUPPORT = "= C rises (mm)", "= support (N)"
"""Sliders that show a number and cannot be moved for long: rise of the load point C in K, support force on the keel.
Meshcat shows some eighteen letters of a name."""
POLL_S = 1.0 / 30.0


def frame_button(letter: str) -> str:
    """Name of the button that shows and hides a frame."""
    return f"Frame {letter} on/off"


class Viewer:
    """Sliders and buttons of `scene` on its Meshcat; `say` is told what goes wrong while the page stays open."""

    def __init__(self, scene: Scene, say: Callable[[str], None]) -> None:
        self.meshcat, self.scene, self._say, self._said = scene.meshcat, scene, say, ""
        self._drawn: dict[str, float] = {}
        self._shown = dict.fromkeys(scene.frames, True)
        for button in (STOP, RESET, *map(frame_button, scene.frames)):
            self.meshcat.AddButton(button)
        self._resets = 0
        foot = scene.foot.parameters
        for control in scene.controls:
            self.meshcat.AddSlider(control.label, control.low, control.high, control.step, control.rest)
        largest = 1.2 * LARGEST_LOAD_N * foot.load_point_m / foot.fulcrum.rearmost_m
        self.meshcat.AddSlider(RISE, 0.0, 1e3 * foot.load_point_m, 0.01, 0.0)
        self.meshcat.AddSlider(SUPPORT, -round(largest), 0.0, 1.0, 0.0)
        self._told: dict[str, float] = {}
        self.poll()

    def values(self) -> dict[str, float]:
        """Where the sliders stand, by the names of their controls."""
        return {control.name: self.meshcat.GetSliderValue(control.label) for control in self.scene.controls}

    def poll(self) -> bool:
        """Follows what was moved or pressed since the last time; False once Stop was pressed."""
        resets = self.meshcat.GetButtonClicks(RESET)
        if resets != self._resets:
            self._resets = resets
            for control in self.scene.controls:
                self.meshcat.SetSliderValue(control.label, control.rest)
        for letter, shown in self._shown.items():
            wanted = self.meshcat.GetButtonClicks(frame_button(letter)) % 2 == 0
            if wanted != shown:
                self.meshcat.SetProperty(f"{FRAMES}/{letter}", "visible", wanted)
                self._shown[letter] = wanted
        values = self.values()
        if values != self._drawn:
            self._drawn = values
            try:
                shape = self.scene.draw(values)
                for name, value in ((RISE, 1e3 * float(shape.load_point_K[1])), (SUPPORT, shape.support_force_n)):
                    self._told[name] = self.meshcat.SetSliderValue(name, value)  # as rounded to the slider's step
            except SimulationError as error:
                if error.what != self._said:
                    self._say(error.what)
                self._said = error.what
        for name, value in self._told.items():
            if self.meshcat.GetSliderValue(name) != value:
                self.meshcat.SetSliderValue(name, value)
        return self.meshcat.GetButtonClicks(STOP) == 0

    def run(self) -> None:
        """Polls until Stop is pressed; KeyboardInterrupt is the caller's."""
        while self.poll():
            time.sleep(POLL_S)
