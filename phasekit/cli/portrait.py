"""``phasekit portrait``: draw the phase portrait of one system."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from phasekit.cli import Parser, common


def run(argv: Sequence[str]) -> None:
    """Draw one system's portrait into a file."""
    options, model, given = common.read_model(
        "portrait", "Draw the phase portrait of one system.", argv, _options
    )
    units = common.units_of(options.units)
    path = common.output_file(options.out, overwrite=options.overwrite)
    system = common.build_one(model, given, "; phasekit diagram draws ranges")
    orbits = [tuple(common.state_of(system, text, "--orbit").values()) for text in options.orbit]
    common.quiet_backend()
    from phasekit import plot

    draw: Any = plot.potential_well if options.well else plot.phase_portrait
    shown = {"units": units} if units else {}
    drawn = draw(system, orbits=orbits, angles=options.angles, **shown)
    common.save(drawn[0] if isinstance(drawn, tuple) else drawn, path)
    common.say(f"{system}\nwrote {path}")


def _options(parser: Parser) -> None:
    parser.add_argument(
        "--orbit",
        action="append",
        default=[],
        metavar="STATE",
        help="draw the orbit from this state, the angle and angular velocity such as 45deg,15deg/s "
        "or the states of FILE in their order; may be given several times",
    )
    parser.add_argument("--well", action="store_true", help="draw the potential over the portrait")
    common.add_units(parser)
    common.add_output(parser, "portrait.png")
