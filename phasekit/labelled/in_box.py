"""All equilibria of a system of equations in a box, labelled."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from phasekit.bifurcation.enclosure import Enclosed, zeros_in_box
from phasekit.labels.arguments import bad, reals, unknown
from phasekit.labels.grid import LABEL_DTYPE, variable
from phasekit.laws.formulas import symbols_of
from phasekit.phase.numerical.intervals import NoRule
from phasekit.systems.problem import Problem

Array = npt.NDArray[np.float64]

#: Starts of Newton's method where f is code, of which nothing can be proved.
STARTS = 256
#: Distance, in units of the box, within which two ends of it are one equilibrium.
SAME = 1e-8


def equilibria_in_box(problem: Problem, box: Any) -> xr.Dataset:
    """All equilibria of a problem in a box of its states; see `phasekit.equilibria`."""
    if problem.map:
        raise bad(
            "problem", problem, "a flow x' = f(x)",
            "fixed points of a map x -> f(x) are the equilibria of x' = f(x) - x",
        )  # fmt: skip
    low, high = _corners(problem, box)
    names = list(problem.state)
    found, why = _enclosed(problem, low, high)
    if why:
        warnings.warn(f"equilibria: there may be others than these: {why}", stacklevel=3)
    eigenvalues = np.array([np.linalg.eigvals(problem.derivatives(x)[1]) for x in found.zeros])
    eigenvalues = eigenvalues.reshape(-1, len(names)).astype(complex)
    n_unstable = np.sum(eigenvalues.real > 0.0, axis=1).astype(np.int64)
    count = len(found.zeros)
    ds = xr.Dataset(
        {
            "x": variable(("equilibrium", "state"), found.zeros, {"long_name": "state"}),
            "eigenvalue": variable(
                ("equilibrium", "eigenvalue_number"), eigenvalues,
                {"long_name": "eigenvalue of the derivatives of f"},
            ),
            "n_unstable": variable(
                ("equilibrium",), n_unstable, {"long_name": "eigenvalues with positive real part"}
            ),
            "n_equilibria": variable((), np.int64(count), {"long_name": "number of equilibria"}),
            "complete": variable(
                (), np.bool_(found.complete and not why),
                {"long_name": "whether it is proved that the box holds these and no others"},
            ),
        },
        coords={
            "equilibrium": variable(("equilibrium",), np.arange(count)),
            "state": variable(("state",), np.array(names, LABEL_DTYPE)),
            **{name: variable((), value) for name, value in problem.parameters.items()},
            "box_low": variable(("state",), low),
            "box_high": variable(("state",), high),
        },
    )  # fmt: skip
    return ds


def _corners(problem: Problem, box: Any) -> tuple[Array, Array]:
    """The ends of the box, of angles one turn where they are left out."""
    given = {} if box is None else box
    if not isinstance(given, Mapping):
        raise bad("box", box, "a mapping from states to (low, high)")
    for name in given:
        if name not in problem.state:
            raise unknown("box: state", name, problem.state)
    ends = []
    for name in problem.state:
        if name in given:
            wants = "two finite numbers, low < high"
            pair = reals(f"box[{name!r}]", given[name], wants)
            if pair.shape != (2,) or not np.all(np.isfinite(pair)) or not pair[0] < pair[1]:
                raise bad(f"box[{name!r}]", given[name], wants)
            ends.append(pair)
        elif name in problem.periods:
            # A little more than a turn: what lies on its ends is found there, and kept once.
            half = 0.5 * problem.periods[name] * (1.0 + 1e-9)
            ends.append(np.array([-half, half]))
        else:
            raise bad("box", box, f"(low, high) of every state; {name!r} has none")
    low, high = np.array(ends).T
    return low, high


def _enclosed(problem: Problem, low: Array, high: Array) -> tuple[Enclosed, str]:
    """Zeros in the box, and why there may be others."""
    nothing = np.empty((0, len(low)))
    if problem.kind != "symbolic":
        zeros = _searched(problem, low, high)
        why = f"f is code, so {STARTS} starts of Newton's method were all that could be tried"
        return Enclosed(_folded(problem, zeros), (nothing, nothing)), why
    symbols = symbols_of([*problem.state, *problem.parameters])
    states = [symbols[name] for name in problem.state]
    values = {symbols[name]: value for name, value in problem.parameters.items()}
    try:
        found = zeros_in_box(problem.f, states, values, low, high)
    except NoRule as rule:
        zeros = _searched(problem, low, high)
        why = f"no bounds are known of {rule}; {STARTS} starts of Newton's method were tried"
        return Enclosed(_folded(problem, zeros), (nothing, nothing)), why
    why = ""
    if not found.complete:
        a, b = found.undecided[0].min(axis=0), found.undecided[1].max(axis=0)
        where = ", ".join(
            f"{name} in ({p:.6g}, {q:.6g})" for name, p, q in zip(problem.state, a, b, strict=True)
        )
        why = f"a multiple one, a pole or too much rounding leaves it open within {where}"
    return found._replace(zeros=_folded(problem, found.zeros)), why


def _folded(problem: Problem, zeros: Array) -> Array:
    """Each equilibrium once, where angles that differ by a turn are the same."""
    kept: list[Array] = []
    turns = np.array([problem.periods.get(name, 0.0) for name in problem.state])
    whole = np.where(turns > 0.0, turns, 1.0)
    for x in zeros:
        apart = [x - y for y in kept]
        apart = [d - turns * np.rint(d / whole) for d in apart]
        size = 1e-12 * np.maximum(np.abs(x), turns)
        if not any(np.all(np.abs(d) <= size) for d in apart):
            kept.append(x)
    return np.array(kept).reshape(-1, zeros.shape[1])


def _searched(problem: Problem, low: Array, high: Array) -> Array:
    """Ends of Newton's method from starts that fill the box evenly."""
    from scipy.optimize import root
    from scipy.stats import qmc

    starts = qmc.Sobol(len(low), seed=0).random(STARTS)
    kept: list[Array] = []
    for start in low + starts * (high - low):
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            end = root(problem, start, method="hybr", options={"xtol": 1e-13})
            x = np.asarray(end.x, dtype=float)
            if not np.all((x >= low) & (x <= high)):
                continue
            f, slopes = problem.derivatives(x)
            step = np.linalg.lstsq(slopes, f, rcond=None)[0]
        # The step that is left says how far the end is from a zero; the solver's word does not.
        if not np.all(np.abs(step) <= SAME * (high - low)):
            continue
        if all(np.any(np.abs(x - y) > SAME * (high - low)) for y in kept):
            kept.append(x)
    return np.array(sorted(kept, key=tuple)).reshape(-1, len(low))
