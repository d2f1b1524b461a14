"""Files of models: equations, parameters, window and units as a TOML table, or XPPAUT's ``.ode``.

A table holds one law and what belongs to it::

    duration = 200

    [rates]
    v = "v - v^3/3 - w + I"
    w = "eps*(v + a - b*w)"

    [parameters]
    I = 0.5
    eps = 0.08
    a = 0.7
    b = 0.8

    [window]
    v = [-2.5, 2.5]
    w = [-1, 2]
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from phasekit.errors import ParameterError, StoreError
from phasekit.labels.arguments import unknown
from phasekit.labels.units import UNITS, number
from phasekit.systems.registry import models
from phasekit.systems.system import System

#: The ways to state a law, of which a file has one.
LAWS = ("rates", "step", "potential", "model")
#: What belongs to each.
WITH = {
    "rates": (
        "time", "period", "periods", "window", "start", "definitions", "functions", "observables",
        "conservative", "noise",
    ),
    "step": ("periods", "window", "start", "definitions", "functions", "observables"),
    "potential": ("coordinate", "period", "interval"),
    "model": (),
}  # fmt: skip
#: Tables of names.
TABLES = (
    "rates", "step", "parameters", "units", "long_names", "window", "start", "definitions",
    "functions", "observables", "periods", "noise",
)  # fmt: skip
EVERYWHERE = ("parameters", "units", "long_names", "duration", "count")
#: What a file says of a map, beside the model.
OF_MAPS = ("store", "of", "chunks", "workers", "scheduler", "dtype", "axes")


class Model(NamedTuple):
    """A system from a file, and how long and at how many times its motions are shown."""

    system: System
    duration: float | None
    times: int | None


def read_file(path: Path) -> Model:
    """The model of a file, by its ending."""
    if path.suffix.lower() == ".ode":
        return _ode(path)
    if path.suffix.lower() != ".toml":
        raise ParameterError(f"FILE: got {str(path)!r}, wants a name that ends in .toml or .ode")
    return model_of(read_toml(path, "that describes a model"), str(path))


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """The table of a TOML file."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise StoreError(f"{path} does not exist; name a TOML file {what}") from None
    except IsADirectoryError:
        raise StoreError(f"{path} is a folder; name a TOML file {what}") from None
    except (ValueError, RecursionError) as error:  # TOMLDecodeError, and what tomllib lets through
        raise ParameterError(f"{path}: not TOML: {error}") from None


def _ode(path: Path) -> Model:
    from phasekit.systems.ode_problem import read_ode
    from phasekit.systems.problem import Problem

    if not path.exists():
        raise StoreError(f"{path} does not exist; name an .ode file that describes a model")
    file = read_ode(path, Problem)
    given = {"total": 20.0, "dt": 0.05, "njmp": 1.0}
    for name in given:
        try:
            given[name] = float(file.options.get(name, given[name]))
        except ValueError:
            continue
    step = 1.0 if file.problem.map else given["dt"]
    total, step = given["total"], abs(step) * max(given["njmp"], 1.0)
    if not total > 0.0 or not step > 0.0:
        return Model(file.problem, None, None)
    return Model(file.problem, total, int(min(max(round(total / step), 1), 100_000)) + 1)


def model_of(table: Mapping[str, Any], where: str) -> Model:
    """The model that a table describes, which may say of a map as well."""
    stated = [law for law in LAWS if law in table]
    if len(stated) != 1:
        got = " and ".join(stated or [repr(key) for key in table]) or "nothing"
        raise ParameterError(f"{where}: got {got}, wants one of {', '.join(LAWS)}")
    (law,) = stated
    for key in table:
        valid = (law, *WITH[law], *EVERYWHERE, *OF_MAPS)
        if key not in valid:
            raise unknown(f"{where}: key", key, valid)
    for key in TABLES:
        if not isinstance(table.get(key, {}), dict):
            raise ParameterError(f"{where}: {key}: got {table[key]!r}, wants a table [{key}]")
    duration = _positive(where, "duration", table.get("duration"))
    count = table.get("count")
    if count is not None and not (isinstance(count, int) and count >= 2):
        raise ParameterError(f"{where}: count: got {count!r}, wants a whole number >= 2")
    return Model(_system(law, table, where), duration, count)


def _system(law: str, table: Mapping[str, Any], where: str) -> System:
    if law == "model":
        kind = model_called(table["model"])
        units = {p.name: p.units for p in kind.declared}
        for key in ("units", "long_names"):
            if key in table:
                raise ParameterError(f"{where}: {key}: got a table beside a model, which has them")
        return kind(**_values(table, units, where))
    units, names = table.get("units", {}), table.get("long_names", {})
    for key, given in (("units", units), ("long_names", names)):
        for name, text in given.items():
            if not isinstance(text, str):
                raise ParameterError(f"{where}: {key}: {name}: got {text!r}, wants a text")
    values = _values(table, units, where)
    if law == "potential":
        from phasekit.systems.potential import Potential

        if units or names:
            raise ParameterError(f"{where}: units: got a table beside a potential, wants none")
        return Potential(
            table["potential"], table.get("coordinate", "x"), values, table.get("period"),
            interval=table.get("interval"),
        )  # fmt: skip
    from phasekit.systems.problem import Problem

    given = {key: table[key] for key in WITH[law] if key in table}
    if "periods" in given:
        given["periods"] = {n: _constant(where, n, x) for n, x in given["periods"].items()}
    problem = Problem(table[law], parameters=values, map=law == "step", **given)
    named = {*units, *names}
    words: dict[str, dict[str, str]] = {name: {} for name in named}
    for name in named:
        words[name] |= {"units": units[name]} if name in units else {}
        words[name] |= {"long_name": names[name]} if name in names else {}
    return problem.described(words) if words else problem


def model_called(name: Any) -> type[System]:
    """Return the model of a name."""
    known = models()
    if not isinstance(name, str) or name not in known:
        raise unknown("model", name, known)
    return known[name]


def _values(table: Mapping[str, Any], units: Mapping[str, str], where: str) -> dict[str, float]:
    found = {}
    for name, given in table.get("parameters", {}).items():
        if table.get("model") and name not in units:
            raise unknown(f"{where}: parameters: parameter of {table['model']}", name, units)
        unit = units.get(name, "1")
        # Of a unit that is not known numbers stay as they are.
        found[name] = number(name, given, unit if unit in UNITS else "1")
    return found


def _constant(where: str, name: str, given: Any) -> float:
    """A number, or a formula of numbers such as 2*pi."""
    from phasekit.laws.formulas import take_formula

    return float(take_formula(given, {}, f"{where}: periods: {name}"))


def _positive(where: str, name: str, given: Any) -> float | None:
    if given is None:
        return None
    found = number(f"{where}: {name}", given, "s")
    if not found > 0.0:
        raise ParameterError(f"{where}: {name}: got {given!r}, wants a number > 0")
    return found
