"""One declared parameter of a model; validation and coordinates follow from the declaration.

Of cells whose parameters are not legal it is said how many there are, why, and the way out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from phasekit.errors import InvalidCellsWarning, warn
from phasekit.inputs import call_checked
from phasekit.labels.arguments import FloatArray, Value, bad, describe, flag, numeric

if TYPE_CHECKING:
    import xarray as xr

#: Share of the cells from which on it is said: maps may touch what is not legal at their edges.
MANY = 0.1


#: Default of a parameter that has to be given.
REQUIRED = ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One declared parameter of a model: its name, meaning, unit, domain and default."""

    name: str = ""
    units: str
    long_name: str
    low: float = -np.inf
    high: float = np.inf
    positive: bool = False  # zero is excluded
    optional: bool = False
    default: Any = REQUIRED

    def __set_name__(self, owner: type, name: str) -> None:
        """Take the name of the field."""
        object.__setattr__(self, "name", name)

    @property
    def least(self) -> float:
        """The least value, just above zero where that is excluded."""
        return max(self.low, math.ulp(0.0)) if self.positive else self.low

    @property
    def example(self) -> float:
        """A value of the domain, for where the parameter's own value does not count."""
        if np.isfinite(self.low) and np.isfinite(self.high):
            return 0.5 * (self.low + self.high)
        return max(1.0, self.low)

    @property
    def wants(self) -> str:
        """The domain in words."""
        if self.positive:
            domain = "a number > 0"
        elif self.low == 0.0 and self.high == np.inf:
            domain = "a number >= 0"
        elif np.isfinite(self.high):
            domain = f"a number from {self.low:.6g} to {self.high:.6g}"
        else:
            domain = "a finite number"
        units = {"1": "", "rad": " in radians"}.get(self.units, f" in {self.units}")
        return domain + units

    @property
    def entry(self) -> str:
        """What a docstring says of it that does not speak of it itself."""
        given = self.default is REQUIRED or self.optional
        how = ", optional" if self.optional else "" if given else f", default {self.default!r}"
        what = self.long_name[:1].upper() + self.long_name[1:]
        kind = "float, 1-D array_like or xarray.DataArray"
        return f"{self.name} : {kind}{how}\n    {what}: {self.wants}."

    def valid(self, value: Any) -> NDArray[np.bool_]:
        """Whether each value lies in the domain; NaN does not."""
        inside = np.isfinite(value) & (value >= self.low) & (value <= self.high)
        return np.asarray(inside & (value > 0) if self.positive else inside)

    def check(self, value: Any) -> Value:
        """Return the value as it is kept, or raise a `ParameterError`.

        Cells of arrays that lie outside the domain are kept: they give invalid cells.
        """
        kept = numeric(self.name, value, self.units)
        if isinstance(kept, float):
            if not self.valid(kept):
                in_degrees = (
                    self.units == "rad"
                    and not isinstance(value, str)
                    and self.valid(kept * np.pi / 180.0)
                )
                hint = f"if it is in degrees: {kept:.15g} * pk.deg" if in_degrees else ""
                raise bad(self.name, value, self.wants, hint)
            return kept
        if isinstance(kept, np.ndarray):
            return kept
        return self._plain_axis(kept)

    def _plain_axis(self, kept: xr.DataArray) -> Value:
        """Keep a DataArray on the parameter's own dim as the 1-D array that it is."""
        if self.name not in kept.dims:
            return kept
        if kept.ndim > 1:
            wants = f"a dim {self.name!r} only where it is the one dim (it is the axis then)"
            raise bad(self.name, kept, wants, "rename the dim")
        if self.name in kept.coords and not np.array_equal(
            kept.coords[self.name].values, kept.values, equal_nan=True
        ):
            wants = f"a coordinate {self.name!r} that equals its values"
            raise bad(self.name, kept, wants, f"drop it with .drop_vars({self.name!r})")
        if kept.chunks is not None:  # stays lazy
            return kept.drop_vars(self.name, errors="ignore")
        array = np.array(kept.values)
        array.flags.writeable = False
        return array


@call_checked
def parameter(
    units: str = "1",
    long_name: str = "",
    *,
    default: Any = REQUIRED,
    low: float = -math.inf,
    high: float = math.inf,
    positive: bool = False,
) -> Any:
    """Declare a parameter of a system: a field of the class.

    Parameters
    ----------
    units : str
        Unit as arrays have it in ``attrs["units"]``, such as ``"m s-2"``; ``"rad"`` of an angle,
        ``"1"`` without one.
    long_name : str
        What it is, for labels and tables.
    default : float or None, optional
        Its value where none is given; None of a parameter that may be left out. Without it a value
        has to be given.
    low, high : float
        Its domain, ends included. A value outside is refused; in arrays such cells are empty.
    positive : bool
        Whether zero is outside as well.

    Returns
    -------
    Any
        A field of a `System`.

    Examples
    --------
    >>> import phasekit as pk
    >>> class Bob(pk.System):
    ...     length = pk.parameter("m", "length of the pendulum", positive=True)
    ...     g = pk.parameter("m s-2", "acceleration of gravity", default=9.81)
    ...     coordinate = pk.angle("theta")
    ...     potential = "-g/length*cos(theta)"
    >>> Bob(length=0.5)
    Bob(length=0.5, g=9.81)
    """
    for name, text in (("units", units), ("long_name", long_name)):
        if not isinstance(text, str):
            raise bad(name, text, "text")
    flag("positive", positive)
    low = 0.0 if positive and low == -math.inf else low
    for name, end in (("low", low), ("high", high)):
        if not isinstance(end, (int, float)) or math.isnan(end):
            raise bad(name, end, "a number")
    if not low <= high:
        raise bad("low", low, f"a number up to high = {high!r}")
    made = Parameter(
        units=units, long_name=long_name, low=float(low), high=float(high), positive=positive,
        optional=default is None, default=default,
    )  # fmt: skip
    if default is not REQUIRED and default is not None:  # labels are not loaded for it
        known = isinstance(default, (int, float)) and not isinstance(default, bool)
        if not known or not made.valid(default):
            raise bad("default", default, made.wants)
    return made


def attrs_of(*parameters: Parameter) -> dict[str, dict[str, str]]:
    """Attributes of the coordinates or results that are named as these parameters."""
    return {p.name: {"long_name": p.long_name, "units": p.units} for p in parameters}


def warn_of_invalid(declared: Sequence[Parameter], parameters: Mapping[str, Value]) -> None:
    """Warn of many cells that stay empty, once a call; of lazy parameters none are looked at."""
    import xarray as xr

    valid: list[xr.Variable] = []
    reasons = []
    for parameter in declared:
        value = parameters.get(parameter.name)
        if not isinstance(value, (np.ndarray, xr.DataArray)) or getattr(value, "chunks", None):
            continue
        inside = parameter.valid(np.asarray(value))
        if inside.all():
            continue
        dims = value.dims if isinstance(value, xr.DataArray) else (parameter.name,)
        valid.append(xr.Variable(dims, inside))
        reasons.append(_reason(parameter, np.asarray(value), inside))
    if not reasons:
        return
    share = _share_inside(valid)
    if share <= 1.0 - MANY:
        text = f"{100.0 * (1.0 - share):.3g} % of the cells are empty: {'; '.join(reasons)}"
        warn(text, InvalidCellsWarning)


def _reason(parameter: Parameter, value: FloatArray, inside: NDArray[np.bool_]) -> str:
    example = value[~inside].flat[0]
    text = (
        f"{parameter.name}: {np.count_nonzero(~inside)} of {inside.size} values are not legal, "
        f"such as {describe(example)}; wants {parameter.wants}"
    )
    with np.errstate(all="ignore"):
        in_degrees = parameter.units == "rad" and parameter.valid(value * np.pi / 180.0).all()
    return f"{text}; if they are in degrees: {parameter.name} * pk.deg" if in_degrees else text


def _share_inside(valid: list[xr.Variable]) -> float:
    """Return the share of cells that are valid in all; dims that are shared count once."""
    share = 1.0
    while valid:
        joint = valid.pop()
        while near := [other for other in valid if set(other.dims) & set(joint.dims)]:
            valid = [other for other in valid if not any(other is one for one in near)]
            for other in near:
                joint = joint & other
        share *= float(joint.mean())
    return share
