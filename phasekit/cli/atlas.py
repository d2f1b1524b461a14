"""``phasekit atlas``: draw all bifurcations of equilibria in two parameters, and of cycles."""

from __future__ import annotations

import warnings
from collections.abc import Sequence

from phasekit.cli import Parser, common
from phasekit.cli.values import ends
from phasekit.errors import ParameterError


def run(argv: Sequence[str]) -> None:
    """Draw an atlas into a file, and say what it holds."""
    options, model, given = common.read_model(
        "atlas",
        "Draw all curves of folds, Hopf points and branch points over two parameters, each given "
        "as FROM:TO, and print the points of codimension two and the regions.",
        argv,
        _options,
    )
    units = common.units_of(options.units)
    path = common.output_file(options.out, overwrite=options.overwrite)
    ranges = [name for name, text in given.items() if ":" in text]
    if len(ranges) != 2:
        found = f"the ranges {', '.join(ranges)}" if ranges else "no range"
        raise ParameterError(f"parameters: got {found}, wants exactly two FROM:TO, such as 0:2")
    declared = {p.name: p.units for p in model.declared}
    span = {name: ends(f"--{name}", given[name], declared[name]) for name in ranges}
    middles = {name: repr(0.5 * (low + high)) for name, (low, high) in span.items()}
    system, _ = common.build(model, {**given, **middles})
    system = common.windowed(system, options, shown=False)
    common.quiet_backend()
    from phasekit import atlas, plot

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # it is printed with the rest
        made = atlas(system, *ranges, span=span, cycles=options.cycles)
    common.save(plot.atlas(made, angles=options.angles, units=units), path)
    common.say(f"{system!r}\n{made!r}\nwrote {path}")


def _options(parser: Parser) -> None:
    common.add_window(parser)
    common.add_units(parser)
    parser.add_argument("--cycles", action="store_true", help="follow curves of cycles, too")
    common.add_output(parser, "atlas.png")
