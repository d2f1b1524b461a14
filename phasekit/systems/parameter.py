"""One declared parameter of a model; validation and coordinates follow from the declaration."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from phasekit.errors import ParameterError
from phasekit.labels.arguments import Value, bad, describe, numeric
from phasekit.laws.trigonometric import Values

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One declared parameter of a model: its name, meaning, unit and domain."""

    name: str
    units: str
    long_name: str
    low: float = -np.inf
    high: float = np.inf
    positive: bool = False  # zero is excluded
    optional: bool = False

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
                in_degrees = self.units == "rad" and self.valid(kept * np.pi / 180.0)
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


def attrs_of(*parameters: Parameter) -> dict[str, dict[str, str]]:
    """Attributes of the coordinates or results that are named as these parameters."""
    return {p.name: {"long_name": p.long_name, "units": p.units} for p in parameters}


def of_parameters(products: Callable[[Values], Any]) -> Callable[[Values], Any]:
    """A law that names what it was given where that is not its parameters."""

    @functools.wraps(products)
    def checked(v: Values) -> Any:
        try:
            return products(v)
        except Exception as error:
            raise ParameterError(
                f"v: got {describe(v)}, wants the parameters by name, angles as (sine, cosine, "
                f"radius): {type(error).__name__}: {error}"
            ) from error

    return checked
