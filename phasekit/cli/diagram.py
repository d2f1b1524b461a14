"""``phasekit diagram``: draw the equilibria against one parameter."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

from phasekit.cli import Parser, common
from phasekit.cli.values import ends
from phasekit.errors import ParameterError


def run(argv: Sequence[str]) -> None:
    """Draw a bifurcation diagram into a file."""
    options, model, given = common.read_model(
        "diagram",
        "Draw the equilibria against one parameter, given as a range FROM:TO:COUNT, such as "
        "--beta 0:90deg:181, or, of equations from a file, as FROM:TO.",
        argv,
        _options,
    )
    units = common.units_of(options.units)
    path = common.output_file(options.out, overwrite=options.overwrite)
    if hasattr(model, "field"):  # equations: branches are followed
        _branches(options, model, given, units, path)
        return
    if options.cycles:
        raise ParameterError("--cycles: got it for a system in a potential, wants equations")
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
    axes = plot.bifurcation_diagram(ds, y=options.y or "phi", angles=options.angles, units=units)
    common.save(axes, path)
    common.say(str(system))
    common.say_invalid(ds)
    common.say(f"wrote {path}")


def _branches(
    options: Any, model: Any, given: Mapping[str, str], units: Mapping[str, str], path: Any
) -> None:
    """The branches of equations along one parameter, and of cycles where they begin."""
    ranges = [name for name, text in given.items() if ":" in text]
    if len(ranges) != 1:
        found = f"the ranges {', '.join(ranges)}" if ranges else "no range"
        raise ParameterError(f"parameters: got {found}, wants exactly one FROM:TO, such as 0:2")
    (name,) = ranges
    unit = next(p.units for p in model.declared if p.name == name)
    span = ends(f"--{name}", given[name], unit)
    problem, _ = common.build(model, {key: x for key, x in given.items() if key != name})
    own = problem.parameters[name]
    if not span[0] <= own <= span[1]:
        problem = problem.replace(**{name: span[0]})
    if options.window:
        problem = common.windowed(problem, options)
    common.quiet_backend()
    from phasekit import diagram, equilibria, plot

    starts = None
    if set(problem.window) == set(problem.state) and problem.time is None:
        found = equilibria(problem).x.values
        starts = found if len(found) else None
    elif problem.start:
        starts = [[problem.start.get(state, 0.0) for state in problem.state]]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", RuntimeWarning)
        branches: list[Any] = list(
            diagram(problem, name, x0=starts, span=span, cycles=options.cycles)
        )
    lines = [repr(problem)]
    for branch in branches:
        for point in branch.special_points:
            if point.kind == "end":
                continue
            where = f"{name} = {point.parameters[name]:.8g}"
            if branch.kind == "equilibrium":
                x = zip(problem.state, point.x, strict=True)
                where += ": " + ", ".join(f"{k} = {v:.8g}" for k, v in x)
            lines.append(f"{point.label} at {where}")
    lines += [str(one.message) for one in caught]
    more: dict[str, Any] = {"units": units} if units else {}
    more |= {"y": options.y} if options.y else {}
    common.save(plot.bifurcation_diagram(branches, angles=options.angles, **more), path)
    common.say("\n".join([*lines, f"wrote {path}"]))


def _options(parser: Parser) -> None:
    common.add_window(parser)
    parser.add_argument("--y", help="quantity or state to draw (by default the first)")
    parser.add_argument(
        "--cycles",
        action="store_true",
        help="of equations: periodic orbits from Hopf points and their doublings as well",
    )
    common.add_units(parser)
    common.add_output(parser, "diagram.png")
