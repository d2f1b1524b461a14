"""The rates of laws, or steps of maps, as machine code and as functions of points."""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import ParameterError
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Map
from phasekit.laws.perturbed import PerturbedLaw
from phasekit.motion import rates
from phasekit.motion.prescribed import span, table_of
from phasekit.motion.rates import Rates
from phasekit.numerics.slopes import jacobian

#: States up to which slopes are compiled, for stiff motions.
MANY = 40
#: Operations of formulas up to which steps by series are compiled unasked, in less than a second.
LONG = 48


def rates_of(law: Equations, order: int = 0, longest: float = LONG, tangents: int = 0) -> Rates:
    """Machine code of the rates of eight states, with so many tangent vectors.

    With steps by series of that order, if it has them; of a map steps are its own.
    """
    address = _compiled(law.states, law.names, law.f, law.time, tangents)
    entries = len(law.states) * (1 + tangents)
    if isinstance(law, Map):
        from phasekit.motion.kernels.iteration import compile_iterations

        turns = _folds(law.states, law.names, law.f, tuple(law.periods.items()))
        return Rates(address, law.names, -1, compile_iterations(address, entries, turns), entries)
    series = series_of(law, order, tangents, longest) if order else 0
    return Rates(address, law.names, -1, series, entries * (order + 1) if series else 0)


@functools.lru_cache(maxsize=128)
def _folds(
    states: tuple[str, ...], names: tuple[str, ...], f: Any, periods: tuple[tuple[str, float], ...]
) -> tuple[float, ...]:
    """Periods of the angles of a map that winds turns up; none where they go on as they are.

    Such a map makes many turns of one, by a matrix with a root beyond 1, and each iteration of
    the unfolded angle loses digits, as 2 x does.
    """
    import sympy as sp

    from phasekit.laws.formulas import symbols_of

    if not (periods and isinstance(f, tuple)):
        return ()
    symbols, turns = symbols_of([*states, *names]), dict(periods)
    angles = [i for i, name in enumerate(states) if name in turns]
    function = sp.lambdify(list(symbols.values()), list(f), ["scipy", "numpy"])
    place = np.random.default_rng(0).uniform(2.0, 3.0, len(symbols))
    with np.errstate(all="ignore"):
        before = np.array(function(*place), float)
        winding = np.empty((len(angles), len(angles)))
        for column, j in enumerate(angles):
            turned = place + turns[states[j]] * (np.arange(len(place)) == j)
            change = np.array(function(*turned), float) - before
            winding[:, column] = [change[i] / turns[states[i]] for i in angles]
    if not np.isfinite(winding).all() or np.abs(np.linalg.eigvals(winding)).max() <= 1.0 + 1e-3:
        return ()
    return tuple(turns.get(name, 0.0) for name in states)


def derivatives_of(law: Equations) -> int:
    """Machine code of the slopes of the rates, by rows, and their derivatives by time.

    0 where the law is no formula, or there is too much of it.
    """
    if law.kind != "symbolic" or len(law.states) > MANY:
        return 0
    return _derivatives(law.states, law.names, law.f, law.time)


@functools.lru_cache(maxsize=128)
def _derivatives(states: tuple[str, ...], names: tuple[str, ...], f: Any, time: str | None) -> int:
    import sympy as sp

    from phasekit.laws.formulas import symbols_of
    from phasekit.numerics.lanes import compile_lanes

    symbols = symbols_of([*states, *names, *([] if time is None else [time])])
    places = {symbols[name]: (0, i) for i, name in enumerate(states)}
    places |= {symbols[name]: (1, i) for i, name in enumerate(names)}
    t = sp.Dummy("t", real=True) if time is None else symbols[time]
    places[t] = (2, 0)
    rows = jacobian(f, [*(symbols[name] for name in states), t])
    entries = [one for row in rows for one in row[:-1]]
    return compile_lanes(tuple([*entries, *(row[-1] for row in rows)]), places)


def series_of(law: Equations, order: int, tangents: int = 0, longest: float = LONG) -> int:
    """Machine code of steps by series, with tangent vectors; 0 where a law has none, or is long."""
    if law.kind != "symbolic":
        return 0
    return _series(law.states, law.names, law.f, law.time, order, tangents, longest)


@functools.lru_cache(maxsize=128)
def _series(
    states: tuple[str, ...], names: tuple[str, ...], f: Any, time: str | None, order: int,
    tangents: int, longest: float,
) -> int:  # fmt: skip
    import sympy as sp

    from phasekit.laws.formulas import symbols_of

    symbols = symbols_of([*states, *names, *([] if time is None else [time])])
    t = sp.Dummy("t") if time is None else symbols[time]
    expressions, places = varied(states, symbols, f, tangents)
    shared, rest = sp.cse(expressions)
    if sp.count_ops([part for _, part in shared] + rest) > longest:
        return 0
    parameters = {symbols[name]: i for i, name in enumerate(names)}
    return rates.series_of(order, t, [(x,) for x in places], expressions, parameters, len(states))


def varied(
    states: tuple[str, ...], symbols: Mapping[str, Any], f: Sequence[Any], tangents: int
) -> tuple[list[Any], dict[Any, int]]:
    """Rates of states and of tangent vectors, and the places of all of them."""
    import sympy as sp

    x = [symbols[name] for name in states]
    places, expressions = {symbol: i for i, symbol in enumerate(x)}, list(f)
    slopes = jacobian(f, x) if tangents else []
    for i in range(tangents):
        u = sp.symbols(f"_u{i}_:{len(x)}", real=True)
        places |= {symbol: (1 + i) * len(x) + j for j, symbol in enumerate(u)}
        expressions += [sp.Add(*(a * b for a, b in zip(row, u, strict=True))) for row in slopes]
    return expressions, places


def parameters_of(law: Equations, values: Mapping[str, Any], count: int) -> Array:
    """Parameters of the machine code in so many cells, of shape (parameters, cells)."""
    columns = [np.asarray(values[name], float) for name in law.names] or [np.zeros(())]
    return np.array([np.broadcast_to(column, (count,)) for column in columns])


@functools.lru_cache(maxsize=128)
def _compiled(
    states: tuple[str, ...], names: tuple[str, ...], f: Any, time: str | None, tangents: int
) -> int:
    from phasekit.laws.formulas import symbols_of
    from phasekit.numerics.lanes import compile_lanes

    if not isinstance(f, tuple):
        return int(_wrapped(states, names, f, time, tangents).address)
    symbols = symbols_of([*states, *names, *([] if time is None else [time])])
    expressions, order = varied(states, symbols, f, tangents)
    places = {symbol: (0, i) for symbol, i in order.items()}
    places |= {symbols[name]: (1, i) for i, name in enumerate(names)}
    if time is not None:
        places[symbols[time]] = (2, 0)
    return compile_lanes(expressions, places)


@functools.cache  # the code lives as long as it may be called
def _wrapped(
    states: tuple[str, ...], names: tuple[str, ...], f: Any, time: str | None, tangents: int
) -> Any:
    import inspect

    from phasekit.numerics.lanes import LANES
    from phasekit.numerics.wrapped import wrap

    arguments = list(inspect.signature(f.py_func).parameters)[1:]
    order = tuple(None if name == time else names.index(name) for name in arguments)
    return wrap(f, len(states), order, lanes=LANES, tangents=tangents)


def code_of(
    law: PerturbedLaw | Equations, values: Mapping[str, Any], count: int, tangents: int = 0,
    order: int = 0, longest: float = LONG,
) -> tuple[Rates, Array]:  # fmt: skip
    """Machine code of a law, and its parameters in so many cells."""
    if isinstance(law, Equations):
        return rates_of(law, order, longest, tangents), parameters_of(law, values, count)
    code, parameters = rates.rates_of(law, values, tangents, order)
    return code, np.array(np.broadcast_to(parameters, (len(parameters), count)))


def table_for(law: PerturbedLaw | Equations, times: npt.ArrayLike) -> Array:
    """What is prescribed of time, for motions from t = 0 to times."""
    return table_of(getattr(law, "prescribed", None), *span(times))


def rates_along(
    law: PerturbedLaw | Equations, values: Mapping[str, Any], times: npt.ArrayLike, states: Array,
    tangents: int = 0,
) -> Array:  # fmt: skip
    """The rates at times and states, the rows, with so many tangent vectors; not of code in Python.

    Parameters are one value each, or one a row.
    """
    from phasekit.motion.kernels.motions import rates_at

    count, table = len(states), table_for(law, times)
    code, parameters = code_of(law, values, count, tangents)
    t = np.array(np.broadcast_to(np.asarray(times, float), (count,)))
    sign = np.sign(states[:, 1]) if code.kink >= 0 else np.zeros(count)
    out = np.empty(states.shape)
    rates_at(code.address, table, t, np.array(states), parameters, sign, code.kink, 0, count, out)
    return out


def pointwise(
    law: PerturbedLaw | Equations, values: Mapping[str, Any], times: npt.ArrayLike = 0.0
) -> Callable[[float, Any], Array]:
    """The rates of one system as a function of time and state, between the least of times and 0."""
    if isinstance(law, Equations) and law.kind == "python":
        return Called(law, values)
    from phasekit.motion.kernels.motions import rates_at

    (code, parameters), table = code_of(law, values, 1), table_for(law, times)

    def rates(t: float, x: Any) -> Array:
        state = np.array(x, float)[None]
        out, sign = np.empty(state.shape), np.zeros(1)
        if code.kink >= 0:
            sign = np.sign(state[:, 1])
        now = np.array([float(t)])
        rates_at(code.address, table, now, state, parameters, sign, code.kink, 0, 1, out)
        return np.asarray(out[0])

    return rates


def rates_on(law: PerturbedLaw | Equations, values: Mapping[str, Any], x: Array) -> Array:
    """The rates, or steps of a map, at many states, the rows of x, at time 0."""
    if isinstance(law, Equations) and law.kind == "python":
        f = Called(law, values)
        return np.array([f(0.0, row) for row in x]).reshape(x.shape)
    return rates_along(law, values, 0.0, x)


class Called:
    """A Python function as the rates, or the step, NaN where it raises or has no value."""

    def __init__(self, law: Equations, values: Mapping[str, float]) -> None:
        self.law, self.given = law, {name: float(x) for name, x in values.items()}
        self.raised = ""
        """What it raised last."""
        self.undefined = False
        """Whether it returned NaN at a state that is finite."""

    def __call__(self, t: float, x: Any) -> Array:
        """Value at a time and a state."""
        law, n = self.law, len(self.law.states)
        more = {} if law.time is None else {law.time: t}
        try:
            found = law.f(np.array(x, float), **self.given, **more)
        except Exception as error:  # whatever a user's function raises, it has no value there
            self.raised = f"{type(error).__name__}: {error}"
            return np.full(n, np.nan)
        if found is not None:  # which NumPy takes for NaN
            with contextlib.suppress(TypeError, ValueError):
                value = np.asarray(found, dtype=float).reshape(n)
                total = sum(value.tolist())  # NaN if one of them is, and found sooner
                if total != total:
                    self.undefined |= bool(np.isnan(value).any() and np.isfinite(x).all())
                return value
        wants = f"{n} numbers, one for each of {', '.join(law.states)}"
        raise ParameterError(f"f: returned {str(found)[:80]}, wants {wants}")


def slopes_at(law: Equations, values: Mapping[str, float], x: Array, t: float = 0.0) -> Array:
    """Derivatives of the rates, or of a step, by the states at one state."""
    n = len(law.states)
    if law.kind == "symbolic":
        function = _slopes(law.states, law.names, law.f, law.time)
        return np.array(function([float(one) for one in x], values, t), float).reshape(n, n)
    f = pointwise(law, values)
    size = np.maximum(np.abs(x), 1e-3 * max(float(np.abs(x).max(initial=0.0)), 1e-300))
    found = np.empty((n, n))
    for i in range(n):
        h = np.zeros(n)
        h[i] = np.finfo(float).eps ** (1.0 / 3.0) * size[i]
        found[:, i] = (f(t, x + h) - f(t, x - h)) / (2.0 * h[i])
    return found


def slopes_on(law: Equations, values: Mapping[str, float], x: Array) -> Array:
    """Derivatives of the rates by the states at many states, the rows of x, at time 0."""
    count, n = x.shape
    if law.kind == "symbolic":
        found = _slopes(law.states, law.names, law.f, law.time)(x.T, values, 0.0)
        rows = [np.broadcast_to(np.asarray(one, float), (count,)) for one in found]
        return np.stack(rows, axis=-1).reshape(count, n, n)
    size = np.maximum(np.abs(x), 1e-3 * np.abs(x).max(axis=1, initial=1e-300, keepdims=True))
    steps = np.finfo(float).eps ** (1.0 / 3.0) * size
    columns = []
    for i in range(n):
        h = np.where(np.arange(n) == i, steps, 0.0)
        change = rates_on(law, values, x + h) - rates_on(law, values, x - h)
        columns.append(change / (2.0 * steps[:, i : i + 1]))
    return np.stack(columns, axis=-1)


@functools.lru_cache(maxsize=128)
def _slopes(states: tuple[str, ...], names: tuple[str, ...], f: Any, time: str | None) -> Any:
    import sympy as sp

    from phasekit.laws.formulas import symbols_of

    given = [*states, *names, *([] if time is None else [time])]
    symbols = symbols_of(given)
    entries = list(chain.from_iterable(jacobian(f, [symbols[name] for name in states])))
    beside = [one.replace(sp.DiracDelta, lambda *_: sp.Integer(0)) for one in entries]  # jumps
    function = sp.lambdify([symbols[name] for name in given], beside, "numpy", cse=True)

    def slopes(x: Any, values: Mapping[str, float], t: float) -> Any:
        more = [] if time is None else [t]
        with np.errstate(all="ignore"):
            return function(*x, *(float(values[n]) for n in names), *more)

    return slopes
