"""All equilibria of a system of equations in a box, labelled."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from phasekit.bifurcation.enclosure import Enclosed, zeros_in_box
from phasekit.cells.schema import dataset_attrs
from phasekit.errors import FlowEquilibriumKind
from phasekit.labels.arguments import bad, reals, unknown, whole
from phasekit.labels.grid import LABEL_DTYPE, Grid, make_grid, variable
from phasekit.laws.formulas import symbols_of
from phasekit.numerics.waits import said, stage
from phasekit.phase.numerical.intervals import NoRule
from phasekit.systems.problem import Problem, as_problem

Array = npt.NDArray[np.float64]

#: Starts of Newton's method where f is code, of which nothing can be proved.
STARTS = 256
#: Operations of an iterate from which on it is searched, and nothing proved.
LONG = 2_000
#: Distance, in units of the box, within which two ends of it are one equilibrium.
SAME = 1e-8


def equilibria_in_box(system: Any, box: Any, n: Any = None) -> xr.Dataset:
    """All equilibria of a flow, or fixed points of a map's iterate; see `phasekit.equilibria`."""
    problem = as_problem(system, arrays=True)
    if n is not None and not problem.map:
        raise bad("n", n, "None for a flow")
    if problem.time is not None:
        hint = "pk.periodic_orbit finds its periodic motions"
        raise bad("system", problem, "a flow without forcing, which has equilibria", hint)
    grid = make_grid(problem.parameters)
    if grid.lazy:
        raise bad("parameters", "chunked arrays", "loaded ones: use .load()")
    if n is not None:
        times = whole("n", n, "a number of iterations >= 1")
        problem = problem.iterated(times)
    low, high = corners(problem, box)
    dims, shape = tuple(grid.sizes), tuple(grid.sizes.values())
    values = {name: grid.aligned(name, dims) for name in grid.inputs}
    found, reasons = [], []
    with said("looking for equilibria"):
        for k, cell in enumerate(np.ndindex(shape)):
            single: Problem | None = problem
            if dims:
                own = {
                    name: float(np.broadcast_to(array, shape)[cell])
                    for name, array in values.items()
                }
                valid = all(map(np.isfinite, own.values()))
                single = problem.replace(**own) if valid else None
                stage(f"{k + 1:,} of {int(np.prod(shape)):,} systems")
            one, why = _of_one(single, low, high)
            found.append(one)
            reasons += [why] if why else []
    if reasons:
        of = f" in {len(reasons)} of {len(found)} systems" if dims else ""
        warnings.warn(f"equilibria: there may be others than these{of}: {reasons[0]}", stacklevel=3)
    return _dataset(problem, grid, found, low, high)


class _Found(NamedTuple):
    """Equilibria of one system."""

    x: Array
    eigenvalues: npt.NDArray[np.complex128]
    n_unstable: npt.NDArray[np.int64]
    kind: npt.NDArray[np.int8]
    complete: bool


def _of_one(problem: Problem | None, low: Array, high: Array) -> tuple[_Found | None, str]:
    if problem is None:
        return None, ""
    enclosed, why = _enclosed(problem, low, high)
    n = len(problem.state)
    eigenvalues = np.empty((len(enclosed.zeros), n), complex)
    number = np.zeros(len(enclosed.zeros), np.int64)
    kind = np.zeros(len(enclosed.zeros), np.int8)
    for k, x in enumerate(enclosed.zeros):
        slopes = problem.derivatives(x)[1]
        error = 8.0 * np.finfo(float).eps if problem.kind == "symbolic" else 1e-9
        eigenvalues[k], number[k], kind[k] = kind_of(
            slopes, discrete=problem.map, conservative=problem.conservative, error=error
        )
    complete = bool(enclosed.complete and not why)
    return _Found(enclosed.zeros, eigenvalues, number, kind, complete), why


def kind_of(
    slopes: Array, *, discrete: bool, conservative: bool = False, error: float
) -> tuple[npt.NDArray[np.complex128], int, FlowEquilibriumKind]:
    """Eigenvalues, how many are unstable, and the kind of an equilibrium by its derivatives.

    The error is that of the derivatives, relative to their norm.
    """
    from scipy.linalg import eig

    if conservative and len(slopes) == 1:  # the force alone: x'' = f
        root = np.sqrt(complex(slopes[0, 0]))
        kind = FlowEquilibriumKind.SADDLE if root.real > 0.0 else FlowEquilibriumKind.CENTER
        flat = slopes[0, 0] == 0.0
        return (
            np.array([root]),
            int(root.real > 0.0),
            FlowEquilibriumKind.DEGENERATE if flat else kind,
        )
    if not np.isfinite(slopes).all():
        nothing = np.full(len(slopes), np.nan + 0j)
        return nothing, 0, FlowEquilibriumKind.NOT_COMPUTED
    found, left, right = eig(slopes, left=True, right=True)
    size = max(float(np.linalg.norm(slopes)), float(discrete))
    with np.errstate(all="ignore"):
        # How much an eigenvalue moves with the derivatives; of a double one by the root of that.
        bend = np.abs(np.einsum("ij,ij->j", left.conj(), right))
        doubt = np.minimum(error * size / bend, np.sqrt(error) * size)
    growth = np.abs(found) - 1.0 if discrete else found.real
    unstable = growth > doubt
    order = np.lexsort((-found.imag, -growth))
    found, growth, doubt, unstable = (x[order] for x in (found, growth, doubt, unstable))
    kinds, number = FlowEquilibriumKind, int(unstable.sum())
    nearest = int(np.argmin(np.abs(growth)))
    turns = abs(found[nearest].imag) > doubt[nearest]
    if conservative and not unstable.any():
        kind = kinds.CENTER if np.all(np.abs(found) > doubt) else kinds.DEGENERATE
    elif np.any(np.abs(growth) <= doubt) and not (conservative and unstable.any()):
        kind = kinds.DEGENERATE
    elif 0 < number < len(found):
        kind = kinds.SADDLE
    elif number:
        kind = kinds.UNSTABLE_FOCUS if turns else kinds.UNSTABLE_NODE
    else:
        kind = kinds.STABLE_FOCUS if turns else kinds.STABLE_NODE
    return found, number, kind


def _dataset(
    problem: Problem, grid: Grid, found: list[_Found | None], low: Array, high: Array
) -> xr.Dataset:
    """Results of all cells, filled up to the greatest number of equilibria."""
    dims, shape = tuple(grid.sizes), tuple(grid.sizes.values())
    names, most = list(problem.state), max((len(f.x) for f in found if f is not None), default=0)
    n = len(names)
    x, kind = np.full((len(found), most, n), np.nan), np.zeros((len(found), most), np.int8)
    eigenvalues = np.full((len(found), most, n), np.nan + 0j)
    unstable = np.zeros((len(found), most), np.int64)
    number, complete = np.full(len(found), -1, np.int64), np.zeros(len(found), bool)
    for k, one in enumerate(found):
        if one is None:
            continue
        part = slice(0, len(one.x))
        x[k, part], eigenvalues[k, part] = one.x, one.eigenvalues
        unstable[k, part], kind[k, part] = one.n_unstable, one.kind
        number[k], complete[k] = len(one.x), one.complete
    what = "fixed point" if problem.map else "equilibrium"
    codes = FlowEquilibriumKind
    flags = {
        "flag_values": np.array([code.value for code in codes], np.int8),
        "flag_meanings": " ".join(code.name.lower() for code in codes),
    }
    border = (
        "multipliers of a size above 1" if problem.map else "eigenvalues with positive real part"
    )
    places = (*dims, "equilibrium")
    table: dict[str, tuple[tuple[str, ...], Any, dict[str, Any]]] = {
        "x": ((*places, "state"), x, {"long_name": f"state of the {what}"}),
        "eigenvalue": (
            (*places, "eigenvalue_number"), eigenvalues,
            {"long_name": "eigenvalue of the derivatives of f, the least stable first"},
        ),
        "kind": (places, kind, {"long_name": f"kind of the {what}", **flags}),
        "n_unstable": (places, unstable, {"long_name": border}),
        "n_equilibria": (dims, number, {"long_name": f"number of {what}s"}),
        "complete": (
            dims, complete,
            {"long_name": "whether these are proved to be all in the box"},
        ),
    }  # fmt: skip
    data = {
        name: variable(on, array.reshape(shape + array.shape[1:]), attrs)
        for name, (on, array, attrs) in table.items()
    }
    coords = {
        **grid.coords,
        "equilibrium": variable(
            ("equilibrium",), np.arange(most), {"long_name": f"{what}, by its number"}
        ),
        "state": variable(("state",), np.array(names, LABEL_DTYPE)),
        **{name: given for name, given in grid.inputs.items() if name not in grid.coords},
        "box_low": variable(("state",), low),
        "box_high": variable(("state",), high),
    }
    return xr.Dataset(data, coords, dataset_attrs(problem))


def corners(problem: Problem, box: Any) -> tuple[Array, Array]:
    """The ends of the box, of angles one turn where they are left out."""
    given = {} if box is None else box
    if not isinstance(given, Mapping):
        raise bad("box", box, "a mapping from states to (low, high)")
    for name in given:
        if name not in problem.state:
            raise unknown("box: state", name, problem.state)
    given = {**problem.window, **given}
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
        why = f"f is code, so {STARTS} starts of Newton's method were tried, and nothing else"
        return Enclosed(_folded(problem, zeros), (nothing, nothing)), why
    symbols = symbols_of([*problem.state, *problem.parameters])
    states = [symbols[name] for name in problem.state]
    values = {symbols[name]: value for name, value in problem.parameters.items()}
    formulas = problem.f
    if problem.map:
        for _ in range(problem.times - 1):
            step = dict(zip(states, formulas, strict=True))
            formulas = tuple(f.subs(step, simultaneous=True) for f in problem.f)
            if sum(f.count_ops() for f in formulas) > LONG:
                zeros = _searched(problem, low, high)
                why = f"the iterate is long; {STARTS} starts of Newton's method were tried"
                return Enclosed(_folded(problem, zeros), (nothing, nothing)), why
        formulas = tuple(f - x for f, x in zip(formulas, states, strict=True))
    try:
        found = zeros_in_box(formulas, states, values, low, high)
    except NoRule as rule:
        zeros = _searched(problem, low, high)
        why = f"no bounds are known for {rule}; {STARTS} starts of Newton's method were tried"
        return Enclosed(_folded(problem, zeros), (nothing, nothing)), why
    why = ""
    if not found.complete:
        a, b = found.undecided[0].min(axis=0), found.undecided[1].max(axis=0)
        where = ", ".join(
            f"{name} in ({p:.6g}, {q:.6g})" for name, p, q in zip(problem.state, a, b, strict=True)
        )
        why = f"a multiple equilibrium, a pole or rounding leaves it undecided within {where}"
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
            end = root(lambda x: problem(x) - problem.map * x, start, options={"xtol": 1e-13})
            x = np.asarray(end.x, dtype=float)
            if not np.all((x >= low) & (x <= high)):
                continue
            f, slopes = problem.derivatives(x)
            if problem.map:
                f, slopes = f - x, slopes - np.eye(len(x))
            step = np.linalg.lstsq(slopes, f, rcond=None)[0]
        # The step that is left says how far the end is from a zero; the solver's word does not.
        if not np.all(np.abs(step) <= SAME * (high - low)):
            continue
        if all(np.any(np.abs(x - y) > SAME * (high - low)) for y in kept):
            kept.append(x)
    return np.array(sorted(kept, key=tuple)).reshape(-1, len(low))
