"""The command line, one module a command; importing a module adds its command."""

from __future__ import annotations

import math
import os
import signal
import stat
import sys
import time
from typing import Any

from vsf_drake.errors import InputError, VsfError

CLEARING_S = 10.0
"""How long after a SIGTERM another one changes nothing."""


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
        if since_s > CLEARING_S:  # nothing disturbs the clearing up; but something may have swallowed the first one
            ended_by = signal.Signals(number)
            raise KeyboardInterrupt

    before = {each: signal.getsignal(each) for each in (signal.SIGTERM, signal.SIGHUP)
              if signal.getsignal(each) is signal.SIG_DFL}  # not what nohup ignores, or a caller handles
    try:
        for each in before:
            signal.signal(each, interrupt)
        _run()
    except VsfError as error:
        _say_error(error)
        sys.exit(error.exit_code)
    except OSError as error:  # of a file that nobody asked for: a full disk under a cache of compiled code
        wrong = InputError(error.strerror or str(error), file=error.filename)
        _say_error(wrong)
        sys.exit(wrong.exit_code)
    except (SystemExit, KeyboardInterrupt) as ended:
        stopped = isinstance(ended, KeyboardInterrupt) or ended.code == 128 + signal.SIGINT  # Typer's, or before Typer
        said = isinstance(ended.__context__, KeyboardInterrupt)  # by the command itself
        if stopped and not said:
            print("interrupted; nothing of the unfinished part was written", file=sys.stderr)
        if stopped:
            sys.exit(128 + ended_by)
        raise
    finally:
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


def _say_error(error: VsfError) -> None:
    from vsf_drake.cli.app import errors

    errors.print(f"error: {error}", style="red", highlight=False, soft_wrap=True, markup=False)


def _leave_terminal() -> None:
    """What is said from now on goes nowhere instead of to a terminal that is closed, where it would be an error."""
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (1, 2):
        if stat.S_ISCHR(os.fstat(stream).st_mode):
            os.dup2(nowhere, stream)
