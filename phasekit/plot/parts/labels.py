"""Words on axes and color bars, made from the attributes that Datasets carry."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable
from typing import Any

import numpy as np
import xarray as xr

from phasekit.errors import ParameterError
from phasekit.labels.arguments import bad, unknown
from phasekit.plot.parts.units import SYMBOLS, Angles, Units, as_units
from phasekit.systems.identity import MODEL, SCHEMA, SCHEMA_VERSION
from phasekit.systems.registry import models
from phasekit.systems.system import System

#: Names of quantities where there is no room for their meaning, if they are not plain words.
BRIEF = {"n_equilibria": "number of equilibria"}

GLUE = "\N{NO-BREAK SPACE}"
#: From this number of letters on, labels may have two lines.
ROOMY = 36


def shown(values: xr.DataArray, units: Angles | Units) -> tuple[np.ndarray[Any, Any], str]:
    """Return the values in the unit in which they are shown, and that unit for print."""
    return as_units(units).shown(values)


def label(values: xr.DataArray, units: Angles | Units, width: int, extra: str = "") -> str:
    """Return what a quantity or parameter is called on an axis: symbol, meaning, unit.

    Where that does not fit into two lines of `width` letters, or into one if these are few, it is
    the symbol or the name, with the unit.
    """
    name = str(values.name)
    meaning = str(values.attrs.get("long_name", ""))
    if meaning == f"parameter {name}":  # says no more than its name
        meaning = ""
    symbol = SYMBOLS.get(name, "" if meaning else name)
    unit = as_units(units).text(name, str(values.attrs.get("units", "")))
    brief = SYMBOLS.get(name) or BRIEF.get(name, name.replace("_", " "))
    long, short = (
        ", ".join(filter(None, one)) for one in ((symbol, meaning, extra), (brief, extra))
    )
    return fitting(width, unit, long, short, brief)


def with_unit(text: str, unit: str) -> str:
    """Return a text with its unit, if it has one."""
    return f"{text} ({unit})" if unit else text


def fitting(width: int, unit: str, *texts: str) -> str:
    """Return the first of the texts that fits with its unit: in one line where few letters do."""
    lines = 2 if width >= ROOMY else 1
    # The unit stays with the last word.
    end = f"{GLUE}({unit.replace(' ', GLUE)})" if unit else ""
    wrapped = [wrap(text + end, width) for text in texts]
    return next((text for text in wrapped if text.count("\n") < lines), wrapped[-1])


def wrap(text: str, width: int) -> str:
    r"""Break a label into lines, counting what is seen of its formulas.

    >>> wrap(r"$\omega_1$, angular velocity (s$^{-1}$)", 24)
    '$\\omega_1$, angular velocity\n(s$^{-1}$)'
    """
    lines: list[str] = []
    for word in text.split(" "):
        longer = f"{lines[-1]} {word}" if lines else word
        seen = re.sub(r"[${}^_]", "", re.sub(r"\\[A-Za-z]+", "x", longer))
        if lines and len(seen) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return "\n".join(lines).replace(GLUE, " ")


def value(number: xr.DataArray, units: Angles | Units) -> str:
    r"""Return one value of a coordinate for print.

    >>> value(xr.DataArray(0.5, name="beta", attrs={"units": "rad"}), "rad")
    '$\\beta$ = 0.5\xa0rad'
    """
    name = str(number.name)
    symbol = SYMBOLS.get(name, name.replace("_", " "))
    if number.dtype.kind not in "iuf":
        return f"{symbol} {number.item()}".replace("_", " ")
    shown_value, unit = shown(number, units)
    text = f"{float(shown_value):.4g}".replace("-", "\N{MINUS SIGN}")
    between = "" if unit.startswith("°") or not unit else GLUE
    return f"{symbol} = {text}{between}{unit}"


def dataset(
    value: object, argument: str, needs: Iterable[str], source: str = "pk.equilibria or pk.sweep"
) -> xr.Dataset:
    """Return `value` if it is a Dataset with the variables that a picture needs."""
    wants = f"a Dataset, such as {source} returns"
    if not isinstance(value, xr.Dataset):
        raise bad(argument, value, wants)
    for name in needs:
        if name not in value.variables:
            raise ParameterError(f"{argument}: got a Dataset without {name!r}, wants {wants}")
    return value


def model_in(ds: xr.Dataset) -> type[System] | None:
    """Return the model that a Dataset names, if all that it needs is there."""
    model = models().get(str(ds.attrs.get(MODEL)))
    if model is None or ds.attrs.get(SCHEMA) != SCHEMA_VERSION:
        return None
    needed = (parameter.name for parameter in model.declared if not parameter.optional)
    return model if all(name in ds.variables for name in needed) else None


def system_of(motion: xr.Dataset, argument: str, instead: str) -> System:
    """Return the system whose motion a Dataset holds."""
    model = model_in(motion)
    if model is None:
        named = motion.attrs.get(MODEL)
        without = f"of {named}, without its parameters" if named else f"no attribute {MODEL!r}"
        raise ParameterError(
            f"{argument}: got a motion that does not tell its system ({without}); "
            f"give {instead}(disk, motion)"
        )
    return model.from_dataset(motion)


def swept(values: xr.DataArray, labels: Iterable[Hashable] = ()) -> list[str]:
    """Return the dims of an array that are axes of a map."""
    return [str(dim) for dim in values.dims if dim not in set(labels)]


def choose_axis(values: xr.DataArray, name: object, argument: str, offered: list[str]) -> str:
    """Return the dim that `name` asks for: the dim itself, or a coordinate along it."""
    if not isinstance(name, str) or (name not in offered and name not in values.coords):
        raise unknown(argument, name, offered)
    if name in offered:
        return name
    dims = [str(dim) for dim in values.coords[name].dims]
    if len(dims) != 1 or dims[0] not in offered:
        raise unknown(argument, name, offered)
    return name


def monotone(values: xr.DataArray, argument: str) -> None:
    """Refuse an axis that cannot be drawn: not numbers, not finite, or not in order."""
    numbers = np.asarray(values.values)
    wants = "at least two finite values in rising or falling order"
    if numbers.dtype.kind not in "iuf" or numbers.size < 2 or not np.isfinite(numbers).all():
        raise bad(argument, numbers, wants)
    steps = np.diff(numbers)
    if not ((steps > 0).all() or (steps < 0).all()):
        raise bad(argument, numbers, wants, f"sort it: ds.sortby({str(values.name)!r})")
