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
import numpy.typing as npt

from phasekit.bifurcation.continuation.normal_form import DIGITS, SMALL, unknown
from phasekit.bifurcation.continuation.periodic.linear import Linear, wave
from phasekit.bifurcation.continuation.periodic.multilinear import VARIANTS

Array = npt.NDArray[np.float64]

CLEAR = 1e-6  # relative error of a coefficient up to which nothing is said of it
VERTICAL = 1e-5  # part along the parameter, beside its span, of a tangent that does not move it


def known(
    line: Linear, form: Callable[[Linear], dict[str, float]], powers: dict[str, int]
) -> tuple[dict[str, float], str]:
    """Coefficients, NaN where their errors hide them, and what is to be said of their errors.

    ``powers`` are those of the states with which coefficients of xi' go, where they have errors.
    """
    found = form(line)
    errors = dict.fromkeys(found, 0.0)
    # Those of matrices have one other variant.
    for variant in range(1, 2 if line.cycles.jets.exact else VARIANTS):
        line.variant = variant
        other = form(line)
        for name in found:
            errors[name] = max(errors[name], abs(other.get(name, np.nan) - found[name]))
    size = float(np.sqrt(np.mean(line.cycles.scale**2)))
    said = []
    for name, value in list(found.items()):
        # Such a coefficient moves xi by its size in a period.
        unit = 1.0 / (line.orbit.y[0] * size ** powers.get(name, 0))
        if errors[name] <= max(CLEAR * abs(value), SMALL * unit):
            continue
        if errors[name] <= DIGITS * abs(value):
            said.append(f"{name} is known to {errors[name]:.1g} only")
        else:
            found[name] = np.nan
    missing = unknown(found)
    return found, "; ".join([*said, *([missing] if missing else [])])


def at_fold(line: Linear, dx: Array, dy: Array, stretch: float | None = None) -> dict[str, float]:
    """The coefficients a and b of a fold, from the tangent of its family.

    Of a forced system ``stretch`` is the part by which its period grows with the parameter.
    """
    cycles, orbit = line.cycles, line.orbit
    if cycles.forced:
        v, alpha = line.unit(dx), 0.0
        if stretch is None:
            stretch = float(cycles.own_period(orbit.y)[1][0]) / orbit.y[0]
    else:
        # A part along the flow, which depends on how phases are compared, would count in its size.
        v, alpha = line.across(dx)
        stretch = 0.0
    at = line.at(v)
    columns = rows = [at] if cycles.forced else [at, line.f]
    a = line.solve(0.5 * line.second(v, v) - alpha * line.times_A(v), columns, rows)[1][0]
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
    at = line.at(v)
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
    at = line.at(v)
    g = line.second(v, v)
    if line.cycles.forced:
        h, unknown = line.solve(g, [], [])
        a1 = 0.0
    else:
        h, unknown = line.solve(g, [line.f], [line.f])
        a1 = 0.5 * float(unknown[0])
    cubic = line.third(v, v) + 3.0 * line.second(v, h) - 6.0 * a1 * line.times_A(v)
    c = line.solve(cubic, [at], [at], sigma=-1.0)[1][0] / 6.0
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
    real = line.third(u, u) + line.third(w, u) + 2.0 * second(u, h) + second(u, p) + second(w, q)
    imaginary = line.third(u, w) + line.third(w, w) + 2.0 * second(w, h)
    imaginary += second(u, q) - second(w, p)
    real -= 2.0 * a1 * (line.times_A(u) + omega * line.at(w))
    imaginary -= 2.0 * a1 * (line.times_A(w) - omega * line.at(u))
    at = line.at(v)
    around = np.hstack([-at[:, n:], at[:, :n]])  # i v
    _, d = line.solve(np.hstack([real, imaginary]), [at, around], [at, around], turn=omega)
    return {"d": 0.5 * float(d[0]), "d_imag": 0.5 * float(d[1]), "angle": angle}
