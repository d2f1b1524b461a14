"""Values as people write them: ``30deg``, ``1.153 mm``, ``300rpm``, ``0:90deg:181``."""

from __future__ import annotations

import math
import re
from decimal import Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phasekit.errors import ParameterError
from phasekit.labels.units import UNITS, usual

#: Most values that a range may have.
LONGEST = 10_000_000

_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*")


def number(name: str, text: Any, units: str) -> float:
    """Read one number with an optional unit; without one it is in SI units and radians.

    Parameters
    ----------
    name : str
        Name used in messages.
    text : str, int or float
        What the user wrote.
    units : str
        Unit of the result, as the models declare it.

    Raises
    ------
    ParameterError
        If it is not a number, or the unit does not fit.

    Examples
    --------
    >>> number("e", "1.153mm", "m")
    0.001153
    >>> number("beta", "30mm", "rad")
    Traceback (most recent call last):
    ...
    phasekit.errors.ParameterError: beta: got '30mm', wants a number in rad or deg or °
    """
    known = UNITS.get(units, {})
    wants = f"a number in {' or '.join(known)}" if known else "a number without unit"
    plain = isinstance(text, (int, float)) and not isinstance(text, bool)
    match = _NUMBER.fullmatch(text) if isinstance(text, str) else None
    unit = usual(match[2]) if match else ""
    if not plain and (match is None or (unit and unit not in known)):
        raise ParameterError(f"{name}: got {_short(text)}, wants {wants}")
    try:
        # Decimals have bounds of their own, far beyond those of doubles.
        value = float(text if match is None else Decimal(match[1]) * known.get(unit, Decimal(1)))
    except ArithmeticError:
        value = math.inf
    if not math.isfinite(value):
        raise ParameterError(f"{name}: got {_short(text)}, wants {wants}, and a finite one")
    return value


def _short(value: Any) -> str:
    """Write a value for a message that must stay one readable line."""
    if isinstance(value, int) and value.bit_length() > 1024:  # repr refuses thousands of digits
        return f"a whole number of {value.bit_length()} bits"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:40]}... ({len(text)} letters)"


def is_range(text: str) -> bool:
    """Return whether a value on the command line is a range ``FROM:TO:COUNT``."""
    return ":" in text


def span(name: str, text: str, units: str) -> NDArray[np.float64]:
    """Read a range ``FROM:TO:COUNT``; a unit on TO alone holds for both.

    Examples
    --------
    >>> span("a", "0:2mm:3", "m").tolist()
    [0.0, 0.001, 0.002]
    """
    parts = text.split(":")
    if len(parts) != 3:
        raise ParameterError(f"{name}: got {text!r}, wants FROM:TO:COUNT, such as 0:90deg:181")
    first, last, count = parts
    bare = _NUMBER.fullmatch(first)
    suffix = _NUMBER.fullmatch(last)
    if bare is not None and suffix is not None and not bare[2]:
        first += suffix[2]
    return between(name, first, last, count, units)


def ends(name: str, text: str, units: str) -> tuple[float, float]:
    """Read a range ``FROM:TO``; a count after it is left out, a unit on TO alone holds for both.

    Examples
    --------
    >>> ends("I", "0:2", "1")
    (0.0, 2.0)
    """
    parts = text.split(":")
    if len(parts) not in (2, 3):
        raise ParameterError(f"{name}: got {text!r}, wants FROM:TO, such as 0:2")
    low, high = span(name, ":".join([*parts[:2], "2"]), units if units in UNITS else "1")
    if not low < high:
        raise ParameterError(f"{name}: got {text!r}, wants FROM < TO")
    return float(low), float(high)


def between(
    name: str, first: Any, last: Any, count: Any, units: str, spacing: Any = "linear"
) -> NDArray[np.float64]:
    """Return `count` values from `first` to `last`, evenly spaced or by equal ratios."""
    start, stop = number(name, first, units), number(name, last, units)
    try:
        size = int(count) if not isinstance(count, (bool, float)) else -1
    except (TypeError, ValueError):
        size = -1
    if not 2 <= size <= LONGEST:
        raise ParameterError(
            f"{name}: got {_short(count)} as count, wants a whole number from 2 to {LONGEST}"
        )
    if spacing == "log":
        if not (start > 0.0 and stop > 0.0):
            raise ParameterError(f"{name}: got a log range from {start!r} to {stop!r}, wants > 0")
        return np.geomspace(start, stop, size)
    if spacing != "linear":
        raise ParameterError(f"{name}: got spacing {spacing!r}, wants 'linear' or 'log'")
    return np.linspace(start, stop, size)


def glue_negative_values(argv: list[str]) -> list[str]:
    """Join ``--a -2mm`` to ``--a=-2mm``: argparse takes -2mm for an option.

    >>> glue_negative_values(["--a", "-2mm", "--out", "x.png"])
    ['--a=-2mm', '--out', 'x.png']
    """
    glued: list[str] = []
    for word in argv:
        previous = glued[-1] if glued else ""
        if re.match(r"-[\d.]", word) and previous.startswith("--") and "=" not in previous:
            glued[-1] = f"{previous}={word}"
        else:
            glued.append(word)
    return glued
