"""Older spellings of arguments, which go on working: one table of them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from phasekit.errors import ParameterError

#: Names of arguments that functions had before, and those that they have now.
DEPRECATED: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "capture": {"perturbed": "system"},
        "damped_portrait": {"perturbed": "system"},
        "derivatives": {"time": "t"},
        "escape_rate": {"perturbed": "system"},
        "first_passage": {"longest": "duration"},
        "iterated": {"times": "n"},
        "lyapunov": {"perturbed": "system", "time": "duration"},
        "melnikov": {"perturbed": "system"},
        "nullclines": {"what": "system"},
        "quiet_frequencies": {"perturbed": "system"},
        "resonances": {"perturbed": "system"},
        "retrapping_torque": {"perturbed": "system"},
        "stroboscopic": {"perturbed": "system"},
    }
)


def respelled(function: str, keywords: dict[str, Any], level: int = 3) -> dict[str, Any]:
    """Keywords of a call as they are spelled now, with a warning for each old one.

    Raises
    ------
    ParameterError
        If an argument is given in both spellings.

    Examples
    --------
    >>> import warnings
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore")
    ...     respelled("lyapunov", {"time": 10.0})
    {'duration': 10.0}
    """
    former = DEPRECATED.get(function, {})
    if former.keys().isdisjoint(keywords):
        return keywords
    now = {name: value for name, value in keywords.items() if name not in former}
    for name in former.keys() & keywords.keys():
        if former[name] in now:
            raise ParameterError(f"{name}: got it besides {former[name]}, wants {former[name]}")
        deprecate(f"{function}({name}=...)", f"{function}({former[name]}=...)", level + 1)
        now[former[name]] = keywords[name]
    return now


def deprecate(former: str, now: str, level: int = 3) -> None:
    """Warn that what is written so is written otherwise now."""
    warnings.warn(f"{former} is now {now}", DeprecationWarning, stacklevel=level)
