"""Values as people write them: ``30deg``, ``1.153 mm``, ``300rpm``, ``0:90deg:181``."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phasekit.errors import ParameterError
from phasekit.labels.units import UNITS, brief_value, number, read_typed

#: Most values that a range may have.
LONGEST = 10_000_000


def is_range(text: str) -> bool:
    """Return whether a value on the command line is a range ``FROM:TO:COUNT``."""
    return ":" in text


def span(name: str, text: str, units: str) -> NDArray[np.float64]:
    """Read a range ``FROM:TO:COUNT``; a unit on TO alone holds for both.

    >>> span("a", "0:2mm:3", "m").tolist()
    [0.0, 0.001, 0.002]
    """
    parts = text.split(":")
    if len(parts) != 3:
        raise ParameterError(f"{name}: got {text!r}, wants FROM:TO:COUNT, such as 0:90deg:181")
    first, last, count = parts
    bare = read_typed(first)
    suffix = read_typed(last)
    if bare is not None and suffix is not None and not bare["unit"]:
        first += suffix["unit"]
    return between(name, first, last, count, units)


def ends(name: str, text: str, units: str) -> tuple[float, float]:
    """Read a range ``FROM:TO``; a count after it is left out, a unit on TO alone holds for both.

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
            f"{name}: got {brief_value(count)} as count, wants a whole number from 2 to {LONGEST}"
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
