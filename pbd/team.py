"""Threads that do a batch's passes together with the kernel, with results that do not depend on how many there are.

A pass - a sum over neighbours for each particle, say - is cut into pieces that do not depend on one another. The
kernel's thread starts a pass by writing a new *ticket*; then it and its helpers, which run `serve` in Python threads of
their own, take pieces until none is left, the kernel's thread from the front and helpers from the back, so that most of
what a thread needs is still in its own cache from the pass before. The kernel goes on when all pieces are finished; it
waits for pieces, never for threads: a helper that the operating system has put aside costs what it has taken, and one
that comes late costs nothing.

Limit: helpers without work look for some a few thousand times and then let others run, over and over, until the run
ends. With more threads than processors a run is slower, not wrong.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from pbd.dispatch import stage
from pbd.errors import InvalidInput
from pbd.intrinsics import add_shared, give_way, read_shared, replace_shared, write_shared
from pbd.jit import config, kernel
from pbd.routine import routine

PIECES_PER_THREAD = 8
"""In a pass. All wait for the last piece, which is long where pieces are few; and to begin one costs 0.2 us."""

LOOKS = 2048
"""Looks for work, some microseconds in all, before others may run."""

TICKET, FINISHED, TASK, WORDS = 0, 16, 32, 48
"""Places of shared words, each on cache lines of its own."""

NOTHING_LEFT, ENDED = 0, -1
"""Tickets before the first pass, and after the last: `serve` ends."""

PASS, HALF, MASK = 32, 16, 0xFFFF
"""A ticket holds a pass's number from bit PASS on, and in HALF bits each the pieces taken from the front and those not
taken from the back. A thread that was put aside between reading a ticket and taking a piece takes none of another pass.
"""

PASSES = 1 << 30


class Team(NamedTuple):
    """How many ``threads``, and ``pieces`` of a pass; they share ``words`` (WORDS,) and ``step`` (1,) h [s]."""

    words: np.ndarray
    step: np.ndarray
    pieces: int
    threads: int

    def together(self, batch, task, state, h):
        run_pass(self, batch, task, state, h)


def new_team(threads: int, most: int) -> Team:
    """A team of so many threads, with at most that many pieces in a pass."""
    pieces = max(1, min(threads * PIECES_PER_THREAD, most))
    return Team(np.zeros(WORDS, dtype=np.int64), np.zeros(1), pieces, threads)


def with_teams(batches: tuple, threads: int) -> tuple:
    """The batches, those that have with_team(threads) with a team; `InvalidInput` where threads have nothing to do."""
    if threads == 1:
        return batches
    if config.DISABLE_JIT:
        raise InvalidInput("settings.threads", threads, "1 with NUMBA_DISABLE_JIT=1", "plain Python has one at a time")
    if not any(hasattr(batch, "with_team") for batch in batches):
        raise InvalidInput("settings.threads", threads, "1 here", "of all constraints only fluids can use more")
    return tuple(batch.with_team(threads) if hasattr(batch, "with_team") else batch for batch in batches)


@contextmanager
def helpers(batches: tuple, state: Any) -> Iterator[None]:
    """Run the helpers of all batches that have a ``team`` while the caller runs the kernel, and end them after it.

    Such a batch has for_helpers(): itself, once for each helper, with memory of its own where pieces need it.
    """
    led = [batch for batch in batches if getattr(batch, "team", None) is not None]
    calls = [(batch.team, own, state) for batch in led for own in batch.for_helpers()]
    threads = [threading.Thread(target=serve, args=call, daemon=True) for call in calls]
    set_tickets(led, ENDED)
    for call in calls:
        serve(*call)  # which ends at once: what is to be compiled is compiled now, and not beside the run
    set_tickets(led, NOTHING_LEFT)
    try:
        for thread in threads:
            thread.start()
        yield
    finally:
        set_tickets(led, ENDED)
        for thread in threads:
            if thread.ident is not None:  # it has been started
                thread.join()


def set_tickets(batches: list, ticket: int) -> None:
    """Write a ticket for the helpers of each batch."""
    for batch in batches:
        write_shared(batch.team.words, TICKET, ticket)


@stage(required=True)
def work(batch, task, piece, pieces, state, h):
    """Do a piece of the pass that the batch knows as number ``task``."""


@stage
def together(team, batch, task, state, h):
    """Do a whole pass; without a team in one piece."""
    work(batch, task, 0, 1, state, h)


@routine
def run_pass(team, batch, task, state, h):
    words = team.words
    words[TASK], words[FINISHED], team.step[0] = task, 0, h
    number = (read_shared(words, TICKET) >> PASS) + 1
    write_shared(words, TICKET, ((number % PASSES) << PASS) + team.pieces)
    while True:
        ticket = read_shared(words, TICKET)
        front, back = (ticket >> HALF) & MASK, ticket & MASK
        if front == back:
            break
        if replace_shared(words, TICKET, ticket, ticket + (1 << HALF)):
            work(batch, task, front, team.pieces, state, h)
            add_shared(words, FINISHED, 1)
    looks = 0
    while read_shared(words, FINISHED) < team.pieces:
        looks += 1
        if looks % LOOKS == 0:
            give_way()


@kernel
def serve(team, batch, state):
    """Take part in passes until the ticket says that there are no more."""
    words, looks = team.words, 0
    while True:
        ticket = read_shared(words, TICKET)
        if ticket == ENDED:
            return
        front, back = (ticket >> HALF) & MASK, ticket & MASK
        if front < back and replace_shared(words, TICKET, ticket, ticket - 1):
            work(batch, words[TASK], back - 1, team.pieces, state, team.step[0])
            add_shared(words, FINISHED, 1)
            looks = 0
        looks += 1
        if looks % LOOKS == 0:
            give_way()
