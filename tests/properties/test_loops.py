"""Properties of the separatrices that hold for every system.

The suite tries 20,000 random and adversarial systems; PHASEKIT_SYSTEMS=1000000 tries more.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from properties.extended import cos_sin
from properties.strategies import number_of_systems, systems
from witnesses import oracle

from phasekit.errors import EquilibriumKind, Loop, Topology
from phasekit.phase.exact.phase_space import equilibria, phase_space

UNIT = 2.0**-53
LC, LS, UC, US = range(4)
LOWER, UPPER = 0, 1
LEFT, RIGHT = 0, 1


@pytest.fixture(scope="module")
def tried():
    A, B, C = systems(number_of_systems(), seed=77)
    points, loops = phase_space(A, B, C)
    counts = np.array([oracle.count(*x) for x in zip(A, B, C, strict=True)])
    equal = (counts == 4) & (np.where(A > 0, B, C) == 0)
    eight = (counts == 4) & ~equal
    return SimpleNamespace(A=A, B=B, C=C, points=points, loops=loops, equal=equal, eight=eight)


def failing(tried, bad):
    """Show the first systems that fail, exactly, and how many do."""
    where = np.flatnonzero(bad.reshape(tried.A.size, -1).any(axis=1))
    first = [(float(tried.A[i]), float(tried.B[i]), float(tried.C[i])) for i in where[:5]]
    return f"{where.size} systems fail, first (A, B, C): {first}"


def test_topology_follows_exactly_from_the_coefficients(tried):
    want = np.select(
        [tried.equal, tried.eight], [Topology.HETEROCLINIC, Topology.FIGURE_EIGHT], Topology.WINDING
    )
    bad = tried.loops.topology != want
    assert not bad.any(), failing(tried, bad)
    assert np.array_equal(tried.loops.figure_eight, tried.eight)
    lower = np.select([tried.equal, tried.eight], [Loop.HETEROCLINIC, Loop.LOBES], Loop.ABSENT)
    upper = np.where(tried.equal, Loop.HETEROCLINIC, Loop.WINDING)
    bad = tried.loops.loop != np.stack([lower, upper], axis=1)
    assert not bad.any(), failing(tried, bad)
    assert min(tried.equal.mean(), tried.eight.mean()) > 0.02


def test_values_are_there_where_loops_are(tried):
    loop = tried.loops.loop
    for name, there in (
        ("saddle_phi", loop != Loop.ABSENT),
        ("saddle_energy", loop != Loop.ABSENT),
        ("saddle_exponent", loop != Loop.ABSENT),
        ("winding_area", loop == Loop.WINDING),
    ):
        bad = np.isfinite(getattr(tried.loops, name)) != there
        assert not bad.any(), (name, failing(tried, bad))
    sided = np.isin(loop, (Loop.LOBES, Loop.HETEROCLINIC))[..., None] & np.ones(2, bool)
    for name in ("turning_offset", "turning_phi", "lobe_area"):
        bad = np.isfinite(getattr(tried.loops, name)) != sided
        assert not bad.any(), (name, failing(tried, bad))


def test_saddles_are_those_of_the_equilibria(tried):
    loops, points = tried.loops, tried.points
    for k, label in ((LOWER, LS), (UPPER, US)):
        there = loops.loop[:, k] != Loop.ABSENT
        for name, other in (("saddle_phi", "phi"), ("saddle_energy", "energy")):
            got, want = getattr(loops, name)[there, k], getattr(points, other)[there, label]
            assert np.array_equal(got, want), name
        saddle = there & (points.kind[:, label] == EquilibriumKind.SADDLE)
        got, want = loops.saddle_exponent[saddle, k], points.exponent[saddle, label]
        assert np.array_equal(got, want)
        assert np.all(loops.saddle_exponent[there & ~saddle, k] == 0)


def test_each_lobe_holds_one_center(tried):
    loops, points = tried.loops, tried.points
    rows = np.flatnonzero(tried.eight)
    offset = loops.turning_offset[rows, LOWER]
    assert np.all(offset[:, LEFT] < 0)
    assert np.all(offset[:, RIGHT] > 0)
    assert np.all(offset[:, RIGHT] - offset[:, LEFT] <= 2 * np.pi + 2e-15)
    centers = points.phi[rows][:, [LC, UC]]
    right = np.remainder(centers - loops.saddle_phi[rows, LOWER, None], 2 * np.pi)
    # Next to a cusp a center may round to the saddle's own angle: leave that to exact tests.
    clear = (np.minimum(right, 2 * np.pi - right) > 1e-11).all(axis=1)
    assert clear.mean() > 0.95
    inside_right = right < offset[:, RIGHT, None]
    inside_left = right - 2 * np.pi > offset[:, LEFT, None]
    bad = np.zeros(tried.A.size, bool)
    bad[rows] = clear & ~((inside_right.sum(1) == 1) & (inside_left.sum(1) == 1))
    bad[rows] |= clear & ~(inside_right ^ inside_left).all(axis=1)
    assert not bad.any(), failing(tried, bad)


def test_turning_angle_is_saddle_plus_offset(tried):
    loops = tried.loops
    want = loops.saddle_phi[..., None] + loops.turning_offset
    off = np.abs(np.remainder(loops.turning_phi - want + np.pi, 2 * np.pi) - np.pi)
    there = np.isfinite(loops.turning_offset)
    bad = there & ~(off <= 4e-15)  # two angles with 2e-15 each
    assert not bad.any(), failing(tried, bad)
    assert not (np.abs(loops.turning_phi) > np.pi).any()


def test_energy_at_the_turning_point_is_the_saddles(tried):
    """Within what 1e-12 of the offset and the rounding of two angles explain."""
    rows = np.flatnonzero(tried.eight)
    system = np.array([tried.A, tried.B, tried.C])[:, rows]
    A, B, C = np.ldexp(system, -np.frexp(np.abs(system).max(axis=0))[1])
    (cs, ds), (ss, es) = cos_sin(tried.loops.saddle_phi[rows, LOWER])
    third = 2 * np.abs(A) + np.abs(B) + np.abs(C)
    for side in (LEFT, RIGHT):
        phi = tried.loops.turning_phi[rows, LOWER, side]
        (ct, dt), (st, et) = cos_sin(phi)
        dc, dsin = (ct - cs) + (dt - ds), (st - ss) + (et - es)
        rise = -B * dc - C * dsin + A / 2 * dc * (ct + cs)
        slope = B * st - A * st * ct - C * ct
        within = 1e-12 * np.abs(tried.loops.turning_offset[rows, LOWER, side]) + 8 * UNIT
        rounding = 8 * UNIT * third * np.maximum(np.abs(dc), np.abs(dsin))
        bad = np.zeros(tried.A.size, bool)
        bad[rows] = ~(np.abs(rise) <= np.abs(slope) * within + third * within**2 + rounding)
        assert not bad.any(), failing(tried, bad)


def test_parts_and_passes_give_the_same_bits(tried):
    """A cell depends neither on its array nor on what else is computed with it."""

    def same(got, want):
        if want.dtype.kind != "f":
            return np.array_equal(got, want)
        there = ~np.isnan(want)
        return np.array_equal(np.isnan(got), ~there) and (
            np.asarray(got)[there].tobytes() == want[there].tobytes()
        )

    system, size = np.array([tried.A, tried.B, tried.C]), tried.A.size
    plain = equilibria(*system)
    for name in plain._fields:
        assert same(getattr(plain, name), getattr(tried.points, name)), name
    pieces = [slice(0, 1), slice(1, 258), slice(size // 2, size)]
    for piece in pieces + list(range(0, size, max(1, size // 300))):
        points, loops = phase_space(*system[:, piece])
        for got, want in ((points, tried.points), (loops, tried.loops)):
            for name in got._fields:
                context = (name, system[:, piece][:, :3] if isinstance(piece, slice) else piece)
                assert same(getattr(got, name), getattr(want, name)[piece]), context


def nodes(count: int = 180):
    """Double exponential rule on (0, 1): distances from both ends, weights."""
    t = np.linspace(-3.6, 3.6, count)
    reach = np.pi * np.sinh(t)
    near, far = 1 / (1 + np.exp(-reach)), 1 / (1 + np.exp(reach))
    return near, far, (t[1] - t[0]) * np.pi * np.cosh(t) * near * far


def speed(A, B, C, phi_s, exponent, y):
    """Return |phi'| at the angle y from the saddle: h - V over the exact factor sin^2(y/2)."""
    S, C2 = A / 2 * np.sin(2 * phi_s), A * np.cos(2 * phi_s)
    half = np.sin(y / 2)
    rest = exponent**2 - C2 * half**2 - S * np.sin(y)
    return 2 * np.abs(half) * np.sqrt(np.maximum(rest, 0))


def test_areas_agree_with_quadrature(tried):
    """All areas by a rule in doubles: broad and coarse, the sharp tests have fewer systems."""
    loops, points = tried.loops, tried.points
    near, far, weight = nodes()
    column = [x[:, None] for x in (tried.A, tried.B, tried.C)]
    for k in (LOWER, UPPER):
        phi_s, exponent = loops.saddle_phi[:, k, None], loops.saddle_exponent[:, k, None]
        others = np.remainder(points.phi - phi_s, 2 * np.pi)
        others = np.where(points.kind == EquilibriumKind.ABSENT, 0, others)
        for side, direction in ((LEFT, -1), (RIGHT, 1), (None, 1)):
            if side is None:
                end, want = np.full(tried.A.size, 2 * np.pi), loops.winding_area[:, k]
                turn = others
            else:
                end = np.abs(loops.turning_offset[:, k, side])
                want = loops.lobe_area[:, k, side] / 2
                turn = np.where(direction > 0, others, np.remainder(-others, 2 * np.pi))
            there = np.isfinite(want)
            knots = np.sort(np.minimum(turn, np.nan_to_num(end)[:, None]), axis=1)
            knots = np.concatenate([knots, np.nan_to_num(end)[:, None]], axis=1)
            got = np.zeros(tried.A.size)
            for left, right in zip(knots.T[:-1], knots.T[1:], strict=True):
                rows = np.flatnonzero(there & (right > left))
                for use in np.array_split(rows, 1 + rows.size // 2000):
                    width = (right - left)[use, None]
                    y = left[use, None] + width * near
                    y = np.where(near < 0.5, y, right[use, None] - width * far)
                    system = (x[use] for x in column)
                    values = speed(*system, phi_s[use], exponent[use], direction * y)
                    got[use] += (width * weight * values).sum(axis=1)
            # Rounding of the angles next to the saddle, where k^2 is what is left of larger terms.
            with np.errstate(divide="ignore", invalid="ignore"):
                noise = 200 * UNIT * np.abs(tried.A) * end / loops.saddle_exponent[:, k] ** 2
            limit = 1e-7 if side is None else 1e-3
            bad = there & ~(np.abs(got - want) <= (1e-11 + np.fmin(noise, limit)) * want)
            assert not there.any() or np.median(noise[there]) < 1e-11
            assert not bad.any(), (k, side, failing(tried, bad))
