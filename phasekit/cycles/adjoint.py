"""Solutions of the adjoint equations z' = -A^T z along cycles and connecting orbits.

Of a cycle, with mean(f z) = 1, one is periodic, and f z = 1 everywhere on it: how its phase
responds to kicks ([ErmentroutTerman2010] 8.2). Phases are times: a kick dx moves the motion on by
z dx. Of a connecting orbit that follows one parameter one is bounded: the normal of the manifolds
that meet in it ([ChampneysKuznetsovSandstede1996]).
"""

from __future__ import annotations

import numpy as np

from phasekit.arrays import Array
from phasekit.cycles import collocation
from phasekit.cycles.bounded import Bounded
from phasekit.cycles.connections import ends_of
from phasekit.cycles.cycles import Cycles, Orbit
from phasekit.cycles.linear import Linear


def adjoint(cycles: Cycles, orbit: Orbit) -> tuple[Array, float]:
    """The solution at all places of the orbit, and by how much f z differs from 1."""
    line = Linear(cycles, orbit)
    line.A = -np.swapaxes(line.A, 1, 2)
    z, unknown = line.solve(
        np.zeros_like(line.f), [line.f], [line.f], right=np.array([1.0])
    )  # fmt: skip
    along = np.einsum("ki,ki->k", line.f, collocation.at_gauss(z, cycles.m).reshape(line.f.shape))
    speed = float(np.max(np.einsum("ki,ki->k", line.f, line.f)))
    return z, float(np.max(np.abs(along - 1.0))) + abs(float(unknown[0])) * speed


def normal(bounded: Bounded, orbit: Orbit, dy: Array) -> Array | None:
    """The unit normal of both manifolds at all places, on scaled axes; None if there is no one.

    Its side is that to which the parameters move the manifolds apart, those that turn a quarter
    from the tangent ``dy`` of the curve: it changes nowhere along a curve.
    """
    ends, n = ends_of(bounded), bounded.n
    rests = ends.rests(bounded, orbit)
    if rests is None or ends.unstable + ends.stable != n or bounded.q != 3:
        return None
    scale = bounded.scale
    line = Linear(bounded, orbit)
    line.A = -np.swapaxes(line.A * scale / scale[:, None], 1, 2)
    first, last = ends.subspaces(rests)
    along = (first.plane.T, last.plane.T)
    any_size = np.random.default_rng(7).standard_normal(line.f.shape)
    z = line.unit(line.bounded(line.f / scale, along, any_size)[0])
    by_parameters = line.slopes[:, :, n:] / scale[:, None]
    apart = np.einsum("k,ki,kip->p", line.weights, line.values(z), by_parameters)
    side = float(apart[1] * dy[1] - apart[0] * dy[2])  # they are orthogonal to the tangent
    return np.asarray(z * np.sign(side))
