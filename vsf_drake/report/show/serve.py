"""Opens a scene: on Meshcat's own small server with sliders, behind a gate that keeps other pages out; or as a page."""

from __future__ import annotations

import contextlib
import logging
import os
import secrets
import subprocess
import sys
import time
import webbrowser
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from pydrake.geometry import Meshcat, MeshcatParams

from vsf_drake.errors import InputError, SimulationError
from vsf_drake.files import replaced
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.report.replay_page import with_caption
from vsf_drake.report.show import overlay
from vsf_drake.report.show.scene import (
    FULCRUM,
    LARGEST_LOAD_N,
    LOAD,
    Control,
    Scene,
    bench_scene,
    foot_scene,
    person_scene,
)
from vsf_drake.report.show.stage import Stage

KINDS = ("foot", "bench", "person")
LEAST_PORT, LAST_PORT = 1024, 65535


def open_meshcat() -> Meshcat:
    """A Meshcat for this program only, without Drake's message about it.

    Drake's server answers whoever finds it, web pages included. On Linux, where 127.0.0.0/8 is this machine, it gets
    one of 16 million addresses by chance, which no page can guess; `gate` is where visitors come in.
    """
    host = f"127.{1 + secrets.randbelow(254)}.{secrets.randbelow(256)}.{1 + secrets.randbelow(254)}"
    with _silent():
        return Meshcat(MeshcatParams(host=host if sys.platform == "linux" else "localhost", show_stats_plot=False))


@contextlib.contextmanager
def gate(meshcat: Meshcat, port: int | None = None) -> Iterator[str]:
    """Serves `meshcat` on `port` of this machine, or on any free one, to its own pages only; yields the address.

    A request whose Host is another (a name that was bent to this machine) or whose Origin is another page is refused.

    Raises:
        InputError: `port` is none that may be used, or is in use.
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


def make_scene(meshcat: Meshcat, what: str, model: ModelParameters, subject: Subject | None = None, *,
               keel_joints: bool = False) -> Scene:
    """The scene `what`, one of KINDS, on `meshcat`.

    Args:
        subject: the person's; of no use, and refused, elsewhere.
        keel_joints: whether every joint of the keel gets a control of its own.

    Raises:
        InputError: `what` is none of KINDS, or `subject` is missing or too much.
    """
    if what not in KINDS:
        raise InputError(f"{what!r} is nothing that can be shown", where="--what",
                         right=f"Say one of {', '.join(KINDS)}")
    if what != "person":
        if subject is not None:
            raise InputError(f"has no part in a {what} alone", where="--subject",
                             right="Leave it out, or say --what person")
        return (foot_scene if what == "foot" else bench_scene)(meshcat, model, keel_joints=keel_joints)
    if subject is None:
        raise InputError("a person needs a subject", where="--subject")
    return person_scene(meshcat, model, subject, keel_joints=keel_joints)


def show_model(what: str, model: ModelParameters, subject: Subject | None = None, *, port: int | None = None,
               browser: bool = True, keel_joints: bool = False, say: Callable[[str], None] = print) -> None:
    """Serves the scene with its sliders until Stop is pressed there, or Ctrl-C here.

    Args:
        port: to listen on; any free one by default.
        browser: whether to open the page in the desktop's browser, where there is a desktop.
        say: is told the address, and what goes wrong.

    Raises:
        InputError: see `gate` and `make_scene`.
    """
    meshcat = open_meshcat()
    with gate(meshcat, port) as address, contextlib.suppress(KeyboardInterrupt):  # the way it is meant to end
        viewer = Viewer(meshcat, make_scene(meshcat, what, model, subject, keel_joints=keel_joints), say)
        say(f"{what}: {address}   (Open Controls; press Stop there or Ctrl-C here to end)")
        if browser and _has_desktop():
            webbrowser.open(address)
        viewer.run()


def write_model_page(what: str, model: ModelParameters, path: str | Path, subject: Subject | None = None, *,
                     keel_joints: bool = False) -> None:
    """Writes the scene as one HTML file; see `write_page`.

    Raises:
        InputError: see `make_scene` and `write_page`. SimulationError: see `write_page`.
    """
    meshcat = open_meshcat()
    write_page(meshcat, make_scene(meshcat, what, model, subject, keel_joints=keel_joints), path)


def _has_desktop() -> bool:
    """Whether a browser would have a window: Python's `webbrowser` would else start one in the terminal."""
    return sys.platform in ("darwin", "win32") or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


@contextlib.contextmanager
def _silent() -> Iterator[None]:
    log = logging.getLogger("drake")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(level)


# A scene as one page that opens without a network: sliders are gone, so every control moves in turn.


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


# A scene that follows its sliders in Meshcat until Stop or Ctrl-C.
#
# Drake's `pydrake.multibody.meshcat.JointSliders` moves joints one by one in radians. Here one slider bends all joints
# of the keel at once, as a load does, angles are in degrees and lengths in millimetres, and the numbers that follow
# from the pose stand below; so the sliders are Meshcat's own.


STOP, RESET = "Stop", "Reset"
RISE, SUPPORT = "= C rises (mm)", "= support (N)"
"""Sliders that show a number and cannot be moved for long: rise of the load point C in K, support force on the keel.
Meshcat shows some eighteen letters of a name."""
POLL_S = 1.0 / 30.0


def frame_button(letter: str) -> str:
    """Name of the button that shows and hides a frame."""
    return f"Frame {letter} on/off"


class Viewer:
    """Sliders and buttons of `scene` on `meshcat`.

    Args:
        say: is told what goes wrong while the page stays open.
    """

    def __init__(self, meshcat: Meshcat, scene: Scene, say: Callable[[str], None]) -> None:
        self.meshcat, self.scene, self._say = meshcat, scene, say
        self._stage, self._said = Stage(meshcat, scene), ""
        self._drawn: dict[str, float] = {}
        self._shown = dict.fromkeys(scene.frames, True)
        meshcat.AddButton(STOP)
        meshcat.AddButton(RESET)
        for letter in scene.frames:
            meshcat.AddButton(frame_button(letter))
        self._resets = 0
        foot = scene.foot.parameters
        for control in scene.controls:
            meshcat.AddSlider(control.label, control.low, control.high, control.step, control.rest)
        largest = 1.2 * LARGEST_LOAD_N * foot.load_point_m / foot.fulcrum.rearmost_m
        meshcat.AddSlider(RISE, 0.0, 1e3 * foot.load_point_m, 0.01, 0.0)
        meshcat.AddSlider(SUPPORT, -round(largest), 0.0, 1.0, 0.0)
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
                overlay.show_triad(self.meshcat, letter, wanted)
                self._shown[letter] = wanted
        values = self.values()
        if values != self._drawn:
            self._follow(values)
        for name, value in self._told.items():
            if self.meshcat.GetSliderValue(name) != value:
                self.meshcat.SetSliderValue(name, value)
        return self.meshcat.GetButtonClicks(STOP) == 0

    def run(self) -> None:
        """Polls until Stop is pressed; KeyboardInterrupt is the caller's."""
        while self.poll():
            time.sleep(POLL_S)

    def _follow(self, values: dict[str, float]) -> None:
        self._drawn = values
        try:
            readings = self._stage.draw(values)
        except SimulationError as error:
            if error.what != self._said:
                self._said = error.what
                self._say(error.what)
            return
        for name, value in ((RISE, readings.rise_mm), (SUPPORT, readings.support_force_n)):
            self._told[name] = self.meshcat.SetSliderValue(name, value)  # as rounded to the slider's step
