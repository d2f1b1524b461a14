"""``phasekit flow``: follow a motion; draw it, or write its numbers."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from phasekit.cli import Parser, common
from phasekit.cli.values import LONGEST
from phasekit.errors import ParameterError
from phasekit.labels.units import number

#: Files of numbers.
TABLES = (".csv",)
#: Most states in one picture.
MOST = 8


def run(argv: Sequence[str]) -> None:
    """Follow one motion, or one for each value of a parameter."""
    options, model, given = common.read_model(
        "flow",
        "Follow the motion from a state; of a parameter's range FROM:TO:COUNT one each.",
        argv,
        _options,
    )
    units = common.units_of(options.units)
    suffixes = (*common.PICTURES, *TABLES)
    path = common.output_file(options.out, overwrite=options.overwrite, suffixes=suffixes)
    system, _ = common.build(model, given)
    names, start = common.states_of(system)
    if options.start is not None:
        start = common.state_of(system, options.start, "--start")
    missing = [name for name in names if name not in start]
    if missing:
        wants = ",".join(name.upper() for name in names)
        raise ParameterError(f"--start: got no {', '.join(missing)}, wants {wants}")
    times = _times(options, system)
    common.quiet_backend()
    from phasekit import flow, plot

    more: dict[str, Any] = {}
    if options.paths is not None:
        more = {"paths": options.paths, "seed": options.seed}
    elif options.seed is not None:
        raise ParameterError(f"--seed: got {options.seed}, wants nothing without --paths")
    if list(names) == ["phi", "dphi"] and not hasattr(system, "field"):
        ds = flow(system, start["phi"], start["dphi"], times, **more)
    else:
        ds = flow(system, start, t=times, **more)
    if path.suffix.lower() in TABLES:
        _write(ds, path)
    else:
        drawn = [str(v)[7:] for v in ds.data_vars if str(v).startswith("motion_")][:MOST]
        shown = options.y.split(",") if options.y else drawn
        figure = _draw(plot, ds, [f"motion_{name.strip()}" for name in shown], options, units)
        common.save(figure, path)
    common.say(f"{system}\nwrote {path}")


def _times(options: Any, system: Any) -> Any:
    import numpy as np

    discrete = bool(getattr(system, "map", False))
    last = getattr(options, "duration_of_file", None)
    if options.to is not None:
        last = number("--to", options.to, "1" if discrete else "s")
    if last is None:
        raise ParameterError("--to: got nothing, wants the time at the end")
    if discrete:
        if not 0 <= last <= LONGEST or last != int(last):
            raise ParameterError(f"--to: got {last!r}, wants a number of iterations >= 0")
        return np.arange(int(last) + 1)
    count = options.count or getattr(options, "count_of_file", None) or 1001
    if not 2 <= count <= LONGEST:
        raise ParameterError(f"--count: got {count}, wants a whole number from 2 to {LONGEST}")
    return np.linspace(0.0, last, count)


def _draw(plot: Any, ds: Any, shown: Sequence[str], options: Any, units: Any) -> Any:
    """One picture over the other, of one time."""
    import matplotlib.pyplot as plt

    size = (6.4, 1.2 + 1.5 * len(shown))
    figure, axes = plt.subplots(len(shown), sharex=True, squeeze=False, figsize=size)
    for k, (name, ax) in enumerate(zip(shown, axes[:, 0], strict=True)):
        last = k == len(shown) - 1
        plot.time_history(ds, name, angles=options.angles, units=units, legend=last, ax=ax)
        if not last:
            ax.set_xlabel("")
    return figure


def _write(ds: Any, path: Path) -> None:
    """Numbers of the motion, a line a time: written whole or not at all."""
    drawn = [str(name) for name in ds.data_vars if "time" in ds[name].dims]
    frame = ds[drawn].to_dataframe().reset_index()
    columns = [*(str(name) for name in ds.dims if name != "time"), "time", *drawn]
    part = path.with_name(f".phasekit-{os.getpid()}.part")
    try:
        frame[columns].to_csv(part, index=False)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def _options(parser: Parser) -> None:
    group = parser.add_argument_group("the motion")
    group.add_argument(
        "--start", metavar="STATE", help="values in order, or NAME=VALUE, with commas between"
    )
    group.add_argument("--to", metavar="TIME", help="time at the end; of a map the iterations")
    group.add_argument("--count", type=int, help="how many times (1001)")
    group.add_argument("--paths", type=int, help="how many paths, of a system with noise")
    group.add_argument("--seed", type=int, help="of their random numbers")
    parser.add_argument("--y", metavar="NAME,...", help="what to draw (all states)")
    common.add_units(parser)
    common.add_output(parser, "motion.png", "picture, or .csv for numbers")
