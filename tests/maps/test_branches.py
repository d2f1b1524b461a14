"""Maps of branches: special points, stability and hysteresis along a parameter in each cell."""

import dataclasses
import warnings

import dask.array as da
import numpy as np
import pytest
import xarray as xr

import phasekit as pk
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.cells import along

AB = pk.Problem(
    ["-x + p1*(1 - x)*exp(y)", "-y + p1*p2*(1 - x)*exp(y) - p3*y"],
    ("x", "y"),
    {"p1": 0.0, "p2": 14.0, "p3": 2.0},
    window={"x": (-1, 2), "y": (-1, 8)},
)
CUSP = pk.Problem("mu + nu*x - x^3", "x", {"mu": 0.0, "nu": 1.0}, window={"x": (-3, 3)})
HOPF = pk.Problem(
    {"x": "mu*x - w*y - x*(x^2 + y^2)", "y": "w*x + mu*y - y*(x^2 + y^2)"},
    parameters={"mu": -1.0, "w": 1.0},
    window={"x": (-1, 1), "y": (-1, 1)},
)
PITCHFORK = pk.Problem("r*x + e*x^2 - x^3", "x", {"r": 0.0, "e": 0.0}, window={"x": (-2, 2)})
ALL = ("special_points", "n_stable", "hysteresis")
WIDE = {"along": ("p1", (0, 0.2)), "of": ALL}


def folds_of_ab(p2, p3):
    """Values of p1 at the folds: x (1 - x) c = 1 with y = c x and c = p2/(1 + p3)."""
    c = p2 / (1 + p3)
    if c <= 4.0:
        return []
    roots = 0.5 * (1 + np.array([-1, 1]) * np.sqrt(1 - 4 / c))
    return sorted((roots / (1 - roots) * np.exp(-c * roots)).tolist())


def test_cells_equal_single_branches():
    p2, p3 = np.linspace(12, 16, 4), np.linspace(1.5, 2.5, 5)
    ds = pk.sweep(AB, p2=p2, p3=p3, **WIDE)
    assert set(ds.branch_status.values.ravel()) == {pk.BranchStatus.COMPLETE}
    for i, j in np.ndindex(4, 5):
        cell = ds.isel(p2=i, p3=j)
        problem = AB.replace(p2=p2[i], p3=p3[j])
        one = pk.continuation(problem, "p1", x0=[0, 0], span=(0, 0.2))
        found = sorted((s["p1"], s.kind, *s.x) for s in one.special_points if s.kind != "end")
        kinds = [pk.SpecialPointKind(k).name.lower() for k in cell.special_kind.values if k]
        assert kinds == [kind for _, kind, *_ in found]
        names = ("special_p1", "special_x", "special_y")
        own = np.array([cell[name].values[: len(found)] for name in names]).T
        want = np.array([(at, *x) for at, _, *x in found]).reshape(-1, 3)
        np.testing.assert_allclose(own, want, rtol=1e-12, atol=0)
        assert cell.n_hopf == kinds.count("hopf")
        exact = folds_of_ab(p2[i], p3[j])
        at_folds = cell.special_p1.values[cell.special_kind.values == pk.SpecialPointKind.FOLD]
        np.testing.assert_allclose(at_folds, exact, rtol=1e-12)


def test_folds_and_hysteresis_of_the_cusp_are_exact():
    nu = np.linspace(-1.0, 1.4, 9)
    ds = pk.sweep(CUSP, nu=nu, along=("mu", (-1, 1)), of=ALL)
    fold = 2 * (np.maximum(nu, 0) / 3) ** 1.5
    assert ds.n_fold.values.tolist() == (2 * (nu > 1e-9)).tolist()
    some = nu > 1e-9
    np.testing.assert_allclose(ds.special_mu.values[some], np.outer(fold[some], [-1, 1]), 1e-12)
    np.testing.assert_allclose(ds.hysteresis.values[some, 0], np.outer(fold[some], [-1, 1]), 1e-12)
    np.testing.assert_allclose(ds.hysteresis_width, 2 * fold, rtol=1e-12)
    assert ds.n_stable.values.tolist() == (1 + some).tolist()
    assert np.isnan(ds.hysteresis.values[~some]).all()
    # a = -V'''/2 of mu' = ... on the center manifold: 3 |x| with x = sqrt(nu/3).
    size = 3 * np.sqrt(nu[some] / 3)
    np.testing.assert_allclose(np.abs(ds.special_coefficient.values[some, 0]), size, rtol=1e-12)


@pytest.mark.filterwarnings("ignore:branches of")
def test_cells_without_a_value_at_an_end_of_the_span_leave_the_others():
    """x^3 / 3 - x + sqrt(p - d) = 1 has its fold at x = -1, where sqrt(p - d) = 1/3."""
    law = pk.Problem(
        {"x": "x**3/3 - x + sqrt(p - d) - 1"}, parameters={"p": 0.0, "d": 0.0},
        window={"x": (-3, 3)},
    )  # fmt: skip
    d = np.array([0.1, 0.3, -0.05, 0.5])
    given = {"along": ("p", (0.0, 2.0)), "of": ["special_points", "n_stable"]}
    ds = pk.sweep(law, d=d, **given)
    fold = np.abs(ds.special_x.values + 1.0) < 1e-6
    assert fold.sum(axis=1).tolist() == [1] * 4
    np.testing.assert_allclose(ds.special_p.values[fold], d + 1 / 9, rtol=1e-13)
    whole = [pk.BranchStatus.COMPLETE if one < 0.0 else pk.BranchStatus.CUT for one in d]
    assert ds.branch_status.values.tolist() == whole
    for k in range(len(d)):
        alone = pk.sweep(law, d=d[k : k + 1], **given)
        for name in ("special_p", "special_x", "special_coefficient", "n_stable"):
            own, want = ds[name].values[k].ravel(), alone[name].values[0].ravel()
            np.testing.assert_array_equal(own[: len(want)], want)


def test_hopf_points_of_the_normal_form():
    ds = pk.sweep(HOPF, w=[0.5, 1.0, 3.0], along=("mu", (-0.7, 0.9)), of=ALL)
    assert ds.n_hopf.values.tolist() == [1, 1, 1]
    np.testing.assert_allclose(ds.special_mu.values[:, 0], 0.0, atol=1e-14)
    assert (ds.special_coefficient.values < 0).all()
    assert ds.n_stable.values.tolist() == [1, 1, 1]


def test_cycles_of_the_normal_form():
    """x^2 + y^2 = mu with the period 2 pi/w, stable; unstable where the cubic pushes outwards."""
    ds = pk.sweep(HOPF, w=[0.5, 2.0], along=("mu", (-0.7, 0.9)), of=[*ALL, "period"])
    assert ds.n_cycle_families.values.tolist() == [1, 1]
    np.testing.assert_allclose(
        ds.period.values[:, 0], 2 * np.pi / np.array([[0.5], [2.0]]) + [0, 0]
    )
    np.testing.assert_allclose(ds.cycle_extent.values[:, 0], [[0, 0.9]] * 2, atol=1e-9)
    size = np.sqrt(0.9)
    np.testing.assert_allclose(ds.cycle_x.values[:, 0], [[-size, size]] * 2, rtol=1e-6)
    np.testing.assert_allclose(ds.oscillation.values[:, 0], [[0, 0.9]] * 2, atol=1e-9)
    assert ds.sizes["bistable_interval"] == 0
    # r' = r (mu + r^2 - r^4): a fold of cycles at mu = -1/4, and a stable cycle beyond it.
    r = "(x^2 + y^2)"
    bautin = pk.Problem(
        {"x": f"x*(mu + b*{r} - {r}^2) - y", "y": f"y*(mu + b*{r} - {r}^2) + x"},
        parameters={"mu": -1.0, "b": 1.0}, window={"x": (-1, 1), "y": (-1, 1)},
    )  # fmt: skip
    ds = pk.sweep(bautin, b=[1.0], along=("mu", (-0.7, 0.5)), of=[*ALL, "period"])
    np.testing.assert_allclose(ds.oscillation.values[0, 0], [-0.25, 0.5], atol=1e-7)
    np.testing.assert_allclose(ds.bistability.values[0, 0], [-0.25, 0.0], atol=1e-7)
    assert ds.hysteresis.size == 0
    assert ds.n_stable.item() == 1


def test_cycles_end_at_another_hopf_point_once():
    """Between mu = -1/2 and 1/2 the growth 1/4 - mu^2 is positive."""
    both = pk.Problem(
        {
            "x": "x*(g - mu^2 - x^2 - y^2) - y",
            "y": "y*(g - mu^2 - x^2 - y^2) + x",
        },
        parameters={"mu": -1.0, "g": 0.25},
        window={"x": (-1, 1), "y": (-1, 1)},
    )
    g = np.array([-0.1, 1e-6, 1e-4, 0.25])
    ds = pk.sweep(both, g=g, along=("mu", (-1, 1)), of=["special_points", "period"])
    assert ds.n_hopf.values.tolist() == [0, 2, 2, 2]
    assert ds.n_cycle_families.values.tolist() == [0, 1, 1, 1]
    want = np.sqrt(g[1:, None]) * [-1, 1]
    np.testing.assert_allclose(ds.oscillation.values[1:, 0], want, atol=1e-6)


@pytest.mark.slow
def test_a_family_that_cannot_be_followed_leaves_the_others(monkeypatch):
    """Hopf points at mu = 0 and at nu, of states that know nothing of each other."""
    law = pk.Problem(
        {
            "x": "mu*x - y - x*(x^2 + y^2)", "y": "x + mu*y - y*(x^2 + y^2)",
            "u": "(mu - nu)*u - 2*v - u*(u^2 + v^2)", "v": "2*u + (mu - nu)*v - v*(u^2 + v^2)",
        },
        parameters={"mu": -1.0, "nu": 0.25},
        window=dict.fromkeys("xyuv", (-1, 1)),
    )  # fmt: skip
    begin, number = along.hopf_family, iter(range(9))

    def failing(*given):
        if next(number) in lost:
            raise pk.ConvergenceError("no orbit")
        return begin(*given)

    monkeypatch.setattr(along, "hopf_family", failing)
    for lost in ([1], [2]):
        number = iter(range(1, 9))
        with pytest.warns(RuntimeWarning, match="in 1 a branch or a family .* within the span"):
            ds = pk.sweep(law, nu=[0.25], along=("mu", (-0.5, 0.5)), of=[*ALL, "period"])
        assert ds.branch_status.values.tolist() == [pk.BranchStatus.CUT]
        assert ds.n_hopf.values.tolist() == [2]
        assert ds.n_stable.values.tolist() == [1]
        period = [2 * np.pi, np.pi][lost[0] % 2]
        np.testing.assert_allclose(ds.period.values[0], [[period, period]], rtol=1e-9)


def test_branches_through_branch_points_are_followed():
    ds = pk.sweep(PITCHFORK, e=[0.0, 0.5], along=("r", (-1.0, 1.0)), of=ALL)
    assert ds.n_branch_point.values.tolist() == [1, 1]
    assert ds.n_fold.values.tolist() == [0, 1]
    np.testing.assert_allclose(ds.special_r.values[1, 0], -(0.5**2) / 4, rtol=1e-12)
    # Both branches of the transcritical point are stable from the fold to it, and after it two.
    np.testing.assert_allclose(ds.hysteresis.values[1, 0], [-0.0625, 1.0], rtol=1e-12)
    np.testing.assert_allclose(ds.hysteresis.values[0, 0], [0.0, 1.0], atol=1e-9)
    assert ds.n_stable.values.tolist() == [2, 2]
    first = ds.isel(e=1).phasekit.branch()
    assert first.special("BP")
    assert ds.isel(e=1).phasekit.branch(1).special("LP")
    with pytest.raises(pk.ParameterError, match="number"):
        ds.isel(e=1).phasekit.branch(7)


def test_fixed_points_of_a_map():
    logistic = pk.Problem(
        "r*x*(1 - x) + e", "x", {"r": 2.0, "e": 0.0}, map=True, window={"x": (-1, 1)}
    )
    ds = pk.sweep(logistic, e=[0.0, 0.01], along=("r", (0.5, 3.5)), of="special_points")
    assert ds.n_period_doubling.values.tolist() == [1, 1]
    at = ds.special_kind.values[0] == pk.SpecialPointKind.PERIOD_DOUBLING
    assert ds.special_r.values[0, at].item() == pytest.approx(3.0, rel=1e-12)
    assert ds.n_branch_point.values.tolist() == [1, 0]


@pytest.mark.slow
def test_stored_workers_and_blocks_are_what_is_computed_at_once(tmp_path):
    p2, p3 = np.linspace(12, 16, 3), np.linspace(1.5, 2.5, 2)
    whole = pk.sweep(AB, p2=p2, p3=p3, **WIDE)
    name = tmp_path / "map.zarr"
    pk.sweep(AB, p2=p2[:2], p3=p3, store=name, chunks=2, workers=1, **WIDE)
    longer = pk.sweep(AB, p2=p2, p3=p3, store=name, workers=2, **WIDE)
    assert longer.identical(whole)
    assert pk.open_map(name, verify=True).identical(whole)
    with pytest.raises(pk.StoreError, match="last_p1"):
        pk.sweep(AB, p2=p2, p3=p3, store=name, along=("p1", (0, 0.3)), of=ALL)
    (name / "n_fold" / "c.0.0").write_bytes(b"gone")
    with pytest.warns(UserWarning, match="damaged"):
        again = pk.sweep(AB, p2=p2, p3=p3, store=name, **WIDE)
    assert again.identical(whole)
    lazy = pk.sweep(AB, p2=xr.DataArray(da.from_array(p2, chunks=2), dims="p2"), p3=p3, **WIDE)
    assert lazy.n_fold.chunks is not None
    for variable in whole.data_vars:
        assert lazy[variable].equals(whole[variable]), variable


def test_a_cell_gives_its_system_and_branch_back():
    ds = pk.sweep(AB, p2=[12.0, 14.0], p3=[2.0], **WIDE)
    cell = ds.isel(p2=1, p3=0)
    assert cell.phasekit.system() == AB
    branch = cell.phasekit.branch()
    single = pk.continuation(AB, "p1", x0=[0, 0], span=(0, 0.2))
    assert branch.points.drop_attrs().equals(single.points.drop_attrs())
    assert [repr(s) for s in branch.special_points] == [repr(s) for s in single.special_points]
    with pytest.raises(pk.ParameterError, match="one cell"):
        ds.phasekit.branch()
    with pytest.raises(pk.ParameterError, match="a map of branches"):
        pk.sweep(AB, p1=[0.1, 0.2]).isel(p1=0).phasekit.branch()


def test_cells_that_fail_say_so():
    pole = pk.Problem("sqrt(a - mu) - x", "x", {"a": 1.0, "mu": 0.0}, window={"x": (-3, 3)})
    with pytest.warns(RuntimeWarning, match="in 1 .*a branch or a family .* ends within the span"):
        ds = pk.sweep(pole, a=[0.5, 2.0, np.nan], along=("mu", (0, 1)), of="special_points")
    wanted = [pk.BranchStatus.CUT, pk.BranchStatus.COMPLETE, pk.BranchStatus.NOT_COMPUTED]
    assert ds.branch_status.values.tolist() == wanted
    assert ds.n_fold.values.tolist() == [0, 0, -1]
    none = pk.Problem("a + x^2 + mu^2", "x", {"a": 1.0, "mu": 0.0}, window={"x": (-3, 3)})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ds = pk.sweep(none, a=[1.0], along=("mu", (-1, 1)), of="special_points")
    assert ds.branch_status.values.tolist() == [pk.BranchStatus.NO_EQUILIBRIUM]
    # Of a double equilibrium nothing is enclosed: that is no proof that there is none.
    double = pk.Problem("a + x^2", "x", {"a": 1.0, "mu": 0.0}, window={"x": (-3, 3)})
    with pytest.warns(RuntimeWarning, match="it is not proved that all equilibria"):
        ds = pk.sweep(double, a=[0.0, 1.0], along=("mu", (-1, 1)), of="special_points")
    wanted = [pk.BranchStatus.UNPROVED, pk.BranchStatus.NO_EQUILIBRIUM]
    assert ds.branch_status.values.tolist() == wanted


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"along": ("q", (0, 1))}, "along: parameter"),
        ({"along": ("p1", (1, 0))}, r"along: got \(1, 0\), wants two finite numbers, low < high"),
        ({"along": ("p1", (0, np.nan))}, "along: got nan"),
        ({"along": "p1"}, "along: got 'p1', wants a parameter and its span"),
        ({"along": ("p2", (0, 1))}, "along: got 'p2', wants a parameter that is no axis"),
        ({"along": ("p1", (0, 1)), "of": "orbits"}, "of: the quantity 'orbits' is unknown"),
        ({"along": ("p1", (0, 1)), "starts": 3}, "starts: got 3"),
        ({"along": ("p1", (0, 1)), "x": 0.5}, "'x' is unknown"),
    ],
    ids=str,
)
def test_bad_input_is_refused_by_name(given, words):
    with pytest.raises(pk.ParameterError, match=words):
        pk.sweep(AB, p2=[1.0, 2.0], **given)


def test_systems_without_such_branches_are_refused():
    with pytest.raises(pk.ParameterError, match="along: .* states no equations"):
        pk.sweep(pk.Reduced(0.1, 0.2), lam=[0.1], along=("psi", (0, 1)))
    with pytest.raises(pk.ParameterError, match="window"):
        pk.sweep(pk.Problem("a*x + b", "x", {"a": 1, "b": 1}), b=[1, 2], along=("a", (0, 1)))
    forced = pk.Problem(
        "-x + a*cos(t)", "x", {"a": 1.0, "b": 1}, time="t", period=2 * np.pi, window={"x": (0, 1)}
    )
    with pytest.raises(pk.ParameterError, match="does not depend on time"):
        pk.sweep(forced, b=[1.0, 2.0], along=("a", (0, 1)))


@pytest.mark.slow
def test_counts_are_right_in_every_cell():
    nu, tilt = np.linspace(-1.0, 1.4, 12), np.linspace(-0.5, 0.5, 11)
    law = pk.Problem("mu + nu*x - x^3 + s", "x", {"mu": 0, "nu": 1, "s": 0}, window={"x": (-3, 3)})
    ds = pk.sweep(law, nu=nu, s=tilt, along=("mu", (-0.9, 0.9)), of=ALL)
    fold = 2 * (np.maximum(nu, 0.0)[:, None, None] / 3) ** 1.5 * [-1, 1] - tilt[None, :, None]
    exact = np.sum((np.abs(fold) < 0.9) & (nu[:, None, None] > 0), axis=2)
    assert ds.branch_status.values.max() == pk.BranchStatus.COMPLETE
    np.testing.assert_array_equal(ds.n_fold, exact)


def test_folds_next_to_the_ends_of_a_span_leave_stability_exact():
    """Both folds stand gap outside the span: two stable sheets hold all over it, or within."""
    gap = np.sort([s * 10.0**-k for k in (3, 6, 9, 12) for s in (1, -1)])
    nu = 3 * ((1 + gap) / 2) ** (2 / 3)
    ds = pk.sweep(CUSP, nu=nu, along=("mu", (-1, 1)), of=ALL)
    assert ds.n_fold.values.tolist() == (2 * (gap < 0)).tolist()
    assert ds.n_stable.values.tolist() == [2] * len(gap)
    want = np.minimum(1 + gap, 1)[:, None] * [-1, 1]
    np.testing.assert_allclose(ds.hysteresis.values[:, 0], want, rtol=1e-14)


def blinded(monkeypatch, where):
    """Walks of cells that look for no special points, for some parameters and options."""
    curves = along._curves

    def blind(cells, parameter, options):
        nothing = dataclasses.replace(options, detect=())
        return [
            curve.replace(options=nothing) if where(cell.problem.parameters, options) else curve
            for cell, curve in zip(cells, curves(cells, parameter, options), strict=True)
        ]

    monkeypatch.setattr(along, "_curves", blind)


@pytest.mark.parametrize("always", [False, True])
def test_what_all_neighbours_have_is_looked_for_again_or_said_to_be_missed(monkeypatch, always):
    """The walk of one cell sees no folds: at first, so that shorter steps find them; or ever."""
    default = ContinuationOptions()
    blinded(
        monkeypatch,
        lambda parameters, options: (
            parameters["nu"] == 0.9 and (always or options.max_step == default.max_step)
        ),
    )
    nu = np.array([0.5, 0.7, 0.9, 1.1, 1.3])
    fold = np.outer(2 * (nu / 3) ** 1.5, [-1, 1])
    status = [pk.BranchStatus.COMPLETE] * 5
    if always:
        fold[2], status[2] = np.nan, pk.BranchStatus.MISSED
        with pytest.warns(RuntimeWarning, match="in 1 special points that all neighbours have"):
            ds = pk.sweep(CUSP, nu=nu, along=("mu", (-1, 1)), of=ALL)
    else:
        ds = pk.sweep(CUSP, nu=nu, along=("mu", (-1, 1)), of=ALL)
    assert ds.branch_status.values.tolist() == status
    assert ds.n_fold.values.tolist() == [2, 2, 0 if always else 2, 2, 2]
    np.testing.assert_allclose(ds.special_mu, fold, rtol=1e-12)
    seen = np.isfinite(fold[:, 0])
    np.testing.assert_allclose(ds.hysteresis.values[seen, 0], fold[seen], rtol=1e-12)


@pytest.mark.parametrize("steep", [30.0, 200.0])
def test_folds_that_move_far_from_cell_to_cell_are_missed(monkeypatch, steep):
    """Those of -x + mu + 2 tanh(k (x - 1)), whose walk in one cell sees none."""
    blinded(monkeypatch, lambda parameters, _: parameters["k"] == steep)
    law = pk.Problem(
        "mu - x + 2*tanh(k*(x - 1))", "x", {"mu": 0.0, "k": 1.0}, window={"x": (-6.0, 6.0)}
    )
    k = np.array([1.0, 5.0, 30.0, 200.0, 2000.0])
    with pytest.warns(RuntimeWarning, match="in 1 special points that all neighbours have"):
        ds = pk.sweep(law, k=k, along=("mu", (-3, 4)), of="n_fold")
    assert ds.n_fold.values.tolist() == [0 if one == steep else 2 for one in k]
    missed = ds.branch_status.values == pk.BranchStatus.MISSED
    assert missed.tolist() == [one == steep for one in k]


def test_hopf_points_that_have_become_neutral_saddles_are_not_missed():
    """In one cell the Hopf point has passed a Bogdanov-Takens point."""
    law = pk.Problem(
        {"x": "y", "y": "p - (nu^2 - 1/10)*y + x*y - x^2"}, parameters={"p": 0.0, "nu": 0.0},
        window={"x": (-3, 3), "y": (-1, 1)},
    )  # fmt: skip
    ds = pk.sweep(law, nu=[-1.0, -0.7, 0.0, 0.7, 1.0], along=("p", (-0.5, 2.0)), of="n_hopf")
    assert ds.n_hopf.values.tolist() == [1, 1, 0, 1, 1]
    assert ds.branch_status.values.tolist() == [pk.BranchStatus.COMPLETE] * 5


@pytest.mark.parametrize("gap", [1e-6, 0.04])
def test_what_a_cell_does_not_have_is_not_missed(gap):
    """Both folds of each cell merge next to nu = 0, where they meet in two cusps."""
    law = pk.Problem(
        "mu + (nu^2 - e)*x - x^3", "x", {"mu": 0.0, "nu": 0.0, "e": gap}, window={"x": (-3, 3)}
    )
    nu = np.array([-1.0, -0.6, 0.0, 0.6, 1.0])
    ds = pk.sweep(law, nu=nu, along=("mu", (-1, 1)), of=ALL)
    assert ds.n_fold.values.tolist() == [2, 2, 0, 2, 2]
    assert ds.branch_status.values.tolist() == [pk.BranchStatus.COMPLETE] * 5
