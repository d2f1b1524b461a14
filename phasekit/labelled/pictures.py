"""The one stair up: results of this floor that draw themselves.

Pictures stand above and load matplotlib, so that they are looked up when one is asked for.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any


def picture(name: str) -> Callable[..., Any]:
    """Return a function of `phasekit.plot`."""
    function: Callable[..., Any] = getattr(importlib.import_module("phasekit.plot"), name)
    return function
