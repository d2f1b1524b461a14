"""Who waits while kernels are compiled is told so.

numba tells of it by names that it does not publish; where they are gone, nothing is said.
"""

from __future__ import annotations

import threading
import time
from typing import Any, cast

from phasekit.numerics import waits

#: Seconds between two functions that are compiled for one and the same wait.
PAUSE = 0.5


class _Compiling:
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
            if self.depth == 1 and not self.told and _is_ours(started) and waits.watched():
                now = time.monotonic()
                if now - self.ended > PAUSE:
                    self.began = now
                self.timer = waits.later(max(0.0, self.began + waits.PATIENCE - now), self.tell)

    def on_end(self, ended: Any) -> None:
        with self.lock:
            self.depth -= 1
            if self.depth == 0 and self.timer is not None:
                self.timer.cancel()
                self.timer = None
                self.ended = time.monotonic()

    def tell(self) -> None:
        self.told = True
        waits.tell("compiling once for this machine, which takes up to half a minute")


def _is_ours(started: Any) -> bool:
    function = getattr(started.data.get("dispatcher"), "py_func", None)
    return str(getattr(function, "__module__", "")).startswith("phasekit.")


def _listening() -> _Compiling:
    """Have numba tell of what it compiles, if it does."""
    try:
        from numba.core.event import Listener, register

        listener: Any = type("_Listening", (_Compiling, Listener), {})()
        register("numba:compile", listener)  # type: ignore[no-untyped-call]
    except Exception:  # whatever numba makes of names that are not what they were
        return _Compiling()
    return cast(_Compiling, listener)


_COMPILING = _listening()
