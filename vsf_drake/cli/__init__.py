"""The command line, one module a command; importing a module adds its command."""

from __future__ import annotations

import _thread
import math
import os
import signal
import stat
import sys
import threading
import time
from typing import Any

from vsf_drake.errors import InputError, VsfError

CLEARING_S = 10.0
"""How long after a SIGTERM another one changes nothing, and how long clearing up may take."""
RAISED_AGAIN_S = 0.05
NOTHING_WRITTEN = "interrupted; nothing of the unfinished part was written"


def main() -> None:
    """Runs the command line; a user's mistake ends with one message and exit code 2, a failed simulation with 3.

    SIGTERM and the closing of the terminal end it as Ctrl-C does, with exit codes 143 and 129.
    """
    ended_by, last_s = signal.SIGINT, -math.inf

    def interrupt(number: int, frame: Any) -> None:
        nonlocal ended_by, last_s
        if number == signal.SIGHUP:
            _leave_terminal()
        since_s, last_s = time.monotonic() - last_s, time.monotonic()
        if since_s > CLEARING_S or number == signal.SIGINT:  # no other disturbs the clearing up
            ended_by = signal.Signals(number)
            raise KeyboardInterrupt

    def raise_again() -> None:
        nonlocal last_s
        if signal.getsignal(ended_by) is interrupt:
            last_s = -math.inf
            _thread.interrupt_main(ended_by)

    def ignored(what: sys.UnraisableHookArgs) -> None:
        if what.exc_type is not KeyboardInterrupt:
            sys.__unraisablehook__(what)
            return
        again = threading.Timer(RAISED_AGAIN_S, raise_again)  # a callback of compiled code raises nothing further
        again.daemon = True
        again.start()

    usual = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL, signal.SIGHUP: signal.SIG_DFL}
    before = {each: handler for each, handler in usual.items()  # not what nohup ignores, or a caller handles
              if signal.getsignal(each) is handler}
    hook = sys.unraisablehook
    try:
        sys.unraisablehook = ignored
        for each in before:
            signal.signal(each, interrupt)
        _run()
    except (SystemExit, KeyboardInterrupt) as ended:
        if isinstance(ended, SystemExit) and ended.code != 128 + signal.SIGINT:  # which is Typer's word for it
            raise
        if not isinstance(ended.__context__, KeyboardInterrupt):  # where the command itself has said what there is
            print(NOTHING_WRITTEN, file=sys.stderr)
        sys.exit(128 + ended_by)
    except Exception as error:
        if time.monotonic() - last_s < CLEARING_S:  # others' compiled code makes errors of its own of an interruption
            print(NOTHING_WRITTEN, file=sys.stderr)
            sys.exit(128 + ended_by)
        if isinstance(error, OSError):  # of a file that nobody asked for: a full disk under a cache of compiled code
            error = InputError(error.strerror or str(error), file=error.filename)
        if not isinstance(error, VsfError):
            raise
        from vsf_drake.cli.app import errors

        errors.print(f"error: {error}", style="red", highlight=False, soft_wrap=True, markup=False)
        sys.exit(error.exit_code)
    finally:
        sys.unraisablehook = hook
        for each, handler in before.items():
            signal.signal(each, handler)


def _run() -> None:
    """Loads the commands here, where a signal already finds its answer, and runs the one that is asked for."""
    from vsf_drake.cli import (  # noqa: F401
        bench,
        check,
        export,
        fit,
        import_,
        report,
        schedule,
        show,
        simulate,
        stand,
        sweep,
        tune,
        validate,
    )
    from vsf_drake.cli.app import app

    app()


def _leave_terminal() -> None:
    """What is said from now on goes nowhere instead of to a terminal that is closed, where it would be an error."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (1, 2):
        if stat.S_ISCHR(os.fstat(stream).st_mode):
            os.dup2(nowhere, stream)
