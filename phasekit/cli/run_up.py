"""``phasekit run-up``: run a disk up and draw its bearing forces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from phasekit.cli import Parser, common
from phasekit.errors import ParameterError
from phasekit.labels.units import number


def run(argv: Sequence[str]) -> None:
    """Draw the run-up of one disk into a file."""
    options, model, given = common.read_model(
        "run-up",
        "Run a disk up from --omega1 to --to with a constant acceleration.",
        argv,
        _options,
        files=False,
    )
    path = common.output_file(options.out, overwrite=options.overwrite)
    for name in ("m", "half_span"):
        if name not in given:
            raise ParameterError(f"--{name}: got nothing, wants a value for the bearing forces")
    system: Any
    system = common.build_one(model, given)
    if options.to is None:
        raise ParameterError("--to: got nothing, wants the angular velocity at the end")
    last = number("--to", options.to, "s-1")
    duration = number("--duration", options.duration, "s")
    if not duration > 0.0:
        raise ParameterError(f"--duration: got {options.duration!r}, wants a time > 0")
    damping = number("--damping", options.damping, "s-1")
    states = number("--phi0", options.phi0, "rad"), number("--dphi0", options.dphi0, "s-1")
    common.quiet_backend()
    import numpy as np

    from phasekit import plot
    from phasekit.labelled.run_up import run_up

    first = system.omega1
    ds = run_up(
        system,
        omega1=lambda t: first + (last - first) * t / duration,
        phi0=states[0],
        dphi0=states[1],
        t=np.linspace(0.0, duration, 4001),
        damping=damping,
    )
    common.save(plot.run_up(ds), path)
    lines = [repr(system)]
    for bearing in ds.bearing.values:
        force = ds.force_magnitude.sel(bearing=bearing)
        place = ds.isel(time=int(np.argmax(force.values)))
        lines.append(
            f"bearing {bearing}: at most {force.max().item():.6g} N, at t = "
            f"{place.time.item():.5g} s and omega1 = {place.motion_omega1.item():.5g} rad/s"
        )
    common.say("\n".join([*lines, f"wrote {path}"]))


def _options(parser: Parser) -> None:
    group = parser.add_argument_group("the run-up")
    group.add_argument("--to", metavar="VALUE", help="angular velocity at the end, s-1")
    group.add_argument(
        "--duration", default="10", metavar="VALUE", help="time that it takes, s (%(default)s)"
    )
    group.add_argument("--damping", default="0", metavar="VALUE", help="linear damping, s-1")
    group.add_argument("--phi0", default="0", metavar="VALUE", help="angle at the start, rad")
    group.add_argument("--dphi0", default="0", metavar="VALUE", help="its rate, s-1")
    common.add_output(parser, "run_up.png")
