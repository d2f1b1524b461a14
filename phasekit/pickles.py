"""Pickles, which carry the version that made them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from phasekit.errors import StoreError
from phasekit.version import __version__


class _Stamp:
    """The version in a pickle. It is read before the names of anything else are looked for."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _stamp_of, (__version__,)


def _stamp_of(version: str) -> _Stamp:
    """Refuse what another version pickled: a store is read by later ones, a pickle is not."""
    if version != __version__:
        raise StoreError(
            f"pickle: got one of phasekit {version}, wants one of {__version__}; pickles are read "
            "by the version that made them, maps and saved branches by later ones too"
        )
    return _Stamp()


def stamped(reduced: str | tuple[Any, ...]) -> str | tuple[Any, ...]:
    """Return what `object.__reduce_ex__` returns of a value, with the version in front."""
    if isinstance(reduced, str):  # the name of what is kept in its module
        return reduced
    make, arguments, *state = reduced
    return _make, (_Stamp(), make, arguments), *state


def _make(_: _Stamp, make: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
    return make(*arguments)
