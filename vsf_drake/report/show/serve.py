"""Opens a scene: on Meshcat's own small server with sliders, behind a gate that keeps other pages out; or as a page."""

from __future__ import annotations

import contextlib
import logging
import os
import secrets
import subprocess
import sys
import webbrowser
from collections.abc import Callable, Iterator
from pathlib import Path

from pydrake.geometry import Meshcat, MeshcatParams

from vsf_drake.errors import InputError
from vsf_drake.parameters import ModelParameters, Subject
from vsf_drake.report.show.page import write_page
from vsf_drake.report.show.scene import Scene, bench_scene, foot_scene, person_scene
from vsf_drake.report.show.viewer import Viewer

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
