"""The command line: ``phasekit`` and its commands, one module each.

What a command needs is imported when it runs, so that ``phasekit --version`` and ``--help`` answer
at once. Whatever a user can get wrong ends in one line that says what to do, and exit code 2.
"""

from __future__ import annotations

import argparse
import contextlib
import difflib
import importlib
import re
import signal
import sys
import warnings
from collections.abc import Iterator, Sequence
from typing import NoReturn

from phasekit.errors import InvalidCellsWarning, PhasekitError
from phasekit.version import __version__

COMMANDS = {
    "demo": "map a rotor; draw and store the map",
    "portrait": "draw the phase portrait of a system",
    "basins": "draw the basins of attraction of a damped system",
    "run-up": "run a disk up and draw its bearing forces",
    "diagram": "draw the equilibria against one parameter",
    "atlas": "draw all bifurcations of equilibria in two parameters",
    "flow": "follow a motion; draw it or write its numbers",
    "explore": "write the interactive page of a system and open it",
    "sweep": "compute the map that a TOML file describes, or resume it",
    "info": "describe a stored map and its progress, or what phasekit runs with",
    "warm": "compile beforehand what first calls would compile",
}


#: Exit code after Ctrl-C, as shells have it.
INTERRUPTED = 128 + 2


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        """End with exit code 2 and one line, which names an option that was probably meant."""
        _, _, given = message.partition("unrecognized arguments: ")
        options = self._option_string_actions
        near = difflib.get_close_matches(given.split(" ")[0].split("=")[0], options, n=1)
        more = f"did you mean {near[0]}? See" if near else "see"
        raise SystemExit(_complain(f"{message}; {more} {self.prog} --help"))


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : sequence of str, optional
        The arguments; those of the process if left out.

    Returns
    -------
    int
        Exit code: 0, 2 after an error that the user can mend, or 130 after Ctrl-C.

    Examples
    --------
    >>> main([])
    usage: phasekit [-h] [--version] COMMAND ...
    <BLANKLINE>
    ...
    0
    """
    parser = Parser(
        prog="phasekit",
        usage="%(prog)s [-h] [--version] COMMAND ...",
        description="Bifurcation and phase-space analysis of equations of motion.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="commands:\n"
        + "\n".join(f"  {name:<10}{text}" for name, text in COMMANDS.items())
        + "\n\nportrait, diagram, atlas, flow, explore and sweep take the file of a model "
        "(.toml, .ode):\n"
        "  phasekit portrait model.toml --I 0.5\n"
        "\nphasekit COMMAND --help says more.",
    )
    parser.add_argument("--version", action="version", version=f"phasekit {__version__}")
    parser.add_argument("command", nargs="?", help=argparse.SUPPRESS)
    parser.add_argument("rest", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    options = parser.parse_args(argv)
    if options.command is None:
        parser.print_help()
        return 0
    if options.command not in COMMANDS:
        parser.error(f"unknown command {options.command!r}; wants one of {', '.join(COMMANDS)}")
    try:
        command = importlib.import_module(f"phasekit.cli.{options.command.replace('-', '_')}")
        with warnings.catch_warnings(), _warnings_in_a_line():
            warnings.simplefilter("ignore", InvalidCellsWarning)  # commands say it in their words
            command.run(options.rest)
    except (PhasekitError, OSError) as error:
        # In a shell degrees are written another way.
        return _complain(re.sub(r"(if .* in degrees: )(\S+) \* pk\.deg", r"\1\2deg", str(error)))
    except KeyboardInterrupt as interrupt:
        if argv is None:  # what is left is to end the process: another Ctrl-C does so at once
            signal.signal(signal.SIGINT, signal.SIG_DFL)
        _complain(": ".join(("interrupted", *map(str, interrupt.args))))
        return INTERRUPTED
    return 0


@contextlib.contextmanager
def _warnings_in_a_line() -> Iterator[None]:
    """Say warnings as errors are said, without a line of the code in which they come up."""
    before = warnings.formatwarning
    warnings.formatwarning = lambda message, *_, **__: (
        f"phasekit: warning: {' '.join(str(message).split())}\n"
    )
    try:
        yield
    finally:
        warnings.formatwarning = before


def _complain(message: str) -> int:
    print(f"phasekit: {' '.join(message.split())}", file=sys.stderr)
    return 2
