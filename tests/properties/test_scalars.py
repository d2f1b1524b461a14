"""Any three doubles whatever: subnormal, huge, not finite."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from properties.extended import derivatives
from witnesses import oracle

from phasekit.errors import EquilibriumKind, Loop, Topology
from phasekit.phase.exact.phase_space import phase_space

UNIT = 2.0**-53
EXAMPLES = settings(max_examples=150)

finite = st.floats(allow_nan=False, allow_infinity=False)
moderate = st.floats(-1e3, 1e3)
special = st.sampled_from(
    [0.0, -0.0, 5e-324, -5e-324, 2.0**-1022, 1e-160, -1e160, 1.7976931348623157e308, 1.0, -1.0, 8.0]
)
any_finite = finite | moderate | special
anything = any_finite | st.sampled_from([math.nan, math.inf, -math.inf])


def folds():
    """Return exact folds, in every octant and at any scale that keeps them exact."""
    triples = [(5, 3, 4), (13, 5, 12), (17, 8, 15), (25, 24, 7), (65, 16, 63), (145, 143, 24)]
    sign = st.sampled_from([-1, 1])
    return st.tuples(
        st.sampled_from(triples), sign, sign, sign, st.integers(-900, 900), st.integers(1, 1000)
    ).map(
        lambda x: tuple(
            math.ldexp(float(s * n**3 * x[5]), x[4]) for s, n in zip(x[1:4], x[0], strict=True)
        )
    )


def check(A: float, B: float, C: float) -> None:
    points, loops = phase_space(A, B, C)
    count = oracle.count(A, B, C)
    assert points.n_equilibria == count
    if count == 0:
        assert loops.topology == Topology.NONE
        assert np.isnan(points.fold_margin)
        return
    degenerate = oracle.delta_sign(A, B, C) == 0
    assert (EquilibriumKind.DEGENERATE in points.kind) == degenerate
    assert np.sum(points.kind != EquilibriumKind.ABSENT) == count
    assert np.array_equal(np.isnan(points.phi), points.kind == EquilibriumKind.ABSENT)
    equal = count == 4 and (B if A > 0 else C) == 0
    want = Topology.FIGURE_EIGHT if count == 4 else Topology.WINDING
    assert loops.topology == (Topology.HETEROCLINIC if equal else want)
    # Residuals, of coefficients scaled to 1; what underflows then is below rounding.
    shift = -math.frexp(max(abs(A), abs(B), abs(C)))[1]
    a, b, c = (np.full(4, math.ldexp(x, shift)) for x in (A, B, C))
    phi = np.nan_to_num(points.phi)
    assert np.all(np.abs(phi) <= np.pi)
    first, second, size = derivatives(a, b, c, phi)
    bound = 2e-15 * np.abs(second) + 4 * UNIT * (np.abs(second) + size)
    assert np.all((np.abs(first) <= bound) | (points.kind == EquilibriumKind.ABSENT))
    if not degenerate and np.isfinite(points.fold_margin):
        assert np.sign(points.fold_margin) == (1 if count == 4 else -1)


@EXAMPLES
@given(any_finite, any_finite, any_finite)
@example(5e-324, 5e-324, 0.0)
@example(5e-324, 0.0, -5e-324)
@example(1.7976931348623157e308, 1.7976931348623157e308, 1.7976931348623157e308)
@example(1.7976931348623157e308, 5e-324, -5e-324)
@example(5e-324, 1.7976931348623157e308, 5e-324)
@example(-1e308, 1e308, 1e292)
@example(1.0, 1.0, 1e-150)
@example(-1.0, 1.0, 1e-200)
def test_any_finite_system(A, B, C):
    check(A, B, C)


@EXAMPLES
@given(folds())
@example((1.0, 1.0, 0.0))
@example((5e-324, 0.0, 5e-324))
@example((-1.7976931348623157e308, 1.7976931348623157e308, 0.0))
def test_exact_folds_and_their_neighbours(system):
    check(*system)
    for k in range(3):
        for towards in (0.0, math.inf):
            moved = list(system)
            moved[k] = math.nextafter(moved[k], math.copysign(towards, moved[k]))
            if math.isfinite(moved[k]):
                check(*moved)


@EXAMPLES
@given(st.lists(st.tuples(anything, anything, anything), min_size=1, max_size=12))
def test_cells_stand_for_themselves(rows):
    """No exception, absent where not finite, and the same bits alone and in any array."""
    system = np.array(rows).T
    whole = phase_space(*system)
    finite = np.isfinite(system).all(axis=0)
    assert np.array_equal(whole[0].n_equilibria == -1, ~finite)
    assert np.array_equal(whole[1].topology == Topology.NOT_COMPUTED, ~finite)
    assert np.all(whole[0].kind[~finite] == EquilibriumKind.ABSENT)
    assert np.all(whole[1].loop[~finite] == Loop.ABSENT)
    assert not whole[1].figure_eight[~finite].any()
    repeated = phase_space(*np.repeat(system, 40, axis=1))
    for i, row in enumerate(rows):
        alone = phase_space(*row)
        for floor, alone_floor, repeated_floor in zip(whole, alone, repeated, strict=True):
            for name in floor._fields:
                got = np.asarray(getattr(alone_floor, name))
                context = (name, row)
                for want in (getattr(floor, name)[i], getattr(repeated_floor, name)[40 * i + 7]):
                    equal = np.array_equal(got, want, equal_nan=got.dtype.kind == "f")
                    assert equal, context
                    if got.dtype.kind == "f":
                        there = ~np.isnan(got)
                        assert np.array_equal(np.signbit(got)[there], np.signbit(want)[there]), (
                            context
                        )
                        assert np.all(~there | finite[i]), context


@EXAMPLES
@given(moderate, moderate, moderate, st.integers(-900, 900))
@pytest.mark.filterwarnings("error")
def test_units_of_time_are_free(A, B, C, exponent):
    """Powers of four scale energies, powers of two frequencies and areas, without rounding."""
    system = np.array([A, B, C])
    assume(np.all((system == 0) | (np.abs(system) > 1e-20)))
    points, loops = phase_space(A, B, C)
    other, others = phase_space(*np.ldexp(system, 2 * (exponent // 8)))
    power = exponent // 8
    for name, scale in (("phi", 0), ("energy", 2), ("curvature", 2), ("exponent", 1)):
        got, want = getattr(other, name), np.ldexp(getattr(points, name), scale * power)
        assert np.array_equal(got, want, equal_nan=True), name
    for name, scale in (("turning_offset", 0), ("lobe_area", 1), ("winding_area", 1)):
        got, want = getattr(others, name), np.ldexp(getattr(loops, name), scale * power)
        assert np.array_equal(got, want, equal_nan=True), name
