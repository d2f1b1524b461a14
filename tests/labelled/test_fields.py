"""Continuation of fields of many states, against closed forms and against the dense engine."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
import scipy.sparse as sp
import xarray as xr
from scipy.sparse.linalg import aslinearoperator
from witnesses.variants import some

import phasekit as pk
from phasekit.bifurcation.continuation.large.curve import LargeCurve
from phasekit.bifurcation.continuation.large.hopf import normal_form
from phasekit.cycles import trace
from phasekit.numerics.memory import refuse

FOLD = 3.513830719125  # of u'' + lam exp(u) = 0, u(0) = u(1) = 0
BOUNDED = pk.ContinuationOptions(bounds={"u": (-1.0, 10.0)})


def laplacian(n):
    h = 1.0 / (n + 1)
    entries = [np.full(n - 1, h**-2), np.full(n, -2.0 * h**-2), np.full(n - 1, h**-2)]
    return sp.diags_array(entries, offsets=[-1, 0, 1], format="csc")


def bratu(n, jac="sparse", **keywords):
    L = laplacian(n)

    def f(u, lam):
        return L @ u + lam * np.exp(u)

    def slopes(u, lam):
        return L + sp.diags_array(lam * np.exp(u), format="csc")

    forms = {
        "sparse": slopes,
        "pattern": L != 0.0,
        "operator": lambda u, lam: aslinearoperator(slopes(u, lam)),
        "full": lambda u, lam: slopes(u, lam).toarray(),
        "none": None,
    }
    keywords.setdefault("state", [("u", n)])
    return pk.Problem(f, parameters={"lam": 0.0}, jac=forms[jac], **keywords)


def fold_of(problem, **keywords):
    (point,) = pk.continuation(
        problem, "lam", span=(0.0, 4.0), options=BOUNDED, **keywords
    ).special("fold")
    return point


def test_folds_converge_as_the_square_of_the_cells():
    errors = [fold_of(bratu(n))["lam"] - FOLD for n in (24, 49, 99)]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=1e-2)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=2e-3)
    # What is left after one extrapolation is of fourth order.
    assert abs(errors[2] - (errors[1] - errors[2]) / 3.0) < 4e-7


@pytest.mark.parametrize("form", ["pattern", "operator", "full", "none"])
def test_forms_of_derivatives_give_the_same_fold(form):
    one, other = fold_of(bratu(20)), fold_of(bratu(20, form))
    assert other["lam"] == pytest.approx(one["lam"], rel=1e-9)
    assert other.normal_form["a"] == pytest.approx(one.normal_form["a"], rel=1e-6)
    assert other.normal_form["b"] == pytest.approx(one.normal_form["b"], rel=1e-6)


@pytest.mark.slow
def test_it_is_what_the_dense_engine_finds():
    n = 30
    names = [f"u_{i}" for i in range(n)]
    dense = pk.Problem(
        bratu(n).f, names, {"lam": 0.0}, jac=lambda u, lam: bratu(n).jac(u, lam).toarray()
    )
    options = pk.ContinuationOptions(bounds={"u_15": (-1.0, 10.0)})
    branch = pk.continuation(dense, "lam", span=(0.0, 4.0), options=options)
    (one,) = branch.special("fold")
    two = fold_of(bratu(n))
    with pytest.raises(pk.ParameterError, match="few states"):
        _ = two.sensitivity
    assert two["lam"] == pytest.approx(one["lam"], rel=1e-12)
    assert two.x == pytest.approx(one.x, rel=1e-6)
    sign = np.sign(one.special.extra @ two.special.extra)
    for name in ("a", "b"):
        assert sign * two.normal_form[name] == pytest.approx(one.normal_form[name], rel=1e-6)


def test_more_cells_make_no_more_points():
    points = [
        pk.continuation(bratu(n), "lam", span=(0.0, 4.0), options=BOUNDED).points.sizes["point"]
        for n in (50, 800)
    ]
    assert abs(points[0] - points[1]) <= 3


def test_branches_are_arrays_over_space():
    import xarray as xr

    n = 40
    x = xr.DataArray(np.arange(1, n + 1) / (n + 1), dims="x", attrs={"units": "m"})
    problem = bratu(n, coords={"x": x}).described({"u": {"long_name": "heat", "units": "K"}})
    branch = pk.continuation(
        problem, "lam", span=(0.0, 4.0), options=BOUNDED, record={"middle": lambda u, lam: u[20]}
    )
    points = branch.points
    assert points.u.dims == ("point", "x")
    assert points.u.attrs == {"long_name": "heat", "units": "K"}
    assert points.x.attrs["units"] == "m"
    assert np.array_equal(points.middle, points.u[:, 20])
    assert np.array_equal(points.u_max, points.u.max("x"))
    (fold,) = branch.special("LP")
    assert fold["u"].dims == ("x",)
    assert branch.to_dataset().special_u.dims == ("special_point", "x")
    assert points.u[int(fold.index)].identical(points.u[fold.index])
    # One eigenvalue crosses at the fold.
    assert set(points.n_unstable.values[: fold.index].tolist()) == {0}
    assert set(points.n_unstable.values[fold.index + 1 :].tolist()) == {1}
    assert float(points.residual.max()) < 1e-13
    assert "LP" in repr(branch)
    assert branch.table().kind.tolist() == ["end", "fold", "end"]


def allen_cahn(n):
    L = laplacian(n)
    return pk.Problem(
        lambda u, lam: L @ u + lam * (u - u**3), n, {"lam": 1.0},
        jac=lambda u, lam: L + sp.diags_array(lam * (1.0 - 3.0 * u**2), format="csc"),
    )  # fmt: skip


def test_branch_points_of_a_trivial_branch_are_eigenvalues():
    n = 99
    branch = pk.continuation(allen_cahn(n), "lam", span=(0.0, 200.0))
    found = branch.special("pitchfork")
    modes = np.arange(1, 5)
    exact = (2.0 * (n + 1) * np.sin(modes * np.pi / (2 * (n + 1)))) ** 2
    assert [point["lam"] for point in found] == pytest.approx(exact, rel=1e-10)
    # On sin(k pi x), of length one: lam - lam_k = -c xi^2 by projection.
    for point, lam in zip(found, exact, strict=True):
        assert point.normal_form["d"] == pytest.approx(1.0, rel=1e-6)
        assert point.normal_form["c"] == pytest.approx(-lam * 1.5 / (n + 1), rel=1e-3)
    side = found[1].switch()
    assert [stop.reason for stop in side.stops] == ["bound", "bound"]
    assert float(side.points.u_max.max()) > 0.9
    (own,) = side.special("pitchfork")
    assert own["lam"] == pytest.approx(exact[1], rel=1e-8)
    # The second side branch is the first one of half the length, turned.
    u = side.points.u.values[-1]
    assert u == pytest.approx(-u[::-1], abs=1e-8)


def test_a_branch_ends_at_a_kind_and_goes_on():
    branch = pk.continuation(bratu(12), "lam", span=(0.0, 4.0), options=BOUNDED, stop="fold")
    assert branch.stops[1].reason == "fold"
    longer = branch.extend()
    whole = pk.continuation(bratu(12), "lam", span=(0.0, 4.0), options=BOUNDED)
    assert longer.points.u.identical(whole.points.u)


def test_two_fields_one_after_the_other():
    problem = pk.Problem(
        lambda x, a: np.append(a - x[:3], x[:3] - x[3:] ** 3), [("u", 3), ("v", 3)], {"a": 1.0},
        jac=sp.csr_array(np.kron([[1, 0], [1, 1]], np.eye(3)).astype(bool)),
    )  # fmt: skip
    assert problem.state == ("u_0", "u_1", "u_2", "v_0", "v_1", "v_2")
    branch = pk.continuation(problem, "a", x0={"u": 1.0, "v": [1.0, 1.0, 1.0]}, span=(0.5, 8.0))
    last = branch.points.isel(point=-1)
    assert last.u.values == pytest.approx([8.0] * 3)
    assert last.v.values == pytest.approx([2.0] * 3)
    assert last.u.dims == ("cell",)
    again = copy.deepcopy(problem)
    assert [block.name for block in again.blocks] == ["u", "v"]


def test_a_constant_matrix_serves_where_f_is_linear():
    L = laplacian(50)
    problem = pk.Problem(lambda u, q: L @ u + q, 50, {"q": 0.0}, jac=L)
    last = pk.continuation(problem, "q", span=(0.0, 8.0)).points.isel(point=-1)
    x = np.arange(1, 51) / 51
    assert last.u.values == pytest.approx(4.0 * x * (1.0 - x), rel=1e-9)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"state": 0}, "state: got 0"),
        ({"state": [("u", 20), ("u", 20)]}, "names that differ"),
        ({"state": [("for", 20)]}, "state: got 'for'"),
        ({"coords": {"x": np.arange(7.0)}}, "7 values of x"),
        ({"coords": {"u": np.arange(20.0)}}, "coords: got 'u'"),
        ({"coords": {"x": [[1.0]]}}, "1-D array"),
        ({"jac": sp.eye_array(7)}, r"shape \(7, 7\), wants \(20, 20\)"),
        ({"jac": sp.eye_array(7).astype(bool)}, r"pattern of shape \(7, 7\)"),
        ({"jac": "exact"}, "jac"),
        ({"state": 5000}, "of more than 2000 states a sparse matrix"),
        ({"conservative": True}, "conservative"),
        ({"map": True}, "map"),
        ({"f": "u"}, "f: got 'u'"),
    ],
)
def test_bad_fields_are_named(change, says):
    given = {"f": lambda u, lam: lam - u, "state": 20, "parameters": {"lam": 0.0}, **change}
    with pytest.raises(pk.ParameterError, match=says):
        pk.Problem(given.pop("f"), **given)


@pytest.mark.parametrize(
    ("jac", "says"),
    [
        (lambda u, lam: sp.eye_array(7), r"jac: got a matrix of shape \(7, 7\), wants \(20, 20\)"),
        (lambda u, lam: 2.0 * sp.eye_array(20), "jac: its row of u_"),
        (sp.eye_array(20).astype(bool), "missing in the pattern"),
    ],
)
def test_wrong_derivatives_are_announced(jac, says):
    def f(u, lam):
        return lam - u - 0.5 * np.roll(u, 1)

    problem = pk.Problem(f, 20, {"lam": 0.0}, jac=jac)
    with pytest.raises(pk.ParameterError, match=says):
        pk.continuation(problem, "lam", span=(0.0, 1.0))


@pytest.mark.parametrize(
    ("bent", "jac", "says"),
    [
        (lambda u: u, -sp.eye_array(20, format="csc"), "jac: its row of u_"),
        (lambda u: np.roll(u, 1), sp.eye_array(20).astype(bool), "missing in the pattern, at r"),
        (lambda u: u, sp.eye_array(20).astype(bool), None),
    ],
)
def test_derivatives_that_are_wrong_away_from_the_start_are_announced(bent, jac, says):
    problem = pk.Problem(lambda u, r: r - u - 0.5 * bent(u) * u, 20, {"r": 0.0}, jac=jac)
    options = pk.ContinuationOptions(max_points=8)
    messages = pk.continuation(problem, "r", span=(0.0, 0.4), options=options).messages
    assert not messages if says is None else says in messages[0]


def test_eigenvalues_that_are_not_counted_are_announced():
    """Of no symmetric f_x, and without Hopf points, nothing counts them."""
    matrix = sp.csc_array(-sp.eye_array(250) + 0.3 * sp.eye_array(250, k=1))
    problem = pk.Problem(lambda u, r: matrix @ u + r, 250, {"r": 0.0}, jac=matrix)
    options = pk.ContinuationOptions(detect=("fold", "branch_point"), max_points=4)
    branch = pk.continuation(problem, "r", span=(0.0, 0.4), options=options)
    assert set(branch.points.n_unstable.values.tolist()) == {-1}
    assert "n_unstable is -1: without 'hopf'" in branch.messages[0]


def test_what_is_not_a_start_is_named():
    problem = bratu(20)
    for x0, says in (
        ([1.0, 2.0], "x0"), ({"v": 1.0}, "field"), ({}, "a value for each"), ("low", "x0"),
        ([1.0], r"x0: got \[1.0\], wants finite numbers: one, or an array of shape \(20,\)"),
        (np.ones(19), r"x0: got \(19,\), wants finite numbers"),
        ({"u": [0.5]}, "wants finite numbers"),
    ):  # fmt: skip
        with pytest.raises(pk.ParameterError, match=says):
            pk.continuation(problem, "lam", x0=x0, span=(0.0, 4.0))
    with pytest.raises(pk.ParameterError, match="wants 20|shape"):
        pk.continuation(
            pk.Problem(lambda u, a: u[:3], 20, {"a": 0.0}, jac=sp.eye_array(20)), "a", span=(0, 1)
        )


def brusselator(m, named=False):
    """One dimension, fixed ends, of a length l: modes grow where their trace vanishes."""
    A, B, first, second = 2.0, 5.45, 0.008, 0.004
    L = laplacian(m)
    ends = np.zeros(m)
    ends[[0, -1]] = (m + 1.0) ** 2

    spread = sp.csc_array(sp.block_diag([first * L, second * L]))

    def f(x, l):  # noqa: E741 - the length
        u, v = x[:m], x[m:]
        one = first / l**2 * (L @ u + ends * A) + u * u * v - (B + 1.0) * u + A
        return np.append(one, second / l**2 * (L @ v + ends * B / A) + B * u - u * u * v)

    def jac(x, l):  # noqa: E741 - the length
        u, v = x[:m], x[m:]
        diagonals = [np.append(2.0 * u * v - B - 1.0, -u * u), u * u, B - 2.0 * u * v]
        matrix = spread / l**2 + sp.diags_array(diagonals, offsets=[0, m, -m], format="csc")
        return matrix.toarray() if named else matrix

    state = [f"u_{i}" for i in range(2 * m)] if named else [("u", m), ("v", m)]
    k = np.arange(1, 11)
    modes = (2.0 * (m + 1) * np.sin(k * np.pi / (2 * (m + 1)))) ** 2
    lengths = np.sqrt((first + second) * modes / (B - 1.0 - A * A))
    start = np.append(np.full(m, A), np.full(m, B / A)) if named else {"u": A, "v": B / A}
    return pk.Problem(f, state, {"l": 0.3}, jac=jac), start, lengths


FORWARD = pk.ContinuationOptions(directions="forward")


def hopf_points_of(problem, start, end):
    branch = pk.continuation(problem, "l", x0=start, span=(0.3, end), options=FORWARD)
    return branch, branch.special("hopf")


@pytest.mark.parametrize("m", [8, 150])
def test_hopf_points_are_those_of_the_modes(m):
    problem, start, exact = brusselator(m)
    branch, found = hopf_points_of(problem, start, 1.3)
    assert [point["l"] for point in found] == pytest.approx(exact[:2], rel=1e-10)
    omega = np.sqrt(2.0**2 * 5.45 - (2.0**2 + 0.004 * 0.45 / 0.012) ** 2)
    for point, length in zip(found, exact, strict=False):
        assert point.status == "converged"
        assert point.normal_form["omega"] == pytest.approx(omega, rel=1e-9)
        # The trace is 0.45 (1 - (l_k/l)^2).
        assert point.normal_form["d"] == pytest.approx(0.45 / length, rel=1e-6)
    grow = branch.points.n_unstable.values
    assert grow[0] == 0
    assert grow[-1] == 4
    assert branch.messages == ()


def test_a_lyapunov_coefficient_takes_derivatives_along_five_directions(monkeypatch):
    """The point itself, both parts of q, their sum and difference, and the branch: 1 + 5*4."""
    branch, (point,) = hopf_points_of(*brusselator(8)[:2], 0.6)
    taken, derivatives = [], LargeCurve.derivatives
    monkeypatch.setattr(
        LargeCurve, "derivatives", lambda *given, **k: taken.append(1) or derivatives(*given, **k)
    )
    form, _ = normal_form(branch.curve, point.special.u, point.normal_form["omega"])
    assert form["l1"] == pytest.approx(point.normal_form["l1"], rel=1e-9)
    assert len(taken) == 21


@pytest.mark.slow
def test_lyapunov_coefficients_are_those_of_the_dense_engine():
    _, many = hopf_points_of(*brusselator(8)[:2], 1.3)
    _, named = hopf_points_of(*brusselator(8, named=True)[:2], 1.3)
    for one, other in zip(many, named, strict=True):
        assert one["l"] == pytest.approx(other["l"], rel=1e-10)
        for name in ("l1", "omega", "d"):
            assert one.normal_form[name] == pytest.approx(other.normal_form[name], rel=2e-5)


@pytest.mark.slow
def test_five_modes_of_two_thousand_states():
    problem, start, exact = brusselator(1000)
    branch, found = hopf_points_of(problem, start, 2.7)
    assert [point["l"] for point in found] == pytest.approx(exact[:5], rel=1e-10)
    assert int(branch.points.n_unstable[-1]) == 10
    assert branch.messages == ()


@pytest.mark.parametrize("length", [0.4, 1.2, 3.0])
def test_no_eigenvalue_to_the_right_is_missed(length):
    from phasekit.numerics.rightmost import box_of, spectrum_at

    problem, _, _ = brusselator(150)
    x = np.append(np.full(150, 2.0), np.full(150, 2.725))
    matrix = problem.jac(x, length)
    scale = np.append(np.full(150, 2.0), np.full(150, 2.725))
    values = np.linalg.eigvals(matrix.toarray())
    found = spectrum_at(matrix, scale)
    assert found.complete
    assert found.positive == int(np.sum(values.real > 0.0))
    for one in found.values:
        assert np.min(np.abs(values - one)) < 1e-8
    right, up = box_of(matrix, scale)
    growing = values[values.real >= 0.0]
    assert (growing.size > 0) == (length > 0.52)  # the first of the pairs crosses at 0.513
    assert np.all(growing.real <= right)
    assert np.all(np.abs(growing.imag) <= up)


def test_fields_on_a_grid_are_arrays_over_its_coordinates():
    axis = pk.grid("x", 0.0, 1.0, 49)
    problem = pk.Problem({"u": "lap(u) + lam*exp(u)"}, parameters={"lam": 0.0}, grid=axis)
    branch = pk.continuation(problem, "lam", span=(0.0, 4.0), options=BOUNDED)
    assert branch.points.u.dims == ("point", "x")
    assert np.array_equal(branch.points.x, axis.coordinates)
    (fold,) = branch.special("fold")
    assert fold["lam"] == pytest.approx(fold_of(bratu(49))["lam"], rel=1e-10)


def test_a_start_far_away_relaxes_to_an_equilibrium():
    problem = pk.Problem(
        lambda u, a: np.append(a - u[:1] ** 3 + 3.0 * u[:1], u[:1] - u[1:]), 2, {"a": 0.0},
        jac=lambda u, a: sp.csr_array([[3.0 - 3.0 * u[0] ** 2, 0.0], [1.0, -1.0]]),
    )  # fmt: skip
    # f falls away from the equilibria at both sides of 1: Newton's steps shrink to nothing there.
    flat = pk.Problem(
        lambda u, a: a - np.arctan(5.0 * u) - 1e-3 * u,
        3,
        {"a": 0.0},
        jac=lambda u, a: sp.diags_array(-5.0 / (1.0 + 25.0 * u**2) - 1e-3),
    )
    for one, x0 in ((problem, [1.001, 5.0]), (flat, [40.0, -30.0, 90.0])):
        branch = pk.continuation(one, "a", x0=x0, span=(-0.1, 0.1))
        assert float(branch.points.residual.max()) < 1e-12


@pytest.mark.slow
def test_periodic_orbits_begin_at_hopf_points_of_fields():
    problem, start, exact = brusselator(4)
    _, found = hopf_points_of(problem, start, 0.8)
    cycles = found[0].switch(options=pk.ContinuationOptions(max_points=5))
    period = 2.0 * np.pi / found[0].normal_form["omega"]
    assert float(cycles.points.period[0]) == pytest.approx(period, rel=1e-4)


@pytest.mark.slow
def test_orbits_of_fields_on_a_grid_are_those_of_a_simulation():
    """Next to a Hopf point: period and amplitude by its normal form, and back after a period."""
    from scipy.integrate import solve_ivp

    m, A, B, first, second = 30, 2.0, 5.45, 0.008, 0.004
    problem = pk.Problem(
        {"u": "D1/L^2*lap(u) + u^2*v - (B + 1)*u + A", "v": "D2/L^2*lap(v) + B*u - u^2*v"},
        parameters={"L": 0.45, "A": A, "B": B, "D1": first, "D2": second},
        grid=pk.grid("x", 0.0, 1.0, m, values={"u": "A", "v": "B/A"}),
    )
    branch = pk.continuation(problem, "L", x0={"u": A, "v": B / A}, span=(0.4, 0.9))
    (hopf,) = branch.special("hopf")
    cycles = hopf.switch(options=pk.ContinuationOptions(max_points=3))
    other, _, _ = brusselator(m)
    jacobian = other.jac(hopf.x, hopf["L"]).toarray()
    values, vectors = np.linalg.eig(jacobian)
    k = np.argmin(np.abs(values.real) + (values.imag <= 0.0))
    form = hopf.normal_form
    assert form["omega"] == pytest.approx(values[k].imag, rel=1e-9)
    gap = cycles.points.L.values - hopf["L"]
    swing = np.sqrt(form["d"] * gap / (form["omega"] * -form["l1"]))
    q = np.abs(vectors[m // 2, k])
    ends = (cycles.points.u_max - cycles.points.u_min).isel(x=m // 2).values
    half = 0.5 * ends
    assert half[1:] == pytest.approx(2.0 * q * swing[1:], rel=0.01)
    assert float(cycles.points.period[0]) == pytest.approx(2.0 * np.pi / form["omega"], rel=1e-5)
    assert set(cycles.points.n_unstable.values) == {0}
    last = cycles.orbit(len(cycles.points.L) - 1)
    start = np.concatenate([last[name].isel(time=0).values for name in ("u", "v")])
    period, length = float(last.period), float(last.L)
    motion = solve_ivp(
        lambda t, x: other.f(x, length), (0.0, period), start, method="Radau", rtol=1e-7,
        atol=1e-9, jac=lambda t, x: other.jac(x, length),
    )  # fmt: skip
    assert np.max(np.abs(motion.y[:, -1] - start)) < 1e-4 * ends[-1]


def test_motions_and_orbits_of_fields_are_arrays_over_space(tmp_path):
    m = 6
    problem = pk.Problem(
        {"u": "D/L^2*lap(u) + u^2*v - (B + 1)*u + A", "v": "0.5*D/L^2*lap(v) + B*u - u^2*v"},
        parameters={"L": 0.6, "A": 2.0, "B": 5.45, "D": 0.008},
        grid=pk.grid("x", 0.0, 1.0, m, values={"u": "A", "v": "B/A"}),
    ).described({"u": {"long_name": "activator", "units": "mol m-3"}})
    named = pk.Problem(problem.f, [f"s{i}" for i in range(2 * m)], problem.parameters)
    start, t = np.repeat([2.1, 2.86], m), np.linspace(0.0, 3.0, 4)
    motion = pk.flow(problem, start, t)
    assert motion.motion_u.dims == ("time", "x")
    assert motion.motion_u.attrs["units"] == "mol m-3"
    alone = pk.flow(named, start, t)
    np.testing.assert_array_equal(motion.motion_v[:, 2], alone[f"motion_s{m + 2}"])
    for given in ({"u": 2.1, "v": np.full(m, 2.86)}, {"u": motion.state_u, "v": 2.86}):
        xr.testing.assert_identical(pk.flow(problem, given, t), motion)
        xr.testing.assert_identical(pk.flow(problem, t=t, **given), motion)
    two = xr.DataArray([2.1, 2.2], dims="start")
    assert pk.flow(problem, {"u": two, "v": 2.86}, t).motion_v.dims == ("start", "time", "x")
    with pytest.raises(pk.ParameterError, match="an array over"):
        pk.flow(problem, {"u": np.ones(m + 1), "v": 2.86}, t)
    orbit = pk.periodic_orbit(problem, {"u": 2.1, "v": 2.86}, settle=20.0)
    assert orbit.u.dims == ("time", "x")
    np.testing.assert_allclose(orbit.u_max, orbit.u.max("time"), rtol=1e-4)
    few = pk.ContinuationOptions(intervals=8, directions="forward")
    family = pk.continuation(problem, "L", orbit=orbit, span=(0.6, 0.61), options=few)
    assert family.points.u_max.dims == ("point", "x")
    assert family.points.u_max.attrs["long_name"] == "largest activator"
    assert family.to_dataset().special_u.dims == ("special_point", "x")
    assert family.orbit(0).v.dims == ("time", "x")
    assert "u_0" not in family.table().columns
    lines = family.plot().lines
    highest = max(float(np.max(line.get_ydata())) for line in lines)
    assert highest == pytest.approx(float(family.points.u_max.max()))
    family.save(tmp_path / "family.nc")
    assert pk.Branch.load(tmp_path / "family.nc") == family


def test_stiff_motions_of_fields_take_implicit_steps():
    """Waves of the discrete heat equation decay at known rates; DOP853 takes 20,000 steps."""
    from phasekit.motion import flows

    m, t = 60, np.array([0.0, 0.05, 0.1, 20.0])
    heat = pk.Problem(
        {"u": "a*lap(u)"}, parameters={"a": 1.0},
        grid=pk.grid("x", 0.0, 1.0, m, boundary="neumann"),
    )  # fmt: skip
    wave = np.cos(np.pi * heat.coords["x"].values)
    motion = pk.flow(heat, {"u": 1.0 + wave}, t)
    assert motion.attrs["method"] == "radau"
    rate = (2.0 * m * np.sin(0.5 * np.pi / m)) ** 2
    exact = 1.0 + np.exp(-rate * t)[:, None] * wave
    np.testing.assert_allclose(motion.motion_u, exact, atol=1e-8)
    turn = np.array([[0.0, 1.0], [-1.0, 0.0]])
    wheel = pk.Problem(lambda u, w: w * turn @ u, 2, {"w": 100.0}, jac=lambda u, w: w * turn)
    at = {"w": np.array([100.0])}, np.ones((1, 2)), np.array([[2000.0]])
    assert not flows.is_steep(wheel.law, *at)  # what turns as fast decays no faster
    short = pk.flow(heat, {"u": 1.0 + wave}, t[:3])
    assert short.attrs["method"] == "dop853"
    np.testing.assert_allclose(short.motion_u, exact[:3], atol=1e-8)


def test_points_that_no_memory_holds_are_refused_before_the_first(monkeypatch):
    monkeypatch.setattr("phasekit.numerics.memory.available_memory", lambda: 10**9)
    problem = pk.Problem(lambda u, a: a - u, 200_000, {"a": 0.0}, jac=-sp.eye_array(200_000))
    with pytest.raises(pk.ParameterError, match="max_points: got 2000, wants at most"):
        pk.continuation(problem, "a", span=(0.0, 1.0))
    few = pk.ContinuationOptions(max_points=10)
    sides = [pk.grid(name, 0.0, 1.0, 60) for name in "xy"]
    square = pk.Problem({"u": "lap(u) - a*u"}, parameters={"a": 0.0}, grid=sides)
    monkeypatch.setattr("phasekit.numerics.memory.available_memory", lambda: 5 * 10**6)
    with pytest.raises(pk.ParameterError, match=r"state: got 3,600, .* factors of f_x would take"):
        pk.continuation(square, "a", span=(0.0, 1.0), options=few)


@pytest.mark.parametrize("lack", [MemoryError, None])
def test_points_are_kept_where_memory_runs_short_on_the_way(monkeypatch, lack):
    problem, left = bratu(20), [6]
    few = pk.ContinuationOptions(directions="forward", max_points=12)
    given = (problem, "lam"), {"x0": np.zeros(20), "span": (0.0, 4.0), "options": few}
    with pytest.warns(RuntimeWarning, match="max_points"):
        whole = pk.continuation(*given[0], **given[1])
    correct = LargeCurve.correct

    def short(*point):
        left[0] -= 1
        if left[0] < 0:
            if lack is not None:
                raise lack
            refuse("state", 20, "fewer", "the factors of f_x", 10**30, "a coarser grid takes less")
        return correct(*point)

    with monkeypatch.context() as change:
        change.setattr(LargeCurve, "correct", short)
        with pytest.warns(RuntimeWarning, match=r"memory was short .*extend\(\) continues it"):
            part = pk.continuation(*given[0], **given[1])
    assert part.points.sizes["point"] == 7
    with pytest.warns(RuntimeWarning, match="max_points"):
        longer = part.extend(6)
    assert np.array_equal(longer.points.u, whole.points.u)


def test_points_of_a_family_are_kept_where_memory_runs_short_on_the_way(monkeypatch):
    formulas = {"x": "r*x - y - x*(x^2 + y^2)", "y": "x + r*y - y*(x^2 + y^2)"}
    problem = pk.Problem(formulas, parameters={"r": 1.0})
    turn = np.linspace(0.0, 2 * np.pi, 33)
    samples = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    orbit = pk.periodic_orbit(problem, samples, period=2 * np.pi)
    advance, left = trace.advance, [4]

    def short(*state):
        left[0] -= 1
        if left[0] < 0:
            refuse("state", 2, "fewer", "columns", 10**30, "a shorter orbit takes less")
        return advance(*state)

    monkeypatch.setattr(trace, "advance", short)
    few = pk.ContinuationOptions(directions="forward", max_points=9)
    with pytest.warns(RuntimeWarning, match=r"memory was short .*extend\(\) continues it"):
        family = pk.continuation(problem, "r", orbit=orbit, span=(0.5, 5.0), options=few)
    assert family.points.sizes["point"] == 5


@pytest.mark.slow
def test_leading_multipliers_are_those_of_the_variational_equations():
    """By the midpoint rule with Richardson's extrapolation, along the orbit of a field."""
    from scipy.interpolate import CubicSpline

    m = 51
    problem, start, _ = brusselator(m)
    _, found = hopf_points_of(problem, start, 0.8)
    cycles = found[0].switch(options=pk.ContinuationOptions(max_points=2))
    orbit = cycles.orbit(2)
    length, period = float(orbit.l), float(orbit.period)
    states = np.hstack([orbit[name].transpose("time", ...).values for name in ("u", "v")])
    along = CubicSpline(orbit.time.values, states)

    def leading(count):
        step, whole, one = period / count, np.eye(2 * m), np.eye(2 * m)
        for k in range(count):
            half = 0.5 * step * problem.jac(along((k + 0.5) * step), length).toarray()
            whole = np.linalg.solve(one - half, (one + half) @ whole)
        values = np.linalg.eigvals(whole)
        return values[np.lexsort((values.imag, -np.abs(values).round(9)))][:4]

    exact = (4.0 * leading(800) - leading(400)) / 3.0
    for one in exact:
        assert np.min(np.abs(orbit.multiplier.values - one)) < 2e-6
    assert int(cycles.points.n_unstable[2]) == 0


def test_orbits_that_no_memory_holds_are_refused_before_any_work(monkeypatch):
    monkeypatch.setattr("phasekit.numerics.memory.available_memory", lambda: 10**9)
    n = 1000
    problem = pk.Problem(lambda u, a: a - u, n, {"a": 0.0}, jac=-np.ones((n, n)))
    samples = np.tile(np.sin(np.linspace(0.0, 6.0, 9))[:, None], n)
    with pytest.raises(pk.ParameterError, match="state: got 1000, wants at most 6.. states"):
        pk.periodic_orbit(problem, samples, period=6.0)
    options = pk.ContinuationOptions(intervals=16, degree=2)
    with pytest.raises(pk.ParameterError, match="at most 8.. states .* on 16 intervals"):
        pk.periodic_orbit(problem, samples, period=6.0, options=options)
    sides = sp.diags_array([np.ones(n - d) for d in (0, 30)], offsets=[0, 30])
    wide = pk.Problem(lambda u, a: a - u, n, {"a": 0.0}, jac=(sides + sides.T).astype(bool))
    monkeypatch.setattr("phasekit.numerics.memory.available_memory", lambda: 10**7)
    many = pk.ContinuationOptions(intervals=2000)
    with pytest.raises(pk.ParameterError, match="state: got 1000, wants at most .* states"):
        pk.periodic_orbit(wide, samples, period=6.0, options=many)


def test_what_is_not_looked_for_is_said():
    options = pk.ContinuationOptions(detect=("fold", "neutral_saddle"), max_points=3)
    branch = pk.continuation(bratu(20), "lam", span=(0.0, 4.0), options=options)
    assert branch.messages == ("neutral saddles are not looked for, of fields of states",)


@pytest.mark.slow
def test_every_fold_of_a_snake():
    """Swift and Hohenberg's equation on half a line: two snakes meet at the end of both."""
    n, length, nu, r = 160, 20.0 * np.pi, 1.6, -0.05
    h = length / n
    T = sp.diags_array([np.ones(n - 1), -2.0 * np.ones(n), np.ones(n - 1)], offsets=[-1, 0, 1])
    T = T.tolil()
    T[0, 0] = T[-1, -1] = -1.0
    M = sp.eye_array(n) + T / h**2
    M = sp.csc_array(-(M @ M))
    x = h * (np.arange(n) + 0.5)
    height = 2.0 * np.sqrt(-r / (19.0 * nu**2 / 18.0 - 0.75))
    start = height * np.cos(x) / np.cosh(x * np.sqrt(-r) / 2.0)
    problem = pk.Problem(
        lambda u, r: M @ u + r * u + nu * u * u - u**3, [("u", n)], {"r": r},
        jac=lambda u, r: M + sp.diags_array(r + 2.0 * nu * u - 3.0 * u * u), coords={"x": x},
    )  # fmt: skip
    branch = pk.continuation(problem, "r", x0=start, span=(-0.6, -0.01))
    folds = branch.special("fold")
    assert {point.status for point in folds} == {"converged"}
    values = np.array([point["r"] for point in folds])
    half = len(values) // 2
    assert half == 16
    # From its end the path goes back along the same states, turned.
    assert values[:half] == pytest.approx(values[half:][::-1], abs=1e-9)
    left, right = values[:half:2], values[1:half:2]
    # Folds come to a limit by a factor for each length of the pattern.
    gaps = np.abs(np.diff(left[:4]))
    assert np.all(gaps[1:] < gaps[:-1] / 50.0)
    assert abs(right[2] - right[1]) < abs(right[1] - right[0]) / 100.0
    grow = branch.points.n_unstable.values
    assert set(grow[1:-1].tolist()) <= {0, 1, 2}
    assert branch.messages == ()


@pytest.mark.parametrize("pace", [1.0, 1e-11])
def test_eigenvalues_of_slow_fields_and_double_ones_are_all_counted(pace):
    """On a ring all but the first are double; a unit of time changes no number."""
    from phasekit.numerics.rightmost import spectrum_at

    n, r = 200, 3.0
    ring = sp.diags([1.0, -2.0, 1.0], [-1, 0, 1], shape=(n, n)).tolil()
    ring[0, n - 1] = ring[n - 1, 0] = 1.0
    turn = sp.kron(np.array([[0.0, -2.0], [2.0, 0.0]]), sp.eye(n))
    matrix = pace * (sp.kron(sp.eye(2), 100.0 * ring + r * sp.eye(n)) + turn)
    own = r - 400.0 * np.sin(np.pi * np.arange(n) / n) ** 2
    found = spectrum_at(sp.csc_array(matrix), np.ones(2 * n))
    assert found.complete
    assert found.positive == 2 * int(np.sum(own > 0.0))


def turning(formulas, n, ends=(0.0, 1.0), **parameters):
    """The branch of a field at rest, with slopes of 0 at both ends."""
    axis = pk.grid("x", 0.0, 1.0, n, boundary="neumann")
    problem = pk.Problem(formulas, parameters={"r": 0.0, **parameters}, grid=axis)
    return pk.continuation(problem, "r", span=ends)


@pytest.mark.parametrize("n", [20, 120])
def test_a_field_that_is_symmetric_at_its_start_alone(n):
    """Eigenvalues r - 0.3 - (mode) +- i r: pivots count them at r = 0, and nowhere else."""
    branch = turning(
        {"u": "lap(u) + (r - 0.3)*u - r*v", "v": "lap(v) + (r - 0.3)*v + r*u"}, n
    )  # fmt: skip
    (hopf,) = branch.special("hopf")
    assert hopf["r"] == pytest.approx(0.3, abs=1e-9)
    assert hopf.normal_form["omega"] == pytest.approx(0.3, rel=1e-9)
    own = branch.points.isel(point=branch.points.special != "H")
    assert np.array_equal(own.n_unstable, np.where(own.r < 0.3, 0, 2))
    assert branch.messages == ()


@pytest.mark.parametrize("n", [10, 60])
def test_a_pair_that_comes_while_another_goes_is_seen(n):
    """Both within one step, which has as many growing pairs at both ends."""
    pair = {"u": "lap(u) + (r - a)*u - 3*v", "v": "lap(v) + (r - a)*v + 3*u"}
    other = {"w": "lap(w) + (b - r)*w - 3.5*z", "z": "lap(z) + (b - r)*z + 3.5*w"}
    branch = turning(pair | other, n, a=0.302, b=0.298)
    found = branch.special("hopf")
    assert [point["r"] for point in found] == pytest.approx([0.298, 0.302], abs=1e-9)
    assert [point.normal_form["omega"] for point in found] == pytest.approx([3.5, 3.0])
    assert branch.messages == ()


@pytest.mark.parametrize("stiff", [10.0, 1e10])
def test_no_stiff_state_hides_that_others_turn(stiff):
    """Of derivatives by differences, whose errors are those of the largest ones."""
    rates = ((lambda p: p - 0.3, 0.5), (lambda p: 0.345 - p, 0.9))

    def f(x, p):
        found = -stiff * x
        for k, (rate, omega) in enumerate(rates):
            a, b = x[2 * k : 2 * k + 2]
            found[2 * k] = rate(p) * a - omega * b - a**3
            found[2 * k + 1] = omega * a + rate(p) * b - b**3
        return found

    problem = pk.Problem(f, [("u", 20)], {"p": 0.0})
    branch = pk.continuation(problem, "p", x0=np.zeros(20), span=(0.0, 0.6))
    found = [(one["p"], one.normal_form["omega"]) for one in branch.special("hopf")]
    np.testing.assert_allclose(found, [(0.3, 0.5), (0.345, 0.9)], atol=1e-7)


def test_pairs_that_become_real_cross_nothing():
    """Eigenvalues 1 +- sqrt(r - 0.31) grow on both sides."""
    branch = turning({"u": "lap(u) + u + v", "v": "lap(v) + (r - 0.31)*u + v"}, 8, (0.0, 0.9))
    assert [point.kind for point in branch.special_points] == ["end", "end"]
    assert branch.messages == ()


def test_real_eigenvalues_that_cross_together_are_announced():
    branch = turning({"u": "lap(u) + (r - 0.3)*u + v", "v": "lap(v) + (r - 0.3)*v"}, 8)
    assert any("cross zero in one step" in message for message in branch.messages)


@pytest.mark.parametrize("n", [7, 15])
def test_branches_leave_double_points_of_a_square_along_its_symmetries(n):
    """Of u'' + r (u - u^3): two modes turned against each other, along axes and diagonals."""
    axes = [pk.grid(name, 0.0, 1.0, n) for name in "xy"]
    problem = pk.Problem({"u": "lap(u) + r*(u - u^3)"}, parameters={"r": 40.0}, grid=axes)
    branch = pk.continuation(problem, "r", x0=np.zeros(n * n), span=(40.0, 60.0))
    (point,) = branch.special("BP")
    first, second = (2.0 * (n + 1) * np.sin(k * np.pi / (2 * (n + 1))) for k in (1, 2))
    assert (point.corank, point.status) == (2, "converged")
    assert point["r"] == pytest.approx(first**2 + second**2, rel=1e-11)
    assert branch.messages == ()
    few = pk.ContinuationOptions(max_points=3, directions="forward")
    turned = []
    for k in range(len(point.directions)):
        with pytest.warns(RuntimeWarning, match="max_points"):
            u = point.switch(direction=k, options=few).points.u.values[-1]
        assert np.max(np.abs(u)) > 1e-3
        images = (u.T, -u.T, u[::-1], u[:, ::-1])
        turned.append([bool(np.allclose(u, one, atol=1e-9)) for one in images])
    wanted = [[True, *3 * [False]], [False, True, False, False], [*2 * [False], True, False],
              [*3 * [False], True]]  # fmt: skip
    assert sorted(turned) == sorted(wanted)
    sine = np.sin(np.pi * axes[0].coordinates)
    along = np.outer(np.sin(2.0 * np.pi * axes[0].coordinates), sine)
    with pytest.warns(RuntimeWarning, match="max_points"):
        own = point.switch(direction={"u": along}, options=few).points.u.values[-1]
    np.testing.assert_allclose(own, own[:, ::-1], atol=1e-9)
    there = pk.ContinuationOptions(max_points=3)
    with pytest.warns(RuntimeWarning, match="max_points"):
        (own_start,) = point.switch(options=there).special("BP")
    assert (own_start.corank, own_start.status) == (2, "converged")
    with pytest.raises(pk.ParameterError, match="part along the null vectors"):
        point.switch(direction={"u": np.outer(sine, sine)})
    with pytest.raises(pk.ParameterError, match="direction: field 'v' is unknown"):
        point.switch(direction={"v": along})


def test_patterns_leave_rest_at_double_points_of_a_ring():
    """Of cells in a ring of twelve: modes in the closed form, two or four of which meet."""
    n, A, first, second = 12, 2.0, 0.5, 4.0
    axis = pk.grid("s", 0.0, float(n), n, boundary="periodic")
    problem = pk.Problem(
        {"u": "a*lap(u) + u^2*v - (B + 1)*u + A", "v": "b*lap(v) + B*u - u^2*v"},
        parameters={"B": 2.9, "A": A, "a": first, "b": second}, grid=axis,
    )  # fmt: skip
    branch = pk.continuation(problem, "B", x0={"u": A, "v": 1.45}, span=(2.9, 3.4))
    spread = 4.0 * np.sin(np.pi * np.arange(1, n // 2 + 1) / n) ** 2
    exact = np.sort((1.0 + first * spread) * (A * A + second * spread) / (second * spread))
    points = branch.special("BP")
    assert [point.corank for point in points] == [4, 2]
    assert [point["B"] for point in points] == pytest.approx([exact[0], exact[2]], rel=1e-10)
    assert len(points[1].directions) == 3
    assert branch.messages == ()


def modes(rates, omegas, n=20):
    """The branch at rest of pairs, or of single states (omega None), among others that decay."""

    def f(x, p):
        found, k = -x - x**3, 0
        found[-1] += 0.5 * x[-2]
        for rate, omega in zip(rates, omegas, strict=True):
            a, r = x[k], rate(p)
            found[k] = r * a - a**3
            if omega is not None:
                b = x[k + 1]
                found[k] = r * a - omega * b - a**3
                found[k + 1] = omega * a + r * b - b**3
            k += 1 if omega is None else 2
        return found

    problem = pk.Problem(f, [("u", n)], {"p": -1.0})
    return pk.continuation(problem, "p", x0=np.zeros(n), span=(-1.0, 1.0))


@pytest.mark.parametrize(
    ("ends", "omegas"),
    [
        ((0.3, -0.305, 0.31), (1.0, 2.0, 3.0)),
        ((0.3, -0.31), (1.0, 1.0)),
        ((0.3, -0.305), (None, None)),
        ((0.3, 0.302, -0.31), (None, None, None)),
        ((-0.3, 0.304), (1.0, None)),
    ],
)
def test_what_comes_while_others_go_is_found(ends, omegas):
    """Of ends that are negative, those that go."""
    branch = modes([lambda p, e=e: p - e if e > 0.0 else -e - p for e in ends], omegas)
    found = branch.special_points[1:-1]
    assert [one["p"] for one in found] == pytest.approx(sorted(np.abs(ends)), abs=1e-6)
    kinds = [omegas[k] is not None for k in np.argsort(np.abs(ends))]
    assert [one.kind == "hopf" for one in found] == kinds
    assert {one.status for one in found} == {"converged"}
    assert branch.messages == ()


@pytest.mark.parametrize("top", [1e-3, -1e-3])
def test_what_crosses_and_comes_back_within_a_step_is_found_twice(top):
    """A pair and a single state whose rates are bent, above zero between points or below it."""
    rates = [lambda p: top - 8.0 * (p - 0.31) ** 2, lambda p: top - 8.0 * (p + 0.41) ** 2]
    branch = modes(rates, (1.5, None))
    half = np.sqrt(max(top, 0.0) / 8.0)
    found = [one["p"] for one in branch.special_points[1:-1]]
    exact = [-0.41 - half, -0.41 + half, 0.31 - half, 0.31 + half] if half else []
    assert found == pytest.approx(exact, abs=1e-6)
    assert branch.messages == ()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["symmetric", "skew", "pairs"])
def test_no_eigenvalue_of_many_states_hides_another_one(kind):
    """At 0.3 and 0.31 they come, at 0.305 one goes, of more states than have full spectra."""
    n, turns = 210, np.array([1.0, 1.3, 1.7])
    first, second = np.arange(0, 6, 2), np.arange(1, 6, 2)

    def rates(p):
        found = -1.0 - np.arange(n) / n
        crossing = np.array([p - 0.3, 0.305 - p, p - 0.31])
        found[: 3 + 3 * (kind == "pairs")] = np.repeat(crossing, 1 + (kind == "pairs"))
        return found

    def beside(x):
        more = sp.lil_array((n, n))
        if kind == "pairs":
            more[first, second], more[second, first] = -turns, turns
        elif kind == "skew":
            more[5, 6] = 0.5
        return sp.csc_array(more)

    problem = pk.Problem(
        lambda x, p: rates(p) * x - x**3 + beside(x) @ x, n, {"p": 0.0},
        jac=lambda x, p: sp.csc_array(sp.diags_array(rates(p) - 3.0 * x**2) + beside(x)),
    )  # fmt: skip
    branch = pk.continuation(problem, "p", span=(0.0, 1.0))
    found = [point for point in branch.special_points if point.kind != "end"]
    assert {point.kind for point in found} == {"hopf" if kind == "pairs" else "pitchfork"}
    assert [point["p"] for point in found] == pytest.approx([0.3, 0.305, 0.31], abs=1e-8)
    assert branch.messages == ()


def test_what_comes_as_another_goes_is_announced():
    rates = [lambda p: p - 0.3, lambda p: 0.3 - p]
    (hopf,) = modes(rates, (1.0, 2.0)).special("hopf")
    assert (hopf.status, hopf["p"]) == ("guess", pytest.approx(0.3, abs=1e-3))
    assert any(
        "2 more eigenvalues cross zero" in text for text in modes(rates, (None,) * 2).messages
    )


@pytest.mark.parametrize("size", some([1e-6, 1e6], 2))
def test_no_unit_of_f_changes_a_verdict(size):
    """Of branch points, and of branches that miss each other by a little."""
    kinds = []
    for offset in (0.0, 1e-5, 1e-2):
        problem = pk.Problem(
            {"u": "s*(lap(u) + r*(u - u^3) + e)"}, parameters={"r": 8.0, "s": size, "e": offset},
            grid=pk.grid("x", 0.0, 1.0, 20),
        )  # fmt: skip
        inner = pk.continuation(problem, "r", span=(8.0, 30.0)).special_points[1:-1]
        kinds.append([(point.kind, point.status) for point in inner])
    assert kinds == [[("pitchfork", "converged")], [], []]


@pytest.mark.parametrize("size", [1e-10, 1e6])
def test_no_unit_of_a_field_changes_a_fold(size):
    axis = pk.grid("x", 0.0, 1.0, 20)
    problem = pk.Problem(
        {"u": "lap(u) + r*w*exp(u/w)"}, parameters={"r": 0.1, "w": size}, grid=axis
    )
    (fold,) = pk.continuation(problem, "r", span=(0.1, 4.0)).special("fold")
    (same,) = pk.continuation(problem.replace(w=1.0), "r", span=(0.1, 4.0)).special("fold")
    assert fold["r"] == pytest.approx(same["r"], rel=1e-10)
    assert fold.x / size == pytest.approx(same.x, rel=1e-8)
    # Differences of a field that begins at 0 take its size from the options.
    by_differences = pk.Problem(
        lambda u, r: problem.f(u, r=r, w=size), [("u", 20)], {"r": 0.1},
        jac=laplacian(20) != 0.0,
    )  # fmt: skip
    options = pk.ContinuationOptions(scales={"u": size})
    (one,) = pk.continuation(by_differences, "r", span=(0.1, 4.0), options=options).special("fold")
    assert one["r"] == pytest.approx(same["r"], rel=1e-9)


@pytest.mark.parametrize(
    ("formula", "ends", "start"),
    [
        ("r*u - u - 2*lap(u) - lap(lap(u)) + 2*u^3 - u^5", "periodic", 1.3),
        ("-lap(r*lap(u)/200 + u - u^3)", "neumann", 0.1),
        ("lap(u) + sin(dx(u))", "periodic", 0.1),
    ],
)
def test_equilibria_that_are_not_isolated_are_refused(formula, ends, start):
    axis = pk.grid("x", 0.0, 4.0 * np.pi, 128, boundary=ends)
    problem = pk.Problem({"u": formula}, parameters={"r": 0.2}, grid=axis)
    with pytest.raises(pk.ConvergenceError, match="f_x is singular .* not isolated"):
        pk.continuation(problem, "r", x0=start * np.cos(axis.coordinates), span=(0.0, 0.5))


@pytest.mark.parametrize("n", [60, 150])
def test_equilibria_that_are_not_isolated_are_refused_on_any_grid(n):
    """Also where rounding lets Newton's method fail without a border next to them."""
    axis = pk.grid("x", 0.0, 6.0, n, boundary="periodic")
    formula = {"u": "-lap(lap(u)) - 2*lap(u) - u + r*u - u^3"}
    problem = pk.Problem(formula, parameters={"r": 1.5}, grid=axis)
    with pytest.raises(pk.ConvergenceError, match="f_x is singular .* not isolated"):
        pk.continuation(
            problem, "r", x0=np.cos(2.0 * np.pi * axis.coordinates / 6.0), span=(1.0, 2.0)
        )


@pytest.mark.parametrize("fast", [1.0, 1e12, 1e18])
def test_rates_of_all_sizes_are_regular(fast):
    rates = np.append(1e-4, np.full(11, fast))
    problem = pk.Problem(
        lambda x, p: np.append(p, rates[1:]) - rates * x, [("x", 12)], {"p": 1e-5},
        jac=sp.diags_array(-rates, format="csc"),
    )  # fmt: skip
    ends = pk.continuation(problem, "p", x0=np.ones(12), span=(-1e-4, 1e-4)).points.isel(point=-1)
    np.testing.assert_allclose(ends.x, np.append(1e4 * ends.p, np.ones(11)), rtol=1e-9)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e6])
def test_a_start_on_a_fold_is_refused(size):
    problem = pk.Problem(
        lambda x, p: np.append(p - (x[0] / size) ** 2, p - x[1:]), [("x", 12)], {"p": 0.0},
        jac=lambda x, p: sp.diags_array(np.append(-2.0 * x[0] / size**2, np.full(11, -1.0))),
    )  # fmt: skip
    for span in ((-1.0, 1.0), (0.0, 1.0), (-1.0, 0.0)):
        with pytest.raises(pk.ConvergenceError, match="it is on a fold"):
            pk.continuation(problem, "p", x0=np.zeros(12), span=span)


@pytest.mark.parametrize("size", [1e-15, 1e-9, 1e9])
def test_a_guess_tells_the_size_of_a_field(size):
    """Of s (p - 1 + y - y^2/2) at y = x/s: the branch x = s (1 + sqrt(2 p - 1))."""
    problem = pk.Problem(
        lambda x, p: size * (p - 1.0 + x / size - 0.5 * (x / size) ** 2), [("x", 12)], {"p": 1.0},
        jac=lambda x, p: sp.diags_array(1.0 - x / size),
    )  # fmt: skip
    points = pk.continuation(problem, "p", x0=np.full(12, 2.5 * size), span=(0.7, 2.0)).points
    wants = size * (1.0 + np.sqrt(2.0 * points.p.values - 1.0))
    np.testing.assert_allclose(points.x.values, np.repeat(wants[:, None], 12, axis=1), rtol=1e-8)


@pytest.mark.parametrize("rounding", [0.0, 1e-17, 1e-13])
def test_a_guess_of_rounding_is_no_size(rounding):
    axis = pk.grid("x", 0.0, 1.0, 12)
    problem = pk.Problem({"u": "lap(u) + r*(exp(u) - 1)"}, parameters={"r": 1.0}, grid=axis)
    guess = rounding * np.cos(37.0 * axis.coordinates)
    point = pk.continuation(problem, "r", x0=guess, span=(1.0, 30.0)).special_points[1]
    assert point.kind == "transcritical"
    assert np.ptp(point.switch().points.u.values) > 1.0


@pytest.mark.parametrize("size", [1e-4, 1e-6, 1e-8])
def test_right_derivatives_of_small_fields_are_taken(size):
    def of(times):
        return pk.Problem(
            lambda u, p: p * u - u**3 / size**2 - 1e-3 * np.roll(u, 1), [("u", 12)], {"p": -1.0},
            jac=lambda u, p: times * (
                sp.diags_array(p - 3.0 * (u / size) ** 2) - 1e-3 * np.roll(np.eye(12), 1, axis=0)
            ),
        )  # fmt: skip

    options = pk.ContinuationOptions(max_points=3)
    pk.continuation(of(1.0), "p", x0=np.zeros(12), span=(-1.0, -0.5), options=options)
    with pytest.raises(pk.ParameterError, match="jac: its row of u_"):
        pk.continuation(of(1.1), "p", x0=np.zeros(12), span=(-1.0, -0.5), options=options)


def test_a_branch_may_begin_at_a_branch_point():
    branch = turning({"u": "lap(u) + r*u - u^3"}, 12, (-0.5, 0.5))
    assert [point.kind for point in branch.special_points] == ["end", "pitchfork", "end"]
    assert branch.messages == ()


def test_curves_of_folds_are_folds():
    """Of u'' + r exp(u/(1 + e u)) = 0: at e = 0 Bratu's, and all along it f_x is singular."""
    n = 20
    problem = pk.Problem(
        {"u": "lap(u) + r*exp(u/(1 + e*u))"}, parameters={"r": 0.1, "e": 0.05},
        grid=pk.grid("x", 0.0, 1.0, n),
    )  # fmt: skip
    (fold,) = pk.continuation(problem, "r", span=(0.1, 5.0), options=BOUNDED).special("fold")
    curve = fold.curve("e", (0.0, 0.3))
    assert curve.kind == "fold"
    assert curve.free == ("r", "e")
    points = curve.points
    assert points.u.dims == ("point", "x")
    assert float(points.r[0]) == pytest.approx(fold_of(bratu(n))["lam"], rel=1e-8)
    assert float(points.e[0]) == 0.0
    assert points.sizes["point"] > 10
    for k in range(0, points.sizes["point"], 7):
        point = points.isel(point=k)
        here = problem.replace(r=float(point.r), e=float(point.e))
        value, slopes = here.derivatives(point.u.values)
        assert np.max(np.abs(value)) < 1e-10
        assert np.min(np.abs(np.linalg.eigvals(slopes))) < 1e-7
    end = curve.special_points[-1]
    assert end["e"] == float(points.e[-1])
    assert "e" in curve.table().columns
    assert "special_r" in curve.to_dataset()


def test_curves_of_folds_go_on_where_the_kernel_has_turned():
    """By more than a right angle: y1' = p + y1^2, y2' = -y2 in axes that turn by q."""

    def f(x, p, q):
        turn = np.array([[np.cos(q), np.sin(q)], [-np.sin(q), np.cos(q)]])
        one, two = turn @ x[:2]
        return np.concatenate([turn.T @ [p + one**2, -two], -x[2:]])

    problem = pk.Problem(f, [("u", 8)], {"p": -1.0, "q": 0.0})
    branch = pk.continuation(problem, "p", x0=-np.eye(8)[0], span=(-1.5, 0.5))
    curve = branch.special("fold")[0].curve("q", (-0.5, 3.0))
    assert [float(curve.points.q[k]) for k in (0, -1)] == [-0.5, 3.0]
    np.testing.assert_allclose(curve.points.p, 0.0, atol=1e-12)


@pytest.mark.parametrize("m", [12, 80])
def test_curves_of_hopf_points_are_those_of_modes(m):
    """The Brusselator's in its length and B, up to where the frequency vanishes."""
    A, first, second = 2.0, 0.008, 0.004
    problem = pk.Problem(
        {"u": "D1/L^2*lap(u) + u^2*v - (B + 1)*u + A", "v": "D2/L^2*lap(v) + B*u - u^2*v"},
        parameters={"L": 0.45, "A": A, "B": 5.45, "D1": first, "D2": second},
        grid=pk.grid("x", 0.0, 1.0, m, values={"u": "A", "v": "B/A"}),
    )
    branch = pk.continuation(problem, "L", x0={"u": A, "v": 2.725}, span=(0.45, 0.6))
    curve = branch.special("hopf")[0].curve("B", (5.2, 20.0))
    points = curve.points
    mode = (2.0 * (m + 1) * np.sin(np.pi / (2 * (m + 1)))) ** 2
    above = points.B - 1.0 - A**2
    exact = np.sqrt((first + second) * mode / above)
    far = points.omega.values > 0.1  # at the end the curve of folds with this kernel meets it
    np.testing.assert_allclose(points.L[far], exact[far], rtol=1e-8)
    np.testing.assert_allclose(points.L, exact, rtol=1e-6)
    square = A**2 * points.B - (A**2 + second / (first + second) * above) ** 2
    np.testing.assert_allclose(points.omega**2, square, rtol=1e-6, atol=1e-4)
    last = curve.stops[1]
    assert last.reason == "bound"
    assert "Bogdanov-Takens" in last.message
    assert float(points.B[-1]) == pytest.approx(11.0 + 6.0 * np.sqrt(2.0), rel=5e-6)


def test_curves_of_points_refuse_what_they_cannot_be():
    branch = pk.continuation(allen_cahn(9), "lam", span=(0.0, 20.0))
    with pytest.raises(pk.ParameterError, match="one of fold, hopf of fields"):
        branch.special("pitchfork")[0].curve("lam", (0.0, 1.0))
    fold = fold_of(bratu(9))
    with pytest.raises(pk.ParameterError, match="another one than that of the branch"):
        fold.curve("lam", (0.0, 5.0))
    with pytest.raises(pk.ParameterError, match="parameter"):
        fold.curve("mu", (0.0, 5.0))


@pytest.mark.slow
def test_curves_of_folds_are_those_of_the_dense_engine():
    n = 8
    L = laplacian(n)

    def f(u, r, e):
        return L @ u + r * np.exp(u / (1.0 + e * u))

    def jac(u, r, e):
        part = 1.0 + e * u
        return L + sp.diags_array(r * np.exp(u / part) / part**2, format="csc")

    both = []
    for state, slopes in (
        ([("u", n)], jac), ([f"u_{i}" for i in range(n)], lambda *x, **p: jac(*x, **p).toarray())
    ):  # fmt: skip
        problem = pk.Problem(f, state, {"r": 0.1, "e": 0.05}, jac=slopes)
        bounds = {"u" if len(state) == 1 else "u_4": (-1.0, 10.0)}
        options = pk.ContinuationOptions(bounds=bounds)
        (fold,) = pk.continuation(problem, "r", span=(0.1, 5.0), options=options).special("fold")
        points = fold.curve("e", (0.0, 0.15)).points
        both.append((points.isel(point=-1), points.isel(point=0)))
    for one, other in zip(*both, strict=True):
        assert float(one.r) == pytest.approx(float(other.r), rel=1e-8)
        assert float(one.e) == pytest.approx(float(other.e), abs=1e-12)


def test_cusps_and_bogdanov_takens_points_of_fields():
    """Of fields that are the same at all places, in closed form: v is 1/sqrt(n) there."""
    n, axis = 12, pk.grid("x", 0.0, 1.0, 12, boundary="neumann")
    problem = pk.Problem(
        {"u": "lap(u) + r + e*u - u^3"}, parameters={"r": -1.0, "e": 1.0}, grid=axis
    )
    branch = pk.continuation(problem, "r", x0=np.full(n, -1.3), span=(-1.0, 1.0))
    curve = branch.special("fold")[0].curve("e", (-1.0, 2.0))
    (cusp,) = curve.special("cusp")
    assert [cusp["r"], cusp["e"]] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert cusp.normal_form["c"] == pytest.approx(-1.0 / n, rel=1e-5)
    assert curve.special("bogdanov_takens") == ()
    points = curve.points
    np.testing.assert_allclose(points.r, -2.0 * points.u_mean**3 + 0.0, atol=1e-8)
    two = pk.Problem(
        {"u": "lap(u) + v", "v": "lap(v) + r + e*v + u^2 - u*v"},
        parameters={"r": -0.5, "e": 0.5}, grid=axis,
    )  # fmt: skip
    branch = pk.continuation(two, "r", x0={"u": -0.7, "v": 0.0}, span=(-0.5, 0.5))
    curve = branch.special("fold")[0].curve("e", (-1.0, 1.0))
    (point,) = curve.special("bogdanov_takens")
    assert [point["r"], point["e"]] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert curve.special("cusp") == ()
    assert len(curve.messages) == 1
    assert "not looked for" in curve.messages[0]


def test_zeros_on_points_of_a_curve_of_folds_are_seen(monkeypatch):
    """Exact ones too; a sign that changes with no root between is a guess."""
    from phasekit.bifurcation.continuation.large import on_folds

    axis = pk.grid("x", 0.0, 1.0, 12, boundary="neumann")
    problem = pk.Problem(
        {"u": "lap(u) + r + e*u - u^3"}, parameters={"r": -1.0, "e": 1.0}, grid=axis
    )
    branch = pk.continuation(problem, "r", x0=np.full(12, -1.3), span=(-1.0, 1.0))
    fold, own = branch.special("fold")[0], on_folds.tests_at

    def near(curve, u, near):  # tests that are exactly 0 at points with e < 0.2
        tests, border = own(curve, u, near)
        return tests * [u[curve.n] >= 0.2, 1.0], border

    monkeypatch.setattr(on_folds, "tests_at", near)
    cusps = fold.curve("e", (-1.0, 2.0)).special("cusp")
    assert cusps
    assert all(cusp["e"] < 0.2 for cusp in cusps)

    monkeypatch.setattr(on_folds, "tests_at", own)
    monkeypatch.setattr(on_folds, "root_of", lambda *_: (None, "lost"))
    (cusp,) = fold.curve("e", (-1.0, 2.0)).special("cusp")
    assert (cusp.status, cusp.message) == ("guess", "lost")


def test_branches_and_curves_of_fields_come_back_from_files(tmp_path):
    """Equal to the last bit, as copies are, and they go on alike."""
    axis = pk.grid("x", 0.0, 1.0, 9, values={"u": ("s", 0)})
    problem = pk.Problem(
        {"u": "lap(u) + r*exp(q*u) + 0.1*lap(u*u)"},
        parameters={"r": 0.1, "q": 1.0, "s": 0.1}, grid=axis,
    )  # fmt: skip
    short = pk.ContinuationOptions(max_points=12, directions="forward", bounds={"u": (-1.0, 9.0)})
    with pytest.warns(RuntimeWarning, match="max_points"):
        part = pk.continuation(problem, "r", x0=np.zeros(9), span=(0.1, 5.0), options=short)
    whole = part.extend(200)
    curve = whole.special("fold")[0].curve("q", (0.5, 1.5), options=short)
    for k, branch in enumerate((part, curve)):
        longer = branch.extend(6).points
        assert pickle.loads(pickle.dumps(branch)) == branch
        for end in ("nc", "zarr"):
            branch.save(tmp_path / f"{k}.{end}")
            again = pk.Branch.load(tmp_path / f"{k}.{end}")
            assert again == branch
            assert again.points.identical(branch.points)
            assert again.extend(6).points.identical(longer)
    assert pk.Branch.load(tmp_path / "0.nc").extend(200) == whole


def test_curves_of_hopf_points_of_code_come_back_with_the_problem(tmp_path):
    def make(n, turn=1.0):
        k = np.arange(n)

        def f(x, mu, w):
            u, v = x[:n], x[n:]
            return np.append((mu - k) * u - turn * w * v - u**3, (mu - k) * v + w * u - v**3)

        return pk.Problem(f, [("u", n), ("v", n)], {"mu": -0.3, "w": 1.0})

    problem = make(4)
    (hopf,) = pk.continuation(problem, "mu", span=(-0.3, 0.7)).special("hopf")
    curve = hopf.curve("w", (0.5, 2.0))
    np.testing.assert_allclose(curve.points.mu, 0.0, atol=1e-9)
    curve.save(tmp_path / "curve.nc")
    with pytest.raises(pk.ParameterError, match="wants the problem itself"):
        pk.Branch.load(tmp_path / "curve.nc")
    assert pk.Branch.load(tmp_path / "curve.nc", problem=problem) == curve
    for other in (make(5), make(4, 1.1)):
        with pytest.raises(pk.ParameterError, match="the problem of the branch"):
            pk.Branch.load(tmp_path / "curve.nc", problem=other)


def test_damage_to_a_stored_branch_of_fields_is_found(tmp_path):
    """A bit that changes anywhere is announced, or changes nothing that is read."""
    branch = fold_of(bratu(9)).branch
    branch.save(tmp_path / "a.nc")
    data = (tmp_path / "a.nc").read_bytes()
    problem, generator, found = branch.problem, np.random.default_rng(3), 0
    for place in generator.integers(0, len(data), 8):
        wrong = bytearray(data)
        wrong[place] ^= 1 << int(generator.integers(8))
        (tmp_path / "b.nc").write_bytes(wrong)
        try:
            again = pk.Branch.load(tmp_path / "b.nc", problem=problem)
        except pk.StoreError:
            found += 1
        else:
            assert again == branch
    assert found


def swift_hohenberg(start, end, n):
    """Swift and Hohenberg's equation on a line, and where its places are."""
    problem = pk.Problem(
        {"u": "r*u - u - 2*lap(u) - lap(lap(u)) + 2*u^3 - u^5"}, parameters={"r": -0.65},
        grid=pk.grid("x", start, end, n, boundary="neumann"),
    )  # fmt: skip
    return problem, problem.coords["x"].values


@pytest.mark.slow
def test_a_snake_whose_shift_is_within_rounding_and_its_rungs():
    """On the whole line it has the folds of half the line, where no pattern may be shifted."""
    half, folds = 10.0 * np.pi, []
    options = pk.ContinuationOptions(max_points=70, directions="backward")
    for start, n in ((0.0, 256), (-half, 512)):
        problem, x = swift_hohenberg(start, half, n)
        guess = 1.36 * np.cos(x) / (1.0 + np.exp(2.0 * (np.abs(x) - 8.0)))
        branch = pk.continuation(problem, "r", x0=guess, span=(-0.9, -0.4), options=options)
        folds.append([point["r"] for point in branch.special("fold")])
    assert len(folds[0]) >= 2
    assert folds[1] == pytest.approx(folds[0], abs=1e-9)
    # Two vectors are odd: the shift, and the one by which a rung leaves.
    rungs = [p for p in branch.special("BP") if p.status == "converged"]
    assert len(rungs) == 2
    for rung in rungs:
        matrix = problem.replace(r=rung["r"]).derivatives(rung.x)[1]
        values, vectors = np.linalg.eigh(matrix)
        near = np.argsort(np.abs(values))
        assert (np.abs(values[near[:3]]) < [1e-7, 1e-6, 1.0]).all()
        assert np.abs(values[near[2]]) > 1e-4
        np.testing.assert_allclose(vectors[:, near[:2]], -vectors[::-1, near[:2]], atol=2e-3)
    few = pk.ContinuationOptions(max_points=12, directions="forward")
    rung = min(rungs, key=lambda point: abs(point["r"] + 0.626))
    with pytest.warns(RuntimeWarning, match="max_points"):
        other = rung.switch(options=few)
    last = other.points.u.values[-1]
    assert np.max(np.abs(last - last[::-1])) > 0.1


def test_tracks_of_files_without_what_was_held_open():
    from phasekit.labelled.continuation import large_store

    branch = pk.continuation(
        bratu(20), "lam", span=(0.0, 4.0), options=pk.ContinuationOptions(max_points=3)
    )
    arrays, stop = large_store.arrays_of(branch), branch.tracks[1].stop
    state = large_store.track_of(arrays, "forward", stop).state
    old = large_store.track_of(
        arrays | {"forward_numbers": arrays["forward_numbers"][:-1]}, "forward", stop
    )
    assert (old.state.held, old.state.side, old.state.done) == (0.0, state.side, state.done)
    assert state.side != 0.0
    arrays["forward_numbers"] = arrays["forward_numbers"][:-2]
    with pytest.raises(ValueError, match="forward_numbers"):
        large_store.track_of(arrays, "forward", stop)


def ginzburg_landau(m, b=0.2):
    """The complex Ginzburg-Landau equation on [0, 1], with slopes of 0 at both ends."""
    rates = {
        "u": "u - w*v - (u^2 + v^2)*(u - c*v) + D*(lap(u) - b*lap(v))",
        "v": "v + w*u - (u^2 + v^2)*(v + c*u) + D*(lap(v) + b*lap(u))",
    }
    parameters = {"b": b, "c": -2.0, "D": 0.01, "w": 1.5}
    axis = pk.grid("x", 0.0, 1.0, m, boundary="neumann")
    period = 2.0 * np.pi / 3.5
    turn = 2.0 * np.pi * np.linspace(0.0, 1.0, 33)[:, None] * np.ones(m)
    samples = np.hstack([np.cos(turn), np.sin(turn)])
    return pk.Problem(rates, parameters=parameters, grid=axis), samples, period


def decays(m, k, b):
    """The rates at which waves on its uniform oscillation grow: exact, of the discrete equation."""
    decay = 0.01 * (2.0 * m * np.sin(0.5 * k * np.pi / m)) ** 2
    return np.linalg.eigvals([[-2.0 - decay, b * decay], [4.0 - b * decay, -decay]])


@pytest.mark.slow
def test_orbits_of_many_states_have_exact_multipliers_and_branch_points(monkeypatch):
    """By sparse equations, which are applied and never formed."""
    monkeypatch.setattr("phasekit.cycles.cycles.FORMED", 50)
    m, b = 30, 0.525
    problem, samples, period = ginzburg_landau(m, b)
    options = pk.ContinuationOptions(
        intervals=10, directions="forward", initial_step=0.4, max_step=0.4
    )
    orbit = pk.periodic_orbit(problem, samples, period=period, options=options)
    assert float(orbit.period) == pytest.approx(period, rel=1e-8)
    exact = np.exp(period * np.concatenate([decays(m, k, b) for k in range(8)]))
    exact = np.sort(exact[exact > 0.05])[::-1]
    assert len(exact) == 6
    assert orbit.multiplier.values[:6] == pytest.approx(exact, abs=1e-8)
    assert int(orbit.n_unstable) == 0
    family = pk.continuation(problem, "b", orbit=orbit, span=(b, 0.54), options=options)
    (point,) = family.special("cycle_branch_point")
    decay = 0.01 * (2.0 * m * np.sin(0.5 * np.pi / m)) ** 2
    lost = np.min(np.roots([decay, -4.0, 2.0 + decay]))  # where the first wave is neutral
    assert point["b"] == pytest.approx(lost, abs=5e-8)
    assert family.points.n_unstable.values[-1] == 1
    near = np.array([[decays(m, 1, lost + side).real.max() for side in (-1e-5, 1e-5)]])
    assert point.normal_form["d"] == pytest.approx(np.diff(near)[0, 0] / 2e-5, rel=1e-7)
    monkeypatch.setattr("phasekit.numerics.memory.available_memory", lambda: 10**6)
    with pytest.raises(pk.ParameterError, match="one of fewer states; linear equations"):
        point.curve("c", (-2.1, -1.9))


def test_multipliers_where_intervals_resolve_some_decays_only():
    """Their errors hide nothing: others are found by a scheme that damps them."""
    problem, samples, period = ginzburg_landau(20, 0.525)
    options = pk.ContinuationOptions(intervals=10)
    orbit = pk.periodic_orbit(problem, samples, period=period, options=options)
    exact = np.exp(period * np.concatenate([decays(20, k, 0.525) for k in range(8)]))
    exact = np.sort(exact[exact > 0.05])[::-1]
    assert orbit.multiplier.values[:6] == pytest.approx(exact, abs=1e-7)
    assert int(orbit.n_unstable) == 0


def in_cells(rates, parameters, cells, samples):
    """A system of few states in cells that diffuse, all alike at first: its orbits are theirs."""
    rates = {name: f"{rate} + D*lap({name})" for name, rate in rates.items()}
    axis = pk.grid("x", 0.0, 1.0, cells, boundary="neumann")
    problem = pk.Problem(rates, parameters=parameters | {"D": 0.1}, grid=axis)
    return problem, np.repeat(samples, cells, axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("formed", [50, 300])
def test_folds_of_sparse_orbits_are_exact(monkeypatch, formed):
    """Of r' = r (b + r^2 - r^4) in cells, by both ways to their equations."""
    monkeypatch.setattr("phasekit.cycles.cycles.FORMED", formed)
    b, square = -0.2497, "(u^2 + v^2)"
    growth = f"(b + {square} - {square}^2)"
    rates = {"u": f"u*{growth} - v*(1 + 0.3*{square})", "v": f"v*{growth} + u*(1 + 0.3*{square})"}
    size = 0.5 * (1.0 + np.sqrt(1.0 + 4.0 * b))
    turn = np.linspace(0.0, 2.0 * np.pi, 33)[:, None]
    circle = np.sqrt(size) * np.hstack([np.cos(turn), np.sin(turn)])
    problem, samples = in_cells(rates, {"b": b}, 26, circle)
    period = 2.0 * np.pi / (1.0 + 0.3 * size)
    options = pk.ContinuationOptions(
        directions="backward", intervals=8, max_points=3, initial_step=0.3, max_step=0.3
    )
    orbit = pk.periodic_orbit(problem, samples, period=period, options=options)
    assert float(orbit.period) == pytest.approx(period, rel=1e-8)
    family = pk.continuation(problem, "b", orbit=orbit, span=(-0.3, -0.2), options=options)
    (fold,) = family.special("fold_of_cycles")
    assert fold["b"] == pytest.approx(-0.25, abs=1e-10)
    assert float(fold.orbit.period) == pytest.approx(2.0 * np.pi / 1.15, rel=1e-8)
    assert family.points.n_unstable.values[[0, -1]].tolist() == [1, 0]
    for k in (0, -1):
        b = float(family.points.b[k])
        size = 0.5 * (1.0 + (1.0 if k else -1.0) * np.sqrt(1.0 + 4.0 * b))
        radial = np.exp(float(family.points.period[k]) * 2.0 * size * (1.0 - 2.0 * size))
        off = np.abs(family.points.multiplier.values[k] - radial)
        assert np.nanmin(off) < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("formed", [50, 300])
def test_period_doublings_of_sparse_orbits_are_those_of_a_cell(monkeypatch, formed):
    """Of Roessler's equations in cells, where they double together and decays are fast."""
    monkeypatch.setattr("phasekit.cycles.cycles.FORMED", formed)
    rates = {"X": "-Y - Z", "Y": "X + a*Y", "Z": "a + Z*(X - c)"}
    one = pk.Problem(["-y - z", "x + a*y", "a + z*(x - c)"], ("x", "y", "z"), {"a": 0.2, "c": 2.8})
    cell = pk.periodic_orbit(one, [3.0, 0.0, 0.1], settle=100.0)
    samples = np.stack([cell[name].values for name in "xyz"], axis=1)
    problem, samples = in_cells(rates, {"a": 0.2, "c": 2.8}, 18, samples)
    options = pk.ContinuationOptions(
        directions="forward", intervals=24, max_points=2, initial_step=0.1, max_step=0.1
    )
    orbit = pk.periodic_orbit(problem, samples, period=float(cell.period), options=options)
    assert orbit.multiplier.values[:2] == pytest.approx(cell.multiplier.values[:2], abs=1e-6)
    family = pk.continuation(problem, "c", orbit=orbit, span=(2.8, 3.4), options=options)
    (doubling,) = family.special("period_doubling")
    assert doubling["c"] == pytest.approx(2.832445027862, rel=1e-7)
    assert family.points.n_unstable.values[[0, -1]].tolist() == [0, 1]


def test_growth_that_no_mesh_resolves_is_announced(monkeypatch):
    """A field beside an oscillation that grows far faster than on intervals is no decay."""
    rates = {"u": "u*(1 - u^2 - v^2) - v", "v": "v*(1 - u^2 - v^2) + u", "w": "g*w"}
    turn = np.linspace(0.0, 2.0 * np.pi, 33)[:, None]
    circle = np.hstack([np.cos(turn), np.sin(turn), 0.0 * turn])
    monkeypatch.setattr("phasekit.cycles.cycles.FORMED", 50)
    problem, samples = in_cells(rates, {"g": 100.0}, 18, circle)
    options = pk.ContinuationOptions(intervals=10)
    orbit = pk.periodic_orbit(problem, samples, period=2.0 * np.pi, options=options)
    assert int(orbit.n_unstable) == -1
