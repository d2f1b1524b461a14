"""From a bracket to a special point: narrowed on the path, refined on its defining system."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation import normal_form as forms
from phasekit.bifurcation.continuation.curve import TIGHT, Curve, nullspace
from phasekit.bifurcation.continuation.events import Bracket
from phasekit.bifurcation.continuation.path import Sample, bracket_root
from phasekit.bifurcation.continuation.spectrum import eigenvalues_of, test_functions
from phasekit.kernels.defining import BRANCH, FOLD, HOPF

Array = npt.NDArray[np.float64]

CONVERGED, GUESS = "converged", "guess"
# A tangent whose part along the parameter is less, on scaled axes, does not move it.
VERTICAL = 1e-5
FLAT = 1e-12


@dataclass(frozen=True)
class Special:
    """A special point: unknowns (x, free parameters), and how well it is known."""

    kind: str
    u: Array
    interval: tuple[float, float]
    residual: float
    status: str
    message: str = ""
    normal_form: dict[str, float] = field(default_factory=dict)
    tangent: Array | None = None  # of the path
    other: Array | None = None  # of the other branch, at a branch point
    extra: Array | None = None  # the unknowns that its defining system adds


def locate(curve: Curve, bracket: Bracket) -> list[Special]:
    """The special points of one bracket."""
    with np.errstate(all="ignore"):
        found = _locate(curve, bracket)
    ends = [abs(s.tangent[curve.n]) / curve.scale[curve.n] for s in (bracket.a, bracket.b)]
    if max(ends) < FLAT:  # the parameter does not move: signs are those of rounding errors
        found = [one for one in found if one.status == CONVERGED and one.kind != "fold"]
    return found


def _locate(curve: Curve, bracket: Bracket) -> list[Special]:
    found: list[Special] = []
    if "branch" in bracket.changes:
        point = _branch_point(curve, bracket)
        if point is not None:
            found.append(point)
    if "fold" in bracket.changes and not any(_is_turn(curve, point) for point in found):
        found.append(_fold(curve, bracket))
    if "pair" in bracket.changes:
        point = _pair(curve, bracket)
        if point is not None:
            found.append(point)
    if not found and bracket.crossing:
        found.append(_several(curve, bracket))
    return found


def extended(curve: Curve, kind: int, u: Array, extra: Array, aux: Array | None = None) -> Curve:
    """The curve's own unknowns with those of a defining system, whose sizes are those of extra.

    A right vector v counts in units of the states, a left one in units of 1/f.
    """
    more, n, m = len(extra), curve.n, curve.m
    sizes = np.ones(more)
    sizes[:n] = curve.scale[:n]
    if kind == HOPF:
        sizes[-1] = max(abs(float(extra[-1])), 1e-300) if extra[-1] else 1.0
    if kind == BRANCH:
        sizes[:n] = 1.0 / force_sizes(curve, u)
    return curve.replace(
        kind=kind,
        scale=np.concatenate([curve.scale[:m], sizes]),
        period=np.concatenate([curve.period[:m], np.zeros(more)]),
        low=np.concatenate([curve.low[:m], np.full(more, -np.inf)]),
        high=np.concatenate([curve.high[:m], np.full(more, np.inf)]),
        aux=aux,
    )


def force_sizes(curve: Curve, u: Array) -> Array:
    """Sizes of the entries of f near a point: of its first and second derivatives.

    The second ones count because all first ones of an entry may vanish at a branch point.
    """
    m = curve.m
    scale = curve.scale[:m]
    sizes = np.max(np.abs(curve.at(u)[1] * scale), axis=1)
    sizes = sizes + np.max(np.abs(curve.bend(u, scale) * scale), axis=1)
    return np.asarray(np.where((sizes > 0.0) & np.isfinite(sizes), sizes, 1.0))


def _interval(curve: Curve, bracket: Bracket) -> tuple[float, float]:
    ends = bracket.a.u[curve.n], bracket.b.u[curve.n]
    return float(min(ends)), float(max(ends))


def _polish(
    curve: Curve, kind: int, start: Array, extra: Array, reach: float, aux: Array | None = None
) -> tuple[Array, Array, float, str]:
    """Newton's method on a square defining system: unknowns, extra ones, residual, message."""
    system = extended(curve, kind, start, extra, aux)
    whole = np.concatenate([start[: curve.m], extra])
    point = system.refine(whole, tolerance=max(TIGHT, curve.field.accuracy * 0.1))
    residual = float(np.max(np.abs(point.residual)))
    if not point.converged or not np.isfinite(residual):
        return start, extra, residual, "Newton's method on the defining system did not converge"
    moved = curve.length(point.u[: curve.m] - start[: curve.m])
    if moved > reach:
        return start, extra, residual, "the defining system led away from the bracket"
    return point.u[: curve.m], point.u[curve.m :], residual, ""


def _reach(curve: Curve, bracket: Bracket) -> float:
    return curve.length(bracket.b.u - bracket.a.u) + 1e-7


def _fold(curve: Curve, bracket: Bracket) -> Special:
    n = curve.n
    best, left, right = bracket_root(
        curve, bracket.a, bracket.b, lambda s: float(s.tangent[n]), steps=10, width=1e-4
    )
    v = forms.null_vectors(best.slopes[:, :n], curve.scale[:n])[0]
    v = v / np.linalg.norm(v / curve.scale[:n])
    u, v, residual, message = _polish(curve, FOLD, best.u, v, _reach(curve, bracket))
    if message:
        best, left, right = bracket_root(
            curve, left, right, lambda s: float(s.tangent[n]), steps=60, width=1e-14
        )
        u = best.u
    d = forms.Derivatives(curve, u)
    form = forms.fold(d)
    return Special(
        "fold", u, _interval(curve, bracket), residual, GUESS if message else CONVERGED, message,
        form, tangent=_tangent_at(curve, u, best.tangent), extra=v,
    )  # fmt: skip


def _tangent_at(curve: Curve, u: Array, near: Array) -> Array:
    _, slopes = curve.at(u)
    directions = nullspace(slopes, curve.scale[: curve.m])
    if len(directions) != 1:
        return near
    t = directions[0] / curve.length(directions[0])
    return np.asarray(t if np.dot(curve.weight * t, near) >= 0.0 else -t)


def _is_turn(curve: Curve, point: Special) -> bool:
    """Whether the parameter turns back at a branch point: the path is a pitchfork's side branch."""
    assert point.tangent is not None
    return bool(abs(point.tangent[curve.n]) / curve.scale[curve.n] < VERTICAL)


def directions_at(curve: Curve, u: Array) -> tuple[list[Array], Array]:
    """Unit tangents of the branches through a point, and the left null vector.

    The algebraic bifurcation equation ([AllgowerGeorg1990] 8.3); at a regular point one tangent.
    """
    n, m = curve.n, curve.m
    d = forms.Derivatives(curve, u)
    scaled = d.slopes * curve.scale[:m]
    rows = forms.row_sizes(scaled)
    left, _, right = np.linalg.svd(scaled / rows[:, None])
    w = left[:, -1] / rows
    basis = right[n - 1 :] * curve.scale[:m]
    c = np.array([[w @ d.second(a, b).value for b in basis] for a in basis])
    size = np.max(np.abs(c))
    root = c[0, 1] ** 2 - c[0, 0] * c[1, 1]
    if not size > 0.0 or root <= 1e-10 * size**2:
        return [], w
    # c00 x^2 + 2 c01 x y + c11 y^2 = 0, its roots without cancellation.
    q = -(c[0, 1] + np.copysign(np.sqrt(root), c[0, 1]))
    pairs = [(q, c[0, 0]), (c[1, 1], q)]
    found = []
    for x, y in pairs:
        t = x * basis[0] + y * basis[1]
        found.append(t / curve.length(t))
    return found, w


def _branch_point(curve: Curve, bracket: Bracket) -> Special | None:
    n, m = curve.n, curve.m

    def test(s: Sample) -> float:
        return float(test_functions(curve, s.tangent, s.slopes, pairs=False).branch)

    ends = abs(test(bracket.a)), abs(test(bracket.b))
    if max(ends) < 1e-13:
        return None
    best, left, right = bracket_root(curve, bracket.a, bracket.b, test, steps=10, width=1e-3)
    middle = 0.5 * (left.u + right.u)
    _, slopes = curve.at(middle)
    scaled = slopes * curve.scale[:m]
    rows = force_sizes(curve, middle)
    w = np.linalg.svd(scaled / rows[:, None])[0][:, -1] / rows
    w /= np.linalg.norm(w * rows)
    extra = np.append(w, 0.0)
    u, extra, residual, message = _polish(curve, BRANCH, middle, extra, _reach(curve, bracket))
    if not message and abs(extra[-1]) * float(np.max(np.abs(w))) > 1e3 * curve.field.accuracy * max(
        1.0, float(np.max(np.abs(scaled)))
    ):
        message = "the equilibria nearby do not meet: f differs from zero where f_u is singular"
    if message:
        u = best.u
    chord = bracket.b.u - bracket.a.u
    chord = chord / curve.length(chord)
    tangents, _ = directions_at(curve, u)
    if len(tangents) != 2:
        return Special(
            "branch_point", u, _interval(curve, bracket), residual, GUESS if message else CONVERGED,
            message, tangent=best.tangent, extra=extra,
        )  # fmt: skip
    near = [abs(float(np.dot(curve.weight * t, chord))) for t in tangents]
    own, other = tangents if near[0] >= near[1] else tangents[::-1]
    own = own if np.dot(curve.weight * own, chord) >= 0.0 else -own
    steep = [abs(t[n]) / curve.scale[n] < VERTICAL for t in (own, other)]
    kind = "pitchfork" if any(steep) else "transcritical"
    moving = other if steep[0] else own
    form: dict[str, float] = {}
    if not all(steep):
        form = forms.branch_point(
            forms.Derivatives(curve, u), moving, pitchfork=kind == "pitchfork"
        )
    return Special(
        kind, u, _interval(curve, bracket), residual, GUESS if message else CONVERGED, message,
        form, tangent=own, other=other, extra=extra,
    )  # fmt: skip


def _pair(curve: Curve, bracket: Bracket) -> Special | None:
    n = curve.n

    def test(s: Sample) -> float:
        return float(test_functions(curve, s.tangent, s.slopes, pairs=True).pair)

    best, _, _ = bracket_root(curve, bracket.a, bracket.b, test, steps=10, width=1e-4)
    A = best.slopes[:, :n]
    values, vectors = np.linalg.eig(A)
    i, j = _nearest_pair(values)
    kappa = float((values[i] * values[j]).real)
    scale = curve.scale[:n]
    q = vectors[:, i] / scale
    if values[i].imag != 0.0:
        v = q.real if np.linalg.norm(q.real) >= np.linalg.norm(q.imag) else q.imag
    else:
        r = (vectors[:, j] / scale).real
        v = q.real / np.linalg.norm(q.real) + r / np.linalg.norm(r)
    v = v / np.linalg.norm(v)
    y = A @ (v * scale) / scale
    aux = y - np.dot(v, y) * v
    aux = aux / np.linalg.norm(aux) / scale
    v = v * scale
    extra = np.append(v, kappa)
    u, extra, residual, message = _polish(curve, HOPF, best.u, extra, _reach(curve, bracket), aux)
    kind = "hopf" if extra[-1] > 0.0 else "neutral_saddle"
    if message:
        best, _, _ = bracket_root(curve, bracket.a, bracket.b, test, steps=60, width=1e-14)
        u = best.u
        values = eigenvalues_of(best.slopes)
        i, j = _nearest_pair(values)
        kind = "hopf" if values[i].imag != 0.0 else "neutral_saddle"
        extra[-1] = float((values[i] * values[j]).real)
    form: dict[str, float] = {}
    if kind == "hopf" and not message:
        form = forms.hopf(forms.Derivatives(curve, u), float(np.sqrt(extra[-1])))
    return Special(
        kind, u, _interval(curve, bracket), residual, GUESS if message else CONVERGED, message,
        form, tangent=_tangent_at(curve, u, best.tangent), extra=np.concatenate([extra, aux]),
    )  # fmt: skip


def _nearest_pair(values: npt.NDArray[np.complex128]) -> tuple[int, int]:
    """The two eigenvalues, both real or conjugate, whose sum is least in size."""
    best, least = (0, 1), np.inf
    for i in range(len(values)):
        for j in range(i + 1, len(values)):
            real = values[i].imag == 0.0 and values[j].imag == 0.0
            if (real or values[i] == np.conj(values[j])) and abs(values[i] + values[j]) < least:
                best, least = (i, j), abs(values[i] + values[j])
    return best


def _several(curve: Curve, bracket: Bracket) -> Special:
    """Eigenvalues that cross together, without a change of sign: found, not refined."""
    n = curve.n
    values = eigenvalues_of(bracket.a.slopes), eigenvalues_of(bracket.b.slopes)
    close = values[0][np.argsort(np.abs(values[0].real))][: bracket.crossing]
    complex_ = bool(np.any(close.imag != 0.0))
    u = 0.5 * (bracket.a.u + bracket.b.u)
    return Special(
        "hopf" if complex_ else "branch_point", u, _interval(curve, bracket),
        float(np.max(np.abs(curve.at(u)[0]))), GUESS,
        f"{bracket.crossing} eigenvalues cross together: a multiple point, which is not refined",
        tangent=bracket.a.tangent if n else None,
    )  # fmt: skip
