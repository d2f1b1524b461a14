"""``phasekit sweep FILE.toml``: make a map and store it, or go on with one.

The file holds the model, what is fixed, what is swept, what is computed, and where it is put::

    model = "GyroRotorDisk"
    store = "map.zarr"
    of = ["equilibria", "separatrices"]
    chunks = { beta = 91 }
    workers = 4
    dtype = "float32"

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

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from phasekit.cli import Parser, common
from phasekit.cli.models import LAWS, OF_MAPS, model_called, model_of, read_file, read_toml
from phasekit.cli.values import between
from phasekit.errors import ParameterError, StoreError
from phasekit.labels.arguments import unknown
from phasekit.labels.coordinates import STATES
from phasekit.labels.units import UNITS, number
from phasekit.systems.system import System

KEYS = ("model", *OF_MAPS[:-1], "parameters", "axes")
RANGE_KEYS = ("from", "to", "count", "spacing")

#: Cells from which on a sweep says beforehand how large it will be and how long it will take.
MANY_CELLS = 1_000_000


def run(argv: Sequence[str]) -> None:
    """Make the map that a TOML file describes."""
    parser = Parser(
        prog="phasekit sweep",
        description="Make a map from a TOML file. A map that the same file began is continued; "
        "one with fewer quantities or shorter axes is extended.",
    )
    parser.add_argument("file", metavar="FILE.toml", help="what to map; see docs/command_line.md")
    parser.add_argument("--store", help="where to write the map, instead of the file's store")
    parser.add_argument("--workers", type=int, help="number of processes (as many as cores)")
    parser.add_argument("--scheduler", help="address of a dask scheduler, tcp://host:8786")
    parser.add_argument(
        "--estimate", action="store_true", help="print the expected size and time, and stop"
    )
    parser.add_argument("--force", action="store_true", help="start even if the disk is too small")
    parser.add_argument("--overwrite", action="store_true", help="replace an existing map")
    options = parser.parse_args(argv)
    recipe = read_recipe(common.path_called("FILE.toml", options.file))
    for key in ("store", "workers", "scheduler"):
        if getattr(options, key) is not None:
            recipe[key] = getattr(options, key)
    # What the command line names replaces what the file does.
    if options.scheduler is not None and options.workers is None:
        recipe.pop("workers", None)
    if options.workers is not None and options.scheduler is None:
        recipe.pop("scheduler", None)
    store = recipe.get("store")
    if not isinstance(store, str) or not store:
        raise ParameterError(
            f"store: got {store!r}, wants a name that ends in .zarr or .nc, in the file "
            "or as --store"
        )
    if options.estimate and store.endswith(".nc"):
        raise ParameterError(
            f"--estimate: got {store!r} as store, wants a Zarr store; what goes into a .nc file "
            "is computed in memory"
        )
    if "://" not in store:
        path = common.path_called("store", store)
        if path.suffix == ".nc" and path.exists() and not options.overwrite:
            raise StoreError(f"store: {store} exists; choose another name or pass --overwrite")
    system, axes = read_system(recipe)
    _sweep(recipe, system, axes, options)


def _sweep(recipe: Mapping[str, Any], system: System, axes: dict[str, Any], options: Any) -> None:
    from phasekit import sweep
    from phasekit.maps.sweep import plan_sweep

    store = recipe["store"]
    what = {"of": recipe.get("of", ("equilibria", "separatrices")), "store": store}
    if "dtype" in recipe:
        what["dtype"] = recipe["dtype"]
    if "chunks" in recipe:
        what["chunks"] = recipe["chunks"]
    sizes = " x ".join(f"{name} {np.size(values)}" for name, values in axes.items())
    title = f"{type(system).__name__}: {sizes} cells"
    if not store.endswith(".nc"):
        job = plan_sweep(system, axes, overwrite=options.overwrite, **what)
        if options.estimate or job.cells > MANY_CELLS:
            common.say(title)
            _say_estimate(job, 1 if "scheduler" in recipe else recipe.get("workers"))
        if options.estimate:
            return
        if 0 < job.count < job.total:
            common.say(f"{job.count} of {job.total} tiles are left")
    ds = sweep(
        system,
        axes,
        **what,
        workers=recipe.get("workers"),
        client=recipe.get("scheduler"),
        overwrite=options.overwrite,
        force=options.force,
    )
    common.say(f"{title}, {len(ds.data_vars)} quantities")
    common.say_invalid(ds)
    common.say(f"wrote {store}; open it with phasekit.open_map({store!r})")


def _say_estimate(job: Any, workers: Any) -> None:
    from phasekit.numerics.launch import cpus
    from phasekit.numerics.memory import human

    if not job.count:
        common.say("nothing is left to compute")
        return
    number = workers if isinstance(workers, int) and workers > 0 else cpus()
    needed = job.estimate()
    common.say(f"left: {job.cells:,} cells in {job.count:,} tiles, {needed.describe(number)}")
    free = job.place.free_bytes()
    if free is not None:
        fits = "" if needed.stored <= free else ": the map does not fit"
        common.say(f"the disk has {human(free)} left{fits}")


def read_recipe(path: Path) -> dict[str, Any]:
    """Read the file, and refuse what is not in its schema."""
    recipe = read_toml(path, "that says what to map")
    of_file = str(recipe.get("model", "")).lower().endswith((".toml", ".ode"))
    if of_file:
        recipe["model"] = str(path.parent / recipe["model"])
    stated = any(law in recipe for law in LAWS if law != "model")
    for key in recipe if not stated else ():
        if key not in KEYS:
            raise unknown(f"{path}: key", key, KEYS)
    if stated:
        recipe["system"] = model_of(recipe, str(path)).system
    elif of_file:
        recipe["system"] = read_file(Path(recipe["model"])).system
    for key in ("parameters", "axes"):
        if not isinstance(recipe.setdefault(key, {}), dict):
            raise ParameterError(f"{path}: {key}: got {recipe[key]!r}, wants a table [{key}]")
    return recipe


def read_system(recipe: Mapping[str, Any]) -> tuple[System, dict[str, Any]]:
    """Return the system of a recipe and its axes, in their order."""
    model: Any = recipe.get("system") or model_called(recipe.get("model", "GyroRotorDisk"))
    title = model.__name__ if isinstance(model, type) else "the model"
    declared = {parameter.name: parameter.units for parameter in model.declared}
    units = {**declared, **{name: state[0] for name, state in STATES.items()}}
    for table in ("parameters", "axes"):
        for name in recipe[table]:
            if name not in units:
                raise unknown(f"{table}: parameter of {title}", name, units)
    for name in recipe["axes"]:
        if name in recipe["parameters"] and isinstance(model, type):
            raise ParameterError(f"{name}: got it in parameters and in axes, wants it once")
    if not recipe["axes"]:
        raise ParameterError(
            f"axes: got none, wants at least one of {', '.join(declared)}, "
            "such as beta = { from = 0, to = 1.5, count = 100 }"
        )
    units = {name: unit if unit in UNITS else "1" for name, unit in units.items()}
    fixed = {name: number(name, text, units[name]) for name, text in recipe["parameters"].items()}
    axes = {name: _axis(name, value, units[name]) for name, value in recipe["axes"].items()}
    given = {name: value for name, value in {**fixed, **axes}.items() if name in declared}
    # Fixed states are numbers among the axes.
    states = {name: value for name, value in fixed.items() if name in STATES}
    return (model if isinstance(model, type) else model.replace)(**given), {**axes, **states}


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
