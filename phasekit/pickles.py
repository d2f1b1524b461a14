"""Pickles, which carry the version that made them."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Iterator, Mapping
from types import FunctionType
from typing import Any

from phasekit.errors import ParameterError, StoreError
from phasekit.version import __version__

#: Picklers that keep functions by their code.
BY_CODE = ("cloudpickle", "dill")


class Stamped:
    """What carries, in its pickles, the version that made them."""

    __slots__ = ()

    def __reduce_ex__(self, protocol: Any) -> str | tuple[Any, ...]:
        """Pickles carry the version that made them."""
        return stamped(super().__reduce_ex__(protocol), type(self).__name__)


class _Stamp:
    """The version in a pickle. It is read before the names of anything else are looked for."""

    def __init__(self, owner: str = "", function: str = "") -> None:
        self.owner, self.function = owner, function

    def __deepcopy__(self, memo: Any) -> _Stamp:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        if self.function and not _keeps_code():
            raise ParameterError(
                f"pickle: got a {self.owner} of the function {self.function}, which no module "
                "has by a name, wants one that is defined by def in a module"
            )
        return _stamp_of, (__version__,)


def _keeps_code() -> bool:
    """Whether a pickler is at work that keeps functions without a name as well."""
    frame: Any = sys._getframe(1)
    while frame is not None:
        if any(part in BY_CODE for part in str(frame.f_globals.get("__name__", "")).split(".")):
            return True
        frame = frame.f_back
    return False


def _functions_in(value: Any, depth: int = 4) -> Iterator[FunctionType]:
    """Functions among arguments."""
    if isinstance(value, FunctionType):
        yield value
    elif isinstance(value, functools.partial):
        yield from _functions_in((value.func, value.args, value.keywords), depth)
    elif depth and isinstance(value, (tuple, list, dict, Mapping)):
        for one in value.values() if isinstance(value, Mapping) else value:
            yield from _functions_in(one, depth - 1)


def _stamp_of(version: str) -> _Stamp:
    """Refuse what another version pickled: a store is read by later ones, a pickle is not."""
    if version != __version__:
        raise StoreError(
            f"pickle: got one of phasekit {version}, wants one of {__version__}; pickles are read "
            "by the version that made them, maps and saved branches by later ones too"
        )
    return _Stamp()


def stamped(reduced: str | tuple[Any, ...], owner: str) -> str | tuple[Any, ...]:
    """Return what `object.__reduce_ex__` returns of a value, with the version in front."""
    if isinstance(reduced, str):  # the name of what is kept in its module
        return reduced
    make, arguments, *state = reduced
    names = [one.__qualname__ for one in _functions_in((make, arguments, *state[:1]))]
    nameless = next((name for name in names if "<" in name), "")
    return _make, (_Stamp(owner, nameless), make, arguments), *state


def _make(_: _Stamp, make: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    return make(*arguments)
