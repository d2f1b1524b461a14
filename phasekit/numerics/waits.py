"""What is said to somebody who waits: nothing for two seconds, then why."""

from __future__ import annotations

import contextlib
import multiprocessing
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any

from numba.core import event

#: Seconds that nobody is told about.
PATIENCE = 2.0
#: Seconds between two functions that are compiled for one and the same wait.
PAUSE = 0.5


def in_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    shell = sys.modules.get("IPython")
    running = shell.get_ipython() if shell is not None else None
    return running is not None and "IPKernelApp" in running.config


def watched() -> bool:
    """Whether somebody looks: standard error is a terminal, or this is a notebook."""
    return (_in_terminal() or in_notebook()) and multiprocessing.parent_process() is None


def _in_terminal() -> bool:
    try:
        return sys.stderr.isatty()
    except (AttributeError, ValueError):  # there is none, it cannot tell, or it is closed
        return False


def _tell(text: str) -> None:
    print(f"phasekit: {text}", file=sys.stderr, flush=True)


def _later(seconds: float, tell: Any, *arguments: Any) -> threading.Timer:
    timer = threading.Timer(seconds, tell, arguments)
    timer.daemon = True
    timer.start()
    return timer


_saying = False


@contextlib.contextmanager
def said(what: str) -> Iterator[None]:
    """Say what is going on, if it takes long; where several are nested, the outermost speaks.

    Examples
    --------
    >>> with said("counting"):
    ...     sum(range(10))
    45
    """
    global _saying
    if _saying or not watched():
        yield
        return
    timer = _later(PATIENCE, _tell, what)
    _saying = True
    try:
        yield
    finally:
        _saying = False
        timer.cancel()


class _Compiling(event.Listener):
    """Says that kernels are compiled, if that takes long."""

    def __init__(self) -> None:
        self.depth = 0  # compiling one function compiles those that it calls
        self.began = self.ended = -PAUSE  # of functions that follow each other closely
        self.timer: threading.Timer | None = None
        self.told = False  # once a process is enough
        self.lock = threading.Lock()

    def on_start(self, started: Any) -> None:
        with self.lock:
            self.depth += 1
            if self.depth == 1 and not self.told and _is_ours(started) and watched():
                now = time.monotonic()
                if now - self.ended > PAUSE:
                    self.began = now
                self.timer = _later(max(0.0, self.began + PATIENCE - now), self.tell)

    def on_end(self, ended: Any) -> None:
        with self.lock:
            self.depth -= 1
            if self.depth == 0 and self.timer is not None:
                self.timer.cancel()
                self.timer = None
                self.ended = time.monotonic()

    def tell(self) -> None:
        self.told = True
        _tell("compiling once for this machine, which takes some seconds")


def _is_ours(started: Any) -> bool:
    function = getattr(started.data.get("dispatcher"), "py_func", None)
    return str(getattr(function, "__module__", "")).startswith("phasekit.")


_COMPILING = _Compiling()
event.register("numba:compile", _COMPILING)  # type: ignore[no-untyped-call]
