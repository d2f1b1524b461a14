"""What is said to somebody who waits: nothing for two seconds, then why, and how far it is."""

from __future__ import annotations

import contextlib
import multiprocessing
import sys
import threading
from collections.abc import Iterator
from typing import Any

#: Seconds that nobody is told about.
PATIENCE = 2.0
#: Seconds between two lines on one wait.
AGAIN = 10.0


def in_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    shell = sys.modules.get("IPython")
    running = shell.get_ipython() if shell is not None else None
    return running is not None and "IPKernelApp" in running.config


def watched() -> bool:
    """Whether somebody looks: standard error is a terminal, or this is a notebook."""
    try:
        terminal = sys.stderr.isatty()
    except (AttributeError, ValueError):  # there is none, it cannot tell, or it is closed
        terminal = False
    return (terminal or in_notebook()) and multiprocessing.parent_process() is None


def tell(text: str) -> None:
    """Say it to who waits: as plain text in a notebook, where standard error looks like a fault."""
    print(f"phasekit: {text}", file=sys.stdout if in_notebook() else sys.stderr, flush=True)


def later(seconds: float, action: Any, *arguments: Any) -> threading.Timer:
    """Call something after a while, unless that is cancelled."""
    timer = threading.Timer(seconds, action, arguments)
    timer.daemon = True
    timer.start()
    return timer


_saying = False
_stage = ""  # how far it is


def stage(text: str) -> None:
    """Note how far it is; it is said with what is going on, if that takes long."""
    global _stage
    _stage = text


class _Wait:
    """Says what is going on, and again whenever it is further some seconds later."""

    def __init__(self, what: str) -> None:
        self.what, self.last, self.over = what, "", False
        self.timer = later(PATIENCE, self.tell)

    def tell(self) -> None:
        text = f"{self.what}: {_stage}" if _stage else self.what
        if text != self.last:
            tell(text)
        self.last = text
        if not self.over:
            self.timer = later(AGAIN, self.tell)

    def cancel(self) -> None:
        self.over = True
        self.timer.cancel()


@contextlib.contextmanager
def notice(what: str, *, logged: bool = False) -> Iterator[None]:
    """Say what is going on, if it takes long; where several are nested, the outermost speaks.

    A line follows every ten seconds while `stage` tells of something new. With `logged` it is said
    where nobody looks, too, but not in the processes of a pool.
    """
    global _saying
    if _saying or not (watched() or (logged and multiprocessing.parent_process() is None)):
        yield
        return
    stage("")
    timer = _Wait(what)
    _saying = True
    try:
        yield
    finally:
        _saying = False
        timer.cancel()
