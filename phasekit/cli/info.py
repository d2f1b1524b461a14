"""``phasekit info``: what a stored map is, how complete, and how large; what phasekit runs with."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator, Sequence
from dataclasses import replace
from importlib import metadata
from pathlib import Path

from phasekit.cli import Parser, common
from phasekit.numerics import kept
from phasekit.numerics.launch import cpus
from phasekit.version import __version__


def run(argv: Sequence[str]) -> None:
    """Describe a stored map."""
    parser = Parser(
        prog="phasekit info",
        description="Say what a stored map is, how complete, how large, and what is left to do.",
    )
    parser.add_argument(
        "store", metavar="STORE", nargs="?", help="a map: a folder, a file or a URL"
    )
    parser.add_argument(
        "--environment", action="store_true",
        help="say versions, processor, threads, and what is compiled and where it is kept",
    )  # fmt: skip
    parser.add_argument(
        "--verify",
        action="store_true",
        help="read all files and compare their checksums; damage is named, and the exit code is 2",
    )
    common.add_shown_units(parser)
    options = parser.parse_args(argv)
    if options.environment:
        for line in _environment():
            common.say(line)
        if options.store is None:
            return
    if options.store is None:
        parser.error("got no STORE, wants a map, or --environment")
    units = common.units_of(options.units)
    if "://" not in options.store:
        common.path_called("STORE", options.store)
    from phasekit.labelled.info import map_info

    found = replace(map_info(options.store, verify=options.verify), units=units)
    common.say(str(found))
    if options.verify:
        common.say(found.verdict)


def _environment() -> Iterator[str]:
    """Lines that a report of a fault needs."""
    yield f"phasekit {__version__}, Python {platform.python_version()}, {platform.platform()}"
    for name in ("numpy", "scipy", "sympy", "xarray", "llvmlite", "python-flint", "zarr", "dask"):
        try:
            yield f"  {name} {metadata.version(name)}"
        except metadata.PackageNotFoundError:
            yield f"  {name}: not installed"
    yield f"threads: {cpus()}"
    for folder, count, size in kept.inventory():
        writable = "" if os.access(_there(folder), os.W_OK) else ", cannot be written"
        yield f"compiled kernels: {count} ({size / 1e6:.1f} MB) in {folder}{writable}"


def _there(folder: Path) -> Path:
    """The folder, or the lowest one above it that is there."""
    return next((one for one in (folder, *folder.parents) if one.exists()), folder)
