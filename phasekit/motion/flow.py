"""States of damped and driven motions at given times."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Index
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Map, Trait
from phasekit.laws.perturbed import OWN, PerturbedLaw
from phasekit.laws.terms import STANDARD, drift_name, forcing_names, modulation_names
from phasekit.laws.trigonometric import Trigonometric
from phasekit.motion.equation_rates import LONG, code_of, pointwise, rates_along, table_for
from phasekit.motion.lost import ARRIVED, FAILED, MOST, judged, tell
from phasekit.motion.method import both_ways, cells_of, entries_of, kinds, limits_of, run, unit_of
from phasekit.motion.rates import order_of
from phasekit.motion.stiff import follow, stiff_cells

#: Error of a step that is allowed, relative and absolute.
RTOL, ATOL = 1e-10, 1e-12


class Motion(NamedTuple):
    """The group "motion"."""

    motion_phi: Array
    motion_dphi: Array


class Cells(NamedTuple):
    """Motions side by side."""

    states: Array
    """Of shape (cells, times, 2); NaN where a motion did not come to a time."""
    status: Index
    steps: Index
    """By the method that followed a motion last."""


def flow(
    law: PerturbedLaw,
    *arrays: npt.ArrayLike,
    rtol: float = RTOL,
    atol: float = ATOL,
    threads: int | None = None,
) -> Motion:
    """States after times from t = 0.

    Arrays are parameters, then states at t = 0, then times; they broadcast. NaN where a motion did
    not come to a time, which a RuntimeWarning says.
    """
    laid = Laid.out(len(law.names), arrays)
    named = law.values(*laid.values)
    found = _motions(law, named, laid.states, laid.times, rtol, atol, threads)
    return Motion(*laid.back(found))


class Laid(NamedTuple):
    """Motions in a row, and the way back to the shape of the arrays that they are given by."""

    values: list[Array]
    """Parameters: of a motion each, or scalars."""
    states: Array
    """Of shape (cells, states)."""
    times: Array
    """Of shape (cells, times), or (1, times)."""
    shape: tuple[int, ...]
    order: npt.NDArray[np.intp]

    @classmethod
    def out(cls, parameters: int, arrays: tuple[npt.ArrayLike, ...]) -> Laid:
        """Lay out so many parameters, then states at t = 0, then times; they broadcast."""
        *given, t = (np.asarray(array, dtype=float) for array in arrays)
        shape = np.broadcast_shapes(*(array.shape for array in (*given, t)))
        inner = _time_axes(tuple(given), t, len(shape))
        outer = tuple(axis for axis in range(len(shape)) if axis not in inner)
        cells = tuple(shape[axis] for axis in outer)

        def flat(array: Array) -> Array:
            full = array.reshape((1,) * (len(shape) - array.ndim) + array.shape)
            if full.size == 1:
                return full.reshape(())
            return np.broadcast_to(full.squeeze(inner), cells).reshape(-1)

        row = [flat(array) for array in given]
        count = int(np.prod(cells, dtype=int))
        states = np.stack([np.broadcast_to(x, (count,)) for x in row[parameters:]], axis=-1)
        full = t.reshape((1,) * (len(shape) - t.ndim) + t.shape)
        times = np.transpose(full, (*outer, *inner))
        alone = all(full.shape[axis] == 1 for axis in outer)
        width = int(np.prod([shape[axis] for axis in inner], dtype=int))
        whole = (*cells, *(shape[axis] for axis in inner))
        if not alone:
            times = np.broadcast_to(times, whole)
        order = np.argsort((*outer, *inner))
        return cls(row[:parameters], states, times.reshape(-1, width), whole, order)

    def back(self, found: Array) -> list[Array]:
        """States of shape (cells, times, states) as arrays of the given shape."""
        results = found.reshape(*self.shape, found.shape[-1])
        return [results[..., i].transpose(self.order) for i in range(found.shape[-1])]


def at_momentum(law: Any, *arrays: npt.ArrayLike, **how: Any) -> Motion:
    """States after times, at momenta that are constant: `flow` without damping and drive."""
    count = len(law.names)
    alone = PerturbedLaw(law, (*law.names, *OWN), law.names, STANDARD, traits=Trait(0))
    return flow(alone, *arrays[:count], *np.zeros(len(OWN)), *arrays[count:], **how)


def _motions(
    law: PerturbedLaw,
    values: Mapping[str, Array],
    states: Array,
    times: Array,
    *how: Any,
) -> Array:
    """States of motions, by the exact flow where nothing disturbs them."""
    still = _is_still(law, values, len(states))
    if not still.any():
        return _integrated(law, values, states, times, *how)
    from phasekit.phase.exact.flow import flow as exact

    result = np.empty((len(states), times.shape[1], 2))
    own = cells_of(values, still)
    assert isinstance(law.base, Trigonometric)
    A, B, C = (np.reshape(x, (-1, 1)) for x in law.base.coefficients(own))
    phi, dphi = states[still].T[..., None]
    result[still] = np.stack(exact(A, B, C, phi, dphi, entries_of(times, still)), axis=-1)
    if not still.all():
        rest = cells_of(values, ~still), states[~still], entries_of(times, ~still)
        result[~still] = _integrated(law, *rest, *how)
    return result


def _integrated(
    law: PerturbedLaw,
    values: Mapping[str, Array],
    states: Array,
    times: Array,
    *how: Any,
) -> Array:
    """States of motions, each by the method that suits it, whatever the others are."""
    count = len(states)
    stiff = stiff_cells(law, values, times, count)
    found, status = np.empty((count, times.shape[1], 2)), np.empty(count, np.int64)
    for kind in kinds(law, values, count):
        which = kind & ~stiff
        if which.all():
            found, status, _ = motions(law, values, states, times, *how)
        elif which.any():
            cells = cells_of(values, which), states[which], entries_of(times, which)
            found[which], status[which], _ = motions(law, *cells, *how)
    if stiff.any():
        cells = cells_of(values, stiff), states[stiff], entries_of(times, stiff)
        found[stiff], status[stiff] = _stiff_motions(law, *cells, *how)
    tell("motion_phi", status, states)
    return found


def _stiff_motions(
    law: PerturbedLaw,
    values: Mapping[str, Array],
    states: Array,
    times: Array,
    rtol: float,
    atol: float,
    threads: int | None,
) -> tuple[Array, Index]:
    """States of stiff motions, and what the implicit method leaves by the explicit one."""
    times = np.broadcast_to(times, (len(states), times.shape[1]))
    found, status = np.empty((*times.shape, 2)), np.full(len(states), ARRIVED)
    for cell, own in enumerate(times):
        one = {name: np.reshape(x, ()) for name, x in cells_of(values, cell).items()}
        rates = pointwise(law, one, own)
        how = {"rtol": rtol, "atol": atol, "unit": unit_of(law)}
        found[cell] = follow(rates, states[cell], own, **how)
    left = np.isnan(found[..., 0]) & ~np.isnan(times)
    lost = left.any(axis=1)
    if lost.any():
        cells = cells_of(values, lost), states[lost], np.where(left, times, 0.0)[lost]
        moved = motions(law, *cells, rtol, atol, threads)
        found[lost] = np.where(left[lost, :, None], moved.states, found[lost])
        status[lost] = moved.status
    return found, status


def _is_still(law: PerturbedLaw, values: Mapping[str, Array], count: int) -> Any:
    """In which cells there is neither damping nor torque nor anything that varies."""
    if not isinstance(law.base, Trigonometric) or law.prescribed is not None or law.own:
        return np.zeros(count, bool)
    names = ["damping", "quadratic", "torque"]
    names += [forcing_names(i)[0] for i in range(law.harmonics)]
    names += [modulation_names(name)[0] for name in law.modulated]
    names += [drift_name(name) for name in law.drifting]
    return np.broadcast_to(
        np.all(np.broadcast_arrays(*(values[n] == 0.0 for n in names)), axis=0), (count,)
    )


def _time_axes(arrays: tuple[Array, ...], t: Array, n: int) -> tuple[int, ...]:
    """Axes along which times vary and nothing else does: one motion has them all."""

    def sizes(array: Array) -> tuple[int, ...]:
        return (1,) * (n - array.ndim) + array.shape

    used = [any(sizes(array)[axis] > 1 for array in arrays) for axis in range(n)]
    return tuple(axis for axis in range(n) if sizes(t)[axis] > 1 and not used[axis])


def motions(
    law: PerturbedLaw | Equations,
    values: Mapping[str, Array],
    states: Array,
    times: Array,
    rtol: float = RTOL,
    atol: float = ATOL,
    threads: int | None = None,
    most: int = MOST,
    *,
    method: str | None = None,
    tangents: int = 0,
    again: bool = True,
) -> Cells:
    """Integrate from t = 0 to times of either sign, in any order; or step by step, of maps.

    Steps are by Taylor series where the law has them, unless the method is "dop853", and up to a
    length of formulas where it is None. Behind the states, of shape (cells, n + n tangents), stand
    tangent vectors; times are of shape (cells, times) or (1, times).
    """
    from phasekit.motion.kernels.motions import motions as kernel

    order = 0 if method == "dop853" else order_of(rtol)
    longest = LONG if method is None else np.inf
    code, parameters = code_of(law, values, len(states), tangents, order, longest)
    limits = limits_of(law, rtol, atol, most, alone=True, keep=True)
    shared = table_for(law, times), limits, 0.0, code.kink

    def integrate(rising: Array, groups: tuple[Any, ...]) -> None:
        cells = rising, np.array(states)
        run(kernel, code, shared, cells, parameters, groups, groups[1], threads, again=again)

    found = Cells(*both_ways(times, len(states), states.shape[1], integrate))
    failed = np.flatnonzero((found.status == FAILED) & np.isfinite(states).all(axis=1))
    if code.series and failed.size and isinstance(law, Equations) and not isinstance(law, Map):
        # As those of a root do where it vanishes.
        part = cells_of(values, failed), states[failed], entries_of(times, failed)
        other = motions(
            law, *part, rtol, atol, threads, most, method="dop853", tangents=tangents
        )  # fmt: skip
        found.states[failed], found.status[failed] = other.states, other.status
    judged(found.status, parameters)
    return found


def accelerations(
    law: PerturbedLaw,
    values: Mapping[str, Array],
    times: npt.ArrayLike,
    phi: npt.ArrayLike,
    dphi: npt.ArrayLike,
) -> Array:
    """Phi'' at states and times, that broadcast with the values of the parameters."""
    given = (np.asarray(array, dtype=float) for array in (times, phi, dphi))
    t, x, v = np.broadcast_arrays(*given)
    states = np.stack([x.reshape(-1), v.reshape(-1)], axis=-1)
    return np.asarray(rates_along(law, values, t.reshape(-1), states)[:, 1].reshape(t.shape))
