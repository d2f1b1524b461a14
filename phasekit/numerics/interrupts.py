"""Ctrl-C at moments of one's own choice."""

from __future__ import annotations

import contextlib
import functools
import signal
import threading
from collections.abc import Callable, Iterator
from types import FrameType, TracebackType
from typing import Any, ParamSpec, TypeVar

from phasekit.errors import warn

P = ParamSpec("P")
R = TypeVar("R")
Handler = Callable[[int, FrameType | None], Any]


class Noted:
    """What has come since the caller said that it would look."""

    def __init__(self, handler: Handler) -> None:
        self._handler, self._seen = handler, False

    def note(self, *_: object) -> None:
        """Take note of a signal."""
        self._seen = True

    def act(self) -> None:
        """Do what the handler does, which is to raise a `KeyboardInterrupt`, if one has come."""
        if self._seen:
            self._seen = False
            self._handler(signal.SIGINT, None)


def _handler_here() -> Handler | None:
    """What hears Ctrl-C in this thread; in others than the main one it never comes."""
    handler = signal.getsignal(signal.SIGINT)
    main = threading.current_thread() is threading.main_thread()
    return handler if callable(handler) and main else None


@contextlib.contextmanager
def deferred_interrupts() -> Iterator[Noted]:
    """Only take note of Ctrl-C, where it would raise: between any two steps of what is to be ended.

    In other threads than the main one none can come.
    """
    handler = _handler_here()
    if handler is None:
        yield Noted(lambda *_: None)
        return
    found = Noted(handler)
    signal.signal(signal.SIGINT, found.note)
    try:
        yield found
    finally:
        signal.signal(signal.SIGINT, handler)
    found.act()


# ------------------------------------------------------------------- calls that keep what is done


class _Call:
    """A call under way; what it has done so far would be lost wherever Ctrl-C raises.

    Until `hold` nothing is done. Then it raises within `may_end` alone, where somebody takes what
    is done. Asked a second time it raises at once.
    """

    def __init__(self, handler: Handler) -> None:
        self.handler = handler
        self.open = True
        self.over = False  # it only tidies up, where nothing may raise
        self.waits = False  # one has come and has not raised
        self.raised = False  # one has, here or in a call that this one made

    def act(self) -> None:
        """Raise what waits, and what an inner call has taken or another package has swallowed."""
        try:
            if self.waits:
                self.raise_it()
            if self.raised:
                raise KeyboardInterrupt
        finally:
            self.raised = False

    def raise_it(self, number: int = signal.SIGINT, frame: FrameType | None = None) -> None:
        """Ask the handler, which raises as a rule; the outer calls hear of it."""
        was, self.open, self.waits = self.open, False, False
        try:
            self.handler(number, frame)
        except BaseException:
            for call in _under_way():
                call.raised = True
            raise
        self.open = was


class _Thread(threading.local):
    """The calls under way in a thread, the innermost last."""

    def __init__(self) -> None:
        self.calls: list[_Call] = []


_thread = _Thread()


def _under_way() -> list[_Call]:
    return _thread.calls


def _hear(number: int, frame: FrameType | None) -> None:
    call = _under_way()[-1]
    if not call.over and (call.open or call.waits):
        call.raise_it(number, frame)
    else:
        call.waits = True


def keeps(function: Callable[P, R]) -> Callable[P, R]:
    """Let a function return what it has done where Ctrl-C comes."""

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        outer = _under_way()
        handler = outer[0].handler if outer else _handler_here()
        if handler is None:
            return function(*args, **kwargs)
        own, place = _Call(handler), len(outer)
        # Ctrl-C may come behind each call in here: what is set is taken back all the same.
        try:
            outer.append(own)
            if place == 0:
                signal.signal(signal.SIGINT, _hear)
            return function(*args, **kwargs)
        finally:
            own.over = True
            try:
                if place == 0:
                    signal.signal(signal.SIGINT, handler)
            finally:
                del outer[place:]
            if outer:
                outer[-1].waits |= own.waits
            elif own.waits:
                warn("Ctrl-C came when all was done", RuntimeWarning)

    return call


def hold() -> None:
    """From here on there is something to keep."""
    for call in _under_way()[-1:]:
        call.open = False


def act() -> None:
    """Raise Ctrl-C if one has come."""
    for call in _under_way()[-1:]:
        call.act()


class may_end:  # noqa: N801
    """Ctrl-C raises in here, at any moment, and somebody outside takes it."""

    def __enter__(self) -> None:
        """Raise at once if one has come."""
        self.calls = _under_way()[-1:]
        for call in self.calls:
            call.act()
            self.was, call.open = call.open, True

    def __exit__(
        self, kind: type[BaseException] | None, *_: BaseException | TracebackType | None
    ) -> None:
        """Raise what was swallowed; where that made an error, whoever asks next hears of it."""
        for call in self.calls:
            call.open = self.was
            if kind is None:
                call.act()
            elif not issubclass(kind, Exception):
                call.raised = False


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
