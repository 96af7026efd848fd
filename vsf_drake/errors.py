"""The errors that a user can meet, with the exit code that the command line gives each."""

from __future__ import annotations

import math
import re
import threading
import time
from pathlib import Path

UNPRINTABLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff]")
"""What is no text: control characters but tab and line feed, turns of the writing direction, halves of characters."""


def visible(text: str) -> str:
    """`text` with its unprintable characters as escapes (`\\x1b`)."""
    return UNPRINTABLE.sub(lambda found: found[0].encode("unicode_escape").decode("ascii"), text)


class VsfError(Exception):
    """Base of every error this package raises on purpose."""

    exit_code = 1


class InputError(VsfError):
    """Something the user gave cannot be used: a file, a key, a value, a recording.

    The message names the file, the place in it (key, column, line or time), what is
    wrong there and, where it is known, what would be right.
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
        self.what, self.file, self.where, self.right = what, file, where, right
        place = ": ".join(str(part) for part in (file, where) if part is not None)
        message = f"{place}: {what}" if place else what
        super().__init__(visible(f"{message}. {right}" if right else message))


class SimulationError(VsfError):
    """A simulation that could not be carried to its end.

    Args:
        what: what happened, in which part of the model.
        time_s: simulated time at which it happened.
    """

    exit_code = 3

    def __init__(self, what: str, *, time_s: float) -> None:
        self.what, self.time_s = what, time_s
        super().__init__(f"the simulation failed at t = {time_s:.4f} s: {what}")


class FitError(VsfError):
    """A fit that did not come to an end that can be used, and whose result was asked for as if it had."""

    exit_code = 4


CLEARING_S = 10.0
"""How long after a signal the program may take to clear up."""
_asked_s = -math.inf


def note_interruption(*, came: bool = True) -> None:
    """Keeps that a signal asked the program to end, or forgets it."""
    global _asked_s  # noqa: PLW0603 (signals are the process's)
    _asked_s = time.monotonic() if came else -math.inf


def interrupted_lately() -> bool:
    """Whether a signal asked the program to end in the last `CLEARING_S` seconds."""
    return time.monotonic() - _asked_s < CLEARING_S


def raise_if_interrupted() -> None:
    """For who goes on after any error: compiled code of others makes errors of its own of an interruption.

    Raises:
        KeyboardInterrupt: a signal has just asked the program to end.
    """
    if interrupted_lately() and threading.current_thread() is threading.main_thread():
        raise KeyboardInterrupt
