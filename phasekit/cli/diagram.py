"""``phasekit diagram``: draw the equilibria against one parameter."""

from __future__ import annotations

from collections.abc import Sequence

from phasekit.cli import Parser, common
from phasekit.errors import ParameterError


def run(argv: Sequence[str]) -> None:
    """Draw a bifurcation diagram into a file."""
    options, model, given = common.read_model(
        "diagram",
        "Draw the equilibria against one parameter, given as a range FROM:TO:COUNT, such as "
        "--beta 0:90deg:181.",
        argv,
        _options,
    )
    units = common.units_of(options.units)
    path = common.output_file(options.out, overwrite=options.overwrite)
    system, swept = common.build(model, given)
    if len(swept) != 1:
        found = f"the ranges {', '.join(swept)}" if swept else "no range"
        raise ParameterError(
            f"parameters: got {found}, wants exactly one FROM:TO:COUNT, such as 0:90deg:181"
        )
    common.quiet_backend()
    from phasekit import equilibria, plot

    ds = equilibria(system)
    if swept[0] not in ds["phi"].dims:
        raise ParameterError(
            f"--{swept[0]}: got a range, but {swept[0]} does not enter the equilibria; "
            "wants a range of a parameter that does"
        )
    axes = plot.bifurcation_diagram(ds, y=options.y, angles=options.angles, units=units)
    common.save(axes, path)
    common.say(str(system))
    common.say_invalid(ds)
    common.say(f"wrote {path}")


def _options(parser: Parser) -> None:
    parser.add_argument("--y", default="phi", help="quantity to draw (%(default)s)")
    common.add_units(parser)
    parser.add_argument("--out", default="diagram.png", help="picture file (%(default)s)")
    parser.add_argument("--overwrite", action="store_true", help="replace an existing file")
