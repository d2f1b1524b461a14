"""``phasekit info STORE``: what a stored map is, how complete, and how large."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from phasekit.cli import Parser, common


def run(argv: Sequence[str]) -> None:
    """Describe a stored map."""
    parser = Parser(
        prog="phasekit info",
        description="Say what a stored map is, how complete, how large, and what is left to do.",
    )
    parser.add_argument("store", metavar="STORE", help="a map: a folder, a file or a URL")
    parser.add_argument(
        "--verify",
        action="store_true",
        help="read all files and compare their checksums; damage is named, and the exit code is 2",
    )
    common.add_shown_units(parser)
    options = parser.parse_args(argv)
    units = common.units_of(options.units)
    if "://" not in options.store:
        common.path_called("STORE", options.store)
    from phasekit.labelled.info import map_info

    found = replace(map_info(options.store, verify=options.verify), units=units)
    common.say(str(found))
    if options.verify:
        common.say(found.verdict)
