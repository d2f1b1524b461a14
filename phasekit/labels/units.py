"""Units that people write, each with the number that leads to SI units and radians."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from decimal import Decimal
from typing import Any

from phasekit.constants import deg, rpm
from phasekit.errors import ParameterError

#: Units by the unit that results carry; each is the number to multiply by. Decimal, so that 1.153mm
#: becomes the double nearest to 0.001153.
UNITS: Mapping[str, Mapping[str, Decimal]] = {
    "rad": {"rad": Decimal(1), "deg": Decimal(deg), "°": Decimal(deg)},
    "m": {"m": Decimal(1), "cm": Decimal("1e-2"), "mm": Decimal("1e-3"), "um": Decimal("1e-6")},
    "kg": {"kg": Decimal(1), "g": Decimal("1e-3"), "t": Decimal(1000)},
    "s-1": {
        "rad/s": Decimal(1),
        "1/s": Decimal(1),
        "s-1": Decimal(1),
        "deg/s": Decimal(deg),
        "rpm": Decimal(rpm),
    },
    "s-2": {
        "rad/s2": Decimal(1),
        "1/s2": Decimal(1),
        "s-2": Decimal(1),
        "deg/s2": Decimal(deg),
    },
    "m s-2": {"m/s2": Decimal(1), "m s-2": Decimal(1)},
    "s": {"s": Decimal(1), "ms": Decimal("1e-3"), "min": Decimal(60)},
    "kg m2": {"kg m2": Decimal(1)},
    "kg m2 s-1": {"kg m2 s-1": Decimal(1)},
    "N": {"N": Decimal(1), "kN": Decimal(1000), "mN": Decimal("1e-3")},
    "N m": {"N m": Decimal(1)},
    "J": {"J": Decimal(1)},
    "1": {},
}

#: Units of the arguments of motions with two degrees of freedom.
UNITS_OF: Mapping[str, str] = {
    **dict.fromkeys(("phi", "phi0", "phi1", "section"), "rad"),
    **dict.fromkeys(("dphi", "dphi0", "omega1"), "s-1"),
    **dict.fromkeys(("t", "span", "duration", "period", "max_step"), "s"),
    **dict.fromkeys(("torque1", "torque2"), "N m"),
    "carrier_inertia": "kg m2",
    "p": "kg m2 s-1",
    "energy": "J",
}

_ALIASES = {
    "degree": "deg",
    "degrees": "deg",
    "radian": "rad",
    "radians": "rad",
    "rad s-1": "rad/s",
    "deg s-1": "deg/s",
    "rad s-2": "rad/s2",
    "deg s-2": "deg/s2",
    "degree/s": "deg/s",
    "degrees/s": "deg/s",
    "rev/min": "rpm",
    "meter": "m",
    "meters": "m",
    "metre": "m",
    "metres": "m",
    "millimeter": "mm",
    "millimeters": "mm",
    "centimeter": "cm",
    "centimeters": "cm",
    "\N{MICRO SIGN}m": "um",
    "kilogram": "kg",
    "kilograms": "kg",
    "gram": "g",
    "grams": "g",
    "second": "s",
    "seconds": "s",
}


def usual(unit: str) -> str:
    """Return a unit as `UNITS` spells it, where it knows it.

    >>> usual("degrees"), usual("m/s^2"), usual("parsec")
    ('deg', 'm/s2', 'parsec')
    """
    plain = unit.strip().replace("**", "").replace("^", "")
    return _ALIASES.get(plain, plain)


def si_unit(unit: object) -> str | None:
    """Return the SI unit, or radians, to which a unit leads; None where it is not known.

    >>> si_unit("mm"), si_unit("rpm"), si_unit("parsec")
    ('m', 's-1', None)
    """
    name = usual(unit) if isinstance(unit, str) else ""
    return next((held for held, fits in UNITS.items() if name == held or name in fits), None)


#: A number as people write it, with a decimal point or comma or as a part of pi, and its unit. The
#: letters that may follow are those of units, which `\w` means in Python, but not in JavaScript.
TYPED = re.compile(
    r"\s*(?:(?P<digits>[-+]?(?:[0-9]+(?:[.,][0-9]*)?|[.,][0-9]+)(?:[eE][-+]?[0-9]+)?)"
    r"(?![0-9.,]|\s*\*?\s*(?:pi|\u03c0)(?![0-9A-Za-z_\u00b5\u03bc\u03a9]))"
    r"|(?P<sign>[-+]?)\s*(?P<times>[0-9]+(?:\.[0-9]+)?)?\s*\*?\s*(?:pi|\u03c0)"
    r"(?:\s*/\s*(?P<over>[0-9]+(?:\.[0-9]+)?))?)"
    r"\s*(?P<unit>.*?)\s*"
)
#: What may be a number with a decimal comma, or thousands.
_THOUSANDS = re.compile(r"[-+]?[1-9][0-9]{0,2},[0-9]{3}")


def grammar() -> dict[str, Any]:
    """Return what another language needs to read numbers as `number` does; JSON can hold it.

    ``typed`` and ``thousands`` are patterns of the whole text with groups named as in JavaScript,
    ``aliases`` other names of units, ``units`` the numbers to multiply by, by the unit of results.

    >>> grammar()["units"]["m"]["mm"], grammar()["aliases"]["degrees"]
    (0.001, 'deg')
    """
    return {
        "typed": TYPED.pattern.replace("(?P<", "(?<"),
        "thousands": _THOUSANDS.pattern,
        "aliases": dict(_ALIASES),
        "units": {held: {n: float(x) for n, x in fits.items()} for held, fits in UNITS.items()},
    }


def number(name: str, text: Any, units: str) -> float:
    """Read one number with an optional unit; without one it is in SI units and radians.

    >>> number("e", "1.153mm", "m"), number("beta", "pi/4", "rad"), number("psi", "0,7", "1")
    (0.001153, 0.7853981633974483, 0.7)
    >>> number("beta", "30mm", "rad")
    Traceback (most recent call last):
    ...
    phasekit.errors.ParameterError: beta: got '30mm', wants a number in rad or deg or °
    """
    known = UNITS.get(units, {})
    wants = f"a number in {' or '.join(known)}" if known else "a number without unit"
    plain = isinstance(text, (int, float)) and not isinstance(text, bool)
    match = read_typed(text)
    unit = usual(match["unit"]) if match else ""
    if not plain and (match is None or (unit and unit not in known)):
        raise ParameterError(f"{name}: got {brief_value(text)}, wants {wants}")
    digits = (match["digits"] or "") if match else ""
    if _THOUSANDS.fullmatch(digits):
        raise ParameterError(
            f"{name}: got {text!r}, wants {digits.replace(',', '')} or {digits.replace(',', '.')}"
        )
    try:
        # Decimals have bounds of their own, far beyond those of doubles.
        if match is None:
            value = float(text)
        else:
            value = float(_decimal(match) * known.get(unit, Decimal(1)))
    except ArithmeticError:
        value = math.inf
    if not math.isfinite(value):
        raise ParameterError(f"{name}: got {brief_value(text)}, wants {wants}, and a finite one")
    return value


def read_typed(text: object) -> re.Match[str] | None:
    """Return how a text is read as a number; None where it is none.

    >>> read_typed("\N{MINUS SIGN}5 mm")["digits"], read_typed("mm") is None
    ('-5', True)
    """
    if not isinstance(text, str):
        return None
    return TYPED.fullmatch(text.replace("\N{MINUS SIGN}", "-"))


def _decimal(match: re.Match[str]) -> Decimal:
    if match["digits"]:
        return Decimal(match["digits"].replace(",", "."))
    turned = float(match["times"] or 1) * math.pi / float(match["over"] or 1)
    return Decimal(-turned if match["sign"] == "-" else turned)


def brief_value(value: Any) -> str:
    """Write a value for a message that must stay one readable line."""
    if isinstance(value, int) and value.bit_length() > 1024:  # repr refuses thousands of digits
        return f"a whole number of {value.bit_length()} bits"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:40]}... ({len(text)} letters)"


def factor(argument: str, unit: Any, wanted: str | None) -> Decimal:
    """Return the number by which values in `unit` become values in the unit `wanted`.

    None wants values of any dimension, in SI units.
    """
    found = _number(str(unit), wanted)
    if found is not None:
        return found
    known = _fitting(wanted)
    wants = f"units {' or '.join(known)}" if known else "numbers without units"
    raise ParameterError(
        f"{argument}: got the attribute units={str(unit)!r}, wants {wants}; convert it, or drop "
        "the attribute with .drop_attrs() if the numbers are right"
    )


def converted(argument: str, values: Any, held: str, unit: Any) -> Any:
    """Return values that are held in the unit `held`, an SI unit or radians, in the unit `unit`.

    >>> converted("units", 0.024, "m", "mm"), converted("units", 30.0 * rpm, "s-1", "rpm")
    (24.0, 30.0)
    """
    times = _number(unit, held) if isinstance(unit, str) else None
    if times is None:
        wants = " or ".join(_fitting(held)) or "'1', for it has no unit"
        raise ParameterError(f"{argument}: got {unit!r}, wants {wants}")
    # 0.001153 m times 1000 is rounded once.
    return values * float(1 / times) if 1 / times % 1 == 0 else values / float(times)


def _number(unit: str, wanted: str | None) -> Decimal | None:
    """Return the number that leads from `unit` to the unit `wanted`; None where there is none."""
    name = usual(unit)
    fits = UNITS.get(wanted, {}) if wanted is not None else {
        key: value for units in UNITS.values() for key, value in units.items()
    }  # fmt: skip
    if name in fits:
        return fits[name]
    for units in UNITS.values():  # where results are in another unit than SI's, as in ms
        if wanted is not None and name in units and usual(wanted) in units:
            return units[name] / units[usual(wanted)]
    plain = wanted in (None, "", "1", "rad") and name in ("", "1")
    same = name == wanted or (wanted == "1" and name == "rad")
    return Decimal(1) if plain or same else None


def _fitting(wanted: str | None) -> list[str]:
    """Return the units that fit where `wanted` is, that one first."""
    tables = UNITS.values() if wanted is None else [UNITS.get(wanted, {})]
    names = [name for units in tables for name in units]
    first = [wanted] if wanted not in (None, "", "1") else []
    return [str(name) for name in dict.fromkeys([*first, *names])]
