"""Progress of long work, with the time left: a bar on a terminal, now and then a plain line elsewhere."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import Any

PLAIN_INTERVAL = 10.0
"""Seconds between plain lines."""


class Progress:
    """Context manager; `advance` counts one piece of work done, `expect` corrects the total."""

    def __init__(self, title: str, total: int, *, quiet: bool = False) -> None:
        self.title, self.total, self.done = title, total, 0
        self._quiet, self._start, self._said = quiet, time.monotonic(), time.monotonic()
        self._bar: Any = None

    def __enter__(self) -> Progress:
        if not self._quiet and sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
            from rich.progress import Progress as Bar

            columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
            self._bar = Bar(*columns, console=Console(stderr=True), transient=True)
            self._bar.start()
            self._task = self._bar.add_task(self.title, total=self.total)
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._bar is not None:
            self._bar.stop()

    def advance(self, count: int = 1) -> None:
        """Count ``count`` pieces of work as done."""
        self.done += count
        if self._bar is not None:
            self._bar.update(self._task, completed=self.done, total=max(self.total, self.done))
        elif not self._quiet and time.monotonic() - self._said > PLAIN_INTERVAL:
            self._said = time.monotonic()
            elapsed = self._said - self._start
            left = elapsed * (self.total - self.done) / max(self.done, 1)
            print(f"{self.title}: {self.done} of {self.total}, about {left:.0f} s left", file=sys.stderr, flush=True)
