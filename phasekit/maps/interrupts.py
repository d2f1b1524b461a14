"""Ctrl-C at moments of one's own choice."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any


class Noted:
    """What has come since the caller said that it would look."""

    def __init__(self, handler: Callable[[int, FrameType | None], Any]) -> None:
        self._handler, self._seen = handler, False

    def note(self, *_: object) -> None:
        """Take note of a signal."""
        self._seen = True

    def act(self) -> None:
        """Do what the handler does, which is to raise a `KeyboardInterrupt`, if one has come."""
        if self._seen:
            self._seen = False
            self._handler(signal.SIGINT, None)


@contextlib.contextmanager
def deferred_interrupts() -> Iterator[Noted]:
    """Only take note of Ctrl-C, where it would raise: between any two steps of what is to be ended.

    In other threads than the main one none can come.
    """
    handler = signal.getsignal(signal.SIGINT)
    if not callable(handler) or threading.current_thread() is not threading.main_thread():
        yield Noted(lambda *_: None)
        return
    found = Noted(handler)
    signal.signal(signal.SIGINT, found.note)
    try:
        yield found
    finally:
        signal.signal(signal.SIGINT, handler)
    found.act()


@contextlib.contextmanager
def unheard() -> Iterator[None]:
    """Start processes that never hear Ctrl-C, which reaches all those of a terminal."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # begun later, it would end what this is for
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
