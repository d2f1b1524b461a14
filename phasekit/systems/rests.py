"""Equilibria of problems in a box: all of them, proved by intervals where f is a formula."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import FlowEquilibriumKind, ParameterError
from phasekit.labels.arguments import bad, reals, unknown
from phasekit.laws.formulas import symbols_of
from phasekit.laws.ladder import Conservative, Routhian
from phasekit.numerics.balance import balanced
from phasekit.numerics.intervals.program import NoRule
from phasekit.numerics.intervals.zeros import Zeros, zeros_of_cells
from phasekit.systems.problem import Problem
from phasekit.systems.rounding import refuse_rounding_at
from phasekit.systems.smooth import jumping_formula, refuse_jump_at, refuse_steep_at
from phasekit.systems.system import System

#: Starts of Newton's method where f is code, of which nothing can be proved.
STARTS = 256
#: Operations of an iterate from which on it is searched, and nothing proved.
LONG = 2_000
#: Places along a coordinate at which its force is asked for.
PLACES = 513
#: Distance, in units of the box, within which two ends of it are one equilibrium.
SAME = 1e-8


class Equilibria(NamedTuple):
    """Equilibria of one system in a box."""

    x: Array
    eigenvalues: npt.NDArray[np.complex128]
    n_unstable: npt.NDArray[np.int64]
    kind: npt.NDArray[np.int8]
    complete: bool
    why: str
    """Why there may be others."""


def equilibria_of(problem: Problem, low: Array, high: Array) -> Equilibria:
    """Equilibria of a flow, or fixed points of a map, between corners of a box."""
    return equilibria_of_cells([problem], low, high)[0]


def equilibria_of_cells(problems: Sequence[Problem], low: Array, high: Array) -> list[Equilibria]:
    """The same of problems that differ in the values of their parameters alone."""
    found = states_of_cells(problems, low, high)
    if not found:
        return []
    for one, (zeros, _) in zip(problems, found, strict=True):
        for x in zeros:
            refuse_jump_at(one, x)
    first, ends = problems[0], np.cumsum([len(x) for x, _ in found])[:-1]
    slopes = [
        one.derivatives(x)[1]
        for one, (zeros, _) in zip(problems, found, strict=True)
        for x in zeros
    ]
    places = [(one, x) for one, (zeros, _) in zip(problems, found, strict=True) for x in zeros]
    for (one, x), slope in zip(places, slopes, strict=True):
        refuse_rounding_at(one, x, slope, SAME * (high - low), high - low)
        refuse_steep_at(one, x, slope, SAME * (high - low))
    kinds = kinds_of(
        np.array(slopes).reshape(-1, len(first.state), len(first.state)),
        discrete=first.map,
        conservative=first.conservative,
        error=8.0 * np.finfo(float).eps if first.kind == "symbolic" else 1e-9,
    )
    each = zip(found, *(np.split(values, ends) for values in kinds), strict=True)
    return [
        Equilibria(x, values, unstable, kind, not why, why)
        for (x, why), values, unstable, kind in each
    ]


def states_of_cells(
    problems: Sequence[Problem], low: Array, high: Array
) -> list[tuple[Array, str]]:
    """Where the equilibria of each are, and why there may be others; nothing else of them."""
    if problems and (formula := jumping_formula(problems[0])):
        none = np.empty((0, len(low))), f"f jumps, in {formula}, so they are not looked for"
        return [none] * len(problems)
    found = _enclosed(problems, low, high) if problems else []
    return [(_folded(one, x), why) for one, (x, why) in zip(problems, found, strict=True)]


def kind_of(
    slopes: Array, *, discrete: bool, conservative: bool = False, error: float
) -> tuple[npt.NDArray[np.complex128], int, FlowEquilibriumKind]:
    """What `kinds_of` finds, of one equilibrium."""
    found, number, kind = kinds_of(
        slopes[None], discrete=discrete, conservative=conservative, error=error
    )
    return found[0], int(number[0]), FlowEquilibriumKind(int(kind[0]))


def kinds_of(
    slopes: Array, *, discrete: bool, conservative: bool = False, error: float
) -> tuple[npt.NDArray[np.complex128], npt.NDArray[np.int64], npt.NDArray[np.int8]]:
    """Eigenvalues, how many are unstable, and the kinds of equilibria by their derivatives.

    The error is that of the derivatives, relative to their norm in balanced units.
    """
    kinds = FlowEquilibriumKind
    count, n = slopes.shape[:2]
    eigenvalues = np.full((count, n), np.nan + 0j)
    number, kind = np.zeros(count, np.int64), np.full(count, kinds.NOT_COMPUTED, np.int8)
    own = np.flatnonzero(np.isfinite(slopes).all(axis=(1, 2)))
    if not own.size:
        return eigenvalues, number, kind
    slopes = slopes[own]
    if conservative and n == 1:  # the force alone: x'' = f
        force = slopes[:, 0, 0]
        eigenvalues[own, 0] = np.sqrt(force.astype(complex))
        number[own] = force > 0.0
        kind[own] = np.select(
            [force == 0.0, force > 0.0], [kinds.DEGENERATE, kinds.SADDLE], kinds.CENTER
        )
        return eigenvalues, number, kind
    # States have units, on which neither eigenvalues nor what is known of them depend.
    slopes, _ = balanced(slopes)
    found, right = np.linalg.eig(slopes)
    found = found.astype(complex)
    size = np.maximum(np.linalg.norm(slopes, axis=(1, 2)), float(discrete))[:, None]
    with np.errstate(all="ignore"):
        # How much an eigenvalue moves with the derivatives; of a double one by the root of that.
        doubt = np.minimum(error * size / _angles(right), np.sqrt(error) * size)
    growth = np.abs(found) - 1.0 if discrete else found.real
    order = np.lexsort((-found.imag, -growth))
    found, growth, doubt = (np.take_along_axis(x, order, axis=1) for x in (found, growth, doubt))
    unstable = growth > doubt
    many = unstable.sum(axis=1)
    nearest = np.argmin(np.abs(growth), axis=1)[:, None]
    turns = np.take_along_axis(np.abs(found.imag) > doubt, nearest, axis=1)[:, 0]
    flat = np.any(np.abs(growth) <= doubt, axis=1)
    if conservative:
        resting = np.all(np.abs(found) > doubt, axis=1)
        first = [(many == 0) & resting, many == 0]
        flat &= many == 0
    else:
        first = [np.zeros(len(own), bool)] * 2
    eigenvalues[own], number[own] = found, many
    kind[own] = np.select(
        [*first, flat, (many > 0) & (many < n), (many > 0) & turns, many > 0, turns],
        [
            kinds.CENTER, kinds.DEGENERATE, kinds.DEGENERATE, kinds.SADDLE, kinds.UNSTABLE_FOCUS,
            kinds.UNSTABLE_NODE, kinds.STABLE_FOCUS,
        ],
        kinds.STABLE_NODE,
    )  # fmt: skip
    return eigenvalues, number, kind


def _angles(right: npt.NDArray[Any]) -> Array:
    """The cosines between the left and the right eigenvectors, which have the length 1."""
    try:
        return np.asarray(1.0 / np.linalg.norm(np.linalg.inv(right), axis=2))
    except np.linalg.LinAlgError:  # one has too few eigenvectors
        if len(right) == 1:
            return np.zeros(right.shape[:2])
        return np.concatenate([_angles(one[None]) for one in right])


def corners(problem: Problem, box: Any, argument: str = "box") -> tuple[Array, Array]:
    """The ends of the box, of angles one turn where they are left out."""
    given = {} if box is None else box
    if not isinstance(given, Mapping):
        example = f"{argument}={{{problem.state[0]!r}: (-1, 1), ...}}"
        raise bad(argument, box, "a mapping from states to (low, high)", example)
    for name in given:
        if name not in problem.state:
            raise unknown(f"{argument}: state", name, problem.state)
    given = {**problem.window, **given}
    ends = []
    for name in problem.state:
        if name in given:
            wants = "two finite numbers, low < high"
            pair = reals(f"{argument}[{name!r}]", given[name], wants)
            if pair.shape != (2,) or not np.all(np.isfinite(pair)) or not pair[0] < pair[1]:
                raise bad(f"{argument}[{name!r}]", given[name], wants)
            ends.append(pair)
        elif name in problem.periods:
            # A little more than a turn: what lies on its ends is found there, and kept once.
            half = 0.5 * problem.periods[name] * (1.0 + 1e-9)
            ends.append(np.array([-half, half]))
        else:
            way = f"{argument}={{{name!r}: (low, high)}} or Problem(..., window=...) gives it"
            raise bad(argument, box, f"(low, high) of every state; {name!r} has none: {way}")
    low, high = np.array(ends).T
    return low, high


def natural_window(system: Any) -> dict[str, tuple[float, float]] | None:
    """Where the motions of a system in a potential are, which has no window of a user's own.

    Its interval, or the circle; and rates half as great again as that with which a motion comes
    down from the highest barrier, or as that of a rotation under the torque. None for others.
    """
    if not issubclass(system.standing.rung, (Conservative, Routhian)):
        return None
    bare = getattr(system, "system", system) if system.standing.traits is not None else system
    law = bare.law_of_parameters
    x, turn = law.coordinate, law.period
    ends = getattr(bare, "interval", None) if turn is None else (-0.5 * turn, 0.5 * turn)
    if ends is None:
        return None
    low, high = map(float, ends)
    places = np.linspace(low, high, PLACES)
    speed = 0.0
    for values in _corner_values(bare):
        force = _force_on(law, values, places)
        if not np.isfinite(force).all():
            return None
        work = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]))])
        work *= (high - low) / (PLACES - 1)
        if turn is not None:  # what is lost in a turn is no barrier
            work -= np.linspace(0.0, work[-1], PLACES)
        speed = max(speed, float(np.sqrt(2.0 * np.ptp(work))))
    if system is not bare:
        given = {name: np.abs(np.asarray(value)) for name, value in system.parameters.items()}
        push = given.get("torque", np.zeros(1)).max()
        push += sum(v.max() for n, v in given.items() if n.endswith("amplitude"))
        damping, drag = (given.get(n, np.zeros(1)).min() for n in ("damping", "quadratic"))
        fast = [push / damping] if damping > 0.0 else []
        fast += [np.sqrt(push / drag)] if drag > 0.0 else []
        speed += float(min(fast, default=0.0))
    if not speed > 0.0:
        return None
    rate = {f"d{x}": (-1.5 * speed, 1.5 * speed)}
    return rate if turn is not None else {x: (low, high), **rate}


def window_of(system: Any, window: Any) -> Any:
    """The window that is given, or where the motions of a system in a potential are."""
    return natural_window(system) if window is None and isinstance(system, System) else window


def _corner_values(system: Any) -> list[dict[str, float]]:
    """Values of the parameters: of arrays the least and the greatest, each beside the others'."""
    found: list[dict[str, float]] = [{}, {}]
    for name in system.formula_inputs():
        array = np.asarray(system.parameters[name], float)
        found[0][name], found[1][name] = float(np.nanmin(array)), float(np.nanmax(array))
    return found[:1] if found[0] == found[1] else found


def _force_on(law: Any, values: Mapping[str, float], places: Array) -> Array:
    """The acceleration at rest at places along a coordinate."""
    import sympy as sp

    symbols = symbols_of([law.coordinate, *values])
    formula = law.acceleration_formula(symbols, sp.Integer(0), sp.Integer(0))
    function = sp.lambdify(list(symbols.values()), formula, ["scipy", "numpy"])
    with np.errstate(all="ignore"):
        found = function(places, *values.values())
    return np.array(np.broadcast_to(found, places.shape), float)


def _raised(problem: Problem) -> str:
    """What f raised last while it was searched, in words."""
    return problem._own.raised.replace(": it", "; where it has no value f", 1)


def _enclosed(problems: Sequence[Problem], low: Array, high: Array) -> list[tuple[Array, str]]:
    """Zeros in the box of each, and why there may be others, if that is not excluded."""
    import sympy as sp

    def searched(why: str) -> list[tuple[Array, str]]:
        more = f"{STARTS} starts of Newton's method were tried"
        return [(_searched(one, low, high), f"{why}{more}") for one in problems]

    first = problems[0]
    if first.kind != "symbolic":
        ends = zip(problems, searched("f is code, so "), strict=True)
        return [(x, f"{why}, and nothing else{_raised(one)}") for one, (x, why) in ends]
    symbols = symbols_of([*first.state, *first.parameters])
    states = [symbols[name] for name in first.state]
    formulas = first.f
    if first.map:
        for _ in range(first.times - 1):
            step = dict(zip(states, formulas, strict=True))
            formulas = tuple(f.subs(step, simultaneous=True) for f in first.f)
            if sum(f.count_ops() for f in formulas) > LONG:
                return searched("the iterate is long; ")
        formulas = tuple(f - x for f, x in zip(formulas, states, strict=True))
    # What is multiplied by zero need not be bounded.
    kinked = any(f.has(sp.Abs, sp.sign) for f in formulas)
    groups: dict[tuple[str, ...], list[int]] = {}
    for place, one in enumerate(problems):
        zero = tuple(name for name, value in one.parameters.items() if kinked and value == 0.0)
        groups.setdefault(zero, []).append(place)
    boxes = dict[int, Zeros]()
    for absent, places in groups.items():
        own = tuple(f.subs({symbols[name]: 0 for name in absent}) for f in formulas)
        values = {
            symbols[name]: np.array([float(problems[place].parameters[name]) for place in places])
            for name in first.parameters
        }
        try:
            found = zeros_of_cells(own, states, values, low, high)
        except NoRule as rule:
            return searched(f"no bounds are known for {rule}; ")
        found = found * len(places) if len(found) < len(places) else found  # without parameters
        boxes.update(zip(places, found, strict=True))
    return [(boxes[k].zeros, _doubt(one, boxes[k])) for k, one in enumerate(problems)]


def _doubt(problem: Problem, found: Zeros) -> str:
    """Why there may be other zeros than these; empty where that is excluded."""
    if found.complete:
        return ""
    a, b = found.undecided[0].min(axis=0), found.undecided[1].max(axis=0)
    where = ", ".join(
        f"{name} in ({p:.6g}, {q:.6g})" for name, p, q in zip(problem.state, a, b, strict=True)
    )
    return f"a multiple equilibrium, a pole or rounding leaves it undecided within {where}"


def _folded(problem: Problem, zeros: Array) -> Array:
    """Each equilibrium once, where angles that differ by a turn are the same."""
    if len(zeros) < 2:
        return zeros.reshape(-1, len(problem.state))
    kept: list[Array] = []
    turns = np.array([problem.periods.get(name, 0.0) for name in problem.state])
    whole = np.where(turns > 0.0, turns, 1.0)
    for x in zeros:
        apart = [x - y for y in kept]
        apart = [d - turns * np.rint(d / whole) for d in apart]
        size = 1e-12 * np.maximum(np.abs(x), turns)
        if not any(np.all(np.abs(d) <= size) for d in apart):
            kept.append(x)
    return np.array(kept)


def _searched(problem: Problem, low: Array, high: Array) -> Array:
    """Ends of Newton's method from starts that fill the box evenly."""
    from scipy.optimize import root
    from scipy.stats import qmc

    from phasekit.bifurcation.continuation.code_fields import PythonField

    problem._own.failure = None
    starts = low + qmc.Sobol(len(low), seed=0).random(STARTS) * (high - low)
    with np.errstate(all="ignore"):
        if not any(np.isfinite(problem(start)).all() for start in starts):
            raise ParameterError(
                f"f: got no finite value at any of {STARTS} states of the window, wants a function "
                f"with values there{problem.field.raised}"
            )

    own, (_, par) = problem._own, problem._point(starts[0], 0.0)

    def f_of(x: Array) -> Array:
        # Of functions without what is checked of a state that somebody gives.
        value = own.values(x[None], par, ())[0] if isinstance(own, PythonField) else problem(x)
        return np.asarray(value - problem.map * x)

    kept: list[Array] = []
    for start in starts:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            end = root(f_of, start, options={"xtol": 1e-13})
            x = np.asarray(end.x, dtype=float)
            if not np.all((x >= low) & (x <= high)):
                continue
            if any(np.all(np.abs(x - y) <= SAME * (high - low)) for y in kept):
                continue  # met already: its derivatives tell nothing new
            f, slopes = problem.derivatives(x)
            if problem.map:
                f, slopes = f - x, slopes - np.eye(len(x))
            if not (np.isfinite(f).all() and np.isfinite(slopes).all()):
                continue
            near = SAME * (high - low)
            step = newton_step(slopes, f, near)
            after = np.abs(f_of(x - step))
        # The step that is left says how far the end is from a zero; the solver's word does not.
        left = f - slopes @ step
        if not np.all(np.abs(step) <= near) or not _reaches(f_of, x, left, near):
            continue
        # Nor does the step of a function that changes within less than its differences see.
        if not np.any(after > np.abs(slopes) @ near + np.abs(left)):
            kept.append(x)
    return np.array(sorted(kept, key=tuple)).reshape(-1, len(low))


def newton_step(slopes: Array, f: Array, units: Array) -> Array:
    """What Newton's method takes off a state; the least, in units of the states, of many.

    Rates have units as well: derivatives that are small beside those of another are no zeros.
    """
    sizes = np.abs(slopes) @ units
    sizes = np.where(sizes > 0.0, sizes, 1.0)
    scaled = slopes * units / sizes[:, None]
    return np.asarray(np.linalg.lstsq(scaled, f / sizes, rcond=None)[0] * units)


def _reaches(f: Callable[[Array], Array], x: Array, left: Array, near: Array) -> bool:
    """Whether f changes nearby by as much as a step by singular derivatives leaves of it."""
    if not left.any():
        return True
    ways = np.concatenate([np.diag(near), -np.diag(near)])
    with np.errstate(all="ignore"):
        here = f(x)
        change = np.nanmax([np.abs(f(x + way) - here) for way in ways], axis=0)
    return bool(np.all(np.abs(left) <= change))
