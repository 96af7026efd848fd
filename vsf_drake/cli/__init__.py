"""The command line: `main`, which answers signals and errors; a command's module adds it when it is
imported."""

from __future__ import annotations

import atexit
import gc
import importlib
import os
import signal
import stat
import sys
import threading
from typing import Any, Self

from vsf_drake.base.errors import (
    InputError,
    SimulationError,
    VsfError,
    interrupted_lately,
    note_interruption,
)
from vsf_drake.cli.guide import GUIDES, guide_to

# how long after a signal fell into a callback of compiled code it is raised once more (a choice)
RAISED_AGAIN_S = 0.05
GARBAGE_OBJECTS = 500_000  # after so many new ones Python looks for garbage (a choice)
INTERRUPTED = "interrupted; results are written whole or not at all"


def main() -> None:
    """Runs the command line; a user's mistake ends with one message and exit code 2, a failed
    simulation with 3.

    SIGTERM and the closing of the terminal end it as Ctrl-C does, with exit codes 143 and 129.
    Where it does not run in the main thread, signals are left to the caller.
    """
    # looking for garbage among what is imported, and at the end, takes a fifth of a short command;
    # a lower threshold after it would look through all of that again
    gc.set_threshold(GARBAGE_OBJECTS)
    atexit.register(gc.freeze)
    with _Signals() as signals:
        code = _ended(signals)
    # out here, where no traceback keeps parts of Drake into Python's own end, which may abort on
    # them
    sys.exit(code)


def _ended(signals: _Signals) -> int | str | None:
    """Runs the command, and says what there is to say of how it ended; the exit code."""
    try:  # the commands are loaded here, where a signal already finds its answer
        from vsf_drake.cli import (  # noqa: F401
            certify,
            compare,
            device,
            doctor,
            fit,
            foot,
            predict,
            recordings,
            session,
            stiffness_map,
            study,
            sweep,
            tune,
        )
        from vsf_drake.cli.app import PlainCommand, app

        order = {name: place for place, name in enumerate(GUIDES)}
        app.registered_commands.sort(
            key=lambda each: order.get(
                str(each.name or getattr(each.callback, "__name__", "")), len(order)
            )
        )
        for each in app.registered_commands:
            each.cls = PlainCommand
        app()
    except (SystemExit, KeyboardInterrupt) as ended:
        signals.answer_no_more()
        # Typer's word for it, and ours
        if isinstance(ended, SystemExit) and ended.code != 128 + signal.SIGINT:
            return ended.code
        said = isinstance(ended, SystemExit) and isinstance(
            ended.__cause__ or ended.__context__, KeyboardInterrupt
        )
        if not said:  # by the command, which knows what is written
            print(INTERRUPTED, file=sys.stderr)
        return 128 + signals.ended_by
    except Exception as error:
        signals.answer_no_more()
        # compiled code of others makes errors of its own of an interruption
        if interrupted_lately():
            print(f"{INTERRUPTED} ({type(error).__name__}: {error})", file=sys.stderr)
            return 128 + signals.ended_by
        from vsf_drake.cli.app import fail

        if isinstance(error, ImportError | OSError) and not _drake_loads():
            fail(
                f"Drake cannot be imported: {type(error).__name__}: {error}. vsf-drake doctor "
                "says what to do"
            )
            return SimulationError.exit_code
        # of a file that nobody asked for: a full disk under a compiler's cache
        if isinstance(error, OSError):
            error = InputError(error.strerror or str(error), file=error.filename)
        if not isinstance(error, VsfError):
            raise
        fail(str(error))
        if isinstance(error, InputError) and (place := guide_to(error, sys.argv[1:])):
            page, _, section = place.partition("#")
            print(f"guide: docs/guide/{page}.md{section and f'#{section}'}", file=sys.stderr)
        return error.exit_code
    return 0


def _drake_loads() -> bool:
    try:
        importlib.import_module("pydrake.solvers")
    except Exception:  # of any kind, as in `doctor`
        return False
    return True


class _Signals:
    """While it is entered SIGINT, SIGTERM and SIGHUP raise KeyboardInterrupt, unless a caller has
    set them."""

    def __init__(self) -> None:
        self.ended_by = signal.SIGINT
        self._hook = sys.unraisablehook
        ours: dict[signal.Signals, tuple[Any, Any]] = {
            signal.SIGINT: (signal.default_int_handler, self._interrupt),
            signal.SIGTERM: (signal.SIG_DFL, self._interrupt),
            signal.SIGHUP: (signal.SIG_DFL, self._interrupt),
            signal.SIGALRM: (signal.SIG_DFL, self._again),
        }
        if threading.current_thread() is not threading.main_thread():
            ours = {}
        self._handled = {
            each: pair for each, pair in ours.items() if signal.getsignal(each) is pair[0]
        }

    def __enter__(self) -> Self:
        sys.unraisablehook = self._ignored
        for each, (_, handler) in self._handled.items():
            signal.signal(each, handler)
        return self

    def __exit__(self, *raised: object) -> None:
        sys.unraisablehook = self._hook
        if signal.SIGALRM in self._handled:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        for each, (before, _) in self._handled.items():
            signal.signal(each, before)
        note_interruption(came=False)

    def answer_no_more(self) -> None:
        """For the last words, when all is cleared up."""
        for each in self._handled:
            signal.signal(each, signal.SIG_IGN)

    def _interrupt(self, number: int, frame: Any) -> None:
        # what is said from now on goes nowhere: to the closed terminal it were an error
        if number == signal.SIGHUP:
            nowhere = os.open(os.devnull, os.O_RDWR)
            for stream in (1, 2):
                if stat.S_ISCHR(os.fstat(stream).st_mode):
                    os.dup2(nowhere, stream)
        if number == signal.SIGINT or not interrupted_lately():  # no other disturbs the clearing up
            self.ended_by = signal.Signals(number)
            note_interruption()
            raise KeyboardInterrupt

    def _ignored(self, what: sys.UnraisableHookArgs) -> None:
        # a callback of compiled code raises nothing further: once more, when it is over
        if what.exc_type is KeyboardInterrupt and signal.SIGALRM in self._handled:
            signal.setitimer(signal.ITIMER_REAL, RAISED_AGAIN_S)
        else:
            self._hook(what)

    def _again(self, number: int, frame: Any) -> None:
        if signal.getsignal(self.ended_by) == self._interrupt:
            note_interruption(came=False)
            self._interrupt(self.ended_by, frame)
        else:  # results are being put in their place: after that
            signal.setitimer(signal.ITIMER_REAL, RAISED_AGAIN_S)
