"""``phasekit portrait``: draw the phase portrait of one system."""

from __future__ import annotations

from collections.abc import Sequence

from phasekit.cli import Parser, common
from phasekit.cli.values import number
from phasekit.errors import ParameterError


def run(argv: Sequence[str]) -> None:
    """Draw one system's portrait into a file."""
    options, model, given = common.read_model(
        "portrait", "Draw the phase portrait of one system.", argv, _options
    )
    units = common.units_of(options.units)
    path = common.output_file(options.out, overwrite=options.overwrite)
    system, swept = common.build(model, given)
    if swept:
        raise ParameterError(
            f"--{swept[0]}: got a range, wants one value; phasekit diagram draws ranges"
        )
    orbits = [_orbit(text) for text in options.orbit]
    common.quiet_backend()
    from phasekit import plot

    draw = plot.potential_well if options.well else plot.phase_portrait
    drawn = draw(system, orbits=orbits, angles=options.angles, units=units)
    common.save(drawn[0] if isinstance(drawn, tuple) else drawn, path)
    common.say(f"{system}\nwrote {path}")


def _options(parser: Parser) -> None:
    parser.add_argument(
        "--orbit",
        action="append",
        default=[],
        metavar="PHI,DPHI",
        help="draw the orbit from this angle and angular velocity, such as 45deg,15deg/s; may be "
        "given several times",
    )
    parser.add_argument("--well", action="store_true", help="draw the potential over the portrait")
    common.add_units(parser)
    parser.add_argument("--out", default="portrait.png", help="picture file (%(default)s)")
    parser.add_argument("--overwrite", action="store_true", help="replace an existing file")


def _orbit(text: str) -> tuple[float, float]:
    phi, comma, dphi = text.partition(",")
    if not comma:
        raise ParameterError(f"--orbit: got {text!r}, wants PHI,DPHI, such as 45deg,15deg/s")
    return number("--orbit", phi, "rad"), number("--orbit", dphi, "s-1")
