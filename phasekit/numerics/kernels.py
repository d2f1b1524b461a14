"""Kernels: functions that are interpreted or compiled, with the same bits.

A kernel is compiled for each kind of arguments that it is given. Where no finished machine code is
kept on disk, a quick form is made first, in milliseconds and without any effort, which runs a few
times slower than the finished one. That follows when the quick form has run for as long as it takes
to make, in this process and others before it, or when another process has made it.
"""

from __future__ import annotations

import atexit
import functools
import threading
import time
import weakref
from collections.abc import Callable
from typing import Any

_LOCK = threading.RLock()
#: All kernels whose modules are loaded.
KERNELS: weakref.WeakSet[Kernel] = weakref.WeakSet()
#: Seconds that a quick form runs before it is asked whether a finished one is there.
SOON = 0.1
#: Seconds below which no finished form is made: a machine that is busy takes them by chance.
LEAST = 0.03
#: Part of what a finished form costs below which it is not kept how long the quick one ran.
PART = 0.01
#: Quick forms of this process, by the files in which they are kept.
QUICK_FORMS: dict[str, QuickForm] = {}


class Kernel:
    """A function of numbers and arrays, compiled for each kind of these when they are first given.

    `py_func` is the function as it was written, which the interpreter runs.
    """

    def __init__(self, function: Callable[..., Any], effort: int) -> None:
        functools.update_wrapper(self, function)
        self.py_func = function
        self.effort = effort
        code = function.__code__
        self.names = code.co_varnames[: code.co_argcount]
        self.forms: dict[Any, Callable[..., Any]] = {}
        #: The form that was called last.
        self.last: Callable[..., Any] | None = None
        annotations = function.__annotations__
        self._annotations = [str(annotations.get(name, "")) for name in self.names]
        KERNELS.add(self)

    def __call__(self, *args: Any) -> Any:
        """Run it, compiled."""
        if self.last is not None:
            result = self.last(*args)
            if result is not NotImplemented:
                return result
        values, form = self.form(args)
        self.last = form
        result = form(*values)
        if result is NotImplemented:
            raise TypeError(f"{self!r}: got arguments that are not what they were compiled for")
        return result

    def __reduce__(self) -> str:
        """Pickle it by its name, as functions are."""
        return self.py_func.__qualname__

    def __repr__(self) -> str:
        """Its full name."""
        return f"<kernel {self.py_func.__module__}.{self.py_func.__qualname__}>"

    def form(self, args: tuple[Any, ...]) -> tuple[list[Any], Callable[..., Any]]:
        """Arguments as compiled code takes them, and the form for their kinds."""
        from phasekit.numerics.values import normal

        if len(args) != len(self.names):
            name = self.py_func.__qualname__
            raise TypeError(f"{name}() takes {len(self.names)} arguments, got {len(args)}")
        pairs = [normal(x, wanted) for x, wanted in zip(args, self._annotations, strict=True)]
        kinds = tuple(kind for _, kind in pairs)
        with _LOCK:
            if kinds not in self.forms:
                self.forms[kinds] = self._compiled(kinds)
        return [value for value, _ in pairs], self.forms[kinds]

    def _compiled(self, kinds: tuple[Any, ...]) -> Callable[..., Any]:
        from phasekit.numerics.forms import python_function

        finished = python_function(self.py_func, kinds, self.effort, make=False)
        return finished or QuickForm(self, kinds)

    def finish(self, kinds: tuple[Any, ...], *, make: bool) -> bool:
        """Whether the finished form for kinds of arguments has taken the place of the quick one."""
        from phasekit.numerics.forms import python_function

        finished = python_function(self.py_func, kinds, self.effort, make=make)
        if finished is None:
            return False
        with _LOCK:
            if self.last is self.forms.get(kinds):
                self.last = finished
            self.forms[kinds] = finished
        return True


class QuickForm:
    """A form that was compiled without effort, until it has paid to make a better one."""

    def __init__(self, kernel: Kernel, kinds: tuple[Any, ...]) -> None:
        from phasekit.numerics.forms import QUICK, file_of, python_function, seconds_to_finish

        self.kernel, self.kinds = kernel, kinds
        run = python_function(kernel.py_func, kinds, QUICK, make=True)
        assert run is not None
        self.run = run
        #: Seconds that it takes to make the finished form, as near as is known.
        self.cost = max(LEAST, kernel.effort * seconds_to_finish(kernel.py_func, kinds))
        #: Seconds that it ran, at first in processes that have ended.
        file = file_of(kernel.py_func, kinds)
        self.spent = self.before = _seconds_before().get(file, 0.0)
        QUICK_FORMS[file] = self
        self._asked = 0.0
        self._asking = threading.Lock()

    def __call__(self, *args: Any) -> Any:
        """Run it, and see now and then whether there is a better one."""
        began = time.perf_counter()
        result = self.run(*args)
        self.spent += time.perf_counter() - began
        if self.spent > self._asked + min(SOON, self.cost):
            self.consider(0.0)
        return result

    def consider(self, ahead: float) -> None:
        """Take the finished form, if it is there or pays, with so many seconds of work ahead."""
        if self._asking.acquire(blocking=False):
            try:
                self._asked = self.spent
                self.kernel.finish(self.kinds, make=max(self.spent, ahead) > self.cost)
            finally:
                self._asking.release()


@functools.cache
def _seconds_before() -> dict[str, float]:
    """How long quick forms ran before this process."""
    from phasekit.numerics.kept import seconds_of

    atexit.register(remember)
    return seconds_of()


def remember() -> None:
    """Keep how long quick forms ran, for later processes to know which finished ones pay."""
    from phasekit.numerics.kept import add_seconds

    more = {}
    for file, form in QUICK_FORMS.items():
        if form.spent - form.before > PART * form.cost:
            more[file], form.before = form.spent - form.before, form.spent
    if more:
        add_seconds(more)
