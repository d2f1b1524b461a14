"""The symbols and units in which a picture shows its quantities, by their names."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import xarray as xr
from numpy.typing import NDArray

from phasekit.labels.arguments import bad, unknown
from phasekit.labels.conversion import in_si
from phasekit.labels.coordinates import STATES
from phasekit.labels.units import UNITS_OF, converted, factor, si_unit, usual
from phasekit.systems.registry import models
from phasekit.table.quantities import Quantities

Angles = Literal["rad", "deg"]

#: Quantities and parameters for print.
SYMBOLS = {
    "beta": r"$\beta$",
    "lam": r"$\lambda$",
    "psi": r"$\psi$",
    "phi": r"$\varphi$",
    "omega1": r"$\omega_1$",
    "state_phi": r"$\varphi_0$",
    "state_dphi": r"$\dot\varphi_0$",
    "Omega_sq": r"$\Omega^2$",
    **{name: f"${name}$" for name in ("A", "B", "C", "a", "e", "g", "m", "r")},
}

PRINTED = {"deg": "°", "deg/s": "°/s", "deg/s2": "°/s$^2$", "um": "\N{MICRO SIGN}m", "1": ""}


@dataclass(frozen=True)
class Units:
    """The units of a picture."""

    #: Unit of the angles that `chosen` does not name.
    angles: Angles = "rad"
    #: Units by the names of quantities and parameters; that of ``phi`` is also that of
    #: ``motion_phi`` and ``state_phi``.
    chosen: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def from_arguments(
        cls, angles: Any, units: Any = None, own: Mapping[str, str] | None = None
    ) -> Units:
        """Check what a picture got for `angles` and `units`; `own` are units of its own names."""
        asked: object = angles
        if not isinstance(asked, str) or asked not in ("rad", "deg"):
            raise bad("angles", asked, "'rad' or 'deg'")
        if units is None:
            return cls(angles)
        if not isinstance(units, Mapping):
            raise bad("units", units, "a mapping from names to units, such as {'beta': 'deg'}")
        known = {**_unit_names(), **(own or {})}
        for name, unit in units.items():
            if not isinstance(name, str) or name not in known:
                raise unknown("name in units", name, known)
            converted(f"units: {name}", 1.0, si_unit(known[name]) or known[name], unit)
        return cls(angles, {name: usual(unit) for name, unit in units.items()})

    @classmethod
    def of_dataset(cls, ds: xr.Dataset, angles: Any, units: Any) -> tuple[xr.Dataset, Units]:
        """Return a Dataset in SI units and radians, and the units in which it is shown.

        What it holds in another unit is shown in that one, if nothing else is asked for.
        """
        held = {str(name): str(one.attrs.get("units", "")) for name, one in ds.variables.items()}
        si = {name: si_unit(unit) or unit for name, unit in held.items()}
        asked = cls.from_arguments(angles, units, si)
        others = {name: unit for name, unit in held.items() if si[name] != unit}
        ds = in_si(ds)
        return ds, cls(asked.angles, {**others, **asked.chosen})

    def unit(self, name: str, held: str) -> str:
        """Return the unit in which values are shown that are held in the unit `held`."""
        bare = name
        for prefix in ("motion_", "state_", "section_", "attractor_"):
            bare = bare.removeprefix(prefix)
        chosen = self.chosen.get(name, self.chosen.get(bare))
        if chosen is not None:
            return chosen
        if held == "rad/s" or (held == "s-1" and bare == "dphi"):
            return f"{self.angles}/s"
        return self.angles if held == "rad" else held

    def scale(self, name: str, held: str) -> float:
        """Return what values that are held in the unit `held` are multiplied by to be shown."""
        unit = self.unit(name, held)
        if unit == held:
            return 1.0
        base = si_unit(held) or held
        si = float(factor(name, held, base)) if held != base else 1.0
        return float(converted(f"units: {name}", si, base, unit))

    def text(self, name: str, held: str) -> str:
        """Return the unit for print."""
        return printed(self.unit(name, held))

    def shown(self, values: xr.DataArray) -> tuple[NDArray[Any], str]:
        """Return the values in the unit in which they are shown, and that unit for print."""
        name, held = str(values.name), str(values.attrs.get("units", ""))
        times = self.scale(name, held)
        return (values.values if times == 1.0 else values.values * times), self.text(name, held)


def as_units(angles: Angles | Units) -> Units:
    """Return `Units`, where the unit of angles may stand for them."""
    return angles if isinstance(angles, Units) else Units.from_arguments(angles)


def printed(unit: str) -> str:
    """Return a unit for print: ``m s-2`` becomes m s with a raised -2.

    >>> printed("m s-2"), printed("deg/s"), printed("1")
    ('m s$^{-2}$', '°/s', '')
    """
    return PRINTED.get(unit, re.sub(r"(?<=[A-Za-z])(-?\d+)", r"$^{\1}$", unit))


def coordinate_symbol(name: str) -> str:
    """Return a coordinate for print, without the dollars."""
    if name in SYMBOLS:
        return SYMBOLS[name].strip("$")
    import sympy as sp

    return str(sp.latex(sp.Symbol(name)))


def dotted(symbol: str, dots: str = "dot") -> str:
    r"""A rate of a coordinate for print, without the dollars.

    >>> print(dotted("x"), dotted(r"\varphi", "ddot"), dotted("x_{1}"))
    \dot x \ddot\varphi \dot{x_{1}}
    """
    if symbol[:1] == "\\" and symbol[1:].isalpha():
        return f"\\{dots}{symbol}"
    return f"\\{dots} {symbol}" if len(symbol) == 1 else f"\\{dots}{{{symbol}}}"


def state_symbols(names: Sequence[str]) -> tuple[list[str], list[str]]:
    """States, and their rates, for print: dx is the rate of x, if that is a state."""
    states, rates = [], []
    for name in names:
        own = name[1:] if name[:1] == "d" and name[1:] in names else ""
        symbol = coordinate_symbol(own or name)
        states.append(dotted(symbol) if own else symbol)
        rates.append(dotted(symbol, "ddot" if own else "dot"))
    return states, rates


def _unit_names() -> dict[str, str]:
    """Return the names that quantities, parameters and states have anywhere, with their units."""
    parameters = {p.name: p.units for model in models().values() for p in model.declared}
    states = {name: units for name, (units, _) in STATES.items()}
    rows = {name: row.units for name, row in Quantities().items()}
    return {**UNITS_OF, **parameters, **states, **rows}
