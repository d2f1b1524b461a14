"""Which functions compiled code may call, and what stands for them there."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple


class Mark(NamedTuple):
    """How a function is compiled where compiled code calls it."""

    body: Callable[..., Any]
    """What is compiled: the function itself, or another one that gives the same bits."""
    inlined: bool
    """Whether it becomes part of each caller, so that a loop over it vectorises."""


_MARKS: dict[Any, Mark] = {}


def lanes(count: int) -> range:
    """As `range`, of a loop that the processor is to run through at once, few numbers side by side.

    It pays where the arrays that it gives values were made in the same function, or in one that
    this is inlined in, and are others than those it reads at other places.
    """
    return range(count)


def mark(function: Callable[..., Any], body: Callable[..., Any], *, inlined: bool) -> None:
    """Let compiled code call a function."""
    _MARKS[function] = Mark(body, inlined)


def mark_of(function: Any) -> Mark | None:
    """How a function is compiled; None of others."""
    try:
        found = _MARKS.get(function)
    except TypeError:  # not hashable
        return None
    if found is None and hasattr(function, "py_func"):  # a kernel, called by another
        return Mark(function.py_func, inlined=False)
    return found
