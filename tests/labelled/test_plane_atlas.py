"""Atlases in two parameters against closed forms, roots of polynomials and the exact rung."""

from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import Mock

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import CubicSpline

import phasekit as pk
from phasekit.labelled.continuation import atlas as atlas_module
from phasekit.labelled.continuation import atlas_cycles
from phasekit.systems.plane_regions import RegionSearch

CUSP = pk.Problem("mu + l*x - x^3", "x", {"mu": 0.0, "l": 0.0}, window={"x": (-3, 3)})
#: Holmes: the symmetric unfolding of a double zero eigenvalue.
SYMMETRIC = pk.Problem(
    {"x": "y", "y": "a*x + b*y - x^3 - x^2*y"},
    parameters={"a": -1.0, "b": 0.5},
    window={"x": (-2, 2), "y": (-2, 2)},
)
#: Takens and Bogdanov.
DOUBLE_ZERO = pk.Problem(
    {"x": "y", "y": "a + b*y + x^2 + x*y"},
    parameters={"a": -0.5, "b": 0.5},
    window={"x": (-2, 2), "y": (-2, 2)},
)
OXIDATION = pk.Problem(
    {
        "x": "2*q1*(1 - x - y - s)^2 - 2*q5*x^2 - q3*x*y",
        "y": "q2*(1 - x - y - s) - q6*y - q3*x*y",
        "s": "q4*((1 - x - y - s) - k*s)",
    },
    parameters={"q1": 2.5, "q2": 1.0, "q3": 10.0, "q4": 0.0675, "q5": 1.0, "q6": 0.1, "k": 0.4},
    window={"x": (0, 1), "y": (0, 1), "s": (0, 1)},
)
#: A generalized Hopf point at which cycles fold at p = -q^2/4, q > 0.
QUINTIC = pk.Problem(
    {
        "x": "x*(p + q*(x^2 + y^2) - (x^2 + y^2)^2) - y",
        "y": "y*(p + q*(x^2 + y^2) - (x^2 + y^2)^2) + x",
    },
    parameters={"p": 0.0, "q": 0.0},
    window={"x": (-1, 1), "y": (-1, 1)},
)
SQUARE = (-1.0, 1.0)


def random_places(atlas, count, seed=0):
    ends = np.array(list(atlas.span.values())).T
    places = ends[0] + np.random.default_rng(seed).random((count, 2)) * (ends[1] - ends[0])
    return dict(zip(atlas.names, places.T, strict=True))


def test_the_cusp_has_one_curve_and_its_numbers_are_those_of_roots():
    atlas = pk.atlas(CUSP, "mu", "l", span={"mu": SQUARE, "l": (-1, 2)})
    (curve,) = atlas.curves
    np.testing.assert_allclose(27 * curve.points.mu**2, 4 * curve.points.l**3, atol=1e-12)
    (point,) = atlas.special_points
    assert point.kind == "cusp"
    np.testing.assert_allclose(
        [point["mu"], point["l"], point.normal_form["c"]], [0, 0, -1], atol=1e-12
    )
    assert atlas.complete == {"n_equilibria": True, "n_stable": True}
    places = random_places(atlas, 10_000)
    found = atlas.counts(**places)
    mu, ell = places["mu"], places["l"]
    expected = np.where(4 * ell**3 > 27 * mu**2, 3, 1)
    np.testing.assert_array_equal(found.n_equilibria, expected)
    np.testing.assert_array_equal(found.n_stable, (expected + 1) // 2)
    assert found.complete.all()


def test_a_region_that_no_cell_fits_in_is_told():
    """Three roots of h + e x - x^3 between |h| < 2 (e/3)^(3/2), along a curve h = 0."""
    e = 0.01
    problem = pk.Problem("mu + q^2 + e*x - x^3", "x", {"mu": 0.0, "q": 0.0, "e": e},
                         window={"x": (-3, 3)})  # fmt: skip
    found = pk.atlas(problem, "mu", "q", span={"mu": (-1, 1), "q": (-1, 1)})
    assert set(found._regions.n_equilibria.tolist()) == {1}
    (narrow,) = found.narrow_regions
    assert (narrow["n_equilibria"], narrow["n_stable"]) == (3, 2)
    assert abs(narrow["mu"] + narrow["q"] ** 2) < 2.0 * (e / 3.0) ** 1.5
    assert "3 equilibria, 2 stable: narrower than a cell" in repr(found)
    assert "3 equilibria, 2 stable: narrower than a cell" in found._repr_html_()
    assert found.to_dataset().narrow_n_stable.values.tolist() == [2]
    # Parts of the region disagree about the second number, and one of them may have these.
    doubt = found._regions._replace(n_equilibria=np.array([1, 3]), n_stable=np.array([1, -1]))
    assert len(found._counts.narrow(doubt)[0]) == 0


@pytest.mark.parametrize("size", [1.0, 1e-9])
def test_two_cusps_at_one_place_are_told_apart_by_their_states_of_any_size(size):
    g = f"((x/{size!r})^2 - 1)"
    both = pk.Problem(
        f"mu + l*{g} - {g}^3", "x", {"mu": 0.0, "l": 0.0}, window={"x": (-2 * size, 2 * size)}
    )
    atlas = pk.atlas(both, "mu", "l", span={"mu": (-0.4, 0.4), "l": (-0.4, 0.4)})
    assert [point.kind for point in atlas.special_points] == ["cusp", "cusp"]
    np.testing.assert_allclose([point.x[0] / size for point in atlas.special_points], [-1, 1])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:atlas:RuntimeWarning")  # the loop round both rests
def test_the_symmetric_double_zero_is_complete():
    """Branch points a = 0, Hopf points b = 0 (a < 0) of x = 0 and b = a (a > 0) of x^2 = a.

    Where a is small loops are at b = 4a/5, and cycles round all three fold at b = 0.752a.
    """
    atlas = pk.atlas(SYMMETRIC, "a", "b", span={"a": SQUARE, "b": SQUARE}, cycles=True)
    cycles = atlas.to_dataset().curve_kind.values.tolist()[3:]
    assert cycles == ["fold_of_cycles", "homoclinic", "homoclinic"]
    for curve, ratio in zip(atlas.curves[3:], (0.752, 0.8, 0.8), strict=True):
        a, b = curve.points.a.values, curve.points.b.values
        row = np.argmin(np.where(a > 1e-3, a, np.inf))
        assert b[row] / a[row] == pytest.approx(ratio, abs=1e-3)
    # No points of cycles are where these shrink to the equilibrium.
    assert [point.kind for point in atlas.special_points] == ["bogdanov_takens"]
    atlas = replace(atlas, curves=atlas.curves[:3])
    assert [curve.kind for curve in atlas.curves] == ["hopf", "hopf", "branch_point"]
    for curve, lines in zip(atlas.curves, atlas.lines(), strict=True):
        a, b = np.concatenate(lines).T
        off = a if curve.kind == "branch_point" else np.where(a < 0, b, np.minimum(b - a, b))
        np.testing.assert_allclose(off, 0, atol=1e-9)
    assert atlas.complete == {"n_equilibria": True, "n_stable": True}
    places = random_places(atlas, 10_000)
    a, b = places["a"], places["b"]
    found = atlas.counts(**places)
    np.testing.assert_array_equal(found.n_equilibria, np.where(a > 0, 3, 1))
    np.testing.assert_array_equal(found.n_stable, np.where(a > 0, 2 * (b < a), b < 0))


@pytest.mark.parametrize("low", [-1.25, -0.75, -0.7265625, -0.7109375])
def test_regions_are_counted_one_by_one_though_curves_that_change_nothing_lie_between(low):
    """At a Hopf curve equilibria do not change: off others their number is counted once."""
    span = (low, low + 2.0)
    ends = np.array([(-3.0, 1.0), span]).T
    t = np.linspace(-3, 2, 8192)
    curves = (
        ("branch_point", (0 * t, t)),
        ("hopf", (t[t < 0], 0 * t[t < 0])),
        ("hopf", (t[t > 0], t[t > 0])),
    )

    def lines(steps):
        for kind, curve in curves:
            places = np.stack(curve, axis=1)
            yield kind, places[np.all((places >= ends[0]) & (places <= ends[1]), axis=1)]

    search = RegionSearch(
        SYMMETRIC, ("a", "b"), {"a": (-3.0, 1.0), "b": span}, np.full(2, -2.0), np.full(2, 2.0),
        np.ones(2, bool), lines,
    )  # fmt: skip
    search.sheets = None
    found = search.regions()
    a, b = found.place.T
    assert len(a) == 4
    np.testing.assert_array_equal(found.n_equilibria, np.where(a > 0, 3, 1))
    np.testing.assert_array_equal(found.n_stable, np.where(a > 0, 2 * (b < a), b < 0))


def test_a_curve_that_is_found_in_the_last_round_bounds_regions(monkeypatch):
    """All equilibria are within a circle of folds between the cuts."""
    monkeypatch.setattr(atlas_module, "ROUNDS", 1)
    island = pk.Problem(
        "x^2 + (a - 13/100)^2 + (b - 17/100)^2 - 1/100", "x", {"a": 0.0, "b": 0.0},
        window={"x": (-1, 1)},
    )  # fmt: skip
    atlas = pk.atlas(island, "a", "b", span={"a": SQUARE, "b": SQUARE})
    (curve,) = atlas.curves
    a, b = curve.points.a.values, curve.points.b.values
    np.testing.assert_allclose(np.hypot(a - 0.13, b - 0.17), 0.1, atol=1e-12)
    ds = atlas.to_dataset()
    inside = np.hypot(ds.region_a - 0.13, ds.region_b - 0.17) < 0.1
    np.testing.assert_array_equal(ds.region_n_equilibria, np.where(inside, 2, 0))
    assert inside.values.sum() == 1
    assert atlas.complete["n_equilibria"]
    assert "1 equilibria" not in repr(atlas)
    regions = atlas.table("regions").set_index("n_equilibria")
    assert regions.regions.to_dict() == {0: (~inside).values.sum(), 2: 1}
    assert regions.share[2] == pytest.approx(np.pi * 0.1**2 / (SQUARE[1] - SQUARE[0]) ** 2, rel=0.2)
    assert np.hypot(regions.a[2] - 0.13, regions.b[2] - 0.17) < 0.05
    (row,) = atlas.table("curves").to_dict("records")
    assert (row["kind"], row["begins"], row["ends"]) == ("fold", "closed", "closed")
    assert [row["a_min"], row["b_max"]] == pytest.approx([0.03, 0.27], abs=1e-3)
    assert len(atlas.table()) == 0
    with pytest.raises(pk.ParameterError, match="of: table 'region' is unknown; did you mean"):
        atlas.table("region")
    page = atlas._repr_html_()
    assert page.count("<table") == 2  # there are no special points
    assert all(note in page for note in ("1 fold", "regions", "proved off the curves"))


@pytest.mark.slow
def test_equilibria_that_stay_on_the_edge_of_the_window_ask_for_another():
    crossing = pk.Problem("x*(mu + l - x)", "x", {"mu": 0.0, "l": 0.0}, window={"x": (0.0, 3.0)})
    span = {"mu": (-1, 1), "l": (-1, 1)}
    says = "stay on the edge x = 0 of the window, or meet there: a window of x from -0.15 tells"
    with pytest.warns(RuntimeWarning, match=says):
        atlas = pk.atlas(crossing, "mu", "l", span=span)
    assert sum("edge" in one for one in atlas.messages) == 1
    assert not atlas.complete["n_equilibria"]
    assert pk.atlas(crossing, "mu", "l", span=span, window={"x": (-3, 3)}).complete["n_equilibria"]


@pytest.mark.slow
def test_the_double_zero_with_the_edge_of_its_window():
    """Folds a = 0; Hopf points a = -b^2, b > 0; x = -sqrt(-a) leaves at none of these a."""
    span = {"a": (-1.0, 0.5), "b": SQUARE}
    atlas = pk.atlas(DOUBLE_ZERO.replace(a=-0.5), "a", "b", span=span)
    assert sorted(curve.kind for curve in atlas.curves) == ["fold", "hopf"]
    (point,) = atlas.special_points
    assert point.kind == "bogdanov_takens"
    places = random_places(atlas, 10_000)
    a, b = places["a"], places["b"]
    found = atlas.counts(**places)
    np.testing.assert_array_equal(found.n_equilibria, np.where(a < 0, 2, 0))
    stable = (a < 0) & (b < np.sqrt(np.abs(a)))  # x = -sqrt(-a), of trace b + x
    np.testing.assert_array_equal(found.n_stable, stable.astype(int))
    narrow = pk.atlas(DOUBLE_ZERO, "a", "b", span=span, window={"x": (-0.5, 2), "y": (-2, 2)})
    (edge,) = [curve for curve in narrow.curves if curve.kind == "event"]
    np.testing.assert_allclose(edge.points.a, -0.25, atol=1e-12)
    assert "window_exit" in narrow.to_dataset().curve_kind.values.tolist()
    found = narrow.counts(**places)
    np.testing.assert_array_equal(found.n_equilibria, (a < 0) * 1 + ((a < 0) & (a > -0.25)))
    assert narrow.complete["n_equilibria"]


@pytest.fixture(scope="module")
def quintic():
    span = {"p": (-0.25, 0.15), "q": (-0.6, 0.8)}
    return pk.atlas(QUINTIC, "p", "q", span=span, cycles=True)


def test_folds_of_cycles_begin_at_a_generalized_hopf_point(quintic):
    atlas = quintic
    assert not atlas.not_followed
    _, curve = atlas.curves
    assert curve.kind == "fold_of_cycles"
    p, q = curve.points.p.values, curve.points.q.values
    assert len(p) > 10
    np.testing.assert_allclose(p, -0.25 * q**2, atol=1e-12)
    ds = atlas.to_dataset()
    assert ds.curve_kind.values.tolist() == ["hopf", "fold_of_cycles"]
    assert (ds.curve_begins.values[1], ds.curve_ends.values[1]) == ("GH", "bound")
    assert "fold_of_cycles curve: from GH" in repr(atlas)
    (line,) = atlas.lines()[1]
    np.testing.assert_allclose(line[0], 0, atol=1e-12)
    np.testing.assert_allclose(line[:, 0], -0.25 * line[:, 1] ** 2, atol=2e-5)
    # Equilibria do not change at it: regions are divided, numbers and proofs stay.
    assert atlas.complete == {"n_equilibria": True, "n_stable": True}
    p, q = ds.region_p.values, ds.region_q.values
    inside = (p < 0) & (q > 0) & (p > -0.25 * q**2)
    assert (len(p), inside.sum()) == (3, 1)
    np.testing.assert_array_equal(ds.region_n_stable, p < 0)
    np.testing.assert_array_equal(ds.region_n_cycles, np.where(p > 0, 1, 2 * inside))
    assert "1 equilibrium, 1 stable, 2 cycles: 1 region" in repr(atlas)


def test_cycles_that_are_in_doubt_are_not_counted_and_that_is_said(monkeypatch):
    """By the symmetry in x and time closed orbits round 0 fill a part of the window at c = 0."""
    turning = pk.Problem(
        {"x": "y", "y": "-x - x*y/2 + c*y"}, parameters={"c": 0.0, "d": 0.0},
        window={"x": (-1, 1), "y": (-1, 1)},
    )  # fmt: skip
    found = SimpleNamespace(
        place=np.array([[0.0, 0.25], [-2.0, 0.0], [2.0, 0.0]]), reach=np.array([0.5, 0.5, 0.001])
    )
    searched = []

    def spied(here, *given):
        searched.append(here.parameters["c"])
        return pk.labelled.periodic_orbits.cycles_of(here, *given)

    monkeypatch.setattr(atlas_cycles, "cycles_of", spied)
    number, doubts = atlas_cycles.cycles_in(turning, ("c", "d"), found, -np.ones(2), np.ones(2))
    np.testing.assert_array_equal(number, [-1, 0, -1])
    assert searched == [0.0]  # where the divergence c - x/2 has one sign there is none
    (text,) = doubts
    assert text.startswith(
        "the number of limit cycles about c = 0, d = 0.25, of which 0 were found"
    )
    assert "closed orbits fill a part of the window" in text
    atlas = pk.atlas(CUSP, "mu", "l", span={"mu": SQUARE, "l": (-1, 2)})
    found = atlas._regions
    unclear = found._replace(n_equilibria=np.full_like(found.n_equilibria, -1))
    shown = replace(atlas, _regions=unclear)
    assert "an unclear number of equilibria, 2 stable" in repr(shown)
    assert "?/2" in [text.get_text() for text in pk.plot.atlas(shown).texts]


def test_regions_in_which_cycles_leave_the_window_have_no_number_of_these():
    """Cycles of the radius sqrt(p) are in the window where p < 1, and out of it beyond."""
    growing = pk.Problem(
        {"x": "x*(p - x^2 - y^2) - q*y", "y": "y*(p - x^2 - y^2) + q*x"},
        parameters={"p": 0.5, "q": 1.0}, window={"x": (-1, 1), "y": (-1, 1)},
    )  # fmt: skip
    with pytest.warns(RuntimeWarning, match="in 1 region the number of limit cycles is in doubt"):
        atlas = pk.atlas(growing, "p", "q", span={"p": (-1.0, 3.0), "q": (0.5, 1.5)}, cycles=True)
    ds = atlas.to_dataset()
    np.testing.assert_array_equal(ds.region_n_cycles, np.where(ds.region_p > 0, -1, 0))
    assert "in other parts of the region cycles leave the window" in atlas.not_followed[-1]


def test_where_curves_of_cycles_are_not_followed_on_is_said(monkeypatch):
    monkeypatch.setattr(atlas_cycles, "LONG", 3)
    span = {"p": (-0.25, 0.15), "q": (-0.6, 0.8)}
    with pytest.warns(RuntimeWarning, match="in . places curves of cycles were not followed on"):
        atlas = pk.atlas(QUINTIC, "p", "q", span=span, cycles=True)
    doubts = [text for text in atlas.not_followed if text.startswith("the number of limit cycles")]
    curves = [text for text in atlas.not_followed if text not in doubts]
    assert len(curves) > 1
    assert doubts  # regions are wide that the rest of the curve would part
    for text in curves:
        assert text.startswith("the fold_of_cycles curve beyond p = ")
        assert "max_points = 3 were computed" in text
    for text in atlas.not_followed:
        assert f"not followed: {text}" in repr(atlas)


@pytest.mark.parametrize(
    ("reason", "step", "orbit", "joins"),
    [
        ("stuck", 1e-5, 0.5, False),
        ("lost", 1e-5, 0.01, False),
        ("max_points", 1e-4, 0.5, False),
        ("max_points", 1e-4, 1e-5, True),
        ("stuck", 0.1, 0.5, True),
        ("bogdanov_takens", 1e-5, 0.5, True),
        ("bound", 0.1, 1e-5, False),
    ],
)
@pytest.mark.parametrize("side", [0, -1])
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_curves_end_at_points_within_their_last_steps_or_where_orbits_shrink(
    reason, step, orbit, joins, side, size
):
    """In a rectangle of 100 it ends at 0.5 beside the point, of which 0.5 % are no measure."""
    orbits = np.linspace(orbit, 1.0, 50)[:: 1 if side == 0 else -1]
    along = size * (0.5 + step * np.arange(50.0))[:: 1 if side == 0 else -1]
    stops = [
        SimpleNamespace(reason="bound", message=""),
        SimpleNamespace(reason=reason, message=""),
    ]
    curve = SimpleNamespace(
        kind="connection", free=("a", "b"), stops=stops[::-1] if side == 0 else stops,
        problem_state=("x",),
        points=xr.Dataset(
            {
                name: ("point", column) for name, column in
                {"a": along, "b": 0 * along, "x_min": 0 * along, "x_max": orbits * size}.items()
            }
        ),
    )  # fmt: skip
    point = Mock(kind="bogdanov_takens", __getitem__=lambda self, name: 0.0)
    ends = atlas_cycles.ends_of(curve, [point], ("a", "b"), np.full(2, 100.0 * size))
    assert ends[side] is (point if joins else None)
    assert ends[-1 - side] is None
    missed = atlas_cycles.early(curve, "the curve", ends)
    assert len(missed) == (reason in atlas_cycles.EARLY and not joins)


@pytest.mark.parametrize("size", [1e-3, 1.0])
def test_of_a_curve_and_its_parts_the_whole_is_kept(size, monkeypatch):
    class Rows(atlas_cycles.CycleSearch):
        def _rows(self, curve):
            return curve.rows

    def arc(low, high, count, radius=1.0, kind="connection", reasons=("stuck", "max_points")):
        t = np.linspace(low, high, count)
        rows = size * radius * np.stack([np.cos(t), np.sin(t), t], axis=1)
        stops = [SimpleNamespace(reason=reason) for reason in reasons]
        curve = Mock(spec=atlas_cycles.CycleBranch, kind=kind, rows=rows, stops=stops)
        curve.tracks = curve.problem = curve.walker = curve.start = curve.record = (None, None)
        return curve

    whole, other = arc(0.0, 2.0, 300), arc(0.0, 1.0, 300, radius=1.5)
    parts, alike = [arc(0.0, 0.9, 200), arc(1.0, 1.9, 300)], arc(0.1, 0.8, 200, kind="torus")
    # Most points of this one lie on the whole, and most of its length beyond.
    longer = arc(0.0, 6.0, 300)
    longer.rows = longer.rows[np.r_[0:100, 100:300:50]]
    beyond = Rows(CUSP, ("mu", "l"), {"mu": SQUARE, "l": SQUARE}, {"x": 6.0}, ())
    for curve in (whole, longer):
        beyond._add(curve)
    assert longer in beyond.curves
    # A short way to an end is new; not where nothing ends, or another one ends there.
    for high, reasons, new in ((2.05, "bound", 1), (2.05, "stuck", 0), (2.001, "bound", 0)):
        ends = Rows(CUSP, ("mu", "l"), {"mu": SQUARE, "l": SQUARE}, {"x": 6.0}, ())
        for curve in (whole, arc(0.2, high, 900, reasons=("stuck", reasons))):
            ends._add(curve)
        assert len(ends.curves) == 1 + new
    for order in ([*parts, other, alike, whole], [whole, *parts, other, alike]):
        search = Rows(CUSP, ("mu", "l"), {"mu": SQUARE, "l": SQUARE}, {"x": 6.0}, ())
        for curve in order:
            search._add(curve)
        assert {*map(id, search.curves)} == {id(whole), id(other), id(alike)}
    # Of one that is cut on another one the way from its start that leads there is left out.
    monkeypatch.setattr(atlas_cycles, "branch_of", lambda *given: given[-1][1])
    for last, reason, count in ((0.8, "max_points", 2), (0.8, "stuck", 4), (0.0, "max_points", 0)):
        first, ahead = arc(0.0, 1.2, 300), arc(1.2, 2.0, 100, reasons=("start", "bound"))
        cut = arc(last, 2.0, int((2.0 - last) / 0.8 * 99) + 1, reasons=(reason, "bound"))
        cut.tracks = (first, ahead)
        search = Rows(CUSP, ("mu", "l"), {"mu": SQUARE, "l": SQUARE}, {"x": 6.0}, ())
        for curve in (first, cut):
            search._add(curve)
        whole = cut if reason == "stuck" else ahead
        assert search.curves == ([first, whole] if count else [cut])
        for curve in search.curves:
            curve.free, curve._ranges = ("mu",), xr.Dataset({"mu": ("point", [0.0, 1.0])})
        assert len(list(search._twice())) == (2 if reason == "stuck" else 0)
        if count:
            assert search._goes_on(first, -1)
            assert not search._goes_on(first, 0)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:atlas:RuntimeWarning")
@pytest.mark.parametrize("part", [0.0, atlas_cycles.ON_FOLD])
def test_cycles_that_end_at_a_saddle_node_on_them_end_at_the_fold(part, monkeypatch):
    """An oscillator under a constant push locks where w is small: no loop is missing there."""

    def none(end):
        raise pk.ConvergenceError(f"there is no loop at {end.reason} ends")

    monkeypatch.setattr(atlas_cycles, "ON_FOLD", part)
    monkeypatch.setattr(atlas_cycles.HomoclinicEnd, "connection", none)
    pushed = pk.Problem(
        {"x": "x - w*y - x*(x^2 + y^2) + p", "y": "w*x + y - y*(x^2 + y^2)"},
        parameters={"w": 0.3, "p": 0.2}, window={"x": (-2, 2), "y": (-2, 2)},
    )  # fmt: skip
    atlas = pk.atlas(pushed, "w", "p", span={"w": (0.05, 1.2), "p": (0.05, 1.2)}, cycles=True)
    missed = [
        text for text in atlas.not_followed if text.startswith("the homoclinic curve through")
    ]
    assert bool(missed) == (not part)
    ds = atlas.to_dataset()
    counted = ds.region_n_cycles >= 0
    # Off locking and below the Hopf curve there is one cycle, elsewhere none.
    alone = (ds.region_n_equilibria == 1) & (ds.region_n_stable == 0)
    assert counted.sum() > 2
    np.testing.assert_array_equal(ds.region_n_cycles[counted], alone[counted].astype(int))


@pytest.mark.slow
def test_homoclinic_orbits_of_the_double_zero(monkeypatch):
    """Its a = -4 e^4 and b = e^2 tau(e), of a series whose values are known to 12 digits.

    From the point itself the border is not reached: it is followed on by steps of its own size.
    """
    monkeypatch.setattr(atlas_cycles, "LOOPS", 300)
    wide = {"x": (-3, 3), "y": (-3, 3)}  # at a = -1 the largest cycles come to x = -2
    span = {"a": (-1.0, 0.5), "b": SQUARE}
    atlas = pk.atlas(DOUBLE_ZERO, "a", "b", span=span, window=wide, cycles=True)
    assert atlas.to_dataset().curve_kind.values.tolist() == ["fold", "hopf", "homoclinic"]
    curve = atlas.curves[-1].points
    e = (-curve.a.values / 4) ** 0.25
    order = np.argsort(e)
    tau = CubicSpline(e[order], (curve.b.values / e**2)[order])
    assert tau(0.1) == pytest.approx(1.42977039512, abs=1e-8)
    assert tau(0.3) == pytest.approx(1.43932162451, abs=1e-8)
    begins, ends = (atlas.to_dataset()[f"curve_{way}"].values[-1] for way in ("begins", "ends"))
    assert {begins, ends} == {"BT", "bound"}
    assert atlas.complete == {"n_equilibria": True, "n_stable": True}


@pytest.mark.slow
def test_oxidation_of_co():
    span = {"q2": (0.5, 2.0), "k": (0.1, 2.0)}
    atlas = pk.atlas(OXIDATION, "q2", "k", span=span, cycles=True)
    assert atlas.complete == {"n_equilibria": True, "n_stable": True}
    assert [curve.kind for curve in atlas.curves][:3] == ["fold", "hopf", "fold_of_cycles"]
    (folds,) = (curve for curve in atlas.curves if curve.kind == "fold_of_cycles")
    row = int(np.argmin(np.abs(folds.points.k.values - 0.3)))
    q2, k = folds.points.q2.values[row], folds.points.k.values[row]
    rest = pk.continuation(
        OXIDATION.replace(k=k, q2=q2), "q2", x0=folds.orbit(row)[["x", "y", "s"]].mean().to_array(),
        span=(0.5, 2.0),
    )  # fmt: skip
    (fold,) = rest.special("H")[0].switch().special("LPC")
    assert fold["q2"] == pytest.approx(q2, rel=1e-8)
    ds = atlas.to_dataset()
    assert (ds.curve_begins.values[2], ds.curve_ends.values[2]) == ("GH", "GH")
    # Both homoclinic curves end at their double zero, and on the fold curve at saddle-nodes.
    assert not atlas.not_followed
    fold = atlas.curves[0].points
    ends = set()
    for curve in atlas.curves[3:]:
        (side,) = (i for i in (0, 1) if curve.stops[i].reason == "non_central_saddle_node")
        assert curve.stops[1 - side].reason == "bogdanov_takens"
        q2, k = (float(curve.points[name][-side]) for name in ("q2", "k"))
        for branch in np.split(np.arange(fold.sizes["point"]), [int(np.argmin(fold.k.values))]):
            order = branch[np.argsort(fold.k.values[branch])]
            there = np.interp(k, fold.k.values[order], fold.q2.values[order])
            ends |= {curve} if abs(there - q2) < 2e-3 else set()
    assert len(ends) == 2
    equilibria = [p for p in atlas.special_points if p.branch.kind in ("fold", "hopf")]
    places = sorted((point.label, point["q2"], point["k"]) for point in equilibria)
    published = [
        ("BT", 1.1611987, 0.7223391),
        ("BT", 1.4176276, 0.9713976),
        ("CP", 1.0064083, 0.3559913),
        ("GH", 0.891319, 0.2324874),
        ("GH", 0.924255, 0.3058793),
    ]
    assert [label for label, *_ in places] == [label for label, *_ in published]
    np.testing.assert_allclose([at for _, *at in places], [at for _, *at in published], atol=1e-6)
    places = random_places(atlas, 500)
    found = atlas.counts(**places)
    for q2, k, number in zip(*places.values(), found.n_equilibria.values, strict=True):
        # with z = 1 - x - y - s: s = z/k, y = q2 z/(q6 + q3 x), z = (1 - x)/(1 + y/z + 1/k)
        x = np.polynomial.Polynomial([0, 1])
        c = 0.1 + 10 * x
        z_above, z_below = (1 - x) * c, (1 + 1 / k) * c + q2
        f = 5 * z_above**2 * c - 2 * x**2 * z_below**2 * c - 10 * x * q2 * z_above * z_below
        roots = f.roots()
        real = roots[np.abs(roots.imag) < 1e-9].real
        assert number == np.sum((real > 0) & (real < 1))


@pytest.mark.slow
def test_a_predator_and_its_prey_have_the_equilibria_of_their_cubic_and_no_cusp():
    """Its triple roots are at al = 0.0888 and al = 0.9012 alone, outside of the rectangle."""
    predator = pk.Problem(
        {"x": "x - x*y/(1 + al*x) - ep*x^2", "y": "-ga*y + x*y/(1 + al*x) - de*y^2"},
        parameters={"al": 0.3, "de": 0.2, "ga": 1.0, "ep": 0.01},
        window={"x": (0.5, 99.0), "y": (0.05, 30.0)},
    )
    span = {"al": (0.2, 0.6), "de": (0.05, 0.6)}
    atlas = pk.atlas(predator, "al", "de", span=span)
    assert atlas.complete == {"n_equilibria": True, "n_stable": True}
    assert [point.label for point in atlas.special_points] == ["BT"]
    places = random_places(atlas, 500)
    found = atlas.counts(**places)
    for al, de, number in zip(*places.values(), found.n_equilibria.values, strict=True):
        x = np.polynomial.Polynomial([0, 1])
        f = x - (1 + al * x) - de * (1 - 0.01 * x) * (1 + al * x) ** 2
        roots = f.roots()
        real = roots[np.abs(roots.imag) < 1e-9].real
        y = (1 - 0.01 * real) * (1 + al * real)
        assert number == np.sum((real > 0.5) & (real < 99) & (y > 0.05) & (y < 30))


@pytest.mark.slow
def test_states_that_grow_by_many_orders_along_curves_do_not_bend_these():
    """With w = exp(6 x) beside the cusp the curve and the numbers are those of the cusp."""
    problem = pk.Problem(
        {"x": "mu + l*x - x^3", "w": "exp(6*x) - w"}, parameters={"mu": 0.0, "l": 0.0},
        window={"x": (-3, 3), "w": (0.0, 1e9)},
    )  # fmt: skip
    atlas = pk.atlas(problem, "mu", "l", span={"mu": SQUARE, "l": (-1, 2)})
    assert atlas.complete == {"n_equilibria": True, "n_stable": True}
    ((line,),) = atlas.lines()
    np.testing.assert_allclose(27 * line[:, 0] ** 2, 4 * line[:, 1] ** 3, atol=1e-4)
    table = atlas.table("regions")
    assert table[["n_equilibria", "n_stable", "regions"]].values.tolist() == [[1, 1, 1], [3, 2, 1]]


@pytest.mark.slow
def test_the_atmosphere_of_1984_has_the_equilibria_of_its_cubic():
    states = {"x": (-3, 6), "y": (-3, 3), "z": (-3, 3)}
    atmosphere = pk.Problem(
        {"x": "-y^2 - z^2 - x/4 + F/4", "y": "x*y - 4*x*z - y + G", "z": "4*x*y + x*z - z"},
        parameters={"F": 1.0, "G": 1.0}, window=states,
    )  # fmt: skip
    atlas = pk.atlas(atmosphere, "G", "F", span={"G": (0, 3), "F": (0, 4)})
    assert len(atlas.complete) > 0
    assert all(atlas.complete.values())
    assert sorted(point.kind for point in atlas.special_points) == ["cusp", "zero_hopf"]
    places = random_places(atlas, 1000)
    found = atlas.counts(**places)
    for g, f, n, stable in zip(
        *places.values(), found.n_equilibria.values, found.n_stable.values, strict=True
    ):
        # y and z solve a linear system for each x; y^2 + z^2 = g^2/((1 - x)^2 + 16 x^2)
        x = np.polynomial.Polynomial([0, 1])
        roots = ((f - x) * ((1 - x) ** 2 + 16 * x**2) / 4 - g**2).roots()
        x = roots.real[np.abs(roots.imag) < 1e-9]
        y, z = g * np.array([1 - x, 4 * x]) / ((1 - x) ** 2 + 16 * x**2)
        rests, (low, high) = np.array([x, y, z]).T, np.array(list(states.values())).T
        inside = rests[((rests > low) & (rests < high)).all(axis=1)]
        slopes = [
            [[-0.25, -2 * y, -2 * z], [y - 4 * z, x - 1, -4 * x], [4 * y + z, 4 * x, x - 1]]
            for x, y, z in inside
        ]
        assert (n, stable) == (len(inside), sum(np.linalg.eigvals(slopes).real.max(axis=1) < 0))


def test_trigonometric_laws_have_the_curves_of_their_bifurcation_set():
    law = pk.Reduced(0.3, 0.2)
    span = {"lam": (-1.5, 1.5), "psi": (-1.5, 1.5)}
    atlas = pk.atlas(law, "lam", "psi", span=span)
    assert {curve.kind for curve in atlas.curves} == {"fold"}
    exact = pk.bifurcation_set(law, "lam", "psi", xlim=span["lam"], ylim=span["psi"])
    (row,) = np.flatnonzero(exact.curve_kind.values == "fold")
    phi = exact.phi.isel(curve=row).values
    assert len(phi) > 100
    for curve in atlas.curves:
        x = curve.points.phi.values
        # cos^3 and sin^3 of the merged angle are the parameters, on both
        np.testing.assert_allclose(curve.points.lam, np.cos(x) ** 3, atol=1e-10)
        np.testing.assert_allclose(np.abs(curve.points.psi), np.abs(np.sin(x) ** 3), atol=1e-10)
    np.testing.assert_allclose(exact.lam.isel(curve=row), np.cos(phi) ** 3, atol=1e-10)
    assert len(atlas.special_points) == exact.sizes["cusp"] == 4
    places = random_places(atlas, 2_000)
    inside = np.abs(places["lam"]) ** (2 / 3) + np.abs(places["psi"]) ** (2 / 3) < 1
    np.testing.assert_array_equal(atlas.counts(**places).n_equilibria, np.where(inside, 4, 2))


@pytest.mark.slow
def test_code_is_not_proved_and_that_is_said():
    code = pk.Problem(
        lambda x, mu, nu: [mu + nu * x[0] - x[0] ** 3], "x", {"mu": 0.0, "nu": 0.0},
        window={"x": (-3, 3)},
    )  # fmt: skip
    with pytest.warns(RuntimeWarning, match="not proved: f is code"):
        atlas = pk.atlas(code, "mu", "nu", span={"mu": SQUARE, "nu": (-1, 2)})
    assert [curve.kind for curve in atlas.curves] == ["fold"]
    assert not any(atlas.complete.values())
    assert "proved off the curves: nothing" in repr(atlas)
    assert not atlas.counts(mu=0.0, nu=1.0).complete.any()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"x": "nu"}, "x: parameter"),
        ({"y": "mu"}, "y: got 'mu'"),
        ({"span": {"mu": SQUARE}}, "span: got"),
        ({"span": {"mu": SQUARE, "l": (1, 0)}}, r"span\['l'\]"),
        ({"span": {"mu": SQUARE, "l": SQUARE, "x": SQUARE}}, "span: parameter"),
        ({"window": {"z": SQUARE}}, "window: state"),
        ({"problem": pk.Problem("x*l", "x", {"l": 1.0}, map=True)}, "problem: got"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(arguments, message):
    given = {"problem": CUSP, "x": "mu", "y": "l", "span": {"mu": SQUARE, "l": SQUARE}}
    with pytest.raises(pk.ParameterError, match=message):
        pk.atlas(**given | arguments)


def test_portraits_show_what_is_in_regions(quintic):
    ax = pk.plot.atlas(quintic, portraits=True)
    ds = quintic.to_dataset()
    small = ax.child_axes
    letters = {
        text.get_text()[0]: text.get_position() for text in ax.texts if "/" in text.get_text()
    }
    assert sorted(letters) == ["A", "B", "C"]
    for axes in small:
        (letter,) = (text.get_text() for text in axes.texts)
        p, q = letters[letter]
        assert np.any((ds.region_p == p) & (ds.region_q == q))
        # r^2 = (q -+ sqrt(q^2 + 4 p))/2, of which the inner one is unstable, dashed
        roots = 0.5 * (q + np.array([-1, 1]) * np.sqrt(complex(q * q + 4 * p)))
        radii = sorted(np.sqrt(r.real) for r in roots if r.real > 0 and r.imag == 0)
        rings = [line for line in axes.lines if len(line.get_xdata()) > 50]
        found = [float(np.max(np.hypot(*line.get_data()))) for line in rings]
        np.testing.assert_allclose(sorted(found), radii, rtol=1e-3)
    cusp = pk.atlas(CUSP, "mu", "l", span={"mu": SQUARE, "l": (-1, 2)})
    with pytest.raises(pk.ParameterError, match="portraits: got True"):
        pk.plot.atlas(cusp, portraits=True)


def test_a_corner_at_which_the_system_is_not_there_is_refused_by_name():
    disk = pk.GyroRotorDisk(beta=0.3, e=0.05, a=0.012, r=0.2, omega1=31.4)
    with pytest.raises(pk.ParameterError, match="^span: .*r: got 0.0 together with e = 0.0"):
        pk.atlas(disk, "e", "r", span={"e": (0.0, 0.1), "r": (0.0, 0.3)})


def test_guesses_are_named_once_for_each_kind():
    def point(kind, status, name):
        return Mock(kind=kind, status=status, __repr__=lambda self: name)

    points = [
        point("cusp", "guess", "A"), point("torus", "guess", "B"), point("cusp", "guess", "C"),
        point("torus", "converged", "D"),
    ]  # fmt: skip
    assert atlas_cycles.guesses(points, "here") == [
        "here: 2 points, the first of them A",
        "here: B",
    ]


@pytest.mark.parametrize("away", [1e-3, 0.6])
def test_of_guesses_on_families_those_that_a_curve_passes_are_not_named(away):
    """A family along x at y = 0, and a curve along y at x = 0.25, within a step of the guess."""
    line = np.linspace(0.0, 1.0, 21)
    guess = Mock(kind="fold_of_cycles", status="guess", index=6)
    family = Mock(special_points=[guess, Mock(kind="end", status="guess", index=0)])
    family.rows = np.stack([line, 0 * line], axis=1)
    curve = Mock(kind="fold_of_cycles", rows=np.stack([0 * line + 0.26, line + away - 0.5], axis=1))

    class Rows(atlas_cycles.CycleSearch):
        def _rows(self, branch):
            return branch.rows

    search = Rows(CUSP, ("mu", "l"), {"mu": SQUARE, "l": SQUARE}, {"x": 6.0}, ())
    search.curves.append(curve)
    assert search._leading_on(family) == ([] if away < 0.5 else [guess])


def test_numbers_are_left_out_where_a_region_has_no_room_for_them():
    """The stripe between the curves of two folds is thinner than the text, the rest is wide."""
    thin = pk.Problem(
        "mu + l - x^2", "x", {"mu": 0.0, "l": 0.0}, window={"x": (-0.25, 3)}
    )  # two equilibria in the window where 0 < mu + l < 1/16
    atlas = pk.atlas(thin, "mu", "l", span={"mu": SQUARE, "l": SQUARE})
    ds = atlas.to_dataset()
    assert sorted(ds.region_n_equilibria.values.tolist()) == [0, 1, 2]
    ax = pk.plot.atlas(atlas, ax=plt.figure(figsize=(3.4, 2.6)).add_subplot())
    assert sorted(text.get_text() for text in ax.texts) == ["0/0", "1/1"]
