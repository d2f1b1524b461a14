"""What the commands share: options for a model's parameters, and files that are never lost."""

from __future__ import annotations

import inspect
import io
import os
import shlex
import shutil
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from phasekit.cli import Parser
from phasekit.cli.values import glue_negative_values, is_range, number, span
from phasekit.errors import ParameterError, StoreError
from phasekit.labels.arguments import unknown
from phasekit.labels.units import UNITS
from phasekit.systems.registry import models
from phasekit.systems.system import System

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PICTURES = (".pdf", ".png", ".svg")


def model_called(name: Any) -> type[System]:
    """Return the model of a name."""
    known = models()
    if not isinstance(name, str) or name not in known:
        raise unknown("model", name, known)
    return known[name]


def read_model(
    command: str,
    description: str,
    argv: Sequence[str],
    more: Callable[[Parser], None],
) -> tuple[Any, type[System], Mapping[str, str]]:
    """Parse a command whose options are those of a model.

    Returns
    -------
    options, model, parameters
        The command's own options; the model; the text given for each of its parameters.
    """
    words = glue_negative_values(list(argv))
    first = Parser(prog=f"phasekit {command}", add_help=False, allow_abbrev=False)
    first.add_argument("--model", default="GyroRotorDisk")
    model = model_called(first.parse_known_args(words)[0].model)
    parser = Parser(prog=f"phasekit {command}", description=description, allow_abbrev=False)
    parser.add_argument(
        "--model", default="GyroRotorDisk", help=f"one of {', '.join(models())} (%(default)s)"
    )
    group = parser.add_argument_group(
        f"parameters of {model.__name__}",
        "a number with a unit, such as 40deg, 5mm or 300rpm, or in SI units and radians",
    )
    for parameter in model.declared:
        group.add_argument(
            f"--{parameter.name}",
            dest=f"parameter_{parameter.name}",
            metavar="VALUE",
            help=f"{parameter.long_name}, {_fitting(parameter.units)}",
        )
    more(parser)
    options = parser.parse_args(words)
    given = {p.name: getattr(options, f"parameter_{p.name}") for p in model.declared}
    return options, model, {name: text for name, text in given.items() if text is not None}


def build(model: type[System], given: Mapping[str, str]) -> tuple[System, list[str]]:
    """Return the system, and the names of the parameters that are ranges."""
    units = {parameter.name: parameter.units for parameter in model.declared}
    expected = inspect.signature(model).parameters.values()
    missing = [f"--{p.name}" for p in expected if p.default is p.empty and p.name not in given]
    if missing:
        raise ParameterError(f"parameters: got none for {', '.join(missing)}, wants a value each")
    swept = [name for name, text in given.items() if is_range(text)]
    values = {
        name: span(name, text, units[name]) if name in swept else number(name, text, units[name])
        for name, text in given.items()
    }
    return model(**values), swept


def _fitting(units: str) -> str:
    return " or ".join(UNITS.get(units) or ["a number"])


def add_units(parser: Parser) -> None:
    """Add the options that say in which units a picture shows things."""
    parser.add_argument("--angles", choices=("rad", "deg"), default="rad", help="unit of the axes")
    add_shown_units(parser)


def add_shown_units(parser: Parser) -> None:
    """Add the option that says in which units quantities and parameters are shown."""
    parser.add_argument(
        "--units",
        action="append",
        default=[],
        metavar="NAME=UNIT,...",
        help="units in which quantities and parameters are shown, such as beta=deg,a=mm; may be "
        "given several times",
    )


def units_of(texts: Sequence[str]) -> dict[str, str]:
    """Return units by name, from texts like ``beta=deg,a=mm``.

    >>> units_of(["beta=deg, a=mm", "omega1=rpm"])
    {'beta': 'deg', 'a': 'mm', 'omega1': 'rpm'}
    """
    units: dict[str, str] = {}
    for part in (part.strip() for text in texts for part in text.split(",")):
        name, equals, unit = (piece.strip() for piece in part.partition("="))
        if not (name and equals and unit):
            raise ParameterError(f"--units: got {part!r}, wants NAME=UNIT, such as beta=deg,a=mm")
        units[name] = unit
    return units


def path_called(argument: str, name: str) -> Path:
    """Return the path that a user wrote, with ``~`` replaced; refuse what no file can be called."""
    if not name or "\0" in name:
        raise ParameterError(f"{argument}: got {name!r}, wants the name of a file or folder")
    try:
        return Path(name).expanduser()
    except RuntimeError:
        raise ParameterError(
            f"{argument}: got {name!r}, but there is no such user; write ./~ for a name with ~"
        ) from None


def output_file(
    name: str, *, overwrite: bool, suffixes: Sequence[str] = PICTURES, argument: str = "--out"
) -> Path:
    """Return the path of a file that may be written; refuse everything else before any work."""
    path = path_called(argument, name)
    if path.suffix.lower() not in suffixes:
        raise ParameterError(
            f"{argument}: got {name!r}, wants a name that ends in {' or '.join(suffixes)}"
        )
    if not path.parent.is_dir():
        raise StoreError(f"{argument}: the folder {path.parent} does not exist; make it first")
    if path.is_dir() or (path.exists() and not overwrite):
        raise StoreError(f"{argument}: {path} exists; choose another name or pass --overwrite")
    return path


def save(drawn: Figure | Axes, path: Path, *, dpi: int = 150) -> None:
    """Write a picture whole or not at all."""
    import matplotlib

    figure: Any = getattr(drawn, "figure", drawn)
    buffer = io.BytesIO()
    kind = path.suffix.lower().lstrip(".")
    # Without date and random names, the same picture is the same file.
    dated = {"svg": "Date", "pdf": "CreationDate"}.get(kind)
    metadata = {dated: None} if dated else None
    # Texts of vector files stay texts, which can be edited.
    with matplotlib.rc_context(
        {"svg.hashsalt": "phasekit", "svg.fonttype": "none", "pdf.fonttype": 42}
    ):
        figure.savefig(buffer, format=kind, dpi=dpi, metadata=metadata)
    # A link stays a link.
    target = path.resolve()
    part = target.with_name(f".phasekit-{os.getpid()}.part")
    try:
        part.write_bytes(buffer.getvalue())
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)


def say_invalid(ds: xr.Dataset) -> None:
    """Say how many cells of a map hold nothing, if any."""
    if "n_equilibria" not in ds:
        return
    from phasekit.labels.grid import tiles

    counts = ds["n_equilibria"]
    invalid = sum(int((counts[tile].values == -1).sum()) for tile in tiles(counts.shape, 1 << 24))
    if invalid:
        say(
            f"{invalid} of {counts.size} cells are empty because their parameters are invalid; "
            f"numbers without a unit are in SI units and radians: write degrees as 40deg"
        )


def program() -> str:
    """Return how this command is called from a shell: by its name, or where it is not found."""
    called = Path(sys.argv[0])
    found = shutil.which("phasekit")
    passing = "UV_RUN_RECURSION_DEPTH" in os.environ  # uv's path ends with the command
    if called.stem != "phasekit" or (found and not passing and called.samefile(found)):
        return "phasekit"
    path = called.absolute()
    here = os.path.relpath(path)
    near = here if os.sep in here else os.path.join(os.curdir, here)
    return shlex.quote(str(path) if here.startswith(os.pardir) else near)


def quiet_backend() -> None:
    """Draw into files only; nothing may ask for a screen."""
    import matplotlib

    matplotlib.use("Agg")


def say(text: str) -> None:
    """Print a line at once."""
    print(text, file=sys.stdout, flush=True)
