"""Normal forms of periodic orbits at folds, branch points, period doublings and tori.

On the center manifold of the orbit, with tau the time along it and xi the other coordinate,
dtau/dt = 1 + ... and

    fold              xi' = b (p - p0) + a xi^2
    branch point      xi' = d (p - p0) xi + a xi^2, or + c xi^3 at a pitchfork
    period doubling   xi' = c xi^3
    torus             xi' = i omega xi + d xi |xi|^2

([Iooss1988]; [KuznetsovEtAl2005]). The coefficients are what makes linear equations solvable whose
operator is singular; bordered by the functions concerned, these equations give them as unknowns,
so that no adjoint function is needed. Critical functions have a mean square of 1 over a period.
Second and third derivatives of f are taken along the critical functions by `multilinear`; what
coefficients change by with the errors of those is their error.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.normal_form import DIGITS, SMALL, unknown
from phasekit.cycles import divergence, starts
from phasekit.cycles.cycles import Cycles, Solution
from phasekit.cycles.divergence import single
from phasekit.cycles.linear import Linear, lacking_memory, wave
from phasekit.cycles.multilinear import VARIANTS
from phasekit.cycles.point import Point

Form = Callable[[Linear], dict[str, float]]

GROWTH = 10.0  # logarithm of the ratio of sizes of a critical function from which on digits cancel
CLEAR = 1e-6  # relative error of a coefficient up to which nothing is said of it
UNTRIED = "how coefficients go with the mesh is not known: on a finer one there is no orbit"
VERTICAL = 1e-5  # part along the parameter, beside its span, of a tangent that does not move it


def coefficients(
    cycles: Cycles,
    point: Point,
    powers: dict[str, int],
    *ways: Callable[[Point | Solution], Form],
    crossing: bool = False,
) -> tuple[dict[str, float], str]:
    """Coefficients, NaN where their errors hide them, and what is to be said of their errors.

    Errors are what changes with the derivatives of f, and on intervals of half the length. Each of
    the ``ways`` gives the form of an orbit with its tangent; one after another is tried for a
    better one. ``powers`` are those of the states with which coefficients of xi' go. At branch
    points families are ``crossing``.
    """
    lacking = lacking_memory(cycles, (8 if crossing else 2) * point.orbit.intervals)
    if lacking:
        return dict.fromkeys(powers, np.nan), f"coefficients are not computed: {lacking}"
    size = float(np.sqrt(np.mean(cycles.scale**2)))
    fine = _halved(cycles, point, crossing)
    best: tuple[dict[str, float], dict[str, float], dict[str, float]] = {}, {}, {}
    least, worst = {}, np.inf
    for way in ways:
        found, errors, by_mesh = _with_errors(cycles, point, fine, way)
        # Such a coefficient moves xi by its size in a period.
        least = {name: SMALL / (point.orbit.y[0] * size ** powers.get(name, 0)) for name in found}
        sizes = ((abs(one), least[name] / CLEAR, name) for name, one in found.items())
        parts = [(errors[name] + by_mesh[name]) / max(one, other) for one, other, name in sizes]
        part = float(np.max(parts, initial=0.0))
        if not best[0] or part < worst:
            best, worst = (found, errors, by_mesh), part if np.isfinite(part) else np.inf
        if worst <= CLEAR:
            break
    found, errors, by_mesh = best
    said, coarse = [] if fine is not None else [UNTRIED], []
    for name, value in list(found.items()):
        error = float(np.maximum(errors[name], by_mesh[name]))
        if error <= max(CLEAR * abs(value), least[name]):
            continue
        if error <= DIGITS * abs(value):
            said.append(f"{name} is known to {error:.1g} only")
            continue
        found[name] = np.nan
        if errors[name] <= max(DIGITS * abs(value), least[name]):
            coarse.append(name)
            said.append(f"{name} not known: on intervals of half the length it is not the same")
    missing = unknown({name: one for name, one in found.items() if name not in coarse})
    return found, "; ".join([*said, *([missing] if missing else [])])


def _with_errors(
    cycles: Cycles, point: Point, fine: Solution | None, way: Callable[[Point | Solution], Form]
) -> tuple[dict[str, float], dict[str, float], dict[str, float]]:
    """Coefficients, their errors by the derivatives of f, and by the mesh."""
    line = Linear(cycles, point.orbit)
    form = way(point)
    found = form(line)
    errors = dict.fromkeys(found, 0.0)
    # Those of matrices have one other variant.
    for variant in range(1, 2 if cycles.jets.exact else VARIANTS):
        line.variant = variant
        other = form(line)
        for name in found:
            errors[name] = max(errors[name], abs(other.get(name, np.nan) - found[name]))
    if fine is None:
        return found, errors, dict.fromkeys(found, 0.0)
    other = way(fine)(Linear(cycles, fine.orbit))
    return found, errors, {k: abs(other.get(k, np.nan) - one) for k, one in found.items()}


def _halved(cycles: Cycles, point: Point, crossing: bool) -> Solution | None:
    """The orbit on a mesh of intervals of half the length; None if it is not found."""
    mesh = point.orbit.mesh
    fine = np.sort(np.concatenate([mesh, 0.5 * (mesh[1:] + mesh[:-1])]))
    orbit, (dx,) = cycles.on(fine, point.orbit, point.dx)
    if crossing:
        return starts.crossing(cycles, orbit, (dx, point.dy))
    found = cycles.correct(orbit, *cycles.rows(orbit, dx, point.dy))
    return found if found.converged else None


def at_fold(
    line: Linear, dx: Array, stretch: float | None = None, growth: float = GROWTH
) -> dict[str, float]:
    """The coefficients a and b of a fold, from the tangent of its family.

    Of a forced system ``stretch`` is the part by which its period grows with the parameter. Of a
    single multiplier they are integrals from a ``growth`` of the critical function on; equations
    leave less out as long as they keep their digits.
    """
    cycles, orbit = line.cycles, line.orbit
    if cycles.forced and stretch is None:
        stretch = float(cycles.own_period(orbit.y)[1][0]) / orbit.y[0]
    stretch = stretch if stretch and cycles.forced else 0.0
    if single(cycles) and (it := divergence.across(line)).moving and it.growth > growth:
        return divergence.fold_form(it, dx, stretch)
    if cycles.forced:
        v, alpha = line.unit(dx), 0.0
    else:
        # A part along the flow, which depends on how phases are compared, would count in its size.
        v, alpha = line.across(dx)
    at = line.values(v)
    columns = rows = [at] if cycles.forced else [at, line.f]
    bent = line.total(v, 0.5 * line.second(v, v), -alpha * line.times_A(v))
    a = line.solve(bent, columns, rows)[1][0]
    b = line.solve(line.by_parameter(stretch), columns, rows)[1][0]
    return {"a": float(a), "b": float(b)}


def at_branching(
    line: Linear, own: tuple[Array, Array], other: tuple[Array, Array]
) -> dict[str, float]:
    """The coefficients d and a at which two families cross, d and c at a pitchfork.

    ``own`` is the tangent (dx, dy) of the family that is followed, ``other`` another solution of
    the singular equations. With the parameter mu from its value and h along a family on which it
    moves, x + xi v + mu h + ... goes with dtau/dt = 1 + alpha xi + ....
    """
    cycles, orbit = line.cycles, line.orbit
    (dx, dy), (ex, ey) = own, other
    p, r = float(dy[1] / cycles.width[0]), float(ey[1] / cycles.width[0])
    steep = abs(p) < VERTICAL
    if steep and abs(r) < VERTICAL:
        return {}  # on neither family the parameter moves
    v = p * ex - r * dx
    v = v * np.sign(v.flat[np.argmax(np.abs(v / cycles.scale))])
    # The parameter moves by 1; where the own family does not move it, any other one will do.
    k, j = (p, r) if steep else (p, 0.0)
    moved = (k * p + j * r) * cycles.width[0]
    h, h_y = (k * dx + j * ex) / moved, (k * dy + j * ey) / moved
    v, alpha = (line.unit(v), 0.0) if cycles.forced else line.across(v)
    at = line.values(v)
    columns = rows = [at] if cycles.forced else [at, line.f]
    stretch = float(h_y[0]) / orbit.y[0]
    g = line.moved(h, h_y, v) + stretch * line.times_A(v)
    g -= alpha * (line.times_A(h) + line.by_parameter(stretch))
    d = float(line.solve(g, columns, rows)[1][0])
    bent = 0.5 * line.second(v, v)
    w, unknowns = line.solve(bent - alpha * line.times_A(v), columns, rows)
    a = float(unknowns[0])
    nothing = np.zeros(cycles.q)
    length = np.sqrt(cycles.inner(orbit.mesh, v, v, nothing, nothing))
    if not steep and not abs(a) < VERTICAL * abs(d) * float(cycles.width[0]) * length:
        return {"d": d, "a": a}
    beta = 0.0 if cycles.forced else float(unknowns[1])
    cubic = line.third(v, v) / 6.0 + line.second(v, w) - beta * line.times_A(v)
    cubic -= alpha * (line.times_A(w) + bent - alpha * line.times_A(v))
    return {"d": d, "c": float(line.solve(cubic, columns, rows)[1][0])}


def at_doubling(line: Linear, v: Array) -> dict[str, float]:
    """The coefficient c of a period doubling: the doubled orbits are stable beside it if c < 0."""
    v = line.unit(v)
    at = line.values(v)
    g = line.second(v, v)
    if line.cycles.forced:
        h, unknown = line.solve(g, [], [])
        a1 = 0.0
    else:
        h, unknown = line.solve(g, [line.f], [line.f])
        a1 = 0.5 * float(unknown[0])
    terms = line.third(v, v) / 6.0, 0.5 * line.second(v, h), -a1 * line.times_A(v)
    c = line.solve(line.total(v, *terms), [at], [at], sigma=-1.0)[1][0]
    return {"c": float(c)}


def at_torus(line: Linear, angle: float, v: Array | None = None) -> dict[str, float]:
    """The coefficient d of a torus bifurcation, of a pair of multipliers with an angle.

    Its critical function, real and imaginary part side by side, is ``v`` where it is known.

    The torus is stable beside it if the real part of d is negative.
    """
    n, omega = line.n, angle / line.orbit.y[0]
    v = wave(line, omega) if v is None else line.unit(v)
    u, w = np.ascontiguousarray(v[:, :n]), np.ascontiguousarray(v[:, n:])
    second = line.second
    g = second(u, u) + second(w, w)
    if line.cycles.forced:
        h, unknown = line.solve(g, [], [])
        a1 = 0.0
    else:
        h, unknown = line.solve(g, [line.f], [line.f])
        a1 = float(unknown[0])
    g = np.hstack([second(u, u) - second(w, w), 2.0 * second(u, w)])
    double, _ = line.solve(g, [], [], turn=2.0 * omega)
    p, q = np.ascontiguousarray(double[:, :n]), np.ascontiguousarray(double[:, n:])
    terms = [
        np.hstack([line.third(u, u) + line.third(w, u), line.third(u, w) + line.third(w, w)]),
        np.hstack([2.0 * second(u, h), 2.0 * second(w, h)]),
        np.hstack([second(u, p) + second(w, q), second(u, q) - second(w, p)]),
        np.hstack(
            [line.times_A(u) + omega * line.values(w), line.times_A(w) - omega * line.values(u)]
        ),
    ]
    terms[3] *= -2.0 * a1
    cubic = line.total(v, *(0.5 * one for one in terms))
    at = line.values(v)
    around = np.hstack([-at[:, n:], at[:, :n]])  # i v
    _, d = line.solve(cubic, [at, around], [at, around], turn=omega)
    return {"d": float(d[0]), "d_imag": float(d[1]), "angle": angle}
