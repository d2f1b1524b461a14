"""What is said to somebody who waits: nothing for two seconds, then why."""

from __future__ import annotations

import multiprocessing
import sys
import threading
from typing import Any

from numba.core import event

#: Seconds that nobody is told about.
PATIENCE = 2.0


def in_notebook() -> bool:
    """Whether this process is the kernel of a notebook."""
    shell = sys.modules.get("IPython")
    running = shell.get_ipython() if shell is not None else None
    return running is not None and "IPKernelApp" in running.config


def watched() -> bool:
    """Whether somebody looks: standard error is a terminal, or this is a notebook."""
    terminal = sys.stderr is not None and sys.stderr.isatty()
    return (terminal or in_notebook()) and multiprocessing.parent_process() is None


class _Compiling(event.Listener):
    """Says that kernels are compiled, if that takes long."""

    def __init__(self) -> None:
        self.depth = 0  # compiling one function compiles those that it calls
        self.timer: threading.Timer | None = None
        self.told = False  # once a process is enough
        self.lock = threading.Lock()

    def on_start(self, started: Any) -> None:
        with self.lock:
            self.depth += 1
            if self.depth == 1 and not self.told and _is_ours(started) and watched():
                self.timer = threading.Timer(PATIENCE, self.tell)
                self.timer.daemon = True
                self.timer.start()

    def on_end(self, ended: Any) -> None:
        with self.lock:
            self.depth -= 1
            if self.depth == 0 and self.timer is not None:
                self.timer.cancel()
                self.timer = None

    def tell(self) -> None:
        self.told = True
        print(
            "phasekit: compiling once for this machine, which takes some seconds",
            file=sys.stderr,
            flush=True,
        )


def _is_ours(started: Any) -> bool:
    function = getattr(started.data.get("dispatcher"), "py_func", None)
    return str(getattr(function, "__module__", "")).startswith("phasekit.")


_COMPILING = _Compiling()
event.register("numba:compile", _COMPILING)  # type: ignore[no-untyped-call]
