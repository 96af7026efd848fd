"""How far a sweep is: for a callback, a bar on a terminal, or now and then a line in a file."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

LINE_EVERY_S = 30.0


@dataclass(frozen=True)
class SweepProgress:
    """A sweep at one moment.

    Attributes:
        total, done, failed, from_cache, simulated: members; the last three are among those done.
        elapsed_s: since the first simulation was asked for.
    """

    total: int
    done: int
    failed: int
    from_cache: int
    simulated: int
    elapsed_s: float

    @property
    def rate_per_s(self) -> float | None:
        """Members simulated in a second; None before the first."""
        return self.simulated / self.elapsed_s if self.simulated and self.elapsed_s > 0.0 else None

    @property
    def left_s(self) -> float | None:
        """Time left at this rate; None before there is one."""
        if self.done == self.total:
            return 0.0
        rate = self.rate_per_s
        return None if rate is None else (self.total - self.done) / rate

    def __str__(self) -> str:
        rate = "" if self.rate_per_s is None else f", {self.rate_per_s:.1f} walks/s"
        left = "" if not self.left_s else f", {_clock(self.left_s)} left"
        failed = f", {self.failed} failed" if self.failed else ""
        cached = f" ({self.from_cache} from the cache)" if self.from_cache else ""
        return f"{self.done} of {self.total} walks{cached}{failed}{rate}{left}"


Report = Callable[[SweepProgress], None]


@contextmanager
def reporting(progress: bool | Report | None) -> Iterator[Report]:
    """What to call with the state of a sweep: nothing, the caller's function, or for True a display on stderr."""
    if callable(progress):
        yield progress
    elif not progress:
        yield lambda _: None
    elif sys.stderr.isatty():
        with _bar() as show:
            yield show
    else:
        yield Lines(lambda line: print(line, file=sys.stderr, flush=True))


class Lines:
    """A line at the start, at the end, and every LINE_EVERY_S in between."""

    def __init__(self, write: Callable[[str], None], clock: Callable[[], float] = time.monotonic) -> None:
        self._write, self._clock = write, clock
        self._last: float | None = None

    def __call__(self, state: SweepProgress) -> None:
        now = self._clock()
        if self._last is None or state.done == state.total or now - self._last >= LINE_EVERY_S:
            self._last = now
            self._write(str(state))


@contextmanager
def _bar() -> Iterator[Report]:
    from rich.console import Console  # noqa: PLC0415 (workers import this module, and show nothing)
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn  # noqa: PLC0415

    columns = (TextColumn("walks"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[rate]}"),
               TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("walks", total=None, rate="")

        def show(state: SweepProgress) -> None:
            words = str(state).partition(" walks")[2].strip(" ,")
            bar.update(task, total=state.total, completed=state.done, rate=words)

        yield show


def _clock(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{seconds:02d}" if hours else f"{minutes}:{seconds:02d}"
