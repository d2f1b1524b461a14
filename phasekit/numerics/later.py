"""Modules that are imported when something of theirs is first used.

SymPy, SciPy's integrators and FLINT take longer to import than most first answers take to compute,
and most of those need none of them.
"""

from __future__ import annotations

import gc
import importlib
import sys
from types import ModuleType
from typing import Any


class _Later(ModuleType):
    """Stands for a module until it is used, and hands its names on."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") and name != "__version__":  # asked for by machines
            raise AttributeError(name)
        value = getattr(imported(self.__name__), name)
        self.__dict__[name] = value  # later uses find it without coming here
        return value


def later(name: str) -> Any:
    """Return what stands for a module, whose import waits for the first use."""
    return _Later(name)


def imported(name: str) -> Any:
    """Return a large module, imported without collections of garbage, of which it makes none.

    All that it makes stays, and looking through it takes a fifth of the time of SymPy's import.
    """
    if name in sys.modules or not gc.isenabled():
        return importlib.import_module(name)
    gc.disable()
    try:
        return importlib.import_module(name)
    finally:
        gc.enable()
