"""A scene that follows its sliders in Meshcat until Stop or Ctrl-C.

Drake's `pydrake.multibody.meshcat.JointSliders` moves joints one by one in radians. Here one slider bends all joints of
the keel at once, as a load does, angles are in degrees and lengths in millimetres, and the numbers that follow from the
pose stand below; so the sliders are Meshcat's own.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from pydrake.geometry import Meshcat

from vsf_drake.errors import SimulationError
from vsf_drake.report.show import overlay
from vsf_drake.report.show.controls import LARGEST_LOAD_N
from vsf_drake.report.show.scene import Scene
from vsf_drake.report.show.stage import Stage

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
