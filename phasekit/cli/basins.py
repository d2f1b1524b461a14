"""``phasekit basins``: draw the basins of attraction of one damped system."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from phasekit.cli import Parser, common
from phasekit.cli.values import span
from phasekit.errors import ParameterError
from phasekit.labels.units import number


def run(argv: Sequence[str]) -> None:
    """Draw the basins of one system into a file."""
    options, model, given = common.read_model(
        "basins", "Draw the basins of attraction of one damped system.", argv, _options, files=False
    )
    path = common.output_file(options.out, overwrite=options.overwrite)
    system = common.build_one(model, given)
    units = {"damping": "s-1", "quadratic": "1", "torque": "s-2"}
    own: dict[str, Any] = {
        name: number(f"--{name}", getattr(options, name), unit) for name, unit in units.items()
    }
    grid: dict[str, Any] = {
        "phi": span("--phi", options.phi, "rad"),
        "dphi": span("--dphi", options.dphi, "s-1"),
    }
    common.quiet_backend()
    from phasekit import plot
    from phasekit.labelled.basins import basins
    from phasekit.systems.harmonic import Harmonic
    from phasekit.systems.perturbed import Perturbed

    drive = [Harmonic(*_harmonic(text)) for text in options.forcing]
    perturbed = Perturbed(system, **own, forcing=drive or None)
    ds = basins(perturbed, **grid)
    common.save(plot.basins(ds, angles=options.angles), path)
    lines = [repr(perturbed)]
    for i in range(ds.sizes["attractor"]):
        one = ds.isel(attractor=i)
        what = f"at phi = {one.attractor_phi.values[0]:.6g} rad"
        if one.attractor_period.item() == 0:
            what = "does not repeat itself"
        share, error = one.basin_fraction.item(), one.basin_fraction_error.item()
        lines.append(f"attractor {i}, {what}: {share:.4f} +- {error:.4f} of the states")
    for code, what in ((-1, "are undecided"), (-2, "run to infinity")):
        if (lost := int((ds.basin == code).sum())) > 0:
            lines.append(f"{lost} of {ds.basin.size} states {what}")
    common.say("\n".join([*lines, f"wrote {path}"]))


def _options(parser: Parser) -> None:
    group = parser.add_argument_group("damping and drive")
    group.add_argument("--damping", default="0", metavar="VALUE", help="linear damping, s-1")
    group.add_argument("--quadratic", default="0", metavar="VALUE", help="quadratic damping")
    group.add_argument("--torque", default="0", metavar="VALUE", help="constant torque, s-2")
    group.add_argument(
        "--forcing",
        action="append",
        default=[],
        metavar="AMPLITUDE,FREQUENCY[,PHASE]",
        help="harmonic torque in s-2, s-1 and rad; may be given several times",
    )
    parser.add_argument(
        "--phi", default="-180:180deg:201", metavar="FROM:TO:COUNT", help="angles (%(default)s)"
    )
    parser.add_argument(
        "--dphi", default="-3:3:201", metavar="FROM:TO:COUNT",
        help="angular velocities in s-1 (%(default)s)",
    )  # fmt: skip
    common.add_angles(parser)
    common.add_output(parser, "basins.png")


def _harmonic(text: str) -> list[float]:
    parts = text.split(",")
    if len(parts) not in (2, 3):
        wants = "AMPLITUDE,FREQUENCY or AMPLITUDE,FREQUENCY,PHASE, such as 0.2,1.5"
        raise ParameterError(f"--forcing: got {text!r}, wants {wants}")
    units = ("s-2", "s-1", "rad")[: len(parts)]
    return [number("--forcing", part, unit) for part, unit in zip(parts, units, strict=True)]
