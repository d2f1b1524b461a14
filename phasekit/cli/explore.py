"""``phasekit explore``: write the page of one system, and open it in a browser."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from phasekit.cli import Parser, common
from phasekit.cli.values import ends, glue_negative_values
from phasekit.errors import ParameterError
from phasekit.labels.units import number

#: What is shown where no parameter is given: the rotor of the demo, with mass and bearings.
EXAMPLE = {
    "beta": "40deg",
    "e": "50mm",
    "a": "24mm",
    "r": "200mm",
    "omega1": "300rpm",
    "m": "2kg",
    "half_span": "150mm",
}


def run(argv: Sequence[str]) -> None:
    """Write the page into a file, and open it."""
    if any(word.split("=")[0] == "--potential" for word in argv):
        options, system = _potential(argv)
    else:
        options, system = _model(argv)
    path = _target(options)
    from phasekit.explorer.explore import explore

    page = explore(system, **_shown(options))
    path = page.save(path or Path(tempfile.mkdtemp(prefix="phasekit-")) / "explorer.html")
    common.say(f"{system}\nwrote {path}")
    if not options.no_open:
        _open(path.resolve())


def _shown(options: Any) -> dict[str, Any]:
    """What the page of equations is asked for."""
    found: dict[str, Any] = {}
    duration = getattr(options, "duration_of_file", None)
    if duration is not None:
        found["duration"] = duration
    if getattr(options, "over", None):
        found["over"] = [tuple(name.strip() for name in pair.split(",")) for pair in options.over]
    if getattr(options, "range", None):
        found["ranges"] = {}
        for text in options.range:
            name, equals, reach = text.partition("=")
            if not equals or ":" not in reach:
                raise ParameterError(f"--range: got {text!r}, wants NAME=FROM:TO, such as I=0:2")
            found["ranges"][name.strip()] = ends(f"--range {name}", reach, "1")
    return found


def _model(argv: Sequence[str]) -> tuple[Any, Any]:
    options, model, given = common.read_model(
        "explore",
        "Write a page with phase portrait, diagrams and a map over two parameters of one system, "
        "with a slider for every parameter, and open it in a browser. Without "
        "parameters it shows a disk. --potential FORMULA shows any potential; see phasekit explore "
        "--potential x --help.",
        argv,
        _model_options,
    )
    of_class = isinstance(model, type)
    if of_class and not given and EXAMPLE.keys() <= {p.name for p in model.declared}:
        given = EXAMPLE
    system = common.build_one(model, given, "; the page has sliders")
    system = common.windowed(system, options)
    return options, system


def _model_options(parser: Parser) -> None:
    common.add_window(parser)
    _options(parser)
    parser.add_argument(
        "--over",
        action="append",
        metavar="NAME,NAME",
        help="two parameters of a file of equations, over which curves of bifurcations are "
        "computed; may be given several times",
    )
    parser.add_argument(
        "--range",
        action="append",
        metavar="NAME=FROM:TO",
        help="the range of a slider of a file of equations; may be given several times",
    )


def _options(parser: Parser) -> None:
    parser.add_argument(
        "--output", "--out", metavar="FILE", help="the page, .html; by default a temporary file"
    )
    parser.add_argument("--no-open", action="store_true", help="do not open it in a browser")
    parser.add_argument("--overwrite", action="store_true", help="replace an existing file")


def _potential(argv: Sequence[str]) -> tuple[Any, Any]:
    parser = Parser(
        prog="phasekit explore", description="The page of any potential.", allow_abbrev=False
    )
    parser.add_argument("--potential", metavar="FORMULA", help="such as 'x^4/4 - mu*x^2/2'")
    parser.add_argument("--coordinate", default="x", help="its coordinate (%(default)s)")
    parser.add_argument(
        "--parameter", action="append", default=[], metavar="NAME=VALUE", help="any number of times"
    )
    parser.add_argument("--period", help="length of the circle, a number or such as 2*pi")
    parser.add_argument("--interval", metavar="LOW:HIGH", help="the part of the line looked at")
    _options(parser)
    options = parser.parse_args(glue_negative_values(list(argv)))
    from phasekit.systems.potential import Potential

    values = {}
    for text in options.parameter:
        name, equals, value = text.partition("=")
        if not equals:
            raise ParameterError(f"--parameter: got {text!r}, wants NAME=VALUE, such as mu=1.5")
        values[name.strip()] = number(f"--parameter {name}", value, "1")
    interval = None
    if options.interval is not None:
        ends = options.interval.split(":")
        if len(ends) != 2:
            raise ParameterError(f"--interval: got {options.interval!r}, wants LOW:HIGH")
        interval = [number("--interval", end, "1") for end in ends]
    system = Potential(
        options.potential, options.coordinate, values, options.period, interval=interval
    )
    return options, system


def _target(options: Any) -> Path | None:
    """Refuse what cannot be written before any work."""
    if options.output is None:
        return None
    return common.output_file(
        options.output, overwrite=options.overwrite, suffixes=(".html", ".htm"), argument="--output"
    )


def _open(path: Path) -> None:
    import webbrowser

    try:
        opened = webbrowser.open(path.as_uri())
    except webbrowser.Error:
        opened = False
    if not opened:
        common.say(f"no browser was found; open {path.as_uri()}")
