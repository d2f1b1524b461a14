"""``phasekit sweep FILE.toml``: make a map and store it.

The file holds the model, what is fixed, what is swept and what is computed::

    model = "GyroRotorDisk"
    store = "map.zarr"
    of = ["equilibria", "separatrices"]

    [parameters]
    e = "50 mm"
    r = "0.2 m"
    omega1 = "300 rpm"

    [axes]
    beta = { from = "0 deg", to = "90 deg", count = 91 }
    a = ["0 mm", "10 mm", "20 mm"]

Numbers without a unit are in SI units and radians.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from phasekit.cli import Parser, common
from phasekit.cli.values import between, number
from phasekit.errors import ParameterError, StoreError
from phasekit.labelled.arguments import unknown
from phasekit.labelled.system import Model

KEYS = ("model", "store", "of", "parameters", "axes")
RANGE_KEYS = ("from", "to", "count", "spacing")


def run(argv: Sequence[str]) -> None:
    """Make the map that a TOML file describes."""
    parser = Parser(prog="phasekit sweep", description="Make a map from a TOML file.")
    parser.add_argument("file", metavar="FILE.toml", help="what to map; see docs/command_line.md")
    parser.add_argument("--store", help="where to write the map, instead of the file's store")
    parser.add_argument("--overwrite", action="store_true", help="replace an existing map")
    options = parser.parse_args(argv)
    recipe = read_recipe(common.path_called("FILE.toml", options.file))
    store = options.store if options.store is not None else recipe.get("store")
    if not isinstance(store, str) or not store:
        raise ParameterError(
            f"store: got {store!r}, wants a name that ends in .zarr or .nc, in the file "
            "or as --store"
        )
    if common.path_called("store", store).exists() and not options.overwrite:
        raise StoreError(f"store: {store} exists; choose another name or pass --overwrite")
    system, axes = read_system(recipe)
    from phasekit import sweep

    of = recipe.get("of", ("equilibria", "separatrices"))
    ds = sweep(system, axes, of=of, store=store, overwrite=options.overwrite)
    sizes = " x ".join(f"{name} {ds.sizes[name]}" for name in axes)
    common.say(f"{type(system).__name__}: {sizes} cells, {len(ds.data_vars)} quantities")
    common.say_invalid(ds)
    common.say(f"wrote {store}; open it with phasekit.open_map({store!r})")


def read_recipe(path: Path) -> dict[str, Any]:
    """Read the file, and refuse what is not in its schema."""
    try:
        recipe = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise StoreError(f"{path} does not exist; name a TOML file that says what to map") from None
    except IsADirectoryError:
        raise StoreError(f"{path} is a folder; name a TOML file that says what to map") from None
    except (ValueError, RecursionError) as error:  # TOMLDecodeError, and what tomllib lets through
        raise ParameterError(f"{path}: not TOML: {error}") from None
    for key in recipe:
        if key not in KEYS:
            raise unknown(f"{path}: key", key, KEYS)
    for key in ("parameters", "axes"):
        if not isinstance(recipe.setdefault(key, {}), dict):
            raise ParameterError(f"{path}: {key}: got {recipe[key]!r}, wants a table [{key}]")
    return recipe


def read_system(recipe: Mapping[str, Any]) -> tuple[Model, dict[str, Any]]:
    """Return the system of a recipe and its axes, in their order."""
    model = common.model_called(recipe.get("model", "GyroRotorDisk"))
    units = {parameter.name: parameter.units for parameter in model.declared}
    for table in ("parameters", "axes"):
        for name in recipe[table]:
            if name not in units:
                raise unknown(f"{table}: parameter of {model.__name__}", name, units)
    for name in recipe["axes"]:
        if name in recipe["parameters"]:
            raise ParameterError(f"{name}: got it in parameters and in axes, wants it once")
    if not recipe["axes"]:
        raise ParameterError(
            f"axes: got none, wants at least one of {', '.join(units)}, "
            "such as beta = { from = 0, to = 1.5, count = 100 }"
        )
    fixed = {name: number(name, text, units[name]) for name, text in recipe["parameters"].items()}
    axes = {name: _axis(name, value, units[name]) for name, value in recipe["axes"].items()}
    return model(**fixed, **axes), axes


def _axis(name: str, value: Any, units: str) -> Any:
    if isinstance(value, list) and value:
        return np.array([number(name, item, units) for item in value])
    if isinstance(value, dict):
        for key in value:
            if key not in RANGE_KEYS:
                raise unknown(f"axes: {name}: key", key, RANGE_KEYS)
        if {"from", "to", "count"} <= set(value):
            return between(
                name, value["from"], value["to"], value["count"], units,
                value.get("spacing", "linear"),
            )  # fmt: skip
    raise ParameterError(
        f"axes: {name}: got {value!r}, wants a list of values or "
        "{ from = ..., to = ..., count = ... }"
    )
