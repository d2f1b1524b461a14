"""States of motions once a period, and how errors grow beside them."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Index
from phasekit.errors import warn
from phasekit.inputs import bad
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Map
from phasekit.laws.perturbed import PerturbedConservative, forcing_names, modulation_names
from phasekit.motion.equation_rates import LONG, code_of, rates_on, table_for
from phasekit.motion.flow import ATOL, RTOL
from phasekit.motion.flows import period_of
from phasekit.motion.lost import FAILED, UNDEFINED, judged, stuck, tell
from phasekit.motion.method import cells_of, circle, entries_of, kinds, limits_of, run, turns_of
from phasekit.motion.rates import order_of

#: Way in a leg, in units of the box, from which on a motion is under way to infinity; and steps of
#: a map after which it is not asked where one ended.
FAST, LAST = 1e12, 1_000
#: Greatest denominator of a ratio of frequencies that counts as commensurate.
DENOMINATOR = 64
#: Relative error of a step of a tangent vector of which the length alone matters.
LOOSE = 1e-4


def common_period(
    law: PerturbedConservative | Equations, values: Mapping[str, Array]
) -> Array | None:
    """Period of all that varies with time; None without such, NaN without a common one.

    Frequencies whose ratio is a fraction of small numbers, to rounding, are commensurate.
    """
    if isinstance(law, Equations):
        if law.time is None:
            return None
        if law.period is None:
            return np.array(np.nan)
        return period_of(law, [values[name] for name in law.names])
    if law.drifting or law.prescribed is not None:
        return np.array(np.nan)
    names = [forcing_names(i) for i in range(law.harmonics)]
    names += [modulation_names(name) for name in law.modulated]
    found = [values[frequency] for _, frequency, _ in names] + law.own_frequencies(values)
    if not found:
        return None
    frequencies = np.broadcast_arrays(*found)
    flat = np.stack([x.reshape(-1) for x in frequencies], axis=-1)
    return np.array([_period(row) for row in flat]).reshape(frequencies[0].shape)


def _period(frequencies: Array) -> float:
    if not (np.isfinite(frequencies).all() and (frequencies > 0.0).all()):
        return float("nan")
    base = float(frequencies.min())
    turns = 1
    for frequency in frequencies:
        ratio = float(frequency) / base
        near = Fraction(ratio).limit_denominator(DENOMINATOR)
        if abs(ratio - near) > min(1e-12 * ratio, 1e-9):  # of great ones some come near by chance
            return float("nan")
        turns = int(np.lcm(turns, near.denominator))
    return 2.0 * np.pi * turns / base


class Strobed(NamedTuple):
    """States of motions after equal times."""

    states: Array
    """Of shape (cells, kept, n), or with a tangent vector (cells, kept, 2 n)."""
    code: Index
    """Attractor at which a motion came; -1: at none."""
    taken: Index
    """Legs until then."""
    growth: Array
    """How great an error became to which every leg adds one, where that is measured; else 0."""
    status: Index
    raised: str = ""
    """What a function raised where one of them ended."""


class Targets(NamedTuple):
    """Where motions end: near points, within borders, in cells of a grid, or beyond all."""

    units: Array
    """By which the states are measured."""
    points: Array
    """Rows: state, radius, attractor."""
    grid: Array
    """Rows: its least state, and the edges of a cell."""
    side: int
    """Cells along each axis."""
    keys: Index
    """Table of the cells by their numbers, -1 for none, and of what is written in them:"""
    codes: Index
    visits: int
    """Cells of one attractor in succession after which a motion belongs to it."""
    reach: Array
    """Rows: least and greatest state of a motion that is not gone for good."""
    spans: Array
    """Rows: coordinate from, to, attractor; of each the borders:"""
    bands: Array
    """Least and greatest rates at equal distances, of shape (spans, points, 2)."""
    at: int = 0
    """Place of the coordinate, of two states."""

    @classmethod
    def none(cls, units: npt.ArrayLike) -> Targets:
        """Nowhere."""
        own = np.array(units, float)
        n, nothing = own.size, np.zeros(0, np.int64)
        reach = np.repeat([[-np.inf], [np.inf]], n, axis=1)
        spans, bands = np.zeros((0, 3)), np.zeros((0, 2, 2))
        points = np.zeros((0, n + 2))
        return cls(own, points, np.ones((2, n)), 1, nothing, nothing, 1, reach, spans, bands)


class Steps(NamedTuple):
    """How the steps of a motion are taken."""

    rtol: float = RTOL
    """Error of a step, relative to the state, that is allowed."""
    atol: float = ATOL
    """The same, absolute."""
    series: bool = True
    """By Taylor series where the law has them; by Runge-Kutta otherwise, and where series would
    take too many."""
    longest: float = LONG
    """Operations of equations up to which steps by series are compiled."""
    stiff: bool = False
    """Implicit steps, of a flow that does not vary."""


def strobe(
    law: PerturbedConservative | Equations,
    values: Mapping[str, Array],
    states: Array,
    legs: npt.ArrayLike,
    kept: int,
    skip: int = 0,
    *,
    targets: Targets | None = None,
    most_legs: int | None = None,
    enough: float = np.inf,
    steps: Steps | None = None,
    threads: int | None = None,
) -> Strobed:
    """States after skip, skip + 1, ... legs.

    States are of shape (cells, n), or (cells, 2 n) with a tangent vector as long as the error,
    whose growth is then measured; at `enough` of that a motion ends, and its state is the first
    that is kept. Where a leg is the period of the law, time begins anew after each; where it is NaN
    there is no motion. Motions end early at targets, and after so many legs at most.
    """
    from phasekit.motion.kernels.strobe import strobe as kernel

    rtol, atol, series, longest, stiff = Steps() if steps is None else steps
    turns = turns_of(law)
    count, n = len(states), turns.size
    to = Targets.none(np.ones(n)) if targets is None else targets
    legs = np.array(np.broadcast_to(np.asarray(legs, float), (count,)))
    many = max(skip + kept - 1, 0) if most_legs is None else most_legs
    period = common_period(law, values)
    never = ~np.isfinite(legs)
    again = np.full(count, True) if period is None else np.abs(legs - period) <= 1e-14 * legs
    states, legs = np.where(never[:, None], np.nan, states), np.where(never, 1.0, legs)
    found = np.full(count, -1, np.int64)
    taken, status = np.zeros(count, np.int64), np.zeros(count, np.int64)
    out, growth = np.full((count, kept, states.shape[1]), np.nan), np.zeros(count)
    if skip == 0 and kept:
        out[:, 0] = states
    groups, raised = (out, found, taken, growth, status), ""
    ends = np.full((count, n), np.nan)
    if isinstance(law, Equations) and (stiff or law.kind == "python"):
        from phasekit.motion.legs import called, implicit, strobe_by

        if stiff:
            leg = implicit(law, values, legs, to.units, rtol, atol, threads)
        else:
            leg = called(law, values, legs, to.reach, rtol, atol)
        ends, raised = strobe_by(leg, law, states, skip, many, to, enough, groups)
    elif count and many:
        tangents = states.shape[1] // n - 1
        order = order_of(rtol) if series else 0
        code, parameters = code_of(law, values, count, tangents, order, longest)
        table = table_for(law, float(np.max(legs, initial=0.0)) * many)
        beside = max(LOOSE / rtol, 1.0) if tangents else 1.0
        # A motion at rest in the middle of a box comes to no size of its own, but terms that
        # cancel there have one.
        scales = None if targets is None else np.minimum(to.units, 1.0)
        limits = limits_of(law, rtol, atol, beside=beside, scales=scales)
        shared = table, limits, code.kink, skip, many, turns, tuple(to), enough
        cells = legs, again, np.array(states)
        run(kernel, code, shared, cells, parameters, groups, status, threads)
        lost = (status == FAILED) & (out.shape[1] > 0)
        if lost.any():
            ends[lost] = out[lost, -1, :n]
            out[lost, -1] = np.nan
        judged(status, parameters)
        gone = lost & ~np.isfinite(ends).all(axis=1)
        if isinstance(law, Equations) and isinstance(law, Map) and gone.any():
            ends[gone] = _last_values(law, cells_of(values, gone), states[gone, :n])
    _mark_undefined(law, values, ends, legs, to, status)
    return Strobed(out, found, taken, growth, status, raised)


def _mark_undefined(
    law: PerturbedConservative | Equations, values: Mapping[str, Array], ends: Array, legs: Array,
    to: Targets, status: Index,
) -> None:  # fmt: skip
    """Tell motions that end where the law has no value from those that run to infinity.

    On their way to infinity they are far or fast in the last states that are known, or overflow.
    """
    lost = np.flatnonzero((status == FAILED) & np.isfinite(ends).all(axis=1))
    ends = ends[lost]
    with np.errstate(invalid="ignore"):
        near = ((to.reach[0] <= ends) & (ends <= to.reach[1])).all(axis=1)
    lost, ends = lost[near], ends[near]
    if lost.size:
        rates = np.abs(rates_on(law, cells_of(values, lost), ends))
        with np.errstate(over="ignore"):
            ways = rates if isinstance(law, Map) else rates * legs[lost][:, None]
        gone = np.asarray(ways > FAST * to.units).any(axis=1)
        status[lost[~gone]] = UNDEFINED


def _last_values(law: Equations, values: Mapping[str, Array], x: Array) -> Array:
    """The last states of iterations before those without a value."""
    for _ in range(LAST):
        further = rates_on(law, values, x)
        good = np.asarray(np.isfinite(further).all(axis=1))
        if not good.any():
            break
        x = np.where(good[:, None], further, x)
    return x


def check_period(name: str, period: Array | None) -> Array:
    """Refuse where there is no period."""
    if period is None or not np.isfinite(period).all():
        why = "nothing varies in time" if period is None else "what varies has no common period"
        raise bad(name, None, "a time in s, > 0", f"{why}, so there is no period of its own")
    return period


class Sections(NamedTuple):
    """The group "stroboscopic"."""

    section_time: Array
    section_phi: Array
    section_dphi: Array
    rotation_number: Array


def sections(
    law: PerturbedConservative,
    *arrays: npt.ArrayLike,
    n: int,
    skip: int = 0,
    period: float | None = None,
    rtol: float = RTOL,
    atol: float = ATOL,
) -> Sections:
    """States once a period, with the crossings on the last axis.

    Arrays are parameters and states at t = 0; the period is by default that of all that varies.
    """
    given = [np.asarray(array, dtype=float) for array in arrays]
    shape = np.broadcast_shapes(*(array.shape for array in given))
    *flat, phi, dphi = (
        x.reshape(()) if x.size == 1 else np.broadcast_to(x, shape).reshape(-1) for x in given
    )
    values = law.values(*flat)
    count = int(np.prod(shape, dtype=int))
    own = common_period(law, values) if period is None else np.asarray(period)
    legs = check_period("period", own) if own is None or not np.isfinite(own).any() else own
    without = int(np.sum(np.broadcast_to(~np.isfinite(legs), (count,))))
    if without:
        warn(
            f"section_phi: {without} of {count} motions have no sections, because what varies has "
            "no common period there",
            RuntimeWarning,
        )
    states = np.stack([np.broadcast_to(x, (count,)) for x in (phi, dphi)], axis=-1)
    found, status = np.empty((count, n, 2)), np.empty(count, np.int64)
    for which in kinds(law, values, count):
        cells = cells_of(values, which), states[which], entries_of(legs, which)
        own_run = strobe(law, *cells, n, skip, steps=Steps(rtol, atol))
        found[which], status[which] = own_run.states, own_run.status
    stuck(law, status)
    tell("section_phi", status, np.where(np.isfinite(legs).reshape(-1, 1), states, np.nan))
    times = np.broadcast_to(np.reshape(legs, (-1, 1)) * (skip + np.arange(n)), (count, n))
    turn = circle(law)
    angles = found[..., 0]
    if turn:
        turned = (angles[:, -1] - angles[:, 0]) / (turn * max(n - 1, 1))
        angles = 0.5 * turn - np.mod(0.5 * turn - angles, turn)
    else:
        turned = np.full(count, np.nan)
    time, angle, speed = (
        np.asarray(x, float).reshape(*shape, n) for x in (times, angles, found[..., 1])
    )
    turns = turned.reshape(shape) if n > 1 else np.full(shape, np.nan)
    return Sections(time, angle, speed, turns)
