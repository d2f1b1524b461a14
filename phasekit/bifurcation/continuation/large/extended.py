"""Folds and Hopf points of many states as equilibria of a larger field, in one parameter more.

With a null vector v of f_x among the unknowns, and with the parameter p of the branch, folds are
zeros of (f, f_x v, |v|^2 - 1); with q' + i q'' and the frequency w, Hopf points are those of
(f, f_x q' + w q'', f_x q'' - w q', and two conditions on the length and phase of q)
([Govaerts2000] chapter 4). Both are sparse and regular, so that curves of them
are those of equilibria, walked alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.large.curve import LargeCurve
from phasekit.bifurcation.continuation.large.field import OMEGA, SHARP, SparseField
from phasekit.bifurcation.continuation.large.forms import WIDE
from phasekit.bifurcation.continuation.large.hopf import normal_form
from phasekit.bifurcation.continuation.points.special import Special


class PointField(SparseField):
    """The equations of folds or Hopf points of a field.

    Its states are those of the field, the parameter ``moved``, one or two vectors, and of Hopf
    points their frequency. |v| has the weights ``weight``; ``held`` are vectors that fix q.
    """

    def __init__(self, field: SparseField, moved: str, weight: Array, held: Array | None) -> None:
        self.field, self.moved, self.weight, self.held = field, moved, weight, held
        n, parts = len(field.states), 1 if held is None else 2
        self.n, self.parts = n, parts
        names = [f"{part}_{i}" for part in ("v", "w")[:parts] for i in range(n)]
        states = [*field.states, moved, *names, *([OMEGA] if parts == 2 else [])]
        others = [name for name in field.parameters if name != moved]
        super().__init__(lambda x, **p: x, sp.eye_array(len(states)), states, others)

    @property
    def differenced(self) -> bool:
        """Whether derivatives of the field are differences."""
        return self.field.differenced

    @property
    def beside(self) -> dict[str, int]:
        """Places of what belongs to a point beside the states of the field."""
        omega = {OMEGA: len(self.states) - 1} if self.parts == 2 else {}
        return {self.moved: self.n} | omega

    def prepare(self, scale: Array) -> None:
        """Take the scales of the unknowns."""
        super().prepare(scale)
        self.field.prepare(scale[: self.n + 1])

    def parts_of(
        self, x: Array, p: Mapping[str, float]
    ) -> tuple[Array, dict[str, float], Array]:  # fmt: skip
        """The states and parameters of the field, and the vectors."""
        n = self.n
        vectors = x[n + 1 : n + 1 + self.parts * n].reshape(self.parts, n)
        return x[:n].copy(), {**p, self.moved: float(x[n])}, vectors

    def value(self, x: Array, p: Mapping[str, float]) -> Array:
        """The equations at a point; NaN where f or its derivatives have no value."""
        u, at, vectors = self.parts_of(x, p)
        turned = vectors @ self.field.matrix(u, at).T
        if self.parts == 2:
            turned = turned + x[-1] * np.stack([vectors[1], -vectors[0]])
        return np.concatenate([self.field.value(u, at), turned.ravel(), self._lengths(vectors)])

    def _lengths(self, vectors: Array) -> Array:
        if self.held is None:
            return np.array([np.sum(self.weight * vectors**2) - 1.0])
        products = self.held @ vectors.T
        return np.array([products[0, 0] + products[1, 1] - 1.0, products[0, 1] - products[1, 0]])

    def matrix(self, x: Array, p: Mapping[str, float]) -> Any:
        """The derivatives by all states, by columns."""
        u, at, vectors = self.parts_of(x, p)
        field, n = self.field, self.n
        A, size = field.matrix(u, at), max(abs(float(x[n])), float(self.scale[n]))
        by_p = field.slope(u, at, self.moved, size)[:, None]
        bent = [self.bent(u, at, v) for v in vectors]
        step = SHARP * size
        ahead, behind = (field.matrix(u, {**at, self.moved: x[n] + h}) for h in (step, -step))
        by_both = ((ahead - behind) @ vectors.T) / (2.0 * step)
        if self.held is None:
            along = 2.0 * self.weight * vectors
            rows = [
                [A, by_p, None], [bent[0], by_both, A], [None, None, along],
            ]  # fmt: skip
        else:
            turn, (c, d) = float(x[-1]) * sp.eye_array(n), self.held[:, None]
            rows = [
                [A, by_p, None, None, None],
                [bent[0], by_both[:, :1], A, turn, vectors[1][:, None]],
                [bent[1], by_both[:, 1:], -turn, A, -vectors[0][:, None]],
                [None, None, c, d, None],
                [None, None, -d, c, None],
            ]
        blocks = [[one if one is None else sp.csc_array(one) for one in row] for row in rows]
        return sp.csc_array(sp.block_array(blocks, format="csc"))

    def bent(self, u: Array, p: Mapping[str, float], v: Array, *, twice: bool = False) -> Any:
        """The derivative of f_x v by the states: of f_x along v, by differences; or the second."""
        sizes = np.maximum(self.scale[: self.n], np.abs(u))
        h = WIDE * (4.0 if self.differenced else 1.0) / float(np.max(np.abs(v) / sizes))
        sign = 1.0 if twice else -1.0
        one, two = (
            self.field.matrix(u + k * h * v, p) + sign * self.field.matrix(u - k * h * v, p)
            for k in (1.0, 2.0)
        )
        if twice:
            return (16.0 * one - two - 30.0 * self.field.matrix(u, p)) / (12.0 * h * h)
        return (8.0 * one - two) / (12.0 * h)


def blocks_with(
    blocks: tuple[tuple[str, int], ...], moved: str, parts: int
) -> tuple[tuple[str, int], ...]:  # fmt: skip
    """The blocks of states of a `PointField` with so many vectors."""
    vectors = [(f"{word} {name}", count) for word in ("v", "w")[:parts] for name, count in blocks]
    return (*blocks, (moved, 1), *vectors, *([(OMEGA, 1)] if parts == 2 else []))


def point_curve(
    curve: LargeCurve, special: Special, other: str, bounds: tuple[float, float],
    span: tuple[float, float],
) -> tuple[LargeCurve, Array]:  # fmt: skip
    """The curve of folds or Hopf points through one over another parameter, and its start.

    Vectors have entries of about one; ``bounds`` are those of the parameter of the branch.
    """
    n, field, u = curve.n, curve.sparse, special.u
    units = curve.scale[:n]
    if special.kind == "hopf":
        omega = special.normal_form["omega"]
        _, q = normal_form(curve, u, omega)
        vectors = np.zeros((2, n)) if q is None else np.stack([q.real, q.imag])
    else:
        assert special.extra is not None
        omega, vectors = 0.0, special.extra[None]
    size = float(np.sqrt(np.mean(np.sum((vectors / units) ** 2, axis=0))))
    vectors = vectors / size if size else vectors
    parts, weight = len(vectors), 1.0 / units**2 / n
    held = weight * vectors if parts == 2 else None
    made = PointField(field, curve.free, weight, held)
    more = [omega] if parts == 2 else []
    ends = np.full(parts * n, np.inf)
    begin = np.concatenate([u, vectors.ravel(), more, [curve.parameters_at(u)[other]]])
    given = dict(zip(field.parameters, curve.par.tolist(), strict=True))
    large = replace(
        curve, field=made,
        par=np.array([given[name] for name in made.parameters]),
        active=(made.parameters.index(other),),
        scale=np.concatenate([curve.scale, np.tile(units, parts), more, [span[1] - span[0]]]),
        period=np.zeros(len(begin)),
        low=np.concatenate([curve.low[:n], [bounds[0]], -ends, 0.0 * np.array(more), [span[0]]]),
        high=np.concatenate(
            [curve.high[:n], [bounds[1]], ends, np.inf + np.array(more), [span[1]]]
        ),
        blocks=blocks_with(curve.blocks, curve.free, parts),
        symmetric=False, ends=(),
    )  # fmt: skip
    return large, begin
