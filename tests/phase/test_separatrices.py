"""Separatrices against quadrature with forty digits, and where the answer is known in closed form.

Relative tolerances are 1e-12 without a condition number, next to folds and heteroclinic sets too:
coefficients are exact doubles, so nothing of what is tested is ill-conditioned in itself.
"""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import mpf
from properties.strategies import FAMILIES
from witnesses import oracle
from witnesses.variants import some

from phasekit.errors import EquilibriumKind, Loop, Topology
from phasekit.phase.exact.phase_space import phase_space, separatrices

UNIT = 2.0**-53
RELATIVE = mpf("1e-12")
LOOPS = {"lobes": Loop.LOBES, "winding": Loop.WINDING, "heteroclinic": Loop.HETEROCLINIC}
TOPOLOGIES = {
    "lobes": Topology.FIGURE_EIGHT,
    "winding": Topology.WINDING,
    "heteroclinic": Topology.HETEROCLINIC,
}
RECORDED = oracle.cases("separatrix")
FLOATS = (
    "saddle_phi",
    "saddle_energy",
    "saddle_exponent",
    "winding_area",
    "turning_offset",
    "turning_phi",
    "lobe_area",
)


def close(got, want, *context) -> None:
    off = abs(mpf(float(got)) - want)
    assert off <= RELATIVE * abs(want), (*context, float(got), float(want), float(off / abs(want)))


def check(A: float, B: float, C: float) -> None:
    """Compare everything with the oracle."""
    got, want = separatrices(A, B, C), oracle.separatrices(A, B, C)
    scale = abs(A) + abs(B) + abs(C)
    lower = want.get("lower", want["upper"])
    assert got.topology == TOPOLOGIES[lower.loop], (A, B, C)
    assert bool(got.figure_eight) == (lower.loop == "lobes"), (A, B, C)
    for i, name in enumerate(oracle.SADDLES):
        context = (A, B, C, name)
        if name not in want:
            assert got.loop[i] == Loop.ABSENT, context
            for field in FLOATS:
                assert np.all(np.isnan(getattr(got, field)[i])), (*context, field)
            continue
        s = want[name]
        assert got.loop[i] == LOOPS[s.loop], context
        assert oracle.apart(float(got.saddle_phi[i]), s.phi) <= 2.2e-14, context
        assert abs(mpf(float(got.saddle_energy[i])) - s.energy) <= 8 * UNIT * scale, context
        close(got.saddle_exponent[i], s.exponent, *context, "exponent")
        if s.loop == "winding":
            close(got.winding_area[i], s.winding_area, *context, "winding")
            for field in ("turning_offset", "turning_phi", "lobe_area"):
                assert np.all(np.isnan(getattr(got, field)[i])), (*context, field)
            continue
        assert np.isnan(got.winding_area[i]), context
        for j, side in enumerate(oracle.SIDES):
            assert np.sign(got.turning_offset[i, j]) == (-1, 1)[j], (*context, side)
            close(got.turning_offset[i, j], s.turning_offset[j], *context, side, "offset")
            close(got.lobe_area[i, j], s.lobe_area[j], *context, side, "area")
            off = oracle.apart(float(got.turning_phi[i, j]), s.phi + s.turning_offset[j])
            within = 2e-15 + 1e-12 * abs(s.turning_offset[j])  # the saddle's own and the offset's
            assert off <= within, (*context, side, float(off))
            assert abs(got.turning_phi[i, j]) <= np.pi


@pytest.mark.slow
@pytest.mark.parametrize("case", RECORDED, ids=lambda case: case["id"])
def test_recorded_values(case):
    A, B, C = (float(case["in"][name]) for name in "ABC")
    got, scale = separatrices(A, B, C), abs(A) + abs(B) + abs(C)
    saddles = case["out"]["saddles"]
    assert np.sum(got.loop != Loop.ABSENT) == len(saddles)
    for want in saddles:
        i = int(np.nanargmin([float(oracle.apart(x, want["phi"])) for x in got.saddle_phi]))
        kind = {"figure8": "lobes"}.get(want["kind"], want["kind"])
        assert got.loop[i] == LOOPS[kind]
        assert oracle.apart(float(got.saddle_phi[i]), want["phi"]) <= 2.2e-14
        assert abs(mpf(float(got.saddle_energy[i])) - mpf(want["h"])) <= 8 * UNIT * scale
        close(got.saddle_exponent[i], mpf(want["k"]))
        if kind == "winding":
            close(got.winding_area[i], mpf(want["area_up"]))
            continue
        close(got.lobe_area[i, 0], mpf(want["area_left"]))
        close(got.lobe_area[i, 1], mpf(want["area_right"]))
        right = want["theta_right"] if kind == "lobes" else want["partner_offset"]
        close(got.turning_offset[i, 1], mpf(right))
        if kind == "lobes":
            close(got.turning_offset[i, 0], mpf(want["theta_left"]))
    check(A, B, C)


@pytest.mark.slow
@pytest.mark.parametrize("family", some([*FAMILIES][1:], 2))
def test_random_systems(family):
    rng = np.random.default_rng(31)
    tried = 0
    for A, B, C in np.array(FAMILIES[family](rng, 60)).T:
        # What is smaller is tried below: so many digits do not see it.
        if min(abs(x) for x in (A, B, C) if x) > 1e-25 * max(abs(A), abs(B), abs(C)):
            check(float(A), float(B), float(C))
            tried += 1
        if tried == 6:
            return
    raise AssertionError("too few systems")


@pytest.mark.slow
@pytest.mark.parametrize("A", [1.5, -1.5])
@pytest.mark.parametrize("u", [0.1, 1e-4, 1e-8, 1e-12, 1e-15])
def test_small_lobes_next_to_a_fold(A, u):
    for theta in (0.3, 1.1):
        size = abs(A) * (1 - u)
        check(A, size * np.cos(theta) ** 3, -size * np.sin(theta) ** 3)


@pytest.mark.slow
@pytest.mark.parametrize("u", [1e-3, 1e-7, 1e-12])
def test_small_lobes_next_to_a_cusp(u):
    """Both lobes are small next to the cusp that is like a center."""
    tongue = (2 / 3 * u) ** 1.5
    for part in (0.0, 0.3, 0.999):
        check(2.0, 2.0 * (1 - u), -2.0 * tongue * part)
        check(-2.0, -2.0 * tongue * part, 2.0 * (1 - u))


@pytest.mark.slow
@pytest.mark.parametrize("digits", [10, 20, 30, 60, 100, 200, 300])
def test_exponent_next_to_a_cusp(digits):
    """On |C| = A a saddle's V'' goes with B^(2/3), and a center's on |B| = A with C^(2/3).

    The tolerance of both exponents is 1e-12 times the condition number of the point itself, at
    most 1 %.
    """
    for A in (1.0, 0.3, 7.7e5):
        small = A * 10.0**-digits
        for saddle, B, C in ((True, small, -A), (False, -A, small)):
            points, got = phase_space(A, B, C)
            with oracle.mp.workdps(500):
                kind = "saddle" if saddle else "center"
                (want,) = (p for p in oracle.equilibria(A, B, C, 1500) if p.kind == kind)
                value = got.saddle_exponent[1] if saddle else points.natural_frequency[0]
                exact = oracle.mp.sqrt(abs(want.curvature))
                off = abs(mpf(float(value)) / exact - 1)
                within = min(RELATIVE * oracle.kappa(A, B, C, want.phi), mpf("0.01"))
                assert off <= within, (A, B, C, float(value), float(exact), float(within))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("small", "A"), [(1e-3, 1), (-1e-6, -1), (1e-10, -1), (-1e-15, 1), (1e-24, 1), (1e-35, -1)]
)
def test_close_to_heteroclinic(small, A):
    other = 0.4 if A > 0 else -0.7
    check(A, *((small, other) if A > 0 else (other, small)))


@pytest.mark.parametrize("A", [1.0, -1.0])
def test_close_to_no_gravity_and_no_distance(A):
    check(A, 1e-9, -3e-10)


@pytest.mark.parametrize("A", [1e-3, -1e-7, 1e-12, -1e-16, 1e-25, -1e-38])
def test_close_to_a_pendulum(A):
    """The closed form of the area is 0/0 at A = 0."""
    check(A, 0.3, -0.7)
    check(A, -0.3, 0.0)
    check(A, 0.0, 1.1)
    want = 8 * (mpf(0.3) ** 2 + mpf(0.7) ** 2) ** mpf("0.25")
    assert abs(mpf(float(separatrices(A, 0.3, -0.7).winding_area[1])) - want) < 3 * abs(A) + 1e-14


@pytest.mark.parametrize(("B", "C"), [(2.5, 0.0), (-2.5, 0.0), (0.0, 1.7), (0.3, -0.7)])
def test_pendulum(B, C):
    """The area is 8 (B^2 + C^2)^(1/4)."""
    got = separatrices(0.0, B, C)
    assert got.topology == Topology.WINDING
    assert list(got.loop) == [Loop.ABSENT, Loop.WINDING]
    close(got.winding_area[1], 8 * (mpf(B) ** 2 + mpf(C) ** 2) ** mpf("0.25"))
    check(0.0, B, C)


@pytest.mark.slow
@pytest.mark.parametrize("zero", [0.0, -0.0])
@pytest.mark.parametrize(
    ("A", "B", "C"),
    [(3.0, 0, 1.2), (3.0, 0, -2.9), (-3.0, 1.5, 0), (-3.0, -0.9, 0), (-3.0, 2.999999, 0)],
)
def test_heteroclinic_cycles(A, B, C, zero):
    A, B, C = A, B or zero, C or zero
    got = separatrices(A, B, C)
    assert got.topology == Topology.HETEROCLINIC
    assert not got.figure_eight
    assert list(got.loop) == [Loop.HETEROCLINIC] * 2
    # The two arcs are shared: what is right of one saddle is left of the other one.
    assert np.allclose(got.lobe_area, got.lobe_area[::-1, ::-1], rtol=1e-15)
    assert np.allclose(got.turning_phi, got.saddle_phi[::-1, None], rtol=0, atol=1e-15)
    check(A, B, C)


@pytest.mark.parametrize("A", [2.25, -2.25])
def test_no_gravity_no_distance(A):
    """B = C = 0: phi'^2 = |A| sin^2 or |A| cos^2, and both arcs have the area 4 sqrt|A|."""
    got = separatrices(A, 0.0, 0.0)
    assert got.topology == Topology.HETEROCLINIC
    assert np.allclose(got.lobe_area, 6.0, rtol=1e-15)
    assert np.allclose(np.abs(got.turning_offset), np.pi, rtol=1e-15)
    assert np.allclose(got.saddle_phi, [0, np.pi] if A > 0 else [np.pi / 2, -np.pi / 2])
    check(A, 0.0, 0.0)


def test_double_well():
    """A = 2, B = 1, C = 0: phi'^2 = 2 (1 - cos) cos on the eight."""
    got = separatrices(2.0, 1.0, 0.0)
    assert got.figure_eight
    assert np.allclose(got.turning_offset[0], [-np.pi / 2, np.pi / 2], rtol=1e-15)
    check(2.0, 1.0, 0.0)
    check(2.0, -1.0, 0.0)
    check(-2.0, 0.0, 1.0)
    check(-2.0, 0.0, -1.0)


@pytest.mark.parametrize(
    ("A", "B", "C"), [(-4.0, 4.0, 0.0), (-4.0, -4.0, 0.0), (4.0, 0.0, 4.0), (4.0, 0.0, -4.0)]
)
def test_cusp_like_a_saddle(A, B, C):
    """The upper saddle with exponent 0; A = -1, B = 1 has phi' = 1 + cos phi, area 2 pi."""
    got = separatrices(A, B, C)
    assert got.topology == Topology.WINDING
    assert list(got.loop) == [Loop.ABSENT, Loop.WINDING]
    assert got.saddle_exponent[1] == 0
    close(got.winding_area[1], 4 * oracle.mp.pi)
    assert np.isnan(got.saddle_phi[0])
    assert (
        oracle.apart(got.saddle_phi[1], [0, np.pi][B > 0] if B else -np.sign(C) * np.pi / 2) < 1e-15
    )


@pytest.mark.parametrize(
    ("A", "B", "C"), [(4.0, 4.0, 0.0), (4.0, -4.0, 0.0), (-4.0, 0.0, 4.0), (-4.0, 0.0, -4.0)]
)
def test_cusp_like_a_center(A, B, C):
    got = separatrices(A, B, C)
    assert got.topology == Topology.WINDING
    assert list(got.loop) == [Loop.ABSENT, Loop.WINDING]
    close(got.saddle_exponent[1], mpf(8) ** 0.5)
    check(A, B, C)


@pytest.mark.parametrize("sign_A", [1, -1])
def test_pair_of_a_fold_is_absent(sign_A):
    for B, C in ((27.0, 64.0), (-64.0, 27.0), (27.0, -64.0), (-64.0, -27.0)):
        points, got = phase_space(125.0 * sign_A, B, C)
        assert points.kind[1] == EquilibriumKind.DEGENERATE
        assert got.topology == Topology.WINDING
        assert not got.figure_eight
        assert list(got.loop) == [Loop.ABSENT, Loop.WINDING]
        check(125.0 * sign_A, B, C)


@pytest.mark.parametrize("tiny", [1e-60, 1e-150, 1e-290, 5e-324])
def test_tiny_coefficients_decide_the_topology(tiny):
    """Equal energies mean exactly equal: B = 0 for A > 0, however small B is otherwise."""
    limit = separatrices(1.0, 0.0, 0.4)
    for B in (tiny, -tiny):
        got = separatrices(1.0, B, 0.4)
        assert got.topology == Topology.FIGURE_EIGHT
        assert list(got.loop) == [Loop.LOBES, Loop.WINDING]
        same = 0 if B > 0 else 1  # the lower saddle is the right one for B > 0
        assert np.allclose(got.turning_offset[0], limit.turning_offset[same], rtol=1e-12)
        assert np.allclose(got.lobe_area[0], limit.lobe_area[same], rtol=1e-12)
        assert np.isclose(got.winding_area[1], limit.lobe_area[0].sum() / 2, rtol=1e-12)
    assert separatrices(1.0, 0.4, tiny).topology == Topology.FIGURE_EIGHT
    assert separatrices(-1.0, 0.4, tiny).topology == Topology.FIGURE_EIGHT
    assert separatrices(tiny, 0.4, 0.3).topology == Topology.WINDING
    assert separatrices(1e300, tiny, 1e299).topology == Topology.FIGURE_EIGHT


def test_no_force_and_invalid_cells():
    got = separatrices([0.0, np.nan, 2.0, np.inf, 1.0], [0.0, 1.0, 1.0, 1.0, -np.inf], 0.0)
    assert list(got.topology) == [
        Topology.NONE,
        Topology.NOT_COMPUTED,
        Topology.FIGURE_EIGHT,
        Topology.NOT_COMPUTED,
        Topology.NOT_COMPUTED,
    ]
    assert list(got.figure_eight) == [False, False, True, False, False]
    for cell in (0, 1, 3, 4):
        assert list(got.loop[cell]) == [Loop.ABSENT] * 2
        for field in FLOATS:
            assert np.all(np.isnan(getattr(got, field)[cell])), field
    alone = separatrices(2.0, 1.0, 0.0)
    for name in got._fields:
        want = getattr(alone, name)
        assert np.array_equal(getattr(got, name)[2], want, equal_nan=want.dtype.kind == "f"), name


def test_shapes_and_dtypes():
    A = np.array([[2.0], [-1.0], [0.5]])
    got = separatrices(A, [0.3, 0.1, 0.0, 1.0], 0.25)
    assert got.topology.shape == got.figure_eight.shape == (3, 4)
    assert got.topology.dtype == got.loop.dtype == np.int8
    assert got.figure_eight.dtype == np.bool_
    for name in ("saddle_phi", "saddle_energy", "saddle_exponent", "loop", "winding_area"):
        assert getattr(got, name).shape == (3, 4, 2), name
    for name in ("turning_offset", "turning_phi", "lobe_area"):
        assert getattr(got, name).shape == (3, 4, 2, 2), name
    assert separatrices(2.0, 1.0, 0.0).lobe_area.shape == (2, 2)
    assert separatrices(np.empty((2, 0)), 1.0, 0.0).lobe_area.shape == (2, 0, 2, 2)
