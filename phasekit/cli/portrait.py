"""``phasekit portrait``: draw the phase portrait of one system."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from phasekit.cli import Parser, common
from phasekit.errors import ParameterError


def run(argv: Sequence[str]) -> None:
    """Draw one system's portrait into a file."""
    options, model, given = common.read_model(
        "portrait", "Draw the phase portrait of one system.", argv, _options
    )
    units = common.units_of(options.units)
    path = common.output_file(options.out, overwrite=options.overwrite)
    system = common.build_one(model, given, "; phasekit diagram draws ranges")
    system = common.windowed(system, options)
    if system.own_equations is not None and len(system.own_equations.states) < 2:
        raise ParameterError(
            f"FILE: got {system.own_equations.states[0]} alone, wants two states or more; phasekit "
            "diagram, flow and explore show one"
        )
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
    common.add_window(parser)
    common.add_units(parser)
    common.add_output(parser, "portrait.png")
