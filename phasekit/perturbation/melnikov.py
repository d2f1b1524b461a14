"""Melnikov's function on the separatrices: its mean and its oscillation, in closed form.

``M(t0)``, the energy that a motion along the unperturbed separatrix gains to first order, is the
distance between the stable and the unstable manifold times the speed. All is per unit of inertia.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import Loop, Validity
from phasekit.inputs import bad
from phasekit.laws.perturbed import PerturbedLaw, drift_name, modulation_names
from phasekit.numerics.contract import contract
from phasekit.perturbation.harmonics import reach
from phasekit.perturbation.transforms import area_rates, transforms
from phasekit.perturbation.validity import (
    OVERDAMPED,
    WITHIN,
    bend,
    drive_share,
    rates,
    saddles_held,
    tilt_share,
    validity,
)
from phasekit.phase.exact.phase_space import Separatrices, phase_space, separatrices
from phasekit.phase.exact.under_torque import numbers_under

#: Relative step of frequencies for slopes of responses.
STEP = 1e-4
NODES, WEIGHTS = (np.asarray(x) for x in np.polynomial.legendre.leggauss(24))


class Part(NamedTuple):
    """One harmonic; per unit of amplitude its transform, greatest force, and ``nu dZ/dnu``."""

    transform: Any
    amplitude: Any
    frequency: Any
    phase: Any
    force: Any
    slope: Any


class Melnikov(NamedTuple):
    """Melnikov's function; the last axes are saddle and side."""

    melnikov_mean: Array
    melnikov_amplitude: Array
    melnikov_phase: Array
    chaos_threshold: Array
    chaos_threshold_error: Array
    turnstile_area: Array
    threshold_validity: npt.NDArray[np.int8]


def melnikov(law: PerturbedLaw, *parameters: npt.ArrayLike) -> Melnikov:
    """Melnikov's function along the separatrices of (A, B, C)."""
    refuse_prescribed(law, "melnikov")
    values = law.values(*parameters)
    A, B, C = law.coefficients(values)
    points, loops = phase_space(A, B, C)
    mean = means(law, values, loops)
    parts = oscillations(law, values, loops)
    found = assembled(mean, parts, undamped(law, values))
    count = counts(A, B, C, values["torque"], points.n_equilibria)
    held = saddles_held(loops.loop, *count)
    ways = net_angles(loops), loops.turning_offset
    area, sharp = side_areas(loops), bends(A, B, C, loops)
    return weak(law, values, found, parts, area, loops.saddle_exponent, held, ways, sharp)


def bends(A: Any, B: Any, C: Any, loops: Separatrices) -> Array:
    """Relative changes of k by swings, over their squares, at each saddle."""
    A, B, C = (np.asarray(x)[..., None] for x in (A, B, C))
    phi, k = loops.saddle_phi, loops.saddle_exponent
    third = 2.0 * A * np.sin(2.0 * phi) - B * np.sin(phi) + C * np.cos(phi)
    fourth = 4.0 * A * np.cos(2.0 * phi) - B * np.cos(phi) - C * np.sin(phi)
    return bend(third, fourth, k)


def counts(A: Any, B: Any, C: Any, torque: Any, still: Any) -> tuple[Any, Any]:
    """Numbers of equilibria under torques and without them, which are known."""
    if not np.any(torque):
        return still, still
    *cells, still = np.broadcast_arrays(A, B, C, torque, still)
    A, B, C, torque = (np.asarray(x, float).reshape(-1) for x in cells)
    found = numbers_under(A, B, C, torque, still.reshape(-1))
    return found.reshape(still.shape), still


def weak(
    law: PerturbedLaw, values: dict[str, Any], found: Melnikov, parts: Sequence[Part], area: Any,
    exponent: Any, held: Any, ways: tuple[Any, Any], sharp: Any,
) -> Melnikov:  # fmt: skip
    """Thresholds where damping is weak and saddles are held, and their errors; NaN elsewhere.

    ``ways`` are the angles by which the loops lead on, and how far they reach, as the areas are;
    ``sharp`` are changes of k by swings as `bend` has them.
    """
    each = {name: np.asarray(x)[..., None, None] for name, x in values.items()}
    held = np.asarray(held)[..., None]
    k = np.asarray(exponent)[..., None]
    rate = rates(found.melnikov_mean, area, exponent)
    # Without a mean there is nothing that a threshold could be compared with.
    rate = np.where(np.isfinite(area * k), np.where(np.isnan(rate), 0.0, rate), np.nan)
    tilt = tilt_share(each["torque"], ways, found.melnikov_mean, area * k)
    code = validity(
        law, each, rate, held, tilted=tilt > WITHIN, exponent=k, noisy=True, most=OVERDAMPED
    )
    good = code == Validity.HOLDS
    threshold = np.where(good, found.chaos_threshold, np.nan)
    share = np.zeros(threshold.shape)
    if parts:
        with np.errstate(all="ignore"):
            first = np.abs(np.asarray(parts[0].amplitude))[..., None, None]
            factors = [
                threshold if i == 0 else threshold * np.abs(_of_sides(part.amplitude)) / first
                for i, part in enumerate(parts)
            ]
        drives = [
            (factor, part.force, _of_sides(part.frequency), np.abs(part.transform), part.slope)
            for factor, part in zip(factors, parts, strict=True)
        ]
        lobes = np.asarray(ways[0]) == 0.0
        sharp = np.asarray(sharp)[..., None]
        share = drive_share(drives, found.melnikov_mean, area, k, lobes, sharp, tilt)
    strong = good & ((share > WITHIN) | np.isinf(threshold))  # a loop that does not respond
    code = np.where(strong, np.int8(Validity.STRONG_DRIVE), code)
    with np.errstate(all="ignore"):
        error = np.where(np.isinf(threshold), np.inf, share * threshold)
    return found._replace(
        chaos_threshold=threshold,
        chaos_threshold_error=error,
        turnstile_area=np.where(good, found.turnstile_area, np.nan),
        threshold_validity=code,
    )


def _of_sides(values: Any) -> Any:
    """Values of cells, with axes for saddle and side."""
    return np.asarray(values)[..., None, None]


def refuse_prescribed(law: PerturbedLaw, what: str) -> None:
    """Refuse a function or table of time, which is no harmonic."""
    if law.prescribed is not None:
        hint = "use modulation={'omega1': pk.Harmonic(...)} or drift={'omega1': rate}"
        raise bad("omega1", law.prescribed, f"None for {what}, which is in closed form", hint)


def side_areas(loops: Any) -> Array:
    """Integral of phi'^2 over time along the loop on each side."""
    loop = loops.loop[..., None]
    lobe = np.where(loop == Loop.HETEROCLINIC, 0.5, 1.0) * loops.lobe_area
    area: Array = np.where(loop == Loop.WINDING, loops.winding_area[..., None], lobe)
    return area


def net_angles(loops: Separatrices) -> Array:
    """Angle by which the loop on each side leads on."""
    turn = 2.0 * np.pi * np.array([-1.0, 1.0])
    arc = np.where(loops.loop[..., None] == Loop.HETEROCLINIC, loops.turning_offset, np.nan)
    net = np.where(loops.loop[..., None] == Loop.WINDING, turn, arc)
    return np.where(loops.loop[..., None] == Loop.LOBES, 0.0, net)


def means(law: PerturbedLaw, values: dict[str, Any], loops: Separatrices) -> Array:
    """The mean: what damping takes, a torque gives, and drift takes as the area changes."""
    A, B, C = law.coefficients(values)
    each = {name: np.asarray(x)[..., None, None] for name, x in values.items()}
    mean = -each["damping"] * side_areas(loops)
    mean = mean + np.where(each["torque"] == 0.0, 0.0, each["torque"] * net_angles(loops))
    if np.any(values["quadratic"] != 0.0):
        mean = mean - each["quadratic"] * cubes(A, loops)
    for parameter in law.drifting:
        rate = values[drift_name(parameter)]
        slopes = [rate * slope for slope in law.derivatives(values, parameter)]
        change = area_rates(A, B, C, loops.saddle_phi, loops.saddle_exponent, loops.loop, *slopes)
        arcs = loops.loop[..., None] == Loop.HETEROCLINIC
        change = np.where(arcs, arc_rates(A, B, C, loops, *slopes), change)
        if law.rate is not None and law.rate.parameter == parameter:
            level = np.asarray(law.euler(values)[0])[..., None, None]
            winds = loops.loop[..., None] == Loop.WINDING
            change = change - np.where(
                winds, rate[..., None, None] * level * net_angles(loops), 0.0
            )
        mean = mean - np.where(rate[..., None, None] == 0.0, 0.0, change)
    return np.asarray(mean)


def arc_rates(A: Any, B: Any, C: Any, loops: Separatrices, dA: Any, dB: Any, dC: Any) -> Array:
    """Rates at which the areas of arcs between saddles change; NaN where their energies part.

    There phi' is sqrt(A) |sin phi + C/A| if A > 0, B = 0, and phi -> pi/2 - phi exchanges this
    with A < 0, C = 0.
    """
    turned = np.asarray(A) < 0.0
    size, other = np.abs(A), np.where(turned, B, C)
    slope, along, apart = (
        np.where(turned, -dA, dA),
        np.where(turned, dB, dC),
        np.where(turned, dC, dB),
    )
    size, other, slope, along, apart = (
        np.asarray(x)[..., None, None]
        for x in np.broadcast_arrays(size, other, slope, along, apart)
    )
    start = loops.saddle_phi[..., None] + np.zeros(2)
    stop = start + loops.turning_offset
    flipped = turned[..., None, None]
    start, stop = (np.where(flipped, 0.5 * np.pi - x, x) for x in (start, stop))
    with np.errstate(all="ignore"):
        ratio = other / size

        def inner(phi: Array) -> Array:
            return np.asarray(0.5 * slope * (-np.cos(phi) - ratio * phi) + along * phi)

        sense = np.sign(np.sin(0.5 * (start + stop)) + ratio) * np.sign(stop - start)
        rates = sense * (inner(stop) - inner(start)) / np.sqrt(size)
    return np.asarray(np.where(apart == 0.0, rates, np.nan))


def cubes(A: Any, loops: Separatrices) -> Array:
    """Integral of |phi'|^3 over time, which is that of phi'^2 over the angle."""
    whole = np.where(
        loops.loop[..., None] == Loop.WINDING,
        2.0 * np.pi * np.array([-1.0, 1.0]),
        loops.turning_offset,
    )
    theta = 0.5 * whole[..., None] * (NODES + 1.0)
    phi, k = (x[..., None, None] for x in (loops.saddle_phi, loops.saddle_exponent))
    inner = np.asarray(A)[..., None, None, None] * (np.cos(theta + 2.0 * phi) - np.cos(2.0 * phi))
    square = 2.0 * np.sin(0.5 * theta) ** 2 * (inner + 2.0 * k * k)
    passes = np.where(loops.loop[..., None] == Loop.LOBES, 2.0, 1.0)
    return np.asarray(passes * 0.5 * np.abs(whole) * contract(square, WEIGHTS))


def oscillations(law: PerturbedLaw, values: dict[str, Any], loops: Separatrices) -> list[Part]:
    """The harmonics: those of the forcing, then those of modulated parameters."""
    A, B, C = law.coefficients(values)
    at = (A, B, C, loops.saddle_phi, loops.saddle_exponent, loops.loop)
    parts: list[Part] = []
    for amplitude, nu, phase in law.forcing(values):
        both = [transforms(*at, part * nu, 1.0, 0.0, 0.0, 0.0) for part in (1.0, 1.0 + STEP)]
        parts.append(Part(both[0], amplitude, nu, phase, 1.0, np.abs(both[1] - both[0]) / STEP))
    for parameter in law.modulated:
        amplitude, nu, phase = law.harmonic(values, modulation_names(parameter))
        dA, dB, dC = law.derivatives(values, parameter)
        g0, gs, gc = 0.0, -dB, dC
        if law.rate is not None and law.rate.parameter == parameter:
            E0, Es, Ec = (1j * nu * part for part in law.euler(values))
            g0, gs, gc = E0, gs + Es, gc + Ec
        most = np.abs(g0) + np.hypot(np.abs(gs), np.abs(gc)) + 0.5 * np.abs(dA)
        both = [transforms(*at, part * nu, g0, gs, gc, 0.5 * dA) for part in (1.0, 1.0 + STEP)]
        slope = np.abs(both[1] - both[0]) / STEP
        parts.append(Part(both[0], amplitude, nu, phase, _of_sides(most), slope))
    return parts


def undamped(law: PerturbedLaw, values: dict[str, Any]) -> Any:
    """Whether nothing makes the motion gain or lose energy on average."""
    rates = [values["damping"], values["quadratic"], *(values[drift_name(p)] for p in law.drifting)]
    return np.logical_and.reduce(np.broadcast_arrays(*(np.asarray(r) == 0.0 for r in rates)))


def assembled(mean: Array, parts: Sequence[Part], unmoved: Any) -> Melnikov:
    """Mean, amplitude, phase, threshold and turnstile of Melnikov's function."""
    if not parts:
        nothing = np.full(mean.shape, np.nan)
        still = np.where(np.isnan(mean), np.nan, 0.0)
        phase, threshold, error = (nothing.copy() for _ in range(3))
        return Melnikov(mean, still, phase, threshold, error, still.copy(), _held(mean))
    spread = [
        np.broadcast_arrays(Z, *(np.asarray(x)[..., None, None] for x in (a, nu, phase)), mean)[:4]
        for Z, a, nu, phase, *_ in parts
    ]
    shape = np.broadcast_shapes(*(Z.shape for Z, *_ in spread))
    Z = np.stack(
        [np.broadcast_to(z * a * np.exp(1j * phase), shape) for z, a, _, phase in spread], -1
    )
    nu = np.stack([np.broadcast_to(n, shape) for _, _, n, _ in spread], -1)
    mean = np.broadcast_to(mean, shape)
    amplitude, area = reach(Z, nu, np.where(mean > 0.0, -1.0, 1.0))
    same = (nu == nu[..., :1]).all(axis=-1)
    # Of several frequencies the sense of the mean tells which peak counts.
    amplitude = np.where(same | ~np.isnan(mean), amplitude, np.nan)
    total = Z.sum(axis=-1)
    phase = np.where(same & (total != 0.0), np.angle(total), np.nan)
    size = np.abs(mean)
    with np.errstate(all="ignore"):
        if len(parts) == 1:
            threshold = size / np.abs(spread[0][0])
        else:
            first = np.abs(spread[0][1])
            threshold = np.where(first == 0.0, np.nan, first * size / amplitude)
    none = np.asarray(unmoved)[..., None, None] & (mean == 0.0)
    threshold = np.where(none, np.nan, threshold)
    error = np.full(threshold.shape, np.nan)
    return Melnikov(np.array(mean), amplitude, phase, threshold, error, area, _held(mean))


def _held(mean: Array) -> npt.NDArray[np.int8]:
    return np.full(mean.shape, Validity.HOLDS, np.int8)


def quiet_frequencies(
    law: PerturbedLaw, *parameters: npt.ArrayLike, number: int = 1
) -> tuple[Array]:
    """Frequencies of a torque that leave a lobe as it is: the least one and its multiples."""
    refuse_prescribed(law, "quiet_frequencies")
    values = law.values(*parameters)
    A, B, C = law.coefficients(values)
    loops = separatrices(A, B, C)
    phi, k = loops.saddle_phi, loops.saddle_exponent
    A, B, C = (np.asarray(x)[..., None] for x in (A, B, C))
    with np.errstate(all="ignore"):
        # cosh(a) = (-S + i k^2)/sqrt D; sinh(Re a) = |(k^2, Re q)|/sqrt D
        q = 1j * k * np.sqrt(A.astype(complex)) * np.exp(1j * phi)
        # D = mu (A - mu) in the forms that do not cancel, mu = B/cos phi
        upright = B / np.cos(phi) * (k * k + A * np.sin(phi) ** 2)
        level = C / np.sin(phi) * (k * k - A * np.cos(phi) ** 2)
        root = np.sqrt(np.where(A >= 0.0, upright, level))
        x = np.arcsinh(np.hypot(k * k, q.real) / root)
        quiet = np.where(loops.loop == Loop.LOBES, np.pi * k / x, np.nan)
    both = np.repeat(quiet[..., None], 2, axis=-1)
    return (both[..., None] * np.arange(1.0, number + 1.0),)
