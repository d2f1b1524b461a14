"""The atlas against the equilibria of single systems, and its special points against theirs."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

import phasekit as pk
from phasekit.bifurcation.exact.atlas import atlas
from phasekit.bifurcation.exact.line import Path
from phasekit.labelled.atlas import branches
from phasekit.laws.trigonometric import law

DISK = pk.GyroRotorDisk(beta=0.3, e=0.05, a=0.012, r=0.2, omega1=31.4)
PARTICLE = pk.ParticleOnCircle(radius=0.1, omega=20.0, tilt=0.2, offset=0.01, normal_offset=0.02)
MAGNET = pk.StonerWohlfarth(K=1.0, h_x=0.3, h_y=0.2)
SPANS = {
    "beta": (0.0, np.pi),
    "e": (0.0, 0.5),
    "a": (-0.05, 0.05),
    "omega1": (-40.0, 40.0),
    "r": (1e-6, 0.5),
    "g": (-30.0, 30.0),
    "tilt": (-np.pi / 2, np.pi / 2),
    "omega": (-30.0, 30.0),
    "radius": (0.01, 1.0),
    "length": (0.1, 2.0),
}
PATHS = [
    *((DISK, name) for name in ("beta", "e", "a", "omega1", "r", "g")),
    *((DISK.replace(a=0.0), name) for name in ("beta", "e", "omega1", "g")),
    *((DISK.replace(g=0.0), name) for name in ("beta", "a", "omega1")),
    (DISK.replace(beta=1.5), "a"),
    (DISK.replace(beta=1.5), "omega1"),
    (DISK.replace(r=0.0, beta=1.5), "e"),
    (DISK.replace(e=0.0), "beta"),
    *((PARTICLE, name) for name in PARTICLE.formula_inputs()),
    *((MAGNET, name) for name in MAGNET.formula_inputs()),
    (pk.Reduced(0.3, 0.1), "Omega_sq"),
    (pk.Reduced(1.0, 0.0), "psi"),
    (pk.Reduced(0.9, 0.0), "psi"),
    (pk.Reduced(0.0, 1e-9), "lam"),
    (pk.Reduced(0.0, 0.0, -1.0), "lam"),
    (pk.Coefficients(1.0, 0.1, 0.0), "A"),
    (pk.Coefficients(1.0, 0.0, 0.0), "A"),
    (pk.Coefficients(0.0, 1.0, 0.5), "C"),
    (pk.Pendulum(length=1.0), "g"),
    (pk.Pendulum(length=1.0), "length"),
]


def special(ds, *kinds):
    return ds.isel(special=np.isin(ds.special_kind.values, kinds))


def crossings(ds, parameter, at):
    """Angles and kinds where the curves, straight from vertex to vertex, have this parameter."""
    x, phi, kind = (ds[name].values for name in (parameter, "phi", "kind"))
    rows, k = np.nonzero((x[:, :-1] - at) * (x[:, 1:] - at) < 0)
    share = (at - x[rows, k]) / (x[rows, k + 1] - x[rows, k])
    angles = phi[rows, k] + share * (phi[rows, k + 1] - phi[rows, k])
    return angles, np.where(kind[rows, k] == 3, kind[rows, k + 1], kind[rows, k])


def gap(a, b):
    return np.abs((a - b + np.pi) % (2 * np.pi) - np.pi)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "parameter"), PATHS, ids=lambda x: x if isinstance(x, str) else ""
)
def test_every_equilibrium_lies_on_one_curve_and_every_curve_is_one(system, parameter):
    span = SPANS.get(parameter, (-2.0, 2.0))
    ds = branches(system, parameter, span)
    at = np.random.default_rng(5).uniform(*span, 30)
    points = pk.equilibria(system.replace(**{parameter: at}))
    for i, x in enumerate(at):
        there = np.isfinite(points.phi.values[i])
        phi, kind = points.phi.values[i][there], points.kind.values[i][there]
        got, got_kind = crossings(ds, parameter, x)
        assert got.size == phi.size, x
        nearest = gap(got[:, None], phi).argmin(axis=0)
        assert len(set(nearest)) == phi.size
        assert gap(got[nearest], phi).max(initial=0.0) < 0.03
        assert np.array_equal(got_kind[nearest], kind)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("system", "parameter"), PATHS, ids=lambda x: x if isinstance(x, str) else ""
)
def test_vertices_are_equilibria_to_rounding_and_curves_are_smooth(system, parameter):
    ds = branches(system, parameter, SPANS.get(parameter, (-2.0, 2.0)))
    there = np.isfinite(ds.phi.values)
    x, phi = ds[parameter].values[there], ds.phi.values[there]
    abc = system.replace(**{parameter: x}).coefficients()
    A, B, C = (np.broadcast_to(np.asarray(c), x.shape) for c in abc)
    slope = B * np.sin(phi) - A * np.sin(phi) * np.cos(phi) - C * np.cos(phi)
    size = np.abs(A) + np.abs(B) + np.abs(C)
    assert np.all(np.abs(slope) <= 1e-14 * np.maximum(size, 1e-9 * size.max()))
    assert np.nanmax(np.abs(np.diff(ds.phi.values, axis=1))) < 0.26


@pytest.mark.parametrize("parameter", ["beta", "e", "a", "omega1"])
@pytest.mark.parametrize("disk", [DISK, DISK.replace(beta=1.5), DISK.replace(a=-0.03, g=-3.0)])
def test_folds_are_those_of_the_closed_form(disk, parameter):
    span = (0.0, np.pi / 2) if parameter == "beta" else (0.0, 60.0)
    got = special(branches(disk, parameter, span), "fold").special_value.values
    want = pk.critical(disk, parameter).critical_fold.values
    want = np.sort(want[np.isfinite(want) & (want < span[1])])
    assert np.sort(got) == pytest.approx(want, rel=1e-13)


def test_folds_of_beta_repeat_about_a_right_angle():
    ds = special(branches(DISK, "beta", (0.0, np.pi)), "fold")
    values = ds.special_value.values
    assert values.size == 4
    assert values == pytest.approx(np.pi - values[::-1], rel=1e-15)


def test_a_pitchfork_lies_on_two_branches_that_cross():
    ds = branches(pk.Coefficients(1.0, 0.5, 0.0), "B", (0.0, 2.0))
    point = special(ds, "pitchfork")
    assert point.special_value.item() == 1.0
    assert point.special_phi.item() == 0.0
    assert point.on_branch.sum().item() == 2
    assert (point.unfolding.item(), point.cubic.item()) == (-1.0, -0.5)
    straight, bent = (ds.isel(branch=i) for i in np.flatnonzero(point.on_branch.values[0]))
    if np.nanmax(np.abs(straight.phi)) > 0:
        straight, bent = bent, straight
    assert np.nanmax(np.abs(straight.phi)) == 0.0
    assert {1, 2} <= set(straight.kind.values.tolist())
    inside = np.isfinite(bent.phi.values)
    assert np.cos(bent.phi.values[inside]) == pytest.approx(bent.B.values[inside], abs=1e-15)


@pytest.mark.parametrize("psi", [1e-3, 1e-7, 1e-12, -1e-12])
def test_an_imperfect_pitchfork_breaks_into_a_fold(psi):
    ds = branches(pk.Reduced(0.0, psi), "lam", (0.5, 1.5))
    assert special(ds, "pitchfork").sizes["special"] == 0
    fold = special(ds, "fold")
    want = (1 - abs(psi) ** (2 / 3)) ** 1.5
    assert fold.special_value.item() == pytest.approx(want, rel=1e-14)
    assert fold.special_phi.item() == pytest.approx(-math.atan(np.cbrt(psi / want)), rel=1e-12)


def test_a_path_through_a_cusp():
    ds = special(branches(pk.Reduced(1.0, 0.0), "psi", (-1.0, 1.0)), "cusp")
    assert (ds.special_value.item(), ds.special_phi.item()) == (0.0, 0.0)
    # phi'' = psi - phi^3/2 + ...
    assert (ds.unfolding.item(), ds.cubic.item()) == (1.0, -0.5)


def test_curves_end_where_there_is_no_force():
    ds = branches(pk.Reduced(0.3, 0.1), "Omega_sq", (-1.0, 1.0))
    assert ds.sizes["branch"] == 8
    ends = special(ds, "no_force")
    want = pk.equilibria(pk.Reduced(0.3, 0.1)).phi.values
    assert np.sort(ends.special_phi.values) == pytest.approx(np.sort([*want, *want]), abs=1e-15)
    assert (ends.special_value == 0.0).all()


def test_no_equilibria_without_force():
    ds = branches(pk.Reduced(0.3, 0.1, 0.0), "lam", (-1.0, 1.0))
    assert (ds.sizes["branch"], ds.sizes["special"]) == (0, 0)


def test_a_system_that_stays_on_the_cusp():
    ds = branches(pk.Reduced(1.0, 0.0), "Omega_sq", (0.5, 2.0))
    kinds = {tuple(np.unique(row)) for row in ds.kind.values}
    assert kinds == {(2,), (3,)}


def test_a_closed_branch_is_marked():
    ds = branches(DISK, "beta", (0.0, np.pi))
    (closed,) = np.flatnonzero(ds.closed.values)
    row = ds.isel(branch=closed)
    phi = row.phi.values[np.isfinite(row.phi.values)]
    assert gap(phi[0], phi[-1]) < 1e-15
    assert special(ds, "fold").on_branch.values[:, closed].sum() == 2


# Paths that no model takes: A, B and C as given.


def along(products, span=(-0.5, 0.5)):
    form = law(lambda v: (*products(v["p"]), 1), (("p", "1", -np.inf, np.inf),))

    def coefficients(at):
        return tuple(np.broadcast_to(np.asarray(c, float), at.shape) for c in products(at))

    return atlas(Path(form, {}, "p", span), coefficients)


def kinds_of(meetings):
    return [m.kind for m in meetings if m.kind != "end"]


def test_branches_cross_where_two_folds_touch_from_inside():
    curves, meetings = along(lambda p: (125 + 0 * p, 27 - p * p, 64 + 0 * p))
    assert kinds_of(meetings) == ["transcritical"]
    assert meetings[0].at == pytest.approx(0.0, abs=1e-15)
    crossing = [c for c in curves if 0 in c.meetings]
    assert len(crossing) == 2
    for curve in crossing:  # straight through: phi - phi* changes sign
        off = curve.vertices.phi - meetings[0].phi
        assert off[0] * off[-1] < 0
        assert np.abs(np.diff(curve.vertices.phi)).max() < 0.26


def test_a_pair_that_exists_at_one_value_only():
    curves, meetings = along(lambda p: (125 + 0 * p, 27 + p * p, 64 + 0 * p))
    assert kinds_of(meetings) == ["fold"]
    (lonely,) = (c for c in curves if 0 in c.meetings)
    assert lonely.vertices.phi.size == 1
    assert len(curves) == 3


def test_three_branches_cross_where_a_path_touches_a_cusp_from_inside():
    curves, meetings = along(lambda p: (1 + 0 * p, 1 - p * p, 0 * p))
    assert kinds_of(meetings) == ["branch_point"]
    crossing = [c for c in curves if 0 in c.meetings]
    slopes = sorted(float(c.vertices.phi[-1] - c.vertices.phi[0]) for c in crossing)
    want = 2 * math.acos(0.75)
    assert slopes == pytest.approx([-want, 0.0, want], abs=1e-12)


def test_a_path_that_touches_a_cusp_from_outside():
    curves, meetings = along(lambda p: (1 + 0 * p, 1 + p * p, 0 * p))
    assert kinds_of(meetings) == ["cusp"]
    assert len(curves) == 2


def test_close_folds_are_told_apart():
    """Two folds 2e-11 apart, about the exact one at (125, 27, 64)."""
    step = Fraction(1, 10**22)

    def products(p):
        exact = isinstance(p, Fraction)
        return 125 + 0 * p, 27 - (step if exact else 1e-22) + p * p, 64 + 0 * p

    _, meetings = along(products)
    low, high = sorted(m.at for m in meetings if m.kind == "fold")
    assert (low, high) == pytest.approx((-1e-11, 1e-11), rel=1e-6)


# Datasets and arguments.


def test_the_dataset_rebuilds_its_system():
    ds = branches(DISK, "beta", (0.1, 1.5))
    system = ds.phasekit.system()
    assert system.e == DISK.e
    assert system.beta.dims == ("branch", "point")
    assert ds.attrs["completeness"].startswith("complete")
    assert ds.phi.attrs["units"] == "rad"
    assert ds.beta.attrs["units"] == "rad"


def test_energy_and_curvature_belong_to_the_points():
    ds = branches(DISK, "beta", (0.1, 1.5))
    there = np.isfinite(ds.phi.values)
    A, B, C = (np.asarray(c)[there] for c in ds.phasekit.system().coefficients())
    phi = ds.phi.values[there]
    V = -B * np.cos(phi) + A / 2 * np.cos(phi) ** 2 - C * np.sin(phi)
    assert ds.energy.values[there] == pytest.approx(V, abs=1e-11)
    bend = B * np.cos(phi) - A * np.cos(2 * phi) + C * np.sin(phi)
    assert ds.curvature.values[there] == pytest.approx(bend, abs=1e-10)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((DISK, "bet", (0, 1)), "did you mean 'beta'"),
        ((DISK, "m", (1, 2)), "unknown"),
        ((DISK, "beta", (0, 90)), "span: got (0.0, 90.0)"),
        ((DISK, "beta", 3), "span: got 3"),
        ((DISK, "beta", (1, 1)), "two different values"),
        ((DISK.replace(a=[0.1, 0.2]), "beta", (0, 1)), "a: got"),
        ((3, "beta", (0, 1)), "system: got 3"),
    ],
)
def test_bad_arguments(arguments, message):
    with pytest.raises(pk.ParameterError) as error:
        branches(*arguments)
    assert message in str(error.value)


@pytest.mark.slow
@pytest.mark.parametrize("span", [(-1e20, 1e20), (-1e100, 1e200)])
@pytest.mark.parametrize("parameter", ["A", "B", "C"])
def test_spans_beyond_the_resolution_of_doubles_end_soon(span, parameter):
    """Between neighboring doubles nothing is refined, and no vertex stands twice."""
    ds = pk.branches(pk.Coefficients(2.0, 1.0, 0.5), parameter, span)
    assert 50 < ds.sizes["point"] < 1000
    assert ds.sizes["special"] >= 2
