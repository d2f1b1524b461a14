"""``phasekit warm``: compile beforehand, for images and nodes."""

from __future__ import annotations

import time
from collections.abc import Sequence

from phasekit.cli import Parser, common


def run(argv: Sequence[str]) -> None:
    """Compile what first calls need."""
    parser = Parser(
        prog="phasekit warm",
        description="Compile beforehand what first calls would compile, once on this machine.",
    )
    parser.add_argument(
        "subjects", metavar="SUBJECT", nargs="*",
        help="equilibria, motions, perturbed, branches or cycles; all of them if left out",
    )  # fmt: skip
    options = parser.parse_args(argv)
    from phasekit.labelled.warm import warm

    began = time.perf_counter()
    found = warm(options.subjects or None)
    place = f"kept in {found.folder}" if found.folder else "kept nowhere: no folder can be written"
    common.say(
        f"{found.kernels} kernels are compiled ({time.perf_counter() - began:.0f} s), {place}"
    )
