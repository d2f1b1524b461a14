"""Motions of any number of states: of flows x' = f(t, x; p) in lanes, of maps step by step."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.errors import ConvergenceError
from phasekit.inputs import bad
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Map
from phasekit.motion.equation_rates import (
    LONG,
    parameters_of,
    pointwise,
    rates_of,
    series_of,
    slopes_at,
)
from phasekit.motion.flow import ATOL, RTOL, Laid
from phasekit.motion.lost import ARRIVED, EXHAUSTED, FAILED, MOST, judged, tell
from phasekit.motion.method import WEIGHT, both_ways, cells_of, run, some
from phasekit.motion.rates import order_of

Array = npt.NDArray[np.float64]
Index = npt.NDArray[np.int64]

#: Steps of the explicit method, after which the implicit one is tried.
TRIED = 100_000
#: Steps of the implicit method.
MOST_IMPLICIT = 30_000


def flow(
    law: Equations,
    *arrays: npt.ArrayLike,
    rtol: float = RTOL,
    atol: float = ATOL,
    threads: int | None = None,
    method: str | None = None,
) -> tuple[Array, ...]:
    """States after times from t = 0, or after so many steps of a map.

    Parameters
    ----------
    law : Equations
        The law.
    *arrays : array_like
        Its parameters, then the states at t = 0, then times; they broadcast.
    rtol, atol : float
        Error of a step that is allowed, relative and absolute.
    threads : int, optional
        Default: all cores where there are many motions.
    method : {"taylor", "dop853", "radau"}, optional
        Default: Radau's where the motion is stiff; else series where formulas are short.

    Raises
    ------
    ParameterError
        If series are asked for, and the law has none.

    Returns
    -------
    tuple of array
        One a state; NaN where a motion did not come to a time, which a RuntimeWarning says.
    """
    laid = Laid.out(len(law.names), arrays)
    values = dict(zip(law.names, laid.values, strict=True))
    if isinstance(law, Map):
        found, status = iterates(law, values, laid.states, laid.times * law.times)
    else:
        how = {"rtol": rtol, "atol": atol}
        found, status = _flows(law, values, laid.states, laid.times, method, threads, how)
    tell(f"motion of {', '.join(law.states)}", status, laid.states)
    return tuple(laid.back(found))


def _flows(
    law: Equations, values: Mapping[str, Array], states: Array, times: Array,
    method: str | None, threads: int | None, how: dict[str, float],
) -> tuple[Array, Index]:  # fmt: skip
    order = order_of(how["rtol"])
    if method == "taylor" and not series_of(law, order, longest=np.inf):
        why = "f has functions whose series are not known, or is no formula"
        raise bad("method", method, "dop853 or radau", why)
    if law.kind == "python" or method == "radau":
        return _one_by_one(law, values, states, times, method, how)
    few = TRIED if method is None else MOST

    def move(cells: tuple[Any, Array, Array], most: int) -> tuple[Array, Index]:
        return motions(law, *cells, how["rtol"], how["atol"], threads, most, method)

    found, status = move((values, states, times), few)
    lost = np.flatnonzero(status == EXHAUSTED)
    if few == MOST or not lost.size:
        return found, status

    def part(cells: Any) -> tuple[dict[str, Array], Array, Array]:
        return cells_of(values, cells), states[cells], some(times, cells)

    # Stiff motions take the implicit method few steps; others as many, each of which takes longer.
    _, ended = _one_by_one(law, *part(lost[:1]), "radau", how)
    if ended[0] == ARRIVED:
        found[lost], status[lost] = _one_by_one(law, *part(lost), "radau", how)
    else:
        found[lost], status[lost] = move(part(lost), MOST)
    return found, status


def sections(
    law: Equations, *arrays: npt.ArrayLike, n: int, skip: int, period: float | None, **how: Any
) -> dict[str, Array]:
    """States once a period of the forcing, or after equal times, on a last axis."""
    given = [np.asarray(array, dtype=float) for array in arrays]
    legs = np.asarray(period_of(law, given[: len(law.names)]) if period is None else period)
    wide = [array[..., None] for array in given]
    times = legs[..., None] * (skip + np.arange(n))
    found = flow(law, *wide, times, **how)
    shape = np.broadcast_shapes(*(array.shape for array in wide), times.shape)
    names = [f"section_{name}" for name in law.states]
    result = dict(zip(names, found, strict=True))
    for name, state in zip(names, law.states, strict=True):
        if state in law.periods:
            turn = law.periods[state]
            result[name] = 0.5 * turn - np.mod(0.5 * turn - result[name], turn)
    return {"section_time": np.array(np.broadcast_to(times, shape)), **result}


def period_of(law: Equations, values: Sequence[Array]) -> Array:
    """The period of the forcing at values of the parameters."""
    import sympy as sp

    from phasekit.laws.formulas import symbols_of

    symbols = symbols_of(law.names)
    function = sp.lambdify([symbols[name] for name in law.names], law.period, "numpy")
    shape = np.broadcast_shapes(*(value.shape for value in values))
    return np.array(np.broadcast_to(function(*values), shape), float)


def motions(
    law: Equations,
    values: Mapping[str, Array],
    states: Array,
    times: Array,
    rtol: float = RTOL,
    atol: float = ATOL,
    threads: int | None = None,
    most: int = MOST,
    method: str | None = None,
) -> tuple[Array, Index]:
    """Integrate a flow from t = 0 to times of either sign; states at them, and how it ended."""
    from phasekit.motion.kernels.motions import motions as kernel

    count, n = states.shape
    longest = LONG if method is None else np.inf
    code = rates_of(law, 0 if method == "dop853" else order_of(rtol), longest)
    parameters = parameters_of(law, values, count)
    limits = limits_of(law, rtol, atol, most, keep=True)
    shared = np.zeros((0, 3)), limits, 0.0, code.kink

    def integrate(rising: Array, groups: tuple[Any, ...]) -> None:
        cells = rising, np.array(states)
        run(kernel, code, shared, cells, parameters, groups, groups[1], threads)

    result, status, _ = both_ways(times, count, n, integrate)
    failed = np.flatnonzero((status == FAILED) & np.isfinite(states).all(axis=1))
    if code.series and failed.size:  # as those of a root do where it vanishes
        part = cells_of(values, failed), states[failed], some(times, failed)
        again = motions(law, *part, rtol, atol, threads, most, "dop853")
        result[failed], status[failed] = again
    judged(status, parameters)
    return result, status


def limits_of(law: Equations, rtol: float, atol: float, most: int, *, keep: bool = False) -> Array:
    """What bounds the steps of the kernels: common limits, then unit and scale of each state.

    Steps by series are taken one at a time; they are kept where states within them are asked for.
    """
    from phasekit.numerics.lanes import LANES

    rows = [rtol, atol, np.inf, float(most), 1.0, float(keep), 1.0]
    for name in law.states:
        low, high = law.window.get(name, (0.0, 0.0))
        # Without a window an angle is measured by radians.
        unit = law.periods[name] / (2.0 * np.pi) if name in law.periods else np.inf
        rows += [unit, min(high - low, unit)]
    return np.repeat(np.reshape(rows, (-1, 1)), LANES, axis=1)


def _one_by_one(
    law: Equations, values: Mapping[str, Array], states: Array, times: Array,
    method: str | None, how: dict[str, float],
) -> tuple[Array, Index]:  # fmt: skip
    """Motions one after the other: of Python functions, and stiff ones."""
    from phasekit.numerics.waits import stage

    times = np.broadcast_to(times, (len(states), times.shape[1]))
    found = np.empty((*times.shape, states.shape[1]))
    status = np.full(len(states), ARRIVED)
    for cell, own in enumerate(times):
        one = {name: float(np.reshape(x, ())) for name, x in cells_of(values, cell).items()}
        found[cell] = _followed(law, one, states[cell], own, method, how)
        lost = np.isnan(found[cell]).any(axis=1) & np.isfinite(own)
        if lost.any():
            status[cell] = FAILED if np.isfinite(states[cell]).all() else EXHAUSTED
        stage(f"{cell + 1:,} of {len(states):,} motions")
    return found, status


def _followed(
    law: Equations, values: Mapping[str, float], state: Array, times: Array,
    method: str | None, how: dict[str, float],
) -> Array:  # fmt: skip
    from scipy.integrate import DOP853, Radau

    from phasekit.motion.steps import InitialValue, steps

    found = np.full((times.size, state.size), np.nan)
    found[times == 0.0] = state
    if not np.isfinite(state).all():
        return found
    rates = pointwise(law, values)
    stiff = method == "radau"
    kind: Any = DOP853
    if stiff:
        kind = functools.partial(Radau, jac=lambda t, x: slopes_at(law, values, x, t))
    for sense in (1.0, -1.0):
        ahead = np.flatnonzero((sense * times > 0.0) & np.isfinite(times))
        if not ahead.size:
            continue
        ahead = ahead[np.argsort(sense * times[ahead])]
        own, done = times[ahead], 0
        problem = InitialValue(
            rates, list(state), rtol=max(how["rtol"], 1e-13), atol=how["atol"], unit=np.inf,
            most=MOST_IMPLICIT if stiff else 1_000_000, method=kind,
        )  # fmt: skip
        try:
            for step in steps(problem, float(own[-1])):
                upto = int(np.searchsorted(sense * own, sense * step.stop, side="right"))
                if upto > done:
                    found[ahead[done:upto]] = step.dense(own[done:upto]).T
                    done = upto
        except (ConvergenceError, ValueError):  # a ValueError: of rates that are not finite
            pass
    return found


def iterates(
    law: Equations, values: Mapping[str, Array], states: Array, times: Array
) -> tuple[Array, Index]:
    """States after so many steps of a map; NaN where the number is none."""
    count, n = states.shape
    times = np.broadcast_to(times, (count, times.shape[1]))
    wrong = np.isfinite(times) & ((times < 0.0) | (times != np.rint(times)))
    if wrong.any():
        warnings.warn(
            f"t: {wrong.sum()} of {wrong.size} values are no whole numbers >= 0, as counts of "
            "iterations of a map are; there results are NaN",
            RuntimeWarning,
            stacklevel=2,
        )
    wanted = np.where(np.isfinite(times) & ~wrong, times, -1.0).astype(np.int64)
    found, status = np.full((count, times.shape[1], n), np.nan), np.full(count, ARRIVED)
    order = np.argsort(wanted, axis=1)
    rising = np.take_along_axis(wanted, order, axis=1)
    out = np.full(found.shape, np.nan)
    if law.kind == "python":
        for cell in range(count):
            one = {name: float(np.reshape(x, ())) for name, x in cells_of(values, cell).items()}
            step, x, done = pointwise(law, one), states[cell], 0
            for i, k in enumerate(rising[cell]):
                while done < k:
                    x, done = step(float(done), x), done + 1
                if k >= 0:
                    out[cell, i] = x
    elif count and times.shape[1]:
        from phasekit.motion.kernels.iterates import iterates as kernel
        from phasekit.numerics.launch import launch

        code, parameters = rates_of(law), parameters_of(law, values, count)
        work = WEIGHT + int(rising[:, -1].max(initial=0)) // 8
        cells = np.array(rising), np.array(states), parameters
        groups: Any = (out,)
        launch(kernel, (code.address, *cells), count, groups, None, work)
    back = np.argsort(order, axis=1)[..., None]
    found = np.take_along_axis(out, np.broadcast_to(back, (count, *back.shape[1:])), axis=1)
    lost = ~np.isfinite(found).all(axis=2) & (wanted >= 0)
    status[lost.any(axis=1)] = FAILED
    return np.where(lost[..., None], np.nan, found), status
