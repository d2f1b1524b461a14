"""What results do that stands above them: to go on elsewhere, and to be kept.

A branch knows what was traced, a special point its branch; neither knows what leads on from
there. The package says which function that is (its `__init__`), by name, so that it is loaded
when it is asked for.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any, Protocol, TypeVar

_WAYS: dict[str, str] = {}


class Origin(Protocol):
    """What a special point knows of the branch that it is a point of."""

    @property
    def free(self) -> tuple[str, ...]:
        """The free parameters."""

    @property
    def parameter(self) -> str:
        """The first of them."""

    @property
    def problem_state(self) -> tuple[str, ...]:
        """The states."""

    @property
    def special_points(self) -> tuple[Any, ...]:
        """The points in order."""

    @property
    def curve(self) -> Any:
        """The equations of what was followed."""

    @property
    def problem(self) -> Any:
        """Their problem."""

    @property
    def walker(self) -> Any:
        """How they were followed."""

    @property
    def way(self) -> str:
        """What leads on from its points."""


#: The branch of a special point.
Of = TypeVar("Of", bound=Origin)


def lead(ways: Mapping[str, str]) -> None:
    """Say which function each way is, as ``"module:name"``."""
    _WAYS.update(ways)


def onward(way: str) -> Callable[..., Any]:
    """The function that a way is."""
    module, _, name = _WAYS[way].partition(":")
    function: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return function
