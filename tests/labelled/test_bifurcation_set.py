"""Bifurcation sets against counts of equilibria, closed forms, and elimination by sympy."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
import sympy
from witnesses.variants import ALL, some

import phasekit as pk
from phasekit.bifurcation.exact.critical import critical_disk
from phasekit.labelled.bifurcation_set import bifurcation_set
from phasekit.phase.exact.phase_space import equilibria

DISK = pk.GyroRotorDisk(beta=0.3, e=0.05, a=0.012, r=0.2, omega1=31.4)
PARTICLE = pk.ParticleOnCircle(radius=0.1, omega=20.0, tilt=0.2, offset=0.01, normal_offset=0.02)
LIMITS = {
    "beta": (0.0, np.pi),
    "e": (0.0, 0.4),
    "a": (-0.05, 0.05),
    "omega1": (-40.0, 40.0),
    "r": (0.0, 0.5),
    "g": (-30.0, 30.0),
    "tilt": (-np.pi / 2, np.pi / 2),
    "omega": (-30.0, 30.0),
    "radius": (0.01, 1.0),
    "offset": (-0.1, 0.1),
    "normal_offset": (-0.1, 0.1),
}
PLANES = [
    (DISK, "beta", "e"),
    (DISK, "beta", "a"),
    (DISK, "a", "beta"),
    (DISK, "beta", "omega1"),
    (DISK, "beta", "r"),
    (DISK, "beta", "g"),
    (DISK, "e", "a"),
    (DISK, "e", "omega1"),
    (DISK, "a", "omega1"),
    (DISK, "omega1", "r"),
    (DISK, "r", "g"),
    (DISK.replace(a=0.0), "beta", "e"),
    (DISK.replace(a=0.0), "beta", "omega1"),
    (DISK.replace(a=0.0), "beta", "g"),
    (DISK.replace(g=0.0), "beta", "a"),
    (DISK.replace(g=0.0), "e", "omega1"),
    (PARTICLE, "tilt", "omega"),
    (PARTICLE, "tilt", "offset"),
    (PARTICLE, "omega", "normal_offset"),
    (PARTICLE, "radius", "offset"),
    (pk.Reduced(0.3, 0.1), "lam", "psi"),
    (pk.Reduced(0.3, 0.1), "lam", "Omega_sq"),
    (pk.Coefficients(1.0, 0.3, 0.2), "A", "B"),
    (pk.Coefficients(1.0, 0.3, 0.2), "C", "B"),
    (pk.StonerWohlfarth(K=0.5, h_x=0.3, h_y=0.2), "K", "h_x"),
    (pk.StonerWohlfarth(K=0.5, h_x=0.3, h_y=0.2), "h_x", "h_y"),
]
IDS = [f"{type(s).__name__}-{x}-{y}-{k}" for k, (s, x, y) in enumerate(PLANES)]
#: A few of each class at once; all where their sets are made anyhow, to count equilibria.
A_PLANES = [
    pytest.param(
        *plane, id=name, marks=() if k in (0, 3, 9, 13, 16, 21, 22, 24) else pytest.mark.slow
    )
    for k, (plane, name) in enumerate(zip(PLANES, IDS, strict=True))
    if ALL or k in (0, 3, 9, 12, 13, 16, 21, 22, 24)
]


@functools.cache
def made(system, x, y, **changes):
    xlim, ylim = (changes.get(n, LIMITS.get(n, (-1.5, 1.5))) for n in (x, y))
    return bifurcation_set(system, x, y, xlim=xlim, ylim=ylim)


def curves(ds, *kinds):
    """The polylines of these kinds, each with shape (n, 2)."""
    x, y = (ds[ds.attrs[n]].values for n in "xy")
    for i in np.flatnonzero(np.isin(ds.curve_kind.values, kinds)):
        there = np.isfinite(x[i])
        yield np.stack([x[i][there], y[i][there]], axis=1)


def coefficients(system, **values):
    shape = np.broadcast_shapes(*(np.shape(v) for v in values.values()))
    fixed = {n: np.full(shape, getattr(system, n)) for n in system.formula_inputs()}
    return type(system).valid_coefficients({**fixed, **values})


def hits(line, start, way):
    """Where a segment crosses a polyline, as parts of the segment."""
    off = line - start
    side = way[0] * off[:, 1] - way[1] * off[:, 0]
    k = np.flatnonzero(side[:-1] * side[1:] < 0)
    share = (side[k] / (side[k] - side[k + 1]))[:, None]
    t = (off[k] + share * (off[k + 1] - off[k])) @ way / (way @ way)
    return t[(t > 0) & (t < 1)]


def segments(ds, number, seed=0):
    """Random segments across the plane, in units of it: start and way."""
    rng = np.random.default_rng(seed)
    for _ in range(number):
        start, end = rng.random((2, 2))
        yield start, end - start


def unit(ds, line):
    low, high = np.array([ds.attrs["xlim"], ds.attrs["ylim"]]).T
    return (line - low) / (high - low)


@pytest.mark.slow
@pytest.mark.parametrize(("system", "x", "y"), some(PLANES, 3), ids=some(IDS, 3))
def test_the_count_changes_at_the_curves_and_nowhere_else(system, x, y):
    """Along random segments, by 3,000 counts each."""
    ds = made(system, x, y)
    low, high = np.array([ds.attrs["xlim"], ds.attrs["ylim"]]).T
    lines = [unit(ds, line) for line in curves(ds, "fold", "pitchfork")]
    t = (np.arange(3000) + 0.5) / 3000
    for start, way in segments(ds, 5):
        points = low + (high - low) * (start + t[:, None] * way)
        A, B, C = coefficients(system, **{x: points[:, 0], y: points[:, 1]})
        counts = equilibria(A, B, C).n_equilibria
        want = (np.flatnonzero(np.diff(counts)) + 1) / 3000
        got = np.sort(np.concatenate([hits(line, start, way) for line in lines] or [[]]))
        # Two crossings between neighboring samples are not seen by the counts.
        close = np.abs(got[:, None] - want).min(axis=1, initial=1.0) < 2e-3
        lonely = got[~close]
        assert lonely.size % 2 == 0
        assert np.all(np.diff(lonely)[::2] < 2e-3)
        assert np.all(np.abs(got[:, None] - want).min(axis=0, initial=1.0) < 2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("system", "x", "y"), A_PLANES)
def test_A_changes_sign_at_the_curves_and_nowhere_else(system, x, y):
    ds = made(system, x, y)
    low, high = np.array([ds.attrs["xlim"], ds.attrs["ylim"]]).T
    lines = [unit(ds, line) for line in curves(ds, "sign_change")]
    t = (np.arange(3000) + 0.5) / 3000
    for start, way in segments(ds, 5, seed=1):
        points = low + (high - low) * (start + t[:, None] * way)
        A = coefficients(system, **{x: points[:, 0], y: points[:, 1]})[0]
        want = (np.flatnonzero(np.diff(np.sign(A))) + 1) / 3000
        got = np.sort(np.concatenate([hits(line, start, way) for line in lines] or [[]]))
        assert got == pytest.approx(want, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("system", "x", "y"), some(PLANES, 3), ids=some(IDS, 3))
def test_vertices_of_folds_have_a_degenerate_equilibrium(system, x, y):
    ds = made(system, x, y)
    for i in np.flatnonzero(np.isin(ds.curve_kind.values, ("fold", "pitchfork"))):
        row = ds.isel(curve=i)
        there = np.isfinite(row[x].values)
        phi = row.phi.values[there]
        A, B, C = coefficients(system, **{n: row[n].values[there] for n in (x, y)})
        size = np.sqrt(A * A + B * B + C * C)
        near = 1e-12 * size.max()
        s, c = np.sin(phi), np.cos(phi)
        assert np.all(np.abs(B * s - A * s * c - C * c) < near)
        assert np.all(np.abs(B * c - A * np.cos(2 * phi) + C * s) < near)
        assert np.all((np.sign(A) == row.sign_of_A.item()) | (np.abs(A) < near))


def test_the_astroid():
    ds = made(pk.Reduced(0.3, 0.1), "lam", "psi")
    (line,) = curves(ds, "fold")
    assert bool(ds.closed[0])
    assert np.array_equal(line[0], line[-1])
    assert (np.cbrt(line) ** 2).sum(axis=1) == pytest.approx(1.0, abs=1e-12)
    # length 6, area 3 pi/8
    assert np.hypot(*np.diff(line, axis=0).T).sum() == pytest.approx(6.0, abs=5e-3)
    area = 0.5 * np.sum(line[:-1, 0] * line[1:, 1] - line[1:, 0] * line[:-1, 1])
    assert abs(area) == pytest.approx(3 * np.pi / 8, abs=5e-3)
    cusps = sorted(zip(ds.cusp_lam.values, ds.cusp_psi.values, ds.cusp_like.values, strict=True))
    assert [(round(x, 14), round(y, 14), like) for x, y, like in cusps] == [
        (-1, 0, "center"),
        (0, -1, "saddle"),
        (0, 1, "saddle"),
        (1, 0, "center"),
    ]
    assert sorted(zip(ds.cusp_like.values, ds.cusp_cubic.values, strict=True)) == [
        ("center", -0.5),
        ("center", -0.5),
        ("saddle", 0.5),
        ("saddle", 0.5),
    ]


def test_the_astroid_by_elimination():
    t, lam, psi = sympy.symbols("t lam psi")
    # V' = 0 with tan(phi/2) = t and A = 1
    quartic = psi * t**4 + 2 * (lam + 1) * t**3 + 2 * (lam - 1) * t - psi
    discriminant = sympy.Poly(sympy.discriminant(quartic, t), lam, psi)
    size = sympy.Poly({m: abs(c) for m, c in discriminant.terms()}, lam, psi)
    (line,) = curves(made(pk.Reduced(0.3, 0.1), "lam", "psi"), "fold")
    for x, y in line[::7]:
        off = float(discriminant.eval((sympy.Rational(x), sympy.Rational(y))))
        assert abs(off) < 1e-13 * float(size.eval((abs(sympy.Rational(x)), abs(sympy.Rational(y)))))


@pytest.mark.slow
@pytest.mark.parametrize("other", ["e", "a", "omega1"])
def test_folds_of_the_disk_are_those_of_the_closed_form(other):
    ds = made(DISK, "beta", other)
    width = np.ptp(LIMITS[other])
    seen = [0, 0]
    for i in np.flatnonzero(ds.curve_kind.values == "fold"):
        row = ds.isel(curve=i)
        there = np.isfinite(row.beta.values) & (np.abs(row[other].values) > 0.002 * width)
        given = {n: getattr(DISK, n) for n in ("e", "a", "omega1", "r", "g")}
        values = {**given, "beta": row.beta.values[there]}
        del values[other]
        minus, plus, _ = critical_disk(other, **values)
        side = int(row.sign_of_A.item() > 0)
        want = (minus, plus)[side]
        # Rounding in units of the plane, times the slope of the curve.
        assert np.abs(row[other].values[there]) == pytest.approx(want, rel=1e-10, abs=1e-12)
        seen[side] += there.sum()
    assert min(seen) > 20


def test_equal_energies_of_the_disk():
    """Saddles: a = 0 up to the cusp with A < 0; centers: a = 0 beyond the other cusp."""
    ds = made(DISK, "beta", "a", beta=(0.0, np.pi / 2))
    minus, plus, _ = critical_disk("beta", a=0.0, e=DISK.e, r=DISK.r, omega1=DISK.omega1)
    for kind, ends in (
        ("equal_saddles", (0.0, float(minus))),
        ("equal_centers", (float(plus), np.pi / 2)),
    ):
        (line,) = curves(ds, kind)
        assert np.all(line[:, 1] == 0.0)
        assert np.sort(line[[0, -1], 0]) == pytest.approx(ends, abs=1e-12)
    inside = pk.equilibria(DISK.replace(beta=np.linspace(0.1, float(minus) - 1e-3, 9), a=0.0))
    assert np.abs(inside.energy[:, 1] - inside.energy[:, 3]).max() < 1e-12
    assert sorted(ds.cusp_beta.values) == pytest.approx([float(minus), float(plus)], abs=1e-14)


@pytest.mark.parametrize("A", [1.0, -1.0])
def test_the_two_saddles_or_centers_have_equal_energies_on_the_curves(A):
    ds = made(pk.Coefficients(A, 0.0, 0.0), "B", "C")
    for kind, slots in (("equal_saddles", (1, 3)), ("equal_centers", (0, 2))):
        (line,) = curves(ds, kind)
        points = equilibria(A, *line[1:-1].T)
        assert np.all(points.n_equilibria == 4)
        assert np.ptp(points.energy[:, slots], axis=1).max() < 1e-15
        assert np.abs(line[[0, -1]]).max(axis=1) == pytest.approx(1.0, abs=1e-12)


def test_a_cusp_on_the_edge_of_the_plane():
    ds = made(DISK, "beta", "a", a=(0.0, 0.05), beta=(0.0, np.pi / 2))
    assert np.all(ds.cusp_a.values == 0.0)
    assert ds.sizes["cusp"] == 2
    ends = np.concatenate([line[[0, -1]] for line in curves(ds, "fold")])
    for beta in ds.cusp_beta.values:
        assert np.abs(ends - [beta, 0.0]).max(axis=1).min() < 1e-14


@pytest.mark.slow
def test_curves_end_on_the_edge_exactly():
    for line in curves(made(DISK, "beta", "e", e=(0.0, 0.2)), "fold"):
        for end in line[[0, -1]]:
            assert end[1] == 0.2
    for line in curves(made(DISK, "beta", "a", a=(-0.2, 0.2)), "fold"):
        for end in line[[0, -1]]:
            assert abs(end[1]) == 0.2 or np.array_equal(line[0], line[-1])


def test_without_the_distance_folds_are_pitchforks():
    """At a = 0: |B| = |A|, that is 4 e s g/omega1^2 = |4 e^2 s^2 - r^2 c^2|."""
    ds = made(DISK.replace(a=0.0), "beta", "e")
    assert set(ds.curve_kind.values) == {"pitchfork", "sign_change", "equal_saddles"}
    for i in np.flatnonzero(ds.curve_kind.values == "pitchfork"):
        row = ds.isel(curve=i)
        like_center = row.sign_of_A.item() > 0
        pair = ("lower_center", "upper_center") if like_center else ("lower_saddle", "upper_saddle")
        assert set(pair) < set(row.merging.item().split())
    for line in curves(ds, "pitchfork"):
        beta, e = line.T
        s, c = np.sin(beta), np.cos(beta)
        A = 4 * e * e * s * s - DISK.r**2 * c * c
        assert 4 * e * s * DISK.g / DISK.omega1**2 == pytest.approx(np.abs(A), abs=1e-15)


def test_regions():
    ds = made(pk.Reduced(0.3, 0.1), "lam", "psi")
    assert sorted(ds.region_count.values) == [2, 4]
    for i in range(2):
        point = pk.Reduced(ds.region_lam.values[i], ds.region_psi.values[i])
        assert pk.equilibria(point).n_equilibria == ds.region_count.values[i]
    disk = made(DISK, "beta", "e")
    assert sorted(disk.region_count.values) == [2, 4, 4, 4]


def test_small_closed_curves_are_found():
    """Both cusps of beta and a, in a wide plane: the closed fold about beta = pi/2."""
    disk = DISK.replace(e=0.0115)  # hardly more than g/omega1^2 = 0.00995
    ds = made(disk, "beta", "a", a=(-0.01, 0.01))
    assert bool(ds.closed.values[(ds.sign_of_A == 1) & (ds.curve_kind == "fold")].all())


def test_the_quadratic_coefficient_vanishes_at_cusps_only():
    ds = made(pk.Reduced(0.3, 0.1, 2.0), "lam", "psi").isel(curve=0)
    want = 1.5 * 2.0 * np.cbrt(np.abs(ds.lam * ds.psi))
    assert np.abs(ds.quadratic.values) == pytest.approx(want.values, abs=1e-10)


def test_the_dataset_rebuilds_its_system():
    ds = made(DISK, "beta", "a")
    assert ds.phasekit.system().e == DISK.e
    assert (ds.attrs["x"], ds.attrs["y"]) == ("beta", "a")
    assert ds.beta.attrs["units"] == "rad"


def test_nothing_where_there_is_no_fold():
    ds = bifurcation_set(pk.Pendulum(length=1.0), "length", "g", xlim=(0.1, 1), ylim=(1, 2))
    assert (ds.sizes["curve"], ds.sizes["cusp"], ds.region_count.values.tolist()) == (0, 0, [2])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"x": "bet"}, "did you mean 'beta'"),
        ({"y": "m"}, "y: parameter of bifurcation_set"),
        ({"y": "beta"}, "y: got 'beta', wants a parameter that is not on x"),
        ({"xlim": (0, 180)}, "xlim: got (0.0, 180.0)"),
        ({"ylim": (math.nan, 1)}, "ylim: got"),
        ({"system": DISK.replace(e=[0.1, 0.2])}, "e: got"),
    ],
)
def test_bad_arguments(changes, message):
    arguments = {"system": DISK, "x": "beta", "y": "a", "xlim": (0, 1), "ylim": (0, 1), **changes}
    with pytest.raises(pk.ParameterError) as error:
        bifurcation_set(**arguments)
    assert message in str(error.value)


def test_planes_of_lambda_and_psi_are_those_of_the_reduced_system():
    disk = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=31.4)
    box = {"xlim": (-1.5, 1.5), "ylim": (-1.5, 1.5)}
    got = pk.bifurcation_set(disk, "lam", "psi", **box)
    want = pk.bifurcation_set(disk.reduced(), "lam", "psi", **box)
    assert got.identical(want)
    assert set(got.sign_of_A.values) == {-1}
    assert pk.branches(disk, "lam", (-2.0, 2.0)).identical(
        pk.branches(disk.reduced(), "lam", (-2.0, 2.0))
    )
    with pytest.raises(pk.ParameterError, match="'lam' is unknown"):
        pk.bifurcation_set(disk, "beta", "lam", **box)
