"""Melnikov's function in any potential: quadrature along the separatrices, with its error.

The trapezoidal rule over the whole time converges exponentially, because the motion is analytic
next to the real axis and decays at both ends.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import Loop
from phasekit.laws.formulas import symbols_of
from phasekit.laws.perturbed import PerturbedLaw, drift_name, modulation_names
from phasekit.numerics.contract import contract
from phasekit.perturbation.melnikov import (
    Melnikov,
    Part,
    assembled,
    refuse_prescribed,
    undamped,
    weak,
)
from phasekit.perturbation.validity import bend, saddles_held
from phasekit.phase.numerical import functions, torqued
from phasekit.phase.numerical.formula import Formula, make_formula
from phasekit.phase.numerical.separatrices import Separatrices

#: Times up to this over the exponent; e^-REACH is below rounding.
REACH = 36.0
#: Points in time: as few as do, else many.
POINTS = (3 << 7, 1 << 11)
#: Frequencies over the exponent at which signs of the response are looked at.
WAVES = np.linspace(0.0, 40.0, 801)[1:]
#: Change of k by a swing over its square, beside k/S, where derivatives of the potential are not
#: at hand: in wells of twice the frequency it is 2.2, of one less.
SHARP = 2.5
#: Cells at a time, for the memory of their motions.
CELLS = 256
#: Greatest error of what is said, relative, and that of motions and sums relative to their size.
WORST, ROUNDING = 1e-6, 1e-13


@functools.lru_cache(maxsize=32)
def derivative(formula: Formula, parameter: str) -> Formula:
    """The derivative of a potential by a parameter."""
    symbol = symbols_of((formula.coordinate, *formula.names))[parameter]
    by = formula.expression.diff(symbol)
    return make_formula(by, formula.coordinate, formula.names, formula.period, formula.interval)


class Paths:
    """Motions along all separatrices of some cells: the axes are cell, saddle, side, time."""

    def __init__(self, time: Array, phi: Array, dphi: Array, parameters: Sequence[Array]) -> None:
        self.time, self.phi, self.dphi = time[:, :, None, :], phi, dphi
        self.step = self.time[..., 1] - self.time[..., 0]
        self.parameters = [p[:, None, None, None] for p in parameters]

    @classmethod
    def from_formula(
        cls, formula: Formula, parameters: list[Array], loops: Separatrices, points: int
    ) -> Paths:
        """Follow the separatrices of a potential."""
        # Cells of one potential, under many drives, have the same motions.
        keys = np.stack([*parameters, np.zeros(len(loops.saddle_phi))], axis=1)
        _, first, which = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        which = which.reshape(-1)
        k = loops.saddle_exponent[first]
        times = times_of(k, points)
        shape = (len(first), k.shape[-1], 2, times.shape[-1])
        phi, dphi = np.full(shape, np.nan), np.full(shape, np.nan)
        for saddle in range(k.shape[-1]):
            there = np.flatnonzero(np.isfinite(k[:, saddle]) & (k[:, saddle] > 0.0))
            own = [p[first[there], None] for p in parameters]
            for side in (0, 1) if there.size else ():
                found = functions.separatrix_motion(
                    formula, *own, times[there, saddle], saddle=saddle, side=side
                )
                moved = closed(found.motion_phi, found.motion_dphi)
                phi[there, saddle, side], dphi[there, saddle, side] = moved
        return cls(times[which], phi[which], dphi[which], parameters)

    def integral(self, values: Any, corner: Any = False) -> Sum:
        """Integral over time of what is analytic, or has a corner as that of abs(t)^3 at t = 0."""
        size = np.abs(values).sum(axis=-1)
        fine, coarse = values.sum(axis=-1), 2.0 * values[..., ::2].sum(axis=-1)
        # Half the step squares the error; with a corner it is of the fourth order.
        fourth = (fine - coarse) / 15.0
        with np.errstate(all="ignore"):
            square = np.where(size > 0.0, np.abs(fine - coarse) ** 2 / size, 0.0 * size)
        error = np.where(corner, np.abs(fourth), square) + ROUNDING * size
        return Sum(np.where(corner, fine + fourth, fine), error, size).times(self.step)

    def transform(self, values: Any, nu: Array) -> tuple[Sum, Array]:
        """Integral Z of phi' g e^{i nu t}, its real and imaginary part, and ``|nu dZ/dnu|``.

        Nothing is known of a frequency that half of the points cannot tell from a lower one.
        """
        nu = nu[:, None, None, None]
        turned = np.exp(1j * nu * self.time) * self.dphi * values
        found = self.integral(turned)
        told = 2.0 * np.abs(nu[..., 0]) * self.step < np.pi
        slope = np.abs(nu[..., 0] * self.step * (turned * self.time).sum(axis=-1))
        return found._replace(error=np.where(told, found.error, np.inf)), slope


class Sum(NamedTuple):
    """An integral, or several together: its error, and the size of what was added."""

    value: Any
    error: Any
    size: Any

    def times(self, factor: Any) -> Sum:
        """It times a factor."""
        size = np.abs(factor)
        return Sum(factor * self.value, size * self.error, size * self.size)

    def plus(self, other: Sum) -> Sum:
        """Both together."""
        return Sum(*(one + more for one, more in zip(self, other, strict=True)))

    def has_digits(self) -> Any:
        """Whether it has not lost too many digits."""
        return self.error <= WORST * np.abs(self.value)

    def settled(self) -> Any:
        """The value, NaN where it has lost too many digits; 0 where it is but rounding of 0."""
        nothing = (np.abs(self.value) <= self.error) & (self.error <= 2.0 * ROUNDING * self.size)
        return np.where(self.has_digits(), self.value, np.where(nothing, 0.0, np.nan))


def times_of(k: Array, points: int) -> Array:
    """Times from one end of a separatrix to the other, on a new axis; NaN without a saddle."""
    grid = np.linspace(-REACH, REACH, points + 1)
    with np.errstate(all="ignore"):
        return np.asarray(grid / k[..., None])


def closed(phi: Array, dphi: Array) -> tuple[Array, Array]:
    """Motions that come to rest at both ends, NaN for the others."""
    speed = np.abs(dphi)
    size = speed.max(axis=-1, keepdims=True, initial=0.0)
    good = np.isfinite(phi).all(axis=-1, keepdims=True)
    good &= speed[..., [0, -1]].max(-1, keepdims=True) < 1e-9 * size
    return np.where(good, phi, np.nan), np.where(good, dphi, np.nan)


class Quiet(NamedTuple):
    """Frequencies of a torque that leave a lobe as it is; the last axis is their order."""

    quiet_frequency: Array
    quiet_frequency_error: Array


def melnikov(law: PerturbedLaw, *parameters: npt.ArrayLike) -> Melnikov:
    """Melnikov's function along the separatrices of any potential."""
    refuse_prescribed(law, "melnikov")
    return _by_cells(law, parameters, functools.partial(_melnikov, law))


def quiet_frequencies(law: PerturbedLaw, *parameters: npt.ArrayLike, number: int = 1) -> Quiet:
    """The least frequencies of a torque to which lobes do not respond, in any potential."""
    refuse_prescribed(law, "quiet_frequencies")
    return _by_cells(law, parameters, functools.partial(_quiet, law, number))


Found = TypeVar("Found", Melnikov, Quiet)


def _by_cells(
    law: PerturbedLaw, parameters: Sequence[npt.ArrayLike],
    function: Callable[[dict[str, Array], Separatrices], Found],
) -> Found:  # fmt: skip
    """What a function finds of values and separatrices, some cells at a time."""
    values = law.values(*parameters)
    formula: Any = law.base
    shape = np.broadcast_shapes(*(np.shape(x) for x in values.values()))
    flat = {n: np.array(np.broadcast_to(x, shape), float).reshape(-1) for n, x in values.items()}
    loops: Any = functions.separatrices(formula, *(flat[name] for name in formula.names))
    size = loops.saddle_phi.shape[0] if formula.names else 1
    if not formula.names:  # a formula without parameters is one system
        loops = Separatrices._make(np.asarray(x)[None] for x in loops)
    cells = int(np.prod(shape, dtype=int))
    found: list[Any] = []
    for start in range(0, cells, CELLS):
        part = slice(start, min(start + CELLS, cells))
        one = {name: x[part] for name, x in flat.items()}
        own = [_rows_of(field, part, cells if size == cells else 1) for field in loops]
        found.append(function(one, Separatrices._make(own)))
    fields: Any = zip(*found, strict=True)
    whole = [np.concatenate(parts) for parts in fields]
    kind: Any = type(found[0])
    joined: Found = kind._make(field.reshape(shape + field.shape[1:]) for field in whole)
    return joined


def _rows_of(field: Any, part: slice, size: int) -> Any:
    """Some rows of an array, of which there may be one for all."""
    if size > 1:
        return field[part]
    return np.broadcast_to(field[:1], (part.stop - part.start, *field.shape[1:]))


def _melnikov(law: PerturbedLaw, values: dict[str, Array], loops: Separatrices) -> Melnikov:
    formula: Any = law.base
    few, lost = _cells(law, formula, values, loops, POINTS[0])
    if lost.any():
        rows = np.flatnonzero(lost)
        left = Separatrices._make(x[rows] for x in loops)
        again = {name: x[rows] for name, x in values.items()}
        many, _ = _cells(law, formula, again, left, POINTS[1])
        fields: tuple[Any, ...] = few
        for field, better in zip(fields, many, strict=True):
            field[rows] = better
    return few


def _quiet(
    law: PerturbedLaw, number: int, values: dict[str, Array], loops: Separatrices
) -> Quiet:  # fmt: skip
    """Zeros of the sine transform of the speed, which is odd about the turning point."""
    formula: Any = law.base
    paths = Paths.from_formula(formula, [values[name] for name in formula.names], loops, POINTS[1])
    shape = (*paths.dphi.shape[:-1], number)
    found = Quiet(np.full(shape, np.nan), np.full(shape, np.nan))
    ends = np.isin(loops.loop, (Loop.LOBE, Loop.LOBES))[..., None]
    closed_ = ends & (np.abs(paths.phi[..., -1] - paths.phi[..., 0]) < 1e-6 * np.ptp(paths.phi, -1))
    grid = np.linspace(-REACH, REACH, POINTS[1] + 1)
    speeds = paths.dphi[closed_]
    exponent = np.broadcast_to(loops.saddle_exponent[..., None], closed_.shape)[closed_]
    response = contract(speeds, np.sin(np.outer(WAVES, grid)))
    blur = 8.0 * ROUNDING * np.abs(speeds).sum(axis=-1)
    for row, at in enumerate(zip(*np.nonzero(closed_), strict=True)):
        waves, errors = _zeros(speeds[row], response[row], blur[row], number)
        found.quiet_frequency[(*at, slice(waves.size))] = exponent[row] * waves
        found.quiet_frequency_error[(*at, slice(waves.size))] = exponent[row] * errors
    return found


def _zeros(speed: Array, response: Array, blur: float, number: int) -> tuple[Array, Array]:
    """The first zeros of the response to waves, and their errors: as far as signs are sure."""
    grid = np.linspace(-REACH, REACH, speed.size)
    sure = np.flatnonzero(np.abs(response) > blur)
    # A zero may hide the sign of one wave; more of them in a row are noise.
    apart = np.flatnonzero(np.diff(sure, prepend=sure[:1]) > 2)
    sure = sure[: apart[0]] if apart.size else sure
    turn = np.flatnonzero(np.diff(np.sign(response[sure])))[:number]
    low, high = WAVES[sure[turn]], WAVES[sure[turn + 1]]
    start = np.sign(response[sure[turn]])
    for _ in range(52):
        middle = 0.5 * (low + high)
        same = np.sign(contract(np.sin(middle[:, None] * grid), speed)) == start
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    waves = 0.5 * (low + high)
    slope = contract(np.cos(waves[:, None] * grid) * grid, speed)
    with np.errstate(all="ignore"):
        errors = blur / np.abs(slope)
    known = np.logical_and.accumulate(errors <= WORST * waves)
    return waves[known], errors[known]


def _cells(
    law: PerturbedLaw, formula: Formula, values: dict[str, Array], loops: Separatrices,
    points: int,
) -> tuple[Melnikov, Any]:  # fmt: skip
    """Melnikov's function by so many points in time, and in which cells they were too few."""
    paths = Paths.from_formula(formula, [values[name] for name in formula.names], loops, points)
    held = saddles_held(loops.loop, *counts(law, values))
    own = [values[name][:, None] for name in formula.names]
    third, fourth = (formula.derivative(n)(loops.saddle_phi, *own) for n in (3, 4))
    sharp = bend(third, fourth, loops.saddle_exponent)
    return along(law, paths, values, held=held, sharp=sharp)


def counts(law: PerturbedLaw, values: dict[str, Array]) -> tuple[Array, Array]:
    """Numbers of equilibria under torques and without them; one everywhere if all is level."""
    cells = dict(zip(values, np.broadcast_arrays(*values.values()), strict=True))
    found, still = (np.ones(cells["torque"].shape, int) for _ in range(2))
    turned = cells["torque"] != 0.0
    if np.any(turned):
        own = [cells[name][turned] for name in law.names]
        level = [0.0 * x if name == "torque" else x for name, x in zip(law.names, own, strict=True)]
        for count, parameters in ((found, own), (still, level)):
            count[turned] = torqued.equilibria(law, *parameters).n_equilibria
    return found, still


def along(
    law: PerturbedLaw,
    paths: Paths,
    values: dict[str, Array],
    weight: Any = 1.0,
    held: Any = True,
    mobility: Any = 1.0,
    sharp: Any = None,
) -> tuple[Melnikov, Any]:
    """Melnikov's function along motions, and in which cells they have too few points.

    Forces are per unit of inertia, of which there are `weight`: that of the motion is less by the
    factor `mobility`. Changes of k by swings are `sharp`, or several times k/S.
    """
    formula: Any = law.base
    each = {name: x[:, None, None] for name, x in values.items()}
    square = paths.dphi**2
    total = paths.integral(square).times(-each["damping"])
    net = paths.phi[..., -1] - paths.phi[..., 0]
    reach = np.abs(paths.phi - paths.phi[..., :1]).max(axis=-1)
    lobe = np.abs(net) < 1e-6 * reach
    net = np.where(lobe, 0.0, net)
    gain = each["torque"] * net
    total = total.plus(Sum(gain, 0.0 * gain, np.abs(gain)))
    if np.any(values["quadratic"] != 0.0):
        cubes = paths.integral(square * np.abs(paths.dphi), corner=lobe)
        total = total.plus(cubes.times(-each["quadratic"]))
    for parameter in law.drifting:
        rate = each[drift_name(parameter)]
        loss = _area_loss(paths, formula, parameter).times(rate)
        total = total.plus(Sum(*(np.where(rate == 0.0, 0.0, x) for x in loss)))
    mean = total.settled()
    # A swing is beside the root of the area, which has the weight.
    unit = mobility * np.sqrt(weight)
    drives: list[tuple[Sum, Any, Any, Any, Any, Any]] = []
    for amplitude, nu, phase in law.forcing(values):
        Z, rise = paths.transform(1.0, nu)
        drives.append((Z, amplitude, nu, phase, unit, weight * rise))
    for parameter in law.modulated:
        amplitude, nu, phase = law.harmonic(values, modulation_names(parameter))
        slope = -derivative(formula, parameter).slopes(paths.phi, *paths.parameters)
        most = np.abs(slope).max(axis=-1)
        Z, rise = paths.transform(slope, nu)
        drives.append((Z, amplitude, nu, phase, unit * most, weight * rise))
    sizes = [np.abs(drive[1])[:, None, None] for drive in drives]
    responses = [
        np.where(Z.has_digits(), size * np.abs(Z.value), 0.0)
        for (Z, *_), size in zip(drives, sizes, strict=True)
    ]
    parts: list[Part] = []
    for i, (Z, *rest) in enumerate(drives):
        # What is small beside the others need not have digits of its own.
        others = [one for j, one in enumerate(responses) if j != i]
        good = Z.has_digits()
        if others:
            good |= sizes[i] * Z.error <= WORST * np.max(others, axis=0)
        parts.append(Part(weight * np.where(good, Z.value, np.nan), *rest))
    found = assembled(weight * mean, parts, undamped(law, values))
    with np.errstate(all="ignore"):
        exponent = REACH / paths.time[..., 0, -1]
    area = weight * paths.integral(square).settled()
    ways = weight * net, weight * reach
    if sharp is None:
        with np.errstate(all="ignore"):
            sharp = SHARP * np.max(exponent[..., None] / area, axis=-1)
    found = weak(law, values, found, parts, area, exponent, held, ways, sharp)
    closed = np.isfinite(paths.phi[..., 0])
    lost = closed & (np.isnan(found.melnikov_mean) | np.isnan(found.melnikov_amplitude))
    return found, lost.any(axis=(1, 2))


def _area_loss(paths: Paths, formula: Formula, parameter: str) -> Sum:
    """Integral of V_p(phi) - V_p(phi_s): minus the derivative of the area."""
    level = derivative(formula, parameter).values(paths.phi, *paths.parameters)
    rise = level - level[..., :1]
    size = np.abs(rise).max(axis=-1)
    returns = np.abs(rise[..., -1]) <= 1e-9 * size
    return Sum(*(np.where(returns, x, np.nan) for x in paths.integral(rise)))
