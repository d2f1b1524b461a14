"""What the commands share: options for a model's parameters, and files that are never lost."""

from __future__ import annotations

import argparse
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
from phasekit.cli.models import model_called, read_file
from phasekit.cli.values import ends, glue_negative_values, is_range, span
from phasekit.errors import ParameterError, StoreError
from phasekit.labels.arguments import unknown
from phasekit.labels.units import UNITS, number
from phasekit.systems.registry import models

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PICTURES = (".pdf", ".png", ".svg")


def read_model(
    command: str,
    description: str,
    argv: Sequence[str],
    more: Callable[[Parser], None],
    *,
    files: bool = True,
) -> tuple[Any, Any, Mapping[str, str]]:
    """Parse a command whose options are those of a model, or of the file that comes first.

    Returns
    -------
    options, model, parameters
        The command's own options; the model: a class, or the system of a file; the text given for
        each of its parameters.
    """
    words = glue_negative_values(list(argv))
    if files:
        description += (
            " The system is that of FILE, a TOML table of equations or an .ode file, or one of "
            f"phasekit's models. phasekit {command} FILE --help lists the parameters of a file."
        )
    if files and words and not words[0].startswith("-"):
        return _read_file(command, description, words, more)
    first = Parser(prog=f"phasekit {command}", add_help=False, allow_abbrev=False)
    first.add_argument("--model", default="GyroRotorDisk")
    model = model_called(first.parse_known_args(words)[0].model)
    parser = Parser(
        prog=f"phasekit {command}",
        usage=f"%(prog)s {'[FILE | --model NAME]' if files else '[--model NAME]'} [OPTIONS]",
        description=description,
        allow_abbrev=False,
    )
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


def _read_file(
    command: str, description: str, words: Sequence[str], more: Callable[[Parser], None]
) -> tuple[Any, Any, Mapping[str, str]]:
    """The same of the system of a file."""
    found = read_file(path_called("FILE", words[0]))
    parser = Parser(
        prog=f"phasekit {command} {words[0]}",
        usage="%(prog)s [OPTIONS]",
        description=description,
        allow_abbrev=False,
    )
    group = parser.add_argument_group(f"parameters of {words[0]}")
    more(parser)
    parser.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE",
        help="a parameter by its name, also where an option has the same name",
    )  # fmt: skip
    declared = {p.name: p for p in found.system.declared if not p.optional}
    for name, p in declared.items():
        try:
            group.add_argument(
                f"--{name}", dest=f"parameter_{name}", metavar="VALUE",
                help=f"{p.long_name}, {_fitting(p.units)}".replace("%", "%%"),
            )  # fmt: skip
        except argparse.ArgumentError:  # an option of the command has that name
            continue
    options = parser.parse_args(words[1:])
    given = {name: getattr(options, f"parameter_{name}", None) for name in declared}
    for text in options.set:
        name, equals, value = text.partition("=")
        if not equals or name.strip() not in declared:
            raise ParameterError(
                f"--set: got {text!r}, wants NAME=VALUE, NAME one of {', '.join(declared)}"
            )
        given[name.strip()] = value
    options.duration_of_file, options.count_of_file = found.duration, found.times
    return options, found.system, {name: text for name, text in given.items() if text is not None}


def build(model: Any, given: Mapping[str, str]) -> tuple[Any, list[str]]:
    """Return the system, and the names of the parameters that are ranges."""
    units = {parameter.name: parameter.units for parameter in model.declared}
    units = {name: unit if unit in UNITS else "1" for name, unit in units.items()}
    of_class = isinstance(model, type)
    expected = inspect.signature(model).parameters.values() if of_class else ()
    missing = [f"--{p.name}" for p in expected if p.default is p.empty and p.name not in given]
    if missing:
        raise ParameterError(f"parameters: got none for {', '.join(missing)}, wants a value each")
    swept = [name for name, text in given.items() if is_range(text)]
    values = {
        name: span(name, text, units[name]) if name in swept else number(name, text, units[name])
        for name, text in given.items()
    }
    return (model if of_class else model.replace)(**values), swept


def build_one(model: Any, given: Mapping[str, str], hint: str = "") -> Any:
    """Return the system, no parameter of which is a range."""
    system, swept = build(model, given)
    if swept:
        raise ParameterError(f"--{swept[0]}: got a range, wants one value{hint}")
    return system


def states_of(system: Any) -> tuple[dict[str, str], dict[str, float]]:
    """Units of the states of a system by name, in their order, and where they begin."""
    law = system.own_equations
    if law is None:
        return {"phi": "rad", "dphi": "s-1"}, {}
    units = {name: law.units.get(name, "1") for name in law.states}
    units |= {name: "rad" for name in law.periods if units[name] == "1"}
    return units, dict(law.start)


def state_of(system: Any, text: str, argument: str) -> dict[str, float]:
    """The state that a user wrote: values in order, or NAME=VALUE, with commas between."""
    units, found = states_of(system)
    parts = [part.strip() for part in text.split(",") if part.strip()]
    wants = f"{','.join(name.upper() for name in units)} or NAME=VALUE,..."
    by_name = [part for part in parts if "=" in part]
    if by_name and len(by_name) < len(parts) or not by_name and len(parts) != len(units):
        raise ParameterError(f"{argument}: got {text!r}, wants {wants}")
    pairs = (part.split("=", 1) for part in parts) if by_name else zip(units, parts, strict=True)
    for name, value in pairs:
        if name.strip() not in units:
            raise unknown(f"{argument}: state", name.strip(), units)
        unit = units[name.strip()]
        found[name.strip()] = number(argument, value, unit if unit in UNITS else "1")
    missing = [name for name in units if name not in found]
    if missing:
        raise ParameterError(f"{argument}: got {text!r}, wants a value for {', '.join(missing)}")
    return {name: found[name] for name in units}


def _fitting(units: str) -> str:
    known = UNITS.get(units)
    return " or ".join(known) if known else f"a number{'' if known is not None else f' in {units}'}"


def add_window(parser: Parser) -> None:
    """Add the option that says where to look."""
    parser.add_argument(
        "--window",
        action="append",
        default=[],
        metavar="NAME=FROM:TO,...",
        help="the part of the space of states that is looked at, such as x=-2:2,y=0:1, in place of "
        "the window of FILE; pictures without either show where the motion from the start goes",
    )


def windowed(system: Any, options: Any, *, shown: bool = True) -> Any:
    """The equations of a file with a range for each state: as asked, or its own.

    Of what is only shown also that of its motion, which would prove nothing.
    """
    if not hasattr(system, "field"):
        if options.window:
            raise ParameterError("--window: got one, wants none for a system of its own window")
        return system
    given: dict[str, tuple[float, float]] = {}
    from phasekit.systems.problem_parts import in_window

    units, _ = states_of(system)
    for part in (part.strip() for text in options.window for part in text.split(",")):
        name, equals, reach = part.partition("=")
        if not equals or ":" not in reach:
            raise ParameterError(f"--window: got {part!r}, wants NAME=FROM:TO, such as x=-1:1")
        if name.strip() not in units:
            raise unknown("--window: state", name.strip(), units)
        if name.strip() in given:
            raise ParameterError(f"--window: got {name.strip()} twice, wants one range of each")
        given[name.strip()] = ends(f"--window {name.strip()}", reach, units[name.strip()])
    known = {**system.window, **given}
    why = "got no range of"
    missing = [n for n in system.state if n not in known and n not in system.periods]
    if shown and missing and set(system.start) >= set(system.state):
        from phasekit.explorer.explored import ranges_from_start

        try:
            known |= ranges_from_start(system, missing, None)
            missing = []
        except ParameterError:
            why = "the motion from the start has no end, which leaves none for"
    if missing:
        example = ",".join(f"{name}=-1:1" for name in missing)
        raise ParameterError(
            f"--window: {why} {', '.join(missing)}, wants one of each, such as --window {example}, "
            f"or a [window]{' or a [start] of all states' if shown else ''} in a .toml file"
        )
    return in_window(system, known)


def add_output(parser: Parser, name: str, what: str = "picture file") -> None:
    """Add the options that say where a picture is put."""
    parser.add_argument("--out", "--output", default=name, help=f"{what} (%(default)s)")
    parser.add_argument("--overwrite", action="store_true", help="replace an existing file")


def add_angles(parser: Parser) -> None:
    """Add the option that says in which unit axes show angles."""
    parser.add_argument("--angles", choices=("rad", "deg"), default="rad", help="unit of the axes")


def add_units(parser: Parser) -> None:
    """Add the options that say in which units a picture shows things."""
    add_angles(parser)
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
