"""The errors that a user can meet, with the exit code that the command line gives each."""

from __future__ import annotations

import math
import re
import threading
import time
from pathlib import Path

UNPRINTABLE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]"
)
"""What is no text: control characters but tab and line feed, turns of the writing direction, halves
of characters."""


class VsfError(Exception):
    """Base of every error this package raises on purpose."""

    exit_code = 1


class InputError(VsfError):
    """Something the user gave cannot be used: a file, a key, a value, a recording.

    The message names the file, the place in it (key, column, line or time), what is wrong there
    and, where it is known, what would be right; what is unprintable in it stands as escapes
    (`\\x1b`).
    """

    exit_code = 2

    def __init__(
        self,
        what: str,
        *,
        file: str | Path | None = None,
        where: str | None = None,
        right: str | None = None,
    ) -> None:
        self.what = what
        self.file = file
        self.where = where
        self.right = right
        message = ": ".join(str(part) for part in (file, where, what) if part is not None)
        if right:
            message = f"{message}{'' if message.endswith(('.', '?')) else '.'} {right}"
        super().__init__(
            UNPRINTABLE.sub(
                lambda match: match[0].encode("unicode_escape").decode("ascii"), message
            )
        )


def require(
    holds: object,
    what: str,
    where: str | None = None,
    right: str | None = None,
    *,
    file: str | Path | None = None,
) -> None:
    """Raises InputError unless `holds`."""
    if not holds:
        raise InputError(what, file=file, where=where, right=right)


class SimulationError(VsfError):
    """A simulation that could not be carried to its end: what happened, in which part of the model,
    and when."""

    exit_code = 3

    def __init__(self, what: str, *, time_s: float) -> None:
        self.what = what
        self.time_s = time_s
        super().__init__(f"the simulation failed at t = {time_s:.4f} s: {what}")


class FitError(VsfError):
    """A fit that did not come to an end that can be used, and whose result was asked for as if it
    had."""

    exit_code = 4


CLEARING_S = 10.0  # how long after a signal the program may take to clear up
_asked_s = -math.inf


def note_interruption(*, came: bool = True) -> None:
    """Keeps that a signal asked the program to end, or forgets it."""
    global _asked_s  # noqa: PLW0603 (signals are the process's)
    _asked_s = time.monotonic() if came else -math.inf


def interrupted_lately() -> bool:
    """Whether a signal asked the program to end in the last `CLEARING_S` seconds."""
    return time.monotonic() - _asked_s < CLEARING_S


def raise_if_interrupted() -> None:
    """KeyboardInterrupt for who goes on after any error: compiled code makes errors of its own of
    an interruption."""
    if interrupted_lately() and threading.current_thread() is threading.main_thread():
        raise KeyboardInterrupt
